//! Blocks: an identifier, links to other blocks, and data.

use super::malformed;
use crate::RecordError;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// Bytes in front of the links.
const HEAD: u64 = 24;
/// Bytes of data that are read of a block of the description; of blocks of values, what says how they are packed.
const MOST_DATA: u64 = 1 << 16;
const OF_VALUES: u64 = 24;
/// Links of one block.
const MOST_LINKS: u64 = 1 << 20;

/// A block of the description.
#[derive(Debug)]
pub(super) struct Block {
    pub(super) id: [u8; 4],
    pub(super) links: Vec<u64>,
    pub(super) data: Vec<u8>,
    /// Where its data begin in the file, and how many bytes they have.
    pub(super) data_at: u64,
    pub(super) data_bytes: u64,
}

impl Block {
    pub(super) fn link(&self, k: usize) -> u64 {
        self.links.get(k).copied().unwrap_or(0)
    }

    /// A number of its data, or zero behind their end.
    pub(super) fn number<const N: usize>(&self, at: usize) -> u64 {
        let mut bytes = [0; 8];
        for (b, d) in bytes.iter_mut().zip(self.data.iter().skip(at).take(N)) {
            *b = *d;
        }
        u64::from_le_bytes(bytes)
    }

    pub(super) fn float(&self, at: usize) -> f64 {
        f64::from_bits(self.number::<8>(at))
    }
}

/// An open file.
#[derive(Debug)]
pub(super) struct Blocks {
    pub(super) file: File,
    pub(super) bytes: u64,
    /// Bytes of blocks that may still be read: each is read a few times at most.
    left: u64,
}

impl Blocks {
    /// Opens a file of version 4; where its first block is.
    pub(super) fn open(path: &Path) -> Result<(Self, u64), RecordError> {
        let file = File::open(path).map_err(RecordError::io("open"))?;
        let bytes = file.metadata().map_err(RecordError::io("open"))?.len();
        let mut blocks = Self {
            file,
            bytes,
            left: (1 << 20) + bytes.saturating_mul(64),
        };
        let start = blocks.part(0, 64)?;
        if start.starts_with(b"UnFinMF") {
            return Err(malformed(
                "",
                "it was not finished; open it in the program that wrote it and save it",
            ));
        }
        if !start.starts_with(b"MDF ") || start.len() < 64 {
            return Err(malformed("", "it does not begin like an MDF file"));
        }
        if start[8] != b'4' {
            let version = String::from_utf8_lossy(&start[8..16])
                .trim_end_matches(['\0', ' '])
                .to_owned();
            return Err(RecordError::UnsupportedFormat {
                found: format!("MDF of version {version}"),
                supported: "MDF of version 4; save it as such",
            });
        }
        Ok((blocks, 64))
    }

    /// The block at this place, which must be of one of these kinds.
    pub(super) fn block(&mut self, at: u64, kinds: &[&[u8; 4]]) -> Result<Block, RecordError> {
        let head = self.part(at, HEAD)?;
        let number = |from: usize| {
            let mut bytes = [0; 8];
            bytes.copy_from_slice(&head[from..from + 8]);
            u64::from_le_bytes(bytes)
        };
        let broken = |problem: &str| malformed("", &format!("{problem} at byte {at}"));
        if head.len() < HEAD as usize {
            return Err(broken("no block"));
        }
        let id = [head[0], head[1], head[2], head[3]];
        if !kinds.iter().any(|k| **k == id) {
            return Err(broken(&format!(
                "a block of the kind `{}` where `{}` belongs",
                id.escape_ascii(),
                kinds
                    .first()
                    .map_or(String::new(), |k| k.escape_ascii().to_string())
            )));
        }
        let (length, links) = (number(8), number(16));
        let end = at.checked_add(length).filter(|end| *end <= self.bytes);
        let data_at = links
            .checked_mul(8)
            .and_then(|l| (at + HEAD).checked_add(l))
            .filter(|d| end.is_some_and(|end| *d <= end));
        let (Some(end), Some(data_at)) = (end, data_at) else {
            return Err(broken(&format!("a block that claims {length} bytes")));
        };
        if links > MOST_LINKS {
            return Err(broken("a block of too many links"));
        }
        let most = match &id {
            b"##DT" | b"##DZ" | b"##DV" => OF_VALUES,
            _ => MOST_DATA,
        };
        let data_bytes = end - data_at;
        self.left = self
            .left
            .checked_sub(HEAD + 8 * links + data_bytes.min(most))
            .ok_or_else(|| malformed("", "its blocks refer to each other in a circle"))?;
        let links = self.part(at + HEAD, data_at - at - HEAD)?;
        let links = links
            .chunks_exact(8)
            .map(|c| u64::from_le_bytes(std::array::from_fn(|i| c[i])));
        Ok(Block {
            id,
            links: links.collect(),
            data: self.part(data_at, data_bytes.min(most))?,
            data_at,
            data_bytes,
        })
    }

    /// Bytes of the file; fewer at its end.
    pub(super) fn part(&mut self, at: u64, count: u64) -> Result<Vec<u8>, RecordError> {
        let mut part = Vec::new();
        self.file
            .seek(SeekFrom::Start(at))
            .map_err(RecordError::io("read"))?;
        (&self.file)
            .take(count)
            .read_to_end(&mut part)
            .map_err(RecordError::io("read"))?;
        Ok(part)
    }

    /// The text of a block; nothing where there is none.
    pub(super) fn text(&mut self, at: u64) -> Result<String, RecordError> {
        if at == 0 {
            return Ok(String::new());
        }
        let block = self.block(at, &[b"##TX", b"##MD"])?;
        let end = block
            .data
            .iter()
            .position(|b| *b == 0)
            .unwrap_or(block.data.len());
        let text = String::from_utf8_lossy(&block.data[..end]).into_owned();
        if block.id == *b"##TX" {
            return Ok(text.trim().to_owned());
        }
        // Of XML the first text: `<CNunit><TX>N</TX></CNunit>`.
        let inside = text.split_once("<TX>").and_then(|(_, t)| t.split_once("</TX>"));
        Ok(inside.map_or(String::new(), |(t, _)| t.trim().to_owned()))
    }
}
