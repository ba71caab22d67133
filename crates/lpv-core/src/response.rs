//! Frequency responses over thousands of lines: one Hessenberg reduction a model, then O(n^2) a line.

use crate::linalg::finite;
use crate::{Clock, CoreError, Frf, StateSpace};
use nalgebra::{DMatrix, Hessenberg};
use num_complex::Complex;
use pulp::{Simd, WithSimd};
use std::ops::{DivAssign, MulAssign};

/// A model reduced to Hessenberg form, ready to be evaluated at many points.
///
/// With `D^-1 A D = Q H Q^T`, D diagonal such that rows and columns have like norms (powers of two, so that nothing is rounded), the
/// response is `C D Q (z I - H)^-1 Q^T D^-1 B + D_u`, D_u the direct term; `z I - H` is solved by elimination between
/// neighbouring rows with pivoting (Laub, IEEE TAC 26(2), 1981), for as many points at a time as a vector register of the
/// machine has lanes. No products and sums are fused: the result does not depend on the machine.
#[derive(Debug, Clone)]
pub struct ResponseKernel {
    h: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
    d: DMatrix<f64>,
    work: Vec<f64>,
}

impl ResponseKernel {
    /// One reduction of `A`.
    pub fn new<K: Clock>(system: &StateSpace<K>) -> Self {
        let n = system.states();
        let (mut a, mut b, mut c) = (system.a().clone(), system.b().clone(), system.c().clone());
        balance(&mut a, &mut b, &mut c);
        let (q, h) = if n > 1 {
            Hessenberg::new(a).unpack()
        } else {
            (DMatrix::identity(n, n), a)
        };
        Self {
            b: q.transpose() * b,
            c: c * &q,
            d: system.d().clone(),
            work: vec![0.0; 2 * WIDEST * n * (n + system.inputs())],
            h,
        }
    }

    /// Writes the response at each of `points` into `out`, point after point, `n_y x n_u` each, column-major.
    ///
    /// # Errors
    /// The index of the first point that is a pole: where elimination meets an exact zero or the response overflows; from
    /// there on `out` is unspecified. A pole that rounding has moved off the point gives a very large response instead.
    ///
    /// # Panics
    /// Never, if `out` has `n_y n_u` entries a point; a shorter slice is filled as far as it goes.
    pub fn evaluate(&mut self, points: &[Complex<f64>], out: &mut [Complex<f64>]) -> Result<(), usize> {
        pulp::Arch::new().dispatch(Points {
            kernel: self,
            points,
            out,
        })
    }
}

/// Scales the states by powers of two until rows and columns of `a` have like norms (Parlett and Reinsch, Numerische Mathematik
/// 13, 1969), or for as many sweeps as that may reasonably take.
fn balance(a: &mut DMatrix<f64>, b: &mut DMatrix<f64>, c: &mut DMatrix<f64>) {
    for _ in 0..20 {
        let mut settled = true;
        for i in 0..a.nrows() {
            let diagonal = a[(i, i)].abs();
            let row = a.row(i).lp_norm(1) - diagonal;
            let column = a.column(i).lp_norm(1) - diagonal;
            let power = (0.5 * (row / column).log2()).round();
            if !(power.is_finite() && power.abs() >= 1.0 && power.abs() < 500.0) {
                continue;
            }
            let scale = power.exp2();
            settled = false;
            a.column_mut(i).mul_assign(scale);
            c.column_mut(i).mul_assign(scale);
            a.row_mut(i).div_assign(scale);
            b.row_mut(i).div_assign(scale);
        }
        if settled {
            break;
        }
    }
}

