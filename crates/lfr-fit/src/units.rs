//! Units in which signals, time and p have size one. A fit in them depends on none of the units that the data came in: neither on
//! those of inputs and outputs, nor on that of time, nor on unit and zero of p.

use crate::moving::MovingData;
use crate::{FitError, Refined};
use lpv_core::{Continuous, CoreError, Discrete, Frf, FrfEstimate, SchedulingRange};
use nalgebra::DMatrix;
use num_complex::Complex;

/// Sample time in the unit of time that is used: a rate of integration of one is slow against the clock, as it is for a machine
/// that is sampled well.
const SAMPLE_TIME: f64 = 0.0625;

/// The units of a machine: a signal, a time or a p of the data is so many of them.
///
/// ```
/// use lfr_fit::Units;
/// use lpv_core::num_complex::Complex;
/// use lpv_core::{Discrete, Frf, FrfEstimate, SchedulingRange};
///
/// let frf = Frf::new(vec![1.0, 2.0], 1, 1, vec![Complex::new(3e-9, 0.0), Complex::new(0.0, 3e-9)])?;
/// let nanometres = FrfEstimate::with_unit_covariance(frf, Some(0.3.into()))?;
/// let units = Units::of(Discrete::new(1e-3)?, &SchedulingRange::interval(0.0, 0.3)?, &[nanometres.clone()])?;
/// let plain = units.scaled(&nanometres)?;
/// assert!((plain.frf().line(1)[(0, 0)].norm() - 1.0).abs() < 1e-12);
/// assert_eq!(units.places(&[0.3]), [1.0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Units {
    outputs: Vec<f64>,
    inputs: Vec<f64>,
    /// In the unit of time of the data.
    time: f64,
    clock: Discrete,
    range: SchedulingRange,
}

impl Units {
    /// From responses at one clock over a range of p: the geometric mean of the size of each channel decides.
    ///
    /// # Errors
    /// [`FitError::Empty`] without responses, [`FitError::Data`] for channels that do not fit together.
    pub fn of(clock: Discrete, range: &SchedulingRange, estimates: &[FrfEstimate]) -> Result<Self, FitError> {
        let first = estimates.first().ok_or(FitError::Empty { what: "positions" })?;
        let (ny, nu) = (first.frf().outputs(), first.frf().inputs());
        for (index, estimate) in estimates.iter().enumerate() {
            for (what, expected, found) in [
                ("outputs", ny, estimate.frf().outputs()),
                ("inputs", nu, estimate.frf().inputs()),
            ] {
                if expected != found {
                    return Err(FitError::Data {
                        index,
                        what,
                        expected,
                        found,
                    });
                }
            }
        }
        let sizes = DMatrix::from_fn(ny, nu, |i, j| {
            let all = estimates.iter().flat_map(|e| e.frf().channel(i, j));
            let (sum, count) = all
                .map(|g| g.norm().ln())
                .filter(|v| v.is_finite())
                .fold((0.0, 0usize), |(s, n), v| (s + v, n + 1));
            (count > 0).then(|| sum / count as f64)
        });
        let mean = |values: &mut dyn Iterator<Item = f64>| {
            let (sum, count) = values.fold((0.0, 0usize), |(s, n), v| (s + v, n + 1));
            if count > 0 { sum / count as f64 } else { 0.0 }
        };
        // ln |G_ij| is about a row's share plus a column's.
        let rows: Vec<f64> = (0..ny)
            .map(|i| mean(&mut sizes.row(i).iter().copied().flatten()))
            .collect();
        let columns: Vec<f64> = (0..nu)
            .map(|j| {
                mean(
                    &mut sizes
                        .column(j)
                        .iter()
                        .zip(&rows)
                        .filter_map(|(v, row)| Some((*v)? - row)),
                )
            })
            .collect();
        Ok(Self {
            outputs: rows.into_iter().map(f64::exp).collect(),
            inputs: columns.into_iter().map(|v| (-v).exp()).collect(),
            time: clock.sample_time() / SAMPLE_TIME,
            clock,
            range: range.clone(),
        })
    }

    /// The clock of the data in these units.
    ///
    /// # Errors
    /// None.
    pub fn clock(&self) -> Result<Discrete, FitError> {
        Ok(Discrete::new(SAMPLE_TIME)?)
    }

    /// The range of p in these units: -1 to 1 in each parameter.
    ///
    /// # Errors
    /// None.
    pub fn range(&self) -> Result<SchedulingRange, FitError> {
        Ok(SchedulingRange::new(vec![[-1.0, 1.0]; self.range.parameters()])?)
    }

    /// Scheduling values in these units, within -1 to 1 up to rounding for those of the range.
    pub fn places(&self, p: &[f64]) -> Vec<f64> {
        let delta = self.range.normalise(p);
        // The ends of the range lie in it.
        let close = |v: f64| (v.abs() - 1.0).abs() < 1e-9;
        delta
            .into_iter()
            .map(|v| if close(v) { v.signum() } else { v })
            .collect()
    }

    /// Scheduling values of the data from those in these units.
    pub fn undo_places(&self, delta: &[f64]) -> Vec<f64> {
        let (centre, half) = (self.range.centre(), self.range.half_width());
        let of = |((d, c), h): ((&f64, &f64), &f64)| c + h * d;
        delta.iter().zip(&centre).zip(&half).map(of).collect()
    }

