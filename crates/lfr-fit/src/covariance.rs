//! What the noise of the data does to the entries of a refined model and to its responses.

use crate::data::Position;
use crate::lines::Chunk;
use crate::problem::chain;
use crate::sampling::Sampling;
use crate::{FitError, Refined};
use lpv_core::{CoreError, Frf};
use nalgebra::DMatrix;

impl<K: Sampling> Refined<K> {
    /// Covariance of the free entries of M, in the order of [`crate::Candidate::free_entries`]. Along changes of
    /// coordinates, which no data decide, it is zero: it holds for the coordinates that the search stayed in.
    ///
    /// The covariance is that of the linearised fit, `RefineAccount::variance (J^T J)^+`; what the model cannot represent
    /// comes on top.
    #[must_use]
    pub fn parameter_covariance(&self) -> DMatrix<f64> {
        &self.factor * self.factor.transpose()
    }

    /// Covariance of the response at constant `p`, one matrix a line, at any p of the range. Rows and columns: the real
    /// parts of `vec F` (down the columns of F), then the imaginary parts, `2 n_y n_u` in all.
    ///
    /// # Errors
    /// [`FitError::Core`]: `p` outside the range or where the LFR is not well-posed, a line that is a pole;
    /// [`FitError::Line`]: a line above Nyquist; [`FitError::Empty`]: no line.
    pub fn response_covariance(
        &self,
        p: &[f64],
        frequencies_hz: &[f64],
    ) -> Result<Vec<DMatrix<f64>>, FitError> {
        let deviations = self.response_factors(p, frequencies_hz)?;
        Ok(deviations.into_iter().map(|d| &d * d.transpose()).collect())
    }

    /// Standard deviation of each channel of the response at constant `p`, the root of `E |dF_ij|^2`: one
    /// `n_y x n_u` matrix a line.
    ///
    /// # Errors
    /// As [`Refined::response_covariance`].
    pub fn response_deviation(
        &self,
        p: &[f64],
        frequencies_hz: &[f64],
    ) -> Result<Vec<DMatrix<f64>>, FitError> {
        let (ny, nu) = (self.candidate.outputs(), self.candidate.inputs());
        let factors = self.response_factors(p, frequencies_hz)?;
        let of_line = |d: DMatrix<f64>| {
            DMatrix::from_fn(ny, nu, |i, j| {
                let channel = j * ny + i;
                d.row(channel).norm().hypot(d.row(ny * nu + channel).norm())
            })
        };
        Ok(factors.into_iter().map(of_line).collect())
    }

    /// `D` with covariance `D D^T` a line.
    fn response_factors(&self, p: &[f64], frequencies_hz: &[f64]) -> Result<Vec<DMatrix<f64>>, FitError> {
        let candidate = &self.candidate;
        let shape = candidate.shape();
        candidate.range().check(p)?;
        let clocks = (candidate.clock(), self.clock);
        let free = candidate.free_entries();
        let (s, columns) = chain(candidate.matrix(), shape, &candidate.deltas_at(p), &free, clocks)
            .ok_or_else(|| CoreError::IllPosed { p: p.to_vec() })?;
        let factor = columns * &self.factor;
        let entries: Vec<(usize, usize)> = (0..shape.columns())
            .flat_map(|j| (0..shape.rows()).map(move |i| (i, j)))
            .collect();
        let frf = Frf::zeros(frequencies_hz.to_vec(), shape.outputs, shape.inputs)?;
        let position = Position::new(0, self.clock, p, &frf, vec![1.0; frf.len()], None)?;
        let ones = vec![1.0; frf.len()];
        let one = |k: usize| {
            let chunk = Chunk::new(&s, shape, &position, (frf.values(), &ones), k..k + 1).ok_or(
                CoreError::PoleOnLine {
                    frequency_hz: frequencies_hz[k],
                },
            )?;
            // Rows of one line: real and imaginary part of the first channel, then of the next.
            let derivative = chunk.jacobian(&entries) * &factor;
            let channels = shape.outputs * shape.inputs;
            let order: Vec<usize> = (0..channels)
                .map(|c| 2 * c)
                .chain((0..channels).map(|c| 2 * c + 1))
                .collect();
            Ok(derivative.select_rows(&order))
        };
        (0..frf.len()).map(one).collect()
    }
}
