//! Poles, Table I, the LPV-OBF models and their LFR.

use crate::TaskError;
use crate::experiment::{Bench, median};
use crate::size::{CHOSEN_FUNCTIONS, PAPER_GRID_DB, PAPER_TRUE_DB, TABLE_FUNCTIONS};
use lfr_realize::{Realization, realize};
use lpv::validation::{FrozenError, channel_error};
use lpv::{IdentifyConfig, PoleStage, Polish, RigidTerms, choose_basis, fit_poles, regress_on};
use lpv_core::num_complex::Complex;
use lpv_core::{Frf, FrfEstimate, WellPosedness};
use lpv_ident::{
    Interpolation, LeaveOneOut, LocalFits, LpvObfModel, RegressionSettings, RigidTerm, Weighting, recommend,
    regress,
};
use obf_basis::{
    FkcmSettings, MinimaxSettings, OrthonormalBasis, PoleSet, Refinement, fkcm, kolmogorov_cost_db,
    polish_minimax,
};
use rayon::prelude::*;
use serde::Serialize;

/// Order of the common denominator: two integrators and two modes.
const ORDER: usize = 6;

/// Figures on the pole estimates.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct PoleAccount {
    /// Largest distance between an estimated and a true pole in the z plane, times 100: the paper's figure.
    pub(crate) worst_abs_percent: f64,
    /// Median of the same.
    pub(crate) median_abs_percent: f64,
    /// Largest relative error of a pole in the s plane, in percent.
    pub(crate) worst_continuous_percent: f64,
    /// Root mean square of the error over its stated deviation; 1 where the covariance is right.
    pub(crate) error_over_deviation: f64,
    /// Weighted cost minus its expectation, in standard deviations, the largest over positions.
    pub(crate) worst_cost_excess: f64,
    /// The paper's worst error.
    pub(crate) paper_worst_abs_percent: f64,
}

/// Fits the poles at all positions and compares them with the true ones.
pub(crate) fn poles(bench: &Bench, estimates: &[FrfEstimate]) -> Result<(PoleStage, PoleAccount), TaskError> {
    let config = IdentifyConfig {
        order: Some(ORDER),
        integrators: Some(2),
        ..IdentifyConfig::default()
    };
    let stage = fit_poles(estimates, bench.clock, &config)?;
    let (mut distances, mut relative, mut normalised) = (Vec::new(), 0.0_f64, Vec::new());
    for (fit, &p) in stage.fits.iter().zip(&bench.positions) {
        let truth = bench.machine.sampled_flexible_poles(p, bench.clock)?;
        for index in fit.flexible_indices() {
            let z = fit.poles[index];
            let nearest = truth
                .iter()
                .min_by(|a, b| (*a - z).norm().total_cmp(&(*b - z).norm()));
            let Some(&t) = nearest else { continue };
            distances.push(100.0 * (z - t).norm());
            relative = relative.max(100.0 * (z.ln() - t.ln()).norm() / t.ln().norm());
            normalised.push((z - t).norm_sqr() / fit.pole_covariance[index].trace());
        }
    }
    let account = PoleAccount {
        worst_abs_percent: distances.iter().copied().fold(0.0, f64::max),
        median_abs_percent: median(distances),
        worst_continuous_percent: relative,
        error_over_deviation: (normalised.iter().sum::<f64>() / normalised.len() as f64).sqrt(),
        worst_cost_excess: stage
            .fits
            .iter()
            .map(|f| f.account.cost_excess())
            .fold(f64::NEG_INFINITY, f64::max),
        paper_worst_abs_percent: 0.007,
    };
    Ok((stage, account))
}

/// One column of Table I, all in dB.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct TableColumn {
    pub(crate) functions: usize,
    /// FKcM run on the estimated poles, cost on the true continuum.
    pub(crate) fkcm_true_db: f64,
    /// The same basis, cost on the estimated poles.
    pub(crate) fkcm_grid_db: f64,
    /// FKcM without the joint descent that follows its alternation, cost on the true continuum.
    pub(crate) alternation_true_db: f64,
    /// Minimax polish on the true continuum.
    pub(crate) minimax_true_db: f64,
    pub(crate) paper_true_db: f64,
    pub(crate) paper_grid_db: f64,
}

/// The true poles over the whole range.
pub(crate) fn continuum(bench: &Bench) -> Result<Vec<Complex<f64>>, TaskError> {
    let mut all = Vec::new();
    for p in bench.machine.positions(bench.size.continuum) {
        all.extend(bench.machine.sampled_flexible_poles(p, bench.clock)?);
    }
    Ok(all)
}

