//! The exponential of one interval, and how it moves with its generator.

use nalgebra::DMatrix;
use pulp::{Simd, WithSimd};

/// Nodes of Gauss-Legendre quadrature on [0, 1] with their weights, symmetric about the middle. For a generator of norm
/// 1/2 three make the derivative exact to `1e-6`, for norm one four to `2e-7`: more than a step of a search can use.
const THREE: [(f64, f64); 3] = [
    (0.1127016653792583, 0.2777777777777778),
    (0.5, 0.4444444444444444),
    (0.8872983346207417, 0.2777777777777778),
];
const FOUR: [(f64, f64); 4] = [
    (0.06943184420297371, 0.17392742256872679),
    (0.33000947820757187, 0.3260725774312732),
    (0.6699905217924281, 0.3260725774312732),
    (0.9305681557970262, 0.17392742256872679),
];
/// Norm of the generator of one interval.
const NORM: f64 = 1.0;

/// Powers of the generator that are kept. The series goes on to twice as many terms, by one more product: the last is
/// below rounding for that norm. The derivative is content with the powers.
const POWERS: usize = 9;

/// Most intervals: a generator of a larger norm is too stiff for its clock.
const INTERVALS: usize = 256;

/// `out = a b`, for matrices too small to be worth packing.
pub(crate) fn multiply(a: &DMatrix<f64>, b: &DMatrix<f64>, out: &mut DMatrix<f64>) {
    out.fill(0.0);
    add_product(1.0, a, b, out);
}

/// `out += factor a b`; of a, as many columns count as b has rows.
pub(crate) fn add_product(factor: f64, a: &DMatrix<f64>, b: &DMatrix<f64>, out: &mut DMatrix<f64>) {
    pulp::Arch::new().dispatch(AddProduct {
        factor,
        a: a.as_slice(),
        b: b.as_slice(),
        rows: a.nrows(),
        inner: b.nrows(),
        out: out.as_mut_slice(),
    });
}

/// `out += factor a b`, compiled for the registers of each kind of machine.
struct AddProduct<'a> {
    factor: f64,
    a: &'a [f64],
    b: &'a [f64],
    rows: usize,
    inner: usize,
    out: &'a mut [f64],
}

impl WithSimd for AddProduct<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self {
            factor,
            a,
            b,
            rows,
            inner,
            out,
        } = self;
        // A controller without states adds nothing.
        if rows == 0 || inner == 0 {
            return;
        }
        match rows {
            2 => add_columns::<2>(factor, a, b, inner, out),
            4 => add_columns::<4>(factor, a, b, inner, out),
            6 => add_columns::<6>(factor, a, b, inner, out),
            8 => add_columns::<8>(factor, a, b, inner, out),
            _ => {
                for (out, b) in out.chunks_exact_mut(rows).zip(b.chunks_exact(inner)) {
                    for (column, b) in a.chunks_exact(rows).zip(b) {
                        let b = factor * b;
                        for (out, a) in out.iter_mut().zip(column) {
                            *out += b * a;
                        }
                    }
                }
            }
        }
    }
}

/// Columns of a length that the compiler knows stay in registers.
#[inline(always)]
fn add_columns<const N: usize>(factor: f64, a: &[f64], b: &[f64], inner: usize, out: &mut [f64]) {
    let (a, _) = a.as_chunks::<N>();
    let (out, _) = out.as_chunks_mut::<N>();
    for (out, b) in out.iter_mut().zip(b.chunks_exact(inner)) {
        let mut sum = *out;
        for (column, b) in a.iter().zip(b) {
            let b = factor * b;
            for i in 0..N {
                sum[i] += b * column[i];
            }
        }
        *out = sum;
    }
}

