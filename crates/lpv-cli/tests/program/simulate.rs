//! `simulate`: the bundle that it writes is one that an engineer could have measured.

use experiment_data::{Bundle, RecordFormat};
use lpv::PipelineError;
use lpv::simulate::{MachineFile, SimulateAccount, simulate};
use lpv_core::{Purpose, Record, RecordKind};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::Path;
use xytable_plant::{HiddenEffect, MoveKind};

/// Two positions and two moves, small enough for a test.
fn small() -> MachineFile {
    toml::from_str(
        r#"
        name = "axis 3"
        seed = 11
        positions = { values = [-0.2, 0.1] }
        multisine = { period = 128, periods = 3, lines = { band = { first = 1, last = 40 } } }
        moves = { estimation = 1, validation = 1, kinds = ["back-and-forth"] }
        setpoints = { samples = 400 }
        "#,
    )
    .unwrap()
}

fn write(file: &MachineFile, hidden: &[&str], out: &Path) -> Result<SimulateAccount, PipelineError> {
    let hidden: Vec<HiddenEffect> = hidden.iter().map(|e| e.parse().unwrap()).collect();
    simulate(file, &hidden, out, RecordFormat::Npz, &|_, _| ())
}

fn records(out: &Path) -> Vec<Record> {
    let bundle = Bundle::open(out).unwrap();
    let count = bundle.description().records.len();
    (0..count).map(|i| bundle.load(i).unwrap()).collect()
}

/// Every file of a folder with its bytes.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut all = BTreeMap::new();
    for part in [folder.to_owned(), folder.join("records")] {
        for entry in std::fs::read_dir(part).unwrap().map(Result::unwrap) {
            if entry.file_type().unwrap().is_file() {
                let name = entry.file_name().into_string().unwrap();
                all.insert(name, std::fs::read(entry.path()).unwrap());
            }
        }
    }
    all
}

fn rms_difference(a: &[f64], b: &[f64]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    (sum / a.len() as f64).sqrt()
}

#[test]
fn a_bundle_has_records_controller_and_geometry_that_fit_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("bundle");
    let heard = RefCell::new(Vec::new());
    let account = simulate(&small(), &[], &out, RecordFormat::Npz, &|done, of| {
        heard.borrow_mut().push((done, of));
    })
    .unwrap();
    let all: Vec<(usize, usize)> = (1..=6).map(|done| (done, 6)).collect();
    assert_eq!(*heard.borrow(), all);
    assert_eq!((account.records, account.samples), (6, 4 * 384 + 2 * 400));
    assert!(
        account.integration_error < 1e-15 && account.substeps == 1,
        "{account:?}"
    );

    let records = records(&out);
    let names: Vec<&str> = records.iter().map(|r| r.name.as_str()).collect();
    let kinds = [RecordKind::Periodic { period: 128 }; 4];
    assert_eq!(
        records.iter().map(|r| r.kind).take(4).collect::<Vec<_>>(),
        kinds,
        "{names:?}"
    );
    assert_eq!(records[2].position, Some(0.1.into()));
    assert_eq!(records[4].purpose, Purpose::Estimation);
    assert_eq!(records[5].purpose, Purpose::Validation);

    let bundle = Bundle::open(&out).unwrap();
    // The controller of the description gives the recorded inputs from the recorded outputs.
    let controller = bundle.description().controller.clone().unwrap();
    for record in &records {
        for i in 0..2 {
            let [b, a] = [&controller.feedback_numerator[i], &controller.denominator[i]];
            assert_eq!(b, &controller.reference_numerator[i]);
            let (r, y) = (&record.references.columns[i], &record.outputs.columns[i]);
            let u = &record.inputs.columns[i];
            for k in 0..u.len() {
                let past = |c: &[f64], s: &dyn Fn(usize) -> f64, first: usize| -> f64 {
                    (first..c.len().min(k + 1)).map(|j| c[j] * s(k - j)).sum()
                };
                let expected = past(b, &|k| r[k] - y[k], 0) - past(a, &|k| u[k], 1);
                assert!((u[k] - expected).abs() < 1e-12, "{} {i} {k}", record.name);
            }
        }
    }
    // u'_1 = 1 m/s² at p = 0 takes 32 kg: 16 N a motor.
    let geometry = bundle.description().geometry.clone().unwrap();
    let force = geometry.force_from_input_at(0.0);
    assert!((force[(0, 0)] - 16.0).abs() < 1e-12 && (force[(1, 0)] - 16.0).abs() < 1e-12);
    assert_eq!(geometry.motor_from_output, [[1.0, -0.5], [1.0, 0.5]]);
}

