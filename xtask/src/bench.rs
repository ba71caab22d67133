//! Instruction counts of the hot kernels under valgrind: kept in docs, compared with them, and with their own growth.

use crate::{TaskError, root};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Part by which a count may differ from the one that is kept: other versions of the compiler schedule differently.
const TOLERANCE: f64 = 0.10;

/// Most that twice the work may cost.
const TWICE: f64 = 2.1;

/// Work that is doubled.
struct Growth {
    what: &'static str,
    half: &'static str,
    whole: &'static str,
    /// What both do before it.
    before: Option<&'static str>,
    /// Most that the whole may cost of the half.
    most: f64,
}

const fn twice(what: &'static str, half: &'static str, whole: &'static str) -> Growth {
    Growth {
        what,
        half,
        whole,
        before: None,
        most: TWICE,
    }
}

const GROWTH: [Growth; 8] = [
    twice(
        "lines of the regression",
        "regression lines_8191",
        "regression lines_16383",
    ),
    twice(
        "positions of the regression",
        "regression positions_8",
        "regression positions_16",
    ),
    Growth {
        // A transform of N samples takes N log N.
        most: 2.0 * 13.0 / 12.0,
        ..twice(
            "samples of a period",
            "frf_push period_4096",
            "frf_push period_8192",
        )
    },
    twice(
        "lines of a frequency response",
        "frequency_response lines_500",
        "frequency_response lines_1000",
    ),
    twice(
        "samples of a simulation",
        "simulation samples_2000",
        "simulation samples_4000",
    ),
    twice(
        "samples of a simulation at moving p",
        "moving_p samples_4000",
        "moving_p samples_8000",
    ),
    twice("lines of a pole fit", "poles lines_401", "poles lines_802"),
    Growth {
        what: "steps of an LFR refinement",
        half: "lfr_refinement steps_4",
        whole: "lfr_refinement steps_6",
        before: Some("lfr_refinement steps_2"),
        most: TWICE,
    },
];

/// Version of the library in benches/Cargo.toml; the runner must be of the same.
const RUNNER: &str = "0.20.0";

/// Instructions by kernel; none where valgrind or its runner cannot be had.
///
/// # Errors
/// A bench that fails, or says nothing.
pub(crate) fn count(profile: &str) -> Result<Option<BTreeMap<String, u64>>, TaskError> {
    if Command::new("valgrind").arg("--version").output().is_err() {
        println!("skipped: valgrind is not installed");
        return Ok(None);
    }
    let Some(runner) = runner()? else {
        println!("skipped: gungraun-runner {RUNNER} cannot be installed");
        return Ok(None);
    };
    let output = Command::new("cargo")
        // The whole workspace, so that its crates have the features with which the tests have built them.
        .args(["bench", "--profile", profile, "--workspace"])
        .args(["--bench", "instructions"])
        .env("GUNGRAUN_RUNNER", runner)
        .env("GUNGRAUN_COLOR", "never")
        .current_dir(root())
        .output()?;
    let text = String::from_utf8_lossy(&output.stdout);
    if !output.status.success() {
        return Err(format!("{text}{}", String::from_utf8_lossy(&output.stderr)).into());
    }
    let counts = parse(&text);
    match counts.is_empty() {
        true => Err("the bench told no counts".into()),
        false => Ok(Some(counts)),
    }
}

/// The runner, installed into the target folder if it is not there; not optimised, since it counts nothing itself.
fn runner() -> Result<Option<PathBuf>, TaskError> {
    let tools = root().join("target/tools");
    let binary = tools.join("bin/gungraun-runner");
    if !binary.exists() {
        let status = Command::new("cargo")
            .args([
                "install",
                "--quiet",
                "--debug",
                "--locked",
                "gungraun-runner",
                "--version",
                RUNNER,
            ])
            .arg("--root")
            .arg(&tools)
            .env("CARGO_PROFILE_DEV_DEBUG", "false")
            .status()?;
        if !status.success() {
            return Ok(None);
        }
    }
    Ok(Some(binary))
}

