//! Friction that does not grow with the speed, which the model does not have.
//!
//! Of a motion with one frequency it is taken for viscous friction, and where the axis sticks for inertia too; its
//! harmonics tell it. What it does repeats with the motion, so that no scatter of the lines shows it.

use super::filter;
use super::lines::{C, OF_CONSTANT, Part, smoothed, solve, spectrum, window};
use super::spectral::{Run, first};
use lpv_core::Discrete;
use nalgebra::Vector3;
use realfft::RealFftPlanner;

/// Highest harmonic of the motion at which dry friction is looked for.
const HARMONICS: f64 = 8.0;
/// Least power of the direction at a line over the largest.
const SEEN: f64 = 2e-3;
/// Deviations of the dry friction from which it is there.
const CERTAIN: f64 = 2.0;
/// Deviations of the dry friction from which the inertia beside it is the better one.
const BEYOND_DOUBT: f64 = 5.0;
/// Part of the dry friction that may act as an inertia, since an axis that sticks has no direction.
const STUCK: f64 = 0.15;

/// What dry friction does to an estimate.
pub(super) struct Drag {
    /// How far it moves it; zero where the lines do not show it.
    pub(super) moved: Vector3<f64>,
    /// The sampled inertia beside it, where it is there beyond doubt.
    pub(super) inertia: Option<f64>,
}

/// Equations with the direction of the motion beside, at the lines used and at harmonics of the motion. The
/// frequencies are the cut-off of the smooth position and the highest line used.
pub(super) fn drag(
    runs: &[Run<'_>],
    of_mass: &[Part<3>],
    theta: &Vector3<f64>,
    clock: Discrete,
    [smooth_hz, highest_hz]: [f64; 2],
) -> Drag {
    let none = Drag {
        moved: Vector3::zeros(),
        inertia: None,
    };
    let t = clock.sample_time();
    let mut planner = RealFftPlanner::new();
    let mut parts = Vec::with_capacity(runs.len());
    for (run, part) in runs.iter().zip(of_mass) {
        let samples = run.position.len() - 2;
        let smooth = filter::low_pass(run.position, clock, smooth_hz);
        let direction: Vec<f64> = smooth.windows(3).map(|q| first(q, t).signum()).collect();
        let direction = spectrum(&mut planner, &direction, &window(samples));
        let largest = direction.iter().fold(0.0, |m: f64, d| m.max(d.norm_sqr()));
        let last = HARMONICS * highest_hz * t * samples as f64;
        let used = |k: usize| {
            let seen = direction[k].norm_sqr() > SEEN * largest;
            part.noise[k].is_finite() || (k >= OF_CONSTANT && k as f64 <= last && seen)
        };
        let with = |columns: &[[C; 3]]| -> Vec<[C; 4]> {
            let both = columns.iter().zip(&direction);
            both.map(|([a, v, o], d)| [*a, *v, *o, *d]).collect()
        };
        parts.push(Part {
            x: with(&part.x),
            z: with(&part.z),
            u: part.u.clone(),
            noise: (0..part.u.len())
                .map(|k| if used(k) { 1.0 } else { f64::INFINITY })
                .collect(),
        });
    }
    let Some(found) = solve(&parts) else {
        return none;
    };
    let powers: Vec<Vec<f64>> = parts
        .iter()
        .map(|p| {
            let power: Vec<f64> = p.residual(&found.theta).iter().map(|e| e.norm_sqr()).collect();
            smoothed(&power, &vec![1.0; power.len()]).0
        })
        .collect();
    let covariance = found.covariance(&parts, &powers);
    let deviation = covariance[(3, 3)].sqrt();
    let dry = found.theta[3];
    if dry.is_nan() || dry <= CERTAIN * deviation {
        return none;
    }
    let moved = Vector3::from_fn(|i, _| (found.theta[i] - theta[i]).abs());
    let size = |i: usize| -> f64 {
        let lines = parts
            .iter()
            .zip(of_mass)
            .flat_map(|(four, own)| four.x.iter().zip(&own.noise));
        lines
            .map(|(x, noise)| x[i].norm_sqr() / noise)
            .sum::<f64>()
            .sqrt()
    };
    let stuck = STUCK * dry * size(3) / size(0);
    let own = covariance[(0, 0)].sqrt();
    Drag {
        moved: Vector3::new(moved[0].hypot(stuck).hypot(own), moved[1], moved[2]),
        inertia: Some(found.theta[0]).filter(|j| *j > 0.0 && dry > BEYOND_DOUBT * deviation),
    }
}
