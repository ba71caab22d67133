//! The inspection in words and as a table of lines.

use super::{ExperimentInfo, Inspection, RecordInfo, ResponseInfo, Spread};
use crate::encode::cell;
use crate::error::short_place;
use crate::finding::{self, Finding, Severity};
use crate::table::TextTable;
use lpv_core::{Position, counted};
use std::fmt::Write as _;

impl Inspection {
    /// For a person.
    pub fn text(&self) -> String {
        let (grave, other): (Vec<Finding>, Vec<Finding>) = self
            .findings
            .iter()
            .cloned()
            .partition(|f| f.severity() == Severity::Contradiction);
        let mut out = finding::lines(&grave)
            .iter()
            .fold(String::new(), |out, f| out + f + "\n");
        out += &format!(
            "{}: {} at {} Hz\n",
            self.name,
            counted(self.records.len() + self.responses.len(), "record"),
            self.sample_rate_hz
        );
        for c in &self.channels {
            let columns: Vec<String> = c
                .columns
                .iter()
                .enumerate()
                .map(|(k, name)| {
                    let unit = c.units.get(k).map_or(String::new(), |unit| format!(" [{unit}]"));
                    // That an output is no position changes what a model of it is.
                    match c.quantities.get(k) {
                        Some(other) if c.role == "output" && *other != "position" => {
                            format!("{name}{unit}, {other}")
                        }
                        _ => format!("{name}{unit}"),
                    }
                })
                .collect();
            let _ = writeln!(out, "  {}: {}", c.role, columns.join(", "));
        }
        if !self.records.is_empty() {
            out += &self.record_table();
        }
        for purpose in ["estimation", "validation"] {
            let some: Vec<&ExperimentInfo> =
                self.experiments.iter().filter(|e| e.purpose == purpose).collect();
            if !some.is_empty() {
                out += &format!("\nfrequency responses, {purpose} (median over lines, worst in brackets)\n");
                out += &experiment_table(&some);
            }
        }
        if !self.responses.is_empty() {
            out += "\nmeasured frequency responses (median over lines, worst in brackets)\n";
            out += &response_table(&self.responses);
            for note in self.responses.iter().flat_map(|r| &r.notes) {
                let _ = writeln!(out, "- {note}");
            }
        }
        if let Some(c) = &self.coverage {
            let _ = writeln!(
                out,
                "\nscheduling covers [{:.5}, {:.5}], periodic estimation at {} positions, largest gap {:.5}",
                c.range[0],
                c.range[1],
                c.positions.len(),
                c.largest_gap
            );
        }
        if !self.noise.is_empty() {
            let noise: Vec<String> = self.noise.iter().map(|n| format!("{n:.2e}")).collect();
            let _ = writeln!(out, "noise of one sample, by output: {}", noise.join(", "));
        }
        if self.findings.is_empty() {
            out += "no warnings\n";
        }
        for line in finding::lines(&other) {
            let _ = writeln!(out, "{line}");
        }
        out.truncate(out.trim_end().len());
        out
    }

    /// One row for each excited and each detection line, comma separated, for a spreadsheet.
    pub fn lines_csv(&self) -> String {
        let mut table = csv::Writer::from_writer(Vec::new());
        let mut row = |cells: [&str; 10]| {
            // Memory takes what is written.
            table.write_record(cells).ok();
        };
        row([
            "use",
            "position",
            "kind",
            "frequency",
            "output",
            "snr_db",
            "coherence",
            "frf_deviation",
            "level",
            "noise",
        ]);
        let outputs = self.channels.iter().find(|c| c.role == "output");
        let name = |i: usize| cell(outputs.and_then(|c| c.columns.get(i)).map_or("", String::as_str));
        for e in &self.experiments {
            let at = e.position.as_ref().map_or(String::new(), |p| p.to_string());
            for l in &e.lines {
                for i in 0..l.coherence.len() {
                    row([
                        e.purpose,
                        &at,
                        "excited",
                        &l.frequency_hz.to_string(),
                        &name(i),
                        &format!("{:.3}", l.output_snr_db[i]),
                        &format!("{:.8}", l.coherence[i]),
                        &format!("{:.3e}", l.frf_deviation),
                        "",
                        "",
                    ]);
                }
            }
            for d in &e.detection {
                for i in 0..d.level.len() {
                    row([
                        e.purpose,
                        &at,
                        d.parity,
                        &d.frequency_hz.to_string(),
                        &name(i),
                        "",
                        "",
                        "",
                        &format!("{:.6e}", d.level[i]),
                        &format!("{:.6e}", d.noise[i]),
                    ]);
                }
            }
        }
        String::from_utf8_lossy(&table.into_inner().unwrap_or_default()).into_owned()
    }

