//! The licences of all that is linked into the program, as they ask to be passed on with it.

use super::output;
use crate::TaskError;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// How the names of files with licences begin.
const NAMES: [&str; 4] = ["licen", "copying", "notice", "unlicense"];

/// All texts, each once, below the crates that it is of.
pub(super) fn notices(target: &str) -> Result<String, TaskError> {
    let words = [
        "metadata",
        "--offline",
        "--format-version",
        "1",
        "--filter-platform",
        target,
    ];
    let about: Value = serde_json::from_slice(&output(Path::new("cargo"), &words)?)?;
    let packages = about["packages"]
        .as_array()
        .ok_or("cargo metadata lists no packages")?;
    let linked = linked(&about)?;
    let mut texts: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut silent = Vec::new();
    for package in packages {
        let text = |key: &str| package[key].as_str().unwrap_or_default();
        // Those without a source are our own.
        if package["source"].is_null() || !linked.contains(text("id")) {
            continue;
        }
        let name = format!("{} {} ({})", text("name"), text("version"), text("license"));
        let folder = Path::new(text("manifest_path")).parent().unwrap_or(Path::new(""));
        let found = of_folder(folder)?;
        if found.is_empty() {
            silent.push(name.clone());
        }
        for licence in found {
            texts.entry(licence).or_default().push(name.clone());
        }
    }
    let mut out = "What is linked into lpv, and under which licences.\n".to_owned();
    for (text, names) in &texts {
        out += &format!("\n{}\n{}\n\n{text}\n", "=".repeat(72), names.join("\n"));
    }
    if !silent.is_empty() {
        out += &format!(
            "\n{}\nWithout a text of their own:\n{}\n",
            "=".repeat(72),
            silent.join("\n")
        );
    }
    Ok(out)
}

/// Ids of the packages that the program is linked from: what lpv-cli needs, without what only builds or tests need.
fn linked(about: &Value) -> Result<BTreeSet<&str>, TaskError> {
    let nodes = about["resolve"]["nodes"]
        .as_array()
        .ok_or("cargo metadata resolves nothing")?;
    let by_id: BTreeMap<&str, &Value> = nodes
        .iter()
        .filter_map(|n| Some((n["id"].as_str()?, n)))
        .collect();
    let is_program = |p: &&Value| p["name"] == "lpv-cli";
    let program = about["packages"]
        .as_array()
        .and_then(|all| all.iter().find(is_program));
    let mut open = vec![
        program
            .and_then(|p| p["id"].as_str())
            .ok_or("there is no package lpv-cli")?,
    ];
    let mut found = BTreeSet::new();
    while let Some(id) = open.pop() {
        if !found.insert(id) {
            continue;
        }
        let needs = by_id.get(id).and_then(|node| node["deps"].as_array());
        for need in needs.into_iter().flatten() {
            let kinds = need["dep_kinds"].as_array();
            if kinds.is_some_and(|all| all.iter().any(|k| k["kind"].is_null())) {
                open.extend(need["pkg"].as_str());
            }
        }
    }
    Ok(found)
}

/// The licences in the folder of a package, and the texts beside its fonts, in the order of their names.
fn of_folder(folder: &Path) -> Result<Vec<String>, TaskError> {
    let begins = |name: &str| NAMES.iter().any(|begin| name.starts_with(begin));
    let is_text = |name: &str| name.ends_with(".txt");
    let mut files = listed(folder, &begins)?;
    files.extend(listed(&folder.join("fonts"), &is_text)?);
    let text = |file: &PathBuf| {
        let bytes = std::fs::read(file)?;
        Ok(String::from_utf8_lossy(&bytes).trim().replace('\r', ""))
    };
    files.iter().map(text).collect()
}

/// Files by their names in small letters; none of a folder that is not there.
fn listed(folder: &Path, wanted: &dyn Fn(&str) -> bool) -> Result<Vec<PathBuf>, TaskError> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten() {
        let path = entry?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if path.is_file() && wanted(&name.to_lowercase()) {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_linked_is_named() {
        let dep = |id: &str, kind: Value| serde_json::json!({ "pkg": id, "dep_kinds": [{ "kind": kind }] });
        let about = serde_json::json!({
            "packages": [{ "name": "lpv-cli", "id": "cli" }],
            "resolve": { "nodes": [
                { "id": "cli", "deps": [dep("a", Value::Null), dep("test", "dev".into())] },
                { "id": "a", "deps": [dep("b", Value::Null), dep("build", "build".into())] },
                { "id": "b", "deps": [dep("a", Value::Null)] },
                { "id": "test", "deps": [] },
                { "id": "build", "deps": [] },
            ] },
        });
        let found: Vec<&str> = linked(&about).unwrap().into_iter().collect();
        assert_eq!(found, ["a", "b", "cli"]);
    }
}
