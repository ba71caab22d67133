//! Record files stay inside the bundle.

use crate::DescriptionError;
use crate::nearest::nearest;
use std::path::{Component, Path, PathBuf};

/// A record file.
pub(crate) struct Resolved {
    /// Below the folder as it was given.
    pub(crate) path: PathBuf,
    /// After following links.
    pub(crate) real: PathBuf,
}

/// The record file, if it is a regular file inside `folder`, which is `root` after following links.
pub(crate) fn resolve(folder: &Path, root: &Path, file: &str) -> Result<Resolved, DescriptionError> {
    let relative = inside(file)?;
    let path = folder.join(&relative);
    let missing = || DescriptionError::FileMissing {
        file: file.to_owned(),
        nearest: neighbours(&path),
    };
    let Ok(real) = path.canonicalize() else {
        return Err(missing());
    };
    if !real.starts_with(root) {
        return Err(outside(file, "a link leads out of the folder"));
    }
    if real.is_file() {
        Ok(Resolved { path, real })
    } else {
        Err(missing())
    }
}

/// The path without `.` parts, refused where it could leave the folder.
pub(crate) fn inside(file: &str) -> Result<PathBuf, DescriptionError> {
    let mut clean = PathBuf::new();
    for component in Path::new(file).components() {
        match component {
            Component::Normal(part) => clean.push(part),
            Component::CurDir => {}
            Component::ParentDir => return Err(outside(file, "it contains `..`")),
            Component::RootDir | Component::Prefix(_) => return Err(outside(file, "it is absolute")),
        }
    }
    Ok(clean)
}

fn outside(file: &str, reason: &'static str) -> DescriptionError {
    DescriptionError::Outside {
        file: file.to_owned(),
        reason,
    }
}

/// Files of the same folder with a similar name.
fn neighbours(path: &Path) -> Vec<String> {
    let (Some(folder), Some(name)) = (path.parent(), path.file_name()) else {
        return Vec::new();
    };
    let Ok(entries) = std::fs::read_dir(folder) else {
        return Vec::new();
    };
    let mut names: Vec<String> = entries
        .take(10_000)
        .flatten()
        .filter(|e| e.file_type().is_ok_and(|t| t.is_file()))
        .map(|e| e.file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    nearest(&name.to_string_lossy(), &names)
}
