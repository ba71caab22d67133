//! A mass on a spring that stiffens with p, along a move of p: simulated, and predicted one step ahead from noisy samples.

use lpv_simulate::lpv_core::nalgebra::{self, dmatrix};
use lpv_simulate::lpv_core::{
    Discrete, LpvStateSpace, MatrixFunction, Model, Purpose, Record, RecordKind, SchedulingRange, Signals,
};
use lpv_simulate::{Machine, Predictor, open_loop, rms_error, whiteness};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let clock = Discrete::new(0.01)?;
    let a = MatrixFunction::polynomial(vec![
        dmatrix![1.0, 0.01; -0.4, 0.98],
        dmatrix![0.0, 0.0; -0.2, 0.0],
    ])?;
    let constant = MatrixFunction::constant;
    let model = LpvStateSpace::new(
        a,
        constant(dmatrix![0.0; 0.01])?,
        constant(dmatrix![1.0, 0.0])?,
        constant(dmatrix![0.0])?,
        SchedulingRange::interval(-1.0, 1.0)?,
        clock,
    )?;
    let machine = Machine::new(&Model::from(model), clock)?;
    let wave = |rate: f64| (0..2000).map(|k| (rate * f64::from(k)).sin()).collect::<Vec<_>>();
    let mut record = Record {
        outputs: Signals::new(&["y"], vec![vec![0.0; 2000]]),
        inputs: Signals::new(&["u"], vec![wave(0.013)]),
        scheduling: Signals::new(&["p"], vec![wave(0.002)]),
        ..Record::empty("move", RecordKind::Transient, Purpose::Validation)
    };
    let run = open_loop(&machine, &record, None)?;
    // Readings of a sensor with steps.
    record.outputs.columns[0] = run.outputs.iter().map(|y| (1e5 * y).round() / 1e5).collect();
    println!(
        "rounding of the sensor: {:.1e} rms",
        rms_error(&run.outputs, &record)[0]
    );
    let errors = Predictor::for_disturbance(&machine, &[1e-4], &[3e-6]).errors(&record, None, 2000)?;
    let residual: Vec<f64> = errors.iter().copied().collect();
    let test = whiteness("y", &residual, &[]);
    println!(
        "one step ahead: at most {:.1e}, white: {}",
        errors.amax(),
        test.is_white()
    );
    Ok(())
}