/// Most lanes that a register of doubles has.
const WIDEST: usize = 8;

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
        let n = self.h.nrows();
        let (ny, nu) = self.d.shape();
        let (all, _) = S::as_mut_simd_f64s(&mut self.work);
        let (all, _) = all.as_chunks_mut::<2>();
        let (work, rest) = all.split_at_mut(n * n);
        let rhs = &mut rest[..n * nu];
        let (zero, z) = (simd.splat_f64s(0.0), lanes_of::<S>(simd, points));
        for i in 0..n {
            for j in i.saturating_sub(1)..n {
                work[i * n + j] = [simd.splat_f64s(-self.h[(i, j)]), zero];
            }
            let [re, _] = work[i * n + i];
            work[i * n + i] = [simd.add_f64s(re, z[0]), z[1]];
            for j in 0..nu {
                rhs[i * nu + j] = [simd.splat_f64s(self.b[(i, j)]), zero];
            }
        }
        solve::<S>(simd, work, rhs, n, nu);
        for j in 0..nu {
            for i in 0..ny {
                let mut sum = [simd.splat_f64s(self.d[(i, j)]), zero];
                for k in 0..n {
                    let c = simd.splat_f64s(self.c[(i, k)]);
                    let x = rhs[k * nu + j];
                    sum = [
                        simd.add_f64s(sum[0], simd.mul_f64s(x[0], c)),
                        simd.add_f64s(sum[1], simd.mul_f64s(x[1], c)),
                    ];
                }
                let [re, im] = sum.map(|s| values_of::<S>(simd, s));
                for lane in 0..points.len() {
                    if let Some(o) = out.get_mut(lane * ny * nu + j * ny + i) {
                        *o = Complex::new(re[lane], im[lane]);
                    }
                }
            }
        }
        // What is not finite minus itself is not zero.
        let left = rhs
            .iter()
            .flatten()
            .fold(zero, |sum, v| simd.add_f64s(sum, simd.sub_f64s(*v, *v)));
        match values_of::<S>(simd, left)[..points.len()]
            .iter()
            .position(|l| *l != 0.0)
        {
            Some(lane) => Err(lane),
            None => Ok(()),
        }
    }
}

/// One complex number of each point: real and imaginary parts.
type Lanes<S> = [<S as Simd>::f64s; 2];

/// The last point fills the lanes that are left.
#[inline(always)]
fn lanes_of<S: Simd>(simd: S, points: &[Complex<f64>]) -> Lanes<S> {
    let at = |lane: usize| points[lane.min(points.len() - 1)];
    let load = |values: [f64; WIDEST]| match S::as_simd_f64s(&values).0.first() {
        Some(lanes) => *lanes,
        None => simd.splat_f64s(values[0]),
    };
    [
        load(std::array::from_fn(|lane| at(lane).re)),
        load(std::array::from_fn(|lane| at(lane).im)),
    ]
}

/// Values by lane; zero where there is none.
#[inline(always)]
fn values_of<S: Simd>(_simd: S, lanes: S::f64s) -> [f64; WIDEST] {
    let mut values = [0.0; WIDEST];
    if let Some(first) = S::as_mut_simd_f64s(&mut values).0.first_mut() {
        *first = lanes;
    }
    values
}

/// `a b`.
#[inline(always)]
fn times<S: Simd>(simd: S, a: Lanes<S>, b: Lanes<S>) -> Lanes<S> {
    let re = simd.sub_f64s(simd.mul_f64s(a[0], b[0]), simd.mul_f64s(a[1], b[1]));
    let im = simd.add_f64s(simd.mul_f64s(a[0], b[1]), simd.mul_f64s(a[1], b[0]));
    [re, im]
}

/// `sum - a b`.
#[inline(always)]
fn less<S: Simd>(simd: S, sum: Lanes<S>, a: Lanes<S>, b: Lanes<S>) -> Lanes<S> {
    let product = times(simd, a, b);
    [
        simd.sub_f64s(sum[0], product[0]),
        simd.sub_f64s(sum[1], product[1]),
    ]
}

/// `a / b`.
#[inline(always)]
fn over<S: Simd>(simd: S, a: Lanes<S>, b: Lanes<S>) -> Lanes<S> {
    let square = simd.add_f64s(simd.mul_f64s(b[0], b[0]), simd.mul_f64s(b[1], b[1]));
    let re = simd.add_f64s(simd.mul_f64s(a[0], b[0]), simd.mul_f64s(a[1], b[1]));
    let im = simd.sub_f64s(simd.mul_f64s(a[1], b[0]), simd.mul_f64s(a[0], b[1]));
    [simd.div_f64s(re, square), simd.div_f64s(im, square)]
}

/// The sum of the absolute values of the parts.
#[inline(always)]
fn size<S: Simd>(simd: S, a: Lanes<S>) -> S::f64s {
    simd.add_f64s(simd.abs_f64s(a[0]), simd.abs_f64s(a[1]))
}

