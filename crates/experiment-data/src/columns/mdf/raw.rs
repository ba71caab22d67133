//! One value of a record.

use crate::columns::number::{Class, DOUBLE, Number};

/// Where a record has a value, and how it is stored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Raw {
    /// Whole bytes.
    Bytes { offset: usize, number: Number },
    /// Some bits of at most eight bytes.
    Bits {
        offset: usize,
        bytes: usize,
        shift: u32,
        bits: u32,
        is_signed: bool,
        big_endian: bool,
    },
    /// The number of the record, from 0; it is stored nowhere.
    Index,
}

impl Raw {
    /// From the description of a channel: the kind of its numbers, first byte, first bit in it, and number of bits.
    pub(super) fn new(
        kind: u64,
        offset: u64,
        bit: u64,
        bits: u64,
        record_bytes: u64,
    ) -> Result<Self, String> {
        let (class, big_endian) = match kind {
            0 => (Class::Unsigned, false),
            1 => (Class::Unsigned, true),
            2 => (Class::Signed, false),
            3 => (Class::Signed, true),
            4 => (Class::Float, false),
            5 => (Class::Float, true),
            6..=9 => return Err("text".to_owned()),
            15 | 16 => return Err("complex numbers".to_owned()),
            _ => return Err("bytes that are no number".to_owned()),
        };
        let bytes = (bit.saturating_add(bits)).div_ceil(8);
        let end = offset.saturating_add(bytes);
        if bits == 0 || bits > 64 || bytes > 8 || bit > 7 || end > record_bytes {
            return Err(format!(
                "values of {bits} bits from byte {offset}, in records of {record_bytes} bytes"
            ));
        }
        let offset = offset as usize;
        let is_whole = bit == 0 && matches!(bits, 8 | 16 | 32 | 64);
        match class {
            Class::Float if !is_whole || bits == 8 => Err(format!("floats of {bits} bits")),
            _ if is_whole => Ok(Self::Bytes {
                offset,
                number: Number {
                    class,
                    size: bytes as usize,
                    big_endian,
                },
            }),
            _ => Ok(Self::Bits {
                offset,
                bytes: bytes as usize,
                shift: bit as u32,
                bits: bits as u32,
                is_signed: class == Class::Signed,
                big_endian,
            }),
        }
    }

    /// The first byte of a little-endian double, where it is one.
    pub(super) fn double(self) -> Option<usize> {
        match self {
            Self::Bytes { offset, number } if number == DOUBLE => Some(offset),
            _ => None,
        }
    }

    /// The value in a record, which has as many bytes as [`Raw::new`] was told.
    pub(super) fn value(self, record: &[u8], index: u64) -> f64 {
        match self {
            Self::Index => index as f64,
            Self::Bytes { offset, number } => number.value(&record[offset..offset + number.size]),
            Self::Bits {
                offset,
                bytes,
                shift,
                bits,
                is_signed,
                big_endian,
            } => {
                let mut le = [0; 8];
                for (k, byte) in record[offset..offset + bytes].iter().enumerate() {
                    le[if big_endian { bytes - 1 - k } else { k }] = *byte;
                }
                let above = 64 - bits;
                let value = (u64::from_le_bytes(le) >> shift) << above;
                if is_signed {
                    ((value as i64) >> above) as f64
                } else {
                    (value >> above) as f64
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_by_hand() {
        let record = [0b1011_0110, 0b0000_0001, 0xff, 0, 0, 0, 0, 0xc0];
        let value =
            |kind, offset, bit, bits| Raw::new(kind, offset, bit, bits, 8).map(|r| r.value(&record, 7));
        assert_eq!(value(0, 0, 1, 3), Ok(3.0));
        assert_eq!(value(2, 0, 4, 4), Ok(-5.0));
        assert_eq!(value(0, 0, 4, 8), Ok(f64::from(0b0001_1011)));
        assert_eq!(value(1, 0, 0, 12), Ok(f64::from(0b0110_0000_0001)));
        assert_eq!(value(2, 2, 0, 8), Ok(-1.0));
        assert_eq!(value(4, 4, 0, 32), Ok(-2.0));
        for (kind, offset, bit, bits) in [
            (0, 8, 0, 8),
            (0, 0, 0, 0),
            (0, 0, 8, 1),
            (4, 0, 0, 24),
            (6, 0, 0, 8),
            (0, u64::MAX, 0, 64),
        ] {
            assert!(value(kind, offset, bit, bits).is_err());
        }
        assert_eq!(Raw::Index.value(&[], 7), 7.0);
    }
}
