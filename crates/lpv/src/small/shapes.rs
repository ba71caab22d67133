//! The small LFR of a machine whose poles do not depend on p.

use super::local::Body;
use super::{BetweenPositions, MISSED, MovingStage, SizeRow, SmallStage};
use crate::PipelineError;
use crate::moves::Moves;
use crate::progress::{Progress, begin};
use lfr_fit::moving::{MovingData, refine_with_moves, simulate_errors};
use lfr_fit::{
    Candidate, ConstantPoles, FitError, FrozenData, GrowSettings, RefineSettings, Refined, ShapesAt, Units,
    constant_poles, refine,
};
use lpv_core::{Continuous, SchedulingRange};

/// Joint iterations on responses and records.
const ITERATIONS: usize = 8;

/// Residual of the responses over that before the records beyond which they have spoilt it.
const SPOILT: f64 = 1.2;

/// Fits it, or gives nothing where the poles move. `enough`: the residual of all lines that is noise.
pub(super) fn shapes(
    data: &FrozenData,
    body: Body,
    (units, range): (&Units, &SchedulingRange),
    (enough, settings): (Option<f64>, &GrowSettings),
    moves: &Moves,
    progress: Progress<'_>,
) -> Result<Option<SmallStage>, PipelineError> {
    let rigid = match body {
        Body::Absent => false,
        Body::Constant | Body::Varying => true,
        Body::Friction | Body::Decoupled => return Ok(None),
    };
    begin(progress, "small LFR: constant poles");
    let Some(found) = constant_poles(data, rigid, range, settings)? else {
        return Ok(None);
    };
    let fit = &found.refined;
    let mut reasons = moves.reasons.clone();
    reasons.push(account(&found));
    begin(progress, "small LFR: all lines");
    let as_it_is = RefineSettings {
        max_iterations: 0,
        ..RefineSettings::default()
    };
    let mut whole = refine(&fit.candidate, data, &as_it_is)?;
    // More than noise, which functions of p of another kind may explain.
    if enough.is_some_and(|enough| whole.account.rms > enough) {
        return Ok(None);
    }
    let mut moving = None;
    begin(progress, "small LFR: coordinates along the moves");
    match &moves.data {
        Err(why) => reasons.push(format!("moving records: none, {why}{}", coordinates(&found))),
        Ok(moves) => {
            let moves = units.moves(moves)?;
            let (candidate, stage) = along(fit, &found.few, &moves)?;
            let shown = |error: Option<f64>| {
                error.map_or_else(
                    || "beyond bounds".to_owned(),
                    |e| format!("{e:.3} times the noise"),
                )
            };
            let [own, _, joint] = stage.over_noise;
            reasons.push(format!(
                "moving records: error {} with the fit to the responses, {} after the joint refinement",
                shown(own),
                shown(joint)
            ));
            if joint.is_none_or(|e| e > MISSED) {
                reasons.push(format!(
                    "warning: moving records are not explained to their noise{}",
                    coordinates(&found)
                ));
            }
            if candidate != fit.candidate {
                whole = refine(&candidate, data, &as_it_is)?;
            }
            moving = Some(stage);
        }
    }
    let fit = units.undo(whole)?;
    let (between, words) = between(&found, data, units);
    reasons.extend(words);
    Ok(Some(SmallStage {
        lfr: fit.candidate.to_lfr()?,
        sizes: found
            .sizes
            .iter()
            .map(|(deltas, residual)| SizeRow {
                states: fit.candidate.states(),
                deltas: *deltas,
                residual: *residual,
                starts: 1,
            })
            .collect(),
        at_noise: true,
        between,
        fit,
        moving,
        reasons,
    }))
}

fn account(found: &ConstantPoles) -> String {
    let shapes = match found.shapes {
        ShapesAt::Outputs => "C is a function of p",
        ShapesAt::Inputs => "B is a function of p",
        ShapesAt::Both => "B and C are functions of p",
    };
    let rigid = match found.rank {
        0 => String::new(),
        rank => format!(", a rigid body of rank {rank} among them"),
    };
    let residuals: Vec<String> = found
        .sizes
        .iter()
        .map(|(deltas, rms)| format!("{deltas}: {rms:.3}"))
        .collect();
    format!(
        "small LFR: the poles do not depend on p, {shapes}: {} states{rigid}, residual over the noise of the responses by deltas ({}); polynomials of degree {} are the start",
        found.refined.candidate.states(),
        residuals.join(", "),
        found.degree
    )
}

