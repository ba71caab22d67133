//! The data sets of a universal file: each stands between two lines with -1.

use super::header::{Function, Header, LINES};
use super::malformed;
use crate::RecordError;
use std::ops::Range;

/// More sets than this are no measurement.
const MOST_SETS: usize = 1 << 20;

/// What a file holds, in its order.
#[derive(Debug, Default)]
pub(super) struct Sets {
    pub(super) functions: Vec<Set>,
    /// Place in the file, from 1, and number of the format, of data sets other than 58.
    pub(super) others: Vec<(usize, i64)>,
}

/// A data set 58.
#[derive(Debug, Clone)]
pub(super) struct Set {
    /// Place in the file, from 1.
    pub(super) number: usize,
    pub(super) header: Header,
    /// Where its values are.
    pub(super) values: Range<usize>,
    pub(super) coding: Coding,
}

/// How values are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Coding {
    Text,
    Bytes {
        big_endian: bool,
        /// Bytes of the abscissa of a value; 0 where none is stored.
        abscissa_bytes: usize,
    },
}

impl Set {
    /// In words.
    pub(super) fn what(&self) -> String {
        let of = match self.header.function {
            Function::FrequencyResponse => "a frequency response".to_owned(),
            Function::Number(n) => format!("a function of type {n}"),
            Function::Other | Function::TimeHistory => "a function".to_owned(),
        };
        format!(
            "{of}, {} values, no time history of real numbers",
            self.header.points
        )
    }
}

/// All data sets, in the order of the file.
pub(super) fn sets(bytes: &[u8]) -> Result<Sets, RecordError> {
    let mut sets = Sets::default();
    let mut lines = Lines { bytes, at: 0 };
    let mut number = 0;
    while let Some(line) = lines.next() {
        if !is_mark(line) {
            continue;
        }
        number += 1;
        let Some(kind) = lines.next() else {
            // Some programs end a file with a mark more.
            break;
        };
        if sets.functions.len() + sets.others.len() == MOST_SETS {
            return Err(malformed("", "more data sets than any measurement has"));
        }
        let name = format!("data set {number}");
        let broken = |problem: String| malformed(&name, &problem);
        let text = String::from_utf8_lossy(&kind[..kind.len().min(80)]).into_owned();
        let text = text.trim();
        let digits = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
        let (digits, rest) = text.split_at(digits);
        let kind: i64 = digits
            .parse()
            .map_err(|_| broken(format!("`{}` in the place of its number", text)))?;
        if kind != 58 {
            // Units and headers are in most files.
            if !matches!(kind, 151 | 164) {
                sets.others.push((number, kind));
            }
            lines.skip_to_mark();
            continue;
        }
        let first_line = rest.strip_prefix(['b', 'B']).map(FirstLine::read);
        let mut header = [&[][..]; LINES];
        for line in &mut header {
            *line = lines
                .next()
                .ok_or_else(|| broken("the file ends in its header".to_owned()))?;
        }
        let header = Header::read(&header).map_err(broken)?;
        let (values, coding) = match first_line {
            None => {
                let start = lines.at;
                (start..lines.skip_to_mark(), Coding::Text)
            }
            Some(None) => {
                return Err(broken(
                    "its first line does not say the byte order, the kind of numbers (IEEE 754) and their length"
                        .to_owned(),
                ));
            }
            Some(Some(first_line)) => {
                for _ in LINES..first_line.lines {
                    lines.next();
                }
                let start = lines.at;
                // Some programs state another length than they write; the mark behind it tells.
                let (length, abscissa_bytes) = header
                    .lengths()
                    .into_iter()
                    .find(|(length, _)| start.checked_add(*length).is_some_and(|end| ends(bytes, end)))
                    .ok_or_else(|| {
                        let (points, left) = (header.points, bytes.len() - start);
                        broken(format!(
                            "its header claims {points} values, and behind as many in the {left} bytes that follow no set ends"
                        ))
                    })?;
                lines.at = start + length;
                lines.skip_to_mark();
                let coding = Coding::Bytes {
                    big_endian: first_line.big_endian,
                    abscissa_bytes,
                };
                (start..start + length, coding)
            }
        };
        sets.functions.push(Set {
            number,
            header,
            values,
            coding,
        });
    }
    if number == 0 {
        return Err(malformed(
            "",
            "no line with -1, which stands before each data set",
        ));
    }
    Ok(sets)
}

/// What the first line of a set in bytes says.
struct FirstLine {
    big_endian: bool,
    /// Lines of text behind it.
    lines: usize,
}

impl FirstLine {
    fn read(rest: &str) -> Option<Self> {
        let mut numbers = rest.split_whitespace().map(str::parse::<usize>);
        let mut next = || numbers.next()?.ok();
        let big_endian = match next()? {
            1 => false,
            2 => true,
            _ => return None,
        };
        // 2 is IEEE 754; the others are of machines of the past.
        if next()? != 2 {
            return None;
        }
        let lines = next().filter(|n| (LINES..1000).contains(n))?;
        Some(Self { big_endian, lines })
    }
}

/// Whether a set may end here: a mark follows, or the end of the file.
fn ends(bytes: &[u8], at: usize) -> bool {
    let Some(rest) = bytes.get(at..) else {
        return false;
    };
    let rest = rest.strip_prefix(b"\r").unwrap_or(rest);
    let rest = rest.strip_prefix(b"\n").unwrap_or(rest);
    let line = &rest[..memchr::memchr(b'\n', rest).unwrap_or(rest.len())];
    rest.is_empty() || is_mark(line)
}

fn is_mark(line: &[u8]) -> bool {
    line.trim_ascii() == b"-1"
}

struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Lines<'a> {
    fn next(&mut self) -> Option<&'a [u8]> {
        let rest = self.bytes.get(self.at..).filter(|r| !r.is_empty())?;
        let length = memchr::memchr(b'\n', rest).map_or(rest.len(), |at| at + 1);
        self.at += length;
        let line = &rest[..length];
        let line = line.strip_suffix(b"\n").unwrap_or(line);
        Some(line.strip_suffix(b"\r").unwrap_or(line))
    }

    /// Passes the line with the next mark; where it begins, or the end of the file.
    fn skip_to_mark(&mut self) -> usize {
        loop {
            let start = self.at;
            match self.next() {
                None => return self.bytes.len(),
                Some(line) if is_mark(line) => return start,
                Some(_) => {}
            }
        }
    }
}
