//! The files of a diagnosis: `diagnosis.json`, `diagnosis.html`, and `model.json`.

use super::Diagnosed;
use crate::PipelineError;
use crate::output::{Inputs, Kind, Overwrite, Place, write_all};
use experiment_data::Bundle;
use std::path::{Path, PathBuf};

/// Where a diagnosis will be written.
#[derive(Debug)]
pub struct ResultFiles {
    account: Place,
    page: Place,
    model: Place,
    model_file: PathBuf,
}

impl ResultFiles {
    /// Looks whether the files may and can be written in a folder, which is made with them.
    ///
    /// # Errors
    /// [`PipelineError::NoFolder`] for a file; those of [`Place::check`].
    pub fn check(folder: &Path, inputs: &Inputs, overwrite: Overwrite) -> Result<Self, PipelineError> {
        if folder.exists() && !folder.is_dir() {
            return Err(PipelineError::NoFolder {
                place: folder.to_owned(),
            });
        }
        let place = |name: &str, kind| Place::check(&folder.join(name), kind, inputs, overwrite);
        Ok(Self {
            account: place("diagnosis.json", Kind::Diagnosis)?,
            page: place("diagnosis.html", Kind::Page)?,
            model: place("model.json", Kind::DiagnosedModel)?,
            model_file: folder.join("model.json"),
        })
    }

    /// Writes all of them, or leaves what was there.
    ///
    /// # Errors
    /// [`PipelineError::Write`].
    pub fn write(&self, found: &Diagnosed, bundle: &Bundle) -> Result<(), PipelineError> {
        let account = serde_json::to_string_pretty(&found.diagnosis)?;
        let page = found.page().to_html()?;
        let model = found.model_file(bundle, &self.model_file)?.to_json()?;
        write_all(&[
            (&self.account, account.as_bytes()),
            (&self.page, page.as_bytes()),
            (&self.model, model.as_bytes()),
        ])
    }
}
