//! Every way to damage a record: the message names file, record, column and place.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)] // helpers of tests, too

mod common;

use common::{PERIOD, ROWS, Small, csv, csv_with, value};
use experiment_data::{DataError, RecordError};

#[track_caller]
fn expect(small: &Small, parts: &[&str]) {
    let text = small.load_error();
    assert!(text.contains("records/grid.csv (records[0]): "), "{text}");
    for part in parts {
        assert!(text.contains(part), "{part} expected in {text}");
    }
}

/// The error when one column of the periodic record is changed.
#[track_caller]
fn expect_changed(column: &str, change: impl Fn(usize, f64) -> f64, parts: &[&str]) {
    let small = Small::new();
    small.put(
        "records/grid.csv",
        csv_with(|c, k, v| {
            if c == column {
                change(k, v).to_string()
            } else {
                v.to_string()
            }
        }),
    );
    expect(&small, parts);
}

#[test]
fn columns_that_are_not_there() {
    let small = Small::new();
    small.put("records/grid.csv", csv().replacen("y1", "Y1_", 1));
    expect(&small, &["no column `y1` among 8", "nearest: `u1`, `Y1_`"]);
    small.put("records/grid.csv", csv().replacen("y1", "y2", 1));
    expect(&small, &["no column `y1`"]);
    small.put(
        "records/grid.csv",
        csv().replacen("r1", "y2", 1).replacen("r2", "r1", 1),
    );
    expect(&small, &["line 1: the header has the column `y2` 2 times"]);
}

#[test]
fn csv_that_is_none() {
    let small = Small::new();
    small.put("records/grid.csv", csv().replace(',', ";").replace('.', ","));
    expect(&small, &["line 1: fields are separated by semicolons"]);
    small.put("records/grid.csv", csv().replace(',', "\t"));
    expect(&small, &["separated by tabs"]);
    small.put("records/grid.csv", csv().replace('.', ","));
    expect(&small, &["line 2: ", "the header has 8", "decimal commas"]);
    small.put("records/grid.csv", "");
    expect(&small, &["damaged CSV file", "empty"]);
    small.put("records/grid.csv", "u1,u2,y1,y2,r1,r2,p,pulse\n");
    expect(&small, &["column `y1` has no rows"]);
    let mut lines: Vec<String> = csv().lines().map(str::to_owned).collect();
    lines[10] += ",5";
    small.put("records/grid.csv", lines.join("\n"));
    expect(&small, &["line 11: 9 fields, the header has 8"]);
    small.put(
        "records/grid.csv",
        csv_with(|c, k, v| {
            if (c, k) == ("u2", 4) {
                "-".into()
            } else {
                v.to_string()
            }
        }),
    );
    expect(&small, &["line 6, column `u2`: `-` is not a number"]);
    small.put(
        "records/grid.csv",
        csv_with(|c, k, v| {
            if (c, k) == ("u2", 4) {
                String::new()
            } else {
                v.to_string()
            }
        }),
    );
    expect(&small, &["line 6, column `u2`: `` is not a number"]);
    small.put(
        "records/grid.csv",
        csv_with(|c, k, v| {
            if (c, k) == ("u2", 4) {
                "\"1,5\"".into()
            } else {
                v.to_string()
            }
        }),
    );
    expect(&small, &["line 6, column `u2`: `1,5` is not a number"]);
    small.put("records/grid.csv", b"\xff\xfeu\x001\x00");
    expect(&small, &["no column `y1`"]);
}

#[test]
fn csv_that_is_odd_and_fine() {
    let small = Small::new();
    let plain = small.open().unwrap().load(0).unwrap();
    small.put(
        "records/grid.csv",
        format!(
            "\u{feff}{}",
            csv().replace('\n', "\r\n").replacen("u1,u2", "\"u1\" , u2", 1)
        ),
    );
    assert_eq!(small.open().unwrap().load(0).unwrap(), plain);
    // A text column that nobody asked for is not looked at.
    let with_text: String = csv()
        .lines()
        .enumerate()
        .map(|(i, l)| format!("{l},note{i}\n"))
        .collect();
    small.put("records/grid.csv", with_text);
    assert_eq!(small.open().unwrap().load(0).unwrap(), plain);
}

#[test]
fn numbers_that_are_none() {
    let nan = |k: usize, v: f64| if k == 4 || k == 11 { f64::NAN } else { v };
    expect_changed(
        "u1",
        nan,
        &["column `u1`: 2 values are NaN or infinite, at rows 5, 12 (lines 6, 13)"],
    );
    let infinite = |k: usize, v: f64| if k == 0 { f64::NEG_INFINITY } else { v };
    expect_changed("r2", infinite, &["column `r2`: 1 values", "rows 1 (lines 2)"]);
    // Finite in the file, not after the scale of 2.
    let huge = |k: usize, v: f64| if k == 3 { 1.5e308 } else { v };
    expect_changed("y1", huge, &["column `y1`: 1 values", "rows 4"]);
    expect_changed(
        "p",
        |_, _| f64::NAN,
        &["column `p`: 120 values", "9, 10, ... (lines"],
    );
    // Blank lines and rows part company.
    let small = Small::new();
    small.put(
        "records/grid.csv",
        csv_with(|c, k, v| {
            if (c, k) == ("u1", 4) {
                "nan".into()
            } else {
                v.to_string()
            }
        })
        .replacen('\n', "\n\n\n", 1),
    );
    expect(&small, &["rows 5 (lines 8)"]);
}

