//! Files of other programs, and what their columns hold: tests/fixtures/make.py and make_instruments.py.

use std::path::PathBuf;

pub(crate) fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("tests/fixtures")
        .join(name)
}

/// Places of the numbers of a column.
pub(crate) const K: [f64; 5] = [0.0, 1.0, 2.0, 3.0, 4.0];

/// The numbers of a column.
pub(crate) fn expected(column: &str) -> [f64; 5] {
    K.map(|k| match column {
        "f4" => f64::from((k / 3.0) as f32),
        "i1" | "i8" => k - 2.0,
        "i2" => 1000.0 * k - 2000.0,
        "i4" => 100_000.0 * k - 200_000.0,
        "u1" => k + 250.0,
        "u2" => k + 65_000.0,
        "u4" => k + 4_294_967_000.0,
        "u8" => k,
        "flag" => f64::from(k % 2.0 == 0.0),
        "f2" => k / 4.0,
        "constant" => 0.25,
        "decimal" => [1.25, -2.5, 0.0, 100.0, 7.75][k as usize],
        "rig.axis.qm" | "rig.qm" => k / 7.0,
        _ => k / 3.0,
    })
}
