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
        let decimal = layout.decimal?;
        let between = decimal.character();
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
                let is_apart = may_be_thousands(cell, between);
                // A fraction in any column says what stands before it.
                if cell.contains(between) && !is_apart && is_plain_number(cell, decimal) {
                    return None;
                }
                match counts {
                    Some([_, below]) if is_below => *below += 1,
                    Some([apart, _]) if is_apart => *apart += 1,
                    // Words.
                    _ => *counts = None,
                }
            }
        }
        let shows = |&[apart, below]: &[usize; 2]| apart >= LEAST && below >= LEAST && 20 * below >= apart;
        let found = columns.iter().position(|c| c.as_ref().is_some_and(shows))?;
        Some(format!(
            "column `{}` has numbers such as `1{between}234` beside whole ones: is that a fraction or one thousand? Say what stands before a \
             fraction by decimal, or write thousands without a mark",
            layout.names[found]
        ))
    }
}

/// Whether a cell is a number without anything between its thousands.
fn is_plain_number(cell: &str, decimal: Decimal) -> bool {
    match decimal {
        Decimal::Point => cell.parse::<f64>().is_ok(),
        Decimal::Comma => !cell.contains('.') && cell.replacen(',', ".", 1).parse::<f64>().is_ok(),
    }
}
