//! Errors of the facade as exceptions of `lpvident.errors`, with the facts as fields.

use lpv::experiment_data::{DataError, RecordError};
use lpv::lpv_core::CoreError;
use lpv::{PipelineError, nearest_name};
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// An exception to be: its class, its message, its facts.
struct Told<'py> {
    class: &'static str,
    facts: Bound<'py, PyDict>,
}

/// The exception of an error.
pub(crate) fn to_python(py: Python<'_>, error: &PipelineError) -> PyErr {
    let facts = PyDict::new(py);
    facts.set_item("exit_code", error.exit_code()).ok();
    let mut told = Told {
        class: "LpvError",
        facts,
    };
    match told.take(error) {
        Ok(()) => exception(py, told.class, &error.to_string(), &told.facts),
        Err(own) => own,
    }
}

/// An exception for what the types of Python let through.
pub(crate) fn core_error(py: Python<'_>, error: CoreError) -> PyErr {
    to_python(py, &PipelineError::Core(error))
}

/// Work that ended by a panic, whose message is on standard error.
pub(crate) fn internal(py: Python<'_>) -> PyErr {
    let text = "this is a fault of lpvident; please report it with the call, the data, and what stands on standard error";
    exception(py, "InternalError", text, &PyDict::new(py))
}

/// A setting that is none.
pub(crate) fn unknown_setting<'a>(py: Python<'_>, name: &str, known: impl Iterator<Item = &'a str>) -> PyErr {
    let known: Vec<&str> = known.collect();
    let nearest = nearest_name(name, known.iter().copied());
    let hint = nearest.map_or_else(
        || format!("there are {}", known.join(", ")),
        |n| format!("nearest: `{n}`"),
    );
    let facts = PyDict::new(py);
    let filled = facts
        .set_item("name", name)
        .and_then(|()| facts.set_item("nearest", nearest));
    match filled {
        Ok(()) => exception(
            py,
            "SettingError",
            &format!("unknown setting `{name}`; {hint}"),
            &facts,
        ),
        Err(own) => own,
    }
}

/// A setting of another type or outside its range.
pub(crate) fn wrong_setting(py: Python<'_>, name: &str, problem: &str) -> PyErr {
    let facts = PyDict::new(py);
    match facts.set_item("name", name) {
        Ok(()) => exception(py, "SettingError", &format!("`{name}`: {problem}"), &facts),
        Err(own) => own,
    }
}

fn exception(py: Python<'_>, class: &str, message: &str, facts: &Bound<'_, PyDict>) -> PyErr {
    let made = py
        .import("lpvident.errors")
        .and_then(|module| module.getattr(class))
        .and_then(|class| class.call((message,), Some(facts)));
    match made {
        Ok(made) => PyErr::from_value(made),
        // A package without its Python half.
        Err(_) => PyRuntimeError::new_err(message.to_owned()),
    }
}

impl Told<'_> {
    fn fact<'py, T: IntoPyObject<'py>>(&self, py: Python<'py>, name: &str, value: T) -> PyResult<()> {
        self.facts.set_item(name, value.into_py_any(py)?)
    }

    /// Finds the class, and the facts that the error has.
    fn take(&mut self, error: &PipelineError) -> PyResult<()> {
        use PipelineError as E;
        let py = self.facts.py();
        self.class = match error {
            E::Data(_) | E::RecordFile { .. } => "BundleError",
            E::Contradicted { .. } => "ContradictionError",
            E::Frf { .. } | E::Poles { .. } | E::Basis(_) | E::Ident(_) | E::Realize(_) | E::Fit(_) => {
                "IdentifyError"
            }
            E::Lti(_) | E::NoResponses { .. } | E::Structure { .. } => "IdentifyError",
            E::Places { .. } | E::SchedulingSignals { .. } => "IdentifyError",
            E::Trace(_) | E::NoBase { .. } => "DiagnoseError",
            E::Plant(_) => "MachineError",
            E::Simulate(_) | E::Core(_) | E::Channels { .. } | E::Model { .. } => "ModelError",
            E::Setting { .. } | E::Value { .. } | E::Config { .. } => "SettingError",
            E::NoFolder { .. } | E::Place { .. } | E::Write { .. } => "WriteError",
            E::Report(_) | E::Format(_) | E::Grid { .. } => "WriteError",
            _ => self.class,
        };
        match error {
            E::At { place, source } => {
                self.take(source)?;
                self.fact(py, "path", place)
            }
            E::Contradicted { finding, .. } => {
                self.fact(py, "finding", serde_json::to_string(finding).unwrap_or_default())
            }
            E::Data(error) => self.data(py, error),
            E::Frf { place, .. } | E::Poles { place, .. } => self.fact(py, "place", place),
            E::NoFolder { place } => self.fact(py, "path", place),
            E::Model { file, .. }
            | E::RecordFile { file, .. }
            | E::Config { file, .. }
            | E::Place { file, .. }
            | E::Write { file, .. } => self.fact(py, "path", file),
            E::Setting { name, value, allowed } => {
                self.fact(py, "name", *name)?;
                self.fact(py, "value", *value)?;
                self.fact(py, "allowed", *allowed)
            }
            E::Value {
                place, key, value, ..
            } => {
                self.fact(py, "place", place)?;
                self.fact(py, "name", key)?;
                self.fact(py, "value", *value)
            }
            _ => Ok(()),
        }
    }

    fn data(&self, py: Python<'_>, error: &DataError) -> PyResult<()> {
        match error {
            DataError::Io { path, .. } | DataError::Exists { path } => self.fact(py, "path", path),
            DataError::NotABundle { folder } => self.fact(py, "path", folder),
            DataError::Toml {
                file, line, column, ..
            } => {
                self.fact(py, "path", file)?;
                self.fact(py, "line", *line)?;
                self.fact(py, "column", *column)
            }
            DataError::Description { place, .. } => {
                self.fact(py, "path", &place.file)?;
                self.fact(py, "key", &place.key)?;
                self.fact(py, "line", place.position.map(|p| p.0))?;
                self.fact(py, "column", place.position.map(|p| p.1))
            }
            DataError::Record { place, problem } => {
                self.fact(py, "path", &place.file)?;
                self.fact(py, "record", place.index)?;
                self.record(py, problem)
            }
            DataError::Index { index, .. } => self.fact(py, "record", *index),
            _ => Ok(()),
        }
    }

    fn record(&self, py: Python<'_>, problem: &RecordError) -> PyResult<()> {
        match problem {
            RecordError::CsvNumber { line, column, .. } | RecordError::CsvDuplicate { line, column, .. } => {
                self.fact(py, "line", *line)?;
                self.fact(py, "column", column)
            }
            RecordError::CsvRagged { line, .. } => self.fact(py, "line", *line),
            RecordError::ColumnMissing { column, .. } => self.fact(py, "column", column),
            _ => Ok(()),
        }
    }
}
