//! The report, and the table of docs/reproduction.md: the same figures, from the same metrics.

use crate::TaskError;
use crate::figures::Pictures;
use crate::identification::{ObfStage, TableColumn};
use lpv_report::{Bar, Cell, Format, KeyFigure, Page, Section, Table};
use serde_json::Value;

/// A figure with its bar, as the report and the docs show it.
struct Row {
    path: &'static str,
    what: &'static str,
    bar: Option<Bar>,
    format: Format,
}

const fn row(path: &'static str, what: &'static str, bar: Option<Bar>, format: Format) -> Row {
    Row {
        path,
        what,
        bar,
        format,
    }
}

const ROWS: [Row; 33] = [
    row(
        "/wall_seconds",
        "whole run, s, two cores",
        Some(Bar::AtMost(30.0)),
        Format::Fixed(1),
    ),
    row(
        "/peak_rss_mib",
        "peak memory, MiB",
        Some(Bar::AtMost(200.0)),
        Format::Fixed(0),
    ),
    row(
        "/samples_simulated",
        "closed-loop samples",
        None,
        Format::Scientific(2),
    ),
    row(
        "/frf/noise_free_max_rel",
        "FRF, noise-free, largest relative error",
        Some(Bar::AtMost(1e-6)),
        Format::Scientific(1),
    ),
    row(
        "/frf/coverage95",
        "share of entries over all lines with the truth in the 95 % region, at least",
        Some(Bar::AtLeast(0.94)),
        Format::Fixed(4),
    ),
    row(
        "/frf/coverage95",
        "the same, at most",
        Some(Bar::AtMost(0.96)),
        Format::Fixed(4),
    ),
    row(
        "/frf/median_rel_modes",
        "FRF, median relative error over the modes",
        None,
        Format::Scientific(1),
    ),
    row(
        "/poles/worst_abs_percent",
        "worst absolute pole error, % (paper 0.007)",
        Some(Bar::AtMost(0.007)),
        Format::Fixed(5),
    ),
    row(
        "/poles/error_over_deviation",
        "pole error over its stated deviation",
        None,
        Format::Fixed(2),
    ),
    row(
        "/obf/band/strict_max_db",
        "LPV-OBF, n_g = 16, strict frozen error over [0.01, 3], dB",
        None,
        Format::Fixed(1),
    ),
    row(
        "/obf/band/median_db",
        "LPV-OBF, median frozen error over [0.01, 3], dB",
        None,
        Format::Fixed(1),
    ),
    row(
        "/obf/band/at_positions/strict_max_db",
        "strict, at positions, dB",
        None,
        Format::Fixed(2),
    ),
    row(
        "/obf/band/between/strict_max_db",
        "strict, between positions, dB (bar: within 1 dB)",
        None,
        Format::Fixed(2),
    ),
    row(
        "/obf/strict_max_db",
        "strict up to Nyquist, where the plant has a zero and the noise is larger, dB",
        None,
        Format::Fixed(1),
    ),
    row(
        "/obf/median_db",
        "median up to Nyquist, dB",
        None,
        Format::Fixed(1),
    ),
    row(
        "/obf/paper_polynomial/band/strict_max_db",
        "the paper's order-17 polynomial, strict over [0.01, 3], dB",
        None,
        Format::Fixed(1),
    ),
    row(
        "/obf/paper_polynomial/band/median_db",
        "the paper's order-17 polynomial, median over [0.01, 3], dB",
        None,
        Format::Fixed(1),
    ),
    row(
        "/obf/chebyshev/band/strict_max_db",
        "Chebyshev, order 17 (has an LFR), strict over [0.01, 3], dB",
        None,
        Format::Fixed(1),
    ),
    row(
        "/obf/noise_free/strict_max_db",
        "spline, noise-free, relative weights, strict up to Nyquist, dB",
        None,
        Format::Fixed(1),
    ),
    row(
        "/obf/noise_free/median_db",
        "the same, median, dB",
        None,
        Format::Fixed(1),
    ),
    row(
        "/lfr/direct_max_rel",
        "LFR against LPV-OBF, largest relative difference",
        Some(Bar::AtMost(1e-9)),
        Format::Scientific(1),
    ),
    row("/lfr/states", "LFR states", None, Format::Fixed(0)),
    row("/lfr/deltas", "LFR deltas", None, Format::Fixed(0)),
    row(
        "/time/open_loop_sweep_rms/0",
        "open loop on the sweep, y1, rms, m",
        None,
        Format::Scientific(2),
    ),
    row(
        "/time/open_loop_sweep_rms/1",
        "open loop on the sweep, y2, rms, rad",
        None,
        Format::Scientific(2),
    ),
    row(
        "/time/closed_loop_rms/0",
        "closed loop, y1, rms, m",
        None,
        Format::Scientific(2),
    ),
    row(
        "/time/closed_loop_rms/1",
        "closed loop, y2, rms, rad",
        None,
        Format::Scientific(2),
    ),
    row(
        "/time/closed_loop_over_noise/0",
        "closed loop, y1, multiples of the noise",
        None,
        Format::Fixed(1),
    ),
    row(
        "/time/closed_loop_over_noise/1",
        "closed loop, y2, multiples of the noise",
        None,
        Format::Fixed(1),
    ),
    row(
        "/time/closed_loop_constant_p/over_noise/0",
        "closed loop at constant p, y1, multiples of the noise",
        None,
        Format::Fixed(1),
    ),
    row(
        "/time/plant_open_loop/over_noise/0",
        "the plant's own model, frozen at each p: open loop, y1, multiples of the noise",
        None,
        Format::Fixed(1),
    ),
    row(
        "/time/plant_closed_loop/over_noise/0",
        "the plant's own model: closed loop, y1, multiples of the noise",
        None,
        Format::Fixed(1),
    ),
    row(
        "/time/plant_closed_loop/over_noise/1",
        "the plant's own model: closed loop, y2, multiples of the noise",
        None,
        Format::Fixed(1),
    ),
];

