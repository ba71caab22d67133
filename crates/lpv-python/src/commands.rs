//! The commands of the program that answer at once: inspect, identify, validate.

use crate::arrays::{samples, signals};
use crate::bundle::Bundle;
use crate::error::to_python;
use crate::model::Model;
use crate::{settings, worker};
use lpv::encode::for_terminal;
use lpv::validation::Scope;
use lpv::{ModelFile, PipelineError, identify_bundle};
use numpy::PyArray2;
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// An account as JSON, and in words.
type Account = (String, String);

/// Name of a record; measured, simulated in open loop, simulated in closed loop, samples x outputs.
type Along<'py> = (
    String,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray2<f64>>,
    Option<Bound<'py, PyArray2<f64>>>,
);

fn account(py: Python<'_>, value: &impl lpv::account::Account, text: &str) -> PyResult<Account> {
    let json = lpv::account::to_json(value).map_err(|e| to_python(py, &e))?;
    Ok((json, for_terminal(text)))
}

/// What is in a bundle.
#[pyfunction]
pub(crate) fn inspect(
    py: Python<'_>,
    bundle: &Bundle,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, String, String)> {
    let inner = Arc::clone(&bundle.inner);
    let found = worker::run(py, progress.as_ref(), move |tell| {
        lpv::inspect::inspect(&inner, tell).map_err(|e| e.at(inner.folder()))
    })?;
    let (json, text) = account(py, &found, &found.text())?;
    Ok((json, text, found.lines_csv()))
}

/// A model from a bundle; the settings are a JSON object by name, above those of the file.
#[pyfunction]
pub(crate) fn identify(
    py: Python<'_>,
    bundle: &Bundle,
    settings: &str,
    config: Option<PathBuf>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Model> {
    let config = settings::read(py, config, settings)?;
    let inner = Arc::clone(&bundle.inner);
    let file = worker::run(py, progress.as_ref(), move |tell| {
        let outcome = identify_bundle(&inner, &config, tell).map_err(|e| e.at(inner.folder()))?;
        ModelFile::of(outcome, &inner, config, Path::new("model.json"))
    })?;
    Ok(Model::new(file, bundle.inner.folder()))
}

/// A model against a bundle: the account, and what it was made from.
#[pyfunction]
pub(crate) fn validate<'py>(
    py: Python<'py>,
    model: &Model,
    bundle: &Bundle,
    all: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<(Account, Vec<Along<'py>>)> {
    let scope = match all {
        true => Scope::All,
        false => Scope::HeldOut,
    };
    let (file, inner) = (Arc::clone(&model.file), Arc::clone(&bundle.inner));
    let (found, evidence) = worker::run(py, progress.as_ref(), move |tell| {
        let found = lpv::validation::validate(&file, &inner, scope, tell);
        found.map_err(|e: PipelineError| e.at(inner.folder()))
    })?;
    let mut runs = Vec::with_capacity(evidence.runs.len());
    for (record, open, closed) in &evidence.runs {
        let closed = closed.as_ref().map(|run| samples(py, &run.outputs)).transpose()?;
        runs.push((
            record.name.clone(),
            signals(py, &record.outputs)?,
            samples(py, &open.outputs)?,
            closed,
        ));
    }
    Ok((account(py, &found, &found.text())?, runs))
}
