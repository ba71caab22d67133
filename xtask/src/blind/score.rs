//! What the outcomes of the bench amount to.

use super::{CATALOGUE, Outcome};
use lpv::diagnose::{Diagnosis, Errors};
use serde::Serialize;

/// `metrics.json`, in the order of the bars. None where no case belongs to a key.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Metrics {
    /// Part of the effects of the catalogue that are named, from 10 times the noise on.
    pub(crate) named: Option<f64>,
    /// Part whose family is named.
    pub(crate) family: Option<f64>,
    /// Part that is named at 3 times the noise.
    pub(crate) named_at_3: Option<f64>,
    /// Of the explained ones, those within their bar after.
    pub(crate) after_over_noise_share: Option<f64>,
    /// Part of the true parameters within three standard deviations.
    pub(crate) parameter_coverage: Option<f64>,
    /// Part of the clean machines where anything is said.
    pub(crate) false_alarm: Option<f64>,
    /// Part of the pairs of which both are named and nothing else.
    pub(crate) pairs_named: Option<f64>,
    /// Part of the machines with an effect outside the catalogue where an effect is named.
    pub(crate) outside_wrong_name: Option<f64>,
    /// Wall clock of one diagnosis alone, the longest of one of each kind.
    pub(crate) seconds: Option<f64>,
}

impl Metrics {
    /// What the quick run must reach: all of its few machines right.
    pub(crate) fn meets_quick_bars(&self) -> bool {
        self.named == Some(1.0) && self.false_alarm == Some(0.0)
    }
}

/// What kind of case it was.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// One effect of the catalogue.
    Single,
    /// One outside it.
    Outside,
    /// Two of the catalogue.
    Pair,
    /// None.
    Clean,
}

pub(crate) fn kind(o: &Outcome) -> Kind {
    match o.hidden.as_slice() {
        [] => Kind::Clean,
        [one] if CATALOGUE.contains(&one.as_str()) => Kind::Single,
        [_] => Kind::Outside,
        _ => Kind::Pair,
    }
}

/// The deviation that was asked for could be made.
pub(crate) fn reached(o: &Outcome) -> bool {
    o.deviation > 0.5 * o.wanted && o.deviation < 2.0 * o.wanted
}

pub(crate) fn names(o: &Outcome) -> Vec<&str> {
    match &o.diagnosis {
        Ok(d) => d.effects.iter().map(|e| e.effect.as_str()).collect(),
        Err(_) => Vec::new(),
    }
}

/// What was hidden is named, and nothing else.
pub(crate) fn is_named(o: &Outcome) -> bool {
    let (mut names, mut hidden) = (names(o), o.hidden.iter().map(String::as_str).collect::<Vec<_>>());
    names.sort_unstable();
    hidden.sort_unstable();
    names == hidden
}

fn is_family(o: &Outcome) -> bool {
    let Ok(d) = &o.diagnosis else { return false };
    !d.effects.is_empty() && d.effects.iter().all(|e| o.families.contains(&e.family))
}

fn part(all: &[Outcome], of: impl Fn(&Outcome) -> bool, is: impl Fn(&Outcome) -> bool) -> Option<f64> {
    let chosen: Vec<&Outcome> = all.iter().filter(|o| of(o)).collect();
    let hits = chosen.iter().filter(|o| is(o)).count();
    (!chosen.is_empty()).then(|| hits as f64 / chosen.len() as f64)
}

pub(crate) fn worst(errors: &Errors) -> f64 {
    errors
        .validation
        .values()
        .map(|e| e.over_noise)
        .fold(0.0, f64::max)
}

fn is_explained(o: &Outcome) -> bool {
    matches!(&o.diagnosis, Ok(d) if d.verdict == "explained" || d.verdict == "partly-explained")
}

/// 1.1 times the noise, 1.5 times at 100, and at 1000 a fall by 30 dB.
pub(crate) fn is_within(o: &Outcome) -> bool {
    let Ok(d) = &o.diagnosis else { return false };
    let (before, after) = (worst(&d.before), worst(&d.after));
    match o.wanted {
        w if w > 500.0 => 20.0 * (before / after).log10() >= 30.0 || after <= 1.5,
        w if w > 50.0 => after <= 1.5,
        _ => after <= 1.1,
    }
}

