//! How a text table is laid out, found by looking at its first lines.

mod above;
mod row;
mod thousands;

use super::cell::number;
use super::split::{Splitter, words};
use crate::RecordError;
use crate::text::{Decimal, Separator, Text};
use above::Above;
use row::{Cell, Row, common_width, solid_columns};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Bytes that are looked at, unless the first lines are longer.
const HEAD: usize = if cfg!(test) { 1 << 12 } else { 1 << 17 };
/// No row of a table is longer.
const LONGEST: usize = 1 << 24;
/// Lines that the quick look at a plain table asks for.
const QUICK: usize = 16;

/// Where the rows of a file begin, and how they are read.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Layout {
    pub(super) separator: Separator,
    /// None if no number of the first lines shows it.
    pub(super) decimal: Option<Decimal>,
    /// One a field; empty where the file has no name for it.
    pub(super) names: Vec<String>,
    /// One a field, or none.
    pub(super) units: Vec<String>,
    /// Rows may leave the last field out.
    pub(super) last_optional: bool,
    /// Line of the names; 0 if the file has none.
    pub(super) header: u64,
    pub(super) units_row: Option<u64>,
    /// First line that may be data.
    pub(super) first: u64,
    /// Lines below the names that are no data, ascending.
    pub(super) skip: Vec<u64>,
    /// The fields of the lines above, without the names.
    pub(super) preamble: Vec<Vec<String>>,
    /// Commas, points, and names in the first line: what needs no `[text]`.
    pub(super) plain: bool,
}

impl Layout {
    /// What `[text]` of a description says about it; none for a plain table.
    pub(super) fn text(&self) -> Option<Text> {
        let unnamed = |(k, name): (usize, &String)| match name.as_str() {
            "" => format!("column{}", k + 1),
            _ => name.clone(),
        };
        (!self.plain).then(|| Text {
            separator: Some(self.separator),
            decimal: self.decimal,
            header: Some(self.header),
            names: match self.header {
                0 => self.names.iter().enumerate().map(unnamed).collect(),
                _ => Vec::new(),
            },
            units_row: self.units_row,
            skip: self.skip.clone(),
        })
    }
}

/// Looks at a file; what `given` says is taken as said.
pub(super) fn look(path: &Path, given: Option<&Text>) -> Result<Layout, RecordError> {
    let default = Text::default();
    let given = given.unwrap_or(&default);
    let head = Head::read(path, given)?;
    if head.lines.iter().all(|l| blank(&head.bytes[l.0..l.1])) {
        let problem = "the file is empty; the first line must name the columns";
        return Err(super::malformed(1, problem));
    }
    let nothing_given = *given == default;
    if nothing_given && let Some(layout) = head.plain(QUICK) {
        return Ok(layout);
    }
    match head.best(given) {
        Ok(layout) if given.decimal.is_some() => Ok(layout),
        Ok(layout) => match head.doubt_of_thousands(&layout) {
            Some(problem) => Err(RecordError::TextLayout { problem }),
            None => Ok(layout),
        },
        // The reader of plain tables says what is wrong with one that is almost plain.
        Err(problem) => match head.plain(0) {
            Some(layout) if nothing_given && layout.names.len() > 1 => Ok(layout),
            _ => Err(RecordError::TextLayout { problem }),
        },
    }
}

/// The first lines of a file.
struct Head {
    bytes: Vec<u8>,
    /// Places of the lines in it, without their ends.
    lines: Vec<(usize, usize)>,
}

impl Head {
    fn read(path: &Path, given: &Text) -> Result<Self, RecordError> {
        let needed = [given.header, given.units_row, given.skip.last().copied()];
        let needed = needed.into_iter().flatten().max().unwrap_or(0) as usize + 8;
        let mut file = File::open(path).map_err(RecordError::io("open"))?;
        let (mut bytes, mut room) = (Vec::new(), HEAD);
        loop {
            let before = bytes.len();
            (&mut file)
                .take((room - before) as u64)
                .read_to_end(&mut bytes)
                .map_err(RecordError::io("read"))?;
            let ended = bytes.len() < room;
            let lines = lines(&bytes, ended);
            if ended || lines.len() >= needed || room >= LONGEST {
                return Ok(Self { bytes, lines });
            }
            room *= 2;
        }
    }

    fn line(&self, index: usize) -> &[u8] {
        let (from, to) = self.lines[index];
        &self.bytes[from..to]
    }

