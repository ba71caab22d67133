//! NPZ: a zip archive (stored or deflated) of `.npy` arrays.
//!
//! The archive is read by the `zip` crate, through `npyz`, which also writes. The small array header is parsed here,
//! because a foreign file may claim sizes whose product overflows, or nest without end.

mod arrays;
mod header;
mod quiet;

pub(crate) use self::arrays::{entries, numbers};
use self::header::{Header, number};
use self::quiet::Quiet;
use super::Sink;
use crate::RecordError;
use crate::columns::number::{DEFLATE_RATIO, Number};
use crate::contents::{
    Column, ColumnInfo, Contents, MOST_SCALARS, PassedOver, Scalar, missing, vector_length,
};
use crate::memory::Allowance;
use npyz::WriterBuilder;
use npyz::npz::{NpzArchive, NpzWriter, array_name_from_file_name, file_name_from_array_name};
use npyz::zip;
use std::collections::HashSet;
use std::fs::File;
use std::io::{BufReader, BufWriter, Read, Write};
use std::path::Path;

pub(crate) fn read(path: &Path, names: &[&str]) -> Result<Vec<Vec<f64>>, RecordError> {
    let mut archive = open(path)?;
    let archive = archive.zip_archive();
    let mut allowance = Allowance::new(size(path)?);
    for name in names {
        allowance.take(name, Array::open(archive, name)?.length)?;
    }
    names
        .iter()
        .map(|name| Array::open(archive, name)?.next(u64::MAX))
        .collect()
}

/// All arrays side by side, each with its own place in the file.
pub(crate) fn each_block(
    path: &Path,
    names: &[&str],
    rows: usize,
    sink: Sink<'_>,
) -> Result<(), RecordError> {
    let mut archives = names.iter().map(|_| open(path)).collect::<Result<Vec<_>, _>>()?;
    let arrays = archives.iter_mut().zip(names);
    let mut arrays = arrays
        .map(|(archive, name)| Array::open(archive.zip_archive(), name))
        .collect::<Result<Vec<_>, _>>()?;
    let mut allowance = Allowance::new(size(path)?);
    for array in &arrays {
        allowance.take(array.name, array.length.min(rows as u64))?;
    }
    loop {
        let block = arrays.iter_mut().map(|a| a.next(rows as u64));
        let block = block.collect::<Result<Vec<_>, _>>()?;
        if block.iter().all(Vec::is_empty) {
            return Ok(());
        }
        sink(block);
    }
}

fn size(path: &Path) -> Result<u64, RecordError> {
    Ok(path.metadata().map_err(RecordError::io("read"))?.len())
}

fn open(path: &Path) -> Result<NpzArchive<BufReader<File>>, RecordError> {
    let file = File::open(path).map_err(RecordError::io("open"))?;
    // Headers are looked at more than once; values pass by the buffer.
    const BUFFER: usize = 1 << 10;
    let mut archive =
        NpzArchive::new(BufReader::with_capacity(BUFFER, file)).map_err(|e| malformed("", &e.to_string()))?;
    let zip = archive.zip_archive();
    // Names are unique in the index of the archive, entries are not.
    if zip.file_names().count() < zip.len() {
        let mut seen = HashSet::new();
        for index in 0..zip.len() {
            let entry = zip.by_index_raw(index).map_err(|e| refused("", &e))?;
            let name = array_name_from_file_name(entry.name()).unwrap_or(entry.name());
            if !seen.insert(name.to_owned()) {
                return Err(malformed(
                    name,
                    "the archive holds two arrays of this name; write each under a name of its own",
                ));
            }
        }
    }
    Ok(archive)
}

/// Every array with its name and header, in the order of the archive; its numbers are still to be read.
fn each_array(
    path: &Path,
    mut take: impl FnMut(String, &Header, &mut dyn Read) -> Result<(), RecordError>,
) -> Result<(), RecordError> {
    let mut archive = open(path)?;
    let archive = archive.zip_archive();
    for index in 0..archive.len() {
        let mut entry = archive.by_index(index).map_err(|e| refused("", &e))?;
        let Some(name) = array_name_from_file_name(entry.name()).map(str::to_owned) else {
            continue;
        };
        let header = Header::read(&mut entry).map_err(|problem| malformed(&name, problem))?;
        take(name, &header, &mut entry)?;
    }
    Ok(())
}

