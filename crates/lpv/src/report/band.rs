//! How well the frozen response is known, at the positions and lines of a figure.

use super::Subject;
use crate::{FrozenDeviation, PipelineError};
use lpv_core::Frf;
use lpv_report::{Colour, Series};
use lpv_simulate::Frozen;

/// A magnitude that is known no better than this has no lower edge: on its logarithmic axis that would lead nowhere.
const UNKNOWN: f64 = 0.9;

/// Deviations on either side of a curve.
const WIDTH: f64 = 2.0;

/// Deviations at one position, relative to the response, on the lines of the table.
pub(super) struct Known<'a> {
    table: &'a FrozenDeviation,
    at: usize,
    response: Frf,
}

impl<'a> Known<'a> {
    /// At the position of the table nearest to p; none without a table for the sample time of the figure.
    pub(super) fn new(s: &'a Subject, p: f64) -> Result<Option<Self>, PipelineError> {
        let here = s.clock.sample_time();
        let table = s.file.identification.as_ref().and_then(|account| {
            let same = (account.sample_time? / here - 1.0).abs() < 1e-6;
            account.frozen_deviation.as_ref().filter(|_| same)
        });
        let Some(table) = table else { return Ok(None) };
        let distance = |at: &usize| (table.positions[*at] - p).abs();
        let nearest = (0..table.positions.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
        let Some(at) = nearest else { return Ok(None) };
        let frozen = s.machine.at(&[table.positions[at]])?;
        Ok(Some(Self {
            table,
            at,
            response: frozen.frequency_response(&table.frequencies_hz)?,
        }))
    }

    /// Deviations of size and phase (radians) of a channel, both relative to its size, at any line: linear between those
    /// of the table over the logarithm of the frequency. None outside the table.
    fn channel(&self, i: usize, j: usize, frequency_hz: f64) -> Option<[f64; 2]> {
        let lines = &self.table.frequencies_hz;
        let after = lines.partition_point(|f| *f < frequency_hz * (1.0 - 1e-9));
        let before = if lines.get(after)? * (1.0 - 1e-9) <= frequency_hz {
            after
        } else {
            after.checked_sub(1)?
        };
        let relative = |k: usize| {
            let of = |table: &crate::ChannelTable| Some(*table.get(self.at)?.get(k)?.get(i)?.get(j)?);
            let size = self.response.line(k)[(i, j)].norm();
            Some([
                of(&self.table.in_phase)? / size,
                of(&self.table.quadrature)? / size,
            ])
        };
        let (low, high) = (relative(before)?, relative(after)?);
        let step = (lines[after] / lines[before]).ln();
        let t = if step > 0.0 {
            (frequency_hz / lines[before]).ln() / step
        } else {
            0.0
        };
        Some([0, 1].map(|n| (1.0 - t) * low[n] + t * high[n]))
    }

    /// The band of the magnitude about a curve.
    pub(super) fn magnitude(&self, response: &Frf, i: usize, j: usize, n: usize) -> Series {
        let edges: Vec<(f64, f64, f64)> = response
            .frequencies_hz()
            .iter()
            .zip(response.channel(i, j))
            .filter_map(|(&f, g)| {
                let half = WIDTH * self.channel(i, j, f)?[0];
                let lower = if half > UNKNOWN { 0.0 } else { 1.0 - half };
                Some((f, g.norm() * lower, g.norm() * (1.0 + half)))
            })
            .collect();
        Series::band(&edges).colour(Colour::Index(n))
    }

    /// The bands of the phase in degrees: one between every two jumps from -180 to 180.
    pub(super) fn phase(&self, response: &Frf, i: usize, j: usize, n: usize) -> Vec<Series> {
        let edges: Vec<(f64, f64, f64)> = response
            .frequencies_hz()
            .iter()
            .zip(response.channel(i, j))
            .filter_map(|(&f, g)| {
                let half = (WIDTH * self.channel(i, j, f)?[1]).to_degrees().min(180.0);
                let phase = g.arg().to_degrees();
                Some((f, phase - half, phase + half))
            })
            .collect();
        edges
            .chunk_by(|a, b| (a.1 + a.2 - b.1 - b.2).abs() < 360.0)
            .map(|run| Series::band(run).colour(Colour::Index(n)))
            .collect()
    }

    /// Deviation of the whole matrix relative to it, by line.
    pub(super) fn relative(&self) -> Vec<(f64, f64)> {
        let square = |table: &crate::ChannelTable, k: usize| -> f64 {
            let line = table.get(self.at).and_then(|t| t.get(k));
            line.into_iter().flatten().flatten().map(|v| v * v).sum()
        };
        (0..self.response.len())
            .map(|k| {
                let variance = square(&self.table.in_phase, k) + square(&self.table.quadrature, k);
                (
                    self.table.frequencies_hz[k],
                    variance.sqrt() / self.response.line(k).norm(),
                )
            })
            .collect()
    }
}
