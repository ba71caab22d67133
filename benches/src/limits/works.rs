//! What is measured, its inputs made before.

use crate::Failure;
use frf_estimation::PeriodicAccumulator;
use lfr_fit::{RefineSettings, refine};
use lpv_benches::refinement::Case;
use lpv_benches::{Bench, accumulator, median, twelve_poles};
use lpv_core::nalgebra::{Complex, DMatrix, DVector};
use lpv_core::{Discrete, Frf, FrfEstimate, PeriodBlock, StateSpace};
use lpv_ident::{RegressionSettings, RigidTerm, regress};
use pole_fit::{PoleFitSettings, fit};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::hint::black_box;
use std::ops::Range;
use std::time::Instant;
use xytable_plant::{MovingExperiment, MovingSettings, Noise, PlantError};

type C64 = Complex<f64>;

/// One run.
pub(crate) type Work<'a> = Box<dyn FnMut() -> Result<(), Failure> + 'a>;

/// Measurements of which the median counts.
pub(crate) const RUNS: usize = 7;

/// Mean seconds of a run, repeated for a while.
pub(crate) fn once(run: &mut Work<'_>) -> Result<f64, Failure> {
    /// A run is repeated until it takes so long, seconds.
    const LEAST: f64 = 0.01;
    let (start, mut count) = (Instant::now(), 0.0);
    while count == 0.0 || start.elapsed().as_secs_f64() < LEAST {
        run()?;
        count += 1.0;
    }
    Ok(start.elapsed().as_secs_f64() / count)
}

/// Median time of several runs, of which the first does not count.
pub(crate) fn time(mut run: Work<'_>) -> Result<f64, Failure> {
    run()?;
    let times: Vec<f64> = (0..RUNS).map(|_| once(&mut run)).collect::<Result<_, _>>()?;
    Ok(median(times))
}

/// What is local to a position, and the gains that all share.
pub(crate) fn regression(
    bench: &Bench,
    positions: usize,
    lines: usize,
    functions: usize,
) -> Result<Work<'_>, Failure> {
    let (estimates, basis) = (bench.estimates(positions, lines)?, bench.basis(functions)?);
    let settings = RegressionSettings {
        rigid_body: RigidTerm::diagonal(2),
        ..RegressionSettings::default()
    };
    Ok(Box::new(move || {
        black_box(regress(&estimates, &basis, &settings)?);
        Ok(())
    }))
}

/// The same with as many inputs and outputs at one position: responses of two by two on the diagonal, a thousandth of them beside
/// it, and covariances of that shape.
pub(crate) fn channels(bench: &Bench, channels: usize) -> Result<Work<'_>, Failure> {
    const LINES: usize = 255;
    const FUNCTIONS: usize = 4;
    const BESIDE: f64 = 1e-3;
    let (one, basis) = (bench.estimate(0.1, LINES)?, bench.basis(FUNCTIONS)?);
    let whole = |of: &dyn Fn(usize) -> DMatrix<C64>, beside: f64| -> Vec<C64> {
        let entry = |k: usize| {
            let part = of(k);
            DMatrix::from_fn(channels, channels, |i, j| {
                part[(i % 2, j % 2)] * if i / 2 == j / 2 { 1.0 } else { beside }
            })
        };
        (0..LINES).flat_map(|k| entry(k).data.as_vec().clone()).collect()
    };
    let frf = Frf::new(
        one.frf().frequencies_hz().to_vec(),
        channels,
        channels,
        whole(&|k| one.frf().line(k).into_owned(), BESIDE),
    )?;
    let estimate = FrfEstimate::new(
        frf,
        whole(&|k| one.output_covariance(k).into_owned(), 0.0),
        whole(&|k| one.input_factor(k).into_owned(), 0.0),
        one.degrees_of_freedom(),
        one.position().cloned(),
    )?;
    let settings = RegressionSettings {
        rigid_body: RigidTerm::diagonal(channels),
        ..RegressionSettings::default()
    };
    Ok(Box::new(move || {
        black_box(regress(std::slice::from_ref(&estimate), &basis, &settings)?);
        Ok(())
    }))
}

/// Signals of a period: no kernel asks what they mean.
fn period(length: usize, channels: usize, seed: usize) -> Vec<Vec<f64>> {
    (0..channels)
        .map(|c| {
            (0..length)
                .map(|k| ((k * (seed + 2 * c + 3)) % 1009) as f64 - 504.0)
                .collect()
        })
        .collect()
}

/// Periods of one experiment of many: as many as are taken up together.
pub(crate) const TOGETHER: usize = 4;

/// Outputs, inputs and references of a period.
struct Signals([Vec<Vec<f64>>; 3]);

impl Signals {
    fn new(length: usize, channels: usize) -> Self {
        Self([1, 2, 5].map(|seed| period(length, channels, seed)))
    }