/// FKcM and the minimax polish for the sizes of Table I.
pub(crate) fn table_one(
    bench: &Bench,
    stage: &PoleStage,
    truth: &[Complex<f64>],
) -> Result<Vec<TableColumn>, TaskError> {
    let observed = PoleSet::new(
        &stage
            .fits
            .iter()
            .flat_map(pole_fit::PoleFit::flexible_poles)
            .collect::<Vec<_>>(),
    )?;
    TABLE_FUNCTIONS
        .par_iter()
        .zip(PAPER_TRUE_DB.par_iter().zip(&PAPER_GRID_DB))
        .map(|(&functions, (&paper_true_db, &paper_grid_db))| {
            let settings = FkcmSettings {
                fuzziness: 35.0,
                seed: bench.seed,
                ..FkcmSettings::new(functions)
            };
            let found = fkcm(&observed, &settings.clone())?;
            let alternation = fkcm(
                &observed,
                &FkcmSettings {
                    refinement: Refinement::None,
                    ..settings
                },
            )?;
            let polish = polish_minimax(
                &found.poles,
                truth,
                &MinimaxSettings {
                    seed: bench.seed,
                    ..MinimaxSettings::default()
                },
            )?;
            Ok(TableColumn {
                functions,
                fkcm_true_db: kolmogorov_cost_db(&found.poles, truth)?,
                fkcm_grid_db: found.cost_db,
                alternation_true_db: kolmogorov_cost_db(&alternation.poles, truth)?,
                minimax_true_db: polish.cost_db,
                paper_true_db,
                paper_grid_db,
            })
        })
        .collect()
}

/// The grid on which models are compared with the plant.
pub(crate) struct TestGrid {
    pub(crate) frequencies_hz: Vec<f64>,
    pub(crate) positions: Vec<f64>,
    pub(crate) truth: Vec<Frf>,
    /// Which test positions were measured.
    pub(crate) measured: Vec<bool>,
}

impl TestGrid {
    /// All measured positions and `refinement - 1` between two neighbours; 240 lines spaced logarithmically from 0.01 to
    /// Nyquist and 400 linearly over the modes.
    pub(crate) fn new(bench: &Bench) -> Result<Self, TaskError> {
        let nyquist: f64 = 0.5 / bench.clock.sample_time();
        let wide = (0..240).map(|k| 0.01 * (0.999 * nyquist / 0.01).powf(f64::from(k) / 239.0));
        let dense = (0..400).map(|k| 1.0 + 2.0 * f64::from(k) / 399.0);
        let mut frequencies_hz: Vec<f64> = wide.chain(dense).collect();
        frequencies_hz.sort_by(f64::total_cmp);
        frequencies_hz.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
        let steps = bench.size.refinement;
        let positions = bench.machine.positions((bench.size.positions - 1) * steps + 1);
        let truth = positions
            .par_iter()
            .map(|&p| bench.truth(p, &frequencies_hz))
            .collect::<Result<Vec<_>, _>>()?;
        let measured = (0..positions.len()).map(|i| i % steps == 0).collect();
        Ok(Self {
            frequencies_hz,
            positions,
            truth,
            measured,
        })
    }

    /// Relative error of every line, by test position.
    fn errors(&self, responses: &[Frf]) -> Result<Vec<Vec<f64>>, TaskError> {
        let pairs = responses.par_iter().zip(&self.truth);
        Ok(pairs
            .map(|(g, f)| g.relative_error(f))
            .collect::<Result<_, _>>()?)
    }

    /// Of all positions, or of those that were measured or not, up to a frequency.
    fn part(
        &self,
        errors: &[Vec<f64>],
        measured: Option<bool>,
        highest_hz: f64,
    ) -> Result<FrozenError, TaskError> {
        let kept = (0..errors.len()).filter(|i| measured.is_none_or(|m| self.measured[*i] == m));
        let lines = kept.enumerate().flat_map(|(index, i)| {
            let lines = errors[i].iter().zip(&self.frequencies_hz);
            lines.map(move |(error, f)| (*error, *f, index))
        });
        let part = FrozenError::of(lines.filter(|(_, f, _)| *f <= highest_hz));
        Ok(part.ok_or("a part of the test grid is empty")?)
    }
}

/// The band of the rigid body and the modes, Hz. Above it the plant falls towards its zero at Nyquist
/// and into the noise, so that a relative error there says little.
pub(crate) const BAND_HZ: f64 = 3.0;

/// The two readings of the frozen error, at the measured positions and between them.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct ObfError {
    pub(crate) functions: usize,
    pub(crate) interpolation: String,
    pub(crate) strict_max_db: f64,
    pub(crate) median_db: f64,
    pub(crate) at_positions: FrozenError,
    pub(crate) between: FrozenError,
    /// Over [0.01, 3] only: rigid body and modes.
    pub(crate) band: BandError,
}

/// The readings over a band.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct BandError {
    pub(crate) strict_max_db: f64,
    pub(crate) median_db: f64,
    pub(crate) at_positions: FrozenError,
    pub(crate) between: FrozenError,
}

