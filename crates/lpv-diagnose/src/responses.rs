//! The competition where there are no moves: linear effects, on the frequency response of an axis.

use crate::TraceError;
use crate::base::{Axis, Base};
use crate::catalogue::{self, first_of_equals};
use crate::character::Character;
use crate::effect::{Effect, Family, Lines, Path};
use crate::fit::{Explained, Minimum, deviations, minimum};
use lpv_core::FrfEstimate;
use lpv_numerics::statistics::chi_squared_p_value;
use num_complex::Complex64 as C64;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Response of a motor with one input, and of the load that it drives: outputs are angles or positions, the motor's first.
pub struct ResponseCase<'a> {
    /// Response to fit.
    pub fitted: &'a FrfEstimate,
    /// Response of another experiment, to judge by.
    pub judged: &'a FrfEstimate,
}

/// One model of the sequence.
#[derive(Debug, Clone)]
pub struct ResponseStep {
    /// What was added to the one before; none for the rigid axis.
    pub effect: Option<&'static Effect>,
    /// The model.
    pub model: Explained,
    /// Probability of such a fall on the fitted response without the effect.
    pub p_value: f64,
    /// Standard deviations of its coordinates' values: the machine's, then the effects'.
    pub deviations: Vec<f64>,
    /// Errors of the fitted response by output, see [`error_of`].
    pub fitted: Vec<f64>,
    /// The same of the judged one.
    pub judged: Vec<f64>,
    /// The next best effect, and by how much its squared error on the judged response is larger, in decibels.
    pub runner_up: Option<(&'static Effect, f64)>,
    /// Every effect that was tried, and the fall of the squared error on the judged response, in decibels.
    pub tried: Vec<(&'static Effect, f64)>,
}

impl ResponseStep {
    /// The effect that the judged response does not tell from the one that was added, and the margin in decibels.
    pub fn tied(&self) -> Option<(&'static Effect, f64)> {
        self.runner_up.filter(|(_, margin)| margin.abs() < EQUAL_DB)
    }
}

/// Most effects at once.
const MOST: usize = 4;
/// Iterations of a fit.
const ITERATIONS: usize = 100;
/// Part of the squared error on the judged response that an effect must take.
const SHARE: f64 = 0.05;
/// Decibels on the judged response within which two effects with as many parameters are not told apart: what is left is no noise,
/// so that lengths of description tell less than they say.
const EQUAL_DB: f64 = 0.5;

/// Adds linear effects to a rigid axis with viscous friction as long as they lower the error of a response that they were not
/// fitted to; the steps, the rigid axis first. Of two effects with as many parameters that are within half a decibel the
/// first of the catalogue is added, and the other is its runner-up.
///
/// Minimised is the sum over outputs of the squared error over the squared size of the response.
///
/// # Errors
/// [`TraceError::TooFew`] for less than eight lines; [`TraceError::NoBase`] where the response is not that of one input.
pub fn trace_responses(case: &ResponseCase<'_>) -> Result<Vec<ResponseStep>, TraceError> {
    for e in [case.fitted, case.judged] {
        if e.frf().len() < 8 {
            return Err(TraceError::TooFew {
                what: "effects on a frequency response need at least eight lines",
            });
        }
        if e.frf().inputs() != 1 {
            return Err(TraceError::NoBase {
                why: "the rigid axis has one input; a machine with more needs [geometry]",
            });
        }
    }
    let rigid = Explained {
        base: rigid(case.fitted),
        effects: Vec::new(),
    };
    let fit = |start: &Explained| -> Option<(Explained, Minimum)> {
        let found = minimum(start.coordinates(), &start.bounded(), ITERATIONS, |c| {
            residual(&start.with(c), case.fitted)
        })?;
        Some((start.with(&found.at), found))
    };
    let none = TraceError::NoBase {
        why: "the rigid axis has no finite error against the response",
    };
    let mut now = fit(&rigid).ok_or(none)?;
    let judge = |model: &Explained| -> f64 { error_of(model, case.judged).iter().map(|e| e * e).sum() };
    let step = |(model, found): &(Explained, Minimum)| ResponseStep {
        effect: None,
        model: model.clone(),
        p_value: 1.0,
        deviations: spread(model, found),
        fitted: error_of(model, case.fitted),
        judged: error_of(model, case.judged),
        runner_up: None,
        tried: Vec::new(),
    };
    let mut steps = vec![step(&now)];
    // What cannot be told apart from what was added.
    let mut tied: Vec<&str> = Vec::new();
    let highest = case
        .fitted
        .frf()
        .frequencies_hz()
        .iter()
        .copied()
        .fold(0.0, f64::max);
    while steps.len() <= MOST {
        let before = judge(&now.0);
        let taken = |e: &Effect| now.0.effects.iter().any(|(t, _)| t.is_called(e));
        let mut tried: Vec<(&'static Effect, (Explained, Minimum))> = catalogue::all()
            .filter(|e| e.suits(&now.0.base) && !taken(e) && !tied.contains(&e.name))
            .collect::<Vec<_>>()
            .into_par_iter()
            .filter_map(|effect| {
                starts(effect, &now.0, case.fitted)
                    .into_iter()
                    .filter_map(|values| {
                        let mut start = now.0.clone();
                        start.effects.push((effect, values));
                        fit(&start)
                    })
                    .filter(|(model, found)| is_known(effect, model, found, highest))
                    .min_by(|a, b| a.1.cost.total_cmp(&b.1.cost))
                    .map(|best| (effect, best))
            })
            .collect();
        tried.sort_by(|a, b| length(&a.1.1).total_cmp(&length(&b.1.1)));
        let gain = |model: &Explained| 10.0 * (before / judge(model)).log10();
        if let Some((best, (model, _))) = tried.first() {
            let (most, parameters) = (gain(model), best.fitted());
            let equals = |(e, (model, _)): &(&'static Effect, (Explained, Minimum))| {
                e.fitted() == parameters && gain(model) > most - EQUAL_DB
            };
            first_of_equals(&mut tried, |t| t.0, equals);
        }
        let gains: Vec<(&'static Effect, f64)> =
            tried.iter().map(|(e, (model, _))| (*e, gain(model))).collect();
        if let Some(last) = steps.last_mut() {
            last.tried = gains.clone();
        }
        let Some((effect, best)) = tried.into_iter().next() else {
            break;
        };
        if length(&best.1) >= length(&now.1) || judge(&best.0) > (1.0 - SHARE) * before {
            break;
        }
        let added = ResponseStep {
            effect: Some(effect),
            p_value: chi_squared_p_value(
                best.1.rows as f64 * (now.1.cost / best.1.cost).ln(),
                effect.fitted(),
            ),
            runner_up: gains.get(1).map(|(e, gain)| (*e, gains[0].1 - gain)),
            ..step(&best)
        };
        tied.extend(added.tied().map(|(other, _)| other.name));
        steps.push(added);
        now = best;
    }
    Ok(steps)
}

/// Root of the squared error of the response of each output over its squared size, all lines together.
pub fn error_of(model: &Explained, estimate: &FrfEstimate) -> Vec<f64> {
    let frf = estimate.frf();
    (0..frf.outputs())
        .map(|i| {
            let (mut error, mut size) = (0.0, 0.0);
            for (k, f) in frf.frequencies_hz().iter().enumerate() {
                let measured = frf.line(k)[(i, 0)];
                error += (response(model, *f)[i.min(1)] - measured).norm_sqr();
                size += measured.norm_sqr();
            }
            (error / size).sqrt()
        })
        .collect()
}

/// What a model leaves of a response: where it sits, and what of it goes with the output itself, its rate and its
/// acceleration. None where there is nothing.
pub fn characterise_response(model: &Explained, estimate: &FrfEstimate) -> Option<Character> {
    let (errors, noise) = (error_of(model, estimate), noise_of(estimate));
    let over = |i: &usize| errors[*i] / noise[*i].max(f64::MIN_POSITIVE);
    let output = (0..errors.len()).max_by(|a, b| over(a).total_cmp(&over(b)))?;
    let frf = estimate.frf();
    let lines = frf.frequencies_hz();
    let measured: Vec<C64> = frf.channel(output, 0).collect();
    let left: Vec<C64> = lines
        .iter()
        .zip(&measured)
        .map(|(f, g)| g - response(model, *f)[output.min(1)])
        .collect();
    let energy: f64 = left.iter().map(C64::norm_sqr).sum();
    if energy <= 0.0 || !energy.is_finite() {
        return None;
    }
    let at = |part: f64| {
        let mut sum = 0.0;
        let line = left.iter().position(|e| {
            sum += e.norm_sqr();
            sum >= part * energy
        });
        lines[line.unwrap_or(lines.len() - 1)]
    };
    let with = |order: i32| {
        let signal = |(f, g): (&f64, &C64)| g * C64::new(0.0, TAU * f).powi(order);
        let signal: Vec<C64> = lines.iter().zip(&measured).map(signal).collect();
        let size: f64 = signal.iter().map(C64::norm_sqr).sum();
        let product: f64 = left.iter().zip(&signal).map(|(e, g)| (e * g.conj()).re).sum();
        product / (energy * size).sqrt()
    };
    let mut correlations = vec![("output", with(0)), ("speed", with(1)), ("acceleration", with(2))];
    correlations.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    Some(Character {
        output,
        band_hz: [at(0.1), at(0.9)],
        correlations,
    })
}

/// Noise of an estimate by output, counted as [`error_of`] counts errors.
pub fn noise_of(estimate: &FrfEstimate) -> Vec<f64> {
    let frf = estimate.frf();
    (0..frf.outputs())
        .map(|i| {
            let noise: f64 = (0..frf.len()).map(|k| estimate.variance(k, i, 0)).sum();
            let size: f64 = (0..frf.len()).map(|k| frf.line(k)[(i, 0)].norm_sqr()).sum();
            (noise / size).sqrt()
        })
        .collect()
}

/// Response of motor and load to the command at a frequency, Hz.
pub fn response(model: &Explained, frequency_hz: f64) -> [C64; 2] {
    let s = C64::new(0.0, TAU * frequency_hz);
    let one = C64::new(1.0, 0.0);
    let mut path = Path {
        command: one,
        dynamic: match &model.base {
            Base::Axis(axis) => axis.dynamic(s),
            Base::XyTable(_) | Base::Lpv(_) => C64::new(f64::NAN, 0.0),
        },
        follow: one,
        sensor: one,
    };
    model.blocks().iter().for_each(|b| b.respond(s, &mut path));
    let motor = path.command / path.dynamic;
    [motor * path.sensor, motor * path.follow]
}

/// The mass that moves as the motor does at the lowest lines.
fn rigid(estimate: &FrfEstimate) -> Base {
    const LINES: usize = 8;
    let frf = estimate.frf();
    let lines = frf.frequencies_hz().iter().enumerate().take(LINES);
    let masses: Vec<f64> = lines
        .map(|(k, f)| (frf.line(k)[(0, 0)].norm() * (TAU * f).powi(2)).recip())
        .collect();
    let mass = masses.iter().sum::<f64>() / masses.len() as f64;
    Base::Axis(Axis::new(mass, 0.0, 0.0).linear())
}

fn residual(model: &Explained, estimate: &FrfEstimate) -> Option<Vec<f64>> {
    let frf = estimate.frf();
    let mut all = Vec::with_capacity(2 * frf.len() * frf.outputs());
    let sizes: Vec<f64> = (0..frf.outputs())
        .map(|i| frf.channel(i, 0).map(|g| g.norm_sqr()).sum::<f64>().sqrt())
        .collect();
    for (k, f) in frf.frequencies_hz().iter().enumerate() {
        let there = response(model, *f);
        for (i, size) in sizes.iter().enumerate() {
            let error = (there[i.min(1)] - frf.line(k)[(i, 0)]) / size;
            all.extend([error.re, error.im]);
        }
    }
    all.iter().all(|r| r.is_finite()).then_some(all)
}

/// Length of the description, up to a constant.
fn length(found: &Minimum) -> f64 {
    let rows = found.rows as f64;
    rows * found.cost.ln() + found.at.len() as f64 * rows.ln()
}

/// Standard deviations, of what a response leaves when the model explains it but for noise that is the same at all lines.
fn spread(model: &Explained, found: &Minimum) -> Vec<f64> {
    let level = (found.cost / found.rows.saturating_sub(found.at.len()).max(1) as f64).sqrt();
    let deviations = deviations(&found.factor);
    deviations
        .iter()
        .zip(model.scales())
        .map(|(d, s)| level * d * s)
        .collect()
}

/// Whether a last effect is larger than its deviation, and a time not longer than half a cycle of the highest line: on lines a
/// delay is known up to the period only.
fn is_known(effect: &Effect, model: &Explained, found: &Minimum, highest_hz: f64) -> bool {
    let deviations = spread(model, found);
    let Some((_, values)) = model.effects.last() else {
        return false;
    };
    let deviation = deviations[deviations.len() - values.len()];
    let short = effect.family != Family::Timing || values[0].abs() * highest_hz <= 0.5;
    short && deviation.is_finite() && values[0].abs() > 2.0 * deviation
}

/// Starts of the effects that a response can show; none of the others.
fn starts(effect: &Effect, model: &Explained, estimate: &FrfEstimate) -> Vec<Vec<f64>> {
    let lines = estimate.frf().frequencies_hz();
    let (low, high) = (lines[0], lines[lines.len() - 1]);
    let Base::Axis(axis) = &model.base else {
        return Vec::new();
    };
    let on = Lines {
        band_hz: [low, high],
        outputs: estimate.frf().outputs(),
        mass: axis.mass(),
    };
    effect.on_response.map_or_else(Vec::new, |starts| starts(&on))
}
