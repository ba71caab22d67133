//! The page of a diagnosis.

use super::{Diagnosed, Diagnosis, ForceErrors, FoundEffect, LeftTest, LeftTests, OutputError};
use crate::verdict::{number, percent, times};
use lpv_diagnose::MISSING_SHARE;
use lpv_report::{
    Axis, Block, Cell, Colour, Figure, Format, Marker, Page, Panel, Section, Series, Style, Table, Tone,
};

/// Gain, dB, that stands for a machine that leaves all bounds.
const LOST_DB: f64 = -299.0;

impl Diagnosed {
    /// What was found, the errors before and after, and every effect that was tried.
    pub fn page(&self) -> Page {
        let d = &self.diagnosis;
        let mut page = Page::new(format!("Diagnosis of {}", d.bundle))
            .lead([
                Block::Judgement(tone(d), d.verdict_in_words.clone()),
                Block::Aside(self.fit()),
            ])
            .fact("verdict", d.verdict.as_str())
            .fact("base model", d.base_model.clone());
        if !self.axes.is_empty() {
            return self.page_of_axes(page);
        }
        page = page.lead([Block::Figure(Box::new(self.errors.clone()))]);
        if !d.base_parameters.is_empty() {
            page = page.section(Section::new("The machine").table(base(d)));
        }
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
                        Cell::text(e.effect.clone()),
                        Cell::text(e.channel.clone()),
                        Cell::text(name.clone()),
                        Cell::text(format!("{:.5e}", v.value)),
                        Cell::text(v.std.map_or("-".to_owned(), |s| format!("{s:.1e}"))),
                        Cell::text(v.unit.clone()),
                        Cell::number(e.evidence.held_out_gain_db, Format::Fixed(1)),
                        Cell::text(e.rival().map_or("-".to_owned(), |(name, margin)| {
                            format!("{name}, {margin:.1} dB worse")
                        })),
                    ]);
                }
            }
            let mut section = Section::new("What was missing").table(table);
            let doubts: Vec<String> = d.effects.iter().flat_map(FoundEffect::doubts).collect();
            if !doubts.is_empty() {
                section = section.list(doubts);
            }
            page = page.section(section);
        }
        let what = match d.responses.is_empty() {
            true if d.error_of == "observer" => {
                "Root mean square on held-out records: the model driven by the logged inputs, with an observer that keeps it at the record, in \
                 brackets over the noise of a reading; and one step ahead, by a Kalman filter that lets a force at the inputs walk at random. \
                 Before: the base without effects, fitted to the same records."
            }
            true => {
                "Root mean square on held-out records: simulated in closed loop, in brackets over the closed-loop output noise; and one \
                 step ahead, by a Kalman filter that follows the scheduling and lets a force at the inputs walk at random. Before: the \
                 base without effects, fitted to the same records, which may shift its error to another output."
            }
            false => {
                "Error of the held-out responses over their size, roots of sums of squares over all lines, in brackets over that of the noise."
            }
        };
        let columns = ["output", "before", "after", "one step before", "one step after"];
        // Responses have no step ahead.
        let columns = if d.responses.is_empty() {
            &columns[..]
        } else {
            &columns[..3]
        };
        let mut table = Table::new(what, columns.iter().copied());
        for (name, before) in &d.before.validation {
            let after = &d.after.validation[name];
            let simulated = |e: &OutputError| Cell::text(format!("{:.3e} ({:.2})", e.rms, e.over_noise));
            let ahead =
                |e: &OutputError| Cell::text(e.rms_one_step.map_or("-".to_owned(), |e| format!("{e:.3e}")));
            let cells = [
                Cell::text(name.clone()),
                simulated(before),
                simulated(after),
                ahead(before),
                ahead(after),
            ];
            table = table.row(cells.into_iter().take(columns.len()));
        }
        page = page.section(Section::new("Before and after").table(table));
        if !self.force.is_empty() {
            let mut section = Section::new("The force that would explain the error");
            for figure in &self.force {
                section = section.figure(figure.clone());
            }
            page = page.section(section);
        }
        if let Some(free_run) = &self.free_run {
            page = page.section(Section::new("Let run free").figure(free_run.clone()));
        }
        if let Some(spectrum) = &self.spectrum {
            page = page.section(Section::new("In spectrum").figure(spectrum.clone()));
        }
        if let Some(frozen) = &self.frozen {
            page =
                page.section(Section::new("At rest: the base against the responses").figure(frozen.clone()));
        }
        if let Some(left) = &d.left {
            page = page.section(self::left(left));
        }
        let mut table = Table::new(
            "Every effect of the catalogue that these data could show, look by look, as it did on held-out records beside what was \
             there already: fitted in full with the machine, or after one linear step, where that did not promise enough.",
            ["beside", "effect", "channel", "gain, dB", "fitted", "added"],
        );
        for c in &d.candidates {
            let gain = match c.held_out_gain_db {
                db if db > LOST_DB => Cell::number(db, Format::Fixed(2)),
                _ => Cell::text("leaves all bounds"),
            };
            table = table.row([
                Cell::text(c.beside.join(", ")),
                Cell::text(c.effect.as_str()),
                Cell::text(c.channel.clone()),
                gain,
                Cell::text(if c.fitted { "in full" } else { "one step" }),
                Cell::text(if c.accepted { "yes" } else { "" }),
            ]);
        }
        page = page.section(Section::new("Candidates").table(table));
        let lines = d.text();
        let plain = |l: &str| l.strip_prefix("- ").unwrap_or(l).to_owned();
        page.section(Section::new("How it was found").list(lines.lines().map(plain)))
    }

    /// The axes one after the other: a table of all, then the page of each.
    fn page_of_axes(&self, mut page: Page) -> Page {
        let mut table = Table::new(
            "The axes of the machine, each diagnosed alone. Force: error of the inverse dynamics on the first held-out record.",
            ["axis", "force before, %", "force after, %", "verdict"],
        );
        for (i, axis) in self.axes.iter().enumerate() {
            let percent = |of: fn(&ForceErrors) -> f64| match axis.force_errors() {
                Some(force) => Cell::number(of(force), Format::Fixed(1)),
                None => Cell::text("-"),
            };
            table = table.row([
                Cell::text(format!("{}", i + 1)),
                percent(|f| f.before_percent),
                percent(|f| f.after_percent),
                Cell::text(axis.diagnosis.verdict_in_words.clone()),
            ]);
        }
        page = page.lead(self.forces().map(|f| Block::Figure(Box::new(f))));
        page = page.section(Section::new("The axes").table(table));
        for (i, axis) in self.axes.iter().enumerate() {
            let own = axis.page();
            let mut first = Section::new("verdict");
            first.blocks = own.lead;
            for mut section in std::iter::once(first).chain(own.sections) {
                section.heading = format!("Axis {}: {}", i + 1, section.heading);
                page = page.section(section);
            }
        }
        page
    }

    /// Errors of every output and force before and after, in units, over the noise and in percent.
    fn fit(&self) -> String {
        let d = &self.diagnosis;
        let mut parts = Vec::new();
        for (name, before) in &d.before.validation {
            let after = &d.after.validation[name];
            // The panels of the errors are named by output and unit.
            let mut titles = self.errors.panels.iter().map(|p| &p.title);
            let unit = titles.find_map(|t| t.strip_prefix(name.as_str())?.strip_prefix(", "));
            parts.push(format!(
                "{name}: {:.2e} -> {:.2e}{}, {} -> {} the noise, {} of the error left",
                before.rms,
                after.rms,
                unit.map_or(String::new(), |u| format!(" {u}")),
                number(before.over_noise),
                times(after.over_noise),
                percent(100.0 * after.rms / before.rms)
            ));
        }
        for (input, f) in self.forces_held_out() {
            parts.push(format!(
                "force of {input}: {} -> {}, {:.2e} -> {:.2e} {}",
                percent(f.before_percent),
                percent(f.after_percent),
                f.before,
                f.after,
                f.unit
            ));
        }
        parts.join(" · ").replace("->", "→")
    }

    /// Error of the force of every axis, before and after; none where no axis has one.
    fn forces(&self) -> Option<Figure> {
        let along = |of: fn(&ForceErrors) -> f64| -> Vec<(f64, f64)> {
            let each = self.axes.iter().enumerate();
            each.filter_map(|(i, axis)| Some(((i + 1) as f64, of(axis.force_errors()?))))
                .collect()
        };
        let before = along(|f| f.before_percent);
        let series =
            |points, label: &str, colour| Series::new(points, Style::Circles).label(label).colour(colour);
        let panel = Panel::new(
            Axis::linear("Axis")
                .range(0.5, self.axes.len() as f64 + 0.5)
                .step(1.0),
            Axis::log("Error of the force (%)"),
        )
        .series(series(before.clone(), "before", Colour::Reference))
        .series(series(along(|f| f.after_percent), "after", Colour::Model));
        let caption = "Error of the inverse dynamics over the size of the force, on the first held-out record of each axis.";
        (!before.is_empty()).then(|| Figure::new("").panel(panel).caption(caption))
    }

    /// Errors of the forces on the first held-out record, by input.
    fn forces_held_out(&self) -> impl Iterator<Item = (&String, &ForceErrors)> {
        let mut records = self.diagnosis.records.iter();
        let held_out = records.find(|r| r.purpose == "validation");
        held_out.into_iter().flat_map(|r| &r.force)
    }

    /// The first of these.
    fn force_errors(&self) -> Option<&ForceErrors> {
        Some(self.forces_held_out().next()?.1)
    }
}

