//! The identification pipeline: bundle in, model out, every choice explained. The program `lpv` and the reproduction use it.
//!
//! # The problem
//! Records of a machine at several constant positions are to become one model. [`estimate_bundle`] turns the periodic
//! records into frequency responses with covariance, [`identify`] fits the poles, chooses the basis, solves the regression,
//! chooses the interpolation and realises the LFR; [`validation`] measures what the model gets wrong.
//!
//! # Words
//! - *bundle*: a folder with one `experiment.toml` and its record files.
//! - *reasons*: the choices that were made from the data, in words.
//!
//! # What it does not do
//! It solves no problem that a crate below owns; its own are the rules that choose. No step is told whether the data is
//! simulated or measured. It simulates no machine; that is xytable-plant's, which the reproduction calls by itself.
//!
//! # Example
//! ```
//! use lpv_cli::{IdentifyConfig, Identified, identify};
//! use lpv_core::{Discrete, FrfEstimate, StateSpace, nalgebra::dmatrix};
//!
//! let clock = Discrete::new(1.0)?;
//! let lines: Vec<f64> = (1..100).map(|k| 0.005 * f64::from(k)).collect();
//! let machine = StateSpace::new(dmatrix![0.9, -0.3; 0.3, 0.9], dmatrix![1.0; 0.0], dmatrix![0.0, 1.0], dmatrix![0.0], clock)?;
//! let frf = FrfEstimate::with_unit_covariance(machine.frequency_response(&lines)?, None)?;
//! let config = IdentifyConfig { order: Some(2), integrators: Some(0), ..IdentifyConfig::default() };
//! let Identified::Lti(found) = identify(&[frf], clock, &config)? else { unreachable!() };
//! assert!((found.model.poles()?[0].norm() - 0.9_f64.hypot(0.3)).abs() < 1e-9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod basis;
mod config;
pub mod convert;
mod error;
mod identify;
pub mod inspect;
mod model_file;
pub mod new;
mod pipeline;
mod poles;
mod progress;
pub mod report;
mod responses;
mod settings_file;
mod signal;
pub mod simulate;
mod summary;
mod table;
pub mod validation;

pub use basis::{BasisStage, choose_basis};
pub use config::{FitFocus, IdentifyConfig, InterpolationKind, Polish, Structure, Weighting};
pub use error::PipelineError;
pub use identify::{Outcome, Stages, identify_bundle};
pub use model_file::{Identification, ModelFile, relative_folder, write_whole};
pub use pipeline::{Identified, LpvStage, LtiStage, identify, regress_on};
pub use poles::{PoleStage, fit_poles};
pub use progress::{Progress, silent};
pub use responses::{Responses, estimate_bundle, estimate_local, estimate_periodic, load_records};
pub use settings_file::{nearest_name, read_settings};
pub use summary::{AxisSummary, FrequencySummary, HeldOut, LpvSummary, OrderRow, Summary, TimeSummary};
