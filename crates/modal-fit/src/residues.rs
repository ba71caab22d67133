//! Residues of given poles by linear least squares, and the ranks that the data show.

use crate::ModalFitError;
use crate::model::{Modal, Rigid, Section};
use lpv_core::linalg::svd;
use lpv_core::{Clock, Discrete, FrfEstimate};
use lpv_numerics::dense::Triangle;
use lpv_numerics::poles::partial_fractions;
use nalgebra::DMatrix;
use num_complex::Complex;

type C64 = Complex<f64>;

/// A singular value counts where it is this many times the largest that noise alone makes, about `sqrt(n_y) + sqrt(n_u)`
/// deviations.
const ABOVE_NOISE: f64 = 2.0;

/// A singular value below this part of the first is no second mode, however little noise there is.
const NEGLIGIBLE: f64 = 1e-7;

/// Ranks of the residues of complex poles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ranks {
    /// One mode shape a pole.
    One,
    /// As many as stand above the noise.
    AboveNoise,
}

/// What least squares gives at the given poles, with deviations.
pub(crate) struct Residues {
    poles: Vec<(C64, DMatrix<C64>, DMatrix<f64>)>,
    rigid: Option<(Rigid, DMatrix<C64>, DMatrix<f64>)>,
    direct: Option<DMatrix<f64>>,
    shape: (usize, usize),
}

impl Residues {
    /// The model with the residues cut to rank. Real poles are often those of several axes, and the rigid body of all: they have
    /// the rank that stands above the noise.
    pub(crate) fn model(&self, ranks: Ranks) -> Result<Modal, ModalFitError> {
        let section = |(pole, residue, deviation): &(C64, DMatrix<C64>, DMatrix<f64>)| {
            let most = if ranks == Ranks::One && pole.im != 0.0 {
                1
            } else {
                usize::MAX
            };
            let (c, b) = cut(residue, deviation, 1, most)?;
            Ok(Section { pole: *pole, c, b })
        };
        let rigid = match &self.rigid {
            None => None,
            Some((kind, gain, deviation)) => {
                let (c, b) = cut(gain, deviation, 0, usize::MAX)?;
                Some((*kind, c.map(|v| v.re), b.map(|v| v.re)))
            }
        };
        Ok(Modal {
            sections: self
                .poles
                .iter()
                .map(section)
                .collect::<Result<_, ModalFitError>>()?,
            rigid: rigid.filter(|(_, c, _)| c.ncols() > 0),
            direct: self.direct.clone(),
            shape: self.shape,
        })
    }

    pub(crate) fn new(
        estimate: &FrfEstimate,
        clock: Discrete,
        poles: &[C64],
        rigid: Option<Rigid>,
        direct: bool,
    ) -> Result<Self, ModalFitError> {
        let frf = estimate.frf();
        let (n_y, n_u, lines) = (frf.outputs(), frf.inputs(), frf.len());
        let z: Vec<C64> = frf.frequencies_hz().iter().map(|&f| clock.point(f)).collect();
        let mut columns = partial_fractions(&z, poles);
        if let Some(rigid) = rigid {
            columns.push(z.iter().map(|&z| rigid.response(z, clock)).collect());
        }
        if direct {
            columns.push(vec![C64::from(1.0); lines]);
        }
        let count = columns.len();
        if lines * 2 <= count {
            return Err(ModalFitError::TooFewEquations {
                equations: 2 * lines * n_y * n_u,
                unknowns: count * n_y * n_u,
            });
        }
        let scale: Vec<f64> = columns
            .iter()
            .map(|c| c.iter().map(|v| v.norm_sqr()).sum::<f64>().sqrt().recip())
            .collect();
        // Coefficients and their variances, a row a column and a column a channel.
        let (mut x, mut variance) = (DMatrix::zeros(count, n_y * n_u), DMatrix::zeros(count, n_y * n_u));
        for channel in 0..n_y * n_u {
            let (output, input) = (channel % n_y, channel / n_y);
            let least = (0..lines)
                .map(|k| 1e-18 * frf.line(k)[(output, input)].norm_sqr())
                .fold(f64::MIN_POSITIVE, f64::max);
            let mut triangle = Triangle::new(count + 1, 2 * lines);
            let weights: Vec<f64> = (0..lines)
                .map(|k| (2.0 / estimate.variance(k, output, input).max(least)).sqrt())
                .collect();
            for (j, (values, s)) in columns.iter().zip(&scale).enumerate() {
                triangle.set_complex(j, (0..lines).map(|k| values[k] * (weights[k] * s)));
            }
            let right = (0..lines).map(|k| frf.line(k)[(output, input)] * weights[k]);
            triangle.set_complex(count, right);
            triangle.absorb(2 * lines);
            let factor = triangle.factor();
            let r = factor.view((0, 0), (count, count)).into_owned();
            let inverse = r.solve_upper_triangular(&DMatrix::identity(count, count));
            let inverse = inverse.ok_or(lpv_core::CoreError::Singular {
                operation: "the residues of the given poles",
            })?;
            let own = &inverse * factor.view((0, count), (count, 1)).column(0);
            for j in 0..count {
                x[(j, channel)] = own[j] * scale[j];
                variance[(j, channel)] = inverse.row(j).norm_squared() * scale[j] * scale[j];
            }
        }
        let matrix = |of: &DMatrix<f64>, j: usize| DMatrix::from_fn(n_y, n_u, |i, u| of[(j, u * n_y + i)]);
        let mut at = 0;
        let mut of_poles = Vec::with_capacity(poles.len());
        for &pole in poles {
            let (residue, deviation) = if pole.im == 0.0 {
                at += 1;
                (
                    matrix(&x, at - 1).map(C64::from),
                    matrix(&variance, at - 1).map(f64::sqrt),
                )
            } else {
                at += 2;
                (
                    matrix(&x, at - 2).zip_map(&matrix(&x, at - 1), C64::new),
                    (matrix(&variance, at - 2) + matrix(&variance, at - 1)).map(f64::sqrt),
                )
            };
            of_poles.push((pole, residue, deviation));
        }
        let gain = rigid.map(|kind| {
            at += 1;
            let deviation = matrix(&variance, at - 1).map(f64::sqrt);
            (kind, matrix(&x, at - 1).map(C64::from), deviation)
        });
        Ok(Self {
            poles: of_poles,
            rigid: gain,
            direct: direct.then(|| matrix(&x, at)),
            shape: (n_y, n_u),
        })
    }
}

