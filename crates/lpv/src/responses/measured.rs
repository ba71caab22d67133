//! Frequency responses that were measured elsewhere, as estimates of their positions.
//!
//! What enters the pole fit is the response of the outputs, as the description has them, to samples of the inputs that are held until
//! the next. A response over a force is one of continuous time: it is multiplied by that of the hold, `(1 - e^-sT) / (sT)`, and marked, since
//! a direct term is not late by that hold. One of another derivative than the output is multiplied by a power of `s = j 2 pi f`. Both leave
//! out what folds back from beyond the Nyquist frequency, and so ask for a sample rate well above the highest line.

use crate::PipelineError;
use crate::error::ResponseProblem;
use crate::finding::{self, Finding};
use crate::progress::{Counter, Progress};
use crate::signal::finite;
use experiment_data::{Bundle, MeasuredResponse, Quantity, ResponseQuantity, Spread};
use frf_estimation::{
    Nearest, scatter, variance_of_coherence, with_assumed_error, with_covariance, with_variance,
};
use lpv_core::num_complex::Complex;
use lpv_core::{Discrete, Frf, FrfEstimate, Position, Purpose};
use std::f64::consts::TAU;

/// Lines lie this far below the sample rate where what folds back is left out: of a free mass it is then 0.02 % of the highest line,
/// of its speed 0.3 %.
pub(crate) const BELOW_RATE: f64 = 20.0;

/// The least and the most that is assumed of the relative error of a response that states none; the scatter over neighbouring lines
/// decides in between.
const ASSUMED: [f64; 2] = [1e-4, 0.03];

/// Lines of a response from which a fit has something to tell modes from noise with.
const FEWEST_LINES: usize = 10;

/// A variance that is this much off is worth a word.
const OFF: f64 = 1.5;

/// One measured response.
#[derive(Debug, Clone)]
pub(crate) struct Measured {
    /// Its record, as the file has it.
    pub(crate) record: MeasuredResponse,
    /// What enters the fits.
    pub(crate) estimate: FrfEstimate,
    /// What was done with it, in words.
    pub(crate) reasons: Vec<String>,
}

/// The measured responses for which `wanted` holds, in the order of the bundle.
///
/// # Errors
/// What is wrong with the first one; [`PipelineError::Response`] for one that cannot be taken to the clock or the outputs.
pub(crate) fn measured_responses(
    bundle: &Bundle,
    wanted: impl Fn(usize) -> bool,
    progress: Progress<'_>,
) -> Result<Vec<Measured>, PipelineError> {
    let clock = bundle.clock()?;
    let entries = &bundle.description().records;
    let indices: Vec<usize> = (0..bundle.len())
        .filter(|&i| entries[i].is_response() && wanted(i))
        .collect();
    if indices.is_empty() {
        return Ok(Vec::new());
    }
    let counter = Counter::new(progress, "measured frequency responses", indices.len());
    indices
        .into_iter()
        .map(|i| {
            let record = bundle.load_response(i)?;
            counter.one();
            let name = record.name.clone();
            let found = record.frf.len();
            if entries[i].purpose == Purpose::Estimation && found < FEWEST_LINES {
                let needed = FEWEST_LINES;
                return Err(Refused::Problem(ResponseProblem::FewLines { found, needed }).of(&name));
            }
            as_estimate(record, bundle, clock).map_err(|problem| problem.of(&name))
        })
        .collect()
}

/// What they say against each other.
pub(crate) fn compare(bundle: &Bundle, measured: &[Measured]) -> Vec<Finding> {
    let each: Vec<_> = measured
        .iter()
        .map(|m| (m.record.name.as_str(), &m.estimate))
        .collect();
    let channels = &bundle.description().channels;
    finding::compare_measured(&each, &channels.output.columns, &channels.input.columns)
}

/// Why a response is not taken.
enum Refused {
    Problem(ResponseProblem),
    Error(PipelineError),
}

impl Refused {
    fn of(self, record: &str) -> PipelineError {
        match self {
            Self::Problem(problem) => PipelineError::Response {
                record: record.to_owned(),
                problem,
            },
            Self::Error(error) => error,
        }
    }
}

