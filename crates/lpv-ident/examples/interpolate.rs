//! A one-mode machine measured at seven positions: regression, leave-one-out, and the error between positions.

use lpv_core::nalgebra::{DMatrix, dmatrix};
use lpv_core::{Discrete, FrfEstimate, StateSpace};
use lpv_ident::{Interpolation, RegressionSettings, Weighting, recommend, regress};

fn machine(p: f64, clock: Discrete) -> Result<StateSpace<Discrete>, lpv_core::CoreError> {
    // A mode whose frequency and gain move with p.
    let (s, c) = (0.5 + 0.1 * p * p).sin_cos();
    StateSpace::new(
        dmatrix![c, -s; s, c] * 0.9,
        dmatrix![1.0; 0.0],
        dmatrix![0.0, 1.0 + p],
        dmatrix![0.0],
        clock,
    )
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let clock = Discrete::new(1.0)?;
    let frequencies: Vec<f64> = (1..200).map(|k| 0.0025 * f64::from(k)).collect();
    let positions: Vec<f64> = (0..7).map(|i| -1.0 + f64::from(i) / 3.0).collect();
    let estimates = positions
        .iter()
        .map(|&p| {
            FrfEstimate::with_unit_covariance(
                machine(p, clock)?.frequency_response(&frequencies)?,
                Some(p.into()),
            )
        })
        .collect::<Result<Vec<_>, _>>()?;
    // Three copies of the middle mode as filters, in series: a crude basis, good enough to see the effect.
    let middle = machine(0.5, clock)?;
    let a = middle.a();
    let zero = DMatrix::zeros(2, 2);
    let b = middle.b();
    let couple = b * dmatrix![0.0, 1.0];
    let bank = StateSpace::new(
        lpv_core::linalg::from_blocks(&[&[a, &zero, &zero], &[&couple, a, &zero], &[&zero, &couple, a]])?,
        lpv_core::linalg::from_blocks(&[&[b], &[&(b * 0.0)], &[&(b * 0.0)]])?,
        DMatrix::identity(6, 6),
        DMatrix::zeros(6, 1),
        clock,
    )?;
    let fits = regress(
        &estimates,
        &bank,
        &RegressionSettings {
            weighting: Weighting::Relative,
            ..RegressionSettings::default()
        },
    )?;
    let candidates: Vec<Interpolation> = (1..=5)
        .map(|order| Interpolation::Polynomial { order })
        .chain([Interpolation::Spline])
        .collect();
    let table = fits.leave_one_out(&candidates)?;
    for row in &table {
        println!(
            "{:22} leave-one-out cost {:.2e}",
            row.interpolation.name(),
            row.cost
        );
    }
    if let Some(best) = recommend(&table, 1.1) {
        let model = fits.interpolate(best.interpolation)?;
        let error = model
            .response(&[0.5], &frequencies)?
            .relative_error(&machine(0.5, clock)?.frequency_response(&frequencies)?)?;
        println!(
            "recommended: {}; largest relative error between positions: {:.2e}",
            best.interpolation.name(),
            error.into_iter().fold(0.0, f64::max)
        );
    }
    Ok(())
}
