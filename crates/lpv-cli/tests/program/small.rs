//! Files of a small continuous-time LFR: its uncertainty, its page, and what other programs make of it.

use crate::common::{Desk, MACHINE};
use crate::python::{close, flat, numbers, python_has};
use lpv_core::nalgebra::{DMatrix, dmatrix};
use lpv_core::{Continuous, DeltaBlock, Discrete, Lfr, LfrBlocks, Model, SchedulingRange};
use serde_json::{Value, json};

const SAMPLE_TIME: f64 = 0.05;
const POSITIONS: [f64; 3] = [-0.3, 0.05, 0.4];
const LINES: [f64; 5] = [0.01, 0.1, 1.0, 2.1, 9.0];

/// Two carriages with integrators, joined by a mode whose shape and frequency depend on p; two deltas.
fn machine() -> Lfr<Continuous> {
    let mut a = DMatrix::zeros(6, 6);
    a[(0, 1)] = 1.0;
    a[(2, 3)] = 1.0;
    a.view_mut((4, 4), (2, 2))
        .copy_from(&dmatrix![0.0, 12.0; -12.0, -0.3]);
    let blocks = LfrBlocks {
        a,
        b1: dmatrix![0.0, 0.0; 0.0, 0.0; 0.0, 0.0; 0.0, 0.0; 0.0, 0.0; 1.0, 0.4],
        b2: dmatrix![0.0, 0.0; 1.0, 0.1; 0.0, 0.0; 0.1, 1.0 / 3.0; 0.0, 0.0; 0.7, -0.2],
        c1: dmatrix![0.0, 0.0, 0.0, 0.0, 1.5, 0.0; 0.0, 0.0, 0.0, 0.0, 0.3, 0.1],
        d11: dmatrix![0.1, -0.2; 0.0, 0.15],
        d12: dmatrix![0.0, 0.05; 0.3, 0.0],
        c2: dmatrix![1.0, 0.0, 0.0, 0.0, 0.05, 0.0; 0.0, 0.0, 1.0, 0.0, -0.02, 0.0],
        d21: dmatrix![0.01, 0.0; 0.0, 0.003],
        d22: DMatrix::zeros(2, 2),
    };
    let deltas = vec![DeltaBlock {
        parameter: 0,
        repetitions: 2,
    }];
    let range = SchedulingRange::interval(POSITIONS[0], POSITIONS[2]).unwrap();
    Lfr::new(blocks, deltas, range, Continuous).unwrap()
}

/// A table over positions, lines, outputs and inputs, each entry the same part of the size of the response.
fn table(part: f64) -> Value {
    let clock = Discrete::new(SAMPLE_TIME).unwrap();
    let at = |p: f64| {
        let frozen = machine().frozen(&[p]).unwrap().zero_order_hold(clock).unwrap();
        let frf = frozen.frequency_response(&LINES).unwrap();
        let line = |k: usize| {
            let size = |i: usize, j: usize| part * frf.line(k)[(i, j)].norm();
            json!([[size(0, 0), size(0, 1)], [size(1, 0), size(1, 1)]])
        };
        (0..LINES.len()).map(line).collect::<Vec<_>>()
    };
    json!(POSITIONS.map(at))
}

/// The file of a fit, as `identify` writes it.
fn file() -> Value {
    let mut whole: Value = serde_json::from_str(&Model::ContinuousLfr(machine()).to_json().unwrap()).unwrap();
    let frozen =
        json!({"strict_max_db": -20.0, "median_db": -40.0, "worst_frequency_hz": 1.0, "worst_response": 0});
    let mode = [[2.03, 0.012]];
    whole["identification"] = json!({
        "bundle": "table",
        "folder": "nowhere",
        "outputs": ["y1", "y2"],
        "inputs": ["u1", "u2"],
        "config": {"lfr": "small"},
        "sample_time": SAMPLE_TIME,
        "frozen_deviation": {
            "positions": POSITIONS,
            "frequencies_hz": LINES,
            "in_phase": table(0.1),
            "quadrature": table(0.2),
        },
        "summary": {
            "model": "continuous LFR",
            "positions": 3,
            "lines": 100,
            "frf_noise_percent": 1.0,
            "frf_noise_by_output_percent": [1.0, 1.0],
            "order": 6,
            "integrators": 2,
            "modes": mode,
            "resonance_hz": 2.03,
            "frozen": frozen,
            "relative_rms_percent": [1.0, 1.0],
            "cost_over_expected": 1.0,
            "error_over_noise": 0.9,
            "frf_noise_db": -40.0,
            "lpv": {
                "positions": POSITIONS,
                "modes": [mode, mode, mode],
                "functions": 8,
                "interpolation": "polynomial of order 2",
                "leave_one_out": [],
                "lfr": [6, 2],
                "small": {"sizes": [
                    {"states": 6, "deltas": 1, "residual": 17.25, "starts": 3},
                    {"states": 6, "deltas": 2, "residual": 1.023, "starts": 1},
                ]},
            },
            "reasons": ["small LFR: chosen by hand"],
        },
    });
    whole
}

