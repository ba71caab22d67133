//! What effects see of the data before they are fitted.

mod pulses;

use crate::base::{Base, Motion, Pair};
use crate::inverse::Moved;
use crate::track::{Track, grow_with_time};
use nalgebra::{DMatrix, DVector};
pub(crate) use pulses::Pulses;
use rayon::prelude::*;

/// The records along the present model, and its residual with all that the machine's parameters explain taken out.
pub struct Screen<'a> {
    /// The machine.
    pub base: &'a Base,
    /// Records.
    pub tracks: &'a [Track],
    /// Motions of the present model, by record and sample.
    pub motions: Vec<Vec<Motion>>,
    /// Steps of the grids on which readings lie, by output; zero where they lie on none.
    pub resolution: Pair,
    pub(crate) known: Known,
    /// What was measured of an axis that an observer holds at its records, by record.
    pub(crate) moved: Option<Vec<Moved>>,
    /// The loop at rest, for a quick look.
    pub(crate) pulses: Pulses,
}

/// Residual and columns of the machine's parameters.
pub(crate) struct Known {
    /// Orthonormal basis of the columns.
    pub(crate) basis: DMatrix<f64>,
    /// Residual outside it.
    pub(crate) left: DVector<f64>,
    /// The whole residual, and from the coarse integration.
    pub(crate) residual: DVector<f64>,
    pub(crate) rough: Vec<f64>,
}

impl Known {
    pub(crate) fn new(columns: DMatrix<f64>, residual: &[f64], rough: Vec<f64>) -> Self {
        let basis = columns.qr().q();
        let residual = DVector::from_column_slice(residual);
        let left = &residual - &basis * basis.tr_mul(&residual);
        Self {
            basis,
            left,
            residual,
            rough,
        }
    }
}

/// A force or a sensor error to try, by record and sample.
pub enum Trial {
    /// Forces of the motors.
    Motors(Vec<Vec<Pair>>),
    /// Added to the outputs.
    Outputs(Vec<Vec<Pair>>),
}

