//! Whether a file of arrays holds a frequency response, before any description names it.

use super::arrays::{frequency_unit, numbers_of};
use super::names::{FREQUENCY, OMEGA};
use crate::columns::{self, RecordFormat};
use crate::{Contents, RecordError};
use std::f64::consts::TAU;
use std::path::Path;

/// Arrays of a file that are a frequency response.
#[derive(Debug, Clone, PartialEq)]
pub struct ResponseArrays {
    /// What `columns` of a record has to say where they are: the part of a response and its name in the file.
    pub columns: Vec<(String, String)>,
    /// Number of outputs.
    pub outputs: usize,
    /// Number of inputs.
    pub inputs: usize,
    /// Its highest line, Hz.
    pub highest_hz: f64,
}

/// Names of frequencies in Hz, and in rad/s.
const IN_HZ: [&str; 9] = [
    "frequency",
    "frequencies",
    "freq",
    "freqs",
    "f",
    "hz",
    "f_hz",
    "freq_hz",
    "frequency_hz",
];
const IN_TURNS: [&str; 5] = ["omega", "w", "frequency_rad_s", "omega_rad_s", "w_rad_s"];

/// The response of a file of arrays with these contents: the only one that has complex numbers as often as it has frequencies. None where it holds samples, or
/// what cannot be told.
///
/// # Errors
/// A file that cannot be read.
pub fn response_arrays(path: &Path, contents: &Contents) -> Result<Option<ResponseArrays>, RecordError> {
    let format = columns::format(path)?;
    if !matches!(format, RecordFormat::Npz | RecordFormat::Mat | RecordFormat::Hdf5) {
        return Ok(None);
    }
    let complex = complex_arrays(contents);
    let frequencies = frequencies(contents);
    let ([response], [(at, in_turns)]) = (complex.as_slice(), frequencies.as_slice()) else {
        return Ok(None);
    };
    let (response, at) = (response.as_str(), at.as_str());
    let is_frd = response.ends_with(".ResponseData");
    let mut per_hz = if *in_turns { TAU } else { 1.0 };
    if is_frd {
        match frequency_unit(path, format, response)? {
            Some(unit) => per_hz = unit,
            None => return Ok(None),
        }
    }
    let values = numbers_of(path, format, at)?;
    let lines = values.re.len() as u64;
    // Signals beside it are samples, and the response is a result of them.
    let signals = contents.columns.iter().filter(|c| c.rows > 1 && c.rows != lines);
    if signals.count() > 1 {
        return Ok(None);
    }
    let goes = |up: bool| values.re.windows(2).all(|w| (w[0] < w[1]) == up && w[0] != w[1]);
    if lines < 2 || !(goes(true) || goes(false)) || values.im.is_some() {
        return Ok(None);
    }
    let shape = numbers_of(path, format, response)?.shape;
    let Some((outputs, inputs)) = channels(&shape, lines, is_frd) else {
        return Ok(None);
    };
    let named = [
        (if *in_turns { OMEGA } else { FREQUENCY }, at),
        ("response", response),
    ];
    let own = named.into_iter().filter(|(name, place)| !is_frd && name != place);
    Ok(Some(ResponseArrays {
        columns: own
            .map(|(name, place)| (name.to_owned(), place.to_owned()))
            .collect(),
        outputs,
        inputs,
        highest_hz: values.re.iter().copied().fold(0.0, f64::max) / per_hz,
    }))
}

/// Arrays of complex numbers; where one is called a response it is that.
fn complex_arrays(contents: &Contents) -> Vec<String> {
    let is_complex = |what: &str| what.contains("complex numbers");
    let all: Vec<String> = contents
        .passed_over
        .iter()
        .filter(|p| is_complex(&p.what))
        .map(|p| p.name.clone())
        .collect();
    match all
        .iter()
        .find(|n| n.as_str() == "response" || n.ends_with(".ResponseData"))
    {
        Some(named) => vec![named.clone()],
        None => all,
    }
}

/// Vectors whose name is that of frequencies, and whether they are in rad/s.
fn frequencies(contents: &Contents) -> Vec<(String, bool)> {
    let of = |list: &[&str], in_turns: bool| -> Vec<(String, bool)> {
        let leaf = |name: &str| name.rsplit('.').next().unwrap_or(name).to_lowercase();
        let columns = contents.columns.iter().filter(|c| c.rows > 1);
        let found = columns.filter(|c| list.contains(&leaf(&c.name).as_str()));
        found
            .map(|c| (c.source.clone().unwrap_or_else(|| c.name.clone()), in_turns))
            .collect()
    };
    match of(&IN_HZ, false) {
        found if found.is_empty() => of(&IN_TURNS, true),
        found => found,
    }
}

/// Outputs and inputs of an array with as many lines along its first or its last index.
fn channels(shape: &[u64], lines: u64, is_frd: bool) -> Option<(usize, usize)> {
    let size = |n: u64| usize::try_from(n).ok();
    match *shape {
        [n] if n == lines => Some((1, 1)),
        [outputs, inputs, n] if n == lines && is_frd => Some((size(outputs)?, size(inputs)?)),
        [n, outputs, inputs] if n == lines => Some((size(outputs)?, size(inputs)?)),
        [outputs, inputs, n] if n == lines => Some((size(outputs)?, size(inputs)?)),
        // What MATLAB calls a vector has two indices, and of a matrix one index counts the outputs.
        [n, outputs] if n == lines && !is_frd => Some((size(outputs)?, 1)),
        [outputs, n] if n == lines => Some((size(outputs)?, 1)),
        _ => None,
    }
}