fn page(desk: &Desk, file: &Value) -> String {
    desk.write("model.json", file.to_string());
    desk.done("report model.json -o page.html");
    desk.text("page.html")
}

/// The filled areas with the tint of a band.
fn bands(page: &str) -> Vec<&str> {
    page.match_indices("<path")
        .map(|(at, _)| page[at..].split('>').next().unwrap_or_default())
        .filter(|path| path.contains("fill-opacity"))
        .collect()
}

#[test]
fn the_page_shows_sizes_uncertainty_and_what_p_may_do() {
    let desk = Desk::new();
    let whole = page(&desk, &file());
    for part in [
        "Small LFR",
        "17.25",
        "1.023",
        "rms residual over the noise",
        "two standard deviations",
        "deviation of the model",
        "known for slow p only",
        "2.030 Hz",
        "p = -0.3000",
    ] {
        assert!(whole.contains(part), "{part} is not on the page");
    }
    assert!(!whole.contains("poles of its basis") && !whole.contains("error over the noise"));

    // Three bands a channel in both figures, and one sample in the legend of each.
    assert!(bands(&whole).len() >= 2 * (3 * 4 + 1), "{}", bands(&whole).len());
    let mut without = file();
    without["identification"]
        .as_object_mut()
        .unwrap()
        .remove("frozen_deviation");
    let bare = page(&desk, &without);
    assert!(bands(&bare).is_empty() && !bare.contains("two standard deviations"));
    assert!(bare.contains("relative rms residual"));

    let mut moved = file();
    moved["identification"]["summary"]["lpv"]["small"]["moving"] = json!({
        "deltas": [1, 0, 1], "over_noise": [88.5, 1.31, 1.044], "frozen_residual": 1.031,
    });
    let moved = page(&desk, &moved);
    for part in [
        "88.50",
        "1.310",
        "1.044",
        "1.031",
        "parameter-independent coordinates",
    ] {
        assert!(moved.contains(part), "{part} is not on the page");
    }
    assert!(!moved.contains("known for slow p only"));
}

/// A page without the drawings that a narrow screen shows instead.
fn on_a_wide_screen(page: &str) -> String {
    let mut parts = page.split("<div class=\"drawing narrow\">");
    let first = parts.next().unwrap().to_owned();
    parts.fold(first, |wide, part| wide + part.split_once("</svg>").unwrap().1)
}

/// Heights of the bands at their left end, px: the outline runs out along the upper edge and back along the lower one.
fn heights(page: &str) -> Vec<f64> {
    let height = |path: &&str| {
        let data = path.split(" d=\"").nth(1).unwrap().split('"').next().unwrap();
        let spaced = data.replace('-', " -").replace(['M', 'l', ',', 'z'], " ");
        let steps: Vec<f64> = spaced.split_whitespace().map(|v| v.parse().unwrap()).collect();
        // The first pair is a place, the others are steps.
        steps.chunks(2).skip(1).map(|step| step[1]).sum()
    };
    bands(page).iter().map(height).collect()
}

/// At 0.2 rad across the response, two deviations of the phase on either side are 0.8 rad of the 360 degrees of the
/// panel; at 10 % along it, all bands of the magnitude are as high.
#[test]
fn a_band_is_two_deviations_on_either_side() {
    let desk = Desk::new();
    let whole = on_a_wide_screen(&page(&desk, &file()));
    let phases = whole
        .split("<svg")
        .filter(|svg| !bands(svg).is_empty())
        .last()
        .unwrap();
    let plot: f64 = phases
        .split("<clipPath")
        .nth(1)
        .and_then(|clip| clip.split("height=\"").nth(1)?.split('"').next())
        .unwrap()
        .parse()
        .unwrap();
    let heights = heights(&whole);
    // The sample of the legend comes first in a figure.
    let (magnitude, phase) = (&heights[1..13], &heights[14..]);
    for pair in magnitude.chunks(3) {
        assert!(
            pair.iter().all(|h| (h - pair[0]).abs() < 0.3 && *h > 1.0),
            "{pair:?}"
        );
    }
    let expected = plot * 0.8 / std::f64::consts::TAU;
    assert!(phase.len() >= 12, "{}", phase.len());
    // A band that begins where the phase is steep is higher within the width of its first line.
    assert!(
        phase.iter().all(|h| *h > expected - 0.3),
        "{phase:?} for {expected}"
    );
    let flat = phase.iter().filter(|h| (*h - expected).abs() < 0.3).count();
    assert!(flat >= 12, "{phase:?} for {expected}");
}

