use super::{Basis, Cause, Stability, Verdict, Worth};
use crate::validation::{Band, ErrorFigure, FrozenCheck, FrozenError, OutputCheck, RecordCheck};

fn band(low_hz: f64, error_percent: f64, over_noise: f64) -> Band {
    Band {
        low_hz,
        high_hz: 1.4 * low_hz,
        error_percent,
        noise_percent: error_percent / over_noise,
        over_noise: Some(over_noise),
    }
}

/// Half octaves from 1 Hz on with an error in percent and in multiples of the noise.
fn frozen(errors: &[[f64; 2]]) -> FrozenCheck {
    FrozenCheck {
        source: "validation",
        positions: Vec::new(),
        error: FrozenError {
            strict_max_db: 0.0,
            median_db: 0.0,
            worst_frequency_hz: 1.0,
            worst_response: 0,
        },
        noise_db: Some(-40.0),
        error_over_noise: Some(1.0),
        relative_rms_percent: vec![1.0],
        bands: errors
            .iter()
            .enumerate()
            .map(|(k, [percent, over])| band(2f64.powf(0.5 * k as f64), *percent, *over))
            .collect(),
    }
}

struct Case {
    moves: bool,
    closed: Option<[f64; 2]>,
    open_percent: f64,
    by_inputs: f64,
    by_past: f64,
    noise: bool,
}

const QUIET: Case = Case {
    moves: false,
    closed: None,
    open_percent: 1.0,
    by_inputs: 0.0,
    by_past: 0.0,
    noise: false,
};

fn record(c: &Case) -> RecordCheck {
    let figure = |percent: f64, over: Option<f64>| ErrorFigure {
        rms: 1.0,
        over_noise: over,
        fit_percent: 100.0 - percent,
    };
    RecordCheck {
        name: "move".to_owned(),
        purpose: "validation",
        from: 0,
        moves: c.moves,
        start: "at rest",
        outputs: vec![OutputCheck {
            name: "y".to_owned(),
            unit: String::new(),
            one_step: None,
            open_loop: figure(c.open_percent, c.noise.then_some(c.open_percent)),
            open_loop_by_inputs: c.by_inputs,
            open_loop_predictable: c.by_past,
            change_rms: 1.0,
            closed_loop: c.closed.map(|[percent, over]| figure(percent, Some(over))),
        }],
        whiteness: Vec::new(),
        cross_correlation: Vec::new(),
        axes: Vec::new(),
    }
}

fn worth(frozen: Option<&FrozenCheck>, records: &[Case], stability: Stability) -> Worth {
    let records: Vec<RecordCheck> = records.iter().map(record).collect();
    Verdict::of(frozen, &records, stability, false, &[]).worth
}

const NOISE: [f64; 2] = [3.0, 1.1];

#[test]
fn noise_is_good_and_five_times_the_noise_is_not() {
    let good = frozen(&[NOISE; 12]);
    assert_eq!(worth(Some(&good), &[], Stability::Stable), Worth::Good);
    for k in 0..12 {
        let mut errors = [NOISE; 12];
        errors[k] = [15.0, 5.0];
        let found = worth(Some(&frozen(&errors)), &[], Stability::Stable);
        assert_ne!(found, Worth::Good, "{k}");
        assert_eq!(matches!(found, Worth::GoodUpTo { .. }), k > 6, "{k}: {found:?}");
    }
    let moving = |over| Case {
        moves: true,
        closed: Some([0.01, over]),
        ..QUIET
    };
    let judge = |over| worth(Some(&good), &[moving(over)], Stability::Integrating);
    assert_eq!(judge(1.3), Worth::Good);
    // The controller makes any model follow: a hundredth of a percent of the motion is no excuse.
    assert_eq!(judge(90.0), Worth::GoodAtRest);
}

#[test]
fn what_explains_less_than_half_is_no_model() {
    let missed = frozen(&[[80.0, 30.0]; 12]);
    assert_eq!(worth(Some(&missed), &[], Stability::Stable), Worth::NotAModel);
    assert!(!Worth::NotAModel.is_usable());
    let half = Case {
        open_percent: 60.0,
        by_inputs: 0.9,
        ..QUIET
    };
    assert_eq!(worth(None, &[half], Stability::Stable), Worth::NotAModel);
    // An error far below its noise is no error of the model, however large.
    let noisy = frozen(&[[80.0, 1.0]; 12]);
    assert_eq!(worth(Some(&noisy), &[], Stability::Stable), Worth::Approximate);
}

