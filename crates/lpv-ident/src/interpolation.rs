//! From samples of the coefficient functions to functions of p. Every kind is linear in the samples.

use crate::IdentError;
use lpv_core::linalg::{dimension, pseudo_inverse, svd};
use lpv_core::{BasisKind, CoreError, FunctionBasis, MatrixFunction, Position, SchedulingRange, matern52};
use nalgebra::DMatrix;

/// How the samples `W(p_q)` become a function `W(p)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Interpolation {
    /// Least-squares polynomial of this order through the samples, kept in Chebyshev polynomials, which span the same
    /// functions and stay well conditioned. Of several scheduling signals it is of this total order, in powers.
    Polynomial {
        /// Highest power.
        order: usize,
    },
    /// Chebyshev interpolant of this order of the cubic spline through the samples: a polynomial, so it has an exact
    /// LFR, without the end oscillations of a polynomial through equidistant points.
    Chebyshev {
        /// Highest power.
        order: usize,
    },
    /// Not-a-knot cubic spline through the samples.
    Spline,
    /// Straight lines between the samples.
    Linear,
    /// Mean of a Gaussian process with a Matern-5/2 kernel of this length, an unknown constant mean and a relative
    /// noise variance of 1e-10 (interpolating, up to rounding).
    GaussianProcess {
        /// Correlation length, units of p.
        length_scale: f64,
    },
}

/// Noise variance of the Gaussian process relative to the kernel's: keeps the kernel matrix invertible.
const NUGGET: f64 = 1e-10;

/// Highest order of a Chebyshev interpolant; far above what positions support, low enough for its LFR.
const MOST_CHEBYSHEV: usize = 200;

impl Interpolation {
    /// A short name for tables.
    pub fn name(&self) -> String {
        match self {
            Self::Polynomial { order } => format!("polynomial, order {order}"),
            Self::Chebyshev { order } => format!("Chebyshev, order {order}"),
            Self::Spline => "cubic spline".to_owned(),
            Self::Linear => "linear".to_owned(),
            Self::GaussianProcess { length_scale } => format!("Gaussian process, length {length_scale:.3}"),
        }
    }

    /// Whether the result is a polynomial in p and so has an exact LFR.
    pub fn is_polynomial(&self) -> bool {
        matches!(self, Self::Polynomial { .. } | Self::Chebyshev { .. })
    }

