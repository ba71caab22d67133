//! The header of a `.npy` array and its numbers (NumPy enhancement proposal 1).

use crate::columns::number::{Class, Number};
use std::io::Read;

/// `{'descr': '<f8', 'fortran_order': False, 'shape': (N,), }`. The order does not matter for a vector.
#[derive(Debug, PartialEq)]
pub(super) struct Header {
    pub(super) descr: String,
    pub(super) shape: Vec<u64>,
    /// Whether the first index is the fastest.
    pub(super) first_fastest: bool,
    /// Bytes in front of the numbers.
    pub(super) length: u64,
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
        let mut header = Self::parse(text).ok_or("an array header that cannot be understood")?;
        header.length = 8 + if wide { 4 } else { 2 } + u64::from(length);
        Ok(header)
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
        Some(Self {
            descr,
            shape,
            first_fastest: after("fortran_order")?.starts_with("True"),
            length: 0,
        })
    }
}

/// The number of a dtype; none for complex numbers, texts, objects, dates and structures.
pub(super) fn number(descr: &str) -> Option<Number> {
    let [order, letter, size @ ..] = descr.as_bytes() else {
        return None;
    };
    let size: usize = std::str::from_utf8(size).ok()?.parse().ok()?;
    let (class, sizes): (_, &[usize]) = match letter {
        b'f' => (Class::Float, &[2, 4, 8]),
        b'i' => (Class::Signed, &[1, 2, 4, 8]),
        b'u' => (Class::Unsigned, &[1, 2, 4, 8]),
        b'b' => (Class::Logical, &[1]),
        _ => return None,
    };
    let big_endian = match order {
        b'<' | b'|' => false,
        b'>' => true,
        b'=' => cfg!(target_endian = "big"),
        _ => return None,
    };
    sizes.contains(&size).then_some(Number {
        class,
        size,
        big_endian,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_by_hand() {
        let value = |descr: &str, bytes: &[u8]| number(descr).unwrap().value(bytes);
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
            assert_eq!(number(descr), None, "{descr}");
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