    /// Pushes them as these periods of the first experiment.
    fn push(&self, sums: &mut PeriodicAccumulator, periods: Range<usize>) -> Result<(), Failure> {
        let [outputs, inputs, references] = &self.0;
        for period in periods {
            sums.push(&PeriodBlock {
                experiment: 0,
                period,
                outputs,
                inputs,
                references,
            })?;
        }
        Ok(())
    }
}

/// So many periods pushed.
pub(crate) fn accumulation(length: usize, channels: usize) -> Result<Work<'static>, Failure> {
    let mut sums = accumulator(length, channels, None)?;
    let signals = Signals::new(length, channels);
    let mut count = 0;
    Ok(Box::new(move || {
        count += TOGETHER;
        signals.push(&mut sums, count - TOGETHER..count)
    }))
}

/// Transforms of so many signals, nothing else.
pub(crate) fn transforms(length: usize, signals: usize) -> Work<'static> {
    let plan = realfft::RealFftPlanner::<f64>::new().plan_fft_forward(length);
    let (signal, mut input) = (period(length, 1, 1).swap_remove(0), plan.make_input_vec());
    let (mut output, mut scratch) = (plan.make_output_vec(), plan.make_scratch_vec());
    Box::new(move || {
        for _ in 0..signals {
            // A transform spoils its input.
            input.copy_from_slice(&signal);
            plan.process_with_scratch(&mut input, &mut output, &mut scratch)?;
        }
        black_box(&output);
        Ok(())
    })
}

/// A record of so many periods of 4,096 samples.
pub(crate) fn record<'a>(periods: usize) -> Result<Work<'a>, Failure> {
    let signals = Signals::new(1 << 12, 2);
    Ok(Box::new(move || {
        signals.push(&mut accumulator(1 << 12, 2, None)?, 0..periods)
    }))
}

/// From rest, at constant p.
pub(crate) fn simulation(model: &StateSpace<Discrete>, samples: usize) -> Work<'_> {
    let inputs = DMatrix::from_fn(model.inputs(), samples, |i, k| ((k * (i + 2)) % 17) as f64 - 8.0);
    let rest = DVector::zeros(model.states());
    Box::new(move || {
        black_box(model.simulate(&rest, &inputs)?);
        Ok(())
    })
}

/// The plant in its loop while its carriage moves.
pub(crate) fn motion(bench: &Bench, samples: usize) -> Result<Work<'_>, Failure> {
    let settings = MovingSettings {
        noise: Noise::Off,
        ..MovingSettings::default()
    };
    let experiment =
        MovingExperiment::new(&bench.machine, &bench.controller, bench.sweep(samples)?, settings)?;
    Ok(Box::new(move || {
        experiment.stream(1, &mut |sample| -> Result<(), PlantError> {
            black_box(sample);
            Ok(())
        })?;
        Ok(())
    }))
}

/// Responses at many lines.
pub(crate) fn response(model: &StateSpace<Discrete>, lines: Vec<f64>) -> Work<'_> {
    Box::new(move || {
        black_box(model.frequency_response(&lines)?);
        Ok(())
    })
}

/// Four steps of a fit of order 12, to a response with noise of a thousandth: where a fit ends by itself, the noise or rounding
/// decides how many steps it takes.
pub(crate) fn poles(bench: &Bench, lines: usize) -> Result<Work<'_>, Failure> {
    let lines = bench.lines_hz(lines);
    let exact = bench.large_model(14)?.frequency_response(&lines)?;
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut noisy = |v: &C64| {
        let noise: f64 = StandardNormal.sample(&mut rng);
        v * (1.0 + 1e-3 * noise)
    };
    let values = exact.values().iter().map(&mut noisy).collect();
    let frf = Frf::new(lines, exact.outputs(), exact.inputs(), values)?;
    let estimate = FrfEstimate::with_unit_covariance(frf, None)?;
    let settings = PoleFitSettings {
        start_iterations: 3,
        max_iterations: 1,
        ..twelve_poles()
    };
    Ok(Box::new(move || {
        black_box(fit(&estimate, bench.clock, &settings)?);
        Ok(())
    }))
}

/// Two steps of a refinement at as many positions.
pub(crate) fn refinement_at<'a>(positions: usize) -> Result<Work<'a>, Failure> {
    let case = Case::with_positions(positions)?;
    Ok(Box::new(move || refinement(&case, 2)?()))
}

/// So many steps of a refinement: the Jacobian at all lines, compressed by orthogonal transformations, and the trials of each.
pub(crate) fn refinement(case: &Case, steps: usize) -> Result<Work<'_>, Failure> {
    let settings = RefineSettings {
        tolerance: 1e-12,
        max_iterations: steps,
        ..RefineSettings::default()
    };
    Ok(Box::new(move || {
        let account = refine(&case.start, &case.data, &settings)?.account;
        if account.iterations() != steps {
            return Err(format!("{} steps of {steps}", account.iterations()).into());
        }
        Ok(())
    }))
}
