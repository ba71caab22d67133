//! From the triangular factors of all positions to the gains that they share and their own coefficients.

use super::eliminate::eliminate;
use super::equations::{Eliminated, Equations};
use super::gram::{self, Left};
use super::{IdentError, LocalFit};
use faer::MatRef;
use lpv_core::Position;
use lpv_numerics::dense::{Triangle, invert_upper, solve_upper};
use nalgebra::{DMatrix, DVector, SVD};
use rayon::prelude::*;

/// Numbers of outputs, inputs and functions.
pub(super) type Sizes = (usize, usize, usize);

/// The gains with their covariance, and the fits.
pub(super) type Solved = ((DVector<f64>, DMatrix<f64>), Vec<LocalFit>);

/// Of all positions in their order; the first error counts.
pub(super) fn each<T: Send, U: Send>(
    items: impl IndexedParallelIterator<Item = T>,
    run: impl Fn(T) -> Result<U, IdentError> + Sync + Send,
) -> Result<Vec<U>, IdentError> {
    let results: Vec<_> = items.map(run).collect();
    results.into_iter().collect()
}

/// Columns of the sums of products, of all positions that are worked on together: enough for the speed of a large product,
/// few enough for the cache.
const COLUMNS: usize = 512;

/// What may be lost of the sixteen digits, as a factor, before a correction is worth another pass over the data.
const SPARE: f64 = 1e6;

