//! Models from frequency responses that were measured elsewhere.

use crate::error::core_error;
use crate::model::Model;
use crate::places::{PlaceArguments, to_estimate};
use crate::{settings, worker};
use lpv::lpv_core::{Discrete, FrfEstimate};
use lpv::validation::judge_on_responses;
use lpv::{FrozenDeviation, Identification, ModelFile, Moves, Summary, identify};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// Responses at one place or several to a state space or an LFR.
#[pyfunction]
pub(crate) fn fit_frf(
    py: Python<'_>,
    places: Vec<PlaceArguments<'_>>,
    sample_time: f64,
    settings: &str,
    config: Option<PathBuf>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Model> {
    let config = settings::read(py, config, settings)?;
    let clock = Discrete::new(sample_time).map_err(|e| core_error(py, e))?;
    let estimates: Vec<FrfEstimate> = places
        .iter()
        .map(|place| to_estimate(py, place))
        .collect::<PyResult<_>>()?;
    let first = estimates.first().map(|e| (e.frf().outputs(), e.frf().inputs()));
    let file = worker::run(py, progress.as_ref(), move |tell| {
        let moves = Moves::none("frequency responses come without records");
        let identified = identify(&estimates, clock, &moves, &config, tell)?;
        let names = |letter: &str, n: usize| (1..=n).map(|i| format!("{letter}{i}")).collect();
        let (outputs, inputs) = first.unwrap_or_default();
        let model = identified.model()?;
        let mut summary = Summary::of_responses(&identified, &estimates, clock)?;
        summary.verdict = Some(judge_on_responses(&model, &estimates, &summary, clock)?);
        Ok(ModelFile {
            model,
            explanation: None,
            identification: Some(Identification {
                written_by: "lpvident.fit_frf".to_owned(),
                bundle: "frequency responses".to_owned(),
                folder: PathBuf::new(),
                outputs: names("y", outputs),
                inputs: names("u", inputs),
                config,
                summary,
                sample_time: Some(clock.sample_time()),
                frozen_deviation: FrozenDeviation::of(&identified, &estimates, clock)?,
            }),
        })
    })?;
    Ok(Model { file: Arc::new(file) })
}