    /// The linear map of this interpolation at the given positions.
    ///
    /// # Errors
    /// [`IdentError::TooFewPositions`], [`IdentError::Setting`], positions of one scheduling signal that are not increasing,
    /// [`IdentError::OneSignal`] for all but polynomials of several, [`IdentError::FarFromZero`].
    pub fn operator(&self, positions: &[Position]) -> Result<InterpolationOperator, IdentError> {
        let n = positions.len();
        let need = |what, needed| {
            if n < needed {
                Err(IdentError::TooFewPositions {
                    what,
                    needed,
                    found: n,
                })
            } else {
                Ok(())
            }
        };
        need("interpolation", 1)?;
        if n == 1 {
            // One position: the model does not depend on p.
            return Ok(InterpolationOperator {
                basis: FunctionBasis::constant(),
                map: DMatrix::from_element(1, 1, 1.0),
            });
        }
        let Some(positions) = positions
            .iter()
            .map(Position::single)
            .collect::<Option<Vec<f64>>>()
        else {
            return match *self {
                Self::Polynomial { order } => polynomial_of_several(order, positions),
                Self::Chebyshev { .. } => Err(IdentError::one_signal("a Chebyshev interpolant", positions)),
                Self::Spline => Err(IdentError::one_signal("a cubic spline", positions)),
                Self::Linear => Err(IdentError::one_signal("linear interpolation", positions)),
                Self::GaussianProcess { .. } => {
                    Err(IdentError::one_signal("this Gaussian process", positions))
                }
            };
        };
        let positions = positions.as_slice();
        let range = || SchedulingRange::interval(positions[0], positions[n - 1]);
        let chebyshev = |order| {
            Ok::<_, IdentError>(FunctionBasis::new(BasisKind::Chebyshev {
                degree: order,
                range: range()?,
            })?)
        };
        match *self {
            Self::Polynomial { order } => {
                need("a polynomial of this order", order.saturating_add(1))?;
                let basis = chebyshev(order)?;
                let f = design(&basis, positions);
                let singular = IdentError::TooFewPositions {
                    what: "this polynomial",
                    needed: order + 1,
                    found: n,
                };
                let map = pseudo_inverse(f, 1e-13).map_err(|_| singular)?;
                Ok(InterpolationOperator { basis, map })
            }
            Self::Chebyshev { order } if order > MOST_CHEBYSHEV => Err(IdentError::Setting {
                name: "order",
                value: order as f64,
                problem: "a Chebyshev interpolant of a spline gains nothing beyond order 200",
            }),
            Self::Chebyshev { order } => {
                let spline = FunctionBasis::new(BasisKind::Spline {
                    knots: positions.to_vec(),
                })?;
                let basis = chebyshev(order)?;
                let range = range()?;
                let (centre, half, count) = (range.centre()[0], range.half_width()[0], order + 1);
                let angle = |j: usize| std::f64::consts::PI * (j as f64 + 0.5) / count as f64;
                let nodes: Vec<f64> = (0..count).map(|j| centre + half * angle(j).cos()).collect();
                let transform = DMatrix::from_fn(count, count, |k, j| {
                    (if k == 0 { 1.0 } else { 2.0 }) / count as f64 * (k as f64 * angle(j)).cos()
                });
                Ok(InterpolationOperator {
                    basis,
                    map: transform * design(&spline, &nodes),
                })
            }
            Self::Spline => {
                let basis = FunctionBasis::new(BasisKind::Spline {
                    knots: positions.to_vec(),
                })?;
                Ok(InterpolationOperator {
                    basis,
                    map: DMatrix::identity(n, n),
                })
            }
            Self::Linear => {
                let basis = FunctionBasis::new(BasisKind::Tabulated {
                    knots: positions.to_vec(),
                })?;
                Ok(InterpolationOperator {
                    basis,
                    map: DMatrix::identity(n, n),
                })
            }
            Self::GaussianProcess { length_scale } => {
                let problem = "give a finite length above zero";
                if !(length_scale.is_finite() && length_scale > 0.0) {
                    return Err(IdentError::Setting {
                        name: "length_scale",
                        value: length_scale,
                        problem,
                    });
                }
                let basis = FunctionBasis::new(BasisKind::Matern {
                    knots: positions.to_vec(),
                    length_scale,
                })?;
                let kernel = DMatrix::from_fn(n, n, |i, j| {
                    matern52((positions[i] - positions[j]) / length_scale) + if i == j { NUGGET } else { 0.0 }
                });
                let refused = || IdentError::Setting {
                    name: "length_scale",
                    value: length_scale,
                    problem: "the kernel matrix is singular at this length; shorten it",
                };
                let inverse = kernel.cholesky().ok_or_else(refused)?.inverse();
                // Generalised least squares for the constant mean, then the kernel weights of what is left.
                let ones = DMatrix::from_element(n, 1, 1.0);
                let total = (ones.transpose() * &inverse * &ones)[(0, 0)];
                let mean = ones.transpose() * &inverse / total;
                let weights = &inverse * (DMatrix::identity(n, n) - &ones * &mean);
                let mut map = DMatrix::zeros(n + 1, n);
                map.row_mut(0).copy_from(&mean.row(0));
                map.rows_mut(1, n).copy_from(&weights);
                Ok(InterpolationOperator { basis, map })
            }
        }
    }
}

/// The smallest range that holds all positions.
pub(crate) fn surrounding(positions: &[Position]) -> Result<SchedulingRange, CoreError> {
    let parameters = positions.first().map_or(0, |p| p.len());
    let bound = |i: usize| {
        let values = positions.iter().map(|p| p[i]);
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, u], v| {
            [l.min(v), u.max(v)]
        })
    };
    SchedulingRange::new((0..parameters).map(bound).collect())
}

/// Number of monomials of a total order up to this one.
pub(crate) fn terms(parameters: usize, order: usize) -> usize {
    (0..parameters).fold(1, |count: usize, k| count.saturating_mul(order + k + 1) / (k + 1))
}

/// Exponents of all monomials of so many parameters up to a total order, the constant first.
#[must_use]
pub fn monomials(parameters: usize, order: usize) -> Vec<Vec<u32>> {
    let mut all = vec![Vec::new()];
    for _ in 0..parameters {
        all = all
            .into_iter()
            .flat_map(|begun: Vec<u32>| {
                let left = order as u32 - begun.iter().sum::<u32>();
                (0..=left).map(move |e| [begun.as_slice(), &[e]].concat())
            })
            .collect();
    }
    all.sort_by_key(|e| e.iter().sum::<u32>());
    all
}

/// Highest total order of a polynomial of several scheduling signals.
const MOST_SEVERAL: usize = 30;

/// Part of the values that may be lost where powers of p stand for those of its distance from the middle.
const MOST_LOST: f64 = 1e-7;

