//! Data without noise.

use crate::{normal, plant, record, response_error, run};
use lpv_core::nalgebra::{DMatrix, DVector, dmatrix};
use lpv_core::{Discrete, StateSpace};
use lti_ident::{Focus, InnovationSettings, Mean, Segment, identify};

#[test]
fn a_first_order_system_from_six_numbers() {
    // x+ = x / 2 + u, y = x from x = 1.
    let u = dmatrix![
        1.0, 0.0, 0.0, 2.0, 0.0, 0.0, -1.0, 0.0, 1.0, 1.0, 0.0, 3.0, -2.0, 0.0, 1.0, 0.0
    ];
    let clock = Discrete::new(1.0).unwrap();
    let one = |v: f64| dmatrix![v];
    let truth = StateSpace::new(one(0.5), one(1.0), one(1.0), one(0.0), clock).unwrap();
    let y = truth
        .simulate(&DVector::from_element(1, 1.0), &u)
        .unwrap()
        .outputs;
    let record = record(&u, &y);
    let settings = InnovationSettings::new([1])
        .mean(Mean::Keep)
        .response_samples(4)
        .check()
        .unwrap();
    let fit = identify(&[Segment::whole(&record)], clock, &settings, &[]).unwrap();
    let model = fit.chosen().model.model();
    assert!((model.a()[0] - 0.5).abs() < 1e-8, "{}", model.a());
    assert!((model.c()[0] * model.b()[0] - 1.0).abs() < 1e-8);
    assert!(model.d()[0].abs() < 1e-8);
}

#[test]
fn two_runs_with_states_of_their_own() {
    let (first, second) = (run(300, 0.0, 1), run(200, 0.0, 2));
    let segments = [Segment::new(&first, 20..300), Segment::whole(&second)];
    let truth = plant();
    let settings = InnovationSettings::new([4]).mean(Mean::Keep).check().unwrap();
    let fit = identify(&segments, truth.clock(), &settings, &[]).unwrap();
    let entry = fit.chosen();
    let error = response_error(entry.model.model(), &truth);
    assert!(error < 1e-7, "{error}: {entry:?}");
    for (segment, x) in segments.iter().zip(&entry.initial_states) {
        let y = entry.model.simulate(x, &segment.inputs()).unwrap().outputs;
        assert!((y - segment.outputs()).amax() < 1e-6);
    }
    assert!(entry.simulated_fit_percent.iter().all(|f| *f > 99.9999));
}

#[test]
fn offsets_are_removed_and_put_back() {
    let truth = plant();
    let u = normal(2, 600, 3);
    let x = DVector::zeros(4);
    let mut y = truth.simulate(&x, &u).unwrap().outputs;
    y.row_mut(0).add_scalar_mut(100.0);
    let shifted = u.map(|v| v + 20.0);
    let record = record(&shifted, &y);
    let settings = InnovationSettings::new([4]).check().unwrap();
    let fit = identify(&[Segment::whole(&record)], truth.clock(), &settings, &[]).unwrap();
    let entry = fit.chosen();
    let simulated = entry
        .model
        .simulate(&entry.initial_states[0], &shifted)
        .unwrap()
        .outputs;
    // Means over a finite run are not exactly the offsets, so that a constant is left.
    assert!((simulated - y).amax() < 0.3);
    assert!((entry.model.output_offset()[0] - 100.0).abs() < 1.0);
}

#[test]
fn an_integrator_is_found_with_the_focus_on_prediction() {
    let clock = Discrete::new(0.1).unwrap();
    let a = dmatrix![1.0, 0.1; 0.0, 0.9];
    let truth = StateSpace::new(a, dmatrix![0.0; 1.0], dmatrix![1.0, 0.0], dmatrix![0.0], clock).unwrap();
    let u = normal(1, 400, 5);
    let y = truth.simulate(&DVector::zeros(2), &u).unwrap().outputs + normal(1, 400, 6) * 1e-4;
    let record = record(&u, &y);
    let settings = InnovationSettings::new([2])
        .focus(Focus::Prediction)
        .mean(Mean::Keep)
        .check()
        .unwrap();
    let fit = identify(&[Segment::whole(&record)], clock, &settings, &[]).unwrap();
    let poles = fit.chosen().model.model().poles().unwrap();
    assert!(
        (poles[0].re - 0.9).abs() < 0.01 && (poles[1].re - 1.0).abs() < 1e-3,
        "{poles:?}"
    );
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let record = run(400, 0.1, 7);
    let settings = InnovationSettings::new([2, 4]).check().unwrap();
    let fit = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let segments = [Segment::whole(&record)];
        pool.install(|| identify(&segments, plant().clock(), &settings, &[]).unwrap())
    };
    assert_eq!(fit(1), fit(2));
}

#[test]
fn a_given_start_is_tried_and_a_useless_one_does_no_harm() {
    let record = run(400, 0.05, 8);
    let truth = plant();
    let settings = InnovationSettings::new([4]).check().unwrap();
    let a = DMatrix::identity(4, 4) * 1.5;
    let bad = StateSpace::new(
        a,
        truth.b().clone(),
        truth.c().clone(),
        truth.d().clone(),
        truth.clock(),
    );
    let starts = [
        truth.clone(),
        bad.unwrap(),
        StateSpace::gain(dmatrix![1.0], truth.clock()).unwrap(),
    ];
    let fit = identify(&[Segment::whole(&record)], truth.clock(), &settings, &starts).unwrap();
    let entry = fit.chosen();
    assert_eq!(entry.starts[0].kind, lti_ident::StartKind::Given(0));
    assert!(
        entry.starts[0].first_cost - entry.cost < 0.05,
        "{:?}",
        entry.starts
    );
    assert!(
        entry
            .starts
            .iter()
            .all(|s| s.cost >= entry.cost && s.cost <= s.first_cost)
    );
}
