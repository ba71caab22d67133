//! Data with noise of known size.

use crate::{normal, plant, record, response_error, run};
use lpv_core::nalgebra::{DMatrix, DVector, dvector};
use lpv_core::{InnovationModel, Record};
use lti_ident::{Focus, InnovationSettings, Segment, identify};

/// The plant with innovations that reach its states.
fn innovations(samples: usize, seed: u64) -> (InnovationModel, Record) {
    let gain = DMatrix::from_row_slice(4, 2, &[0.4, 0.1, 0.2, 0.3, 0.3, 0.0, -0.1, 0.4]);
    let covariance = DMatrix::from_row_slice(2, 2, &[0.09, 0.03, 0.03, 0.04]);
    let (u, white) = (normal(2, samples, seed), normal(2, samples, seed + 1));
    let e = covariance.clone().cholesky().unwrap().unpack() * white;
    let zeros = dvector![0.0, 0.0];
    let model = InnovationModel::new(plant(), gain, covariance, zeros.clone(), zeros).unwrap();
    let mut x = DVector::zeros(4);
    let mut y = DMatrix::zeros(2, samples);
    for k in 0..samples {
        y.set_column(k, &(plant().c() * &x + plant().d() * u.column(k) + e.column(k)));
        x = plant().a() * x + plant().b() * u.column(k) + model.gain() * e.column(k);
    }
    (model, record(&u, &y))
}

#[test]
fn costs_do_not_increase_with_the_order_and_the_true_one_is_chosen() {
    let record = run(600, 0.5, 11);
    for focus in [Focus::Simulation, Focus::Prediction] {
        let settings = InnovationSettings {
            focus,
            ..InnovationSettings::new(1..=8)
        };
        let fit = identify(&[Segment::whole(&record)], plant().clock(), &settings, &[]).unwrap();
        assert_eq!(fit.entries.len(), 8, "{:?}", fit.failures);
        for pair in fit.entries.windows(2) {
            assert!(pair[1].cost <= pair[0].cost + 1e-9, "order {}", pair[1].order);
        }
        assert_eq!(fit.chosen().order, 4, "{focus:?}");
        // White noise on the output: the covariance of the simulation error is that of the noise.
        let entry = fit.chosen();
        assert!((entry.simulation_covariance[(0, 0)] / 0.25 - 1.0).abs() < 0.2);
        assert!(response_error(entry.model.model(), &plant()) < 0.1);
    }
}

#[test]
fn the_focus_on_prediction_finds_the_gain_and_the_covariance() {
    let (truth, record) = innovations(6000, 21);
    let settings = InnovationSettings {
        focus: Focus::Prediction,
        ..InnovationSettings::new([4])
    };
    let fit = identify(&[Segment::whole(&record)], plant().clock(), &settings, &[]).unwrap();
    let model = &fit.chosen().model;
    assert!(response_error(model.model(), &plant()) < 0.03);
    let relative = (model.innovation_covariance() - truth.innovation_covariance()).norm() / 0.1;
    assert!(relative < 0.05, "{relative}");
    // From innovations to outputs: the response of K through the plant, whatever the states.
    let noise = |m: &InnovationModel| {
        let (a, c) = (m.model().a().clone(), m.model().c().clone());
        let one = DMatrix::identity(2, 2);
        lpv_core::StateSpace::new(a, m.gain().clone(), c, one, plant().clock()).unwrap()
    };
    assert!(response_error(&noise(model), &noise(&truth)) < 0.1);
}

#[test]
fn the_focus_on_simulation_adds_a_gain_that_predicts_as_well() {
    let (truth, record) = innovations(3000, 31);
    let fit = |focus| {
        let settings = InnovationSettings {
            focus,
            ..InnovationSettings::new([4])
        };
        identify(&[Segment::whole(&record)], plant().clock(), &settings, &[]).unwrap()
    };
    let (simulation, prediction) = (fit(Focus::Simulation), fit(Focus::Prediction));
    let trace = |m: &InnovationModel| m.innovation_covariance().trace();
    let (found, best) = (
        trace(&simulation.chosen().model),
        trace(&prediction.chosen().model),
    );
    assert!(found < 1.05 * best, "{found} {best}");
    assert!((best / trace(&truth) - 1.0).abs() < 0.1);
    // The output error alone is much larger: the gain did something.
    assert!(simulation.chosen().simulation_covariance.trace() > 2.0 * found);
}
