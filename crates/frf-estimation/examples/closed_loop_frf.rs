//! A resonance in closed loop, two experiments, 12 periods: FRF, stated and true error, coverage.

use frf_estimation::{Layout, PeriodicAccumulator, PeriodicSettings, SkipRule, confidence_radius};
use lpv_core::nalgebra::{DMatrix, DVector};
use lpv_core::{Discrete, PeriodBlock, StateSpace};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const PERIOD: usize = 1024;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let clock = Discrete::from_rate(20.0)?;
    let a = DMatrix::from_row_slice(2, 2, &[0.87, 0.47, -0.47, 0.87]);
    let b = DMatrix::from_row_slice(2, 2, &[0.2, 0.1, 0.3, -0.2]);
    let c = DMatrix::from_row_slice(2, 2, &[0.5, 0.1, -0.2, 0.4]);
    let plant = StateSpace::new(a, b, c, DMatrix::zeros(2, 2), clock)?;

    // Random-phase multisines on all lines; the second experiment turns the sign of the second reference.
    let multisine = |rng: &mut ChaCha8Rng| -> Vec<f64> {
        let phases: Vec<f64> = (1..PERIOD / 2)
            .map(|_| rng.random::<f64>() * std::f64::consts::TAU)
            .collect();
        let w = std::f64::consts::TAU / PERIOD as f64;
        let at = |t: usize| {
            (1..PERIOD / 2)
                .map(|k| (w * (k * t) as f64 + phases[k - 1]).cos())
                .sum()
        };
        (0..PERIOD).map(at).collect()
    };
    let (r1, r2) = (multisine(&mut rng), multisine(&mut rng));

    let layout = Layout {
        period: PERIOD,
        outputs: 2,
        inputs: 2,
        references: 2,
        experiments: 2,
        sample_rate_hz: 20.0,
    };
    let settings = PeriodicSettings {
        skip: SkipRule::Fixed(2),
        ..PeriodicSettings::default()
    };
    let mut accumulator = PeriodicAccumulator::new(layout, &settings, None)?;
    for (experiment, sign) in [1.0, -1.0].into_iter().enumerate() {
        let references = [r1.clone(), r2.iter().map(|v| v * sign).collect()];
        let mut x = DVector::zeros(2);
        for period in 0..12 {
            let mut outputs = vec![Vec::new(); 2];
            let mut inputs = outputs.clone();
            for t in 0..PERIOD {
                let mut y = plant.c() * &x;
                y.iter_mut().for_each(|v| {
                    *v += 0.3 * {
                        let n: f64 = StandardNormal.sample(&mut rng);
                        n
                    }
                });
                let u = DVector::from_fn(2, |i, _| references[i][t] - 0.2 * y[i]);
                x = plant.a() * x + plant.b() * &u;
                for i in 0..2 {
                    outputs[i].push(y[i]);
                    inputs[i].push(u[i]);
                }
            }
            accumulator.push(&PeriodBlock {
                experiment,
                period,
                outputs: &outputs,
                inputs: &inputs,
                references: &references,
            })?;
        }
    }
    let result = accumulator.finish()?;
    let frf = result.estimate.frf();
    let truth = plant.frequency_response(frf.frequencies_hz())?;

    println!(
        "{} lines, {} periods used, instrument {:?}",
        frf.len(),
        result.periods_used,
        result.instrument
    );
    println!(
        "worst condition of U R^H: {:.2} at {:.3} Hz",
        result.condition.worst, result.condition.worst_frequency_hz
    );
    println!("   Hz      |F11|    stated    true error   radius (95 %)");
    let mut inside = 0;
    for l in 0..frf.len() {
        let error = (frf.line(l)[(0, 0)] - truth.line(l)[(0, 0)]).norm();
        let radius = confidence_radius(&result.estimate, l, 0, 0, 0.95);
        inside += usize::from(error <= radius);
        if l % 64 == 31 {
            let deviation = result.estimate.variance(l, 0, 0).sqrt();
            let size = truth.line(l)[(0, 0)].norm();
            println!(
                "{:7.3}  {size:8.4}  {deviation:.2e}     {error:.2e}     {radius:.2e}",
                frf.frequencies_hz()[l]
            );
        }
    }
    println!(
        "true value inside its 95 % region at {:.1} % of the lines",
        100.0 * inside as f64 / frf.len() as f64
    );
    Ok(())
}
