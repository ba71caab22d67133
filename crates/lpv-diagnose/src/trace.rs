//! The competition: which effects of the catalogue earn a place.

mod account;
mod begun;
mod bench;
mod chosen;
mod conclude;
mod in_band;
mod load;
mod noise;
mod refine;
mod select;
mod slower;

use crate::TraceError;
use crate::base::{Base, Pair};
use crate::catalogue::quantization;
use crate::effect::Effect;
use crate::fit::{Explained, Fitted, Prior};
use crate::track::Track;
use crate::whiten::{SHORT, Whitening};
pub use account::{Added, Judged, Trace, Tried, Verdict};
pub use begun::begun;
use bench::{Aim, Bench};
use chosen::Chosen;
pub use conclude::MISSING_SHARE;
pub use in_band::trace_in_band;
use load::WithLoad;
use lpv_core::ControllerState;
use lpv_numerics::statistics::power_db;
use noise::loop_noise;
pub use noise::sensor_noise;
use select::select;
pub use slower::{Slower, trace_slower};

/// What is known before.
pub struct Case<'a> {
    /// Base model.
    pub base: &'a Base,
    /// What other data tell of its coordinates.
    pub prior: Option<&'a Prior>,
    /// Base and prior with parameters free that `base` holds: tried where effects do not explain the error in fewer words.
    pub free: Option<(&'a Base, &'a Prior)>,
    /// The loop of the experiment, at rest.
    pub controller: &'a ControllerState,
    /// Deviation of the noise of the sensors, by output; see [`sensor_noise`].
    pub noise: Pair,
    /// Records to fit.
    pub fitted: &'a [Track],
    /// Records to judge by.
    pub judged: &'a [Track],
    /// Effects of a user beside the catalogue.
    pub own: &'a [&'static Effect],
    /// Whether a load on a spring is looked for in the place of a rigid axis.
    pub seeks_load: bool,
    /// Hears of every fit of an effect together with the machine, which takes most of the time: how many are done in this look at the
    /// catalogue, and at most how many there are. How many looks there will be, nobody knows before.
    pub on_fit: &'a (dyn Fn(usize, usize) + Sync),
}

/// Lengths of description, in units of the likelihood's logarithm, within which two effects are equals.
const EQUAL: f64 = 6.0;

/// Most effects at once.
const MOST_EFFECTS: usize = 3;
/// Iterations of a full fit.
const ITERATIONS: usize = 40;
/// Fall of the squared whitened error on judged records that no chance makes.
const SURE: f64 = 14.0;
/// Cost over its expectation up to which what is left is noise.
const NOISE: f64 = 1.21;
/// Step of a grid of readings, in units of the noise, from which it matters.
const ROUGH: f64 = 3.0;
/// Part of the excess over the noise that may be left where effects are named.
const LEFT: f64 = 0.15;
/// Finds the effects that a base model lacks.
///
/// The machine's parameters are refitted along the records; each effect of the catalogue is tried from its starts by one
/// linear step, the most promising ones are fitted in full together with the machine, and the best of them is added if it
/// lowers the error on records that it was not fitted to. This is repeated until nothing but noise is left or no effect
/// helps.
///
/// # Errors
/// [`TraceError::TooFew`] without records to fit or to judge by; [`TraceError::Diverges`].
pub fn trace(case: &Case<'_>) -> Result<Trace, TraceError> {
    if case.fitted.is_empty() || case.judged.is_empty() {
        return Err(TraceError::TooFew {
            what: "a diagnosis needs at least one record to fit and one with use = \"validation\" to judge by",
        });
    }
    let (case, steps) = in_view_of_rounding(case);
    let strict = compete(&case, Aim::Noise, alone(&case)?);
    let free = match case.free {
        Some((base, prior)) if !strict.is_noise() => {
            let free = Case {
                base,
                prior: Some(prior),
                free: None,
                ..case
            };
            let bare = alone(&free)?;
            (bare.1.length() < strict.now.length()).then_some((free, bare))
        }
        _ => None,
    };
    let loaded = match case.seeks_load && !strict.is_noise() {
        true => WithLoad::traced(&case, &strict),
        false => None,
    };
    let mut found = match (free, loaded) {
        (Some((free, bare)), _) => compete(&free, Aim::Noise, bare).conclude(&free)?,
        (None, Some(loaded)) => Trace {
            rigid: Some(strict.before),
            ..loaded
        },
        (None, None) => strict.conclude(&case)?,
    };
    // What tests see in errors that are no larger than the rounding is the rounding: it goes with what is rounded.
    let rounding = found.after.cost <= NOISE;
    if steps.iter().any(Option::is_some) && (rounding || found.verdict != Verdict::Unexplained) {
        let values = steps.map(|step| step.unwrap_or((0.0, f64::INFINITY)));
        found.added.insert(
            0,
            Added {
                effect: &quantization::EFFECT,
                values: values.to_vec(),
                then: found.bare.clone(),
                gain_db: 0.0,
                p_value: f64::MIN_POSITIVE,
                runner_up: None,
            },
        );
        // It moves no error: the readings of all records lie on its grid.
        found.candidates.insert(
            0,
            Tried {
                effect: &quantization::EFFECT,
                beside: Vec::new(),
                gain_db: 0.0,
                fitted: true,
                accepted: true,
            },
        );
        if rounding {
            found.verdict = Verdict::Explained;
        }
    }
    Ok(found)
}

