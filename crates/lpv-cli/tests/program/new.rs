//! `lpv new`: from record files to a bundle.

use crate::common::{Desk, PERIOD, csv, entry, head, mode_record, number};
use experiment_data::{Bundle, BundleWriter, RecordFormat};
use lpv_core::RecordKind;

/// The mode's record with the time of each sample.
fn timed(desk: &Desk, name: &str) {
    let (u, y) = mode_record();
    let t: Vec<f64> = (0..u.len()).map(|n| n as f64 / 10.0).collect();
    desk.write(name, csv(&[("t", &t), ("u", &u), ("y", &y)]));
}

#[test]
fn a_csv_file_alone_becomes_a_bundle_and_a_model() {
    let desk = Desk::new();
    timed(&desk, "data/run.csv");
    let said = desk.done("new data/run.csv");
    for part in [
        "sample_rate = 10",
        "`t`",
        "256",
        "input: u",
        "output: y",
        "lpv inspect",
    ] {
        assert!(said.contains(part), "{part} in {said}");
    }
    let bundle = Bundle::open(&desk.path("data")).unwrap();
    let d = bundle.description();
    assert_eq!((d.sample_rate_hz, d.name.as_str()), (10.0, "data"));
    assert_eq!(
        (
            d.channels.input.columns.as_slice(),
            d.channels.output.columns.as_slice()
        ),
        (&["u".to_owned()][..], &["y".to_owned()][..])
    );
    assert_eq!(
        bundle.load(0).unwrap().kind,
        RecordKind::Periodic { period: PERIOD }
    );
    let summary = desk.json("identify data -o model.json --json");
    assert_eq!(
        (summary["positions"].as_u64(), summary["order"].as_u64()),
        (Some(1), Some(2))
    );
}

#[test]
fn every_kind_of_file_below_records() {
    let desk = Desk::new();
    let (u, y) = mode_record();
    desk.write("source/run.csv", csv(&[("u", &u), ("y", &y)]));
    let toml = head(10.0) + &entry("run.csv", Some(PERIOD), "estimation");
    desk.write("source/experiment.toml", toml);
    let source = Bundle::open(&desk.path("source")).unwrap();
    for (ending, format) in [
        ("npz", RecordFormat::Npz),
        ("parquet", RecordFormat::Parquet),
        ("mat", RecordFormat::Mat),
        ("csv", RecordFormat::Csv),
    ] {
        let mut writer =
            BundleWriter::create(&desk.path(ending), source.description().clone(), format).unwrap();
        writer.write(&source.load(0).unwrap()).unwrap();
        writer.finish().unwrap();
        let description = desk.path(&format!("{ending}/experiment.toml"));
        std::fs::remove_file(&description).unwrap();
        desk.done(&format!(
            "new {ending}/records/run.{ending} --sample-rate 10 --name axis"
        ));
        // The bundle is the folder above `records`.
        let bundle = Bundle::open(&desk.path(ending)).unwrap();
        assert_eq!(bundle.description().name, "axis");
        assert_eq!(
            bundle.load(0).unwrap().outputs,
            source.load(0).unwrap().outputs,
            "{ending}"
        );
        desk.done(&format!("identify {ending} -o {ending}.json"));
    }
}

#[test]
fn positions_validation_and_dead_columns_are_seen() {
    let desk = Desk::new();
    let (u, y) = mode_record();
    let rest = vec![0.5; u.len()];
    for (name, at) in [("a", -0.1), ("b", 0.2)] {
        let p = vec![at; u.len()];
        let columns: [(&str, &[f64]); 4] = [("u", &u), ("y", &y), ("slide", &p), ("x", &rest)];
        desk.write(&format!("data/{name}.csv"), csv(&columns));
    }
    desk.write(
        "data/move.csv",
        csv(&[
            ("u", &u[..300]),
            ("y", &y[..300]),
            ("slide", &u[..300]),
            ("x", &rest[..300]),
        ]),
    );
    let said = desk
        .json("new data/a.csv data/b.csv data/move.csv --sample-rate 10 --validation data/move.csv --json");
    assert_eq!(said["questions"], serde_json::json!([]), "{said:#}");
    let guesses = said["guesses"].to_string();
    assert!(
        guesses.contains("`slide` is the scheduling signal") && guesses.contains("`x` is constant"),
        "{guesses}"
    );
    let summary = desk.json("inspect data --json");
    assert_eq!(summary["coverage"]["positions"], serde_json::json!([-0.1, 0.2]));
    assert_eq!(summary["records"][2]["purpose"], "validation");
    assert_eq!(summary["records"][2]["kind"], "transient");
}

