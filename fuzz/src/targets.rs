//! What is done with an input, and what must hold of it beside no panic.

use experiment_data::{Bundle, list_columns, read_columns};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// A reader.
#[derive(Clone, Copy)]
pub struct Target {
    /// Its name, which is that of its corpus.
    pub name: &'static str,
    /// Reads the input.
    pub run: fn(&[u8]),
}

/// Those of records and descriptions.
pub const TARGETS: &[Target] = &[
    Target {
        name: "csv",
        run: |data| columns("r.csv", data),
    },
    Target {
        name: "npz",
        run: |data| columns("r.npz", data),
    },
    Target {
        name: "mat",
        run: |data| columns("r.mat", data),
    },
    Target {
        name: "mat73",
        run: |data| columns("h.mat", data),
    },
    Target {
        name: "parquet",
        run: |data| columns("r.parquet", data),
    },
    Target {
        name: "description",
        run: description,
    },
];

/// The folder of the inputs, in memory where the system has such a place.
pub fn folder() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let memory = Path::new("/dev/shm");
        let above = if memory.is_dir() {
            memory.to_owned()
        } else {
            std::env::temp_dir()
        };
        let folder = above.join(format!("lpv-fuzz-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder for the inputs");
        folder
    })
}

pub(crate) fn file(name: &str, data: &[u8]) -> PathBuf {
    let path = folder().join(name);
    std::fs::write(&path, data).expect("an input that can be written");
    path
}

/// What a file lists as a column of so many rows is read as such, or refused.
fn columns(name: &str, data: &[u8]) {
    let path = file(name, data);
    let Ok(listed) = list_columns(&path) else {
        // What cannot be listed may still be asked for.
        drop(read_columns(&path, &["y"]));
        return;
    };
    let names: Vec<&str> = listed.iter().map(|c| c.name.as_str()).take(64).collect();
    if let Ok(columns) = read_columns(&path, &names) {
        assert_eq!(columns.len(), names.len());
        for (column, info) in columns.iter().zip(&listed) {
            assert_eq!(column.len() as u64, info.rows, "{}", info.name);
        }
    }
    drop(read_columns(&path, &["y", "s.a", "u"]));
}

/// A bundle with this description beside two record files.
fn description(data: &[u8]) {
    static RECORDS: OnceLock<()> = OnceLock::new();
    RECORDS.get_or_init(|| {
        let table = |rows: u32| {
            let row = |k: u32| {
                format!(
                    "{},{},{},0.5\n",
                    f64::from(k % 8).sin(),
                    f64::from(k % 8).cos(),
                    k % 8
                )
            };
            (0..rows).fold("y,u,r,p\n".to_owned(), |text, k| text + &row(k))
        };
        file("a.csv", table(32).as_bytes());
        file("b.csv", table(40).as_bytes());
    });
    let path = file("experiment.toml", data);
    if let Ok(bundle) = Bundle::open(&path) {
        for index in 0..bundle.len().min(8) {
            let whole = bundle.load(index);
            let mut samples = 0;
            let parts = bundle.each_period(index, |part| samples += part.len());
            assert_eq!(whole.is_ok(), parts.is_ok(), "whole and in parts alike");
            if let Ok(record) = whole {
                assert_eq!(record.len(), samples);
            }
        }
    }
}
