//! What moving records say about the state coordinates of an LFR, without a simulation.

use crate::frozen::{Closure, close};
use crate::moving::turning::{TurningFit, chebyshev};
use crate::problem::Linear;
use crate::{Candidate, MechanicalForm, RealizeError};
use lpv_core::Continuous;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Positions at which coordinates are compared, Chebyshev-Lobatto points.
const NODES: usize = 9;

/// The error along the records as a function of the LFR, through the rate at which its coordinates turn against those of
/// the frozen model that the records were explained with.
///
/// With `x~ = L(p) x` from the coordinates of the LFR to those of the frozen model, the LFR has `G = (dL/dp) L^-1`. The
/// error is nearly linear in G, so its linearisation at the fitted G serves for all. L is what makes the frozen
/// matrices agree best, `diag(l, l)` with `l A = A~ l`, `l B = B~`, `C~ l = C` in least squares.
pub(super) struct Coordinates {
    /// Normalised positions and the frozen matrices `[A_q A_v B; C_q . .]` there.
    nodes: Vec<Node>,
    /// Derivative at the nodes by values at the nodes.
    differentiate: DMatrix<f64>,
    /// Coefficients of Chebyshev polynomials by values at the nodes, in least squares.
    project: DMatrix<f64>,
    information: DMatrix<f64>,
    /// Residual for `G = 0`: `b - R g`.
    offset: DVector<f64>,
    scales: Vec<f64>,
    input: Vec<f64>,
    rate: f64,
}

struct Node {
    p: Vec<f64>,
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    c: DMatrix<f64>,
}

impl Coordinates {
    pub(super) fn new(
        form: &MechanicalForm,
        fit: &TurningFit,
        whole: &Candidate<Continuous>,
    ) -> Result<Self, RealizeError> {
        let last = (NODES - 1) as f64;
        let at: Vec<f64> = (0..NODES)
            .map(|k| -(std::f64::consts::PI * k as f64 / last).cos())
            .collect();
        let sizes = whole.mechanical_sizes();
        let nodes = at
            .iter()
            .map(|delta| {
                let p = vec![form.range().centre()[0] + delta * form.range().half_width()[0]];
                let frozen = form.frozen(&p)?;
                let nq = frozen.states() / 2;
                Ok(Node {
                    a: frozen.a().rows(nq, nq) / sizes.rate,
                    b: scaled_input(frozen.b().rows(nq, nq).into_owned(), &sizes.input, sizes.rate),
                    c: scaled_output(frozen.c().columns(0, nq).into_owned(), form.scales()),
                    p,
                })
            })
            .collect::<Result<_, RealizeError>>()?;
        let degree = fit.turning.coefficients.ncols();
        let vandermonde = DMatrix::from_fn(NODES, degree, |k, j| chebyshev(at[k], degree)[j]);
        let project = vandermonde
            .pseudo_inverse(1e-12)
            .map_err(|_| RealizeError::NoConvergence {
                operation: "the pseudo-inverse of Chebyshev polynomials",
            })?;
        Ok(Self {
            nodes,
            differentiate: differentiation(&at),
            project,
            information: fit.information.clone(),
            offset: &fit.residual - &fit.information * fit.turning.theta(),
            scales: form.scales().to_vec(),
            input: sizes.input,
            rate: sizes.rate,
        })
    }

    /// The residual of the records, in units of their noise. None where coordinates do not exist.
    pub(super) fn residual(&self, candidate: &Candidate<Continuous>) -> Option<DVector<f64>> {
        let nq = candidate.states() / 2;
        let l: Vec<DMatrix<f64>> = self
            .nodes
            .iter()
            .map(|node| self.to_form(node, candidate))
            .collect::<Option<_>>()?;
        let mut values = DMatrix::zeros(NODES, nq * nq);
        for (k, here) in l.iter().enumerate() {
            let mut slope = DMatrix::zeros(nq, nq);
            for (j, there) in l.iter().enumerate() {
                slope += there * self.differentiate[(k, j)];
            }
            let g = slope * here.clone().try_inverse()?;
            values.row_mut(k).copy_from_slice(g.as_slice());
        }
        let coefficients = (&self.project * values).transpose();
        let residual = &self.offset + &self.information * DVector::from_column_slice(coefficients.as_slice());
        residual.iter().all(|v| v.is_finite()).then_some(residual)
    }

