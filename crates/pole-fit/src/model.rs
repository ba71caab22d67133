//! One point of the search: given the denominator, the best numerators, the residual and the normal matrices.
//!
//! `F(z) = B(z) / (t(z) a(z))`, `t = (z-1)^m` fixed, `a = sum_j alpha_j p_j`, `B_c = sum_i beta_ci p_i`; the columns
//! of the Jacobian of the residual `r = F - B / (t a)` are `-p_i / (t a)` in channel `c` for `beta_ci` and
//! `B p_j / (t a^2)` for `alpha_j`.

use crate::basis::Basis;
use crate::columns::{
    Columns, add_conjugate_product, add_real_product, conjugate_product, dot, product, real_product, square,
};
use crate::moments::Moments;
use crate::weights::Lines;
use crate::{NumeratorDegree, PoleFitError, PoleFitSettings};
use nalgebra::{Cholesky, DMatrix, DVector, DVectorViewMut, Dyn};
use num_complex::Complex;

type C64 = Complex<f64>;

/// What stays the same during a fit.
#[derive(Debug)]
pub(crate) struct Setup<'a> {
    pub(crate) lines: &'a Lines,
    /// `1 / (z - 1)^m` on the lines.
    over_t: Columns,
    /// `K F`.
    weighted_f: Columns,
    pub(crate) order: usize,
    /// Number of coefficients `alpha`: order - m + 1.
    pub(crate) n_a: usize,
    /// Number of coefficients of a numerator.
    pub(crate) n_b: usize,
}

impl<'a> Setup<'a> {
    pub(crate) fn of(lines: &'a Lines, settings: &PoleFitSettings) -> Self {
        let n_b = match settings.numerator {
            NumeratorDegree::Proper => settings.order + 1,
            NumeratorDegree::StrictlyProper => settings.order,
        };
        Self::new(lines, settings.order, settings.fixed_integrators(), n_b)
    }

    pub(crate) fn new(lines: &'a Lines, order: usize, fixed_integrators: usize, n_b: usize) -> Self {
        let over = |z: &C64| (z - 1.0).powu(fixed_integrators as u32).inv();
        let mut weighted_f = Columns::zeros(lines.len(), lines.channels());
        lines.weighted(&lines.f, &mut weighted_f);
        Self {
            lines,
            over_t: Columns::single(&lines.z.iter().map(over).collect::<Vec<_>>()),
            weighted_f,
            order,
            n_a: order - fixed_integrators + 1,
            n_b,
        }
    }

    /// `1 / (z - 1)^m` on a line.
    pub(crate) fn over_t(&self, line: usize) -> C64 {
        self.over_t.at(line, 0)
    }
    /// Real equations.
    pub(crate) fn equations(&self) -> usize {
        2 * self.lines.len() * self.lines.channels()
    }
    /// Real unknowns; the scale of the denominator is none.
    pub(crate) fn unknowns(&self) -> usize {
        self.lines.channels() * self.n_b + self.n_a - 1
    }
    /// The response, as what a model explains.
    pub(crate) fn data(&self) -> Explained {
        Explained {
            v: self.lines.f.clone(),
            weighted: self.weighted_f.clone(),
        }
    }
    /// `sum_k F^H K F`: the cost when nothing is explained.
    pub(crate) fn power(&self) -> f64 {
        dot(self.lines.f.parts(), self.weighted_f.parts())
    }
    /// Whether a cost is that of ten digits of the responses: data without noise.
    pub(crate) fn is_exact(&self, cost: f64) -> bool {
        cost <= 1e-20 * self.power()
    }
    /// The basis that makes the numerators' normal matrix nearly the identity at the denominator `a`.
    pub(crate) fn basis(&self, a: &[C64]) -> Result<Basis, PoleFitError> {
        let sizes: Vec<f64> = a.iter().map(|v| v.norm_sqr()).collect();
        // What is no number stays none, and is refused.
        let floored = |k: usize| {
            let least = least(&sizes, k);
            if sizes[k] < least { least } else { sizes[k] }
        };
        let mu: Vec<f64> = (0..a.len())
            .map(|k| self.lines.profile[k] * self.over_t.at(k, 0).norm_sqr() / floored(k))
            .collect();
        Basis::new(&self.lines.z, &mu, self.order)
    }
}

