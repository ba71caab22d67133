//! The names, units and notes above the first row of numbers.

use super::{Cell, Head, Layout, Row};
use crate::columns::csv::units::is_unit;
use crate::text::{Decimal, Separator, Text};

/// What stands above the first row of numbers.
pub(super) struct Above<'a> {
    head: &'a Head,
    separator: Separator,
    given: &'a Text,
    width: usize,
    first: u64,
    /// Lines with words that could be names, the lowest first, and their fields.
    texts: Vec<(u64, Vec<String>)>,
    preamble: Vec<Vec<String>>,
    /// The line above the numbers, where it has too few or too many fields for names.
    misfit: Option<(u64, usize)>,
}

impl<'a> Above<'a> {
    pub(super) fn new(
        head: &'a Head,
        rows: &[Row],
        separator: Separator,
        first: u64,
        width: usize,
        given: &'a Text,
    ) -> Self {
        let (mut texts, mut preamble, mut misfit) = (Vec::new(), Vec::new(), None);
        for row in rows.iter().rev().filter(|r| r.line < first) {
            let mut fields = head.fields(row.line, separator);
            let comment = uncomment(&mut fields);
            let few_rows_use_last = |f: &str| f.is_empty() || f.eq_ignore_ascii_case("comment");
            let fits = fields.len() == width
                || (fields.len() == width + 1 && fields.last().is_some_and(|f| few_rows_use_last(f)))
                || (fields.len() + 1 == width && rows.iter().all(|r| ends_empty(r, width)));
            let may_be_names = !comment && fields.len() > 1 && !is_note(&fields);
            if texts.is_empty() && preamble.is_empty() && !fits && may_be_names {
                misfit = Some((row.line, fields.len()));
            }
            if fits && preamble.is_empty() && texts.len() < 3 && row.cells.contains(&Cell::Words) {
                texts.push((row.line, fields));
            } else {
                preamble.push(fields);
            }
        }
        preamble.reverse();
        Self {
            head,
            separator,
            given,
            width,
            first,
            texts,
            preamble,
            misfit,
        }
    }

    pub(super) fn layout(self, decimal: Decimal) -> Result<Layout, String> {
        let mut layout = Layout {
            separator: self.separator,
            decimal: Some(decimal),
            names: Vec::new(),
            units: Vec::new(),
            last_optional: false,
            header: 0,
            units_row: None,
            first: self.first,
            skip: Vec::new(),
            preamble: Vec::new(),
            plain: false,
        };
        match self.given.header {
            Some(0) => {
                layout.names.clone_from(&self.given.names);
                self.given_line(self.given.units_row, &mut layout.units);
            }
            Some(line) => {
                layout.header = line;
                self.given_line(Some(line), &mut layout.names);
                uncomment(&mut layout.names);
                self.given_line(self.given.units_row, &mut layout.units);
            }
            None => self.names_by_looking(&mut layout)?,
        }
        layout.units_row = layout.units_row.or(self.given.units_row);
        self.units_of_preamble(&mut layout);
        let (found, width) = (layout.names.len(), self.width);
        if layout.header == 0 && found == 0 {
            layout.names = vec![String::new(); width];
        } else if found + 1 == width {
            // A separator ends every row.
            layout.names.push(String::new());
        } else if found != width && found != width + 1 {
            return Err(format!(
                "there are {found} names, and rows of {width} fields separated by {}",
                self.separator.words()
            ));
        }
        for unit in &mut layout.units {
            *unit = bare(unit).to_owned();
        }
        if !layout.units.is_empty() {
            layout.units.resize(layout.names.len(), String::new());
        }
        if layout.header == 0 && self.given.header.is_none() {
            layout.skip = (1..self.first).collect();
        }
        // A setting may have as many fields as the table has columns.
        let (header, units) = (layout.header, layout.units_row);
        let others = self.texts.into_iter().rev();
        let others = others.filter(|(line, _)| *line != header && units != Some(*line));
        layout.preamble = self.preamble;
        layout.preamble.extend(others.map(|(_, fields)| fields));
        Ok(layout)
    }

    fn given_line(&self, line: Option<u64>, into: &mut Vec<String>) {
        if let Some(line) = line.filter(|l| *l > 0) {
            *into = self.head.fields(line, self.separator);
        }
    }

