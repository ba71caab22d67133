//! Records as the simulation reads them.

mod alike;
mod beginning;
pub(crate) mod smooth;
mod units;

use crate::TraceError;
use crate::base::{Pair, Start};
pub(crate) use alike::grow_with_time;
use beginning::{BEGINNING, beginning};
use lpv_core::{ControllerState, Record};
use lpv_numerics::statistics::range;
use nalgebra::{DMatrix, DVector};
pub(crate) use units::turn_in;

/// One record: signals by sample, and the scheduling between the samples.
#[derive(Debug, Clone)]
pub struct Track {
    /// Name of the record.
    pub name: String,
    /// Its place among the records of an experiment, counted from one; zero where it has none.
    pub number: usize,
    /// Samples.
    pub samples: usize,
    /// Time from sample to sample.
    pub step: f64,
    /// Outputs, by sample.
    pub outputs: Vec<Pair>,
    /// Recorded inputs, by sample.
    pub inputs: Vec<Pair>,
    /// Further measured signals, by signal and sample.
    pub auxiliary: Vec<Vec<f64>>,
    /// Those that are temperatures.
    temperatures: Vec<usize>,
    /// A whole turn, where the first output is an angle.
    pub(crate) turn: Option<f64>,
    pub(crate) references: Vec<Pair>,
    pub(crate) injections: Vec<Pair>,
    /// p and its rate at the ends and middles of the sub-steps, `2 * substeps` a sample.
    pub(crate) path: Vec<[f64; 2]>,
    pub(crate) substeps: usize,
    /// Half of one of them, in samples.
    pub(crate) half: f64,
    /// Outputs beyond which a simulation has lost the record.
    pub(crate) bound: Pair,
    /// Where the outputs begin.
    pub(crate) start: Start,
    /// Outputs of which that is what the sensor tells, as far as its noise lets see; else it is where the machine is.
    pub(crate) is_read: [bool; 2],
    /// Whether the reference is what was measured: then its noise is in what an observer makes of it.
    pub(crate) follows: bool,
    /// Whether the logged inputs run on between the samples; else they are held.
    pub(crate) runs_on: bool,
    /// Injections at the points of the path and the end, if they run on.
    pub(crate) between: Vec<Pair>,
    /// The controller at the first sample, unless it is at rest.
    pub(crate) moving: Option<ControllerState>,
    /// What other beginnings make of the first output, orthonormal; none where the record begins as it is told.
    free: Vec<DVector<f64>>,
}

/// Outputs over the largest of the record beyond which a simulation has lost it.
const LOST: f64 = 1e6;
/// Deviations of the noise within which a first reading is where the record begins.
const SAME: f64 = 3.0;
impl Track {
    /// Samples that a record needs.
    pub const LEAST: usize = 32;

    /// Whether an output falls below an earlier value by at least so much, and whether it rises above one.
    pub(crate) fn goes(&self, output: usize, least: f64) -> [bool; 2] {
        let ends = (f64::NEG_INFINITY, f64::INFINITY, false, false);
        let values = self.outputs.iter().map(|y| y[output]);
        let (.., falls, rises) = values.fold(ends, |(high, low, falls, rises), y| {
            let (high, low) = (high.max(y), low.min(y));
            (high, low, falls || y < high - least, rises || y > low + least)
        });
        [falls, rises]
    }

    /// Whether an output goes both ways in these records, in one of them or in several: by a part of its longest travel.
    pub fn go_both_ways(tracks: &[Self], output: usize) -> bool {
        const WAY: f64 = 0.01;
        let least = WAY * Self::travel(tracks, output);
        let ways = tracks.iter().map(|t| t.goes(output, least));
        ways.fold([false; 2], |a, b| [a[0] || b[0], a[1] || b[1]]) == [true; 2]
    }

