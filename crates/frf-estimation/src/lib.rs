//! Records in, frequency response functions with covariance out.
//!
//! # The problem
//!
//! A plant with `n_u` inputs and `n_y` outputs runs, often in closed loop, at a constant scheduling position. At line `k`,
//! `Y_e(k) = F(k) U_e(k) + V_e(k)` for experiment `e`, and `F(k)` is wanted with the covariance of its error.
//!
//! *Periodic excitation* ([`PeriodicAccumulator`], [`estimate_records`]). Spectra are averaged over periods and
//!
//! `F = (Y R^H)(U R^H)^-1` (Tóth et al., ACC 2011, eq. (15)), or with `U` for `R` (eq. (14)),
//!
//! so that `dF = V G`, `G = R^H (U R^H)^-1`. The scatter `C_e` of `[Y; U]` over periods, pooled over experiments, gives
//! `C_V = [I -F] C [I -F]^H / M`, and `S = G^H G` completes the Kronecker covariance of [`lpv_core::FrfEstimate`].
//! [`confidence_radius`] turns it into a region with a stated probability. From `2 n_u` experiments on, the variance over
//! realisations replaces that over periods; see [`Distortion`].
//!
//! *Any excitation* ([`local_polynomial`], [`local_rational`]). Response and transient are smooth, or have few poles, in a
//! window of neighbouring lines, and are separated there by least squares.
//!
//! *Measured elsewhere* ([`with_variance`], [`with_covariance`], [`variance_of_coherence`], [`with_assumed_error`]). A response with what
//! is known of its error becomes an estimate with the nearest Kronecker covariance.
//!
//! Before any model, [`multiple_coherence`] tells how much of each output the inputs explain at all.
//!
//! # Glossary
//!
//! - *line*: an integer multiple `k` of the inverse record or period length; *spectra* are `(1/N) sum x exp(-j 2 pi k t / N)`.
//! - *instrument*: the signal correlated with `Y` and `U`; free of noise (`R`) it removes the bias of the closed loop.
//! - *realisation*: `n_u` experiments with one draw of random phases.
//! - *detection line*: a line without excitation between excited ones; what appears there is noise or distortion.
//! - *circular complex degrees of freedom*: `sum (M_e - 1)` for `M_e` periods; `2 nu` real ones.
//!
//! # What this crate does not do
//!
//! It never sees a model or a file. It designs no excitation, resamples nothing and smooths no FRF over frequency, since a
//! parametric fit behind it weights by the covariance, which smoothing would falsify. Zero and the Nyquist line are left out:
//! their spectra are real, and the circular statistics do not hold. Excitation that puts each input on lines of its own in
//! one experiment is refused by the periodic estimator (too few experiments); the local methods take it. Errors in
//! the reference are not modelled. Neighbouring lines of a local method are correlated; the covariance is by line.
//!
//! # Example
//!
//! ```
//! use frf_estimation::{Layout, PeriodicAccumulator, PeriodicSettings, SkipRule, confidence_radius};
//! use frf_estimation::lpv_core::PeriodBlock;
//!
//! let settings = PeriodicSettings { skip: SkipRule::Fixed(1), ..PeriodicSettings::default() };
//! let layout = Layout { period: 32, outputs: 1, inputs: 1, references: 0, experiments: 1, sample_rate_hz: 1.0 };
//! let mut accumulator = PeriodicAccumulator::new(layout, &settings, Some(0.2.into()))?;
//! let u: Vec<f64> = (0..32).map(|t| if t == 0 { 1.0 } else { 0.0 }).collect();
//! for period in 0..5 {
//!     // A delay of one sample, with an error that alternates between periods.
//!     let error = if period % 2 == 0 { 1e-3 } else { -1e-3 };
//!     let y: Vec<f64> = (0..32).map(|t| if t == 1 { 1.0 + error } else { 0.0 }).collect();
//!     let (outputs, inputs) = (&[y], std::slice::from_ref(&u));
//!     accumulator.push(&PeriodBlock { experiment: 0, period, outputs, inputs, references: &[] })?;
//! }
//! let result = accumulator.finish()?;
//! assert_eq!(result.excited_lines.len(), 15);
//! assert!((result.estimate.frf().line(0)[(0, 0)].norm() - 1.0).abs() < 1e-12);
//! assert!(confidence_radius(&result.estimate, 0, 0, 0, 0.95) < 2e-3);
//! # Ok::<(), frf_estimation::FrfError>(())
//! ```

mod accumulator;
mod averages;
mod coherence;
mod confidence;
mod detection;
mod error;
mod gain;
mod lanes;
mod lines;
mod local;
mod measured;
mod moments;
#[cfg(target_arch = "x86_64")]
mod pairs;
#[cfg(not(target_arch = "x86_64"))]
#[path = "pairs/absent.rs"]
mod pairs;
mod periodic;
mod realisations;
mod records;
mod selection;
mod settings;
mod spectra;
mod waiting;

pub use accumulator::PeriodicAccumulator;
pub use averages::Layout;
pub use coherence::{Coherence, multiple_coherence};
pub use confidence::{confidence_radius, f_quantile_2};
pub use detection::DetectionLines;
pub use error::FrfError;
pub use local::{
    HalfWidth, LocalEstimate, LocalLines, LocalSettings, Regressor, local_polynomial, local_rational,
};
pub use lpv_core;
pub use measured::{
    Nearest, scatter, variance_of_coherence, with_assumed_error, with_covariance, with_variance,
};
pub use periodic::{Condition, Distortion, NoiseFloor, PeriodicEstimate};
pub use realisations::RealisationDistortion;
pub use records::{Settling, estimate_records};
pub use settings::{CovarianceSource, Instrument, LineSelection, PeriodicSettings, SkipRule};
