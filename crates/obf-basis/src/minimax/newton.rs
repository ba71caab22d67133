//! Smoothed Newton descent of `max_k F(z_k)`, where F is a mean of log-distances to the centres.

use crate::PoleUnit;
use crate::disc::{from_chart, kappa_squared, log_distance};
use crate::memberships::log_power_mean;
use nalgebra::{Cholesky, DMatrix, DVector};
use num_complex::Complex;

/// How the distances to the centres are put together; both are scaled to the n-width cost in nepers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Mean {
    /// `F = sum_i ln d_i`.
    Geometric,
    /// `F = n_c ln (1/n_c sum_i d_i^(-1/(m-1)))^(-(m-1))`, with this `m`.
    Power(f64),
}

/// First and last sharpness `p` of the smooth maximum `1/p ln sum_k exp(p F_k)`, and the factor between stages.
pub(crate) const FIRST_SHARPNESS: f64 = 4.0;
const LAST_SHARPNESS: f64 = 3e5;
const SHARPENING: f64 = 4.0;
/// Newton steps at one sharpness.
const STEPS_PER_STAGE: usize = 24;
/// Points with a smaller share of the maximum take no part in the derivatives.
const SMALLEST_SHARE: f64 = 1e-13;

/// What a descent did.
#[derive(Debug, Clone)]
pub(crate) struct Descent {
    pub(crate) units: Vec<PoleUnit>,
    /// `max_k F`, nepers.
    pub(crate) worst: f64,
    pub(crate) iterations: usize,
    pub(crate) converged: Convergence,
}

/// Whether every stage ended by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Convergence {
    Reached,
    OutOfIterations,
}

/// `F` at every point.
pub(crate) fn evaluate(units: &[PoleUnit], points: &[Complex<f64>], mean: Mean, out: &mut Vec<f64>) {
    out.clear();
    match mean {
        Mean::Geometric => out.extend(points.iter().map(|&z| {
            // One logarithm for a product of squared distances, taken before the product underflows.
            let (mut product, mut sum) = (1.0f64, 0.0f64);
            for unit in units {
                product *= match unit {
                    PoleUnit::Real(a) => kappa_squared(z, Complex::new(*a, 0.0)),
                    PoleUnit::Pair(v) => kappa_squared(z, *v) * kappa_squared(z, v.conj()),
                };
                if product < 1e-100 {
                    sum += product.ln();
                    product = 1.0;
                }
            }
            0.5 * (sum + product.ln())
        })),
        Mean::Power(m) => {
            let mut distances = vec![0.0; units.len()];
            out.extend(points.iter().map(|&z| {
                for (d, &unit) in distances.iter_mut().zip(units) {
                    *d = log_distance(z, unit);
                }
                units.len() as f64 * log_power_mean(&distances, m)
            }));
        }
    }
}

/// Descends from `units` on all `points`, with sharpness growing from `sharpness` to the last one.
pub(crate) fn descend(
    units: Vec<PoleUnit>,
    points: &[Complex<f64>],
    mean: Mean,
    max_iterations: usize,
    sharpness: f64,
) -> Descent {
    let mut values = Vec::with_capacity(points.len());
    evaluate(&units, points, mean, &mut values);
    let mut best = Descent {
        worst: top(&values),
        units,
        iterations: 0,
        converged: Convergence::Reached,
    };
    let mut now = best.units.clone();
    let mut trial_values = Vec::with_capacity(points.len());
    let mut p = sharpness.max(FIRST_SHARPNESS);
    let mut damping = 1e-3;
    while p <= LAST_SHARPNESS * 1.001 && best.worst.is_finite() {
        evaluate(&now, points, mean, &mut values);
        let mut smooth = smooth_maximum(&values, p);
        for step in 0..=STEPS_PER_STAGE {
            if best.iterations >= max_iterations {
                best.converged = Convergence::OutOfIterations;
                return best;
            }
            if step == STEPS_PER_STAGE {
                break;
            }
            best.iterations += 1;
            let (gradient, hessian) = derivatives(&now, points, &values, mean, p);
            let mut decrease = 0.0;
            // Levenberg-Marquardt: more damping until the Hessian is positive definite and the step descends.
            for _ in 0..30 {
                let trial = step_from(&now, &gradient, &hessian, damping);
                if let Some(trial) = trial {
                    evaluate(&trial, points, mean, &mut trial_values);
                    let value = smooth_maximum(&trial_values, p);
                    if value < smooth {
                        decrease = smooth - value;
                        smooth = value;
                        now = trial;
                        std::mem::swap(&mut values, &mut trial_values);
                        damping = (damping * 0.15).max(1e-12);
                        break;
                    }
                }
                damping = (damping * 5.0).max(1e-10);
                if damping > 1e12 {
                    break;
                }
            }
            let worst = top(&values);
            if worst < best.worst {
                best.worst = worst;
                best.units.clone_from(&now);
            }
            if !worst.is_finite() || decrease < 0.01 / p {
                damping = damping.min(1e3);
                break;
            }
        }
        p *= SHARPENING;
    }
    best
}

