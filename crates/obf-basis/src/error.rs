//! What can be wrong with poles, settings or observations.

use lpv_core::CoreError;

/// Every refusal of this crate. The fields carry the facts; the text says what to do about them.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BasisError {
    /// No pole where at least one is needed.
    #[error("{what}: there is no pole; give at least one")]
    Empty {
        /// The list that is empty.
        what: &'static str,
    },
    /// A pole with a NaN or infinite part.
    #[error("{what}, pole {index}: {re} + {im}j is not a finite number; remove or repair it")]
    NotFinite {
        /// The list.
        what: &'static str,
        /// Index in the list, from 0.
        index: usize,
        /// Real part given.
        re: f64,
        /// Imaginary part given.
        im: f64,
    },
    /// A pole on or outside the unit circle.
    #[error(
        "{what}, pole {index}: |z| = {radius:.6} is not inside the unit circle; leave integrators and unstable poles out"
    )]
    NotInside {
        /// The list.
        what: &'static str,
        /// Index in the list, from 0.
        index: usize,
        /// Modulus of the pole.
        radius: f64,
    },
    /// A complex pole without its conjugate.
    #[error(
        "pole {index}: {re} + {im}j has no conjugate in the list; give both, or use `PoleSet::from_upper_half`"
    )]
    NoConjugate {
        /// Index in the list, from 0.
        index: usize,
        /// Real part.
        re: f64,
        /// Imaginary part.
        im: f64,
    },
    /// A pole of the lower half plane where only the upper one is meant.
    #[error(
        "pole {index}: imaginary part {im} is negative; give the member of the pair in the upper half plane"
    )]
    LowerHalf {
        /// Index in the list, from 0.
        index: usize,
        /// Imaginary part.
        im: f64,
    },
    /// More basis functions than anyone can mean.
    #[error("{functions} basis functions are outside 1..={limit}; choose fewer poles or repetitions")]
    Functions {
        /// Number asked for.
        functions: usize,
        /// Largest number allowed.
        limit: usize,
    },
    /// A setting outside its range.
    #[error("setting `{name}` = {value} is outside its range {range}")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// Value given.
        value: f64,
        /// Allowed range.
        range: &'static str,
    },
    /// A range of sizes that holds no size.
    #[error(
        "basis sizes {lowest}..={highest} hold none to try; give 1 <= lowest <= highest and a size of the parity of the settings' `functions`"
    )]
    EmptyRange {
        /// Lower end.
        lowest: usize,
        /// Upper end.
        highest: usize,
    },
    /// A model could not be built.
    #[error(transparent)]
    Core(#[from] CoreError),
}
