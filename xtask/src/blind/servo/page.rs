//! docs/blind-servo.md.

use super::score::{Metrics, Said, Share, is_catalogue, is_clean, is_outside, reached, said, share, within};
use super::{CATALOGUE, OUTSIDE, Outcome, SEVERITIES};
use crate::blind::page::{counted, machines};
use std::collections::BTreeMap;
use std::fmt::Write;

const HEAD: &str = "# Hidden effects on servo axes: what `lpv diagnose` finds without a controller\n\n\
Each machine is simulated: a mass on a guide, the same on a flexure, motor and load on a spring with one or two encoders, or two axes that \
move by themselves. A tracking controller moves it, or a command that was computed beforehand; neither stands in the bundle. Moves are \
trapezoids of speed, s-curves and sums of sines. A bundle has three records to fit and one held out, of 1600 to 4800 samples each, with the \
commands and the readings of the encoders, which are rounded. One effect is hidden, or none. The code that hides effects \
(`xytable_plant::servo_axis`) and the code that finds them (crate `lpv-diagnose`) share nothing.\n\n\
Drawn uniformly in the logarithm: sample rates from 0.2 to 10 kHz, strokes from 1 mm to 10 m, masses from 1 g to 1 t, 10^4 to 10^6 steps of \
the encoder in the stroke, pitches from a thousandth of the stroke (where speed and encoder resolve it) to the stroke, frequencies of forces from 2.5 \
periods in a record to a tenth of the sample rate.\n\n\
**The least visible size** of an effect is that at which it moves the axis by the noise of one reading: the root mean square over all records of the difference between \
the position with the effect and that of a clean machine that gets the same commands, both without rounding, least over position and speed at \
the beginning of each record and over mass, viscous friction, force at rest and the stiffness of a flexure (these an identification would fit), \
is the step of the encoder over the square root of 12. It is computed by simulation alone. Effects are hidden at 10, 100 and 1000 times it: 10 times is what the bar asks \
for, about three steps of the encoder; from 1000 times on, some hundred steps, an engineer sees it in a plot of the tracking error. Smaller \
ones are not hidden, since the diagnosis names nothing that stays below the noise of a reading.\n\n";

const NOTES: &str = "\nAn effect counts as named where it is named, on its axis, and nothing else is. Readings are rounded on every machine, so that `quantization` is never \
a wrong name; nor is `extra-mode` on motor and load, which the base, a rigid axis, lacks. Viscous friction and a constant force are parameters of \
the axis: they count as named where no name is given, nothing is left, and their values count among the parameters. A smooth force of position, gravity over an angle among them, may be told as `position-force`, `cogging` or \
`cable-stiffness`, on a flexure as `cubic-stiffness`; a spring as `cable-stiffness` or the slope of a `position-force`.\n\n\
The size of an effect counts slow differences of position, which add up over a record. The diagnosis follows the records through an observer, \
which takes slow differences away, and where that leaves noise through slower ones, down to a free run.\n";

pub(super) fn page(metrics: &Metrics, all: &[Outcome], (command, asked): (&str, usize)) -> String {
    let mut text = HEAD.to_owned();
    text += &machines(all.len(), asked, command);
    let at_least = |share: Share, bar: f64| found(share, share.value().is_none_or(|v| v >= bar));
    let at_most = |share: Share, bar: f64| found(share, share.value().is_none_or(|v| v <= bar));
    let rows = [
        (
            "effect named, and nothing else, from 10 times the least visible size on",
            ">= 90 %",
            at_least(metrics.named, 0.9),
        ),
        (
            "the same, or another one of which it says that the hidden one explains the records as well",
            "",
            found(metrics.named_or_equal, true),
        ),
        (
            "parameters of named effects within three standard deviations",
            ">= 95 %",
            at_least(metrics.parameters, 0.95),
        ),
        (
            "clean machines, a wrong name",
            "<= 1 %",
            at_most(metrics.wrong_name_clean, 0.01),
        ),
        (
            "effects outside the catalogue, a wrong name",
            "<= 5 %",
            at_most(metrics.wrong_name_outside, 0.05),
        ),
        (
            "effects of the catalogue, a wrong name",
            "",
            found(metrics.wrong_name, true),
        ),
        (
            "clean machines, something is said to be left",
            "",
            found(metrics.left_on_clean, true),
        ),
        (
            "clean machines, mass, friction, force at rest and stiffness within three standard deviations",
            "",
            found(metrics.axis_parameters, true),
        ),
        ("ended with an error", "", found(metrics.refused, true)),
    ];
    for (what, bar, found) in rows {
        let _ = writeln!(text, "| {what} | {bar} | {found} |");
    }
    for (severity, share) in &metrics.named_by_severity {
        let _ = writeln!(
            text,
            "| named at {severity:.0} times | | {} |",
            found(*share, true)
        );
    }
    let [median, longest] = metrics.seconds;
    let _ = writeln!(
        text,
        "| seconds of a diagnosis, two at a time: median, longest | | {median:.1}, {longest:.1} |"
    );
    text.push_str(NOTES);
    text += &by_effect(all);
    text += &by_machine(all);
    text += &failures(all);
    text
}

