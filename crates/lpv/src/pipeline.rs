//! Frequency responses in, validated model out: the steps of the paper, in order. Nothing here knows where the data came
//! from.

mod series;
mod worth;

use crate::PipelineError;
use crate::basis::{BasisStage, choose_basis};
use crate::config::{IdentifyConfig, LfrKind};
use crate::modes::modal;
use crate::moves::Moves;
use crate::poles::{PoleStage, RigidTerms, Undetermined, fit_poles};
use crate::progress::{Progress, begin};
use crate::small::{SmallStage, small_lfr};
use lfr_realize::{Realization, realize};
use lpv_core::{Discrete, Frf, FrfEstimate, Model, StateSpace, WellPosedness, counted};
use lpv_ident::{Interpolation, LeaveOneOut, LocalFits, LpvObfModel, recommend};
use lpv_numerics::statistics::{amplitude_db, median};
use modal_fit::ModalFit;
pub use series::regress_on;
use series::{MOST_INTEGRATORS, TOO_MANY};
use worth::worth;

/// A model of a machine that moves: every stage with its account.
#[derive(Debug, Clone)]
pub struct LpvStage {
    /// Poles.
    pub poles: PoleStage,
    /// Basis.
    pub basis: BasisStage,
    /// Regression at every position.
    pub fits: LocalFits,
    /// Leave-one-out table; empty with fewer than four positions.
    pub leave_one_out: Vec<LeaveOneOut>,
    /// The model.
    pub model: LpvObfModel,
    /// Its LFR, where the interpolation has one.
    pub realization: Option<Realization>,
    /// The small LFR, where one was asked for and found.
    pub small: Option<SmallStage>,
    /// Why each choice was made.
    pub reasons: Vec<String>,
}

/// A model of a machine at one operating point.
#[derive(Debug, Clone)]
pub struct LtiStage {
    /// Poles, numerators, and the scan.
    pub poles: PoleStage,
    /// The minimal modal model of several inputs and outputs; none where the common denominator is as small, or where it does not
    /// explain the response as well.
    pub modal: Option<ModalFit>,
    /// State space: that of the modal model, else of the common denominator.
    pub model: StateSpace<Discrete>,
    /// What the lines leave open, where another fit describes them about as shortly.
    pub undetermined: Option<Undetermined>,
}

/// What identification delivers.
#[derive(Debug, Clone)]
pub enum Identified {
    /// Several positions.
    Lpv(Box<LpvStage>),
    /// One position.
    Lti(Box<LtiStage>),
}

impl Identified {
    /// The model for the file: the small LFR where there is one, else the exact one, else the series expansion; a state
    /// space for one position.
    ///
    /// # Errors
    /// None for a model of this pipeline.
    pub fn model(&self) -> Result<Model, PipelineError> {
        Ok(match self {
            Self::Lti(stage) => Model::DiscreteStateSpace(stage.model.clone()),
            Self::Lpv(stage) => match (&stage.small, &stage.realization) {
                (Some(small), _) => Model::ContinuousLfr(small.lfr.clone()),
                (None, Some(r)) => Model::DiscreteLfr(r.lfr.clone()),
                (None, None) => Model::SeriesExpansion(stage.model.series()?),
            },
        })
    }

    /// Response of the model at a constant position.
    ///
    /// # Errors
    /// A position outside the range.
    pub fn response(
        &self,
        position: f64,
        frequencies_hz: &[f64],
        clock: Discrete,
    ) -> Result<Frf, PipelineError> {
        Ok(match self {
            Self::Lti(stage) => match &stage.modal {
                Some(modal) => modal.model.frequency_response(frequencies_hz)?,
                None => stage.poles.fits[0].response(frequencies_hz)?,
            },
            Self::Lpv(stage) => match &stage.small {
                Some(small) => small.response(position, frequencies_hz, clock)?,
                None => stage.model.response(&[position], frequencies_hz)?,
            },
        })
    }

    /// What the samples of a machine with the direct term of this model have responded, which is what it is held against.
    pub(crate) fn compared(&self, estimates: Vec<FrfEstimate>) -> Vec<FrfEstimate> {
        match self {
            Self::Lti(stage) => estimates
                .iter()
                .map(|e| e.beside_direct(stage.model.d()))
                .collect(),
            Self::Lpv(_) => estimates,
        }
    }

