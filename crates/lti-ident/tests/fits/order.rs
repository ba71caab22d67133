//! The order chosen, with noise that is white, coloured, and with offsets.

use crate::{normal, plant, record};
use lpv_core::nalgebra::{DMatrix, DVector, dmatrix};
use lpv_core::{Discrete, StateSpace};
use lti_ident::{Focus, InnovationFit, InnovationSettings, Segment, identify};

/// A lightly damped mode: its output is still ringing at the end, so that the mean is not the offset.
fn mode() -> StateSpace<Discrete> {
    let clock = Discrete::new(0.1).unwrap();
    StateSpace::new(
        dmatrix![0.9, 0.3; -0.3, 0.9],
        dmatrix![1.0; 0.0],
        dmatrix![0.0, 1.0],
        dmatrix![0.0],
        clock,
    )
    .unwrap()
}

/// First-order noise of a size.
fn noise(channels: usize, samples: usize, pole: f64, size: f64, seed: u64) -> DMatrix<f64> {
    let mut e = normal(channels, samples, seed) * size;
    for k in 1..samples {
        for i in 0..channels {
            e[(i, k)] = pole * e[(i, k - 1)] + (1.0 - pole * pole).sqrt() * e[(i, k)];
        }
    }
    e
}

fn fit(system: &StateSpace<Discrete>, pole: f64, size: f64, focus: Focus, seed: u64) -> InnovationFit {
    let (nu, ny, samples) = (system.inputs(), system.outputs(), 1050);
    let u = normal(nu, samples, seed);
    let x = DVector::zeros(system.states());
    let y = system.simulate(&x, &u).unwrap().outputs + noise(ny, samples, pole, size, seed + 500);
    let record = record(&u, &y.add_scalar(7.0));
    let settings = InnovationSettings {
        focus,
        ..InnovationSettings::new(1..=8)
    };
    identify(&[Segment::whole(&record)], system.clock(), &settings, &[]).unwrap()
}

#[test]
fn the_true_order_is_chosen_under_white_and_coloured_noise() {
    for (system, size, seeds) in [(mode(), 0.02, 0..4), (plant(), 0.2, 4..5)] {
        for pole in [0.0, 0.8] {
            for seed in seeds.clone() {
                let fit = fit(&system, pole, size, Focus::Simulation, seed);
                assert_eq!(fit.chosen().order, system.states(), "pole {pole}, seed {seed}");
            }
        }
    }
    let fit = fit(&mode(), 0.0, 0.02, Focus::Prediction, 9);
    assert_eq!(fit.chosen().order, 2);
}

#[test]
fn the_offset_is_that_of_the_plant_and_not_the_mean() {
    for focus in [Focus::Simulation, Focus::Prediction] {
        let fit = fit(&mode(), 0.0, 0.02, focus, 3);
        let model = &fit.entries[1].model;
        // Under the input u_0 the plant rests at 7 + G(1) u_0.
        let (a, b, c) = (mode().a().clone(), mode().b().clone(), mode().c().clone());
        let gain = (c * (DMatrix::identity(2, 2) - a).try_inverse().unwrap() * b)[0];
        let rest = 7.0 + gain * model.input_offset()[0];
        let found = model.output_offset()[0];
        assert!((found - rest).abs() < 0.005, "{focus:?}: {found} {rest}");
    }
}

/// A long record is scanned in part and fitted whole: the deviation of the poles falls with the whole length.
#[test]
fn a_long_record_is_scanned_in_part_and_fitted_whole() {
    let (system, samples) = (mode(), 14_000);
    let u = normal(1, samples, 21);
    let clean = system.simulate(&DVector::zeros(2), &u).unwrap().outputs;
    let record = record(&u, &(clean + noise(1, samples, 0.0, 0.02, 22)));
    let settings = InnovationSettings::new(1..=3);
    let fit = identify(&[Segment::whole(&record)], system.clock(), &settings, &[]).unwrap();
    assert!(fit.scanned_samples <= 10_000, "{}", fit.scanned_samples);
    let chosen = fit.chosen();
    assert_eq!(chosen.order, 2);
    // All samples count: the first state is that of the first sample of the record, not of the part.
    let run = chosen
        .model
        .simulate(&chosen.initial_states[0], &u)
        .unwrap()
        .outputs;
    let error = (run - Segment::whole(&record).outputs()).norm() / (samples as f64).sqrt();
    assert!((error / 0.02 - 1.0).abs() < 0.03, "{error}");
    let pole = chosen.model.model().poles().unwrap()[0];
    let truth = system.poles().unwrap();
    let off = truth
        .iter()
        .map(|z| (z - pole).norm())
        .fold(f64::INFINITY, f64::min);
    assert!(off < 2e-4, "{off}");
}
