//! First-principles xy-table in closed loop: parameters in, records out. It knows no identification.
//!
//! # The problem
//!
//! A carriage (m1, J1; y1, R1) rides at `x1 = p` on a beam (m2, J2; y2, R2) that two linear motors push at its ends.
//! With `q = [y1, R1, y2, R2]`, deflections `E(p)^T q = [y1 - y2 - p R2, R1 - R2]` and a constant mass matrix M,
//!
//! `M q'' + E(p) diag(d) E(p)^T q' + E(p) diag(k) E(p)^T q = [0; B_rb] F`, and `m x1'' = F_x` (7), (8),
//!
//! with motors and sensors decoupled for the rigid body (9): `F = T_u(p) u'`, `T_u = B_rb^-1 M_rb(p)`,
//! `y' = [y1 - p R1, R1]`. So `u' -> y'` (10) has 8 states and tends to `I / s²` at low frequency for every p. Two SISO
//! controllers close the loop on `yhat = y' + v` with sensor noise v (11).
//!
//! The stiffness is quadratic in p, although the text after (7) calls it linear: with a constant mass matrix, the term in
//! p² is what leaves rigid rotation free of force. Without it the double integrators of the paper's figures become
//! unstable.
//!
//! # Words
//!
//! - *frozen*: with p held constant. *Sampled*: with inputs held between samples (zero-order hold), exact.
//! - *multisine*: periodic sum of cosines on chosen *lines* (cycles a period). *Crest factor*: peak over rms.
//! - *modulus margin*: inverse of the largest singular value of the sensitivity `(I + P K)^-1`.
//! - time is scaled, as in the paper; "Hz" are cycles per unit of that time.
//!
//! # What it does not do
//!
//! It estimates nothing and reads or writes no files: records leave through [`lpv_core::Record`] and
//! [`lpv_core::PeriodBlock`], as measured ones do, so that nothing downstream can tell that they are simulated or look
//! at the true parameters. The nominal machine has no friction, saturation or delay, which would hide what the
//! identification of it can reach. The motor of x1 feels no reaction of the beam, as in (7), where the mass matrix is
//! constant and block diagonal.
//!
//! # What can be hidden in it
//!
//! [`HiddenEffect`]s put what a real machine has into the simulation: friction, cogging, lag, delay, saturation, a
//! payload, sensor errors and more, see [`HiddenEffect::catalogue`]. They act physically: on the commands, the motors,
//! the guides at the ends of the beam, the couplings and the sensors. Controllers, decoupling and feed-forward stay
//! nominal. With an effect, experiments at constant p are integrated as the moves are, instead of being exact. Coulomb
//! friction is `tanh(speed / 0.1 mm/s)` in place of a sign, so that the integration converges: a guide creeps and never
//! sticks.
//!
//! # Servo axes
//!
//! [`servo_axis`] has machines of another kind, for diagnoses without a controller: one mass on a guide or on a flexure, motor and load
//! on a spring, with encoders that round. Their dry friction sticks: a reversal is found inside a step of the integration.
//!
//! # A run
//!
//! ```
//! use xytable_plant::*;
//! use xytable_plant::lpv_core::Discrete;
//!
//! let machine = MachineParameters::default().check()?;
//! let clock = Discrete::from_rate(20.0)?;
//! let controller = VerifiedController::by_rule(&machine, &ControllerSettings::default(), clock)?;
//! let multisine = MultisineSettings { period: 256, ..MultisineSettings::default() }.check()?;
//! let settings = ExperimentSettings { periods: 3, ..ExperimentSettings::default() };
//! let experiment = Experiment::new(&machine, &controller, &multisine, 0.3, settings)?;
//! let mut blocks = 0;
//! let account = experiment.run(&mut |block| -> Result<(), xytable_plant::PlantError> {
//!     blocks += 1;
//!     assert_eq!(block.outputs[0].len(), 256);
//!     Ok(())
//! })?;
//! assert_eq!((blocks, account.samples), (6, 1536));
//! # Ok::<(), xytable_plant::PlantError>(())
//! ```

mod continuous_loop;
mod controller;
mod crest;
mod digital_loop;
mod effects;
mod error;
mod experiment;
mod filter;
mod lines;
mod mechanics;
mod model;
mod moves;
mod moving;
mod multisine;
mod noise;
mod parameters;
mod plant;
mod profile;
mod robustness;
mod separation;
pub mod servo_axis;

pub use controller::{ControllerSettings, DigitalController, Discretisation, design_controller, discretise};
pub use crest::CrestStop;
pub use effects::{EffectInfo, HiddenEffect, Since, second_signal};
pub use error::PlantError;
pub use experiment::{Experiment, ExperimentAccount, ExperimentSettings, LoopKind};
pub use lines::Lines;
pub use lpv_core;
pub use moves::{MoveKind, MoveSettings};
pub use moving::{IntegrationAccount, MovingExperiment, MovingRun, MovingSample, MovingSettings, Setpoints};
pub use multisine::{Multisine, MultisineSettings};
pub use noise::{Noise, split_seed};
pub use parameters::{Machine, MachineParameters};
pub use profile::{MoveLimits, Profile, ProfilePoint, Setpoint};
pub use robustness::{Robustness, VerificationSettings, VerifiedController};
