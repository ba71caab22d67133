//! Starts of the search: realisation of an estimated impulse response, and polish by linear least squares.

use crate::LtiIdentError;
use crate::predictor::{Predictor, Region, reflected};
use crate::problem::{Equations, InitialStates, Point, Problem, unit_directions};
use crate::search::{Bounds, moved};
use lpv_core::linalg::{least_squares, svd};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, SVD};

/// Longest impulse response that is estimated unless the settings ask for more.
const LONGEST: usize = 100;

/// Ridge of the impulse response, relative to the mean square of the known signals.
const RIDGE: f64 = 3e-5;

/// Least squares for `target(k) = sum_l G_l w(k - l)`, `l = 0 ... L`: the matrix is that of the known signals alone, so
/// that it is factorised once.
pub(crate) struct ImpulseResponse<'a> {
    problem: &'a Problem,
    lags: usize,
    factor: Cholesky<f64, Dyn>,
}

impl<'a> ImpulseResponse<'a> {
    pub(crate) fn new(problem: &'a Problem, samples: Option<usize>) -> Result<Self, LtiIdentError> {
        let nw = problem.known();
        // Five equations an unknown of one output, and no run shorter than the response.
        let longest = problem
            .runs
            .iter()
            .map(|r| r.outputs.ncols() / 2)
            .max()
            .unwrap_or(0);
        let lags = samples
            .unwrap_or((problem.samples() / (5 * nw)).min(LONGEST))
            .min(longest);
        let (equations, unknowns) = (problem.samples(), nw * (lags + 1));
        if lags < 4 || equations < unknowns {
            let what = "impulse response of the start";
            return Err(LtiIdentError::TooFewSamples {
                what,
                equations,
                unknowns,
            });
        }
        let mut gram = DMatrix::zeros(unknowns, unknowns);
        for run in &problem.runs {
            let rows = lagged(&run.known, lags);
            gram.gemm(1.0, &rows, &rows.transpose(), 1.0);
        }
        let ridge = RIDGE * gram.trace() / unknowns as f64;
        for i in 0..unknowns {
            // D is zero for signals that may not feed through.
            let closed = i < nw && i >= problem.direct;
            gram[(i, i)] += if closed { 1e9 * gram.trace() } else { ridge };
        }
        let singular = LtiIdentError::Singular {
            what: "impulse response of the start",
        };
        let factor = gram.cholesky().ok_or(singular)?;
        Ok(Self {
            problem,
            lags,
            factor,
        })
    }

    /// `G_0, ..., G_L`, each `n_y x n_w`, for one target a run.
    fn markov(&self, targets: &[DMatrix<f64>]) -> Vec<DMatrix<f64>> {
        let nw = self.problem.known();
        let mut moments = DMatrix::zeros(nw * (self.lags + 1), self.problem.outputs());
        for (run, target) in self.problem.runs.iter().zip(targets) {
            let rows = lagged(&run.known, self.lags);
            let from = target.ncols() - rows.ncols();
            moments.gemm(1.0, &rows, &target.columns(from, rows.ncols()).transpose(), 1.0);
        }
        let solved = self.factor.solve(&moments);
        (0..=self.lags)
            .map(|l| solved.rows(nw * l, nw).transpose())
            .collect()
    }

    /// The realisation of Ho and Kalman, from which any order can be cut.
    pub(crate) fn realisation(&self, targets: &[DMatrix<f64>]) -> Option<Realisation> {
        let markov = self.markov(targets);
        let (ny, nw) = markov[0].shape();
        let half = self.lags / 2;
        let mut hankel = DMatrix::zeros(ny * half, nw * half);
        for i in 0..half {
            for j in 0..half {
                hankel
                    .view_mut((ny * i, nw * j), (ny, nw))
                    .copy_from(&markov[1 + i + j]);
            }
        }
        let svd = svd(hankel).ok()?;
        Some(Realisation {
            svd,
            direct: markov[0].clone(),
            known: nw,
        })
    }
}

