//! Responses as arrays: `frequency` and `response` with what is known of its error, or a struct of MATLAB's frd kind.

use super::names::{FREQUENCY, OMEGA};
use super::numbers::{Entries, Numbers};
use super::raw::{Asked, Raw, Spread};
use crate::columns::RecordFormat;
use crate::error::ResponseFault;
use crate::nearest::nearest;
use crate::{RecordError, columns, mat};
use lpv_core::num_complex::Complex;
use std::f64::consts::TAU;
use std::path::Path;

const OF_LINES: &str = "lines";
const OF_RESPONSE: &str = "lines x outputs x inputs";
const OF_COVARIANCE: &str =
    "lines x n x n, n = outputs times inputs, of the columns of the response one below the other";
const OF_FRD: &str = "outputs x inputs x lines";

pub(super) fn read(asked: &Asked<'_>, format: RecordFormat) -> Result<Raw, RecordError> {
    let entries = entries_of(asked.path, format)?;
    let file = File {
        asked,
        format,
        entries,
    };
    match file.frd() {
        Some(name) => file.of_frd(&name),
        None => file.of_arrays(),
    }
}

fn entries_of(path: &Path, format: RecordFormat) -> Result<Entries, RecordError> {
    match format {
        RecordFormat::Npz => columns::npz_entries(path),
        _ => mat::entries(path),
    }
}

/// An array that is there.
pub(super) fn numbers_of(path: &Path, format: RecordFormat, place: &str) -> Result<Numbers, RecordError> {
    match format {
        RecordFormat::Npz => columns::npz_numbers(path, place),
        RecordFormat::Hdf5 => mat::hdf5_numbers(path, place),
        _ => mat::numbers(path, place),
    }
}

/// What the frequencies beside `ResponseData` are divided by to be in Hz; none where the file does not say it.
pub(super) fn frequency_unit(
    path: &Path,
    format: RecordFormat,
    data: &str,
) -> Result<Option<f64>, RecordError> {
    let entries = entries_of(path, format)?;
    let name = data.strip_suffix(".ResponseData").unwrap_or(data);
    Ok(entries.per_hz(name).ok())
}

impl Entries {
    /// What the frequencies of a struct are divided by to be in Hz, or the words of their unit.
    fn per_hz(&self, name: &str) -> Result<f64, Option<&str>> {
        let unit = |own: &str| {
            let all = self.texts.iter();
            let named = |(n, _): &&(String, String)| *n == format!("{name}.{own}");
            all.clone().find(named).map(|(_, words)| words.as_str())
        };
        let in_seconds = || matches!(unit("TimeUnit"), None | Some("" | "seconds" | "s"));
        match unit("Units").or_else(|| unit("FrequencyUnit")) {
            Some("Hz") => Ok(1.0),
            Some("kHz") => Ok(1e-3),
            Some("MHz") => Ok(1e-6),
            Some("rpm") => Ok(60.0),
            Some("rad/s" | "rad/sec" | "rad/second") => Ok(TAU),
            // As `frd` has them unless told otherwise.
            Some("rad/TimeUnit") if in_seconds() => Ok(TAU),
            Some("cycles/TimeUnit") if in_seconds() => Ok(1.0),
            other => Err(other),
        }
    }
}

struct File<'a> {
    asked: &'a Asked<'a>,
    format: RecordFormat,
    entries: Entries,
}

