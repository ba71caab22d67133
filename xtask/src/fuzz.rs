//! Coverage-guided fuzzing of every reader: builds the package `fuzz` with counters in it, and runs its targets.

use crate::{TaskError, root};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Options of the fuzz targets.
#[derive(clap::Args)]
pub(crate) struct Fuzz {
    /// How long they run, all together.
    #[arg(long, default_value_t = 300)]
    seconds: u64,
    /// These targets only.
    #[arg(long, value_delimiter = ',')]
    only: Vec<String>,
    /// The readers of records alone, without the files that the program reads beside them: much less has to be built.
    #[arg(long)]
    records: bool,
    /// Targets that run at a time; as many as there are cores without.
    #[arg(long)]
    jobs: Option<usize>,
    /// Add the counts to docs/metrics/fuzz.json.
    #[arg(long)]
    bless: bool,
}

/// What the compiler counts: every edge of the control flow, and the operands of comparisons.
const COUNTERS: &str = "-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
     -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
     -Cllvm-args=-sanitizer-coverage-trace-compares -Ccodegen-units=1 --cfg fuzzing";

/// Longest time of one input, seconds, and most memory, MiB.
const LIMITS: [&str; 3] = ["-timeout=5", "-rss_limit_mb=1024", "-malloc_limit_mb=1024"];

/// Inputs that were run, by target, over all runs that were kept.
#[derive(Default, Serialize, Deserialize)]
struct Account {
    /// Inputs by target.
    executions: BTreeMap<String, u64>,
    /// Their sum.
    total: u64,
    /// Seconds of all targets together.
    seconds: u64,
    /// Inputs that broke a limit in the last run of each target; they are mended before the counts are kept.
    findings: BTreeMap<String, u64>,
    /// Limits of an input.
    limits: BTreeMap<String, u64>,
}

/// Targets behind the feature `program` of the package.
const OF_THE_PROGRAM: [&str; 5] = ["model", "model-mat", "model-csv", "settings", "machine"];

/// Whether no target found anything.
pub(crate) fn run(options: &Fuzz) -> Result<bool, TaskError> {
    let Some(target) = triple()? else {
        println!("skipped: the coverage counters are for Linux and need a C++ compiler (c++)");
        return Ok(true);
    };
    let work = root().join("target/fuzz/work");
    let seeds = root().join("fuzz/corpus");
    let mut names = Vec::new();
    for entry in std::fs::read_dir(&seeds)? {
        names.push(entry?.file_name().to_string_lossy().into_owned());
    }
    names.sort();
    if let Some(unknown) = options.only.iter().find(|name| !names.contains(name)) {
        return Err(format!("no such target: {unknown}; there are {}", names.join(", ")).into());
    }
    names.retain(|name| options.only.is_empty() || options.only.contains(name));
    names.retain(|name| !(options.records && OF_THE_PROGRAM.contains(&name.as_str())));
    if names.is_empty() {
        let of = options.only.join(", ");
        return Err(format!("{of}: no reader of records; ask for it without --records").into());
    }
    let Some(program) = build(&target, options.records)? else {
        println!("skipped: what the package `fuzz` needs cannot be had from the registry");
        return Ok(true);
    };
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let jobs = options.jobs.unwrap_or(cores).clamp(1, names.len());
    let rounds = names.len().div_ceil(jobs);
    let seconds = (options.seconds / rounds as u64).max(1);
    let mut account = Account::default();
    for batch in names.chunks(jobs) {
        let run = |name: &String| one(&program, name, &seeds, &work, seconds);
        let results: Vec<_> = std::thread::scope(|scope| {
            let running: Vec<_> = batch.iter().map(|name| scope.spawn(move || run(name))).collect();
            running.into_iter().map(|thread| thread.join()).collect()
        });
        for (name, result) in batch.iter().zip(results) {
            let (executions, found) =
                result.map_err(|_| format!("{name}: the thread that watches it ended"))??;
            println!("{name}: {executions} inputs, {found} findings");
            account.executions.insert(name.clone(), executions);
            account.findings.insert(name.clone(), found);
            account.seconds += seconds;
        }
    }
    account.total = account.executions.values().sum();
    println!(
        "all: {} inputs in {} s of {} targets",
        account.total,
        account.seconds,
        names.len()
    );
    let clean = account.findings.values().all(|n| *n == 0);
    if options.bless && clean {
        keep(account)?;
    }
    Ok(clean)
}

