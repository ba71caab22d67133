use super::Row;
use super::small::{TOML, csv, edit, put, write};

pub(super) const CASES: &[Row] = &[
    (
        "folder-empty",
        "a folder without experiment.toml",
        |_| (),
        &["holds no experiment.toml; give a bundle folder"],
    ),
    (
        "file-missing",
        "a record file that is not there",
        |d| edit(d, "records/move.csv", "records/mvoe.csv"),
        &[
            ":36:8: records[1].file",
            "`records/mvoe.csv` does not exist",
            "nearest: `move.csv`",
        ],
    ),
    (
        "file-twice",
        "one file as two records",
        |d| edit(d, "records/move.csv", "records/./grid.csv"),
        &[":36:8: ", "`records/./grid.csv` is already records[0]"],
    ),
    (
        "file-a-folder",
        "a folder in the place of a record file",
        |d| {
            edit(d, "records/move.csv", "records/folder.csv");
            std::fs::create_dir(d.join("records/folder.csv")).unwrap();
        },
        &[
            ":36:8: ",
            "`records/folder.csv` does not exist or is no regular file",
        ],
    ),
    (
        "path-up",
        "a path that leaves the folder",
        |d| edit(d, "records/move.csv", "records/../../move.csv"),
        &[":36:8: ", "is outside the bundle: it contains `..`"],
    ),
    (
        "path-absolute",
        "an absolute path",
        |d| edit(d, "records/move.csv", "/data/move.csv"),
        &[":36:8: ", "is outside the bundle: it is absolute"],
    ),
    #[cfg(unix)]
    (
        "path-link-out",
        "a link that leaves the folder",
        |d| {
            edit(d, "records/move.csv", "records/link.csv");
            std::os::unix::fs::symlink("/dev/null", d.join("records/link.csv")).unwrap();
        },
        &[":36:8: ", "is outside the bundle: a link leads out of the folder"],
    ),
    #[cfg(unix)]
    (
        "path-link-twice",
        "one file under two names",
        |d| {
            edit(d, "records/move.csv", "records/alias.csv");
            std::os::unix::fs::symlink("grid.csv", d.join("records/alias.csv")).unwrap();
        },
        &[":36:8: ", "`records/alias.csv` is already records[0]"],
    ),
    (
        "ending-unknown",
        "a kind of file that is not read",
        |d| {
            edit(d, "records/move.csv", "records/move.xlsx");
            put(d, "records/move.xlsx", csv());
        },
        &[
            ":36:8: ",
            "the ending `.xlsx` are not supported; supported: .npz, .csv",
        ],
    ),
    (
        "ending-absent",
        "a file name without an ending",
        |d| edit(d, "records/move.csv", "records/move"),
        &[":36:8: ", "a record file without an ending is not supported"],
    ),
    (
        "file-empty-name",
        "an empty file name",
        |d| edit(d, "records/move.csv", ""),
        &[":36:8: ", "is not supported"],
    ),
    (
        "toml-not-utf8",
        "a description in another encoding",
        |d| {
            write(d);
            put(d, "experiment.toml", b"format = 1\nname = \"\xff\"");
        },
        &[":2:9: the text is not UTF-8"],
    ),
    (
        "toml-empty",
        "an empty description",
        |d| {
            write(d);
            put(d, "experiment.toml", "");
        },
        &[":1:1: missing key"],
    ),
    (
        "toml-nested",
        "a description nested deeper than any stack",
        |d| {
            write(d);
            put(
                d,
                "experiment.toml",
                format!("format = 1\nname = {}", "[".repeat(200_000)),
            );
        },
        &["experiment.toml:2:"],
    ),
    (
        "records-none",
        "a description without records",
        |d| {
            write(d);
            put(d, "experiment.toml", &TOML[..TOML.find("[[records]]").unwrap()]);
        },
        &["records: the bundle lists no record; add a [[records]] table"],
    ),
];