/// `e^X` of a generator whose last rows are zero, `X = [A B; 0 0]`, and the products of its derivative
/// `int_0^1 e^((1-s)X) dX e^(sX) ds = sum_q weight_q after_q dX before_q`. Only the rows of the states are kept: the
/// others are those of the identity. The storage is used again for the next interval.
#[derive(Default)]
pub(crate) struct Flow {
    /// `n x (n + n_u)`.
    pub(crate) whole: DMatrix<f64>,
    products: Vec<Product>,
    count: usize,
    powers: Vec<DMatrix<f64>>,
    nodes: [DMatrix<f64>; 4],
    one: DMatrix<f64>,
    tail: DMatrix<f64>,
    /// `e^(jX/intervals)` for j from 0.
    starts: Vec<DMatrix<f64>>,
}

pub(crate) struct Product {
    pub(crate) weight: f64,
    /// `n x n`.
    pub(crate) after: DMatrix<f64>,
    /// `n x (n + n_u)`.
    pub(crate) before: DMatrix<f64>,
}

/// Whether the products are wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Want {
    Value,
    Derivative,
}

impl Flow {
    /// From the rows `[A B]` times the length of the interval. None where it is too stiff or overflows.
    pub(crate) fn update(&mut self, rows: &DMatrix<f64>, want: Want) -> Option<()> {
        let (n, all) = rows.shape();
        if self.whole.shape() != rows.shape() {
            let zero = || DMatrix::zeros(n, all);
            self.whole = zero();
            self.one = zero();
            self.tail = zero();
            self.powers = (0..POWERS).map(|_| zero()).collect();
            self.nodes = std::array::from_fn(|_| zero());
            self.starts.clear();
            self.products.clear();
        }
        let norm = norm(rows);
        if norm.is_nan() || norm > NORM * INTERVALS as f64 {
            return None;
        }
        let intervals = ((norm / NORM).ceil() as usize).max(1);
        // As many powers as this generator needs.
        let part = norm / intervals as f64;
        let (mut count, mut size) = (1, part);
        while size > 1e-17 && count < POWERS {
            let (even, odd) = ((2 * count + 1) as f64, (2 * count) as f64);
            size *= part * part / (even * odd);
            count += 1;
        }
        self.fill_powers(rows, intervals as f64, count);
        let powers = &self.powers[..count];
        exponential(powers, &mut self.tail, &mut self.one);
        while self.starts.len() < intervals + 1 {
            self.starts.push(DMatrix::identity(n, all));
        }
        self.starts[1].copy_from(&self.one);
        for j in 1..intervals {
            let (before, after) = self.starts.split_at_mut(j + 1);
            join(&self.one, &before[j], &mut after[0]);
        }
        self.whole.copy_from(&self.starts[intervals]);
        self.count = 0;
        if want == Want::Derivative {
            let rule: &[(f64, f64)] = if norm <= 0.5 * intervals as f64 {
                &THREE
            } else {
                &FOUR
            };
            for (node, (s, _)) in self.nodes.iter_mut().zip(rule) {
                series(powers, *s, node);
            }
            for j in 0..intervals {
                for (q, (_, weight)) in rule.iter().enumerate() {
                    let mirrored = &self.nodes[rule.len() - 1 - q];
                    if self.products.len() == self.count {
                        self.products.push(Product {
                            weight: 0.0,
                            after: DMatrix::zeros(n, n),
                            before: DMatrix::zeros(n, all),
                        });
                    }
                    let product = &mut self.products[self.count];
                    product.weight = weight / intervals as f64;
                    // The first and the last interval have nothing to be joined with.
                    if j + 1 == intervals {
                        product.after.copy_from(&mirrored.columns(0, n));
                    } else {
                        let rest = self.starts[intervals - 1 - j].columns(0, n).into_owned();
                        product.after.fill(0.0);
                        add_product(1.0, mirrored, &rest, &mut product.after);
                    }
                    if j == 0 {
                        product.before.copy_from(&self.nodes[q]);
                    } else {
                        join(&self.nodes[q], &self.starts[j], &mut product.before);
                    }
                    self.count += 1;
                }
            }
        }
        self.whole.iter().all(|v| v.is_finite()).then_some(())
    }

    /// The products of the last update.
    pub(crate) fn products(&self) -> &[Product] {
        &self.products[..self.count]
    }

