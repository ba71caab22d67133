//! Data for the tests of the inner modules.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]

use crate::simulate::{MachineFile, simulate};
use experiment_data::{Bundle, RecordFormat};
use tempfile::TempDir;

/// A bundle with two periodic records at one position, of [`PERIODS`] of [`PERIOD`] samples each.
pub(crate) fn two_periodic_records() -> (TempDir, Bundle) {
    let folder = tempfile::tempdir().unwrap();
    let text = format!(
        "positions = {{ values = [0.1] }}\nmultisine = {{ period = {PERIOD}, periods = {PERIODS} }}\n\
         moves = {{ estimation = 0, validation = 1 }}\nsetpoints = {{ samples = 400 }}\n"
    );
    let file: MachineFile = toml::from_str(&text).unwrap();
    let out = folder.path().join("bundle");
    simulate(&file, &[], &out, RecordFormat::Npz, &|_, _| ()).unwrap();
    let bundle = Bundle::open(&out).unwrap();
    (folder, bundle)
}

pub(crate) const PERIOD: usize = 2048;
pub(crate) const PERIODS: usize = 9;