impl Screen<'_> {
    /// Largest travel of a motor in a record.
    pub fn travel(&self, motor: usize) -> f64 {
        let records = self.motions.iter();
        largest_span(records.map(|record| record.iter().map(|m| m.motor_position[motor])))
    }

    /// Largest distance of a motor from zero.
    pub fn farthest(&self, motor: usize) -> f64 {
        let all = self.motions.iter().flatten();
        all.map(|m| m.motor_position[motor].abs()).fold(0.0, f64::max)
    }

    /// Whether the position of a motor and time grow alike, so that a force that depends on where it is cannot be told from friction that
    /// changes in time.
    pub fn grows_with_time(&self, motor: usize) -> bool {
        let one = |record: &Vec<Motion>| record.iter().map(|m| m.motor_position[motor]).collect();
        grow_with_time(&self.motions.iter().map(one).collect::<Vec<_>>())
    }

    /// Shortest and longest periods that the readings of a sensor show: two steps of their grid, and their largest travel in a
    /// record.
    pub fn periods(&self, output: usize) -> (f64, f64) {
        let records = self.tracks.iter();
        let travel = largest_span(records.map(|track| track.outputs.iter().map(|y| y[output])));
        (2.0 * self.resolution[output], travel)
    }

    /// Largest speed of a motor.
    pub fn top_speed(&self, motor: usize) -> f64 {
        let all = self.motions.iter().flatten();
        all.map(|m| m.motor_speed[motor].abs()).fold(0.0, f64::max)
    }

    /// Sizes of an input, the largest last.
    pub fn input_sizes(&self, channel: usize) -> Vec<f64> {
        let inputs = self.tracks.iter().flat_map(|t| &t.inputs);
        let mut all: Vec<f64> = inputs.map(|u| u[channel].abs()).collect();
        all.sort_by(f64::total_cmp);
        all
    }

    /// Root mean square of the deflection of a coupling.
    pub fn deflection(&self, i: usize) -> f64 {
        let count = self.motions.iter().map(Vec::len).sum::<usize>().max(1);
        let sum: f64 = self
            .motions
            .iter()
            .flatten()
            .map(|m| m.deflection[i].powi(2))
            .sum();
        (sum / count as f64).sqrt()
    }

    /// Further measured signals.
    pub fn auxiliaries(&self) -> usize {
        self.tracks.iter().map(|t| t.auxiliary.len()).min().unwrap_or(0)
    }

    /// Indices of the further signals that are temperatures and change, with their means.
    pub fn temperatures(&self) -> Vec<(usize, f64)> {
        Track::warming(self.tracks)
    }

    /// Shortest record in time.
    pub fn shortest(&self) -> f64 {
        let duration = |t: &Track| t.step * t.samples as f64;
        self.tracks.iter().map(duration).fold(f64::INFINITY, f64::min)
    }

    /// Longest record in time.
    pub fn duration(&self) -> f64 {
        Track::longest(self.tracks)
    }

    /// Time from sample to sample.
    pub fn step(&self) -> f64 {
        self.tracks.first().map_or(1.0, |t| t.step)
    }

    /// Sine and cosine of a phase at every sample, each times what goes with it, by record.
    pub fn waves(&self, value: impl Fn(&Track, usize, &Motion) -> (f64, Pair)) -> [Vec<Vec<Pair>>; 2] {
        let mut waves = [Vec::new(), Vec::new()];
        for (track, motions) in self.tracks.iter().zip(&self.motions) {
            let all = motions.iter().enumerate().map(|(k, motion)| {
                let (phase, gains) = value(track, k, motion);
                let (sine, cosine) = phase.sin_cos();
                (gains.map(|g| g * sine), gains.map(|g| g * cosine))
            });
            let (sine, cosine): (Vec<Pair>, Vec<Pair>) = all.unzip();
            waves[0].push(sine);
            waves[1].push(cosine);
        }
        waves
    }

    /// Amplitudes of some signals that explain the most of the residual, and the part of its squares that they explain.
    ///
    /// A quick look: a machine from first principles counts as rigid, and its decoupling as perfect, so that each channel is a
    /// double integrator in its loop; an identified model counts as it is in the middle of its range.
    pub fn explain(&self, trials: &[Trial]) -> Option<(f64, Vec<f64>)> {
        let known = &self.known;
        let rows = known.left.len();
        let mut columns = DMatrix::zeros(rows, trials.len());
        for (j, trial) in trials.iter().enumerate() {
            let mut column = Vec::with_capacity(rows);
            for (r, track) in self.tracks.iter().enumerate() {
                let at = |k: usize| track.scheduling(k)[0];
                match trial {
                    Trial::Motors(f) => {
                        let input = |(k, f): (usize, &Pair)| self.base.as_input(at(k), *f);
                        let inputs: Vec<Pair> = f[r].iter().enumerate().map(input).collect();
                        self.pulses.inputs(&inputs, &mut column);
                    }
                    Trial::Outputs(y) => self.pulses.sensors(&y[r], &mut column),
                }
            }
            column.resize(rows, 0.0);
            columns.column_mut(j).copy_from_slice(&column);
        }
        let columns = &columns - &known.basis * known.basis.tr_mul(&columns);
        let normal = columns.tr_mul(&columns);
        let right = columns.tr_mul(&known.left);
        let scale = normal.diagonal().max();
        let ridge = DMatrix::identity(trials.len(), trials.len()) * (1e-12 * scale);
        let found = (normal + ridge).cholesky()?.solve(&right);
        let part = found.dot(&right) / known.left.norm_squared();
        Some((part, found.iter().copied().collect()))
    }

    /// The best of many sets of signals, as its index and amplitudes; and the next best that is no neighbour.
    pub fn best(&self, count: usize, trials: impl Fn(usize) -> Vec<Trial> + Sync) -> Vec<(usize, Vec<f64>)> {
        let found: Vec<(f64, Vec<f64>)> = (0..count)
            .into_par_iter()
            .map(|i| self.explain(&trials(i)).unwrap_or((0.0, Vec::new())))
            .collect();
        let mut order: Vec<usize> = (0..count).filter(|i| !found[*i].1.is_empty()).collect();
        order.sort_by(|a, b| found[*b].0.total_cmp(&found[*a].0));
        let mut chosen: Vec<(usize, Vec<f64>)> = Vec::new();
        for i in order {
            if chosen.len() < 2 && chosen.iter().all(|(other, _)| other.abs_diff(i) > 3) {
                chosen.push((i, found[i].1.clone()));
            }
        }
        chosen
    }

    /// The frequencies of the highest lines of the residual, all records and outputs together, Hz.
    pub fn peaks(&self, count: usize) -> Vec<f64> {
        // Twice the longest record: lines at half its resolution.
        let length = 2 * self.tracks.iter().map(|t| t.samples).max().unwrap_or(1);
        let width = 1.0 / (length as f64 * self.step());
        let lines = (0.45 * length as f64) as usize;
        let transform = realfft::RealFftPlanner::<f64>::new().plan_fft_forward(length);
        let mut power = vec![0.0; lines];
        let mut first = 0;
        for samples in self.tracks.iter().map(|t| t.samples) {
            for _ in 0..self.base.channels() {
                let mut padded = transform.make_input_vec();
                padded[..samples].copy_from_slice(&self.known.left.as_slice()[first..first + samples]);
                first += samples;
                let mut spectrum = transform.make_output_vec();
                // Lengths are those of the plan.
                if transform.process(&mut padded, &mut spectrum).is_ok() {
                    let each = power.iter_mut().zip(&spectrum[1..]);
                    each.for_each(|(sum, line)| *sum += line.norm_sqr());
                }
            }
        }
        let mut order: Vec<usize> = (0..lines).collect();
        order.sort_by(|a, b| power[*b].total_cmp(&power[*a]));
        let mut chosen: Vec<usize> = Vec::new();
        for line in order {
            if chosen.len() < count && chosen.iter().all(|other| other.abs_diff(line) > 6) {
                chosen.push(line);
            }
        }
        chosen.into_iter().map(|line| width * (line + 1) as f64).collect()
    }
}

/// Largest difference of two values of one record.
fn largest_span(records: impl Iterator<Item = impl Iterator<Item = f64>>) -> f64 {
    let span = |record: &mut dyn Iterator<Item = f64>| {
        let ends = record.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
            (low.min(v), high.max(v))
        });
        ends.1 - ends.0
    };
    records.map(|mut r| span(&mut r)).fold(0.0, f64::max)
}
