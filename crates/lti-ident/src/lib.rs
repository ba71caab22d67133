//! Records of any excitation in, time-invariant models out, in the time domain.
//!
//! # The problem
//!
//! Two structures. The first is the innovation form, whose matrices are all free:
//!
//! `x+ = A x + B (u - u_0) + K e`, `y = y_0 + C x + D (u - u_0) + e`.
//!
//! [`identify`] minimises `ln det` of the covariance of the prediction error \[ljung1999\], section 7.4. With the
//! [`Focus::Simulation`] this is the output error, K = 0, and K is then fitted with the plant held; with the
//! [`Focus::Prediction`] all matrices are fitted to the error one step ahead. The second structure is one mass an axis,
//! `J q'' + F_v q' + o = u`, see [`rigid_body`].
//!
//! # How
//!
//! 1. A start from a regularised impulse response, realised by Ho and Kalman; poles outside the unit circle are
//!    mirrored, and B, D, the offset and the initial states, in which the predictions are linear, are solved for.
//! 2. Levenberg-Marquardt with exact sensitivities over all filters of an order. The steps are orthogonal to the
//!    directions that only change the basis of the state \[mckelvey2004\]; no canonical form, so no
//!    ill-conditioned one. The coordinates are balanced anew at each step. Initial states are eliminated. All
//!    sensitivities are sums of the responses of `2 n` orthonormal functions to each known signal \[heuberger2005\], so
//!    that a sample takes as many operations as there are such responses.
//! 3. A climb through the orders: each also starts from the optima of the two orders below, with states fitted to their
//!    residuals. So the cost never increases with the order. Of more than 10,000 samples a part is searched like this,
//!    and the best of each order is then searched on over all.
//! 4. The choice between orders by [`OrderEntry::expected_cost`].
//!
//! One-step prediction is the same search with `w = [u; y]` as known signals and `A - K C` for A, so that there is one
//! search. It stays where the poles of what is searched decay by a tenth over the longest segment; if an offset is
//! estimated, slow ones to a twentieth.
//!
//! # Glossary
//!
//! - *segment*: samples of a record without a gap; each has an initial state of its own.
//! - *simulated*: from inputs alone. *One step*: from inputs and from outputs up to the sample before.
//! - *cost*: `ln det` of the covariance of what is minimised, for signals of unit deviation.
//!
//! # What it does not do
//!
//! - Integrators with the focus on simulation: an output error that grows without bound has no minimum that the noise
//!   leaves in place. [`Focus::Prediction`] finds them; or differentiate the outputs.
//! - Detrending, resampling, outliers: all there is are constant offsets, see [`Offset`].
//! - A noise model with poles of its own: K shares those of the plant. A disturbance that is slower or faster than all of
//!   the plant needs a higher order.
//! - Covariances of the matrices: their basis is arbitrary. Rigid-body parameters have deviations.
//! - Couplings between rigid-body axes and dry friction: what they leave is in the relative force error.
//!
//! # A run
//!
//! ```
//! use lti_ident::lpv_core::{Discrete, Purpose, Record, RecordKind, Signals};
//! use lti_ident::{InnovationSettings, Segment, identify};
//!
//! // y(k + 1) = 0.9 y(k) + u(k), u a chirp.
//! let u: Vec<f64> = (0..300).map(|k| (1e-3 * f64::from(k * k)).sin()).collect();
//! let y: Vec<f64> = u.iter().scan(0.0, |y, u| Some(std::mem::replace(y, 0.9 * *y + u))).collect();
//! let none = Signals::default;
//! let record = Record {
//!     name: "chirp".into(), kind: RecordKind::Transient, purpose: Purpose::Estimation, position: None,
//!     outputs: Signals::new(&["y"], vec![y]), inputs: Signals::new(&["u"], vec![u]),
//!     references: none(), scheduling: none(), auxiliary: none(), injection: none(),
//! };
//! let settings = InnovationSettings::new([1, 2]);
//! let fit = identify(&[Segment::new(&record, 0..200)], Discrete::new(0.01)?, &settings, &[])?;
//! let pole = fit.entries[0].model.model().poles()?[0];
//! assert!((pole.re - 0.9).abs() < 1e-3, "{pole}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod account;
mod assemble;
mod choice;
mod error;
mod identify;
mod predictor;
mod problem;
mod rest;
pub mod rigid_body;
mod search;
mod segment;
mod sensitivity;
mod settings;
mod start;

pub use account::{InnovationFit, OrderEntry, StartEntry, StartKind};
pub use error::LtiIdentError;
pub use identify::{identify, identify_telling};
pub use lpv_core;
pub use lpv_numerics::least_squares::StopReason;
pub use segment::Segment;
pub use settings::{DirectTerm, Focus, InnovationSettings, ORDER_LIMIT, Offset};