/// Least squares in powers of the distance from the middle over the half width, which is well conditioned, written in powers of p.
fn polynomial_of_several(order: usize, positions: &[Position]) -> Result<InterpolationOperator, IdentError> {
    let parameters = positions[0].len();
    if let Some(index) = positions.iter().position(|p| p.len() != parameters) {
        return Err(IdentError::Position {
            index,
            position: positions[index].clone(),
            problem: "not as many scheduling values as the first position has",
        });
    }
    let (what, found) = ("a polynomial of this order", positions.len());
    let needed = terms(parameters, order.min(MOST_SEVERAL + 1));
    let few = IdentError::TooFewPositions { what, needed, found };
    if order > MOST_SEVERAL || needed > found {
        return Err(few);
    }
    let exponents = monomials(parameters, order);
    let basis = FunctionBasis::new(BasisKind::Monomials {
        exponents: exponents.clone(),
    })?;
    let range = surrounding(positions)?;
    let (centre, half) = (range.centre(), range.half_width());
    let near = |p: &[f64]| -> Vec<f64> { (0..parameters).map(|i| (p[i] - centre[i]) / half[i]).collect() };
    let rows: Vec<f64> = positions.iter().flat_map(|p| basis.evaluate(&near(p))).collect();
    let scaled = DMatrix::from_row_slice(found, needed, &rows);
    // Positions on a curve determine no more than a polynomial on it.
    let svd = svd(scaled.clone())?;
    if svd.singular_values.min() < 1e-9 * svd.singular_values.max() {
        return Err(few);
    }
    let own = svd.pseudo_inverse(0.0).map_err(|_| few)?;
    // ((p - m) / h)^e as a sum of powers of p, by the binomial theorem.
    let mut powers = DMatrix::zeros(needed, needed);
    for (j, e) in exponents.iter().enumerate() {
        for (i, f) in exponents.iter().enumerate() {
            if f.iter().zip(e).all(|(f, e)| f <= e) {
                powers[(i, j)] = (0..parameters)
                    .map(|k| {
                        binomial(e[k], f[k]) * (-centre[k]).powi((e[k] - f[k]) as i32)
                            / half[k].powi(e[k] as i32)
                    })
                    .product();
            }
        }
    }
    let map = powers * &own;
    let rows: Vec<f64> = positions.iter().flat_map(|p| basis.evaluate(p)).collect();
    let written = DMatrix::from_row_slice(found, needed, &rows) * &map;
    let lost = (written - scaled * own).amax();
    if lost > MOST_LOST {
        return Err(IdentError::FarFromZero { lost, order });
    }
    Ok(InterpolationOperator { basis, map })
}

fn binomial(n: u32, k: u32) -> f64 {
    (0..k).map(|i| f64::from(n - i) / f64::from(i + 1)).product()
}

fn design(basis: &FunctionBasis, points: &[f64]) -> DMatrix<f64> {
    let rows: Vec<f64> = points.iter().flat_map(|&p| basis.evaluate(&[p])).collect();
    DMatrix::from_row_slice(points.len(), basis.len(), &rows)
}

/// `Theta = map * samples`, `W(p) = sum_j Theta_j f_j(p)`.
#[derive(Debug, Clone, PartialEq)]
pub struct InterpolationOperator {
    basis: FunctionBasis,
    map: DMatrix<f64>,
}

impl InterpolationOperator {
    /// The weight of each sample in the value at p: `W(p) = sum_q l_q(p) W(p_q)`.
    pub fn cardinals(&self, p: &[f64]) -> Vec<f64> {
        let f = DMatrix::from_row_slice(1, self.basis.len(), &self.basis.evaluate(p));
        (f * &self.map).iter().copied().collect()
    }

    /// The function through (or near) the samples, one matrix a position.
    ///
    /// # Errors
    /// If the samples differ in number from the positions, or in shape from one another.
    pub fn apply(&self, samples: &[&DMatrix<f64>]) -> Result<MatrixFunction, IdentError> {
        let (rows, columns) = samples.first().map_or((0, 0), |m| m.shape());
        dimension("interpolation: samples", self.map.ncols(), samples.len())?;
        let coefficients = self
            .map
            .row_iter()
            .map(|weights| {
                let zero = DMatrix::zeros(rows, columns);
                weights
                    .iter()
                    .zip(samples)
                    .fold(zero, |sum, (&w, s)| if w == 0.0 { sum } else { sum + *s * w })
            })
            .collect();
        Ok(MatrixFunction::new(self.basis.clone(), coefficients)?)
    }
}
