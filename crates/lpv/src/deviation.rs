//! How well the frozen response of a small LFR is known.

use crate::{Identified, PipelineError};
use lfr_fit::{Refined, ResidualUnit};
use lpv_core::nalgebra::DMatrix;
use lpv_core::num_complex::Complex;
use lpv_core::{Continuous, Discrete, Frf, FrfEstimate};
use serde::{Deserialize, Serialize};

/// A table over `[position][line][output][input]`.
pub type ChannelTable = Vec<Vec<Vec<Vec<f64>>>>;

/// Standard deviation of the frozen response of the model, from the covariance of the fit.
///
/// The response is that of the model held at p, sampled with the input held between samples. The error of a channel
/// `F_ij`, a complex number, is split along and across `F_ij`: the first part is the error of its size, the second over
/// `|F_ij|` the error of its phase in radians, both to first order. The deviation of the channel, the root of
/// `E |dF_ij|^2`, is the root of the sum of both squares. What the model cannot represent comes on top.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrozenDeviation {
    /// Where the responses were measured.
    pub positions: Vec<f64>,
    /// Some of the measured lines, Hz, increasing.
    pub frequencies_hz: Vec<f64>,
    /// Deviation of the error along `F_ij`, in the unit of the response.
    pub in_phase: ChannelTable,
    /// Deviation of the error across `F_ij`, in the unit of the response.
    pub quadrature: ChannelTable,
}

/// Most lines of the table.
const LINES: usize = 60;

impl FrozenDeviation {
    /// For a small LFR that was fitted to responses of known noise; none for another model.
    ///
    /// # Errors
    /// None for a model of these responses.
    pub fn of(
        identified: &Identified,
        estimates: &[FrfEstimate],
        clock: Discrete,
    ) -> Result<Option<Self>, PipelineError> {
        let (Identified::Lpv(stage), Some(first)) = (identified, estimates.first()) else {
            return Ok(None);
        };
        let Some(small) = &stage.small else {
            return Ok(None);
        };
        let positions = estimates
            .iter()
            .map(|e| e.single_position().unwrap_or(0.0))
            .collect();
        Self::of_fit(&small.fit, positions, spread(first.frf().frequencies_hz()), clock)
    }

    /// At these positions and lines; none for a fit to responses without a covariance.
    ///
    /// # Errors
    /// A position outside the range of the fit, a line above Nyquist.
    fn of_fit(
        fit: &Refined<Continuous>,
        positions: Vec<f64>,
        frequencies_hz: Vec<f64>,
        clock: Discrete,
    ) -> Result<Option<Self>, PipelineError> {
        if fit.account.unit != ResidualUnit::StandardDeviation {
            return Ok(None);
        }
        let (mut in_phase, mut quadrature) = (Vec::new(), Vec::new());
        for &p in &positions {
            let frozen = fit.candidate.frozen(&[p])?.zero_order_hold(clock)?;
            let response = frozen.frequency_response(&frequencies_hz)?;
            let covariances = fit.response_covariance(&[p], &frequencies_hz)?;
            in_phase.push(deviations(&response, &covariances, |along| along));
            quadrature.push(deviations(&response, &covariances, |along| along * Complex::i()));
        }
        Ok(Some(Self {
            positions,
            frequencies_hz,
            in_phase,
            quadrature,
        }))
    }
}

/// Deviation of every channel in the direction that `direction` makes of its own, by line, output and input. The
/// covariances are those of [`Refined::response_covariance`].
fn deviations(
    response: &Frf,
    covariances: &[DMatrix<f64>],
    direction: fn(Complex<f64>) -> Complex<f64>,
) -> Vec<Vec<Vec<f64>>> {
    let (ny, nu) = (response.outputs(), response.inputs());
    let entry = |k: usize, i: usize, j: usize| {
        let value = response.line(k)[(i, j)];
        let own = match value.norm() {
            0.0 => Complex::new(1.0, 0.0),
            size => value / size,
        };
        let (re, im) = (j * ny + i, ny * nu + j * ny + i);
        let (s, d) = (&covariances[k], direction(own));
        let variance =
            d.re * d.re * s[(re, re)] + 2.0 * d.re * d.im * s[(re, im)] + d.im * d.im * s[(im, im)];
        rounded(variance.max(0.0).sqrt())
    };
    let row = |k: usize, i: usize| (0..nu).map(|j| entry(k, i, j)).collect();
    let line = |k: usize| (0..ny).map(|i| row(k, i)).collect();
    (0..response.len()).map(line).collect()
}

/// To four digits: more say nothing about a deviation.
fn rounded(value: f64) -> f64 {
    if value <= 0.0 || !value.is_finite() {
        return value;
    }
    let unit = 10.0_f64.powf(3.0 - value.log10().floor());
    (value * unit).round() / unit
}

/// At most [`LINES`] of the lines above zero, as evenly over their logarithm as they allow.
fn spread(lines: &[f64]) -> Vec<f64> {
    let lines: Vec<f64> = lines.iter().copied().filter(|f| *f > 0.0).collect();
    let (Some(&low), Some(&high)) = (lines.first(), lines.last()) else {
        return Vec::new();
    };
    if lines.len() <= LINES {
        return lines;
    }
    let mut chosen: Vec<f64> = (0..LINES)
        .map(|n| {
            let wanted = low * (high / low).powf(n as f64 / (LINES - 1) as f64);
            let after = lines.partition_point(|f| *f < wanted).min(lines.len() - 1);
            let before = after.saturating_sub(1);
            if wanted / lines[before] < lines[after] / wanted {
                lines[before]
            } else {
                lines[after]
            }
        })
        .collect();
    chosen.dedup();
    chosen
}

#[cfg(test)]
mod tests;
