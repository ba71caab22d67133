//! Frequency responses over thousands of lines: one Schur form a model, then O(n^2) a line.

mod lanes;
mod refine;

use crate::linalg::{Order, balance, finite, real_schur};
use crate::{Clock, CoreError, Frf, StateSpace};
use lanes::{WIDEST, first_nonzero, lanes_of, plus, size, solve, times_real, values_of};
use nalgebra::DMatrix;
use num_complex::Complex;
use pulp::{Simd, WithSimd};
use std::ops::Range;

/// A model reduced to Schur form, ready to be evaluated at many points.
///
/// With `D^-1 A D = Q T Q^T`, D diagonal such that rows and columns have like norms (powers of two, so that nothing is rounded), the
/// response is `C D Q (z I - T)^-1 Q^T D^-1 B + D_u`, D_u the direct term. T is real, and triangular but for blocks of two on the
/// diagonal: of `z I - T` only these are complex, and it is solved by substitution, which takes a third of what elimination takes from a
/// Hessenberg form (\[laub1981\]), for as many points at a time as a vector register of the machine has lanes. A is ordered first, so that what feeds others comes last: only states that reach each other both ways are scaled
/// and turned together, and a chain of sections keeps its numbers. Where the states are many times larger
/// than B, near a pole, or the response is many times smaller than its states, the solution is refined once or more with residuals of
/// twice the precision (\[higham2002\], ch. 12), as long as that brings it nearer: neither the reduction nor the substitution shows but
/// within some 1e-13 of a pole, or where the terms are so much larger than the response that they hide it whole. Where the entries of D
/// are of very different size a point is solved by elimination instead. Points are refined as
/// many as a register holds, so that the last digits of a response may depend on its neighbours.
#[derive(Debug, Clone)]
pub struct ResponseKernel {
    /// Balanced, and in parts.
    model: Matrices,
    /// `Q^T B`, `C Q`, and `T^T` for the sake of its columns.
    reduced: Matrices,
    q: DMatrix<f64>,
    d: DMatrix<f64>,
    /// States that do not reach those of another part.
    parts: Vec<Range<usize>>,
    /// Whether Q is more than an order of the states.
    is_turned: bool,
    /// Whether each point is solved by elimination.
    is_eliminated: bool,
    /// Largest entries of A and B.
    largest: [f64; 2],
    /// Largest entry of each row of `C Q`.
    outputs: Vec<f64>,
    work: Vec<f64>,
}

#[derive(Debug, Clone)]
struct Matrices {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
}

/// Between how different scales of states a matrix that mixes them, orthogonal in these scales, may leave nothing to refine.
const SPREAD: f64 = 1e6;

/// How many times larger than B the states are where a solution is refined.
const NEAR_A_POLE: f64 = 256.0;

/// How many times smaller than all states as the output sees the largest a response is where a solution is refined: what turns the states
/// mixes large ones with small.
const CANCELLED: f64 = 1024.0;

impl ResponseKernel {
    /// One reduction of `A`.
    ///
    /// # Errors
    /// [`CoreError::NoConvergence`] where the QR iteration finds no Schur form of `A`.
    pub fn new<K: Clock>(system: &StateSpace<K>) -> Result<Self, CoreError> {
        let n = system.states();
        let Order {
            states,
            blocks,
            parts,
        } = Order::new(system.a());
        let mut model = Matrices {
            a: system.a().select_rows(&states).select_columns(&states),
            b: system.b().select_rows(&states),
            c: system.c().select_columns(&states),
        };
        let mut factors = vec![1.0; n];
        for block in &blocks {
            let Matrices { a, b, c } = &mut model;
            balance(a, block, |i, factor| {
                b.row_mut(i).unscale_mut(factor);
                c.column_mut(i).scale_mut(factor);
                factors[i] *= factor;
            });
        }
        // One state, or two, are in Schur form.
        let turned = || blocks.iter().filter(|b| b.len() > 2);
        let is_eliminated = turned().any(|block| {
            let (low, high) = block.clone().fold((f64::INFINITY, 0.0), |(low, high), i| {
                (factors[i].min(low), factors[i].max(high))
            });
            high > SPREAD * low
        });
        let mut forms = Vec::new();
        for block in turned().filter(|_| !is_eliminated) {
            let (at, size) = (block.start, block.len());
            let own = model.a.view((at, at), (size, size)).into_owned();
            forms.push((at, real_schur(&own)?));
        }
        let mut q = DMatrix::identity(n, n);
        for (at, (turn, _)) in &forms {
            q.view_mut((*at, *at), turn.shape()).copy_from(turn);
        }
        let mut t = if forms.is_empty() {
            model.a.clone()
        } else {
            q.transpose() * &model.a * &q
        };
        for (at, (_, form)) in &forms {
            t.view_mut((*at, *at), form.shape()).copy_from(form);
        }
        let c = &model.c * &q;
        Ok(Self {
            outputs: c.row_iter().map(|row| row.amax()).collect(),
            reduced: Matrices {
                a: t.transpose(),
                b: q.transpose() * &model.b,
                c,
            },
            d: system.d().clone(),
            work: vec![0.0; 2 * WIDEST * n * 3 * system.inputs()],
            is_turned: !forms.is_empty(),
            is_eliminated,
            largest: [model.a.amax(), model.b.amax()],
            model,
            q,
            parts,
        })
    }

