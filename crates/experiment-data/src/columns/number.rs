//! Real numbers as files store them.

use std::io::{self, Read};

/// Class of a stored number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Class {
    /// IEEE 754 of 2, 4 or 8 bytes.
    Float,
    Signed,
    Unsigned,
    /// Anything but zero is one.
    Logical,
}

/// A number of at most 8 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Number {
    pub(crate) class: Class,
    /// Bytes.
    pub(crate) size: usize,
    pub(crate) big_endian: bool,
}

impl Number {
    /// The value; 64-bit integers beyond 2^53 are rounded.
    pub(crate) fn value(self, bytes: &[u8]) -> f64 {
        let mut le = [0u8; 8];
        for (i, b) in bytes.iter().take(self.size).enumerate() {
            le[if self.big_endian { self.size - 1 - i } else { i }] = *b;
        }
        let bits = u64::from_le_bytes(le);
        let shift = 64 - 8 * self.size as u32;
        match (self.class, self.size) {
            (Class::Float, 8) => f64::from_bits(bits),
            (Class::Float, 4) => f64::from(f32::from_bits(bits as u32)),
            (Class::Float, _) => half(bits as u16),
            (Class::Signed, _) => (((bits << shift) as i64) >> shift) as f64,
            (Class::Unsigned, _) => bits as f64,
            (Class::Logical, _) => f64::from(u8::from(bits != 0)),
        }
    }

    /// The next `length` numbers, or fewer if the source ends. The column grows with what arrives, so a false length
    /// costs nothing.
    pub(crate) fn column(self, source: &mut impl Read, length: u64) -> io::Result<Vec<f64>> {
        const BLOCK: usize = 1 << 16;
        let mut column = Vec::new();
        let mut block = Vec::with_capacity(BLOCK);
        while (column.len() as u64) < length {
            let count = (length - column.len() as u64).min((BLOCK / self.size) as u64);
            block.clear();
            source.take(count * self.size as u64).read_to_end(&mut block)?;
            let numbers = block.chunks_exact(self.size);
            if self == DOUBLE {
                column.extend(numbers.map(|c| f64::from_le_bytes(std::array::from_fn(|i| c[i]))));
            } else {
                column.extend(numbers.map(|c| self.value(c)));
            }
            if (block.len() as u64) < count * self.size as u64 {
                break;
            }
        }
        Ok(column)
    }
}

/// What most files hold.
pub(crate) const DOUBLE: Number = Number {
    class: Class::Float,
    size: 8,
    big_endian: false,
};

/// IEEE 754 binary16.
pub(crate) fn half(bits: u16) -> f64 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    sign * match exponent {
        0 => fraction * 2f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1024.0 + fraction) * 2f64.powi(exponent - 25),
    }
}

/// Bytes that deflate can make of one: no stream unpacks to more, so a larger claim is false.
pub(crate) const DEFLATE_RATIO: u64 = 1032;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_by_hand() {
        let number = |class, size, big_endian| Number {
            class,
            size,
            big_endian,
        };
        let read = |n: Number, bytes: &[u8], length| n.column(&mut &bytes[..], length).unwrap();
        let double = [1.5f64, -2.0].map(f64::to_le_bytes).concat();
        assert_eq!(read(DOUBLE, &double, 2), [1.5, -2.0]);
        assert_eq!(read(DOUBLE, &double, 1), [1.5]);
        assert_eq!(read(DOUBLE, &double[..15], u64::MAX), [1.5]);
        let big = number(Class::Signed, 2, true);
        assert_eq!(read(big, &[0xff, 0xfe, 1, 0], 2), [-2.0, 256.0]);
        assert_eq!(
            read(number(Class::Unsigned, 1, false), &[200; 100_000], 100_000),
            [200.0; 100_000]
        );
        assert_eq!(read(number(Class::Logical, 1, false), &[0, 7], 2), [0.0, 1.0]);
    }
}
