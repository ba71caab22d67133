//! What the page says first of a model: the verdict, the fit by channel, and the figure that shows what the verdict says.

use super::band::Known;
use super::{Subject, bode, errors, time, tone};
use crate::validation::{ErrorFigure, OutputCheck};
use crate::verdict::{Cause, Run, Verdict, judged_run, percent, times};
use lpv_report::{Block, Figure};

/// Verdict and fit.
pub(super) fn words(s: &Subject, verdict: Option<&Verdict>) -> Vec<Block> {
    // Marks of code are for the terminal.
    let judgement = verdict.map(|v| Block::Judgement(tone(v.worth), v.sentence.replace('`', "")));
    judgement.into_iter().chain(fit(s).map(Block::Aside)).collect()
}

/// What speaks most against the model, else the residual of the frequency responses, else the first record.
pub(super) fn figure(s: &Subject, known: &[Option<Known<'_>>], verdict: Option<&Verdict>) -> Option<Figure> {
    let along = match verdict.and_then(|v| v.causes.first()) {
        Some(
            Cause::Record {
                output,
                run: Run::OneStep,
                ..
            }
            | Cause::Residual { output, .. },
        ) => Some(errors::correlations(s, |name| name == output).columns(1)),
        Some(Cause::Record { record, output, .. }) => in_time(s, record, Some(output)),
        Some(Cause::Force { record, .. }) => in_time(s, record, None),
        _ => None,
    };
    let first = || in_time(s, &s.evidence.runs.first()?.0.name, None);
    along
        .filter(|f| !f.panels.is_empty())
        .or_else(|| bode::residual(s, known))
        .or_else(first)
}

/// One output of a record with its error, the first one without a name.
fn in_time(s: &Subject, record: &str, output: Option<&String>) -> Option<Figure> {
    let run = s.evidence.runs.iter().find(|(r, ..)| r.name == record)?;
    let output = output.or(run.0.outputs.names.first())?;
    Some(time::figure(s, run, |name| name == output))
}

/// The errors of the outputs, the worst ones first: of the response in percent, and along the worst record in percent, in units and
/// over the noise.
fn fit(s: &Subject) -> Option<String> {
    /// Outputs that are told; the tables have all.
    const TOLD: usize = 3;
    let v = s.validation.as_ref()?;
    let mut responses: Vec<(f64, String)> = Vec::new();
    let mut along: Vec<(f64, String)> = Vec::new();
    for (i, name) in s.outputs.iter().enumerate() {
        if let Some(e) = v.frozen.as_ref().and_then(|f| f.relative_rms_percent.get(i)) {
            responses.push((*e, format!("{name} {}", percent(*e))));
        }
        let all = v.records.iter().flat_map(|r| {
            let own = r.outputs.iter().filter(|o| o.name == *name);
            own.map(move |o| (r, o, judged_run(o, v.stability)))
        });
        let size = |e: &ErrorFigure| e.over_noise.unwrap_or(100.0 - e.fit_percent);
        if let Some((r, o, (run, e))) = all.max_by(|a, b| size(a.2.1).total_cmp(&size(b.2.1))) {
            along.push((size(e), in_words(&r.name, o, run, e)));
        }
    }
    let line = |mut each: Vec<(f64, String)>, separator: &str| {
        let more = each.len().saturating_sub(TOLD);
        each.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut told: Vec<String> = each.into_iter().take(TOLD).map(|(_, words)| words).collect();
        if more > 0 {
            told.push(format!("{more} others err less"));
        }
        told.join(separator)
    };
    let response = (!responses.is_empty()).then(|| {
        format!(
            "Error of the response, all lines together: {}",
            line(responses, ", ")
        )
    });
    let along = (!along.is_empty()).then(|| line(along, " · "));
    let parts: Vec<String> = response.into_iter().chain(along).collect();
    (!parts.is_empty()).then(|| parts.join(" · "))
}

fn in_words(record: &str, o: &OutputCheck, run: Run, e: &ErrorFigure) -> String {
    let over = e
        .over_noise
        .map_or(String::new(), |n| format!(", {} the noise", times(n)));
    let space = if o.unit.is_empty() { "" } else { " " };
    let run = match run {
        Run::ClosedLoop => "closed loop",
        Run::OpenLoop => "simulated",
        Run::OneStep => "one step",
    };
    format!(
        "{}: {} of its motion, {:.2e}{space}{}{over} ({record}, {run})",
        o.name,
        percent(100.0 - e.fit_percent),
        e.rms,
        o.unit
    )
}
