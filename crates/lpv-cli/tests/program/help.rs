//! What the program says about itself, and the files that it prints.

use crate::common::{Desk, MACHINE, machine_bundle, message_of, mode_bundle};

const COMMANDS: [&str; 9] = [
    "new",
    "inspect",
    "simulate",
    "identify",
    "validate",
    "convert",
    "report",
    "schema",
    "completions",
];

/// The commands that the help of a command shows below `Example:`.
fn examples(help: &str) -> Vec<String> {
    let (_, after) = help.split_once("Example:").unwrap();
    after
        .lines()
        .map(str::trim)
        .filter(|l| l.starts_with("lpv "))
        .map(str::to_owned)
        .collect()
}

#[test]
fn every_command_has_help_with_an_example_that_it_understands() {
    let desk = Desk::new();
    let all = desk.done("--help");
    for command in COMMANDS {
        assert!(all.contains(&format!("\n  {command}")), "{command} in {all}");
        let help = desk.done(&format!("{command} --help"));
        let examples = examples(&help);
        assert!(!examples.is_empty(), "{help}");
        for example in examples {
            let words = example.split(" > ").next().unwrap().strip_prefix("lpv ").unwrap();
            assert!(words.starts_with(command), "{example}");
            let out = desk.lpv(words);
            let message = String::from_utf8(out.stderr).unwrap();
            // The files of the example are not there, which is another complaint than one about the words.
            assert!(!message.contains("Usage:"), "{example}: {message}");
        }
    }
    assert!(desk.done("--version").starts_with("lpv "));
}

#[test]
fn words_that_mean_nothing_end_with_two() {
    let desk = Desk::new();
    let nothing = desk.lpv("");
    assert_eq!(nothing.status.code(), Some(2));
    assert!(String::from_utf8(nothing.stderr).unwrap().contains("Usage:"));
    for (line, part) in [
        ("identfy", "identify"),
        ("inspect --colour bundle", "--colour"),
        ("inspect", "<BUNDLE>"),
        ("inspect bundle --lines --json", "--lines"),
        ("identify bundle", "--output"),
        ("identify bundle -o m.json --structure rigid", "rigid-body"),
        ("convert m.json --to excel", "python"),
        ("convert m.json --to mat --points 1", "2..=1000"),
        ("simulate", "--output"),
        ("simulate -o b --hide friktion", "friktion"),
        ("completions cmd", "powershell"),
        ("new", "<FILE>"),
    ] {
        let message = desk.refused(line);
        assert!(message.contains(part), "{line}: {message}");
    }
    assert!(desk.files().is_empty());
}

#[test]
fn completions_and_schema() {
    let desk = Desk::new();
    for shell in ["bash", "zsh", "fish"] {
        let script = desk.done(&format!("completions {shell}"));
        assert!(COMMANDS.iter().all(|c| script.contains(c)), "{shell}");
    }
    let schema = desk.done("schema");
    let parsed: serde_json::Value = serde_json::from_str(&schema).unwrap();
    assert_eq!(
        parsed["properties"]["records"]["type"], "array",
        "the schema describes the records"
    );
    let committed = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/experiment.schema.json");
    assert_eq!(std::fs::read_to_string(committed).unwrap().trim(), schema.trim());
}

#[test]
fn the_printed_settings_are_those_without_a_file() {
    let desk = Desk::new();
    mode_bundle(&desk, "bundle");
    desk.write("identify.toml", desk.done("identify --print-config"));
    let plain = desk.done("identify bundle -o plain.json");
    let given = desk.done("identify bundle -o given.json --config identify.toml");
    assert_eq!(plain.replace("plain.json", "given.json"), given);
    assert_eq!(desk.bytes("plain.json"), desk.bytes("given.json"));
    // A flag wins over the file.
    desk.write("ten.toml", "order = 10\n");
    desk.json("identify bundle -o seed.json --config ten.toml --seed 3 --json");
    let account: serde_json::Value = serde_json::from_str(&desk.text("seed.json")).unwrap();
    assert_eq!(account["identification"]["config"]["seed"], 3);
    assert_eq!(account["identification"]["config"]["order"], 10);
}

#[test]
fn the_printed_machine_is_the_one_without_a_file() {
    let desk = Desk::new();
    desk.write("machine.toml", desk.done("simulate --print-machine"));
    desk.done("simulate --machine machine.toml -o given");
    desk.done("simulate -o plain");
    let files = desk.files();
    let of = |folder: &str| -> Vec<_> {
        let name = |p: &std::path::Path| p.strip_prefix(folder).map(ToOwned::to_owned).ok();
        files
            .iter()
            .filter_map(|(p, bytes)| Some((name(p)?, bytes)))
            .collect()
    };
    assert_eq!(of("plain").len(), 2 * 9 + 8 + 1);
    assert!(of("plain") == of("given"), "the bundles differ");
}

#[test]
fn a_key_that_is_unknown_is_answered_with_the_nearest() {
    let desk = Desk::new();
    mode_bundle(&desk, "bundle");
    for (content, parts) in [
        (
            "functons = 16\n",
            ["`functons`", "nearest: `functions`", "line 1"],
        ),
        (
            "seed = 1\nholdout = 0.1\n",
            ["`holdout`", "nearest: `hold-out`", "line 2"],
        ),
        (
            "polish = \"minmax\"\n",
            ["`minmax`", "nearest: `minimax`", "line 1"],
        ),
    ] {
        desk.write("settings.toml", content);
        let message = desk.refused("identify bundle -o model.json --config settings.toml");
        assert!(parts.iter().all(|p| message.contains(p)), "{message}");
        assert!(message.contains("settings.toml"), "{message}");
    }
    for (content, parts) in [
        (
            "positons = { count = 3 }\n".to_owned(),
            ["`positons`", "nearest: `positions`"],
        ),
        (
            MACHINE.to_owned() + "machine = { carriage-mass-k = 1.0 }\n",
            ["`carriage-mass-k`", "nearest: `carriage-mass-kg`"],
        ),
    ] {
        desk.write("settings.toml", content);
        let message = desk.refused("simulate --machine settings.toml -o out");
        assert!(parts.iter().all(|p| message.contains(p)), "{message}");
    }
    assert!(!desk.path("model.json").exists() && !desk.path("out").exists());
}

#[test]
fn simulate_hides_an_effect_and_writes_every_format() {
    let desk = Desk::new();
    machine_bundle(&desk);
    let toml = desk.text("bundle/experiment.toml");
    for format in ["csv", "parquet", "mat"] {
        let account = desk.json(&format!(
            "simulate --machine machine.toml --hide coulomb-friction --format {format} -o {format} --json"
        ));
        assert_eq!(
            (account["records"].as_u64(), account["samples"].as_u64()),
            (Some(12), Some(10 * 8 * 512 + 2 * 800))
        );
        // The friction shows nowhere in the description.
        let written = desk.text(&format!("{format}/experiment.toml"));
        assert_eq!(written.replace(&format!(".{format}"), ".npz"), toml);
    }
    let message = message_of("simulate", &desk.lpv("simulate --machine machine.toml -o bundle"));
    assert!(message.contains("bundle"), "{message}");
    assert_eq!(desk.text("bundle/experiment.toml"), toml);
}
