//! Moving p against the exact constant-p simulation, a tiny step and each other.

use lpv_core::{Discrete, Purpose, RecordKind};
use nalgebra::{DMatrix, DVector};
use xytable_plant::{
    ControllerSettings, Machine, MachineParameters, MoveLimits, MovingExperiment, MovingSettings, Noise,
    PlantError, Profile, Setpoint, Setpoints, VerifiedController,
};

const SAMPLES: usize = 800;

fn setup() -> (Machine, VerifiedController, Discrete) {
    let machine = MachineParameters::default().check().unwrap();
    let clock = Discrete::from_rate(20.0).unwrap();
    let k = VerifiedController::by_rule(&machine, &ControllerSettings::default(), clock).unwrap();
    (machine, k, clock)
}

fn setpoints(clock: Discrete, x1: Setpoint) -> Setpoints {
    let limits = MoveLimits {
        speed: 1e-3,
        acceleration: 1e-3,
        jerk: 2e-3,
    };
    let y1 = Profile::at(0.0, limits)
        .unwrap()
        .steps(&[1e-3, 0.0], 5.0)
        .unwrap()
        .sample(clock, SAMPLES);
    Setpoints {
        y1,
        y2: Setpoint::constant(0.0, SAMPLES),
        x1,
        injection: None,
    }
}

fn fast(clock: Discrete) -> Setpoint {
    let limits = MoveLimits {
        speed: 0.2,
        acceleration: 0.2,
        jerk: 0.5,
    };
    Profile::at(-0.28, limits)
        .unwrap()
        .back_and_forth(0.28, 5)
        .unwrap()
        .sample(clock, SAMPLES)
}

const QUIET: MovingSettings = MovingSettings {
    noise: Noise::Off,
    seed: 0,
    servo_bandwidth_hz: 0.5,
    tolerance: 1e-10,
};

#[test]
fn standing_still_is_the_exact_sampled_loop() {
    let (machine, k, clock) = setup();
    let p = 0.21;
    let set = setpoints(clock, Setpoint::constant(p, SAMPLES));
    let run = MovingExperiment::new(&machine, &k, set, QUIET)
        .unwrap()
        .run("still", Purpose::Validation)
        .unwrap();
    assert_eq!(run.record.kind, RecordKind::Transient);
    run.record.check().unwrap();
    assert!(
        run.record.scheduling.columns[0]
            .iter()
            .all(|v| (v - p).abs() < 1e-15)
    );
    // The recorded inputs through the exact sampled plant give the recorded outputs.
    let plant = machine.sampled(p, clock).unwrap();
    let u = DMatrix::from_fn(2, SAMPLES, |i, j| run.record.inputs.columns[i][j]);
    let y = plant.simulate(&DVector::zeros(8), &u).unwrap().outputs;
    for i in 0..2 {
        for j in 0..SAMPLES {
            let error = (y[(i, j)] - run.record.outputs.columns[i][j]).abs();
            assert!(error < 1e-9, "output {i}, sample {j}: {error:e}");
        }
    }
    assert!(
        run.record.outputs.columns[0].iter().any(|v| *v > 9e-4),
        "it moved"
    );
}

#[test]
fn a_tiny_step_changes_less_than_the_account_says() {
    let (machine, k, clock) = setup();
    let moving = MovingExperiment::new(&machine, &k, setpoints(clock, fast(clock)), QUIET).unwrap();
    let run = moving.run("fast", Purpose::Estimation).unwrap();
    assert_eq!(run.account.runs, 1);
    let outputs = |moving: &MovingExperiment<'_>, substeps: usize| {
        let mut outputs = Vec::new();
        moving
            .stream(substeps, &mut |s| -> Result<(), PlantError> {
                outputs.extend(s.outputs);
                Ok(())
            })
            .unwrap();
        outputs
    };
    let distance = |a: &[f64], b: &[f64]| {
        a.iter()
            .zip(b)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0_f64, f64::max)
    };
    let columns = &run.record.outputs.columns;
    let found: Vec<f64> = (0..run.record.len())
        .flat_map(|k| [columns[0][k], columns[1][k]])
        .collect();
    let error = distance(&found, &outputs(&moving, 256));
    assert!(
        error <= 2.0 * run.account.estimated_error + 1e-13,
        "{error:e} {:?}",
        run.account
    );
    // Steps by Runge-Kutta, with an effect, have order 4: half of them divide the error by about 16.
    let sticky = moving
        .with_effects(&["viscous-friction=0.1".parse().unwrap()])
        .unwrap();
    let truth = outputs(&sticky, 256);
    let ratio = distance(&outputs(&sticky, 4), &truth) / distance(&outputs(&sticky, 8), &truth);
    assert!((12.0..20.0).contains(&ratio), "{ratio}");
}

