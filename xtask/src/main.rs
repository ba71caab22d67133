//! `cargo xtask`: the reproduction of the paper, and the measured bundles.

mod check;
mod experiment;
mod figures;
mod identification;
mod measured;
mod measured_page;
mod page;
mod reproduce;
mod size;
mod time;

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
    Measured(Measured),
}

/// Options of the measured bundles.
#[derive(clap::Args)]
pub(crate) struct Measured {
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
    let done = match Arguments::parse().command {
        Task::Reproduce(options) => reproduce::run(&options),
        Task::Measured(options) => run_measured(&options).map(|()| true),
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

fn run_measured(options: &Measured) -> Result<(), TaskError> {
    let data = root().join("../shared/data");
    if !data.exists() {
        println!("skipped: there is no ../shared/data beside the project");
        return Ok(());
    }
    let found = measured::run()?;
    let docs = root().join("docs");
    let folder = if options.bless { &docs } else { &options.output };
    std::fs::create_dir_all(folder.join("images"))?;
    let page = folder.join("measured-data.md");
    std::fs::write(&page, measured_page::page(&found))?;
    if let Some(svg) = measured_page::distortion_figure(&found)? {
        std::fs::write(folder.join("images/two-mass-distortion.svg"), svg)?;
    }
    std::fs::create_dir_all(&options.output)?;
    reproduce::write_json(
        &options.output.join("measured.json"),
        &serde_json::to_value(&found)?,
    )?;
    println!("page: {}", page.display());
    Ok(())
}

/// The root of the workspace.
pub(crate) fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..")
}
