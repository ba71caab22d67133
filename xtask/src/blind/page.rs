//! docs/blind.md: the figures beside their bars, and who was taken for whom.

use super::score::{Kind, Metrics, is_named, is_within, kind, names, reached, worst};
use super::{CATALOGUE, Outcome, SEVERITIES};
use lpv::diagnose::EQUAL_DB;
use std::collections::BTreeMap;
use std::fmt::Write;

/// What one figure is, its bar, and whether it is a least value.
const BARS: [(&str, f64, bool); 9] = [
    (
        "right effect named, deviation from 10 times the noise on",
        0.95,
        true,
    ),
    ("right family", 0.98, true),
    ("right effect named at 3 times the noise", 0.70, true),
    ("of the explained ones, error after within its bar", 0.95, true),
    ("true parameters within three standard deviations", 0.95, true),
    ("false alarms on clean machines", 0.01, false),
    ("two effects at once, both named and nothing else", 0.85, true),
    ("effects outside the catalogue, a wrong name", 0.05, false),
    (
        "one diagnosis alone, the longest of one of each kind, seconds",
        10.0,
        false,
    ),
];

/// How many machines of those asked for a command has worked on, and the head of the table of their figures.
pub(super) fn machines(worked_on: usize, asked: usize, command: &str) -> String {
    let of = if worked_on < asked {
        format!(" of the {asked}")
    } else {
        String::new()
    };
    format!("{worked_on}{of} machines of `{command}`.\n\n| | bar | found |\n|---|---|---|\n")
}

/// Names with how often each was said.
pub(super) fn counted(said: impl Iterator<Item = String>) -> String {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for what in said {
        *counts.entry(what).or_default() += 1;
    }
    let parts = counts.into_iter().map(|(name, n)| format!("{name} {n}"));
    parts.collect::<Vec<_>>().join(", ")
}

/// The page, with the command that makes it and how many machines that asks for.
pub(crate) fn page(metrics: &Metrics, all: &[Outcome], (command, asked): (&str, usize)) -> String {
    let figures = [
        metrics.named,
        metrics.family,
        metrics.named_at_3,
        metrics.after_over_noise_share,
        metrics.parameter_coverage,
        metrics.false_alarm,
        metrics.pairs_named,
        metrics.outside_wrong_name,
        metrics.seconds,
    ];
    let mut text = String::from(
        "# Hidden effects: what `lpv diagnose` finds in machines that nobody described to it\n\n\
         Each machine has random masses, couplings and dampings; one effect (or two, or none) is hidden in it, its shape drawn, its \
         severity such that an output departs by 3, 10, 100 or 1000 times the noise of its sensor. The simulated measurements are \
         written as a bundle, and `lpv diagnose` sees nothing else. The code that hides effects (crate `xytable-plant`) and the code \
         that finds them (crate `lpv-diagnose`) share nothing.\n\n",
    );
    text += &machines(all.len(), asked, command);
    for ((what, bar, least), figure) in BARS.iter().zip(figures) {
        let percent = |v: f64| {
            if *what == BARS[8].0 {
                format!("{v:.1}")
            } else {
                format!("{:.1} %", 100.0 * v)
            }
        };
        let found = match figure {
            None => "not run".to_owned(),
            Some(v) if (v >= *bar) == *least || v == *bar => percent(v),
            Some(v) => format!("**{}**, missed", percent(v)),
        };
        let sign = if *least { ">=" } else { "<=" };
        let _ = writeln!(text, "| {what} | {sign} {} | {found} |", percent(*bar));
    }
    text.push_str(
        "\n## By effect\n\nNamed of all, by deviation over the noise; then what else was said.\n\n| hidden |",
    );
    SEVERITIES.iter().for_each(|s| {
        let _ = write!(text, " {s:.0} |");
    });
    text.push_str(" taken for |\n|---|---|---|---|---|---|\n");
    let outside: Vec<&str> = {
        let mut found: Vec<&str> = all
            .iter()
            .filter(|o| kind(o) == Kind::Outside)
            .map(|o| o.hidden[0].as_str())
            .collect();
        found.sort_unstable();
        found.dedup();
        found
    };
    for name in CATALOGUE.into_iter().chain(outside) {
        let own: Vec<&Outcome> = all.iter().filter(|o| o.hidden == [name]).collect();
        if own.is_empty() {
            continue;
        }
        let _ = write!(text, "| {name} |");
        for severity in SEVERITIES {
            let here: Vec<&&Outcome> = own.iter().filter(|o| o.wanted == severity).collect();
            let right = here.iter().filter(|o| is_named(o)).count();
            let _ = write!(text, " {right}/{} |", here.len());
        }
        let _ = writeln!(
            text,
            " {} |",
            counted(own.iter().filter(|o| !is_named(o)).map(|o| said(o)))
        );
    }
    text += &others_that_do(all);
    text += &identified(all);
    let rest: Vec<&Outcome> = all
        .iter()
        .filter(|o| matches!(kind(o), Kind::Clean | Kind::Pair) && !is_named(o))
        .collect();
    if !rest.is_empty() {
        text.push_str("\n## Clean machines and pairs that were missed\n\n| hidden | said |\n|---|---|\n");
        for o in rest {
            let hidden = if o.hidden.is_empty() {
                "nothing".to_owned()
            } else {
                o.hidden.join(" + ")
            };
            let _ = writeln!(text, "| {hidden} | {} |", said(o));
        }
    }
    text
}

