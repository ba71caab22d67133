//! Numbers with a format and a unit, and how they compare with a bar.

use crate::ticks;

/// One cell of a table, or the value of a key figure.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
pub enum Cell {
    /// Nothing to say: a dash.
    #[default]
    Empty,
    /// Text, left-aligned; `_{..}` and `^{..}` set sub- and superscripts.
    Text(String),
    /// A number, right-aligned.
    Number {
        /// The value; NaN and infinity are shown as such.
        value: f64,
        /// How it is written.
        format: Format,
        /// Unit behind it; may be empty.
        unit: String,
        /// The bar that it is held against, if any; a mark then says whether it is met.
        bar: Option<Bar>,
    },
}

/// How a number is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// This many decimals: `-62.1`. Magnitudes of 1e9 and more are written as powers of ten.
    Fixed(u8),
    /// This many decimals before a power of ten: `1.45·10^-6`.
    Scientific(u8),
    /// This many significant digits, fixed from 0.001 to 99999, otherwise scientific.
    Significant(u8),
}

/// A requirement on a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Bar {
    /// Met if the value is not larger.
    AtMost(f64),
    /// Met if the value is not smaller.
    AtLeast(f64),
}

/// Whether a bar is met.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The bar is met.
    Pass,
    /// The bar is not met, or the value or the bar is NaN.
    Fail,
}

impl Bar {
    /// Holds a value against the bar; NaN fails.
    pub fn judge(self, value: f64) -> Verdict {
        let met = match self {
            Bar::AtMost(bar) => value <= bar,
            Bar::AtLeast(bar) => value >= bar,
        };
        if met { Verdict::Pass } else { Verdict::Fail }
    }
}

impl Cell {
    /// Text.
    pub fn text(text: impl Into<String>) -> Self {
        Cell::Text(text.into())
    }

    /// A number without unit.
    pub fn number(value: f64, format: Format) -> Self {
        Cell::Number {
            value,
            format,
            unit: String::new(),
            bar: None,
        }
    }

    /// A count.
    pub fn count(value: usize) -> Self {
        Cell::Text(value.to_string()).into_number(value)
    }

    /// A level in decibels; the value must already be one.
    pub fn decibel(value_db: f64, decimals: u8) -> Self {
        Cell::number(value_db, Format::Fixed(decimals)).unit("dB")
    }

    /// Unit behind a number; text and empty cells stay as they are.
    pub fn unit(mut self, name: impl Into<String>) -> Self {
        if let Cell::Number { unit, .. } = &mut self {
            *unit = name.into();
        }
        self
    }

    /// Holds a number against a bar; text and empty cells stay as they are.
    pub fn bar(mut self, requirement: Bar) -> Self {
        if let Cell::Number { bar, .. } = &mut self {
            *bar = Some(requirement);
        }
        self
    }

    /// Whether the bar is met; `None` without one.
    pub fn verdict(&self) -> Option<Verdict> {
        match self {
            Cell::Number { value, bar, .. } => bar.map(|bar| bar.judge(*value)),
            _ => None,
        }
    }

    /// A count that is exact as a number is one; a larger one stays text.
    fn into_number(self, value: usize) -> Self {
        if value < 1_000_000_000 {
            Cell::number(value as f64, Format::Fixed(0))
        } else {
            self
        }
    }

    /// The value as markup of this crate (`^{..}` for a superscript), without bar.
    pub(crate) fn markup(&self) -> String {
        match self {
            Cell::Empty => "–".to_owned(),
            Cell::Text(text) => text.clone(),
            Cell::Number {
                value, format, unit, ..
            } if unit.is_empty() || value.is_nan() => write(*value, *format),
            Cell::Number {
                value, format, unit, ..
            } => format!("{}\u{a0}{unit}", write(*value, *format)),
        }
    }

    /// The bar as markup: `≤ −40`, without the unit, which the value has.
    pub(crate) fn bar_markup(&self) -> Option<String> {
        match self {
            Cell::Number {
                format,
                bar: Some(bar),
                ..
            } => Some(match bar {
                Bar::AtMost(value) => format!("≤\u{a0}{}", write(*value, *format)),
                Bar::AtLeast(value) => format!("≥\u{a0}{}", write(*value, *format)),
            }),
            _ => None,
        }
    }
}

