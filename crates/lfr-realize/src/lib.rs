//! LFRs of LPV-OBF models.
//!
//! # The problem
//! A control engineer's tools want the linear fractional form (3),
//! `x(k+1) = A x + B1 w + B2 u`, `z = C1 x + D11 w + D12 u`, `y = C2 x + D21 w + D22 u`, `w = Delta(p) z`. Given an expansion
//! `y = R u + sum_i W_i(p) phi_i u` with polynomial `W_i(p)`, [`realize`] builds an LFR with the same response at every
//! constant p, and says whether it is well-posed over the whole range.
//!
//! # Words
//! - *delta*: one entry of the diagonal of `Delta(p)`; their number is the size of w and z.
//! - *well-posed*: `I - D11 Delta(p)` can be inverted for every p of the range.
//!
//! # What it does not do
//! It does not fit data: the LFR has exactly the error of the model that it is given. Splines and Gaussian
//! processes are refused, since no finite LFR equals them; a Chebyshev interpolant is the way round.
//!
//! # Example
//! ```
//! use lpv_core::nalgebra::{DMatrix, dmatrix};
//! use lpv_core::{Discrete, MatrixFunction, SchedulingRange, SeriesExpansion, StateSpace};
//!
//! // y = (1 + p + p^2) q^-1 u on p in [-1, 1]: one state, two deltas.
//! let clock = Discrete::new(1.0)?;
//! let pulse = StateSpace::new(dmatrix![0.0], dmatrix![1.0], dmatrix![1.0], dmatrix![0.0], clock)?;
//! let nothing = StateSpace::gain(dmatrix![0.0], clock)?;
//! let w = MatrixFunction::polynomial(vec![dmatrix![1.0]; 3])?;
//! let w0 = MatrixFunction::constant(DMatrix::zeros(1, 1))?;
//! let range = SchedulingRange::interval(-1.0, 1.0)?;
//! let made = lfr_realize::realize(&SeriesExpansion::new(nothing, pulse, w0, w, range)?)?;
//! assert_eq!((made.lfr.states(), made.lfr.delta_count()), (1, 2));
//! assert!(made.largest_difference(&[-1.0, 0.2, 1.0], &[0.1, 0.4])? < 1e-14);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod direct;
mod error;

pub use direct::{Realization, realize};
pub use error::RealizeError;