impl ObfError {
    fn new(model: &LpvObfModel, grid: &TestGrid) -> Result<Self, TaskError> {
        let responses = model.responses(grid.positions.iter().copied(), &grid.frequencies_hz)?;
        let errors = grid.errors(&responses)?;
        let all = grid.part(&errors, None, f64::INFINITY)?;
        let band = grid.part(&errors, None, BAND_HZ)?;
        Ok(Self {
            functions: model.fits().functions(),
            interpolation: model.interpolation().name(),
            strict_max_db: all.strict_max_db,
            median_db: all.median_db,
            at_positions: grid.part(&errors, Some(true), f64::INFINITY)?,
            between: grid.part(&errors, Some(false), f64::INFINITY)?,
            band: BandError {
                strict_max_db: band.strict_max_db,
                median_db: band.median_db,
                at_positions: grid.part(&errors, Some(true), BAND_HZ)?,
                between: grid.part(&errors, Some(false), BAND_HZ)?,
            },
        })
    }
}

/// Error of one channel over all test positions, relative at each line.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct ChannelError {
    pub(crate) channel: String,
    pub(crate) strict_max_db: f64,
    pub(crate) median_db: f64,
}

/// The models with n_g = 16.
pub(crate) struct ObfStage {
    /// Recommended by leave-one-out.
    pub(crate) recommended: LpvObfModel,
    /// The paper's polynomial.
    pub(crate) paper: LpvObfModel,
    /// The same order, Chebyshev: what goes into the LFR.
    pub(crate) chebyshev: LpvObfModel,
    pub(crate) leave_one_out: Vec<LeaveOneOut>,
    pub(crate) account: ObfAccount,
    pub(crate) table: Vec<ObfError>,
}

/// Figures on the models.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct ObfAccount {
    #[serde(flatten)]
    pub(crate) recommended: ObfError,
    pub(crate) by_channel: Vec<ChannelError>,
    /// The paper's polynomial at the paper's positions.
    pub(crate) paper_polynomial: ObfError,
    /// Chebyshev interpolant of the same order: it has an LFR.
    pub(crate) chebyshev: ObfError,
    /// From exact responses, relative weights, on poles that FKcM chose: no noise, every line alike.
    pub(crate) noise_free: ObfError,
    /// Weighted cost over its expectation with the pure covariance as weight: how far above the noise the truncation is.
    pub(crate) cost_over_expected: f64,
}

/// Lines of the tables over n_g: enough for the fit, few enough for 49 fits.
const TABLE_LINES: usize = 1500;

/// Basis functions of the paper's model.
const FUNCTIONS: usize = 16;

/// The models of Sec. IV-E at n_g = 16, and the table over n_g and interpolations.
pub(crate) fn obf(
    bench: &Bench,
    stage: &PoleStage,
    estimates: &[FrfEstimate],
    grid: &TestGrid,
) -> Result<ObfStage, TaskError> {
    let config = IdentifyConfig {
        seed: bench.seed,
        polish: Polish::None,
        ..IdentifyConfig::default()
    };
    let basis = choose_basis(&stage.fits, &bench.positions, bench.clock, FUNCTIONS, &config)?;
    let fits = regress_on(estimates, &basis, RigidTerms::Constant, &config)?;
    let leave_one_out = fits.leave_one_out(&candidates(&fits, bench.size.order))?;
    let best = recommend(&leave_one_out, 1.0)
        .ok_or("leave-one-out found no interpolation")?
        .interpolation;
    let recommended = fits.interpolate(best)?;
    let paper = fits.interpolate(Interpolation::Polynomial {
        order: bench.size.order,
    })?;
    let chebyshev = fits.interpolate(Interpolation::Chebyshev {
        order: bench.size.order,
    })?;

    let responses = recommended.responses(grid.positions.iter().copied(), &grid.frequencies_hz)?;
    let mut by_channel = Vec::new();
    for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        let (strict_max_db, median_db) = channel_error(&responses, &grid.truth, i, j)?;
        by_channel.push(ChannelError {
            channel: format!("y{} u{}", i + 1, j + 1),
            strict_max_db,
            median_db,
        });
    }
    let pure = IdentifyConfig {
        model_error: Some(0.0),
        ..config.clone()
    };
    let few = thinned(estimates, TABLE_LINES);
    let ratio: Vec<f64> = regress_on(&few, &basis, RigidTerms::Constant, &pure)?
        .fits()
        .iter()
        .map(|f| f.cost / (f.equations - f.unknowns) as f64)
        .collect();
    let account = ObfAccount {
        recommended: ObfError::new(&recommended, grid)?,
        by_channel,
        paper_polynomial: ObfError::new(&paper, grid)?,
        chebyshev: ObfError::new(&chebyshev, grid)?,
        noise_free: noise_free(bench, &basis.basis, grid)?,
        cost_over_expected: median(ratio),
    };
    let table = table(bench, stage, &few, grid)?;
    Ok(ObfStage {
        recommended,
        paper,
        chebyshev,
        leave_one_out,
        account,
        table,
    })
}

