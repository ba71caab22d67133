//! The low-order LFR: the flexible part with the smallest number of deltas whose residual reaches the noise, in parameter-independent state coordinates.

mod between;
mod data;
mod local;
mod shapes;

use crate::PipelineError;
use crate::config::IdentifyConfig;
use crate::moves::Moves;
use crate::poles::PoleStage;
use crate::progress::{Progress, begin};
pub use between::BetweenPositions;
use between::{between, coarse};
use data::{expected_residuals, frozen_data};
use lfr_fit::moving::{MovingData, StaticLfr, StaticLfrSettings, fit_static};
use lfr_fit::{
    FitError, FrozenData, GainFit, GrowSettings, Grown, RefineSettings, Refined, ResidualUnit, StartKind,
    Units, grow_sizes, merge_lines, refine,
};
use lfr_realize::RealizeError;
use local::{Body, Local};
use lpv_core::num_complex::Complex;
use lpv_core::{Continuous, DeltaBlock, Discrete, Frf, FrfEstimate, Lfr, SchedulingRange};
use pole_fit::PoleFit;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use shapes::shapes;

/// A small LFR with its account.
#[derive(Debug, Clone)]
pub struct SmallStage {
    /// The model.
    pub lfr: Lfr<Continuous>,
    /// Sizes that were tried, in order.
    pub sizes: Vec<SizeRow>,
    /// The fit to the frozen responses, with its covariance.
    pub fit: Refined<Continuous>,
    /// What the moving records added; none without them.
    pub moving: Option<MovingStage>,
    /// Whether the residual of the frozen responses is their noise.
    pub at_noise: bool,
    /// What is to be expected between the positions, where they tell.
    pub between: Option<BetweenPositions>,
    /// The choices in words.
    pub reasons: Vec<String>,
}

/// One size.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SizeRow {
    /// States.
    pub states: usize,
    /// Deltas.
    pub deltas: usize,
    /// Rms residual of the frozen responses, in units of their deviation; relative where they have none.
    pub residual: f64,
    /// Starts that it took.
    pub starts: usize,
}

/// What records along a moving p added.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MovingStage {
    /// Deltas of the inner forces, of the outputs, and of the accelerations.
    pub deltas: [usize; 3],
    /// Rms error along the records in units of the noise of a sample: the frozen model, with its coordinates turned, and
    /// after the joint refinement; none where the frozen model runs away from them.
    pub over_noise: [Option<f64>; 3],
    /// Rms residual of the frozen responses after it.
    pub frozen_residual: f64,
}

/// Numbers of deltas that are tried.
const DELTAS: std::ops::RangeInclusive<usize> = 1..=6;

/// Residuals up to this many times what noise alone leaves are noise.
const AT_NOISE: f64 = 1.1;

/// An error along moving records above this many times what coordinates that turn freely leave is worth a warning.
const MISSED: f64 = 1.3;

/// Poles with more damping belong to no mode.
pub(crate) const MOST_DAMPING: f64 = 0.5;

/// Fits a small LFR, or says why there is none.
///
/// # Errors
/// Failures of the numerics. A machine that the structure does not fit is a reason, not an error.
pub fn small_lfr(
    estimates: &[FrfEstimate],
    poles: &PoleStage,
    clock: Discrete,
    moves: &Moves,
    config: &IdentifyConfig,
    progress: Progress<'_>,
) -> Result<Result<SmallStage, String>, PipelineError> {
    let positions: Vec<f64> = estimates
        .iter()
        .map(|e| e.single_position().unwrap_or(0.0))
        .collect();
    let (low, high) = lpv_numerics::statistics::range(&positions);
    let units = Units::of(clock, &SchedulingRange::interval(low, high)?, estimates)?;
    match attempt(estimates, poles, (clock, &units), moves, config, progress) {
        Ok(stage) => Ok(Ok(stage)),
        Err(PipelineError::Fit(refused) | PipelineError::Realize(RealizeError::Fit(refused))) => {
            let refused = units.undo_error(refused);
            Ok(Err(format!("no small LFR: {refused}")))
        }
        Err(other) => Err(other),
    }
}

