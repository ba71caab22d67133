//! Wild parameters are refused or simulated, never a panic.

use lpv_core::{Discrete, Purpose};
use proptest::prelude::*;
use xytable_plant::{
    ControllerSettings, Experiment, ExperimentSettings, MachineParameters, MovingExperiment, MovingSettings,
    MultisineSettings, Noise, PlantError, Setpoint, Setpoints, VerificationSettings, VerifiedController,
};

fn parameters(v: [f64; 11]) -> MachineParameters {
    MachineParameters {
        carriage_mass_kg: v[0],
        beam_mass_kg: v[1],
        carriage_inertia_kg_m2: v[2],
        beam_inertia_kg_m2: v[3],
        half_beam_m: v[4],
        stiffness_y_n_per_m: v[5],
        stiffness_r_n_m_per_rad: v[6],
        damping_y_n_s_per_m: v[7],
        damping_r_n_m_s_per_rad: v[8],
        servo_mass_kg: v[9],
        half_stroke_m: v[10],
    }
}

#[test]
fn each_bad_field_is_named() {
    for i in 0..11 {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let mut v = [1.0; 11];
            v[i] = bad;
            let Err(PlantError::Setting { field, value, .. }) = parameters(v).check() else {
                panic!("field {i}")
            };
            assert!(field.contains('_') && (value == bad || bad.is_nan()));
        }
    }
}

#[test]
fn a_loop_that_is_too_fast_is_refused_with_its_worst_position() {
    let machine = MachineParameters::default().check().unwrap();
    let clock = Discrete::from_rate(20.0).unwrap();
    let rule = ControllerSettings {
        bandwidth_hz: 1.0,
        ..ControllerSettings::default()
    };
    let Err(PlantError::NotStable { spectral_radius, .. }) =
        VerifiedController::by_rule(&machine, &rule, clock)
    else {
        panic!("a bandwidth near the modes cannot be stable");
    };
    assert!(spectral_radius > 1.0);
    let strict = VerificationSettings {
        largest_sensitivity: 1.5,
        ..VerificationSettings::default()
    };
    let k = ControllerSettings::default().design().unwrap();
    let refused = VerifiedController::new(&machine, [k.clone(), k], clock, &strict);
    assert!(matches!(refused, Err(PlantError::NotRobust { limit: 1.5, .. })));
}

#[test]
fn dynamics_of_the_default_machine_are_those_that_the_paper_reports() {
    let machine = MachineParameters::default().check().unwrap();
    let f = [0.05, 1.0, 1.5, 2.1, 5.0];
    let at = |p| machine.frozen(p).unwrap().frequency_response(&f).unwrap();
    let (left, middle, right) = (at(-0.3), at(0.0), at(0.3));
    for k in 0..f.len() {
        for (i, j) in [(0, 0), (1, 1)] {
            assert!(
                (left.line(k)[(i, j)] - right.line(k)[(i, j)]).norm() < 1e-9 * right.line(k)[(i, j)].norm()
            );
        }
        for (i, j) in [(0, 1), (1, 0)] {
            // Symmetric in magnitude, with a phase flip of 180 degrees, and zero in the middle.
            assert!(
                (left.line(k)[(i, j)] + right.line(k)[(i, j)]).norm() < 1e-9 * right.line(k)[(i, j)].norm()
            );
            assert!(middle.line(k)[(i, j)].norm() < 1e-12 * middle.line(k).norm());
        }
    }
    // Decoupled: 1/s^2 at low frequency, at every p.
    let low = (std::f64::consts::TAU * 0.05).powi(2);
    for frf in [left, middle, right] {
        for i in 0..2 {
            assert!((frf.line(0)[(i, i)] * low + 1.0).norm() < 0.01);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn wild_machines_never_panic(
        values in prop::array::uniform11(prop_oneof![4 => 1e-3_f64..1e3, 1 => any::<f64>()]),
        position in any::<f64>(),
        sample_time in prop_oneof![3 => 1e-3_f64..1.0, 1 => any::<f64>()],
        bandwidth_hz in prop_oneof![3 => 1e-2_f64..10.0, 1 => any::<f64>()],
    ) {
        let Ok(machine) = parameters(values).check() else { return Ok(()) };
        let _ = machine.frozen(position);
        let _ = machine.flexible_poles(position);
        let _ = machine.mechanics();
        let Ok(clock) = Discrete::new(sample_time) else { return Ok(()) };
        for p in machine.positions(3) {
            let _ = machine.sampled(p, clock);
            let _ = machine.sampled_flexible_poles(p, clock);
        }
        let rule = ControllerSettings { bandwidth_hz, ..ControllerSettings::default() };
        let Ok(k) = rule.design() else { return Ok(()) };
        let settings = VerificationSettings { positions: 3, frequencies: 20, ..VerificationSettings::default() };
        let _ = VerifiedController::new(&machine, [k.clone(), k], clock, &settings);
    }

    #[test]
    fn wild_experiments_never_panic(
        position in prop_oneof![-0.3_f64..0.3, any::<f64>()],
        stds in prop::array::uniform2(any::<f64>()),
        seed in any::<u64>(),
        tolerance in any::<f64>(),
        servo_bandwidth_hz in any::<f64>(),
        r in prop::collection::vec(any::<f64>(), 0..6),
    ) {
        let machine = MachineParameters::default().check().unwrap();
        let clock = Discrete::from_rate(20.0).unwrap();
        let k = ControllerSettings::default().design().unwrap();
        let settings = VerificationSettings { positions: 3, frequencies: 20, ..VerificationSettings::default() };
        let k = VerifiedController::new(&machine, [k.clone(), k], clock, &settings).unwrap();
        let noise = Noise::Normal { y1_std_m: stds[0], y2_std_rad: stds[1] };
        let m = MultisineSettings { period: 16, crest_iterations: 0, ..MultisineSettings::default() }.check().unwrap();
        let settings = ExperimentSettings { periods: 2, noise, seed, ..ExperimentSettings::default() };
        if let Ok(e) = Experiment::new(&machine, &k, &m, position, settings) {
            let _ = e.run(&mut |_| -> Result<(), PlantError> { Ok(()) });
        }
        let n = r.len();
        if let Ok(y1) = Setpoint::from_positions(r, clock) {
            let still = Setpoint::constant(position, n);
            let set = Setpoints { y2: y1.clone(), y1, x1: still, injection: None };
            let settings = MovingSettings { noise, seed, servo_bandwidth_hz, tolerance };
            if let Ok(e) = MovingExperiment::new(&machine, &k, set, settings) {
                let _ = e.run("wild", Purpose::Estimation);
            }
        }
    }
}