    /// `l` at one node.
    fn to_form(&self, node: &Node, candidate: &Candidate<Continuous>) -> Option<DMatrix<f64>> {
        let (n, nu, ny) = (candidate.states(), candidate.inputs(), candidate.outputs());
        let nq = n / 2;
        let s = close(
            candidate.matrix(),
            candidate.shape(),
            &candidate.deltas_at(&node.p),
            Closure::Value,
        )?
        .s;
        let a = s.view((nq, 0), (nq, n)) / self.rate;
        let b = scaled_input(s.view((nq, n), (nq, nu)).into_owned(), &self.input, self.rate);
        let c = scaled_output(s.view((n, 0), (ny, nq)).into_owned(), &self.scales);
        // vec(l): entry (i, j) at j nq + i.
        let rows = 2 * nq * nq + nq * nu + ny * nq;
        let mut m = DMatrix::zeros(rows, nq * nq);
        let mut rhs = DVector::zeros(rows);
        for half in 0..2 {
            for j in 0..nq {
                for i in 0..nq {
                    let row = half * nq * nq + j * nq + i;
                    for k in 0..nq {
                        m[(row, k * nq + i)] += a[(k, half * nq + j)];
                        m[(row, j * nq + k)] -= node.a[(i, half * nq + k)];
                    }
                }
            }
        }
        for j in 0..nu {
            for i in 0..nq {
                let row = 2 * nq * nq + j * nq + i;
                for k in 0..nq {
                    m[(row, k * nq + i)] = b[(k, j)];
                }
                rhs[row] = node.b[(i, j)];
            }
        }
        for j in 0..nq {
            for i in 0..ny {
                let row = 2 * nq * nq + nq * nu + j * ny + i;
                for k in 0..nq {
                    m[(row, j * nq + k)] = node.c[(i, k)];
                }
                rhs[row] = c[(i, j)];
            }
        }
        let qr = m.qr();
        qr.q_tr_mul(&mut rhs);
        let l = qr
            .unpack_r()
            .solve_upper_triangular(&rhs.rows(0, nq * nq).into_owned())?;
        Some(DMatrix::from_column_slice(nq, nq, l.as_slice()))
    }

    /// By finite differences in the free entries.
    pub(super) fn linearise(
        &self,
        candidate: impl Fn(&DVector<f64>) -> Candidate<Continuous> + Sync,
        theta: &DVector<f64>,
    ) -> Option<Linear> {
        let residual = self.residual(&candidate(theta))?;
        let typical = theta.amax() * 1e-3;
        let columns: Vec<DVector<f64>> = (0..theta.len())
            .into_par_iter()
            .map(|i| {
                let step = STEP * theta[i].abs().max(typical);
                let mut moved = theta.clone();
                moved[i] += step;
                let up = self.residual(&candidate(&moved))?;
                moved[i] -= 2.0 * step;
                let down = self.residual(&candidate(&moved))?;
                Some((up - down) / (2.0 * step))
            })
            .collect::<Option<_>>()?;
        Some(Linear {
            jacobian: DMatrix::from_columns(&columns),
            residual,
            factorisations: 0,
        })
    }
}

/// Relative step of the finite differences.
const STEP: f64 = 1e-6;

fn scaled_input(mut b: DMatrix<f64>, input: &[f64], rate: f64) -> DMatrix<f64> {
    for (mut column, size) in b.column_iter_mut().zip(input) {
        column *= size / rate;
    }
    b
}

fn scaled_output(mut c: DMatrix<f64>, scales: &[f64]) -> DMatrix<f64> {
    for (mut row, scale) in c.row_iter_mut().zip(scales) {
        row /= *scale;
    }
    c
}

/// Differentiation of the polynomial through values at the nodes, by barycentric weights.
fn differentiation(at: &[f64]) -> DMatrix<f64> {
    let n = at.len();
    let weights: Vec<f64> = (0..n)
        .map(|i| {
            (0..n)
                .filter(|&j| j != i)
                .map(|j| at[i] - at[j])
                .product::<f64>()
                .recip()
        })
        .collect();
    let mut d = DMatrix::from_fn(n, n, |i, j| {
        if i == j {
            0.0
        } else {
            weights[j] / weights[i] / (at[i] - at[j])
        }
    });
    for i in 0..n {
        d[(i, i)] = -d.row(i).sum();
    }
    d
}
