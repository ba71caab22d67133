//! The periodic estimator against systems that are known.
use crate::common::{Loop, RATE, clock, orthogonal_pair, plant, rng};
use frf_estimation::{
    FrfError, Instrument, Layout, LineSelection, PeriodicAccumulator, PeriodicEstimate, PeriodicSettings,
    SkipRule, confidence_radius, estimate_records,
};
use lpv_core::num_complex::Complex;
use lpv_core::{Discrete, PeriodBlock, Record, StateSpace};

fn fixed(skip: usize) -> PeriodicSettings {
    PeriodicSettings {
        skip: SkipRule::Fixed(skip),
        ..PeriodicSettings::default()
    }
}

fn refs(records: &[Record]) -> Vec<&Record> {
    records.iter().collect()
}

/// Entries inside their 95 % region, and all entries.
fn inside(result: &PeriodicEstimate, plant: &StateSpace<Discrete>) -> (usize, usize) {
    let frf = result.estimate.frf();
    let truth = plant.frequency_response(frf.frequencies_hz()).unwrap();
    let (mut hits, mut all) = (0, 0);
    for l in 0..frf.len() {
        for i in 0..2 {
            for j in 0..2 {
                let error = (frf.line(l)[(i, j)] - truth.line(l)[(i, j)]).norm();
                hits += usize::from(error <= confidence_radius(&result.estimate, l, i, j, 0.95));
                all += 1;
            }
        }
    }
    (hits, all)
}

fn coverage(periods: [usize; 2], seeds: std::ops::Range<u64>) -> f64 {
    let plant = plant(0.95);
    let lines: Vec<usize> = (1..4096).collect();
    let what = Loop {
        noise: 1e-1,
        gain: 0.2,
        ..Loop::default()
    };
    let (mut hits, mut all) = (0, 0);
    for seed in seeds {
        let records = orthogonal_pair(&plant, &lines, 8192, periods, what, &mut rng(seed));
        let result = estimate_records(&refs(&records), clock(), &fixed(1)).unwrap();
        assert_eq!(result.instrument, Instrument::References);
        assert_eq!(result.excited_lines, lines);
        let (h, a) = inside(&result, &plant);
        hits += h;
        all += a;
    }
    hits as f64 / all as f64
}

#[test]
fn coverage_of_the_95_percent_region() {
    let covered = coverage([16, 16], 0..4);
    println!("coverage {covered:.4}");
    assert!((0.945..=0.955).contains(&covered), "{covered}");
}

#[test]
fn coverage_with_unequal_numbers_of_periods() {
    let covered = coverage([4, 13], 10..13);
    println!("coverage {covered:.4}");
    assert!((0.945..=0.955).contains(&covered), "{covered}");
}

#[test]
fn few_periods_widen_the_region() {
    let covered = coverage([3, 3], 20..23);
    println!("coverage {covered:.4}");
    assert!((0.945..=0.955).contains(&covered), "{covered}");
}

#[test]
fn gain_and_delay_by_hand() {
    // y(t) = 2 u(t - 1), u = cos + noise-free: F = 2 exp(-j w) at the one excited line, period 8.
    let u: Vec<f64> = (0..8)
        .map(|t| (std::f64::consts::TAU * t as f64 / 8.0).cos())
        .collect();
    let y: Vec<f64> = (0..8).map(|t| 2.0 * u[(t + 7) % 8]).collect();
    let layout = Layout {
        period: 8,
        outputs: 1,
        inputs: 1,
        references: 0,
        experiments: 1,
        sample_rate_hz: 8.0,
    };
    let mut acc = PeriodicAccumulator::new(layout, &fixed(1), None).unwrap();
    for period in 0..4 {
        acc.push(&PeriodBlock {
            experiment: 0,
            period,
            outputs: std::slice::from_ref(&y),
            inputs: std::slice::from_ref(&u),
            references: &[],
        })
        .unwrap();
    }
    let result = acc.finish().unwrap();
    assert_eq!(result.excited_lines, [1]);
    assert_eq!((result.periods_used, result.periods_skipped), (3, 1));
    assert_eq!(result.instrument, Instrument::Inputs);
    assert_eq!(result.estimate.frf().frequencies_hz(), [1.0]);
    let expected = Complex::from_polar(2.0, -std::f64::consts::TAU / 8.0);
    assert!((result.estimate.frf().line(0)[(0, 0)] - expected).norm() < 1e-14);
    assert!(result.estimate.variance(0, 0, 0) < 1e-30);
    assert_eq!(result.estimate.degrees_of_freedom(), 2.0);
    assert!((result.condition.worst - 1.0).abs() < 1e-14);
    assert_eq!(result.noise_floor.lines, [2, 3]);
}

