//! One mass on a spring whose stiffness moves: its frozen responses, and a move of p.
//!
//! `cargo run -p lpv-core --example frozen_and_moving`

use lpv_core::nalgebra::{DMatrix, DVector, dmatrix};
use lpv_core::{Continuous, CoreError, Discrete, LpvStateSpace, MatrixFunction, SchedulingRange};

fn main() -> Result<(), CoreError> {
    // q'' + 0.4 q' + (80 + 30 p) q = u, y = q, for p in [-1, 1].
    let a = vec![dmatrix![0.0, 1.0; -80.0, -0.4], dmatrix![0.0, 0.0; -30.0, 0.0]];
    let model = LpvStateSpace::new(
        MatrixFunction::polynomial(a)?,
        MatrixFunction::constant(dmatrix![0.0; 1.0])?,
        MatrixFunction::constant(dmatrix![1.0, 0.0])?,
        MatrixFunction::constant(dmatrix![0.0])?,
        SchedulingRange::interval(-1.0, 1.0)?,
        Continuous,
    )?;

    println!("{:>6} {:>16} {:>14}", "p", "resonance, Hz", "|G| at 1.2 Hz");
    for p in [-1.0, -0.5, 0.0, 0.5, 1.0] {
        let frozen = model.frozen(&[p])?;
        let highest = frozen.poles()?.iter().map(|s| s.im).fold(0.0, f64::max);
        let gain = frozen.frequency_response(&[1.2])?.line(0)[(0, 0)].norm();
        println!("{p:>6} {:>16.4} {gain:>14.6}", highest / std::f64::consts::TAU);
    }

    // A unit step in u while p runs from one end to the other.
    let samples = 200;
    let p = DMatrix::from_fn(1, samples, |_, k| -1.0 + 2.0 * k as f64 / (samples - 1) as f64);
    let u = DMatrix::from_element(1, samples, 1.0);
    let run = model.simulate_held(&DVector::zeros(2), &u, &p, Discrete::from_rate(20.0)?, 1e-9)?;
    println!(
        "step while p moves: y ends at {:.5}, the static gain there is {:.5}",
        run.outputs[(0, samples - 1)],
        1.0 / 110.0
    );
    Ok(())
}
