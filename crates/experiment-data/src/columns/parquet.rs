//! Parquet: flat columns of numbers, packed with snappy or not at all, read and written without Arrow.
//!
//! A bundle needs no other codec: snappy is what most programs write unless told otherwise, and the codecs that pack
//! tighter are C code.

mod claims;
mod kind;
mod writer;

use self::kind::Kind;
use super::number::half;
use crate::RecordError;
use crate::contents::{ColumnInfo, missing};
use crate::memory::Allowance;
use ::parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use ::parquet::data_type::DataType;
use ::parquet::errors::ParquetError;
use ::parquet::file::reader::{FileReader, SerializedFileReader};
use std::collections::HashMap;
use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

pub(crate) use writer::write;

pub(crate) fn read(path: &Path, names: &[&str]) -> Result<Vec<Vec<f64>>, RecordError> {
    guarded(|| {
        let table = Table::open(path)?;
        let mut allowance = Allowance::new(table.bytes);
        for name in names {
            allowance.take(name, table.rows()?)?;
        }
        names.iter().map(|name| table.column(name)).collect()
    })
}

/// Every column of real numbers, in the order of the file.
pub(crate) fn list(path: &Path) -> Result<Vec<ColumnInfo>, RecordError> {
    guarded(|| {
        let table = Table::open(path)?;
        let rows = table.rows()?;
        let numbers = table.names.into_iter().zip(table.kinds);
        Ok(numbers
            .filter(|(_, kind)| kind.is_ok())
            .map(|(name, _)| ColumnInfo { name, rows })
            .collect())
    })
}

/// The crate `parquet` asserts some of its own invariants, which damaged files can break; a panic in it is an error of
/// the file here, because nothing of ours is half changed when it happens.
fn guarded<T>(run: impl FnOnce() -> Result<T, RecordError>) -> Result<T, RecordError> {
    catch_unwind(AssertUnwindSafe(run))
        .unwrap_or_else(|_| Err(malformed("", "its pages contradict its schema")))
}

fn malformed(variable: &str, problem: &str) -> RecordError {
    RecordError::Malformed {
        format: "Parquet",
        variable: variable.to_owned(),
        problem: problem.to_owned(),
    }
}

struct Table {
    file: File,
    bytes: u64,
    reader: SerializedFileReader<File>,
    /// Of each leaf of the schema: its name, dotted inside groups, and how to read it, or what it is instead.
    names: Vec<String>,
    /// Where a name stands; none if more than one column has it.
    places: HashMap<String, Option<usize>>,
    kinds: Vec<Result<Kind, &'static str>>,
    /// The definition level of a row that has a value.
    levels: Vec<i16>,
}

impl Table {
    fn open(path: &Path) -> Result<Self, RecordError> {
        let file = File::open(path).map_err(RecordError::io("open"))?;
        let bytes = file.metadata().map_err(RecordError::io("read"))?.len();
        let again = file.try_clone().map_err(RecordError::io("open"))?;
        let reader = SerializedFileReader::new(again).map_err(|e| malformed("", &text(&e)))?;
        let leaves = reader.metadata().file_metadata().schema_descr().columns();
        let names: Vec<String> = leaves.iter().map(|leaf| leaf.path().string()).collect();
        let mut places = HashMap::new();
        for (place, name) in names.iter().enumerate() {
            let found = places.entry(name.clone());
            found.and_modify(|p| *p = None).or_insert(Some(place));
        }
        Ok(Self {
            file,
            bytes,
            names,
            places,
            levels: leaves.iter().map(|leaf| leaf.max_def_level()).collect(),
            kinds: leaves.iter().map(|leaf| Kind::of(leaf)).collect(),
            reader,
        })
    }

    /// Rows that the footer claims, checked against the size of the file.
    fn rows(&self) -> Result<u64, RecordError> {
        let metadata = self.reader.metadata();
        let mut rows = 0u64;
        for group in metadata.row_groups() {
            let claimed = u64::try_from(group.num_rows()).unwrap_or(u64::MAX);
            rows = rows.saturating_add(claimed);
        }
        claims::check_rows(rows, self.bytes).map_err(|problem| malformed("", &problem))?;
        Ok(rows)
    }

