//! The local methods on short records with arbitrary excitation and large transients.
use crate::common::{Loop, clock, normal, plant, rng, simulate};
use frf_estimation::{
    FrfError, HalfWidth, LocalEstimate, LocalLines, LocalSettings, Regressor, local_polynomial,
    local_rational,
};
use lpv_core::{Record, RecordKind};

fn random_records(radius: f64, samples: usize, count: usize, what: Loop, seed: u64) -> Vec<Record> {
    let mut rng = rng(seed);
    let plant = plant(radius);
    (0..count)
        .map(|_| {
            let r: Vec<Vec<f64>> = (0..2)
                .map(|_| (0..samples).map(|_| normal(&mut rng)).collect())
                .collect();
            let mut record = simulate(&plant, &r, samples, what, &mut rng);
            record.kind = RecordKind::Transient;
            record
        })
        .collect()
}

type Method =
    fn(&[&Record], lpv_core::Discrete, &frf_estimation::LocalSettings) -> Result<LocalEstimate, FrfError>;

fn run(method: Method, records: &[Record], settings: LocalSettings) -> LocalEstimate {
    method(&records.iter().collect::<Vec<_>>(), clock(), &settings).unwrap()
}

/// Mean over lines, channels and seeds of squared error over stated variance. With `nu` complex degrees of freedom the
/// mean of `F(2, 2 nu)` is `nu / (nu - 1)`; the ratio is freed of that.
fn calibration(method: Method, radius: f64, settings: &LocalSettings, what: Loop, seeds: u64) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for seed in 0..seeds {
        let records = random_records(radius, 1024, 1, what, 100 + seed);
        let estimate = run(method, &records, settings.clone()).estimate;
        let truth = plant(radius)
            .frequency_response(estimate.frf().frequencies_hz())
            .unwrap();
        let nu = estimate.degrees_of_freedom();
        for l in 0..truth.len() {
            for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let error = (estimate.frf().line(l)[(i, j)] - truth.line(l)[(i, j)]).norm_sqr();
                sum += error / estimate.variance(l, i, j) * (nu - 1.0) / nu;
                count += 1.0;
            }
        }
    }
    sum / count
}

#[test]
fn stated_covariance_agrees_with_the_error() {
    let what = Loop {
        noise: 0.05,
        initial_state: 2.0,
        ..Loop::default()
    };
    // Smooth system: the polynomial is exact enough and noise is all that is left.
    let settings = LocalSettings {
        half_width: HalfWidth::Lines(12),
        ..LocalSettings::default()
    };
    let polynomial = calibration(local_polynomial, 0.7, &settings, what, 6);
    let rational = calibration(local_rational, 0.7, &settings, what, 6);
    // Light damping: only the rational method follows.
    let resonant = calibration(local_rational, 0.99, &settings, what, 6);
    println!(
        "error over stated variance: LPM {polynomial:.3}, LRM {rational:.3}, LRM at a resonance {resonant:.3}"
    );
    assert!((0.9..1.1).contains(&polynomial));
    assert!((0.85..1.2).contains(&rational));
    assert!((0.8..1.25).contains(&resonant));
}

#[test]
fn rational_beats_polynomial_at_a_light_resonance() {
    let what = Loop {
        noise: 1e-4,
        initial_state: 5.0,
        ..Loop::default()
    };
    let records = random_records(0.995, 512, 2, what, 5);
    let largest = |method: Method| {
        let frf = run(method, &records, LocalSettings::default())
            .estimate
            .frf()
            .clone();
        let truth = plant(0.995).frequency_response(frf.frequencies_hz()).unwrap();
        frf.relative_error(&truth)
            .unwrap()
            .into_iter()
            .fold(0.0, f64::max)
    };
    let (polynomial, rational) = (largest(local_polynomial), largest(local_rational));
    println!("largest relative error: LPM {polynomial:.2e}, LRM {rational:.2e}");
    assert!(rational < 0.2 * polynomial && rational < 0.02);
}

