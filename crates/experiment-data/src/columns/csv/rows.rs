//! Rows of numbers. Plain rows are parsed where they lie, only as far as the wanted columns need it; whatever is not
//! plain (quotation marks, blanks between fields, decimal commas, odd numbers, errors) is split by the rules.

use super::blocks::Blocks;
use super::cell::number;
use super::look::Layout;
use super::malformed;
use super::split::{Splitter, words};
use crate::RecordError;
use crate::text::{Decimal, Separator};
use memchr::{memchr, memchr2_iter, memchr3, memchr3_iter};
use std::path::Path;

/// A text file behind its names.
pub(super) struct Table {
    header: Vec<String>,
    blocks: Blocks,
    splitter: Splitter,
    rules: Rules,
}

/// How rows are read.
struct Rules {
    /// Of plain rows: none if there are no such.
    delimiter: Option<u8>,
    /// Found by the first fraction if it is not known.
    decimal: Option<Decimal>,
    last_optional: bool,
    /// Lines that are no data, ascending.
    skip: Vec<u64>,
}

/// What is done with a cell that is no number.
pub(super) type OnWords<'a> = &'a mut dyn FnMut(u64, usize, &[u8]) -> Result<f64, RecordError>;

impl Table {
    pub(super) fn open(path: &Path, layout: Layout) -> Result<Self, RecordError> {
        let separator = layout.separator;
        let delimiter = match (separator, layout.decimal) {
            (Separator::Blanks, _) | (_, None | Some(Decimal::Comma)) => None,
            (other, Some(Decimal::Point)) => Some(other.character() as u8),
        };
        let mut table = Self {
            header: layout.names,
            blocks: Blocks::open(path)?,
            splitter: Splitter::new(separator),
            rules: Rules {
                delimiter,
                decimal: layout.decimal,
                last_optional: layout.last_optional,
                skip: layout.skip,
            },
        };
        if !layout.plain {
            table.skip_to(layout.first)?;
            return Ok(table);
        }
        table.skip_blank_lines()?;
        let used = table.split_here()?;
        table.header = table.splitter.fields().map(words).collect();
        table.blocks.line += breaks(table.blocks.lines(), used);
        table.blocks.advance(used);
        Ok(table)
    }

    pub(super) fn header(&self) -> &[String] {
        &self.header
    }

    /// The fields of the next row, which is not used up; none at the end.
    pub(super) fn peek(&mut self) -> Result<Option<&Splitter>, RecordError> {
        self.skip_blank_lines()?;
        if self.blocks.lines().is_empty() {
            return Ok(None);
        }
        self.split_here()?;
        Ok(Some(&self.splitter))
    }

    /// Calls back with the line and the values of the wanted places (ascending) of every row that is left.
    pub(super) fn each_row(
        &mut self,
        wanted: &[usize],
        on_words: OnWords<'_>,
        mut sink: impl FnMut(u64, &[f64]),
    ) -> Result<(), RecordError> {
        let mut values = Vec::with_capacity(wanted.len());
        let mut skip = std::mem::take(&mut self.rules.skip).into_iter().peekable();
        loop {
            let lines = self.blocks.lines();
            let mut line = self.blocks.line;
            let (mut at, mut quote) = (0, 0);
            loop {
                (at, line) = blank_lines(lines, at, line);
                if at == lines.len() {
                    break;
                }
                while skip.next_if(|s| *s < line).is_some() {}
                if skip.peek() == Some(&line) {
                    let length = line_length(&lines[at..]);
                    line += breaks(&lines[at..], length);
                    at += length;
                    continue;
                }
                if quote <= at {
                    quote = memchr(b'"', &lines[at..]).map_or(lines.len(), |i| at + i);
                }
                values.clear();
                let plain = self
                    .rules
                    .delimiter
                    .and_then(|d| plain_row(&lines[at..], d, wanted, self.header.len(), &mut values));
                match plain {
                    Some(length) if at + length <= quote => {
                        sink(line, &values);
                        at += length;
                    }
                    _ => {
                        let Some(length) = self.splitter.split(&lines[at..]) else {
                            break;
                        };
                        values.clear();
                        self.rules.numbers(
                            &self.splitter,
                            line,
                            self.header.len(),
                            wanted,
                            on_words,
                            &mut values,
                        )?;
                        sink(line, &values);
                        line += breaks(&lines[at..], length);
                        at += length;
                    }
                }
            }
            let unclosed = self.blocks.ended() && at < lines.len();
            self.blocks.line = line;
            self.blocks.advance(at);
            if unclosed {
                return Err(unclosed_quote(line));
            }
            if self.blocks.ended() {
                return Ok(());
            }
            self.blocks.more()?;
        }
    }

    /// Goes to a line.
    fn skip_to(&mut self, first: u64) -> Result<(), RecordError> {
        loop {
            let lines = self.blocks.lines();
            let (mut at, mut line) = (0, self.blocks.line);
            while line < first && at < lines.len() {
                let length = line_length(&lines[at..]);
                line += 1;
                at += length;
            }
            self.blocks.line = line;
            self.blocks.advance(at);
            if line >= first || self.blocks.ended() {
                return Ok(());
            }
            self.blocks.more()?;
        }
    }

