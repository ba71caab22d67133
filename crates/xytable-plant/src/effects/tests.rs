//! Each effect against a case computed by hand, on the bodies without any loop.

use super::*;
use crate::plant::{Plant, Rounding};
use std::f64::consts::TAU;

const MASS: f64 = 32.0;
const HALF_BEAM: f64 = 0.5;

/// A plant with one effect and a sample time, at rest at `[x1, y'_1, y'_2]`.
fn plant(effect: &str, sample_time: f64, start: [f64; 3]) -> Plant {
    let machine = MachineParameters::default().check().unwrap();
    Plant::new(&machine, &[effect.parse().unwrap()], sample_time, start)
}

/// Momentum along y and angular momentum, whose rates are the total force and moment on the beam: (8) summed over the
/// bodies, in which the couplings cancel.
fn momenta(plant: &Plant) -> [f64; 2] {
    let (x, q) = (plant.state(), plant.machine());
    let along = q.carriage_mass_kg * x[6];
    [
        along + q.beam_mass_kg * x[8],
        q.carriage_inertia_kg_m2 * x[7] + q.beam_inertia_kg_m2 * x[9] + x[0] * along,
    ]
}

/// Force of the left and the right motor, averaged over a time in which nothing moves far.
fn forces(plant: &mut Plant, u: [f64; 2], time: f64) -> [f64; 2] {
    let before = momenta(plant);
    plant.advance(0.0, u, 4);
    let [force, moment] = [0, 1].map(|i: usize| (momenta(plant)[i] - before[i]) / time);
    [
        0.5 * (force - moment / HALF_BEAM),
        0.5 * (force + moment / HALF_BEAM),
    ]
}

fn close(found: [f64; 2], expected: [f64; 2]) {
    let size = expected.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    for (a, b) in found.iter().zip(expected) {
        assert!((a - b).abs() <= 1e-4 * size, "{found:?}, by hand {expected:?}");
    }
}

const SHORT: f64 = 1e-6;

#[test]
fn coulomb_friction_brakes_steady_motion_with_its_level() {
    // The left guide goes forward, the right one backward, both fast enough for tanh = 1.
    let mut p = plant("coulomb-friction=0.004", SHORT, [0.0; 3]);
    p.state_mut()[8] = 0.01;
    p.state_mut()[9] = -0.1;
    let half = 0.5 * 0.004 * MASS;
    // Speeds 0.01 + 0.05 and 0.01 - 0.05.
    close(forces(&mut p, [0.0; 2], SHORT), [-half, half]);
}

#[test]
fn coulomb_friction_is_proportional_to_slow_motion() {
    let mut p = plant("coulomb-friction=0.004", SHORT, [0.0; 3]);
    p.state_mut()[8] = 1e-4;
    let half = 0.5 * 0.004 * MASS * 1.0_f64.tanh();
    close(forces(&mut p, [0.0; 2], SHORT), [-half, -half]);
}

#[test]
fn viscous_friction_is_proportional_to_each_guides_speed() {
    let mut p = plant("viscous-friction=0.2", SHORT, [0.0; 3]);
    p.state_mut()[8] = 0.02;
    p.state_mut()[9] = 0.1;
    // 0.2 m / 2 = 3.2 N s/m; speeds 0.02 - 0.05 and 0.02 + 0.05.
    close(forces(&mut p, [0.0; 2], SHORT), [3.2 * 0.03, -3.2 * 0.07]);
}

#[test]
fn cogging_is_a_sine_of_each_motors_coordinate() {
    let mut p = plant("cogging=0.01", SHORT, [0.0; 3]);
    let half = 0.5 * 0.01 * MASS;
    let sine = |turns: f64| half * (TAU * turns).sin();
    close(forces(&mut p, [0.0; 2], SHORT), [sine(0.1), sine(0.3)]);
    // A quarter of the pitch of 24 mm along y.
    let mut p = plant("cogging=0.01", SHORT, [0.0, 0.006, 0.0]);
    close(forces(&mut p, [0.0; 2], SHORT), [sine(0.35), sine(0.55)]);
}

