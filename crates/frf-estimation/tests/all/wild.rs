//! Any numbers and any sizes: an error or a result, never a panic.
use frf_estimation::{
    HalfWidth, Layout, LineSelection, LocalLines, LocalSettings, PeriodicAccumulator, PeriodicSettings,
    Regressor, SkipRule, confidence_radius, estimate_records, f_quantile_2, local_polynomial, local_rational,
};
use lpv_core::{Discrete, PeriodBlock, Purpose, Record, RecordKind, Signals};
use proptest::prelude::*;

type Columns = Vec<Vec<f64>>;

fn columns(channels: usize, samples: usize) -> impl Strategy<Value = Columns> {
    let value = prop_oneof![
        6 => -1.0..1.0f64,
        1 => Just(0.0),
        1 => Just(1e300),
        1 => Just(1e-300),
        1 => any::<f64>(),
    ];
    let tame = prop::collection::vec(prop::collection::vec(-1.0..1.0f64, samples), channels);
    let wild = prop::collection::vec(prop::collection::vec(value, samples), channels);
    prop_oneof![tame, wild]
}

fn records() -> impl Strategy<Value = Vec<Record>> {
    // Mostly whole periods and at least one channel, so that the estimators get past their first checks.
    let channels = || prop_oneof![1 => Just(0), 6 => 1..3usize];
    let samples = (0..16usize, 0..6usize, prop_oneof![6 => Just(0), 1 => 1..4usize]);
    let shape = (channels(), channels(), channels(), samples);
    let one = shape.prop_flat_map(|(ny, nu, nr, (period, count, rest))| {
        let n = period * count + rest;
        prop::collection::vec((columns(ny, n), columns(nu, n), columns(nr, n)), 0..4).prop_map(move |sets| {
            let record = |(y, u, r): (Columns, Columns, Columns)| Record {
                name: "wild".into(),
                kind: RecordKind::Periodic { period },
                purpose: Purpose::Estimation,
                position: None,
                outputs: Signals::new(&[], y),
                inputs: Signals::new(&[], u),
                references: Signals::new(&[], r),
                scheduling: Signals::default(),
                auxiliary: Signals::default(),
                injection: Signals::default(),
            };
            sets.into_iter().map(record).collect::<Vec<_>>()
        })
    });
    // Now and then a record of another shape joins.
    (one.clone(), one, prop::bool::weighted(0.2)).prop_map(|(mut a, b, join)| {
        if join {
            a.extend(b);
        }
        a
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn periodic_never_panics(records in records(), skip in 0..3usize, auto in any::<bool>(), all in any::<bool>()) {
        let list: Vec<&Record> = records.iter().collect();
        let clock = Discrete::new(0.05).unwrap();
        let lines = if all { LineSelection::All } else { LineSelection::Excited { relative_threshold: 0.01 } };
        let skip = if auto { SkipRule::Auto } else { SkipRule::Fixed(skip) };
        let settings = PeriodicSettings { skip, lines, ..PeriodicSettings::default() };
        if let Ok(result) = estimate_records(&list, clock, &settings) {
            for l in 0..result.estimate.frf().len() {
                prop_assert!(confidence_radius(&result.estimate, l, 0, 0, 0.95) >= 0.0);
            }
        }
    }

    #[test]
    fn local_methods_never_panic(records in records(), degree in 0..3usize, width in 0..5usize, references in any::<bool>()) {
        let list: Vec<&Record> = records.iter().collect();
        let clock = Discrete::new(0.05).unwrap();
        let regressor = if references { Regressor::References } else { Regressor::Inputs };
        let half_width = if width == 0 { HalfWidth::Auto } else { HalfWidth::Lines(width) };
        let settings = LocalSettings { degree, denominator_degree: 1, half_width, regressor, ..LocalSettings::default() };
        let _ = local_polynomial(&list, clock, &settings);
        let _ = local_rational(&list, clock, &settings);
    }

    #[test]
    fn settings_and_layouts_never_panic(
        period in any::<usize>(), counts in prop::array::uniform4(any::<usize>()), rate in any::<f64>(), position in any::<f64>(),
        condition in any::<f64>(), threshold in any::<f64>(), list in prop::collection::vec(any::<usize>(), 0..4), width in any::<usize>(),
    ) {
        let lines = if list.len() > 2 { LineSelection::Excited { relative_threshold: threshold } } else { LineSelection::List(list.clone()) };
        let settings = PeriodicSettings { skip: SkipRule::Fixed(period), max_condition: condition, lines, smoothing_half_width: width, ..PeriodicSettings::default() };
        {
            let [outputs, inputs, references, experiments] = counts.map(|c| c % 70);
            let layout = Layout { period: period % 50, outputs, inputs, references, experiments, sample_rate_hz: rate };
            let _ = PeriodicAccumulator::new(layout, &settings, Some(position.into()));
        }
        let _ = LocalSettings { degree: width, half_width: HalfWidth::Lines(period), lines: LocalLines::List(list), ..LocalSettings::default() }.check();
        let _ = f_quantile_2(condition, threshold);
    }

    #[test]
    fn blocks_never_panic(
        experiment in 0..3usize, period in 0..3usize,
        y in columns(1, 8), u in columns(1, 8), r in columns(1, 7), drop in any::<bool>(),
    ) {
        let settings = PeriodicSettings { skip: SkipRule::Fixed(0), ..PeriodicSettings::default() };
        let layout = Layout { period: 8, outputs: 1, inputs: 1, references: usize::from(!drop), experiments: 2, sample_rate_hz: 1.0 };
        let mut acc = PeriodicAccumulator::new(layout, &settings, None).unwrap();
        let block = PeriodBlock { experiment, period, outputs: &y, inputs: &u, references: if drop { &[] } else { &r } };
        let accepted = acc.push(&block).is_ok();
        let finite = y.iter().chain(&u).flatten().all(|v| v.is_finite());
        prop_assert_eq!(accepted, drop && experiment < 2 && period == 0 && finite);
        prop_assert!(acc.finish().is_err());
    }
}