/// A number as markup, with a true minus sign.
fn write(value: f64, format: Format) -> String {
    if value.is_nan() {
        return "not a number".to_owned();
    }
    if value.is_infinite() {
        return if value > 0.0 { "∞" } else { "−∞" }.to_owned();
    }
    match format {
        Format::Fixed(decimals) if value.abs() < 1e9 => ticks::decimal(value, usize::from(decimals.min(12))),
        Format::Fixed(_) => scientific(value, 3),
        Format::Scientific(decimals) => scientific(value, decimals),
        Format::Significant(_) if value == 0.0 => "0".to_owned(),
        Format::Significant(digits) => {
            let digits = i32::from(digits.clamp(1, 15));
            // Rounding first: 9.996 with three digits is 10.0, not 10.00.
            let rounded = format!("{value:.*e}", digits as usize - 1);
            let exponent: i32 = rounded
                .split_once('e')
                .and_then(|(_, e)| e.parse().ok())
                .unwrap_or(0);
            if (-3..=4).contains(&exponent) {
                ticks::decimal(value, (digits - 1 - exponent).max(0) as usize)
            } else {
                scientific(value, digits as u8 - 1)
            }
        }
    }
}

fn scientific(value: f64, decimals: u8) -> String {
    let text = format!("{value:.*e}", usize::from(decimals.min(15)));
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let (mantissa, exponent) = (mantissa.replace('-', "−"), exponent.replace('-', "−"));
    if exponent == "0" {
        mantissa
    } else {
        format!("{mantissa}·10^{{{exponent}}}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn numbers_as_they_are_written() {
        let markup = |value, format| Cell::number(value, format).markup();
        assert_eq!(markup(-62.08, Format::Fixed(1)), "−62.1");
        assert_eq!(markup(-0.001, Format::Fixed(1)), "0.0");
        assert_eq!(markup(1.45e-6, Format::Scientific(2)), "1.45·10^{−6}");
        assert_eq!(markup(-3.0, Format::Scientific(1)), "−3.0");
        assert_eq!(markup(9.996, Format::Significant(3)), "10.0");
        assert_eq!(markup(0.000_123_4, Format::Significant(2)), "1.2·10^{−4}");
        assert_eq!(markup(12_345.6, Format::Significant(3)), "12346");
        assert_eq!(markup(1e12, Format::Fixed(2)), "1.000·10^{12}");
        assert_eq!(markup(f64::NAN, Format::Fixed(2)), "not a number");
        assert_eq!(Cell::decibel(f64::NAN, 1).markup(), "not a number");
        assert_eq!(markup(f64::NEG_INFINITY, Format::Significant(2)), "−∞");
        assert_eq!(Cell::decibel(-14.04, 1).markup(), "−14.0\u{a0}dB");
        assert_eq!(Cell::count(36).markup(), "36");
        assert_eq!(Cell::Empty.markup(), "–");
    }

    #[test]
    fn a_bar_is_met_or_not_and_nan_never_meets_it() {
        let cell = Cell::decibel(-40.0, 1).bar(Bar::AtMost(-40.0));
        assert_eq!(cell.verdict(), Some(Verdict::Pass));
        assert_eq!(cell.bar_markup().unwrap(), "≤\u{a0}−40.0");
        assert_eq!(Bar::AtMost(-40.0).judge(-39.9), Verdict::Fail);
        assert_eq!(Bar::AtLeast(8.0).judge(8.0), Verdict::Pass);
        assert_eq!(Bar::AtLeast(8.0).judge(f64::NAN), Verdict::Fail);
        assert_eq!(Bar::AtMost(f64::NAN).judge(0.0), Verdict::Fail);
        assert_eq!(Cell::text("x").bar(Bar::AtMost(1.0)).verdict(), None);
    }

    proptest! {
        #[test]
        fn any_number_can_be_written(value in any::<f64>(), digits in any::<u8>()) {
            for format in [Format::Fixed(digits), Format::Scientific(digits), Format::Significant(digits)] {
                let text = write(value, format);
                prop_assert!(!text.is_empty() && text.len() < 48, "{text}");
                prop_assert!(!text.contains('-'), "hyphen in {text}");
            }
        }
    }
}