#[test]
fn references_remove_the_bias_of_the_closed_loop() {
    // With noise as strong as the signal, (14) leans towards the inverse of the controller and (15) does not.
    let plant = plant(0.8);
    let lines: Vec<usize> = (1..1024).collect();
    let what = Loop {
        noise: 30.0,
        gain: 0.5,
        ..Loop::default()
    };
    let records = orthogonal_pair(&plant, &lines, 2048, [60, 60], what, &mut rng(1));
    let listed = |instrument| {
        let settings = PeriodicSettings {
            skip: SkipRule::Fixed(1),
            instrument,
            lines: LineSelection::List(lines.clone()),
            ..PeriodicSettings::default()
        };
        estimate_records(&refs(&records), clock(), &settings).unwrap()
    };
    let result = listed(Instrument::References);
    let by_inputs = listed(Instrument::Inputs);
    // The two coincide for square experiments, (Y R^H)(U R^H)^-1 = Y U^-1; they part with more experiments.
    assert_eq!(result.estimate.frf(), &result.direct);
    let gap = result
        .estimate
        .frf()
        .relative_error(by_inputs.estimate.frf())
        .unwrap();
    assert!(gap.iter().all(|g| *g < 1e-9));

    // 24 noisy repetitions of two periods as experiments of their own.
    let mut pieces = Vec::new();
    for record in &records {
        for m in 0..24 {
            let mut piece = record.clone();
            let columns = [&mut piece.outputs, &mut piece.inputs, &mut piece.references];
            for signals in columns {
                for c in &mut signals.columns {
                    *c = c[(1 + 2 * m) * 2048..(3 + 2 * m) * 2048].to_vec();
                }
            }
            pieces.push(piece);
        }
    }
    let settings = PeriodicSettings {
        skip: SkipRule::Fixed(0),
        lines: LineSelection::List(lines.clone()),
        ..PeriodicSettings::default()
    };
    let many = estimate_records(&refs(&pieces), clock(), &settings).unwrap();
    let truth = plant.frequency_response(many.direct.frequencies_hz()).unwrap();
    let bias = |f: &lpv_core::Frf| {
        let mut sum = Complex::new(0.0, 0.0);
        for l in 0..f.len() {
            sum += (f.line(l) - truth.line(l)).trace();
        }
        sum.norm() / f.len() as f64
    };
    let (with_r, with_u) = (bias(many.estimate.frf()), bias(&many.direct));
    println!("mean error of (15) {with_r:.4}, of (14) {with_u:.4}");
    assert!(with_u > 0.1 && with_r < 0.2 * with_u);
}

#[test]
fn interleaved_stream_gives_the_same_estimate_as_records() {
    let plant = plant(0.9);
    let lines: Vec<usize> = (1..=100).collect();
    let what = Loop {
        noise: 1e-3,
        gain: 0.2,
        ..Loop::default()
    };
    let records = orthogonal_pair(&plant, &lines, 256, [5, 5], what, &mut rng(2));
    let whole = estimate_records(&refs(&records), clock(), &fixed(2)).unwrap();
    let layout = Layout {
        period: 256,
        outputs: 2,
        inputs: 2,
        references: 2,
        experiments: 2,
        sample_rate_hz: RATE,
    };
    let mut acc = PeriodicAccumulator::new(layout, &fixed(2), Some(0.1.into())).unwrap();
    for period in 0..5 {
        for experiment in [1, 0] {
            let cut = |s: &lpv_core::Signals| -> Vec<Vec<f64>> {
                let range = period * 256..(period + 1) * 256;
                s.columns.iter().map(|c| c[range.clone()].to_vec()).collect()
            };
            let record = &records[experiment];
            acc.push(&PeriodBlock {
                experiment,
                period,
                outputs: &cut(&record.outputs),
                inputs: &cut(&record.inputs),
                references: &cut(&record.references),
            })
            .unwrap();
        }
    }
    let streamed = acc.finish().unwrap();
    assert_eq!(streamed.estimate.frf(), whole.estimate.frf());
    // The scatter is summed over the experiments in the order in which they come.
    for k in 0..whole.estimate.frf().len() {
        let (a, b) = (&streamed.estimate, &whole.estimate);
        let (own, other) = (a.output_covariance(k), b.output_covariance(k));
        assert!((own - other).norm() < 1e-13 * other.norm(), "line {k}");
        assert_eq!(a.input_factor(k), b.input_factor(k));
    }
    for (a, b) in streamed.output_snr.iter().zip(&whole.output_snr) {
        assert!((a - b).abs() < 1e-13 * b);
    }
    assert_eq!(whole.estimate.single_position(), Some(0.1));
}