/// Every vector of real numbers, in the order of the archive.
pub(crate) fn list(path: &Path) -> Result<Vec<ColumnInfo>, RecordError> {
    let mut columns = Vec::new();
    each_array(path, |name, header, _| {
        if let (Some(_), Ok(rows)) = (number(&header.descr), vector_length(&name, &header.shape)) {
            columns.push(ColumnInfo { name, rows });
        }
        Ok(())
    })?;
    Ok(columns)
}

/// Every vector of real numbers, the single numbers, which are arrays of one element, and what else there is.
pub(crate) fn contents(path: &Path) -> Result<Contents, RecordError> {
    let mut contents = Contents::default();
    each_array(path, |name, header, mut entry| {
        let shape = header
            .shape
            .iter()
            .map(u64::to_string)
            .collect::<Vec<_>>()
            .join(" x ");
        let Some(number) = number(&header.descr) else {
            contents.passed_over.push(PassedOver {
                what: match header.descr.get(1..) {
                    Some("c8" | "c16") => format!("{shape} complex numbers"),
                    _ => format!("{shape} values that are no real numbers"),
                },
                name,
                remedy: String::new(),
            });
            return Ok(());
        };
        match vector_length(&name, &header.shape) {
            // A name in levels, as a program writes a tree: `run1/u`.
            Ok(rows) => {
                let path = as_path(&name);
                contents.columns.push(Column {
                    source: (path != name).then(|| name.clone()),
                    ..Column::plain(ColumnInfo { name: path, rows })
                });
            }
            // A number by itself.
            Err(_) if header.shape.is_empty() => {}
            Err(_) => contents.passed_over.push(PassedOver {
                what: format!("an array of {shape} numbers"),
                remedy: format!(
                    "save each signal as a vector, in Python with the arrays of the file as d: numpy.savez(file, **d, {}1=d[\"{name}\"]{}, ...)",
                    name.replace(|c: char| !c.is_alphanumeric(), "_"),
                    // The longer index counts the samples.
                    match header.shape[..] {
                        [channels, samples] if channels < samples => "[0]",
                        _ => "[:, 0]",
                    }
                ),
                name: name.clone(),
            }),
        }
        if header.shape.iter().all(|n| *n == 1) && contents.scalars.len() < MOST_SCALARS {
            let value = number
                .column(&mut entry, 1)
                .map_err(|e| malformed(&name, &e.to_string()))?;
            let value = value.first().copied().filter(|v| v.is_finite());
            let name = as_path(&name);
            contents.scalars.extend(value.map(|value| Scalar { name, value }));
        }
        Ok(())
    })?;
    Ok(contents)
}

/// The levels of a name as those of other files, `run1/u` as `run1.u`; the part of a response, `y/u re`, has words and no levels.
fn as_path(name: &str) -> String {
    match name.contains(' ') {
        true => name.to_owned(),
        false => name.replace('/', "."),
    }
}

/// An array of numbers, read from its front.
struct Array<'a> {
    name: &'a str,
    entry: zip::read::ZipFile<'a>,
    number: Number,
    length: u64,
    /// Values read so far.
    read: u64,
}

impl<'a> Array<'a> {
    fn open<R: Read + std::io::Seek>(
        archive: &'a mut zip::ZipArchive<R>,
        name: &'a str,
    ) -> Result<Self, RecordError> {
        let file = file_name_from_array_name(name);
        if matches!(archive.by_name(&file), Err(zip::result::ZipError::FileNotFound)) {
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
        Ok(Self {
            name,
            entry,
            number,
            length,
            read: 0,
        })
    }

    /// The next values, as many as are wanted and left.
    fn next(&mut self, wanted: u64) -> Result<Vec<f64>, RecordError> {
        let failed = |e: std::io::Error| malformed(self.name, &e.to_string());
        let count = wanted.min(self.length - self.read);
        let part = self.number.column(&mut self.entry, count).map_err(failed)?;
        self.read += part.len() as u64;
        let complete = part.len() as u64 == count;
        // Reading on to the end lets the archive compare its checksum.
        let more = match complete && self.read == self.length {
            true => self.entry.read(&mut [0]).map_err(failed)?,
            false => 0,
        };
        if !complete || more != 0 {
            let found = if more == 0 { "fewer" } else { "more" };
            let problem = format!(
                "the header claims {} values, the archive has {found}",
                self.length
            );
            return Err(malformed(self.name, &problem));
        }
        Ok(part)
    }
}

/// Arrays of `<f8`, stored, with a fixed date: the same columns give the same bytes.
pub(crate) fn write(file: File, names: &[&str], columns: &[&[f64]]) -> Result<File, RecordError> {
    let mut npz = NpzWriter::new(BufWriter::new(Quiet::new(file)));
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
        .map(Quiet::into_inner)
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
