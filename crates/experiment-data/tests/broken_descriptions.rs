//! Every way to write a wrong experiment.toml: the message names file, line, column, key and what to do.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests, too

mod common;

use common::{Small, TOML};
use experiment_data::{Bundle, DataError, DescriptionError};

#[test]
fn the_correct_one_opens_by_folder_and_by_file() {
    let small = Small::new();
    let bundle = small.open().unwrap();
    assert_eq!(bundle.len(), 2);
    let c = bundle.description().controller.as_ref().unwrap();
    assert_eq!(c.reference_numerator, [[1.0, -0.5], [1.0, -0.5]]);
    assert_eq!(c.feedback_numerator, [[1.0, -0.5], [2.0, 0.0]]);
    let record = bundle.load(0).unwrap();
    assert_eq!(record.name, "grid");
    assert_eq!(record.position, Some(0.25));
    assert_eq!(record.outputs.columns[0][3], 2.0 * common::value("y1", 3));
    let other = Bundle::open(&small.path().join("experiment.toml")).unwrap();
    let record = other.load(1).unwrap();
    assert_eq!((record.position, record.injection.columns[0][7]), (None, 3.0));
    assert!(matches!(
        other.load(2),
        Err(DataError::Index { index: 2, records: 2 })
    ));
    // A byte order mark of some editors is no trouble.
    small.put("experiment.toml", format!("\u{feff}{TOML}"));
    assert!(small.open().is_ok());
}

/// (text of the correct description, what it becomes, position, parts of the message)
const CASES: [(&str, &str, &str, &[&str]); 43] = [
    (
        "format = 1",
        "format = 2",
        ":1:10",
        &["format", "format 2 is not known", "format 1"],
    ),
    (
        "format = 1",
        "format = \"1\"",
        ":1:10",
        &["format \"1\" is not known"],
    ),
    ("format = 1\n", "", ":1:1", &["missing field `format`"]),
    ("name = \"small\"", "name = 3", ":2:8", &["expected a string"]),
    (
        "name = \"small\"",
        "name = \"small",
        ":2:14",
        &["invalid basic string"],
    ),
    (
        "sample_rate = 20.0",
        "sample_rate = 0",
        ":3:15",
        &["sample_rate: sample rate 0 Hz"],
    ),
    (
        "sample_rate = 20.0",
        "sample_rate = -1.0",
        ":3:15",
        &["sample rate -1 Hz"],
    ),
    (
        "sample_rate = 20.0",
        "sample_rate = nan",
        ":3:15",
        &["sample rate NaN Hz"],
    ),
    (
        "sample_rate = 20.0",
        "sample_rat = 20.0",
        ":3:1",
        &["unknown key `sample_rat`", "nearest: `sample_rate`"],
    ),
    (
        "[channels.output]",
        "[channels.outputs]",
        ":5:11",
        &["channels.outputs", "nearest: `output`"],
    ),
    (
        "units = [\"m\", \"rad\"]",
        "unit = [\"m\"]",
        ":7:1",
        &["channels.output.unit", "nearest: `units`"],
    ),
    (
        "limit = 100.0",
        "limits = 100.0",
        ":23:1",
        &["controller.limits", "nearest: `limit`"],
    ),
    (
        "period = 40",
        "perod = 40",
        ":32:1",
        &["records[0].perod", "nearest: `period`"],
    ),
    (
        "scale = [3.0]",
        "gain = [3.0]",
        ":39:36",
        &["records[1].injection.gain", "known here: columns, units, scale"],
    ),
    (
        "[\"y1\", \"y2\"]",
        "[]",
        ":6:11",
        &["channels.output.columns: no columns"],
    ),
    (
        "[\"y1\", \"y2\"]",
        "[\"y1\", \"\"]",
        ":6:18",
        &["channels.output.columns[1]", "empty"],
    ),
    (
        "[\"y1\", \"y2\"]",
        "[\"y1\", \"y1\"]",
        ":6:18",
        &["`y1` is already listed under channels.output.columns[0]"],
    ),
    (
        "[\"u1\", \"u2\"]",
        "[\"u1\", \"y2\"]",
        ":11:18",
        &["`y2` is already listed under channels.output.columns[1]"],
    ),
    (
        "units = [\"m\", \"rad\"]",
        "units = [\"m\"]",
        ":7:9",
        &["channels.output.units: 1 entries for 2 columns"],
    ),
    (
        "scale = [2.0, 1.0]",
        "scale = [2.0]",
        ":8:9",
        &["channels.output.scale: 1 entries for 2 columns"],
    ),
    (
        "scale = [2.0, 1.0]",
        "scale = [2.0, 0.0]",
        ":8:15",
        &["channels.output.scale[1]: scale 0 of column `y2`"],
    ),
    (
        "scale = [2.0, 1.0]",
        "scale = [inf, 1.0]",
        ":8:10",
        &["scale inf of column `y1`"],
    ),
    (
        "scale = [2.0, 1.0]",
        "scale = \"2\"",
        ":8:9",
        &["expected a sequence"],
    ),
    (
        "scale = [3.0]",
        "scale = [3.0, 1.0]",
        ":39:44",
        &["records[1].injection.scale: 2 entries for 1 columns"],
    ),
    (
        "denominator = [1.0, -0.9]",
        "denominator = [0.0, 1.0]",
        ":22:16",
        &["controller.denominator[0][0]", "zero"],
    ),
    (
        "denominator = [1.0, -0.9]",
        "denominator = []",
        ":22:15",
        &["controller.denominator[0]: an empty polynomial"],
    ),
    (
        "denominator = [1.0, -0.9]",
        "denominator = [\"a\"]",
        ":22:15",
        &["one list of numbers a loop"],
    ),
    (
        "denominator = [1.0, -0.9]\n",
        "",
        ":19:1",
        &["missing field `denominator`"],
    ),
    (
        "[[1.0, -0.5], [2.0, 0.0]]",
        "[[1.0, -0.5]]",
        ":21:22",
        &["coefficients for 1 loops", "2 inputs"],
    ),
    (
        "limit = 100.0",
        "limit = -1",
        ":23:9",
        &["controller.limit: limit -1"],
    ),
    (
        "motor_from_output = [[1.0, -0.5], [1.0, 0.5]]",
        "motor_from_output = [[1.0], [1.0, 0.5]]",
        ":27:22",
        &[
            "geometry.motor_from_output[0]",
            "a 2 x 2 matrix",
            "found 1 in this row",
        ],
    ),
    (
        "[[1.0, 0.0], [1.0, 2.0]]",
        "[[1.0, 0.0]]",
        ":26:21",
        &["geometry.force_from_input[0]", "found 1 in rows"],
    ),
    (
        "[channels.scheduling]\ncolumns = [\"p\"]\n",
        "",
        ":24:20",
        &["exactly one scheduling signal"],
    ),
    (
        "kind = \"periodic\"",
        "kind = \"steady\"",
        ":31:8",
        &["`steady`", "`periodic` or `transient`"],
    ),
    (
        "use = \"validation\"",
        "use = \"test\"",
        ":38:7",
        &["`test`", "`estimation` or `validation`"],
    ),
    (
        "period = 40\n",
        "",
        ":29:1",
        &["records[0]: a periodic record needs `period`"],
    ),
    (
        "period = 40",
        "period = 1",
        ":32:10",
        &["records[0].period: period of 1 samples"],
    ),
    ("period = 40", "period = -40", ":32:10", &["-40"]),
    (
        "kind = \"transient\"",
        "kind = \"transient\"\nperiod = 3",
        ":38:10",
        &["`period` = 3 on a transient record"],
    ),
    (
        "records/move.csv",
        "records/move.parquet",
        ":36:8",
        &["`.parquet` is not supported", ".npz, .csv, .mat"],
    ),
    (
        "records/move.csv",
        "records/move",
        ":36:8",
        &["`` is not supported"],
    ),
    (
        "records/move.csv",
        "records/mvoe.csv",
        ":36:8",
        &["`records/mvoe.csv` does not exist", "nearest: `move.csv`"],
    ),
    (
        "records/move.csv",
        "records/./grid.csv",
        ":36:8",
        &["`records/./grid.csv` is already records[0]"],
    ),
];

