//! Options of every command: threads, what is said and where, colour, manual pages.

use crate::common::{Desk, csv, machine_bundle, mode_bundle, mode_record};

/// What begins a colour.
const ESCAPE: &str = "\u{1b}[";

#[test]
fn the_number_of_threads_changes_no_bit() {
    let desk = Desk::new();
    machine_bundle(&desk);
    let machine = "simulate --machine machine.toml --hide coulomb-friction -o";
    let mut first: Option<Vec<(String, Vec<u8>)>> = None;
    for threads in [1, 2, 5] {
        // The same names within each folder, since a model names its bundle.
        let folder = format!("t{threads}");
        desk.done(&format!("{machine} {folder}/bundle --threads {threads}"));
        let mut said = Vec::new();
        for line in [
            "inspect {}/bundle --json",
            "identify {}/bundle -o {}/model.json",
            "validate {}/model.json {}/bundle --all --json",
            "diagnose {}/bundle -o {}/found",
            "report {}/model.json",
        ] {
            let line = line.replace("{}", &folder);
            let out = desk.judged(&format!("--threads {threads} {line}"));
            said.push((line.replace(&folder, ""), out.replace(&folder, "").into_bytes()));
        }
        for (file, bytes) in desk.files() {
            if let Ok(name) = file.strip_prefix(&folder) {
                said.push((name.to_string_lossy().into_owned(), bytes));
            }
        }
        let first = first.get_or_insert_with(|| said.clone());
        assert_eq!(first.len(), said.len());
        for (one, other) in first.iter().zip(&said) {
            assert!(one == other, "{} with {threads} threads", one.0);
        }
    }
    for wrong in ["0", "-1", "many"] {
        let message = desk.refused(&format!("inspect bundle --threads={wrong}"));
        assert!(message.contains("--threads"), "{message}");
    }
}

#[test]
fn quiet_leaves_the_verdict() {
    let desk = Desk::new();
    machine_bundle(&desk);
    assert_eq!(desk.done("-q simulate --machine machine.toml -o more"), "");
    for line in [
        "identify bundle -o model.json",
        "validate model.json bundle --all",
        "diagnose bundle -o found",
    ] {
        let whole = desk.judged(line);
        let first = whole.lines().next().unwrap();
        assert_eq!(
            desk.judged(&format!("{line} --quiet")).trim_end(),
            first,
            "{line}"
        );
    }
    let warnings = desk.json("inspect bundle --json")["warnings"].clone();
    let said = desk.done("inspect bundle -q");
    assert_eq!(said.lines().count(), warnings.as_array().unwrap().len(), "{said}");
    assert_eq!(desk.done("-q convert model.json --to csv"), "");
    assert_eq!(desk.done("-q report model.json"), "");
    // What another program reads stays whole, and so do errors.
    assert_eq!(desk.done("schema -q"), desk.done("schema"));
    assert_eq!(
        desk.done("inspect bundle --json -q"),
        desk.done("inspect bundle --json")
    );
    assert!(desk.refused("-q inspect nothing").contains("nothing"));
    assert!(desk.refused("inspect bundle -q -v").contains("--verbose"));
}

#[test]
fn verbose_tells_the_steps_and_nothing_else_changes() {
    let desk = Desk::new();
    machine_bundle(&desk);
    let plain = desk.judged("identify bundle -o model.json");
    let out = desk.lpv("identify bundle -o model.json -v");
    assert_eq!(String::from_utf8(out.stdout).unwrap(), plain);
    let steps = String::from_utf8(out.stderr).unwrap();
    for step in ["frequency responses", "poles of the responses", "basis"] {
        let of_step = |l: &str| l.starts_with(&format!("{step}: ")) && l.ends_with(" s");
        assert!(steps.lines().any(of_step), "{step} in {steps}");
    }
}

