//! MAT 7.3 and Parquet files of h5py and pyarrow (tests/fixtures/make.py).
use crate::fixtures::{self, expected};
use experiment_data::{ColumnInfo, list_columns, read_columns};

const NUMBERS: [&str; 11] = ["f8", "f4", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "flag"];

const FILES: [(&str, &[&str]); 4] = [
    ("v73.mat", &["row", "rig.axis.qm"]),
    ("plain_hdf5.mat", &["row", "big", "rig.axis.qm"]),
    ("snappy.parquet", &["f2", "decimal", "constant", "rig.qm"]),
    ("plain.parquet", &["f2", "decimal", "constant", "rig.qm"]),
];

#[test]
fn all_numeric_types_of_other_programs() {
    for (file, more) in FILES {
        let mut names: Vec<&str> = NUMBERS.iter().chain(more).copied().collect();
        // The order is that of the names.
        names.reverse();
        let columns = read_columns(&fixtures::path(file), &names).unwrap();
        for (name, column) in names.iter().zip(columns) {
            assert_eq!(column, expected(name), "{file}, {name}");
        }
    }
}

#[test]
fn lists_name_what_can_be_read() {
    for file in [
        "plain.mat",
        "plain.npz",
        "v73.mat",
        "plain_hdf5.mat",
        "snappy.parquet",
    ] {
        let listed = list_columns(&fixtures::path(file)).unwrap();
        let names: Vec<&str> = listed.iter().map(|c| c.name.as_str()).collect();
        println!("{file}: {names:?}");
        for name in NUMBERS {
            assert!(names.contains(&name), "{file}, {name}");
        }
        for name in [
            "text", "cells", "z", "matrix", "rig", "time", "list", "many.x", "thin",
        ] {
            assert!(!names.contains(&name), "{file}, {name}");
        }
        // `gaps` is listed, because only its values show that some are absent; `packed` by its filter.
        for ColumnInfo { name, rows } in &listed {
            if !["gaps", "packed"].contains(&name.as_str()) {
                let column = &read_columns(&fixtures::path(file), &[name]).unwrap()[0];
                assert_eq!(column.len() as u64, *rows, "{file}, {name}");
            }
        }
    }
}

#[test]
fn what_is_no_column_of_numbers_is_named() {
    for (file, column, part) in [
        ("v73.mat", "text", "column `text` holds characters"),
        ("v73.mat", "cells", "holds a cell array"),
        ("v73.mat", "z", "holds complex numbers"),
        ("v73.mat", "matrix", "column `matrix` has the shape [2, 3]"),
        ("v73.mat", "rig", "holds a struct (name a field with a dot)"),
        ("v73.mat", "many.x", "holds a struct array"),
        ("v73.mat", "thin", "holds a sparse matrix"),
        ("v73.mat", "rig.axis.qn", "nearest: `rig.axis.qm`"),
        ("v73.mat", "#refs#.a", "no column `#refs#.a`"),
        (
            "plain_hdf5.mat",
            "packed",
            "`packed` with the HDF5 filter lzf is not supported",
        ),
        ("snappy.parquet", "text", "holds texts or bytes"),
        ("snappy.parquet", "time", "holds dates or times"),
        ("snappy.parquet", "list.list.element", "holds lists"),
        (
            "snappy.parquet",
            "f9",
            "no column `f9` among the 19 of the file; nearest: `f8`, `f4`, `f2`",
        ),
        (
            "snappy.parquet",
            "gaps",
            "column `gaps` has no value (null) in rows 2, 5, 2 in all",
        ),
        (
            "plain.parquet",
            "gaps",
            "column `gaps` has no value (null) in rows 2, 5, 2 in all",
        ),
        (
            "zstd.parquet",
            "f8",
            "`f8` packed with ZSTD is not supported; supported: Parquet with snappy",
        ),
    ] {
        let text = read_columns(&fixtures::path(file), &[column])
            .unwrap_err()
            .to_string();
        assert!(text.contains(part), "{part} expected in {text}");
    }
    let empty = read_columns(&fixtures::path("v73.mat"), &["empty", "scalar"]).unwrap();
    assert_eq!(empty, [vec![], vec![3.0]]);
}
