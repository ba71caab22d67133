//! Free masses joined by springs and dampers: the structure of a machine that moves.

use crate::{Candidate, Channel, FitError, FrozenData, RandomChannels};
use lpv_core::linalg::{dimension, eigenvalues, pseudo_inverse, svd};
use lpv_core::{Continuous, LfrBlocks, SchedulingRange, StateSpace};
use nalgebra::{Complex, DMatrix, DVector};

mod separate;
mod structure;

use separate::Separated;
use structure::Mask;

/// How many deltas of a single scheduling parameter act where in the mechanical structure.
///
/// With positions q (rigid coordinates first, then one a mode), the inner forces f are functions of the state and act on
/// the accelerations:
///
/// `dq/dt = w_0 v`, `f = E(p) [q; v]`, `dv/dt = X(p) f + B(p) u`, `y = C(p) q`.
///
/// The first forces, one a mode, answer to positions and speeds, those of friction to ground, one a rigid coordinate where it has
/// any, to speeds alone. With as many forces of the first kind as modes, the positions that move none of them are as many as the
/// rigid coordinates, and their integrals are exact, whatever the numbers are. Without friction, `A(p) = N + [0; X] E` is at every p a nilpotent N plus a term of that rank, and
/// `det(sI - A) = s^(2 n_r) det(s^2 I - s E_v X - w_0 E_q X)`: the `n_r` double integrators are exact, whatever the
/// numbers are, and no output answers an input faster than a mass does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DeltaSplit {
    /// Between the state and the inner forces.
    pub forces: usize,
    /// Between the positions and the outputs.
    pub outputs: usize,
    /// Between inner forces and inputs, and the accelerations.
    pub accelerations: usize,
}

impl DeltaSplit {
    /// All of them.
    pub fn total(self) -> usize {
        self.forces + self.outputs + self.accelerations
    }
}

/// A frozen model in mechanical coordinates: positions q (rigid ones first, then one a mode) and `v = (dq/dt) / w_0`, all
/// of size one where the outputs are of their typical sizes.
///
/// The flexible part `(A, B, C)` with `C B = 0` has the positions `eta = L x`, where the rows of L contain those of C and
/// satisfy `L B = 0`, and `d eta/dt = L A x`. With as many modes as outputs, eta are the flexible parts of the outputs;
/// else those rows of L that are missing are modal displacements at the centre, projected on `L B = 0` elsewhere.
#[derive(Debug, Clone, PartialEq)]
pub struct MechanicalForm {
    candidate: Candidate<Continuous>,
    /// Whether the rigid body has friction to ground.
    friction: bool,
    scales: Vec<f64>,
    rate: f64,
    /// Combinations of the outputs that are coordinates, `rank x n_y`.
    seen: DMatrix<f64>,
    /// Displacements at the centre that complete them.
    unseen: DMatrix<f64>,
}

/// Poles closer to the real axis than this part of their size are not those of a mode.
const REAL: f64 = 1e-6;

/// Columns of C below this part of the largest do not count as seen.
const SEEN: f64 = 1e-6;

impl MechanicalForm {
    /// From a candidate of [`Candidate::flexible`] with a rigid body, and the responses that it was fitted to, which tell
    /// the sizes of the outputs relative to each other.
    ///
    /// # Errors
    /// [`FitError::Start`] if a pole of the flexible part at the centre is real, if there is no rigid body, or if the
    /// outputs answer the inputs faster than masses do.
    pub fn new(candidate: &Candidate<Continuous>, data: &FrozenData) -> Result<Self, FitError> {
        let ny = candidate.outputs();
        let gamma = candidate
            .matrix()
            .view((ny, candidate.states()), (ny, candidate.inputs()));
        Self::in_sizes(candidate, &output_sizes(data, &gamma.into_owned())?)
    }

