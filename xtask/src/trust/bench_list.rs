//! `cargo bench -- --list`: the regression core first, then all kernels.

use super::judge::Judged;
use super::program::watch;
use super::{Case, TaskError};
use crate::root;
use std::process::Command;

pub(crate) fn cases() -> Vec<Case> {
    vec![Case::new("bench", "list", 0, |_, _| listed())]
}

/// Not built for speed, so that it takes what has been built for the tests; `tests/tests/readme.rs` holds the rest.
fn listed() -> Result<Judged, TaskError> {
    let profile = if cfg!(debug_assertions) { "dev" } else { "bench" };
    let said = watch(
        Command::new("cargo")
            .args([
                "bench",
                "--workspace",
                "--profile",
                profile,
                "--bench",
                "kernels",
                "--",
                "--list",
            ])
            .current_dir(root()),
    )?;
    let names: Vec<&str> = said.out.lines().filter(|l| l.ends_with(": benchmark")).collect();
    let first = names.first().is_some_and(|n| n.starts_with("regression"));
    let all = [
        "FRF",
        "pole fit",
        "basis poles",
        "frequency response",
        "closed-loop simulation",
    ];
    let has_all = all.iter().all(|k| names.iter().any(|n| n.starts_with(k)));
    Ok(Judged::new(
        first && has_all,
        &said,
        "cargo bench -- --list",
        "regression core first, all kernels",
    ))
}
