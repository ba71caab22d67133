//! The data sets of a universal file: each stands between two lines with -1.

use super::header::{Function, Header, LINES};
use super::malformed;
use super::source::Source;
use crate::RecordError;
use std::io::{Read, Seek};
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
    pub(super) values: Range<u64>,
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
pub(super) fn sets<R: Read + Seek>(source: &mut Source<R>) -> Result<Sets, RecordError> {
    let mut sets = Sets::default();
    let mut number = 0;
    while source.skip_to_mark()? < source.bytes() {
        number += 1;
        let Some(kind) = source.next_line()? else {
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
            source.skip_to_mark()?;
            continue;
        }
        let first_line = rest.strip_prefix(['b', 'B']).map(FirstLine::read);
        let mut header: [Vec<u8>; LINES] = Default::default();
        for line in &mut header {
            *line = source
                .next_line()?
                .ok_or_else(|| broken("the file ends in its header".to_owned()))?;
        }
        let header = Header::read(&header.each_ref().map(Vec::as_slice)).map_err(broken)?;
        let (values, coding) = match first_line {
            None => {
                let start = source.at();
                (start..source.skip_to_mark()?, Coding::Text)
            }
            Some(None) => {
                return Err(broken(
                    "its first line does not say the byte order, the kind of numbers (IEEE 754) and their length"
                        .to_owned(),
                ));
            }
            Some(Some(first_line)) => {
                for _ in LINES..first_line.lines {
                    source.next_line()?;
                }
                let start = source.at();
                // Some programs state another length than they write; the mark behind it tells.
                let mut fitting = None;
                for (length, abscissa_bytes) in header.lengths() {
                    let end = start.saturating_add(length);
                    if fitting.is_none() && source.ends_at(end)? {
                        fitting = Some((end, abscissa_bytes));
                    }
                }
                let (end, abscissa_bytes) = fitting.ok_or_else(|| {
                    let (points, left) = (header.points, source.bytes() - start);
                    broken(format!(
                        "its header claims {points} values, and behind as many in the {left} bytes that follow no set ends"
                    ))
                })?;
                source.go_to(end)?;
                source.skip_to_mark()?;
                let coding = Coding::Bytes {
                    big_endian: first_line.big_endian,
                    abscissa_bytes,
                };
                (start..end, coding)
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
