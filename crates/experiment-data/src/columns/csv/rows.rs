//! Rows of numbers. Plain rows are parsed where they lie, only as far as the wanted columns need it; whatever is not
//! plain (quotation marks, odd numbers, errors) goes through `csv-core`, which splits by the rules.

use super::blocks::Blocks;
use super::malformed;
use crate::RecordError;
use csv_core::ReadRecordResult;
use memchr::{memchr, memchr3, memchr3_iter};
use std::path::Path;

/// A CSV file behind its header.
pub(super) struct Table {
    header: Vec<String>,
    blocks: Blocks,
    splitter: Splitter,
}

impl Table {
    pub(super) fn open(path: &Path) -> Result<Self, RecordError> {
        let mut table = Self {
            header: Vec::new(),
            blocks: Blocks::open(path)?,
            splitter: Splitter {
                core: csv_core::Reader::new(),
                text: Vec::new(),
                ends: Vec::new(),
                fields: 0,
            },
        };
        table.skip_blank_lines()?;
        if table.blocks.lines().is_empty() {
            return Err(malformed(
                1,
                "the file is empty; the first line must name the columns",
            ));
        }
        let used = table.split_here()?;
        let fields = table.splitter.fields();
        table.header = fields
            .map(|field| String::from_utf8_lossy(field).trim().to_owned())
            .collect();
        separators(&table.header)?;
        table.blocks.line += breaks(table.blocks.lines(), used);
        table.blocks.advance(used);
        Ok(table)
    }

    pub(super) fn header(&self) -> &[String] {
        &self.header
    }

    /// The places whose field in the next row is a number. The row is not used up.
    pub(super) fn numeric_in_first_row(&mut self) -> Result<Vec<usize>, RecordError> {
        self.skip_blank_lines()?;
        if self.blocks.lines().is_empty() {
            return Ok(Vec::new());
        }
        self.split_here()?;
        let fields = self.splitter.fields().take(self.header.len()).enumerate();
        Ok(fields
            .filter(|(_, field)| number(field).is_some())
            .map(|(place, _)| place)
            .collect())
    }

    /// Calls back with the line and the values of the wanted places (ascending) of every row that is left.
    pub(super) fn each_row(
        &mut self,
        wanted: &[usize],
        mut sink: impl FnMut(u64, &[f64]),
    ) -> Result<(), RecordError> {
        let mut values = Vec::with_capacity(wanted.len());
        loop {
            let lines = self.blocks.lines();
            let mut line = self.blocks.line;
            let (mut at, mut quote) = (0, 0);
            loop {
                (at, line) = blank_lines(lines, at, line);
                if at == lines.len() {
                    break;
                }
                if quote <= at {
                    quote = memchr(b'"', &lines[at..]).map_or(lines.len(), |i| at + i);
                }
                values.clear();
                match plain_row(&lines[at..], wanted, self.header.len(), &mut values) {
                    Some(length) if at + length <= quote => {
                        sink(line, &values);
                        at += length;
                    }
                    _ => {
                        let Some(length) = self.splitter.split(&lines[at..]) else {
                            break;
                        };
                        values.clear();
                        self.splitter.numbers(line, &self.header, wanted, &mut values)?;
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

/// A row without quotation marks: pushes the values and gives the length up to its end, which is not part of it. None
/// if anything is not as it should be; then [`Splitter::numbers`] says what.
fn plain_row(row: &[u8], wanted: &[usize], fields: usize, values: &mut Vec<f64>) -> Option<usize> {
    let (mut at, mut field) = (0, 0);
    for (k, &place) in wanted.iter().enumerate() {
        while field < place {
            at += memchr3(b',', b'\n', b'\r', &row[at..])?;
            if row[at] != b',' {
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
        match row.get(at)? {
            b',' => at += 1,
            b'\n' | b'\r' if k + 1 == wanted.len() && place + 1 == fields => return Some(at),
            _ => return None,
        }
        field += 1;
    }
    for end in memchr3_iter(b',', b'\n', b'\r', &row[at..]) {
        if row[at + end] != b',' {
            return (field + 1 == fields).then_some(at + end);
        }
        field += 1;
    }
    None
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

/// The number of a field; spaces around it do not matter.
fn number(field: &[u8]) -> Option<f64> {
    std::str::from_utf8(field.trim_ascii()).ok()?.parse().ok()
}

fn unclosed_quote(line: u64) -> RecordError {
    malformed(line, "a quotation mark is never closed")
}

/// One field that holds a foreign separator is a header that nobody split.
fn separators(header: &[String]) -> Result<(), RecordError> {
    let found = match header {
        [one] if one.contains('\t') => "tabs",
        // Semicolons between fields and commas inside them, or the other way round.
        many if many.iter().any(|f| f.contains(';')) => "semicolons",
        _ => return Ok(()),
    };
    Err(RecordError::CsvSeparator { found })
}

/// Splits any row into fields.
struct Splitter {
    core: csv_core::Reader,
    text: Vec<u8>,
    ends: Vec<usize>,
    fields: usize,
}

impl Splitter {
    /// The length of the first row, its end included; none if it does not end here.
    fn split(&mut self, input: &[u8]) -> Option<usize> {
        self.core.reset();
        let (mut used, mut written) = (0, 0);
        self.fields = 0;
        loop {
            let (result, i, o, e) = self.core.read_record(
                &input[used..],
                &mut self.text[written..],
                &mut self.ends[self.fields..],
            );
            used += i;
            written += o;
            self.fields += e;
            match result {
                ReadRecordResult::Record => return Some(used),
                ReadRecordResult::OutputFull => self.text.resize(2 * self.text.len() + 64, 0),
                ReadRecordResult::OutputEndsFull => self.ends.resize(2 * self.ends.len() + 8, 0),
                ReadRecordResult::InputEmpty | ReadRecordResult::End => return None,
            }
        }
    }

    fn fields(&self) -> impl Iterator<Item = &[u8]> {
        (0..self.fields).map(|k| self.field(k))
    }

    fn field(&self, k: usize) -> &[u8] {
        let start = if k == 0 { 0 } else { self.ends[k - 1] };
        &self.text[start..self.ends[k]]
    }

    fn numbers(
        &self,
        line: u64,
        header: &[String],
        wanted: &[usize],
        values: &mut Vec<f64>,
    ) -> Result<(), RecordError> {
        if self.fields != header.len() {
            return Err(RecordError::CsvRagged {
                line,
                expected: header.len() as u64,
                found: self.fields as u64,
            });
        }
        for &place in wanted {
            let field = self.field(place);
            values.push(number(field).ok_or_else(|| RecordError::CsvNumber {
                line,
                column: header[place].clone(),
                text: String::from_utf8_lossy(field).chars().take(40).collect(),
            })?);
        }
        Ok(())
    }
}