#[test]
fn files_without_the_newer_parts_and_with_a_damaged_table_are_read() {
    let desk = Desk::new();
    let mut old = file();
    let account = old["identification"].as_object_mut().unwrap();
    account.remove("frozen_deviation");
    account.remove("sample_time");
    account["config"] = json!({});
    let lpv = account["summary"]["lpv"].as_object_mut().unwrap();
    lpv.remove("small");
    assert!(page(&desk, &old).contains("Frequency responses"));
    desk.done("convert model.json --to json -o copy.json");
    let copy: Value = serde_json::from_str(&desk.text("copy.json")).unwrap();
    assert!(copy["identification"].get("frozen_deviation").is_none());

    // What a hand has cut off is not drawn.
    let mut cut = file();
    cut["identification"]["frozen_deviation"]["in_phase"] = json!([[[[0.1]]]]);
    assert!(page(&desk, &cut).contains("Frequency responses"));
    let mut none = file();
    for key in ["positions", "frequencies_hz", "in_phase", "quadrature"] {
        none["identification"]["frozen_deviation"][key] = json!([]);
    }
    assert!(page(&desk, &none).contains("Frequency responses"));
}

/// Real and imaginary parts of the frozen responses of the program, by position.
fn responses(sample_time: f64) -> Vec<f64> {
    let clock = Discrete::new(sample_time).unwrap();
    let at = |p: f64| {
        let frozen = machine().frozen(&[p]).unwrap().zero_order_hold(clock).unwrap();
        flat(&frozen.frequency_response(&LINES).unwrap())
    };
    POSITIONS.into_iter().flat_map(at).collect()
}

/// The module in python-control, held at the sample time of the records and at another; line by line, since integrators
/// make low lines large.
#[test]
fn python_control_holds_the_input_as_the_program_does() {
    if !python_has("control, numpy, scipy") {
        return;
    }
    let desk = Desk::new();
    desk.write("model.json", file().to_string());
    desk.done("convert model.json --to python");
    let text = desk.text("model.py");
    assert!(text.contains("delta = (p - centre) / half_width"));
    let script = r#"
import numpy as np
import model as m

assert m.dt == 0 and m.frozen(0.05).dt == 0 and m.sampled(0.05).dt == 0.05
assert m.sampled(0.05).input_labels == ["u1", "u2"], m.sampled(0.05)
for Ts in [None, 0.01]:
    for p in [-0.3, 0.05, 0.4]:
        for f in [0.01, 0.1, 1.0, 2.1, 9.0]:
            for g in m.sampled(p, Ts)(np.exp(2j * np.pi * f * (Ts or 0.05))).ravel():
                print(repr(float(g.real)), repr(float(g.imag)))
"#;
    let found = numbers(&desk, script);
    let expected: Vec<f64> = [SAMPLE_TIME, 0.01].into_iter().flat_map(responses).collect();
    assert_eq!(found.len(), expected.len());
    // Four channels, two parts.
    for (found, expected) in found.chunks(8).zip(expected.chunks(8)) {
        close(found, expected);
    }
    // Without the account the sample time must be given.
    desk.write_model("model.json", &Model::ContinuousLfr(machine()));
    desk.done("convert model.json --to python");
    let script = r#"
import model as m

try:
    m.sampled(0.05)
except ValueError as e:
    assert "give Ts" in str(e), e
    print(m.sampled(0.05, 0.25).dt)
"#;
    assert_eq!(numbers(&desk, script), [0.25]);
}

#[test]
fn no_bit_changes_by_way_of_other_formats() {
    let desk = Desk::new();
    desk.write("model.json", file().to_string());
    for format in ["mat", "csv"] {
        desk.done(&format!("convert model.json --to {format} -o there.{format}"));
        desk.done(&format!("convert there.{format} --to json -o back.json"));
        let Model::ContinuousLfr(back) = desk.model("back.json") else {
            panic!("another kind by {format}");
        };
        assert_eq!(back, machine(), "{format}");
    }
    let text = desk.text("there.csv");
    assert!(
        text.contains("delta = (p - centre) / half_width") && text.contains("record_sample_time,,1,1,0.05")
    );
    // The program's own format keeps the account.
    desk.done("convert model.json --to json -o copy.json");
    let copy: Value = serde_json::from_str(&desk.text("copy.json")).unwrap();
    assert_eq!(
        copy["identification"]["frozen_deviation"],
        file()["identification"]["frozen_deviation"]
    );
    assert_eq!(copy["identification"]["sample_time"], SAMPLE_TIME);
}

