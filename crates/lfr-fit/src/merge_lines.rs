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

/// Lines that scatter about their merged value by more than this many times their noise, in power, are not merged: the model is
/// too far from the data there to tell how the response runs between them. A covariance from few periods, or some distortion,
/// makes a few times the noise.
const SCATTER: f64 = 10.0;

/// Rounds that fit one Kronecker product to a sum of them; the factors differ little from line to line.
const ROUNDS: usize = 3;

impl Position {
    /// The same knowledge in fewer lines. `model` is near the response here: neighbours that are closer together than to
    /// its poles become one line, at their mean frequency, with the sum of their weights, and with the value of the model
    /// plus the weighted mean of what the data add to it. To first order in the width of the merged arc the sum of squares
    /// of any model with poles like these is the same, up to a constant. The weight is the Kronecker product nearest to
    /// the sum. Lines that scatter about their merged value by more than noise stay as they are.
    pub(crate) fn merged_lines(
        &self,
        clock: Discrete,
        model: &StateSpace<Discrete>,
    ) -> Result<Self, CoreError> {
        let poles = eigenvalues(model.a())?;
        let mut kernel = ResponseKernel::new(model)?;
        let arcs = self.arcs(&poles);
        let (ny, nu) = (self.frf.outputs(), self.frf.inputs());
        let mut merged = Merged::default();
        for arc in arcs {
            // Lines that are known too badly for a sum, or on which the model has a pole or is far from the data, stay as they are.
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
            poles: self.poles.clone(),
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
        let (mut frequency, mut total, mut square) = (0.0, 0.0, 0.0);
        let mut values = vec![C64::default(); arc.len() * ny * nu];
        kernel.evaluate(&self.z[arc.clone()], &mut values).ok()?;
        let values = values.chunks_exact(ny * nu);
        for ((k, (a, b)), value) in arc.clone().zip(&weights).zip(values) {
            let more = self.frf.line(k) - DMatrix::from_column_slice(ny, nu, value);
            let weighted = b * &more * a.transpose();
            square += weighted.dotc(&more).re;
            moved += DVector::from_column_slice(weighted.as_slice());
            whole += a.kronecker(b);
            let weight = a.trace().re * b.trace().re;
            frequency += weight * self.frf.frequencies_hz()[k];
            total += weight;
        }
        let frequency_hz = frequency / total;
        let mean = whole.cholesky()?.solve(&moved);
        // Whitened, real and imaginary part of an entry have a variance of one each.
        let freedom = (2 * ny * nu * (arc.len() - 1)) as f64;
        if square - moved.dotc(&mean).re > SCATTER * freedom {
            return None;
        }
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]

    use crate::test_kit::{candidate, clock, responses, weighted};
    use lpv_core::StateSpace;

    /// Lines are merged about a model of the data, and left alone about another one, which would bend them.
    #[test]
    fn a_model_far_from_the_data_merges_nothing() {
        let truth = candidate(clock(), [0.5, 0.7, 0.8], &[crate::Channel::Parameter(0)], 3);
        let data = weighted(&responses(&truth, 400), 0.0, 1);
        let mut position = data.positions()[0].clone();
        // As known to a part in ten thousand.
        position.scale.fill(1e4);
        let frozen: StateSpace<_> = truth.frozen(&[1.0]).unwrap();
        let other = truth.frozen(&[3.0]).unwrap();
        let [few, many] = [&frozen, &other].map(|model| position.merged_lines(clock(), model).unwrap().frf);
        assert!(
            few.len() * 8 < 400 && many.len() > 4 * few.len(),
            "{} {}",
            few.len(),
            many.len()
        );
        for frf in [few, many] {
            let exact = frozen.frequency_response(frf.frequencies_hz()).unwrap();
            let errors = (0..frf.len()).map(|k| (frf.line(k) - exact.line(k)).norm());
            assert!(errors.fold(0.0, f64::max) < 1e-3);
        }
    }
}
