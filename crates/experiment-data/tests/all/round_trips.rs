//! What is written is read back to the same bits, in all formats; nothing is overwritten or left half done.
use crate::common::{self, Small};
use experiment_data::{Bundle, BundleWriter, ChannelGroup, DataError, Description, RecordFormat};
use lpv_core::{Position, Purpose, Record, RecordKind, Signals};
use proptest::prelude::*;
use std::path::Path;

const FORMATS: [RecordFormat; 4] = [
    RecordFormat::Npz,
    RecordFormat::Csv,
    RecordFormat::Mat,
    RecordFormat::Parquet,
];

#[test]
fn a_bundle_survives_each_format() {
    let small = Small::new();
    let bundle = small.open().unwrap();
    let records: Vec<Record> = bundle.records().collect::<Result<_, _>>().unwrap();
    for format in FORMATS {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("new/bundle");
        let mut writer = BundleWriter::create(&folder, bundle.description().clone(), format).unwrap();
        for record in &records {
            writer.write(record).unwrap();
        }
        assert!(!folder.join("experiment.toml").exists());
        let back = writer.finish().unwrap();
        let again: Vec<Record> = back.records().collect::<Result<_, _>>().unwrap();
        assert_eq!(again, records, "{format:?}");
        for (i, record) in records.iter().enumerate() {
            assert_eq!(&by_period(&back, i), record, "{format:?}");
        }
        assert_eq!(back.description().controller, bundle.description().controller);
        assert_eq!(back.description().geometry, bundle.description().geometry);
        assert_eq!(
            back.description().records[1].file,
            format!("records/move{}", format.ending())
        );
        assert!(!folder.join("experiment.toml.partial").exists());
    }
}

/// A record put together from its periods.
fn by_period(bundle: &Bundle, index: usize) -> Record {
    let mut whole: Option<Record> = None;
    let position = bundle.each_period(index, |part| match &mut whole {
        None => whole = Some(part),
        Some(whole) => {
            let groups = |r: Record| {
                [
                    r.outputs,
                    r.inputs,
                    r.references,
                    r.scheduling,
                    r.auxiliary,
                    r.injection,
                ]
            };
            let of = [
                &mut whole.outputs,
                &mut whole.inputs,
                &mut whole.references,
                &mut whole.scheduling,
                &mut whole.auxiliary,
                &mut whole.injection,
            ];
            for (all, part) in of.into_iter().zip(groups(part)) {
                for (all, part) in all.columns.iter_mut().zip(part.columns) {
                    all.extend(part);
                }
            }
        }
    });
    Record {
        position: position.unwrap(),
        ..whole.unwrap()
    }
}

fn transient(name: &str, y: Vec<f64>, u: Vec<f64>) -> Record {
    Record {
        name: name.to_owned(),
        kind: RecordKind::Transient,
        purpose: Purpose::Estimation,
        position: None,
        outputs: Signals::new(&["y"], vec![y]),
        inputs: Signals::new(&["u"], vec![u]),
        references: Signals::default(),
        scheduling: Signals::default(),
        auxiliary: Signals::default(),
        injection: Signals::default(),
    }
}

/// Two scheduling signals: the position is the mean of each, or what the description says.
#[test]
fn a_position_in_the_plane_is_read_back() {
    for format in FORMATS {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("plane");
        let mut description = Description::new("plane", 10.0, &["y"], &["u"]);
        description.channels.scheduling.columns = vec!["px".to_owned(), "py".to_owned()];
        let mut writer = BundleWriter::create(&folder, description, format).unwrap();
        let mut written = Vec::new();
        for (name, at, said) in [
            ("a", [0.1, -0.05], None),
            ("b", [0.1, 0.25], None),
            ("c", [-0.2, 0.25], Some(vec![-0.2001, 0.2501])),
        ] {
            let signal = |k: usize| (0..8).map(|i| ((i % 4 + k) as f64).sin()).collect();
            let mut record = transient(name, signal(1), signal(3));
            record.kind = RecordKind::Periodic { period: 4 };
            record.scheduling = Signals::new(&["px", "py"], at.iter().map(|p| vec![*p; 8]).collect());
            record.position = said.clone().map(Position::from);
            writer.write(&record).unwrap();
            written.push(said.unwrap_or(at.to_vec()));
        }
        let bundle = writer.finish().unwrap();
        let text = std::fs::read_to_string(folder.join("experiment.toml")).unwrap();
        assert!(
            text.contains("format = 2") && text.contains("position = ["),
            "{text}"
        );
        for (i, expected) in written.into_iter().enumerate() {
            let expected = Some(Position::from(expected));
            assert_eq!(bundle.load(i).unwrap().position, expected, "{format:?}");
            assert_eq!(
                bundle.place(i).unwrap().map(|p| p.position),
                expected,
                "{format:?}"
            );
        }
    }
}

fn start(folder: &Path, format: RecordFormat) -> Result<BundleWriter, DataError> {
    BundleWriter::create(folder, Description::new("t", 10.0, &["y"], &["u"]), format)
}