#[test]
fn periods_that_do_not_fit() {
    let small = Small::new();
    small.edit("period = 40", "period = 61");
    expect(&small, &["120 samples are fewer than two periods of 61"]);
    small.edit("period = 40", "period = 50");
    expect(
        &small,
        &["120 samples are no multiple of the period 50: 20 left over"],
    );
    small.edit("period = 40", "period = 18446744073709551615");
    let text = small.open().and_then(|b| b.load(0)).unwrap_err().to_string();
    assert!(
        text.contains("18446744073709551615") || text.contains(":32:10"),
        "{text}"
    );
}

#[test]
fn scheduling_that_moves() {
    let ramp = |k: usize, v: f64| v + 0.01 * k as f64 / ROWS as f64;
    expect_changed(
        "p",
        ramp,
        &[
            "scheduling column `p` moves from 0.25 to 0.25991",
            "taken as constant",
        ],
    );
    let through_zero = |k: usize, _: f64| 1e-3 * value("y1", k);
    expect_changed("p", through_zero, &["scheduling column `p` moves"]);
    let small = Small::new();
    // Sensor noise at zero is not motion: the other record shows the range of p.
    small.put(
        "records/grid.csv",
        csv_with(|c, k, v| {
            let noise = 1e-6 * ((k * 7919 % 101) as f64 - 50.0);
            if c == "p" {
                noise.to_string()
            } else {
                v.to_string()
            }
        }),
    );
    let record = small.open().unwrap().load(0).unwrap();
    assert!(record.position.unwrap().abs() < 1e-5);
    // A transient record may move.
    small.put(
        "records/move.csv",
        csv_with(|c, k, v| if c == "p" { k.to_string() } else { v.to_string() }),
    );
    assert_eq!(small.open().unwrap().load(1).unwrap().position, None);
}

#[test]
fn position_declared() {
    let small = Small::new();
    small.edit("period = 40", "period = 40\nposition = 0.2501");
    assert_eq!(small.open().unwrap().load(0).unwrap().position, Some(0.2501));
    small.edit("period = 40", "period = 40\nposition = 0.3");
    expect(
        &small,
        &["`position` = 0.3, but the scheduling column `p` has the mean 0.25"],
    );
    small.edit("kind = \"transient\"", "kind = \"transient\"\nposition = 0.25");
    assert_eq!(small.open().unwrap().load(1).unwrap().position, Some(0.25));
}

#[test]
fn channels_that_are_dead_or_clipped() {
    expect_changed("y2", |_, _| 0.5, &["column `y2` is constant, 0.5 in every row"]);
    expect_changed("u1", |_, _| 0.0, &["column `u1` is constant, 0 in every row"]);
    // The scale of y1 is 2: the message speaks of scaled values.
    expect_changed(
        "y1",
        |_, v| v.min(0.25),
        &["column `y1` is clipped", "extreme value 0.5"],
    );
    expect_changed(
        "u2",
        |_, v| v.max(-1.0),
        &["column `u2` is clipped", "of 120 samples", "extreme value -1"],
    );
    // The transient record too, where it is entered at speed; the controller's limit of 100 is not reached.
    let small = Small::new();
    let cut = |c: &str, k: usize, v: f64| {
        let slow = 5.0 * (std::f64::consts::TAU * k as f64 / ROWS as f64).sin() + 0.3 * v;
        if c == "u1" {
            slow.min(2.0).to_string()
        } else {
            v.to_string()
        }
    };
    small.put("records/move.csv", csv_with(cut));
    let text = small.open().unwrap().load(1).unwrap_err().to_string();
    assert!(
        text.contains("records/move.csv (records[1]): column `u1` is clipped"),
        "{text}"
    );
    small.edit("limit = 100.0", "limit = 2.0");
    assert!(small.open().unwrap().load(1).is_ok());
    // A dead output is refused in a transient record as well.
    small.put(
        "records/move.csv",
        csv_with(|c, _, v| if c == "y1" { "0".into() } else { v.to_string() }),
    );
    let text = small.open().unwrap().load(1).unwrap_err().to_string();
    assert!(text.contains("column `y1` is constant"), "{text}");
}

#[test]
fn errors_are_typed() {
    let small = Small::new();
    small.edit("period = 40", &format!("period = {}", PERIOD + 20));
    assert!(small.open().unwrap().load(0).is_ok());
    small.edit("period = 40", "period = 70");
    match small.open().unwrap().load(0).unwrap_err() {
        DataError::Record { place, problem } => {
            assert_eq!((place.index, place.file.ends_with("records/grid.csv")), (0, true));
            assert!(matches!(
                *problem,
                RecordError::FewPeriods {
                    samples: 120,
                    period: 70
                }
            ));
        }
        other => panic!("{other}"),
    }
}
