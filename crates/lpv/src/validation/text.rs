//! The validation in words.

use super::{ErrorFigure, RecordCheck, Validation};
use crate::table::TextTable;
use lpv_core::counted;
use std::fmt::Write as _;

impl Validation {
    /// For a person.
    pub fn text(&self) -> String {
        let mut out = format!("{}\n{}\n", self.verdict.sentence, self.model);
        if let Some(f) = &self.frozen {
            let rms: Vec<String> = f
                .relative_rms_percent
                .iter()
                .map(|e| format!("{e:.2} %"))
                .collect();
            let _ = writeln!(
                out,
                "frozen response against the {} records, {}: median error {:.1} dB ({}), \
                 largest {:.1} dB at {:.4}{}; rms by output {}",
                f.source,
                counted(f.positions.len().max(1), "position"),
                f.error.median_db,
                f.noise_db
                    .map_or("its noise is not stated".to_owned(), |n| format!(
                        "noise of the response {n:.1} dB"
                    )),
                f.error.strict_max_db,
                f.error.worst_frequency_hz,
                f.error_over_noise.map_or(String::new(), |n| format!(
                    "; error over its noise {n:.2} in the median"
                )),
                rms.join(", ")
            );
        }
        if !self.records.is_empty() {
            let mut table = TextTable::new(&[
                "record",
                "use",
                "output",
                "one step",
                "open loop",
                "closed loop",
                "start",
            ]);
            for r in &self.records {
                for o in &r.outputs {
                    table.row(vec![
                        r.name.clone(),
                        r.purpose.to_owned(),
                        if o.unit.is_empty() {
                            o.name.clone()
                        } else {
                            format!("{} [{}]", o.name, o.unit)
                        },
                        o.one_step.as_ref().map_or("-".to_owned(), figure),
                        figure(&o.open_loop),
                        o.closed_loop.as_ref().map_or(String::new(), figure),
                        r.start.to_owned(),
                    ]);
                }
            }
            let _ = writeln!(
                out,
                "errors in time: rms (times the noise of one sample; fit percent)\n{}",
                table.text().trim_end()
            );
        }
        for r in &self.records {
            out += &axes(r);
            out += &residuals(r);
        }
        for line in crate::finding::lines(&self.findings) {
            let _ = writeln!(out, "{line}");
        }
        for n in &self.notes {
            let _ = writeln!(out, "note: {n}");
        }
        out.truncate(out.trim_end().len());
        out
    }
}

fn figure(e: &ErrorFigure) -> String {
    let noise = e.over_noise.map_or(String::new(), |n| {
        if n < 1e5 {
            format!("{n:.2} x; ")
        } else {
            format!("{n:.1e} x; ")
        }
    });
    if !e.rms.is_finite() {
        return "diverges".to_owned();
    }
    // An unstable simulation leaves any scale.
    let fit = if e.fit_percent.abs() < 1e5 {
        format!("{:.2}", e.fit_percent)
    } else {
        format!("{:.1e}", e.fit_percent)
    };
    format!("{:.2e} ({noise}{fit} %)", e.rms)
}

fn axes(r: &RecordCheck) -> String {
    let mut out = String::new();
    for a in &r.axes {
        let _ = write!(
            out,
            "{}, axis {}: force of the inverse dynamics {:.2} %, velocity in open loop {:.2} %",
            r.name, a.input, a.force_percent, a.open_loop_velocity_percent
        );
        if let Some(c) = &a.closed_loop {
            let _ = write!(
                out,
                "; in closed loop position {:.5} %, velocity {:.4} %, force {:.3} %",
                c.position_percent, c.velocity_percent, c.force_percent
            );
        }
        out.push('\n');
    }
    out
}

fn residuals(r: &RecordCheck) -> String {
    let mut out = String::new();
    for w in &r.whiteness {
        let verdict = match (w.p_value > 0.01, w.is_white()) {
            (true, _) => "white",
            (false, true) => "nearly white",
            (false, false) => "not white",
        };
        let inputs: Vec<String> = r
            .cross_correlation
            .iter()
            .filter(|c| c.output == w.output)
            .map(|c| {
                let largest = c.correlation.iter().map(|v| v.abs()).fold(0.0, f64::max);
                format!("{} {:.1}", c.input, largest / c.bound_99)
            })
            .collect();
        let _ = writeln!(
            out,
            "{}, one-step residual of {}: {verdict} (its past predicts {:.0} % of its power, the inputs {:.0} %; p {}, {:.0} % of the lags \
             beyond the 99 % bound); largest correlation with inputs over its 99 % bound: {}",
            r.name,
            w.output,
            100.0 * w.predictable,
            100.0 * w.by_inputs,
            probability(w.p_value),
            100.0 * w.outside,
            inputs.join(", ")
        );
    }
    out
}

fn probability(p: f64) -> String {
    const SMALL: f64 = 1e-12;
    if p < SMALL {
        format!("< {SMALL:e}")
    } else {
        format!("= {p:.2}")
    }
}
