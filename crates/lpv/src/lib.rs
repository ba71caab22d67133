//! The commands of the program `lpv` as a library: bundle in, model out, every choice explained. The reproduction uses it too.
//!
//! # The problem
//! Records of a machine are to become one model that a control engineer can use. [`identify_bundle`] takes a bundle and chooses
//! the chain: periodic records at several positions become frequency responses with covariance ([`estimate_bundle`]), poles, a
//! basis, a regression, an interpolation and an LFR ([`identify()`]); one position becomes a pole fit; records without periods a
//! prediction-error fit that starts at the local rational response; servo axes a mass, a viscous friction and an offset each.
//! [`validation`] measures what the model gets wrong, frozen and in time; [`convert`] hands it to other programs; [`report`]
//! shows it. [`mod@diagnose`] finds what a model lacks, [`fleet`] does so for many bundles. [`new`] drafts the description of a bundle, [`inspect`] judges the data before any model.
//!
//! # Words
//! - *bundle*: a folder with one `experiment.toml` and its record files.
//! - *reasons*: the choices that were made from the data, in words.
//! - *over noise*: an error in time as a multiple of the deviation of one sample's noise, which is what does not repeat from
//!   period to period.
//!
//! # What it does not do
//! It solves no problem that a crate below owns; its own are the rules that choose. No step is told whether the data is
//! simulated or measured: only [`simulate`](mod@simulate) knows the simulated machine, and hands over files.
//!
//! # Example
//! ```
//! use lpv::{IdentifyConfig, Identified, Moves, identify, silent};
//! use lpv::lpv_core::{Discrete, FrfEstimate, StateSpace, nalgebra::{self, dmatrix}};
//!
//! let clock = Discrete::new(1.0)?;
//! let lines: Vec<f64> = (1..100).map(|k| 0.005 * f64::from(k)).collect();
//! let machine = StateSpace::new(dmatrix![0.9, -0.3; 0.3, 0.9], dmatrix![1.0; 0.0], dmatrix![0.0, 1.0], dmatrix![0.0], clock)?;
//! let frf = FrfEstimate::with_unit_covariance(machine.frequency_response(&lines)?, None)?;
//! let config = IdentifyConfig { order: Some(2), integrators: Some(0), ..IdentifyConfig::default() };
//! let Identified::Lti(found) = identify(&[frf], clock, &Moves::none("one position"), &config, &silent)? else { unreachable!() };
//! assert!((found.model.poles()?[0].norm() - 0.9_f64.hypot(0.3)).abs() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod account;
mod basis;
mod config;
pub mod convert;
mod deviation;
pub mod diagnose;
pub mod encode;
mod error;
mod finding;
pub mod fleet;
mod identify;
pub mod inspect;
mod model_file;
mod modes;
mod moves;
pub mod new;
pub mod output;
mod period_noise;
mod pipeline;
mod poles;
mod progress;
pub mod report;
mod responses;
mod rigid;
mod settings_file;
mod signal;
pub mod simulate;
mod small;
mod speed;
mod summary;
mod table;
#[cfg(test)]
mod test_kit;
pub mod validation;
pub mod verdict;

/// The crates whose types stand in the interface.
pub use {experiment_data, lpv_core, lpv_simulate};

pub use basis::{BasisStage, choose_basis};
pub use config::{
    Direct, FitFocus, IdentifyConfig, InterpolationKind, LfrKind, Polish, RigidBody, Structure, Weighting,
};
pub use deviation::{ChannelTable, FrozenDeviation};
pub use error::{PipelineError, ResponseProblem};
pub use finding::{Finding, Severity};
pub use identify::{Outcome, Stages, identify_bundle};
pub use model_file::{Identification, ModelFile, relative_folder};
pub use moves::Moves;
pub use output::write_whole;
pub use pipeline::{Identified, LpvStage, LtiStage, identify, regress_on};
pub use poles::{PoleStage, RigidTerms, Undetermined, fit_poles};
pub use progress::{Progress, silent};
pub use responses::{
    Responses, estimate_bundle, estimate_local, estimate_part, load_records, records_by_place,
};
pub use rigid::RigidEvidence;
pub use settings_file::{nearest_name, read_settings};
pub use small::{BetweenPositions, MovingStage, SizeRow, SmallStage, small_lfr};
pub use summary::{
    AxisSummary, FrequencySummary, HeldOut, LpvSummary, OrderRow, SmallSummary, Summary, TimeSummary,
};
