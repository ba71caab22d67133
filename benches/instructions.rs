//! Instruction counts of the hot kernels under valgrind, for `cargo xtask bench`: they do not depend on what else runs.
#![allow(missing_docs)] // The entry points that the harness generates have no documentation.
#![allow(clippy::unwrap_used)] // An input that cannot be made ends the bench.

use frf_estimation::PeriodicAccumulator;
use gungraun::{Callgrind, LibraryBenchmarkConfig, library_benchmark, library_benchmark_group, main};
use lfr_fit::{RefineSettings, refine};
use lpv_benches::refinement::Case;
use lpv_benches::{Bench, accumulator, twelve_poles};
use lpv_core::nalgebra::{DMatrix, DVector};
use lpv_core::{Discrete, FrfEstimate, PeriodBlock, StateSpace};
use lpv_ident::{RegressionSettings, RigidTerm, regress};
use pole_fit::fit;
use std::hint::black_box;
use std::ops::Range;
use xytable_plant::{MovingExperiment, MovingSettings, Noise, PlantError, Setpoints};

const PERIOD: usize = 1 << 12;

/// Threads would make the counts depend on who takes which work, and another thread than this one is not counted: all work is done here.
fn alone() {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .use_current_thread();
    pool.build_global().unwrap();
}

fn estimates(positions: usize, lines: usize) -> (Vec<FrfEstimate>, StateSpace<Discrete>) {
    alone();
    let bench = Bench::new().unwrap();
    (
        bench.estimates(positions, lines).unwrap(),
        bench.basis(16).unwrap(),
    )
}

// Sixteen functions; twice the lines or positions are to cost twice as much.
#[library_benchmark]
#[bench::lines_8191(args = (4, 8191), setup = estimates)]
#[bench::lines_16383(args = (4, 16383), setup = estimates)]
#[bench::positions_8(args = (8, 1023), setup = estimates)]
#[bench::positions_16(args = (16, 1023), setup = estimates)]
fn regression((estimates, basis): (Vec<FrfEstimate>, StateSpace<Discrete>)) {
    let settings = RegressionSettings {
        rigid_body: RigidTerm::diagonal(2),
        ..RegressionSettings::default()
    };
    black_box(regress(black_box(&estimates), &basis, &settings).unwrap());
}

/// Periods that are there before, so that plans and buffers are made, and periods that are counted: none is left to wait.
const PERIODS: [usize; 2] = [2, 4];

fn push(accumulator: &mut PeriodicAccumulator, signals: &[Vec<f64>], periods: Range<usize>) {
    for period in periods {
        let block = PeriodBlock {
            experiment: 0,
            period,
            outputs: &signals[..2],
            inputs: &signals[2..4],
            references: &signals[4..],
        };
        accumulator.push(black_box(&block)).unwrap();
    }
}

fn signals(period: usize) -> (PeriodicAccumulator, Vec<Vec<f64>>) {
    let wave = |i: usize| (0..period).map(|k| ((i + 1) as f64 * k as f64).sin()).collect();
    let signals: Vec<Vec<f64>> = (0..6).map(wave).collect();
    let mut accumulator = accumulator(period, 2, Some(0.2.into())).unwrap();
    push(&mut accumulator, &signals, 0..PERIODS[0]);
    (accumulator, signals)
}

// Four periods of two outputs, inputs and references.
#[library_benchmark]
#[bench::period_4096(args = (PERIOD), setup = signals)]
#[bench::period_8192(args = (2 * PERIOD), setup = signals)]
fn frf_push((mut accumulator, signals): (PeriodicAccumulator, Vec<Vec<f64>>)) {
    push(&mut accumulator, &signals, PERIODS[0]..PERIODS[0] + PERIODS[1]);
}

fn model(lines: usize) -> (StateSpace<Discrete>, Vec<f64>) {
    alone();
    let bench = Bench::new().unwrap();
    (bench.large_model(24).unwrap(), bench.lines_hz(lines))
}

// Twenty-four states.
#[library_benchmark]
#[bench::lines_500(args = (500), setup = model)]
#[bench::lines_1000(args = (1000), setup = model)]
fn frequency_response((model, lines): (StateSpace<Discrete>, Vec<f64>)) {
    black_box(model.frequency_response(black_box(&lines)).unwrap());
}

// Twenty-four states, two inputs.
#[library_benchmark]
#[bench::samples_2000(args = (2000), setup = model)]
#[bench::samples_4000(args = (4000), setup = model)]
fn simulation((model, lines): (StateSpace<Discrete>, Vec<f64>)) {
    let inputs = DMatrix::from_fn(model.inputs(), lines.len(), |i, k| lines[k] * (i as f64 - 0.5));
    let start = DVector::zeros(model.states());
    black_box(model.simulate(&start, black_box(&inputs)).unwrap());
}

fn motion(samples: usize) -> (Bench, Setpoints) {
    alone();
    let bench = Bench::new().unwrap();
    let moves = bench.sweep(samples).unwrap();
    (bench, moves)
}

// The plant in its loop while its carriage moves.
#[library_benchmark]
#[bench::samples_4000(args = (4000), setup = motion)]
#[bench::samples_8000(args = (8000), setup = motion)]
fn moving_p((bench, moves): (Bench, Setpoints)) {
    let settings = MovingSettings {
        noise: Noise::Off,
        ..MovingSettings::default()
    };
    let experiment = MovingExperiment::new(&bench.machine, &bench.controller, moves, settings).unwrap();
    let mut sink = |sample| -> Result<(), PlantError> {
        black_box(sample);
        Ok(())
    };
    experiment.stream(1, &mut sink).unwrap();
}

// An LFR of 8 states and 5 deltas on 5 positions: so many steps, each with its Jacobian.
#[library_benchmark]
#[bench::steps_2(args = (2), setup = refinement)]
#[bench::steps_4(args = (4), setup = refinement)]
#[bench::steps_6(args = (6), setup = refinement)]
fn lfr_refinement((case, settings): (Case, RefineSettings)) {
    black_box(refine(&case.start, &case.data, &settings).unwrap());
}

fn refinement(steps: usize) -> (Case, RefineSettings) {
    alone();
    let settings = RefineSettings {
        tolerance: 1e-12,
        max_iterations: steps,
        ..RefineSettings::default()
    };
    (Case::with_positions(5).unwrap(), settings)
}

fn response(lines: usize) -> (FrfEstimate, Discrete) {
    alone();
    let bench = Bench::new().unwrap();
    let frf = bench
        .large_model(14)
        .unwrap()
        .frequency_response(&bench.lines_hz(lines))
        .unwrap();
    (FrfEstimate::with_unit_covariance(frf, None).unwrap(), bench.clock)
}

// Order twelve, two inputs and outputs.
#[library_benchmark]
#[bench::lines_401(args = (401), setup = response)]
#[bench::lines_802(args = (802), setup = response)]
fn poles((estimate, clock): (FrfEstimate, Discrete)) {
    let settings = twelve_poles();
    black_box(fit(black_box(&estimate), clock, &settings).unwrap());
}

library_benchmark_group!(
    name = kernels,
    benchmarks = [
        regression,
        frf_push,
        frequency_response,
        simulation,
        moving_p,
        lfr_refinement,
        poles
    ]
);

// Valgrind 3.19 computes some vector code wrongly when it optimises (a response comes out otherwise than natively, in memcheck, or without
// optimisation); the counts are those of the program.
main!(
    config = LibraryBenchmarkConfig::default()
        .tool(Callgrind::with_args(["--cache-sim=no", "--vex-iropt-level=0"])),
    library_benchmark_groups = kernels
);
