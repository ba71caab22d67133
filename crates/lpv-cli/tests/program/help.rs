//! What the program says about itself, and the files that it prints.

use crate::common::{Desk, MACHINE, machine_bundle, message_of, mode_bundle};

const COMMANDS: [&str; 11] = [
    "new",
    "inspect",
    "simulate",
    "identify",
    "validate",
    "fleet",
    "merge",
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
fn a_value_out_of_range_is_answered_with_its_line_and_key() {
    let desk = Desk::new();
    for (content, part) in [
        (
            "[machine]\ncarriage-mass-kg = 0.0\n",
            "m.toml:2:1: [machine] carriage-mass-kg = 0: ",
        ),
        (
            "\n[servo]\n  bandwidth-hz = -0.5\n",
            "m.toml:3:3: [servo] bandwidth-hz = -0.5: ",
        ),
        (
            "[controller]\nbandwidth-hz = 0.0\n",
            "m.toml:2:1: [controller] bandwidth-hz = 0: ",
        ),
        (
            "controller = { bandwidth-hz = 0.0 }\n",
            "m.toml:1:16: [controller] bandwidth-hz = 0: ",
        ),
        ("seed = 1\nsample-rate = -2.0\n", "m.toml:2:1: sample-rate = -2: "),
        ("[multisine]\nperiods = 1\n", "m.toml:2:1: [multisine] periods = "),
        ("[positions]\ncount = 0\n", "m.toml:2:1: [positions] count = 0: "),
        (
            "[setpoints]\nstroke-fraction = 2.0\n",
            "m.toml:2:1: [setpoints] stroke-fraction = 2: ",
        ),
        (
            "[setpoints]\ny2-limits = { speed = 0.0 , acceleration = 1.0, jerk = 1.0 }\n",
            "m.toml:2:15: [setpoints] y2-limits.speed = 0: ",
        ),
        (
            "[noise]\ny1-std-m = -1.0\n",
            "m.toml:2:1: [noise] y1-std-m = -1: ",
        ),
        (
            "sample-rate = 1e12\n",
            "m.toml: at sample-rate = 1000000000000 the closed loop",
        ),
        ("[controller]\nbandwidth-hz = 5.0\n", "m.toml: closed loop not"),
    ] {
        desk.write("m.toml", content);
        let message = desk.refused("simulate --machine m.toml -o out");
        assert!(message.contains(part), "{content}: {message}");
        assert!(!desk.path("out").exists());
    }
    mode_bundle(&desk, "bundle");
    desk.write("s.toml", "seed = 1\nfuzziness = 0.5\n");
    let message = desk.refused("identify bundle -o m.json -c s.toml");
    assert!(
        message.contains("s.toml:2:1: fuzziness = 0.5: it must be above 1"),
        "{message}"
    );
}

#[test]
fn a_slip_is_answered_with_what_was_meant() {
    let desk = Desk::new();
    mode_bundle(&desk, "bundle");
    desk.done("identify bundle -o m.json");
    desk.write("alone.csv", "u,y\n0,1\n1,2\n");
    desk.write("alone.mf4", "of an instrument");
    for (line, part) in [
        ("simulate -o out --hide abbe", "nearest: `abbe-offset`"),
        ("inspect alone.csv", "`lpv new`"),
        ("inspect alone.mf4", "`lpv new`"),
        (
            "inspect bundle/run.csv",
            "give the folder of its experiment.toml, bundle",
        ),
        ("identify bundle/run.csv -o x.json", "experiment.toml, bundle"),
        ("inspect m.json", "lpv report"),
        ("new alone.csv --sample-rate 0", "above zero"),
        ("new alone.csv --sample-rate -5", "above zero"),
        ("new alone.csv --period 1", "2 or more"),
        ("diagnose bundle -o found --time-limit soon", "seconds"),
    ] {
        let message = desk.refused(line);
        assert!(message.contains(part), "{line}: {message}");
    }
    // Refusals that know no place of their own name the bundle.
    let message = desk.refused("identify bundle -o x.json --structure lpv");
    assert!(
        message.starts_with("error: bundle: ") && message.contains("scheduling"),
        "{message}"
    );
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
