//! Poles from a response without a start: subspace identification (McKelvey, Akçay, Ljung, IEEE Trans. Autom. Control 41(7), 1996).
//!
//! On a line, the response and its multiples by powers of z are the observability matrix times the states' response, plus a block Toeplitz
//! matrix times powers of z:
//!
//! ```text
//! [F; z F; ...; z^(q-1) F] = O X + Gamma [I; z I; ...; z^(q-1) I],   O = [C; C A; ...; C A^(q-1)]
//! ```
//!
//! The part of the left side outside the row space of the right blocks has the column space of O; the covariance of the noise is known, and
//! weighs the directions so that those of noise alone have singular values near one. The shift of O gives A. In place of z stands the bilinear
//! variable `w = (z - a) / (1 - a z)` that moves the median line to a quarter of the circle, so that lines on a short arc still tell the powers
//! apart; poles are mapped back.

use crate::relocate::{inside, size};
use crate::weights::Lines;
use lpv_core::linalg::{eigenvalues, least_squares};
use lpv_numerics::dense::{Triangle, right_singular};
use nalgebra::{Cholesky, DMatrix};
use num_complex::Complex;

type C64 = Complex<f64>;

/// Powers of z at first; twice as many, as long as the states fill most of the rows.
const POWERS: usize = 16;
/// Powers at most.
const MOST_POWERS: usize = 128;
/// Part of the rows that states may fill.
const FILLED: f64 = 0.66;
/// Rows of the left side at most.
const MOST_ROWS: usize = 600;
/// Lines of one block of the factorisation.
const BLOCK_LINES: usize = 256;
/// Lines over which the size of the noise is averaged, each way.
const NEIGHBOURS: usize = 5;
/// Singular value over the largest that noise makes from which a direction is a state.
const ABOVE: f64 = 1.05;

/// The directions of the states in the response.
#[derive(Debug)]
pub(crate) struct Subspace {
    /// Column space of O, strongest direction first.
    directions: DMatrix<f64>,
    /// Directions that stand out of the noise.
    states: usize,
    outputs: usize,
    powers: usize,
    /// Of the bilinear variable.
    a: f64,
    /// Angle of the lowest line: poles nearer to one are taken by fixed integrators.
    nearest: f64,
}

impl Subspace {
    /// With as many powers as the states need; none where lines are too few, or too near to each other.
    pub(crate) fn new(lines: &Lines) -> Option<Self> {
        let most = most_powers(lines);
        let mut powers = POWERS.min(most);
        loop {
            let found = Self::with_powers(lines, powers)?;
            let filled = found.states as f64 > FILLED * (powers * lines.n_y) as f64;
            if !filled || powers == most {
                return (!filled).then_some(found);
            }
            powers = (2 * powers).min(most);
        }
    }

    /// The same with four times the powers: modes nearer to each other than a few lines stand out there.
    pub(crate) fn finer(&self, lines: &Lines) -> Option<Self> {
        let powers = 4 * self.powers;
        (powers <= most_powers(lines)).then(|| Self::with_powers(lines, powers))?
    }

    fn with_powers(lines: &Lines, powers: usize) -> Option<Self> {
        let (n_y, n_u, n) = (lines.n_y, lines.n_u, lines.len());
        if powers < 2 {
            return None;
        }
        let mut angles: Vec<f64> = lines.z.iter().map(|z| z.arg().abs()).collect();
        angles.sort_by(f64::total_cmp);
        let lowest = *angles.iter().find(|a| **a > 0.0)?;
        let c = (0.5 * angles[n / 2]).tan().recip();
        let a = if c.is_finite() { (c - 1.0) / (c + 1.0) } else { 0.0 };
        let w: Vec<C64> = lines.z.iter().map(|z| (z - a) / (1.0 - z * a)).collect();
        let roots = line_weights(lines);
        let (rows, known) = (powers * n_y, powers * n_u);
        let free = outside(lines, &w, &roots, powers);
        let factor = Cholesky::new(noise_covariance(lines, &w, &roots, powers))?.l();
        // Rows are directions of the lines, columns those of the powers.
        let whitened = factor.solve_lower_triangular(&free.transpose())?.transpose();
        let (values, vectors) = right_singular(&whitened).ok()?;
        // The largest singular value of noise alone (Marchenko, Pastur): its columns have squares that add up to one a direction.
        let columns = (2 * n * n_u).saturating_sub(known).max(1) as f64;
        let most = ABOVE * (1.0 + (rows as f64 / columns).sqrt());
        Some(Self {
            directions: factor * vectors,
            states: values.iter().take_while(|v| **v > most).count(),
            outputs: n_y,
            powers,
            a,
            nearest: lowest,
        })
    }

