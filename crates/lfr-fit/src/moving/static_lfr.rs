//! From a frozen model and moving records to an LFR in parameter-independent state coordinates that explains both.

use super::{Jointly, MovingData, fit_transformation, refine_with_moves, static_dependence};
use crate::{
    Candidate, DeltaSplit, FitError, FrozenData, MechanicalForm, RefineSettings, Refined, ResidualUnit,
};
use lpv_core::Continuous;

/// How to find parameter-independent coordinates. What takes them checks every field against this table.
///
/// | field | default | meaning | range |
/// |---|---|---|---|
/// | `splits` | 1+0+0, 1+0+1, 1+1+1, 1+0+2, 1+1+2, 2+1+2 | where the deltas act, tried in this order | not empty |
/// | `degree` | 5 | of the polynomials of the state transformation's rate; too low a degree leaves an error that no LFR explains | 1 to 12 |
/// | `starts` | 2 | starts of each split | 1 to 1000 |
/// | `seed` | 0 | of the starts | |
/// | `iterations` | 2 | joint iterations on responses and records; more without noise | 1 to 1000 |
#[derive(Debug, Clone, PartialEq)]
pub struct StaticLfrSettings {
    /// Where the deltas act.
    pub splits: Vec<DeltaSplit>,
    /// Degree of the polynomials of the state transformation's rate.
    pub degree: usize,
    /// Starts of each split.
    pub starts: usize,
    /// Seed of the starts.
    pub seed: u64,
    /// Joint iterations.
    pub iterations: usize,
}

/// Forces, outputs and accelerations.
const SPLITS: [[usize; 3]; 6] = [[1, 0, 0], [1, 0, 1], [1, 1, 1], [1, 0, 2], [1, 1, 2], [2, 1, 2]];

impl Default for StaticLfrSettings {
    fn default() -> Self {
        let split = |[forces, outputs, accelerations]: [usize; 3]| DeltaSplit {
            forces,
            outputs,
            accelerations,
        };
        Self {
            splits: SPLITS.map(split).to_vec(),
            degree: 5,
            starts: 2,
            seed: 0,
            iterations: 2,
        }
    }
}

impl StaticLfrSettings {
    /// Checks every field against the table above.
    ///
    /// # Errors
    /// [`FitError::Setting`]; [`FitError::Empty`] without splits.
    pub fn check(&self) -> Result<(), FitError> {
        if self.splits.is_empty() {
            return Err(FitError::Empty { what: "splits" });
        }
        let within = |name, value: usize, most: usize, allowed| {
            FitError::unless((1..=most).contains(&value), name, value as f64, allowed)
        };
        within("degree", self.degree, 12, "give 1 to 12")?;
        within("starts", self.starts, 1000, "give 1 to 1000")?;
        within("iterations", self.iterations, 1000, "give 1 to 1000")?;
        Ok(())
    }
}

/// An LFR whose state coordinates are the machine's, as far as responses and records show.
#[derive(Debug, Clone, PartialEq)]
pub struct StaticLfr {
    /// The LFR.
    pub candidate: Candidate<Continuous>,
    /// Where its deltas act.
    pub split: DeltaSplit,
    /// Rms error along the records in units of the noise: of the frozen model, of the frozen model with a
    /// parameter-dependent state transformation, and of the LFR; none where the frozen model runs away from the records.
    pub moving_rms: [Option<f64>; 3],
    /// Rms residual of the frozen responses, in their unit.
    pub frozen_rms: f64,
}

/// A split whose frozen responses miss by more than this many times what the free model leaves is too small.
const NEAR: f64 = 2.0;

/// Residual of the responses over that of the free model beyond which the records have spoilt it.
const SPOILT: f64 = 1.2;

/// An error within this factor of what a free state transformation leaves has nothing left to explain.
const EXPLAINED: f64 = 1.05;

/// An error within this factor of it is worth more iterations, so many times those of the settings.
const PROMISING: f64 = 10.0;
const MORE: usize = 5;

/// Relative errors that count beside the noise: a model that is not near yet must not be decided by lines that are known
/// very well.
const TOLERANT: [f64; 3] = [0.05, 0.005, 5e-4];

