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

/// Whether it may be a whole number from 1000 on with this between its thousands, as `-1.539` is where a fraction follows a comma.
pub(super) fn may_be_thousands(text: &str, between: char) -> bool {
    let is_number = |group: &str| !group.is_empty() && group.bytes().all(|b| b.is_ascii_digit());
    let mut groups = text.trim_start_matches(['+', '-']).split(between);
    let first = groups.next().unwrap_or_default();
    let rest: Vec<&str> = groups.collect();
    let begins = first.len() <= 3 && is_number(first) && !first.starts_with('0');
    begins && !rest.is_empty() && rest.iter().all(|group| group.len() == 3 && is_number(group))
}

/// Seconds since midnight of `hh:mm:ss.fff`, or since 1970-01-01 with a date before it: `2018-01-22T10:00:00.5`,
/// `22.01.2018 10:00:00,5`, `2018/01/22 10:00:00`, `22-Jan-2018 10:00:00`, `1/22/2018 10:00:00 AM`. The fraction may follow a point, a comma or a colon. Or
/// a duration as MATLAB writes it: `0.5 sec`.
pub(super) fn stamp(text: &str) -> Option<f64> {
    if let Some((number, unit)) = text.split_once(' ')
        && let Some(seconds) = duration(unit)
    {
        return number.parse::<f64>().ok().map(|n| n * seconds);
    }
    // Without two colons it is no time, and most cells end here.
    if !text.is_ascii() || text.len() > 40 || text.bytes().filter(|b| *b == b':').count() < 2 {
        return None;
    }
    let (text, half) = match text.rsplit_once(' ') {
        Some((before, half)) if half.eq_ignore_ascii_case("am") => (before, Some(false)),
        Some((before, half)) if half.eq_ignore_ascii_case("pm") => (before, Some(true)),
        _ => (text, None),
    };
    let of_day = |time: &str| match (half, time_of_day(time)?) {
        (None, seconds) => Some(seconds),
        // From 12:00 AM, which is midnight, to 11:59 PM.
        (Some(is_afternoon), seconds) if (3600.0..13.0 * 3600.0).contains(&seconds) => {
            Some(seconds % 43_200.0 + if is_afternoon { 43_200.0 } else { 0.0 })
        }
        _ => None,
    };
    match text.split_once(['T', ' ']) {
        Some((date, time)) => Some(86_400.0 * days(date, half.is_some())? as f64 + of_day(time.trim())?),
        None => of_day(text),
    }
}

/// Seconds of a unit behind a number.
fn duration(unit: &str) -> Option<f64> {
    match unit {
        "sec" => Some(1.0),
        "min" => Some(60.0),
        "hr" => Some(3600.0),
        _ => None,
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

/// Days since 1970-01-01 of year-month-day with dashes or slashes, day.month.year, day-Jan-year, or with slashes month/day/year, where the time is told
/// as there or no month has that number.
fn days(date: &str, is_american: bool) -> Option<i64> {
    const MONTHS: [&str; 12] = [
        "jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec",
    ];
    let separator = date.chars().find(|c| matches!(c, '-' | '/' | '.'))?;
    let parts: Vec<&str> = date.split(separator).collect();
    let &[a, b, c] = parts.as_slice() else { return None };
    let (year, month, day) = match separator {
        '.' => (c, b, a),
        _ if a.len() == 4 => (a, b, c),
        '-' if b.bytes().all(|b| b.is_ascii_alphabetic()) => (c, b, a),
        // 1/2/2018 may be either way round.
        '/' if is_american || digits(b, 2)? > 12 => (c, a, b),
        '/' if digits(a, 2)? > 12 => (c, b, a),
        _ => return None,
    };
    if year.len() != 4 {
        return None;
    }
    let named = MONTHS.iter().position(|m| month.eq_ignore_ascii_case(m));
    let month = match named {
        Some(at) => at as i64 + 1,
        None => digits(month, 2)?,
    };
    let (year, day) = (digits(year, 4)?, digits(day, 2)?);
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
            ("1/22/2018 10:00:00", Decimal::Point, Some(1_516_615_200.0)),
            ("22/1/2018 10:00:00", Decimal::Point, Some(1_516_615_200.0)),
            ("22-Jan-2018 10:00:00", Decimal::Point, Some(1_516_615_200.0)),
            ("01/22/2018 10:00:00 AM", Decimal::Point, Some(1_516_615_200.0)),
            ("1/2/1970 12:00:01.5 am", Decimal::Point, Some(86_401.5)),
            ("12:00:00 PM", Decimal::Point, Some(43_200.0)),
            ("1:02:03 PM", Decimal::Point, Some(46_923.0)),
            ("13:02:03 PM", Decimal::Point, None),
            ("0.125 sec", Decimal::Point, Some(0.125)),
            ("2 min", Decimal::Point, Some(120.0)),
            ("2 sek", Decimal::Point, None),
            ("25:61:00", Decimal::Point, None),
            ("::", Decimal::Point, None),
        ] {
            assert_eq!(number(cell.as_bytes(), decimal), value, "{cell}");
        }
    }
}
