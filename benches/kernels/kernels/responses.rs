//! Frequency responses and simulations.

use criterion::{BenchmarkId, Criterion, Throughput};
use lpv_benches::Bench;
use lpv_core::Purpose;
use std::hint::black_box;
use xytable_plant::{
    Experiment, ExperimentSettings, MoveLimits, MovingExperiment, MovingSettings, MultisineSettings,
    PlantError, Profile, Setpoint, Setpoints,
};

pub(crate) fn frequency_response(c: &mut Criterion) {
    let bench = Bench::new().unwrap();
    let lines = bench.lines_hz(2000);
    let mut group = c.benchmark_group("frequency response, 2000 lines");
    group.throughput(Throughput::Elements(2000));
    for states in [24, 36] {
        let model = bench.large_model(states).unwrap();
        group.bench_function(BenchmarkId::new("states", states), |b| {
            b.iter(|| model.frequency_response(black_box(&lines)).unwrap());
        });
    }
    group.finish();
}

pub(crate) fn simulation(c: &mut Criterion) {
    let bench = Bench::new().unwrap();
    let multisine = MultisineSettings {
        crest_iterations: 2,
        ..MultisineSettings::default()
    };
    let multisine = multisine.check().unwrap();
    let settings = ExperimentSettings {
        periods: 2,
        ..ExperimentSettings::default()
    };
    let constant = Experiment::new(&bench.machine, &bench.controller, &multisine, 0.2, settings).unwrap();
    let mut group = c.benchmark_group("closed-loop simulation");
    group.throughput(Throughput::Elements(2 * 2 * constant.period() as u64));
    group.bench_function("constant p, two experiments of two periods of 32768", |b| {
        b.iter(|| {
            constant
                .run(&mut |block| -> Result<(), PlantError> {
                    black_box(block.outputs);
                    Ok(())
                })
                .unwrap()
        });
    });

    const SAMPLES: usize = 4000;
    let sweep = Profile::slow_sweep(&bench.machine, 0.9, 180.0).unwrap();
    let limits = MoveLimits {
        speed: 1e-3,
        acceleration: 1e-3,
        jerk: 2e-3,
    };
    let steps = Profile::at(0.0, limits)
        .unwrap()
        .steps(&[1e-3, 0.0], 5.0)
        .unwrap();
    let setpoints = Setpoints {
        y1: steps.sample(bench.clock, SAMPLES),
        y2: Setpoint::constant(0.0, SAMPLES),
        x1: sweep.sample(bench.clock, SAMPLES),
        injection: None,
    };
    let moving = MovingExperiment::new(
        &bench.machine,
        &bench.controller,
        setpoints,
        MovingSettings::default(),
    )
    .unwrap();
    group.throughput(Throughput::Elements(SAMPLES as u64));
    group.bench_function("moving p, sweep of 4000 samples", |b| {
        b.iter(|| moving.run("sweep", Purpose::Validation).unwrap());
    });
    group.finish();
}
