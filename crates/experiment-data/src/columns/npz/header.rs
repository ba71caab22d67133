//! The header of a `.npy` array and its numbers (NumPy enhancement proposal 1).

use std::io::Read;

/// `{'descr': '<f8', 'fortran_order': False, 'shape': (N,), }`. The order does not matter for a vector.
#[derive(Debug, PartialEq)]
pub(super) struct Header {
    pub(super) descr: String,
    pub(super) shape: Vec<u64>,
}

impl Header {
    pub(super) fn read(source: &mut impl Read) -> Result<Self, &'static str> {
        const LONGEST: u32 = 1 << 16;
        let mut start = [0; 8];
        source
            .read_exact(&mut start)
            .map_err(|_| "it ends inside the array header")?;
        if &start[..6] != b"\x93NUMPY" {
            return Err("it does not start like a NumPy array");
        }
        let wide = match start[6] {
            1 => false,
            2 | 3 => true,
            _ => return Err("an array format version that is not 1, 2 or 3"),
        };
        let mut length = [0; 4];
        source
            .read_exact(&mut length[..if wide { 4 } else { 2 }])
            .map_err(|_| "it ends inside the array header")?;
        let length = u32::from_le_bytes(length);
        if length > LONGEST {
            return Err("an array header longer than that of any vector");
        }
        let mut text = Vec::new();
        source
            .take(u64::from(length))
            .read_to_end(&mut text)
            .map_err(|_| "it ends inside the array header")?;
        if text.len() as u64 != u64::from(length) {
            return Err("it ends inside the array header");
        }
        let text = std::str::from_utf8(&text).map_err(|_| "an array header that is no text")?;
        Self::parse(text).ok_or("an array header that cannot be understood")
    }

    fn parse(text: &str) -> Option<Self> {
        let after = |key: &str| {
            let at = text.find(&format!("'{key}'"))?;
            text[at + key.len() + 2..]
                .trim_start()
                .strip_prefix(':')
                .map(str::trim_start)
        };
        let descr = after("descr")?;
        // A list is a structured type; its text serves the message.
        let descr = match descr.strip_prefix('\'') {
            Some(rest) => rest[..rest.find('\'')?].to_owned(),
            None => descr.chars().take(40).collect(),
        };
        let shape = after("shape")?.strip_prefix('(')?;
        let shape = shape[..shape.find(')')?]
            .split(',')
            .map(str::trim)
            .filter(|n| !n.is_empty())
            .map(|n| n.trim_end_matches('L').parse().ok())
            .collect::<Option<_>>()?;
        Some(Self { descr, shape })
    }
}

/// A real number type: byte order, letter, size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Kind {
    big_endian: bool,
    letter: u8,
    pub(super) size: usize,
}

impl Kind {
    /// None for complex numbers, texts, objects, dates and structures.
    pub(super) fn of(descr: &str) -> Option<Self> {
        let [order, letter, size @ ..] = descr.as_bytes() else {
            return None;
        };
        let size: usize = std::str::from_utf8(size).ok()?.parse().ok()?;
        let known = match letter {
            b'f' => matches!(size, 2 | 4 | 8),
            b'i' | b'u' => matches!(size, 1 | 2 | 4 | 8),
            b'b' => size == 1,
            _ => false,
        };
        let big_endian = match order {
            b'<' | b'|' => false,
            b'>' => true,
            b'=' => cfg!(target_endian = "big"),
            _ => return None,
        };
        known.then_some(Self {
            big_endian,
            letter: *letter,
            size,
        })
    }

    /// The number; 64-bit integers beyond 2^53 are rounded.
    pub(super) fn value(self, bytes: &[u8]) -> f64 {
        let mut le = [0u8; 8];
        for (i, b) in bytes.iter().take(self.size).enumerate() {
            le[if self.big_endian { self.size - 1 - i } else { i }] = *b;
        }
        let bits = u64::from_le_bytes(le);
        let shift = 64 - 8 * self.size as u32;
        match (self.letter, self.size) {
            (b'f', 8) => f64::from_bits(bits),
            (b'f', 4) => f64::from(f32::from_bits(bits as u32)),
            (b'f', _) => half(bits as u16),
            (b'i', _) => (((bits << shift) as i64) >> shift) as f64,
            (b'b', _) => f64::from(u8::from(bits != 0)),
            _ => bits as f64,
        }
    }
}

/// IEEE 754 binary16.
fn half(bits: u16) -> f64 {
    let sign = if bits >> 15 == 1 { -1.0 } else { 1.0 };
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    sign * match exponent {
        0 => fraction * 2f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1024.0 + fraction) * 2f64.powi(exponent - 25),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_by_hand() {
        let value = |descr: &str, bytes: &[u8]| Kind::of(descr).unwrap().value(bytes);
        assert_eq!(value("<i2", &[0xfe, 0xff]), -2.0);
        assert_eq!(value(">i2", &[0xff, 0xfe]), -2.0);
        assert_eq!(value("|u1", &[200]), 200.0);
        assert_eq!(value("|i1", &[200]), -56.0);
        assert_eq!(value("|b1", &[1]), 1.0);
        assert_eq!(value(">f4", &1.5f32.to_be_bytes()), 1.5);
        assert_eq!(value("<f2", &[0x00, 0x3c]), 1.0);
        assert_eq!(value("<f2", &[0x01, 0x80]), -(2f64.powi(-24)));
        assert_eq!(value("<f2", &[0xff, 0x7b]), 65504.0);
        assert_eq!(value("<u8", &u64::MAX.to_le_bytes()), 2f64.powi(64));
        assert_eq!(value("<i8", &(-3i64).to_le_bytes()), -3.0);
        for descr in [
            "<c16",
            "|O",
            "<U3",
            "<f16",
            "",
            "<",
            "<f",
            "<i3",
            "<fé",
            "[('a', '<f8')]",
        ] {
            assert_eq!(Kind::of(descr), None, "{descr}");
        }
    }

    #[test]
    fn headers_by_hand() {
        let parse = |shape: &str| {
            Header::parse(&format!(
                "{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}"
            ))
        };
        assert_eq!(parse("(3,)").unwrap().shape, [3]);
        assert_eq!(parse("(3, 1)").unwrap().shape, [3, 1]);
        assert_eq!(parse("()").unwrap().shape, [0u64; 0]);
        assert_eq!(parse("(-3,)"), None);
        assert_eq!(parse("(99999999999999999999,)"), None);
        assert_eq!(Header::parse("{'shape': (3,)}"), None);
        assert_eq!(parse("3").map(|h| h.shape), None);
    }
}
