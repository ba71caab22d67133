//! A model over a range from models at its positions.

use crate::{IdentError, Interpolation};
use lpv_core::linalg::dimension;
use lpv_core::{Discrete, LpvStateSpace, Position, SchedulingRange, StateSpace, same_clock};
use nalgebra::DMatrix;

/// Interpolates the matrices of models at increasing positions, entry by entry: the local approach.
///
/// `models`: `(p_q, model at p_q)`. What is between the positions depends on the coordinates of the states: these must go
/// along with p, as the sections of a pole fit side by side do while its poles keep their order. Where poles move by many
/// times their width from one position to the next, this needs fewer positions than weights of fixed functions; on a
/// denser grid those have the better conditioned problem, fixed dynamics and an exact LFR ([`crate::regress`]).
///
/// # Errors
/// [`IdentError::Position`] where positions do not increase, [`IdentError::Core`] where models differ in states, channels
/// or clock, and those of [`Interpolation::operator`]. A single position has no range: [`IdentError::TooFewPositions`].
pub fn interpolate_models(
    models: &[(f64, StateSpace<Discrete>)],
    interpolation: Interpolation,
) -> Result<LpvStateSpace<Discrete>, IdentError> {
    let [(lowest, first), .., (highest, _)] = models else {
        return Err(IdentError::TooFewPositions {
            what: "interpolation of models",
            needed: 2,
            found: models.len(),
        });
    };
    for (index, pair) in models.windows(2).enumerate() {
        let increases = pair[0].0 < pair[1].0 && pair[0].0.is_finite() && pair[1].0.is_finite();
        if !increases {
            return Err(IdentError::Position {
                index: index + 1,
                position: pair[1].0.into(),
                problem: "models are given at increasing, finite positions",
            });
        }
        let sizes = |m: &StateSpace<Discrete>| (m.states(), m.outputs(), m.inputs());
        let (a, b) = (sizes(first), sizes(&pair[1].1));
        dimension("interpolation of models: states", a.0, b.0)?;
        dimension("interpolation of models: outputs", a.1, b.1)?;
        dimension("interpolation of models: inputs", a.2, b.2)?;
        same_clock(first.clock(), pair[1].1.clock())?;
    }
    let positions: Vec<Position> = models.iter().map(|(p, _)| (*p).into()).collect();
    let operator = interpolation.operator(&positions)?;
    let over = |part: fn(&StateSpace<Discrete>) -> &DMatrix<f64>| {
        operator.apply(&models.iter().map(|(_, m)| part(m)).collect::<Vec<_>>())
    };
    Ok(LpvStateSpace::new(
        over(StateSpace::a)?,
        over(StateSpace::b)?,
        over(StateSpace::c)?,
        over(StateSpace::d)?,
        SchedulingRange::interval(*lowest, *highest)?,
        first.clock(),
    )?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    /// A resonance whose frequency is `1 + 0.2 p`, damping 0.02, in the coordinates position and velocity.
    fn resonance(p: f64) -> StateSpace<Discrete> {
        let w = 0.4 * (1.0 + 0.2 * p);
        let z = num_complex::Complex::from_polar((-0.02 * w).exp(), w);
        let a = dmatrix![0.0, 1.0; -z.norm_sqr(), 2.0 * z.re];
        let clock = Discrete::new(1.0).unwrap();
        StateSpace::new(
            a,
            dmatrix![0.0; 1.0],
            dmatrix![1.0 + p, 0.0],
            dmatrix![0.0],
            clock,
        )
        .unwrap()
    }

    fn at(positions: &[f64]) -> Vec<(f64, StateSpace<Discrete>)> {
        positions.iter().map(|p| (*p, resonance(*p))).collect()
    }

    /// From one position to the next the resonance moves by 2.5 of its widths; between them its frequency is right to a hundredth of a width.
    #[test]
    fn a_resonance_that_moves_by_many_widths_is_met_between_positions() {
        let positions = [-1.0, -0.5, 0.0, 0.5, 1.0];
        let model = interpolate_models(&at(&positions), Interpolation::Spline).unwrap();
        let lines: Vec<f64> = (1..500).map(|k| 0.001 * f64::from(k)).collect();
        for p in [-0.75, -0.1, 0.25, 0.9] {
            let own = model.frozen(&[p]).unwrap().frequency_response(&lines).unwrap();
            let exact = resonance(p).frequency_response(&lines).unwrap();
            let error = (0..lines.len())
                .map(|k| (own.line(k) - exact.line(k)).norm() / exact.line(k).norm())
                .fold(0.0, f64::max);
            assert!(error < 0.02, "p {p}: {error:e}");
        }
        assert!(model.frozen(&[1.1]).is_err());
    }

    #[test]
    fn what_does_not_fit_together_is_refused() {
        let spline = Interpolation::Spline;
        let few = interpolate_models(&at(&[0.0]), spline).unwrap_err();
        assert!(matches!(few, IdentError::TooFewPositions { found: 1, .. }));
        let order = interpolate_models(&at(&[0.0, 1.0, 0.5]), spline).unwrap_err();
        assert!(matches!(order, IdentError::Position { index: 2, .. }));
        let clock = Discrete::new(1.0).unwrap();
        let mut models = at(&[0.0, 1.0]);
        models[1].1 = StateSpace::gain(dmatrix![1.0], clock).unwrap();
        let states = interpolate_models(&models, spline).unwrap_err();
        assert!(states.to_string().contains("states"), "{states}");
        let other = Discrete::new(2.0).unwrap();
        let m = resonance(1.0);
        models[1].1 =
            StateSpace::new(m.a().clone(), m.b().clone(), m.c().clone(), m.d().clone(), other).unwrap();
        let clocks = interpolate_models(&models, spline).unwrap_err();
        assert!(clocks.to_string().contains("clocks"), "{clocks}");
    }
}
