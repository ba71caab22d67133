//! The measured CD player arm: first half fitted, second half simulated from the state that the first half ends in.

use crate::shared;
use lpv_core::Discrete;
use lpv_core::nalgebra::DMatrix;
use lti_ident::{Focus, InnovationFit, InnovationSettings, OrderEntry, Segment, identify};

fn fit_percent(y: &DMatrix<f64>, predicted: &DMatrix<f64>) -> [f64; 2] {
    [0, 1].map(|i| {
        let spread = y.row(i).add_scalar(-y.row(i).mean()).norm();
        100.0 * (1.0 - (y.row(i) - predicted.row(i)).norm() / spread)
    })
}

/// Simulated and one-step fit of the second half.
fn second_half(entry: &OrderEntry, first: &Segment, second: &Segment) -> [[f64; 2]; 2] {
    let (model, x) = (&entry.model, &entry.initial_states[0]);
    let x_simulated = model.simulate(x, &first.inputs()).unwrap().final_state;
    let x_predicted = model
        .predict_one_step(x, &first.inputs(), &first.outputs())
        .unwrap()
        .final_state;
    let simulated = model.simulate(&x_simulated, &second.inputs()).unwrap();
    let predicted = model
        .predict_one_step(&x_predicted, &second.inputs(), &second.outputs())
        .unwrap();
    [simulated, predicted].map(|t| fit_percent(&second.outputs(), &t.outputs))
}

fn both_halves(
    orders: std::ops::RangeInclusive<usize>,
    focus: Focus,
) -> Option<(InnovationFit, [[f64; 2]; 2])> {
    let record = shared("cd-player-arm")?.load(0).unwrap();
    let half = record.len() / 2;
    let (first, second) = (
        Segment::new(&record, 0..half),
        Segment::new(&record, half..record.len()),
    );
    let settings = InnovationSettings {
        focus,
        ..InnovationSettings::new(orders)
    };
    let start = std::time::Instant::now();
    let fit = identify(
        std::slice::from_ref(&first),
        Discrete::new(1.0).unwrap(),
        &settings,
        &[],
    )
    .unwrap();
    println!("{:?}", start.elapsed());
    for entry in &fit.entries {
        let [simulated, predicted] = second_half(entry, &first, &second);
        println!(
            "order {:2}: cost {:.3}, expected {:.3}, simulated {:.1?} / {simulated:.1?}, one step {:.1?} / {predicted:.1?}",
            entry.order,
            entry.cost,
            entry.expected_cost,
            entry.simulated_fit_percent,
            entry.one_step_fit_percent,
        );
        println!("    {:?}", entry.starts);
    }
    println!("chosen {}", fit.chosen().order);
    let judged = second_half(fit.chosen(), &first, &second);
    Some((fit, judged))
}

#[test]
fn an_order_chosen_on_the_first_half_simulates_the_second() {
    let Some((fit, [simulated, predicted])) = both_halves(2..=12, Focus::Simulation) else {
        return;
    };
    assert!(fit.entries.windows(2).all(|e| e[1].cost <= e[0].cost));
    // An independent ARX of order 8 has 65.8 and 63.9, of any order at most 96.3 and 94.3 one step ahead.
    assert!(simulated[0] > 73.0 && simulated[1] > 82.5, "{simulated:?}");
    assert!(predicted[0] > 90.0 && predicted[1] > 89.0, "{predicted:?}");
}

#[test]
fn the_focus_on_prediction_is_as_good_as_the_best_regression() {
    let Some((_, [_, predicted])) = both_halves(2..=12, Focus::Prediction) else {
        return;
    };
    assert!(predicted[0] > 95.0 && predicted[1] > 93.0, "{predicted:?}");
}

#[test]
#[ignore = "prints tables of all orders"]
fn tables() {
    both_halves(1..=20, Focus::Simulation);
    both_halves(1..=20, Focus::Prediction);
}