/// The interpolations of the tables.
fn candidates(fits: &LocalFits, order: usize) -> Vec<Interpolation> {
    let positions = fits.positions();
    let spacing = positions[1][0] - positions[0][0];
    vec![
        Interpolation::Polynomial { order: 7 },
        Interpolation::Polynomial { order: 11 },
        Interpolation::Polynomial { order },
        Interpolation::Chebyshev { order },
        Interpolation::Spline,
        Interpolation::GaussianProcess {
            length_scale: 6.0 * spacing,
        },
        Interpolation::Linear,
    ]
}

fn thinned(estimates: &[FrfEstimate], lines: usize) -> Vec<FrfEstimate> {
    estimates
        .iter()
        .map(|e| {
            let step = e.frf().len().div_ceil(lines);
            e.select(|k, _| k % step == 0)
        })
        .collect()
}

fn noise_free(bench: &Bench, basis: &OrthonormalBasis, grid: &TestGrid) -> Result<ObfError, TaskError> {
    let exact = bench
        .positions
        .iter()
        .map(|&p| {
            Ok(FrfEstimate::with_unit_covariance(
                bench.truth(p, &grid.frequencies_hz)?,
                Some(p.into()),
            )?)
        })
        .collect::<Result<Vec<_>, TaskError>>()?;
    let settings = RegressionSettings {
        rigid_body: RigidTerm::diagonal(2),
        weighting: Weighting::Relative,
        ..RegressionSettings::default()
    };
    let fits = regress(&exact, basis.state_space(), &settings)?;
    ObfError::new(&fits.interpolate(Interpolation::Spline)?, grid)
}

fn table(
    bench: &Bench,
    stage: &PoleStage,
    estimates: &[FrfEstimate],
    grid: &TestGrid,
) -> Result<Vec<ObfError>, TaskError> {
    debug_assert!(bench.size.functions.contains(&CHOSEN_FUNCTIONS));
    let of_size = |&functions: &usize| -> Result<Vec<ObfError>, TaskError> {
        let config = IdentifyConfig {
            seed: bench.seed,
            polish: Polish::None,
            ..IdentifyConfig::default()
        };
        let basis = choose_basis(&stage.fits, &bench.positions, bench.clock, functions, &config)?;
        let fits = regress_on(estimates, &basis, RigidTerms::Constant, &config)?;
        candidates(&fits, bench.size.order)
            .par_iter()
            .map(|&kind| ObfError::new(&fits.interpolate(kind)?, grid))
            .collect()
    };
    let rows = bench.size.functions.par_iter().with_max_len(1).map(of_size);
    Ok(rows.collect::<Result<Vec<_>, _>>()?.concat())
}

/// Figures on the direct LFR.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct LfrAccount {
    /// Largest relative difference between the frozen responses of the LFR and of the LPV-OBF model.
    pub(crate) direct_max_rel: f64,
    pub(crate) states: usize,
    pub(crate) deltas: usize,
    /// Well-posedness over the range: proven, with this margin.
    pub(crate) well_posed_margin: f64,
}

/// The direct LFR of the paper's polynomial model and of the Chebyshev one.
pub(crate) fn lfr(stage: &ObfStage, grid: &TestGrid) -> Result<(Realization, LfrAccount), TaskError> {
    let frequencies: Vec<f64> = grid.frequencies_hz.iter().copied().step_by(8).collect();
    let difference = |model: &LpvObfModel| -> Result<(Realization, f64), TaskError> {
        let made = realize(&model.series()?)?;
        let largest = grid
            .positions
            .par_iter()
            .map(|&p| {
                let own = made.lfr.frozen(&[p])?.frequency_response(&frequencies)?;
                let errors = own.relative_error(&model.response(&[p], &frequencies)?)?;
                Ok(errors.into_iter().fold(0.0, f64::max))
            })
            .collect::<Result<Vec<f64>, TaskError>>()?;
        Ok((made, largest.into_iter().fold(0.0, f64::max)))
    };
    let (paper, chebyshev) = rayon::join(|| difference(&stage.paper), || difference(&stage.chebyshev));
    let ((_, paper), (made, chebyshev)) = (paper?, chebyshev?);
    let well_posed_margin = match made.well_posedness {
        WellPosedness::Proven { margin } => margin,
        _ => f64::NAN,
    };
    let account = LfrAccount {
        direct_max_rel: paper.max(chebyshev),
        states: made.lfr.states(),
        deltas: made.lfr.delta_count(),
        well_posed_margin,
    };
    Ok((made, account))
}