fn as_estimate(record: MeasuredResponse, bundle: &Bundle, clock: Discrete) -> Result<Measured, Refused> {
    let (factors, mut reasons) = factors(&record, bundle, clock).map_err(Refused::Problem)?;
    let (outputs, inputs) = (record.frf.outputs(), record.frf.inputs());
    let n = outputs * inputs;
    let mut values = record.frf.values().to_vec();
    // Entries are column-major: those of one output are every `outputs`-th.
    let factor = |at: usize| factors[at / n * outputs + at % n % outputs];
    values.iter_mut().enumerate().for_each(|(at, v)| *v *= factor(at));
    let core = |e: lpv_core::CoreError| Refused::Error(e.into());
    let frf = Frf::new(record.frf.frequencies_hz().to_vec(), outputs, inputs, values).map_err(core)?;
    let freedom = record
        .averages
        .map_or(f64::INFINITY, |n| (n - inputs as f64).max(1.0));
    let position = record.position.clone();
    let scaled = |variance: &[f64]| -> Vec<f64> {
        let all = variance.iter().enumerate();
        all.map(|(at, v)| v * factor(at).norm_sqr()).collect()
    };
    let nearest = match &record.spread {
        Spread::Unknown => None,
        Spread::Variance(v) => Some(with_variance(frf.clone(), &scaled(v), freedom, position.clone())),
        Spread::Coherence(g) => {
            let variance = variance_of_coherence(&frf, g, record.averages.unwrap_or(1.0));
            Some(with_variance(frf.clone(), &variance, freedom, position.clone()))
        }
        Spread::Covariance(c) => {
            let part = |at: usize| {
                let (line, a, b) = (at / (n * n), at % n, at / n % n);
                factor(line * n + a) * factor(line * n + b).conj()
            };
            let all: Vec<_> = c.iter().enumerate().map(|(at, v)| v * part(at)).collect();
            Some(with_covariance(frf.clone(), &all, freedom, position.clone()))
        }
    };
    let failed = |source| {
        Refused::Error(PipelineError::Frf {
            place: format!("record {}", record.name),
            source,
        })
    };
    let estimate = match nearest {
        Some(nearest) => {
            let Nearest { estimate, factor } = nearest.map_err(failed)?;
            if factor > OFF {
                reasons.push(format!(
                    "record {}: the variances of its channels are no product of one an output and one an input; those taken differ by up to a factor of {factor:.1}",
                    record.name
                ));
            }
            estimate
        }
        None => {
            let found = scatter(&frf).unwrap_or(ASSUMED[1]);
            let part = found.clamp(ASSUMED[0], ASSUMED[1]);
            reasons.push(format!(
                "warning: record {} states no variance: its lines weigh as if each had an error of {:.2} % of its size ({}); no error is told in multiples of a noise. `variance`, or `coherence` with `averages`, in the file would tell it",
                record.name,
                100.0 * part,
                match found > ASSUMED[1] {
                    true => format!("neighbouring lines differ by more, {:.1} %: noise, or lines too far apart", finite(100.0 * found)),
                    false => "what neighbouring lines scatter".to_owned(),
                }
            ));
            with_assumed_error(frf, part, position).map_err(failed)?
        }
    };
    let of_force = record.quantity.is_some_and(ResponseQuantity::is_of_force);
    Ok(Measured {
        estimate: match of_force {
            true => estimate.of_held_input(clock),
            false => estimate,
        },
        record,
        reasons,
    })
}