#[test]
fn what_nobody_can_guess_is_marked() {
    let desk = Desk::new();
    let (u, y) = mode_record();
    desk.write("data/run.csv", csv(&[("alpha", &u), ("beta", &y)]));
    let said = desk.done("new data/run.csv");
    for part in [
        "fill in: sample_rate",
        "--sample-rate",
        "fill in: channels.output",
        "fill in: channels.input",
        "`alpha`",
        "FILL IN",
    ] {
        assert!(said.contains(part), "{part} in {said}");
    }
    let text = desk.text("data/experiment.toml");
    assert_eq!(
        text.lines().filter(|l| l.contains("# FILL IN")).count(),
        3,
        "{text}"
    );
    // As it is, no command takes it for data.
    assert!(desk.refused("inspect data").contains("experiment.toml"));
    // What the user adds answers the questions.
    let said = desk.done("new data/run.csv --force --sample-rate 10 --input alpha --output beta");
    assert!(!said.contains("fill in"), "{said}");
    let lines = desk.json("inspect data --json");
    assert!(number(&lines, "/experiments/0/band_hz/1") > 3.8);
}

#[test]
fn a_time_column_that_is_uneven_is_no_clock() {
    let desk = Desk::new();
    let (u, y) = mode_record();
    let mut t: Vec<f64> = (0..u.len()).map(|n| n as f64 / 10.0).collect();
    t[100] += 0.05;
    desk.write("run.csv", csv(&[("time", &t), ("u", &u), ("y", &y)]));
    let said = desk.done("new run.csv");
    assert!(said.contains("`time` does not advance evenly"), "{said}");
}

/// The same machine in text files of every layout: one draft each, without a question, and the same numbers.
#[test]
fn text_tables_of_all_kinds_need_no_edit() {
    let (u, y) = mode_record();
    let rows = 2 * PERIOD;
    let desk = Desk::new();
    let mut count = 0;
    for (separator, decimal) in [
        (",", "."),
        (";", ","),
        (";", "."),
        ("\t", ","),
        ("\t", "."),
        ("  ", "."),
    ] {
        for preamble in [
            "",
            "Logger,X3\nVersion;1.2\n\n",
            "# measured by me\n",
            "***\nA\tB\t2\n",
        ] {
            for units_row in [false, true] {
                // Samples a second, and the unit in which the time stands.
                for (rate, unit, seconds) in [
                    (100.0, "s", 1.0),
                    (0.25, "s", 1.0),
                    (8e3, "ms", 1e-3),
                    (1e6, "us", 1e-6),
                    (2e5, "ns", 1e-9),
                ] {
                    count += 1;
                    let file = format!("{count}/a.txt");
                    let cell = |v: f64| format!("{v}").replace('.', decimal);
                    let mut text = preamble.to_owned();
                    if units_row {
                        text += &["Zeit", "Kraft", "Weg"].join(separator);
                        text += &format!("\n{}\n", [unit, "N", "mm"].join(separator));
                    } else {
                        text += &[&format!("Zeit[{unit}]"), "Kraft[N]", "Weg[mm]"].join(separator);
                        text += "\n";
                    }
                    for k in 0..rows {
                        let t = (k as f64 / rate / seconds * 1e9).round() / 1e9;
                        text += &([cell(t), cell(u[k]), cell(y[k])].join(separator) + "\n");
                    }
                    desk.write(&file, text);
                    let draft = lpv::new::draft(&[desk.path(&file)], &lpv::new::Known::default()).unwrap();
                    let kind = format!(
                        "{separator:?} {decimal} {preamble:?} {units_row} {rate} {unit}: {}",
                        draft.text
                    );
                    assert!(draft.questions.is_empty(), "{:?} {kind}", draft.questions);
                    draft.write(lpv::new::Overwrite::Refuse).unwrap();
                    let bundle = Bundle::open(&desk.path(&count.to_string())).unwrap();
                    let found = bundle.description().sample_rate_hz;
                    assert!((found / rate - 1.0).abs() < 1e-9, "{found} {kind}");
                    let record = bundle.load(0).unwrap();
                    assert_eq!(record.inputs.columns, [&u[..rows]], "{kind}");
                    assert_eq!(record.outputs.columns, [&y[..rows]], "{kind}");
                    assert_eq!(record.kind, RecordKind::Periodic { period: PERIOD }, "{kind}");
                    let d = bundle.description();
                    assert_eq!(
                        (
                            d.channels.input.units[0].as_str(),
                            d.channels.output.units[0].as_str()
                        ),
                        ("N", "mm")
                    );
                    // The time stays with the data, and its unit with it.
                    assert_eq!(d.channels.auxiliary.units, [unit], "{kind}");
                }
            }
        }
    }
    assert_eq!(count, 240);
}

