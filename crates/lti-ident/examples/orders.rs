//! Two modes seen through coloured noise: models of several orders from the first half of a record, judged by
//! simulation of the second.

use lpv_core::nalgebra::{DMatrix, DVector, dmatrix};
use lpv_core::{Discrete, Purpose, Record, RecordKind, Signals, StateSpace};
use lti_ident::{InnovationSettings, Segment, identify};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let clock = Discrete::new(0.01)?;
    let a = dmatrix![0.93, 0.28, 0.0, 0.0; -0.28, 0.93, 0.0, 0.0; 0.0, 0.0, 0.4, 0.8; 0.0, 0.0, -0.8, 0.4];
    let plant = StateSpace::new(
        a,
        dmatrix![1.0; 0.5; 0.5; 1.0],
        dmatrix![0.4, 0.1, 1.0, 0.0],
        dmatrix![0.0],
        clock,
    )?;
    let samples = 2000;
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut white = || DMatrix::<f64>::from_fn(1, samples, |_, _| StandardNormal.sample(&mut rng));
    let (u, e) = (white(), white());
    let clean = plant.simulate(&DVector::zeros(4), &u)?.outputs;
    let mut slow = 0.0;
    let y: Vec<f64> = clean
        .iter()
        .zip(&e)
        .map(|(y, e)| {
            slow = 0.8 * slow + 0.3 * e;
            y + slow
        })
        .collect();
    let record = Record {
        name: "two modes".into(),
        kind: RecordKind::Transient,
        purpose: Purpose::Estimation,
        position: None,
        outputs: Signals::new(&["y"], vec![y]),
        inputs: Signals::new(&["u"], vec![u.iter().copied().collect()]),
        references: Signals::default(),
        scheduling: Signals::default(),
        auxiliary: Signals::default(),
        injection: Signals::default(),
    };
    let (first, second) = (
        Segment::new(&record, 0..1000),
        Segment::new(&record, 1000..samples),
    );
    let settings = InnovationSettings::new(1..=8);
    let fit = identify(std::slice::from_ref(&first), clock, &settings, &[])?;
    println!("order    cost  expected  simulated, first and second half");
    for entry in &fit.entries {
        let state = entry
            .model
            .simulate(&entry.initial_states[0], &first.inputs())?
            .final_state;
        let simulated = entry.model.simulate(&state, &second.inputs())?.outputs;
        let y = second.outputs();
        let judged = 100.0 * (1.0 - (&y - simulated).norm() / y.add_scalar(-y.mean()).norm());
        println!(
            "{:5} {:7.3} {:9.3}  {:5.1} {judged:5.1}",
            entry.order, entry.cost, entry.expected_cost, entry.simulated_fit_percent[0]
        );
    }
    println!("chosen: {}", fit.chosen().order);
    for pole in fit.chosen().model.model().poles()? {
        println!("  pole {pole:.4}, modulus {:.4}", pole.norm());
    }
    Ok(())
}
