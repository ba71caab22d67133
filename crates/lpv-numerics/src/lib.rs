//! Numerical devices that the identification crates share.
//!
//! | module | device |
//! |---|---|
//! | [`dense`] | triangular factor of a tall matrix that arrives in blocks of rows, complements, singular values; sequential |
//! | [`least_squares`] | the search of Levenberg and Marquardt with its damped step, in the directions that no change of coordinates makes |
//! | [`planes`] | complex numbers of many lines as two planes |
//! | [`poles`] | sampled poles as oscillations with deviations, and as partial fractions on lines |
//! | [`whiten`] | factors that turn the error of a frequency response into independent unit noise |
//! | [`statistics`] | figures of samples, p-values, decibels |
//!
//! # What it does not do
//!
//! It knows no model, holds no threshold that decides what a user gets, and starts no thread. Eigenvalues, Schur forms and Gramians, which the
//! models themselves need, are in [`lpv_core::linalg`].
//!
//! # A run
//!
//! ```
//! use lpv_numerics::dense::triangle_of;
//! use lpv_numerics::nalgebra::{self, dmatrix};
//!
//! // The triangular factor of two blocks of rows that stand on top of each other.
//! let blocks = [dmatrix![3.0, 1.0; 0.0, 2.0], dmatrix![4.0, 5.0]];
//! let r = triangle_of(2, blocks.iter());
//! let products = r.transpose() * &r;
//! assert!((products - dmatrix![25.0, 23.0; 23.0, 30.0]).amax() < 1e-12);
//! ```

pub mod dense;
pub mod least_squares;
pub mod planes;
pub mod poles;
pub mod statistics;
pub mod whiten;

pub use nalgebra;

#[cfg(test)]
mod test_kit;
