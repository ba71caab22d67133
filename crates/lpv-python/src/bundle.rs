//! A bundle: its description, its records as arrays.

use crate::arrays::signals;
use crate::error::to_python;
use crate::places::{PlaceTuple, places};
use crate::worker;
use lpv::experiment_data;
use lpv::lpv_core::Signals;
use lpv::{PipelineError, estimate_part, records_by_place};
use numpy::PyArray2;
use pyo3::prelude::*;
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

/// A bundle on disk.
#[pyclass(frozen, module = "lpvident._lpvident")]
pub(crate) struct Bundle {
    pub(crate) inner: Arc<experiment_data::Bundle>,
}

/// Names and samples x channels.
type Group<'py> = (Vec<String>, Bound<'py, PyArray2<f64>>);

#[pymethods]
impl Bundle {
    #[new]
    fn new(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let opened = py.detach(|| experiment_data::Bundle::open(&path));
        let inner = opened.map_err(|e| to_python(py, &PipelineError::Data(e)))?;
        Ok(Self {
            inner: Arc::new(inner),
        })
    }

    fn folder(&self) -> PathBuf {
        self.inner.folder().to_owned()
    }

    /// The description as JSON.
    fn description(&self, py: Python<'_>) -> PyResult<String> {
        serde_json::to_string(self.inner.description()).map_err(|e| to_python(py, &e.into()))
    }

    fn record_names(&self) -> Vec<String> {
        let name = |i: usize| self.inner.record_name(i).unwrap_or_default().to_owned();
        (0..self.inner.len()).map(name).collect()
    }

    /// One record, scaled and checked: its groups of channels in the order output, input, reference, scheduling, auxiliary,
    /// injection, and its position.
    fn record<'py>(&self, py: Python<'py>, index: usize) -> PyResult<(Vec<Group<'py>>, Option<Vec<f64>>)> {
        let bundle = Arc::clone(&self.inner);
        let record = worker::run(py, None, move |_| Ok(bundle.load(index)?))?;
        let group = |s: &Signals| Ok((s.names.clone(), signals(py, s)?));
        let groups = record.groups().into_iter().map(group).collect::<PyResult<_>>()?;
        Ok((groups, record.position.map(|p| p.to_vec())))
    }

    /// The estimation records of each place that can be worked on by itself.
    fn places(&self, py: Python<'_>) -> PyResult<Vec<Vec<usize>>> {
        let bundle = Arc::clone(&self.inner);
        worker::run(py, None, move |_| {
            records_by_place(&bundle).map_err(|e| e.at(bundle.folder()))
        })
    }

    /// The frequency responses place by place, of all records or of some, and how they were made.
    #[pyo3(signature = (records, skip_periods, progress))]
    fn frf<'py>(
        &self,
        py: Python<'py>,
        records: Option<BTreeSet<usize>>,
        skip_periods: Option<usize>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<(Vec<PlaceTuple<'py>>, Vec<String>)> {
        let bundle = Arc::clone(&self.inner);
        let found = worker::run(py, progress.as_ref(), move |tell| {
            let part = |i| records.as_ref().is_none_or(|all| all.contains(&i));
            estimate_part(&bundle, part, skip_periods, tell).map_err(|e| e.at(bundle.folder()))
        })?;
        let all = found
            .estimates
            .iter()
            .map(|e| places(py, e))
            .collect::<PyResult<_>>()?;
        Ok((all, found.reasons))
    }
}
