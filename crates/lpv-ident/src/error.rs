//! What can be wrong with a regression or an interpolation.

use lpv_core::{CoreError, Position};

/// Every refusal of this crate.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IdentError {
    /// There is nothing to fit.
    #[error("no FRF estimates were given; estimate at least one position first")]
    NoEstimates,
    /// An estimate lacks its position.
    #[error("estimate {index} has no position; give the scheduling value at which it was measured")]
    NoPosition {
        /// Index of the estimate, from 0.
        index: usize,
    },
    /// Positions that are not finite, or two alike.
    #[error("position {position} of estimate {index}: {problem}")]
    Position {
        /// Index of the estimate, from 0.
        index: usize,
        /// The value.
        position: Position,
        /// What is wrong.
        problem: &'static str,
    },
    /// Estimates with different channels.
    #[error("estimate {index} is {found_outputs} x {found_inputs}, the first one {outputs} x {inputs}")]
    Channels {
        /// Index of the estimate, from 0.
        index: usize,
        /// Outputs of the first.
        outputs: usize,
        /// Inputs of the first.
        inputs: usize,
        /// Outputs of this one.
        found_outputs: usize,
        /// Inputs of this one.
        found_inputs: usize,
    },
    /// A rigid-body channel that does not exist.
    #[error("rigid-body term {index} names channel ({output}, {input}) of a {outputs} x {inputs} system")]
    RigidChannel {
        /// Index of the term, from 0.
        index: usize,
        /// Output named.
        output: usize,
        /// Input named.
        input: usize,
        /// Outputs there are.
        outputs: usize,
        /// Inputs there are.
        inputs: usize,
    },
    /// Fewer equations than unknowns.
    #[error(
        "position {position}: {lines} lines give {equations} real equations for {unknowns} unknowns; use more lines or fewer basis functions"
    )]
    TooFewLines {
        /// The position.
        position: Position,
        /// Lines used.
        lines: usize,
        /// Real equations.
        equations: usize,
        /// Real unknowns.
        unknowns: usize,
    },
    /// The regressors are linearly dependent.
    #[error(
        "position {position}: the regression is rank deficient (reciprocal condition {reciprocal:.1e}); basis function {function} is a combination of the others on these lines: use fewer functions or more lines"
    )]
    RankDeficient {
        /// The position.
        position: Position,
        /// Ratio of the smallest to the largest singular value of the scaled regressors.
        reciprocal: f64,
        /// The function with the largest weight in the dependent direction, from 1.
        function: usize,
    },
    /// The covariance of a line cannot be used as a weight.
    #[error(
        "position {position}, line {line} ({frequency_hz} Hz): the FRF covariance is not positive definite; leave the line out or weight relatively"
    )]
    Covariance {
        /// The position.
        position: Position,
        /// Index of the line, from 0.
        line: usize,
        /// Its frequency.
        frequency_hz: f64,
    },
    /// A line to whose response nothing can be related.
    #[error(
        "position {position}, line {line} ({frequency_hz} Hz): the response is zero or nearly so, and relative weights would be infinite; leave the line out or weight otherwise"
    )]
    NoResponse {
        /// The position.
        position: Position,
        /// Index of the line, from 0.
        line: usize,
        /// Its frequency.
        frequency_hz: f64,
    },
    /// An interpolation that the number of positions cannot carry.
    #[error("{what} needs at least {needed} positions, there are {found}")]
    TooFewPositions {
        /// The interpolation.
        what: &'static str,
        /// Positions it needs.
        needed: usize,
        /// Positions there are.
        found: usize,
    },
    /// A method of one scheduling signal, for several.
    #[error("{what} is a function of one scheduling signal, and there are {found}; use a polynomial")]
    OneSignal {
        /// The method.
        what: &'static str,
        /// Scheduling signals there are.
        found: usize,
    },
    /// Positions too far from zero for powers of them.
    #[error(
        "the positions are far from zero for their distances: powers of them lose {lost:.0e} of their digits at order {order}; subtract the middle of the range from the scheduling signals"
    )]
    FarFromZero {
        /// Part of the values of the polynomial that is lost.
        lost: f64,
        /// Order of the polynomial.
        order: usize,
    },
    /// A setting outside its range.
    #[error("setting {name} = {value}: {problem}")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is wrong.
        problem: &'static str,
    },
    /// From the models.
    #[error(transparent)]
    Core(#[from] CoreError),
}

impl IdentError {
    pub(crate) fn one_signal(what: &'static str, positions: &[Position]) -> Self {
        Self::OneSignal {
            what,
            found: positions.first().map_or(0, |p| p.len()),
        }
    }
}
