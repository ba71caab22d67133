//! One position by sums of products over its lines.
//!
//! With `B = conj(S^-1) (x) 2 C^-1` of a line, the covariance of the error turned over, the normal equations have the entries
//!
//! ```text
//! G[(s, n), (t, m)] = sum over lines of  Re B_st Re(conj(phi_n) phi_m) - Im B_st Im(conj(phi_n) phi_m)
//! ```
//!
//! with `s`, `t` the channels and `n`, `m` the functions. The 2x2 case with 16 functions needs 2080 sums of products so, an
//! eighth of what reflections of the rows take. Normal equations square the condition, and so they are used where that
//! leaves half of the digits to their triangular factor. Where the squaring has cost more than a few, the solution is corrected
//! with the residuals of the equations themselves, which gives them back (Bjorck, Linear Algebra Appl. 88/89, 1987).

mod products;
mod sums;
mod weights;

use super::LocalFit;
use super::equations::{Eliminated, Equations};
use crate::IdentError;
use lpv_numerics::dense::invert_upper;
use lpv_numerics::planes::{Planes, WIDEST};
use lpv_numerics::whiten::Whitening;
use nalgebra::{DMatrix, DVector};
use products::Products;
use pulp::{Simd, WithSimd};
use std::ops::Range;
use sums::{ROWS, Sums};
use weights::{Weighted, Weights, WeightsAt};

/// Lines at once: their planes stay in the fastest cache.
const BLOCK: usize = 64;

/// Condition of the scaled regressors beyond which reflections take over: their triangle keeps five digits then.
const MOST: f64 = 3e5;

/// What a model leaves of the responses of a position.
pub(super) struct Left {
    pub(super) cost: f64,
    /// Half the fall of the cost by each unknown, then by each gain.
    pub(super) gradient: DVector<f64>,
}

/// A position by its sums of products.
pub(super) struct Summed {
    pub(super) eliminated: Eliminated,
    /// Bound from above of the condition number of the regressors, scaled to columns of one length.
    pub(super) condition: f64,
    /// What no model leaves.
    pub(super) left: Left,
}

/// The triangular factors of `[Phi_W, Phi_c, F]`, whitened, without their last rows, of positions that share their
/// regressors: the products of the functions serve all of them. None where equations are too badly conditioned for this way.
pub(super) fn eliminate(group: &[Equations<'_>]) -> Result<Option<Vec<Summed>>, IdentError> {
    let Some(first) = group.first() else {
        return Ok(Some(Vec::new()));
    };
    let mut passes: Vec<Pass<'_>> = group.iter().map(Pass::new).collect();
    let functions = first.all_functions();
    let mut products = Products::new(functions.len(), first.channels(), group.len());
    let mut weights = first.weights(group.len());
    for block in 0..first.blocks() {
        for (position, pass) in passes.iter_mut().enumerate() {
            pass.step(block, None, weights.at(position))?;
        }
        products.add(&weights, &functions, first.range(block));
    }
    let factors = passes.iter().enumerate().map(|(position, pass)| {
        let gram = products.matrix(position, pass.equations);
        pass.equations.factor(&gram, pass.left())
    });
    Ok(factors.collect())
}

impl Equations<'_> {
    fn channels(&self) -> usize {
        self.estimate.frf().outputs() * self.estimate.frf().inputs()
    }

    fn unknowns(&self) -> usize {
        self.channels() * self.regressors.functions().len()
    }

    fn lines(&self) -> usize {
        self.kept.len()
    }

    fn blocks(&self) -> usize {
        self.lines().div_ceil(BLOCK)
    }

    /// Lines of a block, with some zeros behind the last.
    fn range(&self, block: usize) -> Range<usize> {
        let count = BLOCK.min(self.lines() - block * BLOCK);
        block * BLOCK..block * BLOCK + count.next_multiple_of(WIDEST)
    }

    /// Functions, of which the rigid body counts as the last.
    fn all_functions(&self) -> Vec<&Planes> {
        let regressors = self.regressors;
        regressors.functions().iter().chain(regressors.rigid()).collect()
    }

    fn weights(&self, positions: usize) -> Weights {
        let frf = self.estimate.frf();
        Weights::new(frf.outputs(), frf.inputs(), positions)
    }

    fn factor(&self, gram: &DMatrix<f64>, left: Left) -> Option<Summed> {
        let columns = gram.nrows();
        let scale = gram.diagonal().map(f64::sqrt);
        let scaled = DMatrix::from_fn(columns, columns, |i, j| gram[(i, j)] / (scale[i] * scale[j]));
        let mut r = scaled.cholesky()?.unpack().transpose();
        // The product of the Frobenius norms bounds the condition number from above.
        let condition = r.norm() * invert_upper(&r)?.norm();
        if condition.is_nan() || condition > MOST {
            return None;
        }
        for (mut column, scale) in r.column_iter_mut().zip(scale.iter()) {
            column *= *scale;
        }
        let mut eliminated = Eliminated {
            position: self.position.clone(),
            r: r.resize(columns + 1, columns + 1, 0.0),
            unknowns: self.unknowns(),
            equations: 2 * self.channels() * self.lines(),
            factorisations: 1,
        };
        eliminated.set_right(&left.gradient);
        Some(Summed {
            eliminated,
            condition,
            left,
        })
    }

    /// What a fit leaves; its right side becomes that of the factor.
    pub(super) fn left_by(
        &self,
        fit: &LocalFit,
        gains: &DVector<f64>,
        eliminated: &mut Eliminated,
    ) -> Result<Left, IdentError> {
        let mut pass = Pass::new(self);
        // By channel and function.
        let ng = self.regressors.functions().len();
        let mut model = DMatrix::zeros(self.channels(), pass.functions.len());
        for (n, mut column) in model.column_iter_mut().take(ng).enumerate() {
            let channels = column.len();
            column.copy_from_slice(&fit.weights.as_slice()[n * channels..(n + 1) * channels]);
        }
        for (term, gain) in self.settings.rigid_body.iter().zip(gains.iter()) {
            model[(term.input * fit.weights.nrows() + term.output, ng)] += *gain;
        }
        let mut weights = self.weights(1);
        for block in 0..self.blocks() {
            pass.step(block, Some(&model), weights.at(0))?;
        }
        let left = pass.left();
        eliminated.set_right(&left.gradient);
        Ok(left)
    }
}

