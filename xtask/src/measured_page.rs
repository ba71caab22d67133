//! docs/measured-data.md: what the program does with data from elsewhere.

use crate::TaskError;
use crate::measured::{Case, Measured};
use lpv::inspect::ExperimentInfo;
use lpv_report::{Axis, Colour, Figure, Panel, Series, Style};
use std::fmt::Write as _;

/// A row: what, figure, bar with its verdict.
struct Row(String, String, String);

fn verdict(met: bool) -> &'static str {
    if met { "met" } else { "MISSED" }
}

fn at_most(value: f64, limit: f64, unit: &str) -> String {
    format!("at most {limit} {unit}: {}", verdict(value <= limit))
}

fn at_least(value: f64, limit: f64, unit: &str) -> String {
    format!("at least {limit} {unit}: {}", verdict(value >= limit))
}

fn within(value: f64, [low, high]: [f64; 2], unit: &str) -> String {
    format!(
        "{low} to {high} {unit}: {}",
        verdict((low..=high).contains(&value))
    )
}

fn table(rows: &[Row]) -> String {
    let mut out = String::from("| figure | measured | bar |\n|---|---|---|\n");
    for Row(what, value, bar) in rows {
        let _ = writeln!(out, "| {what} | {value} | {bar} |");
    }
    out
}

/// The whole page.
pub(crate) fn page(m: &Measured) -> String {
    let mut out = String::from(
        "# Measured data\n\n\
         Written by `cargo xtask measured --bless`; without `--bless` the same page goes to `target/measured`. Bundles from \
         `../shared/data` that are missing are skipped. All settings are the defaults, except where a command shows one; nothing is \
         tuned by hand.\n",
    );
    out += &m
        .machine_plain
        .as_ref()
        .map_or_else(|| missing("machine-plain"), machine_plain);
    out += &match (&m.two_mass_bench, m.two_mass_orders.is_empty()) {
        (Some(case), false) => two_mass(case, &m.two_mass_orders),
        _ => missing("two-mass-bench"),
    };
    out += &m
        .cd_player_arm
        .as_ref()
        .map_or_else(|| missing("cd-player-arm"), cd_player);
    out += &m.emps.as_ref().map_or_else(|| missing("emps"), emps);
    out += &crate::diagnosed::section(&m.diagnosed);
    out += &speed(m);
    out
}

fn missing(name: &str) -> String {
    format!("\n## {name}\n\nNot run: the bundle is not there.\n")
}

fn commands(lines: &[&str]) -> String {
    format!("```sh\n{}\n```\n\n", lines.join("\n"))
}

fn reasons(case: &Case) -> String {
    let mut out = String::from("\nWhat the program chose, in its own words:\n\n");
    for r in &case.summary.reasons {
        let _ = writeln!(out, "- {r}");
    }
    out
}