    fn record_table(&self) -> String {
        let mut table = TextTable::new(&[
            "record",
            "use",
            "kind",
            "samples",
            "time",
            "periods",
            "scheduling",
            "crest factor u",
            "explained y / %",
        ]);
        for r in &self.records {
            let periods = r
                .period
                .map_or(String::new(), |p| format!("{} x {p}", r.samples / p));
            table.row(vec![
                r.name.clone(),
                r.purpose.to_owned(),
                r.kind.to_owned(),
                r.samples.to_string(),
                format!("{:.2}", r.duration),
                periods,
                scheduling(r),
                r.channels
                    .iter()
                    .filter(|c| c.role == "input")
                    .map(|c| format!("{:.2}", c.crest_factor))
                    .collect::<Vec<_>>()
                    .join(" "),
                r.explained
                    .iter()
                    .map(|part| format!("{:.1}", 100.0 * part))
                    .collect::<Vec<_>>()
                    .join(" "),
            ]);
        }
        table.text()
    }
}

/// One number in five decimals, several in five digits.
fn place(p: &Position) -> String {
    p.single().map_or_else(|| short_place(p), |p| format!("{p:.5}"))
}

fn scheduling(r: &RecordInfo) -> String {
    match (&r.position, r.scheduling.as_slice()) {
        (Some(p), _) => place(p),
        (None, [[low, high]]) => format!("{low:.4} to {high:.4}"),
        _ => String::new(),
    }
}

fn response_table(responses: &[ResponseInfo]) -> String {
    let mut table = TextTable::new(&[
        "record",
        "use",
        "position",
        "quantity",
        "lines",
        "band",
        "FRF noise / %",
        "from",
        "scatter / %",
    ]);
    for r in responses {
        table.row(vec![
            r.name.clone(),
            r.purpose.to_owned(),
            r.position.as_ref().map_or("-".to_owned(), place),
            r.quantity.unwrap_or("-").to_owned(),
            r.lines.to_string(),
            format!("{:.4} to {:.4}", r.band_hz[0], r.band_hz[1]),
            format!(
                "{:.2} ({:.2})",
                100.0 * r.frf_deviation.median,
                100.0 * r.frf_deviation.max
            ),
            r.error_from.to_owned(),
            r.scatter.map_or("-".to_owned(), |s| format!("{:.2}", 100.0 * s)),
        ]);
    }
    table.text()
}

fn experiment_table(experiments: &[&ExperimentInfo]) -> String {
    let mut table = TextTable::new(&[
        "position",
        "lines",
        "band",
        "periods",
        "skipped",
        "SNR y / dB",
        "coherence y",
        "FRF noise / %",
        "distortion odd / even / %",
        "condition",
    ]);
    let worst_low = |s: &[Spread], digits: usize| {
        s.iter()
            .map(|s| format!("{:.digits$} ({:.digits$})", s.median, s.min))
            .collect::<Vec<_>>()
            .join(", ")
    };
    for e in experiments {
        let percent = |d: &Option<Vec<f64>>| {
            d.as_ref().map_or("-".to_owned(), |d| {
                d.iter()
                    .map(|v| format!("{:.2}", 100.0 * v))
                    .collect::<Vec<_>>()
                    .join(", ")
            })
        };
        table.row(vec![
            e.position.as_ref().map_or("-".to_owned(), place),
            e.lines.len().to_string(),
            format!("{:.4} to {:.4}", e.band_hz[0], e.band_hz[1]),
            e.periods_used.to_string(),
            e.periods_skipped.to_string(),
            worst_low(&e.output_snr_db, 0),
            worst_low(&e.coherence, 4),
            format!(
                "{:.2} ({:.2})",
                100.0 * e.frf_deviation.median,
                100.0 * e.frf_deviation.max
            ),
            format!("{} / {}", percent(&e.odd_distortion), percent(&e.even_distortion)),
            format!("{:.1}", e.condition[0]),
        ]);
    }
    table.text()
}
