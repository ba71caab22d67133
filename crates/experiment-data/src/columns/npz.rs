//! NPZ: a zip archive (stored or deflated) of `.npy` arrays.
//!
//! The archive is read by the `zip` crate, through `npyz`, which also writes. The small array header is parsed here,
//! because a foreign file may claim sizes whose product overflows, or nest without end.

mod header;

use self::header::{Header, number};
use super::{ColumnInfo, missing, vector_length};
use crate::RecordError;
use crate::columns::number::DEFLATE_RATIO;
use npyz::WriterBuilder;
use npyz::npz::{NpzArchive, NpzWriter, array_name_from_file_name, file_name_from_array_name};
use npyz::zip;
use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Write};
use std::path::Path;

pub(crate) fn read(path: &Path, names: &[&str]) -> Result<Vec<Vec<f64>>, RecordError> {
    let file = File::open(path).map_err(RecordError::io("open"))?;
    let mut archive = NpzArchive::new(BufReader::new(file)).map_err(|e| malformed("", &e.to_string()))?;
    names
        .iter()
        .map(|name| read_array(archive.zip_archive(), name))
        .collect()
}

/// Every vector of real numbers, in the order of the archive.
pub(crate) fn list(path: &Path) -> Result<Vec<ColumnInfo>, RecordError> {
    let file = File::open(path).map_err(RecordError::io("open"))?;
    let mut archive = NpzArchive::new(BufReader::new(file)).map_err(|e| malformed("", &e.to_string()))?;
    let archive = archive.zip_archive();
    let mut columns = Vec::new();
    for index in 0..archive.len() {
        let mut entry = archive.by_index(index).map_err(|e| refused("", &e))?;
        let Some(name) = array_name_from_file_name(entry.name()).map(str::to_owned) else {
            continue;
        };
        let header = Header::read(&mut entry).map_err(|problem| malformed(&name, problem))?;
        if let (Some(_), Ok(rows)) = (number(&header.descr), vector_length(&name, &header.shape)) {
            columns.push(ColumnInfo { name, rows });
        }
    }
    Ok(columns)
}

fn read_array<R: Read + std::io::Seek>(
    archive: &mut zip::ZipArchive<R>,
    name: &str,
) -> Result<Vec<f64>, RecordError> {
    let file = file_name_from_array_name(name);
    if !archive.file_names().any(|f| f == file) {
        let mut present: Vec<String> = archive
            .file_names()
            .filter_map(array_name_from_file_name)
            .map(str::to_owned)
            .collect();
        present.sort();
        return Err(missing(name, &present));
    }
    let mut entry = archive.by_name(&file).map_err(|e| refused(name, &e))?;
    let header = Header::read(&mut entry).map_err(|problem| malformed(name, problem))?;
    let length = vector_length(name, &header.shape)?;
    let Some(number) = number(&header.descr) else {
        let found = format!("the dtype '{}'", header.descr);
        return Err(RecordError::NotNumeric {
            column: name.to_owned(),
            found,
        });
    };
    let size = number.size as u64;
    let claimed = length
        .checked_mul(size)
        .and_then(|b| b.checked_add(header.length));
    let (unpacked, packed) = (entry.size(), entry.compressed_size());
    if claimed != Some(unpacked) {
        let problem = format!(
            "its header claims {length} values of {size} bytes, the archive holds {} bytes of values",
            unpacked.saturating_sub(header.length)
        );
        return Err(malformed(name, &problem));
    }
    if unpacked / DEFLATE_RATIO > packed {
        let problem = format!("{packed} bytes that claim to unpack to {unpacked}");
        return Err(malformed(name, &problem));
    }
    let column = number
        .column(&mut entry, length)
        .map_err(|e| malformed(name, &e.to_string()))?;
    // Reading on to the end lets the archive compare its checksum.
    let more = entry
        .read(&mut [0])
        .map_err(|e| malformed(name, &e.to_string()))?;
    if column.len() as u64 != length || more != 0 {
        let found = if more == 0 { "fewer" } else { "more" };
        let problem = format!("the header claims {length} values, the archive has {found}");
        return Err(malformed(name, &problem));
    }
    Ok(column)
}

/// Arrays of `<f8`, stored, with a fixed date: the same columns give the same bytes.
pub(crate) fn write(file: File, names: &[&str], columns: &[&[f64]]) -> Result<File, RecordError> {
    let mut npz = NpzWriter::new(BufWriter::new(file));
    for (name, column) in names.iter().zip(columns) {
        let options = zip::write::FileOptions::default()
            .compression_method(zip::CompressionMethod::Stored)
            .last_modified_time(zip::DateTime::default())
            .large_file(column.len() as u64 * 8 > u64::from(u32::MAX) / 2);
        let mut array = npz
            .array::<f64>(name, options)
            .map_err(RecordError::io("write"))?
            .default_dtype()
            .shape(&[column.len() as u64])
            .begin_nd()
            .map_err(RecordError::io("write"))?;
        array
            .extend(column.iter().copied())
            .map_err(RecordError::io("write"))?;
        array.finish().map_err(RecordError::io("write"))?;
    }
    let to_io = |e: zip::result::ZipError| RecordError::io("write")(std::io::Error::other(e.to_string()));
    let mut buffer = npz.zip_writer().finish().map_err(to_io)?;
    buffer.flush().map_err(RecordError::io("write"))?;
    buffer
        .into_inner()
        .map_err(|e| RecordError::io("write")(e.into_error()))
}

fn malformed(variable: &str, problem: &str) -> RecordError {
    RecordError::Malformed {
        format: "NPZ",
        variable: variable.to_owned(),
        problem: problem.to_owned(),
    }
}

fn refused(variable: &str, e: &zip::result::ZipError) -> RecordError {
    match e {
        zip::result::ZipError::UnsupportedArchive(what) => RecordError::UnsupportedFormat {
            found: format!("the array `{variable}` in this archive ({what})"),
            supported: "entries that are stored or deflated, without a password",
        },
        e => malformed(variable, &e.to_string()),
    }
}
