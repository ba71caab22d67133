//! Frequency response functions, with and without their covariance.

mod averaged;
mod held;

use crate::linalg::dimension;
use crate::{CoreError, Discrete, Position};
use nalgebra::{DMatrix, DMatrixView};
use num_complex::Complex;

type C64 = Complex<f64>;

/// A sampled frequency response: one `n_y x n_u` complex matrix a line.
///
/// The lines stand in one block of memory, line after line, each column-major.
#[derive(Debug, Clone, PartialEq)]
pub struct Frf {
    frequencies_hz: Vec<f64>,
    outputs: usize,
    inputs: usize,
    values: Vec<C64>,
}

impl Frf {
    /// From values in one block, line after line, each `n_y x n_u` column-major.
    ///
    /// # Errors
    /// [`CoreError::Frequency`] unless frequencies are finite, not negative and strictly increasing;
    /// [`CoreError::Dimension`], [`CoreError::NotFinite`] (row: entry within the line, column: line).
    pub fn new(
        frequencies_hz: Vec<f64>,
        outputs: usize,
        inputs: usize,
        values: Vec<C64>,
    ) -> Result<Self, CoreError> {
        for (index, &value_hz) in frequencies_hz.iter().enumerate() {
            let problem = if !value_hz.is_finite() {
                "not a finite number"
            } else if value_hz < 0.0 {
                "negative"
            } else if index > 0 && frequencies_hz[index - 1] >= value_hz {
                "not above the one before it; sort the lines and drop doubles"
            } else {
                continue;
            };
            return Err(CoreError::Frequency {
                index,
                value_hz,
                problem,
            });
        }
        let size = outputs * inputs;
        dimension("FRF: number of values", frequencies_hz.len() * size, values.len())?;
        if let Some(i) = values
            .iter()
            .position(|v| !(v.re.is_finite() && v.im.is_finite()))
        {
            return Err(CoreError::NotFinite {
                what: "FRF",
                row: i % size,
                column: i / size,
            });
        }
        Ok(Self {
            frequencies_hz,
            outputs,
            inputs,
            values,
        })
    }

    /// All zeros; filled by [`Frf::line_slice_mut`].
    ///
    /// # Errors
    /// As [`Frf::new`].
    pub fn zeros(frequencies_hz: Vec<f64>, outputs: usize, inputs: usize) -> Result<Self, CoreError> {
        let values = vec![C64::new(0.0, 0.0); frequencies_hz.len() * outputs * inputs];
        Self::new(frequencies_hz, outputs, inputs, values)
    }

    /// Frequencies, Hz, strictly increasing.
    pub fn frequencies_hz(&self) -> &[f64] {
        &self.frequencies_hz
    }
    /// Number of lines.
    pub fn len(&self) -> usize {
        self.frequencies_hz.len()
    }
    /// Whether there is no line.
    pub fn is_empty(&self) -> bool {
        self.frequencies_hz.is_empty()
    }
    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.outputs
    }
    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        self.inputs
    }
    /// The response at line `k`, `n_y x n_u`.
    ///
    /// # Panics
    /// If `k` is not below [`Frf::len`].
    pub fn line(&self, k: usize) -> DMatrixView<'_, C64> {
        DMatrixView::from_slice(self.line_slice(k), self.outputs, self.inputs)
    }
    /// The response at line `k`, column-major.
    ///
    /// # Panics
    /// If `k` is not below [`Frf::len`].
    pub fn line_slice(&self, k: usize) -> &[C64] {
        let size = self.outputs * self.inputs;
        &self.values[k * size..(k + 1) * size]
    }
    /// The response at line `k`, column-major, to be written.
    ///
    /// # Panics
    /// If `k` is not below [`Frf::len`].
    pub fn line_slice_mut(&mut self, k: usize) -> &mut [C64] {
        let size = self.outputs * self.inputs;
        &mut self.values[k * size..(k + 1) * size]
    }
    /// All values, line after line, to be written.
    pub fn values_mut(&mut self) -> &mut [C64] {
        &mut self.values
    }
    /// All values, line after line.
    pub fn values(&self) -> &[C64] {
        &self.values
    }
    /// One channel over all lines.
    ///
    /// # Panics
    /// If the channel does not exist.
    pub fn channel(&self, output: usize, input: usize) -> impl Iterator<Item = C64> + '_ {
        assert!(
            output < self.outputs && input < self.inputs,
            "no channel ({output}, {input})"
        );
        let size = self.outputs * self.inputs;
        self.values
            .iter()
            .skip(input * self.outputs + output)
            .step_by(size.max(1))
            .copied()
    }
    /// The lines whose index `keep` accepts.
    #[must_use]
    pub fn select(&self, mut keep: impl FnMut(usize, f64) -> bool) -> Self {
        let lines: Vec<usize> = (0..self.len())
            .filter(|&k| keep(k, self.frequencies_hz[k]))
            .collect();
        Self {
            frequencies_hz: lines.iter().map(|&k| self.frequencies_hz[k]).collect(),
            outputs: self.outputs,
            inputs: self.inputs,
            values: lines
                .iter()
                .flat_map(|&k| self.line_slice(k).iter().copied())
                .collect(),
        }
    }

    /// Relative error against `truth` a line: `||self - truth||_F / ||truth||_F`. Lines where the truth is zero and
    /// this is not give infinity.
    ///
    /// # Errors
    /// [`CoreError::Dimension`] if the two do not have as many lines and channels, [`CoreError::Frequency`] if their
    /// lines lie elsewhere (by more than `1e-9` of the frequency).
    pub fn relative_error(&self, truth: &Self) -> Result<Vec<f64>, CoreError> {
        dimension("relative error: lines", truth.len(), self.len())?;
        dimension("relative error: outputs", truth.outputs, self.outputs)?;
        dimension("relative error: inputs", truth.inputs, self.inputs)?;
        let pairs = self.frequencies_hz.iter().zip(&truth.frequencies_hz);
        for (index, (&value_hz, &other)) in pairs.enumerate() {
            if (value_hz - other).abs() > 1e-9 * value_hz.max(other) {
                return Err(CoreError::Frequency {
                    index,
                    value_hz,
                    problem: "not a line of the other response; evaluate both on the same lines",
                });
            }
        }
        let norm = |s: &mut dyn Iterator<Item = f64>| s.sum::<f64>().sqrt();
        Ok((0..self.len())
            .map(|k| {
                let (a, b) = (self.line_slice(k), truth.line_slice(k));
                let error = norm(&mut a.iter().zip(b).map(|(x, y)| (x - y).norm_sqr()));
                let size = norm(&mut b.iter().map(|y| y.norm_sqr()));
                if error == 0.0 { 0.0 } else { error / size }
            })
            .collect())
    }
}

