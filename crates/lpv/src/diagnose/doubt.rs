//! What a diagnosis cannot tell, and which experiment would.

use super::places::placed;
use experiment_data::Bundle;
use lpv_core::ControllerState;
use lpv_diagnose::effect::{Effect, Family};
use lpv_diagnose::{Added, Base, Trace, Track, Tried, Verdict, steady_forces};

/// Margin on the judged records, dB, below which two effects do as well as each other.
pub const EQUAL_DB: f64 = 0.02;

/// Part of the squared white error that a test may see in what counts as white.
const WHITE: f64 = 0.02;

/// Look-alikes that the records do not tell apart, refinements that they do not ask for, and a base that may be the limit.
pub(super) fn doubts(found: &Trace, bundle: &Bundle) -> Vec<String> {
    let mut words: Vec<String> = found
        .added
        .iter()
        .filter_map(|a| Some((a.effect, a.runner_up?)))
        .filter(|(_, (_, margin))| *margin < EQUAL_DB)
        .map(|(effect, (other, margin))| {
            let records = experiment(effect);
            let [effect_name, other_name] = if effect.place == other.place {
                [effect, other].map(|e| e.name.to_owned())
            } else {
                [effect, other].map(|e| placed(e, bundle))
            };
            if other.refines(effect) {
                format!(
                    "{other_name} refines {effect_name} and explains no more of these records; {records} would show whether it is there"
                )
            } else {
                format!(
                    "{effect_name} and {other_name} are not told apart by the held-out records ({margin:+.3} dB for the first); {records} would"
                )
            }
        })
        .collect();
    let is_white = found.left[1].iter().all(|l| l.share < WHITE);
    if found.verdict == Verdict::Unexplained && !found.left[1].is_empty() && is_white {
        words.push(
            "what is left is white: on the moves the sensors are noisier than on the periodic records, or their noise does not reach the \
             controller"
                .to_owned(),
        );
    }
    let more = matches!(found.verdict, Verdict::Unexplained | Verdict::PartlyExplained);
    if more && matches!(found.model.base, Base::Lpv(_)) {
        words.push(
            "what is left may be the limit of the base, an identified model: a machine that moves in other coordinates than its states, \
             or a response that an effect had bent when it was measured; `lpv validate` tells its error along moves on which nothing was \
             wrong, and a [geometry] allows a base from first principles"
                .to_owned(),
        );
    }
    words
}

/// All effects that the judged records cannot tell from one that was added, itself first; none where there is no other.
pub(super) fn class(added: &Added, found: &Trace) -> Vec<String> {
    let mut all = vec![added.effect.name.to_owned()];
    // What is named beside it was told apart from it.
    let is_named = |effect: &Effect| found.added.iter().any(|a| a.effect.is_called(effect));
    let mut more = |effect: &Effect| {
        if !is_named(effect) && !all.iter().any(|name| name == effect.name) {
            all.push(effect.name.to_owned());
        }
    };
    if let Some((other, margin)) = added.runner_up
        && margin < EQUAL_DB
    {
        more(other);
    }
    let looks = || found.candidates.iter().filter(|t| t.fitted);
    let own = looks().find(|t| t.accepted && t.effect.is(added.effect));
    if let Some(own) = own {
        let is_same_look = |t: &&Tried| t.beside.len() == own.beside.len();
        let does_as_well = |t: &&Tried| t.gain_db > own.gain_db - EQUAL_DB;
        let others = looks().filter(is_same_look).filter(does_as_well);
        others.for_each(|t| more(t.effect));
    }
    if all.len() == 1 { Vec::new() } else { all }
}

/// What a constant force of each record explains: `tracks` fitted, then judged.
pub(super) fn steady_force(
    found: &Trace,
    observer: &ControllerState,
    tracks: [&Vec<Track>; 2],
    bundle: &Bundle,
) -> Option<String> {
    let tracks: Vec<&Track> = tracks.into_iter().flatten().collect();
    let forces = steady_forces(&found.model, observer, &tracks)?;
    let units = &bundle.description().channels.input.units;
    let unit = units.first().map_or(String::new(), |unit| format!(" {unit}"));
    let each = tracks
        .iter()
        .zip(&forces)
        .map(|(track, force)| format!("{} {force:.4e}{unit}", track.name));
    Some(format!(
        "what is left is a constant force of its own in each record ({}): a load that hangs, a cable or the zero of the amplifier, \
         for which the model has one number",
        each.collect::<Vec<_>>().join(", ")
    ))
}

/// An experiment in which an effect differs from its look-alikes.
pub(super) fn experiment(effect: &Effect) -> &'static str {
    match effect.family {
        Family::Friction => "slow moves that turn often, at several accelerations,",
        Family::PositionForce => "moves over the same stretch at several speeds",
        Family::Actuator => "moves of the same shape at several amplitudes, all over the stroke,",
        Family::Timing => "moves with a multisine on top, its lines up to Nyquist,",
        Family::Structure => "moves with a multisine on top, its lines beyond the modes,",
        Family::Scheduling => "the same move at several rates of the scheduling",
        Family::Disturbance => "a record at rest of more than ten of its periods",
        Family::Sensor => "the same stretch at several speeds, or a second sensor,",
    }
}