#[test]
fn the_carriage_follows_its_setpoint_over_the_stroke() {
    let (machine, k, clock) = setup();
    let set = setpoints(clock, fast(clock));
    let wanted = set.x1.position().to_vec();
    let run = MovingExperiment::new(&machine, &k, set, QUIET)
        .unwrap()
        .run("fast", Purpose::Estimation)
        .unwrap();
    let p = &run.record.scheduling.columns[0];
    let off = p
        .iter()
        .zip(&wanted)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max);
    assert!(off < 1e-4, "{off:e}");
    assert!(p.iter().any(|v| *v > 0.27) && p.iter().any(|v| *v < -0.27));
}

#[test]
fn noise_and_injection_enter_where_they_should() {
    let (machine, k, _) = setup();
    let still = || Setpoint::constant(0.1, SAMPLES);
    let zero = || Setpoints {
        y1: Setpoint::constant(0.0, SAMPLES),
        y2: Setpoint::constant(0.0, SAMPLES),
        x1: still(),
        injection: None,
    };
    let noisy = |seed| {
        let settings = MovingSettings {
            seed,
            ..MovingSettings::default()
        };
        MovingExperiment::new(&machine, &k, zero(), settings)
            .unwrap()
            .run("n", Purpose::Estimation)
            .unwrap()
            .record
    };
    assert_eq!(noisy(3), noisy(3));
    assert_ne!(noisy(3), noisy(4));
    assert!(noisy(3).outputs.columns[0].iter().any(|v| v.abs() > 1e-8));
    let mut pulse = vec![0.0; SAMPLES];
    pulse[10] = 1e-3;
    let set = Setpoints {
        injection: Some([pulse, vec![0.0; SAMPLES]]),
        y1: Setpoint::constant(0.0, SAMPLES),
        y2: Setpoint::constant(0.0, SAMPLES),
        x1: still(),
    };
    let record = MovingExperiment::new(&machine, &k, set, QUIET)
        .unwrap()
        .run("i", Purpose::Estimation)
        .unwrap()
        .record;
    record.check().unwrap();
    assert_eq!(record.injection.channels(), 2);
    assert_eq!(record.inputs.columns[0][9], 0.0);
    assert_eq!(record.inputs.columns[0][10], 1e-3);
    assert!(record.outputs.columns[0][10] == 0.0 && record.outputs.columns[0][12] != 0.0);
}

#[test]
fn what_cannot_run_is_refused() {
    let (machine, k, clock) = setup();
    let set = setpoints(clock, Setpoint::constant(0.31, SAMPLES));
    assert!(matches!(
        MovingExperiment::new(&machine, &k, set, QUIET),
        Err(PlantError::Position { .. })
    ));
    let set = setpoints(clock, Setpoint::constant(0.0, 7));
    assert!(matches!(
        MovingExperiment::new(&machine, &k, set, QUIET),
        Err(PlantError::Length { .. })
    ));
    // A jump of the setpoint makes the servo overshoot the end of the stroke.
    let mut jump = vec![0.0; SAMPLES];
    jump[20..].fill(0.3);
    let set = setpoints(clock, Setpoint::from_positions(jump, clock).unwrap());
    let run = MovingExperiment::new(&machine, &k, set, QUIET)
        .unwrap()
        .run("jump", Purpose::Estimation);
    assert!(matches!(run, Err(PlantError::LeftStroke { .. })), "{run:?}");
    for tolerance in [0.0, -1.0, f64::NAN] {
        let set = setpoints(clock, Setpoint::constant(0.0, SAMPLES));
        let settings = MovingSettings { tolerance, ..QUIET };
        assert!(matches!(
            MovingExperiment::new(&machine, &k, set, settings),
            Err(PlantError::Setting { .. })
        ));
    }
}