/// A response `v` on the lines, and `K v`.
pub(crate) struct Explained {
    pub(crate) v: Columns,
    weighted: Columns,
}

/// A denominator with its best numerators.
#[derive(Debug, Clone)]
pub(crate) struct Point {
    pub(crate) alpha: DVector<f64>,
    /// Numerators, one column a channel.
    pub(crate) beta: DMatrix<f64>,
    /// `1 / (sqrt(mu) a)` and `1 / (sqrt(mu) t a)`: what turns `q_j` into `p_j / a` and `p_j / (t a)`.
    pub(crate) over_a: Columns,
    pub(crate) over_ta: Columns,
    /// `r = F - B / (t a)`, and `K r`.
    pub(crate) residual: Columns,
    weighted: Columns,
    /// Weighted sum of squares `sum_k r^H K r`.
    pub(crate) cost: f64,
    h_bb: Blocks,
}

/// Normal matrix of the denominator after the numerators are eliminated.
pub(crate) struct Reduced {
    /// `H_aa - H_ab^T H_bb^-1 H_ab`.
    pub(crate) m: DMatrix<f64>,
    /// `H_bb^-1 H_ab`.
    pub(crate) elimination: DMatrix<f64>,
    /// Covariance of the equation error of noise with covariance `K^-1`, a factor apart.
    pub(crate) noise: DMatrix<f64>,
}

impl Point {
    pub(crate) fn new(setup: &Setup<'_>, basis: &Basis, alpha: DVector<f64>) -> Result<Self, PoleFitError> {
        let (lines, n_b) = (setup.lines, setup.n_b);
        let (n, n_c) = (lines.len(), lines.channels());
        let failed = PoleFitError::Numerators { order: setup.order };
        let over_a = reciprocal(basis, &alpha);
        let mut over_ta = Columns::zeros(n, 1);
        product(over_a.column(0), setup.over_t.column(0), over_ta.column_mut(0));
        if !over_ta.parts().iter().all(|v| v.is_finite()) {
            return Err(failed);
        }
        let h_bb = numerators(setup, basis, &over_ta).ok_or(failed.clone())?;
        let mut point = Self {
            alpha,
            beta: DMatrix::zeros(n_b, n_c),
            over_a,
            over_ta,
            residual: Columns::zeros(n, n_c),
            weighted: setup.weighted_f.clone(),
            cost: 0.0,
            h_bb,
        };
        // The second pass is iterative refinement: its right-hand side comes from the residual itself, so that the
        // squared condition number of the normal matrix does not reach the solution.
        let mut x = Columns::zeros(n, n_c);
        for _ in 0..2 {
            for c in 0..n_c {
                let (s, weighted) = (point.over_ta.column(0), point.weighted.column(c));
                conjugate_product(s, weighted, x.column_mut(c));
            }
            let mut step = basis.correlate(n_b, &x);
            point.h_bb.solve_mut(step.as_mut_slice());
            for (b, s) in point.beta.iter_mut().zip(step.iter()) {
                *b += s;
            }
            basis.q.combine(point.beta.as_slice(), x.parts_mut());
            for c in 0..n_c {
                product(point.over_ta.column(0), x.column(c), point.residual.column_mut(c));
            }
            for (f, residual) in lines.f.parts().iter().zip(point.residual.parts_mut()) {
                *residual = f - *residual;
            }
            lines.weighted(&point.residual, &mut point.weighted);
        }
        point.cost = dot(point.residual.parts(), point.weighted.parts());
        if point.cost.is_finite() {
            Ok(point)
        } else {
            Err(failed)
        }
    }

    /// `B / (t a)` on the lines.
    pub(crate) fn model(&self, setup: &Setup<'_>) -> Explained {
        let difference = |a: &Columns, b: &Columns| {
            let parts = a.parts().iter().zip(b.parts()).map(|(a, b)| a - b);
            Columns::from_parts(a.lines(), parts.collect())
        };
        Explained {
            v: difference(&setup.lines.f, &self.residual),
            weighted: difference(&setup.weighted_f, &self.weighted),
        }
    }