#[test]
fn automatic_skip_drops_the_transient() {
    // From some 25 in each output, 0.995^(256 m) brings the transient below the noise of 1e-3 at m = 8; over a whole
    // period it is lost in the noise a little earlier.
    let plant = plant(0.995);
    let lines: Vec<usize> = (1..=120).collect();
    let what = Loop {
        noise: 1e-3,
        initial_state: 50.0,
        ..Loop::default()
    };
    let records = orthogonal_pair(&plant, &lines, 256, [30, 30], what, &mut rng(3));
    let settings = PeriodicSettings::default();
    let result = estimate_records(&refs(&records), clock(), &settings).unwrap();
    println!("skipped {}", result.periods_skipped);
    assert!((6..=9).contains(&result.periods_skipped));
    // A transient that outlasts the record: half of the periods at most.
    let short: Vec<Record> = orthogonal_pair(&plant, &lines, 256, [6, 6], what, &mut rng(3));
    let result = estimate_records(&refs(&short), clock(), &settings).unwrap();
    assert_eq!(result.periods_skipped, 3);

    let what = Loop {
        initial_state: 0.0,
        noise: 1e-3,
        ..Loop::default()
    };
    let plant = crate::common::plant(0.5);
    let records = orthogonal_pair(&plant, &lines, 256, [20, 20], what, &mut rng(4));
    let result = estimate_records(&refs(&records), clock(), &settings).unwrap();
    assert!(result.periods_skipped <= 1, "{}", result.periods_skipped);
}

#[test]
fn reference_that_varies_is_averaged() {
    // The second and third period carry another reference amplitude; the mean is what counts.
    let layout = Layout {
        period: 16,
        outputs: 1,
        inputs: 1,
        references: 1,
        experiments: 1,
        sample_rate_hz: 16.0,
    };
    let mut acc = PeriodicAccumulator::new(layout, &fixed(0), None).unwrap();
    for (period, a) in [1.0, 1.0, 1.0, 2.0, 3.0].into_iter().enumerate() {
        let wave = |phase: f64| -> Vec<f64> {
            (0..16)
                .map(|t| a * (std::f64::consts::TAU * t as f64 / 16.0 + phase).cos())
                .collect()
        };
        let (y, u) = (wave(0.3), wave(0.1));
        acc.push(&PeriodBlock {
            experiment: 0,
            period,
            outputs: &[y],
            inputs: std::slice::from_ref(&u),
            references: std::slice::from_ref(&u),
        })
        .unwrap();
    }
    let result = acc.finish().unwrap();
    let expected = Complex::from_polar(1.0, 0.2);
    assert!((result.estimate.frf().line(0)[(0, 0)] - expected).norm() < 1e-12);
    // dF = V G with G = 1 / U, and U = 0.8 exp(0.1 j): the mean amplitude 1.6, half of it at the positive line.
    let s = result.estimate.input_factor(0)[(0, 0)].re;
    assert!((s - 1.0 / 0.64).abs() < 1e-12, "{s}");
}

