//! Low-order LFRs fitted to frequency responses at all positions, and to records along which p moves.
//!
//! # The problem
//! A control engineer's tools want the linear fractional form (3),
//! `x(k+1) = A x + B1 w + B2 u`, `z = C1 x + D11 w + D12 u`, `y = C2 x + D21 w + D22 u`, `w = Delta(p) z`, with few states
//! and few deltas. Given responses `G(p_i, f_k)` at constant positions, [`refine`] moves the free entries of an LFR, in
//! continuous time (held between samples, exactly) or in discrete time, to the least
//! `sum_(i,k) ||W_y (F(p_i, f_k) - G(p_i, f_k)) W_u||_F^2`, relative or whitened by the covariance of the data
//! ([`FrozenData`]). [`local_model`] makes a start at one position from the poles there, and [`grow`] gets from it to
//! the whole range, [`grow_sizes`] with as few deltas as do. The error is part of the result, as is the covariance of every frozen
//! response. [`moving`] goes on with records along which p moves.
//!
//! # How it is found
//! The frozen system is `S(p) = M_aa + M_ab K M_ba` with `K = Delta (I - M_bb Delta)^-1`, all nine matrices being blocks of one
//! matrix M ([`Candidate`]), so `dS = [I, M_ab K] dM [I; K M_ba]`; the Fréchet derivative of the exponential carries
//! it through the hold, and `dF = [C (zI-A)^-1, I] dS_d [(zI-A)^-1 B; I]` to every line. At each position an orthogonal
//! factorisation leaves as many rows as the frozen system has parameters, so that thousands of lines cost no more
//! memory than a few; noisy lines that no model near the data can tell apart are merged first ([`merge_lines`]), so that the way
//! through a narrow valley goes over a hundred lines instead of thousands. Changes of coordinates (of the states, and of the deltas of one parameter) do not change a response;
//! steps are taken in the complement of their tangents, by Levenberg-Marquardt with columns of equal length and a correction
//! for the bend of the residuals along the step (geodesic acceleration). States that
//! nothing free touches, like those of an exactly known rigid body, have their response computed once.
//!
//! # Starts
//! [`grow`] begins with local models at all positions in one state basis, a polynomial through their matrices, and its
//! Hankel matrix in powers of delta cut to rank, which is Ho and Kalman's realisation with delta in the place of the shift.
//! Random channels follow where that misses the target. [`grow_from`] begins with a model that is there.
//!
//! # Words
//! - *delta*: one entry of the diagonal of `Delta(p)`; their number is the size of w and z.
//! - *channel*: one entry of w and z; a *direct* channel has delta 1 and serves to give M a structure.
//! - *frozen*: with p held constant.
//! - *free*: an entry of M that a refinement may move.
//! - *gain of the rigid body*: `gamma` in `F = gamma (T^2/2) (z + 1) / (z - 1)^2 + flexible part`.
//! - *well-posed*: `I - D11 Delta(p)` can be inverted for every p of the range.
//!
//! # What it does not do
//! A fit approximates, and always says by how much: residuals of each position, rank and condition, why it stopped. It does not find
//! poles, makes no stable model unstable, and promises no global minimum: [`grow`] tries several starts and accounts for each,
//! [`grow_sizes`] several numbers of deltas. Frozen responses do not determine what the model does while p moves.
//!
//! # Examples
//! A mass on a spring whose stiffness is `2 + p`, from responses at five positions and a model at p = 0 alone:
//! ```
//! use lfr_fit::{FrozenData, GrowSettings, grow};
//! use lfr_fit::lpv_core::nalgebra::{self, dmatrix};
//! use lfr_fit::lpv_core::{Continuous, CoreError, DeltaBlock, Discrete, SchedulingRange, StateSpace};
//!
//! let clock = Discrete::new(0.5)?;
//! let spring = |p: f64| {
//!     let a = dmatrix![0.0, 1.0; -2.0 - p, -0.1];
//!     StateSpace::new(a, dmatrix![0.0; 1.0], dmatrix![1.0, 0.0], dmatrix![0.0], Continuous)
//! };
//! let lines: Vec<f64> = (1..40).map(|k| 0.025 * f64::from(k)).collect();
//! let response = |p| Ok((vec![p], spring(p)?.zero_order_hold(clock)?.frequency_response(&lines)?));
//! let responses: Vec<_> = [-1.0, -0.5, 0.0, 0.5, 1.0].into_iter().map(response).collect::<Result<_, CoreError>>()?;
//! let data = FrozenData::relative(clock, &responses)?;
//! let (one, range) = (DeltaBlock { parameter: 0, repetitions: 1 }, SchedulingRange::interval(-1.0, 1.0)?);
//! let grown = grow(&spring(0.0)?, None, &data, &[one], &range, &GrowSettings::default())?;
//! assert!(grown.reached && grown.refined.account.largest < 1e-4);
//! assert_eq!(grown.refined.candidate.to_lfr()?.delta_count(), 1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod candidate;
mod constant_poles;
mod covariance;
mod data;
mod error;
mod frozen;
mod grow;
mod ho_kalman;
mod indistinguishable;
mod lines;
mod local;
mod mechanical;
mod merge_lines;
mod minimax;
pub mod moving;
mod problem;
mod refine;
mod sampling;
mod search;
mod settings;
mod shape;
mod start;
mod structure;
#[cfg(test)]
mod test_kit;
mod units;
mod whiten;

pub use candidate::{Candidate, Channel};
pub use constant_poles::{Between, ConstantPoles, ShapesAt, constant_poles};
pub use data::{FrozenData, ResidualUnit};
pub use error::FitError;
pub use grow::{
    DeltaReach, GainFit, GrowSettings, Grown, SizeChoice, Sizes, StartAccount, StartKind, StartOutcome,
    StartSearch, grow, grow_from, grow_sizes, merge_lines,
};
pub use local::{LocalBody, LocalMode, LocalModel, LocalSettings, RigidGain, local_body, local_model};
pub use lpv_core;
pub use lpv_numerics::least_squares::StopReason;
pub use mechanical::{DeltaSplit, MechanicalForm};
pub use refine::{RefineAccount, Refined, refine};
pub use sampling::{Sampling, sampled};
pub use settings::RefineSettings;
pub use start::{RandomChannels, Rigid};
pub use units::Units;
