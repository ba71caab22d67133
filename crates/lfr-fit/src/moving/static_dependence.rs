//! From parameter-dependent state coordinates to parameter-independent ones, and an LFR there.

use super::transformation::TransformationFit;
use crate::frozen::{Closure, close};
use crate::problem::{Cost, Linear, Problem};
use crate::search::{Limits, Objective, search};
use crate::{Candidate, DeltaSplit, FitError, FrozenData, MechanicalForm, RandomChannels, ResidualUnit};
use lpv_core::Continuous;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

mod coordinates;
mod start;
mod targets;

use coordinates::Coordinates;

use start::slope_start;
use targets::{Target, constant_ports, targets};

/// An LFR in parameter-independent state coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct StaticDependence {
    /// The LFR, in the mechanical structure.
    pub candidate: Candidate<Continuous>,
    /// Rms difference of the matrices of the best start from those of the transformed model, relative to their natural sizes.
    pub difference: f64,
    /// The differences of all starts, in the order of their seeds.
    pub starts: Vec<f64>,
    /// Rms residual of the frozen responses that came last, in their unit; infinite if the search was given up before.
    pub frozen_rms: f64,
    /// Rms error along the records in units of their noise, as its linearisation in G has it.
    pub moving_rms: f64,
}

/// Takes a frozen model in mechanical coordinates, with the rate of its state transformation, to `x = T(p) x~`, where the
/// machine's coordinates do not depend on p, and fits an LFR of the mechanical structure with the given deltas, in two steps that
/// simulate nothing. From `starts` random starts it is fitted to the matrices `T A T^-1, T B, C T^-1` over the range; the
/// one that comes nearest is then fitted to frozen responses and to what the records say about G together. Without a fit to records
/// T(p) is that with which inputs act and outputs see as at the centre, and the responses alone are fitted. `data` are
/// the responses, from tolerant weights to those that count; the weight of the records grows along with them.
///
/// # Errors
/// [`FitError::Start`] if T(p) is singular, or no start is well-posed over the range; those of the structure.
pub fn static_dependence(
    form: &MechanicalForm,
    fit: Option<&TransformationFit>,
    data: &[FrozenData],
    split: DeltaSplit,
    starts: usize,
    seed: u64,
) -> Result<StaticDependence, FitError> {
    let centre = form.frozen(&form.range().centre())?;
    let targets = targets(form, |delta, frozen| match fit {
        Some(fit) => Ok(fit.transformation.basis(delta)),
        None => constant_ports(form, &centre, frozen),
    })?;
    let found: Vec<Result<(Candidate<Continuous>, f64), FitError>> = (0..starts.max(1))
        .into_par_iter()
        .map(|start| {
            // The first start leaves X alone.
            let random = RandomChannels {
                seed: seed.wrapping_add(start as u64),
                size: if start == 0 { 0.0 } else { 1.0 },
            };
            let first = slope_start(form, split, &targets, random)?;
            fit_matrices(&first, form.scales(), &targets)
        })
        .collect();
    let found: Vec<_> = found.into_iter().collect::<Result<_, _>>()?;
    let starts: Vec<f64> = found.iter().map(|(_, difference)| *difference).collect();
    let best = found
        .into_iter()
        .filter(|(_, difference)| difference.is_finite())
        .min_by(|a, b| a.1.total_cmp(&b.1));
    let (near, difference) = best.ok_or_else(|| FitError::Start {
        p: form.range().centre(),
        problem: "no LFR of this structure is well-posed over the range",
    })?;
    let made_static = with_records(near, form, fit, data)?;
    Ok(StaticDependence {
        difference,
        starts,
        ..made_static
    })
}

/// Steps from the first weight of the records to the last.
const STEPS: usize = 4;

/// Residual of the responses, in their tolerant weights, that no later step makes good.
const MISSED: f64 = 2.0;

/// Lines a position: for coordinates few are enough.
const LINES: usize = 160;

/// One standard deviation of an error of the records weighs as much as this relative error of a response without noise.
const RELATIVE: f64 = 1e-3;