const MEASURED_ROWS: [Row; 12] = [
    row(
        "/machine_plain/frozen/strict_max_db",
        "machine-plain: frozen error against its FRF, strict, dB",
        None,
        Format::Fixed(1),
    ),
    row(
        "/machine_plain/frozen/median_db",
        "machine-plain: median, dB",
        None,
        Format::Fixed(1),
    ),
    row(
        "/machine_plain/frf_noise_db",
        "machine-plain: noise of the FRF, median, dB",
        None,
        Format::Fixed(1),
    ),
    row(
        "/machine_plain/modes/0/0",
        "machine-plain: first mode at the middle position",
        None,
        Format::Fixed(5),
    ),
    row(
        "/machine_plain/modes/1/0",
        "machine-plain: second mode at the middle position",
        None,
        Format::Fixed(5),
    ),
    row(
        "/two_mass_bench/frf_noise_percent",
        "two-mass-bench: noise of the FRF, both channels, median, %",
        None,
        Format::Fixed(2),
    ),
    row(
        "/two_mass_bench/frf_noise_by_output_percent/0",
        "two-mass-bench: the same, motor channel alone, %",
        None,
        Format::Fixed(2),
    ),
    row(
        "/two_mass_bench/resonance_hz",
        "two-mass-bench: resonance, Hz, at least",
        Some(Bar::AtLeast(73.0)),
        Format::Fixed(2),
    ),
    row(
        "/two_mass_bench/resonance_hz",
        "two-mass-bench: resonance, Hz, at most",
        Some(Bar::AtMost(76.0)),
        Format::Fixed(2),
    ),
    row(
        "/two_mass_bench/order",
        "two-mass-bench: order chosen",
        None,
        Format::Fixed(0),
    ),
    row(
        "/two_mass_bench/relative_rms_percent/0",
        "two-mass-bench: fit error of the motor channel, %",
        None,
        Format::Fixed(2),
    ),
    row(
        "/two_mass_bench/relative_rms_percent/1",
        "two-mass-bench: fit error of the load channel, %",
        None,
        Format::Fixed(2),
    ),
];

fn number(metrics: &Value, path: &str) -> Option<f64> {
    metrics.pointer(path).and_then(Value::as_f64)
}

