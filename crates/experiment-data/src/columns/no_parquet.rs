//! Stands for the reader and writer of Parquet files in a build without the feature `parquet`.

use crate::RecordError;
use crate::contents::{ColumnInfo, SUPPORTED};
use std::fs::File;
use std::path::Path;

pub(crate) fn read(_: &Path, _: &[&str]) -> Result<Vec<Vec<f64>>, RecordError> {
    Err(absent())
}

pub(crate) fn list(_: &Path) -> Result<Vec<ColumnInfo>, RecordError> {
    Err(absent())
}

pub(crate) fn write(_: File, _: &[&str], _: &[&[f64]]) -> Result<File, RecordError> {
    Err(absent())
}

fn absent() -> RecordError {
    RecordError::UnsupportedFormat {
        found: "`.parquet`".to_owned(),
        supported: SUPPORTED,
    }
}
