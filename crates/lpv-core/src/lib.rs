//! Models, frequency responses and records: the types that all other crates exchange.
//!
//! # The problem
//!
//! A machine whose dynamics depend on a measured signal p (its *scheduling*) is written in one of three forms, here in
//! discrete time. LPV state space with static dependence, equation (2) of \[toth2011\], [`LpvStateSpace`]:
//!
//! `x(k+1) = A(p) x + B(p) u`, `y = C(p) x + D(p) u`, with `M(p) = sum_j Theta_j f_j(p)` (5);
//!
//! the linear fractional representation (3), [`Lfr`], whose nine matrices are constant:
//!
//! `x(k+1) = A x + B1 w + B2 u`, `z = C1 x + D11 w + D12 u`, `y = C2 x + D21 w + D22 u`, `w = Delta(p) z`;
//!
//! and the series expansion in fixed filters (6), (13), [`SeriesExpansion`]:
//!
//! `y = R(q) u + W_0(p) u + sum_i W_i(p) phi_i(q) u`.
//!
//! [`SeriesExpansion::to_state_space`] and [`Lfr::to_state_space`] go from one to the next; the crate lfr-realize makes the exact LFR of
//! an LPV state space. At constant p all three are a [`StateSpace`], whose response `C (zI - A)^-1 B + D` on thousands of lines
//! costs one Schur form of A and `O(n^2)` a line, see [`ResponseKernel`].
//!
//! # Glossary
//!
//! - *frozen*: with p held constant.
//! - *range*: the box of p that a model is made for. No model is evaluated outside it.
//! - *delta*: p normalised to `[-1, 1]` over the range, one entry of the diagonal of `Delta(p)`.
//! - *well-posed*: `I - D11 Delta(p)` can be inverted for every p of the range.
//! - *clock*: [`Continuous`], or [`Discrete`] with its sample time. It is part of the type of a model.
//! - *line*: one frequency of a response. Frequencies are Hz and end in `_hz`.
//! - *record*: signals of one experiment at one sample rate; nothing in it says whether they were measured.
//!
//! # What it does not do
//!
//! It estimates nothing: no spectra, fits or choices. It opens no file; [`Model`] goes to and from JSON text. It does
//! not extrapolate: a p outside the range is an error, since an interpolated coefficient means nothing there. It does
//! not approximate in silence: a spline has no exact LFR and a rational LFR no exact polynomial, so both are refused
//! by name. Dependence on past values of p has no type here, since frozen responses cannot show it.
//!
//! # A run
//!
//! ```
//! use lpv_core::nalgebra::{self, DMatrix, DVector, dmatrix};
//! use lpv_core::{Discrete, LpvStateSpace, MatrixFunction, SchedulingRange};
//!
//! // x(k+1) = (0.8 + 0.1 p) x + u, y = (1 + p^2) x on p in [-1, 1].
//! let a = MatrixFunction::polynomial(vec![dmatrix![0.8], dmatrix![0.1]])?;
//! let c = MatrixFunction::polynomial(vec![dmatrix![1.0], dmatrix![0.0], dmatrix![1.0]])?;
//! let constant = |v: f64| MatrixFunction::constant(dmatrix![v]);
//! let range = SchedulingRange::interval(-1.0, 1.0)?;
//! let model = LpvStateSpace::new(a, constant(1.0)?, c, constant(0.0)?, range, Discrete::new(0.05)?)?;
//! // At p = 0.5 and frequency zero: (1 + 0.25) / (1 - 0.85).
//! let response = model.frozen(&[0.5])?.frequency_response(&[0.0])?;
//! assert!((response.line(0)[(0, 0)].re - 1.25 / 0.15).abs() < 1e-12);
//! let y = model.simulate(&DVector::zeros(1), &dmatrix![1.0, 0.0], &dmatrix![0.0, 1.0])?.outputs;
//! assert_eq!(y, DMatrix::from_row_slice(1, 2, &[0.0, 2.0]));
//! # Ok::<(), lpv_core::CoreError>(())
//! ```

mod clock;
mod connect;
mod controller;
mod counted;
mod discretise;
mod error;
mod frf;
mod function;
mod geometry;
mod innovation;
mod json;
mod lfr;
pub mod linalg;
mod lpv;
mod lti;
mod memory;
mod model;
mod polynomial;
mod position;
mod range;
mod record;
mod recursion;
mod response;
mod rigid_body;
mod sampled;
mod series;
mod spline;

pub use clock::{Clock, Continuous, Discrete, same_clock};
pub use controller::{Controller, ControllerFault, ControllerProblem, ControllerState};
pub use counted::counted;
pub use error::CoreError;
pub use frf::{Frf, FrfEstimate};
pub use function::{BasisKind, FunctionBasis, MatrixFunction, matern52};
pub use geometry::Geometry;
pub use innovation::InnovationModel;
pub use json::MODEL_VERSION;
pub use lfr::{DeltaBlock, Lfr, LfrBlocks, WellPosedness};
pub use lpv::LpvStateSpace;
pub use lti::{StateSpace, Trajectory};
pub use memory::keep_freed_memory;
pub use model::{FrozenModel, Model};
pub use nalgebra;
pub use num_complex;
pub use position::Position;
pub use range::SchedulingRange;
pub use record::{PeriodBlock, Purpose, Record, RecordKind, Signals};
pub use response::ResponseKernel;
pub use rigid_body::{AxisOutput, RigidBody, RigidBodyAxis};
pub use sampled::SchedulingNodes;
pub use series::SeriesExpansion;
