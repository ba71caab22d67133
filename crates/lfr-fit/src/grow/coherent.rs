//! Frozen models at all positions in coordinates that change as little as possible, and what a start makes of them: the
//! same responses with more damping, and an LFR from a polynomial through them.

use super::expansion::Expansion;
use super::moved::moved;
use super::weights::Weights;
use super::{DeltaReach, GrowSettings};
use crate::sampling::Sampling;
use crate::sampling::hold::Derivative;
use crate::shape::Shape;
use crate::{
    Candidate, FitError, FrozenData, RandomChannels, RefineSettings, Refined, ResidualUnit, Rigid, refine,
};
use lpv_core::{Continuous, CoreError, Discrete, SchedulingRange, StateSpace};
use nalgebra::DMatrix;

/// Part of its response that a line of a start counts as exact to.
pub(super) const ERROR_FLOOR: f64 = 1e-2;

/// A local fit that leaves more than this many times its target has missed.
const MISSED: f64 = 2.0;

/// Lines a position of the damped responses, at least; twice the states if that is more.
const DAMPED_LINES: usize = 20;

/// Highest degree of a polynomial through the frozen models.
const HIGHEST: usize = 6;

/// One frozen model a position, `S = [A B; C D]` of the flexible part. Each was fitted from that of its nearest
/// neighbour towards the centre, by steps that move no coordinates, so that the entries of S are smooth in p;
/// or from there with the poles moved.
pub(super) struct Coherent<K: Sampling> {
    pub(super) clock: K,
    pub(super) shape: Shape,
    pub(super) range: SchedulingRange,
    /// Normalised scheduling values, and S there.
    pub(super) models: Vec<(Vec<f64>, DMatrix<f64>)>,
    /// How far a change of S moves the response.
    weights: Weights,
    /// Rows of S that depend on p.
    rows: usize,
    pub(super) damped: FrozenData,
    pub(super) damping: f64,
    /// The sampled model at each position, with the rigid body, in the order of the data.
    sampled: Vec<StateSpace<Discrete>>,
}

impl<K: Sampling> Coherent<K> {
    /// Both in few lines a position: models and the data that they were fitted to. Data without noise are exact in any of
    /// their lines; of noisy ones each line knows a part, so that they are merged, about models that a first round gives.
    pub(super) fn in_few_lines(
        local: &StateSpace<K>,
        rigid: Rigid<'_>,
        data: &FrozenData,
        range: &SchedulingRange,
        settings: &GrowSettings,
    ) -> Result<(Self, FrozenData), FitError> {
        let around = |few: &FrozenData| Self::new(local, rigid, few, range, settings.reach);
        let thinned = data.thinned(settings.lines);
        let rough = around(&thinned)?;
        if data.unit() == ResidualUnit::Relative {
            return Ok((rough, thinned));
        }
        let fine = around(&data.merged_lines(&rough.sampled)?)?;
        let few = data.merged_lines(&fine.sampled)?;
        Ok((fine, few))
    }

