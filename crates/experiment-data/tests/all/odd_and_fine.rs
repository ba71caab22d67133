//! Bundles that are odd and fine, and errors as types; what is refused stands in tests/all/broken.
use crate::common::{self, Small, TOML, csv, csv_with};
use experiment_data::{Bundle, DataError, DescriptionError, RecordError};

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
    assert_eq!(record.position, Some(0.25.into()));
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
fn scheduling_that_is_noise_or_may_move() {
    let small = Small::new();
    // Sensor noise at zero is not motion: the other record shows the range of p.
    let noise = |k: usize| 1e-6 * ((k * 7919 % 101) as f64 - 50.0);
    let put = |file: &str, p: &dyn Fn(usize) -> f64| {
        small.put(
            file,
            csv_with(|c, k, v| if c == "p" { p(k) } else { v }.to_string()),
        )
    };
    put("records/grid.csv", &noise);
    let record = small.open().unwrap().load(0).unwrap();
    assert!(record.position.unwrap()[0].abs() < 1e-5);
    put("records/move.csv", &|k| k as f64);
    assert_eq!(small.open().unwrap().load(1).unwrap().position, None);
}

#[test]
fn positions_may_be_declared() {
    let small = Small::new();
    small.edit("period = 40", "period = 40\nposition = 0.2501");
    assert_eq!(
        small.open().unwrap().load(0).unwrap().position,
        Some(0.2501.into())
    );
    small.edit("kind = \"transient\"", "kind = \"transient\"\nposition = 0.25");
    assert_eq!(small.open().unwrap().load(1).unwrap().position, Some(0.25.into()));
}

/// An input at its limit is what acted on the machine, in periodic and in other records, whether the limit is declared or not.
#[test]
fn an_input_at_its_limit_is_not_clipping() {
    let small = Small::new();
    let slow = |k: usize| 5.0 * (std::f64::consts::TAU * k as f64 / common::ROWS as f64).sin();
    let cut = |c: &str, k, v: f64| {
        if c == "u1" {
            (slow(k) + 0.3 * v).min(2.0)
        } else {
            v
        }
    };
    small.put("records/move.csv", csv_with(|c, k, v| cut(c, k, v).to_string()));
    assert!(small.open().unwrap().load(1).is_ok());
    small.edit("limit = 100.0", "limit = 2.0");
    assert!(small.open().unwrap().load(1).is_ok());
    let low = |c: &str, v: f64| if c == "u2" { v.max(-1.0) } else { v };
    small.put("records/grid.csv", csv_with(|c, _, v| low(c, v).to_string()));
    assert!(small.open().unwrap().load(0).is_ok());
}

#[test]
fn errors_are_typed() {
    let small = Small::new();
    small.edit("period = 40", "period = 60");
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
    small.put("experiment.toml", &TOML[..TOML.find("[[records]]").unwrap()]);
    let error = small.open().unwrap_err();
    assert!(
        matches!(&error, DataError::Description { problem, .. } if **problem == DescriptionError::NoRecords)
    );
    assert!(matches!(
        Bundle::open("nowhere".as_ref()),
        Err(DataError::NotABundle { .. })
    ));
}

#[test]
fn a_file_may_hold_several_records_of_other_samples() {
    let dir = tempfile::tempdir().unwrap();
    let rows: String = (0..40)
        .map(|k| format!("{},{},{},{}\n", k % 7, k % 5, k % 3, k % 11))
        .collect();
    std::fs::write(dir.path().join("a.csv"), format!("u,y,u_val,y_val\n{rows}")).unwrap();
    let open = |parts: &[&str]| {
        let mut toml = "format = 2\nname = 'x'\nsample_rate = 1\n[channels.output]\ncolumns = ['y']\n\
                        [channels.input]\ncolumns = ['u']\n"
            .to_owned();
        for part in parts {
            toml += &format!("[[records]]\nfile = 'a.csv'\nkind = 'transient'\nuse = 'estimation'\n{part}\n");
        }
        std::fs::write(dir.path().join("experiment.toml"), toml).unwrap();
        Bundle::open(dir.path())
    };
    let other = "columns = { u = 'u_val', y = 'y_val' }";
    for parts in [
        &["rows = [1, 20]", "rows = [21, 40]"][..],
        &["", other],
        &[
            "rows = [1, 20]",
            "columns = { u = 'u_val', y = 'y_val' }\nrows = [5, 30]",
        ],
    ] {
        let bundle = open(parts).unwrap();
        let records: Vec<_> = bundle.records().collect::<Result<_, _>>().unwrap();
        assert_eq!(
            (records[0].name.as_str(), records[1].name.as_str()),
            ("a.csv #1", "a.csv #2")
        );
        assert_ne!(records[0].inputs.columns, records[1].inputs.columns);
    }
    for parts in [
        &["rows = [1, 20]", "rows = [20, 40]"][..],
        &["", ""],
        &["rows = [1, 20]", ""],
        // The output is the same.
        &["", "columns = { u = 'u_val' }"],
        &[other, other],
    ] {
        assert!(matches!(
            open(parts),
            Err(DataError::Description { problem, .. })
                if matches!(*problem, DescriptionError::DuplicateRecord { first: 0, .. })
        ));
    }
    let many: Vec<String> = (1..=1001).map(|k| format!("rows = [{k}, {k}]")).collect();
    let many: Vec<&str> = many.iter().map(String::as_str).collect();
    let text = open(&many).unwrap_err().to_string();
    assert!(
        text.contains("more than 1000 records are parts of the file"),
        "{text}"
    );
}