#[test]
fn whole_steps_are_asked_about_unless_a_speed_tells_the_unit() {
    let desk = Desk::new();
    for (step, rates) in [(1.0, "1 or 1000"), (10.0, "0.1 or 100"), (0.5, "2 or 2000")] {
        let t: Vec<f64> = (0..400).map(|k| step * f64::from(k)).collect();
        let x: Vec<f64> = t.iter().map(|t| (2e-2 * t / step).sin()).collect();
        desk.write("ask.csv", csv(&[("time", &t), ("force", &x), ("position", &x)]));
        let said = desk.done("new ask.csv --force");
        assert!(
            said.contains("seconds (") && said.contains("milliseconds ("),
            "{said}"
        );
        let text = desk.text("experiment.toml");
        assert!(
            text.contains(&format!("sample_rate = 0.0  # FILL IN: {rates}")),
            "{text}"
        );
        // With the speed of the position beside it, only one unit fits.
        let v: Vec<f64> = t
            .iter()
            .map(|t| 2e-2 / (1e-3 * step) * (2e-2 * t / step).cos())
            .collect();
        let columns: [(&str, &[f64]); 4] = [
            ("time", &t),
            ("current", &v),
            ("actual_position", &x),
            ("actual_speed", &v),
        ];
        desk.write("told.csv", csv(&columns));
        let said = desk.done("new told.csv --force");
        let rate = 1e3 / step;
        assert!(
            said.contains(&format!("sample_rate = {rate} ")) && !said.contains("fill in: sample"),
            "{said}"
        );
        // What the user says counts, and a contradiction is asked about.
        let said = desk.done(&format!("new ask.csv --force --sample-rate {rate}"));
        assert!(!said.contains("fill in"), "{said}");
        let said = desk.done(&format!("new ask.csv --force --sample-rate {}", 3.0 * rate));
        assert!(said.contains("which is right?"), "{said}");
    }
    for rate in ["0", "-5", "nan"] {
        let message = desk.refused(&format!("new ask.csv --force --sample-rate={rate}"));
        assert!(message.contains("--sample-rate"), "{message}");
    }
}

