//! The effects that are tried, one file each.
//!
//! To add one: write a file with a `static EFFECT: Effect`, or `EFFECTS` by place, and its [`Block`](crate::effect::Block), and
//! name it in [`KINDS`].

mod abbe_offset;
mod actuator_lag;
mod actuator_saturation;
mod backlash;
mod cable_stiffness;
mod cogging;
mod constant_force;
mod coulomb_friction;
mod cubic_stiffness;
mod delay;
mod direction_dependent_friction;
mod extra_mode;
mod friction_drift;
mod gravity;
mod hysteresis;
mod input_gain;
mod load_dependent_friction;
mod mass_jump;
mod motor_asymmetry;
mod payload;
mod periodic_disturbance;
mod position_dependent_gain;
mod position_force;
mod quadratic_friction;
pub(crate) mod quantization;
mod scheduling_rate;
mod second_scheduling;
mod sensor_cyclic_error;
mod sensor_drift;
mod sensor_gain;
mod since;
mod stiffness_drift;
mod stribeck_friction;
mod temperature;
mod viscous_friction;

pub(crate) use gravity::LEAST_TURN;

use crate::base::{Base, Forces, Pair};
use crate::effect::{Effect, EffectParameter, Place, Scale};
use crate::screen::{Screen, Trial};
use crate::track::Track;
use std::slice::from_ref;

/// The effects, kind by kind, each at all places where it may act; of two that a record cannot tell apart, the first is named.
pub static KINDS: [&[Effect]; 34] = [
    &coulomb_friction::EFFECTS,
    &stribeck_friction::EFFECTS,
    &direction_dependent_friction::EFFECTS,
    &viscous_friction::EFFECTS,
    from_ref(&quadratic_friction::EFFECT),
    from_ref(&load_dependent_friction::EFFECT),
    &temperature::EFFECTS,
    from_ref(&friction_drift::EFFECT),
    &hysteresis::EFFECTS,
    from_ref(&gravity::EFFECT),
    &cogging::EFFECTS,
    &cable_stiffness::EFFECTS,
    &position_force::EFFECTS,
    &position_dependent_gain::EFFECTS,
    &actuator_saturation::EFFECTS,
    from_ref(&motor_asymmetry::EFFECT),
    from_ref(&input_gain::EFFECT),
    &delay::EFFECTS,
    &actuator_lag::EFFECTS,
    &extra_mode::EFFECTS,
    &payload::EFFECTS,
    from_ref(&mass_jump::EFFECT),
    &cubic_stiffness::EFFECTS,
    from_ref(&stiffness_drift::EFFECT),
    &backlash::EFFECTS,
    from_ref(&scheduling_rate::EFFECT),
    from_ref(&second_scheduling::EFFECT),
    &constant_force::EFFECTS,
    &periodic_disturbance::EFFECTS,
    from_ref(&abbe_offset::EFFECT),
    &sensor_gain::EFFECTS,
    &sensor_cyclic_error::EFFECTS,
    &sensor_drift::EFFECTS,
    from_ref(&quantization::EFFECT),
];

/// All effects in their order.
pub fn all() -> impl Iterator<Item = &'static Effect> {
    KINDS.into_iter().flatten()
}

/// Whether an effect changes slowly with where a motor is: along a motion that only goes on, this cannot be told from a change in time.
pub(crate) fn changes_with_position(effect: &Effect) -> bool {
    let kinds = [
        &cable_stiffness::EFFECTS[..],
        &position_force::EFFECTS,
        &position_dependent_gain::EFFECTS,
    ];
    kinds.into_iter().flatten().any(|e| e.is(effect))
}

/// Whether an effect refines another one, or another form of its own.
pub(crate) fn is_refined(effect: &Effect) -> bool {
    all().any(|e| effect.refines(e))
}

/// Whether an effect is named only where nothing but noise is left beside it, or little of what there was: as long as more is missing, what
/// friction does in time or with the load looks like much that a machine may do.
pub(crate) fn is_only_beside_noise(effect: &Effect) -> bool {
    friction_drift::EFFECT.is(effect) || load_dependent_friction::EFFECT.is(effect)
}

/// Whether an effect is the rough form of one that another form tells better where records are explained down to their noise.
pub(crate) fn is_rough(effect: &Effect) -> bool {
    position_force::is_straight(effect)
}

/// Whether an effect of a machine is itself with these values along records: a peak of friction that has fallen before the sign of the speed
/// has reached its value is a form of that sign, by which dry friction that creeps passes for one that sticks. No cable
/// pushes, two waves that the travel does not tell apart are one, and a drive that clips most of its commands drives nothing.
pub(crate) fn is_itself(effect: &Effect, values: &[f64], tracks: &[Track]) -> bool {
    /// Times the speed that creeps at which the sign is reached: its hyperbolic tangent is 0.96.
    const REACHED: f64 = 2.0;
    if let (true, [linear, cubic]) = (cable_stiffness::EFFECTS.iter().any(|e| e.is(effect)), values) {
        // No cable pushes away; a position force may.
        let farthest = match tracks.iter().all(|t| t.follows) {
            true => 0.0,
            false => Track::farthest(tracks, effect.place.first()),
        };
        return linear + cubic * farthest * farthest > 0.0;
    }
    if cogging::EFFECTS.iter().any(|e| e.is(effect)) && values.len() == cogging::TWO_WAVES {
        return cogging::are_apart(values, Track::travel(tracks, effect.place.first()));
    }
    if let (true, [value]) = (actuator_saturation::EFFECTS.iter().any(|e| e.is(effect)), values) {
        return actuator_saturation::is_seldom(effect, *value, tracks);
    }
    let [_, _, creep, fall] = *values else {
        return true;
    };
    let is_peak = stribeck_friction::EFFECTS.iter().any(|e| e.is(effect));
    !is_peak || fall >= REACHED * creep
}

