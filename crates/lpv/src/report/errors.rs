//! Errors in time as tables, and the residuals' correlations.

use super::Subject;
use crate::PipelineError;
use crate::validation::ErrorFigure;
use lpv_report::{Axis, Cell, Colour, Figure, Format, Marker, Panel, Section, Series, Style, Table};

pub(super) fn section(s: &Subject) -> Result<Option<Section>, PipelineError> {
    let Some(v) = s
        .validation
        .as_ref()
        .filter(|v| !v.records.is_empty() || !v.notes.is_empty())
    else {
        return Ok(None);
    };
    let mut section = Section::new("Errors in time");
    if !v.records.is_empty() {
        let mut table = Table::new(
            "Root mean square, in brackets as a multiple of the noise of one sample.",
            [
                "record",
                "output",
                "one step",
                "open loop",
                "closed loop",
                "open loop fit",
            ],
        );
        let figure = |e: &ErrorFigure| {
            let over = e.over_noise.map_or(String::new(), |n| format!(" ({n:.2})"));
            Cell::text(format!("{:.2e}{over}", e.rms))
        };
        for r in &v.records {
            for o in &r.outputs {
                table = table.row([
                    Cell::text(r.name.clone()),
                    Cell::text(if o.unit.is_empty() {
                        o.name.clone()
                    } else {
                        format!("{} [{}]", o.name, o.unit)
                    }),
                    o.one_step.as_ref().map_or(Cell::text("-"), figure),
                    figure(&o.open_loop),
                    o.closed_loop.as_ref().map_or(Cell::text("-"), figure),
                    Cell::number(o.open_loop.fit_percent, Format::Fixed(2)).unit("%"),
                ]);
            }
        }
        section = section.table(table);
        if v.records.iter().any(|r| !r.whiteness.is_empty()) {
            section = section.figure(correlations(s, |_| true));
        }
    }
    for r in v.records.iter().filter(|r| !r.axes.is_empty()) {
        let mut table = Table::new(
            format!("Servo axes on {}, relative errors in percent.", r.name),
            ["axis", "force", "closed loop: position", "velocity", "force"],
        );
        for a in &r.axes {
            let closed = |value: fn(&crate::validation::ClosedLoopAxis) -> f64, digits| {
                a.closed_loop
                    .as_ref()
                    .map_or(Cell::text("-"), |c| Cell::number(value(c), Format::Fixed(digits)))
            };
            table = table.row([
                Cell::text(a.input.clone()),
                Cell::number(a.force_percent, Format::Fixed(2)),
                closed(|c| c.position_percent, 5),
                closed(|c| c.velocity_percent, 4),
                closed(|c| c.force_percent, 3),
            ]);
        }
        section = section.table(table);
    }
    if !v.notes.is_empty() {
        section = section.list(v.notes.clone());
    }
    Ok(Some(section))
}

/// Autocorrelation of the one-step residuals of the first record, of the outputs that are wanted, with its bound.
pub(super) fn correlations(s: &Subject, wanted: impl Fn(&str) -> bool) -> Figure {
    let mut figure = Figure::new("").columns(2);
    let records = s
        .validation
        .iter()
        .flat_map(|v| v.records.iter().find(|r| !r.whiteness.is_empty()));
    for r in records {
        for w in r.whiteness.iter().filter(|w| wanted(&w.output)) {
            let points = |values: &[f64], first: usize| -> Vec<(f64, f64)> {
                values
                    .iter()
                    .enumerate()
                    .map(|(k, v)| ((k + first) as f64, *v))
                    .collect()
            };
            let mut panel = Panel::new(Axis::linear("Lag (samples)"), Axis::linear("Correlation"))
                .title(format!(
                    "{}: residual of {}",
                    super::bode::plain(&r.name),
                    super::bode::plain(&w.output)
                ))
                .marker(Marker::horizontal(w.bound_99).label("99 %"))
                .marker(Marker::horizontal(-w.bound_99))
                .series(Series::new(points(&w.autocorrelation, 1), Style::Dots).label("with itself"));
            for (n, c) in r
                .cross_correlation
                .iter()
                .filter(|c| c.output == w.output)
                .enumerate()
            {
                panel = panel.series(
                    Series::line(points(&c.correlation, 0))
                        .label(format!("with {}", super::bode::plain(&c.input)))
                        .colour(Colour::Index(n + 1)),
                );
            }
            figure = figure.panel(panel);
        }
    }
    figure.caption("Correlation of the one-step residual with itself and with the inputs; grey: 99 % bound of a white residual.")
}
