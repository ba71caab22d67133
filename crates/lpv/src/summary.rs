//! What a person and a program are told about an identification.

mod modes;
mod time;

use crate::finding::{self, Finding};
use crate::poles::Undetermined;
use crate::signal::finite;
use crate::validation::{FrozenError, frozen_error};
use crate::verdict::Verdict;
use crate::{BetweenPositions, Identified, MovingStage, PipelineError, SizeRow};
use lpv_core::{Discrete, Frf, FrfEstimate, Model, Position, counted};
use lpv_numerics::statistics::{amplitude_db, median};
use modes::{modal_modes, mode_lines, pole_modes};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
pub use time::{AxisSummary, HeldOut, OrderRow, TimeSummary};

/// The figures of one identification.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Summary {
    /// What the model is worth; none of a diagnosis, which has a verdict of its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub verdict: Option<Verdict>,
    /// Kind of the model, in words.
    pub model: String,
    /// From frequency responses.
    #[serde(flatten)]
    pub frequency: Option<FrequencySummary>,
    /// From records without periods.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<TimeSummary>,
    /// Servo axes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub axes: Vec<AxisSummary>,
    /// The choices, in words.
    pub reasons: Vec<String>,
    /// What was found in the data.
    #[serde(
        default,
        skip_serializing_if = "Vec::is_empty",
        serialize_with = "finding::serialize"
    )]
    #[schemars(with = "Vec<finding::Row<'_>>")]
    pub findings: Vec<Finding>,
}

/// Figures of an identification from frequency responses.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FrequencySummary {
    /// Positions with an FRF.
    pub positions: usize,
    /// Lines of the first position.
    pub lines: usize,
    /// Median over lines and positions of the stated relative deviation of the FRF, in percent; of the assumed one, where a record
    /// states none.
    pub frf_noise_percent: f64,
    /// The same by output: deviation of a row of the FRF over the size of the row, in percent.
    pub frf_noise_by_output_percent: Vec<f64>,
    /// Order of the common denominator.
    pub order: usize,
    /// Poles held at z = 1.
    pub integrators: usize,
    /// Modes at the middle position: frequency in Hz, and damping ratio.
    pub modes: Vec<[f64; 2]>,
    /// Frequency of the mode that stands out most once the integrators are divided out: the largest
    /// `||G(f)||_F f^integrators` among lightly damped modes at the middle position.
    pub resonance_hz: Option<f64>,
    /// Error of the model against the estimated FRF, all positions and lines.
    pub frozen: FrozenError,
    /// Root mean square over lines of the error relative to that of the FRF, by output, in percent.
    pub relative_rms_percent: Vec<f64>,
    /// Weighted cost of the fits at the positions over its expectation. The weights hold the noise and, for an LPV model, what the
    /// basis leaves out; 1 says that the fits explain the FRF down to both.
    pub cost_over_expected: f64,
    /// Median over lines and positions of the error of the model over the stated deviation of the FRF, whole matrix at a line:
    /// also after the interpolation over positions. Nothing but noise gives 0.83 for one channel, towards 1 for many.
    /// None where the noise is assumed.
    pub error_over_noise: Option<f64>,
    /// Median noise of the FRF in decibels, to set beside `frozen.median_db`.
    pub frf_noise_db: f64,
    /// What the lines of one position leave open, where another model explains them as well and acts otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub undetermined: Option<Undetermined>,
    /// What the LPV stages found; none for one position.
    pub lpv: Option<LpvSummary>,
}

/// Figures of the LPV stages.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LpvSummary {
    /// Positions.
    pub positions: Vec<f64>,
    /// Modes at every position: frequency in Hz, and damping ratio.
    pub modes: Vec<Vec<[f64; 2]>>,
    /// Number of basis functions.
    pub functions: usize,
    /// Name of the interpolation.
    pub interpolation: String,
    /// Leave-one-out cost an equation of the interpolations tried, by name.
    pub leave_one_out: Vec<(String, f64)>,
    /// States and deltas of the LFR of the model, where there is one.
    pub lfr: Option<[usize; 2]>,
    /// The small LFR.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub small: Option<SmallSummary>,
}

/// Figures of the small LFR.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SmallSummary {
    /// Sizes tried, in order.
    pub sizes: Vec<SizeRow>,
    /// What records along a moving p added.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moving: Option<MovingStage>,
    /// What is to be expected between the positions, where they tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub between: Option<BetweenPositions>,
}

