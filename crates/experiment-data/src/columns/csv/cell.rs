//! One cell of a text table as a number.

use crate::text::Decimal;

/// The number of a cell, or the seconds of a date or a time of day; spaces around it do not matter. A comma before the fraction
/// is read only where the file has such, and then a point only between thousands.
pub(super) fn number(cell: &[u8], decimal: Decimal) -> Option<f64> {
    let text = std::str::from_utf8(cell.trim_ascii()).ok()?;
    let plain = match decimal {
        Decimal::Point => text.parse().ok(),
        Decimal::Comma if text.contains('.') => None,
        Decimal::Comma => {
            // "1," is a cell that the wrong separator has cut.
            if text.ends_with(',') {
                None
            } else {
                text.replacen(',', ".", 1).parse().ok()
            }
        }
    };
    plain.or_else(|| grouped(text, decimal)).or_else(|| stamp(text))
}

/// A number with its thousands apart and a fraction, such as `1,234.5` or `-1.234,5`; without the fraction `1,234` may be either.
fn grouped(text: &str, decimal: Decimal) -> Option<f64> {
    let (point, between) = match decimal {
        Decimal::Point => ('.', ','),
        Decimal::Comma => (',', '.'),
    };
    let (whole, fraction) = text.split_once(point)?;
    let mut groups = whole.trim_start_matches(['+', '-']).split(between);
    let is_number = |group: &str| group.bytes().all(|b| b.is_ascii_digit());
    let first = groups.next()?;
    let mut rest = groups.peekable();
    rest.peek()?;
    let fits = (1..=3).contains(&first.len())
        && is_number(first)
        && rest.all(|group| group.len() == 3 && is_number(group))
        && is_number(fraction);
    fits.then(|| format!("{}.{fraction}", whole.replace(between, "")).parse().ok())?
}

/// Seconds since midnight of `hh:mm:ss.fff`, or since 1970-01-01 with a date before it: `2018-01-22T10:00:00.5`,
/// `22.01.2018 10:00:00,5`, `2018/01/22 10:00:00`. The fraction may follow a point, a comma or a colon.
pub(super) fn stamp(text: &str) -> Option<f64> {
    // Without two colons it is no time, and most cells end here.
    if !text.is_ascii() || text.len() > 40 || text.bytes().filter(|b| *b == b':').count() < 2 {
        return None;
    }
    match text.split_once(['T', ' ']) {
        Some((date, time)) => Some(86_400.0 * days(date)? as f64 + time_of_day(time.trim())?),
        None => time_of_day(text),
    }
}

fn time_of_day(text: &str) -> Option<f64> {
    // The zone is the same in every row of a record.
    let text = text.trim_end_matches('Z');
    let text = match text.rfind(['+', '-']) {
        Some(at) if at > 0 => &text[..at],
        _ => text,
    };
    let mut parts = text.splitn(3, ':');
    let (hours, minutes) = (digits(parts.next()?, 2)?, digits(parts.next()?, 2)?);
    let rest = parts.next()?;
    let (seconds, fraction) = match rest.split_once(['.', ',', ':']) {
        Some((seconds, fraction)) => {
            let value = digits(fraction, 12)? as f64;
            (seconds, value / 10f64.powi(fraction.len() as i32))
        }
        None => (rest, 0.0),
    };
    let seconds = digits(seconds, 2)?;
    (hours < 25 && minutes < 60 && seconds < 61)
        .then_some((3600 * hours + 60 * minutes + seconds) as f64 + fraction)
}

/// Days since 1970-01-01 of year-month-day with dashes or slashes, or day.month.year.
fn days(date: &str) -> Option<i64> {
    let separator = date.chars().find(|c| matches!(c, '-' | '/' | '.'))?;
    let parts: Vec<&str> = date.split(separator).collect();
    let &[a, b, c] = parts.as_slice() else { return None };
    let (year, month, day) = match separator {
        '.' => (c, b, a),
        // 1/22/2018 may be either way round: only the order year first is sure.
        _ if a.len() == 4 => (a, b, c),
        _ => return None,
    };
    if year.len() != 4 {
        return None;
    }
    let (year, month, day) = (digits(year, 4)?, digits(month, 2)?, digits(day, 2)?);
    if !(1..=12).contains(&month) || !(1..=31).contains(&day) {
        return None;
    }
    // Years that start in March have the leap day at their end.
    let (y, m) = if month > 2 {
        (year, month - 3)
    } else {
        (year - 1, month + 9)
    };
    Some(365 * y + y / 4 - y / 100 + y / 400 + (153 * m + 2) / 5 + day - 1 - 719_468)
}

fn digits(text: &str, most: usize) -> Option<i64> {
    let fine = !text.is_empty() && text.len() <= most && text.bytes().all(|b| b.is_ascii_digit());
    fine.then(|| text.parse().ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_by_hand() {
        for (cell, decimal, value) in [
            (" 1.5e3 ", Decimal::Point, Some(1500.0)),
            ("1,5", Decimal::Point, None),
            ("1,5", Decimal::Comma, Some(1.5)),
            ("-,5e-3", Decimal::Comma, Some(-5e-4)),
            ("1.234,5", Decimal::Comma, Some(1234.5)),
            ("-1,234,567.25", Decimal::Point, Some(-1_234_567.25)),
            ("1,234.", Decimal::Point, Some(1234.0)),
            ("12,34.5", Decimal::Point, None),
            ("1,234.5.6", Decimal::Point, None),
            ("1,234.5e3", Decimal::Point, None),
            ("1,234", Decimal::Point, None),
            (",234.5", Decimal::Point, None),
            ("1.234", Decimal::Comma, None),
            ("1,234,567", Decimal::Comma, None),
            ("1,", Decimal::Comma, None),
            ("", Decimal::Comma, None),
            ("off", Decimal::Point, None),
            ("00:00:01.25", Decimal::Point, Some(1.25)),
            ("01:01:01,5", Decimal::Point, Some(3661.5)),
            ("10:00:00:007", Decimal::Point, Some(36_000.007)),
            ("1970-01-02T00:00:00.5Z", Decimal::Point, Some(86_400.5)),
            ("2000-03-01 00:00:00+01:00", Decimal::Point, Some(951_868_800.0)),
            ("22.01.2018 10:00:00,25", Decimal::Comma, Some(1_516_615_200.25)),
            ("2018/01/22 10:00:00", Decimal::Point, Some(1_516_615_200.0)),
            ("1/2/2018 10:00:00", Decimal::Point, None),
            ("25:61:00", Decimal::Point, None),
            ("::", Decimal::Point, None),
        ] {
            assert_eq!(number(cell.as_bytes(), decimal), value, "{cell}");
        }
    }
}