#[test]
fn the_same_record_gives_the_same_bytes() {
    for format in FORMATS {
        let bytes = || {
            let dir = tempfile::tempdir().unwrap();
            let mut writer = start(dir.path(), format).unwrap();
            writer
                .write(&transient("a", vec![0.1, 0.2, 0.7], vec![1.0, 2.0, 3.0]))
                .unwrap();
            let bundle = writer.finish().unwrap();
            (
                std::fs::read(bundle.record_path(0).unwrap()).unwrap(),
                std::fs::read(bundle.description_file()).unwrap(),
            )
        };
        let first = bytes();
        std::thread::sleep(std::time::Duration::from_millis(10));
        assert_eq!(bytes(), first);
    }
}

#[test]
fn nothing_is_overwritten_and_nothing_half_done_looks_whole() {
    let dir = tempfile::tempdir().unwrap();
    let good = transient("a", vec![0.1, 0.2, 0.7], vec![1.0, 2.0, 3.0]);
    let mut writer = start(dir.path(), RecordFormat::Csv).unwrap();
    writer.write(&good).unwrap();
    assert!(matches!(writer.write(&good), Err(DataError::Exists { .. })));
    drop(writer);
    // Broken off: nothing is left.
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    // A file of somebody else in the place of a record is not touched.
    std::fs::create_dir(dir.path().join("records")).unwrap();
    std::fs::write(dir.path().join("records/a.csv"), "mine").unwrap();
    let mut writer = start(dir.path(), RecordFormat::Csv).unwrap();
    assert!(matches!(writer.write(&good), Err(DataError::Exists { .. })));
    writer
        .write(&Record {
            name: "b".into(),
            ..good.clone()
        })
        .unwrap();
    let other = start(dir.path(), RecordFormat::Csv).unwrap();
    let bundle = writer.finish().unwrap();
    assert_eq!(bundle.len(), 1);
    assert_eq!(std::fs::read(dir.path().join("records/a.csv")).unwrap(), b"mine");
    assert!(matches!(
        start(dir.path(), RecordFormat::Npz),
        Err(DataError::Exists { .. })
    ));
    // Without records there is nothing to finish, and two writers do not replace each other's description.
    let text = other.finish().unwrap_err().to_string();
    assert!(text.contains("lists no record"), "{text}");
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 2);
}

#[test]
fn what_a_killed_process_left_behind_is_removed_or_completed() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("above/bundle");
    let good = transient("deep/a", vec![0.1, 0.2, 0.7], vec![1.0, 2.0, 3.0]);
    let left = folder.join(".lpv-1-0.part");
    let leave = |file: &str, text: &str| {
        let path = left.join(file);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    };
    // In the middle of the records.
    leave("lock", "");
    leave("records/deep/a.csv", "torn");
    let mut writer = start(&folder, RecordFormat::Csv).unwrap();
    assert!(!left.exists());
    writer.write(&good).unwrap();
    let bytes = |folder: &Path| {
        let read = |file: &str| std::fs::read(folder.join(file)).unwrap();
        (read("experiment.toml"), read("records/deep/a.csv"))
    };
    writer.finish().unwrap();
    let whole = bytes(&folder);
    // Before the first move, and between the moves.
    for moved in [false, true] {
        let other = dir.path().join(format!("other{moved}"));
        let stage = other.join(".lpv-2-0.part");
        std::fs::create_dir_all(stage.join("records/deep")).unwrap();
        std::fs::write(stage.join("lock"), "").unwrap();
        std::fs::write(stage.join("experiment.toml"), &whole.0).unwrap();
        std::fs::write(stage.join("records/deep/a.csv"), &whole.1).unwrap();
        if moved {
            std::fs::rename(stage.join("records"), other.join("records")).unwrap();
        }
        // The earlier run is complete, so that there is a bundle already.
        assert!(matches!(
            start(&other, RecordFormat::Csv),
            Err(DataError::Exists { .. })
        ));
        assert_eq!(bytes(&other), whole);
        assert!(!stage.exists());
    }
    // One that is in use stays.
    let first = dir.path().join("two");
    let one = start(&first, RecordFormat::Csv).unwrap();
    let two = start(&first, RecordFormat::Csv).unwrap();
    drop(two);
    assert!(one.unfinished().0.is_dir());
    drop(one);
    assert!(!first.exists());
}

