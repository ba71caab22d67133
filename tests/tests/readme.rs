//! What the README says, happens: every command of its tables and examples exists, has the options of its row, and does something.
//!
//! Programs are built as the tests are and asked for their help; what is cheap is run.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a check that cannot read the workspace must fail"
)]

use cargo_metadata::{Message, Metadata, MetadataCommand};
use lpv_tests::{cargo, output_of, root};
use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::PathBuf;
use std::process::Command;
use std::sync::OnceLock;

fn read(name: &str) -> String {
    let path = root().join(name);
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// The profile of the tests.
const PROFILE: &str = if cfg!(debug_assertions) { "dev" } else { "release" };

/// The programs of the workspace by name.
fn programs() -> &'static BTreeMap<String, PathBuf> {
    static PROGRAMS: OnceLock<BTreeMap<String, PathBuf>> = OnceLock::new();
    PROGRAMS.get_or_init(|| {
        let built = output_of(&mut cargo(&[
            "build",
            "--workspace",
            "--profile",
            PROFILE,
            "--bins",
            "--message-format",
            "json",
        ]));
        Message::parse_stream(Cursor::new(built))
            .filter_map(|message| match message.unwrap() {
                Message::CompilerArtifact(artifact) => Some((
                    artifact.target.name,
                    PathBuf::from(artifact.executable?.as_std_path()),
                )),
                _ => None,
            })
            .collect()
    })
}

/// Standard output of a program of the workspace that ends well.
fn said(program: &str, arguments: &[&str]) -> Result<String, String> {
    let file = programs()
        .get(program)
        .ok_or(format!("there is no program `{program}`"))?;
    let output = Command::new(file)
        .args(arguments)
        .current_dir(root())
        .output()
        .unwrap();
    if output.status.success() {
        Ok(String::from_utf8_lossy(&output.stdout).into_owned())
    } else {
        Err(String::from_utf8_lossy(&output.stderr).into_owned())
    }
}

/// Rows of the table of commands: what is typed, and what the README says of it.
fn rows() -> Vec<(String, String)> {
    let readme = read("README.md");
    let table = readme.split("\n## Commands\n").nth(1).unwrap();
    let rows: Vec<_> = table
        .lines()
        .skip_while(|l| !l.starts_with("|---"))
        .skip(1)
        .take_while(|l| l.starts_with('|'))
        .map(|line| {
            let mut cells = line.trim_matches('|').splitn(2, '|').map(str::trim);
            let command = cells.next().unwrap().trim_matches('`').to_owned();
            (command, cells.next().unwrap().to_owned())
        })
        .collect();
    assert!(rows.len() >= 10, "only {} rows found", rows.len());
    rows
}

/// Lines of the README's shell blocks.
fn examples() -> Vec<String> {
    let readme = read("README.md");
    readme
        .split("```sh\n")
        .skip(1)
        .flat_map(|rest| rest.split("```").next().unwrap_or_default().lines())
        .map(|line| line.split('#').next().unwrap_or_default().trim().to_owned())
        .filter(|line| !line.is_empty())
        .collect()
}

/// The `--options` in a text.
fn options(text: &str) -> Vec<&str> {
    text.split(|c: char| c.is_whitespace() || matches!(c, '`' | ',' | ';' | ')' | '('))
        .filter(|word| word.len() > 2 && word.starts_with("--"))
        .collect()
}

/// What is wrong with a task of xtask: no help, or options of its row that it does not have.
fn wrong_task(command: &str, row: &str) -> Vec<String> {
    let name = command.split_whitespace().nth(2).unwrap_or_default();
    // Two tasks hand their options on to a program of the benches, which has their help.
    let passed_on = ["peers", "limits"].contains(&name);
    let help = match passed_on {
        true => said(name, &["--help"]),
        false => said("xtask", &[name, "--help"]),
    };
    let listed = said("xtask", &["--help"]).unwrap_or_default();
    let has_line = |text: &str, start: &str| text.lines().any(|l| l.trim_start().starts_with(start));
    let mut wrong = Vec::new();
    if !has_line(&listed, &format!("{name} ")) {
        wrong.push(format!("{command}: `cargo xtask --help` does not list it"));
    }
    match help {
        Err(error) => wrong.push(format!("{command}: {error}")),
        Ok(help) => wrong.extend(
            [options(command), options(row)]
                .concat()
                .into_iter()
                .filter(|o| !has_line(&help, &format!("{o} ")) && !has_line(&help, &format!("{o}\n")))
                .filter(|o| !help.lines().any(|l| l.trim() == *o))
                .map(|o| format!("{command}: its help has no {o}")),
        ),
    }
    wrong
}

