//! Data elements: a tag (type, length), the bytes, padding to 8.

use crate::columns::number::{Class, Number};
use std::io::{self, Read};

pub(super) const MATRIX: u32 = 14;
pub(super) const COMPRESSED: u32 = 15;

/// Type and length of an element.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tag {
    pub(super) kind: u32,
    pub(super) bytes: u32,
    /// A small element keeps its up to four bytes in the tag itself.
    small: Option<[u8; 4]>,
}

/// A damaged place, in words.
#[derive(Debug)]
pub(super) struct Damage(pub(super) String);

impl From<&str> for Damage {
    fn from(text: &str) -> Self {
        Self(text.to_owned())
    }
}

impl From<io::Error> for Damage {
    fn from(e: io::Error) -> Self {
        match e.kind() {
            io::ErrorKind::UnexpectedEof => Self("it ends in the middle of an element".to_owned()),
            _ => Self(format!("it cannot be read or unpacked: {e}")),
        }
    }
}

/// Elements one after another, never beyond `left` bytes.
pub(super) struct Elements<R> {
    source: R,
    big_endian: bool,
    left: u64,
}

impl<R: Read> Elements<R> {
    pub(super) fn new(source: R, big_endian: bool, left: u64) -> Self {
        Self {
            source,
            big_endian,
            left,
        }
    }

    /// Bytes that may still be read.
    pub(super) fn left(&self) -> u64 {
        self.left
    }

    pub(super) fn into_source(self) -> R {
        self.source
    }

    pub(super) fn tag(&mut self) -> Result<Tag, Damage> {
        let mut raw = [0; 8];
        self.exact(&mut raw)?;
        let (a, b) = raw.split_at(4);
        let first = self.u32(a);
        if first >> 16 == 0 {
            return Ok(Tag {
                kind: first,
                bytes: self.u32(b),
                small: None,
            });
        }
        let bytes = first >> 16;
        if bytes > 4 {
            return Err("a small element longer than four bytes".into());
        }
        Ok(Tag {
            kind: first & 0xffff,
            bytes,
            small: Some([b[0], b[1], b[2], b[3]]),
        })
    }

    /// The bytes of an element that describes an array: names and sizes, never long.
    pub(super) fn data(&mut self, tag: Tag) -> Result<Vec<u8>, Damage> {
        const LONGEST: u32 = 1 << 20;
        if tag.bytes > LONGEST {
            return Err(Damage(format!(
                "an element of {} bytes where a name or a size is due",
                tag.bytes
            )));
        }
        if let Some(small) = tag.small {
            return Ok(small[..tag.bytes as usize].to_vec());
        }
        let bytes = u64::from(tag.bytes);
        self.claim(bytes)?;
        let mut data = Vec::new();
        (&mut self.source).take(bytes).read_to_end(&mut data)?;
        if data.len() as u64 != bytes {
            return Err("it ends in the middle of an element".into());
        }
        self.pad(tag)?;
        Ok(data)
    }

    /// Characters, which are stored as numbers of one or two bytes.
    pub(super) fn text(&mut self, tag: Tag) -> Result<String, Damage> {
        let data = self.data(tag)?;
        let big_endian = self.big_endian;
        let text = match tag.kind {
            3 | 4 | 17 => {
                let unit = |c: &[u8]| match big_endian {
                    true => u16::from_be_bytes([c[0], c[1]]),
                    false => u16::from_le_bytes([c[0], c[1]]),
                };
                String::from_utf16_lossy(&data.chunks_exact(2).map(unit).collect::<Vec<_>>())
            }
            _ => String::from_utf8_lossy(&data).into_owned(),
        };
        Ok(text.trim_end_matches('\0').to_owned())
    }

    /// Passes over an element.
    pub(super) fn skip(&mut self, tag: Tag) -> Result<(), Damage> {
        if tag.small.is_none() {
            self.skip_bytes(u64::from(tag.bytes))?;
            self.pad(tag)?;
        }
        Ok(())
    }