#[test]
fn what_cannot_be_read_is_not_written() {
    let dir = tempfile::tempdir().unwrap();
    let good = transient("a", vec![0.1, 0.2, 0.7, 0.4], vec![1.0, 2.0, 3.0, 0.0]);
    let mut writer = start(dir.path(), RecordFormat::Mat).unwrap();
    let mut refuse = |change: &dyn Fn(&mut Record), part: &str| {
        let mut record = good.clone();
        change(&mut record);
        let text = writer.write(&record).unwrap_err().to_string();
        assert!(text.contains(part), "{part} expected in {text}");
    };
    for name in ["", "../a", "/a", "a b", ".hidden", "a//b", "a/", "a\\b"] {
        refuse(&|r| r.name = name.into(), "record name");
    }
    refuse(
        &|r| r.outputs.columns[0][1] = f64::NAN,
        "column `y` is NaN or infinite in rows 2",
    );
    refuse(&|r| r.outputs.columns[0] = vec![1.0; 4], "column `y` is constant");
    refuse(
        &|r| r.outputs.columns[0].truncate(3),
        "column `u` has 4 rows, `y` has 3",
    );
    refuse(
        &|r| r.outputs.columns.clear(),
        "the output channels: 0 columns, 1 names",
    );
    refuse(
        &|r| r.outputs.names[0] = "z".into(),
        "the output channels are [\"z\"]",
    );
    refuse(
        &|r| r.kind = RecordKind::Periodic { period: 3 },
        "4 samples are fewer than two periods of 3",
    );
    refuse(
        &|r| r.kind = RecordKind::Periodic { period: 0 },
        "`period` = 0; a period has",
    );
    refuse(
        &|r| r.position = Some(f64::INFINITY.into()),
        "records[0].position: inf is not a finite number",
    );
    refuse(
        &|r| r.injection = Signals::new(&["1st"], vec![vec![0.0; 4]]),
        "a MATLAB name starts with a letter",
    );
    refuse(
        &|r| r.injection = Signals::new(&["y"], vec![vec![0.0; 4]]),
        "column `y` of the injection channels",
    );
    // Nothing of all that is left behind.
    assert!(std::fs::read_dir(dir.path().join("records")).map_or(0, Iterator::count) == 0);
    let text = BundleWriter::create(
        dir.path(),
        Description::new("t", f64::NAN, &["y"], &["u"]),
        RecordFormat::Npz,
    )
    .unwrap_err()
    .to_string();
    assert!(text.contains("sample_rate: sample rate NaN Hz"), "{text}");
}

#[test]
fn dead_simple_names_stay_unique() {
    let small = Small::new();
    std::fs::copy(
        small.path().join("records/grid.csv"),
        small.path().join("grid.csv"),
    )
    .unwrap();
    small.edit("records/move.csv", "grid.csv");
    let names: Vec<String> = small.open().unwrap().records().map(|r| r.unwrap().name).collect();
    assert_eq!(names, ["records/grid.csv", "grid.csv"]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Any finite bits survive: subnormals, -0, extremes.
    #[test]
    fn any_finite_numbers_survive(
        rows in prop::collection::vec((any::<f64>(), any::<f64>()), 2..40),
        which in 0usize..4,
    ) {
        let finite = |v: f64| if v.is_finite() { v } else { -0.0 };
        let y: Vec<f64> = rows.iter().map(|r| finite(r.0)).collect();
        let u: Vec<f64> = rows.iter().map(|r| finite(r.1)).collect();
        let constant = |x: &[f64]| x.iter().all(|v| *v == x[0]);
        prop_assume!(!constant(&y) && !constant(&u));
        let dir = tempfile::tempdir().unwrap();
        let mut writer = start(dir.path(), FORMATS[which]).unwrap();
        let record = transient("a", y, u);
        writer.write(&record).unwrap();
        let back = writer.finish().unwrap().load(0).unwrap();
        let bits = |s: &Signals| s.columns.iter().flatten().map(|v| v.to_bits()).collect::<Vec<_>>();
        prop_assert_eq!(bits(&back.outputs), bits(&record.outputs));
        prop_assert_eq!(bits(&back.inputs), bits(&record.inputs));
    }

    /// Any text as a description, any bytes as a record, any numbers in a record to write: never a panic.
    #[test]
    fn wild_input_never_panics(
        text in "\\PC{0,60}",
        cut in 0usize..1000,
        bytes in prop::collection::vec(any::<u8>(), 0..300),
        columns in prop::collection::vec(prop::collection::vec(any::<f64>(), 0..9), 0..3),
        period in any::<usize>(),
        rate in any::<f64>(),
    ) {
        let small = Small::new();
        small.put("experiment.toml", &text);
        let _ = small.open();
        let at = (0..=cut.min(common::TOML.len())).rev().find(|i| common::TOML.is_char_boundary(*i)).unwrap_or(0);
        small.put("experiment.toml", format!("{}{text}{}", &common::TOML[..at], &common::TOML[at..]));
        let _ = small.open();
        small.put("experiment.toml", common::TOML);
        small.put("records/grid.csv", &bytes);
        let _ = small.open().unwrap().load(0);

        let mut d = Description::new("t", rate, &["y"], &["u"]);
        d.channels.scheduling = ChannelGroup::new(&["p"]);
        if let Ok(mut writer) = BundleWriter::create(&small.path().join("n"), d, FORMATS[cut % 4]) {
            let mut record = transient("a", vec![], vec![]);
            record.kind = RecordKind::Periodic { period };
            record.outputs.columns = columns.clone();
            record.inputs.columns = columns.clone();
            record.scheduling = Signals { names: vec!["p".into()], units: vec![], columns };
            let _ = writer.write(&record);
            record.kind = RecordKind::Transient;
            let _ = writer.write(&record);
        }
    }
}