/// Column k is `[w(k + L); w(k + L - 1); ...; w(k)]`; none for a run that is too short.
pub(crate) fn lagged(known: &DMatrix<f64>, lags: usize) -> DMatrix<f64> {
    let (nw, samples) = known.shape();
    DMatrix::from_fn(nw * (lags + 1), samples.saturating_sub(lags), |i, k| {
        known[(i % nw, k + lags - i / nw)]
    })
}

/// Singular value decomposition of a block Hankel matrix of an impulse response.
pub(crate) struct Realisation {
    svd: SVD<f64, Dyn, Dyn>,
    direct: DMatrix<f64>,
    known: usize,
}

impl Realisation {
    /// The filter of the largest Hankel singular values, poles mirrored into the unit circle.
    pub(crate) fn cut(&self, order: usize, region: Region) -> Option<Predictor> {
        let (u, v_t) = (self.svd.u.as_ref()?, self.svd.v_t.as_ref()?);
        let ny = self.direct.nrows();
        if order > self.svd.singular_values.len() || u.nrows() < order + ny {
            return None;
        }
        let root = DMatrix::from_diagonal(&self.svd.singular_values.rows(0, order).map(f64::sqrt));
        let observe = u.columns(0, order) * &root;
        let reach = &root * v_t.rows(0, order);
        let rows = observe.nrows() - ny;
        let upper = observe.rows(0, rows).into_owned();
        let a = least_squares(upper, &observe.rows(ny, rows).into_owned(), 1e-10).ok()?;
        let (b, c) = (
            reach.columns(0, self.known).into_owned(),
            observe.rows(0, ny).into_owned(),
        );
        Predictor::new(&reflected(&a, region)?, &b, &c, &self.direct).ok()
    }
}

/// The given poles and output matrix with the B, D, d and initial states of least squares: with A and C held the
/// predictions are linear in them.
pub(crate) fn polished(problem: &Problem, predictor: &Predictor) -> Option<Point> {
    let n = predictor.states;
    let (ny, nw) = (problem.outputs(), problem.known());
    let mut bare = predictor.clone();
    bare.matrix.view_mut((n, n), (ny, nw)).fill(0.0);
    let zeros = vec![DVector::zeros(n); problem.runs.len()];
    let mut point = problem.point(bare, zeros)?;
    let [direct, offset] = problem.feedthrough(n);
    let blocks = [((0, n), (n, nw)), direct, offset];
    let directions = unit_directions(predictor.matrix.shape(), &blocks);
    // The second time with the weights of the first.
    for _ in 0..2 {
        let step = Equations::new(problem, &point, &directions, InitialStates::Estimated)?.step(1e-10)?;
        match moved(problem, &point, &directions, &step, Bounds::Refused) {
            Some(next) if next.cost < point.cost => point = next,
            _ => break,
        }
    }
    Some(point)
}

/// The optimum of a lower order with states added that are fitted to its residual. Its cost is no higher than that of
/// the lower order: at worst, what was added has no effect.
pub(crate) fn grown(
    problem: &Problem,
    lower: &Point,
    response: &ImpulseResponse,
    order: usize,
) -> Option<Point> {
    let added = response
        .realisation(&lower.residuals)?
        .cut(order - lower.predictor.states, problem.region)?;
    let both = lower.predictor.plus(&added).ok()?;
    let tail = |x: &DVector<f64>| x.clone().resize_vertically(order, 0.0);
    let initial: Vec<_> = lower.initial.iter().map(tail).collect();
    let polished = polished(problem, &both);
    let mut silent = both;
    let n = lower.predictor.states;
    silent
        .matrix
        .view_mut((n, order), (order - n, problem.known()))
        .fill(0.0);
    let (d, feed) = (lower.predictor.d().into_owned(), problem.known());
    silent
        .matrix
        .view_mut((order, order), (d.nrows(), feed))
        .copy_from(&d);
    let silent = problem.point(silent, initial);
    match (polished, silent) {
        (Some(p), Some(s)) => Some(if p.cost < s.cost { p } else { s }),
        (p, s) => p.or(s),
    }
}