/// In units in which everything has size one, so that the result does not depend on those of the data.
fn attempt(
    estimates: &[FrfEstimate],
    poles: &PoleStage,
    (clock, units): (Discrete, &Units),
    moves: &Moves,
    config: &IdentifyConfig,
    progress: Progress<'_>,
) -> Result<SmallStage, PipelineError> {
    let scaled = estimates
        .iter()
        .map(|e| units.scaled(e))
        .collect::<Result<Vec<_>, _>>()?;
    let positions: Vec<f64> = scaled
        .iter()
        .map(|e| e.single_position().unwrap_or(0.0))
        .collect();
    let range = units.range()?;
    let known: Vec<Vec<Complex<f64>>> = poles.fits.iter().map(modes_of).collect();
    let data = &frozen_data(&scaled, &positions, units.clock()?, poles.relative_error)?.with_poles(&known)?;
    // Of two that are equally far from the middle, the first, whatever rounding says.
    let off = |i: usize| (positions[i].abs() * 1e9).round();
    let nearest = (0..positions.len())
        .min_by(|&a, &b| off(a).total_cmp(&off(b)))
        .unwrap_or(0);
    let middle = data.subset(|p| p[0] == positions[nearest])?;
    let modes = modes_of(&poles.fits[nearest]);
    if modes.is_empty() {
        return Err(FitError::Empty {
            what: "lightly damped modes at the middle position",
        }
        .into());
    }
    let body = Body::of(poles)?;
    let mut reasons = moves.reasons.clone();
    // The gain of the rigid body comes from the middle position; the others know it better together.
    let mut settings = GrowSettings {
        seed: config.seed,
        gain: GainFit::Free,
        ..GrowSettings::default()
    };
    let mut enough = None;
    if data.unit() == ResidualUnit::StandardDeviation {
        let [single, merged] = expected_residuals(estimates);
        settings.target = Some(AT_NOISE * merged);
        enough = Some(AT_NOISE * single);
    }
    let deltas: Vec<Vec<DeltaBlock>> = DELTAS
        .map(|repetitions| {
            vec![DeltaBlock {
                parameter: 0,
                repetitions,
            }]
        })
        .collect();
    if let Some(stage) = shapes(data, body, (units, &range), (enough, &settings), moves, progress)? {
        return Ok(stage);
    }
    begin(progress, "small LFR: the middle position");
    let local = Local::new(&middle, (&scaled[nearest], units.clock()?), &modes, body)?;
    begin(progress, "small LFR: numbers of deltas");
    let few = merge_lines(&local.model, local.rigid(), data, &range, &settings)?;
    let mut tried = grow_sizes(&local.model, local.rigid(), &few, &deltas, &range, &settings)?;
    let sizes: Vec<SizeRow> = tried.grown.iter().map(SizeRow::new).collect();
    let best = tried.grown.swap_remove(tried.chosen);
    begin(progress, "small LFR: all lines");
    // Merged lines leave more than all lines do, which decide.
    let as_it_is = RefineSettings {
        max_iterations: 0,
        ..RefineSettings::default()
    };
    let mut whole = refine(&best.refined.candidate, data, &as_it_is)?;
    if enough.is_some_and(|enough| whole.account.rms > enough) {
        whole = refine(&whole.candidate, data, &RefineSettings::default())?;
    }
    let reached = best.reached && enough.is_none_or(|enough| whole.account.rms <= enough);
    let residuals: Vec<String> = sizes
        .iter()
        .map(|s| match s.residual {
            large if large >= 1e4 => format!("{}: {large:.1e}", s.deltas),
            residual => format!("{}: {residual:.3}", s.deltas),
        })
        .collect();
    let won = best.starts.get(best.winner).map_or("", |s| start_name(&s.kind));
    reasons.push(format!(
        "small LFR: {} states{}, residual over the noise of the responses by deltas ({}); the {won} start won{}",
        best.refined.candidate.states(),
        body.words(),
        residuals.join(", "),
        if reached { "" } else { "; the noise is not reached" }
    ));
    if !reached {
        // Coordinates for moves would be those of a model that misses its own data.
        let places: Vec<f64> = positions.iter().map(|p| units.undo_places(&[*p])[0]).collect();
        let modes: Vec<_> = poles.fits.iter().map(modes_of).collect();
        reasons.extend(coarse(&modes, &places));
        let fit = units.undo(to_the_end(&whole, data)?)?;
        return Ok(SmallStage {
            lfr: fit.candidate.to_lfr()?,
            sizes,
            fit,
            moving: None,
            at_noise: false,
            between: None,
            reasons,
        });
    }
    let (mut fit, mut moving) = (best.refined, None);
    let slow = slow(&modes, units, clock);
    begin(progress, "small LFR: coordinates along the moves");
    match (&moves.data, body) {
        (Ok(_), Body::Absent) => reasons.push(format!("moving records: not used, the machine has no rigid body; {slow}")),
        (Ok(moves), _) => match standing(&fit, &few, &units.moves(moves)?, config.seed) {
            Ok(Some(found)) => {
                let account = MovingStage::new(&found);
                let [own, turned, joint] = account.over_noise.map(|error| {
                    error.map_or_else(|| "beyond bounds".to_owned(), |e| format!("{e:.3} times the noise"))
                });
                reasons.push(format!(
                    "moving records: error {own} with the coordinates of the frozen model, {turned} with parameter-dependent ones, {joint} after the joint refinement in parameter-independent coordinates ({} + {} + {} deltas); frozen residual {:.3}",
                    account.deltas[0],
                    account.deltas[1],
                    account.deltas[2],
                    account.frozen_residual
                ));
                let whole = refine(&found.candidate, data, &as_it_is)?;
                if enough.is_none_or(|enough| whole.account.rms <= enough) {
                    let [_, turned, joint] = account.over_noise;
                    if joint.is_none_or(|e| e > MISSED * turned.unwrap_or(1.0).max(1.0)) {
                        reasons.push(format!("warning: moving records are not explained to their noise; {slow}"));
                    }
                    fit = whole;
                    moving = Some(account);
                } else {
                    reasons.push(format!(
                        "its frozen responses miss their noise ({:.3} times it), so the frozen model is taken; {slow}",
                        whole.account.rms
                    ));
                }
            }
            Ok(None) => reasons.push(
                format!("moving records: no LFR of the mechanical structure explains the responses and the records; {slow}"),
            ),
            Err(refused) => reasons.push(format!("moving records: {refused}; {slow}")),
        },
        (Err(why), _) => reasons.push(format!("moving records: none, {why}; {slow}")),
    }
    if moving.is_none() {
        begin(progress, "small LFR: all lines");
        // All lines once more, where few were enough to come near.
        fit = refine(&whole.candidate, data, &RefineSettings::default())?;
        fit = to_the_end(&fit, data)?;
    }
    begin(progress, "small LFR: between the positions");
    if positions.len() >= 4 {
        between(&fit.candidate, &few, units, &mut reasons)?;
    } else {
        reasons.push(format!(
            "warning: {} positions do not tell how well the model holds between them; measure at four or more",
            positions.len()
        ));
    }
    let fit = units.undo(fit)?;
    Ok(SmallStage {
        lfr: fit.candidate.to_lfr()?,
        sizes,
        at_noise: true,
        between: None,
        fit,
        moving,
        reasons,
    })
}