/// From `...::regression lines_1023:(...)` and the line of instructions that follows.
fn parse(text: &str) -> BTreeMap<String, u64> {
    let mut counts = BTreeMap::new();
    let mut name = None;
    for line in text.lines() {
        if let Some((_, kernel)) = line.split_once("::kernels::") {
            name = kernel.split(':').next().map(str::to_owned);
        } else if let Some(rest) = line.trim().strip_prefix("Instructions:") {
            let digits: String = rest.trim().chars().take_while(char::is_ascii_digit).collect();
            if let (Some(name), Ok(count)) = (name.take(), digits.parse()) {
                counts.insert(name, count);
            }
        }
    }
    counts
}

/// Growth that is too much, in words.
pub(crate) fn growth(counts: &BTreeMap<String, u64>) -> Vec<String> {
    let mut wrong = Vec::new();
    for growth in GROWTH {
        let what = growth.what;
        let count = |kernel| counts.get(kernel).map(|c| *c as f64);
        let ends = (count(growth.half), count(growth.whole));
        let before = growth.before.map_or(Some(0.0), count);
        let ((Some(half), Some(whole)), Some(before)) = (ends, before) else {
            wrong.push(format!("{what}: not counted"));
            continue;
        };
        let ratio = (whole - before) / (half - before);
        println!("twice the {what}: {ratio:.3} times the instructions");
        if ratio > growth.most {
            wrong.push(format!(
                "twice the {what} cost {ratio:.3} times the instructions, more than {:.3}",
                growth.most
            ));
        }
    }
    wrong
}

/// Counts that differ from the kept ones, in words.
///
/// # Errors
/// Without kept counts.
pub(crate) fn changed(counts: &BTreeMap<String, u64>, kept: &Path) -> Result<Vec<String>, TaskError> {
    let kept: BTreeMap<String, u64> = serde_json::from_str(&std::fs::read_to_string(kept)?)?;
    let mut wrong = Vec::new();
    for (name, old) in &kept {
        let Some(new) = counts.get(name) else {
            wrong.push(format!("{name}: not counted"));
            continue;
        };
        let change = *new as f64 / *old as f64 - 1.0;
        println!("{name}: {new} ({:+.1} %)", 100.0 * change);
        if change.abs() > TOLERANCE {
            wrong.push(format!(
                "{name}: {new} instructions, {old} are kept ({:+.1} %); find out why, or keep the new ones with --bless",
                100.0 * change
            ));
        }
    }
    let new = counts.keys().filter(|name| !kept.contains_key(*name));
    wrong.extend(new.map(|name| format!("{name}: no count is kept; keep it with --bless")));
    Ok(wrong)
}

/// docs/instructions.md.
pub(crate) fn page(counts: &BTreeMap<String, u64>) -> String {
    let mut text = String::from(
        "# Instruction counts of the hot kernels\n\n\
         Made by `cargo xtask bench --bless`, under valgrind with one thread: registers of 256 bits, as valgrind knows no wider \
         ones. Unlike times they do not depend on what else runs; `cargo xtask bench --check` compares with them within 10 %, and asks \
         that twice the work costs at most 2.1 times the instructions (transforms, of N log N, 2.17 times). Times are in [performance.md](performance.md).\n\n\
         | kernel | instructions |\n|---|---|\n",
    );
    for (name, count) in counts {
        let _ = writeln!(text, "| `{name}` | {count} |");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::{GROWTH, growth, parse};

    #[test]
    fn counts_are_read_and_growth_is_judged() {
        let text = "instructions::kernels::simulation samples_2000:(model(2000))\n  Instructions:   1632146|N/A   (*)\n\
                    instructions::kernels::simulation samples_4000:(model(4000))\n  Instructions:   6248631|1632146 (+1%)\n";
        let counts = parse(text);
        assert_eq!(counts["simulation samples_2000"], 1_632_146);
        assert_eq!(counts["simulation samples_4000"], 6_248_631);
        let wrong = growth(&counts);
        assert_eq!(
            wrong.iter().filter(|w| w.contains("not counted")).count(),
            GROWTH.len() - 1
        );
        assert_eq!(wrong.iter().filter(|w| w.contains("3.828")).count(), 1);
    }
}
