//! Units of time: by the name of a column, by its numbers, by a known rate.

use super::names::unit_of;

/// Units of time, with the seconds in one.
pub(super) const UNITS: [(&str, f64); 4] = [("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)];

/// Whether two steps are one, in the same or another unit of time.
pub(super) fn is_same_step(a: f64, b: f64) -> bool {
    let ratio = (a / b).max(b / a);
    UNITS.iter().any(|(_, s)| (ratio * s - 1.0).abs() < 0.01)
}

/// The unit in which a known rate agrees with the time column; none if no unit does.
pub(super) fn agreeing_unit(step: f64, hz: f64) -> Option<&'static str> {
    UNITS
        .iter()
        .find(|(_, seconds)| (step * seconds * hz - 1.0).abs() < 0.01)
        .map(|u| u.0)
}

/// The unit that the name of a time column states.
pub(super) fn stated_unit(column: &str) -> Option<&str> {
    if let Some(unit) = unit_of(column) {
        return Some(unit);
    }
    let parts = column.rsplit_once(['_', '/', ',', ' ', '.', '-']);
    match parts.map(|(_, end)| end.trim()) {
        Some(end @ ("s" | "ms" | "us" | "µs" | "ns" | "min" | "sec" | "seconds" | "milliseconds")) => {
            Some(end)
        }
        _ => ["Ms", "Us", "Ns", "MS", "Sec"]
            .into_iter()
            .find(|end| column.len() > end.len() && column.ends_with(end)),
    }
}

/// Seconds in a unit of time.
pub(crate) fn seconds(unit: &str) -> Option<f64> {
    match unit.trim().to_lowercase().as_str() {
        "s" | "sec" | "second" | "seconds" | "sekunden" => Some(1.0),
        "ms" | "msec" | "millisecond" | "milliseconds" => Some(1e-3),
        "us" | "µs" | "μs" | "usec" | "microseconds" => Some(1e-6),
        "ns" | "nsec" | "nanoseconds" => Some(1e-9),
        "min" | "minutes" => Some(60.0),
        "h" | "hour" | "hours" | "stunden" => Some(3600.0),
        "d" | "day" | "days" | "tage" => Some(86_400.0),
        _ => None,
    }
}

/// Days since 1900 (spreadsheets) or since the year 0 (MATLAB's datenum) of a date between 1973 and 2109: by the name of the column, or
/// where seconds would be faster than any machine is logged.
pub(super) fn is_in_days(name: &str, first: f64, step: f64) -> bool {
    const FASTEST: f64 = 1e-6;
    let is_date = (26_700.0..76_500.0).contains(&first) || (720_600.0..770_400.0).contains(&first);
    let lower = name.to_lowercase();
    let is_named = ["date", "datum", "fecha", "excel"]
        .iter()
        .any(|d| lower.contains(d));
    is_date && (is_named || step < FASTEST) && 86_400.0 * step < 3600.0
}

/// Times since 1970 lie between 2001 and 2096 in one unit only.
pub(super) fn unit_of_stamps(first: f64) -> Option<(&'static str, f64)> {
    UNITS.into_iter().find(|(_, s)| (1e9..4e9).contains(&(first * s)))
}
