//! The file that `identify` writes: the model, and where it comes from.

use crate::diagnose::Explanation;
use crate::{FrozenDeviation, IdentifyConfig, Outcome, PipelineError, Stages, Summary};
use experiment_data::Bundle;
use lpv_core::Model;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A model and, where this program made it, the account of its identification.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelFile {
    /// The model.
    pub model: Model,
    /// How it was made; none for a model from elsewhere.
    pub identification: Option<Identification>,
    /// The machine behind it, from first principles or with effects; none of a plain model.
    pub explanation: Option<Explanation>,
}

/// How a model was made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Identification {
    /// The command that wrote it; empty in files of older versions.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub written_by: String,
    /// Name of the bundle.
    pub bundle: String,
    /// The bundle's folder, relative to the model file where both are on one tree.
    #[serde(with = "path")]
    pub folder: PathBuf,
    /// Names of the outputs.
    pub outputs: Vec<String>,
    /// Names of the inputs.
    pub inputs: Vec<String>,
    /// The settings that were asked for.
    pub config: IdentifyConfig,
    /// What came out.
    pub summary: Summary,
    /// Sample time of the records, which a continuous model does not hold; none in files of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sample_time: Option<f64>,
    /// How well the frozen response is known, sampled at that time; only of a small LFR from responses of known noise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frozen_deviation: Option<FrozenDeviation>,
}

/// Who writes models of bundles.
const IDENTIFY: &str = "lpv identify";

/// Who adds effects to them.
pub(crate) const DIAGNOSE: &str = "lpv diagnose";

const KEY: &str = "identification";

const EXPLANATION: &str = "explanation";

impl ModelFile {
    /// What [`crate::identify_bundle`] made of a bundle, for the file `output`.
    ///
    /// # Errors
    /// None for a bundle that could be identified.
    pub fn of(
        outcome: Outcome,
        bundle: &Bundle,
        config: IdentifyConfig,
        output: &Path,
    ) -> Result<Self, PipelineError> {
        let description = bundle.description();
        Ok(Self {
            explanation: outcome.explanation,
            model: outcome.model,
            identification: Some(Identification {
                written_by: match outcome.stages {
                    Stages::Diagnosis => DIAGNOSE.to_owned(),
                    _ => IDENTIFY.to_owned(),
                },
                bundle: description.name.clone(),
                folder: relative_folder(bundle.folder(), output),
                outputs: description.channels.output.columns.clone(),
                inputs: description.channels.input.columns.clone(),
                config,
                summary: outcome.summary,
                sample_time: Some(bundle.clock()?.sample_time()),
                frozen_deviation: outcome.deviation,
            }),
        })
    }

    /// Reads a model in the JSON format of lpv-core; the account is read if it is there.
    ///
    /// # Errors
    /// [`PipelineError::Model`] with the file, the line and the column.
    pub fn read(file: &Path) -> Result<Self, PipelineError> {
        let refuse = |problem: String| PipelineError::Model {
            file: file.to_owned(),
            problem,
        };
        let text = std::fs::read_to_string(file).map_err(|e| {
            refuse(format!(
                "cannot be read: {e}; give the model.json that `lpv identify` or `lpv diagnose` wrote"
            ))
        })?;
        let model = Model::from_json(&text).map_err(|e| refuse(e.to_string()))?;
        let whole: serde_json::Value = serde_json::from_str(&text).map_err(|e| refuse(e.to_string()))?;
        Ok(Self {
            model,
            identification: part(&whole, KEY).map_err(refuse)?,
            explanation: part(&whole, EXPLANATION).map_err(refuse)?,
        })
    }

    /// The text of the file.
    ///
    /// # Errors
    /// [`PipelineError::Core`] if the serialiser fails, which finite numbers do not make it do.
    pub fn to_json(&self) -> Result<String, PipelineError> {
        let text = self.model.to_json()?;
        if self.identification.is_none() && self.explanation.is_none() {
            return Ok(text + "\n");
        }
        let mut whole: serde_json::Value = serde_json::from_str(&text)?;
        if let Some(identification) = &self.identification {
            whole[KEY] = serde_json::to_value(identification)?;
        }
        if let Some(explanation) = &self.explanation {
            whole[EXPLANATION] = serde_json::to_value(explanation)?;
        }
        Ok(serde_json::to_string_pretty(&whole)? + "\n")
    }
}

/// An optional part of a file.
fn part<T: DeserializeOwned>(whole: &serde_json::Value, key: &str) -> Result<Option<T>, String> {
    let read = |part: &serde_json::Value| {
        serde_json::from_value(part.clone())
            .map_err(|e| format!("`{key}`: {e}; delete that part to use the model alone"))
    };
    whole
        .get(key)
        .filter(|part| !part.is_null())
        .map(read)
        .transpose()
}

/// `folder` as seen from the folder of `file`, so that both can be moved together; absolute where they share nothing.
pub fn relative_folder(folder: &Path, file: &Path) -> PathBuf {
    let absolute = |p: &Path| std::path::absolute(p).unwrap_or_else(|_| p.to_owned());
    let folder = folder.canonicalize().unwrap_or_else(|_| absolute(folder));
    let base = absolute(file);
    let base = base.parent().unwrap_or(Path::new("/"));
    let base = base.canonicalize().unwrap_or_else(|_| base.to_owned());
    let common = folder
        .components()
        .zip(base.components())
        .take_while(|(a, b)| a == b)
        .count();
    if common <= 1 {
        return folder;
    }
    let up = base
        .components()
        .skip(common)
        .map(|_| std::path::Component::ParentDir);
    let path: PathBuf = up.chain(folder.components().skip(common)).collect();
    if path.as_os_str().is_empty() {
        PathBuf::from(".")
    } else {
        path
    }
}

/// Paths in JSON: text, or a list of bytes where a path is none.
pub(crate) mod path {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};
    use std::path::{Path, PathBuf};

    #[derive(Serialize, Deserialize)]
    #[serde(untagged)]
    enum Written {
        Text(String),
        Bytes(Vec<u8>),
    }

    fn written(path: &Path) -> Written {
        #[cfg(unix)]
        if path.to_str().is_none() {
            let bytes = std::os::unix::ffi::OsStrExt::as_bytes(path.as_os_str());
            return Written::Bytes(bytes.to_vec());
        }
        Written::Text(path.to_string_lossy().into_owned())
    }

    pub(crate) fn serialize<S: Serializer>(path: &Path, to: S) -> Result<S::Ok, S::Error> {
        written(path).serialize(to)
    }

    pub(crate) fn deserialize<'a, D: Deserializer<'a>>(from: D) -> Result<PathBuf, D::Error> {
        Ok(match Written::deserialize(from)? {
            Written::Text(text) => PathBuf::from(text),
            #[cfg(unix)]
            Written::Bytes(bytes) => PathBuf::from(
                <std::ffi::OsString as std::os::unix::ffi::OsStringExt>::from_vec(bytes),
            ),
            #[cfg(not(unix))]
            Written::Bytes(bytes) => PathBuf::from(String::from_utf8_lossy(&bytes).into_owned()),
        })
    }
}
