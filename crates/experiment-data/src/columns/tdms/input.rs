//! Numbers and texts of a segment's description, in its byte order.

use super::malformed;
use crate::RecordError;
use std::io::Read;

/// The description of one segment.
pub(super) struct Input<'a> {
    rest: &'a [u8],
    big_endian: bool,
}

/// A property of an object, as far as it is used.
pub(super) enum Property {
    Text(String),
    Number(f64),
    /// An instant, in 2^-64 s.
    Instant(i128),
    Other,
}

impl<'a> Input<'a> {
    pub(super) fn new(bytes: &'a [u8], big_endian: bool) -> Self {
        Self {
            rest: bytes,
            big_endian,
        }
    }

    pub(super) fn bytes(&mut self, count: usize) -> Result<&'a [u8], RecordError> {
        let (taken, rest) = self
            .rest
            .split_at_checked(count)
            .ok_or_else(|| malformed("", "a segment ends inside its description"))?;
        self.rest = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], RecordError> {
        let mut array = [0; N];
        // As many as were taken.
        self.bytes(N)?
            .read_exact(&mut array)
            .map_err(RecordError::io("read"))?;
        if self.big_endian {
            array.reverse();
        }
        Ok(array)
    }

    pub(super) fn u32(&mut self) -> Result<u32, RecordError> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub(super) fn u64(&mut self) -> Result<u64, RecordError> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    pub(super) fn text(&mut self) -> Result<String, RecordError> {
        let length = self.u32()? as usize;
        Ok(String::from_utf8_lossy(self.bytes(length)?).into_owned())
    }

    /// Of a property its name and value.
    pub(super) fn property(&mut self) -> Result<(String, Property), RecordError> {
        let name = self.text()?;
        let kind = self.u32()?;
        let value = match kind {
            0x20 => Property::Text(self.text()?),
            1 => Property::Number(f64::from(i8::from_le_bytes(self.array()?))),
            2 => Property::Number(f64::from(i16::from_le_bytes(self.array()?))),
            3 => Property::Number(f64::from(i32::from_le_bytes(self.array()?))),
            4 => Property::Number(i64::from_le_bytes(self.array()?) as f64),
            5 => Property::Number(f64::from(u8::from_le_bytes(self.array()?))),
            6 => Property::Number(f64::from(u16::from_le_bytes(self.array()?))),
            7 => Property::Number(f64::from(self.u32()?)),
            8 => Property::Number(self.u64()? as f64),
            9 | 0x19 => Property::Number(f64::from(f32::from_le_bytes(self.array()?))),
            10 | 0x1a => Property::Number(f64::from_le_bytes(self.array()?)),
            0x44 => Property::Instant(i128::from_le_bytes(self.array()?)),
            other => {
                let size = match other {
                    0 => 0,
                    0x21 => 1,
                    // Complex numbers, and floats of the processor.
                    0x10_000d | 11 | 0x1b => 16,
                    0x08_000c => 8,
                    _ => {
                        return Err(malformed(
                            "",
                            &format!("the property `{name}` of the unknown type {other}"),
                        ));
                    }
                };
                self.bytes(size)?;
                Property::Other
            }
        };
        Ok((name, value))
    }
}
