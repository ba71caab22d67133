//! Data without noise.

use crate::{normal, plant, record, response_error, run};
use lpv_core::nalgebra::{DMatrix, DVector, dmatrix};
use lpv_core::{Discrete, StateSpace};
use lti_ident::{Focus, InnovationSettings, Offset, Segment, identify};

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
    let settings = InnovationSettings {
        offset: Offset::Zero,
        response_samples: Some(4),
        ..InnovationSettings::new([1])
    };
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
    let settings = InnovationSettings {
        offset: Offset::Zero,
        ..InnovationSettings::new([4])
    };
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
fn offsets_are_estimated_exactly() {
    let truth = plant();
    let u = normal(2, 600, 3);
    let x = DVector::zeros(4);
    let mut y = truth.simulate(&x, &u).unwrap().outputs;
    y.row_mut(0).add_scalar_mut(100.0);
    let shifted = u.map(|v| v + 20.0);
    let record = record(&shifted, &y);
    let settings = InnovationSettings::new([4]);
    let fit = identify(&[Segment::whole(&record)], truth.clock(), &settings, &[]).unwrap();
    let entry = fit.chosen();
    let simulated = entry
        .model
        .simulate(&entry.initial_states[0], &shifted)
        .unwrap()
        .outputs;
    assert!((simulated - y).amax() < 1e-5);
    // What is not in the offset of the input is in that of the output.
    let (model, u_0) = (entry.model.model(), entry.model.input_offset().add_scalar(-20.0));
    let inverse = (DMatrix::identity(4, 4) - model.a()).try_inverse().unwrap();
    let rest = (model.c() * inverse * model.b() + model.d()) * u_0;
    let found = entry.model.output_offset() - rest;
    assert!((found - lpv_core::nalgebra::dvector![100.0, 0.0]).amax() < 1e-5);
}

#[test]
fn an_integrator_is_found_with_the_focus_on_prediction() {
    let clock = Discrete::new(0.1).unwrap();
    let a = dmatrix![1.0, 0.1; 0.0, 0.9];
    let truth = StateSpace::new(a, dmatrix![0.0; 1.0], dmatrix![1.0, 0.0], dmatrix![0.0], clock).unwrap();
    let u = normal(1, 400, 5);
    let y = truth.simulate(&DVector::zeros(2), &u).unwrap().outputs + normal(1, 400, 6) * 1e-4;
    let record = record(&u, &y);
    let settings = InnovationSettings {
        focus: Focus::Prediction,
        offset: Offset::Zero,
        ..InnovationSettings::new([2])
    };
    let fit = identify(&[Segment::whole(&record)], clock, &settings, &[]).unwrap();
    let poles = fit.chosen().model.model().poles().unwrap();
    assert!(
        (poles[0].re - 0.9).abs() < 0.01 && (poles[1].re - 1.0).abs() < 1e-3,
        "{poles:?}"
    );
}

#[test]
fn a_plant_with_an_integrator_rests_under_the_input_that_is_estimated() {
    let clock = Discrete::new(0.1).unwrap();
    let a = dmatrix![1.0, 0.1; 0.0, 0.9];
    let truth = StateSpace::new(a, dmatrix![0.0; 1.0], dmatrix![1.0, 0.0], dmatrix![0.0], clock).unwrap();
    // The mean of 0.2 drives it away, an input of 3 holds it.
    let drive = normal(1, 400, 5).add_scalar(0.2);
    let y = truth.simulate(&DVector::zeros(2), &drive).unwrap().outputs + normal(1, 400, 6) * 1e-4;
    let record = record(&drive.add_scalar(3.0), &y);
    let settings = InnovationSettings {
        focus: Focus::Prediction,
        ..InnovationSettings::new([2])
    };
    let fit = identify(&[Segment::whole(&record)], clock, &settings, &[]).unwrap();
    let model = &fit.chosen().model;
    assert!(
        (model.input_offset()[0] - 3.0).abs() < 0.01,
        "{}",
        model.input_offset()
    );
    assert!(fit.chosen().simulated_fit_percent[0] > 99.0);
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let record = run(400, 0.1, 7);
    let settings = InnovationSettings::new([2, 4]);
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
    let settings = InnovationSettings::new([4]);
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
