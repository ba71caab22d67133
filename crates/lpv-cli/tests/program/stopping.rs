//! Whatever ends a run early: nothing is half written, one sentence says so, and the next run into the same place works.

#[cfg(unix)]
use crate::common::signal;
use crate::common::{Desk, machine_bundle};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// A simulation that takes some seconds.
const LONG: &str = "seed = 3\npositions = { count = 40 }\nmoves = { estimation = 0, validation = 0 }\n";

/// The folder in which a bundle is being made.
fn stage(folder: &Path) -> bool {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries
        .map(|e| e.path().join("records"))
        .any(|records| records.read_dir().is_ok_and(|mut r| r.next().is_some()))
}

/// A simulation in the middle of its records.
fn running(desk: &Desk) -> Child {
    desk.write("long.toml", LONG);
    let words = ["simulate", "--machine", "long.toml", "-o", "above/out"];
    let child = desk
        .program(&words)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    while !stage(&desk.path("above/out")) {
        assert!(begun.elapsed() < Duration::from_secs(60), "no record is written");
        std::thread::sleep(Duration::from_millis(2));
    }
    child
}

fn message(out: &Output, code: i32) -> String {
    let message = String::from_utf8(out.stderr.clone()).unwrap();
    assert_eq!(out.status.code(), Some(code), "{message}");
    assert_eq!(message.lines().count(), 1, "{message}");
    assert!(out.stdout.is_empty());
    message
}

#[test]
#[cfg(unix)]
fn a_signal_leaves_nothing() {
    for (name, word) in [("-INT", "Ctrl-C"), ("-TERM", "a signal")] {
        let desk = Desk::new();
        let child = running(&desk);
        signal(&child, name);
        let told = message(&child.wait_with_output().unwrap(), 130);
        assert!(
            told.contains(word) && told.contains("no result was written"),
            "{told}"
        );
        assert!(!desk.path("above").exists());
    }
}

#[test]
fn a_killed_run_does_not_disturb_the_next() {
    let desk = Desk::new();
    let mut child = running(&desk);
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(stage(&desk.path("above/out")) && !desk.path("above/out/experiment.toml").exists());
    desk.write("machine.toml", crate::common::MACHINE);
    desk.done("simulate --machine machine.toml -o above/out");
    desk.done("inspect above/out");
    // Two settings, a description, records.
    assert_eq!(desk.files().len(), 2 + 1 + 12);
}

/// A diagnosis into `found` that has begun its work.
#[cfg(unix)]
fn diagnosing(desk: &Desk) -> Child {
    use std::io::{BufRead, BufReader};
    let mut child = desk
        .program(&["diagnose", "bundle", "-o", "found", "--verbose"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // It tells its first step once that is done, and the competition of effects comes after.
    let mut first = String::new();
    BufReader::new(child.stderr.as_mut().unwrap())
        .read_line(&mut first)
        .unwrap();
    assert!(first.ends_with(" s\n"), "{first}");
    child
}

#[test]
#[cfg(unix)]
fn results_of_an_earlier_run_survive_a_later_one_that_is_stopped() {
    let desk = Desk::new();
    machine_bundle(&desk);
    desk.judged("diagnose bundle -o found");
    let before = desk.files();
    for name in ["-INT", "-TERM", "-KILL"] {
        let mut child = diagnosing(&desk);
        signal(&child, name);
        let code = child.wait().unwrap().code();
        assert_eq!(code, (name != "-KILL").then_some(130), "{name}");
        assert!(before == desk.files(), "{name}");
    }
    desk.judged("diagnose bundle -o found");
    assert!(before == desk.files());
}

#[test]
fn a_time_limit_stops_every_long_command() {
    let desk = Desk::new();
    machine_bundle(&desk);
    desk.done("identify bundle -o model.json");
    desk.write("long.toml", LONG);
    let before = desk.files();
    for line in [
        "inspect bundle",
        "simulate --machine long.toml -o out",
        "identify bundle -o other.json",
        "validate model.json bundle --all",
        "diagnose bundle -o found",
        "report model.json",
    ] {
        let told = message(&desk.lpv(&format!("{line} --time-limit 0.004")), 1);
        assert!(
            told.contains("time limit of 0.004 s") && told.contains("no result was written"),
            "{line}: {told}"
        );
        assert!(before == desk.files(), "{line}");
        assert!(
            desk.refused(&format!("{line} --time-limit 0"))
                .contains("above zero")
        );
    }
    // Time enough changes nothing.
    desk.done("report model.json --time-limit 1e9");
}

#[test]
#[cfg(unix)]
fn a_full_disk_is_one_message_and_leaves_nothing() {
    let desk = Desk::new();
    machine_bundle(&desk);
    desk.done("identify bundle -o model.json");
    let before = desk.files();
    // A limit on the size of files stands for a disk that is full.
    let limited = |blocks: usize, line: &str| {
        let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" {line}");
        let mut command = desk.program(&["unused"]);
        let program = command.get_program().to_owned();
        command = Command::new("sh");
        command
            .args(["-c", &script])
            .arg(program)
            .current_dir(desk.path(""));
        command.output().unwrap()
    };
    for format in ["npz", "csv", "mat", "parquet"] {
        let line = format!("simulate --machine machine.toml --format {format} -o out");
        let told = message(&limited(20, &line), 1);
        assert!(
            told.contains("grid00a") && told.contains("too large"),
            "{format}: {told}"
        );
        assert!(before == desk.files() && !desk.path("out").exists());
        desk.done(&line);
        std::fs::remove_dir_all(desk.path("out")).unwrap();
    }
    for line in [
        "identify bundle -o model.json",
        "convert model.json --to csv",
        "report model.json",
    ] {
        let told = message(&limited(1, line), 1);
        assert!(told.contains("cannot be written"), "{told}");
        assert!(before == desk.files(), "{line}");
    }
}
