use super::{Row, find, grid_as, hdf5, one_file, replace};
use experiment_data::RecordFormat::Mat;
use flate2::write::ZlibEncoder;
use hdf5_pure::LibVer;
use hdf5_pure::mat::{Compression, MatBuilder, Options};
use std::io::Write;
use std::path::Path;

const PLAIN: &[u8] = include_bytes!("../../fixtures/plain.mat");
const PACKED: &[u8] = include_bytes!("../../fixtures/packed.mat");
const V73: &[u8] = include_bytes!("../../fixtures/v73.mat");
const HDF5: &[u8] = include_bytes!("../../fixtures/plain_hdf5.mat");

/// A file of version 7.3 with two columns of 120 values, changed byte by byte.
fn version73(dir: &Path, change: impl FnOnce(&mut Vec<u8>)) {
    let mut file = MatBuilder::new(Options::default());
    let column: Vec<f64> = (0..120).map(|k| f64::from(k).sin()).collect();
    file.write_f64("y", &[120, 1], &column).unwrap();
    file.write_f64("u", &[120, 1], &column).unwrap();
    let mut bytes = file.finish().unwrap();
    change(&mut bytes);
    one_file(dir, "x.mat", &bytes, "y", "u");
}

/// The same packed, with columns of so many one-byte zeros.
fn packed73(numbers: usize) -> Vec<u8> {
    let mut options = Options::default();
    options.compression = Compression::Deflate {
        level: 6,
        shuffle: false,
    };
    options.libver = LibVer::V110;
    let mut file = MatBuilder::new(options);
    for name in ["y", "u"] {
        file.write_u8(name, &[numbers, 1], &vec![0; numbers]).unwrap();
    }
    file.finish().unwrap()
}

/// A level 5 file with two packed columns of so many one-byte zeros.
fn packed5(numbers: u32) -> Vec<u8> {
    let mut file = PACKED[..128].to_vec();
    for name in ["y", "u"] {
        let words = |words: &[u32]| words.iter().flat_map(|w| w.to_le_bytes()).collect::<Vec<u8>>();
        let mut body = words(&[
            6,
            8,
            9,
            0,
            5,
            8,
            numbers,
            1,
            1 << 16 | 1,
            u32::from(name.as_bytes()[0]),
        ]);
        body.extend(words(&[2, numbers]));
        body.resize(body.len() + (numbers as usize).next_multiple_of(8), 0);
        let mut packer = ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
        packer.write_all(&words(&[14, body.len() as u32])).unwrap();
        packer.write_all(&body).unwrap();
        let packed = packer.finish().unwrap();
        file.extend(words(&[15, packed.len() as u32]));
        file.extend(packed);
    }
    file
}

fn plain(dir: &Path, input: &str) {
    one_file(dir, "plain.mat", PLAIN, "f8", input);
}

