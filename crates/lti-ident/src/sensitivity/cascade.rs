//! Orthonormal functions with given poles: a cascade of all-passes of two poles each, passed twice.

use crate::LtiIdentError;
use lpv_core::linalg::eigenvalues;
use nalgebra::{DMatrix, DVector, Matrix2, Matrix4, RowVector2, Vector2};

/// Channels that are filtered side by side.
pub(super) const LANES: usize = 4;

/// `(1 + a_1 z + a_2 z^2) / (z^2 + a_1 z + a_2)` as a normalised lattice: two rotations. With the states s,
/// `s+ = A s + b u`, `y = c s + d u`, and `[A b; c d]` is orthogonal.
#[derive(Debug, Clone, Copy)]
struct Section {
    /// Sine and cosine of the inner rotation, `a_1 / (1 + a_2)` the sine.
    inner: (f64, f64),
    /// Of the outer one, `a_2` the sine.
    outer: (f64, f64),
}

impl Section {
    fn new(sum: f64, product: f64) -> Self {
        let rotation = |sine: f64| (sine, ((1.0 - sine) * (1.0 + sine)).max(0.0).sqrt());
        Self {
            inner: rotation((-sum / (1.0 + product)).clamp(-1.0, 1.0)),
            outer: rotation(product),
        }
    }

    fn a(&self) -> Matrix2<f64> {
        let ((k, c), (k2, _)) = (self.inner, self.outer);
        Matrix2::new(-k, -c * k2, c, -k * k2)
    }

    fn b(&self) -> Vector2<f64> {
        Vector2::new(self.inner.1, self.inner.0) * self.outer.1
    }

    fn c(&self) -> RowVector2<f64> {
        RowVector2::new(0.0, self.outer.1)
    }

    fn d(&self) -> f64 {
        self.outer.0
    }
}

/// The functions `F_k` of `[F_1; F_2; ...] = (z - A)^-1 b`, n of them with the poles of a filter and n with the poles
/// once more \[heuberger2005\]. They are orthonormal, `A A' + b b' = 1`, whatever the poles are: equal ones need no
/// care. The first n span all responses of the filter's states to one input, all 2 n those of the states' derivatives.
/// A pole at zero is added where the number of poles is odd.
pub(super) struct Cascade {
    sections: Vec<Section>,
    /// `2 n x 2 n`, block lower triangular.
    pub(super) a: DMatrix<f64>,
    /// 2 n.
    pub(super) b: DVector<f64>,
    /// Of blocks i and k: `(1 - A_kk (x) A_ii)^-1`, for each pair of sections.
    solvers: Vec<Matrix4<f64>>,
    /// Largest modulus of a pole.
    pub(super) radius: f64,
}

impl Cascade {
    /// With the eigenvalues of a matrix, all inside the unit circle.
    pub(super) fn new(matrix: &DMatrix<f64>) -> Result<Self, LtiIdentError> {
        let poles = eigenvalues(matrix)?;
        let radius = poles.iter().map(|z| z.norm()).fold(0.0, f64::max);
        let pairs = poles.iter().filter(|z| z.im > 0.0);
        let mut sections: Vec<_> = pairs.map(|z| Section::new(2.0 * z.re, z.norm_sqr())).collect();
        let real: Vec<f64> = poles.iter().filter(|z| z.im == 0.0).map(|z| z.re).collect();
        for pair in real.chunks(2) {
            let (p, q) = (pair[0], pair.get(1).copied().unwrap_or(0.0));
            sections.push(Section::new(p + q, p * q));
        }
        let size = 4 * sections.len();
        let (mut a, mut b) = (DMatrix::zeros(size, size), DVector::zeros(size));
        // What leaves the sections so far: a row of the states, and the input.
        let (mut row, mut feed) = (DMatrix::zeros(1, size), 1.0);
        for (i, s) in sections.iter().chain(&sections).enumerate() {
            a.view_mut((2 * i, 0), (2, size)).copy_from(&(s.b() * &row));
            a.view_mut((2 * i, 2 * i), (2, 2)).copy_from(&s.a());
            b.rows_mut(2 * i, 2).copy_from(&(s.b() * feed));
            row *= s.d();
            row.columns_mut(2 * i, 2).copy_from(&s.c());
            feed *= s.d();
        }
        let mut cascade = Self {
            sections,
            a,
            b,
            solvers: Vec::new(),
            radius,
        };
        for right in &cascade.sections {
            for left in &cascade.sections {
                let system = Matrix4::identity() - right.a().kronecker(&left.a());
                let singular = || LtiIdentError::Singular {
                    what: "sensitivities",
                };
                cascade.solvers.push(system.try_inverse().ok_or_else(singular)?);
            }
        }
        Ok(cascade)
    }

    /// Functions with simple poles: n.
    pub(super) fn simple(&self) -> usize {
        2 * self.sections.len()
    }

