//! What the outcomes on servo axes amount to.

use super::{CATALOGUE, OF_THE_AXIS, Outcome};
use lpv::diagnose::{Diagnosis, EQUAL_DB, FoundEffect};
use serde::Serialize;

/// A part with its count.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Share {
    pub(super) hits: usize,
    pub(super) of: usize,
}

impl Share {
    pub(super) fn value(self) -> Option<f64> {
        (self.of > 0).then(|| self.hits as f64 / self.of as f64)
    }
}

/// `metrics.json`.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Metrics {
    /// Effects of the catalogue that are named and nothing else, from 10 times the least visible size on.
    pub(super) named: Share,
    /// Those, and those of which it says beside another name that the hidden effect explains the records as well.
    pub(super) named_or_equal: Share,
    /// The first by severity.
    pub(super) named_by_severity: Vec<(f64, Share)>,
    /// Machines with an effect of the catalogue where something is named that is not there.
    pub(super) wrong_name: Share,
    /// True parameters within three standard deviations, of effects that are named.
    pub(super) parameters: Share,
    /// Clean machines where something is named.
    pub(super) wrong_name_clean: Share,
    /// Clean machines of which it is said that something is left.
    pub(super) left_on_clean: Share,
    /// Parameters of the axis within three standard deviations, on clean machines.
    pub(super) axis_parameters: Share,
    /// Effects outside the catalogue where something is named.
    pub(super) wrong_name_outside: Share,
    /// Diagnoses that ended with an error.
    pub(super) refused: Share,
    /// Median and longest wall clock of a diagnosis, two at a time, s.
    pub(super) seconds: [f64; 2],
}

impl Metrics {
    /// What the quick run must reach.
    pub(super) fn meets_quick_bars(&self) -> bool {
        self.named.hits == self.named.of && self.wrong_name_clean.hits + self.refused.hits == 0
    }
}

/// What was said of a machine.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Said {
    /// What is there, and nothing else; of a clean machine, nothing.
    Right,
    /// Another name, and that the hidden effect explains the records as well.
    Equal(String),
    /// Nothing, where something is.
    Nothing,
    /// These are not there.
    Wrong(Vec<String>),
    /// An error.
    Refused,
}

pub(super) fn is_catalogue(o: &Outcome) -> bool {
    o.hidden.as_deref().is_some_and(|h| CATALOGUE.contains(&h))
}

pub(super) fn is_clean(o: &Outcome) -> bool {
    o.hidden.is_none()
}

pub(super) fn is_outside(o: &Outcome) -> bool {
    !is_clean(o) && !is_catalogue(o)
}

/// The wanted deviation could be made.
pub(super) fn reached(o: &Outcome) -> bool {
    is_clean(o) || (o.deviation > 0.5 * o.wanted && o.deviation < 2.0 * o.wanted)
}

/// Whether a name tells of a hidden effect: the catalogue of the program has more than one form of some forces of position.
fn tells_of(hidden: &str, name: &str) -> bool {
    let other_forms: &[&str] = match hidden {
        // On a flexure such a force is told as what its spring has beside a straight line.
        "gravity" => &["position-force", "cogging", "cable-stiffness", "cubic-stiffness"],
        "position-force" => &["cogging", "cable-stiffness", "cubic-stiffness"],
        "force-step" => &["constant-force"],
        "cogging-two-orders" => &["cogging"],
        "cable-stiffness" => &["position-force"],
        "cubic-stiffness" => &["cable-stiffness", "position-force"],
        _ => &[],
    };
    name == in_catalogue(hidden) && CATALOGUE.contains(&hidden) || other_forms.contains(&name)
}

/// Name of a hidden effect in the catalogue of the program.
fn in_catalogue(hidden: &str) -> &str {
    match hidden {
        "backlash-of-the-load" => "backlash",
        _ => hidden,
    }
}

/// Whether an effect that the catalogue has at a motor and at a sensor was found where it was hidden.
fn is_there(hidden: &str, found: &FoundEffect) -> bool {
    let kind = match hidden {
        "backlash" => "output",
        "backlash-of-the-load" => "motor",
        _ => return true,
    };
    found.place.as_ref().is_none_or(|p| p.kind == kind)
}