    /// The same with given sizes of the outputs.
    pub(crate) fn in_sizes(candidate: &Candidate<Continuous>, scales: &[f64]) -> Result<Self, FitError> {
        let ny = candidate.outputs();
        let centre = candidate.range().centre();
        let refuse = |problem| FitError::Start {
            p: centre.clone(),
            problem,
        };
        dimension("scales of the outputs", ny, scales.len())?;
        let (n, rigid) = (candidate.states(), 2 * ny);
        let m = candidate.matrix();
        // The integrals: nothing but an output sees a position, and its rate is its speed.
        let column = |i: usize, j: usize| {
            if i >= n {
                f64::from(u8::from(i - n == j))
            } else {
                0.0
            }
        };
        let row = |i: usize, j: usize| f64::from(u8::from(i + ny == j));
        let integrals = (0..ny.min(n)).all(|k| {
            (0..m.nrows()).all(|i| m[(i, k)] == column(i, k))
                && (0..m.ncols()).all(|j| m[(k, j)] == row(k, j))
        });
        if n <= rigid || (n - rigid) % 2 != 0 || !integrals {
            return Err(refuse(
                "there are no rigid coordinates, or the flexible states are not pairs; mechanical coordinates need both",
            ));
        }
        let friction = (ny..rigid).any(|i| (ny..n).any(|j| m[(i, j)] != 0.0));
        let frozen = candidate.frozen(&centre)?;
        let Separated { flexible, .. } = Separated::new(&frozen)?;
        let mut displacements = DMatrix::zeros((n - rigid) / 2, n - rigid);
        let mut log_rate = 0.0;
        let poles: Vec<_> = eigenvalues(flexible.a())?
            .into_iter()
            .filter(|l| l.im > REAL * l.norm())
            .collect();
        if poles.len() * 2 != n - rigid {
            return Err(refuse(
                "a pole of the flexible part is real, which no vibration has",
            ));
        }
        for (k, pole) in poles.iter().enumerate() {
            displacements
                .row_mut(k)
                .copy_from(&displacement(&flexible, *pole)?.transpose());
            log_rate += pole.norm().ln() / poles.len() as f64;
        }
        // C = C_eta L in the least-squares sense; what of the displacements the outputs do not see completes them.
        let scaled = DMatrix::from_fn(ny, n - rigid, |i, j| flexible.c()[(i, j)] / scales[i]);
        let no_svd = FitError::NoConvergence {
            operation: "the singular value decomposition of the mode shapes",
        };
        let shapes = &scaled * pseudo_inverse(displacements.clone(), 1e-12)?;
        let svd = svd(shapes)?;
        let (Some(u), Some(v)) = (svd.u, svd.v_t) else {
            return Err(no_svd);
        };
        let largest = svd.singular_values.max();
        let rank = svd
            .singular_values
            .iter()
            .filter(|s| **s > SEEN * largest)
            .count();
        let mut order: Vec<usize> = (0..svd.singular_values.len()).collect();
        order.sort_by(|&i, &j| svd.singular_values[j].total_cmp(&svd.singular_values[i]));
        let rows: Vec<usize> = order[..rank].to_vec();
        let seen = u.transpose().select_rows(&rows);
        let basis = v.select_rows(&rows).transpose();
        let rest = lpv_numerics::dense::complement(&basis, 1e-9);
        Ok(Self {
            unseen: rest.transpose() * displacements,
            candidate: candidate.clone(),
            friction,
            scales: scales.to_vec(),
            rate: log_rate.exp(),
            seen,
        })
    }

