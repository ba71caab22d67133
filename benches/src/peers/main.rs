//! The hot kernels beside the tools that a user would pick instead: the same inputs, alternately in one run.
//!
//! `cargo xtask peers` runs this. Each side is a process of its own that prepares its inputs and then runs on demand, so that times and
//! memory are those of the work alone; nothing of Python's start or of reading files is counted.

mod child;
mod page;
mod whole;
mod works;

use child::Child;
use clap::Parser;
use lpv_benches::median;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use works::{Failure, Peer, WORKS, Way, Work};

/// Compares the hot kernels with other tools, and writes peers.json and the table of docs/performance.md.
#[derive(Parser)]
#[command(name = "cargo xtask peers")]
struct Arguments {
    /// Write docs/performance.md too.
    #[arg(long)]
    bless: bool,
    /// Runs of each side, at least 7 for the page.
    #[arg(long, default_value_t = LEAST_RUNS)]
    runs: usize,
    /// These works only.
    #[arg(long, value_delimiter = ',')]
    only: Vec<String>,
    /// Where peers.json, the inputs and the Python environment go.
    #[arg(long, default_value = "target/peers")]
    output: PathBuf,
    /// The program that runs the reproduction.
    #[arg(long, hide = true)]
    xtask: Option<PathBuf>,
    /// Serve one work on demand, for the driver.
    #[arg(long, hide = true)]
    serve: Option<String>,
    /// Serve this peer's way of the work instead of ours.
    #[arg(long, hide = true)]
    peer: Option<String>,
    /// Threads of a served work.
    #[arg(long, hide = true, default_value_t = 1)]
    threads: usize,
}

/// One comparison.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Row {
    work: &'static str,
    peer: &'static str,
    threads: usize,
    /// Median of their times over ours, run by run.
    ratio: f64,
    bar: f64,
    our_error: f64,
    their_error: f64,
    our_mib: f64,
    their_mib: f64,
    our_seconds: f64,
    their_seconds: f64,
    /// Smallest and largest ratio of a run.
    spread: [f64; 2],
    /// Error that is small enough, whatever theirs is.
    enough: f64,
}

impl Row {
    /// The peer of a row that compares two threads with one.
    pub(crate) const ITSELF: &str = "itself on one thread";
}

/// Median, and the smallest and the largest.
pub(crate) fn ratios(all: impl Iterator<Item = f64> + Clone) -> (f64, [f64; 2]) {
    let ends = [
        all.clone().fold(f64::INFINITY, f64::min),
        all.clone().fold(0.0, f64::max),
    ];
    (median(all.collect()), ends)
}

#[derive(Serialize)]
struct Account {
    /// Packages of the environment with their versions.
    packages: &'static [&'static str],
    runs: usize,
    rows: Vec<Row>,
}

/// Runs of each side that the page asks for.
const LEAST_RUNS: usize = 7;

/// Packages of the peers, pinned.
const PACKAGES: [&str; 5] = [
    "numpy==2.4.6",
    "scipy==1.17.1",
    "control==0.10.2",
    // The compiled routines of control.
    "slycot==0.7.1",
    "scikit-rf==2.2.0",
];