/// The same where readings lie on a grid: rounding is noise to all that follows. And the steps of the grid with their deviations, by output.
fn in_view_of_rounding<'a>(case: &Case<'a>) -> (Case<'a>, [Option<(f64, f64)>; 2]) {
    let [fitted, judged] = [case.fitted, case.judged].map(quantization::steps);
    let steps = std::array::from_fn(|i| {
        let times = judged[i].0 / fitted[i].0;
        let is_coarse =
            fitted[i].0 > ROUGH * case.noise[i] && times > 0.5 && (times - times.round()).abs() < 0.01;
        is_coarse.then_some(fitted[i])
    });
    let noise = std::array::from_fn(|i| match steps[i] {
        Some((step, _)) => case.noise[i].hypot(step / 12.0_f64.sqrt()),
        None => case.noise[i],
    });
    (Case { noise, ..*case }, steps)
}

/// The base model alone: the noise in its loop, and its fit.
fn alone(case: &Case<'_>) -> Result<(Whitening, Fitted), TraceError> {
    let bare = Explained {
        base: case.base.clone(),
        effects: Vec::new(),
    };
    let bench = Bench {
        whitening: loop_noise(case, &bare, SHORT)?,
        case,
        aim: Aim::Noise,
    };
    let fit = bench.problem().fit(&bare, ITERATIONS, None)?;
    Ok((bench.whitening, fit))
}

/// What a competition leaves.
struct Contest {
    whitening: Whitening,
    /// Without effects.
    bare: Fitted,
    before: Judged,
    /// With those that were added.
    now: Fitted,
    after: Judged,
    added: Vec<Added>,
    candidates: Vec<Tried>,
    /// The likeliest model with one effect more, which did not earn a place.
    near: Option<Explained>,
}

impl Contest {
    /// Whether nothing was added because nothing is missing.
    fn is_noise(&self) -> bool {
        self.added.is_empty() && self.after.cost <= NOISE
    }
}

fn compete(case: &Case<'_>, aim: Aim, (whitening, bare): (Whitening, Fitted)) -> Contest {
    let bench = Bench { whitening, case, aim };
    let before = bench.judge(&bare.model);
    let mut chosen = Chosen {
        now: bare.clone(),
        judged: before.clone(),
        added: Vec::new(),
        least: aim.least(before.cost),
    };
    let (mut candidates, mut near) = (Vec::new(), None);
    // Through an observer what is as small as the noise may be its own.
    let is_small = case.judged.iter().any(|t| t.follows) && before.cost <= NOISE;
    // Where all records go one way, what happens once, as the machine breaks away, has many names.
    let looks = if is_small || bench.goes_one_way() {
        0
    } else {
        MOST_EFFECTS
    };
    for _ in 0..looks {
        let Some(selection) = select(
            &bench,
            &bare.model.base,
            (&chosen.now, chosen.judged.cost),
            f64::INFINITY,
        ) else {
            break;
        };
        candidates.extend(selection.tried(&bench, &chosen.now, chosen.judged.cost));
        if !(chosen.add(&selection) || aim == Aim::Force && chosen.add_pair(&bench, &bare, &selection)) {
            near = selection.finals.first().map(|(_, fit, _)| fit.model.clone());
            break;
        }
        chosen.choose_again(&bench, &bare);
        if aim == Aim::Noise && (chosen.judged.cost <= NOISE || bench.is_below_noise(&chosen.judged)) {
            break;
        }
    }
    if aim == Aim::Force {
        chosen.refine(&bench, &bare);
    }
    Contest {
        whitening: bench.whitening,
        bare,
        before,
        now: chosen.now,
        after: chosen.judged,
        added: chosen.added,
        candidates,
        near,
    }
}

/// Decibels of a ratio of powers, -300 where that is none.
fn decibel(ratio: f64) -> f64 {
    let db = power_db(ratio);
    if db.is_finite() { db } else { -300.0 }
}