    /// Goes to the next line that is not blank, or to the end.
    fn skip_blank_lines(&mut self) -> Result<(), RecordError> {
        loop {
            let (at, line) = blank_lines(self.blocks.lines(), 0, self.blocks.line);
            self.blocks.line = line;
            self.blocks.advance(at);
            if !self.blocks.lines().is_empty() || self.blocks.ended() {
                return Ok(());
            }
            self.blocks.more()?;
        }
    }

    /// Splits the row at hand; its length.
    fn split_here(&mut self) -> Result<usize, RecordError> {
        loop {
            if let Some(used) = self.splitter.split(self.blocks.lines()) {
                return Ok(used);
            }
            if self.blocks.ended() {
                return Err(unclosed_quote(self.blocks.line));
            }
            self.blocks.more()?;
        }
    }
}

/// The cell that is no number, as an error.
pub(super) fn refuse_words<'a>(
    header: &'a [String],
    decimal: Option<Decimal>,
) -> impl FnMut(u64, usize, &[u8]) -> Result<f64, RecordError> + use<'a> {
    move |line, place, field| {
        Err(RecordError::CsvNumber {
            line,
            column: header[place].clone(),
            text: String::from_utf8_lossy(field).chars().take(40).collect(),
            // Where the first lines did not show it, a point is wrong only beside commas.
            comma: decimal == Some(Decimal::Comma) || (decimal.is_none() && field.contains(&b'.')),
        })
    }
}

impl Rules {
    fn numbers(
        &mut self,
        row: &Splitter,
        line: u64,
        expected: usize,
        wanted: &[usize],
        on_words: OnWords<'_>,
        values: &mut Vec<f64>,
    ) -> Result<(), RecordError> {
        let short = self.last_optional && row.len() + 1 == expected;
        if row.len() != expected && !short {
            return Err(RecordError::CsvRagged {
                line,
                expected: expected as u64,
                found: row.len() as u64,
            });
        }
        for &place in wanted {
            let field = if place < row.len() { row.field(place) } else { b"" };
            if self.decimal.is_none() {
                let shown = field.iter().find(|b| matches!(b, b',' | b'.'));
                self.decimal = shown.map(|b| match b {
                    b',' => Decimal::Comma,
                    _ => Decimal::Point,
                });
            }
            let value = number(field, self.decimal.unwrap_or(Decimal::Point));
            values.push(match value {
                Some(value) => value,
                None => on_words(line, place, field)?,
            });
        }
        Ok(())
    }
}

/// A row without quotation marks: pushes the values and gives the length up to its end, which is not part of it. None
/// if anything is not as it should be; then [`Rules::numbers`] says what.
fn plain_row(
    row: &[u8],
    delimiter: u8,
    wanted: &[usize],
    fields: usize,
    values: &mut Vec<f64>,
) -> Option<usize> {
    // A tab between fields is no space around one.
    let spaces = |text: &[u8]| match delimiter {
        b'\t' => text.iter().take_while(|b| **b == b' ').count(),
        _ => spaces(text),
    };
    let (mut at, mut field) = (0, 0);
    for (k, &place) in wanted.iter().enumerate() {
        while field < place {
            at += memchr3(delimiter, b'\n', b'\r', &row[at..])?;
            if row[at] != delimiter {
                return None;
            }
            at += 1;
            field += 1;
        }
        at += spaces(&row[at..]);
        let (value, used) = fast_float2::parse_partial(&row[at..]).ok()?;
        values.push(value);
        at += used;
        at += spaces(&row[at..]);
        match *row.get(at)? {
            b if b == delimiter => at += 1,
            b'\n' | b'\r' if k + 1 == wanted.len() && place + 1 == fields => return Some(at),
            _ => return None,
        }
        field += 1;
    }
    for end in memchr3_iter(delimiter, b'\n', b'\r', &row[at..]) {
        if row[at + end] != delimiter {
            return (field + 1 == fields).then_some(at + end);
        }
        field += 1;
    }
    None
}

/// The length of a line with its end.
fn line_length(text: &[u8]) -> usize {
    memchr2_iter(b'\n', b'\r', text).next().map_or(text.len(), |end| {
        end + 1 + usize::from(text[end] == b'\r' && text.get(end + 1) == Some(&b'\n'))
    })
}

fn spaces(text: &[u8]) -> usize {
    text.iter().take_while(|b| matches!(b, b' ' | b'\t')).count()
}

/// Passes over lines with nothing but spaces: the new place and its line.
fn blank_lines(lines: &[u8], mut at: usize, mut line: u64) -> (usize, u64) {
    loop {
        let next = at + spaces(&lines[at..]);
        match lines.get(next) {
            Some(b'\n' | b'\r') => {
                line += breaks(&lines[next..], 1);
                at = next + 1;
            }
            None => return (next, line),
            Some(_) => return (at, line),
        }
    }
}

/// Line ends in the first bytes of a text; a carriage return before a line feed is the same end.
fn breaks(text: &[u8], length: usize) -> u64 {
    let ends = (0..length).filter(|&i| match text[i] {
        b'\n' => true,
        b'\r' => text.get(i + 1) != Some(&b'\n'),
        _ => false,
    });
    ends.count() as u64
}

fn unclosed_quote(line: u64) -> RecordError {
    malformed(line, "a quotation mark is never closed")
}