impl File<'_> {
    fn has(&self, name: &str) -> bool {
        self.entries.names.iter().any(|n| n == name)
    }

    /// The struct that holds `ResponseData`: the one that is named, else the only one.
    fn frd(&self) -> Option<String> {
        let named = self.asked.entry.source_of("response");
        if self.has(&format!("{named}.ResponseData")) {
            return Some(named.to_owned());
        }
        let data = |n: &String| n.strip_suffix(".ResponseData").map(str::to_owned);
        let mut all = self.entries.names.iter().filter_map(data);
        let first = all.next()?;
        (all.next().is_none() && !self.has(named)).then_some(first)
    }

    fn needed(&self, name: &str, place: &str) -> Result<Numbers, RecordError> {
        if !self.has(place) {
            return Err(ResponseFault::Missing {
                name: name.to_owned(),
                nearest: nearest(place, &self.entries.names),
                present: self.entries.names.clone(),
            }
            .into());
        }
        numbers_of(self.asked.path, self.format, place)
    }

    /// What may be missing, unless the description says where it is.
    fn optional(&self, name: &str) -> Result<Option<Numbers>, RecordError> {
        let place = self.asked.entry.source_of(name);
        if !self.has(place) && !self.asked.entry.columns.contains_key(name) {
            return Ok(None);
        }
        self.needed(name, place).map(Some)
    }

    fn of_arrays(&self) -> Result<Raw, RecordError> {
        let (outputs, inputs) = self.asked.size();
        // What a file without a response holds, its message lists.
        let response = self.needed("response", self.asked.entry.source_of("response"))?;
        if response.im.is_none() {
            return Err(ResponseFault::NotComplex {
                name: "response".to_owned(),
            }
            .into());
        }
        // What the description says goes before what a name says.
        let says = |name: &str| self.asked.entry.columns.contains_key(name);
        let has = |name: &str| self.has(self.asked.entry.source_of(name));
        let in_turns = says(OMEGA) || !says(FREQUENCY) && !has(FREQUENCY) && has(OMEGA);
        let at = if in_turns { OMEGA } else { FREQUENCY };
        let frequency = self.needed(at, self.asked.entry.source_of(at))?;
        let lines = frequency.re.len();
        let mut frequencies_hz = real(&frequency, at, &[lines], OF_LINES)?;
        if in_turns {
            frequencies_hz.iter_mut().for_each(|f| *f /= TAU);
        }
        let sizes = [lines, outputs, inputs];
        let values = match response.ordered("response", &sizes, OF_RESPONSE) {
            Ok(rows) => by_columns(rows, outputs, inputs),
            // As `frd` of MATLAB and python-control has it.
            Err(first) => match response.ordered("response", &[outputs, inputs, lines], OF_FRD) {
                Ok(rows) => lines_first(&rows, (outputs, inputs, lines)),
                Err(_) => return Err(first.into()),
            },
        };
        let of_channels = |name: &str| -> Result<Option<Vec<f64>>, RecordError> {
            let Some(found) = self.optional(name)? else {
                return Ok(None);
            };
            let all = real(&found, name, &sizes, OF_RESPONSE)?;
            Ok(Some(by_columns(all, outputs, inputs)))
        };
        let n = outputs * inputs;
        let spread = if let Some(found) = self.optional("covariance")? {
            let rows = found.ordered("covariance", &[lines, n, n], OF_COVARIANCE)?;
            Spread::Covariance(by_columns(rows, n, n))
        } else if let Some(variance) = of_channels("variance")? {
            Spread::Variance(variance)
        } else if let Some(coherence) = of_channels("coherence")? {
            Spread::Coherence(coherence)
        } else {
            Spread::Unknown
        };
        let averages = match self.optional("averages")? {
            Some(found) => Some(real(&found, "averages", &[1], "one number")?[0]),
            None => None,
        };
        Ok(Raw {
            frequencies_hz,
            values,
            spread,
            averages,
            quantity: None,
        })
    }

    fn of_frd(&self, name: &str) -> Result<Raw, RecordError> {
        let (outputs, inputs) = self.asked.size();
        let field = |own: &str| format!("{name}.{own}");
        let frequency = self.needed("frequency", &field("Frequency"))?;
        let lines = frequency.re.len();
        let mut frequencies_hz = real(&frequency, "Frequency", &[lines], OF_LINES)?;
        match self.entries.per_hz(name) {
            Ok(per_hz) => frequencies_hz.iter_mut().for_each(|f| *f /= per_hz),
            Err(other) => {
                return Err(ResponseFault::Units {
                    name: field("Units"),
                    found: other.map_or("missing".to_owned(), |words| format!("`{words}`")),
                }
                .into());
            }
        }
        let data = self.needed("response", &field("ResponseData"))?;
        if data.im.is_none() {
            let name = field("ResponseData");
            return Err(ResponseFault::NotComplex { name }.into());
        }
        let ordered = data.ordered("ResponseData", &[outputs, inputs, lines], OF_FRD)?;
        Ok(Raw {
            frequencies_hz,
            values: lines_first(&ordered, (outputs, inputs, lines)),
            spread: Spread::Unknown,
            averages: None,
            quantity: None,
        })
    }
}

/// Of an array outputs x inputs x lines the matrices with columns one after another, line after line.
fn lines_first<T: Copy>(all: &[T], (outputs, inputs, lines): (usize, usize, usize)) -> Vec<T> {
    let of_line =
        |k: usize| (0..inputs).flat_map(move |j| (0..outputs).map(move |i| (i * inputs + j) * lines + k));
    (0..lines).flat_map(of_line).map(|at| all[at]).collect()
}

fn real(
    found: &Numbers,
    name: &str,
    sizes: &[usize],
    meaning: &'static str,
) -> Result<Vec<f64>, ResponseFault> {
    if found.im.is_some() {
        return Err(ResponseFault::Complex {
            name: name.to_owned(),
        });
    }
    let ordered = found.ordered(name, sizes, meaning)?;
    Ok(ordered.into_iter().map(|v: Complex<f64>| v.re).collect())
}

/// Matrices with rows one after another, as matrices with columns one after another.
fn by_columns<T: Copy>(rows: Vec<T>, outputs: usize, inputs: usize) -> Vec<T> {
    if outputs == 1 || inputs == 1 {
        return rows;
    }
    rows.chunks_exact(outputs * inputs)
        .flat_map(|line| (0..inputs).flat_map(move |j| (0..outputs).map(move |i| line[i * inputs + j])))
        .collect()
}