    pub(super) fn new(
        local: &StateSpace<K>,
        rigid: Rigid<'_>,
        data: &FrozenData,
        range: &SchedulingRange,
        reach: DeltaReach,
    ) -> Result<Self, FitError> {
        let none = RandomChannels::default();
        let whole = Candidate::flexible(local, rigid, &[], range.clone(), none)?;
        let shape = Shape {
            states: local.states(),
            outputs: local.outputs(),
            inputs: local.inputs(),
        };
        let mut free = whole.free().clone();
        let beside = whole.states() - shape.states;
        let n = whole.states();
        match reach {
            DeltaReach::States => free.rows_mut(n, shape.outputs).fill(false),
            // C and D of the LFR depend on p.
            DeltaReach::Outputs => free.view_mut((n, n), (shape.outputs, shape.inputs)).fill(true),
        }
        let whole = whole.with_free(free)?;
        let settings = local_settings(data.unit());
        let mut order: Vec<(f64, usize, Vec<f64>)> = Vec::new();
        for (i, p) in data.scheduling().enumerate() {
            range.check(p)?;
            let delta = range.normalise(p);
            order.push((largest(&delta), i, delta));
        }
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut solved: Vec<(Vec<f64>, Candidate<K>)> = Vec::new();
        for (_, i, delta) in &order {
            let far = |other: &[f64]| {
                let gap: Vec<f64> = other.iter().zip(delta).map(|(a, b)| a - b).collect();
                largest(&gap)
            };
            let nearest = solved.iter().min_by(|a, b| far(&a.0).total_cmp(&far(&b.0)));
            let start = nearest.map_or(&whole, |(_, candidate)| candidate);
            let here = data.at(*i);
            let fit = |start: &Candidate<K>| -> Result<Refined<K>, FitError> {
                match data.unit() {
                    ResidualUnit::Relative => refine(start, &here, &settings),
                    // Lines of a very good signal to noise ratio lead a start astray.
                    ResidualUnit::StandardDeviation => {
                        let near = refine(start, &here.with_error_floor(ERROR_FLOOR), &settings)?;
                        refine(&near.candidate, &here, &settings)
                    }
                }
            };
            let mut fitted = fit(start)?;
            let poles = &here.positions()[0].poles;
            if fitted.account.rms > MISSED * target(data.unit()) && !poles.is_empty() {
                let mut m = start.matrix().clone();
                let mut a = m.view_mut((beside, beside), (shape.states, shape.states));
                a.copy_from(&moved(local.clock(), &a.clone_owned(), poles, data.clock())?);
                // A start of its own kind: where it leads to nothing, the other one stands.
                if let Ok(other) = fit(&start.clone().with_matrix(m))
                    && other.account.rms < fitted.account.rms
                {
                    fitted = other;
                }
            }
            solved.push((delta.clone(), fitted.candidate));
        }
        let mut whole_models: Vec<(usize, StateSpace<Discrete>)> = Vec::new();
        for ((_, i, _), (_, candidate)) in order.iter().zip(&solved) {
            let s = candidate.matrix();
            whole_models.push((*i, sampled(local.clock(), whole.shape(), s, data)?));
        }
        whole_models.sort_by_key(|(i, _)| *i);
        let flexible = (shape.rows(), shape.columns());
        let models: Vec<(Vec<f64>, DMatrix<f64>)> = solved
            .into_iter()
            .map(|(delta, c)| (delta, c.matrix().view((beside, beside), flexible).into_owned()))
            .collect();
        let rows = match reach {
            DeltaReach::States => shape.states,
            DeltaReach::Outputs => shape.rows(),
        };
        let mut weights = Weights::new(shape.states, shape.inputs, rows);
        for ((_, i, _), (_, s)) in order.iter().zip(&models) {
            weights.add(&shape.system(s, local.clock())?, &data.positions()[*i].frf);
        }
        let damping = damping(local.clock(), shape, &models, data);
        let responses = order.iter().zip(&models).map(|((_, i, _), (_, s))| {
            let mut s = s.clone();
            local.clock().shift(&mut s, shape.states, damping, data.clock());
            let here = data.at(*i).thinned(DAMPED_LINES.max(2 * shape.states));
            let position = &here.positions()[0];
            let held = sampled(local.clock(), shape, &s, data)?;
            let response = held.frequency_response(position.frf.frequencies_hz())?;
            Ok((position.p.clone(), response))
        });
        let responses = responses.collect::<Result<Vec<_>, FitError>>()?;
        Ok(Self {
            clock: local.clock(),
            shape,
            range: range.clone(),
            damped: FrozenData::relative(data.clock(), &responses)?,
            models,
            weights,
            rows,
            damping,
            sampled: whole_models.into_iter().map(|(_, model)| model).collect(),
        })
    }

    /// Degrees of the polynomials worth a start, the most promising one first: a parabola; the highest, where few deltas
    /// do much; a straight line, which is always near something.
    pub(super) fn degrees(&self) -> Vec<usize> {
        let most = Expansion::largest_degree(self.range.parameters(), self.models.len()).clamp(1, HIGHEST);
        let mut degrees = vec![most.min(2)];
        degrees.extend([most, 1].into_iter().filter(|d| *d != most.min(2)));
        degrees
    }

