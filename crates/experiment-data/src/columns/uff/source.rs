//! A universal file by lines and by ranges: what is not asked for is passed over on disk.

use crate::RecordError;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek};
use std::ops::Range;
use std::path::Path;

/// Bytes of a line that are kept: the format has 80.
const MOST_LINE: usize = 4096;

/// Bytes that are read at a time.
const BLOCK: usize = 1 << 18;

pub(super) struct Source<R> {
    reader: BufReader<R>,
    at: u64,
    bytes: u64,
}

impl Source<File> {
    pub(super) fn open(path: &Path) -> Result<Self, RecordError> {
        let file = File::open(path).map_err(RecordError::io("read"))?;
        Self::new(file)
    }
}

impl<R: Read + Seek> Source<R> {
    pub(super) fn new(mut reader: R) -> Result<Self, RecordError> {
        let all = reader.seek(std::io::SeekFrom::End(0));
        let bytes = all.and_then(|all| reader.rewind().map(|()| all));
        Ok(Self {
            reader: BufReader::with_capacity(BLOCK, reader),
            at: 0,
            bytes: bytes.map_err(RecordError::io("read"))?,
        })
    }

    /// Its length.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Where the next line begins.
    pub(super) fn at(&self) -> u64 {
        self.at
    }

    pub(super) fn go_to(&mut self, at: u64) -> Result<(), RecordError> {
        let at = at.min(self.bytes);
        // A file has fewer bytes than half of what the number holds.
        let by = at as i64 - self.at as i64;
        self.reader.seek_relative(by).map_err(RecordError::io("read"))?;
        self.at = at;
        Ok(())
    }

    /// The next line without its end; none at the end of the file.
    pub(super) fn next_line(&mut self) -> Result<Option<Vec<u8>>, RecordError> {
        let mut line = Vec::new();
        Ok(self.pass_line(&mut line)?.then_some(line))
    }

    /// The next line without its end into a buffer; whether there was one.
    fn pass_line(&mut self, line: &mut Vec<u8>) -> Result<bool, RecordError> {
        line.clear();
        let start = self.at;
        loop {
            let window = self.reader.fill_buf().map_err(RecordError::io("read"))?;
            if window.is_empty() {
                break;
            }
            let end = memchr::memchr(b'\n', window);
            let passed = end.map_or(window.len(), |at| at + 1);
            let kept = end.unwrap_or(window.len()).min(MOST_LINE - line.len());
            line.extend_from_slice(&window[..kept]);
            self.reader.consume(passed);
            self.at += passed as u64;
            if end.is_some() {
                break;
            }
        }
        if line.last() == Some(&b'\r') {
            line.pop();
        }
        Ok(self.at > start)
    }

    /// Passes the line with the next mark; where it begins, or the end of the file.
    pub(super) fn skip_to_mark(&mut self) -> Result<u64, RecordError> {
        let mut line = Vec::new();
        loop {
            let start = self.at;
            if !self.pass_line(&mut line)? {
                return Ok(self.bytes);
            }
            if is_mark(&line) {
                return Ok(start);
            }
        }
    }

    /// Whether a set may end here: a mark follows, or the end of the file. The place afterwards is somewhere else.
    pub(super) fn ends_at(&mut self, at: u64) -> Result<bool, RecordError> {
        if at > self.bytes {
            return Ok(false);
        }
        self.go_to(at)?;
        let mut line = Vec::new();
        // The values may have a line end behind them.
        let has_line = self.pass_line(&mut line)?;
        if has_line && line.is_empty() && self.at - at <= 2 {
            self.pass_line(&mut line)?;
        }
        Ok(self.at == at || is_mark(&line) || line.is_empty() && self.at == self.bytes)
    }

    /// The bytes of a range, piece by piece; pieces but the last have a multiple of `unit` bytes.
    pub(super) fn pieces(
        &mut self,
        range: Range<u64>,
        unit: usize,
        mut take: impl FnMut(&[u8]),
    ) -> Result<(), RecordError> {
        self.go_to(range.start)?;
        let most = (BLOCK / unit).max(1) * unit;
        let mut piece = vec![0; most.min((range.end - range.start) as usize)];
        while self.at < range.end {
            let part = &mut piece[..most.min((range.end - self.at) as usize)];
            self.reader.read_exact(part).map_err(RecordError::io("read"))?;
            self.at += part.len() as u64;
            take(part);
        }
        Ok(())
    }
}

fn is_mark(line: &[u8]) -> bool {
    line.trim_ascii() == b"-1"
}

#[cfg(test)]
mod tests {
    use super::Source;
    use std::io::Cursor;

    #[test]
    fn lines_ranges_and_ends() {
        let text = b"one\r\n\n    -1\r\n58b\n\x01\x02\n\x03-1\n    -1\nlast".to_vec();
        let mut source = Source::new(Cursor::new(text.clone())).unwrap();
        assert_eq!(source.next_line().unwrap().unwrap(), b"one");
        assert_eq!(source.next_line().unwrap().unwrap(), b"");
        assert_eq!(source.skip_to_mark().unwrap(), 6);
        assert_eq!(source.next_line().unwrap().unwrap(), b"58b");
        let start = source.at();
        let ends: Vec<u64> = (start..=start + 8)
            .filter(|at| source.ends_at(*at).unwrap())
            .collect();
        // Behind the last value, and in the line end that follows it and in the blanks of the mark.
        assert_eq!(ends.first(), Some(&(start + 4)), "{ends:?}");
        assert!(source.ends_at(text.len() as u64).unwrap());
        assert!(!source.ends_at(text.len() as u64 + 1).unwrap());
        let mut found = Vec::new();
        source
            .pieces(start..start + 4, 2, |piece| found.extend_from_slice(piece))
            .unwrap();
        assert_eq!(found, b"\x01\x02\n\x03");
        source.go_to(text.len() as u64 - 4).unwrap();
        assert_eq!(source.next_line().unwrap().unwrap(), b"last");
        assert_eq!(source.next_line().unwrap(), None);
    }
}