    /// Largest travel of an output in one of some records.
    pub fn travel(tracks: &[Self], output: usize) -> f64 {
        let travel = |t: &Self| {
            let (low, high) = range(&t.outputs.iter().map(|y| y[output]).collect::<Vec<_>>());
            high - low
        };
        tracks.iter().map(travel).fold(0.0, f64::max)
    }

    /// Largest distance of an output from zero in some records.
    pub(crate) fn farthest(tracks: &[Self], output: usize) -> f64 {
        let distances = tracks.iter().flat_map(|t| &t.outputs).map(|y| y[output].abs());
        distances.fold(0.0, f64::max)
    }

    /// The longest of some records in time.
    pub fn longest(tracks: &[Self]) -> f64 {
        let duration = |t: &Self| t.step * t.samples as f64;
        tracks.iter().map(duration).fold(0.0, f64::max)
    }

    /// Whether a record can be simulated.
    ///
    /// # Errors
    /// [`TraceError::Record`] where there are no references, or more channels than a base model has, or too few samples.
    pub fn check(record: &Record) -> Result<(), TraceError> {
        let refused = |problem: &str| TraceError::Record {
            record: record.name.clone(),
            problem: problem.to_owned(),
        };
        if record.outputs.channels() > 2 || record.inputs.channels() > 2 {
            return Err(refused("a base model has one or two inputs and outputs"));
        }
        if record.references.channels() == 0 {
            return Err(refused("the closed loop needs [channels.reference]"));
        }
        if record.len() < Self::LEAST {
            return Err(refused(&format!(
                "it has {} samples, and a simulation is compared over {} at least; leave it out or record longer",
                record.len(),
                Self::LEAST
            )));
        }
        Ok(())
    }

    /// A record begins at rest at its first references. Where its controller was moving already, as the logged inputs tell (see
    /// [`ControllerState::begun`]), it begins with the outputs and rates that its first samples have.
    ///
    /// # Errors
    /// Those of [`Track::check`].
    pub fn new(
        record: &Record,
        step: f64,
        substeps: usize,
        controller: Option<&ControllerState>,
    ) -> Result<Self, TraceError> {
        Self::check(record)?;
        let samples = record.len();
        let pairs = |columns: &[Vec<f64>]| -> Vec<Pair> {
            (0..samples)
                .map(|k| [0, 1].map(|i: usize| columns.get(i).map_or(0.0, |c| c[k])))
                .collect()
        };
        let still = vec![0.0; samples];
        let p = record.scheduling.columns.first().unwrap_or(&still);
        let largest = |columns: &[Vec<f64>], i: usize| {
            let column = columns.get(i).map_or(&[][..], Vec::as_slice);
            column.iter().fold(0.0_f64, |m, v| m.max(v.abs()))
        };
        let bound = [0, 1].map(|i: usize| {
            let reach = largest(&record.outputs.columns, i).max(largest(&record.references.columns, i));
            if reach > 0.0 { LOST * reach } else { f64::MAX }
        });
        let references = pairs(&record.references.columns);
        let moving = controller.and_then(|c| c.begun(record));
        // An observer follows what was measured: it begins as that does.
        let follows = record.references.columns == record.outputs.columns;
        let mut is_read = [moving.is_some() || follows; 2];
        let mut start = Start {
            position: references[0],
            speed: [0.0; 2],
        };
        if moving.is_some() || follows {
            for (i, y) in record.outputs.columns.iter().enumerate() {
                let [position, rise] = beginning(y);
                (start.position[i], start.speed[i]) = (position, rise / step);
            }
        }
        for (i, y) in record.outputs.columns.iter().enumerate() {
            let rows = y[..Self::LEAST].windows(4).map(|w| [w[0], w[1], w[2], w[3]]);
            is_read[i] |= (y[0] - start.position[i]).abs() <= SAME * roughness(rows);
        }
        Ok(Self {
            start,
            is_read,
            follows,
            runs_on: false,
            between: Vec::new(),
            moving,
            free: Vec::new(),
            bound,
            name: record.name.clone(),
            number: 0,
            samples,
            step,
            outputs: pairs(&record.outputs.columns),
            inputs: pairs(&record.inputs.columns),
            auxiliary: record.auxiliary.columns.clone(),
            turn: record.outputs.units.first().and_then(|u| turn_in(u)),
            temperatures: units::temperatures(&record.auxiliary),
            references,
            injections: pairs(&record.injection.columns),
            path: between(p, step, substeps),
            substeps,
            half: half(substeps),
        })
    }