/// Root mean square of the error relative to that of the response, over all responses and lines, by output, percent.
pub(crate) fn relative_rms_percent(model: &[Frf], truth: &[Frf]) -> Vec<f64> {
    (0..truth.first().map_or(0, Frf::outputs))
        .map(|output| {
            let (mut error, mut size) = (0.0, 0.0);
            for (g, f) in model.iter().zip(truth) {
                for input in 0..f.inputs() {
                    for (a, b) in g.channel(output, input).zip(f.channel(output, input)) {
                        error += (a - b).norm_sqr();
                        size += b.norm_sqr();
                    }
                }
            }
            finite(100.0 * (error / size).sqrt())
        })
        .collect()
}

impl Summary {
    /// Compares the identified model with the responses that it was made from.
    ///
    /// # Errors
    /// None for a model of these responses.
    pub fn of_responses(
        identified: &Identified,
        estimates: &[FrfEstimate],
        clock: Discrete,
    ) -> Result<Self, PipelineError> {
        let first = estimates.first().ok_or(PipelineError::Structure {
            problem: "there are no responses to compare with",
        })?;
        let deviations: Vec<f64> = estimates
            .iter()
            .flat_map(|e| (0..e.frf().len()).map(|k| e.relative_deviation(k)))
            .collect();
        let noise = finite(median(&deviations));
        let model = estimates
            .iter()
            .map(|e| {
                identified.response(
                    e.single_position().unwrap_or(0.0),
                    e.frf().frequencies_hz(),
                    clock,
                )
            })
            .collect::<Result<Vec<_>, _>>()?;
        let (poles, cost) = match identified {
            Identified::Lti(stage) => {
                let account = &stage.poles.fits[0].account;
                let cost = account.cost / account.expected_cost;
                let modal = stage
                    .modal
                    .as_ref()
                    .map(|m| m.account.cost / m.account.expected_cost);
                (&stage.poles, modal.unwrap_or(cost))
            }
            Identified::Lpv(stage) => {
                let fits = stage.fits.fits();
                let cost = fits
                    .iter()
                    .map(|f| f.cost / (f.equations - f.unknowns) as f64)
                    .sum::<f64>()
                    / fits.len() as f64;
                (&stage.poles, cost)
            }
        };
        let truth: Vec<_> = estimates.iter().map(|e| e.frf().clone()).collect();
        let middle = &poles.fits[poles.fits.len() / 2];
        let band = |f: f64| {
            let lines = first.frf().frequencies_hz();
            lines.first().is_some_and(|l| f >= *l) && lines.last().is_some_and(|l| f <= *l)
        };
        let mut resonance = None;
        for mode in middle
            .modes()
            .iter()
            .filter(|m| m.damping > 0.0 && m.damping < 0.3 && band(m.frequency_hz))
        {
            let height = middle.response(&[mode.frequency_hz])?.line(0).norm()
                * mode.frequency_hz.powi(poles.integrators as i32);
            if resonance.is_none_or(|(best, _)| height > best) {
                resonance = Some((height, mode.frequency_hz));
            }
        }
        let mut ratios = Vec::with_capacity(deviations.len());
        for (g, e) in model.iter().zip(estimates) {
            for (k, error) in g.relative_error(e.frf())?.into_iter().enumerate() {
                ratios.push(error / e.relative_deviation(k));
            }
        }
        let known = !estimates.iter().any(FrfEstimate::covariance_is_assumed);
        let error_over_noise = known.then(|| finite(median(&ratios)));
        let frequency = FrequencySummary {
            error_over_noise,
            resonance_hz: resonance.map(|r| r.1),
            positions: estimates.len(),
            lines: first.frf().len(),
            frf_noise_percent: 100.0 * noise,
            frf_noise_by_output_percent: (0..first.frf().outputs())
                .map(|output| finite(100.0 * row_noise(estimates, output)))
                .collect(),
            frf_noise_db: finite(amplitude_db(noise)),
            order: poles.order,
            integrators: poles.integrators,
            modes: match identified {
                Identified::Lti(stage) => stage
                    .modal
                    .as_ref()
                    .map_or_else(|| pole_modes(middle), modal_modes),
                Identified::Lpv(_) => pole_modes(middle),
            },
            frozen: frozen_error(&model, &truth)?,
            relative_rms_percent: relative_rms_percent(&model, &truth),
            cost_over_expected: finite(cost),
            undetermined: identified.undetermined().cloned(),
            lpv: match identified {
                Identified::Lti(_) => None,
                Identified::Lpv(stage) => Some(LpvSummary {
                    positions: stage
                        .fits
                        .positions()
                        .iter()
                        .filter_map(Position::single)
                        .collect(),
                    modes: stage.poles.fits.iter().map(pole_modes).collect(),
                    functions: stage.fits.functions(),
                    interpolation: stage.model.interpolation().name().to_owned(),
                    leave_one_out: stage
                        .leave_one_out
                        .iter()
                        .map(|e| (e.interpolation.name().to_owned(), e.cost))
                        .collect(),
                    lfr: match (&stage.small, &stage.realization) {
                        (Some(small), _) => Some([small.lfr.states(), small.lfr.delta_count()]),
                        (None, Some(r)) => Some([r.lfr.states(), r.lfr.delta_count()]),
                        (None, None) => None,
                    },
                    small: stage.small.as_ref().map(|small| SmallSummary {
                        sizes: small.sizes.clone(),
                        moving: small.moving.clone(),
                        between: small.between.clone(),
                    }),
                }),
            },
        };
        Ok(Self {
            model: identified.model()?.describe(),
            frequency: Some(frequency),
            time: None,
            axes: Vec::new(),
            findings: Vec::new(),
            verdict: None,
            reasons: identified
                .reasons()
                .iter()
                .cloned()
                .chain(noise_warning(noise).filter(|_| known))
                .chain(error_over_noise.and_then(|over| error_warning(identified, over)))
                .collect(),
        })
    }

