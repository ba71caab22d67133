//! Shards, what they keep, and the table that comes of them.

use super::{Account, FleetError, Row, Shard, Task, merge, read};
use crate::output::Overwrite;
use crate::simulate::{MachineFile, simulate};
use crate::{IdentifyConfig, PipelineError, Progress, silent};
use experiment_data::RecordFormat;
use std::path::{Path, PathBuf};

/// Two machines at one position, and between them a folder that is no bundle.
fn fleet(folder: &Path) -> Vec<PathBuf> {
    let bundle = |name: &str, seed: u64| {
        let text = format!(
            "seed = {seed}\npositions = {{ values = [0.1] }}\nmultisine = {{ period = 256, periods = 4, lines = \"odd\" }}\n\
             moves = {{ estimation = 0, validation = 1 }}\nsetpoints = {{ samples = 400 }}\n"
        );
        let machine: MachineFile = toml::from_str(&text).unwrap();
        let place = folder.join(name).join("bundle");
        simulate(&machine, &[], &place, RecordFormat::Npz, &|_, _| ()).unwrap();
        place
    };
    let broken = folder.join("b").join("bundle");
    std::fs::create_dir_all(&broken).unwrap();
    vec![bundle("a", 1), broken, bundle("c", 2)]
}

fn task() -> Task {
    let config = IdentifyConfig {
        order: Some(4),
        integrators: Some(2),
        ..IdentifyConfig::default()
    };
    Task::Identify(Box::new(config))
}

/// A run that replaces no file of others.
fn run(
    bundles: &[PathBuf],
    task: &Task,
    shard: Shard,
    folder: &Path,
    progress: Progress<'_>,
) -> Result<Account, PipelineError> {
    super::run(bundles, task, shard, (folder, Overwrite::Refuse), progress)
}

/// The bytes of every file below a folder but the rows, which hold times.
fn results(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all.extend(results(&path));
        } else if path.file_name() != Some("row.json".as_ref()) {
            all.push((path.clone(), std::fs::read(&path).unwrap()));
        }
    }
    all.sort();
    all
}

#[test]
fn shards_make_the_table_of_one_run_and_lose_nothing() {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    let bundles = fleet(place.path());
    let whole = run(&bundles, &task(), Shard::ALL, &at("whole"), &silent).unwrap();
    assert_eq!((whole.rows.len(), whole.kept), (3, 0));
    let expected = merge(&[at("whole")]).unwrap();
    assert!(expected.missing.is_empty() && !expected.is_whole());
    assert!(
        expected.rows[1]
            .error
            .as_ref()
            .unwrap()
            .contains("experiment.toml")
    );
    assert!(expected.rows[0].worth.is_some() && expected.rows[2].worth.is_some());
    let table = expected.to_csv().unwrap();
    assert_eq!(table.lines().count(), 4);

    // One shard alone names what is missing, both in folders of their own and in one make the same table.
    let shard = |text: &str, folder: &str| {
        run(&bundles, &task(), text.parse().unwrap(), &at(folder), &silent).unwrap()
    };
    shard("1/2", "first");
    let first = merge(&[at("first")]).unwrap();
    assert_eq!(first.missing, [bundles[1].to_string_lossy()]);
    shard("2/2", "second");
    let both = merge(&[at("first"), at("second")]).unwrap();
    assert_eq!(both.to_json().unwrap(), expected.to_json().unwrap());
    shard("2/2", "first");
    assert_eq!(merge(&[at("first")]).unwrap().to_csv().unwrap(), table);

    // What is there stays, but for what was refused without being read.
    let before = results(&at("whole"));
    let again = run(&bundles, &task(), Shard::ALL, &at("whole"), &silent).unwrap();
    assert_eq!(again.kept, 2);
    assert_eq!(
        (again.rows[0].seconds, again.rows[2].seconds),
        (whole.rows[0].seconds, whole.rows[2].seconds)
    );
    assert_eq!(results(&at("whole")), before);
}

