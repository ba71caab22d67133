//! What a competition gives back.

use crate::base::Pair;
use crate::effect::Effect;
use crate::fit::Explained;
use crate::left::Left;

/// What came out.
#[derive(Debug, Clone)]
pub struct Trace {
    /// Verdict.
    pub verdict: Verdict,
    /// Of an axis whose load turned out not to be rigid: the rigid axis, refitted, without effects.
    pub rigid: Option<Judged>,
    /// The machine, refitted, without effects.
    pub before: Judged,
    /// With the effects that were added.
    pub after: Judged,
    /// The machine, refitted, without effects.
    pub bare: Explained,
    /// The model.
    pub model: Explained,
    /// Standard deviations of the machine's parameters in it, infinite where they are held.
    pub deviations: Vec<f64>,
    /// The effects that were added, in their order.
    pub added: Vec<Added>,
    /// Every effect that was tried, look by look, in each the most promising first.
    pub candidates: Vec<Tried>,
    /// Deviation of the closed-loop output noise of the model.
    pub noise: Pair,
    /// Root mean square by output of the error one step ahead on the judged records ([`prediction_errors`](crate::prediction_errors)):
    /// without effects, and with those that were added; none where the machine cannot be followed.
    pub one_step: [Option<Pair>; 2],
    /// Errors in closed loop on the judged records, by record and sample: without effects, and with those that were added.
    pub errors: [Vec<Vec<Pair>>; 2],
    /// What the white errors on the judged records still show: without effects, and with those that were added; the surest first.
    pub left: [Vec<Left>; 2],
}

/// Verdicts of `diagnosis.json`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// What remains is noise.
    Explained,
    /// The error fell, more remains.
    PartlyExplained,
    /// No effect of the catalogue explains what is there.
    Unexplained,
    /// The base model explains the data.
    NothingMissing,
}

impl Verdict {
    /// The name in `diagnosis.json`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Explained => "explained",
            Self::PartlyExplained => "partly-explained",
            Self::Unexplained => "unexplained",
            Self::NothingMissing => "nothing-missing",
        }
    }
}

/// Errors on the judged records.
#[derive(Debug, Clone, PartialEq)]
pub struct Judged {
    /// Root mean square by output, simulated in closed loop.
    pub closed_loop: Pair,
    /// The same of the white error, in units of the noise.
    pub white: Pair,
    /// Sum of squares of the whitened error over its expectation.
    pub cost: f64,
    /// Whitened samples.
    pub samples: usize,
}

/// An effect that was added.
#[derive(Debug, Clone)]
pub struct Added {
    /// The effect.
    pub effect: &'static Effect,
    /// Values and standard deviations of its parameters.
    pub values: Vec<(f64, f64)>,
    /// Fall of the squared error on the judged records when it was added.
    pub gain_db: f64,
    /// Probability of such a fall on the fitted records without the effect.
    pub p_value: f64,
    /// The model when it was added.
    pub then: Explained,
    /// The next best effect, and by how much it is worse on the judged records.
    pub runner_up: Option<(&'static Effect, f64)>,
}

/// How one effect did in one look at the catalogue.
#[derive(Debug, Clone)]
pub struct Tried {
    /// The effect.
    pub effect: &'static Effect,
    /// Those that were there already.
    pub beside: Vec<&'static Effect>,
    /// Fall of the squared error on the judged records, no less than -300.
    pub gain_db: f64,
    /// Whether it was fitted in full, with the machine; else the gain is that of one linear step.
    pub fitted: bool,
    /// Whether it was added.
    pub accepted: bool,
}