fn tone(d: &Diagnosis) -> Tone {
    match d.verdict.as_str() {
        _ if !d.contradictions.is_empty() => Tone::Bad,
        "nothing-missing" | "explained" => Tone::Good,
        "partly-explained" => Tone::Caution,
        _ => Tone::Bad,
    }
}

/// What tests find before and after.
fn left(tests: &LeftTests) -> Section {
    /// Rows of a table.
    const ROWS: usize = 6;
    let mut section = Section::new("Whether anything is left").paragraph(
        "The error one step ahead, in units of the noise, against its own past and against the past of every signal. \
         The probability of a share as large by chance holds for all tests of a list together (Holm). A model that is good to a \
         hundredth of the noise still shows in long records: the share says how much there is, and from a twentieth on the verdict is \
         that more is missing.",
    );
    section = section.figure(shares(tests));
    for (when, list) in [("Before", &tests.before), ("After", &tests.after)] {
        let mut table = Table::new(
            format!("{when}: the surest of {} tests.", list.len()),
            [
                "output",
                "signal",
                "share of the error, %",
                "probability by chance",
            ],
        );
        for test in list.iter().take(ROWS) {
            table = table.row([
                Cell::text(test.output.clone()),
                Cell::text(test.signal.clone()),
                Cell::number(100.0 * test.share, Format::Fixed(2)),
                Cell::text(match test.adjusted {
                    p if p < 0.01 => format!("{p:.1e}"),
                    p => format!("{p:.2}"),
                }),
            ]);
        }
        section = section.table(table);
    }
    section
}