    /// The same with its place among the records of an experiment, counted from one.
    #[must_use]
    pub fn numbered(self, number: usize) -> Self {
        Self { number, ..self }
    }

    /// The first output and its rate, per unit of time.
    pub fn beginning(&self) -> [f64; 2] {
        [self.start.position[0], self.start.speed[0]]
    }

    /// Deviations with which the first samples tell them: of a parabola at least, since a machine may accelerate. Readings on a grid may not
    /// change there at all, and the machine is anywhere within a step.
    pub fn beginning_deviations(&self) -> [f64; 2] {
        let y: Vec<f64> = self.outputs.iter().take(Self::LEAST).map(|y| y[0]).collect();
        let changes = self.outputs.windows(2).map(|w| (w[1][0] - w[0][0]).abs());
        let step = changes.filter(|c| *c > 0.0).fold(f64::INFINITY, f64::min);
        let rounding = if step.is_finite() {
            step / 12.0_f64.sqrt()
        } else {
            0.0
        };
        let noise = roughness(y.windows(4).map(|w| [w[0], w[1], w[2], w[3]])).max(rounding);
        // Rows 1, k, k^2 of the first samples; the covariance of value and rate at the first of them.
        let rows = DMatrix::from_fn(BEGINNING, 3, |k, j| (k as f64).powi(j as i32));
        let inverse = rows.tr_mul(&rows).try_inverse();
        let part = |i: usize| inverse.as_ref().map_or(1.0, |m| m[(i, i)].sqrt());
        [noise * part(0), noise * part(1) / self.step]
    }

    /// The same record of one output that begins elsewhere.
    #[must_use]
    pub fn beginning_at(&self, [position, speed]: [f64; 2]) -> Self {
        let mut other = self.clone();
        (other.start.position[0], other.start.speed[0]) = (position, speed);
        other
    }

    /// Another record, a part of the same, that is followed alike.
    ///
    /// # Errors
    /// Those of [`Track::check`].
    pub fn part(&self, record: &Record) -> Result<Self, TraceError> {
        let part = Self::new(record, self.step, self.substeps, None)?;
        Ok(if self.runs_on { part.running_on() } else { part })
    }

    /// The same record with inputs that run on between the samples, as those do that were measured and not commanded.
    #[must_use]
    pub fn running_on(&self) -> Self {
        Self {
            runs_on: true,
            between: smooth::points(&self.injections, self.substeps),
            ..self.clone()
        }
    }

    /// The same record in the loop of another controller.
    #[must_use]
    pub fn held_by(&self, record: &Record, controller: &ControllerState) -> Self {
        Self {
            moving: controller.begun(record),
            ..self.clone()
        }
    }

    /// The same record with the scheduling held.
    pub(crate) fn at_rest(&self, position: f64) -> Self {
        Self {
            path: vec![[position, 0.0]; self.path.len()],
            ..self.clone()
        }
    }

    /// The same record with so many parts of a sample.
    #[must_use]
    pub fn followed(&self, substeps: usize) -> Self {
        let p: Vec<f64> = (0..self.samples).map(|k| self.scheduling(k)[0]).collect();
        Self {
            path: between(&p, self.step, substeps),
            between: match self.runs_on {
                true => smooth::points(&self.injections, substeps),
                false => Vec::new(),
            },
            substeps,
            half: half(substeps),
            ..self.clone()
        }
    }

