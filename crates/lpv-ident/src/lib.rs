//! LPV-OBF models from frequency responses: the regression and interpolation of equation (13).
//!
//! # The problem
//! At positions `p_q` there are FRF estimates `F_q(z_k)` with covariances. Given fixed orthonormal filters
//! `phi_1 ... phi_ng`, find real matrices `W_i(p)` and constants `c` such that
//!
//! `G(z, p) = sum_t c_t E_t phi_R(z) + sum_i W_i(p) phi_i(z)`,  `phi_R(z) = (z + 1) / (z - 1)^2`
//!
//! has frozen responses near the estimates, at and between the positions. [`regress`] solves the weighted linear least
//! squares problem over all positions with `c` in common, [`LocalFits::leave_one_out`] says which interpolation the
//! samples `W_i(p_q)` support, [`LocalFits::interpolate`] builds the model, and [`LpvObfModel::response_deviation`]
//! carries the covariance of the data to every frozen response. Where models of the positions are at hand in coordinates
//! that go along with p, [`interpolate_models`] joins them instead: it needs fewer positions where poles move far.
//!
//! # Words
//! - *position*: a constant value of the scheduling variable p at which an experiment was made.
//! - *sample*: `W_i(p_q)`, the coefficient at a position.
//! - *cardinal function* `l_q(p)`: the weight of sample q in `W(p)`; every interpolation here is linear in the samples.
//! - *whitened*: multiplied by factors of the covariance so that the noise has unit variance.
//!
//! # What it does not do
//! It does not choose poles (obf-basis does), does not see time series, and does not fit models that are nonlinear in
//! their parameters: the basis stays as given. It knows p only as a constant: what a moving p does is not in frozen
//! responses.
//!
//! # Example
//! ```
//! use lpv_ident::lpv_core::nalgebra::{self, DMatrix, dmatrix};
//! use lpv_ident::lpv_core::{Discrete, FrfEstimate, StateSpace};
//! use lpv_ident::{Interpolation, RegressionSettings, Weighting, regress};
//!
//! let clock = Discrete::new(1.0)?;
//! // One Laguerre function; the "machine" is (1 + p) phi_1.
//! let (a, b) = (dmatrix![0.5], dmatrix![0.75_f64.sqrt()]);
//! let phi = StateSpace::new(a.clone(), b.clone(), dmatrix![1.0], dmatrix![0.0], clock)?;
//! let frequencies: Vec<f64> = (1..40).map(|k| 0.0125 * k as f64).collect();
//! let estimates = [-1.0, 0.0, 1.0].map(|p| {
//!     let machine = StateSpace::new(a.clone(), b.clone(), dmatrix![1.0 + p], dmatrix![0.0], clock).unwrap();
//!     FrfEstimate::with_unit_covariance(machine.frequency_response(&frequencies).unwrap(), Some(p.into())).unwrap()
//! });
//! let fits = regress(&estimates, &phi, &RegressionSettings { weighting: Weighting::Uniform, ..RegressionSettings::default() })?;
//! let model = fits.interpolate(Interpolation::Polynomial { order: 1 })?;
//! assert!((model.weights().evaluate(&[0.3]) - DMatrix::from_element(1, 1, 1.3)).norm() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod choose;
mod error;
mod expansion;
mod interpolation;
mod local;
mod model;
mod regression;
mod settings;
mod weights;

pub use choose::{LeaveOneOut, recommend};
pub use error::IdentError;
pub use interpolation::{Interpolation, InterpolationOperator, monomials};
pub use local::interpolate_models;
pub use lpv_core;
pub use model::LpvObfModel;
pub use regression::{LocalFit, LocalFits, regress};
pub use settings::{RegressionSettings, RigidTerm, Weighting};
