//! Moves of a machine and its base model in, the effects that the model lacks out: found and fitted on some records, and kept only
//! where they lower the error on others that they were not fitted to.
//!
//! # The problem
//!
//! A model leaves an error `e = y - y_sim` along a move in closed loop. [`trace()`] simulates the base model inside the loop of
//! the experiment, with blocks of the catalogue where they act: on the commands, on the motors, on the load, on the sensors.
//! The white error w (what one sample adds to what the past of e tells) is fitted by Levenberg-Marquardt over the parameters
//! of effects and machine together. With S the sum of squares of N samples of w in units of their noise, and d = `W (c - c_0)` the
//! departure of the machine's n coordinates c from what frequency responses tell of them ([`fit_table`]), it minimises
//!
//! ```text
//! N ln(S / N) + n ln(1 + |d|^2 / n)   while S > N,   S - N + n ln(1 + |d|^2 / n)   else
//! ```
//!
//! the likelihood of an error whose size is not known before it is explained: a large error does not bend the machine away from
//! what is known of it, a small one refines it. What is known may be wrong itself, where an effect was there when the responses were
//! measured: far from it, it holds no longer. The masses that a geometry tells are held at first; the model with free masses is
//! selected if it attains the shorter description length without any effect. Every effect is tried by one linear step from each of its starts, with
//! the directions of the machine taken out; the most promising are fitted in full; refinements of what does well start where it
//! ends (Stribeck from Coulomb friction, a flexible mode from a mass). The least `objective + k ln N` wins, and is added if the
//! error falls on the judged records too. This is repeated until noise is left, or nothing helps; after each addition the earlier
//! effects are taken out one by one and chosen again beside the others, since a large effect hides what a small one is. The final simulation refines its
//! substeps until the errors no longer change.
//!
//! Where no controller is known, an [`observer`] holds an axis at its records. [`servo_axis`] makes the base of an axis from its records alone.
//! [`fn@axes`] takes a machine apart whose axes move by themselves, and [`fn@skew`] tells which of two encoders of one is late; [`compare`] also what else they differ in.
//!
//! Where there are no moves, [`trace_responses`] adds linear effects to a rigid axis, on its frequency response.
//!
//! # Words
//!
//! - *Base*: the machine without effects, an [`XyTable`] or an [`Axis`] from first principles, or an identified model ([`Lpv`]).
//! - *Effect*: an entry of the [`catalogue`], one file with its parameters, its starts and its [`effect::Block`], at one channel.
//! - *Judged records*: held out, never fitted. They decide whether an effect is kept, and so its gain on them is that of the best of
//!   a few.
//! - *Noise*: as it leaves the loop; the controller feeds back what the sensors add.
//! - *Left*: what tests find in the white error, with bounds that hold for all of them together. Where readings lie on a coarse grid
//!   and errors are no larger than its rounding, that is the rounding.
//! - *Equivalent force*: what has to be added to the inputs for the outputs to be those of the record ([`equivalent_force`]).
//! - *Unexplained*: effects that take less than 85 percent of the excess over the noise are not named.
//!
//! # What it does not do
//!
//! It estimates no frequency response and reads no file. Effects of the couplings need the xy-table; masses that change are found on
//! it and on servo axes, and with an identified model a payload is a gain of its inputs. Its integration has a fixed step: an effect that is fast within a part of a sample is smoothed.
//! It finds no cause outside the catalogue, and says so by not naming one.
//!
//! # A run
//!
//! A mass that drags a Coulomb friction of 2 N, simulated by hand with many small steps, and an axis that knows nothing of it:
//!
//! ```
//! use lpv_diagnose::lpv_core::{Controller, Purpose, Record, RecordKind, Signals};
//! use lpv_diagnose::{Axis, Base, Case, Track, Verdict, sensor_noise, trace};
//!
//! let controller = Controller {
//!     reference_numerator: vec![vec![3000.0, -2900.0]],
//!     feedback_numerator: vec![vec![3000.0, -2900.0]],
//!     denominator: vec![vec![1.0]],
//!     limit: None,
//! };
//! let (step, mass, friction) = (0.01, 10.0, 2.0);
//! let mut seed = 1_u64;
//! let mut noise = || {
//!     // Twelve uniform numbers of a linear congruence add up to nearly a normal one.
//!     let mut one = || {
//!         seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
//!         (seed >> 11) as f64 / (1_u64 << 53) as f64
//!     };
//!     1e-5 * ((0..12).map(|_| one()).sum::<f64>() - 6.0)
//! };
//! let mut record = |name: &str, rate: f64| -> Result<Track, Box<dyn std::error::Error>> {
//!     let mut state = controller.start()?;
//!     let (mut x, mut v) = (0.0_f64, 0.0_f64);
//!     let (mut r, mut u, mut y) = (Vec::new(), Vec::new(), Vec::new());
//!     for k in 0..1500 {
//!         let t = f64::from(k) * step;
//!         r.push(0.05 * (1.0 - (rate * t).cos()) * (1.0 + 0.3 * (0.37 * rate * t).sin()));
//!         y.push(x + noise());
//!         let mut force = [0.0];
//!         state.step(&[r[k as usize]], &[y[k as usize]], &mut force);
//!         u.push(force[0]);
//!         for _ in 0..400 {
//!             v += 0.0025 * step * (force[0] - friction * (v / 1e-3).tanh()) / mass;
//!             x += 0.0025 * step * v;
//!         }
//!     }
//!     let record = Record {
//!         name: name.to_owned(),
//!         kind: RecordKind::Transient,
//!         purpose: Purpose::Estimation,
//!         position: None,
//!         outputs: Signals::new(&["y"], vec![y]),
//!         inputs: Signals::new(&["u"], vec![u]),
//!         references: Signals::new(&["r"], vec![r]),
//!         scheduling: Signals::new(&[], vec![]),
//!         auxiliary: Signals::new(&[], vec![]),
//!         injection: Signals::new(&[], vec![]),
//!     };
//!     Ok(Track::new(&record, step, 4, None)?)
//! };
//! let fitted = [record("slow", 0.7)?, record("fast", 1.9)?];
//! let judged = [record("other", 1.3)?];
//! let found = trace(&Case {
//!     base: &Base::Axis(Axis::new(10.0, 0.0, 0.0)),
//!     prior: None,
//!     free: None,
//!     controller: &controller.start()?,
//!     noise: [1e-5, 0.0],
//!     fitted: &fitted,
//!     judged: &judged,
//!     own: &[],
//!     seeks_load: false,
//!     on_fit: &|_, _| {},
//! })?;
//! assert_eq!(found.added[0].effect.name, "coulomb-friction");
//! let (level, deviation) = found.added[0].values[0];
//! assert!((level - 2.0).abs() < 0.02, "{level} with {deviation}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod axes;
mod base;
pub mod catalogue;
mod character;
pub mod effect;
mod error;
mod fit;
mod force;
mod frozen;
mod inverse;
mod left;
pub mod observer;
mod responses;
mod screen;
mod servo_axis;
mod simulate;
mod skew;
mod steady;
mod trace;
mod track;
mod user_effect;
mod whiten;

pub use axes::{AxisChannels, axes};
pub use base::{Axis, Base, BaseParameter, Forces, Load, Lpv, Motion, Pair, XyTable, table_from_geometry};
pub use character::{Character, characterise};
pub use error::TraceError;
pub use fit::{Explained, Prior};
pub use force::{EquivalentForce, equivalent_force, prediction_errors};
pub use frozen::{FrozenFit, fit_table};
pub use left::Left;
pub use lpv_core;
pub use responses::{
    ResponseCase, ResponseStep, characterise_response, error_of, noise_of, response, trace_responses,
};
pub use screen::{Screen, Trial};
pub use servo_axis::{axis_in_band, servo_axis};
pub use simulate::Response;
pub use skew::{Compared, Skew, compare, skew};
pub use steady::steady_forces;
pub use trace::{
    Added, Case, Judged, MISSING_SHARE, Slower, Trace, Tried, Verdict, begun, sensor_noise, trace,
    trace_in_band, trace_slower,
};
pub use track::{Track, roughness};
pub use user_effect::{UserEffect, UserParameter, UserState};
