//! Models along records.
//!
//! | question | answer |
//! |---|---|
//! | what does the model give for the recorded inputs? | [`open_loop`] |
//! | what with a controller, for the recorded references? | [`closed_loop`] |
//! | what does it predict one sample ahead? | [`Predictor`], with a gain of its own or a Kalman filter |
//! | is what it misses noise? | [`whiteness`], [`cross_correlation`] |
//!
//! A model is whatever can be frozen at a scheduling value ([`Frozen`]); [`Machine`] makes any [`lpv_core::Model`] one, with the clock of the
//! records. Scheduling follows the record from sample to sample; a time-invariant model does not look at it. Signals are in the units of the
//! record, frequencies in cycles per unit of its time.
//!
//! # What it does not do
//!
//! It fits nothing, says of no error whether it is large, and knows no effect beside a model: those are simulated, and explained, in
//! lpv-diagnose. Between samples the input is held.
//!
//! # A run
//!
//! ```
//! use lpv_simulate::lpv_core::nalgebra::{self, dmatrix};
//! use lpv_simulate::lpv_core::{Discrete, Model, Purpose, Record, RecordKind, Signals, StateSpace};
//! use lpv_simulate::{Machine, Predictor, open_loop, rms_error};
//!
//! // x+ = 0.5 x + u, y = x.
//! let clock = Discrete::new(0.1)?;
//! let system = StateSpace::new(dmatrix![0.5], dmatrix![1.0], dmatrix![1.0], dmatrix![0.0], clock)?;
//! let machine = Machine::new(&Model::from(system), clock)?;
//! let record = Record {
//!     outputs: Signals::new(&["y"], vec![vec![0.0, 1.0, 0.5, 0.25]]),
//!     inputs: Signals::new(&["u"], vec![vec![1.0, 0.0, 0.0, 0.0]]),
//!     ..Record::empty("impulse", RecordKind::Transient, Purpose::Validation)
//! };
//! let run = open_loop(&machine, &record, None)?;
//! assert_eq!(rms_error(&run.outputs, &record), [0.0]);
//! let predictor = Predictor::for_disturbance(&machine, &[0.1], &[0.01]);
//! assert!(predictor.errors(&record, None, 4)?.amax() < 1e-12);
//! # Ok::<(), lpv_simulate::SimulateError>(())
//! ```

mod disturbance;
mod error;
mod machine;
mod predict;
mod residual;
mod run;
mod start;

pub use disturbance::{disturbance, likeliest, predictor, predictor_for_part};
pub use error::SimulateError;
pub use lpv_core;
pub use machine::Machine;
pub use predict::{Predictor, stationary_covariance};
pub use residual::{
    CrossCorrelation, SMALL_COLOUR, SMALL_INPUT_SHARE, Whiteness, cross_correlation, predictable_share, rows,
    share_of_inputs, whiteness,
};
pub use run::{Frozen, Run, Steps, closed_loop, open_loop, rms_error};
pub use start::{at_rest, first_state};
