//! How much memory the records of a bundle take together, before they are read.

use crate::memory::Allowance;
use crate::{Bundle, DataError, RecordError, RecordFormat, RecordPlace, list_columns};
use std::collections::HashSet;

/// Files up to this size are not looked into: packed as tightly as possible they become some tens of megabytes.
const SMALL: u64 = 1 << 12;

/// Bytes of a number in memory.
const NUMBER: u64 = 8;

impl Bundle {
    /// Bytes that the columns of a record take in memory, as far as its file tells without being read: what the headers of a
    /// packed file claim, the size of a text.
    ///
    /// # Errors
    /// As [`Bundle::load`], for what can be told so far.
    pub fn memory(&self, index: usize) -> Result<u64, DataError> {
        let (_, rows, columns) = self.claim(index)?;
        Ok(rows.saturating_mul(columns.len() as u64).saturating_mul(NUMBER))
    }

    /// Refuses records that do not fit into memory together: those that stay there until all are read.
    ///
    /// # Errors
    /// [`RecordError::Unpacks`], [`RecordError::Memory`] at the first record that is too much; as [`Bundle::memory`].
    pub fn check_memory(&self, indices: &[usize]) -> Result<(), DataError> {
        let mut allowance = Allowance::new(0);
        for &index in indices {
            let (bytes, rows, columns) = self.claim(index)?;
            allowance.grow(bytes);
            for column in columns {
                allowance
                    .take(column, rows)
                    .map_err(|problem| self.fault(index, problem))?;
            }
        }
        Ok(())
    }

    /// The size of a record's file, the rows that it claims, and the columns that are wanted of it.
    fn claim(&self, index: usize) -> Result<(u64, u64, Vec<&str>), DataError> {
        let path = self.record_path(index)?;
        let failed = |problem| self.fault(index, problem);
        let metadata = path.metadata().map_err(RecordError::io("read")).map_err(failed)?;
        let bytes = metadata.len();
        if self.description().records[index].is_response() {
            // A response is small, and its file is asked as it is read.
            return Ok((bytes, 0, Vec::new()));
        }
        let columns = self.column_names(index)?;
        let packs = RecordFormat::of(&path.to_string_lossy()).is_ok_and(|f| f != RecordFormat::Csv);
        let rows = if bytes <= SMALL || !packs {
            bytes / NUMBER / columns.len().max(1) as u64
        } else {
            let listed = list_columns(&path).map_err(failed)?;
            let wanted: HashSet<&str> = columns.iter().copied().collect();
            let rows = listed.iter().filter(|c| wanted.contains(c.name.as_str()));
            rows.map(|c| c.rows).max().unwrap_or(0)
        };
        Ok((bytes, rows, columns))
    }

    fn fault(&self, index: usize, problem: RecordError) -> DataError {
        let file = self
            .description()
            .records
            .get(index)
            .map_or("", |e| e.file.as_str());
        DataError::Record {
            place: Box::new(RecordPlace {
                index,
                file: self.folder().join(file),
            }),
            problem: Box::new(problem),
        }
    }
}
