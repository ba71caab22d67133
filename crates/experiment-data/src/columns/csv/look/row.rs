//! What the fields of a line hold.

use super::super::cell::number;
use crate::text::Decimal;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Cell {
    Number,
    Empty,
    Words,
}

impl Cell {
    pub(super) fn of(field: &[u8], decimal: Decimal) -> Self {
        if field.trim_ascii().is_empty() {
            Self::Empty
        } else if number(field, decimal).is_some() {
            Self::Number
        } else {
            Self::Words
        }
    }
}

pub(super) struct Row {
    pub(super) line: u64,
    pub(super) cells: Vec<Cell>,
}

impl Row {
    /// Two numbers or more, and nothing else.
    pub(super) fn looks_like_data(&self) -> bool {
        let numbers = self.cells.iter().filter(|c| **c == Cell::Number).count();
        numbers > 1 && !self.cells.contains(&Cell::Words)
    }
}

/// The number of fields that most rows with numbers have; the larger one where two are as frequent.
pub(super) fn common_width<'a>(rows: impl Iterator<Item = &'a Row>) -> Option<usize> {
    let mut widths: Vec<usize> = rows
        .filter(|r| r.cells.contains(&Cell::Number))
        .map(|r| r.cells.len())
        .collect();
    widths.sort_unstable();
    widths
        .chunk_by(|a, b| a == b)
        .map(|group| (group.len(), group[0]))
        .max()
        .map(|(_, width)| width)
}

/// Columns that hold numbers, but for a hole here and there.
pub(super) fn solid_columns<'a>(rows: impl Iterator<Item = &'a Row>, width: usize) -> Vec<usize> {
    let (mut count, mut numbers, mut words) = (0usize, vec![0usize; width], vec![0usize; width]);
    for row in rows.filter(|r| r.cells.len() == width && r.cells.contains(&Cell::Number)) {
        count += 1;
        for (k, cell) in row.cells.iter().enumerate() {
            numbers[k] += usize::from(*cell == Cell::Number);
            words[k] += usize::from(*cell == Cell::Words);
        }
    }
    (0..width)
        .filter(|&k| 10 * numbers[k] >= 9 * count && 20 * words[k] <= count)
        .collect()
}
