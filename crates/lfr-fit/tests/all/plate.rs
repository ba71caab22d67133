//! The plate of the example with five modes: 4 inputs and outputs, 10 states, 2 parameters.

#[path = "../../examples/plate.rs"]
#[allow(dead_code, reason = "the program of the example is not called")]
mod example;

#[test]
fn two_parameters_four_inputs() {
    let outcome = example::fit(&example::Plate { modes: 5 }, 3, 2e-3).unwrap();
    println!("{} {:?}", outcome.rms, outcome.unseen_db);
    assert_eq!((outcome.states, outcome.deltas), (10, 6));
    let [largest, median] = outcome.unseen_db;
    assert!(largest < -40.0 && median < -50.0, "{largest} {median}");
}