#[test]
fn references_serve_in_closed_loop() {
    let what = Loop {
        noise: 1.0,
        gain: 0.5,
        ..Loop::default()
    };
    let settings = LocalSettings {
        half_width: HalfWidth::Lines(20),
        ..LocalSettings::default()
    };
    let (mut with_r, mut with_u) = (0.0, 0.0);
    let mut calibrated = 0.0;
    for seed in 0..4 {
        let records = random_records(0.7, 2048, 1, what, 300 + seed);
        for (regressor, bias) in [
            (Regressor::References, &mut with_r),
            (Regressor::Inputs, &mut with_u),
        ] {
            let e = run(
                local_polynomial,
                &records,
                LocalSettings {
                    regressor,
                    ..settings.clone()
                },
            )
            .estimate;
            let truth = plant(0.7).frequency_response(e.frf().frequencies_hz()).unwrap();
            for l in 0..truth.len() {
                let error = e.frf().line(l) - truth.line(l);
                *bias += error.trace().re / (4.0 * truth.len() as f64);
                if regressor == Regressor::References {
                    calibrated += error[(0, 1)].norm_sqr() / e.variance(l, 0, 1) / (4.0 * truth.len() as f64);
                }
            }
        }
    }
    println!("mean error with references {with_r:.3}, with inputs {with_u:.3}; calibration {calibrated:.3}");
    assert!(with_u.abs() > 0.1 && with_r.abs() < 0.3 * with_u.abs());
    assert!((0.7..1.4).contains(&calibrated));
}

#[test]
fn static_gain_is_exact() {
    let mut records = random_records(0.5, 256, 2, Loop::default(), 9);
    for r in &mut records {
        let (a, b) = (r.inputs.columns[0].clone(), r.inputs.columns[1].clone());
        r.outputs.columns[0] = a.iter().zip(&b).map(|(a, b)| 2.0 * a - b).collect();
        r.outputs.columns[1] = b.iter().map(|b| 0.5 * b).collect();
    }
    for method in [local_polynomial as Method, local_rational] {
        let lines = LocalLines::List(vec![1, 2, 60, 127]);
        let result = run(
            method,
            &records,
            LocalSettings {
                lines,
                ..LocalSettings::default()
            },
        );
        assert_eq!(result.lines, [1, 2, 60, 127]);
        for l in 0..4 {
            let f = result.estimate.frf().line(l);
            let expected = [(0, 0, 2.0), (0, 1, -1.0), (1, 0, 0.0), (1, 1, 0.5)];
            assert!(
                expected.iter().all(|&(i, j, v)| (f[(i, j)] - v).norm() < 1e-9),
                "{f}"
            );
            assert!(result.estimate.variance(l, 0, 0) < 1e-20);
        }
    }
}

#[test]
fn refusals() {
    let records = random_records(0.5, 64, 1, Loop::default(), 9);
    let list: Vec<&Record> = records.iter().collect();
    let wide = LocalSettings {
        half_width: HalfWidth::Lines(40),
        ..LocalSettings::default()
    };
    assert!(matches!(
        local_polynomial(&list, clock(), &wide),
        Err(FrfError::WindowTooWide {
            available: 31,
            window: 81,
            ..
        })
    ));
    let high = LocalSettings {
        degree: 9,
        ..LocalSettings::default()
    };
    assert!(matches!(
        local_polynomial(&list, clock(), &high),
        Err(FrfError::Setting {
            setting: "degree",
            ..
        })
    ));
    let mut same = records.clone();
    same[0].inputs.columns[1] = same[0].inputs.columns[0].clone();
    let plain = LocalSettings::default();
    for method in [local_polynomial as Method, local_rational] {
        assert!(matches!(
            method(&[&same[0]], clock(), &plain),
            Err(FrfError::LocalRank { line: 1, .. })
        ));
    }
}
