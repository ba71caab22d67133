//! Responses that were measured elsewhere, with what is known of their error, as estimates.
//!
//! An estimate keeps the Kronecker covariance `C_V (x) S` of a line. That of one input or one output is such a product whatever its
//! variances are; of several of both one near to it is taken, and how far it is from what was given is told.

use crate::FrfError;
use lpv_core::nalgebra::{DMatrix, DMatrixView, DVector};
use lpv_core::num_complex::Complex;
use lpv_core::{Frf, FrfEstimate, Position};

type C64 = Complex<f64>;

/// An estimate, and the largest factor by which the variance of a channel is not the one that was given.
#[derive(Debug, Clone, PartialEq)]
pub struct Nearest {
    /// The estimate.
    pub estimate: FrfEstimate,
    /// 1 where the covariance is a Kronecker product.
    pub factor: f64,
}

/// From the variance `E |dF_ij|^2` of each channel, column-major, line after line, all above zero. Where they are no product, that of their
/// row and column means is taken, of a size with which the noise of the line, weighed by it, adds up to that of independent channels.
///
/// # Errors
/// [`FrfError::Core`] for another number of variances, or ones that are no numbers.
pub fn with_variance(
    frf: Frf,
    variance: &[f64],
    degrees_of_freedom: f64,
    position: Option<Position>,
) -> Result<Nearest, FrfError> {
    let (outputs, inputs) = (frf.outputs(), frf.inputs());
    let mut rows = Vec::new();
    let mut columns = Vec::new();
    let mut factor = 1.0_f64;
    for line in variance.chunks_exact((outputs * inputs).max(1)) {
        // Products of row and column means: a small entry, at a zero of its channel, does not lower its whole row and column.
        let at = |i: usize, j: usize| line[j * outputs + i];
        let row: Vec<f64> = (0..outputs)
            .map(|i| (0..inputs).map(|j| at(i, j)).sum::<f64>() / inputs as f64)
            .collect();
        let column: Vec<f64> = (0..inputs)
            .map(|j| (0..outputs).map(|i| at(i, j)).sum::<f64>() / outputs as f64)
            .collect();
        let ratios = || {
            let channels = (0..outputs).flat_map(|i| (0..inputs).map(move |j| (i, j)));
            channels.map(|(i, j)| at(i, j) / row[i] / column[j])
        };
        // Of the size with which the weighted noise of the line adds up to what it should.
        let scale = ratios().sum::<f64>() / line.len() as f64;
        let off = ratios().map(|ratio| (ratio / scale).max(scale / ratio));
        factor = off.fold(factor, f64::max);
        rows.extend(diagonal(row.iter().map(|r| r * scale).collect()));
        columns.extend(diagonal(column));
    }
    let estimate = FrfEstimate::new(frf, rows, columns, degrees_of_freedom, position)?;
    Ok(Nearest { estimate, factor })
}

/// A diagonal matrix, column-major.
fn diagonal(values: Vec<f64>) -> Vec<C64> {
    DMatrix::from_diagonal(&DVector::from_vec(values))
        .map(C64::from)
        .data
        .into()
}

/// From the covariance of the columns of F one below the other, `n x n` with `n = n_y n_u`, column-major, line after line; Hermitian,
/// its diagonal above zero.
///
/// # Errors
/// [`FrfError::Core`] for another number of entries, or ones that are no numbers.
pub fn with_covariance(
    frf: Frf,
    covariance: &[C64],
    degrees_of_freedom: f64,
    position: Option<Position>,
) -> Result<Nearest, FrfError> {
    let (outputs, inputs) = (frf.outputs(), frf.inputs());
    let n = outputs * inputs;
    let mut rows = Vec::new();
    let mut columns = Vec::new();
    let mut factor = 1.0_f64;
    for line in covariance.chunks_exact((n * n).max(1)) {
        let given = DMatrixView::from_slice(line, n, n);
        let (c, s) = nearest_product(&given, outputs, inputs);
        for j in 0..inputs {
            for i in 0..outputs {
                let own = given[(j * outputs + i, j * outputs + i)].re;
                let off = c[(i, i)].re * s[(j, j)].re / own;
                factor = factor.max(off).max(1.0 / off);
            }
        }
        rows.extend(c.iter().copied());
        columns.extend(s.iter().copied());
    }
    let estimate = FrfEstimate::new(frf, rows, columns, degrees_of_freedom, position)?;
    Ok(Nearest { estimate, factor })
}

