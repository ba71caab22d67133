//! What can be wrong with a bundle. The fields carry the facts; the text says where, what, and what to do.

mod description;
mod record;
mod response;

pub use description::DescriptionError;
pub use record::RecordError;
pub use response::ResponseFault;

use std::fmt;
use std::path::PathBuf;

/// Every refusal of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DataError {
    /// The system refused a file operation.
    #[error("cannot {action} `{}`: {source}", path.display())]
    Io {
        /// The operation.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A folder without a description.
    #[error("`{}` holds no experiment.toml; give a bundle folder or the path of its experiment.toml", folder.display())]
    NotABundle {
        /// The folder.
        folder: PathBuf,
    },
    /// Text that is no TOML, or a value of the wrong type.
    #[error("{}:{line}:{column}: {message}", file.display())]
    Toml {
        /// The description file.
        file: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Column in characters, from 1.
        column: usize,
        /// What the parser said.
        message: String,
    },
    /// A description that parses and still cannot be true.
    #[error("{place}: {problem}")]
    Description {
        /// Where.
        place: Box<Place>,
        /// What.
        problem: Box<DescriptionError>,
    },
    /// A record whose file or samples break the format.
    #[error("{place}: {problem}")]
    Record {
        /// Which record.
        place: Box<RecordPlace>,
        /// What.
        problem: Box<RecordError>,
    },
    /// A record that the bundle does not have.
    #[error("record {index} asked for, but the bundle has {records} records, counted from 0")]
    Index {
        /// The index asked for.
        index: usize,
        /// Records in the bundle.
        records: usize,
    },
    /// Something is there already and is never overwritten.
    #[error("`{}` exists; bundles are never overwritten: choose another folder or record name", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// A record name that is no safe file name.
    #[error(
        "record name `{name}`: use letters, digits, `_`, `-` and `.` (not in front), with `/` between folders"
    )]
    RecordName {
        /// The name.
        name: String,
    },
    /// A refusal of `lpv-core`.
    #[error(transparent)]
    Core(#[from] lpv_core::CoreError),
}

impl DataError {
    /// Whether the machine is at fault and not what it was given: a file cannot be written, or a disk fails.
    pub fn is_of_the_machine(&self) -> bool {
        use std::io::ErrorKind;
        let (action, source) = match self {
            Self::Io { action, source, .. } => (*action, source),
            Self::Record { problem, .. } => match &**problem {
                RecordError::Io { action, source } => (*action, source),
                _ => return false,
            },
            _ => return false,
        };
        let is_read = matches!(action, "open" | "read");
        match source.kind() {
            ErrorKind::NotADirectory
            | ErrorKind::IsADirectory
            | ErrorKind::InvalidFilename
            | ErrorKind::AlreadyExists => false,
            ErrorKind::NotFound | ErrorKind::PermissionDenied => !is_read,
            // What a reader says about the content is no word of the system.
            _ => !is_read || source.raw_os_error().is_some(),
        }
    }

    pub(crate) fn io(action: &'static str, path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { action, path, source }
    }
}

/// A value of the description: key, and file position where there is a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// The description file; the folder to be, for a description that is still to be written.
    pub file: PathBuf,
    /// Line and column, both from 1, columns in characters.
    pub position: Option<(usize, usize)>,
    /// The key, such as `records[3].period` (indices from 0).
    pub key: String,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if let Some((line, column)) = self.position {
            write!(f, ":{line}:{column}")?;
        }
        if self.key.is_empty() {
            Ok(())
        } else {
            write!(f, ": {}", self.key)
        }
    }
}

/// A record of the bundle.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordPlace {
    /// Index in the description, from 0.
    pub index: usize,
    /// The record file.
    pub file: PathBuf,
}

impl fmt::Display for RecordPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} (records[{}])", self.file.display(), self.index)
    }
}
