//! `diagnosis.json` and its words.

use super::found::FoundEffect;
use super::places::{base_parameters, channel, placed, record_names};
use super::value::Value;
use super::words::{contradicted, in_words, said_of_slower};
use super::{
    AxisErrors, Characterisation, Errors, LeftTest, LeftTests, NoiseSource, OutputError, RecordErrors,
};
use crate::validation::{AxisCheck, ClosedLoopAxis};
use experiment_data::Bundle;
use lpv_diagnose::{Judged, Trace, Track, Verdict, characterise};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// `diagnosis.json`, format 1, or 2 where nobody knows the controller.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Diagnosis {
    /// 1 or 2.
    pub format: u32,
    /// Name of the bundle.
    pub bundle: String,
    /// The model that effects were added to, in words.
    pub base_model: String,
    /// `explained`, `partly-explained`, `unexplained`, `nothing-missing`.
    pub verdict: String,
    /// The first line: what was found, and what is left; before it what makes the records worthless, if anything does.
    pub verdict_in_words: String,
    /// What makes these records worthless: each contradicts another, itself or its description.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub contradictions: Vec<String>,
    /// Of what the errors are: `closed loop`; `observer` where nobody knows the controller; `response`.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub error_of: String,
    /// Bandwidth of the observer, Hz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub observer_hz: Option<f64>,
    /// What was added, in order.
    pub effects: Vec<FoundEffect>,
    /// Deviation of the noise of one sample as it leaves the loop, by output.
    pub noise_floor: BTreeMap<String, f64>,
    /// Errors on the judged records of the base without effects, fitted to the same records.
    pub before: Errors,
    /// The same with them.
    pub after: Errors,
    /// Every effect that was tried.
    pub candidates: Vec<Tested>,
    /// What tests find in the white error of the judged records.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left: Option<LeftTests>,
    /// What the error looks like where it is not explained.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub characterisation: Option<Characterisation>,
    /// Parameters of the base model, refitted with the effects.
    pub base_parameters: BTreeMap<String, Value>,
    /// Of responses, their relative errors effect by effect, without any first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub responses: Vec<ResponseErrors>,
    /// Of a servo axis, the figures of the literature by record, fitted ones first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub axis: Vec<AxisErrors>,
    /// Where nobody knows the controller, force and free run by record, held-out ones first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub records: Vec<RecordErrors>,
    /// Where the noise is from; only in format 2.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<NoiseSource>,
    /// The choices in words.
    pub reasons: Vec<String>,
}

/// Errors of the responses by output: root of the sum of squares over that of the response.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ResponseErrors {
    /// What was added last.
    pub model: String,
    /// Of the response that was fitted.
    pub fitted: BTreeMap<String, f64>,
    /// Of the response that was held out.
    pub held_out: BTreeMap<String, f64>,
}

/// How one effect did in one look at the catalogue.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Tested {
    /// Name in the catalogue.
    pub effect: String,
    /// Channel at which it acts.
    pub channel: String,
    /// Fall of the squared error on the judged records; -300 where the machine leaves all bounds with it.
    pub held_out_gain_db: f64,
    /// Whether it was added.
    pub accepted: bool,
    /// Effects that were there already.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub beside: Vec<String>,
    /// Whether it was fitted in full; else the gain is that of one linear step.
    #[serde(default)]
    pub fitted: bool,
}

impl Diagnosis {
    pub(super) fn new(bundle: &Bundle, found: &Trace, judged: &[Track], reasons: Vec<String>) -> Self {
        let outputs = &bundle.description().channels.output.columns;
        let errors = |judged: &Judged, one_step: Option<[f64; 2]>| Errors {
            validation: outputs
                .iter()
                .enumerate()
                .map(|(i, name)| {
                    let error = OutputError {
                        rms: judged.closed_loop[i],
                        over_noise: judged.closed_loop[i] / found.noise[i],
                        rms_one_step: one_step.map(|e| e[i]),
                    };
                    (name.clone(), error)
                })
                .collect(),
        };
        let tests = |i: usize| -> Vec<LeftTest> {
            let found = found.left[i].iter();
            found.map(|l| LeftTest::new(l, outputs)).collect()
        };
        let (before, after) = (
            errors(&found.before, found.one_step[0]),
            errors(&found.after, found.one_step[1]),
        );
        let effects: Vec<FoundEffect> = found
            .added
            .iter()
            .map(|a| FoundEffect::new(a, found, judged, bundle))
            .collect();
        let noise: Vec<(String, f64)> = outputs.iter().cloned().zip(found.noise).collect();
        Self {
            format: 1,
            bundle: bundle.description().name.clone(),
            base_model: found.model.base.name().to_owned(),
            verdict: found.verdict.name().to_owned(),
            verdict_in_words: in_words(
                found.verdict.name(),
                &effects,
                &record_names(bundle),
                [&before, &after].map(Errors::largest),
            ),
            contradictions: Vec::new(),
            error_of: "closed loop".to_owned(),
            observer_hz: None,
            effects,
            noise_floor: noise.into_iter().collect(),
            before,
            after,
            candidates: found
                .candidates
                .iter()
                .map(|t| Tested {
                    effect: t.effect.name.to_owned(),
                    channel: channel(t.effect, bundle),
                    held_out_gain_db: t.gain_db,
                    accepted: t.accepted,
                    beside: t.beside.iter().map(|e| placed(e, bundle)).collect(),
                    fitted: t.fitted,
                })
                .collect(),
            left: Some(LeftTests {
                before: tests(0),
                after: tests(1),
            }),
            characterisation: match found.verdict {
                Verdict::Unexplained | Verdict::PartlyExplained => {
                    characterise(&found.errors[1], judged, found.noise)
                        .map(|c| Characterisation::new(c, bundle))
                }
                Verdict::Explained | Verdict::NothingMissing => None,
            },
            base_parameters: base_parameters(&found.model.base, &found.deviations, bundle),
            axis: Vec::new(),
            responses: Vec::new(),
            records: Vec::new(),
            noise: None,
            reasons,
        }
    }

