//! From stored to physical values.

use super::blocks::Blocks;
use crate::RecordError;

/// A conversion that is computed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Conversion {
    None,
    /// `a + b x`.
    Linear([f64; 2]),
    /// `(a x^2 + b x + c) / (d x^2 + e x + f)`.
    Rational([f64; 6]),
}

impl Conversion {
    pub(super) fn apply(self, x: f64) -> f64 {
        match self {
            Self::None => x,
            Self::Linear([a, b]) => a + b * x,
            Self::Rational([a, b, c, d, e, f]) => (a * x * x + b * x + c) / (d * x * x + e * x + f),
        }
    }
}

/// The conversion at this place and the unit that it has, or in words what it is instead.
pub(super) fn conversion(
    blocks: &mut Blocks,
    at: u64,
) -> Result<(Result<Conversion, String>, String), RecordError> {
    if at == 0 {
        return Ok((Ok(Conversion::None), String::new()));
    }
    let block = blocks.block(at, &[b"##CC"])?;
    let unit = blocks.text(block.link(1))?;
    let value = |k: usize| block.float(24 + 8 * k);
    let conversion = match block.number::<1>(0) {
        0 => Ok(Conversion::None),
        1 => Ok(Conversion::Linear([value(0), value(1)])),
        2 => Ok(Conversion::Rational(std::array::from_fn(value))),
        3 => Err("values behind the conversion by a formula".to_owned()),
        4..=6 => Err("values behind the conversion by a table".to_owned()),
        7..=10 => Err("words".to_owned()),
        other => Err(format!("values behind the unknown conversion {other}")),
    };
    Ok((conversion, unit))
}