/// Solves the Hessenberg systems in place.
#[inline(always)]
fn solve<S: Simd>(simd: S, work: &mut [Lanes<S>], rhs: &mut [Lanes<S>], n: usize, nu: usize) {
    for k in 0..n.saturating_sub(1) {
        let (top, bottom) = work.split_at_mut((k + 1) * n);
        let (row, next) = (&mut top[k * n + k..], &mut bottom[k..n]);
        let (above, below) = rhs.split_at_mut((k + 1) * nu);
        let (above, below) = (&mut above[k * nu..], &mut below[..nu]);
        let larger = simd.greater_than_f64s(size(simd, next[0]), size(simd, row[0]));
        if simd.first_true_m64s(larger) < S::F64_LANES {
            let rows = row.iter_mut().zip(next.iter_mut());
            for (one, other) in rows.chain(above.iter_mut().zip(below.iter_mut())) {
                for (one, other) in one.iter_mut().zip(other.iter_mut()) {
                    let (a, b) = (*one, *other);
                    *one = simd.select_f64s(larger, b, a);
                    *other = simd.select_f64s(larger, a, b);
                }
            }
        }
        let factor = over(simd, next[0], row[0]);
        for (next, row) in next[1..].iter_mut().zip(&row[1..]) {
            *next = less(simd, *next, factor, *row);
        }
        for (below, above) in below.iter_mut().zip(above.iter()) {
            *below = less(simd, *below, factor, *above);
        }
    }
    let one = [simd.splat_f64s(1.0), simd.splat_f64s(0.0)];
    for k in (0..n).rev() {
        let inverse = over(simd, one, work[k * n + k]);
        let (known, solved) = rhs.split_at_mut((k + 1) * nu);
        let row = &work[k * n + k + 1..(k + 1) * n];
        for j in 0..nu {
            let mut sum = known[k * nu + j];
            for (factor, solved) in row.iter().zip(solved.chunks_exact(nu)) {
                sum = less(simd, sum, *factor, solved[j]);
            }
            known[k * nu + j] = times(simd, sum, inverse);
        }
    }
}

impl<K: Clock> StateSpace<K> {
    /// The frequency response at frequencies in cycles per unit of time.
    ///
    /// # Errors
    /// [`CoreError::Frequency`] for a frequency that is negative, not finite, not increasing or above Nyquist;
    /// [`CoreError::PoleOnLine`] where the response is infinite.
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
        let mut kernel = ResponseKernel::new(self);
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
mod tests {
    use super::{Points, ResponseKernel};
    use crate::{Continuous, StateSpace};
    use nalgebra::{DMatrix, dmatrix};
    use num_complex::Complex;
    use pulp::Simd;

    /// Every kind of register gives the response that the plain inverse gives.
    #[test]
    fn all_registers_agree() {
        let n = 9;
        let a = DMatrix::from_fn(n, n, |i, j| {
            ((3 * i + 5 * j) as f64).sin() - if i == j { 2.0 } else { 0.0 }
        });
        let b = DMatrix::from_fn(n, 2, |i, j| ((i + 7 * j) as f64).cos());
        let c = DMatrix::from_fn(2, n, |i, j| ((2 * i + j) as f64).sin());
        let d = dmatrix![0.1, 0.0; -0.2, 0.3];
        let system = StateSpace::new(a.clone(), b.clone(), c.clone(), d.clone(), Continuous).unwrap();
        let points: Vec<Complex<f64>> = (0..21).map(|k| Complex::new(0.0, 0.3 * f64::from(k))).collect();
        let complex = |m: &DMatrix<f64>| m.map(|v| Complex::new(v, 0.0));
        let exact: Vec<Complex<f64>> = points
            .iter()
            .flat_map(|z| {
                let gap = DMatrix::identity(n, n) * *z - complex(&a);
                let x = gap.lu().solve(&complex(&b)).unwrap();
                (complex(&c) * x + complex(&d)).as_slice().to_vec()
            })
            .collect();
        let check = |name: &str, run: &dyn Fn(Points<'_>) -> Result<(), usize>| {
            let mut kernel = ResponseKernel::new(&system);
            let mut out = vec![Complex::new(0.0, 0.0); exact.len()];
            run(Points {
                kernel: &mut kernel,
                points: &points,
                out: &mut out,
            })
            .unwrap();
            for (o, e) in out.iter().zip(&exact) {
                assert!((o - e).norm() < 1e-11 * e.norm().max(1.0), "{name}: {o} {e}");
            }
        };
        check("scalar", &|p| Simd::vectorize(pulp::Scalar::new(), p));
        #[cfg(target_arch = "x86_64")]
        {
            if let Some(simd) = pulp::x86::V3::try_new() {
                check("AVX2", &|p| Simd::vectorize(simd, p));
            }
            if let Some(simd) = pulp::x86::V4::try_new() {
                check("AVX-512", &|p| Simd::vectorize(simd, p));
            }
        }
    }
}