#[test]
fn each_message_names_file_place_and_cause() {
    let small = Small::new();
    let mut wrong = Vec::new();
    for (from, to, place, parts) in CASES {
        small.edit(from, to);
        let text = small.open_error();
        let place = format!("experiment.toml{place}: ");
        if !text.contains(&place) || !parts.iter().all(|p| text.contains(p)) {
            wrong.push(format!("{to}: {place}, {parts:?} expected in {text}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn files_outside_the_folder_are_refused() {
    let small = Small::new();
    let elsewhere = tempfile::tempdir().unwrap();
    let outside = elsewhere.path().join("x.csv");
    std::fs::write(&outside, common::csv()).unwrap();
    small.edit("records/move.csv", "records/../../x.csv");
    assert!(small.open_error().contains("it contains `..`"));
    small.edit("records/move.csv", outside.to_str().unwrap());
    assert!(small.open_error().contains("it is absolute"));
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(&outside, small.path().join("records/link.csv")).unwrap();
        small.edit("records/move.csv", "records/link.csv");
        assert!(small.open_error().contains("a link leads out of the folder"));
        std::os::unix::fs::symlink("grid.csv", small.path().join("records/alias.csv")).unwrap();
        small.edit("records/move.csv", "records/alias.csv");
        assert!(small.open_error().contains("already records[0]"));
    }
    small.edit("records/move.csv", "");
    assert!(small.open_error().contains("is not supported"));
    std::fs::create_dir(small.path().join("records/folder.csv")).unwrap();
    small.edit("records/move.csv", "records/folder.csv");
    assert!(small.open_error().contains("no regular file"));
}

#[test]
fn nothing_at_all() {
    let small = Small::new();
    let records = TOML.find("[[records]]").unwrap();
    small.put("experiment.toml", &TOML[..records]);
    let error = small.open().unwrap_err();
    assert!(
        matches!(&error, DataError::Description { problem, .. } if **problem == DescriptionError::NoRecords)
    );
    small.put("experiment.toml", b"format = 1\nname = \"\xff\"");
    assert!(small.open_error().contains(":2:9: the text is not UTF-8"));
    // Nested far deeper than any stack.
    small.put(
        "experiment.toml",
        format!("format = 1\nname = {}", "[".repeat(200_000)),
    );
    assert!(small.open_error().contains("experiment.toml:2:"));
    small.put("experiment.toml", "");
    assert!(small.open_error().contains("missing field"));
    std::fs::remove_file(small.path().join("experiment.toml")).unwrap();
    assert!(small.open_error().contains("holds no experiment.toml"));
    assert!(matches!(
        Bundle::open("nowhere".as_ref()),
        Err(DataError::NotABundle { .. })
    ));
}

#[test]
fn a_file_that_goes_after_opening_is_named() {
    let small = Small::new();
    let bundle = small.open().unwrap();
    std::fs::remove_file(small.path().join("records/grid.csv")).unwrap();
    let text = bundle.load(0).unwrap_err().to_string();
    assert!(
        text.contains("records[0].file") && text.contains("does not exist"),
        "{text}"
    );
}
