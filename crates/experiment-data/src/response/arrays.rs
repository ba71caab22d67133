//! Responses as arrays: `frequency` and `response` with what is known of its error, or a struct of MATLAB's frd kind.

use super::numbers::{Entries, Numbers};
use super::raw::{Asked, Raw, Spread};
use crate::columns::RecordFormat;
use crate::error::ResponseFault;
use crate::nearest::nearest;
use crate::{RecordError, columns, mat};
use lpv_core::num_complex::Complex;
use std::f64::consts::TAU;

const OF_LINES: &str = "lines";
const OF_RESPONSE: &str = "lines x outputs x inputs";
const OF_COVARIANCE: &str =
    "lines x n x n, n = outputs times inputs, of the columns of the response one below the other";
const OF_FRD: &str = "outputs x inputs x lines";

pub(super) fn read(asked: &Asked<'_>, format: RecordFormat) -> Result<Raw, RecordError> {
    let entries = match format {
        RecordFormat::Npz => columns::npz_entries(asked.path)?,
        _ => mat::entries(asked.path)?,
    };
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
        match self.format {
            RecordFormat::Npz => columns::npz_numbers(self.asked.path, place),
            RecordFormat::Hdf5 => mat::hdf5_numbers(self.asked.path, place),
            _ => mat::numbers(self.asked.path, place),
        }
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
        let frequency = self.needed("frequency", self.asked.entry.source_of("frequency"))?;
        let lines = frequency.re.len();
        let frequencies_hz = real(&frequency, "frequency", &[lines], OF_LINES)?;
        let sizes = [lines, outputs, inputs];
        let values = by_columns(
            response.ordered("response", &sizes, OF_RESPONSE)?,
            outputs,
            inputs,
        );
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
        let unit = |own: &str| {
            let texts = &self.entries.texts;
            texts
                .iter()
                .find(|(n, _)| *n == field(own))
                .map(|(_, words)| words.as_str())
        };
        match unit("Units").or_else(|| unit("FrequencyUnit")) {
            Some("Hz") => {}
            Some("rad/s" | "rad/sec" | "rad/second") => frequencies_hz.iter_mut().for_each(|f| *f /= TAU),
            other => {
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
        let at = |k: usize, j: usize, i: usize| ordered[(i * inputs + j) * lines + k];
        let values = (0..lines)
            .flat_map(|k| (0..inputs).flat_map(move |j| (0..outputs).map(move |i| (k, j, i))))
            .map(|(k, j, i)| at(k, j, i))
            .collect();
        Ok(Raw {
            frequencies_hz,
            values,
            spread: Spread::Unknown,
            averages: None,
            quantity: None,
        })
    }
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