#[test]
fn without_a_known_noise_inputs_and_past_tell() {
    let judge = |percent, by_inputs, by_past| {
        let case = Case {
            open_percent: percent,
            by_inputs,
            by_past,
            ..QUIET
        };
        worth(None, &[case], Stability::Stable)
    };
    assert_eq!(judge(0.01, 0.9, 0.9), Worth::Good);
    assert_eq!(judge(4.0, 0.2, 0.1), Worth::Good);
    assert_eq!(judge(30.0, 0.01, 0.0), Worth::Good);
    assert_eq!(judge(4.0, 0.9, 0.0), Worth::Approximate);
    // The smooth error of friction, which a better model would take away.
    assert_eq!(judge(4.0, 0.0, 0.99), Worth::Approximate);
    assert_eq!(judge(60.0, 0.0, 0.0), Worth::NotAModel);
}

#[test]
fn a_model_that_explodes_where_the_record_is_bounded_is_none() {
    let exploding = Case {
        open_percent: 1e9,
        ..QUIET
    };
    let radius = 1.01;
    let verdict = Verdict::of(
        None,
        &[record(&exploding)],
        Stability::Unstable { radius },
        false,
        &[],
    );
    assert_eq!(verdict.worth, Worth::NotAModel);
    assert_eq!(verdict.causes, [Cause::Unstable { radius }]);
    assert!(verdict.sentence.contains("unstable"), "{}", verdict.sentence);
}

/// Under feedback a machine may be unstable, and so may its model; from a growth on that no loop holds, it is none. What is said stays said
/// beside what explains the errors.
#[test]
fn a_model_that_is_judged_by_its_prediction_says_that_it_is_unstable() {
    for (radius, worth) in [
        (1.001, Worth::Approximate),
        (1.4, Worth::Approximate),
        (1.6, Worth::NotAModel),
    ] {
        let mut predicted = record(&Case {
            open_percent: 1e9,
            ..QUIET
        });
        let of_one_step = Case {
            open_percent: 5.0,
            noise: false,
            ..QUIET
        };
        predicted.outputs[0].one_step = Some(record(&of_one_step).outputs[0].open_loop);
        let verdict = Verdict::of(None, &[predicted], Stability::Unstable { radius }, true, &[]);
        assert_eq!(verdict.worth, worth, "{radius}");
        let told = |v: &Verdict| {
            v.sentence
                .contains(&format!("unstable (pole of magnitude {radius:.6})"))
        };
        assert!(told(&verdict), "{}", verdict.sentence);
        let explained = verdict.explained(vec!["the sensor is late".to_owned()]);
        assert!(told(&explained), "{}", explained.sentence);
    }
}

#[test]
fn contradictions_come_first_and_nothing_to_compare_is_said() {
    let nothing = Verdict::of(None, &[], Stability::Stable, false, &["no record".to_owned()]);
    assert_eq!((nothing.worth, nothing.basis), (Worth::Unjudged, Basis::Nothing));
    let good = Verdict::of(Some(&frozen(&[NOISE; 12])), &[], Stability::Stable, false, &[]);
    assert_eq!(good.clone().contradicted([]), good);
    let doubted = good.contradicted(["record b: u has the opposite sign".to_owned()]);
    assert_eq!(doubted.worth, Worth::ContradictoryData);
    assert!(doubted.sentence.contains("record b"), "{}", doubted.sentence);
    assert!(!doubted.worth.is_usable());
}

#[test]
fn a_file_keeps_the_verdict() {
    let mut errors = [NOISE; 12];
    errors[11] = [40.0, 12.0];
    let verdict = Verdict::of(
        Some(&frozen(&errors)),
        &[record(&QUIET)],
        Stability::Stable,
        false,
        &[],
    );
    let text = serde_json::to_string(&verdict).unwrap();
    assert!(text.contains("\"worth\":\"good-up-to\""), "{text}");
    assert_eq!(serde_json::from_str::<Verdict>(&text).unwrap(), verdict);
}
