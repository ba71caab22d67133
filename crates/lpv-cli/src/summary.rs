//! What a person and a program are told about an identification.

use crate::validation::{FrozenError, decibel, frozen_error};
use crate::{Identified, PipelineError, Responses};
use lpv_core::FrfEstimate;
use serde::Serialize;

/// The figures of one identification.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Positions with an FRF.
    pub positions: usize,
    /// Lines of the first position.
    pub lines: usize,
    /// Median over lines and positions of the stated relative deviation of the FRF, in percent.
    pub frf_noise_percent: f64,
    /// The same by output: deviation of a row of the FRF over the size of the row, in percent.
    pub frf_noise_by_output_percent: Vec<f64>,
    /// Order of the common denominator.
    pub order: usize,
    /// Poles held at z = 1.
    pub integrators: usize,
    /// Modes at the middle position: frequency in cycles per unit of time, and damping ratio.
    pub modes: Vec<[f64; 2]>,
    /// Frequency of the mode that stands out most once the integrators are divided out: the largest
    /// `||G(f)||_F f^integrators` among lightly damped modes at the middle position.
    pub resonance_hz: Option<f64>,
    /// Error of the model against the estimated FRF, all positions and lines.
    pub frozen: FrozenError,
    /// Root mean square over lines of the error relative to that of the FRF, by output, in percent.
    pub relative_rms_percent: Vec<f64>,
    /// Weighted cost over its expectation: 1 says that the model explains the FRF down to its noise.
    pub cost_over_expected: f64,
    /// Median noise of the FRF in decibels, to set beside `frozen.median_db`.
    pub frf_noise_db: f64,
    /// The choices, in words.
    pub reasons: Vec<String>,
}

impl Summary {
    /// Compares the identified model with the responses that it was made from.
    ///
    /// # Errors
    /// None for a model of these responses.
    pub fn new(identified: &Identified, responses: &Responses) -> Result<Self, PipelineError> {
        let estimates: Vec<_> = responses.estimates.iter().map(|e| &e.estimate).collect();
        let first = estimates.first().ok_or(PipelineError::Structure {
            problem: "there are no responses to compare with",
        })?;
        let mut deviations: Vec<f64> = estimates
            .iter()
            .flat_map(|e| (0..e.frf().len()).map(|k| e.relative_deviation(k)))
            .collect();
        deviations.sort_by(f64::total_cmp);
        let noise = deviations.get(deviations.len() / 2).copied().unwrap_or(f64::NAN);
        let (poles, model, cost) = match identified {
            Identified::Lti(stage) => {
                let account = &stage.poles.fits[0].account;
                let response = stage.poles.fits[0].response(first.frf().frequencies_hz())?;
                (&stage.poles, vec![response], account.cost / account.expected_cost)
            }
            Identified::Lpv(stage) => {
                let responses = estimates
                    .iter()
                    .map(|e| {
                        stage
                            .model
                            .response(e.position().unwrap_or(0.0), e.frf().frequencies_hz())
                    })
                    .collect::<Result<Vec<_>, _>>()?;
                let fits = stage.fits.fits();
                let cost = fits
                    .iter()
                    .map(|f| f.cost / (f.equations - f.unknowns) as f64)
                    .sum::<f64>()
                    / fits.len() as f64;
                (&stage.poles, responses, cost)
            }
        };
        let truth: Vec<_> = estimates.iter().map(|e| e.frf().clone()).collect();
        let relative_rms_percent = (0..first.frf().outputs())
            .map(|output| {
                let (mut error, mut size) = (0.0, 0.0);
                for (g, f) in model.iter().zip(&truth) {
                    for input in 0..f.inputs() {
                        for (a, b) in g.channel(output, input).zip(f.channel(output, input)) {
                            error += (a - b).norm_sqr();
                            size += b.norm_sqr();
                        }
                    }
                }
                100.0 * (error / size).sqrt()
            })
            .collect();
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
        Ok(Self {
            resonance_hz: resonance.map(|r| r.1),
            positions: estimates.len(),
            lines: first.frf().len(),
            frf_noise_percent: 100.0 * noise,
            frf_noise_by_output_percent: (0..first.frf().outputs())
                .map(|output| 100.0 * row_noise(&estimates, output))
                .collect(),
            frf_noise_db: decibel(noise),
            order: poles.order,
            integrators: poles.integrators,
            modes: middle
                .modes()
                .iter()
                .map(|m| [m.frequency_hz, m.damping])
                .collect(),
            frozen: frozen_error(&model, &truth)?,
            relative_rms_percent,
            cost_over_expected: cost,
            reasons: identified
                .reasons()
                .iter()
                .cloned()
                .chain(noise_warning(noise))
                .collect(),
        })
    }

    /// The summary in words.
    pub fn text(&self) -> String {
        let modes: Vec<String> = self
            .modes
            .iter()
            .map(|[f, d]| format!("  {f:.5} cycles per unit of time, damping {d:.4}"))
            .collect();
        let rms: Vec<String> = self
            .relative_rms_percent
            .iter()
            .map(|e| format!("{e:.2} %"))
            .collect();
        format!(
            "{} position(s), {} lines, FRF noise {:.2} % in the median ({:.1} dB)\n\
             {}\n\
             modes at the middle position:\n{}\n\
             frozen error against the FRF: largest {:.1} dB (at {:.4}), median {:.1} dB; rms by output {}\n\
             weighted cost over its expectation: {:.3}",
            self.positions,
            self.lines,
            self.frf_noise_percent,
            self.frf_noise_db,
            self.reasons
                .iter()
                .map(|r| format!("- {r}"))
                .collect::<Vec<_>>()
                .join("\n"),
            modes.join("\n"),
            self.frozen.strict_max_db,
            self.frozen.worst_frequency_hz,
            self.frozen.median_db,
            rms.join(", "),
            self.cost_over_expected,
        )
    }
}

/// Median over lines and positions of `sqrt(C_ii tr(S)) / ||F_i||` for one output.
fn row_noise(estimates: &[&FrfEstimate], output: usize) -> f64 {
    let mut values = Vec::new();
    for e in estimates {
        for k in 0..e.frf().len() {
            let variance = e.output_covariance(k)[(output, output)].re * e.input_factor(k).trace().re;
            values.push(variance.max(0.0).sqrt() / e.frf().line(k).row(output).norm());
        }
    }
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// In words, where a frequency response is mostly noise.
fn noise_warning(noise: f64) -> Option<String> {
    (noise > 0.5).then(|| {
        format!(
            "warning: the FRF noise is {:.0} % in the median; check `period`, or use more periods or a stronger excitation",
            100.0 * noise
        )
    })
}
