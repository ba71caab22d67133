//! The one structure that both fits search: a linear filter from known signals to predictions.

use crate::{LtiIdentError, Offset};
use lpv_core::linalg::{discrete_gramian, eigenvalues, from_blocks, real_schur, svd};
use nalgebra::{Complex, DMatrix, DMatrixView, DVector};

/// Most chunks of samples that are simulated side by side, and fewest samples of one.
const CHUNKS: usize = 64;

/// `x+ = A x + B w`, `y_hat = C x + D w + d`, kept as `[A B 0; C D d]`, which `[x; w; 1]` drives.
///
/// For a simulation `w = u` and d is the output offset. For one-step predictions `w = [u; y]`, A stands for `A - K C`, B
/// for `[B - K D, K]` and D for `[D, 0]`: the predictor of an innovation model is then an output-error model of its own
/// data. There d is what the offset becomes on its way through the predictor, in which `C x` and d stay linear.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Predictor {
    pub(crate) states: usize,
    /// `(n + n_y) x (n + n_w + 1)`.
    pub(crate) matrix: DMatrix<f64>,
}

impl Predictor {
    /// With d = 0.
    pub(crate) fn new(
        a: &DMatrix<f64>,
        b: &DMatrix<f64>,
        c: &DMatrix<f64>,
        d: &DMatrix<f64>,
    ) -> Result<Self, LtiIdentError> {
        Ok(Self {
            states: a.nrows(),
            matrix: from_blocks(&[&[a, b], &[c, d]])?.resize_horizontally(a.ncols() + b.ncols() + 1, 0.0),
        })
    }
    fn with_offset(mut self, offset: &DVector<f64>) -> Self {
        let (n, last) = (self.states, self.matrix.ncols() - 1);
        self.matrix
            .view_mut((n, last), (offset.len(), 1))
            .copy_from(offset);
        self
    }
    pub(crate) fn outputs(&self) -> usize {
        self.matrix.nrows() - self.states
    }
    pub(crate) fn inputs(&self) -> usize {
        self.matrix.ncols() - self.states - 1
    }
    pub(crate) fn a(&self) -> DMatrixView<'_, f64> {
        self.matrix.view((0, 0), (self.states, self.states))
    }
    pub(crate) fn b(&self) -> DMatrixView<'_, f64> {
        self.matrix.view((0, self.states), (self.states, self.inputs()))
    }
    pub(crate) fn c(&self) -> DMatrixView<'_, f64> {
        self.matrix.view((self.states, 0), (self.outputs(), self.states))
    }
    pub(crate) fn d(&self) -> DMatrixView<'_, f64> {
        self.matrix
            .view((self.states, self.states), (self.outputs(), self.inputs()))
    }
    /// d.
    pub(crate) fn offset(&self) -> DVector<f64> {
        let last = self.matrix.column(self.matrix.ncols() - 1);
        last.rows(self.states, self.outputs()).into_owned()
    }

    /// Whether every entry is finite and every eigenvalue of A in a region.
    pub(crate) fn is_within(&self, region: Region) -> bool {
        // Rounding on the way through another basis must not throw out a pole on the limit.
        let inside = |z: &Complex<f64>| z.norm() <= region.largest_at(*z) + 1e-12;
        eigenvalues(&self.a().into_owned()).is_ok_and(|e| e.iter().all(inside))
            && self.matrix.iter().all(|v| v.is_finite())
    }

    /// Predictions `n_y x N` for `w` (`n_w x N`), and the states `n x N`.
    pub(crate) fn simulate(&self, initial: &DVector<f64>, w: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
        let n = self.states;
        let mut known = DMatrix::from_element(n + w.nrows() + 1, w.ncols(), 1.0);
        known.rows_mut(n, w.nrows()).copy_from(w);
        let mut next = DVector::zeros(n);
        let upper = self.matrix.rows(0, n);
        for k in 0..w.ncols() {
            let x = if k == 0 { initial } else { &next };
            known.view_mut((0, k), (n, 1)).copy_from(x);
            let mut after = DVector::zeros(n);
            after.gemv(1.0, &upper, &known.column(k), 0.0);
            next = after;
        }
        let predictions = self.matrix.rows(n, self.outputs()) * &known;
        (predictions, known.rows(0, n).into_owned())
    }

    /// The predictions of [`Self::simulate`]. Chunks of samples are simulated side by side from rest, so that a step is a
    /// product of matrices; then what their first states add, `C A^k x`.
    pub(crate) fn predictions(&self, initial: &DVector<f64>, w: &DMatrix<f64>) -> DMatrix<f64> {
        let (n, ny, samples) = (self.states, self.outputs(), w.ncols());
        let length = samples.div_ceil(CHUNKS).max(CHUNKS);
        let chunks = samples.div_ceil(length);
        let (rows, left) = (n + ny, self.matrix.columns(0, n));
        let driven = (self.matrix.columns(n, w.nrows()) * w).resize_horizontally(length * chunks, 0.0);
        let mut predictions = DMatrix::zeros(ny, length * chunks);
        let (mut x, mut next) = (DMatrix::zeros(n, chunks), DMatrix::zeros(rows, chunks));
        let (mut see, mut power) = (DMatrix::zeros(length * ny, n), self.c().into_owned());
        for k in 0..length {
            next.copy_from(&driven.columns_with_step(k, chunks, length - 1));
            next.gemm(1.0, &left, &x, 1.0);
            x.copy_from(&next.rows(0, n));
            predictions
                .columns_with_step_mut(k, chunks, length - 1)
                .copy_from(&next.rows(n, ny));
            see.rows_mut(k * ny, ny).copy_from(&power);
            power *= self.a();
        }
        let whole = self.a().into_owned().pow(length as u32);
        let mut first = DMatrix::zeros(n, chunks);
        first.set_column(0, initial);
        for chunk in 1..chunks {
            let arrived = &whole * first.column(chunk - 1) + x.column(chunk - 1);
            first.set_column(chunk, &arrived);
        }
        let (from_first, offset) = (see * first, self.offset());
        for (y, added) in predictions.as_mut_slice().iter_mut().zip(from_first.as_slice()) {
            *y += added;
        }
        predictions.column_iter_mut().for_each(|mut y| y += &offset);
        predictions.resize_horizontally(samples, 0.0)
    }

    /// The same filter in balanced coordinates with its initial states, where the Gramians can be computed: the search
    /// measures steps in the entries of the matrices, and here all states weigh alike.
    pub(crate) fn balanced(&self, initial: &[DVector<f64>]) -> Option<(Self, Vec<DVector<f64>>)> {
        let (a, b, c) = (
            self.a().into_owned(),
            self.b().into_owned(),
            self.c().into_owned(),
        );
        let reach = discrete_gramian(&a, &b).ok()?.cholesky()?.unpack();
        let see = discrete_gramian(&a.transpose(), &c.transpose())
            .ok()?
            .cholesky()?
            .unpack();
        let svd = svd(see.transpose() * &reach).ok()?;
        let (u, v_t) = (svd.u?, svd.v_t?);
        let scale = DMatrix::from_diagonal(&svd.singular_values.map(|s| 1.0 / s.sqrt()));
        if scale.iter().any(|s| !s.is_finite())
            || svd.singular_values.min() < 1e-9 * svd.singular_values.max()
        {
            return None;
        }
        // x = T z with T = L_c V S^-1/2 and its inverse S^-1/2 U' L_o'.
        let t = reach * v_t.transpose() * &scale;
        let inverse = scale * u.transpose() * see.transpose();
        let moved = Self::new(
            &(&inverse * a * &t),
            &(&inverse * b),
            &(c * &t),
            &self.d().into_owned(),
        )
        .ok()?
        .with_offset(&self.offset());
        let initial = initial.iter().map(|x| &inverse * x).collect();
        Some((moved, initial))
    }

    /// With the states of another filter beside: predictions are added.
    pub(crate) fn plus(&self, other: &Self) -> Result<Self, LtiIdentError> {
        let (n, m) = (self.states, other.states);
        let (right, below) = (DMatrix::zeros(n, m), DMatrix::zeros(m, n));
        let own = |v: DMatrixView<'_, f64>| v.into_owned();
        let a = from_blocks(&[&[&own(self.a()), &right], &[&below, &own(other.a())]])?;
        let b = from_blocks(&[&[&own(self.b())], &[&own(other.b())]])?;
        let c = from_blocks(&[&[&own(self.c()), &own(other.c())]])?;
        let sum = Self::new(&a, &b, &c, &(self.d() + other.d()))?;
        Ok(sum.with_offset(&(self.offset() + other.offset())))
    }
}