/// Whether an effect is a force that repeats along the stroke.
pub(crate) fn is_wave(effect: &Effect) -> bool {
    cogging::EFFECTS.iter().any(|e| e.is(effect))
}

/// Whether what changes at a time shows as a change, along the motions of a screen.
pub(crate) fn is_change(effect: &Effect, values: &[f64], screen: &Screen<'_>) -> bool {
    !mass_jump::EFFECT.is(effect) || mass_jump::is_apart(values, screen)
}

/// The mass that one record has from its start on, in the place of one that comes in this record later.
pub fn from_the_start(effect: &Effect, values: &[f64]) -> Option<(&'static Effect, Vec<f64>)> {
    match *values {
        [mass, _, record] if mass_jump::EFFECT.is(effect) && record > 0.0 => {
            Some((payload::of_a_record(), vec![mass, record]))
        }
        _ => None,
    }
}

/// What presliding friction is called whose distance the records do not show: below what the readings resolve, or without a
/// motion that turns.
pub(crate) fn as_seen(
    effect: &'static Effect,
    values: &[f64],
    noise: Pair,
    turns: impl Fn(usize) -> bool,
) -> &'static Effect {
    /// Part of the noise of a reading: over many reversals a distance that is shorter than one is seen still.
    const UNSEEN: f64 = 0.5;
    if !hysteresis::EFFECTS.iter().any(|e| e.is(effect)) {
        return effect;
    }
    let channel = effect.place.first();
    if values[1] >= UNSEEN * noise[channel] && turns(channel) {
        return effect;
    }
    coulomb_friction::at_rest(effect.place).unwrap_or(effect)
}

/// Ties with the best candidate of a list, the best first, are broken in the order of the catalogue; effects of a user come before it.
pub(crate) fn first_of_equals<T>(
    list: &mut [T],
    effect: impl Fn(&T) -> &'static Effect,
    is_equal: impl Fn(&T) -> bool,
) {
    let place = |e: &Effect| all().position(|c| c.is(e));
    let equals = list.iter().filter(|t| is_equal(t)).map(&effect);
    let Some(first) = equals.min_by_key(|e| place(e)) else {
        return;
    };
    if let Some(at) = list.iter().position(|t| effect(t).is(first)) {
        list[..=at].rotate_right(1);
    }
}

const fn parameter(name: &'static str, unit: &'static str, scale: Scale) -> EffectParameter {
    EffectParameter { name, unit, scale }
}

/// The sign of a speed over that which creeps: its hyperbolic tangent, to the rounding of one and not of itself.
fn smooth_sign(over_creep: f64) -> f64 {
    if over_creep.abs() > 20.0 {
        return over_creep.signum();
    }
    1.0 - 2.0 / ((2.0 * over_creep).exp() + 1.0)
}

/// Dry friction at a motor: `-level tanh(v / creep)`.
fn rub(motor: usize, level: f64, (v, creep): (f64, f64), forces: &mut Forces) {
    let sign = smooth_sign(v / creep);
    let (force, slope) = (level * sign, level / creep);
    forces.motors[motor] -= force;
    let dry = &mut forces.dry[motor];
    dry.force += force;
    dry.level += level;
    dry.slope += slope * (1.0 - sign * sign);
    dry.slope_at_rest += slope;
}

/// Forces of the motors that together do what this input of a channel does in the middle of the range.
pub(crate) fn motor_forces(machine: &Base, channel: usize, input: f64) -> Pair {
    let mut inputs = [0.0; 2];
    inputs[channel] = input;
    machine.commanded(0.0, inputs)
}

/// A value for the motors of a place, and zero for others.
fn of_motors(machine: &Base, place: Place, value: f64) -> Pair {
    if place == Place::AllMotors {
        return [value; 2];
    }
    motor_forces(machine, place.first(), 1.0).map(|f| if f == 0.0 { 0.0 } else { value })
}

/// Pitches worth a start, with amplitudes: those that a travel resolves, down to the least.
fn pitches(
    screen: &Screen<'_>,
    (travel, least): (f64, f64),
    trials: impl Fn(f64) -> Vec<Trial> + Sync,
) -> Vec<(f64, Vec<f64>)> {
    /// Most pitches that are tried.
    const MOST: usize = 300;
    if !(travel > 0.0 && least > 0.0) {
        return Vec::new();
    }
    let width = 0.3 / travel;
    let most = 1.0 / least;
    let at = |i: usize| 1.0 / (width * (i + 3) as f64);
    let count = ((most / width) as usize).clamp(1, MOST);
    let found = screen.best(count, |i| trials(at(i)));
    found.into_iter().map(|(i, v)| (at(i), v)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_peak_of_friction_lies_beyond_the_speed_that_creeps() {
        let peak = &stribeck_friction::EFFECTS[0];
        let is = |creep, fall| is_itself(peak, &[1.0, 0.5, creep, fall], &[]);
        assert!(is(1e-3, 1e-2) && !is(1e-3, 1.9e-3) && !is(1e-3, 1e-4));
        assert!(is_itself(&coulomb_friction::EFFECTS[0], &[1.0, 1e-3], &[]));
    }
}
