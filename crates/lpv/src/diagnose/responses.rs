//! Diagnosis from frequency responses, of an axis with one input that has no moves.

use super::places::{channel, placed, units};
use super::words::in_words;
use super::{
    Characterisation, Diagnosed, Diagnosis, Errors, Evidence, Explanation, FoundEffect, OutputError,
    ResponseErrors, Tested, Value, figures, saved,
};
use crate::PipelineError;
use crate::progress::Progress;
use crate::responses::periodic_responses;
use experiment_data::Bundle;
use frf_estimation::PeriodicEstimate;
use lpv_core::{FrfEstimate, Purpose};
use lpv_diagnose::{ResponseCase, ResponseStep, characterise_response, noise_of, response, trace_responses};
use std::collections::BTreeMap;

/// Error over the noise up to which nothing is left.
const NOISE: f64 = 1.1;

/// Noise over the size of a response from which nothing can be judged by it.
const MOSTLY: f64 = 0.5;

/// Whether effects are traced on the responses of the bundle: it has one input, no scheduling, and periodic records only.
pub(crate) fn is_traced_on_responses(bundle: &Bundle) -> bool {
    let description = bundle.description();
    let periodic = |r: &experiment_data::RecordEntry| r.is_periodic();
    description.channels.input.len() == 1
        && description.channels.scheduling.is_empty()
        && description.records.iter().all(periodic)
}

pub(super) fn diagnose(bundle: &Bundle, progress: Progress<'_>) -> Result<Diagnosed, PipelineError> {
    let entries = &bundle.description().records;
    let one = |purpose: Purpose| -> Result<Option<PeriodicEstimate>, PipelineError> {
        let wanted = |i: usize| entries[i].purpose == purpose;
        let found = periodic_responses(bundle, wanted, None, progress)?;
        Ok(found.into_iter().next().map(|f| f.estimate))
    };
    let (fitted, judged) = (one(Purpose::Estimation)?, one(Purpose::Validation)?);
    let Some(fitted) = fitted else {
        return Err(PipelineError::NoResponses {
            bundle: bundle.description().name.clone(),
        });
    };
    let mut reasons = Vec::new();
    for (what, e) in [("estimation", Some(&fitted)), ("validation", judged.as_ref())] {
        reasons.extend(e.and_then(|e| distortion(what, e)));
    }
    let [fitted, judged] = match judged {
        Some(judged) => [fitted.estimate, judged.estimate],
        None => {
            reasons.push("no record has use = \"validation\": every third line judges".to_owned());
            let part = |judges: bool| fitted.estimate.select(|k, _| (k % 3 == 1) == judges);
            [part(false), part(true)]
        }
    };
    let [fitted, judged] = [("fitted", fitted), ("held-out", judged)].map(|(what, e)| {
        let (kept, reason) = standing_out(what, e);
        reasons.extend(reason);
        kept
    });
    if noise_of(&judged).iter().any(|n| *n > MOSTLY) {
        return Err(PipelineError::Structure {
            problem: "the held-out response is mostly noise: check `period` and the channels, or record more periods",
        });
    }
    progress("competition of effects", 0, 1);
    let steps = trace_responses(&ResponseCase {
        fitted: &fitted,
        judged: &judged,
    })?;
    progress("competition of effects", 1, 1);
    for step in &steps {
        if let (Some(effect), Some((other, margin))) = (step.effect, step.tied()) {
            reasons.push(format!(
                "{} and {} are not told apart by these records ({margin:+.2} dB for the first): a multisine with lines up to Nyquist would",
                effect.name, other.name
            ));
        }
    }
    let last = &steps[steps.len() - 1];
    let diagnosis = told(bundle, &steps, &judged, reasons);
    // A response does not know the offset.
    let mut deviations = vec![f64::INFINITY; last.model.base.parameters().len()];
    let fitted = last.model.base.parameters().into_iter().map(|p| !p.held);
    let places = fitted.enumerate().filter(|(_, fitted)| *fitted).map(|(i, _)| i);
    for (i, deviation) in places.zip(&last.deviations) {
        deviations[i] = *deviation;
    }
    let mut explanation = Explanation::of_base(&last.model.base, &deviations, bundle);
    explanation.effects.clone_from(&diagnosis.effects);
    Ok(Diagnosed {
        model: saved(&last.model.base, None, &deviations, &[])?,
        explanation,
        force: Vec::new(),
        spectrum: None,
        free_run: None,
        frozen: None,
        errors: figure(bundle, &steps, &judged),
        diagnosis,
        axes: Vec::new(),
    })
}