#[test]
fn lost_samples_are_named_and_cut_out() {
    let desk = Desk::new();
    let (u, y) = mode_record();
    let t: Vec<f64> = (0..u.len()).map(|n| n as f64 / 2000.0).collect();
    let keep = |x: &[f64]| -> Vec<f64> {
        let lost = PERIOD / 2..PERIOD / 2 + 3;
        x.iter()
            .enumerate()
            .filter(|(k, _)| !lost.contains(k))
            .map(|(_, v)| *v)
            .collect()
    };
    desk.write(
        "run.csv",
        csv(&[("t", &keep(&t)), ("u", &keep(&u)), ("y", &keep(&y))]),
    );
    for line in ["new run.csv --force", "new run.csv --force --sample-rate 2000"] {
        let said = desk.done(line);
        let place = format!("3 samples are missing: 3 behind line {}", PERIOD / 2 + 1);
        assert!(said.contains(&place), "{said}");
        let bundle = Bundle::open(&desk.path(".")).unwrap();
        assert_eq!(bundle.description().sample_rate_hz, 2000.0);
        let record = bundle.load(0).unwrap();
        assert_eq!(record.kind, RecordKind::Periodic { period: PERIOD });
        assert_eq!(record.outputs.columns[0], y[y.len() - record.len()..]);
    }
}

#[test]
fn a_position_is_found_by_what_it_does() {
    let (u, y) = mode_record();
    let warm: Vec<Vec<f64>> = [20.1, 20.3, 20.4].iter().map(|v| vec![*v; 300]).collect();
    for name in ["x_pos", "pos", "q", "stellung", "p", "setpoint_x"] {
        for (offset, scale) in [(0.0, 0.3), (60_000.0, 1.0), (0.0, 1e-6)] {
            let desk = Desk::new();
            for (k, warm) in warm.iter().enumerate() {
                let p = vec![offset + scale * (k as f64 - 1.0); 300];
                let columns: [(&str, &[f64]); 4] =
                    [("y1", &y[..300]), ("u1", &u[..300]), (name, &p), ("Temp", warm)];
                desk.write(&format!("d/{k}.csv"), csv(&columns));
            }
            let said = desk.done("new d/0.csv d/1.csv d/2.csv --sample-rate 10");
            assert!(
                said.contains(&format!("`{name}` is the scheduling signal")),
                "{said}"
            );
            assert!(!said.contains("fill in"), "{said}");
            let bundle = Bundle::open(&desk.path("d")).unwrap();
            assert_eq!(bundle.description().channels.scheduling.columns, [name]);
        }
    }
    // Only the names of the files tell the place: a question, not an answer.
    let desk = Desk::new();
    for k in 1..3 {
        desk.write(
            &format!("d/pos{k}.csv"),
            csv(&[("y1", &y[..300]), ("u1", &u[..300])]),
        );
    }
    let said = desk.done("new d/pos1.csv d/pos2.csv --sample-rate 10");
    assert!(said.contains("fill in: position"), "{said}");
}

#[test]
fn what_is_no_signal_is_left_out_and_named() {
    let desk = Desk::new();
    let (u, y) = mode_record();
    let mut text = String::from("nr,u1,y1,Ts,note,\n");
    for k in 0..200 {
        let ts = if k == 0 { "0.1" } else { "" };
        text += &format!("{k},{},{},{ts},word,\n", u[k], y[k]);
    }
    desk.write("run.csv", text);
    let said = desk.done("new run.csv --sample-rate 10");
    for part in [
        "`nr` counts the rows: left out",
        "`Ts` (no value in 199 of 200 rows, the first in line 3",
        "`note` (words (`word`))",
    ] {
        assert!(said.contains(part), "{part} in {said}");
    }
    assert!(!said.contains("fill in"), "{said}");
    desk.done("inspect .");
    let message = desk.refused("new run.csv --force --input U1");
    assert!(message.contains("nearest: `u1`"), "{message}");
}

