//! The page of a diagnosis.

use super::{Diagnosed, Diagnosis, ForceErrors, LeftTests, OutputError};
use lpv_report::{Cell, Format, Page, Section, Table, Tone};

/// Gain, dB, that stands for a machine that leaves all bounds.
const LOST_DB: f64 = -299.0;

impl Diagnosed {
    /// What was found, the errors before and after, and every effect that was tried.
    pub fn page(&self) -> Page {
        let d = &self.diagnosis;
        let mut page = Page::new(format!("Diagnosis of {}", d.bundle))
            .subtitle(self.summary())
            .section(Section::new("Verdict").judgement(tone(d), d.verdict_in_words.clone()))
            .fact("verdict", d.verdict.as_str())
            .fact("base model", d.base_model.clone());
        if !self.axes.is_empty() {
            return self.page_of_axes(page);
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
            let section = Section::new("What was missing").table(table);
            page = page.section(section);
        }
        let what = match d.responses.is_empty() {
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
        page = page.section(
            Section::new("Before and after")
                .table(table)
                .figure(self.errors.clone()),
        );
        if let Some(spectrum) = &self.spectrum {
            page = page.section(Section::new("In spectrum").figure(spectrum.clone()));
        }
        if let Some(frozen) = &self.frozen {
            page =
                page.section(Section::new("At rest: the base against the responses").figure(frozen.clone()));
        }
        if !self.force.is_empty() {
            let mut section = Section::new("The force that would explain the error");
            for figure in &self.force {
                section = section.figure(figure.clone());
            }
            page = page.section(section);
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
            let records = &axis.diagnosis.records;
            let held_out = records.iter().find(|r| r.purpose == "validation");
            let force = held_out.and_then(|r| r.force.values().next());
            let percent = |of: fn(&ForceErrors) -> f64| match force {
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
        page = page.section(Section::new("The axes").table(table));
        for (i, axis) in self.axes.iter().enumerate() {
            for mut section in axis.page().sections {
                section.heading = format!("Axis {}: {}", i + 1, section.heading);
                page = page.section(section);
            }
        }
        page
    }

    /// Effects, and the error of the worst output.
    fn summary(&self) -> String {
        let d = &self.diagnosis;
        let names: Vec<&str> = d.effects.iter().map(|e| e.effect.as_str()).collect();
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