    /// The frozen model at p in mechanical coordinates.
    ///
    /// # Errors
    /// [`FitError::Core`] outside the range; [`FitError::Start`] where the coordinates do not exist.
    pub fn frozen(&self, p: &[f64]) -> Result<StateSpace<Continuous>, FitError> {
        let whole = self.candidate.frozen(p)?;
        let Separated { gain, rate, flexible } = Separated::new(&whole)?;
        let (nf, ny, nu) = (flexible.states(), whole.outputs(), whole.inputs());
        let (nm, nq) = (nf / 2, ny + nf / 2);
        let singular = || FitError::Start {
            p: p.to_vec(),
            problem: "the mechanical coordinates are singular there",
        };
        let scaled = DMatrix::from_fn(ny, nf, |i, j| flexible.c()[(i, j)] / self.scales[i]);
        let pinv = pseudo_inverse(flexible.b().clone(), 1e-12).map_err(|_| singular())?;
        let free_of_b = DMatrix::identity(nf, nf) - flexible.b() * pinv;
        let mut l = DMatrix::zeros(nm, nf);
        let seen = self.seen.nrows();
        l.rows_mut(0, seen).copy_from(&(&self.seen * scaled));
        l.rows_mut(seen, nm - seen).copy_from(&(&self.unseen * free_of_b));
        let mut t = DMatrix::zeros(nf, nf);
        t.rows_mut(0, nm).copy_from(&l);
        t.rows_mut(nm, nm).copy_from(&(&l * flexible.a() / self.rate));
        let inverse = t.clone().try_inverse().ok_or_else(singular)?;
        let flexible_a = &t * flexible.a() * &inverse;
        let flexible_b = &t * flexible.b();
        let flexible_c = flexible.c() * &inverse;

        let mut a = DMatrix::zeros(2 * nq, 2 * nq);
        a.view_mut((0, nq), (nq, nq)).fill_diagonal(self.rate);
        let mut b = DMatrix::zeros(2 * nq, nu);
        let mut c = DMatrix::zeros(ny, 2 * nq);
        for (i, scale) in self.scales.iter().enumerate() {
            b.row_mut(nq + i).copy_from(&(gain.row(i) / (self.rate * scale)));
            c[(i, i)] = *scale;
            for (j, other) in self.scales.iter().enumerate().filter(|_| self.friction) {
                a[(nq + i, nq + j)] = -rate[(i, j)] * other / scale;
            }
        }
        a.view_mut((nq + ny, ny), (nm, nm))
            .copy_from(&flexible_a.view((nm, 0), (nm, nm)));
        a.view_mut((nq + ny, nq + ny), (nm, nm))
            .copy_from(&flexible_a.view((nm, nm), (nm, nm)));
        b.view_mut((nq + ny, 0), (nm, nu))
            .copy_from(&flexible_b.rows(nm, nm));
        c.view_mut((0, ny), (ny, nm))
            .copy_from(&flexible_c.columns(0, nm));
        Ok(StateSpace::new(a, b, c, DMatrix::zeros(ny, nu), Continuous)?)
    }

    /// Typical sizes of the outputs.
    pub fn scales(&self) -> &[f64] {
        &self.scales
    }
    /// Number of states.
    pub fn states(&self) -> usize {
        self.candidate.states()
    }
    /// The scheduling box.
    pub fn range(&self) -> &SchedulingRange {
        self.candidate.range()
    }

