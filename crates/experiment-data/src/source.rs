//! What of a file belongs to a record: its columns, where the file has them, and its rows.

use crate::columns::{self, Sink};
use crate::{RecordEntry, RecordError, Text};
use std::path::Path;

/// A file as the description has it.
pub(crate) struct Source<'a> {
    pub(crate) path: &'a Path,
    pub(crate) text: Option<&'a Text>,
    pub(crate) entry: &'a RecordEntry,
}

impl Source<'_> {
    /// The columns of these names.
    pub(crate) fn read(&self, names: &[&str]) -> Result<Vec<Vec<f64>>, RecordError> {
        let mut data = columns::read_columns_as(self.path, &self.places(names), self.text)?;
        let Some([first, last]) = self.entry.rows else {
            return Ok(data);
        };
        for (column, name) in data.iter_mut().zip(names) {
            if column.len() < last {
                return Err(self.rows_missing(name, column.len()));
            }
            column.truncate(last);
            column.drain(..first - 1);
        }
        Ok(data)
    }

    /// The same, so many rows at a time.
    pub(crate) fn each_block(&self, names: &[&str], rows: usize, sink: Sink<'_>) -> Result<(), RecordError> {
        let places = self.places(names);
        let Some([first, last]) = self.entry.rows else {
            return columns::each_block(self.path, &places, self.text, rows, sink);
        };
        let mut seen = vec![0; names.len()];
        let mut kept: Vec<Vec<f64>> = vec![Vec::new(); names.len()];
        columns::each_block(self.path, &places, self.text, rows, &mut |block| {
            for ((seen, kept), column) in seen.iter_mut().zip(&mut kept).zip(block) {
                let from = (first - 1).saturating_sub(*seen).min(column.len());
                let to = last.saturating_sub(*seen).min(column.len());
                kept.extend_from_slice(column.get(from..to).unwrap_or_default());
                *seen += column.len();
            }
            while kept.iter().all(|k| k.len() >= rows) && !kept.is_empty() {
                sink(kept.iter_mut().map(|k| k.drain(..rows).collect()).collect());
            }
        })?;
        if let Some(short) = seen.iter().position(|s| *s < last) {
            return Err(self.rows_missing(names[short], seen[short]));
        }
        if kept.iter().any(|k| !k.is_empty()) {
            sink(kept);
        }
        Ok(())
    }

    /// Rows of a message are those of the file; a text file also has line numbers, which differ from them where it has blank
    /// lines or line breaks in quotes.
    pub(crate) fn add_lines(&self, problem: &mut RecordError) {
        let RecordError::NotFinite { rows, lines, .. } = problem else {
            return;
        };
        if let Some([first, _]) = self.entry.rows {
            rows.iter_mut().for_each(|row| *row += first - 1);
        }
        *lines = columns::lines_of_rows(self.path, self.text, rows);
    }

    fn places<'a>(&'a self, names: &[&'a str]) -> Vec<&'a str> {
        names.iter().map(|name| self.entry.source_of(name)).collect()
    }

    fn rows_missing(&self, column: &str, found: usize) -> RecordError {
        RecordError::RowsMissing {
            column: column.to_owned(),
            rows: self.entry.rows.unwrap_or_default(),
            found,
        }
    }
}