    /// Poles of the states that are counted, one of each pair, inside the unit circle and without those that fixed integrators take.
    pub(crate) fn poles(&self, fixed_integrators: usize) -> Option<Vec<C64>> {
        Some(self.near_and_far(self.states, fixed_integrators)?.1)
    }

    /// The same, and then with real poles below the lowest line, which friction makes of integrators:
    /// one, and one for each channel, if there are so many states beside the fixed ones.
    pub(crate) fn starts(&self, fixed_integrators: usize, channels: usize) -> Option<Vec<Vec<C64>>> {
        let (near, far) = self.near_and_far(self.states, fixed_integrators)?;
        let mut distances: Vec<f64> = near.iter().map(|l| (l - 1.0).norm()).collect();
        distances.sort_by(|x, y| y.total_cmp(x));
        let spare = near.len().saturating_sub(fixed_integrators);
        let mut counts = vec![0, spare.min(1), spare.min(channels)];
        counts.dedup();
        let with = |count: usize| {
            // Poles at one place have one residue: each stands a tenth nearer than the one before, at least.
            let mut last = f64::INFINITY;
            let slow = distances[..count].iter().map(|distance| {
                last = distance.min(0.9 * last);
                C64::from(1.0 - last)
            });
            slow.collect::<Vec<_>>()
                .into_iter()
                .chain(far.iter().copied())
                .collect()
        };
        Some(counts.into_iter().map(with).collect())
    }

    /// Poles of so many states inside the unit circle: all of those that are nearer to one than the lowest line where integrators are
    /// fixed, and one of each pair of the others.
    fn near_and_far(&self, states: usize, fixed_integrators: usize) -> Option<(Vec<C64>, Vec<C64>)> {
        let nearest = if fixed_integrators > 0 { self.nearest } else { 0.0 };
        let rows = self.directions.nrows();
        if states == 0 || states + self.outputs > rows {
            return None;
        }
        let o = self.directions.columns(0, states);
        let shifted = rows - self.outputs;
        let (upper, lower) = (o.rows(0, shifted), o.rows(self.outputs, shifted));
        let a = least_squares(upper.into_owned(), &lower.into_owned(), 0.0).ok()?;
        let back = |l: C64| (l + self.a) / (1.0 + l * self.a);
        let all = eigenvalues(&a)
            .ok()?
            .into_iter()
            .map(back)
            .filter(|l| l.is_finite());
        let (near, mut far): (Vec<C64>, Vec<C64>) = all.partition(|l| (l - 1.0).norm() <= nearest);
        far.retain(|l| l.im >= 0.0);
        let mut far: Vec<C64> = far.into_iter().map(inside).collect();
        far.sort_by(|x, y| x.arg().total_cmp(&y.arg()).then(x.re.total_cmp(&y.re)));
        Some((near, far))
    }

    /// So many poles at least, of the states that are counted and of as many more as it takes.
    pub(crate) fn at_least(&self, count: usize, fixed_integrators: usize) -> Option<Vec<C64>> {
        /// States more than poles asked for, which may turn out to be those of integrators.
        const MORE: usize = 16;
        (self.states..=self.states.max(count) + MORE)
            .map_while(|states| Some(self.near_and_far(states, fixed_integrators)?.1))
            .find(|poles| size(poles) >= count)
    }
}

/// Half of the columns stay free of the right side, and twice the rows of the left.
fn most_powers(lines: &Lines) -> usize {
    let (n_y, n_u) = (lines.n_y, lines.n_u);
    let by_lines = lines.len() * n_u / (2 * n_y + n_u);
    by_lines.min(MOST_ROWS / n_y).min(MOST_POWERS)
}

