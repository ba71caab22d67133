use super::{Row, find, grid_as, one_file};
use experiment_data::RecordFormat::Parquet;

const SNAPPY: &[u8] = include_bytes!("../../fixtures/snappy.parquet");
const ZSTD: &[u8] = include_bytes!("../../fixtures/zstd.parquet");

/// Thrift's signed integer of a field that follows the one before it.
fn field(value: u64) -> Vec<u8> {
    let mut bytes = vec![0x16];
    let mut left = 2 * value;
    while left > 127 {
        bytes.push(left as u8 | 128);
        left >>= 7;
    }
    bytes.push(left as u8);
    bytes
}

/// Another number of rows wherever the footer says it.
fn claim_rows(file: &mut Vec<u8>, rows: u64) {
    let tail = file.len() - 8;
    let length = u32::from_le_bytes(std::array::from_fn(|i| file[tail + i])) as usize;
    let mut footer = file[tail - length..tail].to_vec();
    let (old, new) = (field(120), field(rows));
    let mut at = 0;
    while let Some(next) = footer[at..].windows(old.len()).position(|w| w == old) {
        footer.splice(at + next..at + next + old.len(), new.iter().copied());
        at += next + new.len();
    }
    assert!(at > 0);
    file.truncate(tail - length);
    file.extend(&footer);
    file.extend((footer.len() as u32).to_le_bytes());
    file.extend(b"PAR1");
}

pub(super) const CASES: &[Row] = &[
    (
        "parquet-other",
        "a file that is no Parquet",
        |d| grid_as(d, Parquet, |f| *f = b"u1,u2\n1,2\n".to_vec()),
        &["damaged Parquet file"],
    ),
    (
        "parquet-cut",
        "a file that was cut",
        |d| grid_as(d, Parquet, |f| f.truncate(f.len() / 2)),
        &["damaged Parquet file"],
    ),
    (
        "parquet-claim",
        "a footer that claims 10 GiB",
        |d| grid_as(d, Parquet, |f| claim_rows(f, 1_342_177_280)),
        &["its footer claims 1342177280 rows, the file has"],
    ),
    (
        "parquet-claim-more",
        "a footer that claims a row too much",
        |d| grid_as(d, Parquet, |f| claim_rows(f, 121)),
        &[
            "damaged Parquet file, `y1`: ",
            "its footer claims 121 rows, the column has 120",
        ],
    ),
    (
        "parquet-page",
        "a page longer than its column",
        |d| {
            grid_as(d, Parquet, |f| {
                // Type, size, size packed: the last of two bytes each.
                assert_eq!(f[4], 0x15);
                let at = 4 + find(&f[4..], &[0x15]) + 2;
                let at = at + find(&f[at..], &[0x15]) + 1;
                let at = at + find(&f[at..], &[0x15]) + 1;
                f[at] |= 0x80;
                f[at + 1] = 0x7f;
            });
        },
        &["damaged Parquet file, `y1`: a page of"],
    ),
    (
        "parquet-codec",
        "a codec that is not read",
        |d| one_file(d, "zstd.parquet", ZSTD, "f8", "f4"),
        &["`f8` packed with ZSTD is not supported; supported: Parquet with snappy"],
    ),
    (
        "parquet-nulls",
        "rows without a value",
        |d| one_file(d, "snappy.parquet", SNAPPY, "f8", "gaps"),
        &["column `gaps` has no value (null) in rows 2, 5, 2 in all"],
    ),
    (
        "parquet-text",
        "texts in Parquet",
        |d| one_file(d, "snappy.parquet", SNAPPY, "f8", "text"),
        &["column `text` holds texts or bytes"],
    ),
    (
        "parquet-time",
        "times",
        |d| one_file(d, "snappy.parquet", SNAPPY, "f8", "time"),
        &["column `time` holds dates or times"],
    ),
    (
        "parquet-list",
        "lists",
        |d| one_file(d, "snappy.parquet", SNAPPY, "f8", "list.list.element"),
        &["column `list.list.element` holds lists"],
    ),
    (
        "parquet-column",
        "a column that a Parquet file does not have",
        |d| one_file(d, "snappy.parquet", SNAPPY, "f8", "f9"),
        &["no column `f9` among the 19 of the file; nearest: `f8`, `f4`, `f2`"],
    ),
];
