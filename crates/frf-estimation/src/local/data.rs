//! Spectra of whole records, and the size of the local problem.

use super::{HalfWidth, LocalSettings, Regressor};
use crate::FrfError;
use crate::records::{check_alike, mismatch};
use crate::spectra::{Spectra, mean};
use lpv_core::{Clock, Discrete, Position, Record};
use num_complex::Complex;

type C64 = Complex<f64>;

/// Spectra of all records: responses `Z` (outputs; outputs and inputs if references explain) and regressors `X`.
pub(crate) struct LocalData {
    pub(crate) outputs: usize,
    pub(crate) inputs: usize,
    /// Rows of `Z`.
    pub(crate) responses: usize,
    /// Rows of `X`, equal to the number of inputs.
    pub(crate) regressors: usize,
    pub(crate) records: usize,
    /// Lines 1 to this.
    pub(crate) lines: usize,
    /// Distance between lines, Hz.
    pub(crate) resolution_hz: f64,
    pub(crate) position: Option<Position>,
    z: Vec<C64>,
    x: Vec<C64>,
}

/// Size of the least-squares problem, the same for every line.
pub(crate) struct Shape {
    pub(crate) half_width: usize,
    pub(crate) equations: usize,
    pub(crate) unknowns: usize,
    pub(crate) degrees_of_freedom: f64,
}

impl LocalData {
    pub(crate) fn new(records: &[&Record], clock: Discrete, regressor: Regressor) -> Result<Self, FrfError> {
        let first = *records.first().ok_or(FrfError::NoRecords)?;
        let (ny, nu) = (first.outputs.channels(), first.inputs.channels());
        for (field, count) in [("outputs", ny), ("inputs", nu)] {
            if !(1..=64).contains(&count) {
                return Err(FrfError::Layout {
                    field,
                    value: count as f64,
                    expected: "1 to 64",
                });
            }
        }
        let nr = first.references.channels();
        if regressor == Regressor::References && nr != nu {
            return Err(FrfError::References {
                references: nr,
                inputs: nu,
            });
        }
        for (index, record) in records.iter().enumerate() {
            if record.len() != first.len() {
                let (expected, found) = (first.len() as f64, record.len() as f64);
                return Err(mismatch(index, record, "the number of samples", expected, found));
            }
            check_alike(index, record, first)?;
        }
        let length = first.len();
        let lines = Spectra::lines(length);
        let mut data = Self {
            outputs: ny,
            inputs: nu,
            responses: if regressor == Regressor::References {
                ny + nu
            } else {
                ny
            },
            regressors: nu,
            records: records.len(),
            lines,
            resolution_hz: 2.0 * clock.nyquist_hz() / length.max(1) as f64,
            position: first.position.clone(),
            z: Vec::new(),
            x: Vec::new(),
        };
        if lines == 0 {
            return Ok(data);
        }
        let mut spectra = Spectra::new(length);
        let mut spectrum = vec![C64::new(0.0, 0.0); Spectra::size(length)];
        let mut append = |samples: &[f64], to: &mut Vec<C64>| {
            spectra.transform(samples, mean(samples), &mut spectrum)?;
            to.extend_from_slice(&spectrum[1..=lines]);
            Ok::<(), FrfError>(())
        };
        for record in records {
            let (y, u, r) = (
                &record.outputs.columns,
                &record.inputs.columns,
                &record.references.columns,
            );
            let (z, x) = match regressor {
                Regressor::Inputs => (y.iter().chain(&[]), u),
                Regressor::References => (y.iter().chain(u.as_slice()), r),
            };
            for samples in z {
                append(samples, &mut data.z)?;
            }
            for samples in x {
                append(samples, &mut data.x)?;
            }
        }
        Ok(data)
    }

    /// Response `i` of record `e` at line `k`.
    pub(crate) fn z(&self, e: usize, i: usize, k: usize) -> C64 {
        self.z[(e * self.responses + i) * self.lines + k - 1]
    }

    /// Regressor `j` of record `e` at line `k`.
    pub(crate) fn x(&self, e: usize, j: usize, k: usize) -> C64 {
        self.x[(e * self.regressors + j) * self.lines + k - 1]
    }

    /// Width of the window and what it leaves for the covariance. The denominator serves all responses, so each loses
    /// its share of it.
    pub(crate) fn shape(&self, settings: &LocalSettings, denominator: usize) -> Result<Shape, FrfError> {
        let unknowns = (self.regressors + self.records) * (settings.degree + 1);
        let share = denominator as f64 / self.responses as f64;
        let half_width = match settings.half_width {
            HalfWidth::Lines(n) => n,
            HalfWidth::Auto => {
                let needed = unknowns + share.ceil() as usize + 2 * self.responses + 4;
                needed.div_ceil(self.records).div_ceil(2)
            }
        };
        let window = 2 * half_width + 1;
        let equations = window * self.records;
        let degrees_of_freedom = equations as f64 - unknowns as f64 - share;
        if window > self.lines || degrees_of_freedom < 1.0 {
            return Err(FrfError::WindowTooWide {
                available: self.lines,
                window,
                unknowns,
            });
        }
        Ok(Shape {
            half_width,
            equations,
            unknowns,
            degrees_of_freedom,
        })
    }
}
