//! `cargo xtask`: the reproduction of the paper.

mod check;
mod experiment;
mod figures;
mod identification;
mod measured;
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
    let Arguments {
        command: Task::Reproduce(options),
    } = Arguments::parse();
    match reproduce::run(&options) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(1)
        }
    }
}

/// The root of the workspace.
pub(crate) fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..")
}
