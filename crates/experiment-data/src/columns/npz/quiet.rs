//! A file for an archive that may not be completed.

use std::fs::File;
use std::io::{self, ErrorKind, Seek, SeekFrom, Write};

/// Tells its first error and takes everything after it: an archive that is dropped half written completes itself, and complains to
/// standard error where it cannot.
pub(super) struct Quiet {
    file: File,
    /// Where the next byte would go, once there was an error.
    lost: Option<u64>,
}

impl Quiet {
    pub(super) fn new(file: File) -> Self {
        Self { file, lost: None }
    }

    pub(super) fn into_inner(self) -> File {
        self.file
    }

    fn lose<T>(&mut self, error: io::Error) -> io::Result<T> {
        if error.kind() != ErrorKind::Interrupted {
            self.lost = Some(0);
        }
        Err(error)
    }
}

impl Write for Quiet {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if let Some(at) = &mut self.lost {
            *at += bytes.len() as u64;
            return Ok(bytes.len());
        }
        self.file.write(bytes).or_else(|e| self.lose(e))
    }

    fn flush(&mut self) -> io::Result<()> {
        match self.lost {
            Some(_) => Ok(()),
            None => self.file.flush().or_else(|e| self.lose(e)),
        }
    }
}

impl Seek for Quiet {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match (&mut self.lost, to) {
            (None, _) => self.file.seek(to).or_else(|e| self.lose(e)),
            (Some(at), SeekFrom::Start(start)) => {
                *at = start;
                Ok(start)
            }
            (Some(at), SeekFrom::Current(by) | SeekFrom::End(by)) => {
                *at = at.saturating_add_signed(by);
                Ok(*at)
            }
        }
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
        let error = quiet.write(b"abc").unwrap_err();
        assert_eq!(error.kind(), ErrorKind::StorageFull);
        assert_eq!(quiet.write(b"abc").unwrap(), 3);
        assert_eq!(quiet.seek(SeekFrom::Start(10)).unwrap(), 10);
        assert_eq!(quiet.write(b"abc").unwrap(), 3);
        assert_eq!(quiet.stream_position().unwrap(), 13);
        quiet.flush().unwrap();
    }
}
