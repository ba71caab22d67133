//! The command line.

use crate::fleet::{Fleet, Merge};
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;
use std::time::Duration;

/// LPV models of position-dependent machines from measured records.
///
/// A result replaces only a result of its own kind; what is read is never replaced, any other file only with --force.
///
/// Exit codes: 0 done; 2 bad input or usage; 3 done, but the model that `identify`, `validate` or `diagnose` judged is none of this
/// machine or the data contradict themselves (the first line, and with --json the verdict, says which and why), or a bundle of `fleet` or
/// `merge` is refused or has no row; 130 stopped by Ctrl-C;
/// 1 anything else.
#[derive(Parser)]
#[command(name = "lpv", version, about, long_about)]
#[command(mut_arg("color", |a| a.help("When verdicts and errors are coloured; auto: on a terminal, unless NO_COLOR is set")))]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub(crate) common: Common,
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// What every command understands.
#[derive(Args)]
#[command(next_help_heading = "Options of every command")]
pub(crate) struct Common {
    /// Threads that compute, instead of one a core; the result is the same to the last bit.
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
    /// Stop after so many seconds, with exit code 1 and no result.
    #[arg(long, global = true, value_name = "SECONDS", value_parser = seconds)]
    pub(crate) time_limit: Option<Duration>,
    /// Print the verdict or the warnings alone, and show no progress.
    #[arg(short, long, global = true)]
    pub(crate) quiet: bool,
    /// Tell on standard error each step with the time that it took.
    #[arg(short, long, global = true, conflicts_with = "quiet")]
    pub(crate) verbose: bool,
    #[command(flatten)]
    pub(crate) color: colorchoice_clap::Color,
}

#[derive(Subcommand)]
pub(crate) enum Command {
    /// Draft an experiment.toml from record files.
    #[command(
        after_help = "Example:\n  lpv new measurements/run1.csv measurements/run2.csv --input u --output y"
    )]
    New(New),
    /// Tell what is in a bundle, checked: sampling, periods, noise, distortion, coverage, warnings.
    #[command(after_help = "Example:\n  lpv inspect measurements")]
    Inspect(Inspect),
    /// Write a bundle from the simulated xy-table.
    #[command(
        after_help = "Example:\n  lpv simulate --print-machine > machine.toml\n  lpv simulate --machine machine.toml --hide coulomb-friction -o bundle"
    )]
    Simulate(Simulate),
    /// Identify a model from a bundle.
    #[command(after_help = "Example:\n  lpv identify measurements -o result/model.json")]
    Identify(Identify),
    /// Compare a model with the records that a bundle holds out.
    #[command(after_help = "Example:\n  lpv validate result/model.json measurements")]
    Validate(Validate),
    /// Find the effect behind what a model gets wrong on the moves of a bundle.
    #[command(after_help = "Example:\n  lpv diagnose measurements -o diagnosis")]
    Diagnose(Diagnose),
    /// Diagnose or identify many bundles, or a shard of them; what is there already is kept.
    #[command(after_help = "Example:\n  lpv fleet machines/* --shard 2/5 -o results")]
    Fleet(Fleet),
    /// Put the rows of all shards of a fleet together, and name what is missing.
    #[command(after_help = "Example:\n  lpv merge results -o fleet.csv")]
    Merge(Merge),
    /// Write a model for MATLAB, Python or a spreadsheet, or read it back.
    #[command(after_help = "Example:\n  lpv convert result/model.json --to mat -o result/model.mat")]
    Convert(Convert),
    /// Write a page with Bode plots, poles, coefficient functions, errors and time responses of the models in a folder.
    #[command(after_help = "Example:\n  lpv report result")]
    Report(Report),
    /// Print the JSON Schema of experiment.toml, or of what a command prints with --json.
    #[command(after_help = "Example:\n  lpv schema > experiment.schema.json\n  lpv schema --of identify")]
    Schema {
        /// The command; that of experiment.toml without.
        #[arg(long, value_enum, value_name = "COMMAND")]
        of: Option<Account>,
    },
    /// Print the completions of a shell.
    #[command(
        after_help = "Example:\n  lpv completions bash > ~/.local/share/bash-completion/completions/lpv"
    )]
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
    /// Write a manual page of every command into a folder.
    #[command(hide = true, after_help = "Example:\n  lpv man ~/.local/share/man/man1")]
    Man {
        /// The folder.
        folder: PathBuf,
    },
}

