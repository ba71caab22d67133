//! Names and notes that would be code, formulas or commands somewhere else stay text.

use crate::common::{Desk, PERIOD, csv, entry, mode_record};
use lpv::convert;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use std::process::Command;

/// A bundle of the mode whose names are these.
fn named(desk: &Desk, output: &str, unit: &str, name: &str) {
    let (u, y) = mode_record();
    let table = csv(&[("u", &u), ("y", &y)]);
    let body = table.split_once('\n').unwrap().1;
    let mut head = ::csv::Writer::from_writer(Vec::new());
    head.write_record(["u", output]).unwrap();
    desk.write(
        "b/run.csv",
        [&head.into_inner().unwrap(), body.as_bytes()].concat(),
    );
    let quoted = |text: &str| toml::Value::String(text.to_owned()).to_string();
    desk.write(
        "b/experiment.toml",
        format!(
            "format = 1\nname = {}\nsample_rate = 10.0\n[channels.output]\ncolumns = [{}]\nunits = [{}]\n\
             [channels.input]\ncolumns = [\"u\"]\n{}",
            quoted(name),
            quoted(output),
            quoted(unit),
            entry("run.csv", Some(PERIOD), "estimation")
        ),
    );
}

fn shows_only_text(out: &str) {
    let hidden = |c: &char| (c.is_control() && *c != '\n') || matches!(c, '\u{202a}'..='\u{202e}');
    assert_eq!(out.chars().find(hidden), None, "{out:?}");
}

#[test]
fn a_terminal_gets_no_commands() {
    let desk = Desk::new();
    named(
        &desk,
        "y\u{1b}[31m",
        "m\u{202e}",
        "n\rerror: gone\u{1b}]0;t\u{7}\nerror: more",
    );
    for line in [
        "inspect b",
        "inspect b --json",
        "inspect b --lines",
        "identify b -o m.json",
        "validate m.json b --all",
    ] {
        let out = desk.done(line);
        shows_only_text(&out);
        assert!(!out.lines().any(|l| l.starts_with("error:")), "{out}");
    }
    desk.done("report m.json");
    shows_only_text(&desk.text("report.html"));
    // Errors too.
    let toml = desk.text("b/experiment.toml");
    desk.write("b/experiment.toml", toml.replace("31m", "32m"));
    let message = desk.refused("inspect b");
    shows_only_text(&message);
    assert!(message.contains("\\x1b[32m"), "{message}");
    shows_only_text(&String::from_utf8(desk.lpv("inspect \u{1b}[31m").stderr).unwrap());
    shows_only_text(&String::from_utf8(desk.lpv("inspekt\u{1b}[31m").stderr).unwrap());
}

#[test]
fn a_table_of_lines_keeps_its_columns() {
    let desk = Desk::new();
    for name in ["=y, left", "y\"z", "+1", "@SUM(A1)", "a\nb"] {
        named(&desk, name, "m", "n");
        let table = desk.done("inspect b --lines");
        let mut rows = ::csv::Reader::from_reader(table.as_bytes());
        let mut count = 0;
        for row in rows.records().map(Result::unwrap) {
            assert_eq!(row.len(), 10);
            assert!(!row[4].starts_with(['=', '+', '-', '@']), "{}", &row[4]);
            count += 1;
        }
        assert!(count > 50, "{table}");
    }
}

#[test]
fn names_with_combining_marks_give_a_module_that_parses() {
    let desk = Desk::new();
    let name = "Kraft_gro\u{308}\u{df}e \"1\"\nimport os; os.system('touch pwned')\n#";
    named(&desk, name, "m", "n");
    desk.done("identify b -o m.json");
    desk.done("convert m.json --to python");
    let module = desk.text("m.py");
    assert!(!module.lines().any(|l| l.starts_with("import os")), "{module}");
    let program = "import ast, sys\n\
                   names = [n for n in ast.parse(sys.stdin.read()).body if isinstance(n, ast.Assign) and n.targets[0].id == 'outputs']\n\
                   sys.stdout.buffer.write(ast.literal_eval(names[0].value)[0].encode('utf-8'))";
    let Ok(out) = Command::new("python3")
        .args(["-c", program])
        .env("PYTHONUTF8", "1")
        .stdin(std::fs::File::open(desk.path("m.py")).unwrap())
        .output()
    else {
        eprintln!("skipped: there is no python3");
        return;
    };
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    assert_eq!(String::from_utf8(out.stdout).unwrap(), name);
}

/// A model file whose explanation holds texts of somebody else.
fn explained(desk: &Desk, texts: [&str; 4]) {
    let [channel, unit, parameter, effect] = texts;
    let model: serde_json::Value = serde_json::from_str(
        &lpv_core::Model::DiscreteStateSpace(crate::common::mode())
            .to_json()
            .unwrap(),
    )
    .unwrap();
    let mut whole = model;
    let value = serde_json::json!({ "value": 1.5, "std": 0.1, "unit": unit });
    whole["explanation"] = serde_json::json!({
        "base": "servo-axis",
        "base_parameters": { parameter: value, "mass": value },
        "effects": [{
            "effect": effect,
            "family": "friction",
            "channel": channel,
            "parameters": { parameter: value, &format!("{parameter} "): value },
            "base_parameters_then": {},
            "evidence": {
                "held_out_gain_db": 1.0, "p_value": 0.1, "runner_up": null, "runner_up_margin_db": null
            },
        }],
    });
    desk.write("evil.json", whole.to_string());
}

#[test]
fn a_model_file_alone_runs_nothing() {
    let desk = Desk::new();
    let code = "x\nimport os; os.system('touch pwned')\n#";
    let mut modules = Vec::new();
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    let wild = "[\\n\\r\"'\\\\#a-z=;\\PC\u{0}\u{2028}\u{308}]{0,30}";
    for k in 0..40 {
        let text = match k {
            0 => code.to_owned(),
            1 => code.replace('\n', "\r"),
            2 => "\"\"\"\nimport os\n\"\"\"".to_owned(),
            _ => wild.new_tree(&mut runner).unwrap().current(),
        };
        explained(&desk, [&text, &text, &text, &text]);
        let file = convert::import(&desk.path("evil.json")).unwrap();
        for target in [convert::Target::Mat, convert::Target::Csv] {
            convert::export(&file, target, 3).unwrap();
        }
        let module = convert::export(&file, convert::Target::Python, 3).unwrap();
        modules.push(String::from_utf8(module).unwrap());
    }
    let program = "import ast, json, sys\n\
                   for module in json.load(sys.stdin):\n\
                   \x20   tree = ast.parse(module)\n\
                   \x20   found = {a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}\n\
                   \x20   assert found == {'control', 'numpy'}, module\n\
                   \x20   calls = [n for n in tree.body if isinstance(n, ast.Expr)]\n\
                   \x20   assert len(calls) == 1, module\n";
    desk.write("modules.json", serde_json::to_string(&modules).unwrap());
    let Ok(out) = Command::new("python3")
        .args(["-c", program])
        .env("PYTHONUTF8", "1")
        .stdin(std::fs::File::open(desk.path("modules.json")).unwrap())
        .output()
    else {
        eprintln!("skipped: there is no python3");
        return;
    };
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    assert!(modules.iter().all(|m| m.contains("effect1_")));
}