pub(super) const CASES: &[Row] = &[
    (
        "mat-other",
        "a file that is none of MATLAB's",
        |d| grid_as(d, Mat, |f| *f = vec![b'a'; 200]),
        &["damaged MAT file: it does not have the mark of a level 5 MAT file"],
    ),
    (
        "mat-short",
        "a file shorter than its header",
        |d| grid_as(d, Mat, |f| f.truncate(100)),
        &["damaged MAT file: it is shorter than the header"],
    ),
    (
        "mat-level-4",
        "a file of level 4",
        |d| grid_as(d, Mat, |f| f[..128].fill(0)),
        &["a MAT file of level 4 (save it with `-v7`) is not supported"],
    ),
    (
        "mat-cut",
        "a file that was cut",
        |d| grid_as(d, Mat, |f| f.truncate(600)),
        &["damaged MAT file: an element claims 1016 bytes, the file has 464 more (element at byte 128)"],
    ),
    (
        "mat-claim-element",
        "an element that claims 4 GiB",
        |d| grid_as(d, Mat, |f| f[132..136].fill(0xff)),
        &["an element claims 4294967295 bytes", "(element at byte 128)"],
    ),
    (
        "mat-claim-dimensions",
        "dimensions that claim 10 GiB",
        |d| {
            grid_as(d, Mat, |f| {
                f[160..164].copy_from_slice(&1_342_177_280u32.to_le_bytes())
            })
        },
        &["`y1`: dimensions for 1342177280 numbers of 8 bytes, but 960 bytes of them"],
    ),
    (
        "mat-bomb",
        "an element that claims to unpack to 4 GiB",
        |d| {
            let mut file = PACKED[..128].to_vec();
            // The tag of a matrix of 4 GiB, as a stored block of zlib with its sums.
            let tag = [14, 0, 0, 0, 0xf8, 0xff, 0xff, 0xff];
            let sums = tag.iter().fold((1, 0), |(a, b), byte| {
                (a + u32::from(*byte), b + a + u32::from(*byte))
            });
            let mut packed = vec![0x78, 1, 1, 8, 0, 0xf7, 0xff];
            packed.extend(tag);
            packed.extend((sums.1 << 16 | sums.0).to_be_bytes());
            file.extend([15, 0, 0, 0, packed.len() as u8, 0, 0, 0]);
            file.extend(packed);
            one_file(d, "x.mat", &file, "y", "u");
        },
        &["damaged MAT file: 19 bytes that claim to unpack to 4294967288 (element at byte 128)"],
    ),
    (
        "mat-unpacks",
        "a few kilobytes that would fill the memory",
        |d| one_file(d, "x.mat", &packed5(6_000_000), "y", "u"),
        &["column `u` claims 6000000 numbers: with it 96 MB of memory would be needed for"],
    ),
    (
        "mat-checksum",
        "a packed element whose checksum is wrong",
        |d| {
            let mut file = PACKED.to_vec();
            let length = u32::from_le_bytes(std::array::from_fn(|i| file[132 + i])) as usize;
            file[136 + length - 1] ^= 1;
            one_file(d, "packed.mat", &file, "f8", "f4");
        },
        &[
            "damaged MAT file: it cannot be read or unpacked",
            "(element at byte 128)",
        ],
    ),
    (
        "mat-text",
        "characters",
        |d| plain(d, "text"),
        &["column `text` holds characters"],
    ),
    (
        "mat-cells",
        "a cell array",
        |d| plain(d, "cells"),
        &["column `cells` holds a cell array"],
    ),
    (
        "mat-complex",
        "complex numbers",
        |d| plain(d, "z"),
        &["column `z` holds complex numbers"],
    ),
    (
        "mat-matrix",
        "a matrix",
        |d| plain(d, "matrix"),
        &["column `matrix` has the shape [2, 3]; store each signal as a vector"],
    ),
    (
        "mat-struct",
        "a struct in the place of one of its fields",
        |d| plain(d, "rig"),
        &["column `rig` holds a struct (name a field with a dot)"],
    ),
    (
        "mat-field",
        "a field that a struct does not have",
        |d| plain(d, "rig.axis.qn"),
        &["no column `rig.axis.qn` among the 18 of the file; nearest: `rig.axis.qm`"],
    ),
    (
        "mat-lengths",
        "columns of different lengths",
        |d| plain(d, "scalar"),
        &["column `scalar` has 1 rows, `f8` has 5; all columns of a record have one length"],
    ),
    (
        "v73-header-only",
        "a header of version 7.3 with nothing behind it",
        |d| one_file(d, "x.mat", &V73[..300], "f8", "f4"),
        &["damaged MAT (version 7.3) file"],
    ),
    (
        "v73-cut",
        "a file of version 7.3 that was cut",
        |d| version73(d, |f| f.truncate(1500)),
        &["damaged MAT (version 7.3) file"],
    ),
    (
        "v73-bit",
        "a changed bit of a header",
        |d| {
            version73(d, |f| {
                let at = find(f, b"MATLAB_class");
                f[at] ^= 1;
            });
        },
        &["damaged MAT (version 7.3) file", "checksum"],
    ),
    (
        "v73-claim",
        "a header that claims 10 GiB",
        |d| {
            version73(d, |f| {
                replace(f, &120u64.to_le_bytes(), &1_342_177_280u64.to_le_bytes());
                hdf5::reseal(f);
            });
        },
        &["`y`: its header claims 1342177280 values of 8 bytes, the file has"],
    ),
    (
        "v73-unpacks",
        "a few kilobytes of version 7.3 that would fill the memory",
        |d| one_file(d, "x.mat", &packed73(6_000_000), "y", "u"),
        &["column `u` claims 6000000 numbers: with it 96 MB of memory would be needed for"],
    ),
    (
        "v73-part",
        "a part of a column that claims 4 GiB",
        |d| {
            let mut file = V73.to_vec();
            // The size of the first part stands behind the head of the tree that finds the parts.
            let tree = find(&file, b"TREE\x01");
            file[tree + 24..tree + 28].copy_from_slice(&0xffff_fff0_u32.to_le_bytes());
            one_file(d, "v73.mat", &file, "f4", "i2");
        },
        &["damaged MAT (version 7.3) file, `f4`: a part of 4294967280 bytes at byte"],
    ),
    (
        "v73-text",
        "characters in version 7.3",
        |d| one_file(d, "v73.mat", V73, "f8", "text"),
        &["column `text` holds characters"],
    ),
    (
        "v73-sparse",
        "a sparse matrix",
        |d| one_file(d, "v73.mat", V73, "f8", "thin"),
        &["column `thin` holds a sparse matrix"],
    ),
    (
        "v73-empty",
        "an empty variable",
        |d| one_file(d, "v73.mat", V73, "empty", "f4"),
        &["column `empty` has no rows"],
    ),
    (
        "v73-filter",
        "a packing that MATLAB does not use",
        |d| one_file(d, "plain_hdf5.mat", HDF5, "f8", "packed"),
        &["`packed` with the HDF5 filter lzf is not supported; supported: deflate"],
    ),
];