#[test]
fn refusals_name_the_place() {
    let plant = plant(0.5);
    let lines: Vec<usize> = (1..=30).collect();
    let what = Loop {
        noise: 1e-3,
        ..Loop::default()
    };
    let records = orthogonal_pair(&plant, &lines, 64, [4, 4], what, &mut rng(5));
    let twice = [&records[0], &records[0]];
    match estimate_records(&twice, clock(), &fixed(0)) {
        Err(FrfError::Singular {
            line: 1,
            frequency_hz,
            condition,
        }) => assert!(frequency_hz == RATE / 64.0 && condition > 1e8),
        other => panic!("{other:?}"),
    }
    assert!(matches!(
        estimate_records(&refs(&records), clock(), &fixed(3)),
        Err(FrfError::TooFewPeriods {
            experiment: 0,
            used: 1,
            skipped: 3
        })
    ));
    assert!(matches!(
        estimate_records(&[&records[0]], clock(), &fixed(0)),
        Err(FrfError::TooFewExperiments {
            experiments: 1,
            inputs: 2
        })
    ));
    assert!(matches!(
        estimate_records(&[], clock(), &fixed(0)),
        Err(FrfError::NoRecords)
    ));
    let with = |lines| PeriodicSettings {
        skip: SkipRule::Fixed(0),
        lines,
        ..PeriodicSettings::default()
    };
    assert!(matches!(
        estimate_records(&refs(&records), clock(), &with(LineSelection::List(vec![5, 32]))),
        Err(FrfError::Line {
            entry: 1,
            line: 32,
            last: 31
        })
    ));
    assert!(with(LineSelection::List(vec![5, 5])).check().is_err());
    assert!(
        with(LineSelection::Excited {
            relative_threshold: f64::NAN
        })
        .check()
        .is_err()
    );
    let mut silent = records.clone();
    for record in &mut silent {
        record.inputs.columns.iter_mut().flatten().for_each(|v| *v = 1.0);
        record
            .references
            .columns
            .iter_mut()
            .flatten()
            .for_each(|v| *v = 1.0);
    }
    assert!(matches!(
        estimate_records(&refs(&silent), clock(), &fixed(0)),
        Err(FrfError::NoExcitation { what: "the input" })
    ));
    let auto = PeriodicSettings::default();
    let layout = Layout {
        period: 64,
        outputs: 2,
        inputs: 2,
        references: 2,
        experiments: 2,
        sample_rate_hz: RATE,
    };
    assert!(matches!(
        PeriodicAccumulator::new(layout, &auto, None),
        Err(FrfError::AutoSkipNeedsRecords)
    ));
}

/// A stationary signal that repeats, with a little of its own in each period.
fn periods(length: usize, count: usize, noise: f64, seed: u64) -> Vec<Vec<f64>> {
    use rand::RngExt;
    let mut rng = rng(seed);
    let mut white =
        |size: f64| -> Vec<f64> { (0..length).map(|_| size * (rng.random::<f64>() - 0.5)).collect() };
    let same = white(1.0);
    let add = |own: Vec<f64>| same.iter().zip(own).map(|(a, b)| a + b).collect();
    (0..count).map(|_| white(noise)).map(add).collect()
}

/// One experiment of one input and one output, all its periods.
fn siso(u: &[Vec<f64>], y: &[Vec<f64>], settings: &PeriodicSettings) -> Result<PeriodicEstimate, FrfError> {
    let layout = Layout {
        period: u[0].len(),
        outputs: 1,
        inputs: 1,
        references: 0,
        experiments: 1,
        sample_rate_hz: 1.0,
    };
    let mut sums = PeriodicAccumulator::new(layout, settings, None)?;
    for (period, (u, y)) in u.chunks(1).zip(y.chunks(1)).enumerate() {
        sums.push(&PeriodBlock {
            experiment: 0,
            period,
            outputs: y,
            inputs: u,
            references: &[],
        })?;
    }
    sums.finish()
}

