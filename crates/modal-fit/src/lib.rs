//! FRF with covariance and poles in, minimal modal state space out.
//!
//! # The problem
//!
//! A structure with `n` modes, seen by `n_y` sensors and moved by `n_u` actuators, has one mode shape a mode: its residue is
//! `c b^T`, of rank one. A common denominator does not know that, and its state space has `min(n_y, n_u)` copies of every pole.
//! This crate fits
//!
//! `F(z) = D + Gamma phi(z) + sum_i [C_i B_i^T / (z - l_i) + conj(...)]`
//!
//! to an estimated response, with `C_i` (`n_y x r_i`), `B_i` (`n_u x r_i`) complex and of as small a rank `r_i` as the data allow
//! (one for a mode by itself), and `Gamma` of the rank that the data show: the gain of the rigid body behind the hold, with
//! `phi = (T^2/2) (z + 1) / (z - 1)^2` of two integrators or `T / (z - 1)` of one. What is minimised is the likelihood of the
//! Kronecker covariance of the estimate.
//!
//! # How
//!
//! 1. Residues of the given poles by linear least squares, channel by channel, with the variances as weights.
//! 2. Their ranks: singular values that stand above what noise alone would give.
//! 3. Levenberg-Marquardt on poles and factors together. Entries of `B_i` at `r_i` rows are held, so that no change of
//!    coordinates `C_i T`, `B_i T^-T` is left.
//! 4. Standard deviations of frequencies and dampings from the normal matrix.
//!
//! # What it does not do
//!
//! It finds no poles and no number of modes: pole-fit does. It knows no position. Residues of general damping are complex; that
//! of a mode with proportional damping is not held to one phase.
//!
//! # A run
//!
//! ```
//! use modal_fit::lpv_core::{Discrete, Frf, FrfEstimate, num_complex::Complex};
//! use modal_fit::{ModalSettings, modal_fit};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let clock = Discrete::from_rate(20.0)?;
//! let pole = Complex::new(0.9, 0.16f64.sqrt());
//! let lines: Vec<f64> = (1..200).map(|k| 0.05 * f64::from(k)).collect();
//! // Two outputs, two inputs, one mode: the residue is c b^T.
//! let values = lines.iter().flat_map(|f| {
//!     let z = Complex::from_polar(1.0, std::f64::consts::TAU * f / 20.0);
//!     let mode = (z - 0.9) / ((z - pole) * (z - pole.conj()));
//!     [1.0, -2.0, 0.5, -1.0].map(|gain| mode * gain)
//! });
//! let frf = Frf::new(lines.clone(), 2, 2, values.collect())?;
//! let estimate = FrfEstimate::with_unit_covariance(frf, None)?;
//! let found = modal_fit(&estimate, clock, &[pole * 1.0001], &ModalSettings::default())?;
//! assert_eq!(found.model.states(), 2);
//! assert!((found.modes[0].pole - pole).norm() < 1e-8);
//! # Ok(())
//! # }
//! ```

mod error;
mod fit;
mod model;
mod realise;
mod residues;
mod search;
mod whiten;

pub use error::ModalFitError;
pub use fit::{ModalAccount, ModalFit, ModalMode, ModalSettings, modal_fit};
pub use lpv_core;