/// One pass over the lines of a position, block after block.
struct Pass<'a> {
    equations: &'a Equations<'a>,
    functions: Vec<&'a Planes>,
    whitening: Whitening,
    residual: Vec<Planes>,
    weighted: Weighted,
    cost: f64,
    /// Half the fall of the cost, by function and channel.
    gradient: Sums,
}

impl<'a> Pass<'a> {
    fn new(equations: &'a Equations<'a>) -> Self {
        let frf = equations.estimate.frf();
        let (ny, nu) = (frf.outputs(), frf.inputs());
        let functions = equations.all_functions();
        Self {
            equations,
            whitening: Whitening::new(ny, nu, BLOCK),
            residual: vec![Planes::zeros(BLOCK); ny * nu],
            weighted: Weighted::new(ny * nu),
            cost: 0.0,
            gradient: Sums::new(functions.len(), ny * nu),
            functions,
        }
    }

    /// A block, for the coefficients of a model or for none.
    fn step(
        &mut self,
        block: usize,
        model: Option<&DMatrix<f64>>,
        weights: WeightsAt<'_>,
    ) -> Result<(), IdentError> {
        let Equations {
            estimate,
            position,
            kept,
            settings,
            ..
        } = self.equations;
        let start = kept.start + block * BLOCK;
        let lines = start..kept.end.min(start + BLOCK);
        crate::weights::set(&mut self.whitening, estimate, lines.clone(), settings, position)?;
        let range = self.equations.range(block);
        pulp::Arch::new().dispatch(Step {
            pass: self,
            weights,
            model,
            lines,
            range,
        });
        Ok(())
    }

    fn left(&self) -> Left {
        let ng = self.equations.regressors.functions().len();
        let channels = self.residual.len();
        let ny = self.equations.estimate.frf().outputs();
        let rigid = &self.equations.settings.rigid_body;
        let coefficients = (0..channels * ng).map(|i| self.gradient.get(i % ng, i / ng));
        let gains = rigid
            .iter()
            .map(|t| self.gradient.get(ng, t.input * ny + t.output));
        Left {
            cost: self.cost,
            gradient: DVector::from_vec(coefficients.chain(gains).collect()),
        }
    }
}

