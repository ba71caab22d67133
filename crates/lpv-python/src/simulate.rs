//! Bundles of the simulated xy-table.

use crate::error::{to_python, unknown_setting, wrong_setting};
use crate::worker;
use lpv::experiment_data::RecordFormat;
use lpv::simulate::{MachineFile, SimulateAccount, simulate};
use pyo3::prelude::*;
use serde_json::Value;
use std::path::PathBuf;

/// A machine file with all defaults and what they mean.
#[pyfunction]
pub(crate) fn machine_template() -> &'static str {
    MachineFile::template()
}

/// Simulates a machine, and writes its bundle. The machine is a JSON object above that of the file; gives the number of records, of
/// samples, and of the first periods that hold the transient.
#[pyfunction]
pub(crate) fn simulate_machine(
    py: Python<'_>,
    folder: PathBuf,
    machine: &str,
    file: Option<PathBuf>,
    hide: Vec<String>,
    format: &str,
    progress: Option<Py<PyAny>>,
) -> PyResult<(usize, usize, usize)> {
    let machine = read(py, file, machine)?;
    let hidden = hide.iter().map(|e| e.parse()).collect::<Result<Vec<_>, _>>();
    let hidden = hidden.map_err(|e| to_python(py, &lpv::PipelineError::from(e)))?;
    let format = match format {
        "npz" => RecordFormat::Npz,
        "csv" => RecordFormat::Csv,
        "parquet" => RecordFormat::Parquet,
        "mat" => RecordFormat::Mat,
        _ => return Err(wrong_setting(py, "format", "give npz, csv, parquet or mat")),
    };
    let account: SimulateAccount = worker::run(py, progress.as_ref(), move |tell| {
        tell("simulating", 0, 1);
        simulate(&machine, &hidden, &folder, format, &|done, of| {
            tell("simulating", done, of)
        })
    })?;
    Ok((account.records, account.samples, account.transient_periods))
}

fn read(py: Python<'_>, file: Option<PathBuf>, given: &str) -> PyResult<MachineFile> {
    let file = match file {
        Some(file) => MachineFile::read(&file).map_err(|e| to_python(py, &e))?,
        None => MachineFile::default(),
    };
    let wrong = |e: serde_json::Error| wrong_setting(py, "machine", &e.to_string());
    let given: Value = serde_json::from_str(given).map_err(wrong)?;
    let mut all = serde_json::to_value(file).map_err(wrong)?;
    put(py, &mut all, given)?;
    serde_json::from_value(all).map_err(wrong)
}

/// Puts values into tables of the same names; a list or a choice, such as the lines of a multisine, as a whole.
fn put(py: Python<'_>, into: &mut Value, given: Value) -> PyResult<()> {
    /// The table whose keys are a choice.
    const CHOICE: &str = "lines";
    let (Value::Object(known), Value::Object(given)) = (&mut *into, &given) else {
        *into = given;
        return Ok(());
    };
    for (name, value) in given {
        let key = name.replace('_', "-");
        match known.get_mut(&key) {
            Some(place) if key == CHOICE => *place = value.clone(),
            Some(place) => put(py, place, value.clone())?,
            None => return Err(unknown_setting(py, name, known.keys().map(String::as_str))),
        }
    }
    Ok(())
}