fn found(share: Share, holds: bool) -> String {
    let Some(value) = share.value() else {
        return "not run".to_owned();
    };
    let text = format!("{:.1} % ({} of {})", 100.0 * value, share.hits, share.of);
    if holds {
        text
    } else {
        format!("**{text}**, missed")
    }
}

fn count(share: Share) -> String {
    format!("{}/{}", share.hits, share.of)
}

fn by_effect(all: &[Outcome]) -> String {
    let mut text = String::from(
        "\n## By effect\n\nNamed of all and wrong names, by deviation over the noise of a reading; parameters within three standard deviations; what else was said. \
         Of effects outside the catalogue, wrong names alone count.\n\n| hidden |",
    );
    for s in SEVERITIES {
        let _ = write!(text, " named at {s:.0} | wrong |");
    }
    text.push_str(" parameters | taken for |\n|---|---|---|---|---|---|---|---|---|\n");
    for name in CATALOGUE.into_iter().chain(OUTSIDE) {
        let own: Vec<&Outcome> = all
            .iter()
            .filter(|o| o.hidden.as_deref() == Some(name) && reached(o))
            .collect();
        if own.is_empty() {
            continue;
        }
        let _ = write!(text, "| {name} |");
        for severity in SEVERITIES {
            let here = || own.iter().filter(|o| o.wanted == severity).copied();
            let right = share(here(), |o| said(o) == Said::Right);
            let wrong = share(here(), |o| matches!(said(o), Said::Wrong(_)));
            let right = if OUTSIDE.contains(&name) {
                String::new()
            } else {
                count(right)
            };
            let _ = write!(text, " {right} | {} |", count(wrong));
        }
        let right = own.iter().filter(|o| said(o) == Said::Right).copied();
        let _ = writeln!(
            text,
            " {} | {} |",
            count(within(right)),
            counted(own.iter().filter_map(|o| instead(o)))
        );
    }
    let short = all.iter().filter(|o| !reached(o)).count();
    if short > 0 {
        let _ = writeln!(
            text,
            "\n{short} machines, whose deviation could not be brought within a factor of two of the wanted one, are left out."
        );
    }
    text
}

/// What was said of a machine in the place of what is right, if that can be told.
fn instead(o: &Outcome) -> Option<String> {
    match said(o) {
        Said::Right => None,
        Said::Nothing => o.diagnosis.as_ref().ok().map(|d| d.verdict.clone()),
        Said::Wrong(names) => Some(names.join(" + ")),
        Said::Equal(name) => Some(format!("{name} (told as equal)")),
        Said::Refused => Some("error".to_owned()),
    }
}

fn by_machine(all: &[Outcome]) -> String {
    let mut text = String::from(
        "\n## By machine\n\n| machine | effects of the catalogue named | wrong names on them | wrong names on clean ones |\n|---|---|---|---|\n",
    );
    let mut kinds: Vec<&str> = all.iter().map(|o| o.machine.as_str()).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let is_wrong = |o: &Outcome| matches!(said(o), Said::Wrong(_));
    for kind in kinds {
        let own = || all.iter().filter(|o| o.machine == kind && reached(o));
        let _ = writeln!(
            text,
            "| {kind} | {} | {} | {} |",
            count(share(own().filter(|o| is_catalogue(o)), |o| said(o) == Said::Right)),
            count(share(own().filter(|o| is_catalogue(o)), is_wrong)),
            count(share(own().filter(|o| is_clean(o)), is_wrong)),
        );
    }
    text
}

/// Wrong names, most frequent first, with a case of each.
fn failures(all: &[Outcome]) -> String {
    let mut found: BTreeMap<(String, String), Vec<&Outcome>> = BTreeMap::new();
    for o in all.iter().filter(|o| reached(o)) {
        let what = match said(o) {
            Said::Wrong(names) => names.join(" + "),
            Said::Nothing if !is_outside(o) => "nothing".to_owned(),
            Said::Equal(name) => format!("{name} (told as equal)"),
            Said::Refused => "an error".to_owned(),
            _ => continue,
        };
        let hidden = o.hidden.clone().unwrap_or_else(|| "nothing".to_owned());
        found.entry((hidden, what)).or_default().push(o);
    }
    if found.is_empty() {
        return String::new();
    }
    let mut rows: Vec<_> = found.into_iter().collect();
    rows.sort_by_key(|(_, cases)| std::cmp::Reverse(cases.len()));
    let mut text = String::from(
        "\n## Failures\n\nMost frequent first; said names without those of the machine, and one case: its machine, its severity.\n\n\
         | hidden | said beside it or instead | machines | a case |\n|---|---|---|---|\n",
    );
    for ((hidden, what), cases) in rows {
        let first = cases[0];
        let _ = writeln!(
            text,
            "| {hidden} | {what} | {} | {}, {:.0} |",
            cases.len(),
            first.machine,
            first.wanted
        );
    }
    text
}