/// By the normal equations; corrected once with what the first solution leaves where they, or the difference that is the cost,
/// have lost digits. None where they would cost too many.
pub(super) fn by_products(
    equations: &[Equations<'_>],
    nc: usize,
    sizes: Sizes,
) -> Result<Option<Solved>, IdentError> {
    let (columns, _) = gram::pairs(sizes.0 * sizes.1);
    let most = (COLUMNS / columns).max(1);
    let group = equations.len().div_ceil(rayon::current_num_threads()).min(most);
    let groups: Vec<&[Equations<'_>]> = equations
        .chunk_by(|a, b| std::ptr::eq(a.regressors, b.regressors))
        .flat_map(|same| same.chunks(group))
        .collect();
    let eliminated = each(groups.into_par_iter(), gram::eliminate)?;
    let Some(eliminated) = eliminated.into_iter().collect::<Option<Vec<_>>>() else {
        return Ok(None);
    };
    let (mut eliminated, before): (Vec<Eliminated>, Vec<(f64, Left)>) = eliminated
        .into_iter()
        .flatten()
        .map(|s| (s.eliminated, (s.condition, s.left)))
        .unzip();
    let (mut gains, covariance) = shared_gains(&eliminated, nc)?;
    let mut fits = each(eliminated.par_iter(), |e| back_substitute(e, &gains, sizes))?;
    let mut lost = 1.0_f64;
    for ((fit, e), (condition, left)) in fits.iter_mut().zip(&eliminated).zip(&before) {
        fit.cost = e.cost(left, &e.solved(&gains)?, &gains);
        let of_cost = left.cost / fit.cost.max(f64::MIN_POSITIVE);
        lost = lost.max(condition.powi(2)).max(of_cost);
    }
    if lost > SPARE {
        let left = each(
            equations.par_iter().zip(&mut eliminated).zip(&fits),
            |((equations, e), fit)| equations.left_by(fit, &gains, e),
        )?;
        let (change, _) = shared_gains(&eliminated, nc)?;
        for ((fit, e), left) in fits.iter_mut().zip(&eliminated).zip(&left) {
            let w = e.solved(&change)?;
            fit.weights += weights(&w, sizes);
            fit.cost = e.cost(left, &w, &change);
        }
        gains += change;
    }
    Ok(Some(((gains, covariance), fits)))
}

/// By orthogonal transformations of the whitened rows: for regressors that are nearly dependent.
pub(super) fn by_reflections(
    equations: &[Equations<'_>],
    nc: usize,
    sizes: Sizes,
) -> Result<Solved, IdentError> {
    let eliminated = each(equations.par_iter(), eliminate)?;
    let (gains, covariance) = shared_gains(&eliminated, nc)?;
    let fits = each(eliminated.par_iter(), |e| {
        e.full_rank(sizes)?;
        back_substitute(e, &gains, sizes)
    })?;
    Ok(((gains, covariance), fits))
}

/// The gains and their covariance for rows of variance one, from the stacked R22 of all positions: in their order, so that
/// the sum does not depend on threads.
fn shared_gains(eliminated: &[Eliminated], nc: usize) -> Result<(DVector<f64>, DMatrix<f64>), IdentError> {
    let mut triangle = Triangle::new(nc + 1, eliminated.len() * (nc + 1));
    for j in 0..=nc {
        let stacked = triangle.column_mut(j).chunks_exact_mut(nc + 1);
        for (rows, e) in stacked.zip(eliminated) {
            let n = e.unknowns;
            rows.copy_from_slice(e.r.view((n, n + j), (nc + 1, 1)).into_owned().as_slice());
        }
    }
    triangle.absorb(eliminated.len() * (nc + 1));
    let r22 = DMatrix::from_fn(nc, nc, |i, j| triangle.column(j)[i]);
    let r2 = DMatrix::from_fn(nc, 1, |i, _| triangle.column(nc)[i]);

    // What the positions' own coefficients leave of each column, against the whole column: a part that is rounding means
    // that the basis does what the rigid body should do.
    let whole = DVector::from_fn(nc, |j, _| {
        let norms = eliminated.iter().map(|e| e.r.column(e.unknowns + j).norm());
        norms.fold(0.0, f64::hypot).max(f64::MIN_POSITIVE)
    });
    let left = DMatrix::from_fn(nc, nc, |i, j| r22[(i, j)] / whole[j]);
    let (_, smallest) = extreme_singular_values(&left).unwrap_or((0.0, 0.0));
    let deficient = || IdentError::RankDeficient {
        position: eliminated
            .first()
            .map_or(Position::from(0.0), |e| e.position.clone()),
        reciprocal: smallest,
        function: 0,
    };
    if nc > 0 && smallest <= LEAST_RECIPROCAL {
        return Err(deficient());
    }
    let gains = solve_upper(&r22, &r2).ok_or_else(deficient)?;
    let inverse = invert_upper(&r22).ok_or_else(deficient)?;
    Ok((gains.column(0).into_owned(), &inverse * inverse.transpose()))
}

/// Reciprocal condition at which regressors count as dependent.
const LEAST_RECIPROCAL: f64 = 1e-12;

/// The largest and the smallest singular value; none for a matrix that is empty or not finite.
fn extreme_singular_values(m: &DMatrix<f64>) -> Option<(f64, f64)> {
    // The iteration neither accepts an empty matrix nor ends on one that is not finite.
    if m.is_empty() || m.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let view = MatRef::from_column_major_slice(m.as_slice(), m.nrows(), m.ncols());
    let values = view.singular_values().ok()?;
    Some((*values.first()?, *values.last()?))
}

/// The column that weighs most in the direction of the smallest singular value.
fn most_dependent_column(m: &DMatrix<f64>) -> usize {
    if m.is_empty() || m.iter().any(|v| !v.is_finite()) {
        return 0;
    }
    let column = SVD::try_new(m.clone(), false, true, 5.0 * f64::EPSILON, 10_000).and_then(|svd| {
        let weakest = svd.singular_values.imin();
        Some(svd.v_t?.row(weakest).transpose().iamax())
    });
    column.unwrap_or(0)
}

/// Condition after scaling the columns to unit length: the units of the unknowns must not matter. None for a matrix that is
/// not finite or singular.
pub(super) fn condition(r: &DMatrix<f64>) -> Option<f64> {
    let (largest, smallest) = extreme_singular_values(&scaled(r))?;
    (smallest > LEAST_RECIPROCAL * largest).then(|| largest / smallest)
}

fn scaled(r: &DMatrix<f64>) -> DMatrix<f64> {
    let mut scaled = r.clone();
    for mut column in scaled.column_iter_mut() {
        column /= column.norm().max(f64::MIN_POSITIVE);
    }
    scaled
}

impl Eliminated {
    fn deficient(&self, reciprocal: f64, function: usize) -> IdentError {
        IdentError::RankDeficient {
            position: self.position.clone(),
            reciprocal,
            function,
        }
    }

    /// An error that names the function where the position's own regressors are dependent.
    fn full_rank(&self, (.., functions): Sizes) -> Result<(), IdentError> {
        let r11 = self.r11();
        if condition(&r11).is_some() {
            return Ok(());
        }
        let scaled = scaled(&r11);
        let (largest, smallest) = extreme_singular_values(&scaled).unwrap_or((1.0, 0.0));
        Err(self.deficient(smallest / largest, most_dependent_column(&scaled) % functions + 1))
    }

    fn r11(&self) -> DMatrix<f64> {
        self.r.view((0, 0), (self.unknowns, self.unknowns)).into_owned()
    }

    /// The coefficients for the last column of the factor and these gains.
    fn solved(&self, gains: &DVector<f64>) -> Result<DVector<f64>, IdentError> {
        let (n, nc) = (self.unknowns, gains.len());
        let right = self.r.column(n + nc).rows(0, n) - self.r.view((0, n), (n, nc)) * gains;
        let solution = self.r.view((0, 0), (n, n)).solve_upper_triangular(&right);
        solution.ok_or_else(|| self.deficient(0.0, 0))
    }

    /// What is left after a step in the coefficients and the gains: a parabola, exact, and not negative but by rounding.
    fn cost(&self, before: &Left, coefficients: &DVector<f64>, gains: &DVector<f64>) -> f64 {
        let step = DVector::from_iterator(
            coefficients.len() + gains.len(),
            coefficients.iter().chain(gains.iter()).copied(),
        );
        let r = self.r.view((0, 0), (step.len(), step.len()));
        (before.cost - 2.0 * step.dot(&before.gradient) + (r * &step).norm_squared()).max(0.0)
    }
}

/// Unknowns stand as `(b n_y + a) n_g + i`; `W_i` is columns `i n_u ...` of the sample.
fn weights(w: &DVector<f64>, (ny, nu, ng): Sizes) -> DMatrix<f64> {
    DMatrix::from_fn(ny, ng * nu, |a, column| {
        let (i, b) = (column / nu, column % nu);
        w[(b * ny + a) * ng + i]
    })
}

fn back_substitute(e: &Eliminated, gains: &DVector<f64>, sizes: Sizes) -> Result<LocalFit, IdentError> {
    let (n, nc) = (e.unknowns, gains.len());
    let r11 = e.r11();
    let r12 = e.r.view((0, n), (n, nc)).into_owned();
    let gain_response = solve_upper(&r11, &r12).ok_or_else(|| e.deficient(0.0, 0))?;
    let w = e.solved(gains)?;

    // Cost: the rows below R11, at the shared gains.
    let r22 = e.r.view((n, n), (nc + 1, nc));
    let r2 = e.r.view((n, n + nc), (nc + 1, 1));
    let cost = (r2 - r22 * gains).norm_squared();
    Ok(LocalFit {
        position: e.position.clone(),
        weights: weights(&w, sizes),
        cost,
        equations: e.equations,
        unknowns: n,
        factorisations: e.factorisations,
        r11,
        gain_response,
    })
}