/// Where eigenvalues of A may be: inside a circle, and slow ones, nearer than `1 - slow` to the point 1, inside one of the
/// radius `slow`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Region {
    radius: f64,
    slow: f64,
}

impl Region {
    pub(crate) fn circle(radius: f64) -> Self {
        Self { radius, slow: radius }
    }

    /// A pole decays by a tenth over the longest run: one that is slower cannot be told from one on the unit circle. And
    /// what creeps has settled to a twentieth if an offset is estimated: else offset and pole draw a straight line
    /// together, which follows any drift and ends nowhere.
    pub(crate) fn for_samples(longest: usize, offset: Offset) -> Self {
        let n = longest.max(4) as f64;
        let radius = 1.0 - 0.1 / n;
        match offset {
            Offset::Estimated => Self {
                radius,
                slow: 1.0 - 3.0 / n,
            },
            Offset::Zero => Self::circle(radius),
        }
    }

    fn largest_at(self, z: Complex<f64>) -> f64 {
        if (Complex::new(1.0, 0.0) - z).norm() < 1.0 - self.slow {
            self.slow
        } else {
            self.radius
        }
    }
}

/// A matrix with the eigenvalues outside the unit circle mirrored at it, `z -> 1 / conj(z)`, and then those outside
/// a region moved to its edge: the diagonal blocks of the real Schur form are scaled.
pub(crate) fn reflected(a: &DMatrix<f64>, region: Region) -> Option<DMatrix<f64>> {
    let (q, mut t) = real_schur(a).ok()?;
    let mut i = 0;
    while i < t.nrows() {
        let size = if i + 1 < t.nrows() && t[(i + 1, i)] != 0.0 {
            2
        } else {
            1
        };
        let block = t.view((i, i), (size, size)).into_owned();
        let poles = eigenvalues(&block).ok()?;
        let z = *poles.iter().max_by(|a, b| a.norm().total_cmp(&b.norm()))?;
        let radius = z.norm();
        let mirrored = if radius > 1.0 { 1.0 / radius } else { radius };
        let inside = mirrored.min(region.largest_at(z * (mirrored / radius)));
        if inside < radius {
            t.view_mut((i, i), (size, size)).scale_mut(inside / radius);
        }
        i += size;
    }
    Some(&q * t * q.transpose())
}