/// Whether a name tells of the machine and not of what was hidden: readings are rounded on every machine, a load on a spring is a mode
/// that a rigid axis lacks, and a flexure that was not taken for the base is a force of position.
fn is_of_the_machine(o: &Outcome, d: &Diagnosis, e: &FoundEffect) -> bool {
    let is_held = d.base_parameters.keys().any(|k| k.contains("stiffness"));
    match e.effect.as_str() {
        "quantization" => true,
        "extra-mode" => o.machine.starts_with("motor and load"),
        "cable-stiffness" | "position-force" => o.machine.starts_with("flexure") && !is_held,
        _ => false,
    }
}

/// Effects that are named, those of the machine left out, with whether each is the hidden one.
fn named<'a>(o: &'a Outcome, d: &'a Diagnosis) -> Vec<(&'a FoundEffect, bool)> {
    let hidden = o.hidden.as_deref().unwrap_or("");
    let here = |e: &FoundEffect| o.axes == 1 || e.place.as_ref().is_none_or(|p| p.index == o.axis);
    let all = d
        .effects
        .iter()
        .map(|e| (e, tells_of(hidden, &e.effect) && is_there(hidden, e) && here(e)));
    all.filter(|(e, right)| *right || !is_of_the_machine(o, d, e))
        .collect()
}

pub(super) fn said(o: &Outcome) -> Said {
    let Ok(d) = &o.diagnosis else { return Said::Refused };
    let all = named(o, d);
    let wrong: Vec<String> = all
        .iter()
        .filter(|(_, right)| !right)
        .map(|(e, _)| e.effect.clone())
        .collect();
    let is_of_the_axis = o.hidden.as_deref().is_none_or(|h| OF_THE_AXIS.contains(&h));
    let is_equal = |e: &FoundEffect| {
        let hidden = o.hidden.as_deref().unwrap_or("");
        let other = e.evidence.runner_up.as_deref();
        other.is_some_and(|r| tells_of(hidden, r))
            && e.evidence.runner_up_margin_db.is_some_and(|m| m < EQUAL_DB)
    };
    if let [(only, false)] = all[..]
        && is_equal(only)
    {
        Said::Equal(only.effect.clone())
    } else if !wrong.is_empty() {
        Said::Wrong(wrong)
    } else if !all.is_empty() || (is_of_the_axis && has_nothing_left(d)) || is_clean(o) {
        Said::Right
    } else {
        Said::Nothing
    }
}

fn has_nothing_left(d: &Diagnosis) -> bool {
    ["nothing-missing", "explained"].contains(&d.verdict.as_str())
}

/// True values of a named effect with those found and their deviations.
fn parameters(o: &Outcome) -> Vec<(String, f64, f64, f64)> {
    let Ok(d) = &o.diagnosis else { return Vec::new() };
    let hidden = o.hidden.as_deref().unwrap_or("");
    let mut all = Vec::new();
    for (e, right) in named(o, d) {
        if !right || e.effect != in_catalogue(hidden) {
            continue;
        }
        for (name, v) in &e.parameters {
            let truth = o.facts.iter().find(|(n, _)| n == name);
            if let (Some((_, truth)), Some(std)) = (truth, v.std) {
                all.push((name.clone(), *truth, v.value, std));
            }
        }
    }
    if is_clean(o) || OF_THE_AXIS.contains(&hidden) {
        all.extend(axis_parameters(o, d));
    }
    all
}

fn axis_parameters(o: &Outcome, d: &Diagnosis) -> Vec<(String, f64, f64, f64)> {
    let mut all = Vec::new();
    for (i, base) in o.base.iter().enumerate() {
        for (name, truth) in base {
            let key = match o.axes {
                1 => name.clone(),
                _ => format!("axis {} {name}", i + 1),
            };
            if let Some(v) = d.base_parameters.get(&key)
                && let Some(std) = v.std
            {
                all.push((key, *truth, v.value, std));
            }
        }
    }
    all
}

