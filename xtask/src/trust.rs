//! The bench of honesty and safety: inputs of every kind that has misled the program, made anew with known truth; each is given to
//! `lpv` as a user would, and what it says and does is held against what is right.
//!
//! The simulators, the excitations and the judgement are this bench's own: nothing of what it makes or compares comes from the
//! code that estimates.

mod bench_list;
mod bundle;
mod clean;
mod draw;
mod hostile;
mod judge;
mod kills;
mod kinds;
mod loops;
mod machine;
mod mat5;
mod originals;
mod page;
mod program;
mod rig;
mod scales;

use crate::{TaskError, reproduce, root};
use draw::Draw;
use indicatif::ProgressBar;
use judge::Judged;
use program::Lab;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// Options of the bench.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Write the page and the figures to docs/ too.
    #[arg(long)]
    bless: bool,
    /// About a minute: two seeds a kind of the cheap ones; fails where a bar is broken that docs/metrics/trust.json says was held.
    #[arg(long, conflicts_with_all = ["bless", "seeds", "only"])]
    quick: bool,
    /// These kinds or parts only: a kind's name, or kinds, clean, scales, hostile, kills, bench, originals.
    #[arg(long, value_delimiter = ',')]
    only: Vec<String>,
    /// Cases a kind; clean machines are twenty times, kills fifty times as many.
    #[arg(long, default_value_t = 10)]
    seeds: u64,
    /// Seed of every random number.
    #[arg(long, default_value_t = 2011)]
    seed: u64,
    /// The first case of each kind: to see one again.
    #[arg(long, default_value_t = 0)]
    first: u64,
    /// Take the cases that an earlier run left in its log as they are.
    #[arg(long, conflicts_with = "quick")]
    resume: bool,
    /// Keep the files of every case in the output folder.
    #[arg(long)]
    keep: bool,
    /// The program; built beside this one without.
    #[arg(long, value_name = "FILE")]
    lpv: Option<PathBuf>,
    /// Where the results go.
    #[arg(long, value_name = "FOLDER", default_value = "target/trust")]
    output: PathBuf,
}

/// One case and what came of it.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Entry {
    /// Part of the bench.
    pub(crate) part: String,
    /// Kind within it.
    pub(crate) kind: String,
    /// Number of the case.
    pub(crate) index: u64,
    /// What came of it.
    #[serde(flatten)]
    pub(crate) judged: Judged,
    /// Seconds that it took.
    pub(crate) seconds: f64,
}

/// Makes a case from its random numbers, runs it and judges it.
type Make = Box<dyn Fn(&mut Draw, &Lab) -> Result<Judged, TaskError> + Sync + Send>;

/// One case to be run.
pub(crate) struct Case {
    part: &'static str,
    kind: String,
    index: u64,
    make: Make,
}

impl Case {
    /// The case `index` of a kind.
    pub(crate) fn new(
        part: &'static str,
        kind: &str,
        index: u64,
        make: impl Fn(&mut Draw, &Lab) -> Result<Judged, TaskError> + Sync + Send + 'static,
    ) -> Self {
        Self {
            part,
            kind: kind.to_owned(),
            index,
            make: Box::new(make),
        }
    }
}

/// Runs the bench; false where `--quick` finds a bar broken that was held.
///
/// # Errors
/// What cannot be built, read or written.
pub(crate) fn run(options: &Options) -> Result<bool, TaskError> {
    let program = match &options.lpv {
        Some(file) => file.canonicalize()?,
        None => built()?,
    };
    std::fs::create_dir_all(&options.output)?;
    let cases = cases(options);
    let log = options.output.join(if options.quick {
        "quick.jsonl"
    } else {
        "cases.jsonl"
    });
    let mut entries = if options.resume { logged(&log)? } else { Vec::new() };
    let done: BTreeSet<_> = entries
        .iter()
        .map(|e| (e.part.clone(), e.kind.clone(), e.index))
        .collect();
    let open: Vec<Case> = cases
        .into_iter()
        .filter(|c| !done.contains(&(c.part.to_owned(), c.kind.clone(), c.index)))
        .collect();
    let file = Mutex::new(
        File::options()
            .create(true)
            .append(options.resume)
            .truncate(!options.resume)
            .write(true)
            .open(&log)?,
    );
    let bar = ProgressBar::new(open.len() as u64);
    let made: Result<Vec<Entry>, TaskError> = open
        .par_iter()
        .map(|case| {
            let entry = one(case, options, &program)?;
            let line = serde_json::to_string(&entry)?;
            if let Ok(mut file) = file.lock() {
                writeln!(file, "{line}")?;
            }
            bar.inc(1);
            Ok(entry)
        })
        .collect();
    bar.finish_and_clear();
    entries.extend(made?);
    entries.sort_by(|a, b| (&a.part, &a.kind, a.index).cmp(&(&b.part, &b.kind, b.index)));
    let rows = page::rows(&entries);
    let command = match options.quick {
        true => "cargo xtask trust --quick".to_owned(),
        false => format!(
            "cargo xtask trust --seeds {} --seed {}",
            options.seeds, options.seed
        ),
    };
    let text = page::page(&rows, &entries, &command);
    let metrics = page::metrics(&rows, &entries);
    reproduce::write_json(&options.output.join("trust.json"), &metrics)?;
    std::fs::write(options.output.join("trust.md"), &text)?;
    if options.bless {
        let docs = root().join("docs");
        reproduce::write_json(&docs.join("metrics/trust.json"), &metrics)?;
        std::fs::write(docs.join("trust.md"), &text)?;
    }
    print!("{}", page::terminal(&rows, &entries));
    println!("page: {}", options.output.join("trust.md").display());
    if options.quick {
        let kept = root().join("docs/metrics/trust.json");
        let broken = page::broken(&rows, &entries, &kept);
        broken.iter().for_each(|b| println!("broken: {b}"));
        return Ok(broken.is_empty());
    }
    Ok(true)
}

