//! Machines whose poles do not depend on p: mode shapes at the actuators and the sensors do.
//!
//! A plate over fixed sensors, a stage with fixed coils, a carriage on a stiff beam: `x' = A x + B(p) u`, `y = C(p) x` with one A for
//! every p. In modal coordinates the frozen models of all positions are known but for one change of coordinates a mode, which
//! commutes with A; with that chosen, B and C are smooth functions of p, and a polynomial through them has an LFR with as many deltas
//! as the block Hankel matrix of its coefficients has rank (Ho and Kalman, with delta in the place of the shift). Deltas reach the
//! inputs and the outputs only, so that A stays constant. With only one of B and C a function of p, and more inputs (or outputs) than the
//! rank of the rigid body to tell it, the states are those of the machine while p moves too.

mod between;
mod coordinates;
mod model;
mod place;
mod sides;

use crate::problem::Problem;
use crate::{Candidate, FitError, FrozenData, GrowSettings, RefineSettings, Refined, ResidualUnit, refine};
pub use between::Between;
use between::expected_between;
use coordinates::{aligned, chained, constant_sides, smoothed};
use lpv_core::{Continuous, SchedulingRange};
use nalgebra::DMatrix;
use num_complex::Complex;
use place::{Place, places};
use sides::{Sides, Weights};

type C64 = Complex<f64>;

/// What of the model is a function of p.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ShapesAt {
    /// C alone: sensors that see another point of the machine as it moves.
    Outputs,
    /// B alone: actuators that act at another point of it.
    Inputs,
    /// B and C.
    Both,
}

/// An LFR with constant poles.
#[derive(Debug, Clone)]
pub struct ConstantPoles {
    /// The model, fitted to the few lines.
    pub refined: Refined<Continuous>,
    /// What it was fitted to: the data in few lines, those merged that the models of the positions cannot tell apart, and the responses
    /// of the polynomials midway between the positions.
    pub few: FrozenData,
    /// What depends on p.
    pub shapes: ShapesAt,
    /// Degree of the polynomials in p that the deltas realise before the fit.
    pub degree: usize,
    /// Rank of the gain of the rigid body.
    pub rank: usize,
    /// Numbers of deltas that were fitted, with the rms residual of each.
    pub sizes: Vec<(usize, f64)>,
    /// What is to be expected between neighbouring positions.
    pub between: Vec<Between>,
}

/// Positions below which nothing tells a function of p.
const LEAST_POSITIONS: usize = 3;

/// Highest degree of a polynomial in p.
const HIGHEST: usize = 6;

/// A frozen model with constant poles may leave this many times the target at its position: its poles come from all of them.
const SLACK: f64 = 1.5;

/// Part of the squares of the target that a start may add to them.
const ADDED: f64 = 0.1;

/// Part of the target, which lies above the noise, at which a start is not fitted further.
const NOTHING_LEFT: f64 = 0.91;

/// Iterations of the fit of one size: the polynomials leave little to do.
const ITERATIONS: usize = 12;

/// Free entries up to which the functions of p are fitted too.
const MOST_FREE: usize = 1200;

/// Sizes that are fitted at most, and the part of their deltas by which they shrink or grow.
const MOST_SIZES: usize = 4;
const LESS: usize = 8;
const MORE: usize = 4;

