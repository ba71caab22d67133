//! Why a place cannot be written to.

use std::io::ErrorKind;

/// Why a result does not go where it was sent.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PlaceProblem {
    /// It is read, and may not be written.
    #[error("this is {role}, which is read here and never replaced; give another place with --output")]
    Input {
        /// What it is.
        role: String,
    },
    /// Something else stands there.
    #[error(
        "{found} stands there already, which is no {wanted}; give another place with --output, or replace it with --force"
    )]
    Foreign {
        /// What stands there, in words.
        found: String,
        /// What was to be written.
        wanted: &'static str,
    },
    /// A file with a second name.
    #[error(
        "the file there has a second name (a hard link), which would keep the old content; give another place with --output, or replace \
         it under this name alone with --force"
    )]
    Linked,
    /// A file that nobody may write to.
    #[error(
        "the file there is write-protected; give another place with --output, or replace it with --force"
    )]
    Protected,
    /// A folder.
    #[error("this is a folder; give the name of a file")]
    Folder,
}

/// Whether whoever called is at fault for what the system says about a place.
pub(crate) fn is_slip(error: &std::io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::NotADirectory
            | ErrorKind::IsADirectory
            | ErrorKind::InvalidFilename
            | ErrorKind::InvalidInput
    )
}
