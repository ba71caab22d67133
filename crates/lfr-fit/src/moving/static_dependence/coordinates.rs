//! What moving records say about the state coordinates of an LFR, without a simulation.

use crate::frozen::{Closure, Frozen, close};
use crate::moving::transformation::{TransformationFit, chebyshev};
use crate::problem::Linear;
use crate::{Candidate, FitError, MechanicalForm};
use lpv_core::Continuous;
use nalgebra::{DMatrix, DVector};

/// Positions at which coordinates are compared, Chebyshev-Lobatto points.
const NODES: usize = 9;

/// The error along the records as a function of the LFR, through the rate of the transformation of its coordinates to those of
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
        fit: &TransformationFit,
        whole: &Candidate<Continuous>,
    ) -> Result<Self, FitError> {
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
            .collect::<Result<_, FitError>>()?;
        let degree = fit.transformation.coefficients.ncols();
        let vandermonde = DMatrix::from_fn(NODES, degree, |k, j| chebyshev(at[k], degree)[j]);
        let project = lpv_core::linalg::pseudo_inverse(vandermonde, 1e-12)?;
        Ok(Self {
            nodes,
            differentiate: differentiation(&at),
            project,
            information: fit.information.clone(),
            offset: &fit.residual - &fit.information * fit.transformation.theta(),
            scales: form.scales().to_vec(),
            input: sizes.input,
            rate: sizes.rate,
        })
    }

    /// The residual of the records, in units of their noise. None where coordinates do not exist.
    pub(super) fn residual(&self, candidate: &Candidate<Continuous>) -> Option<DVector<f64>> {
        let nq = candidate.states() / 2;
        let l = self.nodes.iter().map(|node| {
            let s = self.frozen(node, candidate, Closure::Value)?;
            Some(self.solve(node, &s.s, nq)?.l)
        });
        let l = l.collect::<Option<Vec<_>>>()?;
        let mut values = DMatrix::zeros(NODES, nq * nq);
        for (k, here) in l.iter().enumerate() {
            let g = self.slope(k, &l) * here.clone().try_inverse()?;
            values.row_mut(k).copy_from_slice(g.as_slice());
        }
        let residual = &self.offset + &self.information * self.coefficients(&values);
        residual.iter().all(|v| v.is_finite()).then_some(residual)
    }

    /// The residual, and how it moves with the free entries.
    pub(super) fn linearise(
        &self,
        candidate: &Candidate<Continuous>,
        free: &[(usize, usize)],
    ) -> Option<Linear> {
        let nq = candidate.states() / 2;
        let mut l = Vec::with_capacity(NODES);
        let mut moved = Vec::with_capacity(NODES);
        for node in &self.nodes {
            let frozen = self.frozen(node, candidate, Closure::Derivative)?;
            let solved = self.solve(node, &frozen.s, nq)?;
            moved.push(self.derivative(&frozen, &solved, nq, free)?);
            l.push(solved.l);
        }
        let mut values = DMatrix::zeros(NODES, nq * nq);
        // Entry (k, f nq^2 + i): node k, free entry f, entry i of g.
        let mut slopes = DMatrix::zeros(NODES, free.len() * nq * nq);
        for (k, here) in l.iter().enumerate() {
            let inverse = here.clone().try_inverse()?;
            let g = self.slope(k, &l) * &inverse;
            values.row_mut(k).copy_from_slice(g.as_slice());
            for f in 0..free.len() {
                // dg = (dl' - g dl) l^-1.
                let of = |j: usize| DMatrix::from_column_slice(nq, nq, moved[j].column(f).as_slice());
                let mut change = -(&g * of(k));
                for j in 0..NODES {
                    change += of(j) * self.differentiate[(k, j)];
                }
                let change = change * &inverse;
                for (i, v) in change.iter().enumerate() {
                    slopes[(k, f * nq * nq + i)] = *v;
                }
            }
        }
        let jacobian = (0..free.len()).map(|f| {
            let of_entry = slopes.columns(f * nq * nq, nq * nq).into_owned();
            &self.information * self.coefficients(&of_entry)
        });
        Some(Linear {
            jacobian: DMatrix::from_columns(&jacobian.collect::<Vec<_>>()),
            residual: &self.offset + &self.information * self.coefficients(&values),
            factorisations: 0,
            chains: Vec::new(),
        })
    }

    /// Of polynomials through values at the nodes, one row a node; in the order of a `StateTransformation`.
    fn coefficients(&self, values: &DMatrix<f64>) -> DVector<f64> {
        DVector::from_column_slice((&self.project * values).transpose().as_slice())
    }

    /// `dl/d delta` at a node.
    fn slope(&self, k: usize, l: &[DMatrix<f64>]) -> DMatrix<f64> {
        let terms = l.iter().enumerate().map(|(j, l)| l * self.differentiate[(k, j)]);
        terms.fold(DMatrix::zeros(l[k].nrows(), l[k].ncols()), |sum, term| sum + term)
    }

    fn frozen(&self, node: &Node, candidate: &Candidate<Continuous>, closure: Closure) -> Option<Frozen> {
        let delta = candidate.deltas_at(&node.p);
        close(candidate.matrix(), candidate.shape(), &delta, closure)
    }

    /// `l` at one node: `M vec(l) = r` in least squares.
    fn solve(&self, node: &Node, s: &DMatrix<f64>, nq: usize) -> Option<Solved> {
        let (n, nu, ny) = (2 * nq, self.input.len(), self.scales.len());
        let a = s.view((nq, 0), (nq, n)) / self.rate;
        let b = scaled_input(s.view((nq, n), (nq, nu)).into_owned(), &self.input, self.rate);
        let c = scaled_output(s.view((n, 0), (ny, nq)).into_owned(), &self.scales);
        // vec(l): entry (i, j) at j nq + i. Rows: l A - A~ l = 0, l B = B~, C~ l = C, each down its columns.
        let rows = (n + nu + ny) * nq;
        let mut m = DMatrix::zeros(rows, nq * nq);
        let mut right = DVector::zeros(rows);
        for j in 0..n + nu {
            for i in 0..nq {
                let row = j * nq + i;
                for k in 0..nq {
                    m[(row, k * nq + i)] = if j < n { a[(k, j)] } else { b[(k, j - n)] };
                }
                if j < n {
                    for k in 0..nq {
                        m[(row, (j % nq) * nq + k)] -= node.a[(i, j - j % nq + k)];
                    }
                } else {
                    right[row] = node.b[(i, j - n)];
                }
            }
        }
        for j in 0..nq {
            for i in 0..ny {
                let row = (n + nu) * nq + j * ny + i;
                for k in 0..nq {
                    m[(row, j * nq + k)] = node.c[(i, k)];
                }
                right[row] = c[(i, j)];
            }
        }
        let qr = m.clone().qr();
        let mut rotated = right.clone();
        qr.q_tr_mul(&mut rotated);
        let triangle = qr.unpack_r();
        let l = triangle.solve_upper_triangular(&rotated.rows(0, nq * nq).into_owned())?;
        Some(Solved {
            rest: right - &m * &l,
            l: DMatrix::from_column_slice(nq, nq, l.as_slice()),
            m,
            triangle,
        })
    }

    /// How `vec(l)` moves with the free entries, `nq^2` rows: `(M^T M) dl = dM^T (r - M l) + M^T (dr - dM l)`.
    fn derivative(
        &self,
        frozen: &Frozen,
        solved: &Solved,
        nq: usize,
        free: &[(usize, usize)],
    ) -> Option<DMatrix<f64>> {
        let (n, nu, ny) = (2 * nq, self.input.len(), self.scales.len());
        let (l, m) = (&solved.l, &solved.m);
        // Right-hand sides, one for each entry (k, j) of [A B], then one for each entry (i, j) of C.
        let first = nq * (n + nu);
        let mut sides = DMatrix::zeros(nq * nq, first + ny * nq);
        for j in 0..n + nu {
            for k in 0..nq {
                let mut side = sides.column_mut(j * nq + k);
                for i in 0..nq {
                    let row = j * nq + i;
                    side[k * nq + i] += solved.rest[row];
                    side.axpy(-l[(i, k)], &m.row(row).transpose(), 1.0);
                }
            }
        }
        for at in 0..ny * nq {
            sides
                .column_mut(first + at)
                .copy_from(&m.row((n + nu) * nq + at).transpose());
        }
        let half = solved.triangle.tr_solve_upper_triangular(&sides)?;
        let by_entry = solved.triangle.solve_upper_triangular(&half)?;
        let mut entries = DVector::zeros(sides.ncols());
        let mut moved = DMatrix::zeros(nq * nq, free.len());
        for (mut column, &(r, c)) in moved.column_iter_mut().zip(free) {
            for j in 0..n + nu {
                let size = if j < n { 1.0 } else { self.input[j - n] };
                let factor = frozen.right[(c, j)] * size / self.rate;
                for k in 0..nq {
                    entries[j * nq + k] = frozen.left[(nq + k, r)] * factor;
                }
            }
            for j in 0..nq {
                for i in 0..ny {
                    entries[first + j * ny + i] =
                        frozen.left[(n + i, r)] * frozen.right[(c, j)] / self.scales[i];
                }
            }
            column.gemv(1.0, &by_entry, &entries, 0.0);
        }
        Some(moved)
    }
}

/// The equations of one node and their solution.
struct Solved {
    l: DMatrix<f64>,
    m: DMatrix<f64>,
    /// `M^T M = R^T R`.
    triangle: DMatrix<f64>,
    /// `r - M vec(l)`.
    rest: DVector<f64>,
}

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
