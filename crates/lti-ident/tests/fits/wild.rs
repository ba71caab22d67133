//! Any input gives a result or a typed refusal, never a panic.

use crate::{normal, record, run};
use lpv_core::Discrete;
use lpv_core::nalgebra::DMatrix;
use lti_ident::rigid_body::{self, RigidBodySettings};
use lti_ident::{Focus, InnovationSettings, LtiIdentError, Offset, Segment, identify};
use proptest::prelude::*;

fn wild() -> impl Strategy<Value = f64> {
    prop_oneof![6 => -10.0..10.0f64, 1 => any::<f64>(), 1 => Just(0.0), 1 => Just(1e300), 1 => Just(1e-300)]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn fits_never_panic(
        nu in 0usize..3, ny in 0usize..3, samples in 0usize..60, tame in 0usize..3,
        order in 1usize..5, from in 0usize..10,
        focus in prop::sample::select(vec![Focus::Simulation, Focus::Prediction]),
        offset in prop::sample::select(vec![Offset::Estimated, Offset::Zero]),
        numbers in prop::collection::vec(wild(), 60 * 4),
    ) {
        let tamed = |v: f64| if tame > 0 && v.abs() > 100.0 { 1.0 } else { v };
        let at = |i: usize, k: usize| tamed(numbers[(i * 60 + k) % numbers.len()]);
        let u = DMatrix::from_fn(nu, samples, at);
        let y = DMatrix::from_fn(ny, samples, |i, k| at(i + 2, k));
        let record = record(&u, &y);
        let clock = Discrete::new(0.01).unwrap();
        let settings = InnovationSettings { focus, offset, max_iterations: 5, response_samples: Some(4), ..InnovationSettings::new([order, 2]) };
        let segment = Segment::new(&record, from..samples);
        if let Ok(fit) = identify(std::slice::from_ref(&segment), clock, &settings, &[]) {
            prop_assert!(fit.entries.iter().all(|e| e.cost.is_finite()));
        }
        let _ = rigid_body::identify(&[segment], clock, &RigidBodySettings::default());
    }
}

#[test]
fn refusals_name_the_facts() {
    let clock = Discrete::new(0.1).unwrap();
    let settings = InnovationSettings::new([3]);
    let good = run(200, 0.1, 1);
    let refuse = |segments: &[Segment]| identify(segments, clock, &settings, &[]).unwrap_err();
    assert_eq!(refuse(&[]), LtiIdentError::Empty { what: "segments" });
    assert_eq!(
        refuse(&[Segment::new(&good, 100..201)]),
        LtiIdentError::Range {
            segment: 0,
            start: 100,
            end: 201,
            samples: 200
        }
    );
    let narrow = record(&normal(1, 50, 1), &normal(2, 50, 2));
    assert!(matches!(
        refuse(&[Segment::whole(&good), Segment::whole(&narrow)]),
        LtiIdentError::Channels {
            segment: 1,
            what: "inputs",
            expected: 2,
            found: 1
        }
    ));
    let constant = record(&normal(1, 50, 1), &DMatrix::from_element(1, 50, 3.0));
    assert_eq!(
        refuse(&[Segment::whole(&constant)]),
        LtiIdentError::Constant {
            what: "output",
            channel: 0
        }
    );
    assert!(matches!(
        refuse(&[Segment::new(&good, 0..12)]),
        LtiIdentError::TooFewSamples { .. }
    ));
    let mut broken = good.clone();
    broken.outputs.columns[1][7] = f64::NAN;
    assert!(matches!(
        refuse(&[Segment::whole(&broken)]),
        LtiIdentError::Core(_)
    ));
    for wrong in [vec![], vec![0], vec![61]] {
        assert!(InnovationSettings::new(wrong).check().is_err());
    }
    assert!(
        InnovationSettings {
            tolerance: 0.0,
            ..InnovationSettings::new([1])
        }
        .check()
        .is_err()
    );
    assert!(
        InnovationSettings {
            max_iterations: 0,
            ..InnovationSettings::new([1])
        }
        .check()
        .is_err()
    );
    assert!(
        InnovationSettings {
            response_samples: Some(3),
            ..InnovationSettings::new([1])
        }
        .check()
        .is_err()
    );
}

#[test]
fn an_order_too_high_for_the_data_fails_alone() {
    let record = run(60, 0.1, 4);
    let settings = InnovationSettings::new([2, 60]);
    let fit = identify(
        &[Segment::whole(&record)],
        Discrete::new(0.1).unwrap(),
        &settings,
        &[],
    )
    .unwrap();
    assert_eq!(fit.chosen().order, 2);
    assert!(matches!(
        fit.failures[..],
        [(60, LtiIdentError::TooFewSamples { .. })]
    ));
}