/// `C` and `S` with `E[dF_ij conj(dF_kl)] = C[i,k] S[l,j]` next to the given in least squares, by turns \[vanloan1993\]: each is a sum
/// of blocks with weights of the other, which keeps both positive.
fn nearest_product(
    given: &DMatrixView<'_, C64>,
    outputs: usize,
    inputs: usize,
) -> (DMatrix<C64>, DMatrix<C64>) {
    const TURNS: usize = 20;
    let block = |i: usize, j: usize, k: usize, l: usize| given[(j * outputs + i, l * outputs + k)];
    let mut s = DMatrix::<C64>::identity(inputs, inputs);
    let mut c = DMatrix::<C64>::identity(outputs, outputs);
    for _ in 0..TURNS {
        let size = s.norm_squared();
        c = DMatrix::from_fn(outputs, outputs, |i, k| {
            let pairs = (0..inputs).flat_map(|j| (0..inputs).map(move |l| (j, l)));
            pairs
                .map(|(j, l)| block(i, j, k, l) * s[(l, j)].conj())
                .sum::<C64>()
                / size
        });
        let size = c.norm_squared();
        s = DMatrix::from_fn(inputs, inputs, |l, j| {
            let pairs = (0..outputs).flat_map(|i| (0..outputs).map(move |k| (i, k)));
            pairs
                .map(|(i, k)| block(i, j, k, l) * c[(i, k)].conj())
                .sum::<C64>()
                / size
        });
    }
    (c, s)
}

/// Variance of the response of one input from its coherence `g^2` over so many averages: `|F|^2 (1 - g^2) / (g^2 averages)`
/// \[bendat2010\]. What is printed as 1 is taken for a coherence of 0.999999.
#[must_use]
pub fn variance_of_coherence(frf: &Frf, coherence: &[f64], averages: f64) -> Vec<f64> {
    const LEAST: f64 = 1e-6;
    frf.values()
        .iter()
        .zip(coherence)
        .map(|(f, g)| f.norm_sqr().max(f64::MIN_POSITIVE) * (1.0 - g).max(LEAST) / (g * averages))
        .collect()
}

/// Relative deviation of a response from what its neighbouring lines say, in the median over lines and channels: the noise of a
/// smooth response, and an upper bound where resonances lie closer than the lines. None of fewer than five lines.
///
/// Four neighbours are interpolated over the logarithm of the frequency, size and phase apart, so that slopes do not count.
#[must_use]
pub fn scatter(frf: &Frf) -> Option<f64> {
    let f = frf.frequencies_hz();
    let mut all = Vec::new();
    for k in 2..frf.len().saturating_sub(2) {
        let around = [k - 2, k - 1, k + 1, k + 2];
        if f[k - 2] <= 0.0 {
            continue;
        }
        let at = |m: usize| (f[m] / f[k]).ln();
        let weight = |m: usize| -> f64 {
            let others = around.iter().filter(|n| **n != m);
            others.map(|n| -at(*n) / (at(m) - at(*n))).product()
        };
        let weights = around.map(weight);
        let size = (1.0 + weights.iter().map(|w| w * w).sum::<f64>()).sqrt();
        for (c, own) in frf.line_slice(k).iter().enumerate() {
            let terms = around.iter().zip(&weights);
            let off: C64 = terms.map(|(m, w)| (frf.line_slice(*m)[c] / own).ln() * *w).sum();
            if off.re.is_finite() && off.im.is_finite() {
                all.push(off.norm() / size);
            }
        }
    }
    // The median of the size of a circular complex normal number of variance one.
    const MEDIAN: f64 = 0.832_554_611_157_697_8;
    (!all.is_empty()).then(|| median(&mut all) / MEDIAN)
}

fn median(all: &mut [f64]) -> f64 {
    let middle = all.len() / 2;
    *all.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// The response with an assumed error: a part of the size of each channel, at its zeros of a tenth of that over the neighbouring
/// lines. The estimate says that its covariance is assumed.
///
/// # Errors
/// [`FrfError::Setting`] for a part that is not above zero.
pub fn with_assumed_error(frf: Frf, part: f64, position: Option<Position>) -> Result<FrfEstimate, FrfError> {
    if !(part.is_finite() && part > 0.0) {
        return Err(FrfError::Setting {
            setting: "part",
            value: part,
            expected: "above zero",
        });
    }
    const AROUND: usize = 5;
    const LEAST: f64 = 0.1;
    let (lines, size) = (frf.len(), frf.outputs() * frf.inputs());
    let mut variance = Vec::with_capacity(lines * size);
    for k in 0..lines {
        let near = k.saturating_sub(AROUND)..(k + AROUND + 1).min(lines);
        for c in 0..size {
            let mut sizes: Vec<f64> = near.clone().map(|l| frf.line_slice(l)[c].norm()).collect();
            let floor = (LEAST * median(&mut sizes)).max(f64::MIN_POSITIVE.sqrt());
            variance.push((part * frf.line_slice(k)[c].norm().max(floor)).powi(2));
        }
    }
    let nearest = with_variance(frf, &variance, f64::INFINITY, position)?;
    Ok(nearest.estimate.with_assumed_covariance())
}

#[cfg(test)]
mod tests;