fn top(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

fn smooth_maximum(values: &[f64], p: f64) -> f64 {
    let top = top(values);
    if !top.is_finite() {
        return top;
    }
    top + values.iter().map(|v| (p * (v - top)).exp()).sum::<f64>().ln() / p
}

/// Gradient and Hessian of the smooth maximum in the charts centred at the present poles, two coordinates a pair,
/// one a real pole. The gradient is exact; the Hessian leaves out how the shares of the power mean change, which is
/// of order 1/(m-1).
fn derivatives(
    units: &[PoleUnit],
    points: &[Complex<f64>],
    values: &[f64],
    mean: Mean,
    p: f64,
) -> (DVector<f64>, DMatrix<f64>) {
    let n: usize = units.iter().map(|u| u.order()).sum();
    let (mut gradient, mut hessian) = (DVector::zeros(n), DMatrix::zeros(n, n));
    let mut row = DVector::zeros(n);
    let mut shares = vec![1.0; units.len()];
    let highest = top(values);
    let mut total = 0.0;
    for (&z, &value) in points.iter().zip(values) {
        let share = (p * (value - highest)).exp();
        if share.is_nan() || share < SMALLEST_SHARE {
            continue;
        }
        if let Mean::Power(m) = mean {
            influence(units, z, m, &mut shares);
        }
        let mut at = 0;
        for (&unit, &weight) in units.iter().zip(&shares) {
            let (g, h) = local_derivatives(z, unit);
            match unit {
                PoleUnit::Real(_) => {
                    row[at] = weight * g.re;
                    hessian[(at, at)] += share * weight * h.re;
                }
                PoleUnit::Pair(_) => {
                    // ln d = Re(g w + h w^2 / 2) with w = x + j y.
                    row[at] = weight * g.re;
                    row[at + 1] = -weight * g.im;
                    hessian[(at, at)] += share * weight * h.re;
                    hessian[(at + 1, at)] -= share * weight * h.im;
                    hessian[(at + 1, at + 1)] -= share * weight * h.re;
                }
            }
            at += unit.order();
        }
        hessian.syger(p * share, &row, &row, 1.0);
        gradient.axpy(share, &row, 1.0);
        total += share;
    }
    gradient /= total;
    hessian /= total;
    hessian.syger(-p, &gradient.clone(), &gradient, 1.0);
    hessian.fill_upper_triangle_with_lower_triangle();
    (gradient, hessian)
}

/// `g` and `h` of `ln d(z, w) = ln d + Re(g w + h w^2 / 2) + O(w^3)`, `w` in the chart centred at the pole.
///
/// In that chart z is `zeta`, and `ln |zeta - w| - ln |1 - conj(w) zeta|` expands to `g = conj(zeta) - 1/zeta`,
/// `h = conj(zeta)^2 - 1/zeta^2`. The conjugate pole sees z as `conj z` sees the pole.
fn local_derivatives(z: Complex<f64>, unit: PoleUnit) -> (Complex<f64>, Complex<f64>) {
    let one = |z: Complex<f64>, v: Complex<f64>| {
        let zeta = crate::disc::to_chart(v, z);
        let inverse = zeta.inv();
        (
            zeta.conj() - inverse,
            zeta.conj() * zeta.conj() - inverse * inverse,
        )
    };
    match unit {
        PoleUnit::Real(a) => one(z, Complex::new(a, 0.0)),
        PoleUnit::Pair(v) => {
            let (upper, lower) = (one(z, v), one(z.conj(), v));
            (upper.0 + lower.0, upper.1 + lower.1)
        }
    }
}

/// `d F / d ln d_i` of the power mean: `n_c` times the normalised `d_i^(-1/(m-1))`.
fn influence(units: &[PoleUnit], z: Complex<f64>, m: f64, out: &mut [f64]) {
    for (o, &unit) in out.iter_mut().zip(units) {
        *o = log_distance(z, unit);
    }
    let least = out.iter().copied().fold(f64::INFINITY, f64::min);
    for o in out.iter_mut() {
        *o = (-(*o - least) / (m - 1.0)).exp();
    }
    let scale = units.len() as f64 / out.iter().sum::<f64>();
    for o in out.iter_mut() {
        *o *= scale;
    }
}

fn step_from(
    units: &[PoleUnit],
    gradient: &DVector<f64>,
    hessian: &DMatrix<f64>,
    damping: f64,
) -> Option<Vec<PoleUnit>> {
    let mut damped = hessian.clone();
    let scale = hessian.diagonal().amax().max(1e-3);
    for i in 0..damped.nrows() {
        damped[(i, i)] += damping * scale;
    }
    let step = -Cholesky::new(damped)?.solve(gradient);
    let longest = step.amax();
    if !longest.is_finite() {
        return None;
    }
    let shrink = (0.4 / longest).min(1.0);
    let mut at = 0;
    let mut moved = Vec::with_capacity(units.len());
    for &unit in units {
        let w = match unit {
            PoleUnit::Real(_) => Complex::new(shrink * step[at], 0.0),
            PoleUnit::Pair(_) => Complex::new(step[at], step[at + 1]) * shrink,
        };
        at += unit.order();
        moved.push(moved_unit(unit, w)?);
    }
    Some(moved)
}

/// The unit moved by `w` in its own chart; none if rounding carries it onto the unit circle.
pub(crate) fn moved_unit(unit: PoleUnit, w: Complex<f64>) -> Option<PoleUnit> {
    let v = from_chart(unit.upper(), w);
    let inside = v.norm_sqr() < 1.0 - 1e-14;
    inside.then_some(match unit {
        PoleUnit::Real(_) => PoleUnit::Real(v.re),
        PoleUnit::Pair(_) => PoleUnit::Pair(Complex::new(v.re, v.im.abs())),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_complex::c64;

    fn case() -> (Vec<PoleUnit>, Vec<Complex<f64>>) {
        let units = vec![
            PoleUnit::Pair(c64(0.5, 0.3)),
            PoleUnit::Real(0.2),
            PoleUnit::Pair(c64(-0.1, 0.6)),
        ];
        (
            units,
            vec![c64(0.45, 0.4), c64(0.1, 0.2), c64(0.7, 0.0), c64(-0.3, 0.5)],
        )
    }

    fn moved(units: &[PoleUnit], w: &[f64; 5]) -> Vec<PoleUnit> {
        vec![
            moved_unit(units[0], c64(w[0], w[1])).unwrap(),
            moved_unit(units[1], c64(w[2], 0.0)).unwrap(),
            moved_unit(units[2], c64(w[3], w[4])).unwrap(),
        ]
    }

    fn smooth(units: &[PoleUnit], points: &[Complex<f64>], mean: Mean, p: f64) -> f64 {
        let mut values = Vec::new();
        evaluate(units, points, mean, &mut values);
        smooth_maximum(&values, p)
    }

    #[test]
    fn gradient_and_hessian_meet_finite_differences() {
        let (units, points) = case();
        for (mean, p, exact_hessian) in [(Mean::Geometric, 3.0, true), (Mean::Power(35.0), 3.0, false)] {
            let mut values = Vec::new();
            evaluate(&units, &points, mean, &mut values);
            let (gradient, hessian) = derivatives(&units, &points, &values, mean, p);
            let h = 1e-4;
            for i in 0..5 {
                let at = |a: f64, j: usize, b: f64| {
                    let mut w = [0.0; 5];
                    w[i] += a;
                    w[j] += b;
                    smooth(&moved(&units, &w), &points, mean, p)
                };
                let slope = (at(h, 0, 0.0) - at(-h, 0, 0.0)) / (2.0 * h);
                assert!(
                    (slope - gradient[i]).abs() < 1e-6 * (1.0 + slope.abs()),
                    "{mean:?} {i}"
                );
                for j in 0..5 {
                    let second = (at(h, j, h) - at(h, j, -h) - at(-h, j, h) + at(-h, j, -h)) / (4.0 * h * h);
                    if exact_hessian {
                        assert!(
                            (second - hessian[(i, j)]).abs() < 1e-4 * (1.0 + second.abs()),
                            "{i} {j}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn one_pair_goes_to_the_hyperbolic_middle() {
        // In the chart of the first point two points at kappa 0.6 from the middle: the best kappa is theirs.
        let middle = c64(0.0, 0.9);
        let points = [
            from_chart(middle, c64(0.3, 0.0)),
            from_chart(middle, c64(-0.3, 0.0)),
        ];
        let start = vec![PoleUnit::Pair(c64(0.1, 0.8))];
        let descent = descend(start, &points, Mean::Geometric, 500, FIRST_SHARPNESS);
        let mut at_middle = Vec::new();
        evaluate(
            &[PoleUnit::Pair(middle)],
            &points,
            Mean::Geometric,
            &mut at_middle,
        );
        assert!(
            descent.worst <= top(&at_middle) + 1e-5,
            "{} {:?}",
            descent.worst,
            at_middle
        );
    }
}