    /// Half the gradient of the cost with respect to `alpha`; the one with respect to `beta` is zero here.
    pub(crate) fn gradient(&self, setup: &Setup<'_>, basis: &Basis, model: &Explained) -> DVector<f64> {
        let n = setup.lines.len();
        let (mut sum, mut x) = (Columns::zeros(n, 1), Columns::zeros(n, 1));
        for c in 0..setup.lines.channels() {
            add_conjugate_product(model.v.column(c), self.weighted.column(c), sum.column_mut(0));
        }
        conjugate_product(self.over_a.column(0), sum.column(0), x.column_mut(0));
        basis.correlate(setup.n_a, &x)
    }

    /// The reduced normal matrix. With the model explained it is the Gauss-Newton one; with the data it is that of the
    /// linearised problem `t a F - B`, divided by the present `t a` (Sanathanan, Koerner, 1963).
    pub(crate) fn reduce(&self, setup: &Setup<'_>, basis: &Basis, explained: &Explained) -> Option<Reduced> {
        let (lines, n_a, n_b) = (setup.lines, setup.n_a, setup.n_b);
        let (n, n_c) = (lines.len(), lines.channels());
        let mut real = vec![0.0; n * (n_c + 2)];
        let mut imaginary = vec![0.0; n * n_c];
        let mut factor = Columns::zeros(n, 1);
        let (by_channel, rest) = real.split_at_mut(n * n_c);
        let (power, flat) = rest.split_at_mut(n);
        conjugate_product(
            self.over_ta.column(0),
            self.over_a.column(0),
            factor.column_mut(0),
        );
        for c in 0..n_c {
            let at = c * n..(c + 1) * n;
            let to = (&mut by_channel[at.clone()], &mut imaginary[at]);
            product(factor.column(0), explained.weighted.column(c), to);
        }
        let both = explained.v.parts().chunks_exact(n);
        for (v, weighted) in both.zip(explained.weighted.parts().chunks_exact(n)) {
            add_real_product(v, weighted, power);
        }
        square(self.over_a.column(0), flat);
        for (power, flat) in power.iter_mut().zip(flat) {
            *power *= *flat;
        }
        let moments = Moments::new(&basis.q, &real, &imaginary);
        let h_aa = DMatrix::from_fn(n_a, n_a, |i, j| moments.real(i, j, n_c));
        let h_ab = DMatrix::from_fn(n_c * n_b, n_a, |row, j| {
            let (c, i) = (row / n_b, row % n_b);
            -moments.complex(i, j, c, c)
        });
        let mut w = h_ab;
        if !self.h_bb.solve_lower_mut(&mut w) {
            return None;
        }
        let m = h_aa - w.tr_mul(&w);
        let mut elimination = w;
        if !self.h_bb.tr_solve_lower_mut(&mut elimination) {
            return None;
        }
        let noise = DMatrix::from_fn(n_a, n_a, |i, j| moments.real(i, j, n_c + 1));
        let finite = m.iter().chain(noise.iter()).all(|x| x.is_finite());
        finite.then_some(Reduced {
            m,
            elimination,
            noise,
        })
    }
}

/// The least that counts of `|a|^2` on a line: a root on it would make its weight infinite. Measured by its neighbours, since
/// with many roots `|a|` spans tens of decades over the band.
fn least(sizes: &[f64], line: usize) -> f64 {
    let near = &sizes[line.saturating_sub(3)..(line + 4).min(sizes.len())];
    1e-26 * near.iter().copied().fold(0.0, f64::max)
}

/// `1 / (sqrt(mu) a)`, with the floor of [`least`].
fn reciprocal(basis: &Basis, alpha: &DVector<f64>) -> Columns {
    let mut a = Columns::zeros(basis.root_mu.len(), 1);
    basis.q.combine(alpha.as_slice(), a.whole_mut(0));
    let (re, im) = a.column_mut(0);
    let lines = || re.iter().zip(im.iter()).zip(&basis.root_mu);
    let sizes: Vec<f64> = lines()
        .map(|((re, im), root)| (re * re + im * im) / (root * root))
        .collect();
    for (k, ((re, im), root)) in re.iter_mut().zip(im).zip(&basis.root_mu).enumerate() {
        let (mut size, least) = (*re * *re + *im * *im, least(&sizes, k) * root * root);
        if size < least {
            (*re, *im, size) = (least.sqrt(), 0.0, least);
        }
        (*re, *im) = (*re / size, -*im / size);
    }
    a
}