    /// What the lines of one position leave open, where that matters.
    pub fn undetermined(&self) -> Option<&Undetermined> {
        match self {
            Self::Lti(stage) => stage.undetermined.as_ref().filter(|u| u.matters()),
            Self::Lpv(_) => None,
        }
    }

    /// The poles at every position.
    pub fn poles(&self) -> &PoleStage {
        match self {
            Self::Lpv(stage) => &stage.poles,
            Self::Lti(stage) => &stage.poles,
        }
    }

    /// The choices in words.
    pub fn reasons(&self) -> &[String] {
        match self {
            Self::Lpv(stage) => &stage.reasons,
            Self::Lti(stage) => &stage.poles.reasons,
        }
    }
}

/// The whole chain from frequency responses at one or several positions; records along a moving p serve the small LFR.
///
/// # Errors
/// Those of the stages.
pub fn identify(
    estimates: &[FrfEstimate],
    clock: Discrete,
    moves: &Moves,
    config: &IdentifyConfig,
    progress: Progress<'_>,
) -> Result<Identified, PipelineError> {
    if estimates.len() > 1 && config.integrators.is_some_and(|count| count > MOST_INTEGRATORS) {
        return Err(TOO_MANY);
    }
    begin(progress, "poles of the responses");
    let mut poles = fit_poles(estimates, clock, config)?;
    let outside: usize = poles.fits.iter().map(|f| f.account.unstable_poles.len()).sum();
    if outside > 0 {
        poles.reasons.push(format!(
            "warning: {} on or outside the unit circle; set `order`, use more periods, or look for distortion with `lpv inspect --lines`",
            counted(outside, "estimated pole")
        ));
    }
    if estimates.len() == 1 {
        begin(progress, "modes");
        let direct = poles.fits[0].state_space()?.d().clone();
        let modal = modal(&estimates[0].beside_direct(&direct), clock, &mut poles);
        let model = match &modal {
            Some(modal) => modal.model.clone(),
            None => poles.fits[0].state_space()?,
        };
        let undetermined = poles.undetermined(&model, estimates[0].frf().frequencies_hz())?;
        return Ok(Identified::Lti(Box::new(LtiStage {
            poles,
            modal,
            model,
            undetermined,
        })));
    }
    if let Some(rigid) = &poles.rigid {
        poles
            .reasons
            .extend(rigid.lines(poles.slow_poles, poles.rigid_terms() != RigidTerms::Constant));
    }
    let position = |e: &FrfEstimate| e.single_position().unwrap_or(0.0);
    let positions: Vec<f64> = estimates.iter().map(position).collect();
    let mut reasons = poles.reasons.clone();
    begin(progress, "basis");
    let basis = match config.functions {
        Some(functions) => choose_basis(&poles.fits, &positions, clock, functions, config)?,
        None => choose_size(
            estimates,
            &poles,
            &positions,
            clock,
            config,
            (&mut reasons, progress),
        )?,
    };
    begin(progress, "regression and interpolation");
    reasons.push(format!(
        "{} basis functions: FKcM reaches an n-width cost of {:.2} dB on the estimated poles{}",
        basis.basis.functions(),
        basis.fkcm.cost_db,
        basis.polish.as_ref().map_or(String::new(), |p| format!(
            "; between positions {:.2} dB, {:.2} dB after the minimax polish",
            p.start_cost_db, p.cost_db
        ))
    ));
    let fits = regress_on(estimates, &basis, poles.rigid_terms(), config)?;
    let (leave_one_out, interpolation, why) = choose_interpolation(&fits, config)?;
    reasons.push(why);
    let model = fits.interpolate(interpolation)?;
    let realization = if interpolation.is_polynomial() {
        Some(realize(&model.series()?)?)
    } else {
        None
    };
    reasons.push(match &realization {
        Some(r) => format!(
            "exact LFR: {} states, {} deltas, {}",
            r.lfr.states(),
            r.lfr.delta_count(),
            well_posedness(&r.well_posedness)
        ),
        None => "no LFR: these coefficient functions are not polynomials; the model file holds the series expansion".to_owned(),
    });
    let small = match config.lfr {
        LfrKind::Exact => None,
        LfrKind::Small => match small_lfr(estimates, &poles, clock, moves, config, progress)? {
            Ok(found) => {
                reasons.extend(found.reasons.iter().cloned());
                worth(found, &model, estimates, clock, &mut reasons)?
            }
            Err(why) => {
                reasons.push(why);
                None
            }
        },
    };
    Ok(Identified::Lpv(Box::new(LpvStage {
        small,
        poles,
        basis,
        fits,
        leave_one_out,
        model,
        realization,
        reasons,
    })))
}

