//! The xy-table along a moving p: from a frozen model to one whose coordinates do not depend on p.

use lfr_fit::moving::{
    MovingData, fit_transformation, refine_with_moves, simulate_errors, static_dependence,
};
use lfr_fit::{
    Candidate, DeltaSplit, FrozenData, GrowSettings, LocalSettings, MechanicalForm, RefineSettings, grow,
    local_model,
};
use lpv_core::nalgebra::{DMatrix, DVector};
use lpv_core::{Continuous, DeltaBlock, Discrete, Frf, Purpose, Record, StateSpace};
use xytable_plant::{
    ControllerSettings, Machine, MachineParameters, MoveKind, MoveSettings, MovingExperiment, MovingSettings,
    Noise, VerifiedController,
};

const NOISE: [f64; 2] = [3.3e-8, 1.7e-6];

struct Bench {
    machine: Machine,
    clock: Discrete,
    controller: VerifiedController,
    data: FrozenData,
}

impl Bench {
    fn new() -> Self {
        let machine = MachineParameters::default().check().unwrap();
        let clock = Discrete::from_rate(20.0).unwrap();
        let controller =
            VerifiedController::by_rule(&machine, &ControllerSettings::default(), clock).unwrap();
        let responses: Vec<(Vec<f64>, Frf)> = machine
            .positions(11)
            .into_iter()
            .map(|p| (vec![p], response(&machine, clock, p)))
            .collect();
        Self {
            data: FrozenData::relative(clock, &responses).unwrap(),
            machine,
            clock,
            controller,
        }
    }

    fn feedback(&self) -> StateSpace<Discrete> {
        let [one, other] = self.controller.digital();
        let one = one.state_space(self.clock).unwrap();
        one.beside(&other.state_space(self.clock).unwrap()).unwrap()
    }

    fn moves(&self, kinds: &[MoveKind], samples: usize, seed: u64) -> Vec<Record> {
        let settings = MoveSettings {
            samples,
            ..MoveSettings::default()
        };
        let run = |(kind, seed): (&MoveKind, u64)| {
            let setpoints = settings
                .setpoints(*kind, &self.machine, self.clock, seed)
                .unwrap();
            let moving = MovingSettings {
                noise: Noise::Off,
                ..MovingSettings::default()
            };
            let experiment =
                MovingExperiment::new(&self.machine, &self.controller, setpoints, moving).unwrap();
            experiment.run("move", Purpose::Estimation).unwrap().record
        };
        kinds.iter().zip(seed..).map(run).collect()
    }

    fn moving(&self, kinds: &[MoveKind], samples: usize, seed: u64) -> MovingData {
        let records = self.moves(kinds, samples, seed);
        MovingData::new(self.clock, &records, &NOISE, Some(&self.feedback())).unwrap()
    }

    /// Three deltas for the flexible states fit the frozen responses exactly.
    fn frozen_model(&self) -> Candidate<Continuous> {
        let centre = self.data.subset(|p| p[0] == 0.0).unwrap();
        let poles = self.machine.sampled_flexible_poles(0.0, self.clock).unwrap();
        let settings = LocalSettings::default();
        let local = local_model(Continuous, &centre, &poles, &settings).unwrap();
        let deltas = [DeltaBlock {
            parameter: 0,
            repetitions: 3,
        }];
        let grown = grow(
            &local.flexible,
            local.gamma.as_ref(),
            &self.data,
            &deltas,
            &self.machine.scheduling_range().unwrap(),
            &GrowSettings {
                target: Some(3e-4),
                ..GrowSettings::default()
            },
        )
        .unwrap();
        assert!(grown.reached, "{:?}", grown.starts);
        grown.refined.candidate
    }
}

fn response(machine: &Machine, clock: Discrete, p: f64) -> Frf {
    let lines: Vec<f64> = (1..80).map(|k| 0.125 * f64::from(k)).collect();
    machine
        .sampled(p, clock)
        .unwrap()
        .frequency_response(&lines)
        .unwrap()
}

