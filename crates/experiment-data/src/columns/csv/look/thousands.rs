//! Numbers that may be fractions or have their thousands apart.

use super::super::cell::may_be_thousands;
use super::super::split::Splitter;
use super::{Head, Layout};
use crate::text::Decimal;

/// Cells of a column that show it.
const LEAST: usize = 8;

impl Head {
    /// Why it is not clear what stands before a fraction, where what was taken for it may stand between thousands: a column has it with exactly three digits behind,
    /// in every number from 1000 on, and beside these whole numbers below 1000, at least one in twenty. With fractions of three digits, one
    /// number in ten ends in a zero that most programs leave out, and one in a thousand is whole.
    pub(super) fn doubt_of_thousands(&self, layout: &Layout) -> Option<String> {
        let (between, other) = match layout.decimal? {
            Decimal::Point => ('.', Decimal::Comma),
            Decimal::Comma => (',', Decimal::Point),
        };
        let mut splitter = Splitter::new(layout.separator);
        let mut columns = vec![Some([0_usize; 2]); layout.names.len()];
        for index in layout.first as usize - 1..self.lines.len() {
            if layout.skip.contains(&(index as u64 + 1)) {
                continue;
            }
            let mut text = self.line(index).to_vec();
            text.push(b'\n');
            splitter.split(&text)?;
            for (counts, field) in columns.iter_mut().zip(splitter.fields()) {
                let cell = std::str::from_utf8(field).ok().map(str::trim);
                let Some(cell) = cell.filter(|c| !c.is_empty()) else {
                    continue;
                };
                let digits = cell.trim_start_matches(['+', '-']);
                let is_below = digits.len() <= 3 && digits.bytes().all(|b| b.is_ascii_digit());
                match counts {
                    Some([_, below]) if is_below => *below += 1,
                    Some([apart, _]) if may_be_thousands(cell, between) => *apart += 1,
                    // A fraction, or words.
                    _ => *counts = None,
                }
            }
        }
        let shows = |&[apart, below]: &[usize; 2]| apart >= LEAST && below >= LEAST && 20 * below >= apart;
        // Fractions of another column settle it.
        let is_fraction = |line: usize| {
            let mut text = self.line(line).to_vec();
            text.push(b'\n');
            let mut splitter = Splitter::new(layout.separator);
            splitter.split(&text).is_some()
                && splitter.fields().any(|field| {
                    let cell = std::str::from_utf8(field).unwrap_or_default().trim();
                    let number = match other {
                        Decimal::Comma => cell.parse::<f64>().is_ok(),
                        Decimal::Point => {
                            cell.replacen(',', ".", 1).parse::<f64>().is_ok() && !cell.contains('.')
                        }
                    };
                    number && cell.contains(between) && !may_be_thousands(cell, between)
                })
        };
        let found = columns.iter().position(|c| c.as_ref().is_some_and(shows))?;
        let settled = || (layout.first as usize - 1..self.lines.len()).any(is_fraction);
        (!settled()).then(|| {
            format!(
                "column `{}` has numbers such as `1{between}234` beside whole ones: is that a fraction or one thousand? Say what stands before a \
                 fraction by decimal, or write thousands without a mark",
                layout.names[found]
            )
        })
    }
}
