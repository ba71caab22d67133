//! A two-mode filter bank with coefficients quadratic in p, realised as an LFR.

use lpv_core::nalgebra::{DMatrix, dmatrix};
use lpv_core::{Discrete, MatrixFunction, SchedulingRange, SeriesExpansion, StateSpace};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let clock = Discrete::from_rate(20.0)?;
    let bank = StateSpace::new(
        dmatrix![0.9, -0.4; 0.4, 0.9],
        dmatrix![1.0; 0.0],
        DMatrix::identity(2, 2),
        DMatrix::zeros(2, 1),
        clock,
    )?;
    let rigid = StateSpace::new(
        dmatrix![1.0, 1.0; 0.0, 1.0],
        dmatrix![1.0; 2.0],
        dmatrix![1.0, 0.0],
        dmatrix![0.0],
        clock,
    )?;
    let weights =
        MatrixFunction::polynomial(vec![dmatrix![1.0, 0.5], dmatrix![0.0, 0.3], dmatrix![0.2, 0.1]])?;
    let none = MatrixFunction::constant(DMatrix::zeros(1, 1))?;
    let series = SeriesExpansion::new(rigid, bank, none, weights, SchedulingRange::interval(-0.3, 0.3)?)?;
    let made = lfr_realize::realize(&series)?;
    println!(
        "{} states, {} deltas, {:?}",
        made.lfr.states(),
        made.lfr.delta_count(),
        made.well_posedness
    );
    let difference = made.largest_difference(&[-0.3, -0.1, 0.2], &[0.1, 1.0, 5.0])?;
    println!("largest relative difference of the frozen responses: {difference:.1e}");
    Ok(())
}
