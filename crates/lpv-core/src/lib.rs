//! LTI, LPV state-space and LFR models, frequency responses, records.

mod clock;
mod discretise;
mod error;
mod frf;
mod function;
mod json;
mod lfr;
pub mod linalg;
mod lpv;
mod lti;
mod range;
mod realise;
mod record;
mod response;
mod series;
mod spline;
mod star;

pub use clock::{Clock, Continuous, Discrete};
pub use error::CoreError;
pub use frf::{Frf, FrfEstimate};
pub use function::{BasisKind, FunctionBasis, MatrixFunction, matern52};
pub use json::{MODEL_VERSION, Model};
pub use lfr::{DeltaBlock, Lfr, LfrBlocks, WellPosedness};
pub use lpv::LpvStateSpace;
pub use lti::{StateSpace, Trajectory};
pub use range::SchedulingRange;
pub use record::{PeriodBlock, Purpose, Record, RecordKind, Signals};
pub use response::ResponseKernel;
pub use series::SeriesExpansion;
pub use star::Partitioned;

pub use nalgebra;
pub use num_complex;
