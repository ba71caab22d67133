//! The text of a description, and the names of its records.

use crate::description::Description;
use crate::{DataError, toml_file};
use std::collections::HashMap;
use std::io::Read;
use std::path::Path;

/// Bytes of the longest description: some hundred thousand records.
const LONGEST: u64 = 1 << 25;

pub(super) fn read_text(file: &Path) -> Result<String, DataError> {
    let mut bytes = Vec::new();
    let source = std::fs::File::open(file).map_err(DataError::io("open", file))?;
    let mut source = source.take(LONGEST + 1);
    source
        .read_to_end(&mut bytes)
        .map_err(DataError::io("read", file))?;
    let refused = |(line, column): (usize, usize), message: &str| DataError::Toml {
        file: file.to_owned(),
        line,
        column,
        message: message.to_owned(),
    };
    if bytes.len() as u64 > LONGEST {
        return Err(refused(
            (1, 1),
            "the text is longer than 32 MiB, which no description is",
        ));
    }
    String::from_utf8(bytes).map_err(|e| {
        let valid = String::from_utf8_lossy(&e.as_bytes()[..e.utf8_error().valid_up_to()]).into_owned();
        refused(toml_file::position(&valid, valid.len()), "the text is not UTF-8")
    })
}

/// Short names where they are unique, the files otherwise, with a number behind those of one file.
pub(super) fn record_names(description: &Description) -> Vec<String> {
    let short = |file: &str| {
        let path = Path::new(file).with_extension("");
        let path = path.strip_prefix("records").unwrap_or(&path);
        path.to_string_lossy().into_owned()
    };
    let names: Vec<String> = description.records.iter().map(|e| short(&e.file)).collect();
    let mut times: HashMap<&str, usize> = HashMap::new();
    for name in &names {
        *times.entry(name).or_default() += 1;
    }
    let unique = |n: &String| !n.is_empty() && times.get(n.as_str()) == Some(&1);
    let mut of_file: HashMap<&str, usize> = HashMap::new();
    for entry in &description.records {
        *of_file.entry(entry.file.as_str()).or_default() += 1;
    }
    let mut seen: HashMap<&str, usize> = HashMap::new();
    names
        .iter()
        .zip(&description.records)
        .map(|(n, entry)| match of_file.get(entry.file.as_str()) {
            _ if unique(n) => n.clone(),
            Some(1) => entry.file.clone(),
            _ => {
                let number = seen.entry(entry.file.as_str()).or_default();
                *number += 1;
                format!("{} #{number}", entry.file)
            }
        })
        .collect()
}
