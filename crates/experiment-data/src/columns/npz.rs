//! NPZ: a zip archive (stored or deflated) of `.npy` arrays.
//!
//! The archive is read by the `zip` crate, through `npyz`, which also writes. The small array header is parsed here,
//! because a foreign file may claim sizes whose product overflows, or nest without end.

mod header;

use self::header::{Header, Kind};
use super::{missing, vector_length};
use crate::RecordError;
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
    let mut entry = archive
        .by_name(&file)
        .map_err(|e| malformed(name, &e.to_string()))?;
    let header = Header::read(&mut entry).map_err(|problem| malformed(name, problem))?;
    let length = vector_length(name, &header.shape)?;
    let Some(kind) = Kind::of(&header.descr) else {
        let found = format!("the dtype '{}'", header.descr);
        return Err(RecordError::NotNumeric {
            column: name.to_owned(),
            found,
        });
    };
    let size = kind.size as u64;
    let bytes = length
        .checked_mul(size)
        .ok_or_else(|| malformed(name, "the header claims too many values"))?;
    // The buffer grows with what arrives, so a false claim costs nothing. Reading to the end also lets the archive
    // compare its checksum; one byte more than claimed is enough to see a false claim.
    let mut data = Vec::new();
    entry
        .take(bytes.saturating_add(1))
        .read_to_end(&mut data)
        .map_err(|e| malformed(name, &e.to_string()))?;
    if data.len() as u64 != bytes {
        let more = if data.len() as u64 > bytes {
            "at least "
        } else {
            ""
        };
        let problem = format!(
            "the header claims {bytes} bytes of data, the archive has {more}{}",
            data.len()
        );
        return Err(malformed(name, &problem));
    }
    Ok(data.chunks_exact(kind.size).map(|c| kind.value(c)).collect())
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
