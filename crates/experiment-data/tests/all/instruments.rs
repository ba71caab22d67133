//! Files as instruments write them: of h5py, npTDMS, asammdf and pyuff (tests/fixtures/make_instruments.py).

mod by_hand;

use crate::fixtures::{self, K, expected};
use experiment_data::{Contents, look_into, read_columns};

const NUMBERS: [&str; 10] = ["f8", "f4", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8"];

fn one(file: &str, column: &str) -> Vec<f64> {
    read_columns(&fixtures::path(file), &[column]).unwrap().remove(0)
}

fn refusal(file: &str, column: &str) -> String {
    read_columns(&fixtures::path(file), &[column])
        .unwrap_err()
        .to_string()
}

/// Names, rows and units.
fn columns(found: &Contents) -> Vec<(&str, u64, &str)> {
    let columns = found.columns.iter();
    columns
        .map(|c| (c.name.as_str(), c.rows, c.unit.as_str()))
        .collect()
}

fn scalars(found: &Contents) -> Vec<(&str, f64)> {
    found.scalars.iter().map(|s| (s.name.as_str(), s.value)).collect()
}

fn passed_over(found: &Contents) -> Vec<(&str, &str)> {
    let passed = found.passed_over.iter();
    passed.map(|p| (p.name.as_str(), p.what.as_str())).collect()
}

#[test]
fn all_numeric_types_to_the_last_bit() {
    for file in [
        "oldest.h5",
        "newest.h5",
        "plain.mf4",
        "deflated.mf4",
        "transposed.mf4",
    ] {
        let found = read_columns(&fixtures::path(file), &NUMBERS).unwrap();
        for (name, column) in NUMBERS.iter().zip(found) {
            assert_eq!(column, expected(name), "{file}: {name}");
        }
    }
    // Two groups have an `f8`.
    let names = NUMBERS.map(|n| if n == "f8" { "log.f8" } else { n });
    let found = read_columns(&fixtures::path("segments.tdms"), &names).unwrap();
    for (name, column) in NUMBERS.iter().zip(found) {
        assert_eq!(column, expected(name), "{name}");
    }
}

#[test]
fn hdf5_of_numerical_programs() {
    for file in ["oldest.h5", "newest.h5"] {
        let found = look_into(&fixtures::path(file)).unwrap();
        let has = columns(&found);
        for column in [
            ("f8", 5, "N"),
            ("rig.qm", 5, ""),
            ("rig.m(:,1)", 5, ""),
            ("rig.m(:,3)", 5, ""),
        ] {
            assert!(has.contains(&column), "{file}: {column:?} in {has:?}");
        }
        assert_eq!(
            scalars(&found),
            [("single", 0.25), ("fs", 2000.0), ("rig.gain", 3.0)]
        );
        assert!(
            passed_over(&found).contains(&("z", "complex numbers, 5")),
            "{found:?}"
        );
        assert_eq!(one(file, "rig.qm"), K.map(|k| k / 7.0));
        assert_eq!(one(file, "rig.m(:,2)"), K.map(|k| k / 7.0));
        assert_eq!(one(file, "rig.m(2,:)"), [1.0 / 3.0, 1.0 / 7.0, -1.0]);
        assert!(refusal(file, "f9").contains("`f8`"));
        assert!(refusal(file, "z").contains("holds complex numbers"));
        assert!(refusal(file, "rig.m").contains("shape"));
    }
}

#[test]
fn segments_of_tdms() {
    let file = "segments.tdms";
    let found = look_into(&fixtures::path(file)).unwrap();
    let has = columns(&found);
    for column in [("log.f8", 5, "N"), ("i2", 5, "N"), ("it's.f8", 5, "")] {
        assert!(has.contains(&column), "{column:?} in {has:?}");
    }
    assert_eq!(scalars(&found), [("wf_increment", 5e-4)]);
    assert_eq!(passed_over(&found), [("text", "text"), ("z", "complex numbers")]);
    assert_eq!(one(file, "it's.f8"), K.map(|k| k / 7.0));
    assert_eq!(one(file, "log.u1"), expected("u1"));
    assert!(refusal(file, "text").contains("holds text"));
    assert!(
        refusal(file, "f8").contains("no column `f8`"),
        "two groups have it"
    );
}

#[test]
fn groups_of_mdf() {
    for file in ["plain.mf4", "deflated.mf4", "transposed.mf4"] {
        let found = look_into(&fixtures::path(file)).unwrap();
        let has = columns(&found);
        for column in [
            ("group1.time", 5, "s"),
            ("f8", 5, "N"),
            ("group2.time", 4, "s"),
            ("linear", 4, ""),
        ] {
            assert!(has.contains(&column), "{file}: {column:?} in {has:?}");
        }
        assert_eq!(passed_over(&found), [("text", "text")]);
        assert_eq!(one(file, "group1.time"), K.map(|k| k / 2000.0));
        let linear: Vec<f64> = K[..4].iter().map(|k| 0.5 * (1000.0 * k - 2000.0) - 2.0).collect();
        assert_eq!(one(file, "linear"), linear);
        assert!(refusal(file, "text").contains("holds text"));
    }
}

#[test]
fn functions_of_universal_files() {
    for file in ["text.uff", "bytes.uff"] {
        let found = look_into(&fixtures::path(file)).unwrap();
        assert_eq!(
            columns(&found),
            [
                ("force 1+Z", 5, "N"),
                ("displacement 7-X", 5, "m"),
                ("time of displacement 7-X #2", 5, "s"),
                ("displacement 7-X #2", 5, "m"),
            ]
        );
        assert_eq!(scalars(&found), [("abscissa increment", 5e-4)]);
        assert_eq!(passed_over(&found).len(), 1, "{found:?}");
        // Text has twelve digits.
        let near = |found: Vec<f64>, wanted: [f64; 5]| {
            let digits = if file == "text.uff" { 1e-11 } else { 0.0 };
            for (a, b) in found.iter().zip(wanted) {
                assert!((a - b).abs() <= digits * b.abs(), "{file}: {a} {b}");
            }
            assert_eq!(found.len(), 5);
        };
        near(one(file, "force 1+Z"), K.map(|k| k / 3.0));
        near(one(file, "displacement 7-X"), K.map(|k| k / 4.0));
        near(one(file, "displacement 7-X #2"), K.map(|k| -k / 3.0));
        near(one(file, "time of displacement 7-X #2"), K.map(|k| k * k / 4.0));
    }
}
