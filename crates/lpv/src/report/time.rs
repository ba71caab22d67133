//! Measured and simulated outputs over time.

use super::Subject;
use super::bode::plain;
use lpv_core::Record;
use lpv_report::{Axis, Colour, Figure, Panel, Section, Series, Share, Style};
use lpv_simulate::Run;

/// Records that are drawn.
const RECORDS: usize = 3;

pub(super) fn section(s: &Subject) -> Option<Section> {
    if s.evidence.runs.is_empty() {
        return None;
    }
    let mut section = Section::new("Time responses");
    for run in s.evidence.runs.iter().take(RECORDS) {
        section = section.figure(figure(s, run, |_| true));
    }
    if s.evidence.runs.len() > RECORDS {
        section = section.paragraph(format!(
            "{} more records are in the table above.",
            s.evidence.runs.len() - RECORDS
        ));
    }
    Some(section)
}

/// The outputs of a record that are wanted, by name, each with its error.
pub(super) fn figure(
    s: &Subject,
    (record, open, closed): &(Record, Run, Option<Run>),
    wanted: impl Fn(&str) -> bool,
) -> Figure {
    let (run, kind) = match closed {
        Some(run) => (run, "closed loop"),
        None => (open, "open loop"),
    };
    let time: Vec<f64> = (0..record.len())
        .map(|k| k as f64 * s.clock.sample_time())
        .collect();
    let mut figure = Figure::new(format!("{}, {kind}", plain(&record.name))).share(Share::X);
    for (i, y) in record.outputs.columns.iter().enumerate() {
        if !wanted(&record.outputs.names[i]) {
            continue;
        }
        let simulated: Vec<f64> = run.outputs.row(i).iter().copied().collect();
        let error: Vec<f64> = y.iter().zip(&simulated).map(|(a, b)| a - b).collect();
        let name = plain(&record.outputs.names[i]);
        let unit = record
            .outputs
            .units
            .get(i)
            .map_or(String::new(), |u| format!(" ({u})"));
        let line = |values: &[f64], style, label: &str, colour| {
            Series::xy(&time, values, style).label(label).colour(colour)
        };
        let axes = |label: String| Panel::new(Axis::linear("Time (s)"), Axis::linear(label));
        figure = figure
            .panel(
                axes(format!("{name}{unit}"))
                    .series(line(y, Style::Line, "measured", Colour::Reference))
                    .series(line(&simulated, Style::Dashed, "model", Colour::Model)),
            )
            .panel(axes(format!("error of {name}{unit}")).series(line(
                &error,
                Style::Line,
                "error",
                Colour::Error,
            )));
    }
    figure.caption(match closed {
        Some(_) => "Model and controller along the recorded references.",
        None => "The model along the recorded inputs.",
    })
}
