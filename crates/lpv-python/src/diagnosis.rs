//! What a model lacks.

use crate::bundle::Bundle;
use crate::commands::account;
use crate::error::to_python;
use crate::model::Model;
use crate::worker;
use lpv::PipelineError;
use lpv::diagnose::Diagnosed;
use lpv::output::{Inputs, Kind, Overwrite, Place, write_all};
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A diagnosis with the bundle that it was made from.
#[pyclass(frozen, module = "lpvident._lpvident")]
pub(crate) struct Diagnosis {
    found: Diagnosed,
    bundle: Arc<lpv::experiment_data::Bundle>,
}

/// Finds the effects that a model of the bundle's machine lacks.
#[pyfunction]
pub(crate) fn diagnose(
    py: Python<'_>,
    bundle: &Bundle,
    model: Option<&Model>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Diagnosis> {
    let (inner, file) = (Arc::clone(&bundle.inner), model.map(|m| Arc::clone(&m.file)));
    let found = worker::run(py, progress.as_ref(), move |tell| {
        lpv::diagnose::diagnose(&inner, file.as_deref(), tell).map_err(|e| e.at(inner.folder()))
    })?;
    Ok(Diagnosis {
        found,
        bundle: Arc::clone(&bundle.inner),
    })
}

#[pymethods]
impl Diagnosis {
    /// The account as the file diagnosis.json holds it, and in words.
    fn account(&self, py: Python<'_>) -> PyResult<(String, String)> {
        account(py, &self.found.diagnosis, &self.found.diagnosis.text())
    }

    /// The page.
    fn html(&self, py: Python<'_>) -> PyResult<String> {
        let page = py.detach(|| self.found.page().to_html());
        page.map_err(|e| to_python(py, &e.into()))
    }

    /// The model with the effects.
    fn model(&self, py: Python<'_>) -> PyResult<Model> {
        let file = self.found.model_file(&self.bundle, Path::new("model.json"));
        let file = file.map_err(|e| to_python(py, &e))?;
        Ok(Model::new(file, self.bundle.folder()))
    }

    /// Writes diagnosis.json, diagnosis.html and model.json.
    fn save(&self, py: Python<'_>, folder: PathBuf, overwrite: bool) -> PyResult<()> {
        py.detach(|| self.write(&folder, overwrite))
            .map_err(|e| to_python(py, &e))
    }
}

impl Diagnosis {
    fn write(&self, folder: &Path, overwrite: bool) -> Result<(), PipelineError> {
        if folder.exists() && !folder.is_dir() {
            return Err(PipelineError::NoFolder {
                place: folder.to_owned(),
            });
        }
        let replace = match overwrite {
            true => Overwrite::Replace,
            false => Overwrite::Refuse,
        };
        let inputs = Inputs::none().bundle(&self.bundle);
        let place = |name: &str, kind| Place::check(&folder.join(name), kind, &inputs, replace);
        let places = [
            place("diagnosis.json", Kind::Diagnosis)?,
            place("diagnosis.html", Kind::Page)?,
            place("model.json", Kind::DiagnosedModel)?,
        ];
        let texts = [
            serde_json::to_string_pretty(&self.found.diagnosis)?,
            self.found.page().to_html()?,
            self.found
                .model_file(&self.bundle, &folder.join("model.json"))?
                .to_json()?,
        ];
        let results: Vec<(&Place, &[u8])> = places.iter().zip(texts.iter().map(String::as_bytes)).collect();
        write_all(&results)
    }
}