    /// The same in format 2, which says more, or in format 1.
    pub(super) fn in_format(mut self, is_second: bool) -> Self {
        if is_second {
            let source = "band".to_owned();
            self.format = 2;
            self.noise = Some(NoiseSource {
                source,
                is_floor: false,
            });
        } else {
            self.effects.iter_mut().for_each(FoundEffect::as_first_format);
        }
        self
    }

    /// The same with more in the first line.
    pub(super) fn and_said(mut self, more: Option<String>) -> Self {
        if let Some(more) = more {
            self.verdict_in_words = format!("{}; {more}", self.verdict_in_words);
        }
        self
    }

    /// The same in view of what a slower observer leaves ([`Look::left`](super::again::Look)), where a faster one leaves noise.
    pub(super) fn in_view_of_slower(self, left: Option<[f64; 2]>, records: &[String]) -> Self {
        let (Some([slow_hz, over_noise]), Some(hz)) = (left, self.observer_hz) else {
            return self;
        };
        let before_and_after = [&self.before, &self.after].map(Errors::largest);
        let hz = [hz, slow_hz];
        let (verdict, words) = said_of_slower(&self.effects, records, before_and_after, hz, over_noise);
        Self {
            verdict: verdict.to_owned(),
            verdict_in_words: words,
            ..self
        }
    }

    /// The same in view of data that contradict themselves, told in words; unchanged without.
    pub(super) fn in_view_of(self, contradictions: Vec<String>) -> Self {
        if contradictions.is_empty() {
            return self;
        }
        let said = contradicted(&contradictions);
        // Without a controller there is nothing that a name could be held against.
        let (words, verdict, effects) = match self.error_of == "observer" {
            true => (said, "unexplained".to_owned(), Vec::new()),
            false => (
                format!("{said}; with them: {}", self.verdict_in_words),
                self.verdict,
                self.effects,
            ),
        };
        Self {
            verdict_in_words: words,
            contradictions,
            verdict,
            effects,
            ..self
        }
    }

    /// In words.
    pub fn text(&self) -> String {
        let mut lines = vec![format!("{}: {}", self.bundle, self.verdict_in_words)];
        let values = |all: &BTreeMap<String, Value>| {
            let each = all.iter().map(|(name, v)| format!("{name} {v}"));
            each.collect::<Vec<_>>().join(", ")
        };
        if !self.base_parameters.is_empty() {
            lines.push(format!(
                "base, {}: {}",
                self.base_model,
                values(&self.base_parameters)
            ));
        }
        for e in &self.effects {
            let rival = e.rival().map_or(String::new(), |(name, margin)| {
                format!(", {margin:.1} dB before {name}")
            });
            lines.push(format!(
                "{} at {}: {:.1} dB on held-out records{rival}; {}",
                e.effect,
                e.channel,
                e.evidence.held_out_gain_db,
                values(&e.parameters)
            ));
        }
        for (name, before) in &self.before.validation {
            let after = &self.after.validation[name];
            lines.push(format!(
                "{name}: {:.3e} before ({:.2} times the noise), {:.3e} after ({:.2})",
                before.rms, before.over_noise, after.rms, after.over_noise
            ));
        }
        lines.extend(self.left.as_ref().map(LeftTests::text));
        if let Some(c) = &self.characterisation {
            let with: Vec<String> = c
                .correlations
                .iter()
                .take(3)
                .map(|(name, r)| format!("{name} {r:.2}"))
                .collect();
            lines.push(format!(
                "what is left is in {} between {:.3} and {:.3} Hz; correlation with {}",
                c.channel,
                c.band_hz[0],
                c.band_hz[1],
                with.join(", ")
            ));
        }
        let percent = |errors: &BTreeMap<String, f64>| {
            let each = errors
                .iter()
                .map(|(name, e)| format!("{name} {:.2} %", 100.0 * e));
            each.collect::<Vec<_>>().join(", ")
        };
        for r in &self.responses {
            lines.push(format!(
                "{}: error of the fitted response {}; of the one held out {}",
                r.model,
                percent(&r.fitted),
                percent(&r.held_out)
            ));
        }
        for a in &self.axis {
            let all = |f: &dyn Fn(&AxisCheck) -> String| {
                let between = a.stages.iter().map(|s| &s.errors);
                let checks = std::iter::once(&a.before).chain(between).chain([&a.after]);
                checks.map(f).collect::<Vec<_>>().join(" -> ")
            };
            let pair = |f: fn(&AxisCheck) -> f64| all(&|c| format!("{:.4}", f(c)));
            let closed = |f: fn(&ClosedLoopAxis) -> f64| {
                all(&|c| format!("{:.5}", c.closed_loop.as_ref().map_or(f64::NAN, f)))
            };
            lines.push(format!(
                "{}, before -> effect by effect: force of the inverse dynamics {} %; in closed loop position {}, velocity {}, force {} %; \
                 position in open loop {} rms",
                a.record,
                pair(|c| c.force_percent),
                closed(|c| c.position_percent),
                closed(|c| c.velocity_percent),
                closed(|c| c.force_percent),
                pair(|c| c.open_loop_position_rms)
            ));
        }
        lines.extend(self.reasons.iter().map(|r| format!("- {r}")));
        lines.join("\n")
    }
}
