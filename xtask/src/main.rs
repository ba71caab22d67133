//! `cargo xtask`: the reproduction of the paper, and the measured bundles.

mod bench;
mod blind;
mod bundle_page;
mod check;
mod diagnosed;
mod dist;
mod effects;
mod experiment;
mod figures;
mod fuzz;
mod identification;
mod measured;
mod measured_page;
mod memory;
mod ordinary;
mod page;
mod reproduce;
mod size;
mod small;
mod small_page;
mod time;
mod trust;

use clap::{Parser, Subcommand};
use std::path::PathBuf;
use std::process::ExitCode;

/// The project's own tasks.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Arguments {
    #[command(subcommand)]
    command: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Reproduce the paper: plant, experiments, FRF, poles, basis, LPV-OBF model, LFR, validation, one report.
    #[command(after_help = "Example:\n  cargo xtask reproduce --quick --check")]
    Reproduce(Reproduce),
    /// Identify the measured bundles of ../shared/data with default settings, and write the table of docs/measured-data.md.
    #[command(after_help = "Example:\n  cargo xtask measured")]
    Measured(Pages),
    /// Fit small LFRs to the experiments of the paper and to three other machines, and write docs/small-lfr.md.
    #[command(after_help = "Example:\n  cargo xtask small")]
    Small(Small),
    /// Hide effects in random machines, diagnose their bundles, and write docs/blind.md.
    #[command(after_help = "Example:\n  cargo xtask blind --quick")]
    Blind(Blind),
    /// Hide every effect of the catalogue in the default machine, and write docs/effects.md with a picture of each.
    #[command(after_help = "Example:\n  cargo xtask effects")]
    Effects(Effects),
    /// Make inputs of every kind that has misled the program, hold what it says against the truth, and write docs/trust.md.
    #[command(after_help = "Example:\n  cargo xtask trust --quick")]
    Trust(trust::Options),
    /// Many modes and many channels at one position, with known truth, and docs/ordinary-machines.md.
    #[command(after_help = "Example:\n  cargo xtask ordinary --quick")]
    Ordinary(ordinary::Options),
    /// Fuzz every reader of files, with coverage counters: no panic, no input over 5 s, no memory over 1 GiB.
    #[command(after_help = "Example:\n  cargo xtask fuzz --seconds 60 --only npz,csv")]
    Fuzz(fuzz::Fuzz),
    /// Pack the program for a release, as `cargo binstall` fetches it, and run it from the archive.
    #[command(after_help = "Example:\n  cargo xtask dist")]
    Dist(Dist),
    /// Count the instructions of the hot kernels under valgrind.
    #[command(after_help = "Example:\n  cargo xtask bench --check")]
    Bench(Bench),
    /// Compare the hot kernels with scipy, numpy, python-control and scikit-rf, and write docs/performance.md.
    #[command(after_help = "Example:\n  cargo xtask peers --only frf,response")]
    Peers(Passed),
    /// Measure how near the hot kernels are to the machine's limits and how they grow, and write docs/limits.md.
    #[command(after_help = "Example:\n  cargo xtask limits")]
    Limits(Passed),
}

/// Options of a program of the benches.
#[derive(clap::Args)]
#[command(disable_help_flag = true)]
struct Passed {
    /// Its options; `--help` tells them.
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    options: Vec<String>,
}

/// Options of the bench of hidden effects.
#[derive(clap::Args)]
pub(crate) struct Blind {
    /// Write the page and the figures to docs/ too.
    #[arg(long)]
    bless: bool,
    /// About a minute, with bars of its own: fails where they are missed.
    #[arg(long, conflicts_with_all = ["bless", "seeds", "only", "severities", "minutes"])]
    quick: bool,
    /// Machines by effect and severity; clean machines are twenty times, pairs ten times as many; of servo axes clean ones are ten times as
    /// many, and there are no pairs.
    #[arg(long, default_value_t = 10)]
    seeds: u64,
    /// Start no new machine after so many minutes.
    #[arg(long, default_value_t = 1e6)]
    minutes: f64,
    /// These effects only; also `clean`, `pairs`.
    #[arg(long, value_delimiter = ',')]
    only: Vec<String>,
    /// These deviations over the noise only.
    #[arg(long, value_delimiter = ',')]
    severities: Vec<f64>,
    /// Servo axes without their controller instead of tables, and docs/blind-servo.md.
    #[arg(long, conflicts_with = "lfr")]
    servo: bool,
    /// Also with a small LFR as the base, identified from the machine before something was hidden in it.
    #[arg(long)]
    lfr: bool,
    /// Seed of every random number.
    #[arg(long, default_value_t = 2011)]
    seed: u64,
    /// Take the machines that an earlier run of the same program, with this seed and output, left in its log as they are.
    #[arg(long, conflicts_with = "quick")]
    resume: bool,
    /// Also keep the bundle of each servo axis, in a folder by its seed.
    #[arg(long, value_name = "FOLDER", requires = "servo")]
    keep: Option<PathBuf>,
    /// Where the results go.
    #[arg(long, value_name = "FOLDER", default_value = "target/blind")]
    output: PathBuf,
}

