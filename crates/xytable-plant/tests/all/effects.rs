//! Hidden effects in closed loop: what is absent changes nothing, what is there shows.

use lpv_core::{Discrete, Purpose};
use xytable_plant::{
    ControllerSettings, Experiment, ExperimentSettings, HiddenEffect, Lines, LoopKind, Machine,
    MachineParameters, MoveKind, MoveSettings, MovingExperiment, MovingSettings, Multisine,
    MultisineSettings, Noise, PlantError, Since, VerifiedController,
};

const NOISE: Noise = Noise::Normal {
    y1_std_m: 3.3e-8,
    y2_std_rad: 1.7e-6,
};

struct Bench {
    machine: Machine,
    controller: VerifiedController,
    clock: Discrete,
}

impl Bench {
    fn new() -> Self {
        let machine = MachineParameters::default().check().unwrap();
        let clock = Discrete::from_rate(20.0).unwrap();
        Self {
            machine,
            controller: VerifiedController::by_rule(&machine, &ControllerSettings::default(), clock).unwrap(),
            clock,
        }
    }

    /// Outputs and inputs of a default move.
    fn moving(&self, kind: MoveKind, samples: usize, effects: &[HiddenEffect]) -> [Vec<f64>; 4] {
        let moves = MoveSettings {
            samples,
            ..MoveSettings::default()
        };
        let setpoints = moves.setpoints(kind, &self.machine, self.clock, 5).unwrap();
        let settings = MovingSettings {
            noise: NOISE,
            ..MovingSettings::default()
        };
        let run = MovingExperiment::new(&self.machine, &self.controller, setpoints, settings)
            .unwrap()
            .with_effects(effects)
            .unwrap()
            .run("move", Purpose::Estimation)
            .unwrap();
        let (y, u) = (run.record.outputs.columns, run.record.inputs.columns);
        [y[0].clone(), y[1].clone(), u[0].clone(), u[1].clone()]
    }

    /// Outputs and inputs of both multisine experiments.
    fn grid(&self, effects: &[HiddenEffect]) -> Vec<f64> {
        let experiment = self.experiment(LoopKind::Digital).with_effects(effects).unwrap();
        let mut all = Vec::new();
        experiment
            .run(&mut |block| -> Result<(), PlantError> {
                all.extend(block.outputs.iter().chain(block.inputs).flatten());
                Ok(())
            })
            .unwrap();
        all
    }

    fn experiment(&self, loop_kind: LoopKind) -> Experiment<'_> {
        let settings = ExperimentSettings {
            periods: 3,
            noise: NOISE,
            loop_kind,
            seed: 7,
        };
        Experiment::new(&self.machine, &self.controller, &multisine(), 0.2, settings).unwrap()
    }
}

fn multisine() -> Multisine {
    MultisineSettings {
        period: 256,
        lines: Lines::Band { first: 1, last: 76 },
        amplitude: 3.5e-3,
        ..MultisineSettings::default()
    }
    .check()
    .unwrap()
}

fn rms_difference(a: &[f64], b: &[f64]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    (sum / a.len() as f64).sqrt()
}

#[test]
fn the_integrated_grid_is_the_exact_one() {
    let bench = Bench::new();
    let exact = bench.grid(&[]);
    // An effect of no strength takes the way of the effects.
    let integrated = bench.grid(&["coulomb-friction=0".parse().unwrap()]);
    assert_ne!(exact, integrated, "it took the other way");
    let worst = exact
        .iter()
        .zip(&integrated)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max);
    assert!(worst < 1e-9, "{worst:e}");
}

#[test]
fn what_is_mounted_after_the_grid_leaves_every_bit_of_it() {
    let bench = Bench::new();
    let still = bench.grid(&[]);
    for info in HiddenEffect::catalogue() {
        let changed = bench.grid(&[info.name.parse().unwrap()]);
        assert_eq!(changed == still, info.since == Since::Moves, "{}", info.name);
    }
}

#[test]
fn every_default_shows_above_the_noise_of_moves() {
    let bench = Bench::new();
    for kind in [MoveKind::Sweep, MoveKind::BackAndForth] {
        let plain = bench.moving(kind, 2000, &[]);
        for info in HiddenEffect::catalogue() {
            if info.name == "scheduling-rate" && kind == MoveKind::Sweep {
                // The scheduling is too slow for it to show.
                continue;
            }
            let with = bench.moving(kind, 2000, &[info.name.parse().unwrap()]);
            let over = [0, 1].map(|i| rms_difference(&with[i], &plain[i]) / NOISE.deviations()[i]);
            let most = over[0].max(over[1]);
            println!("{:24} {kind:?} {over:.1?} times the noise", info.name);
            // A lag that shows less would be so fast that the integration becomes stiff.
            let limit = if info.name == "actuator-lag" {
                2000.0
            } else {
                100.0
            };
            assert!((30.0..limit).contains(&most), "{}: {over:?}", info.name);
        }
    }
}

#[test]
fn the_order_of_asking_does_not_matter() {
    let bench = Bench::new();
    let effects: Vec<HiddenEffect> = ["sensor-gain", "motor-asymmetry=0.01", "actuator-saturation"]
        .map(|e| e.parse().unwrap())
        .into();
    let back: Vec<HiddenEffect> = effects.iter().rev().copied().collect();
    assert_eq!(
        bench.moving(MoveKind::Wander, 300, &effects),
        bench.moving(MoveKind::Wander, 300, &back)
    );
}

#[test]
fn effects_are_refused_in_the_continuous_loop() {
    let bench = Bench::new();
    let effect: HiddenEffect = "delay".parse().unwrap();
    let error = bench
        .experiment(LoopKind::Continuous)
        .with_effects(&[effect])
        .unwrap_err();
    assert_eq!(error, PlantError::EffectsNeedDigitalLoop);
}