/// The second step of [`static_dependence`]; without a fit to the records, on the responses alone.
fn with_records(
    near: Candidate<Continuous>,
    form: &MechanicalForm,
    fit: Option<&TransformationFit>,
    data: &[FrozenData],
) -> Result<StaticDependence, FitError> {
    let coordinates = fit.map(|fit| Coordinates::new(form, fit, &near)).transpose()?;
    let thinned: Vec<FrozenData> = data.iter().map(|d| d.thinned(LINES)).collect();
    let (Some(first), Some(last)) = (thinned.first(), thinned.last()) else {
        return Err(FitError::Empty {
            what: "frozen responses",
        });
    };
    let final_weight = match last.unit() {
        ResidualUnit::StandardDeviation => 1.0,
        ResidualUnit::Relative => RELATIVE,
    };
    // At first the records weigh as much as the responses, whatever they miss.
    let problem = Problem::new(&near, first)?;
    let frozen = problem
        .cost(&problem.theta(&near))
        .ok_or_else(|| problem.no_start())?;
    let moving = match &coordinates {
        Some(coordinates) => {
            let residual = coordinates.residual(&near).ok_or_else(|| problem.no_start())?;
            residual.norm_squared()
        }
        None => f64::NAN,
    };
    let first_weight = (frozen.total / moving).sqrt().min(final_weight);
    let mut made_static = StaticDependence {
        candidate: near,
        difference: f64::NAN,
        starts: Vec::new(),
        frozen_rms: f64::NAN,
        moving_rms: f64::NAN,
    };
    for step in 0..STEPS {
        let data = &thinned[step.min(thinned.len() - 1)];
        let part = step as f64 / (STEPS - 1) as f64;
        let before = made_static.candidate.clone();
        let objective = StaticObjective {
            problem: Problem::new(&before, data)?,
            coordinates: coordinates.as_ref(),
            free: before.free_entries(),
            weight: first_weight.powf(1.0 - part) * final_weight.powf(part),
        };
        let limits = Limits {
            max_iterations: 40,
            tolerance: 1e-2,
            target: 0.0,
            noise: None,
            damping: 1e-4,
        };
        let found = search(&objective, objective.problem.theta(&before), &limits)?;
        let candidate = objective.problem.candidate(&found.theta);
        let cost = |c: Option<Cost>| c.map_or(f64::NAN, |c| c.total);
        let frozen = cost(objective.problem.cost(&found.theta));
        made_static.frozen_rms = (frozen / data.rms_count(data.equations())).sqrt();
        made_static.moving_rms = coordinates
            .as_ref()
            .zip(fit)
            .map_or(f64::NAN, |(coordinates, fit)| {
                let moving = coordinates
                    .residual(&candidate)
                    .map_or(f64::NAN, |r| r.norm_squared());
                (moving / fit.equations as f64).sqrt()
            });
        made_static.candidate = candidate;
        // Where tolerant weights are missed already, those that count are out of reach.
        if step > 0 && data.unit() == ResidualUnit::StandardDeviation && made_static.frozen_rms > MISSED {
            made_static.frozen_rms = f64::INFINITY;
            break;
        }
    }
    Ok(made_static)
}

/// Frozen responses and the coordinates that the records ask for.
struct StaticObjective<'a> {
    problem: Problem<'a, Continuous>,
    /// None where the responses are all that is fitted.
    coordinates: Option<&'a Coordinates>,
    /// Free entries of the candidate, all of which the problem keeps.
    free: Vec<(usize, usize)>,
    weight: f64,
}

impl Objective for StaticObjective<'_> {
    fn size(&self) -> usize {
        self.problem.free.len()
    }
    fn cost(&self, theta: &DVector<f64>) -> Option<Cost> {
        let mut cost = self.problem.cost(theta)?;
        let Some(coordinates) = self.coordinates else {
            return Some(cost);
        };
        let moves = coordinates.residual(&self.problem.candidate(theta))?;
        cost.total += self.weight.powi(2) * moves.norm_squared();
        Some(cost)
    }
    fn linearise(&self, theta: &DVector<f64>) -> Option<Linear> {
        let Some(coordinates) = self.coordinates else {
            return self.problem.linearise(theta);
        };
        let mut moves = coordinates.linearise(&self.problem.candidate(theta), &self.free)?;
        moves.jacobian *= self.weight;
        moves.residual *= self.weight;
        Some(self.problem.linearise(theta)?.above(moves))
    }
    fn indistinguishable(&self, theta: &DVector<f64>) -> Result<DMatrix<f64>, FitError> {
        self.problem.indistinguishable(theta)
    }
    fn rounding(&self) -> f64 {
        0.0
    }
    fn no_start(&self) -> FitError {
        self.problem.no_start()
    }
}

/// The first step of [`static_dependence`]: range after range.
fn fit_matrices(
    start: &Candidate<Continuous>,
    scales: &[f64],
    targets: &[Target],
) -> Result<(Candidate<Continuous>, f64), FitError> {
    let mut candidate = start.clone();
    let mut cost = f64::INFINITY;
    for (reach, iterations) in [(0.4, 20), (0.7, 20), (1.01, 200)] {
        let before = candidate.clone();
        let objective = Matrices::new(&before, scales, targets, reach);
        let limits = Limits {
            max_iterations: iterations,
            tolerance: 1e-3,
            target: 1e-24,
            noise: None,
            damping: 1e-3,
        };
        let free = candidate.free_entries();
        let theta = DVector::from_iterator(free.len(), free.iter().map(|&at| candidate.matrix()[at]));
        match search(&objective, theta, &limits) {
            Ok(found) => {
                candidate = objective.candidate(&found.theta);
                cost = found.cost.total / objective.count() as f64;
            }
            // A start that is ill-posed is a bad start, nothing worse.
            Err(FitError::Start { .. }) => return Ok((start.clone(), f64::INFINITY)),
            Err(other) => return Err(other),
        }
    }
    Ok((candidate, cost.sqrt()))
}