/// Largest root mean square over records, by output.
fn worst(errors: &[DMatrix<f64>]) -> [f64; 2] {
    [0, 1].map(|i| {
        let rms = |e: &DMatrix<f64>| (e.row(i).norm_squared() / e.ncols() as f64).sqrt();
        errors.iter().map(rms).fold(0.0, f64::max)
    })
}

/// A frozen model that is exact is wrong by tens of micrometres when p moves fast. Its basis turned, settled and refined,
/// it is right to a fraction of a nanometre on moves that were not fitted, with four deltas.
#[test]
fn coordinates_that_stand_still_are_found_from_records() {
    use MoveKind::{BackAndForth, Sweep, Wander};
    let bench = Bench::new();
    let frozen = bench.frozen_model();
    let fitted = bench.moving(&[Sweep, BackAndForth, Wander, BackAndForth], 2000, 10);
    let judged = bench.moving(&[Sweep, BackAndForth, Wander], 2000, 50);
    let before = worst(&simulate_errors(&frozen, &judged).unwrap());
    assert!(before[0] > 1e-5, "{before:?}");

    let form = MechanicalForm::new(&frozen, &bench.data).unwrap();
    let settings = RefineSettings {
        max_iterations: 12,
        tolerance: 1e-2,
        ..RefineSettings::default()
    };
    let transformed = fit_transformation(&form, &fitted, 5, &settings).unwrap();
    let rms = &transformed.account.rms;
    assert!(rms[rms.len() - 1] < 0.02 * rms[0], "{rms:?}");

    let split = DeltaSplit {
        forces: 1,
        outputs: 1,
        accelerations: 2,
    };
    let made_static = static_dependence(
        &form,
        Some(&transformed),
        std::slice::from_ref(&bench.data),
        split,
        2,
        0,
    )
    .unwrap();
    let settings = RefineSettings {
        max_iterations: 30,
        ..RefineSettings::default()
    };
    let found = refine_with_moves(&made_static.candidate, &bench.data, &fitted, &settings).unwrap();
    let after = worst(&simulate_errors(&found.candidate, &judged).unwrap());
    assert!(
        after[0] < 5e-8 && after[1] < 2.5e-6,
        "{after:?} {:?}",
        found.account
    );
    let lfr = found.candidate.to_lfr().unwrap();
    assert_eq!((lfr.states(), lfr.delta_count()), (8, 4));
    // The frozen responses stay exact, between the positions too.
    for p in [-0.3, -0.17, 0.02, 0.29] {
        let truth = response(&bench.machine, bench.clock, p);
        let own = lfr.frozen(&[p]).unwrap().zero_order_hold(bench.clock).unwrap();
        let own = own.frequency_response(truth.frequencies_hz()).unwrap();
        let error = own
            .relative_error(&truth)
            .unwrap()
            .into_iter()
            .fold(0.0, f64::max);
        assert!(error < 0.01, "{p}: {error}");
    }
}

/// The simulation that the fit uses is that of the core.
#[test]
fn errors_are_those_of_the_lfr_in_open_loop() {
    let bench = Bench::new();
    let frozen = bench.frozen_model();
    let records = bench.moves(&[MoveKind::BackAndForth], 400, 3);
    let open = MovingData::new(bench.clock, &records, &NOISE, None).unwrap();
    let errors = simulate_errors(&frozen, &open).unwrap();
    let matrix = |columns: &[Vec<f64>]| DMatrix::from_fn(columns.len(), 400, |i, k| columns[i][k]);
    let (u, p, y) = (
        matrix(&records[0].inputs.columns),
        matrix(&records[0].scheduling.columns),
        matrix(&records[0].outputs.columns),
    );
    let lfr = frozen.to_lfr().unwrap();
    let run = lfr
        .simulate_held(&DVector::zeros(8), &u, &p, bench.clock)
        .unwrap();
    let direct = DMatrix::from_fn(2, 400, |i, k| {
        let here = lfr.frozen(&[p[k]]).unwrap();
        (here.d() * u.column(k))[i]
    });
    // The fit leaves out the direct term, which a machine does not have.
    let expected = &y - (run.outputs - direct);
    assert!((&errors[0] - &expected).amax() < 1e-10 * y.amax());
}