/// `M = C B^T` of the rank that stands above the noise, `least` to `most`; real factors of a real matrix.
fn cut(
    m: &DMatrix<C64>,
    deviation: &DMatrix<f64>,
    least: usize,
    most: usize,
) -> Result<(DMatrix<C64>, DMatrix<C64>), ModalFitError> {
    let (n_y, n_u) = m.shape();
    let tiny = f64::MIN_POSITIVE.sqrt();
    // Rows and columns in units of their deviation.
    let rows: Vec<f64> = (0..n_y)
        .map(|i| (deviation.row(i).norm() / (n_u as f64).sqrt()).max(tiny))
        .collect();
    let columns: Vec<f64> = (0..n_u)
        .map(|j| {
            let sum: f64 = (0..n_y).map(|i| (deviation[(i, j)] / rows[i]).powi(2)).sum();
            (sum / n_y as f64).sqrt().max(tiny)
        })
        .collect();
    let scaled = DMatrix::from_fn(n_y, n_u, |i, j| m[(i, j)] / (rows[i] * columns[j]));
    let real = m.iter().all(|v| v.im == 0.0);
    let found = svd(scaled)?;
    let (Some(u), Some(v)) = (&found.u, &found.v_t) else {
        return Err(ModalFitError::Empty {
            what: "singular vectors",
        });
    };
    let noise = (n_y as f64).sqrt() + (n_u as f64).sqrt();
    let values = &found.singular_values;
    let limit = (ABOVE_NOISE * noise).max(NEGLIGIBLE * values.max());
    let rank = values.iter().filter(|s| **s > limit).count().min(most).max(least);
    let mut c = DMatrix::from_fn(n_y, rank, |i, l| u[(i, l)] * (values[l].sqrt() * rows[i]));
    let mut b = DMatrix::from_fn(n_u, rank, |j, l| v[(l, j)] * (values[l].sqrt() * columns[j]));
    if real {
        // The factors of a real matrix may carry a common phase.
        for l in 0..rank {
            let column = b.column(l);
            let largest = column.iter().max_by(|x, y| x.norm_sqr().total_cmp(&y.norm_sqr()));
            let phase = largest.map_or(C64::from(1.0), |v| v / v.norm().max(f64::MIN_POSITIVE));
            b.column_mut(l)
                .iter_mut()
                .for_each(|v| *v = C64::from((*v / phase).re));
            c.column_mut(l)
                .iter_mut()
                .for_each(|v| *v = C64::from((*v * phase).re));
        }
    }
    Ok((c, b))
}
