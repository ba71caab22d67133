//! Settings in TOML files: read with exact places, unknown keys answered with the nearest known one.

use crate::PipelineError;
use serde::de::DeserializeOwned;
use std::path::Path;
use toml::de::{DeTable, DeValue};

/// Reads a settings file of type `T`.
///
/// # Errors
/// [`PipelineError::Config`] with file, line and column, and for an unknown key the nearest that `T` knows.
pub fn read_settings<T: DeserializeOwned>(file: &Path) -> Result<T, PipelineError> {
    let refuse = |message: String| PipelineError::Config {
        file: file.to_owned(),
        message,
    };
    let text = std::fs::read_to_string(file).map_err(|e| refuse(e.to_string()))?;
    toml::from_str(&text).map_err(|e| refuse(with_nearest(&e)))
}

/// Where a value stands, as `file:line:column`, by its keys from the outside in; the file alone where it holds no such key.
pub(crate) fn place_of(file: &Path, keys: &[&str]) -> String {
    let name = file.display().to_string();
    let at = std::fs::read_to_string(file).ok().and_then(|text| {
        let start = start_of(&text, keys)?;
        let before = &text[..start];
        let line_start = before.rfind('\n').map_or(0, |i| i + 1);
        Some((
            before.matches('\n').count() + 1,
            before[line_start..].chars().count() + 1,
        ))
    });
    match at {
        Some((line, column)) => format!("{name}:{line}:{column}"),
        None => name,
    }
}

fn start_of(text: &str, keys: &[&str]) -> Option<usize> {
    let (last, tables) = keys.split_last()?;
    let root = DeTable::parse(text).ok()?;
    let mut table = root.get_ref();
    for key in tables {
        match table.get(*key)?.get_ref() {
            DeValue::Table(inner) => table = inner,
            _ => return None,
        }
    }
    let (key, _) = table.iter().find(|(key, _)| key.get_ref() == last)?;
    Some(key.span().start)
}

/// The parser's own words with the place, and the nearest known name where one is unknown.
fn with_nearest(error: &toml::de::Error) -> String {
    let message = error.to_string();
    // serde says: unknown field `x`, expected one of `a`, `b`; the names between backquotes, the first being the unknown one.
    let unknown = ["unknown field", "unknown variant"]
        .iter()
        .any(|w| error.message().starts_with(w));
    let mut names = error.message().split('`').skip(1).step_by(2);
    let nearest = names
        .next()
        .filter(|_| unknown)
        .and_then(|unknown| nearest_name(unknown, names));
    match nearest {
        Some(name) => format!("{}\nnearest: `{name}`", message.trim_end()),
        None => message.trim_end().to_owned(),
    }
}

/// The known name that a slip of the keyboard could have meant.
pub fn nearest_name<'a>(unknown: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    /// Letters that are compared: nobody reads longer names.
    const LETTERS: usize = 64;
    let cut = |name: &str| -> Vec<char> { name.chars().take(LETTERS).collect() };
    let limit = (unknown.chars().count() / 2).max(2);
    let unknown = cut(&unknown.to_lowercase());
    known
        .map(|name| {
            (
                strsim::generic_damerau_levenshtein(&unknown, &cut(&name.to_lowercase())),
                name,
            )
        })
        .filter(|(distance, _)| *distance <= limit)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, name)| name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_key_is_named_with_its_place() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("identify.toml");
        std::fs::write(&file, "order = 8\nfunctons = 16\n").unwrap();
        let text = read_settings::<crate::IdentifyConfig>(&file)
            .unwrap_err()
            .to_string();
        for part in [
            "identify.toml",
            "line 2, column 1",
            "`functons`",
            "nearest: `functions`",
        ] {
            assert!(text.contains(part), "{part} in {text}");
        }
    }
}
