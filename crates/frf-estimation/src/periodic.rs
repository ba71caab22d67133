//! From averaged spectra to the FRF, its covariance and the account.

use crate::averages::{Averages, Layout};
use crate::detection::{self, DetectionLines};
use crate::lines::{EachLine, LineEstimates};
use crate::realisations::{self, RealisationDistortion};
use crate::selection;
use crate::{CovarianceSource, FrfError, Instrument};
use lpv_core::{Frf, FrfEstimate};

/// The FRF at one position with everything that tells how far to trust it. "By line" means by estimated line, in the
/// order of `excited_lines`; spectra are amplitude spectra `(1/N) sum x exp(-j...)` in the units of the signals.
#[derive(Debug, Clone)]
pub struct PeriodicEstimate {
    /// Equation (15) where references are the instruments, else (14), with covariance, excited lines only.
    pub estimate: FrfEstimate,
    /// Equation (14), `Y U^-1`; least squares where there are more experiments than inputs, and then biased in closed loop.
    pub direct: Frf,
    /// The instrument that was used; never `Auto`.
    pub instrument: Instrument,
    /// Estimated lines, in cycles a period.
    pub excited_lines: Vec<usize>,
    /// Periods used of the experiment that has the fewest.
    pub periods_used: usize,
    /// Periods dropped at the start of each experiment.
    pub periods_skipped: usize,
    /// Fourier transforms of one period of one signal: the unit of work.
    pub transforms: usize,
    /// Power of the averaged output over the noise power in it, by line, then by output; without noise infinite, or what
    /// rounding makes of it, 1e25 and more.
    pub output_snr: Vec<f64>,
    /// The same for the inputs.
    pub input_snr: Vec<f64>,
    /// Conditioning of `U R^H`.
    pub condition: Condition,
    /// Noise where nothing was excited; empty if every line was.
    pub noise_floor: NoiseFloor,
    /// What the plant adds beyond a linear response and noise, where the experiments can show it.
    pub distortion: Option<Distortion>,
}

/// Condition number `||A||_F ||A^-1||_F / n_u` of the matrix `A` that was inverted at each line (`U R^H`; for (14) `U`, or
/// `U U^H` for more experiments than inputs), rows and columns scaled to unit length so that units do not count.
#[derive(Debug, Clone, PartialEq)]
pub struct Condition {
    /// By line.
    pub by_line: Vec<f64>,
    /// The largest.
    pub worst: f64,
    /// Line of the largest, in cycles a period.
    pub worst_line: usize,
    /// Its frequency, Hz.
    pub worst_frequency_hz: f64,
}

/// Standard deviation from period to period of the spectra at lines that were not excited, pooled over experiments.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct NoiseFloor {
    /// The lines, in cycles a period.
    pub lines: Vec<usize>,
    /// Deviation of one period, by line, then by output.
    pub outputs: Vec<f64>,
    /// Deviation of one period, by line, then by input.
    pub inputs: Vec<f64>,
}

/// Nonlinear distortion, by the two methods of Pintelon and Schoukens (System Identification, 2nd ed., ch. 4).
#[derive(Debug, Clone, PartialEq)]
pub struct Distortion {
    /// Robust method: variance over realisations against variance over periods; needs at least `2 n_u` experiments.
    pub realisations: Option<RealisationDistortion>,
    /// Fast method: levels at detection lines between the excited ones.
    pub detection: Option<DetectionLines>,
}