/// True values and those found with their deviations.
fn parameters<'a>(o: &'a Outcome, d: &'a Diagnosis) -> impl Iterator<Item = (f64, f64, f64)> + 'a {
    d.effects
        .iter()
        .flat_map(|e| &e.parameters)
        .filter_map(|(name, v)| {
            let truth = o.facts.iter().find(|(n, _)| n == name)?.1;
            Some((truth, v.value, v.std?))
        })
}

pub(crate) fn score(all: &[Outcome], seconds: Option<f64>) -> Metrics {
    let single = |o: &Outcome| kind(o) == Kind::Single && reached(o);
    let strong = |o: &Outcome| single(o) && o.wanted >= 10.0;
    let mut known = Vec::new();
    for o in all.iter().filter(|o| single(o) && is_named(o)) {
        if let Ok(d) = &o.diagnosis {
            known.extend(parameters(o, d).map(|(truth, value, std)| (truth - value).abs() <= 3.0 * std));
        }
    }
    let within = known.iter().filter(|k| **k).count() as f64;
    Metrics {
        named: part(all, strong, is_named),
        family: part(all, strong, is_family),
        named_at_3: part(all, |o| single(o) && o.wanted < 10.0, is_named),
        after_over_noise_share: part(all, |o| single(o) && is_explained(o), is_within),
        parameter_coverage: (!known.is_empty()).then(|| within / known.len() as f64),
        false_alarm: part(
            all,
            |o| kind(o) == Kind::Clean,
            |o| !matches!(&o.diagnosis, Ok(d) if d.verdict == "nothing-missing"),
        ),
        pairs_named: part(all, |o| kind(o) == Kind::Pair, is_named),
        outside_wrong_name: part(
            all,
            |o| kind(o) == Kind::Outside && reached(o),
            |o| !names(o).is_empty(),
        ),
        seconds,
    }
}

/// One outcome in a line.
pub(crate) fn line(o: &Outcome) -> String {
    let hidden = match o.hidden.as_slice() {
        [] => "nothing".to_owned(),
        some => some.join(" + "),
    };
    let what = match &o.diagnosis {
        Err(error) => format!("no diagnosis: {error}"),
        Ok(d) => {
            let ratio = |e: &Errors| -> Vec<String> {
                e.validation
                    .values()
                    .map(|v| format!("{:.2}", v.over_noise))
                    .collect()
            };
            let off: Vec<String> = d
                .effects
                .iter()
                .flat_map(|e| &e.parameters)
                .filter_map(|(name, v)| {
                    let truth = o.facts.iter().find(|(n, _)| n == name)?.1;
                    let off = (v.value - truth) / v.std?;
                    (off.abs() > 3.0).then(|| format!("{name} off by {off:.1}"))
                })
                .collect();
            format!(
                "{} [{}] {} -> {} {}",
                d.verdict,
                names(o).join(" + "),
                ratio(&d.before).join("/"),
                ratio(&d.after).join("/"),
                off.join(", ")
            )
        }
    };
    let mark = match kind(o) {
        Kind::Single | Kind::Pair if is_named(o) => "ok ",
        Kind::Clean if matches!(&o.diagnosis, Ok(d) if d.verdict == "nothing-missing") => "ok ",
        Kind::Outside if names(o).is_empty() => "ok ",
        _ => "BAD",
    };
    format!(
        "{mark} {hidden} at {:.0} ({:.1}): {what} ({:.0} s)",
        o.wanted, o.deviation, o.seconds
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_written_in_the_order_of_their_bars() -> Result<(), crate::TaskError> {
        let folder = tempfile::tempdir()?;
        let file = folder.path().join("metrics.json");
        crate::reproduce::write_json(&file, &score(&[], None))?;
        let text = std::fs::read_to_string(file)?;
        let keys: Vec<&str> = text.split('"').skip(1).step_by(2).collect();
        let asked = "named family named_at_3 after_over_noise_share parameter_coverage false_alarm pairs_named outside_wrong_name \
                     seconds";
        assert_eq!(keys, asked.split(' ').collect::<Vec<_>>());
        Ok(())
    }
}