/// [`fit_transformation`], [`static_dependence`] and [`refine_with_moves`] for one split after the other, until one explains the records; none
/// explains the responses: no result. `fit` and `data`: the frozen model and the responses, best in few lines (see
/// [`crate::merge_lines`]), since they are gone over many times.
///
/// # Errors
/// Those of [`MechanicalForm::new`] and of the three.
pub fn fit_static(
    fit: &Refined<Continuous>,
    data: &FrozenData,
    moves: &MovingData,
    settings: &StaticLfrSettings,
) -> Result<Option<StaticLfr>, FitError> {
    settings.check()?;
    let set = settings;
    let (mut stages, enough) = match data.unit() {
        ResidualUnit::StandardDeviation => {
            let tolerant = TOLERANT.map(|part| data.with_error_floor(part)).to_vec();
            (tolerant, NEAR * fit.account.rms)
        }
        ResidualUnit::Relative => (Vec::new(), f64::INFINITY),
    };
    stages.push(data.clone());
    let form = MechanicalForm::new(&fit.candidate, data)?;
    let nearly = RefineSettings {
        max_iterations: 12,
        tolerance: 0.1,
        ..RefineSettings::default()
    };
    // Fast moves may make the frozen model run away; the responses then give the coordinates alone.
    let transformed = match fit_transformation(&form, moves, set.degree, &nearly) {
        Ok(found) => Some(found),
        Err(FitError::Moving { .. }) if form.range().parameters() == 1 => None,
        Err(other) => return Err(other),
    };
    let (first, known) = match &transformed {
        Some(found) => (Some(found.account.rms[0]), Some(found.account.rms[2])),
        None => (None, None),
    };
    let least = known.unwrap_or(1.0);
    // None where the model runs away from the records.
    let joint = |start: &Candidate<Continuous>, max_iterations: usize| {
        let settings = RefineSettings {
            max_iterations,
            tolerance: 1e-3,
            ..RefineSettings::default()
        };
        match refine_with_moves(start, data, moves, &settings) {
            Err(FitError::Moving { .. }) => Ok(None),
            other => other.map(Some),
        }
    };
    // One that keeps the responses goes before one that does not.
    let mut best: Option<StaticLfr> = None;
    let spoilt = |frozen_rms: f64| frozen_rms > SPOILT * fit.account.rms;
    let mut consider = |refined: Jointly, split: DeltaSplit| {
        let [_, error] = refined.account.moving_rms;
        let [_, frozen_rms] = refined.account.frozen_rms;
        let better = |b: &StaticLfr| {
            (spoilt(frozen_rms), error) < (spoilt(b.frozen_rms), b.moving_rms[2].unwrap_or(f64::INFINITY))
        };
        if best.as_ref().is_none_or(better) {
            best = Some(StaticLfr {
                candidate: refined.candidate,
                split,
                moving_rms: [first, known, Some(error)],
                frozen_rms,
            });
        }
    };
    // Coordinates that the records ask for, and those of actuators and sensors that stand still.
    let families = || transformed.as_ref().map(Some).into_iter().chain([None]);
    // The smaller goes first in either: more deltas than the machine has follow these records and err along others.
    for (&split, coordinates) in set
        .splits
        .iter()
        .flat_map(|split| families().map(move |family| (split, family)))
    {
        // With fewer deltas than the free model needs no structure can do.
        if split.total() < fit.candidate.delta_count() && split != set.splits[set.splits.len() - 1] {
            continue;
        }
        let made_static = match static_dependence(&form, coordinates, &stages, split, set.starts, set.seed) {
            Ok(made_static) => made_static,
            Err(FitError::Start { .. }) => continue,
            Err(other) => return Err(other),
        };
        if made_static.frozen_rms > enough {
            continue;
        }
        let Some(mut refined) = joint(&made_static.candidate, set.iterations)? else {
            continue;
        };
        let error = |refined: &Jointly| refined.account.moving_rms[1];
        let is_explained =
            |refined: &Jointly| !spoilt(refined.account.frozen_rms[1]) && error(refined) <= EXPLAINED * least;
        if !is_explained(&refined) && error(&refined) < PROMISING * least {
            // On the way, where a few more steps may lead all of it.
            let further = joint(&refined.candidate, MORE * set.iterations)?;
            if let Some(further) = further.filter(|f| is_explained(f) || error(f) < error(&refined)) {
                refined = further;
            }
        }
        let explained = is_explained(&refined);
        let is_spoilt = spoilt(refined.account.frozen_rms[1]);
        consider(refined, split);
        if is_spoilt {
            // Records that no such LFR explains pull it away from the responses: as it was before them.
            if let Some(as_it_was) = joint(&made_static.candidate, 0)? {
                consider(as_it_was, split);
            }
        }
        if explained {
            break;
        }
    }
    // Worse than the frozen model in its own coordinates is no explanation; as good as it, up to the noise, is one.
    let helps =
        |b: &StaticLfr| first.is_none_or(|own| b.moving_rms[2].is_some_and(|error| error <= EXPLAINED * own));
    Ok(best.filter(helps))
}