/// Another program closes the loop of the matrices in a MAT file itself, as the note beside them says.
#[test]
fn a_mat_file_says_how_its_deltas_are_normalised() {
    if !python_has("scipy.io, numpy") {
        return;
    }
    let desk = Desk::new();
    desk.write("model.json", file().to_string());
    desk.done("convert model.json --to mat --points 3");
    let script = r#"
import numpy as np
from scipy.io import loadmat
from scipy.signal import cont2discrete

m = loadmat("model.mat", squeeze_me=False, struct_as_record=False)["lpv"][0, 0]
assert "dx/dt" in m.note[0] and "delta = (p - centre) / half_width" in m.note[0], m.note
assert m.Ts[0, 0] == 0 and m.record_sample_time[0, 0] == 0.05
low, high = m.range[0]
centre, half_width = (low + high) / 2, (high - low) / 2
for p in [-0.3, 0.05, 0.4]:
    delta = (p - centre) / half_width
    d = np.diag(np.concatenate([np.full(int(n), delta) for _, n in m.deltas]))
    k = d @ np.linalg.inv(np.eye(len(d)) - m.D11 @ d)
    a, b = m.A + m.B1 @ k @ m.C1, m.B2 + m.B1 @ k @ m.D12
    c, e = m.C2 + m.D21 @ k @ m.C1, m.D22 + m.D21 @ k @ m.D12
    a, b, c, e, _ = cont2discrete((a, b, c, e), 0.05)
    for f in [0.01, 0.1, 1.0, 2.1, 9.0]:
        z = np.exp(2j * np.pi * f * 0.05)
        for v in (c @ np.linalg.solve(z * np.eye(len(a)) - a, b) + e).ravel():
            print(repr(float(v.real)), repr(float(v.imag)))
"#;
    let found = numbers(&desk, script);
    let expected = responses(SAMPLE_TIME);
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.chunks(8).zip(expected.chunks(8)) {
        close(found, expected);
    }
}

/// The model file of a small simulated machine at rest, with noise of its own.
fn identified(desk: &Desk, seed: usize) -> (Lfr<Continuous>, Value) {
    let machine = MACHINE
        .replace("seed = 11", &format!("seed = {seed}"))
        .replace("estimation = 1", "estimation = 0");
    desk.write("machine.toml", machine);
    desk.done(&format!("simulate --machine machine.toml -o bundle{seed}"));
    desk.write("small.toml", "lfr = \"small\"\n");
    desk.done(&format!(
        "identify bundle{seed} -o {seed}.json --config small.toml"
    ));
    let Model::ContinuousLfr(lfr) = desk.model(&format!("{seed}.json")) else {
        panic!("no small LFR");
    };
    let whole: Value = serde_json::from_str(&desk.text(&format!("{seed}.json"))).unwrap();
    (lfr, whole["identification"].clone())
}

/// Two models of one machine, from records with other noise, differ by what their files say, in every channel.
#[test]
fn the_deviation_in_the_file_is_the_scatter_of_models() {
    let desk = Desk::new();
    let (one, account) = identified(&desk, 21);
    let (other, _) = identified(&desk, 23);
    let clock = Discrete::new(account["sample_time"].as_f64().unwrap()).unwrap();
    let table = &account["frozen_deviation"];
    let list = |key: &str| -> Vec<f64> { serde_json::from_value(table[key].clone()).unwrap() };
    let (positions, lines) = (list("positions"), list("frequencies_hz"));
    assert_eq!(positions.len(), 5);
    assert!(lines.len() > 30 && lines.len() <= 60, "{}", lines.len());
    let mut ratios = DMatrix::<f64>::zeros(2, 2);
    for (n, &p) in positions.iter().enumerate() {
        let response = |m: &Lfr<Continuous>| {
            let held = m.frozen(&[p]).unwrap().zero_order_hold(clock).unwrap();
            held.frequency_response(&lines).unwrap()
        };
        let (f, g) = (response(&one), response(&other));
        for k in 0..lines.len() {
            let entry = |key: &str, i: usize, j: usize| table[key][n][k][i][j].as_f64().unwrap();
            ratios += DMatrix::from_fn(2, 2, |i, j| {
                // Both models have noise.
                let variance = 2.0 * (entry("in_phase", i, j).powi(2) + entry("quadrature", i, j).powi(2));
                (f.line(k)[(i, j)] - g.line(k)[(i, j)]).norm_sqr() / variance
            });
        }
    }
    // Neighbouring lines err together, so that the mean of a channel counts few errors.
    let ratios = (ratios / (positions.len() * lines.len()) as f64).map(f64::sqrt);
    assert!(ratios.iter().all(|r| (0.25..4.0).contains(r)), "{ratios}");
}