fn main() -> ExitCode {
    lpv_core::keep_freed_memory();
    let arguments = Arguments::parse();
    let result = match &arguments.serve {
        Some(name) => serve(name, arguments.peer.as_deref(), arguments.threads),
        None => compare(&arguments),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn serve(name: &str, peer: Option<&str>, threads: usize) -> Result<(), Failure> {
    let work = WORKS.iter().find(|w| w.name == name).ok_or("no such work")?;
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build_global()?;
    let peer = peer.and_then(|name| work.peers.iter().find(|p| p.name == name));
    let mut run = match peer.map(|p| &p.way) {
        Some(Way::Rust(run)) => run()?,
        _ => (work.ours)()?,
    };
    child::serve(&mut run)
}

fn compare(arguments: &Arguments) -> Result<(), Failure> {
    let names: Vec<&str> = WORKS.iter().map(|w| w.name).chain([whole::NAME]).collect();
    if let Some(other) = arguments.only.iter().find(|o| !names.contains(&o.as_str())) {
        return Err(format!("there is no work `{other}`; --only takes {}", names.join(", ")).into());
    }
    if arguments.bless && !arguments.only.is_empty() {
        return Err("the page has the rows of all works: leave out --only, or --bless and read target/peers/performance.md".into());
    }
    if arguments.bless && arguments.runs < LEAST_RUNS {
        return Err(format!("the page has medians of {LEAST_RUNS} runs or more: raise --runs").into());
    }
    let is_wanted = |name: &str| arguments.only.is_empty() || arguments.only.iter().any(|o| o == name);
    let folder = std::path::absolute(&arguments.output)?;
    std::fs::create_dir_all(&folder)?;
    let python = match environment(&folder) {
        Ok(python) => python,
        Err(problem) => {
            println!(
                "skipped: no Python environment with {} ({problem})",
                PACKAGES.join(", ")
            );
            return Ok(());
        }
    };
    let mut account = Account {
        packages: &PACKAGES,
        runs: arguments.runs,
        rows: Vec::new(),
    };
    // Row by row: what is measured is kept, whatever comes after.
    let mut keep = |row: Row| -> Result<(), Failure> {
        println!("{}", page::line(&row));
        account.rows.push(row);
        let text = serde_json::to_string_pretty(&account)?;
        Ok(std::fs::write(folder.join("peers.json"), text)?)
    };
    for work in &WORKS {
        if !is_wanted(work.name) {
            continue;
        }
        let inputs = folder.join(work.name);
        std::fs::create_dir_all(&inputs)?;
        (work.export)(&inputs)?;
        for peer in work.peers {
            for threads in [1, 2] {
                keep(measure(work, peer, threads, arguments.runs, &python, &inputs)?)?;
            }
        }
        std::fs::remove_dir_all(&inputs)?;
    }
    if let (true, Some(xtask)) = (is_wanted(whole::NAME), &arguments.xtask) {
        let rows = whole::rows(xtask, &python, &folder.join("reproduction"), arguments.runs)?;
        rows.into_iter().try_for_each(&mut keep)?;
    }
    let page = page::page(&account.rows, arguments.runs, &PACKAGES);
    std::fs::write(folder.join("performance.md"), &page)?;
    if arguments.bless {
        std::fs::write("docs/performance.md", &page)?;
    }
    Ok(())
}

/// The interpreter of an environment with the peers, made once.
fn environment(folder: &Path) -> Result<PathBuf, Failure> {
    let home = folder.join("python");
    let python = home.join("bin/python");
    let done = home.join("packages");
    let wanted = PACKAGES.join("\n");
    if std::fs::read_to_string(&done).is_ok_and(|found| found == wanted) {
        return Ok(python);
    }
    let run = |command: &mut Command| -> Result<(), Failure> {
        let out = command.output()?;
        if out.status.success() {
            return Ok(());
        }
        let text = String::from_utf8_lossy(&out.stderr);
        Err(text
            .lines()
            .last()
            .unwrap_or("it failed without a word")
            .to_owned()
            .into())
    };
    run(Command::new("python3").args(["-m", "venv"]).arg(&home))?;
    run(Command::new(&python)
        .args(["-m", "pip", "install", "-q"])
        .args(PACKAGES))?;
    std::fs::write(done, wanted)?;
    Ok(python)
}

fn measure(
    work: &Work,
    peer: &Peer,
    threads: usize,
    runs: usize,
    python: &Path,
    inputs: &Path,
) -> Result<Row, Failure> {
    let count = threads.to_string();
    let served = || -> Result<Command, Failure> {
        let mut command = Command::new(std::env::current_exe()?);
        command.args(["--serve", work.name, "--threads", &count]);
        Ok(command)
    };
    let mut one = served()?;
    let mut other = match &peer.way {
        Way::Rust(_) => {
            let mut other = served()?;
            other.args(["--peer", peer.name]);
            other
        }
        Way::Python(script, word) => {
            let mut other = Command::new(python);
            let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("peers");
            other.arg(folder.join(script)).arg(inputs).arg(&count).arg(word);
            other.env("PYTHONDONTWRITEBYTECODE", "1");
            for variable in ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"] {
                other.env(variable, &count);
            }
            other
        }
    };
    let (mut ours, mut theirs) = (Child::start(&mut one)?, Child::start(&mut other)?);
    let mut times = Vec::new();
    for _ in 0..runs.max(1) {
        times.push((ours.run()?, theirs.run()?));
    }
    let (ratio, spread) = ratios(times.iter().map(|(a, b)| b / a));
    let results = [
        ours.result(&inputs.join("ours"))?,
        theirs.result(&inputs.join("theirs"))?,
    ];
    work.compare(&results[0], &results[1])?;
    Ok(Row {
        work: work.what,
        peer: peer.name,
        threads,
        ratio,
        bar: peer.bar,
        our_error: (work.error)(&results[0])?,
        their_error: (work.error)(&results[1])?,
        our_mib: ours.memory()?,
        their_mib: theirs.memory()?,
        our_seconds: median(times.iter().map(|t| t.0).collect()),
        their_seconds: median(times.iter().map(|t| t.1).collect()),
        spread,
        enough: work.enough,
    })
}
