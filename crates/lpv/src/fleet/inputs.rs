//! What a row was made from, in one number, and where it goes.

use super::Task;
use crate::PipelineError;
use crate::encode::word;
use experiment_data::Bundle;
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// A number of what was read (FNV-1a of 64 bits): it guards against data that were changed, not against somebody who means harm.
struct Print(u64);

impl Print {
    fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    fn bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    /// A text, with its end.
    fn text(&mut self, text: &str) {
        self.bytes(text.as_bytes());
        self.bytes(&[0xff]);
    }

    fn file(&mut self, file: &Path) -> io::Result<()> {
        /// Read at a time.
        const BLOCK: usize = 1 << 20;
        let mut open = File::open(file)?;
        let mut block = vec![0; BLOCK];
        let mut length = 0_u64;
        loop {
            match open.read(&mut block)? {
                0 => break,
                n => {
                    self.bytes(&block[..n]);
                    length += n as u64;
                }
            }
        }
        self.bytes(&length.to_le_bytes());
        Ok(())
    }
}

/// The version of the library, the task with its settings, the description and all records.
///
/// # Errors
/// A bundle that cannot be opened, a file that cannot be read.
pub(super) fn fingerprint(path: &Path, task: &Task) -> Result<String, PipelineError> {
    let mut print = Print::new();
    let take = |print: &mut Print, file: &Path| {
        print.file(file).map_err(|e| PipelineError::RecordFile {
            file: file.to_owned(),
            problem: e.to_string(),
        })
    };
    print.text(env!("CARGO_PKG_VERSION"));
    print.text(task.name());
    match task {
        Task::Diagnose { model, effects } => {
            for (what, file) in [("model", model), ("effects", effects)] {
                if let Some(file) = file {
                    print.text(what);
                    take(&mut print, file)?;
                }
            }
        }
        Task::Identify(config) => print.text(&serde_json::to_string(config)?),
    }
    let bundle = Bundle::open(path)?;
    take(&mut print, bundle.description_file())?;
    for index in 0..bundle.len() {
        take(&mut print, &bundle.record_path(index)?)?;
    }
    Ok(format!("{:016x}", print.0))
}

/// Name of the folder of a bundle: that of its own folder, and eight digits of the whole path as it was given, so that two bundles of one
/// name do not meet.
pub(super) fn folder_name(path: &Path) -> String {
    let mut print = Print::new();
    print.text(&path.to_string_lossy());
    // Of its experiment.toml that of the folder.
    let own = if path.extension().is_some_and(|e| e == "toml") {
        path.parent()
    } else {
        Some(path)
    };
    let name = own
        .and_then(Path::file_name)
        .unwrap_or_default()
        .to_string_lossy();
    format!("{}-{:08x}", word(&name), print.0 >> 32)
}
