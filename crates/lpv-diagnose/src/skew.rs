//! Skew of two sensors of one position: `y_2(t) = g y_1(t - T) + o`, with an offset by record.

use crate::track::{cubic, roughness, slope_of};
use lpv_core::linalg::least_squares;
use lpv_core::{Discrete, Record};
use nalgebra::{DMatrix, DVector};

/// By how much a sensor comes later than another one of the same position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Skew {
    /// T, in units of time; below zero where it comes first.
    pub time: f64,
    /// Standard deviation of T, from sums of scores over parts of the records, since what is left is coloured.
    pub deviation: f64,
    /// Root mean square of what one sensor leaves of the other on judged records, in units of the second: without T, and with it.
    pub left: [f64; 2],
}

/// Parts of a record whose scores are summed.
const PARTS: usize = 10;
/// Longest skew that is looked for, in samples.
const LONGEST: f64 = 50.0;
/// Deviations from zero, and the part of the difference that may be left, for a skew to be one.
const SURE: f64 = 5.0;
const LEFT: f64 = 0.8;

/// What one sensor tells of another one of the same position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compared {
    /// By how much it comes later, where the records show it.
    pub skew: Option<Skew>,
    /// Its readings over those of the other one, and the standard deviation of that.
    pub gain: [f64; 2],
    /// Root mean square of its readings on judged records, each without its mean.
    pub size: f64,
    /// The same of their difference from those of the other one that come as late.
    pub difference: f64,
    /// The same of what is left beyond the gain.
    pub left: f64,
    /// Standard deviation of the noise of both readings in this, from their third differences.
    pub noise: f64,
}

/// Output `other` as `one` tells it; none where the records do not compare.
pub fn compare(
    (one, other): (usize, usize),
    fitted: &[Record],
    judged: &[Record],
    clock: Discrete,
) -> Option<Compared> {
    let skew = skew((one, other), fitted, judged, clock);
    let late = skew.map_or(0.0, |s| s.time / clock.sample_time());
    let [fit, rows] = [fitted, judged].map(|records| Rows::of((one, other), records, late));
    let (fit, rows) = (fit?, rows?);
    let (gain, left) = fit.solve()?;
    // What is left is coloured: scores are summed over parts.
    let scores = fit.parts.iter().map(|part| {
        let each = part.clone().map(|k| fit.late[k] * left[k]);
        each.sum::<f64>().powi(2)
    });
    let deviation = scores.sum::<f64>().sqrt() / fit.late.iter().map(|q| q * q).sum::<f64>();
    let mean_square = |of: &dyn Fn(usize) -> f64| {
        let sum: f64 = (0..rows.other.len()).map(|k| of(k).powi(2)).sum();
        (sum / rows.other.len().max(1) as f64).sqrt()
    };
    let rough = |output: usize| {
        let column = judged.iter().flat_map(|r| r.outputs.columns[output].windows(4));
        roughness(column.map(|w| [w[0], w[1], w[2], w[3]]))
    };
    Some(Compared {
        skew,
        gain: [gain, deviation],
        size: mean_square(&|k| rows.other[k]),
        difference: mean_square(&|k| rows.other[k] - rows.late[k]),
        left: mean_square(&|k| rows.other[k] - gain * rows.late[k]),
        noise: rough(other).hypot(gain * rough(one)),
    })
}

/// The skew of output `other` against `one`; none where the records show none.
pub fn skew(
    (one, other): (usize, usize),
    fitted: &[Record],
    judged: &[Record],
    clock: Discrete,
) -> Option<Skew> {
    const STEPS: usize = 30;
    let mut late = 0.0;
    let mut deviation = f64::INFINITY;
    for _ in 0..STEPS {
        let rows = Rows::of((one, other), fitted, late)?;
        let (gain, left) = rows.solve()?;
        // Motion that is later by dT is less by its rate times dT.
        let slope: Vec<f64> = rows.outside(&rows.rate.iter().map(|r| -gain * r).collect::<Vec<_>>());
        let curvature = slope.iter().map(|s| s * s).sum::<f64>();
        let step = slope.iter().zip(&left).map(|(s, e)| s * e).sum::<f64>() / curvature;
        let scores = rows.parts.iter().map(|part| {
            let each = part.clone().map(|k| slope[k] * left[k]);
            each.sum::<f64>().powi(2)
        });
        deviation = scores.sum::<f64>().sqrt() / curvature;
        if !(step.is_finite() && (late + step).abs() < LONGEST) {
            return None;
        }
        late += step;
        if step.abs() < 1e-3 * deviation {
            break;
        }
    }
    let size = |late: f64| -> Option<f64> {
        let (_, left) = Rows::of((one, other), judged, late)?.solve()?;
        Some((left.iter().map(|e| e * e).sum::<f64>() / left.len() as f64).sqrt())
    };
    let left = [size(0.0)?, size(late)?];
    let shows = late.abs() > SURE * deviation && left[1] < LEFT * left[0];
    let step = clock.sample_time();
    shows.then_some(Skew {
        time: late * step,
        deviation: deviation * step,
        left,
    })
}

/// One sensor later by some samples, its rate per sample, and the other one; each without its mean over the record.
struct Rows {
    late: Vec<f64>,
    rate: Vec<f64>,
    other: Vec<f64>,
    parts: Vec<std::ops::Range<usize>>,
}

impl Rows {
    fn of((one, other): (usize, usize), records: &[Record], late: f64) -> Option<Self> {
        let margin = LONGEST as usize + 3;
        let mut rows = Self {
            late: Vec::new(),
            rate: Vec::new(),
            other: Vec::new(),
            parts: Vec::new(),
        };
        for record in records {
            let (q, y) = (&record.outputs.columns[one], &record.outputs.columns[other]);
            let n = q.len().checked_sub(2 * margin).filter(|n| *n >= 2 * PARTS)?;
            let begin = rows.other.len();
            for k in margin..margin + n {
                let time = k as f64 - late;
                let (at, s) = (time.floor() as usize, time - time.floor());
                let slope = |k: usize| slope_of([q[k - 2], q[k - 1], q[k + 1], q[k + 2]]);
                let (da, db) = (slope(at), slope(at + 1));
                let [value, _] = cubic([q[at], q[at + 1]], [da, db], s);
                rows.late.push(value);
                rows.rate.push((1.0 - s) * da + s * db);
                rows.other.push(y[k]);
            }
            for column in [&mut rows.late, &mut rows.rate, &mut rows.other] {
                let middle = lpv_numerics::statistics::mean(&column[begin..]);
                column[begin..].iter_mut().for_each(|v| *v -= middle);
            }
            let part = |i: usize| begin + i * n / PARTS..begin + (i + 1) * n / PARTS;
            rows.parts.extend((0..PARTS).map(part));
        }
        Some(rows)
    }

    /// The gain, and what is left of the other sensor.
    fn solve(&self) -> Option<(f64, Vec<f64>)> {
        let rows = DMatrix::from_column_slice(self.late.len(), 1, &self.late);
        let right = DVector::from_column_slice(&self.other);
        let gain = least_squares(rows, &right, 1e-12).ok()?[0];
        let left = self.other.iter().zip(&self.late).map(|(y, q)| y - gain * q);
        Some((gain, left.collect()))
    }

    /// A signal without what the gain explains.
    fn outside(&self, signal: &[f64]) -> Vec<f64> {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let part = dot(signal, &self.late) / dot(&self.late, &self.late);
        signal.iter().zip(&self.late).map(|(s, q)| s - part * q).collect()
    }
}
