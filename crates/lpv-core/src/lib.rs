//! LTI, LPV state-space and LFR models, frequency responses, records.

mod clock;
mod discretise;
mod error;
mod frf;
pub mod linalg;
mod lti;
mod record;
mod response;

pub use clock::{Clock, Continuous, Discrete};
pub use error::CoreError;
pub use frf::{Frf, FrfEstimate};
pub use lti::{StateSpace, Trajectory};
pub use record::{PeriodBlock, Purpose, Record, RecordKind, Signals};
pub use response::ResponseKernel;

pub use nalgebra;
pub use num_complex;
