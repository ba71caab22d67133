//! The files of a draft.

use super::refuse;
use crate::PipelineError;
use std::path::PathBuf;

/// The files as they were named and where they are: those that are held out belong to the bundle, named among the others or not.
pub(super) fn files(
    named: &[PathBuf],
    held_out: &[PathBuf],
) -> Result<(Vec<PathBuf>, Vec<PathBuf>), PipelineError> {
    let place = |file: &PathBuf| file.canonicalize().map_err(|e| refuse(file, e.to_string()));
    let (mut files, mut paths) = (Vec::new(), Vec::new());
    for file in named {
        let path = place(file)?;
        if paths.contains(&path) {
            return Err(refuse(file, "this file is given twice".to_owned()));
        }
        files.push(file.clone());
        paths.push(path);
    }
    for file in held_out {
        let path = place(file)?;
        if !paths.contains(&path) {
            files.push(file.clone());
            paths.push(path);
        }
    }
    Ok((files, paths))
}
