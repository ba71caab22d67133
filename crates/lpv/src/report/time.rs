//! Measured and simulated outputs over time.

use super::Subject;
use super::bode::plain;
use lpv_report::{Axis, Colour, Figure, Panel, Section, Series, Share, Style};

/// Records that are drawn.
const RECORDS: usize = 3;

pub(super) fn section(s: &Subject) -> Option<Section> {
    if s.evidence.runs.is_empty() {
        return None;
    }
    let mut section = Section::new("Time responses");
    for (record, open, closed) in s.evidence.runs.iter().take(RECORDS) {
        let (run, kind) = match closed {
            Some(run) => (run, "closed loop"),
            None => (open, "open loop"),
        };
        let time: Vec<f64> = (0..record.len())
            .map(|k| k as f64 * s.clock.sample_time())
            .collect();
        let mut figure = Figure::new(format!("{}, {kind}", plain(&record.name)))
            .columns(1)
            .share(Share::X);
        for (i, y) in record.outputs.columns.iter().enumerate() {
            let simulated: Vec<f64> = run.outputs.row(i).iter().copied().collect();
            let error: Vec<f64> = y.iter().zip(&simulated).map(|(a, b)| a - b).collect();
            let name = plain(&record.outputs.names[i]);
            let unit = record
                .outputs
                .units
                .get(i)
                .map_or(String::new(), |u| format!(" ({u})"));
            figure = figure
                .panel(
                    Panel::new(Axis::linear("Time"), Axis::linear(format!("{name}{unit}")))
                        .series(
                            Series::xy(&time, y, Style::Line)
                                .label("measured")
                                .colour(Colour::Reference),
                        )
                        .series(
                            Series::xy(&time, &simulated, Style::Dashed)
                                .label("model")
                                .colour(Colour::Model),
                        ),
                )
                .panel(
                    Panel::new(
                        Axis::linear("Time"),
                        Axis::linear(format!("error of {name}{unit}")),
                    )
                    .series(
                        Series::xy(&time, &error, Style::Line)
                            .label("error")
                            .colour(Colour::Error),
                    ),
                );
        }
        section = section.figure(figure.caption(match closed {
            Some(_) => "Model and controller along the recorded references.",
            None => "The model along the recorded inputs.",
        }));
    }
    if s.evidence.runs.len() > RECORDS {
        section = section.paragraph(format!(
            "{} more records are in the table above.",
            s.evidence.runs.len() - RECORDS
        ));
    }
    Some(section)
}
