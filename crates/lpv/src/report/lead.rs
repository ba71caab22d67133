//! What the page says first of a model: the verdict, the fit by channel, and the figure that shows what the verdict says.

use super::{Subject, bode, errors, time, tone};
use crate::PipelineError;
use crate::validation::{ErrorFigure, OutputCheck};
use crate::verdict::{Cause, Run, Verdict, judged_run, percent, times};
use lpv_report::{Block, Figure};

/// Verdict, fit and figure.
pub(super) fn of(s: &Subject, verdict: Option<&Verdict>) -> Result<Vec<Block>, PipelineError> {
    // Marks of code are for the terminal.
    let judgement = verdict.map(|v| Block::Judgement(tone(v.worth), v.sentence.replace('`', "")));
    let figure = figure(s, verdict)?.map(|figure| Block::Figure(Box::new(figure)));
    let fit = fit(s).map(Block::Aside);
    Ok(judgement.into_iter().chain(fit).chain(figure).collect())
}

/// What speaks most against the model, else the residual of the frequency responses, else the first record.
fn figure(s: &Subject, verdict: Option<&Verdict>) -> Result<Option<Figure>, PipelineError> {
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
    if let Some(figure) = along.filter(|f| !f.panels.is_empty()) {
        return Ok(Some(figure));
    }
    if let Some(residual) = bode::residual(s, &bode::known(s)?) {
        return Ok(Some(residual));
    }
    let first = s.evidence.runs.first();
    Ok(first.and_then(|(record, ..)| in_time(s, &record.name, None)))
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
    let response =
        (!responses.is_empty()).then(|| format!("Error of the response: {}", line(responses, ", ")));
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