    fn names_by_looking(&self, layout: &mut Layout) -> Result<(), String> {
        if let Some((line, fields)) = self.misfit {
            return Err(format!(
                "line {line} has {fields} fields, and the rows from line {} on have {} separated by {}",
                self.first,
                self.width,
                self.separator.words()
            ));
        }
        let all_units = |fields: &[String]| {
            let mut some = fields.iter().filter(|f| !f.is_empty()).peekable();
            some.peek().is_some() && some.all(|f| is_unit(f))
        };
        let mut take = |names: usize, units: Option<usize>| {
            let (line, fields) = &self.texts[names];
            layout.header = *line;
            layout.names.clone_from(fields);
            if let Some(units) = units {
                let (at, fields) = &self.texts[units];
                layout.units.clone_from(fields);
                layout.units_row = (at > line).then_some(*at);
            }
            let between = self.texts[..names].iter().map(|t| t.0);
            layout.skip = between.filter(|l| layout.units_row != Some(*l)).collect();
        };
        let texts: Vec<&[String]> = self.texts.iter().map(|t| t.1.as_slice()).collect();
        match texts.as_slice() {
            [] => {}
            [units, _, ..] if all_units(units) => take(1, Some(0)),
            [_, units, _] if all_units(units) => take(2, Some(1)),
            [_, units, ..] if all_units(units) => take(0, Some(1)),
            // Numbers of channels below their labels, as oscilloscopes have it.
            [channels, labels, ..] if channels.iter().skip(1).all(|f| is_channel(f)) => {
                layout.names = channels[..1].iter().chain(&labels[1..]).cloned().collect();
            }
            _ => take(0, None),
        }
        Ok(())
    }

    /// `Vertical Units,V,V` and its like.
    fn units_of_preamble(&self, layout: &mut Layout) {
        if !layout.units.is_empty() {
            return;
        }
        let mut units = vec![String::new(); layout.names.len()];
        for line in &self.preamble {
            let [key, rest @ ..] = line.as_slice() else {
                continue;
            };
            let key = key.to_lowercase();
            if !key.contains("unit") {
                continue;
            }
            let of_time = key.starts_with(['h', 'x', 't']);
            let places: Vec<&mut String> = if of_time {
                units.iter_mut().take(1).collect()
            } else {
                units.iter_mut().skip(1).collect()
            };
            for (place, unit) in places.into_iter().zip(rest).filter(|(_, u)| is_unit(u)) {
                place.clone_from(unit);
            }
        }
        if units.iter().any(|u| !u.is_empty()) {
            layout.units = units;
        }
    }
}

/// A mark of a comment in front of the names; whether there was one.
fn uncomment(fields: &mut Vec<String>) -> bool {
    let Some(rest) = fields.first().and_then(|f| f.strip_prefix(['#', '%'])) else {
        return false;
    };
    let rest = rest.trim_start_matches(['#', '%']).trim().to_owned();
    if rest.is_empty() && fields.len() > 1 {
        fields.remove(0);
    } else {
        fields[0] = rest;
    }
    true
}

/// Whether a line tells something instead of naming columns: `Operator: Schmidt`, `Gain;2`, `Date;12.03.2026`.
fn is_note(fields: &[String]) -> bool {
    let tells = |f: &String| f.ends_with(':') || f.starts_with(|c: char| c.is_ascii_digit());
    fields.iter().any(tells)
}

fn ends_empty(row: &Row, width: usize) -> bool {
    row.cells.len() != width || row.cells.last() == Some(&Cell::Empty) || !row.looks_like_data()
}

/// `CH1`, `Channel 2`, `C3`.
fn is_channel(name: &str) -> bool {
    let lower = name.to_lowercase();
    let digits = lower.trim_start_matches(|c: char| !c.is_ascii_digit());
    let word = lower[..lower.len() - digits.len()].trim_end_matches([' ', '_']);
    matches!(word, "ch" | "c" | "channel" | "kanal" | "chan")
        && !digits.is_empty()
        && digits.bytes().all(|b| b.is_ascii_digit())
}

/// A unit without brackets around it.
fn bare(unit: &str) -> &str {
    let unit = unit.trim();
    let inside = |open, close| unit.strip_prefix(open).and_then(|u: &str| u.strip_suffix(close));
    inside('[', ']').or(inside('(', ')')).unwrap_or(unit).trim()
}