fn well_posedness(found: &WellPosedness) -> String {
    match found {
        WellPosedness::Proven { margin } => {
            format!("well-posed over the whole range, proven with a margin of {margin:.2}")
        }
        WellPosedness::Sampled { smallest } => {
            format!("well-posed at all points tried, smallest reciprocal condition number {smallest:.1e}")
        }
        WellPosedness::Fails { p } => format!("not well-posed: singular at p = {p:?}"),
    }
}

/// Numbers of basis functions that are tried where none is given.
const SIZES: [usize; 6] = [4, 8, 12, 16, 20, 24];

/// What the truncated basis leaves out should be this far below the noise of the responses: a tenth.
const BELOW_NOISE_DB: f64 = 20.0;

/// The smallest basis whose n-width cost lies well below the noise of the responses, or the largest tried.
fn choose_size(
    estimates: &[FrfEstimate],
    poles: &PoleStage,
    positions: &[f64],
    clock: Discrete,
    config: &IdentifyConfig,
    (reasons, progress): (&mut Vec<String>, Progress<'_>),
) -> Result<BasisStage, PipelineError> {
    let deviations: Vec<f64> = estimates
        .iter()
        .flat_map(|e| (0..e.frf().len()).map(|k| e.relative_deviation(k)))
        .collect();
    let noise_db = amplitude_db(median(&deviations));
    let mut tried = Vec::new();
    let mut reached = false;
    let mut chosen: Option<BasisStage> = None;
    for (done, functions) in SIZES.into_iter().enumerate() {
        progress("size of the basis", done, SIZES.len());
        let found = match choose_basis(&poles.fits, positions, clock, functions, config) {
            Ok(found) => found,
            // A size that one of the next can replace is no reason to stop.
            Err(_) if functions != SIZES[SIZES.len() - 1] || chosen.is_some() => continue,
            Err(refused) => return Err(refused),
        };
        tried.push(format!("{functions}: {:.1} dB", found.cost_db));
        let enough = found.cost_db <= noise_db - BELOW_NOISE_DB;
        chosen = Some(found);
        if enough {
            reached = true;
            break;
        }
    }
    reasons.push(format!(
        "size of the basis: what it leaves out ({}) should be a tenth of the noise of the responses ({noise_db:.1} dB){}",
        tried.join(", "),
        if reached { "" } else { "; not reached, the largest is taken: `functions` allows more" }
    ));
    chosen.ok_or(PipelineError::Structure {
        problem: "no size of the basis could be tried; set `functions`",
    })
}

/// Highest polynomial order that is tried.
const MOST_ORDER: usize = 18;

/// Leave-one-out costs within this factor of the best count as equal; the first of them in the table is taken.
const SLACK: f64 = 1.05;

fn choose_interpolation(
    fits: &LocalFits,
    config: &IdentifyConfig,
) -> Result<(Vec<LeaveOneOut>, Interpolation, String), PipelineError> {
    let positions = fits.positions().len();
    if let Some(kind) = config.interpolation {
        let interpolation = Interpolation::from(kind);
        return Ok((
            Vec::new(),
            interpolation,
            format!("interpolation: {} as asked", interpolation.name()),
        ));
    }
    if positions < 4 {
        let interpolation = Interpolation::Polynomial { order: positions - 1 };
        let why = format!(
            "interpolation: {}; too few positions to leave one out",
            interpolation.name()
        );
        return Ok((Vec::new(), interpolation, why));
    }
    let table = fits.leave_one_out(&fits.candidates(MOST_ORDER))?;
    let with_lfr: Vec<LeaveOneOut> = table
        .iter()
        .filter(|e| e.interpolation.is_polynomial())
        .cloned()
        .collect();
    let chosen = recommend(&with_lfr, SLACK).ok_or(PipelineError::Structure {
        problem: "leave-one-out gave no finite cost; check the positions",
    })?;
    let best = recommend(&table, 1.0).unwrap_or(chosen);
    let why = format!(
        "interpolation: {} (leave-one-out cost {:.3e} an equation; the best of all kinds is {} with {:.3e})",
        chosen.interpolation.name(),
        chosen.cost,
        best.interpolation.name(),
        best.cost
    );
    let interpolation = chosen.interpolation;
    Ok((table, interpolation, why))
}