    /// Writes the response at each of `points` into `out`, point after point, `n_y x n_u` each, column-major.
    ///
    /// # Errors
    /// The index of the first point that is a pole: where substitution meets an exact zero or the response overflows; from
    /// there on `out` is unspecified. A pole that rounding has moved off the point gives a very large response instead.
    ///
    /// # Panics
    /// Never, if `out` has `n_y n_u` entries a point; a shorter slice is filled as far as it goes.
    pub fn evaluate(&mut self, points: &[Complex<f64>], out: &mut [Complex<f64>]) -> Result<(), usize> {
        if self.is_eliminated {
            return self.eliminate(points, out);
        }
        pulp::Arch::new().dispatch(Points {
            kernel: self,
            points,
            out,
        })
    }

    /// The responses by elimination, which mixes no scales, in `O(n^3)` a point.
    fn eliminate(&self, points: &[Complex<f64>], out: &mut [Complex<f64>]) -> Result<(), usize> {
        let complex = |m: &DMatrix<f64>| m.map(Complex::from);
        let (b, c, d) = (complex(&self.model.b), complex(&self.model.c), complex(&self.d));
        for (k, (z, out)) in points.iter().zip(out.chunks_mut(d.len().max(1))).enumerate() {
            let gap = DMatrix::identity(b.nrows(), b.nrows()) * *z - complex(&self.model.a);
            let response = &c * gap.lu().solve(&b).ok_or(k)? + &d;
            if response.iter().any(|v| !v.is_finite()) {
                return Err(k);
            }
            out.iter_mut().zip(response.iter()).for_each(|(o, r)| *o = *r);
        }
        Ok(())
    }
}

/// All points, in the registers of one kind of machine.
struct Points<'a> {
    kernel: &'a mut ResponseKernel,
    points: &'a [Complex<f64>],
    out: &'a mut [Complex<f64>],
}

impl WithSimd for Points<'_> {
    type Output = Result<(), usize>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let lanes = S::F64_LANES;
        let size = self.kernel.d.len();
        for (block, points) in self.points.chunks(lanes).enumerate() {
            let from = (block * lanes * size).min(self.out.len());
            if let Err(lane) = self.kernel.block(simd, points, &mut self.out[from..]) {
                return Err(block * lanes + lane);
            }
        }
        Ok(())
    }
}

