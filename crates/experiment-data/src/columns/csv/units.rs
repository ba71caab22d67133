//! Whether a text is a unit.

/// Units that stand alone or with a prefix in front.
const WITH_PREFIX: &[&str] = &[
    "s", "m", "g", "N", "Nm", "V", "A", "W", "Hz", "rad", "Pa", "J", "K", "F", "H",
];
/// Units without prefixes.
const ALONE: &[&str] = &[
    "sec", "min", "deg", "°", "degree", "degrees", "rpm", "rev", "inc", "incr", "counts", "count", "cts",
    "digit", "digits", "bit", "%", "-", "1", "bar", "°C", "degC", "in", "inch", "lbf", "ohm", "second",
    "seconds", "volt", "volts", "newton", "meter", "metre", "ampere", "amps", "pu", "p.u.", "a.u.", "Ohm",
    "Ω",
];
const PREFIXES: &[&str] = &["n", "u", "µ", "μ", "m", "c", "d", "k", "M", "G", "p"];

/// `N`, `[mm]`, `rad/s`, `m/s^2`, `N*m`, `1/min`: a unit, in brackets or not.
pub(super) fn is_unit(text: &str) -> bool {
    let text = text.trim();
    let inside = |open, close| text.strip_prefix(open).and_then(|t: &str| t.strip_suffix(close));
    let text = inside('[', ']').or(inside('(', ')')).unwrap_or(text).trim();
    // Revolutions are one letter in German, and a letter alone is a name.
    let text = text.strip_prefix("U/").unwrap_or(text);
    !text.is_empty()
        && text
            .split(['/', '*', '·', ' '])
            .filter(|part| !part.is_empty())
            .all(|part| is_simple(part.trim_end_matches(['^', '2', '3', '²', '³'])))
}

fn is_simple(unit: &str) -> bool {
    let known = |u: &str| WITH_PREFIX.contains(&u);
    known(unit)
        || ALONE.contains(&unit)
        || ALONE.contains(&unit.to_lowercase().as_str()) && unit.len() > 2
        || PREFIXES.iter().any(|p| unit.strip_prefix(p).is_some_and(known))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_by_hand() {
        for unit in [
            "s", "N", "[mm]", "(rad/s)", "m/s^2", "N m", "1/min", "µm", "kHz", "mA", "%", "°", "Volts", "Nm",
            "U/min",
        ] {
            assert!(is_unit(unit), "{unit}");
        }
        for word in [
            "t", "u", "y", "r", "Force", "x", "TIME", "CH1", "v", "a", "", "pos", "[note]", "actual",
        ] {
            assert!(!is_unit(word), "{word}");
        }
    }
}