/// What these options ask for.
fn cases(options: &Options) -> Vec<Case> {
    let (first, seeds) = (options.first, if options.quick { 1 } else { options.seeds });
    let mut all = Vec::new();
    for kind in &kinds::KINDS {
        let make = kind.make;
        all.extend((first..first + seeds).map(|i| Case::new("kinds", kind.name, i, make)));
    }
    all.extend(clean::cases(first, if options.quick { 10 } else { 20 * seeds }));
    all.extend(hostile::cases(
        first,
        seeds.min(if options.quick { 1 } else { 10 }),
    ));
    all.extend(scales::cases(first, seeds, options.quick));
    all.extend(kills::cases(first, if options.quick { 2 } else { seeds }));
    if !options.quick {
        all.extend(originals::cases());
        all.extend(bench_list::cases());
    }
    let wanted =
        |c: &Case| options.only.is_empty() || options.only.iter().any(|o| o == c.part || *o == c.kind);
    all.retain(wanted);
    all
}

/// Runs one case in a folder of its own.
fn one(case: &Case, options: &Options, program: &Path) -> Result<Entry, TaskError> {
    let start = std::time::Instant::now();
    let name = format!("{}-{}-{}", case.part, case.kind, case.index);
    let temporary = tempfile::Builder::new().prefix("trust-").tempdir()?;
    let folder = match options.keep {
        true => options.output.join("files").join(&name),
        false => temporary.path().to_owned(),
    };
    if options.keep && folder.exists() {
        std::fs::remove_dir_all(&folder)?;
    }
    std::fs::create_dir_all(&folder)?;
    let lab = Lab {
        program: program.to_owned(),
        folder: folder.canonicalize()?,
    };
    let mut draw = Draw::new(options.seed, &format!("{}/{}", case.part, case.kind), case.index);
    // A case that cannot be made or judged is not right, and stops no other.
    let mut judged = (case.make)(&mut draw, &lab).unwrap_or_else(|e| Judged {
        said: format!("the bench itself: {e}"),
        ..Judged::default()
    });
    // Folders of this machine are nobody's business.
    judged.said = judged.said.replace(&lab.folder.display().to_string(), ".");
    Ok(Entry {
        part: case.part.to_owned(),
        kind: case.kind.clone(),
        index: case.index,
        judged,
        seconds: start.elapsed().as_secs_f64(),
    })
}

/// The entries of a log; a line that was cut off is left out.
fn logged(log: &Path) -> Result<Vec<Entry>, TaskError> {
    if !log.exists() {
        return Ok(Vec::new());
    }
    let text = std::fs::read_to_string(log)?;
    Ok(text
        .lines()
        .filter_map(|l| serde_json::from_str(l).ok())
        .collect())
}

/// The program, built like this one.
fn built() -> Result<PathBuf, TaskError> {
    let own = std::env::current_exe()?;
    let folder = own.parent().ok_or("this program stands in no folder")?;
    let mut build = std::process::Command::new("cargo");
    // The whole workspace, so that its crates have the features with which the rest has been built.
    build
        .args(["build", "--quiet", "--workspace", "--bin", "lpv"])
        .current_dir(root());
    if folder.ends_with("release") {
        build.arg("--release");
    }
    if !build.status()?.success() {
        return Err("the program lpv cannot be built".into());
    }
    Ok(folder.join("lpv"))
}