/// Options of the instruction counts.
#[derive(clap::Args)]
pub(crate) struct Bench {
    /// Fail where a count differs from the kept one by more than 10 %, or grows faster than the work.
    #[arg(long)]
    check: bool,
    /// Fail where a count grows faster than the work; in the profile of the tests.
    #[arg(long, conflicts_with_all = ["check", "bless"])]
    growth: bool,
    /// Keep the counts in docs/.
    #[arg(long, conflicts_with = "check")]
    bless: bool,
}

/// Options of the page of effects.
#[derive(clap::Args)]
pub(crate) struct Effects {
    /// Write the page to docs/ instead of the output folder.
    #[arg(long)]
    bless: bool,
    /// Where the results go.
    #[arg(long, value_name = "FOLDER", default_value = "target/effects")]
    output: PathBuf,
}

/// Options of the release.
#[derive(clap::Args)]
pub(crate) struct Dist {
    /// A program that is built already, as it goes out.
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,
    /// Where the archive goes.
    #[arg(long, value_name = "FOLDER", default_value = "target/dist")]
    output: PathBuf,
}

/// Options of the small LFRs.
#[derive(clap::Args)]
pub(crate) struct Small {
    /// Write the page and the figures to docs/ instead of the output folder.
    #[arg(long)]
    bless: bool,
    /// Shorter experiments and fewer seeds, same code.
    #[arg(long, conflicts_with = "bless")]
    quick: bool,
    /// Seed of the experiments.
    #[arg(long, default_value_t = 2011)]
    seed: u64,
    /// Where the results go.
    #[arg(long, value_name = "FOLDER", default_value = "target/small")]
    output: PathBuf,
}

/// Options of the measured bundles.
#[derive(clap::Args)]
pub(crate) struct Pages {
    /// Write the page to docs/ instead of the output folder.
    #[arg(long)]
    bless: bool,
    /// Where the results go.
    #[arg(long, value_name = "FOLDER", default_value = "target/measured")]
    output: PathBuf,
}

/// Options of the reproduction.
#[derive(clap::Args)]
pub(crate) struct Reproduce {
    /// Fewer positions and shorter records, same code.
    #[arg(long)]
    quick: bool,
    /// Compare the figures with the committed ones, and fail where a tolerance is left.
    #[arg(long)]
    check: bool,
    /// Write the figures to docs/, as the ones to compare with.
    #[arg(long, conflicts_with = "check")]
    bless: bool,
    /// Seed of every random number.
    #[arg(long, default_value_t = 2011)]
    seed: u64,
    /// Where the results go.
    #[arg(long, value_name = "FOLDER", default_value = "target/reproduce")]
    output: PathBuf,
}

/// What can go wrong in a task: the crates' errors, or the file system's.
pub(crate) type TaskError = Box<dyn std::error::Error + Send + Sync>;

fn main() -> ExitCode {
    lpv_core::keep_freed_memory();
    let done = match Arguments::parse().command {
        Task::Reproduce(options) => reproduce::run(&options),
        Task::Measured(options) => run_measured(&options).map(|()| true),
        Task::Small(options) => run_small(&options).map(|()| true),
        Task::Blind(options) if options.servo => blind::servo::run(&options),
        Task::Blind(options) => run_blind(&options),
        Task::Trust(options) => trust::run(&options),
        Task::Ordinary(options) => ordinary::run(&options),
        Task::Fuzz(options) => fuzz::run(&options),
        Task::Bench(options) => run_instructions(&options),
        Task::Effects(options) => {
            let folder = if options.bless {
                root().join("docs")
            } else {
                options.output
            };
            effects::write(&folder).map(|()| true)
        }
        Task::Dist(options) => dist::run(&options),
        Task::Peers(passed) => run_peers(&passed.options),
        Task::Limits(passed) => run_bench("limits", &passed.options),
    };
    match done {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(1)
        }
    }
}