/// What every test finds, the surest first: its share of the error beside the bound from which more is missing.
fn shares(tests: &LeftTests) -> Figure {
    let mut panel = Panel::new(
        Axis::linear("Test, the surest first"),
        Axis::log("Share of the error (%)"),
    )
    .marker(Marker::horizontal(100.0 * MISSING_SHARE).label("more is missing above"));
    let looks = [
        ("before", &tests.before, Colour::Reference),
        ("after", &tests.after, Colour::Model),
    ];
    for (label, list, colour) in looks {
        let at = |(i, test): (usize, &LeftTest)| ((i + 1) as f64, 100.0 * test.share);
        panel = panel.series(
            Series::new(list.iter().enumerate().map(at).collect(), Style::Dots)
                .label(label)
                .colour(colour),
        );
        if let Some(first) = list.first() {
            let name = format!("{} with {}", first.output, first.signal);
            panel = panel.marker(Marker::text(1.0, 100.0 * first.share, name));
        }
    }
    Figure::new("").panel(panel).caption(
        "Part of the square of the error one step ahead that each test explains by the past of a signal, before and after.",
    )
}

/// Parameters of the machine with their deviations.
fn base(d: &Diagnosis) -> Table {
    let what = format!(
        "Parameters of the base, {}, fitted together with the effects.",
        d.base_model
    );
    let columns = ["parameter", "value", "deviation", "unit"];
    d.base_parameters
        .iter()
        .fold(Table::new(what, columns.iter().copied()), |table, (name, v)| {
            table.row([
                Cell::text(name.clone()),
                Cell::text(format!("{:.5e}", v.value)),
                Cell::text(v.std.map_or("-".to_owned(), |s| format!("{s:.1e}"))),
                Cell::text(v.unit.clone()),
            ])
        })
}
