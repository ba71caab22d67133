//! LFRs from models: exactly from LPV state space, with fewer states and deltas, and how far two are apart.
//!
//! # The problem
//! A control engineer's tools want the linear fractional form (3),
//! `x(k+1) = A x + B1 w + B2 u`, `z = C1 x + D11 w + D12 u`, `y = C2 x + D21 w + D22 u`, `w = Delta(p) z`.
//!
//! - *Exactly.* [`exact_lfr`] turns LPV state space with polynomial coefficients into it. Given an expansion
//!   `y = R u + sum_i W_i(p) phi_i u` with polynomial `W_i(p)`, [`realize`] builds an LFR with the same response at every
//!   constant p, and says whether it is well-posed over the whole range. It has many states and deltas: one copy of the
//!   filters an input, `n_y` deltas a degree.
//! - *Reduced.* [`reduce`] cuts states and deltas of any LFR together, by a fit to its frozen responses ([`lfr_fit`]) that starts from
//!   Gramians averaged over the range, with the integrators of a rigid body held, and says how far the result
//!   is from what it was given; [`Reduced::grow`] goes on from there on data.
//! - *Bounded.* [`difference_bound`] bounds the relative difference of two LFRs at every p, not at samples: both are power series in
//!   delta around any point, with a rest that their matrices bound. [`bound_between`] uses it to say what the data support
//!   between their positions.
//!
//! # Words
//! - *delta*: one entry of the diagonal of `Delta(p)`; their number is the size of w and z.
//! - *frozen*: with p held constant.
//! - *well-posed*: `I - D11 Delta(p)` can be inverted for every p of the range.
//!
//! # What it does not do
//! [`realize`] approximates nothing: splines and Gaussian processes are refused, since no finite LFR equals them; a
//! Chebyshev interpolant is the way round. [`reduce`] approximates, and always says by how much. A low-order LFR straight from data is
//! the work of [`lfr_fit`].
//!
//! # Examples
//! ```
//! use lfr_realize::lpv_core::nalgebra::{self, DMatrix, dmatrix};
//! use lfr_realize::lpv_core::{Discrete, MatrixFunction, SchedulingRange, SeriesExpansion, StateSpace};
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

mod bound;
mod direct;
mod error;
mod exact;
mod reduce;

pub use bound::{
    Between, BetweenWarning, BoundSettings, DifferenceBound, Interval, bound_between, difference_bound,
    largest_shift_of,
};
pub use direct::{Realization, realize};
pub use error::RealizeError;
pub use exact::exact_lfr;
pub use lfr_fit;
pub use lpv_core;
pub use reduce::{ReduceSettings, Reduced, reduce, reduce_to_continuous};