impl ResponseKernel {
    /// The response at as many points as there are lanes, or fewer; the first of them that is a pole.
    #[inline(always)]
    fn block<S: Simd>(
        &mut self,
        simd: S,
        points: &[Complex<f64>],
        out: &mut [Complex<f64>],
    ) -> Result<(), usize> {
        let n = self.model.a.nrows();
        let (ny, nu) = self.d.shape();
        let (all, _) = S::as_mut_simd_f64s(&mut self.work);
        let (all, _) = all.as_chunks_mut::<2>();
        let (rhs, rest) = all.split_at_mut(n * nu);
        let (left, rest) = rest.split_at_mut(n * nu);
        let states = &mut rest[..n * nu];
        let (zero, z) = (simd.splat_f64s(0.0), lanes_of::<S>(simd, points));
        for i in 0..n {
            for j in 0..nu {
                rhs[i * nu + j] = [simd.splat_f64s(self.reduced.b[(i, j)]), zero];
            }
        }
        solve::<S>(simd, &self.reduced.a, z, rhs, &self.parts, nu);
        let (mut largest, mut lost) = (zero, zero);
        for x in rhs.iter() {
            let size = size(simd, *x);
            largest = simd.max_f64s(largest, size);
            lost = simd.add_f64s(lost, simd.sub_f64s(size, size));
        }
        if let Some(lane) = first_nonzero::<S>(simd, lost, points.len()) {
            return Err(lane);
        }
        let [a, b] = self.largest;
        let scale = simd.add_f64s(size(simd, z), simd.splat_f64s(a));
        let limit = simd.splat_f64s(NEAR_A_POLE * b);
        let is_near = simd.greater_than_f64s(simd.mul_f64s(largest, scale), limit);
        let mut refined = simd.first_true_m64s(is_near) < S::F64_LANES;
        loop {
            if refined {
                let matrices = (&self.model, &self.reduced.a, &self.q);
                refine::refine(simd, matrices, z, &self.parts, [rhs, left, states]);
            }
            let (x, c) = match refined {
                true => (&*states, &self.model.c),
                false => (&*rhs, &self.reduced.c),
            };
            let (mut hidden, mut lost) = (zero, zero);
            for j in 0..nu {
                let states = (0..n).fold(zero, |sum, k| simd.add_f64s(sum, size(simd, x[k * nu + j])));
                for i in 0..ny {
                    let mut sum = [simd.splat_f64s(self.d[(i, j)]), zero];
                    for k in 0..n {
                        sum = plus(simd, sum, times_real(simd, x[k * nu + j], c[(i, k)]));
                    }
                    let whole = simd.mul_f64s(states, simd.splat_f64s(self.outputs[i]));
                    let size = size(simd, sum);
                    let seen = simd.mul_f64s(size, simd.splat_f64s(CANCELLED));
                    hidden = simd.max_f64s(hidden, simd.sub_f64s(whole, seen));
                    lost = simd.add_f64s(lost, simd.sub_f64s(size, size));
                    let [re, im] = [values_of::<S>(simd, sum[0]), values_of::<S>(simd, sum[1])];
                    for lane in 0..points.len() {
                        if let Some(o) = out.get_mut(lane * ny * nu + j * ny + i) {
                            *o = Complex::new(re[lane], im[lane]);
                        }
                    }
                }
            }
            let is_hidden = simd.greater_than_f64s(hidden, zero);
            if refined || !self.is_turned || simd.first_true_m64s(is_hidden) >= S::F64_LANES {
                return first_nonzero::<S>(simd, lost, points.len()).map_or(Ok(()), Err);
            }
            refined = true;
        }
    }
}

impl<K: Clock> StateSpace<K> {
    /// The frequency response at frequencies in Hz.
    ///
    /// # Errors
    /// [`CoreError::Frequency`] for a frequency that is negative, not finite, not increasing or above Nyquist;
    /// [`CoreError::PoleOnLine`] where the response is infinite; those of [`ResponseKernel::new`].
    pub fn frequency_response(&self, frequencies_hz: &[f64]) -> Result<Frf, CoreError> {
        let limit = self.clock().nyquist_hz() * (1.0 + 1e-12);
        if let Some(index) = frequencies_hz.iter().position(|&f| f > limit) {
            return Err(CoreError::Frequency {
                index,
                value_hz: frequencies_hz[index],
                problem: "above the Nyquist frequency of the model",
            });
        }
        finite("frequency response: A", self.a())?;
        let mut frf = Frf::zeros(frequencies_hz.to_vec(), self.outputs(), self.inputs())?;
        let mut kernel = ResponseKernel::new(self)?;
        let points: Vec<Complex<f64>> = frequencies_hz.iter().map(|&f| self.clock().point(f)).collect();
        match kernel.evaluate(&points, frf.values_mut()) {
            Ok(()) => Ok(frf),
            Err(at) => Err(CoreError::PoleOnLine {
                frequency_hz: frequencies_hz[at],
            }),
        }
    }
}

#[cfg(test)]
mod tests;
