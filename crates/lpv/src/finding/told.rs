//! Findings for a person and for a program.

use super::{Finding, Severity};
use schemars::JsonSchema;
use serde::{Serialize, Serializer};

/// Places named before the rest is counted.
const PLACES: usize = 2;

/// For a person: the gravest first; of those alike, the first in full and where the others are.
pub(crate) fn told(findings: &[Finding]) -> Vec<(Severity, String)> {
    let mut order: Vec<&Finding> = findings.iter().collect();
    order.sort_by_key(|f| std::cmp::Reverse(f.severity()));
    let mut alike: Vec<Vec<&Finding>> = Vec::new();
    for finding in order {
        match alike.iter_mut().find(|group| same(group[0], finding)) {
            Some(group) => group.push(finding),
            None => alike.push(vec![finding]),
        }
    }
    alike
        .iter()
        .map(|group| (group[0].severity(), sentence(group)))
        .collect()
}

/// The same as lines that begin with how much each matters.
pub(crate) fn lines(findings: &[Finding]) -> Vec<String> {
    let label = |severity| match severity {
        Severity::Note => "note",
        Severity::Warning => "warning",
        Severity::Contradiction => "contradiction",
    };
    let told = told(findings).into_iter();
    told.map(|(severity, sentence)| format!("{}: {sentence}", label(severity)))
        .collect()
}

/// What makes an answer from these data worthless, in words.
pub(crate) fn contradictions(findings: &[Finding]) -> Vec<String> {
    let grave = told(findings).into_iter();
    grave
        .filter(|(severity, _)| *severity == Severity::Contradiction)
        .map(|(_, sentence)| sentence)
        .collect()
}

/// What explains that a model errs, in words: the machine does something that no model of this kind has, or the sensor does.
pub(crate) fn explanations(findings: &[Finding]) -> Vec<String> {
    let explains = |f: &&Finding| {
        matches!(
            f,
            Finding::DeadTime { .. }
                | Finding::Trend { .. }
                | Finding::LevelDrifts { .. }
                | Finding::LevelDiffers { .. }
                | Finding::PeriodDrifts { .. }
                | Finding::CommandSaturates { .. }
        )
    };
    let all: Vec<Finding> = findings.iter().filter(explains).cloned().collect();
    told(&all).into_iter().map(|(_, sentence)| sentence).collect()
}

/// Of one kind, and with the same parity where there is one.
fn same(a: &Finding, b: &Finding) -> bool {
    let parity = |f: &Finding| match f {
        Finding::Distortion { parity, .. } => Some(parity.clone()),
        _ => None,
    };
    std::mem::discriminant(a) == std::mem::discriminant(b) && parity(a) == parity(b)
}

fn sentence(group: &[&Finding]) -> String {
    let mut others: Vec<&str> = Vec::new();
    for place in group.iter().map(|f| f.place()).filter(|p| *p != group[0].place()) {
        if !others.contains(&place) {
            others.push(place);
        }
    }
    let named = others[..others.len().min(PLACES)].join(", ");
    match others.len().saturating_sub(PLACES) {
        _ if others.is_empty() => group[0].to_string(),
        0 => format!("{} (so too: {named})", group[0]),
        more => format!("{} (so too: {named}, and {more} more)", group[0]),
    }
}

/// One finding as a program reads it.
#[derive(Serialize, JsonSchema)]
pub(crate) struct Row<'a> {
    severity: Severity,
    sentence: String,
    #[serde(flatten)]
    finding: &'a Finding,
}

/// Facts, severity and sentence of each.
pub(crate) fn serialize<S: Serializer>(findings: &[Finding], to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(findings.iter().map(|finding| Row {
        severity: finding.severity(),
        sentence: finding.to_string(),
        finding,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn few(place: &str) -> Finding {
        Finding::FewPeriods {
            place: place.into(),
            periods: 2,
        }
    }

    #[test]
    fn those_alike_are_told_once_with_their_places() {
        let said = told(&[Finding::NothingHeldOut, few("a"), few("b"), few("c"), few("d")]);
        assert_eq!(said.len(), 2);
        assert!(
            said[0].1.starts_with("a: ") && said[0].1.ends_with("(so too: b, c, and 1 more)"),
            "{said:?}"
        );
        assert!(said[1].1.contains("hold one out"));
    }

    #[test]
    fn a_program_reads_facts_and_sentence_and_the_facts_come_back() {
        #[derive(Serialize)]
        struct Holder(#[serde(serialize_with = "serialize")] Vec<Finding>);
        let json = serde_json::to_value(Holder(vec![few("a")])).unwrap();
        let row = &json[0];
        assert_eq!(row["kind"], "few-periods");
        assert_eq!(row["severity"], "warning");
        assert_eq!(row["periods"], 2);
        assert_eq!(row["sentence"], few("a").to_string());
        let back: Vec<Finding> = serde_json::from_value(json).unwrap();
        assert_eq!(back, vec![few("a")]);
    }
}