    /// The LFR whose frozen matrices are nearest to a polynomial through those of the models, in the weights of their
    /// responses. Channels that the polynomial has no direction for stay as in `base`, and so does what the mask fixes.
    pub(super) fn factorised(&self, base: Candidate<K>, degree: usize) -> Result<Candidate<K>, FitError> {
        let places: Vec<Vec<f64>> = self.models.iter().map(|(delta, _)| delta.clone()).collect();
        let moving = self.models.iter().map(|(_, s)| s.rows(0, self.rows).into_owned());
        let expansion = Expansion::new(&places, &moving.collect::<Vec<_>>(), degree)?;
        let channels = expansion.channels(&self.weights, base.channels())?;
        let (a, b) = (self.shape.rows(), self.shape.columns());
        let mut m = base.matrix().clone();
        m.view_mut((0, 0), (self.rows, b)).copy_from(expansion.constant());
        for j in (0..channels.found.len()).filter(|j| channels.found[*j]) {
            m.view_mut((0, b + j), (self.rows, 1))
                .copy_from(&channels.left.column(j));
            m.view_mut((a + j, 0), (1, b)).copy_from(&channels.right.row(j));
        }
        m.view_mut((a, b), channels.inner.shape())
            .copy_from(&channels.inner);
        let (old, free) = (base.matrix(), base.free());
        let m = DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| {
            if free[(i, j)] { m[(i, j)] } else { old[(i, j)] }
        });
        Ok(base.with_matrix(m))
    }

    /// The flexible part fitted to the responses `F(s + damping)`, from random channels or from a polynomial. A
    /// resonance that moves by many times its width leaves a gradient only where the start is nearly right; with the
    /// damping of all poles raised by as much as they move, it is seen from afar. A shift of A moves LFR and responses
    /// alike, so that it is undone exactly.
    pub(super) fn fit(
        &self,
        start: Candidate<K>,
        settings: &RefineSettings,
    ) -> Result<(Candidate<K>, usize), FitError> {
        let moved = |c: Candidate<K>, by: f64| {
            let mut m = c.matrix().clone();
            self.clock
                .shift(&mut m, self.shape.states, by, self.damped.clock());
            c.with_matrix(m)
        };
        let fitted = refine(&moved(start, self.damping), &self.damped, settings)?;
        let iterations = fitted.account.iterations();
        Ok((moved(fitted.candidate, -self.damping), iterations))
    }
}

/// A local fit serves a start only: a part of a percent, or the noise, is enough.
fn target(unit: ResidualUnit) -> f64 {
    match unit {
        ResidualUnit::Relative => 1e-4,
        ResidualUnit::StandardDeviation => 1.0,
    }
}

fn local_settings(unit: ResidualUnit) -> RefineSettings {
    RefineSettings {
        max_iterations: 20,
        tolerance: 1e-2,
        target: target(unit),
        ..RefineSettings::default()
    }
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |d: f64, v| d.max(v.abs()))
}

/// How far the poles move from where the search began, the most of all positions, as a rate: a pole moves to its nearest
/// one.
fn damping<K: Sampling>(
    clock: K,
    shape: Shape,
    models: &[(Vec<f64>, DMatrix<f64>)],
    data: &FrozenData,
) -> f64 {
    let rates = |s: &DMatrix<f64>| {
        let held = sampled(clock, shape, s, data).ok();
        let poles = held.and_then(|held| lpv_core::linalg::eigenvalues(held.a()).ok());
        let rate = |z| crate::sampling::hold::Hold::pole_of_sampled(Continuous, z, data.clock());
        let rates = poles.unwrap_or_default().into_iter().map(rate);
        rates
            .filter(|s| s.re.is_finite() && s.im.is_finite())
            .collect::<Vec<_>>()
    };
    let Some(((_, first), others)) = models.split_first() else {
        return 0.0;
    };
    let first = rates(first);
    let moved = others.iter().flat_map(|(_, s)| rates(s)).map(|pole| {
        let gaps = first.iter().map(|other| (pole - other).norm());
        gaps.fold(f64::INFINITY, f64::min)
    });
    let most = moved.filter(|v| v.is_finite()).fold(0.0, f64::max);
    most.min(1.0 / data.clock().sample_time())
}

fn sampled<K: Sampling>(
    clock: K,
    shape: Shape,
    s: &DMatrix<f64>,
    data: &FrozenData,
) -> Result<StateSpace<Discrete>, FitError> {
    let held = clock
        .sample(s, shape.states, data.clock(), Derivative::Skip)
        .ok_or(CoreError::Singular {
            operation: "the hold of a local model",
        })?;
    Ok(shape.system(&held.s, data.clock())?)
}
