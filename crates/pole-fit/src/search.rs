//! From data to a denominator: reweighted total least squares, then Gauss-Newton with damping.

use crate::basis::Basis;
use crate::model::{Point, Reduced, Setup};
use crate::relocate::{Spread, denominator, inside, most_important, relocate, spread};
use crate::subspace::Subspace;
use crate::uncertainty::expected_cost;
use crate::{PoleFitError, PoleFitSettings};
use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};
use num_complex::Complex;

/// A step that is rounding of the coefficients, whose length is one.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// Why the search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum StopReason {
    /// The next step is shorter than the tolerance, in standard deviations.
    StepBelowTolerance,
    /// The residual is rounding, below ten digits of all responses together: noise-free data, fitted exactly.
    ResidualAtRounding,
    /// No step lowers the cost although the gradient does not vanish: rounding, or a flat direction.
    NoDescent,
    /// `max_iterations` was reached first.
    IterationLimit,
    /// All poles are fixed; the numerators follow in one step.
    Linear,
}

/// Where the search ended, and the work it took.
pub(crate) struct Found {
    pub(crate) basis: Basis,
    pub(crate) point: Point,
    pub(crate) stop: StopReason,
    pub(crate) start_iterations: usize,
    pub(crate) iterations: usize,
    pub(crate) factorisations: usize,
}

/// Costs within this factor of what noise alone leaves need no other start.
const AT_NOISE: f64 = 1.5;

/// A start is better where its cost is below this part of the other's.
const BETTER: f64 = 0.98;

/// Where a search begins.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Begin<'a> {
    /// At the data, from several starts where the first leaves more than noise.
    Data,
    /// At these poles, one of each pair.
    Poles(&'a [Complex<f64>]),
    /// At these poles, one of each pair; a few steps where they are far from the noise.
    Near(&'a [Complex<f64>]),
    /// At the poles of the better of two vector fits; a few steps where they are far from the noise, and all starts where they are
    /// near it but do not reach it.
    Quick,
}

/// The best of several starts: reweighted total least squares; and, where what it leaves is no noise, vector fitting from poles
/// spread over the band. Of many poles, those of a subspace method come first.
pub(crate) fn search(
    setup: &Setup<'_>,
    settings: &PoleFitSettings,
    begin: Begin<'_>,
) -> Result<Found, PoleFitError> {
    if setup.n_a == 1 {
        return Ok(Found {
            stop: StopReason::Linear,
            ..start(setup, settings)?
        });
    }
    let (expected, _) = expected_cost(setup, settings.weighting);
    let known = settings.weighting.knows_noise();
    let enough = |found: &Found| {
        let cost = found.point.cost;
        setup.is_exact(cost) || (known && cost <= AT_NOISE * expected)
    };
    let relocated = |how| {
        let first = spread(&setup.lines.z, setup.n_a - 1, how);
        let poles = relocate(setup, first)?;
        from_poles(setup, &poles).map(Ok)
    };
    let quickly = |found: Found| {
        let far = found.point.cost > FAR * expected;
        let steps = if far { FEW_STEPS } else { usize::MAX };
        let settings = PoleFitSettings {
            max_iterations: settings.max_iterations.min(steps),
            ..*settings
        };
        refine(setup, &settings, found)
    };
    match begin {
        Begin::Data => {}
        Begin::Poles(poles) => {
            if let Some(found) = from_poles(setup, poles) {
                return refine(setup, settings, found);
            }
        }
        Begin::Near(poles) => {
            if let Some(found) = from_poles(setup, poles) {
                return quickly(found);
            }
        }
        Begin::Quick => {
            let both = [Spread::Lines, Spread::Decades].into_iter().filter_map(relocated);
            let best = both
                .flatten()
                .min_by(|a, b| a.point.cost.total_cmp(&b.point.cost));
            if let Some(found) = best {
                return quickly(found);
            }
        }
    }
    type Start<'a> = &'a dyn Fn() -> Option<Result<Found, PoleFitError>>;
    let total_least_squares: Start<'_> = &|| {
        Some(start(setup, settings).map(|found| {
            if settings.keep_stable {
                mirrored(setup, &found).unwrap_or(found)
            } else {
                found
            }
        }))
    };
    let lines: Start<'_> = &|| relocated(Spread::Lines);
    let decades: Start<'_> = &|| relocated(Spread::Decades);
    let counted: Start<'_> = &|| {
        let fixed = settings.fixed_integrators();
        let poles = Subspace::new(setup.lines)?.at_least(setup.n_a - 1, fixed)?;
        let poles = most_important(setup, &poles, setup.n_a - 1)?;
        from_poles(setup, &poles).map(Ok)
    };
    // Many poles are found from poles; few, without bias from the noise.
    let starts: &[Start<'_>] = match (setup.n_a - 1 > MANY && settings.several_starts, known) {
        (true, true) => &[counted, lines, total_least_squares, decades],
        (true, false) => &[lines, total_least_squares, decades],
        (false, _) => &[total_least_squares, lines, decades],
    };
    let mut best: Option<Result<Found, PoleFitError>> = None;
    for start in starts {
        let Some(found) = start().map(|found| found.and_then(|found| refine(setup, settings, found))) else {
            continue;
        };
        let better = match (&best, &found) {
            (Some(Ok(best)), Ok(found)) => found.point.cost < BETTER * best.point.cost,
            (Some(Ok(_)), Err(_)) => false,
            _ => true,
        };
        if better {
            best = Some(found);
        }
        if !settings.several_starts || matches!(&best, Some(Ok(best)) if enough(best)) {
            break;
        }
    }
    best.unwrap_or(Err(PoleFitError::Numerators { order: setup.order }))
}