/// The target to build for; none where the counters do not work.
fn triple() -> Result<Option<String>, TaskError> {
    let version = Command::new("rustc").arg("-vV").output()?;
    let version = String::from_utf8_lossy(&version.stdout).into_owned();
    let host = version.lines().find_map(|line| line.strip_prefix("host: "));
    let mut compiler = Command::new("c++");
    compiler
        .arg("--version")
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let compiler = compiler.status().is_ok_and(|s| s.success());
    Ok(host
        .filter(|h| h.contains("linux-gnu") && compiler)
        .map(str::to_owned))
}

/// The program with all targets; none if its dependencies cannot be had.
///
/// # Errors
/// An old lock file: without this, what nobody can build would count as skipped.
fn build(target: &str, only_records: bool) -> Result<Option<PathBuf>, TaskError> {
    let cargo = |words: &[&str]| {
        let mut command = Command::new("cargo");
        command
            .args(words)
            .args(["--locked", "--manifest-path", "fuzz/Cargo.toml"]);
        command.current_dir(root());
        command
    };
    let fetch = cargo(&["fetch", "--quiet", "--target", target]).output()?;
    if !fetch.status.success() {
        let why = String::from_utf8_lossy(&fetch.stderr);
        eprint!("{why}");
        if why.contains("lock file") {
            return Err("fuzz/Cargo.lock is old: `cargo update --workspace --manifest-path fuzz/Cargo.toml` renews it".into());
        }
        return Ok(None);
    }
    // With a target given, build scripts and macros are built without counters.
    let features: &[&str] = if only_records {
        &["--no-default-features"]
    } else {
        &[]
    };
    let words = [
        "build",
        "--quiet",
        "--target",
        target,
        "--target-dir",
        "target/fuzz",
    ];
    let built = cargo(&[&words, features].concat())
        .env("RUSTFLAGS", COUNTERS)
        .status()?;
    if !built.success() {
        return Err("the package `fuzz` does not build".into());
    }
    Ok(Some(
        root().join("target/fuzz").join(target).join("debug/lpv-fuzz"),
    ))
}

/// Runs one target: how many inputs, and how many of them broke a limit.
fn one(program: &Path, name: &str, seeds: &Path, work: &Path, seconds: u64) -> Result<(u64, u64), TaskError> {
    let corpus = work.join("corpus").join(name);
    let findings = work.join("findings").join(name);
    std::fs::create_dir_all(&corpus)?;
    std::fs::create_dir_all(&findings)?;
    let log = work.join(format!("{name}.log"));
    let log_file = std::fs::File::create(&log)?;
    let status = Command::new(program)
        .args([&corpus, &seeds.join(name)])
        .args(LIMITS)
        .arg(format!("-max_total_time={seconds}"))
        .arg(format!("-artifact_prefix={}/", findings.display()))
        .args(["-print_final_stats=1", "-max_len=16384"])
        .env("LPV_FUZZ", name)
        .env("RAYON_NUM_THREADS", "1")
        .stdout(Stdio::null())
        .stderr(log_file)
        .status()?;
    let text = String::from_utf8_lossy(&std::fs::read(&log)?).into_owned();
    let executions = text
        .lines()
        .filter_map(|line| line.strip_prefix("stat::number_of_executed_units:"))
        .find_map(|count| count.trim().parse().ok())
        .unwrap_or(0);
    if !status.success() {
        println!(
            "{name}: an input broke a limit; it is in {}, the account in {}",
            findings.display(),
            log.display()
        );
    }
    Ok((executions, u64::from(!status.success())))
}

/// Adds the counts to those of earlier runs.
fn keep(new: Account) -> Result<(), TaskError> {
    let file = root().join("docs/metrics/fuzz.json");
    let mut all: Account = match std::fs::read_to_string(&file) {
        Ok(text) => serde_json::from_str(&text)?,
        Err(_) => Account::default(),
    };
    for (name, count) in new.executions {
        *all.executions.entry(name).or_default() += count;
    }
    all.total = all.executions.values().sum();
    all.seconds += new.seconds;
    all.findings.extend(new.findings);
    all.limits = [("seconds", 5), ("mebibytes", 1024)]
        .map(|(k, v)| (k.to_owned(), v))
        .into();
    crate::reproduce::write_json(&file, &all)
}
