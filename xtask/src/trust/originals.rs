//! The folders in which the kinds were first met, where they stand beside the project: a look at what they say today.

use super::judge::Judged;
use super::program::Lab;
use super::{Case, TaskError};
use crate::root;
use std::path::Path;

/// One case a folder of `../shared/cases` that holds a bundle or a record; none where that is missing.
pub(crate) fn cases() -> Vec<Case> {
    let folder = root().join("../shared/cases");
    let Ok(entries) = std::fs::read_dir(&folder) else {
        println!("skipped: there is no ../shared/cases beside the project");
        return Vec::new();
    };
    let mut all = Vec::new();
    for entry in entries.flatten() {
        let path = entry.path();
        let name = entry.file_name().to_string_lossy().into_owned();
        let mut bundles = Vec::new();
        if path.join("experiment.toml").is_file() {
            bundles.push(path.clone());
        }
        let inside = std::fs::read_dir(&path).into_iter().flatten().flatten();
        bundles.extend(
            inside
                .map(|e| e.path())
                .filter(|p| p.join("experiment.toml").is_file()),
        );
        bundles.sort();
        for (i, bundle) in bundles.into_iter().enumerate() {
            all.push(Case::new("originals", &name, i as u64, move |_, lab| {
                said(lab, &bundle)
            }));
        }
    }
    all
}

/// What `identify` says first. There is no truth here: a good word without a reason is what is counted.
fn said(lab: &Lab, bundle: &Path) -> Result<Judged, TaskError> {
    let place = bundle.display().to_string();
    let said = lab.run(&["identify", &place, "-o", "m.json"])?;
    let worth = super::program::worth(&lab.json("m.json"));
    let doubtful = said.code != Some(0) || !["", "good"].contains(&worth.as_str());
    let name = bundle
        .file_name()
        .map(|n| n.to_string_lossy().into_owned())
        .unwrap_or_default();
    Ok(Judged::new(
        said.is_orderly() && doubtful,
        &said,
        &format!("lpv identify {name} -o m.json"),
        "see its README",
    ))
}
