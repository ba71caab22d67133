//! What a model lacks.

use crate::bundle::Bundle;
use crate::error::{to_python, wrong_setting};
use crate::model::Model;
use crate::worker;
use lpv::diagnose::{Diagnosed, Given, ResultFiles, UserEffect};
use lpv::encode::for_terminal;
use lpv::output::{Inputs, Overwrite};
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A diagnosis with the bundle that it was made from.
#[pyclass(frozen, module = "lpvident._lpvident")]
pub(crate) struct Diagnosis {
    found: Diagnosed,
    bundle: Arc<lpv::experiment_data::Bundle>,
}

/// The effects of a TOML file, as JSON.
#[pyfunction]
pub(crate) fn read_effects(py: Python<'_>, path: PathBuf) -> PyResult<String> {
    let found = lpv::diagnose::read_effects(&path).map_err(|e| to_python(py, &e))?;
    serde_json::to_string(&found).map_err(|e| to_python(py, &e.into()))
}

/// Finds the effects that a model of the bundle's machine lacks; `effects` are those of the user, a JSON list.
#[pyfunction]
pub(crate) fn diagnose(
    py: Python<'_>,
    bundle: &Bundle,
    model: Option<&Model>,
    effects: &str,
    progress: Option<Py<PyAny>>,
) -> PyResult<Diagnosis> {
    let effects: Vec<UserEffect> =
        serde_json::from_str(effects).map_err(|e| wrong_setting(py, "effects", &e.to_string()))?;
    let (inner, file) = (Arc::clone(&bundle.inner), model.map(|m| Arc::clone(&m.file)));
    let found = worker::run(py, progress.as_ref(), move |tell| {
        let given = Given {
            model: file.as_deref(),
            effects: &effects,
        };
        lpv::diagnose::diagnose(&inner, given, tell).map_err(|e| e.at(inner.folder()))
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
        let found = &self.found.diagnosis;
        let json = serde_json::to_string_pretty(found).map_err(|e| to_python(py, &e.into()))?;
        Ok((json, for_terminal(&found.text())))
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
        let inputs = Inputs::none().bundle(&self.bundle);
        let write = || {
            let files = ResultFiles::check(&folder, &inputs, Overwrite::if_asked(overwrite))?;
            files.write(&self.found, &self.bundle)
        };
        py.detach(write).map_err(|e| to_python(py, &e))
    }
}