impl Averages<'_> {
    pub(crate) fn estimate(&self) -> Result<PeriodicEstimate, FrfError> {
        let (ny, nu) = (self.layout.outputs, self.layout.inputs);
        let instrument = self.choose_instrument()?;
        let selection = selection::select(self, instrument)?;
        let excited = selection.lines;
        let frequencies_hz: Vec<f64> = excited.iter().map(|&k| self.layout.frequency_hz(k)).collect();
        let mut totals = self
            .wants_realisations()
            .then(|| realisations::Residuals::new(ny, self.layout.experiments));
        let LineEstimates {
            values,
            direct,
            mut c_v,
            s,
            conditions,
        } = pulp::Arch::new().dispatch(EachLine {
            averages: self,
            lines: &excited,
            instrument,
            residuals: totals.as_mut(),
        })?;
        let share = self.share_of_noise();
        let snr = |channels: std::ops::Range<usize>| {
            let mut all = Vec::with_capacity(excited.len() * channels.len());
            for &k in &excited {
                all.extend(channels.clone().map(|c| self.snr(share, c, k)));
            }
            all
        };

        let mut degrees = self.weights().degrees_of_freedom;
        let realisations = totals.map(|t| {
            let smoothed = t.smooth(self.settings.smoothing_half_width, ny);
            if self.settings.covariance == CovarianceSource::Auto {
                for (c, n) in c_v.iter_mut().zip(&smoothed.nonlinear) {
                    *c += n;
                }
                degrees = degrees.min(smoothed.degrees_of_freedom);
            }
            smoothed.distortion
        });
        let frf = Frf::new(frequencies_hz.clone(), ny, nu, values)?;
        let detection = detection::detect(self, &excited, &selection.quiet, &frf);
        let condition = worst(&conditions, &excited, &frequencies_hz);
        Ok(PeriodicEstimate {
            noise_floor: self.noise_floor(&selection.quiet),
            output_snr: snr(0..ny),
            input_snr: snr(ny..ny + nu),
            estimate: FrfEstimate::new(frf, c_v, s, degrees, self.position.clone())?,
            direct: Frf::new(frequencies_hz, ny, nu, direct)?,
            instrument,
            excited_lines: excited,
            periods_used: self
                .experiments
                .iter()
                .map(|e| e.signals.count())
                .min()
                .unwrap_or(0),
            periods_skipped: self.skipped,
            transforms: self.transforms,
            condition,
            distortion: (realisations.is_some() || detection.is_some()).then_some(Distortion {
                realisations,
                detection,
            }),
        })
    }

    fn wants_realisations(&self) -> bool {
        self.layout.experiments >= 2 * self.layout.inputs
    }

    fn choose_instrument(&self) -> Result<Instrument, FrfError> {
        let Layout {
            references, inputs, ..
        } = self.layout;
        let moves = self.experiments.iter().any(|e| e.reference_moves);
        match self.settings.instrument {
            Instrument::Auto if references == inputs && moves => Ok(Instrument::References),
            Instrument::Auto | Instrument::Inputs => Ok(Instrument::Inputs),
            Instrument::References if references != inputs => {
                Err(FrfError::References { references, inputs })
            }
            Instrument::References if !moves => Err(FrfError::NoExcitation {
                what: "the reference",
            }),
            Instrument::References => Ok(Instrument::References),
        }
    }

    /// With `M_e` periods the mean of experiment `e` has covariance `C / M_e`, `C` pooled over the experiments with
    /// `sum (M_e - 1)` degrees of freedom. `C_V = C / M` with `M` the harmonic mean of the `M_e`; the ratios `M / M_e`
    /// enter `S = G^H diag(M / M_e) G`, so unequal numbers of periods are exact.
    pub(crate) fn weights(&self) -> Weights {
        let counts = || self.experiments.iter().map(|e| e.signals.count() as f64);
        let degrees_of_freedom: f64 = counts().map(|m| m - 1.0).sum();
        let mean = self.experiments.len() as f64 / counts().map(|m| 1.0 / m).sum::<f64>();
        Weights {
            covariance_scale: 1.0 / (degrees_of_freedom * mean),
            experiment: counts().map(|m| mean / m).collect(),
            degrees_of_freedom,
        }
    }

    /// Ratio of signal power to noise power in averaged channels, both summed over experiments, is the power of the means over
    /// this share of the scatter: the mean of experiment `e` has the covariance `C / M_e`.
    pub(crate) fn share_of_noise(&self) -> f64 {
        let counts = self.experiments.iter().map(|e| e.signals.count() as f64);
        counts.map(|m| 1.0 / m).sum::<f64>() / self.weights().degrees_of_freedom
    }

    /// Power of the averaged channel at line `k` over its [share](Self::share_of_noise) of the scatter, outputs before inputs; zero
    /// without a signal.
    pub(crate) fn snr(&self, share: f64, channel: usize, k: usize) -> f64 {
        let place = self.order.place(k);
        let means = self.experiments.iter().map(|e| e.signals.at(channel, place));
        let signal: f64 = means.map(|z| z.norm_sqr()).sum();
        if signal > 0.0 {
            signal / (share * self.scatter.diagonal(channel, place))
        } else {
            0.0
        }
    }

    fn noise_floor(&self, lines: &[usize]) -> NoiseFloor {
        let Layout {
            outputs: ny,
            inputs: nu,
            ..
        } = self.layout;
        let degrees = self.weights().degrees_of_freedom;
        let deviation = |channels: std::ops::Range<usize>| {
            let mut values = Vec::with_capacity(lines.len() * channels.len());
            for &k in lines {
                for c in channels.clone() {
                    values.push((self.scatter.diagonal(c, self.order.place(k)) / degrees).sqrt());
                }
            }
            values
        };
        NoiseFloor {
            lines: lines.to_vec(),
            outputs: deviation(0..ny),
            inputs: deviation(ny..ny + nu),
        }
    }
}

pub(crate) fn worst(by_line: &[f64], lines: &[usize], frequencies_hz: &[f64]) -> Condition {
    let at = (0..by_line.len()).fold(0, |b, i| if by_line[i] > by_line[b] { i } else { b });
    Condition {
        worst: by_line[at],
        worst_line: lines[at],
        worst_frequency_hz: frequencies_hz[at],
        by_line: by_line.to_vec(),
    }
}

/// Factors that turn pooled scatter into covariance.
pub(crate) struct Weights {
    pub(crate) covariance_scale: f64,
    pub(crate) experiment: Vec<f64>,
    pub(crate) degrees_of_freedom: f64,
}
