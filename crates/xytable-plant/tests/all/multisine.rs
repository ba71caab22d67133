//! Multisines: orthogonal, flat, of the asked peak and lines, for any settings that are accepted.

use num_complex::Complex;
use proptest::prelude::*;
use realfft::RealFftPlanner;
use xytable_plant::{CrestStop, Lines, Multisine, MultisineSettings, PlantError};

fn spectrum(x: &[f64]) -> Vec<Complex<f64>> {
    let plan = RealFftPlanner::new().plan_fft_forward(x.len());
    let (mut input, mut output) = (x.to_vec(), plan.make_output_vec());
    plan.process(&mut input, &mut output).unwrap();
    output
}

/// Largest off-diagonal entry of `R R^H` over its diagonal, the spread of the diagonal over the excited lines, and the
/// largest entry at lines that are not excited, relative to one that is.
fn orthogonality(m: &Multisine) -> (f64, f64, f64) {
    let n = m.inputs();
    let spectra: Vec<Vec<Vec<_>>> = (0..n)
        .map(|e| (0..n).map(|i| spectrum(&m.signal(e, i).unwrap())).collect())
        .collect();
    let product = |i: usize, j: usize, k: usize| -> Complex<f64> {
        (0..n).map(|e| spectra[e][i][k] * spectra[e][j][k].conj()).sum()
    };
    let size = product(0, 0, m.lines()[0]).re;
    let (mut cross, mut spread, mut leak) = (0.0_f64, 0.0_f64, 0.0_f64);
    for k in 0..=m.period() / 2 {
        let excited = m.lines().binary_search(&k).is_ok();
        for i in 0..n {
            for j in 0..n {
                let relative = product(i, j, k).norm() / size;
                if !excited {
                    leak = leak.max(relative.sqrt());
                } else if i == j {
                    spread = spread.max((relative - 1.0).abs());
                } else {
                    cross = cross.max(relative);
                }
            }
        }
    }
    (cross, spread, leak)
}

#[test]
fn one_line_is_a_cosine() {
    let settings = MultisineSettings {
        period: 8,
        lines: Lines::List(vec![1]),
        amplitude: 2.0,
        ..MultisineSettings::default()
    };
    let m = settings.check().unwrap();
    let signal = m.signal(0, 0).unwrap();
    // One line has phase 0 in Schroeder's rule: 2 cos(2 pi k / 8).
    for (k, v) in signal.iter().enumerate() {
        assert!(
            (v - 2.0 * (std::f64::consts::TAU * k as f64 / 8.0).cos()).abs() < 1e-12,
            "{k}: {v}"
        );
    }
    assert_eq!(
        m.signal(1, 1).unwrap(),
        signal.iter().map(|v| -v).collect::<Vec<_>>()
    );
    assert!((m.crest_factor() - 2.0_f64.sqrt()).abs() < 1e-9);
    assert_eq!(
        m.signal(2, 0),
        Err(PlantError::Length {
            what: "experiments of a multisine",
            expected: 2,
            found: 3
        })
    );
}

#[test]
fn the_default_reaches_nyquist_with_a_low_crest_factor() {
    let m = MultisineSettings::default().check().unwrap();
    assert_eq!(
        (m.lines().len(), m.lines()[0], m.lines()[16383]),
        (1 << 14, 1, 1 << 14)
    );
    assert!(
        m.crest_factor() < 1.3 && m.crest_factor() < m.first_crest_factor(),
        "{}",
        m.crest_factor()
    );
    assert_eq!((m.iterations(), m.stop()), (50, CrestStop::Iterations));
    let (cross, spread, leak) = orthogonality(&m);
    assert!(
        cross < 1e-9 && spread < 1e-9 && leak < 1e-9,
        "{cross:e} {spread:e} {leak:e}"
    );
}

#[test]
fn odd_random_lines_leave_one_of_a_group_out() {
    let settings = |seed| MultisineSettings {
        period: 256,
        lines: Lines::OddRandom { group: 4 },
        seed,
        ..MultisineSettings::default()
    };
    let m = settings(1).check().unwrap();
    assert_eq!(m.detection_lines().len(), 16);
    assert_eq!(m.lines().len(), 48);
    assert!(m.lines().iter().chain(m.detection_lines()).all(|k| k % 2 == 1));
    for group in 0..16 {
        let inside = |k: &&usize| **k / 8 == group;
        assert_eq!(m.detection_lines().iter().filter(inside).count(), 1);
    }
    assert_eq!(m, settings(1).check().unwrap());
    assert_ne!(m.lines(), settings(2).check().unwrap().lines());
}

#[test]
fn impossible_lines_are_refused() {
    let with = |period, lines, inputs| {
        MultisineSettings {
            period,
            lines,
            inputs,
            ..MultisineSettings::default()
        }
        .check()
        .err()
    };
    let line = |index, line, highest| Some(PlantError::Line { index, line, highest });
    assert_eq!(with(16, Lines::List(vec![3, 9]), 2), line(1, 9, 8));
    assert_eq!(with(16, Lines::List(vec![3, 3]), 2), line(1, 3, 8));
    assert_eq!(with(16, Lines::List(vec![0]), 2), line(0, 0, 8));
    assert_eq!(with(16, Lines::Band { first: 4, last: 3 }, 2), line(0, 4, 8));
    assert_eq!(
        with(16, Lines::List(Vec::new()), 2),
        Some(PlantError::NoLines { period: 16 })
    );
    // The Nyquist line is real, and the phase shifts of three inputs are not.
    assert_eq!(with(16, Lines::Full, 3), line(7, 8, 7));
}

fn any_lines() -> impl Strategy<Value = Lines> {
    prop_oneof![
        Just(Lines::Full),
        Just(Lines::Odd),
        (0_usize..6).prop_map(|group| Lines::OddRandom { group }),
        (0_usize..40, 0_usize..80).prop_map(|(first, last)| Lines::Band { first, last }),
        prop::collection::vec(0_usize..60, 0..12).prop_map(Lines::List),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn orthogonal_flat_and_of_the_asked_peak(
        period in 4_usize..200, lines in any_lines(), inputs in 1_usize..5, seed in any::<u64>()
    ) {
        let settings = MultisineSettings { period, lines, inputs, seed, amplitude: 1e-4, crest_iterations: 5 };
        if let Ok(m) = settings.check() {
            let (cross, spread, leak) = orthogonality(&m);
            prop_assert!(cross < 1e-9 && spread < 1e-9 && leak < 1e-9, "{cross:e} {spread:e} {leak:e}");
            let peak = (0..inputs)
                .flat_map(|e| (0..inputs).map(move |i| (e, i)))
                .flat_map(|(e, i)| m.signal(e, i).unwrap())
                .fold(0.0_f64, |a, v| a.max(v.abs()));
            prop_assert!((peak / 1e-4 - 1.0).abs() < 1e-12, "{peak:e}");
        }
    }

    #[test]
    fn wild_settings_never_panic(
        period in prop_oneof![0_usize..70, Just(usize::MAX)],
        lines in any_lines(),
        amplitude in any::<f64>(),
        inputs in 0_usize..70,
        crest_iterations in prop_oneof![0_usize..4, Just(usize::MAX)],
        seed in any::<u64>(),
    ) {
        let _ = MultisineSettings { period, lines, amplitude, inputs, crest_iterations, seed }.check();
    }
}