/// A band of lines with a leftover 66 to 80 dB below it everywhere, exact in the input. Where noise hides the answer to the leftover the
/// lines of the band are all there is; without noise the others are known too.
#[test]
fn a_leftover_far_below_the_band_counts_where_the_output_shows_it() {
    let (n, last) = (1000, 100);
    for leftover in [5e-4, 1e-4] {
        let wave = |t: usize, k: usize| {
            (std::f64::consts::TAU * ((k * t) as f64 / n as f64 + (k * k) as f64 / 211.0)).cos()
        };
        let u: Vec<f64> = (0..n)
            .map(|t| {
                (1..500)
                    .map(|k| {
                        if k <= last {
                            wave(t, k)
                        } else {
                            leftover * wave(t, k)
                        }
                    })
                    .sum()
            })
            .collect();
        let settings = PeriodicSettings {
            skip: SkipRule::Fixed(0),
            ..PeriodicSettings::default()
        };
        // Beside the band, within 32 lines of it, a leftover is none of the excitation.
        for (noise, lines) in [(0.3, last), (1e-7, 499 - 32)] {
            let inputs = vec![u.clone(); 4];
            let same = periods(n, 4, 1.0, 3);
            let scatter = |m: usize, t: usize| same[m][t] - same[0][t];
            let outputs: Vec<Vec<f64>> = (0..4)
                .map(|m| (0..n).map(|t| 2.0 * u[t] + noise * scatter(m, t)).collect())
                .collect();
            let found = siso(&inputs, &outputs, &settings).unwrap();
            let count = found.excited_lines.len();
            assert!(
                count.abs_diff(lines) <= 4,
                "{leftover}, {noise}: {count} of {lines}"
            );
        }
    }
}

/// Line 1 fails by its references, which are alike, line 2 by its inputs: signals that change their sign after half a period are
/// exactly zero there.
#[test]
fn of_several_singular_lines_the_first_is_named() {
    let odd = |half: [f64; 4]| -> Vec<f64> { half.into_iter().chain(half.map(|x| -x)).collect() };
    let layout = Layout {
        period: 8,
        outputs: 1,
        inputs: 2,
        references: 2,
        experiments: 3,
        sample_rate_hz: 8.0,
    };
    let settings = PeriodicSettings {
        skip: SkipRule::Fixed(0),
        instrument: Instrument::References,
        lines: LineSelection::All,
        ..PeriodicSettings::default()
    };
    let mut sums = PeriodicAccumulator::new(layout, &settings, None).unwrap();
    for experiment in 0..3 {
        let mut pulses = [[0.0; 4]; 2];
        (pulses[0][experiment], pulses[1][(2 * experiment + 1) % 4]) = (1.0, 3.0);
        let inputs = pulses.map(odd);
        let reference = odd(pulses[0]);
        for period in 0..2 {
            let block = PeriodBlock {
                experiment,
                period,
                outputs: &inputs[..1],
                inputs: &inputs,
                references: &[reference.clone(), reference.clone()],
            };
            sums.push(&block).unwrap();
        }
    }
    match sums.finish() {
        Err(FrfError::Singular { line: 1, .. }) => {}
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_dead_input_is_refused_whatever_the_output_does() {
    for level in [0.0, 5.0] {
        for noise in [0.0, 1e-3] {
            let u = vec![vec![level; 1024]; 4];
            let refused = siso(&u, &periods(1024, 4, noise, 3), &fixed(0));
            assert!(
                matches!(refused, Err(FrfError::NoExcitation { .. })),
                "{level} {noise}"
            );
        }
    }
}

#[test]
fn small_outputs_beside_large_inputs_keep_their_digits() {
    let scaled = |size: f64, seed| {
        let mut all = periods(4096, 5, 1e-3, seed);
        all.iter_mut().flatten().for_each(|x| *x *= size);
        all
    };
    let settings = PeriodicSettings {
        skip: SkipRule::Fixed(0),
        lines: LineSelection::List((1..2048).collect()),
        ..PeriodicSettings::default()
    };
    let of = |gain: f64| {
        siso(&scaled(10.0, 1), &scaled(gain, 2), &settings)
            .unwrap()
            .estimate
    };
    let reference = of(1.0);
    for gain in [2.0_f64.powi(-30), 2.0_f64.powi(-45), 2.0_f64.powi(-100)] {
        let found = of(gain);
        for (a, b) in found.frf().values().iter().zip(reference.frf().values()) {
            assert!((a / gain - b).norm() <= 1e-12 * b.norm(), "{gain}: {a} {b}");
        }
        let (ours, theirs) = (found.output_covariances(), reference.output_covariances());
        for (a, b) in ours.iter().zip(theirs) {
            assert!(
                (a / (gain * gain) - b).norm() <= 1e-9 * b.norm(),
                "{gain}: {a} {b}"
            );
        }
    }
}
