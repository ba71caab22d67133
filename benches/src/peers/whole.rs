//! The whole reproduction beside a pipeline of numpy and scipy, stage by stage of one process each.

use crate::works::Failure;
use crate::{Row, ratios};
use lpv_benches::median;
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Stdio};

/// Stages that both have.
const STAGES: [&str; 6] = ["experiments_frf", "poles", "basis", "obf", "lfr", "time"];
/// Its name for `--only`.
pub(crate) const NAME: &str = "reproduction";
const WORK: &str = "whole reproduction, full size, without bundles and report";

/// One run: seconds, peak memory in MiB, median relative error of the frozen responses over the band.
struct Once {
    seconds: f64,
    mib: f64,
    error: f64,
}

impl Once {
    fn new(account: &Value, mib: &str, decibel: &str) -> Result<Self, Failure> {
        let number = |path: &str| -> Result<f64, Failure> {
            let value = account.pointer(path).and_then(Value::as_f64);
            value.ok_or_else(|| format!("the account has no {path}").into())
        };
        let stages = STAGES.iter().map(|s| number(&format!("/stage_seconds/{s}")));
        Ok(Self {
            seconds: stages.sum::<Result<f64, _>>()?,
            mib: number(mib)?,
            error: 10.0_f64.powf(number(decibel)? / 20.0),
        })
    }
}

fn ours(xtask: &Path, folder: &Path, threads: usize) -> Result<Once, Failure> {
    let out = Command::new(xtask)
        .args(["reproduce", "--output"])
        .arg(folder)
        .env("RAYON_NUM_THREADS", threads.to_string())
        .output()?;
    if !out.status.success() {
        let said = String::from_utf8_lossy(&out.stderr);
        return Err(format!("the reproduction failed: {said}").into());
    }
    let text = std::fs::read_to_string(folder.join("metrics.json"))?;
    Once::new(
        &serde_json::from_str(&text)?,
        "/peak_rss_mib",
        "/obf/band/median_db",
    )
}

fn theirs(python: &Path, threads: usize) -> Result<Once, Failure> {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("peers/pipeline_numpy.py");
    let out = Command::new(python)
        .arg(script)
        .env("OMP_NUM_THREADS", threads.to_string())
        .env("OPENBLAS_NUM_THREADS", "1")
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .stderr(Stdio::inherit())
        .output()?;
    if !out.status.success() {
        return Err("the pipeline of numpy failed".into());
    }
    Once::new(
        &serde_json::from_slice(&out.stdout)?,
        "/peak_mib",
        "/band_median_db",
    )
}

/// The rows of one thread, of two, and of two against one.
pub(crate) fn rows(xtask: &Path, python: &Path, folder: &Path, runs: usize) -> Result<Vec<Row>, Failure> {
    let mut all = [Vec::new(), Vec::new()];
    for _ in 0..runs.max(1) {
        for (threads, runs) in (1..).zip(&mut all) {
            runs.push((ours(xtask, folder, threads)?, theirs(python, threads)?));
        }
    }
    let row = |peer, threads, bar, pairs: Vec<(&Once, &Once)>| {
        let (ratio, spread) = ratios(pairs.iter().map(|(a, b)| b.seconds / a.seconds));
        let of = |f: fn(&(&Once, &Once)) -> f64| median(pairs.iter().map(f).collect());
        Row {
            work: WORK,
            peer,
            threads,
            ratio,
            bar,
            our_error: of(|p| p.0.error),
            their_error: of(|p| p.1.error),
            our_mib: of(|p| p.0.mib),
            their_mib: of(|p| p.1.mib),
            our_seconds: of(|p| p.0.seconds),
            their_seconds: of(|p| p.1.seconds),
            spread,
            enough: 0.0,
        }
    };
    let mut rows: Vec<Row> = (1..)
        .zip(&all)
        .map(|(threads, runs)| {
            let pairs = runs.iter().map(|(a, b)| (a, b)).collect();
            row("numpy, scipy", threads, 20.0, pairs)
        })
        .collect();
    let pairs = all[1].iter().zip(&all[0]).map(|(two, one)| (&two.0, &one.0));
    rows.push(row(Row::ITSELF, 2, 1.8, pairs.collect()));
    Ok(rows)
}
