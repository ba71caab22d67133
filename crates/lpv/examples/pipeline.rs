//! The pipeline on responses that a program has at hand: a mode that moves with p, at nine positions.

use lpv::{Identified, IdentifyConfig, identify};
use lpv_core::nalgebra::dmatrix;
use lpv_core::{Discrete, FrfEstimate, StateSpace};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let clock = Discrete::from_rate(20.0)?;
    let frequencies: Vec<f64> = (1..400).map(|k| 0.0249 * f64::from(k)).collect();
    let estimates = (0..9)
        .map(|i| {
            let p = -1.0 + 0.25 * f64::from(i);
            let (s, c) = (0.5 + 0.05 * p).sin_cos();
            let machine = StateSpace::new(
                dmatrix![c, -s; s, c] * 0.97,
                dmatrix![1.0; 0.0],
                dmatrix![0.0, 1.0 + 0.2 * p],
                dmatrix![0.0],
                clock,
            )?;
            FrfEstimate::with_unit_covariance(machine.frequency_response(&frequencies)?, Some(p.into()))
        })
        .collect::<Result<Vec<_>, _>>()?;
    let config = IdentifyConfig {
        order: Some(2),
        integrators: Some(0),
        functions: Some(8),
        ..IdentifyConfig::default()
    };
    let identified = identify(
        &estimates,
        clock,
        &lpv::Moves::none("none were measured"),
        &config,
        &lpv::silent,
    )?;
    for reason in identified.reasons() {
        println!("- {reason}");
    }
    if let Identified::Lpv(stage) = &identified {
        let truth = estimates[4].frf();
        let error = stage
            .model
            .response(&[0.0], &frequencies)?
            .relative_error(truth)?;
        println!(
            "largest relative error at p = 0: {:.1e}",
            error.into_iter().fold(0.0, f64::max)
        );
    }
    Ok(())
}