/// What is known of the coordinates without records.
fn coordinates(found: &ConstantPoles) -> &'static str {
    let candidate = &found.refined.candidate;
    // One input sees no direction: B of one column is constant in some coordinates, whatever the machine does.
    let told = match found.shapes {
        ShapesAt::Outputs => candidate.inputs() > found.rank.max(1),
        ShapesAt::Inputs => candidate.outputs() > found.rank.max(1),
        ShapesAt::Both => false,
    };
    match told {
        true => {
            "; with constant poles, and B or C constant, the state coordinates are those of a machine with constant modes"
        }
        false => {
            "; responses leave the scale of each mode over p open here: the model is known for slow p only"
        }
    }
}

/// The model along the records, refined on both where it misses them.
fn along(
    fit: &Refined<Continuous>,
    few: &FrozenData,
    moves: &MovingData,
) -> Result<(Candidate<Continuous>, MovingStage), FitError> {
    let candidate = &fit.candidate;
    let own = match simulate_errors(candidate, moves) {
        Ok(errors) => {
            let squares: f64 = errors
                .iter()
                .flat_map(|e| {
                    e.row_iter()
                        .zip(moves.noise())
                        .map(|(row, noise)| row.norm_squared() / noise.powi(2))
                        .collect::<Vec<_>>()
                })
                .sum();
            Some((squares / moves.equations() as f64).sqrt())
        }
        Err(FitError::Moving { .. }) => None,
        Err(other) => return Err(other),
    };
    let direct = |c: &Candidate<Continuous>| {
        let n = c.states();
        let seen = (0..c.channels().len())
            .filter(|j| (0..c.outputs()).any(|i| c.free()[(n + i, n + c.inputs() + j)]));
        let outputs = seen.count();
        [0, outputs, c.channels().len() - outputs]
    };
    let stage = |over_noise| MovingStage {
        deltas: direct(candidate),
        over_noise,
        frozen_residual: fit.account.rms,
    };
    let Some(own) = own else {
        return Ok((candidate.clone(), stage([None; 3])));
    };
    if own > MISSED {
        let settings = RefineSettings {
            max_iterations: ITERATIONS,
            tolerance: 1e-3,
            ..RefineSettings::default()
        };
        match refine_with_moves(candidate, few, moves, &settings) {
            Ok(joint) if joint.account.frozen_rms[1] <= SPOILT * fit.account.rms => {
                let over_noise = [Some(own), Some(own), Some(joint.account.moving_rms[1])];
                let account = MovingStage {
                    frozen_residual: joint.account.frozen_rms[1],
                    ..stage(over_noise)
                };
                return Ok((joint.candidate, account));
            }
            Ok(_) | Err(FitError::Moving { .. }) => {}
            Err(other) => return Err(other),
        }
    }
    Ok((candidate.clone(), stage([Some(own); 3])))
}

/// What the positions support between them: the worst pair of neighbours, and all of it in words.
fn between(
    found: &ConstantPoles,
    data: &FrozenData,
    units: &Units,
) -> (Option<BetweenPositions>, Option<String>) {
    if data.len() < 4 {
        let few = format!(
            "warning: {} positions do not tell how well the model holds between them; measure at four or more",
            data.len()
        );
        return (None, Some(few));
    }
    let worst = found
        .between
        .iter()
        .max_by(|a, b| a.over_noise.total_cmp(&b.over_noise));
    let place = |at: usize| data.scheduling().nth(at).map_or(0.0, |p| units.undo_places(p)[0]);
    let Some(worst) = worst.map(|w| BetweenPositions {
        positions: w.positions.map(place),
        over_noise: w.over_noise,
        error_percent: 100.0 * w.part,
    }) else {
        return (None, None);
    };
    let expected = format!(
        "{:.2} times the noise of the responses at them, {:.2} % of the response, if B and C are as smooth as the positions say: most between \
         {:.5} and {:.5}",
        worst.over_noise, worst.error_percent, worst.positions[0], worst.positions[1]
    );
    let words = match worst.is_missed() {
        true => format!(
            "warning: between positions the model is expected to err by up to {expected}; measure there too"
        ),
        false => format!("between positions: expected to err by at most {expected}"),
    };
    (Some(worst), Some(words))
}
