//! Neighbouring lines merged into one, where no model of interest can tell them apart.

use crate::data::Position;
use crate::whiten::Whitening;
use lpv_core::linalg::eigenvalues;
use lpv_core::{Clock, CoreError, Discrete, Frf, ResponseKernel, StateSpace};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex;
use std::ops::Range;

type C64 = Complex<f64>;

/// Widest arc of the unit circle that is merged, as part of its distance from the nearest pole. Merging costs
/// `WIDTH^2 / 24` of the curvature that is left, 0.3 %.
const WIDTH: f64 = 0.25;

/// Rounds that fit one Kronecker product to a sum of them; the factors differ little from line to line.
const ROUNDS: usize = 3;

impl Position {
    /// The same knowledge in fewer lines. `model` is near the response here: neighbours that are closer together than to
    /// its poles become one line, at their mean frequency, with the sum of their weights, and with the value of the model
    /// plus the weighted mean of what the data add to it. To first order in the width of the merged arc the sum of squares
    /// of any model with poles like these is the same, up to a constant. The weight is the Kronecker product nearest to
    /// the sum.
    pub(crate) fn condensed(&self, clock: Discrete, model: &StateSpace<Discrete>) -> Result<Self, CoreError> {
        let poles = eigenvalues(model.a())?;
        let mut kernel = ResponseKernel::new(model);
        let arcs = self.arcs(&poles);
        let (ny, nu) = (self.frf.outputs(), self.frf.inputs());
        let mut merged = Merged::default();
        for arc in arcs {
            // Lines that are known too badly for a sum, or on which the model has a pole, stay as they are.
            let one = self.merge(arc.clone(), clock, &mut kernel);
            match one {
                Some(one) => merged.push(one),
                None => arc.for_each(|k| merged.push(self.single(k))),
            }
        }
        let frf = Frf::new(merged.frequencies, ny, nu, merged.values)?;
        Ok(Self {
            p: self.p.clone(),
            z: frf.frequencies_hz().iter().map(|&f| clock.point(f)).collect(),
            scale: vec![1.0; frf.len()],
            whitening: Some(Whitening::from_factors(ny, nu, merged.left, merged.right)),
            frf,
        })
    }

    /// Runs of neighbours that are closer together than to any pole.
    fn arcs(&self, poles: &[C64]) -> Vec<Range<usize>> {
        let room = |z: C64| {
            poles
                .iter()
                .map(|pole| (z - pole).norm())
                .fold(f64::INFINITY, f64::min)
        };
        let mut arcs = Vec::new();
        let (mut first, mut narrowest) = (0, f64::INFINITY);
        for (k, &z) in self.z.iter().enumerate() {
            narrowest = room(z).min(narrowest);
            if (z - self.z[first]).norm() > WIDTH * narrowest {
                arcs.push(first..k);
                (first, narrowest) = (k, room(z));
            }
        }
        arcs.push(first..self.z.len());
        arcs
    }

    fn single(&self, k: usize) -> Line {
        let (left, right) = self.factors(k);
        Line {
            frequency_hz: self.frf.frequencies_hz()[k],
            value: self.frf.line_slice(k).to_vec(),
            left,
            right,
        }
    }

    fn merge(&self, arc: Range<usize>, clock: Discrete, kernel: &mut ResponseKernel) -> Option<Line> {
        if arc.len() == 1 {
            return Some(self.single(arc.start));
        }
        let (ny, nu) = (self.frf.outputs(), self.frf.inputs());
        // ||W_y E W_u||^2 = vec(E)^H (A x B) vec(E) with B = W_y^H W_y, A = (W_u W_u^H)^T.
        let weights: Vec<(DMatrix<C64>, DMatrix<C64>)> = arc
            .clone()
            .map(|k| {
                let (left, right) = self.factors(k);
                ((&right * right.adjoint()).transpose(), left.adjoint() * left)
            })
            .collect();
        let mut whole = DMatrix::zeros(ny * nu, ny * nu);
        let mut moved = DVector::zeros(ny * nu);
        let (mut frequency, mut total) = (0.0, 0.0);
        let mut values = vec![C64::default(); arc.len() * ny * nu];
        kernel.evaluate(&self.z[arc.clone()], &mut values).ok()?;
        let values = values.chunks_exact(ny * nu);
        for ((k, (a, b)), value) in arc.clone().zip(&weights).zip(values) {
            let more = self.frf.line(k) - DMatrix::from_column_slice(ny, nu, value);
            moved += DVector::from_column_slice((b * more * a.transpose()).as_slice());
            whole += a.kronecker(b);
            let weight = a.trace().re * b.trace().re;
            frequency += weight * self.frf.frequencies_hz()[k];
            total += weight;
        }
        let frequency_hz = frequency / total;
        let mean = whole.cholesky()?.solve(&moved);
        let mut value = vec![C64::default(); ny * nu];
        kernel.evaluate(&[clock.point(frequency_hz)], &mut value).ok()?;
        value.iter_mut().zip(mean.iter()).for_each(|(v, m)| *v += m);
        let (a, b) = nearest_product(&weights);
        Some(Line {
            frequency_hz,
            value,
            left: b.cholesky()?.unpack().adjoint(),
            right: a.transpose().cholesky()?.unpack(),
        })
    }
}

/// `A x B` nearest to a sum of such products of positive definite factors, by alternating projections: both stay
/// positive definite.
fn nearest_product(terms: &[(DMatrix<C64>, DMatrix<C64>)]) -> (DMatrix<C64>, DMatrix<C64>) {
    let (na, nb) = (terms[0].0.nrows(), terms[0].1.nrows());
    let inner = |x: &DMatrix<C64>, y: &DMatrix<C64>| x.dotc(y).re;
    let mut a = DMatrix::identity(na, na);
    let mut b = DMatrix::identity(nb, nb);
    for _ in 0..ROUNDS {
        let along = a.norm_squared();
        b = terms.iter().fold(DMatrix::zeros(nb, nb), |sum, (ak, bk)| {
            sum + bk * C64::from(inner(&a, ak) / along)
        });
        let along = b.norm_squared();
        a = terms.iter().fold(DMatrix::zeros(na, na), |sum, (ak, bk)| {
            sum + ak * C64::from(inner(&b, bk) / along)
        });
    }
    (a, b)
}

struct Line {
    frequency_hz: f64,
    value: Vec<C64>,
    left: DMatrix<C64>,
    right: DMatrix<C64>,
}

#[derive(Default)]
struct Merged {
    frequencies: Vec<f64>,
    values: Vec<C64>,
    left: Vec<C64>,
    right: Vec<C64>,
}

impl Merged {
    fn push(&mut self, line: Line) {
        self.frequencies.push(line.frequency_hz);
        self.values.extend(line.value);
        self.left.extend(line.left.iter());
        self.right.extend(line.right.iter());
    }
}
