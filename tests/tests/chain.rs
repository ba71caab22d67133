//! From a simulated experiment to an LFR, through every crate between: accuracy, identities, equal bits.
// Helpers of tests fail the test when something is wrong, as the tests themselves do.
#![allow(clippy::unwrap_used, clippy::panic)]

use frf_estimation::{Layout, PeriodicAccumulator, PeriodicSettings, SkipRule};
use lfr_realize::{Realization, realize};
use lpv_core::{Discrete, Frf, FrfEstimate, PeriodBlock, Purpose};
use lpv_ident::{Interpolation, LpvObfModel, RegressionSettings, RigidTerm, regress};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex;
use obf_basis::{FkcmSettings, OrthonormalBasis, PoleSet, fkcm};
use pole_fit::{Integrators, NumeratorDegree, PoleFit, PoleFitSettings, fit};
use rayon::prelude::*;
use std::sync::LazyLock;
use xytable_plant::{
    ControllerSettings, Experiment, ExperimentSettings, Machine, MachineParameters, MoveLimits,
    MovingExperiment, MovingSettings, MultisineSettings, Noise, PlantError, Profile, Setpoint, Setpoints,
    VerifiedController,
};

const POSITIONS: usize = 9;
const PERIOD: usize = 2048;
const PERIODS: usize = 8;
const SKIPPED: usize = 2;
const FUNCTIONS: usize = 16;
const ORDER: usize = 16;

struct Chain {
    machine: Machine,
    controller: VerifiedController,
    clock: Discrete,
    estimates: Vec<FrfEstimate>,
    fits: Vec<PoleFit>,
    cost_db: f64,
    model: LpvObfModel,
    realization: Realization,
}

/// Experiments with noise at all positions, then every step of the identification.
fn chain(seed: u64) -> Chain {
    let machine = MachineParameters::default().check().unwrap();
    let clock = Discrete::from_rate(20.0).unwrap();
    let controller = VerifiedController::by_rule(&machine, &ControllerSettings::default(), clock).unwrap();
    let multisine = MultisineSettings {
        period: PERIOD,
        ..MultisineSettings::default()
    };
    let multisine = multisine.check().unwrap();
    let estimates: Vec<FrfEstimate> = machine
        .positions(POSITIONS)
        .into_par_iter()
        .map(|position| {
            let settings = ExperimentSettings {
                periods: PERIODS,
                seed,
                ..ExperimentSettings::default()
            };
            let experiment = Experiment::new(&machine, &controller, &multisine, position, settings).unwrap();
            estimate(&experiment, clock)
        })
        .collect();

    let order = PoleFitSettings {
        integrators: Integrators::Fixed(2),
        numerator: NumeratorDegree::StrictlyProper,
        ..PoleFitSettings::new(6)
    };
    let fits: Vec<PoleFit> = estimates
        .par_iter()
        .map(|e| fit(e, clock, &order).unwrap())
        .collect();

    let observed: Vec<_> = fits.iter().flat_map(PoleFit::flexible_poles).collect();
    let settings = FkcmSettings {
        seed,
        ..FkcmSettings::new(FUNCTIONS)
    };
    let found = fkcm(&PoleSet::new(&observed).unwrap(), &settings).unwrap();
    let basis = OrthonormalBasis::takenaka_malmquist(&found.poles, clock).unwrap();
    // Without an allowance for what sixteen functions cannot represent, the lines of the best signal to noise ratio would buy
    // their fit at the cost of all others.
    let settings = RegressionSettings {
        rigid_body: RigidTerm::diagonal(2),
        model_error: 0.1,
        ..RegressionSettings::default()
    };
    let local = regress(&estimates, basis.state_space(), &settings).unwrap();
    let model = local
        .interpolate(Interpolation::Chebyshev { order: ORDER })
        .unwrap();
    let realization = realize(&model.series().unwrap()).unwrap();
    Chain {
        machine,
        controller,
        clock,
        estimates,
        fits,
        cost_db: found.cost_db,
        model,
        realization,
    }
}

fn estimate(experiment: &Experiment<'_>, clock: Discrete) -> FrfEstimate {
    let layout = Layout {
        period: PERIOD,
        outputs: 2,
        inputs: 2,
        references: 2,
        experiments: 2,
        sample_rate_hz: 1.0 / clock.sample_time(),
    };
    let settings = PeriodicSettings {
        skip: SkipRule::Fixed(SKIPPED),
        ..PeriodicSettings::default()
    };
    let mut sums = PeriodicAccumulator::new(layout, &settings, Some(experiment.position().into())).unwrap();
    let mut push = |block: PeriodBlock<'_>| -> Result<(), PlantError> {
        sums.push(&block).unwrap();
        Ok(())
    };
    experiment.run(&mut push).unwrap();
    sums.finish().unwrap().estimate
}

