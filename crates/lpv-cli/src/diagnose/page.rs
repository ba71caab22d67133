//! The page of a diagnosis.

use super::{Diagnosed, OutputError};
use lpv_report::{Axis, Cell, Colour, Figure, Format, Page, Panel, Section, Series, Style, Table};

impl Diagnosed {
    /// What was found, the errors before and after, and every effect that was tried.
    pub fn page(&self) -> Page {
        let d = &self.diagnosis;
        let mut page = Page::new(format!("Diagnosis of {}", d.bundle))
            .subtitle(format!("{}: {}", d.verdict, self.summary()))
            .fact("verdict", d.verdict)
            .fact("base model", d.base_model.clone());
        if !d.effects.is_empty() {
            let mut table = Table::new(
                "Effects that were added, in order. The gain is the fall of the squared error on held-out records.",
                [
                    "effect",
                    "channel",
                    "parameter",
                    "value",
                    "deviation",
                    "unit",
                    "gain, dB",
                    "next best",
                ],
            );
            for e in &d.effects {
                for (name, v) in &e.parameters {
                    table = table.row([
                        Cell::text(e.effect),
                        Cell::text(e.channel.clone()),
                        Cell::text(*name),
                        Cell::text(format!("{:.5e}", v.value)),
                        Cell::text(v.std.map_or("-".to_owned(), |s| format!("{s:.1e}"))),
                        Cell::text(v.unit.clone()),
                        Cell::number(e.evidence.held_out_gain_db, Format::Fixed(1)),
                        Cell::text(match (e.evidence.runner_up, e.evidence.runner_up_margin_db) {
                            (Some(name), Some(margin)) => format!("{name}, {margin:.1} dB worse"),
                            _ => "-".to_owned(),
                        }),
                    ]);
                }
            }
            let mut section = Section::new("What was missing").table(table);
            if let Some(figure) = &self.missing {
                section = section.figure(figure.clone());
            }
            page = page.section(section);
        }
        let what = match d.responses.is_empty() {
            true => {
                "Root mean square on held-out records, simulated in closed loop, in brackets over the noise as it leaves the loop."
            }
            false => {
                "Error of the held-out responses over their size, roots of sums of squares over all lines, in brackets over that of the noise."
            }
        };
        let mut table = Table::new(what, ["output", "before", "after"]);
        for (name, before) in &d.before.validation {
            let after = &d.after.validation[name];
            let cell = |e: &OutputError| Cell::text(format!("{:.3e} ({:.2})", e.rms, e.over_noise));
            table = table.row([Cell::text(name.clone()), cell(before), cell(after)]);
        }
        page = page.section(
            Section::new("Before and after")
                .table(table)
                .figure(self.errors.clone()),
        );
        let mut table = Table::new(
            "Every effect of the catalogue that these data could show, as it did alone on held-out records.",
            ["effect", "channel", "gain, dB", "added"],
        );
        for c in &d.candidates {
            table = table.row([
                Cell::text(c.effect),
                Cell::text(c.channel.clone()),
                Cell::number(c.held_out_gain_db, Format::Fixed(2)),
                Cell::text(if c.accepted { "yes" } else { "" }),
            ]);
        }
        page = page.section(Section::new("Candidates").table(table));
        page.section(Section::new("How it was found").list(d.text().lines().map(str::to_owned)))
    }

    /// Effects, and the error of the worst output.
    fn summary(&self) -> String {
        let d = &self.diagnosis;
        let names: Vec<&str> = d.effects.iter().map(|e| e.effect).collect();
        let what = match names.as_slice() {
            [] => "no effect added".to_owned(),
            some => some.join(", "),
        };
        let errors: Vec<String> = d
            .before
            .validation
            .iter()
            .map(|(name, before)| {
                let after = d.after.validation[name].over_noise;
                format!("{name} {:.2} -> {after:.2} times the noise", before.over_noise)
            })
            .collect();
        format!("{what}; {}", errors.join(", "))
    }
}

/// What effects add to the force of a motor, over its speed and over its position: by sample position, speed and force.
pub(super) fn over_motion(force: &[[f64; 3]]) -> Figure {
    let panel = |axis: &str, at: usize| {
        let points = force.iter().map(|v| (v[at], v[2])).collect();
        Panel::new(
            Axis::linear(axis),
            Axis::linear("Force of the effects, first motor"),
        )
        .series(Series::new(points, Style::Dots).width(1.6).colour(Colour::Model))
    };
    Figure::new("")
        .columns(2)
        .panel(panel("Speed", 1))
        .panel(panel("Position", 0))
        .caption(
            "What the fitted effects add to the force of the first motor along the first held-out record.",
        )
}

/// Errors by output before and after, over time.
pub(super) fn in_time(outputs: &[String], step: f64, errors: [&[[f64; 2]]; 2]) -> Figure {
    let mut figure = Figure::new("")
        .columns(1)
        .caption("Error in closed loop along the first held-out record.");
    for (i, name) in outputs.iter().enumerate() {
        let mut panel = Panel::new(Axis::linear("Time"), Axis::linear("Error")).title(name.clone());
        for (record, (label, colour)) in errors.iter().zip(BEFORE_AFTER) {
            let points = record.iter().enumerate().map(|(k, e)| (k as f64 * step, e[i]));
            panel = panel.series(Series::line(points.collect()).label(label).colour(colour));
        }
        figure = figure.panel(panel);
    }
    figure
}

/// Magnitudes by output over frequency: what was measured, and the errors of a model before and after.
pub(super) fn over_frequency(outputs: &[String], lines: &[f64], curves: &[[Vec<f64>; 3]]) -> Figure {
    let mut figure = Figure::new("").columns(curves.len().min(2)).caption(
        "Held-out response and what the model leaves of it, before and after; cycles per unit of time.",
    );
    for (name, [measured, before, after]) in outputs.iter().zip(curves) {
        let line = |v: &[f64]| Series::line(lines.iter().copied().zip(v.iter().copied()).collect());
        figure = figure.panel(
            Panel::new(Axis::log("Frequency"), Axis::log("Magnitude"))
                .title(name.clone())
                .series(line(measured).label("measured").colour(Colour::Reference))
                .series(line(before).label("error before").colour(Colour::Bound))
                .series(line(after).label("error after").colour(Colour::Error)),
        );
    }
    figure
}

const BEFORE_AFTER: [(&str, Colour); 2] = [("before", Colour::Reference), ("after", Colour::Model)];