#[test]
fn containers_of_matlab_are_read() {
    use experiment_data::mat::{Array, Value, write_values};
    let desk = Desk::new();
    let (u, y) = mode_record();
    let rows = 2 * PERIOD;
    let time: Vec<f64> = (0..rows).map(|k| k as f64 * 1e-3).collect();
    let array = |shape: &[u64], data: &[f64]| {
        Value::Array(Array {
            shape: shape.to_vec(),
            data: data.to_vec(),
        })
    };
    let row = |data: &[f64]| array(&[1, data.len() as u64], data);
    let text = |t: &str| Value::Text(t.to_owned());
    let named = |name: &str, value| (name.to_owned(), value);
    let signal = |label: &str, data: &[f64]| {
        vec![
            named("Name", text(label)),
            named("Type", row(&[1.0])),
            named("Data", row(data)),
        ]
    };
    // As ControlDesk writes them, the variable named after the file.
    for (file, shift) in [("exp1", 0), ("exp2", PERIOD)] {
        let part = |x: &[f64]| x[shift..shift + rows].to_vec();
        let log = Value::Struct(vec![
            named("X", Value::Struct(vec![named("Data", row(&time))])),
            named(
                "Y",
                Value::Structs(vec![
                    signal("Model/enc (mm)", &part(&y)),
                    signal("Model/input (V)", &part(&u)),
                ]),
            ),
            named(
                "Info",
                Value::Struct(vec![
                    named("RevisionMajor", row(&[1.0])),
                    named("Minor", row(&[2.0])),
                ]),
            ),
        ]);
        desk.write(
            &format!("d/{file}.mat"),
            write_values(&[named(file, log)]).unwrap(),
        );
    }
    let said = desk.done("new d/exp1.mat d/exp2.mat");
    assert!(!said.contains("fill in"), "{said}");
    let bundle = Bundle::open(&desk.path("d")).unwrap();
    assert_eq!(bundle.description().sample_rate_hz, 1000.0);
    for (k, shift) in [(0, 0), (1, PERIOD)] {
        let record = bundle.load(k).unwrap();
        assert_eq!(record.inputs.columns[0], u[shift..shift + rows]);
        assert_eq!(record.outputs.columns[0], y[shift..shift + rows]);
        assert_eq!(record.outputs.names, ["enc (mm)"]);
    }
    // A structure with time, a matrix of signals, a matrix by rows; settings beside them.
    let both: Vec<f64> = u[..rows].iter().chain(&y[..rows]).copied().collect();
    let by_row: Vec<f64> = (0..rows).flat_map(|k| [u[k], y[k]]).collect();
    let values = |data: &[f64], label: &str| {
        vec![
            named("values", array(&[rows as u64, 1], data)),
            named("label", text(label)),
        ]
    };
    let settings = |name: &str| named(name, row(&[3.0]));
    for (file, value, flags, scheme) in [
        (
            "s",
            Value::Struct(vec![
                named("time", array(&[rows as u64, 1], &time)),
                named(
                    "signals",
                    Value::Structs(vec![values(&u[..rows], "u"), values(&y[..rows], "y")]),
                ),
            ]),
            "",
            "[label=u].values",
        ),
        (
            "m",
            array(&[rows as u64, 2], &both),
            "--sample-rate 1000 --input m(:,1) --output m(:,2)",
            "",
        ),
        (
            "r",
            array(&[2, rows as u64], &by_row),
            "--sample-rate 1000 --input r(1,:) --output r(2,:)",
            "",
        ),
    ] {
        let many = ["a", "b", "c", "d6"].map(settings);
        let all: Vec<(String, Value)> = many
            .into_iter()
            .chain([named("w", row(&[0.0; 6])), named(file, value)])
            .collect();
        desk.write(&format!("{file}/x.mat"), write_values(&all).unwrap());
        // Names with commas are no list.
        let mut words = vec!["new".to_owned(), format!("{file}/x.mat")];
        words.extend(flags.split_whitespace().map(str::to_owned));
        let out = desk.program(&words).output().unwrap();
        let said = crate::common::stdout_of(flags, &out);
        assert!(!said.contains("fill in"), "{said}");
        assert!(
            said.contains("`a` (a single number)") && said.contains("`w` (6 rows"),
            "{said}"
        );
        let bundle = Bundle::open(&desk.path(file)).unwrap();
        assert_eq!(bundle.description().sample_rate_hz, 1000.0);
        let record = bundle.load(0).unwrap();
        assert_eq!(record.inputs.columns[0], u[..rows], "{file}");
        assert_eq!(record.outputs.columns[0], y[..rows], "{file}");
        assert!(desk.text(&format!("{file}/experiment.toml")).contains(scheme));
    }
}

