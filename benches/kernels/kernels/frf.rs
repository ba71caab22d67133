//! One period into the accumulator, and the estimate from its sums.

use criterion::{BatchSize, Criterion, Throughput};
use frf_estimation::PeriodicAccumulator;
use lpv_benches::{Bench, accumulator};
use lpv_core::PeriodBlock;
use std::cell::LazyCell;
use xytable_plant::{Experiment, ExperimentSettings, MultisineSettings, PlantError};

const PERIOD: usize = 1 << 15;
const PERIODS: usize = 2;

/// Signals of one period of one experiment.
struct Period {
    experiment: usize,
    index: usize,
    outputs: Vec<Vec<f64>>,
    inputs: Vec<Vec<f64>>,
    references: Vec<Vec<f64>>,
}

/// The periods of both experiments.
fn periods(bench: &Bench) -> Vec<Period> {
    let multisine = MultisineSettings {
        period: PERIOD,
        crest_iterations: 2,
        ..MultisineSettings::default()
    };
    let settings = ExperimentSettings {
        periods: PERIODS,
        ..ExperimentSettings::default()
    };
    let multisine = multisine.check().unwrap();
    let experiment = Experiment::new(&bench.machine, &bench.controller, &multisine, 0.2, settings).unwrap();
    let mut periods = Vec::new();
    let run = experiment.run(&mut |block| -> Result<(), PlantError> {
        periods.push(Period {
            experiment: block.experiment,
            index: block.period,
            outputs: block.outputs.to_vec(),
            inputs: block.inputs.to_vec(),
            references: block.references.to_vec(),
        });
        Ok(())
    });
    run.unwrap();
    periods
}

fn push(accumulator: &mut PeriodicAccumulator, signals: &Period, period: usize) {
    let block = PeriodBlock {
        experiment: signals.experiment,
        period,
        outputs: &signals.outputs,
        inputs: &signals.inputs,
        references: &signals.references,
    };
    accumulator.push(&block).unwrap();
}

pub(crate) fn frf(c: &mut Criterion) {
    let bench = Bench::new().unwrap();
    let periods = LazyCell::new(|| periods(&bench));
    let mut group = c.benchmark_group("FRF, period 32768, two inputs and outputs");
    group.throughput(Throughput::Elements(PERIOD as u64));
    let mut filling = accumulator(PERIOD, 2, Some(0.2.into())).unwrap();
    let mut period = 0;
    group.bench_function("push", |b| {
        b.iter(|| {
            push(&mut filling, &periods[0], period);
            period += 1;
        });
    });
    group.bench_function("finish", |b| {
        let filled = || {
            let mut full = accumulator(PERIOD, 2, Some(0.2.into())).unwrap();
            for signals in &*periods {
                push(&mut full, signals, signals.index);
            }
            full
        };
        b.iter_batched(filled, |full| full.finish().unwrap(), BatchSize::LargeInput);
    });
    group.finish();
}