    /// A candidate of the structure of [`DeltaSplit`] that equals the model at the centre, with small random deltas.
    ///
    /// # Errors
    /// As [`MechanicalForm::frozen`]; [`FitError::Setting`] for a size that is negative or not finite.
    pub fn candidate(
        &self,
        split: DeltaSplit,
        random: RandomChannels,
    ) -> Result<Candidate<Continuous>, FitError> {
        let centre = self.frozen(&self.range().centre())?;
        let (n, nu, ny) = (centre.states(), centre.inputs(), centre.outputs());
        let nq = n / 2;
        let nm = nq - ny;
        // Forces of the modes, then those of friction.
        let nd = if self.friction { nm + ny } else { nm };
        let mut c1 = DMatrix::zeros(nd, n);
        c1.rows_mut(0, nm).copy_from(&centre.a().rows(nq + ny, nm));
        c1.rows_mut(nm, nd - nm).copy_from(&centre.a().rows(nq, nd - nm));
        let mut m = LfrBlocks {
            a: DMatrix::zeros(n, n),
            b1: DMatrix::zeros(n, nd),
            b2: centre.b().clone(),
            c1,
            d11: DMatrix::zeros(nd, nd),
            d12: DMatrix::zeros(nd, nu),
            c2: centre.c().clone(),
            d21: DMatrix::zeros(ny, nd),
            d22: DMatrix::zeros(ny, nu),
        };
        m.a.view_mut((0, nq), (nq, nq)).fill_diagonal(self.rate);
        m.b1.view_mut((nq + ny, 0), (nm, nm)).fill_with_identity();
        m.b1.view_mut((nq, nm), (nd - nm, nd - nm)).fill_with_identity();
        let free = Mask::of(&m).mask(DeltaSplit::default());
        let rigid = Candidate::new(
            &m,
            free,
            vec![Channel::Direct; nd],
            self.range().clone(),
            Continuous,
        )?;
        rigid.with_mechanical_deltas(split, &self.scales, random)
    }
}

/// Sizes of the outputs that balance the responses: with inputs in units of what moves the rigid body, each output
/// answers the others' inputs as strongly as they answer its own (Osborne's iteration). The geometric mean is one.
fn output_sizes(data: &FrozenData, gamma: &DMatrix<f64>) -> Result<Vec<f64>, FitError> {
    let ny = data.outputs();
    let inverse = pseudo_inverse(gamma.clone(), 1e-12)?;
    let inverse = inverse.map(|v| Complex::new(v, 0.0));
    let mut power = DMatrix::<f64>::zeros(ny, ny);
    for frf in data.responses() {
        for (k, f) in frf.frequencies_hz().iter().enumerate() {
            power += (frf.line(k) * &inverse).map(|v| v.norm_sqr() * f.powi(4));
        }
    }
    let mut sizes = vec![1.0_f64; ny];
    for _ in 0..100 {
        for i in 0..ny {
            let others = || (0..ny).filter(move |j| *j != i);
            let row: f64 = others()
                .map(|j| power[(i, j)] * (sizes[j] / sizes[i]).powi(2))
                .sum();
            let column: f64 = others()
                .map(|j| power[(j, i)] * (sizes[i] / sizes[j]).powi(2))
                .sum();
            if row > 0.0 && column > 0.0 {
                sizes[i] *= (row / column).powf(0.25);
            }
        }
    }
    let mean = (sizes.iter().map(|s| s.ln()).sum::<f64>() / ny.max(1) as f64).exp();
    Ok(sizes.into_iter().map(|s| s / mean).collect())
}

/// The row `l` with `eta = l x` the displacement of a mode: the part of its left eigenvector that no input moves at once,
/// as nearly as a real mode has one.
fn displacement(flexible: &StateSpace<Continuous>, pole: Complex<f64>) -> Result<DVector<f64>, FitError> {
    let n = flexible.states();
    let shifted = flexible.a().map(|v| Complex::new(v, 0.0)).transpose() - DMatrix::identity(n, n) * pole;
    let svd = svd(shifted)?;
    let at = svd.singular_values.imin();
    let v = svd.v_t.ok_or(FitError::NoConvergence {
        operation: "the singular value decomposition of a mode",
    })?;
    let left: DVector<Complex<f64>> = v.row(at).adjoint();
    let driven = flexible.b().map(|v| Complex::new(v, 0.0)).transpose() * &left;
    // The phase that makes the driven part real in the mean.
    let phase = (driven.iter().map(|v| v * v).sum::<Complex<f64>>()).sqrt();
    let unit = if phase.norm() > 0.0 {
        phase / phase.norm()
    } else {
        Complex::new(1.0, 0.0)
    };
    let row = left.map(|v| (v / unit).im);
    let norm = row.norm();
    Ok(if norm > 0.0 { row / norm } else { row })
}

#[cfg(test)]
mod tests;
