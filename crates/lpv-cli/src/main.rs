//! The program `lpv`: measured records in, model out.

use clap::{Parser, Subcommand};
use experiment_data::Bundle;
use lpv_cli::{IdentifyConfig, PipelineError, Summary, estimate_bundle, identify};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// LPV models of position-dependent machines from measured records.
#[derive(Parser)]
#[command(version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Identify a model from the periodic records of a bundle.
    #[command(after_help = "Example:\n  lpv identify measurements/axis3 -o model.json")]
    Identify(Identify),
}

#[derive(clap::Args)]
struct Identify {
    /// The bundle: a folder with an experiment.toml, or that file.
    bundle: PathBuf,
    /// Where the model goes, as JSON.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Settings, a TOML file; what it leaves out is chosen from the data.
    #[arg(short, long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Number of basis functions, instead of the configured one.
    #[arg(long, value_name = "N")]
    functions: Option<usize>,
    /// Seed of every random choice, instead of the configured one.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Print the summary as JSON.
    #[arg(long)]
    json: bool,
}

fn main() -> ExitCode {
    let Arguments {
        command: Command::Identify(arguments),
    } = Arguments::parse();
    match run(&arguments) {
        Ok(text) => {
            println!("{text}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

fn run(arguments: &Identify) -> Result<String, PipelineError> {
    let mut config = arguments
        .config
        .as_deref()
        .map_or_else(|| Ok(IdentifyConfig::default()), IdentifyConfig::read)?;
    config.functions = arguments.functions.unwrap_or(config.functions);
    config.seed = arguments.seed.unwrap_or(config.seed);
    let bundle = Bundle::open(&arguments.bundle)?;
    let responses = estimate_bundle(&bundle, config.skip_periods)?;
    let identified = identify(&responses.frfs(), responses.clock, &config)?;
    let summary = Summary::new(&identified, &responses)?;
    write_whole(&arguments.output, identified.model()?.to_json()?.as_bytes())?;
    if arguments.json {
        serde_json::to_string_pretty(&summary).map_err(|e| PipelineError::Write {
            file: arguments.output.clone(),
            source: e.into(),
        })
    } else {
        Ok(format!(
            "{}\nmodel written to {}",
            summary.text(),
            arguments.output.display()
        ))
    }
}

/// Writes beside the target and renames, so that a failure leaves neither half a file nor a spare one.
fn write_whole(file: &Path, bytes: &[u8]) -> Result<(), PipelineError> {
    let refuse = |source| PipelineError::Write {
        file: file.to_owned(),
        source,
    };
    let mut part = file.as_os_str().to_owned();
    part.push(format!(".{}.part", std::process::id()));
    let written = std::fs::write(&part, bytes).and_then(|()| std::fs::rename(&part, file));
    written.map_err(|source| {
        // What cannot be removed was never written.
        std::fs::remove_file(&part).ok();
        refuse(source)
    })
}