    /// Names in the first line and commas; so many rows must fit if there are that many.
    fn plain(&self, rows: usize) -> Option<Layout> {
        let from = self.lines.iter().find(|l| !blank(&self.bytes[l.0..l.1]))?.0;
        let to = self.lines.last()?.1;
        let mut text = self.bytes[from..to].to_vec();
        text.push(b'\n');
        let mut splitter = Splitter::new(Separator::Comma);
        let mut at = splitter.split(&text)?;
        let names: Vec<String> = splitter.fields().map(words).collect();
        let named = |n: &String| !n.is_empty() && number(n.as_bytes(), Decimal::Point).is_none();
        // Numbers with blanks between them are cut at decimal commas.
        let numbers = |n: &String| {
            !n.is_empty()
                && n.split_whitespace()
                    .all(|w| number(w.as_bytes(), Decimal::Point).is_some())
        };
        let foreign = |n: &String| {
            n.contains([';', '\t']) || n.starts_with(['#', '%']) || (n.contains(' ') && numbers(n))
        };
        if !names.iter().any(named) || (rows > 0 && names.iter().any(foreign)) {
            return None;
        }
        let mut solid = vec![true; names.len()];
        let mut seen = 0;
        while seen < rows && at < text.len() {
            let Some(length) = splitter.split(&text[at..]) else {
                if blank(text[at..].trim_ascii()) {
                    break;
                }
                return None;
            };
            at += length;
            if splitter.len() <= 1 && splitter.fields().all(|f| f.trim_ascii().is_empty()) {
                continue;
            }
            if splitter.len() != names.len() {
                return None;
            }
            for (solid, field) in solid.iter_mut().zip(splitter.fields()) {
                *solid &= number(field, Decimal::Point).is_some();
            }
            seen += 1;
        }
        if rows > 0 && (seen == 0 || !solid.contains(&true)) {
            return None;
        }
        Some(Layout {
            separator: Separator::Comma,
            decimal: Some(Decimal::Point),
            names,
            units: Vec::new(),
            last_optional: false,
            header: 1,
            units_row: None,
            first: 2,
            skip: Vec::new(),
            preamble: Vec::new(),
            plain: true,
        })
    }

    /// The layout that makes most of the cells numbers.
    fn best(&self, given: &Text) -> Result<Layout, String> {
        for (key, line) in [("header", given.header), ("units_row", given.units_row)] {
            if let Some(line) = line.filter(|l| *l as usize > self.lines.len()) {
                return Err(format!("{key} = {line}, and the file has no such line"));
            }
        }
        let all = [
            Separator::Semicolon,
            Separator::Tab,
            Separator::Comma,
            Separator::Blanks,
        ];
        let mut found: Vec<(f64, Layout)> = Vec::new();
        let mut problems: Vec<(f64, String)> = Vec::new();
        for separator in all
            .into_iter()
            .filter(|s| given.separator.is_none_or(|g| g == *s))
        {
            let mut own: Vec<(f64, Layout)> = Vec::new();
            for decimal in [Decimal::Point, Decimal::Comma] {
                let said = given.decimal.is_some();
                if given.decimal.is_some_and(|g| g != decimal)
                    || (!said && separator == Separator::Comma && decimal == Decimal::Comma)
                {
                    continue;
                }
                match self.body(separator, decimal, given) {
                    Ok((part, layout)) => own.push((part, layout)),
                    Err((part, problem)) => problems.push((part, problem)),
                }
            }
            if let [(first, a), (second, b)] = own.as_mut_slice()
                && first == second
                && a.names.len() == b.names.len()
            {
                // Whole numbers only: what stands before a fraction, the first fraction tells.
                a.decimal = None;
                own.truncate(1);
            }
            found.extend(own);
        }
        let best = found.iter().map(|f| f.0).fold(0.0, f64::max);
        if let Some((_, layout)) = found.into_iter().find(|f| f.0 == best) {
            return Ok(layout);
        }
        let best = problems.iter().map(|p| p.0).fold(0.0, f64::max);
        let problem = problems.into_iter().find(|p| p.0 == best).map(|p| p.1);
        Err(problem.unwrap_or_else(|| "no table of numbers is in it".to_owned()))
    }