/// One run for all tests that only look at it.
static CHAIN: LazyLock<Chain> = LazyLock::new(|| chain(7));

fn truth(chain: &Chain, position: f64, frequencies_hz: &[f64]) -> Frf {
    let plant = chain.machine.sampled(position, chain.clock).unwrap();
    plant.frequency_response(frequencies_hz).unwrap()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn decibel(ratio: f64) -> f64 {
    20.0 * ratio.log10()
}

#[test]
fn errors_of_the_frf_are_as_large_as_its_covariance_says() {
    for e in &CHAIN.estimates {
        let frf = e.frf();
        assert_eq!(frf.len(), PERIOD / 2 - 1);
        let exact = truth(&CHAIN, e.single_position().unwrap(), frf.frequencies_hz());
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let normalised = (0..frf.len())
                .map(|k| (frf.line(k)[(i, j)] - exact.line(k)[(i, j)]).norm_sqr() / e.variance(k, i, j))
                .sum::<f64>()
                / frf.len() as f64;
            // Ten degrees of freedom a line make the mean 10/9; over 1023 lines it scatters by 4 %.
            assert!(
                (0.9..1.35).contains(&normalised),
                "channel ({i}, {j}): {normalised}"
            );
        }
    }
}

#[test]
fn poles_lie_where_the_machine_has_them() {
    for (e, f) in CHAIN.estimates.iter().zip(&CHAIN.fits) {
        let exact = CHAIN
            .machine
            .sampled_flexible_poles(e.single_position().unwrap(), CHAIN.clock)
            .unwrap();
        assert!(f.account.unstable_poles.is_empty());
        let found = f.flexible_poles();
        assert_eq!(found.len(), exact.len());
        for z in found {
            let nearest = exact.iter().map(|&x| (x - z).norm() / x.norm());
            let error = nearest.fold(f64::INFINITY, f64::min);
            assert!(error < 1e-3, "position {:?}: {error:e}", e.position());
        }
        // Misfit and noise are of one size.
        assert!(f.account.cost_excess().abs() < 6.0, "{}", f.account.cost_excess());
    }
}

#[test]
fn the_frozen_model_has_the_error_that_its_basis_allows() {
    assert!(CHAIN.cost_db < -15.0, "{}", CHAIN.cost_db);
    // Up to beyond the modes; above them the noise is as large as the response.
    let frequencies: Vec<f64> = (1..250).map(|k| 0.01 * f64::from(k)).collect();
    let fitted = CHAIN.machine.positions(POSITIONS);
    let local = fitted.iter().enumerate().map(|(q, &p)| {
        let fit = CHAIN.model.fits().response(q, &frequencies).unwrap();
        fit.relative_error(&truth(&CHAIN, p, &frequencies)).unwrap()
    });
    // The strict error is the n-width cost and about 5 dB.
    judge("fits at the positions", local.flatten().collect(), -12.0, -35.0);

    // Between the positions the interpolation of nine samples decides, near resonances whose frequency moves by more than
    // their width from one position to the next.
    let between = fitted.windows(2).map(|p| {
        let p = 0.5 * (p[0] + p[1]);
        let model = CHAIN.model.response(&[p], &frequencies).unwrap();
        model.relative_error(&truth(&CHAIN, p, &frequencies)).unwrap()
    });
    judge("model between them", between.flatten().collect(), 3.0, -33.0);
}

fn judge(name: &str, errors: Vec<f64>, worst_bound_db: f64, median_bound_db: f64) {
    let worst = decibel(errors.iter().copied().fold(0.0, f64::max));
    let middle = decibel(median(errors));
    println!("{name}: worst {worst:.1} dB, median {middle:.1} dB");
    assert!(worst < worst_bound_db, "{name}: worst {worst}");
    assert!(middle < median_bound_db, "{name}: median {middle}");
}

#[test]
fn lfr_and_basis_model_have_equal_frozen_responses() {
    let lfr = &CHAIN.realization.lfr;
    assert_eq!(lfr.states(), 4 + 2 * FUNCTIONS);
    assert!(lfr.delta_count() <= 2 * ORDER);
    let frequencies: Vec<f64> = (1..400).map(|k| 0.02499 * f64::from(k)).collect();
    for position in CHAIN.machine.positions(13) {
        let of_lfr = lfr
            .frozen(&[position])
            .unwrap()
            .frequency_response(&frequencies)
            .unwrap();
        let of_model = CHAIN.model.response(&[position], &frequencies).unwrap();
        let errors = of_lfr.relative_error(&of_model).unwrap();
        let worst = errors.into_iter().fold(0.0, f64::max);
        assert!(worst < 1e-9, "{worst:e}");
    }
}

