//! Poles in, basis out.
//!
//! # The problem
//!
//! A stable, strictly proper response with poles inside the unit circle is expanded in orthonormal functions
//! `F(z) ~ sum_i w_i phi_i(z)`, `<phi_i, phi_j> = delta_ij` in `H_2`. The functions come from poles `l_1 .. l_n` by
//! the Takenaka-Malmquist construction ([`OrthonormalBasis`]). For a set of systems whose poles z are known, the worst
//! rate at which the expansion in repetitions of the basis converges is the *n-width cost*
//!
//! ```text
//! max_z prod_j kappa(z, l_j),   kappa(z, l) = |z - l| / |1 - z conj(l)|
//! ```
//!
//! ([`kolmogorov_cost_db`]; Oliveira e Silva 1996, Toth, Heuberger, Van den Hof 2009). Good basis poles make it small:
//!
//! - [`fkcm`] clusters the observed poles with fuzzy memberships (Fuzzy-Kolmogorov c-Max, exponent m): the cost
//!   `max_k sum_i mu_ik^m d(z_k, v_i)`, scaled by `n_c^(m-1)`, tends to the geometric mean of the distances, and so to
//!   the n-width cost, as m grows ([`log_fuzzy_cost`]);
//! - [`polish_minimax`] descends the n-width cost itself;
//! - [`choose_functions`] chooses how many functions a target cost needs.
//!
//! A real basis has its poles in conjugate pairs. The distance of an observed pole to a pair is the *product*
//! `d(z, v) = kappa(z, v) kappa(z, conj v)`, because then the sum of logarithms over pairs is exactly the n-width cost;
//! the geometric mean of the two would halve every contrast. Away from the real axis the second factor is nearly one.
//! In the centre step it is taken at the last centre, so that `{v : d <= r}` stays a disc.
//!
//! # Glossary
//!
//! - *Kolmogorov n-width*: how well the best n-dimensional space approximates the worst member of a set.
//! - *Inner function*: the all-pass `G_b(z) = prod_j (1 - conj(l_j) z) / (z - l_j)`; a Hambo basis repeats it.
//! - *Kappa, pseudo-hyperbolic distance*: the metric of the unit disc in which Moebius maps are motions.
//! - *Membership* `mu_ik`: the share of centre i in observed pole k.
//! - *Leja sequence*: poles taken one after the other where the product of distances so far is largest.
//!
//! # What is not here
//!
//! No time series, no files, no frequency responses: estimating poles and expanding responses are other tasks, and a
//! basis does not depend on them. No poles on the unit circle: integrators have no place in `H_2`; treat them apart
//! and leave them out of the observed poles. No interpolation between observed poles: a cost on 21 observed positions
//! says little about the poles between them once the basis has a third as many poles as the list (with 16 functions
//! 1.4 dB on the machine of the tests), so give a dense list where the poles are known between positions. No choice
//! between real poles and pairs: their numbers are settings.
//!
//! # Example
//!
//! ```
//! use obf_basis::lpv_core::Discrete;
//! use obf_basis::lpv_core::num_complex::Complex;
//! use obf_basis::{FkcmSettings, OrthonormalBasis, PoleSet, fkcm};
//!
//! // A lightly damped mode whose frequency moves.
//! let observed: Vec<_> = (0..21).map(|k| Complex::from_polar(0.99, 0.46 + 0.003 * f64::from(k))).collect();
//! let observed = PoleSet::from_upper_half(&observed)?;
//! let found = fkcm(&observed, &FkcmSettings::new(6))?;
//! assert!(found.cost_db < -10.0);
//! let basis = OrthonormalBasis::takenaka_malmquist(&found.poles, Discrete::from_rate(20.0)?)?;
//! assert_eq!(basis.functions(), 6);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod basis;
mod choose;
mod cost;
mod disc;
mod error;
mod fkcm;
mod memberships;
mod minimax;
mod poles;
mod starts;

pub use basis::OrthonormalBasis;
pub use choose::{Choice, SizeCost, Verdict, choose_functions};
pub use cost::{kolmogorov_cost_db, log_fuzzy_cost};
pub use disc::pseudo_hyperbolic_distance;
pub use error::BasisError;
pub use fkcm::{FkcmResult, FkcmSettings, Refinement, StartAccount, fkcm};
pub use lpv_core;
pub use minimax::{MinimaxResult, MinimaxSettings, Stop, polish_minimax};
pub use poles::{MAX_FUNCTIONS, PoleSet, PoleUnit};
