//! Fits of systems made by hand and of measured machines.
#![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]

mod axes;
mod emps;
mod exact;
mod measured;
mod noise;
mod order;
mod rigid;
mod wild;

use experiment_data::Bundle;
use lpv_core::nalgebra::{DMatrix, DVector};
use lpv_core::{Discrete, Purpose, Record, RecordKind, Signals, StateSpace};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::path::Path;

pub(crate) fn shared(name: &str) -> Option<Bundle> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../../shared/data")
        .join(name);
    if !folder.exists() {
        println!("skipped: {} is not there", folder.display());
        return None;
    }
    Some(Bundle::open(&folder).unwrap())
}

/// Standard normal numbers.
pub(crate) fn normal(rows: usize, columns: usize, seed: u64) -> DMatrix<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    DMatrix::from_fn(rows, columns, |_, _| StandardNormal.sample(&mut rng))
}

fn signals(name: &str, m: &DMatrix<f64>) -> Signals {
    Signals {
        names: (0..m.nrows()).map(|i| format!("{name}{i}")).collect(),
        units: Vec::new(),
        columns: m.row_iter().map(|r| r.iter().copied().collect()).collect(),
    }
}

pub(crate) fn record(u: &DMatrix<f64>, y: &DMatrix<f64>) -> Record {
    Record {
        name: "made".into(),
        kind: RecordKind::Transient,
        purpose: Purpose::Estimation,
        position: None,
        outputs: signals("y", y),
        inputs: signals("u", u),
        references: Signals::default(),
        scheduling: Signals::default(),
        auxiliary: Signals::default(),
        injection: Signals::default(),
    }
}

/// Two modes and a direct term, two inputs, two outputs.
pub(crate) fn plant() -> StateSpace<Discrete> {
    let mode = |r: f64, w: f64| [r * w.cos(), r * w.sin()];
    let ([a, b], [c, d]) = (mode(0.97, 0.3), mode(0.93, 1.1));
    #[rustfmt::skip]
    let a = DMatrix::from_row_slice(4, 4, &[a, b, 0., 0., -b, a, 0., 0., 0., 0., c, d, 0., 0., -d, c]);
    let b = DMatrix::from_row_slice(4, 2, &[1.0, 0.2, 0.0, 0.5, 0.3, -1.0, 0.6, 0.0]);
    let c = DMatrix::from_row_slice(2, 4, &[0.5, 0.1, 1.0, 0.0, -0.3, 0.8, 0.2, 0.4]);
    let d = DMatrix::from_row_slice(2, 2, &[0.3, 0.0, 0.0, -0.2]);
    StateSpace::new(a, b, c, d, Discrete::new(0.1).unwrap()).unwrap()
}

/// The plant under white noise from a state of its own, with white noise of a size on the outputs.
pub(crate) fn run(samples: usize, size: f64, seed: u64) -> Record {
    let u = normal(2, samples, seed);
    let x = DVector::from_column_slice(normal(4, 1, seed + 1000).as_slice());
    let y = plant().simulate(&x, &u).unwrap().outputs + normal(2, samples, seed + 2000) * size;
    record(&u, &y)
}

/// Largest error of the response over the largest response.
pub(crate) fn response_error(model: &StateSpace<Discrete>, truth: &StateSpace<Discrete>) -> f64 {
    let nyquist = 0.5 / truth.clock().sample_time();
    let lines: Vec<f64> = (1..200).map(|k| nyquist * f64::from(k) / 200.0).collect();
    let (found, truth) = (
        model.frequency_response(&lines).unwrap(),
        truth.frequency_response(&lines).unwrap(),
    );
    let largest = (0..lines.len()).map(|k| truth.line(k).norm()).fold(0.0, f64::max);
    (0..lines.len())
        .map(|k| (found.line(k) - truth.line(k)).norm())
        .fold(0.0, f64::max)
        / largest
}