    /// `X^k / k!` for k from 1.
    fn fill_powers(&mut self, rows: &DMatrix<f64>, intervals: f64, terms: usize) {
        self.powers[0].copy_from(rows);
        self.powers[0] /= intervals;
        for k in 1..terms {
            let (known, next) = self.powers.split_at_mut(k);
            // A X^(k-1): of X, only the columns of the states meet the rows that are kept.
            next[0].fill(0.0);
            add_product(1.0 / (k + 1) as f64, &known[0], &known[k - 1], &mut next[0]);
        }
    }
}

/// The smaller of the largest column and row sums of A: either bounds the series. B enters linearly, so that its size
/// changes no relative error.
fn norm(rows: &DMatrix<f64>) -> f64 {
    let a = rows.columns(0, rows.nrows());
    let by_column = a.column_iter().map(|c| c.lp_norm(1)).fold(0.0, f64::max);
    let by_row = (0..a.nrows())
        .map(|i| a.row(i).iter().map(|v| v.abs()).sum())
        .fold(0.0, f64::max);
    by_column.min(by_row)
}

/// `e^X`, rows of the states: `sum_k P_k + P_K sum_j (K! j! / (K + j)!) P_j` with the powers `P_k = X^k / k!`.
fn exponential(powers: &[DMatrix<f64>], tail: &mut DMatrix<f64>, out: &mut DMatrix<f64>) {
    series(powers, 1.0, out);
    tail.fill(0.0);
    let last = powers.len();
    let mut weight = 1.0;
    for (j, power) in (1..).zip(powers) {
        weight *= j as f64 / (last + j) as f64;
        for (tail, p) in tail.as_mut_slice().iter_mut().zip(power.as_slice()) {
            *tail += weight * p;
        }
    }
    add_product(1.0, &powers[last - 1], tail, out);
}

/// `e^(s X)` up to the last power, rows of the states.
fn series(powers: &[DMatrix<f64>], s: f64, out: &mut DMatrix<f64>) {
    out.fill(0.0);
    for term in powers.iter().rev() {
        for (out, t) in out.as_mut_slice().iter_mut().zip(term.as_slice()) {
            *out = (*out + t) * s;
        }
    }
    let n = out.nrows();
    for i in 0..n {
        out[(i, i)] += 1.0;
    }
}

/// Rows of the states of `[a; 0 I] [b; 0 I]`.
pub(crate) fn join(a: &DMatrix<f64>, b: &DMatrix<f64>, out: &mut DMatrix<f64>) {
    let n = a.nrows();
    multiply(a, b, out);
    for j in n..a.ncols() {
        for i in 0..n {
            out[(i, j)] += a[(i, j)];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponential_and_its_derivative() {
        let mut flow = Flow::default();
        for size in [0.3, 4.0, 0.1] {
            let rows = DMatrix::from_fn(3, 5, |i, j| size * ((1 + 3 * i + 7 * j) as f64).sin());
            flow.update(&rows, Want::Derivative).unwrap();
            let square = |rows: &DMatrix<f64>| {
                let mut x = DMatrix::zeros(5, 5);
                x.rows_mut(0, 3).copy_from(rows);
                x.exp().rows(0, 3).into_owned()
            };
            let expected = square(&rows);
            assert!((&flow.whole - &expected).amax() < 1e-13 * expected.amax());
            let direction = DMatrix::from_fn(3, 5, |i, j| ((2 + 5 * i + j) as f64).cos());
            let h = 1e-5;
            let difference =
                (square(&(&rows + &direction * h)) - square(&(&rows - &direction * h))) / (2.0 * h);
            let mut own = DMatrix::zeros(3, 5);
            for p in flow.products() {
                let mut before = DMatrix::identity(5, 5);
                before.rows_mut(0, 3).copy_from(&p.before);
                own += &p.after * &direction * before * p.weight;
            }
            let error = (own - &difference).amax();
            assert!(error < 3e-6 * difference.amax(), "{size}: {error}");
        }
        assert!(
            Flow::default()
                .update(&DMatrix::from_element(2, 2, 1e6), Want::Value)
                .is_none()
        );
    }
}
