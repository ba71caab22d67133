//! What a result is worth, before any figure: the first line of every command.

mod judge;
#[cfg(test)]
mod tests;
mod words;

use crate::PipelineError;
use crate::finding::{self, Finding};
use crate::poles::Undetermined;
use crate::small::BetweenPositions;
pub(crate) use judge::judged_run;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
pub(crate) use words::{number, percent, times};

/// A judgement of a model, with the facts behind it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Verdict {
    /// The judgement.
    #[serde(flatten)]
    pub worth: Worth,
    /// The first line: the judgement, the figures that decide, and what to do.
    pub sentence: String,
    /// Whether the records that decide were held out, or the model was fitted to them.
    pub basis: Basis,
    /// What speaks against the model, the gravest first; empty for a good one.
    pub causes: Vec<Cause>,
}

/// Expected error between the positions, percent of the response, up to which a model is good there.
const BETWEEN_PERCENT: f64 = 10.0;

/// What a model may be used for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "worth", rename_all = "kebab-case", rename_all_fields = "snake_case")]
pub enum Worth {
    /// Its errors are noise, or too small to matter.
    Good,
    /// Good up to a frequency.
    GoodUpTo {
        /// That frequency, Hz.
        frequency_hz: f64,
    },
    /// Good while the scheduling variable rests, not when it moves.
    GoodAtRest,
    /// It explains most of the response, and errs by more than the noise.
    Approximate,
    /// There is nothing to judge it by.
    Unjudged,
    /// The data contradict themselves: whatever fits them is wrong somewhere.
    ContradictoryData,
    /// It explains less than half of what the machine does, or is unstable where the machine is not.
    NotAModel,
}

impl Worth {
    /// Whether the result may be used as the commands of this program use it; where not, they end with exit code 3.
    pub fn is_usable(self) -> bool {
        !matches!(self, Self::NotAModel | Self::ContradictoryData)
    }
    /// Whether the model is good for everything that was judged, or for a part of it that is named.
    pub fn is_good(self) -> bool {
        matches!(self, Self::Good | Self::GoodUpTo { .. } | Self::GoodAtRest)
    }
}

/// What the judged records are to the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Basis {
    /// It was not fitted to them.
    HeldOut,
    /// It was fitted to them, and they flatter it.
    Fitted,
    /// None were judged.
    Nothing,
}

/// What speaks against a model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "cause", rename_all = "kebab-case", rename_all_fields = "snake_case")]
#[non_exhaustive]
pub enum Cause {
    /// The frozen response errs over the whole band.
    Response {
        /// Error relative to the response, percent, in the median over half octaves.
        error_percent: f64,
        /// Noise of the response, percent, in the median over half octaves.
        noise_percent: f64,
        /// The error in multiples of the noise, root mean square; none where the noise is assumed, from the scatter over neighbouring
        /// lines.
        over_noise: Option<f64>,
    },
    /// The frozen response errs most in one band.
    Band {
        /// Lower and upper end, Hz.
        band_hz: [f64; 2],
        /// Error relative to the response there, percent.
        error_percent: f64,
        /// The same in multiples of its noise; none where that is assumed.
        over_noise: Option<f64>,
        /// Where the band lies, which tells what is missing.
        place: BandPlace,
    },
    /// The positions are too far from each other to tell what is between them.
    Between {
        /// Two neighbours, where most is to be expected.
        positions: [f64; 2],
        /// Expected error midway, percent of the response.
        error_percent: f64,
        /// The same in multiples of the noise at the positions.
        over_noise: f64,
    },
    /// Another model explains the lines of one position as well, and acts otherwise beyond them.
    Undetermined {
        /// What they leave open.
        #[serde(flatten)]
        what: Undetermined,
    },
    /// The measured response is mostly noise, so that a wrong model would not show.
    NoisyResponse {
        /// Noise of the response, percent, in the median over half octaves.
        noise_percent: f64,
    },
    /// The model misses an output along a record.
    Record {
        /// The record.
        record: String,
        /// The output.
        output: String,
        /// What was compared.
        run: Run,
        /// Error relative to the motion of the output, percent.
        error_percent: f64,
        /// The same in multiples of the noise, where that is known.
        over_noise: Option<f64>,
        /// Whether the scheduling variable moves.
        moves: bool,
    },
    /// The model leaves in the residual what the inputs or the past of the output explain.
    Residual {
        /// The record.
        record: String,
        /// The output.
        output: String,
        /// Part of the residual's power that the inputs explain, percent.
        by_inputs_percent: f64,
        /// Part that its own past explains, percent.
        predictable_percent: f64,
    },
    /// The inverse dynamics of an axis miss the force.
    Force {
        /// The record.
        record: String,
        /// The input of the axis.
        input: String,
        /// Error relative to the force, percent.
        error_percent: f64,
    },
    /// A pole outside the unit circle, of a model that was judged by its prediction alone, as a machine under feedback may have it. The sentence has
    /// it whatever the worth.
    UnstableAlone {
        /// Largest magnitude of a pole.
        radius: f64,
    },
    /// A pole outside the unit circle, of a machine whose outputs stay bounded, which no feedback accounts for.
    Unstable {
        /// Largest magnitude of a pole.
        radius: f64,
    },
    /// A pole outside the unit circle, of a model of responses that were measured in open loop.
    UnstableResponse {
        /// Largest magnitude of a pole.
        radius: f64,
    },
    /// A judgement that could not be made.
    NotJudged {
        /// Why.
        why: String,
    },
    /// The data contradict themselves.
    Data {
        /// What contradicts what, where, and the remedy.
        what: String,
    },
}