pub(crate) fn page(
    metrics: &Value,
    table_one: &[TableColumn],
    obf: &ObfStage,
    pictures: Pictures,
) -> Result<Page, TaskError> {
    let value = |path| number(metrics, path).unwrap_or(f64::NAN);
    let key = |path, format, bar: Option<Bar>, label: &str| {
        let cell = Cell::number(value(path), format);
        KeyFigure::new(bar.map_or(cell.clone(), |b| cell.bar(b)), label)
    };
    let mut pictures: Vec<Option<lpv_report::Figure>> = pictures.into_iter().map(|(_, f)| Some(f)).collect();
    let mut picture = |i: usize| {
        pictures
            .get_mut(i)
            .and_then(Option::take)
            .ok_or("a figure is missing")
    };
    let page = Page::new("LPV identification of an xy-positioning table")
        .subtitle("From the first-principles plant through closed-loop experiments to a validated linear fractional model, after Tóth, van de Wal, Heuberger and Van den Hof (ACC 2011)")
        .fact("size", metrics["size"].as_str().unwrap_or(""))
        .fact("seed", metrics["seed"].to_string())
        .fact("samples", metrics["samples_simulated"].to_string())
        .section(
            Section::new("In short")
                .key_figures([
                    key("/poles/worst_abs_percent", Format::Fixed(5), Some(Bar::AtMost(0.007)), "worst pole error, % (paper 0.007)"),
                    key("/obf/band/strict_max_db", Format::Fixed(1), None, "strict frozen error over [0.01, 3], dB, n_{g} = 16"),
                    key("/obf/band/median_db", Format::Fixed(1), None, "median frozen error over [0.01, 3], dB"),
                    key("/poles/error_over_deviation", Format::Fixed(2), None, "pole error over its stated deviation"),
                    key("/time/closed_loop_over_noise/0", Format::Fixed(1), None, "closed-loop error of y_{1} over the noise"),
                    key("/wall_seconds", Format::Fixed(1), None, "seconds for everything"),
                ])
                .table(table("All figures and their bars", &ROWS, metrics)),
        )
        .section(Section::new("Plant").figure(picture(0)?).figure(picture(7)?))
        .section(Section::new("Frequency responses").figure(picture(1)?))
        .section(
            Section::new("Poles and basis")
                .figure(picture(2)?)
                .table(columns(table_one))
                .note("The n-width cost of a basis is 20 log10 of the largest product of pseudo-hyperbolic distances between a pole and the basis poles. Ours on the 21 estimated poles stays close to ours on the whole locus, since 21 points sample it densely. The paper's first column falls by about 65 dB for every four functions, which no worst case over 21 distinct poles of both modes does; it is printed beside ours without further claim."),
        )
        .section(
            Section::new("LPV-OBF model")
                .figure(picture(3)?)
                .figure(picture(4)?)
                .figure(picture(5)?)
                .table(errors(obf))
                .table(leave_one_out(obf))
                .note("Strict: the largest over frequency and position of the relative error in the Frobenius norm. Median: over the same lines and positions. The paper's reading of 40 dB between the response and the error is close to the median; near the anti-resonances the strict one is bounded by the n-width cost of the basis."),
        )
        .section(Section::new("Time domain").figure(picture(6)?).note("A model of frozen responses does not know how its states turn with p: closed-loop errors at constant p are much smaller than those along the sweep. The model here is the LFR of the Chebyshev interpolant. The plant's own model, frozen and sampled at each p, is the reference to compare with."))
        .section(Section::new("Bundles from elsewhere").paragraph("The same pipeline, default settings, on files that this workspace did not make. Rows without a number: the bundle was not there.").table(table("Bundles", &MEASURED_ROWS, metrics)))
        .section(Section::new("Again").code("cargo xtask reproduce\ncargo xtask reproduce --quick --check"));
    Ok(page)
}

fn table(caption: &str, rows: &[Row], metrics: &Value) -> Table {
    rows.iter()
        .fold(Table::new(caption, ["figure", "value"]), |table, r| {
            let cell = number(metrics, r.path).map_or(Cell::Empty, |v| {
                let cell = Cell::number(v, r.format);
                r.bar.map_or(cell.clone(), |b| cell.bar(b))
            });
            table.row([Cell::text(r.what), cell])
        })
}

fn columns(table_one: &[TableColumn]) -> Table {
    let head = [
        "n_{g}",
        "FKcM, true poles",
        "minimax, true poles",
        "paper, true poles",
        "FKcM, estimated poles",
        "paper, estimated poles",
        "alternation only, true poles",
    ];
    table_one.iter().fold(
        Table::new("Table I: n-width cost in dB, fuzziness 35", head),
        |table, c| {
            let db = |v| Cell::decibel(v, 2);
            table.row([
                Cell::count(c.functions),
                db(c.fkcm_true_db),
                db(c.minimax_true_db),
                db(c.paper_true_db),
                db(c.fkcm_grid_db),
                db(c.paper_grid_db),
                db(c.alternation_true_db),
            ])
        },
    )
}

