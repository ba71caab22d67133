//! A small correct bundle that tests damage.
#![allow(dead_code, unreachable_pub, clippy::unwrap_used)]

use experiment_data::{Bundle, DataError};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

pub use crate::broken::small::*;

pub struct Small {
    pub dir: TempDir,
}

impl Small {
    pub fn new() -> Self {
        let small = Self {
            dir: tempfile::tempdir().unwrap(),
        };
        write(small.path());
        small
    }
    pub fn path(&self) -> &Path {
        self.dir.path()
    }
    pub fn put(&self, file: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path().join(file);
        std::fs::write(&path, content).unwrap();
        path
    }
    /// The description with one text replaced, which must be there.
    pub fn edit(&self, from: &str, to: &str) {
        assert!(TOML.contains(from), "{from}");
        self.put("experiment.toml", TOML.replacen(from, to, 1));
    }
    pub fn open(&self) -> Result<Bundle, DataError> {
        Bundle::open(self.path())
    }
}
