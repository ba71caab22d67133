//! What `lpv convert` writes for Python and MATLAB, read there.

use crate::common::Desk;
use crate::convert::{clock, lfr};
use lpv_core::{Clock, Frf, Lfr, Model, StateSpace};
use std::process::Command;

const LINES: [f64; 4] = [0.1, 1.0, 5.0, 14.0];

/// Whether Python has these modules; else the test says that it is skipped.
pub(crate) fn python_has(modules: &str) -> bool {
    let found = Command::new("python3")
        .args(["-c", &format!("import {modules}")])
        .output();
    let there = found.is_ok_and(|o| o.status.success());
    if !there {
        eprintln!("skipped: python3 without {modules}");
    }
    there
}

/// Numbers that a script prints, one a line.
pub(crate) fn numbers(desk: &Desk, script: &str) -> Vec<f64> {
    desk.write("script.py", script);
    let out = Command::new("python3")
        .args(["-B", "script.py"])
        .current_dir(desk.path("."))
        .output()
        .unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let text = String::from_utf8(out.stdout).unwrap();
    text.split_whitespace().map(|v| v.parse().unwrap()).collect()
}

/// Real and imaginary parts by line, output, input.
pub(crate) fn flat(frf: &Frf) -> Vec<f64> {
    let mut all = Vec::new();
    for k in 0..frf.len() {
        let line = frf.line(k);
        for i in 0..frf.outputs() {
            for j in 0..frf.inputs() {
                all.extend([line[(i, j)].re, line[(i, j)].im]);
            }
        }
    }
    all
}

pub(crate) fn close(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    let size = expected.iter().map(|v| v.abs()).fold(0.0, f64::max);
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() < 1e-9 * size, "{a} for {b}");
    }
}

fn frozen<K: Clock>(lfr: &Lfr<K>, points: usize) -> Vec<f64> {
    let at = |p: &Vec<f64>| -> StateSpace<K> { lfr.frozen(p).unwrap() };
    let grid = lfr.range().grid(points);
    grid.iter()
        .flat_map(|p| flat(&at(p).frequency_response(&LINES).unwrap()))
        .collect()
}

/// Prints the responses of the module's models.
const RESPONSES: &str = r#"
import numpy as np
import model as m

for s in m.models:
    for f in [0.1, 1.0, 5.0, 14.0]:
        s_or_z = np.exp(2j * np.pi * f * m.dt) if m.dt > 0 else 2j * np.pi * f
        for g in np.atleast_2d(s(s_or_z)).ravel():
            print(repr(float(g.real)), repr(float(g.imag)))
"#;

#[test]
fn python_control_has_the_same_frozen_responses() {
    if !python_has("control, numpy") {
        return;
    }
    let discrete = lfr(clock(), 1.0);
    let continuous = lfr(lpv_core::Continuous, -1.0);
    for (model, expected) in [
        (Model::DiscreteLfr(discrete.clone()), frozen(&discrete, 3)),
        (Model::ContinuousLfr(continuous.clone()), frozen(&continuous, 3)),
    ] {
        let desk = Desk::new();
        desk.write_model("model.json", &model);
        desk.done("convert model.json --to python --points 3");
        close(&numbers(&desk, RESPONSES), &expected);
    }
    // A polynomial LPV model has frozen systems on the grid only.
    let desk = Desk::new();
    desk.write_model("model.json", &Model::DiscreteLpv(polynomial()));
    desk.done("convert model.json --to python --points 5");
    let grid = polynomial().range().grid(5);
    let at = |p: &Vec<f64>| {
        flat(
            &polynomial()
                .frozen(p)
                .unwrap()
                .frequency_response(&LINES)
                .unwrap(),
        )
    };
    close(
        &numbers(&desk, RESPONSES),
        &grid.iter().flat_map(at).collect::<Vec<f64>>(),
    );
}

fn polynomial() -> lpv_core::LpvStateSpace<lpv_core::Discrete> {
    use lpv_core::nalgebra::dmatrix;
    use lpv_core::{LpvStateSpace, MatrixFunction, SchedulingRange};
    let constant = |m| MatrixFunction::constant(m).unwrap();
    LpvStateSpace::new(
        MatrixFunction::polynomial(vec![dmatrix![0.5, 0.2; -0.2, 0.5], dmatrix![0.1, 0.0; 0.3, 0.0]])
            .unwrap(),
        constant(dmatrix![1.0; 0.0]),
        constant(dmatrix![0.0, 1.0]),
        constant(dmatrix![0.0]),
        SchedulingRange::interval(-1.0, 1.0).unwrap(),
        clock(),
    )
    .unwrap()
}

#[test]
fn a_time_invariant_model_is_one_python_system() {
    if !python_has("control, numpy") {
        return;
    }
    let desk = Desk::new();
    let model = lfr(clock(), 1.0).frozen(&[0.0, 1.0]).unwrap();
    desk.write_model("model.json", &Model::DiscreteStateSpace(model.clone()));
    desk.done("convert model.json --to python");
    let script = RESPONSES.replace("m.models", "[m.model]");
    close(
        &numbers(&desk, &script),
        &flat(&model.frequency_response(&LINES).unwrap()),
    );
}

/// Prints the scheduling values and the responses of the frozen systems of a MAT file.
const MAT: &str = r#"
import numpy as np
from scipy.io import loadmat

lpv = loadmat("model.mat", squeeze_me=False, struct_as_record=False)["lpv"][0, 0]
assert lpv.kind[0] == "lfr" and lpv.A.shape == (2, 2) and lpv.B1.shape == (2, 3), vars(lpv)
g = lpv.grid[0, 0]
assert g.p.shape == (2, 9) and g.A.shape == (2, 2, 9) and g.B.shape == (2, 1, 9), (g.p.shape, g.A.shape)
for k in range(9):
    a, b, c, d = (m[:, :, k] for m in (g.A, g.B, g.C, g.D))
    for f in [0.1, 1.0, 5.0, 14.0]:
        z = np.exp(2j * np.pi * f * lpv.Ts[0, 0])
        for v in (c @ np.linalg.solve(z * np.eye(2) - a, b) + d).ravel():
            print(repr(float(v.real)), repr(float(v.imag)))
"#;

#[test]
fn a_mat_file_opens_elsewhere_with_the_same_frozen_systems() {
    if !python_has("scipy.io, numpy") {
        return;
    }
    let desk = Desk::new();
    let model = lfr(clock(), 1.0);
    desk.write_model("model.json", &Model::DiscreteLfr(model.clone()));
    desk.done("convert model.json --to mat --points 3");
    close(&numbers(&desk, MAT), &frozen(&model, 3));
}