    /// Parts of a sample.
    pub(crate) fn fine(&self) -> usize {
        self.substeps
    }

    /// Parts of a sample that are enough for small differences.
    pub(crate) fn coarse(&self) -> usize {
        if self.substeps.is_multiple_of(2) {
            self.substeps / 2
        } else {
            self.substeps
        }
    }

    /// p and its rate at a sample.
    pub fn scheduling(&self, k: usize) -> [f64; 2] {
        self.at(k, 0)
    }

    /// The same after so many halves of a sub-step.
    pub(crate) fn at(&self, k: usize, halves: usize) -> [f64; 2] {
        self.path[(2 * self.substeps * k + halves).min(self.path.len() - 1)]
    }
}

fn half(substeps: usize) -> f64 {
    0.5 / substeps as f64
}

/// A smooth signal and its rate between the samples: cubic pieces with slopes from four neighbours.
fn between(p: &[f64], step: f64, substeps: usize) -> Vec<[f64; 2]> {
    let n = p.len();
    let at = |i: isize| p[i.clamp(0, n as isize - 1) as usize];
    let slope = |k: usize| {
        let i = k as isize;
        if k < 2 || k + 2 >= n {
            let (before, after) = (at(i - 1), at(i + 1));
            let wide = (i + 1).min(n as isize - 1) - (i - 1).max(0);
            (after - before) / wide.max(1) as f64
        } else {
            slope_of([at(i - 2), at(i - 1), at(i + 1), at(i + 2)])
        }
    };
    let points = 2 * substeps;
    let mut path = Vec::with_capacity(n * points);
    for k in 0..n {
        let (a, b) = (at(k as isize), at(k as isize + 1));
        let (da, db) = (slope(k), slope((k + 1).min(n - 1)));
        for j in 0..points {
            let s = j as f64 / points as f64;
            let [value, rate] = cubic([a, b], [da, db], s);
            path.push([value, rate / step]);
        }
    }
    path
}

/// Rate, per sample, from the two neighbours on either side.
pub(crate) fn slope_of([a, b, c, d]: [f64; 4]) -> f64 {
    (8.0 * (c - b) - (d - a)) / 12.0
}

/// Value and rate of the cubic with these values and rates at 0 and at 1.
pub(crate) fn cubic([a, b]: [f64; 2], [da, db]: [f64; 2], s: f64) -> [f64; 2] {
    let (s2, s3) = (s * s, s * s * s);
    let value = (2.0 * s3 - 3.0 * s2 + 1.0) * a
        + (s3 - 2.0 * s2 + s) * da
        + (3.0 * s2 - 2.0 * s3) * b
        + (s3 - s2) * db;
    let rate = (6.0 * s2 - 6.0 * s) * (a - b) + (3.0 * s2 - 4.0 * s + 1.0) * da + (3.0 * s2 - 2.0 * s) * db;
    [value, rate]
}

/// Deviation of white noise with these third differences, each of four samples in a row; zero without any.
pub fn roughness(rows: impl Iterator<Item = [f64; 4]>) -> f64 {
    let (sum, count) = rows.fold((0.0, 0), |(sum, count), [a, b, c, d]| {
        (sum + (d - 3.0 * c + 3.0 * b - a).powi(2), count + 1)
    });
    (sum / (20.0 * f64::from(count.max(1)))).sqrt()
}

#[cfg(test)]
mod tests {
    use super::between;

    #[test]
    fn a_sine_between_its_samples() {
        let p: Vec<f64> = (0..200).map(|k| (0.1 * f64::from(k)).sin()).collect();
        let path = between(&p, 0.5, 4);
        for (j, [value, rate]) in path.iter().enumerate().skip(40).take(1400) {
            let t = 0.1 * j as f64 / 8.0;
            assert!((value - t.sin()).abs() < 1e-6, "{value} at {t}");
            assert!((rate - 0.2 * t.cos()).abs() < 1e-5, "{rate} at {t}");
        }
    }
}
