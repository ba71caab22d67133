//! What is wrong with a fleet.

use std::path::PathBuf;

/// Why the bundles of a fleet are not worked on, or their rows not put together.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FleetError {
    /// A part of a list that is none.
    #[error("give the shard as k/N, such as 2/5: number k of N, from 1 to N")]
    Shard,
    /// A bundle that stands twice in the list.
    #[error("{bundle}: this bundle is named twice; name each once")]
    Twice {
        /// The bundle.
        bundle: String,
    },
    /// A folder that has rows of a list with other bundles.
    #[error(
        "{}: the list of this folder has {bundle}, which this command leaves out; give every shard the same bundles, or write to another folder",
        folder.display()
    )]
    OtherList {
        /// The folder.
        folder: PathBuf,
        /// A bundle of its list.
        bundle: String,
    },
    /// A fault of this library, in one bundle.
    #[error("this is a fault of the program; please report it with the command and the data")]
    Panic,
    /// A file that no shard wrote, or that is damaged.
    #[error("{}: {problem}; give a folder that `lpv fleet` wrote", file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// What the system or the parser says.
        problem: String,
    },
    /// Folders of different lists.
    #[error(
        "{} and {} are of different lists of bundles or of different tasks; merge shards of one list, each run with the same bundles in the same order",
        folders[0].display(), folders[1].display()
    )]
    Lists {
        /// Two of the folders.
        folders: Box<[PathBuf; 2]>,
    },
    /// Rows of one bundle that differ.
    #[error("{bundle}: its rows in {} and {} differ; run the older of both again, or leave it out", folders[0].display(), folders[1].display())]
    Rows {
        /// The bundle.
        bundle: String,
        /// Where they are.
        folders: Box<[PathBuf; 2]>,
    },
}