    /// The body of the table for one way to split it, and how many rows of numbers that makes.
    fn body(
        &self,
        separator: Separator,
        decimal: Decimal,
        given: &Text,
    ) -> Result<(f64, Layout), (f64, String)> {
        let nothing = || (0.0, "no table of numbers is in it".to_owned());
        let header = given.header;
        let rows = self.rows(separator, decimal).map_err(|problem| (0.5, problem))?;
        // Lines that `[text]` sets apart.
        let apart = |line: u64| {
            given.skip.contains(&line) || given.units_row == Some(line) || header.is_some_and(|h| line <= h)
        };
        let data = || rows.iter().filter(|r| !apart(r.line));
        let count = data().count();
        // The numbers are below all else.
        let width =
            common_width(data().skip((count / 2).min(count.saturating_sub(3)))).ok_or_else(nothing)?;
        if width < 2 && given.separator.is_none() {
            return Err(nothing());
        }
        let fitting = data()
            .collect::<Vec<_>>()
            .into_iter()
            .rev()
            .take_while(|r| r.cells.len() == width || r.cells.len() == width + 1)
            .take(count.div_ceil(2).max(3));
        let solid = solid_columns(fitting, width);
        let filled = (0..width)
            .filter(|&k| data().any(|r| r.cells.len() == width && r.cells[k] != Cell::Empty))
            .count();
        let part = solid.len() as f64 / filled.max(1) as f64;
        let fits = |r: &Row| {
            let numbers = || solid.iter().filter(|&&k| r.cells[k] == Cell::Number).count();
            (r.cells.len() == width || r.cells.len() == width + 1)
                && solid.iter().all(|&k| r.cells[k] != Cell::Words)
                && 2 * numbers() >= solid.len()
        };
        // Below names whose line is known, everything is data.
        let start = match header {
            Some(line) if line > 0 => 0,
            _ => data().position(fits).ok_or_else(nothing)?,
        };
        let body: Vec<&Row> = data().skip(start).collect();
        let longer = body.iter().filter(|r| r.cells.len() == width + 1).count();
        let strange = body.iter().filter(|r| r.cells.len() != width).count() - longer;
        if solid.is_empty() || part < 0.5 || 10 * strange > body.len() {
            return Err(nothing());
        }
        let first = body[0].line;
        if let Some(row) = data().take(start).find(|r| r.looks_like_data()) {
            let problem = format!(
                "line {} has {} numbers separated by {}, the lines from {first} on have {width}",
                row.line,
                row.cells.len(),
                separator.words()
            );
            return Err((part, problem));
        }
        let above = Above::new(self, &rows, separator, first, width, given);
        let mut layout = above.layout(decimal).map_err(|problem| (part, problem))?;
        // An empty last field that the names do not have, or a name at the end that few rows use.
        if layout.names.len() == width + 1 {
            layout.last_optional = true;
        } else if longer > 0 {
            return Err((
                part,
                format!("{longer} rows have a field more than the {width} of the others"),
            ));
        }
        layout.skip.extend(&given.skip);
        layout.skip.sort_unstable();
        // More rows, and names above them, make a way to split likelier.
        let named = if layout.names.iter().all(String::is_empty) {
            0.9
        } else {
            1.0
        };
        Ok((part * named * body.len() as f64, layout))
    }

    /// The lines that are not blank, split.
    fn rows(&self, separator: Separator, decimal: Decimal) -> Result<Vec<Row>, String> {
        let mut splitter = Splitter::new(separator);
        let mut text = Vec::new();
        let mut rows = Vec::new();
        for index in 0..self.lines.len() {
            let line = self.line(index);
            if blank(line) {
                continue;
            }
            text.clear();
            text.extend_from_slice(line);
            text.push(b'\n');
            if splitter.split(&text).is_none() {
                return Err(format!("line {}: a quotation mark is never closed", index + 1));
            }
            rows.push(Row {
                line: index as u64 + 1,
                cells: splitter.fields().map(|f| Cell::of(f, decimal)).collect(),
            });
        }
        Ok(rows)
    }

    /// The fields of a line.
    fn fields(&self, line: u64, separator: Separator) -> Vec<String> {
        let mut text = self.line(line as usize - 1).to_vec();
        text.push(b'\n');
        let mut splitter = Splitter::new(separator);
        match splitter.split(&text) {
            Some(_) => splitter.fields().map(words).collect(),
            None => vec![words(&text)],
        }
    }
}

fn blank(line: &[u8]) -> bool {
    line.iter().all(|b| matches!(b, b' ' | b'\t' | b'\r'))
}

/// The places of the lines, without their ends and without a byte order mark; the last one only if it is whole.
fn lines(bytes: &[u8], ended: bool) -> Vec<(usize, usize)> {
    let mut all = Vec::new();
    let mut from = if bytes.starts_with(b"\xef\xbb\xbf") { 3 } else { 0 };
    while let Some(length) = memchr::memchr2(b'\n', b'\r', &bytes[from..]) {
        let end = from + length;
        let pair = bytes[end] == b'\r' && bytes.get(end + 1) == Some(&b'\n');
        all.push((from, end));
        from = end + 1 + usize::from(pair);
    }
    if ended && from < bytes.len() {
        all.push((from, bytes.len()));
    }
    all
}
