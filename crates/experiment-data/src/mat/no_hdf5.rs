//! Stands for the reader of MATLAB files of version 7.3 in a build without the feature `hdf5`.

use super::Array;
use super::catalog::Item;
use crate::RecordError;
use crate::contents::{ColumnInfo, SUPPORTED};
use std::path::Path;

pub(super) fn read(_: &Path, _: &[&str]) -> Result<Vec<Vec<f64>>, RecordError> {
    Err(absent())
}

pub(super) fn read_arrays(_: &Path, _: &[&str]) -> Result<Vec<Array>, RecordError> {
    Err(absent())
}

pub(super) fn numbers(_: &Path, _: &str) -> Result<crate::response::numbers::Numbers, RecordError> {
    Err(absent())
}

pub(super) fn survey(_: &Path) -> Result<Vec<Item>, RecordError> {
    Err(absent())
}

/// Units and settings, of which there are none here.
#[derive(Default)]
pub(super) struct Attributes {
    pub(super) units: std::collections::HashMap<String, String>,
    pub(super) scalars: Vec<crate::contents::Scalar>,
}

pub(super) fn attributes(_: &Path) -> Result<Attributes, RecordError> {
    Err(absent())
}

pub(super) fn list(_: &Path) -> Result<Vec<ColumnInfo>, RecordError> {
    Err(absent())
}

fn absent() -> RecordError {
    RecordError::UnsupportedFormat {
        found: "`.mat` of version 7.3".to_owned(),
        supported: SUPPORTED,
    }
}
