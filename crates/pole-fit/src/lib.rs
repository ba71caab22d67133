//! FRF with covariance in, poles with covariance out. This crate never sees a time series or a position.
//!
//! # The problem
//!
//! Given `F(z_k)`, `n_y x n_u`, on lines `z_k = exp(j 2 pi f_k T_s)` with noise of covariance
//! `E[dF_ij conj dF_kl] = C_V[i,k] S[l,j]`, find the real polynomials of
//!
//! `F(z) = z^-d B(z) / ((z-1)^m a(z))`
//!
//! that minimise `sum_k vec(F - B / ((z-1)^m a))^H K_k vec(F - B / ((z-1)^m a))`, with `K_k` the inverse of that
//! covariance: maximum likelihood for circular normal noise (Pintelon, Schoukens, *System Identification: A Frequency
//! Domain Approach*, 2012). All channels share one scalar denominator, so a mode that is absent from a channel costs
//! nothing but a residue of zero.
//!
//! # How
//!
//! 1. Polynomials orthonormal on the lines, by Arnoldi iteration with real coefficients; no powers of `z` anywhere.
//! 2. A start by reweighted total least squares, which has no bias from the noise. Where what it leaves is no noise, starts by
//!    vector fitting from poles spread over the band. Tens of modes are found without a start: a subspace method counts the states
//!    that stand out of the noise, and its poles are a few steps from the best ones.
//! 3. Gauss-Newton on the denominator alone: given `a`, the numerators are a linear problem and are eliminated (variable
//!    projection in Kaufman's form). The matrices are sums of moments; the gradient comes from the residual itself, so
//!    that the end point does not suffer from squared condition numbers.
//! 4. Roots as eigenvalues of the comrade matrix, polished by Newton steps.
//! 5. The covariance of the poles from the normal matrix. Weights from an estimated `C_V` scatter; the factor
//!    `nu^2 / ((nu - n_y)^2 - 1)` for `nu` complex degrees of freedom is included.
//!
//! # Glossary
//!
//! - *order*: degree of `(z-1)^m a(z)`. With `n_u` inputs the state space of the same response may have up to
//!   `n_u` times as many states.
//! - *fixed integrators*: the exact factor `(z-1)^m`. Lines at `z = 1` are then left out.
//! - *floor*: a least relative deviation, so that noise-free data with a covariance of zero can be weighted.
//! - *smoothing*: `C_V` averaged over neighbouring lines. With 28 degrees of freedom the deviation of the poles is 4 %
//!   above that of known weights and smoothing can win no more than that; with 6 it is 26 %, and smoothing over 11
//!   lines leaves about 2 %. It is off by default since `C_V` may change from line to line.
//!
//! # What it does not do
//!
//! - Continuous time: poles are values of `z`. Frequency responses of sampled loops are exact in `z`, and an axis that
//!   ends at Nyquist has no continuous-time limit to respect.
//! - Stability, unless [`PoleFitSettings::keep_stable`] asks for it: poles are not forced inside the unit circle. A pole outside is either a fact or a sign of too high an
//!   order; moving it would hide which. [`Account::unstable_poles`] lists them.
//! - Left and right matrix fractions, and residues of rank one: these serve modal analysis, but the basis that is built
//!   from the poles needs none of it.
//! - Choosing the order silently: [`scan`] gives what a choice needs, and its own choice.
//!
//! # A run
//!
//! ```
//! use pole_fit::lpv_core::{Discrete, Frf, FrfEstimate, num_complex::Complex};
//! use pole_fit::{NumeratorDegree, PoleFitSettings, fit};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let clock = Discrete::from_rate(20.0)?;
//! let lines: Vec<f64> = (1..200).map(|k| 0.05 * f64::from(k)).collect();
//! let response = lines.iter().map(|f| {
//!     let z = Complex::from_polar(1.0, std::f64::consts::TAU * f / 20.0);
//!     (z + 0.9) / (z * z - z * 1.8 + 0.97)
//! });
//! let frf = Frf::new(lines.clone(), 1, 1, response.collect())?;
//! let estimate = FrfEstimate::with_unit_covariance(frf, None)?;
//! let settings = PoleFitSettings { numerator: NumeratorDegree::StrictlyProper, ..PoleFitSettings::new(2) };
//! let result = fit(&estimate, clock, &settings)?;
//! assert!((result.poles[0] - Complex::new(0.9, 0.16f64.sqrt())).norm() < 1e-12);
//! # Ok(())
//! # }
//! ```

mod basis;
mod columns;
mod error;
mod fit;
mod hermitian;
mod model;
mod moments;
mod parallel;
mod realise;
mod relocate;
mod scan;
mod search;
mod settings;
mod subspace;
mod uncertainty;
mod weights;

pub use error::PoleFitError;
pub use fit::{Account, Mode, PoleFit, fit, fit_from};
pub use lpv_core;
pub use scan::{
    PATIENCE, STABLE_DAMPING, STABLE_FREQUENCY, Scan, ScanEntry, scan, scan_counted, scan_to_noise,
};
pub use search::StopReason;
pub use settings::{Integrators, NumeratorDegree, ORDER_LIMIT, PoleFitSettings, Weighting};