#[test]
fn the_commands_of_the_table_do_what_their_rows_say() {
    let mut wrong = Vec::new();
    for (command, row) in rows() {
        if command.starts_with("cargo xtask ") {
            wrong.extend(wrong_task(&command, &row));
        } else if command == "bash .ci/run" {
            let script = read(".ci/run");
            let steps = [
                "cargo fmt",
                "cargo clippy",
                "cargo doc",
                "cargo test",
                "reproduce --quick --check",
                "blind --quick",
            ];
            wrong.extend(
                steps
                    .iter()
                    .filter(|s| !script.contains(**s))
                    .map(|s| format!(".ci/run does not run {s}")),
            );
        } else if command != "cargo bench" {
            wrong.push(format!("{command}: nothing here tells whether it works"));
        }
    }
    assert!(read(".cargo/config.toml").contains("xtask = \"run --quiet --release --package xtask --\""));
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

fn metadata() -> Metadata {
    MetadataCommand::new()
        .manifest_path(root().join("Cargo.toml"))
        .no_deps()
        .other_options(["--offline".to_string()])
        .exec()
        .unwrap()
}

/// The benches that `cargo bench` runs without further words: package and name.
fn default_benches() -> Vec<(String, String)> {
    let metadata = metadata();
    let mut found = Vec::new();
    for package in &metadata.packages {
        if !metadata.workspace_default_members.contains(&package.id) {
            continue;
        }
        let manifest: toml::Table = std::fs::read_to_string(&package.manifest_path)
            .unwrap()
            .parse()
            .unwrap();
        let off = |bench: &toml::Value| bench.get("bench").and_then(toml::Value::as_bool) == Some(false);
        let benches = manifest.get("bench").and_then(toml::Value::as_array);
        for bench in benches.into_iter().flatten().filter(|b| !off(b)) {
            let name = bench.get("name").and_then(toml::Value::as_str).unwrap();
            found.push((package.name.to_string(), name.to_owned()));
        }
    }
    found
}

#[test]
fn cargo_bench_runs_the_regression_core_first_and_then_the_other_kernels() {
    assert_eq!(
        default_benches(),
        [("lpv-kernels".to_owned(), "kernels".to_owned())]
    );
    // As `cargo bench -- --list`, but not built for speed; by name, since the whole workspace has been built for the tests.
    let listed = output_of(&mut cargo(&[
        "bench",
        "--workspace",
        "--profile",
        PROFILE,
        "--bench",
        "kernels",
        "--",
        "--list",
    ]));
    let names: Vec<&str> = listed
        .lines()
        .filter_map(|l| l.strip_suffix(": benchmark"))
        .collect();
    let first = names.first().copied().unwrap_or_default();
    assert!(first.starts_with("regression"), "{listed}");
    for kernel in [
        "regression, 21 positions",
        "interpolation",
        "leave-one-out",
        "FRF",
        "pole fit",
        "basis poles",
        "frequency response",
        "closed-loop simulation",
    ] {
        assert!(
            names.iter().any(|n| n.starts_with(kernel)),
            "no {kernel} in\n{listed}"
        );
    }
}

#[test]
fn the_examples_of_the_program_are_commands_with_these_options() {
    let mut wrong = Vec::new();
    let lines: Vec<String> = examples().into_iter().filter(|l| l.starts_with("lpv ")).collect();
    assert!(lines.len() >= 7, "only {} examples found", lines.len());
    for line in lines {
        let name = line.split_whitespace().nth(1).unwrap_or_default();
        match said("lpv", &[name, "--help"]) {
            Err(error) => wrong.push(format!("{line}: {error}")),
            Ok(help) => wrong.extend(
                line.split_whitespace()
                    .filter(|w| w.starts_with('-'))
                    .filter(|o| !help.contains(&format!("{o} ")) && !help.contains(&format!("{o}, ")))
                    .map(|o| format!("{line}: `lpv {name} --help` has no {o}")),
            ),
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// The chain of the README's example on a small record, each with the file or the words that it promises.
#[test]
fn the_examples_of_the_program_do_what_they_say() {
    let place = tempfile::tempdir().unwrap();
    let axis = place.path().join("axis");
    std::fs::create_dir(&axis).unwrap();
    // One mode at a tenth of the sample rate under a periodic input, and noise from a counter.
    let (mut y, mut text) = ([0.0_f64; 2], String::from("r,u,y\n"));
    let (a1, a2) = (
        2.0 * 0.985 * (0.2 * std::f64::consts::PI).cos(),
        -0.985_f64.powi(2),
    );
    let mut state = 1_u64;
    let mut noise = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / f64::from(1 << 24) - 0.5
    };
    let input: Vec<f64> = (0..256).map(|_| noise()).collect();
    for k in 0..256 * 8 {
        let u = input[k % 256];
        let next = a1 * y[0] + a2 * y[1] + 0.1 * input[(k + 255) % 256];
        y = [next, y[0]];
        text.push_str(&format!("{u},{u},{}\n", next + 1e-4 * noise()));
    }
    std::fs::write(axis.join("a.csv"), text).unwrap();
    let run = |arguments: &[&str]| {
        let output = Command::new(&programs()["lpv"])
            .args(arguments)
            .current_dir(place.path())
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "lpv {arguments:?}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    run(&[
        "new",
        "axis/a.csv",
        "--sample-rate",
        "1000",
        "--input",
        "u",
        "--output",
        "y",
    ]);
    assert!(axis.join("experiment.toml").is_file());
    assert!(run(&["inspect", "axis"]).contains("8 x 256"));
    run(&["identify", "axis", "-o", "result/model.json"]);
    assert!(place.path().join("result/model.json").is_file());
    assert!(run(&["validate", "result/model.json", "axis", "--all"]).contains("frozen"));
    run(&["report", "result"]);
    assert!(place.path().join("result/report.html").is_file());
    run(&["convert", "result/model.json", "--to", "mat"]);
    assert!(place.path().join("result/model.mat").is_file());
}