/// Outputs of the machine and of the LFR with the recorded inputs, from rest, without noise.
fn open_loop(chain: &Chain, x1: Setpoint) -> (DMatrix<f64>, DMatrix<f64>) {
    let samples = x1.len();
    let limits = MoveLimits {
        speed: 1e-3,
        acceleration: 1e-3,
        jerk: 2e-3,
    };
    let steps = Profile::at(0.0, limits).unwrap();
    let steps = steps.steps(&[1e-3, 0.0], 5.0).unwrap();
    let setpoints = Setpoints {
        y1: steps.sample(chain.clock, samples),
        y2: Setpoint::constant(0.0, samples),
        x1,
        injection: None,
    };
    let settings = MovingSettings {
        noise: Noise::Off,
        ..MovingSettings::default()
    };
    let experiment = MovingExperiment::new(&chain.machine, &chain.controller, setpoints, settings).unwrap();
    let record = experiment.run("move", Purpose::Validation).unwrap().record;
    let matrix = |columns: &[Vec<f64>]| DMatrix::from_fn(columns.len(), samples, |i, k| columns[i][k]);
    let lfr = &chain.realization.lfr;
    let rest = DVector::zeros(lfr.states());
    let (u, p) = (matrix(&record.inputs.columns), matrix(&record.scheduling.columns));
    // The servo overshoots its setpoint by less than a thousandth of the stroke.
    let p = p.map(|p| p.clamp(-0.3, 0.3));
    let simulated = lfr.simulate(&rest, &u, &p).unwrap().outputs;
    (matrix(&record.outputs.columns), simulated)
}

/// Root mean square of one row.
fn rms(m: &DMatrix<f64>, row: usize) -> f64 {
    m.row(row).norm() / (m.ncols() as f64).sqrt()
}

#[test]
fn open_loop_simulation_follows_the_machine() {
    let samples = 600;
    let still = Setpoint::constant(0.15, samples);
    let sweep = Profile::slow_sweep(&CHAIN.machine, 0.8, 25.0).unwrap();
    for (name, x1) in [
        ("constant p", still),
        ("slow sweep", sweep.sample(CHAIN.clock, samples)),
    ] {
        let (measured, simulated) = open_loop(&CHAIN, x1);
        let error = &measured - &simulated;
        let (y1, y2) = (rms(&error, 0), rms(&error, 1));
        println!("{name}: y1 off by {y1:.2e} m, y2 by {y2:.2e} rad");
        // Micrometres of a move of a millimetre, after 30 units of time through two integrators.
        assert!(rms(&measured, 0) > 5e-4);
        assert!(y1 < 2e-6, "{name}: {y1:e} m");
        assert!(y2 < 5e-6, "{name}: {y2:e} rad");
    }
}

/// Every number of a run, as bits.
fn bits(chain: &Chain) -> Vec<u64> {
    let mut numbers: Vec<f64> = Vec::new();
    let complex = |numbers: &mut Vec<f64>, values: &[Complex<f64>]| {
        numbers.extend(values.iter().flat_map(|v| [v.re, v.im]));
    };
    for e in &chain.estimates {
        complex(&mut numbers, e.frf().values());
        for k in 0..e.frf().len() {
            complex(&mut numbers, e.output_covariance(k).into_owned().as_slice());
            complex(&mut numbers, e.input_factor(k).into_owned().as_slice());
        }
    }
    for f in &chain.fits {
        complex(&mut numbers, &f.poles);
        numbers.extend(f.pole_covariance.iter().flat_map(|c| c.iter().copied()));
        numbers.extend([f.account.cost, f.account.condition]);
    }
    numbers.push(chain.cost_db);
    let local = chain.model.fits();
    let (gains, covariance) = local.gains();
    numbers.extend(gains.iter().chain(covariance.iter()));
    for (q, f) in local.fits().iter().enumerate() {
        numbers.extend(f.weights.iter());
        numbers.extend([f.cost, f.condition()]);
        numbers.extend(local.coefficient_covariance(q).iter());
    }
    for table in local.leave_one_out(&local.candidates(8)).unwrap() {
        numbers.extend([table.cost, table.worst.0, table.worst.1[0]]);
    }
    let b = chain.realization.lfr.blocks();
    for m in [&b.a, &b.b1, &b.b2, &b.c1, &b.d11, &b.d12, &b.c2, &b.d21, &b.d22] {
        numbers.extend(m.iter());
    }
    numbers.into_iter().map(f64::to_bits).collect()
}

#[test]
fn same_seed_same_bits_whatever_the_number_of_threads() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| bits(&chain(7)))
    };
    let one = with(1);
    assert!(one == with(2), "one thread and two differ");
    assert!(one == bits(&CHAIN), "two runs differ");
    assert!(one != bits(&chain(8)), "the seed changes nothing");
}