/// An estimated FRF with the covariance of its noise.
///
/// The error of an estimate from `n_e` experiments is `dF = V G` with `V` (`n_y x n_e`) the output errors, whose
/// columns are independent, circular complex normal with covariance `C_V`, and `G` (`n_e x n_u`) known. So
///
/// `E[dF_ij conj(dF_kl)] = C_V[i,k] S[l,j]`, with `S = G^H G` (`n_u x n_u`),
///
/// a Kronecker product: a line keeps two small Hermitian matrices, not a `n_y n_u` square one. `C_V` is itself
/// estimated, with [`FrfEstimate::degrees_of_freedom`] complex degrees of freedom.
#[derive(Debug, Clone, PartialEq)]
pub struct FrfEstimate {
    frf: Frf,
    output_covariance: Vec<C64>,
    input_factor: Vec<C64>,
    degrees_of_freedom: f64,
    position: Option<Position>,
    is_assumed: bool,
    /// The clock of the hold by which a response of continuous time was multiplied.
    held: Option<Discrete>,
}

impl FrfEstimate {
    /// From the FRF and, for each line, `C_V` (`n_y x n_y`) and `S` (`n_u x n_u`), column-major, line after line.
    /// `degrees_of_freedom`: complex ones, infinite where the covariance is known. `position`: the constant
    /// scheduling values of the experiment.
    ///
    /// # Errors
    /// [`CoreError::Dimension`], [`CoreError::NotFinite`].
    pub fn new(
        frf: Frf,
        output_covariance: Vec<C64>,
        input_factor: Vec<C64>,
        degrees_of_freedom: f64,
        position: Option<Position>,
    ) -> Result<Self, CoreError> {
        let (ny, nu) = (frf.outputs, frf.inputs);
        for (what, size, values) in [
            ("FRF covariance: C_V", ny * ny, &output_covariance),
            ("FRF covariance: S", nu * nu, &input_factor),
        ] {
            dimension(what, frf.len() * size, values.len())?;
            if let Some(i) = values
                .iter()
                .position(|v| !(v.re.is_finite() && v.im.is_finite()))
            {
                return Err(CoreError::NotFinite {
                    what,
                    row: i % size,
                    column: i / size,
                });
            }
        }
        if position.iter().any(|p| p.iter().any(|v| !v.is_finite())) {
            return Err(CoreError::NotFinite {
                what: "FRF estimate: position",
                row: 0,
                column: 0,
            });
        }
        if degrees_of_freedom.is_nan() || degrees_of_freedom < 0.0 {
            return Err(CoreError::NotFinite {
                what: "FRF covariance: degrees of freedom",
                row: 0,
                column: 0,
            });
        }
        Ok(Self {
            frf,
            output_covariance,
            input_factor,
            degrees_of_freedom,
            position,
            is_assumed: false,
            held: None,
        })
    }