/// What a model leaves on the lines of a block, in vector registers.
struct Step<'a, 'b> {
    pass: &'a mut Pass<'b>,
    weights: WeightsAt<'a>,
    model: Option<&'a DMatrix<f64>>,
    /// Of the estimate.
    lines: Range<usize>,
    /// Of the functions.
    range: Range<usize>,
}

impl WithSimd for Step<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Pass {
            equations,
            functions,
            whitening,
            residual,
            weighted,
            cost,
            gradient,
            ..
        } = self.pass;
        let mut weights = self.weights;
        weights.set(whitening, self.lines.len());
        let (values, size) = (equations.estimate.frf().values(), residual.len());
        for (s, entry) in residual.iter_mut().enumerate() {
            entry.gather((values, size), self.lines.clone(), s, 1.0);
        }
        if let Some(coefficients) = self.model {
            let range = || self.range.clone();
            for (i, pair) in residual.chunks_mut(2).enumerate() {
                match pair.len() {
                    2 => subtract::<S, 2>(simd, functions, coefficients, 2 * i, range(), pair),
                    _ => subtract::<S, 1>(simd, functions, coefficients, 2 * i, range(), pair),
                }
            }
        }
        weights.apply(residual, weighted);
        *cost += weighted.dot(simd, residual);
        for (chunk, functions) in functions.chunks(ROWS).enumerate() {
            let (mut re, mut im): ([&[f64]; ROWS], [&[f64]; ROWS]) = ([&[]; ROWS], [&[]; ROWS]);
            for ((re, im), f) in re.iter_mut().zip(&mut im).zip(functions) {
                (*re, *im) = f.part(self.range.clone());
            }
            for i in functions.len()..ROWS {
                (re[i], im[i]) = (re[0], im[0]);
            }
            gradient.add::<S>(simd, chunk * ROWS, re, &weighted.re);
            gradient.add::<S>(simd, chunk * ROWS, im, &weighted.im);
        }
    }
}

/// Takes the model off the residuals of channels from `at` on; coefficients by function and channel.
#[inline(always)]
fn subtract<S: Simd, const N: usize>(
    simd: S,
    functions: &[&Planes],
    coefficients: &DMatrix<f64>,
    at: usize,
    range: Range<usize>,
    residual: &mut [Planes],
) {
    let count = range.len() / S::F64_LANES;
    let first = range.start / S::F64_LANES;
    for k in 0..count {
        let zero = simd.splat_f64s(0.0);
        let mut sums = [[zero; 2]; N];
        for (n, function) in functions.iter().enumerate() {
            let re = S::as_simd_f64s(&function.re).0[first + k];
            let im = S::as_simd_f64s(&function.im).0[first + k];
            for (j, sum) in sums.iter_mut().enumerate() {
                let c = simd.splat_f64s(coefficients[(at + j, n)]);
                sum[0] = simd.mul_add_f64s(c, re, sum[0]);
                sum[1] = simd.mul_add_f64s(c, im, sum[1]);
            }
        }
        for (entry, sum) in residual.iter_mut().zip(sums) {
            let re = &mut S::as_mut_simd_f64s(&mut entry.re).0[k];
            *re = simd.sub_f64s(*re, sum[0]);
            let im = &mut S::as_mut_simd_f64s(&mut entry.im).0[k];
            *im = simd.sub_f64s(*im, sum[1]);
        }
    }
}

impl Eliminated {
    /// Makes the last column the right side of a gradient: `R^T x = gradient`.
    fn set_right(&mut self, gradient: &DVector<f64>) {
        let n = gradient.len();
        let r = self.r.view((0, 0), (n, n));
        // No zero stands on the diagonal of a well-conditioned factor.
        let x = r
            .tr_solve_upper_triangular(gradient)
            .unwrap_or_else(|| DVector::zeros(n));
        self.r.view_mut((0, n), (n, 1)).copy_from(&x);
    }
}

/// Pairs of so many: with those of one and itself, and of different ones alone.
pub(super) fn pairs(size: usize) -> (usize, usize) {
    (size * (size + 1) / 2, size * size.saturating_sub(1) / 2)
}

/// Place of `(i, j)`, `i <= j`, in the upper triangle of a square of this size, row after row.
fn pair(size: usize, i: usize, j: usize) -> usize {
    i * (2 * size - i + 1) / 2 + j - i
}

/// Place of `(i, j)`, `i < j`, where the diagonal is left out.
fn pair_off(size: usize, i: usize, j: usize) -> usize {
    pair(size, i, j) - i - 1
}