    /// The solution of `X = A X A' + Q` for the first rows and columns of A that Q has. Blocks below the diagonal of A
    /// are products of a column and a row, so that an entry takes a fixed number of operations.
    pub(super) fn stein(&self, mut q: DMatrix<f64>) -> DMatrix<f64> {
        let (rows, columns) = q.shape();
        let count = self.sections.len();
        // Of the columns so far: what leaves their sections.
        let mut left_out = DMatrix::zeros(rows, 1);
        for k in 0..columns / 2 {
            let right = &self.sections[k % count];
            let (a, b) = (right.a().transpose(), right.b().transpose());
            let (mut above, mut out) = (RowVector2::zeros(), 0.0);
            for i in 0..rows / 2 {
                let left = &self.sections[i % count];
                let from_left = left_out.fixed_view::<2, 1>(2 * i, 0).into_owned();
                let mut block = q.fixed_view::<2, 2>(2 * i, 2 * k).into_owned();
                block += (left.a() * from_left + left.b() * out) * b + left.b() * above;
                let solver = &self.solvers[(k % count) * count + i % count];
                let solved = solver * block.reshape_generic(nalgebra::Const::<4>, nalgebra::Const::<1>);
                let x = Matrix2::from_column_slice(solved.as_slice());
                above = above * left.d() + left.c() * x * a;
                out = out * left.d() + (left.c() * from_left)[0];
                q.fixed_view_mut::<2, 2>(2 * i, 2 * k).copy_from(&x);
            }
            left_out *= right.d();
            left_out += q.fixed_columns::<2>(2 * k) * right.c().transpose();
        }
        q
    }

    /// Matrices `Z_k` of `(z - M)^-1 = sum_k Z_k F_k(z)` for the simple poles: those of M.
    pub(super) fn resolvent(&self, m: &DMatrix<f64>) -> Option<Vec<DMatrix<f64>>> {
        let n = m.nrows();
        let unit = DMatrix::identity(n, n);
        let square = m * m;
        // `b A^k` and so on, summed over the basis, are all polynomials of M over others: they commute.
        let (mut out, mut feed) = (DMatrix::zeros(n, n), 1.0);
        let mut all = Vec::with_capacity(self.simple());
        for s in &self.sections {
            let (a, b) = (s.a(), s.b());
            let drive = m * &out + &unit * feed;
            let denominator = &unit - m * a.trace() + &square * a.determinant();
            let left = denominator.lu().solve(&drive)?;
            let turned = m * &left;
            let first = &left * b[0] + &turned * (a[(0, 1)] * b[1] - a[(1, 1)] * b[0]);
            let second = left * b[1] + turned * (a[(1, 0)] * b[0] - a[(0, 0)] * b[1]);
            out = out * s.d() + &second * s.c()[1];
            feed *= s.d();
            all.push(first);
            all.push(second);
        }
        Some(all)
    }

    /// For each simple function k the matrix whose entry (l, r) is the part of `F_r` in `F_l F_k`; l simple, r any.
    pub(super) fn products(&self) -> Vec<DMatrix<f64>> {
        let n = self.simple();
        let b = self.b.rows(0, n);
        (0..n)
            .map(|k| self.stein(b * self.a.column(k).transpose()))
            .collect()
    }

    /// States of all lanes, at rest.
    pub(super) fn rest(&self) -> Vec<[f64; LANES]> {
        vec![[0.0; LANES]; 2 * self.simple()]
    }

    /// Filters some samples, one `[f64; LANES]` each, which are overwritten. Column k of `out` receives the states
    /// before sample k, `LANES` values for each function, from the row `top` on.
    pub(super) fn filter(
        &self,
        states: &mut [[f64; LANES]],
        signals: &mut [[f64; LANES]],
        out: &mut DMatrix<f64>,
        top: usize,
    ) {
        let stride = out.nrows();
        for (i, s) in self.sections.iter().chain(&self.sections).enumerate() {
            let ((k, c), (k2, c2)) = (s.inner, s.outer);
            let (mut x, mut y) = (states[2 * i], states[2 * i + 1]);
            let from = top + 2 * i * LANES;
            for (u, column) in signals
                .iter_mut()
                .zip(out.as_mut_slice().chunks_exact_mut(stride))
            {
                column[from..from + LANES].copy_from_slice(&x);
                column[from + LANES..from + 2 * LANES].copy_from_slice(&y);
                for lane in 0..LANES {
                    let p = c2 * u[lane] - k2 * y[lane];
                    u[lane] = k2 * u[lane] + c2 * y[lane];
                    y[lane] = k * p + c * x[lane];
                    x[lane] = c * p - k * x[lane];
                }
            }
            (states[2 * i], states[2 * i + 1]) = (x, y);
        }
    }
}
