//! Settings in TOML files: read with exact places, unknown keys answered with the nearest known one.

use crate::PipelineError;
use serde::de::DeserializeOwned;
use std::path::Path;

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
    let limit = (unknown.chars().count() / 2).max(2);
    known
        .map(|name| (strsim::damerau_levenshtein(unknown, name), name))
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