/// What each line of each output is multiplied by, line after line, and the same in words.
fn factors(
    record: &MeasuredResponse,
    bundle: &Bundle,
    clock: Discrete,
) -> Result<(Vec<Complex<f64>>, Vec<String>), ResponseProblem> {
    let outputs = &bundle.description().channels.output;
    let rate_hz = 1.0 / clock.sample_time();
    let lines = record.frf.frequencies_hz();
    let highest_hz = lines.last().copied().unwrap_or(0.0);
    let mut powers = vec![0; outputs.len()];
    let mut reasons = Vec::new();
    let is_of_force = record.quantity.is_some_and(ResponseQuantity::is_of_force);
    if let Some(quantity) = record.quantity {
        for (i, power) in powers.iter_mut().enumerate() {
            let output = outputs.quantity_of(i);
            let own = output.derivatives().ok_or_else(|| ResponseProblem::NoMotion {
                output: outputs.columns[i].clone(),
                quantity: output.name(),
                response: quantity.name(),
            })?;
            if is_of_force && output == Quantity::Acceleration {
                return Err(ResponseProblem::HeldAcceleration {
                    output: outputs.columns[i].clone(),
                });
            }
            *power = own - quantity.motion().derivatives().unwrap_or(0);
            if *power != 0 {
                reasons.push(format!(
                    "record {}: its {} becomes the {} `{}`, multiplied by (j 2 pi f)^{power}",
                    record.name,
                    quantity.name(),
                    output.name(),
                    outputs.columns[i]
                ));
            }
        }
    }
    if highest_hz >= 0.5 * rate_hz {
        return Err(ResponseProblem::BeyondNyquist { highest_hz, rate_hz });
    }
    let folds = is_of_force || powers.iter().any(|p| *p != 0);
    if folds && BELOW_RATE * highest_hz > rate_hz * (1.0 + 1e-9) {
        return Err(ResponseProblem::SlowClock {
            quantity: record.quantity.map_or("", ResponseQuantity::name),
            highest_hz,
            rate_hz,
            needed_hz: BELOW_RATE * highest_hz,
        });
    }
    reasons.push(match (is_of_force, record.quantity) {
        (true, _) => format!(
            "record {}: a response over a force, in continuous time; the model is that of a force held for 1/{rate_hz} s",
            record.name
        ),
        (false, None) => format!(
            "record {}: taken as the response to samples of the input, held for 1/{rate_hz} s; quantity = \"displacement/force\" says that it is one of continuous time",
            record.name
        ),
        (false, Some(_)) => format!(
            "record {}: the response to samples of the input, held for 1/{rate_hz} s",
            record.name
        ),
    });
    let factors = lines.iter().flat_map(|f| {
        let s = Complex::new(0.0, TAU * f);
        let hold = match is_of_force {
            true => clock.hold_response(*f),
            false => Complex::from(1.0),
        };
        powers.iter().map(move |power| s.powi(*power) * hold)
    });
    Ok((factors.collect(), reasons))
}

/// Measured responses beside those of the periodic records, in order of position.
///
/// # Errors
/// [`PipelineError::OnePlace`] where two are of one position.
pub(crate) fn join(
    estimates: Vec<FrfEstimate>,
    measured: &[Measured],
) -> Result<Vec<FrfEstimate>, PipelineError> {
    if measured.is_empty() {
        return Ok(estimates);
    }
    /// Part of the largest distance between positions below which two are one place.
    const NEAR: f64 = 1e-6;
    let own = estimates.into_iter().map(|e| (None, e));
    let others = measured
        .iter()
        .map(|m| (Some(m.record.name.clone()), m.estimate.clone()));
    let mut all: Vec<(Option<String>, FrfEstimate)> = own.chain(others).collect();
    let place = |e: &FrfEstimate| e.position().and_then(Position::single).unwrap_or(0.0);
    all.sort_by(|a, b| place(&a.1).total_cmp(&place(&b.1)));
    let gaps: Vec<f64> = all.windows(2).map(|w| place(&w[1].1) - place(&w[0].1)).collect();
    let largest = gaps.iter().copied().fold(0.0, f64::max);
    if let Some(i) = gaps.iter().position(|gap| *gap <= NEAR * largest) {
        let name = |i: usize| {
            all[i]
                .0
                .clone()
                .unwrap_or_else(|| "the periodic records".to_owned())
        };
        return Err(PipelineError::OnePlace {
            records: Box::new([name(i), name(i + 1)]),
            position: all[i].1.single_position(),
        });
    }
    Ok(all.into_iter().map(|(_, e)| e).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use lpv_core::nalgebra::dmatrix;
    use lpv_core::{Continuous, StateSpace};

    /// A mass on a spring: the response in continuous time times the hold is that of the sampled machine, but for what folds back.
    #[test]
    fn the_hold_is_that_of_a_sampled_machine() {
        let clock = Discrete::from_rate(1000.0).unwrap();
        let machine = StateSpace::new(
            dmatrix![0.0, 1.0; -400.0, -2.0],
            dmatrix![0.0; 1.0],
            dmatrix![1.0, 0.0],
            dmatrix![0.0],
            Continuous,
        )
        .unwrap();
        let lines: Vec<f64> = (1..=100).map(|k| 0.5 * f64::from(k)).collect();
        let sampled = machine.zero_order_hold(clock).unwrap();
        let sampled = sampled.frequency_response(&lines).unwrap();
        let continuous = machine.frequency_response(&lines).unwrap();
        for (k, f) in lines.iter().enumerate() {
            let own = continuous.line(k)[(0, 0)] * clock.hold_response(*f);
            let off = (own / sampled.line(k)[(0, 0)] - 1.0).norm();
            assert!(off < 3e-4, "{f} Hz: {off:e}");
        }
    }
}