/// The lines that stand out of their noise, where most do not and some do: the others were hardly excited.
fn standing_out(what: &str, estimate: FrfEstimate) -> (FrfEstimate, Option<String>) {
    /// Noise of a line that stands out, and how many make a response.
    const GOOD: (f64, usize) = (0.3, 20);
    let good = |k: usize| estimate.relative_deviation(k) < GOOD.0;
    let lines = estimate.frf().len();
    let count = (0..lines).filter(|k| good(*k)).count();
    if count < GOOD.1 || !noise_of(&estimate).iter().any(|n| *n > MOSTLY) {
        return (estimate, None);
    }
    let reason =
        format!("of the {what} response, the {count} of {lines} lines count that stand out of their noise");
    (estimate.select(|k, _| good(k)), Some(reason))
}

/// What the lines that were not excited show.
fn distortion(what: &str, estimate: &PeriodicEstimate) -> Option<String> {
    let found = estimate.distortion.as_ref()?.detection.as_ref()?;
    let percent = |levels: &Option<Vec<f64>>| match levels {
        Some(levels) => {
            let each = levels.iter().map(|l| format!("{:.2}", 100.0 * l));
            each.collect::<Vec<_>>().join(" / ")
        }
        None => "not measured".to_owned(),
    };
    Some(format!(
        "nonlinear distortion of the outputs in the {what} record, percent: odd {}, even {}; no linear effect explains it",
        percent(&found.odd_relative),
        percent(&found.even_relative)
    ))
}

fn by_output(bundle: &Bundle, values: &[f64]) -> BTreeMap<String, f64> {
    let names = &bundle.description().channels.output.columns;
    names.iter().cloned().zip(values.iter().copied()).collect()
}