/// Costs beyond this multiple of what noise leaves are far from it: few steps reach it from there.
const FAR: f64 = 100.0;
/// Steps of a quick search from there.
const FEW_STEPS: usize = 6;

/// Beyond so many poles a subspace method and vector fitting are tried first.
const MANY: usize = 16;

/// The point whose poles outside the unit circle are mirrored at it; none where all are inside.
fn mirrored(setup: &Setup<'_>, found: &Found) -> Option<Found> {
    let mut roots = found.basis.recurrence.roots(&found.point.alpha).ok()?;
    if roots.iter().all(|z| z.norm() < 1.0) {
        return None;
    }
    roots.retain(|z| z.im >= 0.0);
    for z in &mut roots {
        *z = inside(*z);
    }
    from_poles(setup, &roots)
}

/// The point with these poles, one of each pair.
fn from_poles(setup: &Setup<'_>, poles: &[Complex<f64>]) -> Option<Found> {
    let a = denominator(&setup.lines.z, poles);
    let basis = setup.basis(&a).ok()?;
    let alpha = normalised(basis.project(setup.n_a, &a));
    let point = Point::new(setup, &basis, alpha).ok()?;
    Some(Found {
        basis,
        point,
        stop: StopReason::IterationLimit,
        start_iterations: 0,
        iterations: 0,
        factorisations: 1,
    })
}

/// Bootstrapped total least squares (Van Huffel, Pintelon): at each pass the equation error `t a F - B` is divided by
/// the last `t a` and `a` minimises its sum of squares over what noise alone would give. Unlike the iteration of
/// Sanathanan and Koerner with a fixed coefficient it has no bias from the noise.
fn start(setup: &Setup<'_>, settings: &PoleFitSettings) -> Result<Found, PoleFitError> {
    let n = setup.lines.len();
    let data = setup.data();
    let mut a = vec![Complex::new(1.0, 0.0); n];
    let mut best: Option<Found> = None;
    let mut factorisations = 0;
    let mut poor = 0;
    for pass in 0..=settings.start_iterations {
        let basis = setup.basis(&a)?;
        let alpha = normalised(basis.project(setup.n_a, &a));
        let point = match Point::new(setup, &basis, alpha) {
            Ok(point) => point,
            Err(error) => match best {
                Some(_) => break,
                None => return Err(error),
            },
        };
        factorisations += 1;
        // What is exact needs no better start, but a denominator that the data have chosen.
        let next = if setup.n_a == 1 || (pass > 0 && setup.is_exact(point.cost)) {
            None
        } else {
            point
                .reduce(setup, &basis, &data)
                .and_then(|reduced| total_least_squares(&reduced))
                .map(|alpha| basis.combine(alpha.as_slice()))
        };
        let previous = best.as_ref().map_or(f64::INFINITY, |b| b.point.cost);
        if point.cost < previous {
            poor = if point.cost > 0.98 * previous { poor + 1 } else { 0 };
            best = Some(Found {
                basis,
                point,
                stop: StopReason::IterationLimit,
                start_iterations: pass,
                iterations: 0,
                factorisations,
            });
        } else {
            poor += 1;
        }
        match next {
            Some(next) if poor < 2 => a = next,
            _ => break,
        }
    }
    best.map(|b| Found { factorisations, ..b })
        .ok_or(PoleFitError::Numerators { order: setup.order })
}

fn normalised(alpha: DVector<f64>) -> DVector<f64> {
    let norm = alpha.norm();
    if norm > 0.0 && norm.is_finite() {
        alpha / norm
    } else {
        let mut one = DVector::zeros(alpha.len());
        one[0] = 1.0;
        one
    }
}