    /// Limits reading to the inside of an element; gives back what [`Self::leave`] needs.
    pub(super) fn enter(&mut self, tag: Tag) -> Result<u64, Damage> {
        let bytes = if tag.small.is_some() {
            0
        } else {
            u64::from(tag.bytes)
        };
        self.claim(bytes)?;
        let outside = self.left;
        self.left = bytes;
        Ok(outside)
    }

    /// Passes over what is left inside and opens the outside again.
    pub(super) fn leave(&mut self, outside: u64) -> Result<(), Damage> {
        self.skip_bytes(self.left)?;
        self.left = outside;
        Ok(())
    }

    /// Passes over the rest, and reads on to the end of a compressed stream so that its checksum is compared.
    pub(super) fn finish(&mut self) -> Result<(), Damage> {
        self.skip_bytes(self.left)?;
        io::copy(&mut (&mut self.source).take(64), &mut io::sink())?;
        Ok(())
    }

    /// Passes over bytes.
    pub(super) fn skip_bytes(&mut self, bytes: u64) -> Result<(), Damage> {
        self.claim(bytes)?;
        let skipped = io::copy(&mut (&mut self.source).take(bytes), &mut io::sink())?;
        if skipped == bytes {
            Ok(())
        } else {
            Err("it ends in the middle of an element".into())
        }
    }

    /// Signed 32-bit numbers, as in dimensions.
    pub(super) fn i32s(&self, data: &[u8]) -> Vec<i32> {
        data.chunks_exact(4).map(|c| self.u32(c) as i32).collect()
    }

    /// Numbers of any stored type, as many as the dimensions say.
    pub(super) fn numbers(&mut self, tag: Tag, length: u64) -> Result<Vec<f64>, Damage> {
        let (class, size) = match tag.kind {
            1 => (Class::Signed, 1),
            2 => (Class::Unsigned, 1),
            3 => (Class::Signed, 2),
            4 => (Class::Unsigned, 2),
            5 => (Class::Signed, 4),
            6 => (Class::Unsigned, 4),
            7 => (Class::Float, 4),
            9 => (Class::Float, 8),
            12 => (Class::Signed, 8),
            13 => (Class::Unsigned, 8),
            _ => return Err("numbers of no known type".into()),
        };
        let number = Number {
            class,
            size,
            big_endian: self.big_endian,
        };
        let bytes = u64::from(tag.bytes);
        if length.checked_mul(size as u64) != Some(bytes) {
            let text = format!("dimensions for {length} numbers of {size} bytes, but {bytes} bytes of them");
            return Err(Damage(text));
        }
        if let Some(small) = tag.small {
            return Ok(number.column(&mut &small[..], length)?);
        }
        self.claim(bytes)?;
        let column = number.column(&mut self.source, length)?;
        if column.len() as u64 != length {
            return Err("it ends in the middle of an element".into());
        }
        self.pad(tag)?;
        Ok(column)
    }

    fn pad(&mut self, tag: Tag) -> Result<(), Damage> {
        let padding = (8 - tag.bytes % 8) % 8;
        // Some writers leave the padding of the last element out.
        let padding = u64::from(padding).min(self.left);
        self.skip_bytes(padding)
    }

    fn exact(&mut self, out: &mut [u8]) -> Result<(), Damage> {
        self.claim(out.len() as u64)?;
        Ok(self.source.read_exact(out)?)
    }

    fn claim(&mut self, bytes: u64) -> Result<(), Damage> {
        self.left = self.left.checked_sub(bytes).ok_or_else(|| {
            Damage(format!(
                "an element claims {bytes} bytes, {} are left of the one around it",
                self.left
            ))
        })?;
        Ok(())
    }

    pub(super) fn u32(&self, b: &[u8]) -> u32 {
        let b = [b[0], b[1], b[2], b[3]];
        if self.big_endian {
            u32::from_be_bytes(b)
        } else {
            u32::from_le_bytes(b)
        }
    }
}