#[test]
fn a_cable_pulls_the_left_end_back() {
    let mut p = plant("cable-stiffness=0.5", SHORT, [0.0, 0.1, 0.02]);
    // 16 N/m at 0.1 - 0.5 * 0.02 m.
    close(forces(&mut p, [0.0; 2], SHORT), [-16.0 * 0.09, 0.0]);
}

#[test]
fn motors_differ_by_the_asymmetry() {
    // u'_1 = 1 asks for 16 N of each motor at p = 0.
    let mut p = plant("motor-asymmetry=0.1", SHORT, [0.0; 3]);
    close(forces(&mut p, [1.0, 0.0], SHORT), [16.0 * 1.05, 16.0 * 0.95]);
}

#[test]
fn gain_follows_the_motors_coordinates() {
    let mut p = plant("position-dependent-gain=0.2", SHORT, [0.0, 0.05, 0.1]);
    // Motors at 0.05 - 0.05 and 0.05 + 0.05 m.
    close(forces(&mut p, [1.0, 0.0], SHORT), [16.0, 16.0 * 1.2]);
}

#[test]
fn saturation_is_linear_for_small_forces_and_clips_large_ones() {
    let force = |u| {
        forces(
            &mut plant("actuator-saturation=0.5", SHORT, [0.0; 3]),
            [u, 0.0],
            SHORT,
        )
    };
    close(force(1e-3), [0.016; 2]);
    close(force(0.5), [8.0 * 1.0_f64.tanh(); 2]);
    close(force(-100.0), [-8.0; 2]);
}

#[test]
fn a_disturbance_is_a_sine_of_time() {
    // A quarter of a period of 1 / 0.37 in one sample; what follows is at the peak.
    let quarter = 0.25 / 0.37;
    let mut p = plant("periodic-disturbance=0.01", quarter, [0.0; 3]);
    p.advance(0.0, [0.0; 2], 64);
    // The impulse of a quarter wave is amplitude / (2 pi f).
    let impulse = 0.01 * MASS / (TAU * 0.37);
    assert!((momenta(&p)[0] / impulse - 1.0).abs() < 1e-6, "{:?}", momenta(&p));
}

#[test]
fn a_command_arrives_after_the_delay() {
    // 1.3 samples of 0.05: of three samples the force acts for 1.7.
    let mut p = plant("delay=0.065", 0.05, [0.0; 3]);
    for _ in 0..3 {
        p.advance(0.0, [1.0, 0.0], 8);
    }
    assert!(
        (momenta(&p)[0] - MASS * 1.7 * 0.05).abs() < 1e-9,
        "{:?}",
        momenta(&p)
    );
    // The commands themselves are told apart: 1 for one sample, then 0, gives the impulse of one.
    let mut p = plant("delay=0.065", 0.05, [0.0; 3]);
    p.advance(0.0, [1.0, 0.0], 8);
    for _ in 0..4 {
        p.advance(0.0, [0.0; 2], 8);
    }
    assert!((momenta(&p)[0] - MASS * 0.05).abs() < 1e-9, "{:?}", momenta(&p));
}

#[test]
fn a_lag_swallows_its_time_constant() {
    let (time, lag) = (0.05, 0.01);
    let mut p = plant("actuator-lag=0.01", time, [0.0; 3]);
    p.advance(0.0, [1.0, 0.0], 64);
    let expected = MASS * (time - lag * (1.0 - (-time / lag).exp()));
    assert!(
        (momenta(&p)[0] / expected - 1.0).abs() < 1e-6,
        "{:?}",
        momenta(&p)
    );
}

