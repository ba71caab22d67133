//! The files of a draft.

use super::refuse;
use crate::PipelineError;
use experiment_data::{Contents, RecordFormat, look_into};
use std::path::{Path, PathBuf};

/// The files as they were named and where they are: those that are held out belong to the bundle, named among the others or not. A folder
/// stands for the record files in it.
pub(super) fn files(
    named: &[PathBuf],
    held_out: &[PathBuf],
) -> Result<(Vec<PathBuf>, Vec<PathBuf>), PipelineError> {
    let place = |file: &PathBuf| file.canonicalize().map_err(|e| refuse(file, e.to_string()));
    let (mut files, mut paths) = (Vec::new(), Vec::new());
    let mut all = Vec::new();
    for file in named {
        match file.is_dir() {
            true => all.extend(records_in(file)?),
            false => all.push(file.clone()),
        }
    }
    for file in all {
        let path = place(&file)?;
        if paths.contains(&path) {
            return Err(refuse(&file, "this file is given twice".to_owned()));
        }
        files.push(file);
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

/// Names, without their ends, of text files that are for people.
const FOR_PEOPLE: [&str; 3] = ["readme", "license", "licence"];

/// The files of a folder that end as records do, by name, as a shell lists them, without those for people.
fn records_in(folder: &Path) -> Result<Vec<PathBuf>, PipelineError> {
    let read = |e: std::io::Error| refuse(folder, e.to_string());
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(read)? {
        let path = entry.map_err(read)?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let is_for_people = FOR_PEOPLE
            .iter()
            .any(|stem| name.eq_ignore_ascii_case(&format!("{stem}.txt")));
        if path.is_file() && !name.starts_with('.') && !is_for_people && RecordFormat::of(&name).is_ok() {
            found.push(path);
        }
    }
    if found.is_empty() {
        let problem =
            "this folder has no record files; name those of the folders in it, as in `lpv new FOLDER/*.csv`";
        return Err(refuse(folder, problem.to_owned()));
    }
    found.sort();
    Ok(found)
}

/// What is in the files, some of which were named, or held out, and the others found in a folder.
pub(super) fn contents(
    [named, held_out]: [&[PathBuf]; 2],
    files: &[PathBuf],
    paths: &[PathBuf],
) -> Result<Vec<Contents>, PipelineError> {
    let look = |(file, path): (&PathBuf, &PathBuf)| {
        look_into(path).map_err(|e| match named.contains(file) || held_out.contains(file) {
            true => refuse(file, e.to_string()),
            false => refuse(
                file,
                format!("{e}; where it is no record, name the record files in the place of their folder"),
            ),
        })
    };
    files.iter().zip(paths).map(look).collect()
}

/// Why a file cannot be a record.
pub(super) const UNNAMEABLE: &str =
    "the name is no UTF-8 text, so an experiment.toml, which is, cannot name it; rename the file";

/// A file as the description names it: relative to the folder, with forward slashes; none for a name that is no text.
pub(super) fn name_of(path: &Path, folder: &Path) -> Option<String> {
    let name = path.strip_prefix(folder).unwrap_or(path).to_str()?;
    Some(match std::path::MAIN_SEPARATOR {
        '/' => name.to_owned(),
        other => name.replace(other, "/"),
    })
}

/// The deepest folder that holds all files.
pub(super) fn common_folder(paths: &[PathBuf]) -> Option<PathBuf> {
    let mut folder = paths.first()?.parent()?.to_owned();
    while !paths.iter().all(|p| p.starts_with(&folder)) {
        folder = folder.parent()?.to_owned();
    }
    // Records often stand in a folder of their own below the bundle.
    if folder.file_name().is_some_and(|n| n == "records") {
        folder = folder.parent()?.to_owned();
    }
    Some(folder)
}