fn machine_plain(case: &Case) -> String {
    let mut out = String::from("\n## machine-plain: an xy-table from an independent simulator\n\n");
    out += &commands(&[
        "lpv inspect ../shared/data/machine-plain",
        "lpv identify ../shared/data/machine-plain -o model.json",
        "lpv validate model.json ../shared/data/machine-plain",
    ]);
    let mut rows = vec![Row("model".into(), case.summary.model.clone(), String::new())];
    if let Some(f) = &case.validation.frozen {
        rows.push(Row(
            "frozen error against the FRF, median over 9 positions and 614 lines".into(),
            format!("{:.1} dB", f.error.median_db),
            format!("noise of the FRF {:.1} dB", f.noise_db.unwrap_or(f64::NAN)),
        ));
        rows.push(Row(
            "the same over the noise of the FRF, median (nothing but noise: 0.83 for one channel, towards 1 for many)".into(),
            format!("{:.2}", f.error_over_noise.unwrap_or(f64::NAN)),
            String::new(),
        ));
    }
    if let Some(f) = &case.summary.frequency {
        rows.push(Row(
            "cost of the fits at the positions over its expectation".into(),
            format!("{:.2}", f.cost_over_expected),
            "1: nothing but noise and what the basis leaves out".into(),
        ));
        let modes: Vec<String> = f
            .modes
            .iter()
            .map(|[hz, d]| format!("{hz:.4} (damping {d:.4})"))
            .collect();
        rows.push(Row("modes at p = 0, Hz".into(), modes.join(", "), String::new()));
    }
    let noise: Vec<String> = case.inspection.noise.iter().map(|n| format!("{n:.2e}")).collect();
    rows.push(Row(
        "noise of one sample as it leaves the closed loop, y1 (m), y2 (rad)".into(),
        noise.join(", "),
        "sensor noise 3.3e-8, 1.7e-6".into(),
    ));
    out += &table(&rows);
    out += "\nErrors on the moves, root mean square as multiples of that noise. Along a fast move such a machine is unstable in open loop \
            (its stiffness is modulated near twice a mode), and the least difference grows; prediction and closed loop judge the model there.\n\n\
            | record | use | output | one step | open loop | closed loop |\n|---|---|---|---|---|---|\n";
    for r in &case.validation.records {
        for o in &r.outputs {
            let over = |v: Option<f64>| v.map_or("-".into(), |v| format!("{v:.1}"));
            let _ = writeln!(
                out,
                "| {} | {} | {} | {} | {} | {} |",
                r.name,
                r.purpose,
                o.name,
                over(o.one_step.and_then(|e| e.over_noise)),
                over(o.open_loop.over_noise),
                over(o.closed_loop.and_then(|c| c.over_noise))
            );
        }
    }
    out + &reasons(case)
}

fn two_mass(case: &Case, orders: &[(usize, Vec<f64>)]) -> String {
    let mut out = String::from("\n## two-mass-bench: motor, flexible coupling, load; measured\n\n");
    out += &commands(&[
        "lpv inspect ../shared/data/two-mass-bench",
        "lpv identify ../shared/data/two-mass-bench -o model.json",
        "lpv inspect ../shared/data/two-mass-bench --lines > lines.csv",
    ]);
    let mut rows = Vec::new();
    if let Some(f) = &case.summary.frequency {
        rows.push(Row(
            "FRF noise, median, motor / load".into(),
            format!(
                "{:.2} / {:.2} %",
                f.frf_noise_by_output_percent[0], f.frf_noise_by_output_percent[1]
            ),
            "about 0.64 % (an independent estimate)".into(),
        ));
        if let Some(hz) = f.resonance_hz {
            rows.push(Row(
                "resonance".into(),
                format!("{hz:.2} Hz"),
                within(hz, [73.0, 76.0], "Hz"),
            ));
        }
        for (name, i, limit) in [("motor", 0, 9.97), ("load", 1, 8.98)] {
            let value = f.relative_rms_percent[i];
            rows.push(Row(
                format!(
                    "relative FRF error over 11 to 250 Hz, order {} chosen from the data, {name}",
                    f.order
                ),
                format!("{value:.2} %"),
                at_most(value, limit, "%"),
            ));
        }
    }
    out += &table(&rows);
    out += "\nThe record itself passes a phase of -90 degrees between its lines at 76 and 77 Hz, and its peak is the line at 77 Hz; \
            that is why no fit puts the resonance below 76 Hz.\n\nWhat a fit of free order reaches (`order = ...` in the configuration):\n\n\
            | order | motor, % | load, % |\n|---|---|---|\n";
    for (order, errors) in orders {
        let _ = writeln!(out, "| {order} | {:.2} | {:.2} |", errors[0], errors[1]);
    }
    if let Some(e) = case
        .inspection
        .experiments
        .iter()
        .find(|e| !e.detection.is_empty())
    {
        out += &distortion(e);
    }
    out + &reasons(case)
}