/// How often what is said instead explains the records as well, and what no figure counts.
fn others_that_do(all: &[Outcome]) -> String {
    let mut text = String::new();
    let taken: Vec<&Outcome> = all
        .iter()
        .filter(|o| kind(o) == Kind::Single && !is_named(o) && !names(o).is_empty())
        .collect();
    if !taken.is_empty() {
        let enough = taken.iter().filter(|o| is_within(o)).count();
        let told = taken.iter().filter(|o| is_told(o)).count();
        let _ = writeln!(
            text,
            "\nIn {} machines with one effect another is named. In {enough} of these it explains the held-out moves to within the bar of \
             the error after; in {told} the diagnosis names the hidden one beside it, as equal within {EQUAL_DB} dB or as a refinement \
             that the records do not ask for, with the experiment that would show it.",
            taken.len(),
        );
    }
    let short = all
        .iter()
        .filter(|o| matches!(kind(o), Kind::Single | Kind::Outside) && !reached(o))
        .count();
    if short > 0 {
        let _ = writeln!(
            text,
            "\n{short} machines, whose deviation could not be brought within a factor of two of the wanted one, are in this table alone."
        );
    }
    text
}

/// The hidden effect is the runner-up, as good as what is named.
fn is_told(o: &Outcome) -> bool {
    let Ok(d) = &o.diagnosis else { return false };
    d.effects.iter().any(|e| {
        let margin = e.evidence.runner_up_margin_db;
        let other = e.evidence.runner_up.as_ref();
        other.is_some_and(|r| o.hidden.contains(r)) && margin.is_some_and(|m| m < EQUAL_DB)
    })
}

/// What the small LFR as the base found, one row a machine.
fn identified(all: &[Outcome]) -> String {
    let mut text = String::new();
    let with: Vec<Outcome> = all
        .iter()
        .filter_map(|o| {
            Some(Outcome {
                diagnosis: o.identified.clone()?,
                ..o.clone()
            })
        })
        .collect();
    if with.is_empty() {
        return text;
    }
    let in_catalogue =
        |o: &&Outcome| !o.hidden.is_empty() && o.hidden.iter().all(|h| CATALOGUE.contains(&h.as_str()));
    let strange = |o: &&Outcome| names(o).iter().any(|n| o.hidden.iter().all(|h| h != n));
    let known: Vec<&Outcome> = with.iter().filter(in_catalogue).collect();
    let _ = write!(
        text,
        "\n## With an identified model as the base\n\n\
         The small LFR of the same machine, identified from an experiment before something was hidden in it, given with `--model`: it \
         knows no masses and no couplings, and effects act on its motors through the geometry. {} machines were run so (`--lfr`). Of \
         {} with effects of the catalogue, {} have all of them named and nothing else; in {} of all machines something is named that \
         is not there. Errors are those of the worst output, in units of the noise, on held-out moves.\n\n\
         | hidden | deviation | said | error before | after |\n|---|---|---|---|---|\n",
        with.len(),
        known.len(),
        known.iter().filter(|o| is_named(o)).count(),
        with.iter().filter(strange).count(),
    );
    for o in &with {
        let hidden = if o.hidden.is_empty() {
            "nothing".to_owned()
        } else {
            o.hidden.join(" + ")
        };
        let _ = match &o.diagnosis {
            Err(why) => writeln!(text, "| {hidden} | {:.0} | no diagnosis: {why} | | |", o.wanted),
            Ok(d) => writeln!(
                text,
                "| {hidden} | {:.0} | {} | {:.1} | {:.2} |",
                o.wanted,
                said(o),
                worst(&d.before),
                worst(&d.after)
            ),
        };
    }
    text
}

fn said(o: &Outcome) -> String {
    match &o.diagnosis {
        Err(_) => "no diagnosis".to_owned(),
        Ok(d) if d.effects.is_empty() => d.verdict.to_owned(),
        Ok(_) => names(o).join(" + "),
    }
}
