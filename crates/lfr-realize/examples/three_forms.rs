//! One mass on a spring whose stiffness moves: LPV model, LFR, frozen responses, and a move of p.
//!
//! `cargo run -p lfr-realize --example three_forms`

use lfr_realize::exact_lfr;
use lpv_core::nalgebra::{DMatrix, DVector, dmatrix};
use lpv_core::{Continuous, Discrete, LpvStateSpace, MatrixFunction, SchedulingRange, WellPosedness};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // q'' + 0.4 q' + (80 + 30 p + 5 p^2) q = u, y = q, for p in [-1, 1].
    let a = vec![
        dmatrix![0.0, 1.0; -80.0, -0.4],
        dmatrix![0.0, 0.0; -30.0, 0.0],
        dmatrix![0.0, 0.0; -5.0, 0.0],
    ];
    let model = LpvStateSpace::new(
        MatrixFunction::polynomial(a)?,
        MatrixFunction::constant(dmatrix![0.0; 1.0])?,
        MatrixFunction::constant(dmatrix![1.0, 0.0])?,
        MatrixFunction::constant(dmatrix![0.0])?,
        SchedulingRange::interval(-1.0, 1.0)?,
        Continuous,
    )?;

    let lfr = exact_lfr(&model)?;
    let verdict = match lfr.well_posedness()? {
        WellPosedness::Proven { margin } => format!("well-posed, margin {margin:.2}"),
        other => format!("{other:?}"),
    };
    println!(
        "LFR: {} states, {} deltas, {verdict}",
        lfr.states(),
        lfr.delta_count()
    );

    println!(
        "{:>6} {:>22} {:>14} {:>14}",
        "p", "upper pole", "|G| at 1.2", "difference"
    );
    for p in [-1.0, -0.5, 0.0, 0.5, 1.0] {
        let (own, through_lfr) = (model.frozen(&[p])?, lfr.frozen(&[p])?);
        let pole =
            own.poles()?
                .into_iter()
                .fold(
                    None,
                    |best: Option<lpv_core::num_complex::Complex<f64>>, pole| match best {
                        Some(b) if b.im >= pole.im => Some(b),
                        _ => Some(pole),
                    },
                );
        let (g, h) = (
            own.frequency_response(&[1.2])?,
            through_lfr.frequency_response(&[1.2])?,
        );
        println!(
            "{p:>6} {:>22} {:>14.6} {:>14.1e}",
            pole.map_or_else(String::new, |z| format!("{z:.4}")),
            g.line(0)[(0, 0)].norm(),
            h.relative_error(&g)?[0],
        );
    }

    // A unit step in u while p runs from one end to the other.
    let samples = 200;
    let p = DMatrix::from_fn(1, samples, |_, k| -1.0 + 2.0 * k as f64 / (samples - 1) as f64);
    let u = DMatrix::from_element(1, samples, 1.0);
    let run = model.simulate_held(&DVector::zeros(2), &u, &p, Discrete::from_rate(20.0)?, 1e-9)?;
    println!(
        "step while p moves: y ends at {:.5}, the static gain there is {:.5}",
        run.outputs[(0, samples - 1)],
        1.0 / 115.0
    );
    Ok(())
}
