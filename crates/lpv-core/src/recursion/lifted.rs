//! Several samples as one step, whose matrices are products of powers of A: fewer operations a sample, and longer sums.
//!
//! With `u` and `y` of K samples above each other the step is `[A^K, R; O, T]`, `R = [A^(K-1) B ... B]`, `O = [C; C A; ...]`, T the block
//! Toeplitz matrix of the pulse response (\[bamieh1991\]). Powers are made in twice the precision, and what rounding takes from A^K and O is
//! kept as a second matrix: what rounding makes of A^K is another model.

use crate::CoreError;
use crate::linalg::from_blocks;
use nalgebra::DMatrix;
use pulp::{Simd, WithSimd};

/// How much larger than A, B and C the entries of the step may be: what grows and comes down again is rounded where it is large.
const GROWTH: f64 = 16.0;

/// Samples a state from which on the step pays for itself.
const LONG: usize = 512;

/// Several samples as one step.
pub(super) struct Lifted {
    /// A, B, C, D of the step.
    pub(super) step: [DMatrix<f64>; 4],
    /// What rounding took from A and C.
    pub(super) low: [DMatrix<f64>; 2],
    /// Samples a step.
    pub(super) count: usize,
}

impl Lifted {
    /// `[A, B, C, D]` for several samples a step, where so many samples make that worth the while.
    pub(super) fn new(matrices: [&DMatrix<f64>; 4], samples: usize) -> Option<Self> {
        let [a, b, c, d] = matrices;
        let (n, nu, ny) = (a.nrows(), b.ncols(), c.nrows());
        let operations =
            |k: usize, states: usize| (n + ny * k).next_multiple_of(super::ROWS) * (states + nu * k);
        let per_sample =
            |doublings: &u32| operations(1 << doublings, 2 * n) as f64 / f64::from(1_u32 << doublings);
        let doublings = (1..=4_u32).min_by(|i, j| per_sample(i).total_cmp(&per_sample(j)))?;
        if samples < LONG * n || per_sample(&doublings) > 0.6 * operations(1, n) as f64 {
            return None;
        }
        let [mut power, mut reach, mut observe] = [a, b, c].map(Twofold::exact);
        for _ in 0..doublings {
            observe = observe.joined(&observe.times(&power), |x, y| from_blocks(&[&[x], &[y]]))?;
            reach = power
                .times(&reach)
                .joined(&reach, |x, y| from_blocks(&[&[x, y]]))?;
            power = power.times(&power);
        }
        let pulses = observe.times(&Twofold::exact(b)).high;
        let count = 1 << doublings;
        let mut through = DMatrix::zeros(ny * count, nu * count);
        for i in 0..count {
            for j in 0..=i {
                let mut block = through.view_mut((ny * i, nu * j), (ny, nu));
                match i - j {
                    0 => block.copy_from(d),
                    lag => block.copy_from(&pulses.rows(ny * (lag - 1), ny)),
                }
            }
        }
        let most = GROWTH * a.amax().max(1.0);
        let grows = |now: &DMatrix<f64>, before: f64| {
            // A number that is none is no less than another.
            now.iter().any(|v| !(v.abs() <= most * before && v.is_finite()))
        };
        let is_worse =
            grows(&power.high, 1.0) || grows(&reach.high, b.amax()) || grows(&observe.high, c.amax());
        (!is_worse && through.iter().all(|v| v.is_finite())).then_some(Self {
            step: [power.high, reach.high, observe.high, through],
            low: [power.low, observe.low],
            count,
        })
    }
}

/// A matrix, and what rounding took from it.
struct Twofold {
    high: DMatrix<f64>,
    low: DMatrix<f64>,
}

impl Twofold {
    fn exact(matrix: &DMatrix<f64>) -> Self {
        Self {
            high: matrix.clone(),
            low: DMatrix::zeros(matrix.nrows(), matrix.ncols()),
        }
    }

    /// Both parts of two of them, joined alike.
    fn joined(
        &self,
        other: &Self,
        join: impl Fn(&DMatrix<f64>, &DMatrix<f64>) -> Result<DMatrix<f64>, CoreError>,
    ) -> Option<Self> {
        Some(Self {
            high: join(&self.high, &other.high).ok()?,
            low: join(&self.low, &other.low).ok()?,
        })
    }

