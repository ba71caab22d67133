//! The models of a folder beside each other.

use super::{Subject, tone};
use crate::validation::{Band, ErrorFigure};
use crate::verdict::{Verdict, Worth, judged_run, number};
use lpv_report::{Axis, Block, Cell, Colour, Figure, Panel, Section, Series, Style, Table};

/// What is compared of a model.
pub(super) struct Row {
    name: String,
    kind: String,
    verdict: Option<Verdict>,
    bands: Vec<Band>,
    /// Error of the response, percent, the worst output.
    response: Option<f64>,
    /// The largest error in time.
    in_time: Option<ErrorFigure>,
}

impl Row {
    pub(super) fn of(name: &str, s: &Subject, verdict: Option<&Verdict>) -> Self {
        let frozen = s.validation.as_ref().and_then(|v| v.frozen.as_ref());
        let judged = s.validation.iter().flat_map(|v| {
            let outputs = v.records.iter().flat_map(|r| &r.outputs);
            outputs.map(|o| *judged_run(o, v.stability).1)
        });
        Self {
            name: name.to_owned(),
            kind: s.file.model.describe(),
            verdict: verdict.cloned(),
            bands: frozen.map_or(Vec::new(), |f| f.bands.clone()),
            response: frozen.map(|f| f.relative_rms_percent.iter().copied().fold(0.0, f64::max)),
            in_time: judged.max_by(|a, b| b.fit_percent.total_cmp(&a.fit_percent)),
        }
    }

    /// The verdict without its reasons.
    fn in_short(&self) -> String {
        let sentence = self.verdict.as_ref().map(|v| v.sentence.as_str());
        let first = sentence.and_then(|s| s.split(':').next());
        first.unwrap_or("not judged").to_owned()
    }

    fn rank(&self) -> usize {
        match self.verdict.as_ref().map(|v| v.worth) {
            Some(Worth::Good) => 0,
            Some(Worth::GoodUpTo { .. }) => 1,
            Some(Worth::GoodAtRest) => 2,
            Some(Worth::Approximate) => 3,
            Some(Worth::NotAModel) => 5,
            Some(Worth::ContradictoryData) => 6,
            Some(Worth::Unjudged) | None => 4,
        }
    }
}

/// The verdict of the best model, in short those of the others, and the error of each over frequency where responses were measured.
pub(super) fn lead(rows: &[Row]) -> Vec<Block> {
    /// Models that are told; the table has all.
    const TOLD: usize = 4;
    let mut ranked: Vec<&Row> = rows.iter().collect();
    ranked.sort_by_key(|r| r.rank());
    let Some((best, others)) = ranked.split_first() else {
        return Vec::new();
    };
    let judgement = best.verdict.as_ref().map(|verdict| {
        Block::Judgement(
            tone(verdict.worth),
            format!("{}: {}", best.name, verdict.sentence.replace('`', "")),
        )
    });
    let told = others.iter().take(TOLD);
    let mut told: Vec<String> = told.map(|r| format!("{}: {}", r.name, r.in_short())).collect();
    if others.len() > TOLD {
        told.push(format!("{} others in the table", others.len() - TOLD));
    }
    let others = (!told.is_empty()).then(|| Block::Aside(told.join(" \u{b7} ")));
    judgement
        .into_iter()
        .chain(others)
        .chain(figure(rows).map(|f| Block::Figure(Box::new(f))))
        .collect()
}

/// The table of all models.
pub(super) fn section(rows: &[Row]) -> Section {
    let mut table = Table::new(
        "Errors in percent of the response, of the motion along a record, and in multiples of the noise; the worst output.",
        [
            "model",
            "kind",
            "response, %",
            "in time, %",
            "over the noise",
            "verdict",
        ],
    );
    for row in rows {
        let cell = |value: Option<String>| Cell::text(value.unwrap_or_else(|| "-".to_owned()));
        table = table.row([
            Cell::text(row.name.clone()),
            Cell::text(row.kind.clone()),
            cell(row.response.map(number)),
            cell(row.in_time.map(|e| number(100.0 - e.fit_percent))),
            cell(row.in_time.and_then(|e| e.over_noise).map(|n| format!("{n:.2}"))),
            Cell::text(row.in_short()),
        ]);
    }
    Section::new("Models beside each other").table(table)
}

fn figure(rows: &[Row]) -> Option<Figure> {
    let along = |bands: &[Band], value: fn(&Band) -> f64| -> Vec<(f64, f64)> {
        bands
            .iter()
            .map(|b| ((b.low_hz * b.high_hz).sqrt(), value(b)))
            .collect()
    };
    let drawn: Vec<&Row> = rows.iter().filter(|r| !r.bands.is_empty()).collect();
    let mut panel = Panel::new(Axis::log("Frequency (Hz)"), Axis::log("Error (%)")).series(
        Series::new(along(&drawn.first()?.bands, |b| b.noise_percent), Style::Dashed)
            .label("noise of the responses")
            .colour(Colour::Bound),
    );
    for (n, row) in drawn.iter().enumerate() {
        let name = super::bode::plain(&row.name);
        panel = panel.series(
            Series::line(along(&row.bands, |b| b.error_percent))
                .label(name)
                .colour(Colour::Index(n)),
        );
    }
    Some(Figure::new("Models beside each other").panel(panel).caption(
        "Root of the power of the error over that of the response, band by band, all positions, the worst output.",
    ))
}