    /// A response known with variance 1 for every channel and line: for noise-free data and unweighted fits.
    ///
    /// # Errors
    /// None beyond those of [`FrfEstimate::new`].
    pub fn with_unit_covariance(frf: Frf, position: Option<Position>) -> Result<Self, CoreError> {
        let one = |n: usize| {
            let eye = DMatrix::<C64>::identity(n, n);
            std::iter::repeat_n(eye, frf.len())
                .flat_map(|m| m.data.as_vec().clone())
                .collect()
        };
        let (c, s) = (one(frf.outputs), one(frf.inputs));
        Self::new(frf, c, s, f64::INFINITY, position)
    }

    /// The same with a covariance that nobody measured: it weighs, and is no noise that an error could be held against.
    #[must_use]
    pub fn with_assumed_covariance(self) -> Self {
        Self {
            is_assumed: true,
            ..self
        }
    }

    /// Whether the covariance is an assumption.
    pub fn covariance_is_assumed(&self) -> bool {
        self.is_assumed
    }

    /// The estimate itself.
    pub fn frf(&self) -> &Frf {
        &self.frf
    }
    /// `C_V` of line `k`, `n_y x n_y`: covariance of the output errors.
    ///
    /// # Panics
    /// If there is no line `k`.
    pub fn output_covariance(&self, k: usize) -> DMatrixView<'_, C64> {
        let n = self.frf.outputs;
        DMatrixView::from_slice(&self.output_covariance[k * n * n..(k + 1) * n * n], n, n)
    }
    /// `C_V` of all lines, column-major, line after line.
    pub fn output_covariances(&self) -> &[C64] {
        &self.output_covariance
    }
    /// `S` of all lines, column-major, line after line.
    pub fn input_factors(&self) -> &[C64] {
        &self.input_factor
    }
    /// `S = G^H G` of line `k`, `n_u x n_u`.
    ///
    /// # Panics
    /// If there is no line `k`.
    pub fn input_factor(&self, k: usize) -> DMatrixView<'_, C64> {
        let n = self.frf.inputs;
        DMatrixView::from_slice(&self.input_factor[k * n * n..(k + 1) * n * n], n, n)
    }
    /// Complex degrees of freedom of the estimated `C_V`; infinite where it is known.
    pub fn degrees_of_freedom(&self) -> f64 {
        self.degrees_of_freedom
    }
    /// The constant scheduling values of the experiment, where there are any.
    pub fn position(&self) -> Option<&Position> {
        self.position.as_ref()
    }
    /// The constant value of the only scheduling signal; none where there are several.
    pub fn single_position(&self) -> Option<f64> {
        self.position.as_ref().and_then(Position::single)
    }
    /// The same of a machine that is taken as time-invariant.
    #[must_use]
    pub fn without_position(self) -> Self {
        Self {
            position: None,
            ..self
        }
    }
    /// Variance of one channel at line `k`: `E |dF_ij|^2 = C_V[i,i] S[j,j]`.
    ///
    /// # Panics
    /// If there is no such line or channel.
    pub fn variance(&self, k: usize, output: usize, input: usize) -> f64 {
        self.output_covariance(k)[(output, output)].re * self.input_factor(k)[(input, input)].re
    }
    /// Relative standard deviation at line `k`: `sqrt(E ||dF||_F^2) / ||F||_F`; zero without noise.
    ///
    /// # Panics
    /// If there is no line `k`.
    pub fn relative_deviation(&self, k: usize) -> f64 {
        let variance = self.output_covariance(k).trace().re * self.input_factor(k).trace().re;
        if variance > 0.0 {
            variance.sqrt() / self.frf.line(k).norm()
        } else {
            0.0
        }
    }
    /// The lines that `keep` accepts.
    #[must_use]
    pub fn select(&self, mut keep: impl FnMut(usize, f64) -> bool) -> Self {
        let lines: Vec<usize> = (0..self.frf.len())
            .filter(|&k| keep(k, self.frf.frequencies_hz[k]))
            .collect();
        let mut marks = vec![false; self.frf.len()];
        lines.iter().for_each(|&k| marks[k] = true);
        Self {
            frf: self.frf.select(|k, _| marks[k]),
            output_covariance: lines
                .iter()
                .flat_map(|&k| self.output_covariance(k).iter().copied().collect::<Vec<_>>())
                .collect(),
            input_factor: lines
                .iter()
                .flat_map(|&k| self.input_factor(k).iter().copied().collect::<Vec<_>>())
                .collect(),
            degrees_of_freedom: self.degrees_of_freedom,
            position: self.position.clone(),
            is_assumed: self.is_assumed,
            held: self.held,
        }
    }
}