    /// Sums with what rounding takes from products and sums (\[ogita2005\]).
    fn times(&self, other: &Self) -> Self {
        let (rows, columns) = (self.high.nrows(), other.high.ncols());
        let mut high = DMatrix::zeros(rows, columns);
        let mut low = DMatrix::zeros(rows, columns);
        pulp::Arch::new().dispatch(Product {
            left: self,
            right: other,
            sums: [high.as_mut_slice(), low.as_mut_slice()],
        });
        Self { high, low }
    }
}

/// A product of two matrices, column by column.
struct Product<'a> {
    left: &'a Twofold,
    right: &'a Twofold,
    sums: [&'a mut [f64]; 2],
}

impl WithSimd for Product<'_> {
    type Output = ();

    // In line, and nothing in it that is not: else the products would be rounded by a function of the library, one by one.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) {
        let Self { left, right, sums } = self;
        let (rows, inner) = left.high.shape();
        let [high, low] = sums.map(|s| s.chunks_exact_mut(rows.max(1)));
        for (j, (sum, lost)) in high.zip(low).enumerate() {
            for k in 0..inner {
                let (b, b_low) = (right.high[(k, j)], right.low[(k, j)]);
                let own = k * rows..(k + 1) * rows;
                let (a, a_low) = (&left.high.as_slice()[own.clone()], &left.low.as_slice()[own]);
                for i in 0..rows {
                    let product = a[i] * b;
                    let rest = a[i].mul_add(b, -product) + (a[i] * b_low + a_low[i] * b);
                    let next = sum[i] + product;
                    let part = next - sum[i];
                    let rounded = (sum[i] - (next - part)) + (product - part);
                    sum[i] = next;
                    lost[i] += rest + rounded;
                }
            }
            for i in 0..rows {
                let whole = sum[i] + lost[i];
                lost[i] -= whole - sum[i];
                sum[i] = whole;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Lifted;
    use nalgebra::DMatrix;

    fn matrix(rows: usize, columns: usize, seed: f64) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |i, j| {
            (seed + 1.3 * i as f64 + 0.7 * (j * j) as f64).sin()
        })
    }

    /// Integers, whose powers need more than one double and are rounded once.
    #[test]
    fn powers_are_rounded_once() {
        let n = 24;
        let whole = DMatrix::from_fn(n, n, |i, j| f64::from(((7 * i + 11 * j * j) % 15) as u32) - 7.0);
        let a = &whole / 1024.0;
        let (b, c, d) = (matrix(n, 2, 0.2), matrix(2, n, 0.3), matrix(2, 2, 0.4));
        let lifted = Lifted::new([&a, &b, &c, &d], 1 << 20).unwrap();
        let (count, [power, ..]) = (lifted.count, lifted.step);
        let integers = whole.map(|v| v as i128);
        let mut exact = integers.clone();
        for _ in 1..count {
            exact = DMatrix::from_fn(n, n, |i, j| {
                (0..n).map(|k| exact[(i, k)] * integers[(k, j)]).sum()
            });
        }
        let unit = 1024.0_f64.powi(count as i32);
        assert_eq!(count, 16);
        for (found, exact) in power.iter().zip(exact.iter()) {
            assert_eq!(*found, *exact as f64 / unit);
        }
    }

    /// Short records, small models, and those that grow on the way are left as they are.
    #[test]
    fn only_what_pays_and_harms_nothing_is_lifted() {
        let n = 12;
        let (b, c, d) = (matrix(n, 1, 0.2), matrix(1, n, 0.3), matrix(1, 1, 0.4));
        let calm = matrix(n, n, 0.1) / n as f64;
        let steep = DMatrix::from_fn(n, n, |i, j| if j == i + 1 { 100.0 } else { 0.0 });
        let wild = &calm * 1e300;
        assert!(Lifted::new([&calm, &b, &c, &d], 100_000).is_some());
        assert!(Lifted::new([&calm, &b, &c, &d], 1000).is_none());
        assert!(Lifted::new([&steep, &b, &c, &d], 100_000).is_none());
        assert!(Lifted::new([&wild, &b, &c, &d], 100_000).is_none());
        let one = |v: f64| DMatrix::from_element(1, 1, v);
        assert!(Lifted::new([&one(0.5), &one(1.0), &one(1.0), &one(0.0)], 100_000).is_none());
    }
}
