//! One command from the plant to the report.

use crate::experiment::Bench;
use crate::identification::{ObfError, TestGrid};
use crate::size::Size;
use crate::{Reproduce, TaskError, check, figures, identification, measured, memory, page, time};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use serde_json::{Value, json};
use std::path::Path;
use std::time::Instant;

/// Runs everything; false where a committed figure is missed.
pub(crate) fn run(options: &Reproduce) -> Result<bool, TaskError> {
    let start = Instant::now();
    let size = if options.quick {
        Size::quick()
    } else {
        Size::full()
    };
    let bar = ProgressBar::new(size.positions as u64).with_style(ProgressStyle::with_template(
        "{msg:28} {bar:30} {pos}/{len}  {elapsed}",
    )?);
    let mut clock = Stopwatch::new(start);

    bar.set_message("experiments and FRF");
    let bench = Bench::new(size, options.seed)?;
    let measured_frf = bench.run(&bar)?;
    clock.lap("experiments_frf");
    bar.set_length(7);
    bar.set_position(0);
    let step = |message: &'static str| {
        bar.inc(1);
        bar.set_message(message);
    };
    step("poles");
    let (found, truth) = rayon::join(
        || identification::poles(&bench, &measured_frf.estimates),
        || Ok::<_, TaskError>((identification::continuum(&bench)?, TestGrid::new(&bench)?)),
    );
    let ((pole_stage, poles), (continuum, grid)) = (found?, truth?);
    clock.lap("poles");
    step("basis, Table I");
    let table_one = identification::table_one(&bench, &pole_stage, &continuum)?;
    clock.lap("basis");
    step("LPV-OBF models");
    let obf = identification::obf(&bench, &pole_stage, &measured_frf.estimates, &grid)?;
    clock.lap("obf");
    step("LFR");
    let (realization, lfr) = identification::lfr(&obf, &grid)?;
    clock.lap("lfr");
    step("time domain");
    let in_time = time::validate(&bench, &realization.lfr)?;
    clock.lap("time");
    step("measured bundles");
    let machine_plain = measured::summary("machine-plain")?;
    let two_mass_bench = measured::summary("two-mass-bench")?;
    clock.lap("bundles");
    step("report");

    let mut metrics = json!({
        "size": bench.size.name,
        "seed": options.seed,
        "samples_simulated": bench.samples(),
        "frf": measured_frf.account,
        "poles": poles,
        "table1": by_functions(&table_one)?,
        "obf": obf.account,
        "obf_table": obf.table,
        "lfr": lfr,
        "time": in_time.account,
        "machine_plain": machine_plain,
        "two_mass_bench": two_mass_bench,
    });
    let pictures = figures::all(
        &bench,
        &measured_frf,
        &pole_stage,
        &obf,
        &grid,
        &in_time,
        &continuum,
    )?;
    std::fs::create_dir_all(&options.output)?;
    for (name, figure) in &pictures {
        std::fs::write(options.output.join(format!("{name}.svg")), figure.to_svg()?)?;
        std::fs::write(options.output.join(format!("{name}.png")), figure.to_png(1200)?)?;
    }
    clock.lap("figures");
    metrics["stage_seconds"] = json!(clock.laps);
    metrics["wall_seconds"] = json!(start.elapsed().as_secs_f64());
    metrics["peak_rss_mib"] = json!(memory::peak_mib());
    let html = page::page(&metrics, &table_one, &obf, pictures)?.to_html()?;
    std::fs::write(options.output.join("report.html"), html)?;
    write_json(&options.output.join("metrics.json"), &metrics)?;
    bar.finish_and_clear();
    println!("{}", headline(&metrics, &obf.account.recommended));
    println!("report: {}", options.output.join("report.html").display());

    if options.bless {
        check::bless(&metrics)?;
    }
    if options.check {
        check::check(&metrics)
    } else {
        Ok(true)
    }
}

fn by_functions(columns: &[identification::TableColumn]) -> Result<Value, TaskError> {
    let mut table = serde_json::Map::new();
    for c in columns {
        table.insert(c.functions.to_string(), serde_json::to_value(c)?);
    }
    Ok(Value::Object(table))
}

fn headline(metrics: &Value, obf: &ObfError) -> String {
    let number = |path: &str| metrics.pointer(path).and_then(Value::as_f64).unwrap_or(f64::NAN);
    format!(
        "{:.1} s, {:.0} MiB, {:.1} million samples\n\
         FRF: noise-free error {:.1e}, coverage of the 95 % region {:.4}\n\
         poles: worst {:.5} % (paper 0.007 %)\n\
         LPV-OBF over [0.01, 3], n_g = {}, {}: strict {:.1} dB, median {:.1} dB; at positions {:.1} dB, between {:.1} dB\n\
         LFR: {} states, {} deltas, differs by {:.1e}\n\
         time, multiples of the noise (y1, y2): open loop {:.1}, {:.1}; closed loop {:.1}, {:.1}",
        number("/wall_seconds"),
        number("/peak_rss_mib"),
        number("/samples_simulated") / 1e6,
        number("/frf/noise_free_max_rel"),
        number("/frf/coverage95"),
        number("/poles/worst_abs_percent"),
        obf.functions,
        obf.interpolation,
        obf.band.strict_max_db,
        obf.band.median_db,
        obf.band.at_positions.strict_max_db,
        obf.band.between.strict_max_db,
        number("/lfr/states"),
        number("/lfr/deltas"),
        number("/lfr/direct_max_rel"),
        number("/time/open_loop_sweep_over_noise/0"),
        number("/time/open_loop_sweep_over_noise/1"),
        number("/time/closed_loop_over_noise/0"),
        number("/time/closed_loop_over_noise/1"),
    )
}

/// Seconds a stage took.
struct Stopwatch {
    last: Instant,
    laps: serde_json::Map<String, Value>,
}

impl Stopwatch {
    fn new(start: Instant) -> Self {
        Self {
            last: start,
            laps: serde_json::Map::new(),
        }
    }
    fn lap(&mut self, stage: &str) {
        let now = Instant::now();
        self.laps
            .insert(stage.to_owned(), json!((now - self.last).as_secs_f64()));
        self.last = now;
    }
}

pub(crate) fn write_json(file: &Path, value: &impl Serialize) -> Result<(), TaskError> {
    std::fs::write(file, serde_json::to_string_pretty(value)? + "\n")?;
    Ok(())
}