    fn column(&self, name: &str) -> Result<Vec<f64>, RecordError> {
        let place = match self.places.get(name) {
            None => return Err(missing(name, &self.names)),
            Some(None) => return Err(malformed(name, "the file has more than one column of this name")),
            Some(Some(place)) => *place,
        };
        let kind = self.kinds[place].map_err(|found| RecordError::NotNumeric {
            column: name.to_owned(),
            found: found.to_owned(),
        })?;
        let rows = self.rows()?;
        let damaged = |e: &ParquetError| malformed(name, &text(e));
        let mut column = Column {
            full_level: self.levels[place],
            ..Column::default()
        };
        for k in 0..self.reader.num_row_groups() {
            let group = self.reader.get_row_group(k).map_err(|e| damaged(&e))?;
            let chunk = group.metadata().column(place);
            let ratio = claims::ratio(chunk).map_err(|codec| RecordError::UnsupportedFormat {
                found: format!("`{name}` packed with {codec}"),
                supported: "Parquet with snappy or without compression",
            })?;
            claims::check_chunk(&self.file, self.bytes, chunk, ratio, rows)
                .map_err(|problem| malformed(name, &problem))?;
            let rows = u64::try_from(group.metadata().num_rows()).unwrap_or(0);
            let pages = group.get_column_reader(place).map_err(|e| damaged(&e))?;
            column.extend(pages, kind, rows).map_err(|e| damaged(&e))?;
        }
        if column.nulls > 0 {
            return Err(RecordError::Null {
                column: name.to_owned(),
                rows: column.null_rows,
                count: column.nulls,
            });
        }
        if column.values.len() as u64 != rows {
            let problem = format!(
                "its footer claims {rows} rows, the column has {}",
                column.values.len()
            );
            return Err(malformed(name, &problem));
        }
        Ok(column.values)
    }
}

/// What goes wrong inside the crate, without its own name of the kind of error.
fn text(e: &ParquetError) -> String {
    let text = e.to_string();
    match text.split_once(": ") {
        Some((_, rest)) => rest.to_owned(),
        None => text,
    }
}

#[derive(Default)]
struct Column {
    values: Vec<f64>,
    rows: usize,
    nulls: usize,
    /// The first rows without a value, from 1.
    null_rows: Vec<usize>,
    /// Definition level of a row that has a value.
    full_level: i16,
}

impl Column {
    fn extend(&mut self, pages: ColumnReader, kind: Kind, rows: u64) -> Result<(), ParquetError> {
        match pages {
            ColumnReader::BoolColumnReader(r) => self.take(r, rows, |v| f64::from(u8::from(*v))),
            ColumnReader::Int32ColumnReader(r) => self.take(r, rows, |v| kind.integer(i64::from(*v))),
            ColumnReader::Int64ColumnReader(r) => self.take(r, rows, |v| kind.integer(*v)),
            ColumnReader::FloatColumnReader(r) => self.take(r, rows, |v| f64::from(*v)),
            ColumnReader::DoubleColumnReader(r) => self.take(r, rows, |v| *v),
            ColumnReader::FixedLenByteArrayColumnReader(r) => self.take(r, rows, |v| match v.data() {
                [a, b] => half(u16::from_le_bytes([*a, *b])),
                _ => f64::NAN,
            }),
            _ => Err(ParquetError::General(
                "pages of another type than the schema".to_owned(),
            )),
        }
    }

    /// Reads in batches, so that a false number of rows costs nothing.
    fn take<T: DataType>(
        &mut self,
        mut pages: ColumnReaderImpl<T>,
        rows: u64,
        value: impl Fn(&T::T) -> f64,
    ) -> Result<(), ParquetError> {
        const BATCH: u64 = 1 << 15;
        let (mut batch, mut levels) = (Vec::new(), Vec::new());
        let mut left = rows;
        while left > 0 {
            batch.clear();
            levels.clear();
            let (records, values, _) =
                pages.read_records(left.min(BATCH) as usize, Some(&mut levels), None, &mut batch)?;
            if records == 0 {
                break;
            }
            self.values.extend(batch.iter().map(&value));
            if values < records {
                self.note_nulls(&levels);
            }
            self.rows += records;
            left -= records as u64;
        }
        Ok(())
    }

    fn note_nulls(&mut self, levels: &[i16]) {
        const SHOWN: usize = 10;
        for (k, _) in levels
            .iter()
            .enumerate()
            .filter(|(_, level)| **level < self.full_level)
        {
            self.nulls += 1;
            if self.null_rows.len() < SHOWN {
                self.null_rows.push(self.rows + k + 1);
            }
        }
    }
}