/// Cholesky factors of a block-diagonal matrix with equal blocks: one of all channels where the weights couple them, else one
/// each.
#[derive(Debug, Clone)]
struct Blocks(Vec<Cholesky<f64, Dyn>>);

impl Blocks {
    fn new(blocks: impl Iterator<Item = DMatrix<f64>>) -> Option<Self> {
        blocks.map(Cholesky::new).collect::<Option<_>>().map(Self)
    }

    fn solve_mut(&self, x: &mut [f64]) {
        let size = x.len() / self.0.len();
        for (block, x) in self.0.iter().zip(x.chunks_exact_mut(size)) {
            block.solve_mut(&mut DVectorViewMut::from_slice(x, size));
        }
    }

    /// `L^-1 x`; false where L is singular.
    fn solve_lower_mut(&self, x: &mut DMatrix<f64>) -> bool {
        let size = x.nrows() / self.0.len();
        let mut parts = self.0.iter().enumerate();
        parts.all(|(i, block)| {
            block
                .l_dirty()
                .solve_lower_triangular_mut(&mut x.rows_mut(i * size, size))
        })
    }

    /// `L^-T x`; false where L is singular.
    fn tr_solve_lower_mut(&self, x: &mut DMatrix<f64>) -> bool {
        let size = x.nrows() / self.0.len();
        let mut parts = self.0.iter().enumerate();
        parts.all(|(i, block)| {
            block
                .l_dirty()
                .tr_solve_lower_triangular_mut(&mut x.rows_mut(i * size, size))
        })
    }
}

/// The normal matrix of the numerators.
fn numerators(setup: &Setup<'_>, basis: &Basis, over_ta: &Columns) -> Option<Blocks> {
    let (lines, n_b) = (setup.lines, setup.n_b);
    let (n, n_c) = (lines.len(), lines.channels());
    let coupled = &lines.coupled;
    let mut weight = vec![0.0; n];
    let mut real = vec![0.0; n * (n_c + coupled.len())];
    let mut imaginary = vec![0.0; n * coupled.len()];
    square(over_ta.column(0), &mut weight);
    let (of_diagonal, of_pairs) = real.split_at_mut(n * n_c);
    let entries = lines.diagonal().chunks_exact(n);
    for (entries, to) in entries.zip(of_diagonal.chunks_exact_mut(n)) {
        real_product(&weight, entries, to);
    }
    let of_pairs = of_pairs.chunks_exact_mut(n).zip(imaginary.chunks_exact_mut(n));
    for (pair, (to_re, to_im)) in of_pairs.enumerate() {
        let (re, im) = lines.coupling.column(pair);
        real_product(&weight, re, to_re);
        real_product(&weight, im, to_im);
    }
    let moments = Moments::new(&basis.q, &real, &imaginary);
    let lift = |mut h: DMatrix<f64>| {
        for i in 0..h.nrows() {
            h[(i, i)] *= 1.0 + 1e-14;
        }
        h
    };
    if coupled.is_empty() {
        let block = |c: usize| lift(DMatrix::from_fn(n_b, n_b, |i, j| moments.real(i, j, c)));
        return Blocks::new((0..n_c).map(block));
    }
    let mut h = DMatrix::zeros(n_c * n_b, n_c * n_b);
    for c in 0..n_c {
        for j in 0..n_b {
            for i in 0..n_b {
                h[(c * n_b + i, c * n_b + j)] = moments.real(i, j, c);
            }
        }
    }
    for (s, &(c, d)) in coupled.iter().enumerate() {
        for j in 0..n_b {
            for i in 0..n_b {
                let value = moments.complex(i, j, n_c + s, s);
                h[(c * n_b + i, d * n_b + j)] = value;
                h[(d * n_b + j, c * n_b + i)] = value;
            }
        }
    }
    Blocks::new(std::iter::once(lift(h)))
}

#[cfg(test)]
mod tests;