#[test]
fn a_payload_takes_part_in_the_motion_but_not_in_the_decoupling() {
    let mut p = plant("payload=2", 0.05, [0.1, 0.0, 0.0]);
    assert_eq!(p.machine().carriage_mass_kg, 14.0);
    assert!((p.machine().carriage_inertia_kg_m2 - 0.27).abs() < 1e-15);
    p.advance(0.0, [1.0, 0.0], 64);
    // The motors still give the force for 32 kg, and its moment for 12 kg on the carriage.
    let [force, moment] = momenta(&p).map(|v| v / 0.05);
    assert!(
        (force - 32.0).abs() < 1e-9 && (moment - 1.2).abs() < 1e-9,
        "{force} {moment}"
    );
}

#[test]
fn an_extra_mode_swings_at_its_frequency_on_a_heavy_carriage() {
    let mut p = plant("extra-mode=1e-9", 1.0 / 4.4, [0.0; 3]);
    p.own_mut()[0] = 1e-3;
    p.advance(0.0, [0.0; 2], 256);
    // One period later: exp(-2 pi zeta), of which the damping shortens the phase only in second order.
    let expected = 1e-3 * (-TAU * 0.02_f64).exp();
    assert!(
        (p.own_mut()[0] / expected - 1.0).abs() < 2e-3,
        "{}",
        p.own_mut()[0]
    );
}

#[test]
fn an_extra_mode_moves_by_what_it_takes_from_the_carriage() {
    let mut p = plant("extra-mode=0.5", 0.05, [0.0; 3]);
    for _ in 0..20 {
        p.advance(0.0, [1.0, 0.0], 64);
    }
    let total = momenta(&p)[0] + 0.5 * p.own_mut()[1];
    assert!((total - MASS).abs() < 1e-9, "{total}");
    assert!(p.own_mut()[1] > 0.5, "it follows");
}

#[test]
fn the_coupling_stiffens_with_the_cube_of_the_deflection() {
    let mut p = plant("cubic-stiffness=0.5", SHORT, [0.0; 3]);
    p.state_mut()[1] = 2e-3;
    p.advance(0.0, [0.0; 2], 4);
    let k = p.machine().stiffness_y_n_per_m;
    // At 2 mm: k e (1 + 0.5 * 4).
    let expected = -k * 2e-3 * 3.0 / 12.0;
    let found = p.state()[6] / SHORT;
    assert!((found / expected - 1.0).abs() < 1e-4, "{found} {expected}");
    assert!(momenta(&p).iter().all(|m| m.abs() < 1e-15), "an inner force");
}

#[test]
fn sensors_scale_drift_and_round() {
    let read = |effect, y1| plant(effect, 20.0, [0.0, y1, 2e-4]).measure([1e-7, 0.0], Rounding::Sensor);
    close(read("sensor-gain=0.01", 0.1), [0.101 + 1e-7, 2e-4]);
    let mut p = plant("sensor-drift=1e-3", 20.0, [0.0; 3]);
    assert_eq!(p.measure([0.0; 2], Rounding::Sensor), [0.0; 2]);
    p.advance(0.0, [0.0; 2], 1);
    close(
        p.measure([0.0; 2], Rounding::Sensor),
        [1e-3 * (1.0 - (-1.0_f64).exp()), 0.0],
    );
    // 1.34 mm in steps of 0.1 mm, 0.2 mrad in steps of 0.2 mrad.
    let rounded = read("quantization=1e-4", 1.34e-3);
    assert!(
        (rounded[0] - 1.3e-3).abs() < 1e-15 && (rounded[1] - 2e-4).abs() < 1e-15,
        "{rounded:?}"
    );
}

