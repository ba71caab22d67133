//! A file as blocks of whole lines, so that a file of any size needs little memory.

use super::malformed;
use crate::RecordError;
use memchr::{memchr, memchr_iter, memmem, memrchr};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Bytes read at once: they stay in the cache of a core until they are parsed. The tests want many borders.
const BLOCK: usize = if cfg!(test) { 16 } else { 1 << 18 };
/// No row of a table is longer.
const LONGEST_ROW: usize = 1 << 24;
const MARK: &[u8] = b"\xef\xbb\xbf";

/// The file, the bytes that are read but not used yet, and their place.
pub(super) struct Blocks {
    file: File,
    /// Not used yet are `bytes[..filled]`.
    bytes: Vec<u8>,
    filled: usize,
    /// Of these, the whole lines.
    whole: usize,
    ended: bool,
    /// Line of the first byte, from 1.
    pub(super) line: u64,
}

impl Blocks {
    pub(super) fn open(path: &Path) -> Result<Self, RecordError> {
        let mut blocks = Self {
            file: File::open(path).map_err(RecordError::io("open"))?,
            bytes: vec![0; BLOCK],
            filled: 0,
            whole: 0,
            ended: false,
            line: 1,
        };
        blocks.read_on()?;
        let start = &blocks.bytes[..blocks.filled];
        if start.starts_with(b"\xff\xfe") || start.starts_with(b"\xfe\xff") {
            return Err(malformed(1, "the text is UTF-16; save it as UTF-8"));
        }
        let mark = if start.starts_with(MARK) { MARK.len() } else { 0 };
        blocks.advance(mark);
        blocks.check_from(0)?;
        Ok(blocks)
    }

    /// Whole lines that are not used yet.
    pub(super) fn lines(&self) -> &[u8] {
        &self.bytes[..self.whole]
    }

    /// Whether the file has nothing behind [`Self::lines`].
    pub(super) fn ended(&self) -> bool {
        self.ended
    }

    /// Gives bytes up that have been used.
    pub(super) fn advance(&mut self, used: usize) {
        self.bytes.copy_within(used..self.filled, 0);
        self.filled -= used;
        self.whole = self.whole.saturating_sub(used);
    }

    /// Reads at least one line more, unless the file ends.
    pub(super) fn more(&mut self) -> Result<(), RecordError> {
        let before = self.filled;
        self.read_on()?;
        // A mark may lie across the border.
        self.check_from(before.saturating_sub(MARK.len() - 1))
    }

    fn read_on(&mut self) -> Result<(), RecordError> {
        let had = self.whole;
        loop {
            if self.filled == self.bytes.len() {
                if self.filled >= LONGEST_ROW {
                    let problem = "a row of more than 16 MiB; is a quotation mark never closed?";
                    return Err(malformed(self.line, problem));
                }
                self.bytes.resize(2 * self.filled, 0);
            }
            while self.filled < self.bytes.len() && !self.ended {
                let room = &mut self.bytes[self.filled..];
                match self.file.read(room) {
                    Ok(0) => self.ended = true,
                    Ok(count) => self.filled += count,
                    Err(e) if e.kind() == std::io::ErrorKind::Interrupted => {}
                    Err(e) => return Err(RecordError::io("read")(e)),
                }
            }
            if self.ended {
                self.close_last_line();
                return Ok(());
            }
            let filled = &self.bytes[..self.filled];
            // Lines may end with a carriage return alone; the last byte may be half of a longer ending.
            self.whole = match memrchr(b'\n', filled) {
                Some(at) => at + 1,
                None => memrchr(b'\r', &filled[..filled.len() - 1]).map_or(0, |at| at + 1),
            };
            if self.whole > had {
                return Ok(());
            }
        }
    }

    fn close_last_line(&mut self) {
        if self.filled > 0 && self.bytes[self.filled - 1] != b'\n' {
            self.bytes.truncate(self.filled);
            self.bytes.push(b'\n');
            self.filled += 1;
        }
        self.whole = self.filled;
    }

    /// Refuses what no table of numbers contains.
    fn check_from(&self, from: usize) -> Result<(), RecordError> {
        let new = &self.bytes[from..self.filled];
        let found = if let Some(at) = memchr(0, new) {
            Some((
                at,
                "a NUL byte: the file is binary or UTF-16; save it as UTF-8 text",
            ))
        } else if memchr(MARK[0], new).is_some() {
            memmem::find(new, MARK)
                .map(|at| (at, "a byte order mark inside the text: two files glued together?"))
        } else {
            None
        };
        match found {
            None => Ok(()),
            Some((at, problem)) => {
                let above = memchr_iter(b'\n', &self.bytes[..from + at]).count();
                Err(malformed(self.line + above as u64, problem))
            }
        }
    }
}
