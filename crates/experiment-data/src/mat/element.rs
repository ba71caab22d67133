//! Data elements: a tag (type, length), the bytes, padding to 8.

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

    /// The bytes of an element. The buffer grows with what arrives, so a false length costs nothing.
    pub(super) fn data(&mut self, tag: Tag) -> Result<Vec<u8>, Damage> {
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

    /// Numbers of any stored type; none if the type is not numeric or the length does not fit.
    pub(super) fn numbers(&self, kind: u32, data: &[u8]) -> Option<Vec<f64>> {
        let size: usize = match kind {
            1 | 2 => 1,
            3 | 4 => 2,
            5..=7 => 4,
            9 | 12 | 13 => 8,
            _ => return None,
        };
        if !data.len().is_multiple_of(size) {
            return None;
        }
        let shift = 64 - 8 * size as u32;
        let one = |c: &[u8]| {
            let mut le = [0u8; 8];
            for (i, b) in c.iter().enumerate() {
                le[if self.big_endian { size - 1 - i } else { i }] = *b;
            }
            let bits = u64::from_le_bytes(le);
            match kind {
                7 => f64::from(f32::from_bits(bits as u32)),
                9 => f64::from_bits(bits),
                1 | 3 | 5 | 12 => (((bits << shift) as i64) >> shift) as f64,
                _ => bits as f64,
            }
        };
        Some(data.chunks_exact(size).map(one).collect())
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