#[test]
fn names_are_parsed_and_misspelt_ones_answered() {
    let effect: HiddenEffect = "coulomb-friction=0.004".parse().unwrap();
    assert_eq!(
        (effect.info().name, effect.severity()),
        ("coulomb-friction", 0.004)
    );
    assert_eq!(effect.to_string().parse::<HiddenEffect>().unwrap(), effect);
    for info in HiddenEffect::catalogue() {
        let effect: HiddenEffect = info.name.parse().unwrap();
        assert_eq!(effect.severity(), info.default);
        assert!(
            (info.range[0]..=info.range[1]).contains(&info.default),
            "{info:?}"
        );
        assert_eq!(
            HiddenEffect::catalogue().filter(|i| i.name == info.name).count(),
            1
        );
    }
    let error = "coloumb-friction"
        .parse::<HiddenEffect>()
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("nearest: `coulomb-friction`") && error.contains("cogging"),
        "{error}"
    );
    for bad in ["delay=fast", "delay=-1", "delay=NaN", "delay=", "payload=inf"] {
        let error = bad.parse::<HiddenEffect>().unwrap_err();
        assert!(matches!(error, PlantError::Severity { .. }), "{bad}: {error}");
    }
    assert!(matches!(
        HiddenEffect::in_order(&[effect, effect]),
        Err(PlantError::EffectTwice { .. })
    ));
}

#[test]
fn stribeck_friction_falls_with_speed() {
    let force_at = |speed: f64| {
        let mut p = plant("stribeck-friction=0.004", SHORT, [0.0; 3]);
        p.state_mut()[8] = speed;
        forces(&mut p, [0.0; 2], SHORT)
    };
    let half = 0.5 * 0.004 * MASS;
    close(force_at(0.1), [-half; 2]);
    // exp(-1) of the 0.6 that is more is left at 10 mm/s.
    close(force_at(0.01), [-half * (1.0 + 0.6 * (-1.0_f64).exp()); 2]);
}

#[test]
fn dahl_friction_builds_up_with_travel() {
    let mut p = plant("hysteresis=0.004", 1e-3, [0.0; 3]);
    let half = 0.5 * 0.004 * MASS;
    // Far along at a steady speed: one sample each of 0.1 mm, the beam held by hand.
    for _ in 0..300 {
        p.state_mut()[8] = 0.1;
        p.state_mut()[6] = 0.1;
        p.advance(0.0, [0.0; 2], 4);
    }
    let before = momenta(&p);
    p.advance(0.0, [0.0; 2], 4);
    let force = (momenta(&p)[0] - before[0]) / 1e-3;
    assert!(
        (force + 2.0 * half).abs() < 1e-3 * half,
        "{force}, by hand {}",
        -2.0 * half
    );
}

#[test]
fn coriolis_is_the_product_of_two_speeds() {
    let mut p = plant("scheduling-rate=0.5", SHORT, [0.0; 3]);
    p.state_mut()[5] = 0.2;
    p.state_mut()[6] = 0.1;
    p.state_mut()[8] = 0.1;
    let before = p.state()[7];
    p.advance(0.0, [0.0; 2], 4);
    // Torque -0.5 * 12 kg * 0.2 * 0.1 on the carriage's 0.25 kg m^2.
    let rate = (p.state()[7] - before) / SHORT;
    assert!((rate + 0.5 * 12.0 * 0.2 * 0.1 / 0.25).abs() < 1e-3, "{rate}");
}

#[test]
fn readings_from_elsewhere() {
    let abbe = plant("abbe-offset=0.01", SHORT, [0.1, 0.0, 2e-3]).measure([0.0; 2], Rounding::Off);
    close(abbe, [2e-5, 2e-3]);
    let cyclic = plant("sensor-cyclic-error=1e-6", SHORT, [0.0, 0.005, 0.0]).measure([0.0; 2], Rounding::Off);
    assert!((cyclic[0] - 0.005 - 1e-6).abs() < 1e-12, "{cyclic:?}");
}

#[test]
fn drawn_shapes_stay_within_their_bounds_and_differ() {
    let machine = MachineParameters::default();
    let pitch = |seed| {
        let effect: HiddenEffect = "cogging".parse().unwrap();
        let facts = effect.varied(seed).facts(&machine);
        facts.iter().find(|(name, _)| *name == "pitch").unwrap().1
    };
    let all: Vec<f64> = (0..50).map(pitch).collect();
    assert!(all.iter().all(|p| (0.012..=0.05).contains(p)), "{all:?}");
    assert!(all.windows(2).all(|w| w[0] != w[1]));
    assert_eq!(pitch(3), pitch(3));
}