fn is_within((_, truth, value, std): &(String, f64, f64, f64)) -> bool {
    (truth - value).abs() <= 3.0 * std
}

pub(super) fn share<'a>(all: impl Iterator<Item = &'a Outcome>, is: impl Fn(&Outcome) -> bool) -> Share {
    let mut share = Share { hits: 0, of: 0 };
    for o in all {
        share.of += 1;
        share.hits += usize::from(is(o));
    }
    share
}

pub(super) fn within<'a>(all: impl Iterator<Item = &'a Outcome>) -> Share {
    let values: Vec<_> = all.flat_map(parameters).collect();
    Share {
        hits: values.iter().filter(|p| is_within(p)).count(),
        of: values.len(),
    }
}

pub(super) fn score(all: &[Outcome]) -> Metrics {
    let in_catalogue = || all.iter().filter(|o| is_catalogue(o) && reached(o));
    let clean = || all.iter().filter(|o| is_clean(o));
    let is_wrong = |o: &Outcome| matches!(said(o), Said::Wrong(_));
    let is_right = |o: &Outcome| said(o) == Said::Right;
    let by_severity = |s: f64| (s, share(in_catalogue().filter(|o| o.wanted == s), is_right));
    let mut seconds: Vec<f64> = all.iter().map(|o| o.seconds).collect();
    seconds.sort_by(f64::total_cmp);
    Metrics {
        named: share(in_catalogue(), is_right),
        named_or_equal: share(in_catalogue(), |o| {
            matches!(said(o), Said::Right | Said::Equal(_))
        }),
        named_by_severity: super::SEVERITIES.map(by_severity).to_vec(),
        wrong_name: share(in_catalogue(), is_wrong),
        parameters: within(in_catalogue().filter(|o| is_right(o))),
        wrong_name_clean: share(clean(), is_wrong),
        left_on_clean: share(clean(), |o| {
            o.diagnosis.as_ref().is_ok_and(|d| !has_nothing_left(d))
        }),
        axis_parameters: within(clean()),
        wrong_name_outside: share(all.iter().filter(|o| is_outside(o) && reached(o)), is_wrong),
        refused: share(all.iter(), |o| o.diagnosis.is_err()),
        seconds: [
            seconds.get(seconds.len() / 2).copied().unwrap_or(0.0),
            seconds.last().copied().unwrap_or(0.0),
        ],
    }
}

/// One outcome in a line.
pub(super) fn line(o: &Outcome) -> String {
    let mark = match said(o) {
        Said::Right => "ok   ",
        Said::Nothing if is_outside(o) => "ok   ",
        Said::Equal(_) => "equal",
        Said::Nothing => "miss ",
        Said::Wrong(_) => "WRONG",
        Said::Refused => "ERROR",
    };
    let found = match &o.diagnosis {
        Err(error) => error.clone(),
        Ok(d) => {
            let names: Vec<&str> = d.effects.iter().map(|e| e.effect.as_str()).collect();
            let ratio = |e: &lpv::diagnose::Errors| -> String {
                let all = e.validation.values().map(|v| format!("{:.2}", v.over_noise));
                all.collect::<Vec<_>>().join("/")
            };
            let off: Vec<String> = parameters(o)
                .iter()
                .filter(|p| !is_within(p))
                .map(|(name, truth, value, std)| {
                    format!(
                        "{name} {value:.3e} of {truth:.3e} by {:.1}",
                        (value - truth) / std
                    )
                })
                .collect();
            format!(
                "{} [{}] {} -> {} {}",
                d.verdict,
                names.join(" + "),
                ratio(&d.before),
                ratio(&d.after),
                off.join(", ")
            )
        }
    };
    format!(
        "{mark} {} {:.0} ({:.1}) {}: {found} ({:.1} s, seed {})",
        o.hidden.as_deref().unwrap_or("clean"),
        o.wanted,
        o.deviation,
        o.machine,
        o.seconds,
        o.seed
    )
}
