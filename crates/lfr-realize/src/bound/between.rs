//! What the data say about a fitted model between their positions.

use super::cells::Cell;
use super::{BoundSettings, over_cell};
use crate::RealizeError;
use lfr_fit::{Candidate, FitError, FrozenData, RefineSettings, ResidualUnit, Sampling, refine};
use lpv_core::{Clock, Lfr};
use num_complex::Complex;

/// A fitted model between the positions of its data.
#[derive(Debug, Clone, PartialEq)]
pub struct Between {
    /// One entry a pair of neighbouring positions.
    pub intervals: Vec<Interval>,
    /// Rms residual of each position, in the order and unit of the data, of a model that was fitted without it; none for
    /// the corners of the range, which are never left out.
    pub left_out_rms: Vec<Option<f64>>,
    /// Where the data do not support what the model says between positions.
    pub warnings: Vec<BetweenWarning>,
}

/// The straight line between two neighbouring positions.
#[derive(Debug, Clone, PartialEq)]
pub struct Interval {
    /// Scheduling values of one end.
    pub from: Vec<f64>,
    /// Scheduling values of the other.
    pub to: Vec<f64>,
    /// The largest relative difference on it between the model and one fitted to half of the positions, as far as met.
    pub largest: f64,
    /// The same as a bound at every p of it.
    pub bound: f64,
    /// The largest shift of a mode from one end to the other, in half-widths of its resonance.
    pub shift: f64,
}

/// Why a statement between positions is not supported.
#[derive(Debug, Clone, PartialEq)]
pub enum BetweenWarning {
    /// A mode shifts by more than its half-width from one position to the next: the response between them may look like
    /// neither.
    Coarse {
        /// Index of the interval.
        interval: usize,
        /// Frequency of the mode, Hz.
        frequency_hz: f64,
        /// Shift in half-widths.
        shift: f64,
    },
    /// A model fitted without a position does not predict it: its residual there is many times that of the fit.
    NotPredicted {
        /// Index of the position.
        position: usize,
        /// Rms residual with the position left out.
        left_out: f64,
        /// Rms residual of the fit.
        fitted: f64,
    },
    /// No bound was found within the allowed work.
    Unbounded {
        /// Index of the interval.
        interval: usize,
    },
}

/// A residual without a position that is larger than this times that with it counts as not predicted.
const PREDICTED: f64 = 3.0;

/// A residual that is small whatever the ratio: relative, and in standard deviations.
const SMALL: [f64; 2] = [1e-3, 1.5];

/// Says what the data support between their positions.
///
/// The machine between positions is unknown; what can be known is whether the positions determine the model there. Two
/// further models are fitted from the given one, each to half of the positions (every second, and the corners of the
/// range). Where they are far from the given model, the positions do not determine it: the interval's `bound` is the
/// largest relative difference, at every p between the two positions and not at samples only (see
/// [`crate::difference_bound`]; own frequency domain, no hold). The error of the model against the machine is about its
/// residual at the positions plus this, if the machine is as smooth in p as the model. Each position is also judged by the
/// model that was fitted without it.
///
/// Neighbours are consecutive positions for one parameter, and a position with its nearest one for several.
///
/// # Errors
/// [`FitError::Empty`] for fewer than four positions, and those of [`refine`].
pub fn bound_between<K: Sampling>(
    candidate: &Candidate<K>,
    data: &FrozenData,
    settings: &BoundSettings,
) -> Result<Between, RealizeError> {
    settings.check()?;
    if data.len() < 4 {
        return Err(FitError::Empty {
            what: "positions to leave out; a statement between positions needs four of them",
        }
        .into());
    }
    let set = settings;
    let thinned = data.thinned(set.lines);
    let range = candidate.range();
    let places: Vec<Vec<f64>> = data.scheduling().map(|p| range.normalise(p)).collect();
    let order = along(&places);
    let rank = |position: usize| order.iter().position(|o| *o == position).unwrap_or(0);
    let corner = |place: &[f64]| place.iter().all(|d| d.abs() >= 1.0 - 1e-6);
    let quick = RefineSettings {
        max_iterations: set.iterations,
        ..RefineSettings::default()
    };
    let none = RefineSettings {
        max_iterations: 0,
        ..RefineSettings::default()
    };
    let fitted = refine(candidate, &thinned, &none)?.position_rms;
    let whole = candidate.to_lfr()?;
    let mut left_out_rms = vec![None; data.len()];
    let mut halves: Vec<Lfr<K>> = Vec::new();
    for parity in [0, 1] {
        let kept = |i: usize| rank(i) % 2 == parity || corner(&places[i]);
        let half = refine(candidate, &thinned.some(kept)?, &quick)?.candidate;
        let judged = refine(&half, &thinned, &none)?.position_rms;
        for (i, rms) in judged.into_iter().enumerate().filter(|(i, _)| !kept(*i)) {
            left_out_rms[i] = Some(rms);
        }
        halves.push(half.to_lfr()?);
    }
    let mut between = Between {
        intervals: Vec::new(),
        left_out_rms,
        warnings: Vec::new(),
    };
    let positions: Vec<&[f64]> = thinned.scheduling().collect();
    let lines: Vec<&[f64]> = thinned.responses().map(|frf| frf.frequencies_hz()).collect();
    for (i, j) in neighbours(&places, &order) {
        let cell = segment(&places[i], &places[j]);
        let (mut largest, mut bound) = (0.0_f64, 0.0_f64);
        for half in &halves {
            let found = over_cell(half, &whole, lines[i], cell.clone(), settings)?;
            largest = largest.max(found.largest);
            bound = bound.max(found.bound);
        }
        let interval = between.intervals.len();
        let (shift, frequency_hz) = largest_shift(candidate, positions[i], positions[j], data)?;
        if shift > 1.0 {
            between.warnings.push(BetweenWarning::Coarse {
                interval,
                frequency_hz,
                shift,
            });
        }
        if bound.is_infinite() {
            between.warnings.push(BetweenWarning::Unbounded { interval });
        }
        between.intervals.push(Interval {
            from: positions[i].to_vec(),
            to: positions[j].to_vec(),
            largest,
            bound,
            shift,
        });
    }
    let small = SMALL[usize::from(data.unit() == ResidualUnit::StandardDeviation)];
    for (position, (left_out, fitted)) in between.left_out_rms.iter().zip(&fitted).enumerate() {
        if let Some(left_out) = *left_out
            && left_out > PREDICTED * fitted
            && left_out > small
        {
            let fitted = *fitted;
            between.warnings.push(BetweenWarning::NotPredicted {
                position,
                left_out,
                fitted,
            });
        }
    }
    Ok(between)
}

