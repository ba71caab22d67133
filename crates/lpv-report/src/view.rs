//! From data values to places on an axis.

use crate::panel::{Axis, Scale};
use crate::ticks::{self, Ticks};

/// Largest magnitude that is drawn; sums and differences of such numbers do not overflow.
const LARGEST: f64 = 1e290;
/// Smallest span of a linear axis, against the size of its ends.
const SMALLEST_SPAN: f64 = 1e-9;
/// Smallest span of any linear axis.
const TINIEST_SPAN: f64 = 1e-280;

/// Why a value has no place on an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Refused {
    NotFinite,
    NotPositive,
}

/// Place of a value on an axis before scaling to a length: the value itself, or its log10.
pub(crate) fn coordinate(scale: Scale, value: f64) -> Result<f64, Refused> {
    if !value.is_finite() || value.abs() > LARGEST {
        return Err(Refused::NotFinite);
    }
    match scale {
        Scale::Linear => Ok(value),
        Scale::Log if value >= 1.0 / LARGEST => Ok(value.log10()),
        Scale::Log => Err(Refused::NotPositive),
    }
}

/// Lower and upper end in axis coordinates.
pub(crate) type Range = (f64, f64);

/// Whether a range can carry ticks.
fn is_range((lower, upper): Range, scale: Scale) -> bool {
    let size = match scale {
        Scale::Linear => (SMALLEST_SPAN * lower.abs().max(upper.abs())).max(TINIEST_SPAN),
        Scale::Log => 1e-6,
    };
    upper - lower >= size
}

/// The range that the user has fixed, if it is one.
pub(crate) fn fixed(axis: &Axis, (lower, upper): (f64, f64)) -> Option<Range> {
    let ends = (
        coordinate(axis.scale, lower).ok()?,
        coordinate(axis.scale, upper).ok()?,
    );
    is_range(ends, axis.scale).then_some(ends)
}

/// Room around the data of an automatic range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Padding {
    /// The axis ends where the data end.
    Tight,
    /// A twentieth on both sides.
    Loose,
}

/// Range of data that are already axis coordinates; a single value gets some room.
pub(crate) fn automatic(values: impl Iterator<Item = f64>, scale: Scale, padding: Padding) -> Option<Range> {
    let (lower, upper) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, u), v| {
        (l.min(v), u.max(v))
    });
    if lower > upper {
        return None;
    }
    if !is_range((lower, upper), scale) {
        let middle = lower + 0.5 * (upper - lower);
        let room = match scale {
            Scale::Linear if middle.abs() < TINIEST_SPAN => 1.0,
            Scale::Linear => 0.1 * middle.abs().max(10.0 * TINIEST_SPAN),
            Scale::Log => 0.5,
        };
        return Some((middle - room, middle + room));
    }
    let room = match padding {
        Padding::Tight => 0.0,
        Padding::Loose => 0.05 * (upper - lower),
    };
    Some((lower - room, upper + room))
}

/// The smallest range around both.
pub(crate) fn union(a: Range, b: Range) -> Range {
    (a.0.min(b.0), a.1.max(b.1))
}

/// An axis with its ends and ticks.
#[derive(Debug, Clone)]
pub(crate) struct View {
    pub(crate) scale: Scale,
    pub(crate) range: Range,
    pub(crate) ticks: Ticks,
}

impl View {
    pub(crate) fn new(axis: &Axis, range: Range, most: usize) -> Self {
        let ticks = match axis.scale {
            Scale::Linear => ticks::linear(range.0, range.1, most, axis.step),
            Scale::Log => ticks::logarithmic(range.0, range.1, most),
        };
        Self {
            scale: axis.scale,
            range,
            ticks,
        }
    }

    /// Place of an axis coordinate: 0 at the lower end, 1 at the upper. Far outside it is cut to ±50, which
    /// keeps the numbers of the drawing small and is not visible.
    pub(crate) fn unit(&self, coordinate: f64) -> f64 {
        let (lower, upper) = self.range;
        ((coordinate - lower) / (upper - lower)).clamp(-50.0, 50.0)
    }

    /// Place of a value.
    pub(crate) fn place(&self, value: f64) -> Result<f64, Refused> {
        coordinate(self.scale, value).map(|c| self.unit(c))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_without_a_place() {
        assert_eq!(coordinate(Scale::Linear, f64::NAN), Err(Refused::NotFinite));
        assert_eq!(coordinate(Scale::Log, f64::INFINITY), Err(Refused::NotFinite));
        assert_eq!(coordinate(Scale::Log, 0.0), Err(Refused::NotPositive));
        assert_eq!(coordinate(Scale::Log, -3.0), Err(Refused::NotPositive));
        assert_eq!(coordinate(Scale::Log, 100.0), Ok(2.0));
        assert_eq!(coordinate(Scale::Linear, -3.0), Ok(-3.0));
    }

    #[test]
    fn ranges_by_hand() {
        let auto = |values: &[f64], padding| automatic(values.iter().copied(), Scale::Linear, padding);
        assert_eq!(auto(&[2.0, 4.0], Padding::Tight), Some((2.0, 4.0)));
        assert_eq!(auto(&[0.0, 20.0], Padding::Loose), Some((-1.0, 21.0)));
        assert_eq!(auto(&[0.0], Padding::Tight), Some((-1.0, 1.0)));
        assert_eq!(auto(&[10.0], Padding::Tight), Some((9.0, 11.0)));
        assert_eq!(auto(&[], Padding::Tight), None);
        assert_eq!(fixed(&Axis::log(""), (0.01, 10.0)), Some((-2.0, 1.0)));
        assert_eq!(fixed(&Axis::log(""), (0.0, 10.0)), None);
        assert_eq!(fixed(&Axis::linear(""), (1.0, 1.0)), None);
        assert_eq!(fixed(&Axis::linear(""), (f64::NAN, 1.0)), None);
    }

    #[test]
    fn places_by_hand() {
        let view = View::new(&Axis::log("").range(0.01, 100.0), (-2.0, 2.0), 5);
        assert_eq!(view.place(1.0), Ok(0.5));
        assert_eq!(view.place(1e280), Ok(50.0));
        assert_eq!(view.place(-1.0), Err(Refused::NotPositive));
    }
}
