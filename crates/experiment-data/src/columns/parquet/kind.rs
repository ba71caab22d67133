//! Which columns are real numbers.

use parquet::basic::{ConvertedType, LogicalType, Type};
use parquet::schema::types::ColumnDescriptor;

/// What its integers mean; of no matter to other columns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Kind {
    Signed,
    Unsigned32,
    Unsigned64,
    /// Integers over this power of ten.
    Decimal(f64),
}

impl Kind {
    /// Says what the column is if it is no list of numbers.
    pub(super) fn of(leaf: &ColumnDescriptor) -> Result<Self, &'static str> {
        if leaf.max_rep_level() > 0 {
            return Err("lists");
        }
        match leaf.logical_type_ref() {
            Some(LogicalType::Timestamp(_) | LogicalType::Time(_) | LogicalType::Date) => {
                return Err("dates or times");
            }
            Some(LogicalType::Float16) => return Ok(Self::Signed),
            _ => {}
        }
        match (leaf.physical_type(), leaf.converted_type()) {
            (
                _,
                ConvertedType::DATE
                | ConvertedType::TIME_MILLIS
                | ConvertedType::TIME_MICROS
                | ConvertedType::TIMESTAMP_MILLIS
                | ConvertedType::TIMESTAMP_MICROS,
            )
            | (Type::INT96, _) => Err("dates or times"),
            (Type::INT32 | Type::INT64, ConvertedType::DECIMAL) => {
                Ok(Self::Decimal(10f64.powi(leaf.type_scale().clamp(0, 300))))
            }
            (Type::INT32, ConvertedType::UINT_8 | ConvertedType::UINT_16 | ConvertedType::UINT_32) => {
                Ok(Self::Unsigned32)
            }
            (Type::INT64, ConvertedType::UINT_64) => Ok(Self::Unsigned64),
            (Type::BOOLEAN | Type::INT32 | Type::INT64 | Type::FLOAT | Type::DOUBLE, _) => Ok(Self::Signed),
            (Type::FIXED_LEN_BYTE_ARRAY | Type::BYTE_ARRAY, ConvertedType::DECIMAL) => {
                Err("decimals of more than 18 digits")
            }
            (Type::FIXED_LEN_BYTE_ARRAY | Type::BYTE_ARRAY, _) => Err("texts or bytes"),
        }
    }

    /// The number that a stored integer stands for; 64-bit integers beyond 2^53 are rounded.
    pub(super) fn integer(self, stored: i64) -> f64 {
        match self {
            Self::Signed => stored as f64,
            Self::Unsigned32 => f64::from(stored as u32),
            Self::Unsigned64 => stored as u64 as f64,
            Self::Decimal(unit) => stored as f64 / unit,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_by_hand() {
        assert_eq!(Kind::Signed.integer(-3), -3.0);
        assert_eq!(Kind::Unsigned32.integer(-1), 4_294_967_295.0);
        assert_eq!(Kind::Unsigned64.integer(-1), 2f64.powi(64));
        assert_eq!(Kind::Decimal(100.0).integer(-125), -1.25);
    }
}