    /// A frequency of the data, cycles per its unit of time, from one in these units.
    pub fn undo_frequency(&self, frequency: f64) -> f64 {
        frequency / self.time
    }

    /// A response with its covariance in these units, its position included.
    ///
    /// # Errors
    /// [`FitError::Core`] where a number leaves the range of numbers.
    pub fn scaled(&self, estimate: &FrfEstimate) -> Result<FrfEstimate, FitError> {
        let frf = estimate.frf();
        let (ny, nu) = (frf.outputs(), frf.inputs());
        let (y, u) = (&self.outputs, &self.inputs);
        let each =
            |values: &[Complex<f64>], rows: usize, size: usize, factor: &dyn Fn(usize, usize) -> f64| {
                let one = |(at, v): (usize, &Complex<f64>)| v * factor(at % size % rows, at % size / rows);
                values.iter().enumerate().map(one).collect::<Vec<_>>()
            };
        let lines = frf.frequencies_hz().iter().map(|f| f * self.time).collect();
        let values = each(frf.values(), ny, ny * nu, &|i, j| u[j] / y[i]);
        Ok(FrfEstimate::new(
            Frf::new(lines, ny, nu, values)?,
            each(estimate.output_covariances(), ny, ny * ny, &|i, k| {
                1.0 / (y[i] * y[k])
            }),
            each(estimate.input_factors(), nu, nu * nu, &|l, j| u[l] * u[j]),
            estimate.degrees_of_freedom(),
            estimate.position().map(|p| self.places(p).into()),
        )?)
    }

    /// Moving records in these units.
    ///
    /// # Errors
    /// [`FitError::Core`] for channels that do not fit.
    pub fn moves(&self, data: &MovingData) -> Result<MovingData, FitError> {
        data.in_units(&self.outputs, &self.inputs, self.clock()?, |p| self.places(p))
    }

    /// A model that was fitted in these units, in those of the data. Entries that are held, as those of integrators are, keep
    /// their values; all others take the units.
    ///
    /// # Errors
    /// [`FitError::Core`] where a number leaves the range of numbers.
    pub fn undo(&self, fitted: Refined<Continuous>) -> Result<Refined<Continuous>, FitError> {
        let (mut fitted, candidate) = (fitted.clone(), fitted.candidate);
        let states = self.state_units(candidate.matrix(), candidate.free(), candidate.states());
        let channels = candidate.channels().len();
        let one = || std::iter::repeat_n(1.0, channels);
        let rows: Vec<f64> = states
            .iter()
            .map(|s| s / self.time)
            .chain(self.outputs.iter().copied())
            .chain(one())
            .collect();
        let columns: Vec<f64> = states
            .iter()
            .chain(&self.inputs)
            .map(|s| s.recip())
            .chain(one())
            .collect();
        let m = candidate.matrix();
        let free = candidate.free();
        let scaled = DMatrix::from_fn(m.nrows(), m.ncols(), |i, j| {
            let held = !free[(i, j)] && (rows[i] * columns[j] - 1.0).abs() < 1e-9;
            if held {
                m[(i, j)]
            } else {
                rows[i] * m[(i, j)] * columns[j]
            }
        });
        if let Some(at) = scaled.iter().position(|v| !v.is_finite()) {
            return Err(FitError::Core(CoreError::NotFinite {
                what: "LFR",
                row: at % m.nrows(),
                column: at / m.nrows(),
            }));
        }
        for (at, (i, j)) in candidate.free_entries().into_iter().enumerate() {
            let factor = rows[i] * columns[j];
            fitted.factor.row_mut(at).scale_mut(factor);
        }
        fitted.candidate = candidate.with_matrix(scaled).with_range(self.range.clone());
        fitted.clock = self.clock;
        Ok(fitted)
    }

    /// The unit of each state: such that entries of A and C that are held keep their values, else one.
    fn state_units(&self, m: &DMatrix<f64>, free: &DMatrix<bool>, states: usize) -> Vec<f64> {
        let held = |i: usize, j: usize| !free[(i, j)] && m[(i, j)] != 0.0;
        let mut units: Vec<Option<f64>> = (0..states)
            .map(|j| {
                let output = (0..self.outputs.len()).find(|o| held(states + o, j))?;
                Some(self.outputs[output])
            })
            .collect();
        for _ in 0..states {
            for i in 0..states {
                let Some(unit) = units[i] else {
                    continue;
                };
                for (j, other) in units.iter_mut().enumerate() {
                    if i != j && other.is_none() && held(i, j) {
                        *other = Some(unit / self.time);
                    }
                }
            }
        }
        units.into_iter().map(|unit| unit.unwrap_or(1.0)).collect()
    }

    /// What went wrong in these units, in those of the data.
    pub fn undo_error(&self, error: FitError) -> FitError {
        match error {
            FitError::Start { p, problem } => FitError::Start {
                p: self.undo_places(&p),
                problem,
            },
            FitError::Line {
                index,
                line,
                frequency_hz,
                problem,
            } => FitError::Line {
                index,
                line,
                frequency_hz: self.undo_frequency(frequency_hz),
                problem,
            },
            FitError::Core(CoreError::IllPosed { p }) => FitError::Core(CoreError::IllPosed {
                p: self.undo_places(&p),
            }),
            other => other,
        }
    }
}