/// Fits an LFR with constant poles to responses whose poles are known ([`FrozenData::with_poles`]); `rigid`: whether there are double
/// integrators. None where no pole is that of more than half of the positions, or no such model reaches the target.
///
/// # Errors
/// Failures of the numerics, as in [`crate::refine`].
pub fn constant_poles(
    data: &FrozenData,
    rigid: bool,
    range: &SchedulingRange,
    settings: &GrowSettings,
) -> Result<Option<ConstantPoles>, FitError> {
    settings.check()?;
    if data.len() < LEAST_POSITIONS || range.parameters() != 1 {
        return Ok(None);
    }
    let Some(poles) = common_poles(data) else {
        return Ok(None);
    };
    let target = settings.target(data.unit());
    let Some(found) = places(data, &poles, rigid, SLACK * target)? else {
        return Ok(None);
    };
    let (modal, few) = (found.modal, found.few);
    let weigh = |places: &[Place]| Weights::new(&modal, places, &few);
    let first = weigh(&found.places)?;
    let deltas: Vec<f64> = few.scheduling().map(|p| range.normalise(p)[0]).collect();
    // What noise leaves of a function through the positions, and what may come on top.
    let per_entry = match data.unit() {
        ResidualUnit::StandardDeviation => target * target,
        ResidualUnit::Relative => 0.0,
    };
    let room = ADDED * target * target * few.rms_count(few.equations());
    let allowed = |unknowns: usize| 2.0 * per_entry * unknowns as f64 + room;
    let align = |shapes| aligned(&modal, &found.places, shapes, &first);
    let (Some(with_b), Some(with_c), Some(mut turned)) = (
        align(ShapesAt::Outputs)?,
        align(ShapesAt::Inputs)?,
        chained(&modal, &found.places, &deltas),
    ) else {
        return Ok(None);
    };
    let of_b = weigh(&with_b)?;
    let of_c = weigh(&with_c)?;
    let stands = |places: &[Place], weights: &Weights, shapes: ShapesAt| {
        let free = weights.unknowns(shapes.other()) * (deltas.len() - 1);
        let found = weights.constant(places, shapes);
        found.filter(|(_, missed)| *missed <= allowed(free))
    };
    let (shapes, constant) = if let Some((b, _)) = stands(&with_b, &of_b, ShapesAt::Outputs) {
        turned = with_b;
        (ShapesAt::Outputs, b)
    } else if let Some((c, _)) = stands(&with_c, &of_c, ShapesAt::Inputs) {
        turned = with_c;
        (ShapesAt::Inputs, c)
    } else {
        let mut settled = vec![false; modal.blocks().count()];
        let sets = [(with_b.as_slice(), &of_b), (with_c.as_slice(), &of_c)];
        constant_sides(&modal, sets, room, &mut turned, &mut settled);
        turned = match smoothed(&modal, &[turned, with_b, with_c], &deltas, &settled)? {
            Some(turned) => turned,
            None => return Ok(None),
        };
        (ShapesAt::Both, DMatrix::zeros(0, 0))
    };
    let weights = weigh(&turned)?;
    let highest = HIGHEST.min(deltas.len() - 1);
    let mut chosen = None;
    for degree in 1..=highest {
        let sides = Sides::new(&deltas, &turned, (shapes, &constant), degree)?;
        let free = weights.unknowns(shapes) * (deltas.len() - 1 - degree);
        let good = weights.misfit(&sides, &deltas, &turned) <= allowed(free);
        chosen = Some((sides, degree));
        if good {
            break;
        }
    }
    let Some((sides, degree)) = chosen else {
        return Ok(None);
    };
    let whole = sides.hankel(&weights)?;
    // What rational functions of few deltas do between the positions, the polynomials say.
    let between = few.between(|p| modal.held(&sides.at(range.normalise(p)[0]), few.clock()))?;
    let both = FrozenData::together(&[few.clone(), between.clone()])?;
    let most = whole.rank();
    let fit = |size: usize| -> Result<Option<(Refined<Continuous>, f64)>, FitError> {
        let realised = whole.cut(size);
        let mut start = modal.candidate(&realised, range, true)?;
        // Many functions of p stay those of the polynomials.
        if start.free_entries().len() > MOST_FREE {
            start = modal.candidate(&realised, range, false)?;
        }
        // Polynomials through all positions are at their noise already.
        let there = match (residual(&start, &few), residual(&start, &between)) {
            (Ok(own), Ok(other)) => own <= NOTHING_LEFT * target && other <= ADDED,
            _ => false,
        };
        let settings = RefineSettings {
            max_iterations: if there { 0 } else { ITERATIONS },
            tolerance: 1e-2,
            ..RefineSettings::default()
        };
        let fitted = match refine(&start, &both, &settings) {
            Err(FitError::Start { .. }) => return Ok(None),
            other => other?,
        };
        let rms = |data: &FrozenData| residual(&fitted.candidate, data);
        let (own, other) = (rms(&few)?, rms(&between)?);
        // The polynomials have no noise.
        Ok(Some((fitted, own.max(target * other))))
    };
    let mut sizes = Vec::new();
    let mut best: Option<Refined<Continuous>> = None;
    let mut size = whole.enough(room);
    while sizes.len() < MOST_SIZES {
        let found = fit(size)?;
        let rms = found.as_ref().map_or(f64::INFINITY, |(_, rms)| *rms);
        sizes.push((size, rms));
        let reached = rms <= target;
        let before = best.is_some();
        if reached {
            best = found.map(|(fitted, _)| fitted);
        }
        size = match (reached, before) {
            (true, false) if sizes.len() > 1 => break,
            (true, _) if size > 1 => size - size.div_ceil(LESS),
            (false, false) if size < most => (size + size.div_ceil(MORE)).min(most),
            _ => break,
        };
    }
    sizes.sort_by_key(|s| s.0);
    let expected = expected_between(&weights, &deltas, &turned, &few, shapes)?;
    Ok(best.map(|refined| ConstantPoles {
        between: expected,
        refined,
        few: both,
        shapes,
        degree,
        rank: modal.rank(),
        sizes,
    }))
}

