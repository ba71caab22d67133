//! MAT and NPZ files of scipy and numpy (tests/fixtures/make.py), and one written byte by byte.
use crate::fixtures::{self, K, expected};
use experiment_data::{Bundle, DataError};
use lpv_core::Record;
use tempfile::TempDir;

fn fixture(name: &str) -> Vec<u8> {
    std::fs::read(fixtures::path(name)).unwrap()
}

/// A bundle of one transient record with the given file; the columns are auxiliary, as nothing is asked of those.
struct Written {
    dir: TempDir,
    file: String,
}

impl Written {
    fn new(file: &str, content: &[u8], columns: &[&str]) -> Self {
        let written = Self {
            dir: tempfile::tempdir().unwrap(),
            file: file.to_owned(),
        };
        let toml = format!(
            "format = 1\nname = 'x'\nsample_rate = 1\n[channels.output]\ncolumns = ['f8']\n[channels.input]\n\
             columns = ['f4']\n[channels.auxiliary]\ncolumns = {columns:?}\n[[records]]\nfile = '{file}'\n\
             kind = 'transient'\nuse = 'estimation'\n"
        );
        std::fs::write(written.dir.path().join("experiment.toml"), toml).unwrap();
        written.put(content);
        written
    }
    fn put(&self, content: &[u8]) {
        std::fs::write(self.dir.path().join(&self.file), content).unwrap();
    }
    fn load(&self) -> Result<Record, DataError> {
        Bundle::open(self.dir.path())?.load(0)
    }
}

fn load_as(file: &str, content: &[u8], columns: &[&str]) -> Result<Record, DataError> {
    Written::new(file, content, columns).load()
}

fn error(file: &str, content: &[u8], columns: &[&str]) -> String {
    load_as(file, content, columns)
        .map(|_| ())
        .unwrap_err()
        .to_string()
}

#[test]
fn all_numeric_types_of_other_programs() {
    let integers = ["i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "flag", "row"];
    let cases = [
        ("plain.mat", vec!["rig.axis.qm"]),
        ("packed.mat", vec!["rig.axis.qm"]),
        ("plain.npz", vec!["f2", "big", "column", "fortran"]),
        ("packed.npz", vec!["f2", "big", "column", "fortran"]),
    ];
    for (file, more) in cases {
        let columns: Vec<&str> = integers.iter().copied().chain(more).collect();
        let record = load_as(file, &fixture(file), &columns).unwrap();
        assert_eq!(record.outputs.columns[0], K.map(|k| k / 3.0));
        assert_eq!(record.inputs.columns[0], K.map(|k| f64::from((k / 3.0) as f32)));
        for (name, column) in columns.iter().zip(&record.auxiliary.columns) {
            assert_eq!(*column, expected(name), "{file}, {name}");
        }
    }
}

#[test]
fn what_is_no_vector_of_numbers_is_named() {
    for file in ["plain.mat", "packed.mat"] {
        let content = fixture(file);
        for (column, part) in [
            ("text", "column `text` holds characters"),
            ("cells", "holds a cell array"),
            ("z", "holds complex numbers"),
            (
                "matrix",
                "column `matrix` has the shape [2, 3]; store each signal",
            ),
            ("scalar", "column `scalar` has 1 rows, `f8` has 5"),
            ("rig", "holds a struct (name a field with a dot)"),
            ("rig.log", "column `rig.log` has 2 rows"),
            ("rig.axis.name", "column `rig.axis.name` holds characters"),
            (
                "rig.axis.qn",
                "no column `rig.axis.qn` among the 18 of the file; nearest: `rig.axis.qm`",
            ),
            ("f9", "nearest: `f8`, `f4`"),
        ] {
            let text = error(file, &content, &[column]);
            assert!(
                text.contains(file) && text.contains(part),
                "{part} expected in {text}"
            );
        }
    }
    for file in ["plain.npz", "packed.npz"] {
        let content = fixture(file);
        for (column, part) in [
            ("text", "column `text` holds the dtype '<U1'; a vector"),
            ("z", "holds the dtype '<c16'"),
            ("matrix", "has the shape [2, 3]"),
            ("scalar", "column `scalar` has the shape []"),
            (
                "i3",
                "no column `i3` among the 20 of the file; nearest: `i1`, `i2`, `i4`",
            ),
        ] {
            let text = error(file, &content, &[column]);
            assert!(
                text.contains(file) && text.contains(part),
                "{part} expected in {text}"
            );
        }
    }
}

/// A big-endian file written byte by byte: small elements, an int16 column stored as a double variable.
#[test]
fn big_endian_by_hand() {
    let mut file = vec![b' '; 124];
    file.extend([0x01, 0x00, b'M', b'I']);
    let mut variable = |name: &[u8; 2], kind: u32, data: &[u8]| {
        let mut m: Vec<u8> = Vec::new();
        m.extend([0, 0, 0, 6, 0, 0, 0, 8, 0, 0, 0, 6, 0, 0, 0, 0]);
        m.extend([0, 0, 0, 5, 0, 0, 0, 8, 0, 0, 0, 1, 0, 0, 0, 3]);
        m.extend([0, 2, 0, 1, name[0], name[1], 0, 0]);
        m.extend(kind.to_be_bytes());
        m.extend((data.len() as u32).to_be_bytes());
        m.extend(data);
        m.resize(m.len().next_multiple_of(8), 0);
        file.extend(14u32.to_be_bytes());
        file.extend((m.len() as u32).to_be_bytes());
        file.extend(m);
    };
    variable(b"f8", 3, &[0, 1, 0xff, 0xff, 1, 0]);
    variable(b"f4", 9, &[1.5f64, -2.0, 0.25].map(f64::to_be_bytes).concat());
    let record = load_as("x.mat", &file, &[]).unwrap();
    assert_eq!(record.outputs.columns[0], [1.0, -1.0, 256.0]);
    assert_eq!(record.inputs.columns[0], [1.5, -2.0, 0.25]);
}
