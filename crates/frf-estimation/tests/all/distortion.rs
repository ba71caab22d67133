//! Nonlinear distortion: told from noise, and odd from even.
use crate::common::{Loop, clock, multisine, orthogonal_pair, plant, rng, simulate};
use frf_estimation::{PeriodicEstimate, PeriodicSettings, SkipRule, confidence_radius, estimate_records};
use lpv_core::Record;

const PERIOD: usize = 2048;

/// Odd lines up to two thirds of the band, one of each group of three left out.
fn odd_random() -> Vec<usize> {
    (0..340)
        .filter(|i| i % 3 != (i / 3) % 3)
        .map(|i| 2 * i + 1)
        .collect()
}

fn run(records: &[Record]) -> PeriodicEstimate {
    let settings = PeriodicSettings {
        skip: SkipRule::Fixed(1),
        ..PeriodicSettings::default()
    };
    estimate_records(&records.iter().collect::<Vec<_>>(), clock(), &settings).unwrap()
}

fn fast(what: Loop) -> PeriodicEstimate {
    let records = orthogonal_pair(&plant(0.9), &odd_random(), PERIOD, [9, 9], what, &mut rng(7));
    run(&records)
}

#[test]
fn detection_lines_tell_odd_from_even() {
    let base = Loop {
        noise: 1e-3,
        gain: 0.2,
        ..Loop::default()
    };
    let linear = fast(base).distortion.unwrap().detection.unwrap();
    // The multisine has a root mean square of about 15 (226 lines), so u^3 is about 1e-4 * 3 * 226 = 7 % of u.
    let odd = fast(Loop { cubic: 1e-4, ..base })
        .distortion
        .unwrap()
        .detection
        .unwrap();
    let even = fast(Loop {
        quadratic: 1e-3,
        ..base
    })
    .distortion
    .unwrap()
    .detection
    .unwrap();
    for (name, d) in [("linear", &linear), ("cubic", &odd), ("quadratic", &even)] {
        println!("{name}: odd {:?}, even {:?}", d.odd_relative, d.even_relative);
    }
    let level = |d: &Option<Vec<f64>>| d.as_ref().unwrap().iter().copied().fold(0.0, f64::max);
    assert!(level(&linear.odd_relative) < 1e-3 && level(&linear.even_relative) < 1e-3);
    assert!(level(&odd.odd_relative) > 1e-2 && level(&odd.even_relative) < 0.2 * level(&odd.odd_relative));
    assert!(
        level(&even.even_relative) > 3e-3 && level(&even.odd_relative) < 0.2 * level(&even.even_relative)
    );
    assert_eq!(linear.output_level.len(), 2 * linear.lines.len());
    assert!(linear.lines.iter().all(|k| !odd_random().contains(k)));
}

fn realisations(what: Loop, count: usize) -> PeriodicEstimate {
    let mut rng = rng(11);
    let lines: Vec<usize> = (1..=800).collect();
    let plant = plant(0.9);
    let mut records = Vec::new();
    for _ in 0..count {
        records.extend(orthogonal_pair(&plant, &lines, PERIOD, [5, 5], what, &mut rng));
    }
    run(&records)
}

#[test]
fn realisations_tell_distortion_from_noise() {
    let noisy = Loop {
        noise: 0.3,
        gain: 0.2,
        ..Loop::default()
    };
    let linear = realisations(noisy, 4);
    let d = linear.distortion.as_ref().unwrap().realisations.as_ref().unwrap();
    assert_eq!(d.realisations, 4);
    let mean_square = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>() / v.len() as f64;
    let ratio = mean_square(&d.total) / mean_square(&d.noise);
    println!(
        "linear: total over noise {ratio:.3}, nonlinear {:?}",
        d.nonlinear_relative
    );
    assert!((ratio - 1.0).abs() < 0.06);

    // The region still holds the truth, a little generously because the excess variance is kept positive.
    let frf = linear.estimate.frf();
    let truth = plant(0.9).frequency_response(frf.frequencies_hz()).unwrap();
    let mut hits = 0;
    for l in 0..frf.len() {
        let error = (frf.line(l)[(0, 1)] - truth.line(l)[(0, 1)]).norm();
        hits += usize::from(error <= confidence_radius(&linear.estimate, l, 0, 1, 0.95));
    }
    let covered = hits as f64 / frf.len() as f64;
    println!("coverage with total variance {covered:.4}");
    assert!((0.93..=0.99).contains(&covered));

    let quiet = Loop {
        noise: 1e-4,
        cubic: 1e-4,
        gain: 0.2,
        ..Loop::default()
    };
    let nonlinear = realisations(quiet, 4);
    let d = nonlinear.distortion.unwrap().realisations.unwrap();
    println!("cubic: nonlinear {:?}", d.nonlinear_relative);
    assert!(d.nonlinear_relative.iter().all(|r| *r > 0.01 && *r < 0.5));
    assert!(mean_square(&d.nonlinear) > 100.0 * mean_square(&d.noise));
}

#[test]
fn total_variance_predicts_the_scatter_of_the_estimate() {
    // The best linear approximation from 3 realisations, twice with fresh phases: the two differ as the covariance says.
    let what = Loop {
        noise: 1e-3,
        cubic: 2e-4,
        ..Loop::default()
    };
    let lines: Vec<usize> = (1..=800).collect();
    let plant = plant(0.9);
    let one = |seed: u64| {
        let mut rng = rng(seed);
        let mut records = Vec::new();
        for _ in 0..6 {
            let r: Vec<Vec<f64>> = (0..2).map(|_| multisine(PERIOD, &lines, &mut rng)).collect();
            records.push(simulate(&plant, &r, 4 * PERIOD, what, &mut rng));
        }
        run(&records).estimate
    };
    let (mut measured, mut stated) = (0.0, 0.0);
    for pair in 0..6 {
        let (a, b) = (one(2 * pair), one(2 * pair + 1));
        for l in 0..a.frf().len().min(b.frf().len()) {
            // Relative to the first variance, so that no line dominates.
            let scale = a.variance(l, 1, 0) + b.variance(l, 1, 0);
            measured += (a.frf().line(l)[(1, 0)] - b.frf().line(l)[(1, 0)]).norm_sqr() / scale;
            stated += 1.0;
        }
    }
    println!("scatter over stated variance {:.3}", measured / stated);
    assert!((0.7..1.3).contains(&(measured / stated)));
}