/// Commands that have an account.
#[derive(Clone, Copy, ValueEnum)]
pub(crate) enum Account {
    New,
    Inspect,
    Simulate,
    Identify,
    Validate,
    Diagnose,
    Fleet,
    Merge,
    Convert,
    Report,
}

/// Groups of a file that hold the same signals.
#[derive(Clone, Copy, ValueEnum)]
pub(crate) enum Groups {
    Runs,
    Axes,
}

#[derive(Args)]
pub(crate) struct New {
    /// Record files, or a folder of them: .npz, .csv and other text tables, .parquet, .mat, .h5, .tdms, .mf4, .uff.
    #[arg(required = true, value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,
    /// Columns of the measured outputs.
    #[arg(long, value_name = "COLUMNS", value_delimiter = ',')]
    pub(crate) output: Vec<String>,
    /// Columns of the inputs of the machine.
    #[arg(long, value_name = "COLUMNS", value_delimiter = ',')]
    pub(crate) input: Vec<String>,
    /// Columns of the excitation or setpoint.
    #[arg(long, value_name = "COLUMNS", value_delimiter = ',')]
    pub(crate) reference: Vec<String>,
    /// Column of the position on which the dynamics depend.
    #[arg(long, value_name = "COLUMN", value_delimiter = ',')]
    pub(crate) scheduling: Vec<String>,
    /// Samples per second.
    #[arg(long, value_name = "HZ", value_parser = rate, allow_negative_numbers = true)]
    pub(crate) sample_rate: Option<f64>,
    /// Samples a period, of all files.
    #[arg(long, value_name = "SAMPLES", value_parser = period)]
    pub(crate) period: Option<usize>,
    /// What groups of a file are that hold the same signals: runs of one machine, or its axes.
    #[arg(long)]
    pub(crate) groups: Option<Groups>,
    /// Files that are held out to judge the model, named among the files or here alone.
    #[arg(long, value_name = "FILE")]
    pub(crate) validation: Vec<PathBuf>,
    /// Name of the experiment.
    #[arg(long)]
    pub(crate) name: Option<String>,
    /// Replace an experiment.toml that is already there.
    #[arg(long)]
    pub(crate) force: bool,
    /// Print what was guessed as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args)]
pub(crate) struct Inspect {
    /// The bundle: a folder with an experiment.toml, or that file.
    pub(crate) bundle: PathBuf,
    /// Print one row for each line of the spectra, as CSV, instead.
    #[arg(long, conflicts_with = "json")]
    pub(crate) lines: bool,
    /// Print everything as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args)]
pub(crate) struct Diagnose {
    /// The bundle: a folder with an experiment.toml, or that file.
    pub(crate) bundle: PathBuf,
    /// The model that effects are added to, a file of `lpv identify` or `lpv convert`; made from the bundle without.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) model: Option<PathBuf>,
    /// A TOML file with effects of your own, which are tried beside those of the catalogue.
    #[arg(long, value_name = "FILE")]
    pub(crate) effects: Option<PathBuf>,
    /// The folder for diagnosis.json, diagnosis.html, and model.json, the model with the effects.
    #[arg(short, long, value_name = "FOLDER")]
    pub(crate) output: PathBuf,
    /// Replace a file that is no result of lpv, if one stands there; what is read is never replaced.
    #[arg(long)]
    pub(crate) force: bool,
    /// Print the diagnosis as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args)]
pub(crate) struct Simulate {
    /// The machine and its experiments; the default machine without.
    #[arg(long, value_name = "FILE")]
    pub(crate) machine: Option<PathBuf>,
    /// An effect that the machine has and the bundle does not tell, with its size; may be repeated.
    #[arg(long, value_name = "EFFECT[=VALUE]")]
    pub(crate) hide: Vec<String>,
    /// The folder of the bundle.
    #[arg(short, long, value_name = "FOLDER", required_unless_present = "print_machine")]
    pub(crate) output: Option<PathBuf>,
    /// Kind of the record files.
    #[arg(long, value_enum, default_value_t = Format::Npz)]
    pub(crate) format: Format,
    /// Print a machine file with all defaults, and do nothing else.
    #[arg(long)]
    pub(crate) print_machine: bool,
    /// Print the account as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

fn seconds(text: &str) -> Result<Duration, &'static str> {
    let seconds = text.parse().ok().filter(|s: &f64| *s > 0.0);
    let limit = seconds.and_then(|s| Duration::try_from_secs_f64(s).ok());
    limit.ok_or("give seconds, a number above zero")
}

/// Kinds of record files.
#[derive(Clone, Copy, ValueEnum)]
pub(crate) enum Format {
    Npz,
    Csv,
    Parquet,
    Mat,
}

#[derive(Args)]
pub(crate) struct Identify {
    /// The bundle: a folder with an experiment.toml, or that file.
    #[arg(required_unless_present = "print_config")]
    pub(crate) bundle: Option<PathBuf>,
    /// Where the model goes, as JSON.
    #[arg(short, long, value_name = "FILE", required_unless_present = "print_config")]
    pub(crate) output: Option<PathBuf>,
    /// Settings, a TOML file; what it leaves out is chosen from the data.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    /// Print the settings with their defaults as a TOML file, and do nothing else.
    #[arg(long)]
    pub(crate) print_config: bool,
    /// What kind of model, instead of the configured one.
    #[arg(long, value_enum)]
    pub(crate) structure: Option<StructureName>,
    /// Number of basis functions, instead of the configured one.
    #[arg(long, value_name = "N")]
    pub(crate) functions: Option<usize>,
    /// Last part of each transient record that is held out, instead of the configured one.
    #[arg(long, value_name = "PART", value_parser = part)]
    pub(crate) hold_out: Option<f64>,
    /// Seed of every random choice, instead of the configured one.
    #[arg(long, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Replace a file that is no result of lpv, if one stands there; what is read is never replaced.
    #[arg(long)]
    pub(crate) force: bool,
    /// Print the summary as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

fn rate(text: &str) -> Result<f64, &'static str> {
    let rate = text.parse().ok().filter(|r: &f64| *r > 0.0 && r.is_finite());
    rate.ok_or(
        "give samples per second, a number above zero; leave it out to have it told from a time column",
    )
}

fn period(text: &str) -> Result<usize, &'static str> {
    let samples = text.parse().ok().filter(|n| *n >= 2);
    samples.ok_or("give a whole number of samples, 2 or more")
}

fn part(text: &str) -> Result<f64, &'static str> {
    let part = text.parse().ok().filter(|p| (0.0..=0.95).contains(p));
    part.ok_or("give a part from 0 to 0.95")
}

/// Kinds of models.
#[derive(Clone, Copy, ValueEnum)]
pub(crate) enum StructureName {
    Lpv,
    Lti,
    RigidBody,
    XyTable,
}

#[derive(Args)]
pub(crate) struct Validate {
    /// The model, a file of `lpv identify` or `lpv convert`.
    pub(crate) model: PathBuf,
    /// The bundle.
    pub(crate) bundle: PathBuf,
    /// Judge also the records with use = "estimation".
    #[arg(long)]
    pub(crate) all: bool,
    /// Print everything as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args)]
pub(crate) struct Convert {
    /// The model: .json, .mat or .csv.
    pub(crate) model: PathBuf,
    /// What to write.
    #[arg(long, value_enum)]
    pub(crate) to: TargetName,
    /// Where it goes; beside the model without.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Replace a file that is no result of lpv, if one stands there; what is read is never replaced.
    #[arg(long)]
    pub(crate) force: bool,
    /// Print what was written as JSON.
    #[arg(long)]
    pub(crate) json: bool,
    /// Frozen systems a scheduling parameter.
    #[arg(long, value_name = "N", default_value_t = 11, value_parser = clap::value_parser!(u16).range(2..=1000))]
    pub(crate) points: u16,
}

/// What a model can be written as.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum TargetName {
    /// MATLAB 5 file with a struct of A, B1, ... D22 and frozen systems on a grid.
    Mat,
    /// The program's own format.
    Json,
    /// One matrix entry a line.
    Csv,
    /// A module that builds python-control systems.
    Python,
}

#[derive(Args)]
pub(crate) struct Report {
    /// A folder with models that `lpv identify` wrote, or one of them.
    pub(crate) folder: PathBuf,
    /// The bundle to compare with, instead of the one that each model names.
    #[arg(long)]
    pub(crate) bundle: Option<PathBuf>,
    /// Where the page goes; report.html in the folder without.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Replace a file that is no result of lpv, if one stands there; what is read is never replaced.
    #[arg(long)]
    pub(crate) force: bool,
    /// Print what was written as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}