#[test]
fn a_bundle_that_changed_or_was_stopped_is_done_again() {
    let place = tempfile::tempdir().unwrap();
    let out = place.path().join("out");
    let bundles = fleet(place.path());
    run(&bundles, &task(), Shard::ALL, &out, &silent).unwrap();
    let folder = |i: usize| out.join(super::inputs::folder_name(&bundles[i]));
    // Killed after the results and before the row.
    std::fs::remove_file(folder(0).join("row.json")).unwrap();
    let description = bundles[2].join("experiment.toml");
    let text = std::fs::read_to_string(&description).unwrap();
    std::fs::write(&description, text + "\n# changed\n").unwrap();
    let again = run(&bundles, &task(), Shard::ALL, &out, &silent).unwrap();
    assert_eq!(again.kept, 0);
    // Its records went: the results of before would be those of another bundle.
    let model = folder(2).join("model.json");
    assert!(model.is_file());
    std::fs::write(&description, "name = 3").unwrap();
    run(&bundles, &task(), Shard::ALL, &out, &silent).unwrap();
    assert!(!model.exists());
    let row: Row = read(&folder(2).join("row.json")).unwrap();
    assert!(row.error.is_some() && row.exit_code == 2);
    // Another task has other results.
    let other = Task::Identify(Box::default());
    assert_eq!(run(&bundles, &other, Shard::ALL, &out, &silent).unwrap().kept, 0);
}

#[test]
fn what_does_not_belong_together_is_refused() {
    let place = tempfile::tempdir().unwrap();
    let at = |name: &str| place.path().join(name);
    let bundles = [at("x"), at("y")];
    run(&bundles, &task(), Shard::ALL, &at("a"), &silent).unwrap();
    run(&bundles[..1], &task(), Shard::ALL, &at("b"), &silent).unwrap();
    // What a shard of the same list did is not left out of it.
    let fewer = run(&bundles[..1], &task(), Shard::ALL, &at("a"), &silent);
    assert!(matches!(
        fewer,
        Err(PipelineError::Fleet(FleetError::OtherList { .. }))
    ));
    let more = [at("x"), at("y"), at("z")];
    assert_eq!(
        run(&more, &task(), Shard::ALL, &at("grown"), &silent)
            .unwrap()
            .rows
            .len(),
        3
    );
    run(&bundles, &task(), Shard::ALL, &at("grown2"), &silent).unwrap();
    run(&more, &task(), Shard::ALL, &at("grown2"), &silent).unwrap();
    let refused = |folders: &[PathBuf]| match merge(folders) {
        Err(PipelineError::Fleet(error)) => error,
        other => panic!("{other:?}"),
    };
    assert!(matches!(refused(&[at("a"), at("b")]), FleetError::Lists { .. }));
    assert!(matches!(refused(&[at("nothing")]), FleetError::File { .. }));
    let twice = run(&[at("x"), at("x")], &task(), Shard::ALL, &at("c"), &silent);
    assert!(matches!(
        twice,
        Err(PipelineError::Fleet(FleetError::Twice { .. }))
    ));
    for text in ["0/2", "3/2", "1", "a/b", "1/0", "-1/2"] {
        assert_eq!(text.parse::<Shard>(), Err(FleetError::Shard), "{text}");
    }
    let parts: Vec<Shard> = ["1/3", "2/3", "3/3"].iter().map(|t| t.parse().unwrap()).collect();
    assert!((0..20).all(|i| parts.iter().filter(|s| s.takes(i)).count() == 1));
}

#[test]
fn a_file_of_others_is_replaced_where_that_is_asked() {
    let place = tempfile::tempdir().unwrap();
    let (bundles, out) = ([place.path().join("none")], place.path().join("out"));
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("fleet.json"), "notes of mine").unwrap();
    let refused = run(&bundles, &task(), Shard::ALL, &out, &silent);
    assert!(matches!(refused, Err(PipelineError::Place { .. })), "{refused:?}");
    assert_eq!(std::fs::read(out.join("fleet.json")).unwrap(), b"notes of mine");
    let asked = super::run(&bundles, &task(), Shard::ALL, (&out, Overwrite::Replace), &silent);
    assert_eq!(asked.unwrap().rows.len(), 1);
}