fn errors(obf: &ObfStage) -> Table {
    let head = [
        "n_{g}",
        "interpolation",
        "strict, at positions",
        "strict, between",
        "median",
        "strict up to Nyquist",
        "median up to Nyquist",
    ];
    obf.table.iter().fold(
        Table::new(
            "What buys what: frozen error in dB, over [0.01, 3] where nothing else is said",
            head,
        ),
        |table, e| {
            let db = |v| Cell::decibel(v, 1);
            table.row([
                Cell::count(e.functions),
                Cell::text(e.interpolation.clone()),
                db(e.band.at_positions.strict_max_db),
                db(e.band.between.strict_max_db),
                db(e.band.median_db),
                db(e.strict_max_db),
                db(e.median_db),
            ])
        },
    )
}

fn leave_one_out(obf: &ObfStage) -> Table {
    let head = ["interpolation", "cost an equation", "worst position"];
    obf.leave_one_out.iter().fold(
        Table::new("Leave-one-out, n_g = 16: from the data alone", head),
        |table, e| {
            table.row([
                Cell::text(e.interpolation.name()),
                Cell::number(e.cost, Format::Scientific(2)),
                Cell::text(format!("{:.2}", e.worst.1)),
            ])
        },
    )
}

const BEGIN: &str = "<!-- figures: written by `cargo xtask reproduce --bless` -->";
const END: &str = "<!-- end of figures -->";

/// The text with the table between the marks renewed.
pub(crate) fn with_table(text: &str, metrics: &Value) -> Result<String, TaskError> {
    let (before, rest) = text
        .split_once(BEGIN)
        .ok_or("docs/reproduction.md has no mark for the figures")?;
    let (_, after) = rest
        .split_once(END)
        .ok_or("docs/reproduction.md has no mark for the end of the figures")?;
    let mut table = String::from("\n| key | figure | value | bar |\n|---|---|---|---|\n");
    for r in ROWS.iter().chain(&MEASURED_ROWS) {
        let value = number(metrics, r.path);
        let shown = value.map_or("not measured".to_owned(), |v| show(v, r.format));
        let bar = match (r.bar, value) {
            (Some(b), Some(v)) => {
                let (sign, limit) = match b {
                    Bar::AtMost(l) => ("at most", l),
                    Bar::AtLeast(l) => ("at least", l),
                };
                let met = if b.judge(v) == lpv_report::Verdict::Pass {
                    "met"
                } else {
                    "MISSED"
                };
                format!("{sign} {limit}: {met}")
            }
            _ => String::new(),
        };
        table += &format!(
            "| `{}` | {} | {shown} | {bar} |\n",
            r.path.trim_start_matches('/').replace('/', "."),
            r.what
        );
    }
    table += "\n| n_g | FKcM, true | minimax, true | paper, true | FKcM, estimated | paper, estimated |\n|---|---|---|---|---|---|\n";
    for functions in crate::size::TABLE_FUNCTIONS {
        let column = &metrics["table1"][functions.to_string()];
        let db = |key: &str| column[key].as_f64().map_or(String::new(), |v| format!("{v:.2}"));
        table += &format!(
            "| {functions} | {} | {} | {} | {} | {} |\n",
            db("fkcm_true_db"),
            db("minimax_true_db"),
            db("paper_true_db"),
            db("fkcm_grid_db"),
            db("paper_grid_db")
        );
    }
    table += "\n| n_g | interpolation | over [0.01, 3]: strict, at / between positions, dB | median, dB | up to Nyquist: strict / median, dB |\n|---|---|---|---|---|\n";
    for e in metrics["obf_table"].as_array().into_iter().flatten() {
        let db = |path: &str| {
            e.pointer(path)
                .and_then(Value::as_f64)
                .map_or(String::new(), |v| format!("{v:.1}"))
        };
        table += &format!(
            "| {} | {} | {} / {} | {} | {} / {} |\n",
            e["functions"],
            e["interpolation"].as_str().unwrap_or(""),
            db("/band/at_positions/strict_max_db"),
            db("/band/between/strict_max_db"),
            db("/band/median_db"),
            db("/strict_max_db"),
            db("/median_db")
        );
    }
    Ok(format!("{before}{BEGIN}{table}{END}{after}"))
}

fn show(value: f64, format: Format) -> String {
    match format {
        Format::Fixed(d) => format!("{value:.*}", usize::from(d)),
        Format::Scientific(d) => format!("{value:.*e}", usize::from(d)),
        Format::Significant(d) => format!("{value:.*}", usize::from(d)),
    }
}
