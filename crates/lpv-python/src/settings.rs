//! Settings of an identification from keyword arguments.

use crate::error::{to_python, unknown_setting, wrong_setting};
use lpv::IdentifyConfig;
use pyo3::prelude::*;
use serde_json::{Map, Value};
use std::path::PathBuf;

/// Every setting with its default, as JSON.
#[pyfunction]
pub(crate) fn settings() -> PyResult<String> {
    Ok(Value::Object(defaults()).to_string())
}

/// A settings file with every setting, what it means, and its default.
#[pyfunction]
pub(crate) fn template() -> &'static str {
    IdentifyConfig::template()
}

fn defaults() -> Map<String, Value> {
    match serde_json::to_value(IdentifyConfig::default()) {
        Ok(Value::Object(all)) => all,
        _ => Map::new(),
    }
}

/// The settings of a file, or the defaults, with those that were given: a JSON object by name. Each is put in by itself, so that a
/// refusal names it.
pub(crate) fn read(py: Python<'_>, file: Option<PathBuf>, given: &str) -> PyResult<IdentifyConfig> {
    let given: Map<String, Value> =
        serde_json::from_str(given).map_err(|e| wrong_setting(py, "settings", &e.to_string()))?;
    let mut config = match file {
        Some(file) => IdentifyConfig::read(&file).map_err(|e| to_python(py, &e))?,
        None => IdentifyConfig::default(),
    };
    let known = defaults();
    for (name, value) in given {
        let key = name.replace('_', "-");
        if !known.contains_key(&key) {
            let names: Vec<String> = known.keys().map(|k| k.replace('-', "_")).collect();
            return Err(unknown_setting(py, &name, names.iter().map(String::as_str)));
        }
        config = with(&config, &key, value).map_err(|e| wrong_setting(py, &name, &e.to_string()))?;
    }
    config.check().map_err(|e| to_python(py, &e))?;
    Ok(config)
}

fn with(config: &IdentifyConfig, key: &str, value: Value) -> Result<IdentifyConfig, serde_json::Error> {
    let mut all = serde_json::to_value(config)?;
    all[key] = value;
    serde_json::from_value(all)
}
