use super::{Row, find, grid_as, one_file, replace};
use experiment_data::RecordFormat::Npz;
use npyz::zip::write::FileOptions;
use npyz::zip::{CompressionMethod, ZipWriter};
use std::io::{Cursor, Write};

const PLAIN: &[u8] = include_bytes!("../../fixtures/plain.npz");

/// Another shape in the header of the first array, as long as the header allows.
fn shape(file: &mut [u8], text: &str) {
    let at = find(file, b"'shape': ") + 9;
    let end = at + find(&file[at..], b"\n");
    let mut header = format!("{text}, }}").into_bytes();
    header.resize(end - at, b' ');
    file[at..end].copy_from_slice(&header);
}

/// Packed arrays of so many one-byte zeros: a few kilobytes that become eight bytes a number.
pub(crate) fn zeros(columns: &[&str], numbers: usize) -> Vec<u8> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let options = FileOptions::default().compression_method(CompressionMethod::Deflated);
    let header = format!("{{'descr': '|u1', 'fortran_order': False, 'shape': ({numbers},), }}\n");
    let mut array = b"\x93NUMPY\x01\x00".to_vec();
    array.extend((header.len() as u16).to_le_bytes());
    array.extend(header.as_bytes());
    array.resize(array.len() + numbers, 0);
    for name in columns {
        archive.start_file(format!("{name}.npy"), options).unwrap();
        archive.write_all(&array).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

pub(super) const CASES: &[Row] = &[
    (
        "npz-other",
        "a file that is no archive",
        |d| grid_as(d, Npz, |f| *f = b"u1,u2\n1,2\n".to_vec()),
        &["damaged NPZ file"],
    ),
    (
        "npz-empty",
        "an empty file",
        |d| grid_as(d, Npz, Vec::clear),
        &["damaged NPZ file"],
    ),
    (
        "npz-cut",
        "a file that was cut",
        |d| grid_as(d, Npz, |f| f.truncate(f.len() / 2)),
        &["damaged NPZ file"],
    ),
    (
        "npz-bit",
        "a bit that has changed",
        |d| grid_as(d, Npz, |f| f[300] ^= 1),
        &["damaged NPZ file, `y1`: Invalid checksum"],
    ),
    (
        "npz-twice",
        "two arrays of one name",
        |d| one_file(d, "x.npz", &zeros(&["y", "u", "u"], 8), "y", "u"),
        &["damaged NPZ file, `u`: the archive holds two arrays of this name"],
    ),
    (
        "npz-claim",
        "a header that claims 10 GiB",
        |d| grid_as(d, Npz, |f| shape(f, "(1342177280,)")),
        &["`y1`: its header claims 1342177280 values of 8 bytes, the archive holds 960 bytes"],
    ),
    (
        "npz-claim-overflow",
        "a header that claims more than can be counted",
        |d| grid_as(d, Npz, |f| shape(f, "(18446744073709551615,)")),
        &["`y1`: its header claims 18446744073709551615 values"],
    ),
    (
        "npz-claim-few",
        "a header that claims fewer values than there are",
        |d| grid_as(d, Npz, |f| shape(f, "(119,)")),
        &["`y1`: its header claims 119 values of 8 bytes, the archive holds 960 bytes"],
    ),
    (
        "npz-bomb",
        "1088 bytes that claim to unpack to 4 GiB",
        |d| {
            grid_as(d, Npz, |f| {
                shape(f, "(536870895,)");
                let directory = find(f, b"PK\x01\x02");
                let size = (128 + 8 * 536_870_895u64) as u32;
                f[directory + 24..directory + 28].copy_from_slice(&size.to_le_bytes());
            });
        },
        &["`y1`: 1088 bytes that claim to unpack to 4294967288"],
    ),
    (
        "npz-unpacks",
        "a few kilobytes that would fill the memory",
        |d| one_file(d, "x.npz", &zeros(&["y", "u"], 6_000_000), "y", "u"),
        &[
            "column `u` claims 6000000 numbers: with it 96 MB of memory would be needed for",
            "of files, which get 67 MB at most",
            "save it without compression or cut it into shorter records",
        ],
    ),
    (
        "npz-stream-short",
        "an archive that claims a value more than it holds",
        |d| {
            grid_as(d, Npz, |f| {
                shape(f, "(121,)");
                let directory = find(f, b"PK\x01\x02");
                f[directory + 24..directory + 28].copy_from_slice(&(128 + 8 * 121u32).to_le_bytes());
            });
        },
        &["damaged NPZ file, `y1`: "],
    ),
    (
        "npz-no-array",
        "an entry that is no array",
        |d| grid_as(d, Npz, |f| replace(f, b"\x93NUMPY", b"GIF89a")),
        &["`y1`: it does not start like a NumPy array"],
    ),
    (
        "npz-password",
        "an archive with a password",
        |d| {
            grid_as(d, Npz, |f| {
                let (local, directory) = (find(f, b"PK\x03\x04"), find(f, b"PK\x01\x02"));
                f[local + 6] |= 1;
                f[directory + 8] |= 1;
            });
        },
        &["the array `y1` in this archive", "without a password"],
    ),
    (
        "npz-entry-path",
        "an entry with a path in its name",
        |d| grid_as(d, Npz, |f| replace(f, b"y1.npy", b"/1.npy")),
        &["no column `y1` among the 7 of the file"],
    ),
    (
        "npz-two-dimensions",
        "an array of two dimensions",
        |d| grid_as(d, Npz, |f| shape(f, "(60, 2)")),
        &["column `y1` has the shape [60, 2]; store each signal as a vector"],
    ),
    (
        "npz-text",
        "texts",
        |d| one_file(d, "plain.npz", PLAIN, "f8", "text"),
        &["column `text` holds the dtype '<U1'; a vector of real numbers is needed"],
    ),
    (
        "npz-complex",
        "complex numbers",
        |d| one_file(d, "plain.npz", PLAIN, "f8", "z"),
        &["column `z` holds the dtype '<c16'"],
    ),
    (
        "npz-scalar",
        "a single number",
        |d| one_file(d, "plain.npz", PLAIN, "f8", "scalar"),
        &["column `scalar` has the shape []"],
    ),
];