/// The fit where another search would end too: what noise hides is large against rounding, and rounding may choose the way there.
fn to_the_end(fit: &Refined<Continuous>, data: &FrozenData) -> Result<Refined<Continuous>, FitError> {
    /// Relative decrease of the cost that counts as none.
    const NOTHING: f64 = 1e-10;
    /// Most iterations; a few do where the model fits.
    const ITERATIONS: usize = 30;
    let settings = RefineSettings {
        tolerance: NOTHING,
        to_the_end: true,
        max_iterations: ITERATIONS,
        ..RefineSettings::default()
    };
    refine(&fit.candidate, data, &settings)
}

/// The lightly damped poles of a fit.
fn modes_of(fit: &PoleFit) -> Vec<Complex<f64>> {
    let mut modes = fit.flexible_poles();
    modes.retain(|z| {
        let s = z.ln();
        z.im != 0.0 && s.re < 0.0 && -s.re <= MOST_DAMPING * s.norm()
    });
    modes
}

fn standing(
    fit: &Refined<Continuous>,
    few: &FrozenData,
    moves: &MovingData,
    seed: u64,
) -> Result<Option<StaticLfr>, FitError> {
    let settings = StaticLfrSettings {
        seed,
        ..StaticLfrSettings::default()
    };
    fit_static(fit, few, moves, &settings)
}

impl SmallStage {
    /// Response behind the hold at a constant position.
    ///
    /// # Errors
    /// A position outside the range.
    pub fn response(
        &self,
        position: f64,
        frequencies_hz: &[f64],
        clock: Discrete,
    ) -> Result<Frf, PipelineError> {
        Ok(self
            .lfr
            .frozen(&[position])?
            .zero_order_hold(clock)?
            .frequency_response(frequencies_hz)?)
    }
}

impl MovingStage {
    fn new(found: &StaticLfr) -> Self {
        Self {
            deltas: [found.split.forces, found.split.outputs, found.split.accelerations],
            over_noise: found.moving_rms,
            frozen_residual: found.frozen_rms,
        }
    }
}

/// What a model in the coordinates of frozen responses is good for. A basis that turns by about its own size over half the
/// range adds `(dp/dt) / half-width` to the state matrix; that should be small against the decay of the modes.
fn slow(modes: &[Complex<f64>], units: &Units, clock: Discrete) -> String {
    const SMALL: f64 = 0.1;
    let decay = modes
        .iter()
        .map(|z| -z.ln().re / clock.sample_time())
        .fold(f64::INFINITY, f64::min);
    format!(
        "the state coordinates are not the machine's, and the model is known for slow p only, |dp/dt| well below {:.2e} a second (a tenth of the decay of the modes over half the range)",
        SMALL * decay * (units.undo_places(&[1.0])[0] - units.undo_places(&[0.0])[0])
    )
}

fn start_name(kind: &StartKind) -> &'static str {
    match kind {
        StartKind::Coherent { .. } => "coherent",
        StartKind::Random { .. } => "random",
        _ => "smaller model's",
    }
}

impl SizeRow {
    fn new(grown: &Grown<Continuous>) -> Self {
        Self {
            states: grown.refined.candidate.states(),
            deltas: grown.refined.candidate.delta_count(),
            residual: grown.refined.account.rms,
            starts: grown.starts.len(),
        }
    }
}
