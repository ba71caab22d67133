//! docs/measured/: what one bundle shows, as one would show it to a colleague.

use crate::TaskError;
use crate::diagnosed::Found;
use crate::effects::capital;
use lpv::diagnose::{Diagnosed, Diagnosis};
use lpv_report::Figure;
use std::fmt::Write as _;
use std::path::Path;

/// Width of a picture, pixels.
const WIDTH: u32 = 1100;

/// Writes the page of a bundle and its pictures below a folder.
pub(crate) fn write(found: &Found, folder: &Path) -> Result<(), TaskError> {
    let folder = folder.join("measured");
    std::fs::create_dir_all(&folder)?;
    let (bundle, d) = (found.bundle, &found.whole.diagnosis);
    let mut out = format!(
        "# {bundle}\n\n{}.\n\n```sh\nlpv diagnose ../shared/data/{bundle} -o diagnosis\n```\n\n\
         Written by `cargo xtask measured --bless`; `diagnosis/diagnosis.html` shows more.\n",
        capital(&d.verdict_in_words)
    );
    let axes = found.whole.axes();
    if axes.is_empty() {
        out += &parameters(d);
        out += &pictures(&found.whole, bundle, "##", &folder)?;
    }
    for (i, axis) in axes.iter().enumerate() {
        let _ = write!(
            out,
            "\n## Axis {}\n\n{}.\n",
            i + 1,
            capital(&axis.diagnosis.verdict_in_words)
        );
        out += &parameters(&axis.diagnosis);
        out += &pictures(axis, &format!("{bundle}-{}", i + 1), "###", &folder)?;
    }
    if !d.records.is_empty() {
        out += &moves(d);
    }
    std::fs::write(folder.join(format!("{bundle}.md")), out)?;
    Ok(())
}

/// The machine and its effects.
fn parameters(d: &Diagnosis) -> String {
    let mut out =
        String::from("\n| of | parameter | value | one standard deviation | unit |\n|---|---|---|---|---|\n");
    let machine = d
        .base_parameters
        .iter()
        .map(|(name, v)| (d.base_model.clone(), name, v));
    let effects = d.effects.iter().flat_map(|e| {
        let parameters = e.parameters.iter();
        parameters.map(move |(name, v)| (format!("{} at {}", e.effect, e.channel), name, v))
    });
    for (of, name, v) in machine.chain(effects) {
        let deviation = v.std.map_or("-".to_owned(), |s| format!("{s:.1e}"));
        let _ = writeln!(
            out,
            "| {of} | {name} | {:.5e} | {deviation} | {} |",
            v.value, v.unit
        );
    }
    out
}

/// The force over speed and position with what the effects add, and the free run, or the error where something holds the machine.
fn pictures(found: &Diagnosed, name: &str, level: &str, folder: &Path) -> Result<String, TaskError> {
    let mut out = String::new();
    let last = match found.free_run() {
        Some(figure) => ("free-run", "Free run, before and after", Some(figure)),
        None => ("error", "Error, before and after", Some(found.in_time())),
    };
    let force = ("force", "Force over speed and position", found.over_motion());
    for (kind, heading, figure) in [force, last] {
        let Some(figure) = figure else { continue };
        let file = format!("{name}-{kind}.png");
        std::fs::write(folder.join(&file), Figure::to_png(figure, WIDTH)?)?;
        let caption = &figure.caption;
        let _ = write!(out, "\n{level} {heading}\n\n![{heading}]({file})\n\n{caption}\n");
    }
    Ok(out)
}

/// The moves of axes, record by record: the force of the inverse dynamics, and the run of the model over the whole
/// record from its measured start.
fn moves(d: &Diagnosis) -> String {
    let mut out = String::from(
        "\n## Record by record\n\n\
         | record | use | input | force, % | force, rms | output | free run over the record, rms | |\n|---|---|---|---|---|---|---|---|\n",
    );
    for record in &d.records {
        let runs: Vec<_> = record
            .free_run
            .last()
            .map(|run| run.outputs.iter().collect())
            .unwrap_or_default();
        for (i, (input, force)) in record.force.iter().enumerate() {
            let (output, run) = match runs.get(i) {
                Some((output, run)) => (
                    output.as_str(),
                    format!("{:.3e} -> {:.3e} {}", run.before, run.after, run.unit),
                ),
                None => ("-", "leaves all bounds".to_owned()),
            };
            let _ = writeln!(
                out,
                "| {} | {} | {input} | {:.1} -> {:.1} | {:.3e} -> {:.3e} {} | {output} | {run} | {} |",
                record.record,
                record.purpose,
                force.before_percent,
                force.after_percent,
                force.before,
                force.after,
                force.unit,
                if record.worse { "worse" } else { "" }
            );
        }
    }
    out
}