fn distortion(e: &ExperimentInfo) -> String {
    let percent = |d: &Option<Vec<f64>>| {
        d.as_ref().map_or("-".into(), |d| {
            d.iter()
                .map(|v| format!("{:.2}", 100.0 * v))
                .collect::<Vec<_>>()
                .join(" / ")
        })
    };
    let mut out = format!(
        "\nNonlinear distortion in record {} (type B, odd random multisine with detection lines), relative to the output, motor / \
         load: odd {} %, even {} %, where the noise of the FRF is {:.2} %.\n\n![Levels at the detection \
         lines](images/two-mass-distortion.svg)\n\n<details><summary>Levels by line, in rad, noise of the level in \
         brackets</summary>\n\n\
         | frequency, Hz | parity | motor | load |\n|---|---|---|---|\n",
        e.records.join(", "),
        percent(&e.odd_distortion),
        percent(&e.even_distortion),
        100.0 * e.frf_deviation.median
    );
    for d in &e.detection {
        let level = |i: usize| format!("{:.2e} ({:.1e})", d.level[i], d.noise[i]);
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} |",
            d.frequency_hz,
            d.parity,
            level(0),
            level(1)
        );
    }
    out + "\n</details>\n"
}

/// Levels at the detection lines of two-mass-bench.
pub(crate) fn distortion_figure(m: &Measured) -> Result<Option<String>, TaskError> {
    let found = m
        .two_mass_bench
        .as_ref()
        .and_then(|c| c.inspection.experiments.iter().find(|e| !e.detection.is_empty()));
    let Some(e) = found else { return Ok(None) };
    let mut figure = Figure::new("").columns(2);
    for (i, name) in ["Motor angle", "Load angle"].into_iter().enumerate() {
        let points = |parity: &str| -> Vec<(f64, f64)> {
            e.detection
                .iter()
                .filter(|d| d.parity == parity)
                .map(|d| (d.frequency_hz, d.level[i]))
                .collect()
        };
        let noise = e.detection.iter().map(|d| (d.frequency_hz, d.noise[i])).collect();
        figure = figure.panel(
            Panel::new(Axis::log("Frequency (Hz)"), Axis::log("Level (rad)"))
                .title(name)
                .series(
                    Series::new(noise, Style::Dots)
                        .label("noise")
                        .colour(Colour::Bound),
                )
                .series(
                    Series::new(points("even"), Style::Dots)
                        .label("even lines")
                        .colour(Colour::Index(0)),
                )
                .series(
                    Series::new(points("odd"), Style::Dots)
                        .label("odd lines")
                        .colour(Colour::Index(1)),
                ),
        );
    }
    Ok(Some(figure.to_svg()?))
}

fn cd_player(case: &Case) -> String {
    let mut out = String::from("\n## cd-player-arm: two actuators, two tracking outputs; measured\n\n");
    out += &commands(&["lpv identify ../shared/data/cd-player-arm --hold-out 0.5 -o model.json"]);
    let Some(time) = &case.summary.time else {
        return out;
    };
    let mut rows = Vec::new();
    if let Some(h) = &time.held_out {
        for (i, limit) in [(0, 68.0), (1, 66.0)] {
            let value = h.simulated_fit_percent[i];
            rows.push(Row(
                format!(
                    "simulated fit of y{} on the second half, fitted on the first",
                    i + 1
                ),
                format!("{value:.1} %"),
                at_least(value, limit, "%"),
            ));
        }
        rows.push(Row(
            "one-step fit on the second half".into(),
            format!(
                "{:.1} / {:.1} %",
                h.one_step_fit_percent[0], h.one_step_fit_percent[1]
            ),
            "ARX of order 8, an independent fit: 94.4 / 93.6 %".into(),
        ));
    }
    rows.push(Row(
        "states, chosen from the first half".into(),
        time.states.to_string(),
        String::new(),
    ));
    out += &table(&rows);
    out += "\nFits of the first half by order, and the cost that the choice expects on other data:\n\n\
            | states | simulated, % | one step, % | expected cost |\n|---|---|---|---|\n";
    for o in &time.orders {
        let pair = |v: &[f64]| {
            v.iter()
                .map(|x| format!("{x:.1}"))
                .collect::<Vec<_>>()
                .join(" / ")
        };
        let _ = writeln!(
            out,
            "| {} | {} | {} | {} |",
            o.order,
            pair(&o.simulated_fit_percent),
            pair(&o.one_step_fit_percent),
            o.expected_cost.map_or("-".into(), |c| format!("{c:.4}"))
        );
    }
    out + &reasons(case)
}