#[test]
fn the_bytes_depend_on_the_seed_and_not_on_the_threads() {
    let folder = tempfile::tempdir().unwrap();
    let run = |name: &str, seed: u64, threads: usize| {
        let out = folder.path().join(name);
        let file = MachineFile { seed, ..small() };
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| write(&file, &["coulomb-friction"], &out))
            .unwrap();
        files(&out)
    };
    let one = run("one", 1, 1);
    assert_eq!(one.len(), 7);
    assert_eq!(one, run("three", 1, 3));
    let other = run("other", 2, 1);
    assert!(
        one.iter().filter(|(name, bytes)| other[*name] != **bytes).count() == 6,
        "records differ"
    );
}

#[test]
fn a_hidden_effect_shows_in_the_records_and_nowhere_else() {
    let folder = tempfile::tempdir().unwrap();
    let [plain, hidden, mounted] = ["plain", "hidden", "mounted"].map(|n| folder.path().join(n));
    write(&small(), &[], &plain).unwrap();
    write(&small(), &["cogging=1e-5"], &hidden).unwrap();
    write(&small(), &["payload=0.1"], &mounted).unwrap();
    let toml = |out: &Path| std::fs::read_to_string(out.join("experiment.toml")).unwrap();
    assert_eq!(toml(&plain), toml(&hidden));
    assert_eq!(toml(&plain), toml(&mounted));
    let (a, b, c) = (records(&plain), records(&hidden), records(&mounted));
    let over = |a: &Record, b: &Record| rms_difference(&a.outputs.columns[0], &b.outputs.columns[0]) / 3.3e-8;
    for k in 0..6 {
        assert!(over(&a[k], &b[k]) > 10.0, "{}: {}", a[k].name, over(&a[k], &b[k]));
        assert_eq!(
            over(&a[k], &c[k]) > 10.0,
            k >= 4,
            "mounted after the grid: {}",
            a[k].name
        );
    }
}

#[test]
fn a_bundle_that_exists_is_not_touched() {
    let folder = tempfile::tempdir().unwrap();
    write(&small(), &[], folder.path()).unwrap();
    let before = files(folder.path());
    let error = write(&MachineFile { seed: 5, ..small() }, &[], folder.path()).unwrap_err();
    assert!(matches!(error, PipelineError::Data(_)), "{error}");
    assert_eq!(before, files(folder.path()));
}

#[test]
fn settings_that_make_no_sense_leave_no_folder() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("bundle");
    let with = |change: &dyn Fn(&mut MachineFile)| {
        let mut file = small();
        change(&mut file);
        let error = write(&file, &[], &out).unwrap_err();
        assert!(!out.exists(), "{error}");
        error.to_string()
    };
    assert!(with(&|f| f.machine.beam_mass_kg = -1.0).contains("beam_mass_kg = -1"));
    assert!(with(&|f| f.positions.values = vec![0.4]).contains("outside the stroke"));
    assert!(with(&|f| f.multisine.periods = 1).contains("2 or more"));
    assert!(with(&|f| f.multisine.periods = usize::MAX).contains("more than 4,194,304 samples a record"));
    assert!(with(&|f| f.moves.kinds = vec![]).contains("at least one kind"));
    assert!(with(&|f| f.moves.estimation = usize::MAX).contains("at most"));
    assert!(with(&|f| f.sample_rate = 0.0).contains("sample-rate = 0"));
    assert!(with(&|f| f.controller.bandwidth_hz = 5.0).contains("closed loop"));
    assert!(with(&|f| f.setpoints.stroke_fraction = 2.0).contains("stroke"));
}

#[test]
fn a_misspelt_key_is_answered_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("machine.toml");
    std::fs::write(&path, "seed = 3\n[machine]\nbeam-mass = 21.0\n").unwrap();
    let text = MachineFile::read(&path).unwrap_err().to_string();
    for part in ["machine.toml", "line 3", "`beam-mass`", "nearest: `beam-mass-kg`"] {
        assert!(text.contains(part), "{part} in {text}");
    }
    std::fs::write(&path, "[moves]\nkinds = [\"wander\"]\n").unwrap();
    assert_eq!(MachineFile::read(&path).unwrap().moves.kinds, [MoveKind::Wander]);
}