#[test]
fn transient_records_of_any_lengths_are_one_bundle() {
    let desk = Desk::new();
    let (u, y) = mode_record();
    for (name, from, to) in [("a", 0, 400), ("b", 300, 690), ("c", 200, 560)] {
        desk.write(
            &format!("d/{name}.csv"),
            csv(&[("u", &u[from..to]), ("y", &y[from..to])]),
        );
    }
    let mut toml = head(20.0);
    for name in ["a.csv", "b.csv", "c.csv"] {
        toml += &entry(name, None, "estimation");
    }
    desk.write("d/experiment.toml", toml);
    let summary = desk.json("identify d -o m.json --json");
    assert!(
        summary["reasons"]
            .to_string()
            .contains("the first 360 of 3 of 3 records"),
        "{summary:#}"
    );
}

#[test]
fn a_folder_stands_for_its_record_files() {
    let desk = Desk::new();
    for name in ["d/b.csv", "d/a.csv", "d/.hidden.csv", "d/below/c.csv"] {
        timed(&desk, name);
    }
    desk.write("d/picture.png", "none");
    desk.write("d/ReadMe.txt", "how it was measured, and who to ask\n");
    desk.done("new d");
    let bundle = Bundle::open(&desk.path("d")).unwrap();
    let files: Vec<&str> = bundle
        .description()
        .records
        .iter()
        .map(|r| r.file.as_str())
        .collect();
    assert_eq!(files, ["a.csv", "b.csv"]);
    desk.write("none/deeper/e.csv", "t,y\n0,1\n");
    let said = desk.refused("new none");
    assert!(
        said.contains("no record files") && said.contains("none"),
        "{said}"
    );
    desk.write("d/z.csv", "what\nis\nthis\n");
    let said = desk.refused("new d --force");
    assert!(
        said.contains("z.csv") && said.contains("name the record files"),
        "{said}"
    );
    let said = desk.refused("new d/z.csv d/a.csv --force");
    assert!(
        said.contains("z.csv") && !said.contains("name the record files"),
        "{said}"
    );
    let said = desk.refused("new d d/a.csv --force");
    assert!(said.contains("a.csv") && said.contains("twice"), "{said}");
}

#[test]
fn a_description_that_exists_stays() {
    let desk = Desk::new();
    timed(&desk, "run.csv");
    desk.write("experiment.toml", "mine");
    let message = desk.refused("new run.csv");
    assert!(
        message.contains("experiment.toml") && message.contains("--force"),
        "{message}"
    );
    assert_eq!(desk.text("experiment.toml"), "mine");
    desk.done("new run.csv --force");
    Bundle::open(&desk.path(".")).unwrap();
}

#[test]
fn wrong_files_and_columns_are_named() {
    let desk = Desk::new();
    timed(&desk, "run.csv");
    desk.write("empty.csv", "");
    desk.write("notes.txt", "not data");
    desk.write("words.csv", "a,b\nx,y\n");
    desk.write("other.csv", "force,pos\n1,2\n3,4\n");
    for (line, parts) in [
        ("new run.csv --input uu", ["`uu`", "nearest: `u`"]),
        ("new other.csv --input forse", ["`forse`", "nearest: `force`"]),
        ("new nothing.csv", ["nothing.csv", ""]),
        ("new empty.csv", ["empty.csv", ""]),
        ("new notes.txt", ["notes.txt", ""]),
        ("new words.csv", ["words.csv", ""]),
        ("new run.csv run.csv", ["run.csv", "twice"]),
        ("new run.csv other.csv", ["no column in common", ""]),
    ] {
        let message = desk.refused(line);
        assert!(parts.iter().all(|p| message.contains(p)), "{line}: {message}");
    }
    assert!(!desk.path("experiment.toml").exists());
}
