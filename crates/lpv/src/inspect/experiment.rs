//! Figures of the periodic records at one position, and of their frequency response.

use crate::account::NumberOrList;
use crate::responses::AtPosition;
use frf_estimation::Instrument;
use lpv_core::Position;
use lpv_numerics::statistics::{amplitude_db, median, quantile};
use schemars::JsonSchema;
use serde::Serialize;

/// One periodic experiment.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ExperimentInfo {
    /// `estimation` or `validation`.
    pub purpose: &'static str,
    /// Position; none without scheduling.
    #[schemars(with = "Option<NumberOrList>")]
    pub position: Option<Position>,
    /// Its records.
    pub records: Vec<String>,
    /// Lowest and highest excited frequency, Hz.
    pub band_hz: [f64; 2],
    /// Periods used of the record that has the fewest.
    pub periods_used: usize,
    /// Periods dropped as transient.
    pub periods_skipped: usize,
    /// What was correlated with: references (unbiased in closed loop) or inputs.
    pub instrument: &'static str,
    /// Largest condition number over the lines, and its frequency.
    pub condition: [f64; 2],
    /// Relative standard deviation of the FRF over its lines.
    pub frf_deviation: Spread,
    /// Signal-to-noise ratio of the averaged output, dB, over the lines, by output.
    pub output_snr_db: Vec<Spread>,
    /// The same, by input.
    pub input_snr_db: Vec<Spread>,
    /// Coherence of the outputs with the excitation in a single period, over the lines, by output.
    pub coherence: Vec<Spread>,
    /// Standard deviation of the noise of one sample, by output: what does not repeat from period to period.
    pub noise: Vec<f64>,
    /// Nonlinear distortion at odd detection lines relative to the output, by output; none without such lines.
    pub odd_distortion: Option<Vec<f64>>,
    /// The same at even lines.
    pub even_distortion: Option<Vec<f64>>,
    /// Distortion from the spread over realisations, relative to the output, by output.
    pub realisation_distortion: Option<Vec<f64>>,
    /// Every excited line.
    pub lines: Vec<LineInfo>,
    /// Every detection line between the excited ones.
    pub detection: Vec<DetectionLine>,
}

/// Smallest, middle and largest of many values.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Spread {
    /// Smallest.
    pub min: f64,
    /// Median.
    pub median: f64,
    /// Largest.
    pub max: f64,
}

impl Spread {
    pub(crate) fn of(values: &[f64]) -> Self {
        Self {
            min: quantile(values, 0.0),
            median: median(values),
            max: quantile(values, 1.0),
        }
    }
}

/// One excited line.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct LineInfo {
    /// Hz.
    pub frequency_hz: f64,
    /// Signal-to-noise ratio of the averaged outputs, dB.
    pub output_snr_db: Vec<f64>,
    /// The same of the inputs.
    pub input_snr_db: Vec<f64>,
    /// Coherence of the outputs with the excitation in a single period.
    pub coherence: Vec<f64>,
    /// Relative standard deviation of the FRF, whole matrix.
    pub frf_deviation: f64,
}

/// One line that was not excited: what appears there is noise or nonlinear distortion.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct DetectionLine {
    /// Cycles a period.
    pub line: usize,
    /// Hz.
    pub frequency_hz: f64,
    /// `odd` or `even`.
    pub parity: &'static str,
    /// Amplitude that a linear response to the input does not explain, noise included, in units of the output.
    pub level: Vec<f64>,
    /// Standard deviation of the noise in it.
    pub noise: Vec<f64>,
}

/// The figures of one position, for one use.
pub(crate) fn describe(purpose: &'static str, at: &AtPosition) -> ExperimentInfo {
    let e = &at.estimate;
    let frf = e.estimate.frf();
    let frequencies = frf.frequencies_hz();
    let (ny, nu) = (frf.outputs(), frf.inputs());
    let power_db = |snr: f64| 0.5 * amplitude_db(snr);
    // The averaged output has the noise of one period over M; a single period shows the M-th part of that ratio.
    let coherence = |snr: f64| {
        let one = snr / e.periods_used as f64;
        if one.is_infinite() { 1.0 } else { one / (1.0 + one) }
    };
    let lines: Vec<LineInfo> = frequencies
        .iter()
        .enumerate()
        .map(|(k, &frequency_hz)| LineInfo {
            frequency_hz,
            output_snr_db: (0..ny).map(|i| power_db(e.output_snr[k * ny + i])).collect(),
            input_snr_db: (0..nu).map(|i| power_db(e.input_snr[k * nu + i])).collect(),
            coherence: (0..ny).map(|i| coherence(e.output_snr[k * ny + i])).collect(),
            frf_deviation: e.estimate.relative_deviation(k),
        })
        .collect();
    let by = |count: usize, value: fn(&LineInfo) -> &Vec<f64>| -> Vec<Spread> {
        (0..count)
            .map(|i| Spread::of(&lines.iter().map(|l| value(l)[i]).collect::<Vec<_>>()))
            .collect()
    };
    let resolution = frequencies[0] / e.excited_lines[0] as f64;
    let found = e.distortion.as_ref().and_then(|d| d.detection.as_ref());
    let detection = found.map_or_else(Vec::new, |d| {
        d.lines
            .iter()
            .enumerate()
            .map(|(k, &line)| DetectionLine {
                line,
                frequency_hz: resolution * line as f64,
                parity: if line % 2 == 0 { "even" } else { "odd" },
                level: d.output_level[k * ny..(k + 1) * ny].to_vec(),
                noise: d.output_noise[k * ny..(k + 1) * ny].to_vec(),
            })
            .collect()
    });
    ExperimentInfo {
        purpose,
        position: e.estimate.position().cloned(),
        records: at.records.clone(),
        band_hz: [frequencies[0], frequencies[frequencies.len() - 1]],
        periods_used: e.periods_used,
        periods_skipped: e.periods_skipped,
        instrument: match e.instrument {
            Instrument::References => "references",
            Instrument::Inputs | Instrument::Auto => "inputs",
        },
        condition: [e.condition.worst, e.condition.worst_frequency_hz],
        frf_deviation: Spread::of(&lines.iter().map(|l| l.frf_deviation).collect::<Vec<_>>()),
        output_snr_db: by(ny, |l| &l.output_snr_db),
        input_snr_db: by(nu, |l| &l.input_snr_db),
        coherence: by(ny, |l| &l.coherence),
        noise: at.noise.clone(),
        odd_distortion: found.and_then(|d| d.odd_relative.clone()),
        even_distortion: found.and_then(|d| d.even_relative.clone()),
        realisation_distortion: e
            .distortion
            .as_ref()
            .and_then(|d| d.realisations.as_ref())
            .map(|r| r.nonlinear_relative.clone()),
        lines,
        detection,
    }
}