/// The difference of matrices as a sum of squares.
struct Matrices<'a> {
    whole: &'a Candidate<Continuous>,
    free: Vec<(usize, usize)>,
    targets: &'a [Target],
    /// Largest normalised distance from the centre that counts; the model must be well-posed beyond it too.
    reach: f64,
    /// One over the natural size of each entry of S; zero for the rows that are fixed.
    weights: DMatrix<f64>,
}

impl<'a> Matrices<'a> {
    fn new(whole: &'a Candidate<Continuous>, scales: &[f64], targets: &'a [Target], reach: f64) -> Self {
        let sizes = whole.mechanical_sizes();
        let nq = whole.states() / 2;
        let (rows, columns) = (2 * nq + whole.outputs(), 2 * nq + whole.inputs());
        let row = |i: usize| match i {
            i if i < nq => f64::INFINITY,
            i if i < 2 * nq => sizes.rate,
            i => scales[i - 2 * nq],
        };
        let column = |j: usize| match j {
            j if j < 2 * nq => 1.0,
            j => sizes.input[j - 2 * nq],
        };
        Self {
            free: whole.free_entries(),
            weights: DMatrix::from_fn(rows, columns, |i, j| column(j) / row(i)),
            whole,
            targets,
            reach,
        }
    }

    fn near(&self) -> impl Iterator<Item = &Target> {
        self.targets.iter().filter(|t| t.delta.abs() <= self.reach)
    }

    /// Entries that are compared.
    fn count(&self) -> usize {
        self.near().count() * self.weights.iter().filter(|w| **w > 0.0).count()
    }

    fn matrix(&self, theta: &DVector<f64>) -> DMatrix<f64> {
        let mut m = self.whole.matrix().clone();
        for (&at, v) in self.free.iter().zip(theta.iter()) {
            m[at] = *v;
        }
        m
    }

    fn candidate(&self, theta: &DVector<f64>) -> Candidate<Continuous> {
        self.whole.with_matrix(self.matrix(theta))
    }

    fn deltas(&self, delta: f64) -> Vec<f64> {
        let range = self.whole.range();
        self.whole
            .deltas_at(&[range.centre()[0] + delta * range.half_width()[0]])
    }
}

impl Objective for Matrices<'_> {
    fn size(&self) -> usize {
        self.free.len()
    }
    fn cost(&self, theta: &DVector<f64>) -> Option<Cost> {
        let m = self.matrix(theta);
        let mut total = 0.0;
        for target in self.targets {
            let frozen = close(&m, self.whole.shape(), &self.deltas(target.delta), Closure::Value)?;
            if !frozen.positive {
                return None;
            }
            if target.delta.abs() > self.reach {
                continue;
            }
            total += (frozen.s - &target.s).component_mul(&self.weights).norm_squared();
        }
        total.is_finite().then(|| Cost {
            total,
            lines: Vec::new(),
        })
    }
    fn linearise(&self, theta: &DVector<f64>) -> Option<Linear> {
        let m = self.matrix(theta);
        let size = self.weights.len();
        let mut linear = Linear {
            jacobian: DMatrix::zeros(size * self.near().count(), self.free.len()),
            residual: DVector::zeros(size * self.near().count()),
            factorisations: 0,
            chains: Vec::new(),
        };
        for (at, target) in self.near().enumerate() {
            let delta = self.deltas(target.delta);
            let frozen = close(&m, self.whole.shape(), &delta, Closure::Derivative)?;
            let difference = (&frozen.s - &target.s).component_mul(&self.weights);
            let rows = frozen.s.nrows();
            linear
                .residual
                .rows_mut(at * size, size)
                .copy_from_slice(difference.as_slice());
            for (mut column, &(r, c)) in linear.jacobian.column_iter_mut().zip(&self.free) {
                for j in 0..frozen.s.ncols() {
                    let factor = frozen.right[(c, j)];
                    if factor != 0.0 {
                        for i in 0..rows {
                            column[at * size + j * rows + i] =
                                self.weights[(i, j)] * frozen.left[(i, r)] * factor;
                        }
                    }
                }
            }
        }
        Some(linear)
    }
    fn indistinguishable(&self, _: &DVector<f64>) -> Result<DMatrix<f64>, FitError> {
        // State coordinates are those of the target; those of the channels are left to the damping.
        Ok(DMatrix::zeros(self.size(), 0))
    }
    fn rounding(&self) -> f64 {
        1e-28
    }
    fn no_start(&self) -> FitError {
        FitError::Start {
            p: self.whole.range().centre(),
            problem: "the start is not well-posed over the range",
        }
    }
}