#[test]
fn colour_comes_where_it_is_asked_for() {
    let desk = Desk::new();
    mode_bundle(&desk, "bundle");
    // No terminal: none by itself.
    let plain = desk.done("identify bundle -o model.json");
    assert!(!plain.contains(ESCAPE));
    let always = desk.done("identify bundle -o model.json --color always");
    assert!(always.starts_with(ESCAPE), "{always}");
    // The first line alone, and without it the same text.
    let (first, rest) = always.split_once('\n').unwrap();
    assert!(!rest.contains(ESCAPE) && first.contains("\u{1b}[0m"));
    assert_eq!(rest, plain.split_once('\n').unwrap().1);
    let stderr = |line: &str| String::from_utf8(desk.lpv(line).stderr).unwrap();
    for (line, coloured) in [
        ("inspect nothing --color always", true),
        ("inspect nothing --color never", false),
        ("inspect nothing", false),
        ("--color always identfy", true),
        ("--color never identfy", false),
        ("identfy", false),
    ] {
        assert_eq!(stderr(line).contains(ESCAPE), coloured, "{line}");
    }
    // JSON is never painted.
    assert!(!desk.done("inspect bundle --json --color always").contains(ESCAPE));
    let message = desk.refused("inspect bundle --color sometimes");
    assert!(message.contains("always"), "{message}");
}

#[test]
fn a_terminal_shows_colour_unless_the_environment_forbids() {
    let desk = Desk::new();
    mode_bundle(&desk, "bundle");
    let run = |setting: &str| {
        let line = format!(
            "{setting} {} identify bundle -o model.json",
            env!("CARGO_BIN_EXE_lpv")
        );
        // A program that gives its command a terminal.
        let mut script = std::process::Command::new("script");
        script
            .args(["-qec", &line, "/dev/null"])
            .env("TERM", "xterm")
            .env_remove("NO_COLOR")
            .current_dir(desk.path(""));
        Some(String::from_utf8_lossy(&script.output().ok()?.stdout).into_owned())
    };
    let (Some(plain), Some(forbidden)) = (run("env"), run("env NO_COLOR=1")) else {
        eprintln!("skipped: there is no `script`");
        return;
    };
    let painted = |text: &str| text.contains("\u{1b}[1m\u{1b}[3") || text.contains("\u{1b}[1;3");
    assert!(painted(&plain), "{plain:?}");
    assert!(!painted(&forbidden), "{forbidden:?}");
    // There a person sees what runs.
    assert!(plain.contains("so far"), "{plain:?}");
}

#[test]
fn every_command_has_a_manual_page() {
    let desk = Desk::new();
    desk.done("man pages/man1");
    let help = desk.done("--help");
    let (_, commands) = help.split_once("Commands:\n").unwrap();
    let names = commands.lines().take_while(|l| !l.is_empty());
    let names: Vec<&str> = names.filter_map(|l| l.split_whitespace().next()).collect();
    assert!(names.len() >= 10 && !names.contains(&"man"), "{names:?}");
    for name in names.into_iter().filter(|n| *n != "help") {
        let page = desk.text(&format!("pages/man1/lpv-{name}.1"));
        assert!(page.contains(".SH OPTIONS") && page.contains("threads"), "{page}");
    }
    assert!(desk.text("pages/man1/lpv.1").contains("Exit codes"));
}

#[test]
fn a_model_that_fails_its_check_ends_with_three_however_it_is_told() {
    let desk = Desk::new();
    mode_bundle(&desk, "bundle");
    desk.done("identify bundle -o model.json");
    // The same machine with the opposite sign.
    let (u, y) = mode_record();
    let opposite: Vec<f64> = y.iter().map(|y| -y).collect();
    desk.write("other/run.csv", csv(&[("u", &u), ("y", &opposite)]));
    desk.write("other/experiment.toml", desk.text("bundle/experiment.toml"));
    for form in ["", "--json", "--quiet", "--color always"] {
        let out = desk.lpv(&format!("validate model.json other --all {form}"));
        let said = String::from_utf8(out.stdout).unwrap();
        assert_eq!(out.status.code(), Some(3), "{form}: {said}");
        match form {
            "--json" => {
                let account: serde_json::Value = serde_json::from_str(&said).unwrap();
                assert_eq!(account["verdict"]["worth"], "not-a-model");
            }
            // Red.
            "--color always" => assert!(said.starts_with("\u{1b}[1m\u{1b}[31m"), "{said:?}"),
            _ => assert!(said.starts_with("not a model of this machine"), "{said}"),
        }
    }
    for form in ["", "--json", "--quiet"] {
        let out = desk.lpv(&format!("validate model.json bundle --all {form}"));
        assert_eq!(out.status.code(), Some(0), "{form}");
    }
}