/// Where a band lies among the measured ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BandPlace {
    /// At the lowest frequencies: what a rigid body, friction or a spring would explain.
    Low,
    /// In between: a mode, usually.
    Middle,
    /// At the highest.
    High,
}

/// What an error in time is the error of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Run {
    /// Simulation with the controller.
    ClosedLoop,
    /// Simulation from the recorded inputs.
    OpenLoop,
    /// One-step prediction.
    OneStep,
}

/// How a model answers a bounded input in open loop over the length of the records.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Stability {
    /// With a bounded output.
    Stable,
    /// It drifts: integrators, or poles slower than the records.
    Integrating,
    /// Its output grows without bound.
    Unstable {
        /// Largest magnitude of a pole.
        radius: f64,
    },
}

impl Stability {
    /// Whether outputs that were measured may stay bounded all the same: feedback holds a machine that grows slowly. A loop amplifies some
    /// disturbance at least as much as the machine grows in a sample (the maximum principle at the pole), and
    /// none is made for much of that.
    pub(crate) fn may_stay_bounded(self, closed_loop: bool) -> bool {
        const MOST_HELD: f64 = 1.5;
        match self {
            Self::Unstable { radius } => closed_loop && radius < MOST_HELD,
            Self::Stable | Self::Integrating => true,
        }
    }
}

impl Verdict {
    /// A verdict with its sentence.
    pub(crate) fn new(worth: Worth, basis: Basis, facts: &[Cause], causes: Vec<Cause>) -> Self {
        Self {
            sentence: words::sentence(worth, basis, facts, &causes),
            worth,
            basis,
            causes,
        }
    }

    /// Of a model that could not be compared with any record.
    pub(crate) fn unjudged(error: &PipelineError) -> Self {
        Self::not_judged(&error.to_string())
    }

    /// Of a model that no record can judge, and why.
    pub(crate) fn not_judged(why: &str) -> Self {
        let causes = vec![Cause::NotJudged { why: why.to_owned() }];
        Self::new(Worth::Unjudged, Basis::Nothing, &[], causes)
    }

    /// The same of an unstable model that no record along time has judged: what is measured in open loop is stable, or drifts.
    pub(crate) fn unstable(mut self, radius: f64) -> Self {
        if !self.worth.is_good() {
            return self;
        }
        self.causes.insert(0, Cause::UnstableResponse { radius });
        Self::new(Worth::Approximate, self.basis, &[], self.causes)
    }

    /// The same in view of what is to be expected between the positions: a model that was not judged there is no better than that.
    pub(crate) fn with_expected(mut self, between: Option<&BetweenPositions>) -> Self {
        let Some(between) = between.filter(|b| b.is_missed() && b.error_percent > BETWEEN_PERCENT) else {
            return self;
        };
        if !self.worth.is_good() || self.basis == Basis::HeldOut {
            return self;
        }
        self.causes.insert(
            0,
            Cause::Between {
                positions: between.positions,
                error_percent: between.error_percent,
                over_noise: between.over_noise,
            },
        );
        Self::new(Worth::Approximate, self.basis, &[], self.causes)
    }

    /// The same in view of what the lines of one position leave open: a model that was judged on them alone is no better than that.
    pub(crate) fn with_open(mut self, undetermined: Option<&Undetermined>) -> Self {
        let Some(undetermined) = undetermined.filter(|u| u.matters()) else {
            return self;
        };
        if !self.worth.is_good() || self.basis == Basis::HeldOut {
            return self;
        }
        let what = undetermined.clone();
        self.causes.insert(0, Cause::Undetermined { what });
        Self::new(Worth::Approximate, self.basis, &[], self.causes)
    }

    /// The same in view of what was found in the data: contradictions take its worth away, and what explains an error is named
    /// beside it.
    pub(crate) fn in_view_of(self, findings: &[Finding]) -> Self {
        self.contradicted(finding::contradictions(findings))
            .explained(finding::explanations(findings))
    }

    /// The same with what explains its errors, in words; unchanged for a good model.
    fn explained(mut self, explanations: Vec<String>) -> Self {
        let errs = matches!(self.worth, Worth::NotAModel | Worth::Approximate);
        if explanations.is_empty() || !errs || self.causes.is_empty() {
            return self;
        }
        let rest = self.causes.split_off(1);
        let named = explanations.into_iter().map(|what| Cause::Data { what });
        self.causes.extend(named.chain(rest));
        Self::new(self.worth, self.basis, &[], self.causes)
    }

    /// The same in view of data that contradict themselves, told in words; unchanged without.
    fn contradicted(self, contradictions: impl IntoIterator<Item = String>) -> Self {
        // Of fewer records the same may be said with another remedy, and of more with more places.
        let fact = |what: &str| what.split(';').next().unwrap_or_default().to_owned();
        let known: Vec<String> = self
            .causes
            .iter()
            .filter_map(|cause| match cause {
                Cause::Data { what } => Some(fact(what)),
                _ => None,
            })
            .collect();
        let mut causes: Vec<Cause> = contradictions
            .into_iter()
            .filter(|what| !known.contains(&fact(what)))
            .map(|what| Cause::Data { what })
            .collect();
        if causes.is_empty() {
            return self;
        }
        causes.extend(self.causes);
        Self::new(Worth::ContradictoryData, self.basis, &[], causes)
    }
}
