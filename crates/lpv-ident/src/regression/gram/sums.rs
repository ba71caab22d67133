//! Sums of products over lines: the kernel that the others feed.

use lpv_numerics::planes::WIDEST;
use pulp::Simd;

/// Rows that are summed together.
pub(super) const ROWS: usize = 4;

/// A matrix of sums over lines of `x_i y_j`, each in the lanes of a register.
pub(super) struct Sums {
    lanes: Vec<f64>,
    columns: usize,
    /// Lanes of a register of this machine.
    width: usize,
}

impl Sums {
    pub(super) fn new(rows: usize, columns: usize) -> Self {
        Self {
            lanes: vec![0.0; rows.next_multiple_of(ROWS) * columns * WIDEST],
            columns,
            width: WIDEST,
        }
    }

    pub(super) fn get(&self, row: usize, column: usize) -> f64 {
        let at = (row * self.columns + column) * self.width;
        self.lanes[at..at + self.width].iter().sum()
    }

    /// Adds the sums of these lines from row `at` on, with all columns.
    #[inline(always)]
    pub(super) fn add<S: Simd>(&mut self, simd: S, at: usize, x: [&[f64]; ROWS], y: &[Vec<f64>]) {
        self.width = S::F64_LANES;
        let (sums, _) = S::as_mut_simd_f64s(&mut self.lanes);
        let (mut from, count) = (0, self.columns);
        while from < count {
            let (sums, y) = (&mut sums[at * count + from..], &y[from..]);
            from += match count - from {
                1 => tile::<S, 1>(simd, x, y, sums, count),
                2 => tile::<S, 2>(simd, x, y, sums, count),
                3 => tile::<S, 3>(simd, x, y, sums, count),
                4 => tile::<S, 4>(simd, x, y, sums, count),
                6 => tile::<S, 6>(simd, x, y, sums, count),
                _ => tile::<S, 5>(simd, x, y, sums, count),
            };
        }
    }
}

/// All rows with so many columns, in as many registers as there are sums.
#[inline(always)]
fn tile<S: Simd, const N: usize>(
    simd: S,
    x: [&[f64]; ROWS],
    y: &[Vec<f64>],
    sums: &mut [S::f64s],
    stride: usize,
) -> usize {
    // Loops, since what takes a function is not always compiled for these registers.
    let count = x[0].len() / S::F64_LANES;
    let mut rows: [&[S::f64s]; ROWS] = [&[]; ROWS];
    for (row, x) in rows.iter_mut().zip(x) {
        *row = &S::as_simd_f64s(x).0[..count];
    }
    let mut columns: [&[S::f64s]; N] = [&[]; N];
    for (column, y) in columns.iter_mut().zip(y) {
        *column = &S::as_simd_f64s(y).0[..count];
    }
    let mut all = [[simd.splat_f64s(0.0); N]; ROWS];
    for k in 0..count {
        let mut now = [simd.splat_f64s(0.0); N];
        for j in 0..N {
            now[j] = columns[j][k];
        }
        for i in 0..ROWS {
            let x = rows[i][k];
            for j in 0..N {
                all[i][j] = simd.mul_add_f64s(x, now[j], all[i][j]);
            }
        }
    }
    for i in 0..ROWS {
        let sums = &mut sums[i * stride..i * stride + N];
        for j in 0..N {
            sums[j] = simd.add_f64s(sums[j], all[i][j]);
        }
    }
    N
}