/// The `alpha` of least `alpha^T M alpha / alpha^T C alpha`.
fn total_least_squares(reduced: &Reduced) -> Option<DVector<f64>> {
    let n = reduced.m.nrows();
    let lift = 1e-13 * reduced.noise.trace() / n as f64;
    let factor = Cholesky::new(&reduced.noise + DMatrix::identity(n, n) * lift)?.l();
    let mut half = reduced.m.clone();
    let mut whole = DMatrix::zeros(n, n);
    if factor.solve_lower_triangular_mut(&mut half) {
        whole = half.transpose();
    }
    if !factor.solve_lower_triangular_mut(&mut whole) || !whole.iter().all(|v| v.is_finite()) {
        return None;
    }
    let symmetric = (&whole + whole.transpose()) * 0.5;
    let eigen = SymmetricEigen::try_new(symmetric, f64::EPSILON, 1000)?;
    let least = eigen.eigenvalues.imin();
    let mut alpha = eigen.eigenvectors.column(least).into_owned();
    factor
        .tr_solve_lower_triangular_mut(&mut alpha)
        .then(|| normalised(alpha))
}

/// Orthonormal basis of the directions that change `alpha` other than in scale, `n_a x (n_a - 1)`.
pub(crate) fn tangent(alpha: &DVector<f64>) -> DMatrix<f64> {
    let n = alpha.len();
    let mut v = normalised(alpha.clone());
    v[0] += if v[0] < 0.0 { -1.0 } else { 1.0 };
    let scale = 2.0 / v.norm_squared();
    DMatrix::from_fn(n, n - 1, |i, j| {
        f64::from(u8::from(i == j + 1)) - scale * v[i] * v[j + 1]
    })
}

fn refine(setup: &Setup<'_>, settings: &PoleFitSettings, found: Found) -> Result<Found, PoleFitError> {
    let set = settings;
    let Found {
        basis,
        mut point,
        start_iterations,
        mut factorisations,
        ..
    } = found;
    let (mut iterations, mut lambda) = (0, 0.0);
    let free = setup.equations().saturating_sub(setup.unknowns()).max(1) as f64;
    let stays = set.keep_stable && is_stable(&basis, &point.alpha);
    let stop = 'search: loop {
        let model = point.model(setup);
        let Some(reduced) = point.reduce(setup, &basis, &model) else {
            break StopReason::NoDescent;
        };
        let q = tangent(&point.alpha);
        let r = q.tr_mul(&reduced.m) * &q;
        let g = q.tr_mul(&point.gradient(setup, &basis, &model));
        loop {
            let raise = |lambda: f64| (lambda * 10.0f64).max(1e-4);
            let Some(step) = damped_step(&r, &g, lambda) else {
                lambda = raise(lambda);
                if lambda > 1e8 {
                    break 'search StopReason::NoDescent;
                }
                continue;
            };
            // Twice the decrease that the quadratic model promises: the squared length of the step measured by the
            // covariance that a residual of this size implies, a factor apart.
            let decrement = -step.dot(&g);
            if decrement <= set.tolerance.powi(2) * point.cost / free {
                break 'search if lambda < 1.0 {
                    StopReason::StepBelowTolerance
                } else {
                    StopReason::NoDescent
                };
            }
            if iterations >= set.max_iterations {
                break 'search StopReason::IterationLimit;
            }
            iterations += 1;
            let length = step.norm();
            let alpha = normalised(&point.alpha + &q * step);
            let trial = Point::new(setup, &basis, alpha);
            factorisations += 1;
            match trial {
                Ok(trial) if trial.cost < point.cost && (!stays || is_stable(&basis, &trial.alpha)) => {
                    point = trial;
                    // Where the residual vanishes, what remains after a step is its square.
                    if lambda < 1.0 && length < ROUNDING && setup.is_exact(point.cost) {
                        break 'search StopReason::ResidualAtRounding;
                    }
                    lambda = if lambda > 1e-4 { lambda * 0.1 } else { 0.0 };
                    break;
                }
                // In an orthonormal basis such a step is rounding of the coefficients.
                _ if length < 1e-11 => {
                    break 'search if setup.is_exact(point.cost) {
                        StopReason::ResidualAtRounding
                    } else {
                        StopReason::NoDescent
                    };
                }
                _ => {
                    lambda = raise(lambda);
                    if lambda > 1e8 {
                        break 'search StopReason::NoDescent;
                    }
                }
            }
        }
    };
    Ok(Found {
        basis,
        point,
        stop,
        start_iterations,
        iterations,
        factorisations,
    })
}

fn is_stable(basis: &Basis, alpha: &DVector<f64>) -> bool {
    let roots = basis.recurrence.roots(alpha);
    roots.is_ok_and(|roots| roots.iter().all(|z| z.norm() < 1.0))
}

/// `-(R + lambda diag R)^-1 g`; the diagonal never counts as less than a rounding of the largest entry.
fn damped_step(r: &DMatrix<f64>, g: &DVector<f64>, lambda: f64) -> Option<DVector<f64>> {
    let mut damped = r.clone();
    let least = f64::EPSILON * r.diagonal().amax();
    for i in 0..r.nrows() {
        let d = r[(i, i)].max(least);
        damped[(i, i)] = d * (1.0 + lambda);
    }
    let step = Cholesky::new(damped)?.solve(g);
    step.iter().all(|v| v.is_finite()).then_some(-step)
}