/// Positions in the order of their first delta that differs.
fn along(places: &[Vec<f64>]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..places.len()).collect();
    order.sort_by(|&i, &j| {
        let pairs = places[i].iter().zip(&places[j]);
        pairs
            .map(|(x, y)| x.total_cmp(y))
            .find(|o| o.is_ne())
            .unwrap_or(std::cmp::Ordering::Equal)
    });
    order
}

fn neighbours(places: &[Vec<f64>], order: &[usize]) -> Vec<(usize, usize)> {
    if places[0].len() == 1 {
        return order.windows(2).map(|w| (w[0], w[1])).collect();
    }
    let distance = |i: usize, j: usize| -> f64 {
        places[i]
            .iter()
            .zip(&places[j])
            .map(|(x, y)| (x - y).powi(2))
            .sum()
    };
    let nearest = |i: usize| {
        let others = (0..places.len()).filter(|j| *j != i);
        others.min_by(|&j, &k| distance(i, j).total_cmp(&distance(i, k)))
    };
    let mut pairs: Vec<(usize, usize)> = (0..places.len())
        .filter_map(|i| nearest(i).map(|j| (i.min(j), i.max(j))))
        .collect();
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

fn segment(from: &[f64], to: &[f64]) -> Cell {
    let half = |sign: f64| {
        from.iter()
            .zip(to)
            .map(move |(x, y)| 0.5 * (y + sign * x))
            .collect()
    };
    Cell {
        centre: half(1.0),
        directions: vec![half(-1.0)],
    }
}

/// The largest shift of a mode between two positions in half-widths, and its frequency. Modes are those whose resonance
/// lies within the lines; each is compared with the nearest one at the other end.
fn largest_shift<K: Sampling>(
    candidate: &Candidate<K>,
    from: &[f64],
    to: &[f64],
    data: &FrozenData,
) -> Result<(f64, f64), RealizeError> {
    let clock = data.clock();
    let lowest = data
        .responses()
        .filter_map(|frf| frf.frequencies_hz().first().copied())
        .fold(f64::INFINITY, f64::min);
    let lines = std::f64::consts::TAU * lowest..std::f64::consts::TAU * clock.nyquist_hz();
    // `s = ln(z) / T` is the same pole for a continuous model and for one of the clock of the data.
    let poles = |p: &[f64]| -> Result<Vec<Complex<f64>>, RealizeError> {
        let discrete = candidate.clock().nyquist_hz().is_finite();
        let all = candidate.frozen(p)?.poles()?.into_iter();
        let continuous = all.map(|v| if discrete { v.ln() / clock.sample_time() } else { v });
        Ok(continuous.filter(|s| lines.contains(&s.im)).collect())
    };
    let (here, there) = (poles(from)?, poles(to)?);
    let largest = largest_shift_of(&here, &there);
    Ok(largest.map_or((0.0, 0.0), |(shift, s)| (shift, s.im / std::f64::consts::TAU)))
}

/// The pole of `here` whose nearest one of `there` is farthest away, in half-widths of the mode, and how far. Poles are those of a
/// continuous model, or logarithms of sampled ones.
pub fn largest_shift_of(here: &[Complex<f64>], there: &[Complex<f64>]) -> Option<(f64, Complex<f64>)> {
    let shift = |s: &Complex<f64>| {
        let nearest = there.iter().map(|t| (t - s).norm()).fold(f64::INFINITY, f64::min);
        let width = s.re.abs();
        if width > 0.0 && nearest.is_finite() {
            nearest / width
        } else {
            0.0
        }
    };
    let largest = here.iter().max_by(|s, t| shift(s).total_cmp(&shift(t)))?;
    Some((shift(largest), *largest))
}
