//! Identities that hold for any data, and sensitivities against finite differences.
use crate::common::{Loop, clock, normal, orthogonal_pair, plant, rng, simulate};
use frf_estimation::{
    HalfWidth, LocalLines, LocalSettings, PeriodicEstimate, PeriodicSettings, SkipRule, estimate_records,
    local_polynomial, local_rational,
};
use lpv_core::{Record, RecordKind};
use proptest::prelude::*;

fn run(records: &[Record]) -> PeriodicEstimate {
    let settings = PeriodicSettings {
        skip: SkipRule::Fixed(1),
        ..PeriodicSettings::default()
    };
    estimate_records(&records.iter().collect::<Vec<_>>(), clock(), &settings).unwrap()
}

fn experiments(seed: u64) -> Vec<Record> {
    let what = Loop {
        noise: 0.1,
        gain: 0.2,
        ..Loop::default()
    };
    let lines: Vec<usize> = (1..=20).collect();
    orthogonal_pair(&plant(0.8), &lines, 64, [5, 5], what, &mut rng(seed))
}

fn close(a: &PeriodicEstimate, b: &PeriodicEstimate, y: f64, u: f64) -> bool {
    a.excited_lines == b.excited_lines
        && (0..a.excited_lines.len()).all(|l| {
            let (fa, fb) = (a.estimate.frf().line(l), b.estimate.frf().line(l));
            let (va, vb) = (a.estimate.variance(l, 1, 0), b.estimate.variance(l, 1, 0));
            let factor = lpv_core::num_complex::Complex::new(y / u, 0.0);
            (fa * factor - fb).norm() < 1e-9 * fb.norm() && (va * (y / u).powi(2) / vb - 1.0).abs() < 1e-9
        })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn units_scale_the_estimate(seed in 0..1000u64, y in -6.0..6.0f64, u in -6.0..6.0f64, r in -6.0..6.0f64) {
        let (y, u, r) = (10f64.powf(y), 10f64.powf(u), 10f64.powf(r));
        let records = experiments(seed);
        let mut scaled = records.clone();
        for record in &mut scaled {
            record.outputs.columns.iter_mut().flatten().for_each(|v| *v *= y);
            record.inputs.columns.iter_mut().flatten().for_each(|v| *v *= u);
            record.references.columns.iter_mut().flatten().for_each(|v| *v *= r);
        }
        prop_assert!(close(&run(&records), &run(&scaled), y, u));
    }

    #[test]
    fn order_of_experiments_does_not_matter(seed in 0..1000u64) {
        let mut records = experiments(seed);
        let forward = run(&records);
        records.reverse();
        prop_assert!(close(&forward, &run(&records), 1.0, 1.0));
    }
}

/// Adds `amplitude cos(2 pi k t / N)`, a line of `amplitude / 2`, to a channel.
fn add_line(samples: &mut [f64], k: usize, n: usize, amplitude: f64) {
    for (t, v) in samples.iter_mut().enumerate() {
        *v += amplitude * (std::f64::consts::TAU * ((k * t) % n) as f64 / n as f64).cos();
    }
}

#[test]
fn input_factor_is_the_sensitivity_of_the_periodic_estimate() {
    let records = experiments(3);
    let base = run(&records);
    let (l, k) = (6, 7);
    assert_eq!(base.excited_lines[l], k);
    let mut sums = [0.0; 2];
    for e in 0..2 {
        let mut changed = records.clone();
        add_line(&mut changed[e].outputs.columns[0], k, 64, 2e-3);
        let f = run(&changed);
        for (j, sum) in sums.iter_mut().enumerate() {
            let d = (f.estimate.frf().line(l)[(0, j)] - base.estimate.frf().line(l)[(0, j)]) / 1e-3;
            *sum += d.norm_sqr();
        }
    }
    for j in 0..2 {
        let s = base.estimate.input_factor(l)[(j, j)].re;
        assert!((sums[j] / s - 1.0).abs() < 1e-8, "{} {s}", sums[j]);
    }
}

/// Sum over the window of squared sensitivities to one output line, relative to the stated factor, at each given line.
fn local_sensitivities(rational: bool, radius: f64, lines: &[usize]) -> Vec<f64> {
    let n = 512;
    let mut rng = rng(8);
    let r: Vec<Vec<f64>> = (0..2)
        .map(|_| (0..n).map(|_| normal(&mut rng)).collect())
        .collect();
    let mut record = simulate(
        &plant(radius),
        &r,
        n,
        Loop {
            initial_state: 3.0,
            ..Loop::default()
        },
        &mut rng,
    );
    record.kind = RecordKind::Transient;
    record.outputs.columns.truncate(1);
    let run = |record: &Record, k: usize| {
        let settings = LocalSettings {
            half_width: HalfWidth::Lines(10),
            lines: LocalLines::List(vec![k]),
            ..LocalSettings::default()
        };
        let method = if rational {
            local_rational
        } else {
            local_polynomial
        };
        method(&[record], clock(), &settings).unwrap().estimate
    };
    lines
        .iter()
        .map(|&k| {
            let base = run(&record, k);
            let mut sum = 0.0;
            for w in k - 10..=k + 10 {
                let mut changed = record.clone();
                add_line(&mut changed.outputs.columns[0], w, n, 2e-7);
                let d = (run(&changed, k).frf().line(0)[(0, 1)] - base.frf().line(0)[(0, 1)]) / 1e-7;
                sum += d.norm_sqr();
            }
            sum / base.input_factor(0)[(1, 1)].re
        })
        .collect()
}

#[test]
fn input_factor_is_the_sensitivity_of_the_local_estimates() {
    let polynomial = local_sensitivities(false, 0.7, &[20, 41, 98]);
    // Lines 41 and 98 are next to the resonances, at 40.7 and 97.8.
    let rational = local_sensitivities(true, 0.98, &[41, 98]);
    println!("polynomial {polynomial:?}, rational {rational:?}");
    assert!(polynomial.iter().all(|r| (r - 1.0).abs() < 1e-5));
    assert!(rational.iter().all(|r| (r - 1.0).abs() < 0.05));
}