impl ShapesAt {
    fn other(self) -> Self {
        match self {
            Self::Outputs => Self::Inputs,
            Self::Inputs => Self::Outputs,
            Self::Both => Self::Both,
        }
    }

    fn has_outputs(self) -> bool {
        self != Self::Inputs
    }

    fn has_inputs(self) -> bool {
        self != Self::Outputs
    }
}

/// Rms residual of a model.
fn residual(candidate: &Candidate<Continuous>, data: &FrozenData) -> Result<f64, FitError> {
    let problem = Problem::new(candidate, data)?;
    let cost = problem
        .cost(&problem.theta(candidate))
        .ok_or_else(|| problem.no_start())?;
    Ok((cost.total / data.rms_count(data.equations())).sqrt())
}

/// The poles that more than half of the positions have, above the real axis, sampled: the medians of frequency and damping over them. A
/// mode may be out of sight at a position, and what is found there instead is no mode. None without one.
fn common_poles(data: &FrozenData) -> Option<Vec<C64>> {
    /// Part of its frequency, and times its half-width, by which a constant pole may scatter.
    const NEAR: [f64; 2] = [2e-3, 0.5];
    let mut all: Vec<Vec<C64>> = data
        .positions()
        .iter()
        .map(|position| {
            let upper = position.poles.iter().filter(|z| z.im > 0.0);
            upper.map(|z| z.ln()).collect()
        })
        .collect();
    let mut seeds: Vec<C64> = all.iter().flatten().copied().collect();
    seeds.sort_by(|a, b| a.im.total_cmp(&b.im));
    let mut found = Vec::new();
    for seed in seeds {
        let near = |s: &C64| (s.im - seed.im).abs() <= NEAR[0] * seed.im + NEAR[1] * seed.re.abs();
        // Of each position the nearest one that belongs to no other mode.
        let members: Vec<(usize, usize)> = all
            .iter()
            .enumerate()
            .filter_map(|(i, rates)| {
                let by_distance =
                    |a: &usize, b: &usize| (rates[*a] - seed).norm().total_cmp(&(rates[*b] - seed).norm());
                let nearest = (0..rates.len())
                    .filter(|k| near(&rates[*k]))
                    .min_by(by_distance)?;
                Some((i, nearest))
            })
            .collect();
        if 2 * members.len() <= all.len() {
            continue;
        }
        let median = |of: fn(&C64) -> f64| {
            let values: Vec<f64> = members.iter().map(|(i, k)| of(&all[*i][*k])).collect();
            lpv_numerics::statistics::median(&values)
        };
        found.push(C64::new(median(|s| s.re), median(|s| s.im)).exp());
        for (i, k) in members {
            all[i].swap_remove(k);
        }
    }
    (!found.is_empty()).then_some(found)
}

#[cfg(test)]
mod tests;