fn emps(case: &Case) -> String {
    let mut out = String::from("\n## emps: ball-screw axis; measured\n\n");
    out += &commands(&[
        "lpv identify ../shared/data/emps --structure rigid-body -o model.json",
        "lpv validate model.json ../shared/data/emps --all",
    ]);
    let mut rows = Vec::new();
    for a in &case.summary.axes {
        let value = |[v, s]: [f64; 2]| format!("{v:.3} (standard deviation {s:.2})");
        rows.push(Row(
            "mass, kg".into(),
            value(a.inertia),
            "95.11 with friction in the model (published)".into(),
        ));
        rows.push(Row(
            "viscous friction, N s/m".into(),
            value(a.viscous),
            "203.5 with friction in the model".into(),
        ));
        rows.push(Row(
            "offset, N".into(),
            value(a.offset),
            "-3.165 with friction in the model".into(),
        ));
    }
    out += &table(&rows);
    out += "\nThe linear axis has no Coulomb friction, so its viscous friction takes over part of it; the errors below are what that \
            costs. Errors are relative norms in percent.\n\n\
            | record | force, inverse dynamics | velocity, open loop | position rms, open loop, mm | closed loop: position | velocity | force |\n\
            |---|---|---|---|---|---|---|\n";
    for r in &case.validation.records {
        for (a, o) in r.axes.iter().zip(&r.outputs) {
            let closed = a
                .closed_loop
                .as_ref()
                .map_or(["-".to_owned(), "-".into(), "-".into()], |c| {
                    [
                        format!("{:.5}", c.position_percent),
                        format!("{:.4}", c.velocity_percent),
                        format!("{:.3}", c.force_percent),
                    ]
                });
            let _ = writeln!(
                out,
                "| {} ({}) | {:.2} | {:.2} | {:.2} | {} |",
                r.name,
                r.purpose,
                a.force_percent,
                a.open_loop_velocity_percent,
                1e3 * o.open_loop.rms,
                closed.join(" | ")
            );
        }
    }
    out += "\nPublished with symmetric Coulomb friction: force of the inverse dynamics 4.083 %, on the pulse record 5.982 %; closed loop \
            0.01375 / 0.2291 / 5.848 %, pulses 0.00802 / 0.4789 / 8.941 %.\n";
    out + &reasons(case)
}

fn speed(m: &Measured) -> String {
    let mut rows = vec![Row(
        "CSV reader on one core, seven columns of doubles with all digits".into(),
        format!("{:.0} MB/s", m.csv_mb_per_second),
        at_least(m.csv_mb_per_second, 150.0, "MB/s"),
    )];
    if let Some(case) = &m.machine_plain {
        rows.push(Row(
            "`inspect` on machine-plain".into(),
            format!("{:.2} s", case.inspect_seconds),
            at_most(case.inspect_seconds, 1.0, "s"),
        ));
        rows.push(Row(
            "`identify` on machine-plain".into(),
            format!("{:.2} s", case.identify_seconds),
            at_most(case.identify_seconds, 5.0, "s"),
        ));
    }
    format!("\n## Speed\n\nTwo cores, a shared machine.\n\n{}", table(&rows))
}