/// The triangular factor of the left side's rows, as columns, outside the row space of the right side.
fn outside(lines: &Lines, w: &[C64], roots: &[f64], powers: usize) -> DMatrix<f64> {
    let (n_y, n_u, n) = (lines.n_y, lines.n_u, lines.len());
    let (rows, known) = (powers * n_y, powers * n_u);
    let mut triangle = Triangle::new(known + rows, 2 * BLOCK_LINES.min(n) * n_u);
    for first in (0..n).step_by(BLOCK_LINES) {
        let block = first..(first + BLOCK_LINES).min(n);
        let (lines_of, count) = (block.len(), block.len() * n_u);
        let mut factors: Vec<C64> = roots[block.clone()].iter().map(|r| C64::from(*r)).collect();
        for i in 0..powers {
            // Input after input, line after line.
            for l in 0..n_u {
                let of = |at: usize| match at / lines_of == l {
                    true => factors[at % lines_of],
                    false => C64::default(),
                };
                triangle.set_complex(i * n_u + l, (0..count).map(of));
            }
            for o in 0..n_y {
                let of = |at: usize| {
                    let (j, k) = (at / lines_of, at % lines_of);
                    factors[k] * lines.f.at(first + k, j * n_y + o)
                };
                triangle.set_complex(known + i * n_y + o, (0..count).map(of));
            }
            for (factor, w) in factors.iter_mut().zip(&w[block.clone()]) {
                *factor *= w;
            }
        }
        triangle.absorb(2 * count);
    }
    triangle.factor().view((known, known), (rows, rows)).into_owned()
}

/// Covariance of the noise in the left side, summed over the lines: block (i, l) is that of `w^(i-l)`.
fn noise_covariance(lines: &Lines, w: &[C64], roots: &[f64], powers: usize) -> DMatrix<f64> {
    /// Part of the mean variance that is added, so that lines on an arc leave a factor.
    const LIFT: f64 = 1e-13;
    let (n_y, rows) = (lines.n_y, powers * lines.n_y);
    let mut by_difference = vec![DMatrix::<f64>::zeros(n_y, n_y); powers];
    for (k, (w, root)) in w.iter().zip(roots).enumerate() {
        let (c_v, s) = lines.factors(k);
        let inputs: f64 = (0..lines.n_u).map(|j| s[j * lines.n_u + j].re).sum();
        let mut power = C64::from(root * root * inputs);
        for own in &mut by_difference {
            for (sum, c) in own.iter_mut().zip(c_v) {
                *sum += (power * c).re;
            }
            power *= w;
        }
    }
    let mut covariance = DMatrix::zeros(rows, rows);
    for i in 0..powers {
        for l in 0..=i {
            let own = &by_difference[i - l];
            let mut below = covariance.view_mut((i * n_y, l * n_y), (n_y, n_y));
            below.copy_from(own);
            let mut above = covariance.view_mut((l * n_y, i * n_y), (n_y, n_y));
            above.tr_copy_from(own);
        }
    }
    let lift = LIFT * covariance.trace() / rows as f64;
    for i in 0..rows {
        covariance[(i, i)] += lift;
    }
    covariance
}

/// Root of a weight a line, so that noise is of one size on all of them.
fn line_weights(lines: &Lines) -> Vec<f64> {
    let (n_y, n_u, n) = (lines.n_y, lines.n_u, lines.len());
    let own: Vec<(Vec<f64>, f64)> = (0..n)
        .map(|k| {
            let (c_v, s) = lines.factors(k);
            let outputs = (0..n_y).map(|i| c_v[i * n_y + i].re).collect();
            (outputs, (0..n_u).map(|j| s[j * n_u + j].re).sum())
        })
        .collect();
    // Outputs have units of their own.
    let mean: Vec<f64> = (0..n_y)
        .map(|i| own.iter().map(|(c, s)| c[i] * s).sum::<f64>() / n as f64)
        .collect();
    let size: Vec<f64> = own
        .iter()
        .map(|(c, s)| c.iter().zip(&mean).map(|(c, m)| c * s / m).sum::<f64>() / n_y as f64)
        .collect();
    (0..n)
        .map(|k| {
            let window = &size[k.saturating_sub(NEIGHBOURS)..(k + NEIGHBOURS + 1).min(n)];
            (window.iter().sum::<f64>() / window.len() as f64).sqrt().recip()
        })
        .collect()
}