    pub(crate) fn of_time(model: &Model, time: TimeSummary, reasons: Vec<String>) -> Self {
        Self {
            model: model.describe(),
            frequency: None,
            time: Some(time),
            axes: Vec::new(),
            reasons,
            findings: Vec::new(),
            verdict: None,
        }
    }

    pub(crate) fn of_axes(model: &Model, axes: Vec<AxisSummary>, reasons: Vec<String>) -> Self {
        Self {
            model: model.describe(),
            frequency: None,
            time: None,
            axes,
            reasons,
            findings: Vec::new(),
            verdict: None,
        }
    }

    /// The summary in words.
    pub fn text(&self) -> String {
        let mut parts: Vec<String> = self.verdict.iter().map(|v| v.sentence.clone()).collect();
        parts.push(self.model.clone());
        parts.extend(finding::lines(&self.findings));
        parts.extend(self.reasons.iter().map(|r| format!("- {r}")));
        parts.extend(self.frequency.as_ref().map(FrequencySummary::text));
        parts.extend(self.time.as_ref().map(TimeSummary::text));
        parts.extend(self.axes.iter().map(AxisSummary::text));
        parts.join("\n")
    }
}

fn percents(values: &[f64]) -> String {
    // An unstable simulation leaves any scale.
    let text = |e: &f64| {
        if e.abs() < 1e5 {
            format!("{e:.2} %")
        } else {
            format!("{e:.0e} %")
        }
    };
    let texts: Vec<String> = values.iter().map(text).collect();
    texts.join(", ")
}

impl FrequencySummary {
    fn text(&self) -> String {
        let known = self.error_over_noise.is_some();
        format!(
            "{}, {} lines, FRF noise {:.2} % in the median ({:.1} dB{})\n\
             modes at the middle position:\n{}\n\
             frozen error against the FRF: largest {:.1} dB (at {:.4}), median {:.1} dB; rms by output {}\n\
             {}cost of the fits over its expectation: {:.3}",
            counted(self.positions, "position"),
            self.lines,
            self.frf_noise_percent,
            self.frf_noise_db,
            if known { "" } else { "; assumed, none is stated" },
            mode_lines(&self.modes),
            self.frozen.strict_max_db,
            self.frozen.worst_frequency_hz,
            self.frozen.median_db,
            percents(&self.relative_rms_percent),
            self.error_over_noise.map_or(String::new(), |over| format!(
                "error over the noise of the FRF, median: {over:.2}; "
            )),
            self.cost_over_expected,
        )
    }
}

/// Median over lines and positions of `sqrt(C_ii tr(S)) / ||F_i||` for one output.
fn row_noise(estimates: &[FrfEstimate], output: usize) -> f64 {
    let mut values = Vec::new();
    for e in estimates {
        for k in 0..e.frf().len() {
            let variance = e.output_covariance(k)[(output, output)].re * e.input_factor(k).trace().re;
            values.push(variance.max(0.0).sqrt() / e.frf().line(k).row(output).norm());
        }
    }
    median(&values)
}

/// In words, where a frequency response is mostly noise.
fn noise_warning(noise: f64) -> Option<String> {
    let percent = 100.0 * noise;
    (percent > 50.0).then(|| {
        format!("warning: the FRF noise is {percent:.0} % in the median; check `period`, or use more periods or a stronger excitation")
    })
}

/// In words, where an LPV model misses responses that are known better.
fn error_warning(identified: &Identified, over_noise: f64) -> Option<String> {
    const MISSED: f64 = 2.0;
    (matches!(identified, Identified::Lpv(_)) && over_noise > MISSED).then(|| {
        format!(
            "warning: the model misses the responses by {over_noise:.1} times their noise in the median; measure at positions in between, or allow more basis functions or a higher order of the interpolation"
        )
    })
}
