//! A file for an archive that may not be completed.

use std::fs::File;
use std::io::{self, ErrorKind, Seek, SeekFrom, Write};

/// Tells its first error and takes everything after it: an archive that is dropped half written completes itself, and complains to
/// standard error where it cannot.
pub(super) struct Quiet {
    file: File,
    /// Where the next byte goes, or would go if there had been no error: positions go on growing, as what was begun counts on it.
    at: u64,
    is_lost: bool,
}

impl Quiet {
    /// A file at its beginning.
    pub(super) fn new(file: File) -> Self {
        Self {
            file,
            at: 0,
            is_lost: false,
        }
    }

    pub(super) fn into_inner(self) -> File {
        self.file
    }

    fn keep<T>(&mut self, result: io::Result<T>) -> io::Result<T> {
        if result.as_ref().is_err_and(|e| e.kind() != ErrorKind::Interrupted) {
            self.is_lost = true;
        }
        result
    }
}

impl Write for Quiet {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let taken = if self.is_lost {
            bytes.len()
        } else {
            let result = self.file.write(bytes);
            self.keep(result)?
        };
        self.at += taken as u64;
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        if self.is_lost {
            return Ok(());
        }
        let result = self.file.flush();
        self.keep(result)
    }
}

impl Seek for Quiet {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.at = match (self.is_lost, to) {
            (false, _) => {
                let result = self.file.seek(to);
                self.keep(result)?
            }
            (true, SeekFrom::Start(start)) => start,
            (true, SeekFrom::Current(by) | SeekFrom::End(by)) => self.at.saturating_add_signed(by),
        };
        Ok(self.at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn only_the_first_error_is_told() {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let mut quiet = Quiet::new(full);
        let before = quiet.stream_position().unwrap();
        let error = quiet.write(b"abc").unwrap_err();
        assert_eq!(error.kind(), ErrorKind::StorageFull);
        assert_eq!(quiet.stream_position().unwrap(), before);
        assert_eq!(quiet.write(b"abc").unwrap(), 3);
        assert_eq!(quiet.seek(SeekFrom::Start(10)).unwrap(), 10);
        assert_eq!(quiet.write(b"abc").unwrap(), 3);
        assert_eq!(quiet.stream_position().unwrap(), 13);
        quiet.flush().unwrap();
    }
}