/// Builds and runs a program of the benches: they depend on the kernels only.
fn run_bench(name: &str, options: &[String]) -> Result<bool, TaskError> {
    let status = std::process::Command::new("cargo")
        .args([
            "run",
            "--quiet",
            "--release",
            "--package",
            "lpv-benches",
            "--bin",
            name,
            "--",
        ])
        .args(options)
        .current_dir(root())
        .status()?;
    Ok(status.success())
}

/// The whole reproduction, too, is compared: it is this program.
fn run_peers(options: &[String]) -> Result<bool, TaskError> {
    let own = std::env::current_exe()?.display().to_string();
    run_bench("peers", &[options, &["--xtask".to_owned(), own]].concat())
}

fn run_measured(options: &Pages) -> Result<(), TaskError> {
    let data = root().join("../shared/data");
    if !data.exists() {
        println!("skipped: there is no ../shared/data beside the project");
        return Ok(());
    }
    let found = measured::run()?;
    let docs = root().join("docs");
    let folder = if options.bless { &docs } else { &options.output };
    std::fs::create_dir_all(folder.join("images"))?;
    for one in &found.diagnosed {
        bundle_page::write(one, folder)?;
    }
    let page = folder.join("measured-data.md");
    std::fs::write(&page, measured_page::page(&found))?;
    if let Some(svg) = measured_page::distortion_figure(&found)? {
        std::fs::write(folder.join("images/two-mass-distortion.svg"), svg)?;
    }
    std::fs::create_dir_all(&options.output)?;
    reproduce::write_json(&options.output.join("measured.json"), &found)?;
    println!("page: {}", page.display());
    Ok(())
}

fn run_small(options: &Small) -> Result<(), TaskError> {
    let size = if options.quick {
        size::Size::quick()
    } else {
        size::Size::full()
    };
    let found = small::run(size, options.seed)?;
    let metrics = serde_json::json!({ "lfr_small": found, "seed": options.seed });
    let docs = root().join("docs");
    let (pages, figures) = if options.bless {
        (&docs, docs.join("metrics/small.json"))
    } else {
        (&options.output, options.output.join("metrics.json"))
    };
    std::fs::create_dir_all(pages)?;
    reproduce::write_json(&figures, &metrics)?;
    let page = pages.join("small-lfr.md");
    std::fs::write(&page, small_page::page(&metrics))?;
    println!("page: {}", page.display());
    Ok(())
}

fn run_instructions(options: &Bench) -> Result<bool, TaskError> {
    // The growth is the same without optimisation: what has been built with this program serves.
    let profile = match options.growth && cfg!(debug_assertions) {
        true => "test",
        false => "bench",
    };
    let Some(counts) = bench::count(profile)? else {
        return Ok(true);
    };
    let docs = root().join("docs");
    let kept = docs.join("metrics/instructions.json");
    let mut wrong = Vec::new();
    if options.bless {
        reproduce::write_json(&kept, &counts)?;
        std::fs::write(docs.join("instructions.md"), bench::page(&counts))?;
    } else if options.check {
        wrong = bench::changed(&counts, &kept)?;
    } else {
        counts
            .iter()
            .for_each(|(name, count)| println!("{name}: {count}"));
    }
    wrong.extend(bench::growth(&counts));
    wrong.iter().for_each(|w| println!("{w}"));
    Ok(wrong.is_empty() || !(options.check || options.growth))
}

fn run_blind(options: &Blind) -> Result<bool, TaskError> {
    let extent = if options.quick {
        blind::Extent::quick()
    } else {
        blind::Extent::of(options, [20, 10])
    };
    std::fs::create_dir_all(&options.output)?;
    let log = options.output.join("cases.jsonl");
    let done = if options.resume {
        blind::logged(&log)?
    } else {
        Vec::new()
    };
    let (all, seconds) = blind::run(&extent, options.seed, &log, done)?;
    let metrics = blind::score(&all, seconds);
    let command = format!(
        "cargo xtask blind --seeds {} --seed {}{}",
        options.seeds,
        options.seed,
        if options.lfr { " --lfr" } else { "" }
    );
    let asked = blind::count(&extent, options.seed);
    let page = blind::page(&metrics, &all, (&command, asked));
    blind::publish((&options.output, "blind"), &metrics, &page, options.bless)?;
    Ok(!options.quick || metrics.meets_quick_bars())
}

/// The root of the workspace.
pub(crate) fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..")
}