fn told(bundle: &Bundle, steps: &[ResponseStep], judged: &FrfEstimate, reasons: Vec<String>) -> Diagnosis {
    let noise = noise_of(judged);
    let outputs = &bundle.description().channels.output.columns;
    let errors = |step: &ResponseStep| Errors {
        validation: outputs
            .iter()
            .zip(step.judged.iter().zip(&noise))
            .map(|(name, (error, noise))| {
                let error = OutputError {
                    rms: *error,
                    over_noise: error / noise,
                    rms_one_step: None,
                };
                (name.clone(), error)
            })
            .collect(),
    };
    let (first, last) = (&steps[0], &steps[steps.len() - 1]);
    let squares = |s: &ResponseStep| s.judged.iter().map(|e| e * e).sum::<f64>();
    let at_noise = last.judged.iter().zip(&noise).all(|(e, n)| *e <= NOISE * n);
    let verdict = match (steps.len() > 1, at_noise) {
        (false, true) => "nothing-missing",
        (false, false) => "unexplained",
        (true, true) => "explained",
        (true, false) => "partly-explained",
    };
    let machine = last.model.base.fitted().count();
    let mut from = machine;
    let effects = steps
        .windows(2)
        .filter_map(|pair| {
            let effect = pair[1].effect?;
            let at = last.model.effects.iter().find(|(e, _)| e.is(effect))?;
            let stds = &last.deviations[from..from + at.1.len()];
            from += at.1.len();
            let parameters = effect.parameters.iter().zip(at.1.iter().zip(stds));
            Some(FoundEffect {
                effect: effect.name.to_owned(),
                family: effect.family.name().to_owned(),
                channel: channel(effect, bundle),
                signal: None,
                parameters: parameters
                    .map(|(p, (value, std))| {
                        let value = Value::new(*value, *std, units(p.unit, bundle, effect.place.first()));
                        (p.name.to_owned(), value)
                    })
                    .collect(),
                base_parameters_then: pair[1]
                    .model
                    .base
                    .fitted()
                    .map(|p| (p.name.to_owned(), p.value))
                    .collect(),
                evidence: Evidence {
                    held_out_gain_db: 10.0 * (squares(&pair[0]) / squares(&pair[1])).log10(),
                    p_value: pair[1].p_value,
                    runner_up: pair[1].runner_up.map(|(e, _)| e.name.to_owned()),
                    runner_up_channel: pair[1].runner_up.map(|(e, _)| channel(e, bundle)),
                    runner_up_margin_db: pair[1].runner_up.map(|(_, margin)| margin),
                },
                class: Vec::new(),
                caveats: Vec::new(),
                would_tell: None,
                definition: None,
                place: None,
            })
        })
        .collect::<Vec<FoundEffect>>();
    let (before, after) = (errors(first), errors(last));
    let tested = steps.iter().enumerate().flat_map(|(i, step)| {
        let next = steps.get(i + 1).and_then(|s| s.effect);
        let beside: Vec<String> = step
            .model
            .effects
            .iter()
            .map(|(e, _)| placed(e, bundle))
            .collect();
        step.tried.iter().map(move |(effect, gain)| Tested {
            effect: effect.name.to_owned(),
            channel: channel(effect, bundle),
            held_out_gain_db: *gain,
            accepted: next.is_some_and(|n| n.is(effect)),
            beside: beside.clone(),
            fitted: true,
        })
    });
    let base = last.model.base.fitted().zip(&last.deviations);
    Diagnosis {
        format: 1,
        bundle: bundle.description().name.clone(),
        base_model: "rigid axis with viscous friction; rms are errors of the response over its size"
            .to_owned(),
        verdict: verdict.to_owned(),
        verdict_in_words: in_words(verdict, &effects, &[], [&before, &after].map(Errors::largest)),
        contradictions: Vec::new(),
        error_of: "response".to_owned(),
        observer_hz: None,
        effects,
        noise_floor: by_output(bundle, &noise),
        before,
        after,
        candidates: tested.collect(),
        left: None,
        characterisation: match verdict {
            "unexplained" | "partly-explained" => {
                characterise_response(&last.model, judged).map(|c| Characterisation::new(c, bundle))
            }
            _ => None,
        },
        base_parameters: base
            .map(|(p, std)| {
                let value = Value::new(p.value, *std, units(p.unit, bundle, 0));
                (p.name.to_owned(), value)
            })
            .collect(),
        responses: steps
            .iter()
            .map(|s| ResponseErrors {
                model: s
                    .effect
                    .map_or("rigid axis".to_owned(), |e| format!("with {}", e.name)),
                fitted: by_output(bundle, &s.fitted),
                held_out: by_output(bundle, &s.judged),
            })
            .collect(),
        axis: Vec::new(),
        records: Vec::new(),
        noise: None,
        reasons,
    }
}

fn figure(bundle: &Bundle, steps: &[ResponseStep], judged: &FrfEstimate) -> lpv_report::Figure {
    let frf = judged.frf();
    let lines = frf.frequencies_hz();
    let curves: Vec<[Vec<f64>; 3]> = (0..frf.outputs())
        .map(|i| {
            let left = |step: &ResponseStep| {
                let error = |(k, f): (usize, &f64)| {
                    (response(&step.model, *f)[i.min(1)] - frf.line(k)[(i, 0)]).norm()
                };
                lines.iter().enumerate().map(error).collect()
            };
            let measured = frf.channel(i, 0).map(|g| g.norm()).collect();
            [measured, left(&steps[0]), left(&steps[steps.len() - 1])]
        })
        .collect();
    figures::over_frequency(&bundle.description().channels.output.columns, lines, &curves)
}
