//! The eleven lines in front of the values of data set 58.

/// What kind of function a set is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Function {
    /// General or unknown.
    Other,
    TimeHistory,
    FrequencyResponse,
    /// Anything else, by its number.
    Number(i64),
}

/// Whether the abscissa of each value is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Spacing {
    Even,
    Uneven,
}

/// What an axis shows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Axis {
    /// 8 displacement, 9 and 13 force, 11 velocity, 12 acceleration, 17 time, 18 frequency.
    pub(super) kind: i64,
    pub(super) label: String,
    pub(super) unit: String,
}

/// Node and direction.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) entity: String,
    pub(super) node: i64,
    pub(super) direction: i64,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Header {
    pub(super) function: Function,
    pub(super) response: Place,
    /// Where a frequency response is excited.
    pub(super) reference: Place,
    pub(super) is_complex: bool,
    pub(super) is_double: bool,
    pub(super) points: u64,
    pub(super) spacing: Spacing,
    /// First abscissa of even values.
    pub(super) start: f64,
    pub(super) step: f64,
    pub(super) abscissa: Axis,
    pub(super) ordinate: Axis,
    /// Kind of what the ordinate is over.
    pub(super) over: i64,
}

/// Lines of a header.
pub(super) const LINES: usize = 11;

impl Header {
    /// The header, or what is wrong with it.
    pub(super) fn read(lines: &[&[u8]; LINES]) -> Result<Self, String> {
        let whole = |line: usize, from: usize, to: usize| {
            let text = cut(lines[line], from, to);
            text.parse::<i64>()
                .map_err(|_| format!("`{text}` in line {} of its header is no whole number", line + 1))
        };
        let function = match whole(5, 0, 5)? {
            0 => Function::Other,
            1 => Function::TimeHistory,
            4 => Function::FrequencyResponse,
            n => Function::Number(n),
        };
        let place = |from: usize| -> Result<Place, String> {
            Ok(Place {
                entity: word(lines[5], from, from + 10),
                node: whole(5, from + 10, from + 20)?,
                direction: whole(5, from + 20, from + 24)?,
            })
        };
        let (is_complex, is_double) = match whole(6, 0, 10)? {
            2 => (false, false),
            4 => (false, true),
            5 => (true, false),
            6 => (true, true),
            n => return Err(format!("values of the unknown type {n}")),
        };
        let points =
            u64::try_from(whole(6, 10, 20)?).map_err(|_| "a negative number of values".to_owned())?;
        let spacing = match whole(6, 20, 30)? {
            0 => Spacing::Uneven,
            1 => Spacing::Even,
            n => return Err(format!("the unknown abscissa spacing {n}")),
        };
        let real = |from: usize, to: usize| {
            let text = cut(lines[6], from, to).replace(['D', 'd'], "E");
            text.parse().unwrap_or(f64::NAN)
        };
        let (start, step) = (real(30, 43), real(43, 56));
        if spacing == Spacing::Even && !f64::is_finite(step) {
            return Err("even values without an increment".to_owned());
        }
        let axis = |line: usize| Axis {
            kind: whole(line, 0, 10).unwrap_or(0),
            label: word(lines[line], 26, 46),
            unit: word(lines[line], 47, 67),
        };
        Ok(Self {
            function,
            response: place(31)?,
            reference: place(56).unwrap_or(Place {
                entity: String::new(),
                node: 0,
                direction: 0,
            }),
            is_complex,
            is_double,
            points,
            spacing,
            start,
            step,
            abscissa: axis(7),
            ordinate: axis(8),
            over: whole(9, 0, 10).unwrap_or(0),
        })
    }

    /// Bytes of a number.
    pub(super) fn width(&self) -> usize {
        if self.is_double { 8 } else { 4 }
    }

    /// Bytes of all values, and of an abscissa where it is stored: that is of single precision, but some programs write it as
    /// they write values. None for more than can be counted.
    pub(super) fn lengths(&self) -> Vec<(u64, usize)> {
        let values = self.width() * (1 + usize::from(self.is_complex));
        let abscissas: &[usize] = match self.spacing {
            Spacing::Even => &[0],
            Spacing::Uneven => &[4, 8][..self.width() / 4],
        };
        abscissas
            .iter()
            .filter_map(|a| Some((self.points.checked_mul((values + a) as u64)?, *a)))
            .collect()
    }

    /// Quantity, node and direction.
    pub(super) fn name(&self) -> String {
        let quantity = match (self.ordinate.kind, self.ordinate.label.as_str()) {
            (8, _) => "displacement",
            (9 | 13, _) => "force",
            (11, _) => "velocity",
            (12, _) => "acceleration",
            (_, "") => "signal",
            (_, label) => label,
        };
        format!("{quantity} {}", self.response.name())
    }
}

impl Place {
    /// As engineers write it: `12+Z`, `wing:12+Z`.
    pub(super) fn name(&self) -> String {
        let Self {
            entity,
            node,
            direction,
        } = self;
        let entity = if entity.is_empty() {
            String::new()
        } else {
            format!("{entity}:")
        };
        format!("{entity}{node}{}", letters(*direction))
    }
}

/// A direction as engineers write it.
pub(super) fn letters(direction: i64) -> String {
    let axis = match direction.unsigned_abs() {
        1 => "X",
        2 => "Y",
        3 => "Z",
        4 => "RX",
        5 => "RY",
        6 => "RZ",
        _ => return String::new(),
    };
    format!("{}{axis}", if direction < 0 { '-' } else { '+' })
}

/// The columns `from .. to` of a line, without blanks around.
fn cut(line: &[u8], from: usize, to: usize) -> String {
    let part = &line[from.min(line.len())..to.min(line.len())];
    String::from_utf8_lossy(part.trim_ascii()).into_owned()
}

/// The same, where `NONE` says nothing.
fn word(line: &[u8], from: usize, to: usize) -> String {
    let text = cut(line, from, to);
    if text.eq_ignore_ascii_case("none") {
        String::new()
    } else {
        text
    }
}
