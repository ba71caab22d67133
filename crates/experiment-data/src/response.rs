//! Frequency responses that were measured elsewhere, by an analyser or in an earlier evaluation.
//!
//! In files of arrays (`.npz`, `.mat`, `.h5`) `frequency` (Hz), `response` (lines x outputs x inputs, complex), and, where they are
//! known, `variance` of the same shape (`E |dF|^2`), or `covariance` (lines x n x n, of the columns of F one below the other), or
//! `coherence` with the number of `averages`; in `.mat` also a struct with `Frequency`, `ResponseData` (outputs x inputs x lines) and
//! `Units`. In tables `frequency`, or `omega` in rad/s, and of each channel `y/u re` and `y/u im`, or `y/u magnitude` or `y/u dB` with
//! `y/u deg` or `y/u rad` (`variance`, `coherence`). In universal files the
//! functions of type 4 of data set 58. `columns` of the record says where something is that has another name.

mod arrays;
mod look;
pub(crate) mod names;
pub(crate) mod numbers;
pub(crate) mod raw;
mod table;

use crate::columns::{self, RecordFormat};
use crate::error::ResponseFault;
use crate::{Bundle, DataError, RecordError, ResponseQuantity};
pub use look::{ResponseArrays, response_arrays};
use lpv_core::num_complex::Complex;
use lpv_core::{Frf, Position, Purpose};
pub use raw::Spread;
use raw::{Asked, Raw};

/// A measured frequency response, in the units of the description.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredResponse {
    /// Name of its record.
    pub name: String,
    /// Whether it may be fitted or is held out.
    pub purpose: Purpose,
    /// Where it was measured; none without.
    pub position: Option<Position>,
    /// What it is of and over, as the description or the file says; none where neither does.
    pub quantity: Option<ResponseQuantity>,
    /// Outputs over inputs. A line at 0 Hz is left out: what stands there is an offset.
    pub frf: Frf,
    /// What is known of its error.
    pub spread: Spread,
    /// Averages behind it, where that is known.
    pub averages: Option<f64>,
}

impl Bundle {
    /// Reads a measured frequency response, scaled and checked.
    ///
    /// # Errors
    /// [`DataError::Index`]; [`DataError::Record`] for a record of samples, and with what is wrong with the response and where.
    pub fn load_response(&self, index: usize) -> Result<MeasuredResponse, DataError> {
        let name = self.record_name(index)?.to_owned();
        let path = self.record_path(index)?;
        let description = self.description();
        let asked = Asked {
            path: &path,
            entry: &description.records[index],
            channels: &description.channels,
            text: description.text.as_ref(),
        };
        of_file(&asked)
            .map(|raw| MeasuredResponse { name, ..raw })
            .map_err(|problem| self.record_fault(index, path.clone(), problem))
    }
}

fn of_file(asked: &Asked<'_>) -> Result<MeasuredResponse, RecordError> {
    if !asked.entry.is_response() {
        return Err(RecordError::UnsupportedFormat {
            found: "a record of samples in the place of a frequency response".to_owned(),
            supported: "kind = \"response\"",
        });
    }
    let format = columns::format(asked.path)?;
    let as_table = asked.entry.columns.keys().any(|k| names::is_part(k));
    let mut raw = match format {
        RecordFormat::Uff => columns::uff_responses(asked)?,
        RecordFormat::Npz | RecordFormat::Mat | RecordFormat::Hdf5 if !as_table => {
            arrays::read(asked, format)?
        }
        _ => table::read(asked)?,
    };
    let (outputs, inputs) = asked.size();
    if let Some([first, last]) = asked.entry.rows {
        let found = raw.frequencies_hz.len();
        if found < last {
            return Err(RecordError::RowsMissing {
                column: "frequency".to_owned(),
                rows: [first, last],
                found,
            });
        }
        raw.keep(|k| (first - 1..last).contains(&k));
    }
    raw.ascend();
    raw.check(asked)?;
    let zero = raw.frequencies_hz[0] == 0.0;
    raw.keep(|k| k > 0 || !zero);
    if raw.frequencies_hz.is_empty() {
        return Err(ResponseFault::NoLines.into());
    }
    raw.scale(asked);
    let quantity = agreed(asked.entry.quantity, raw.quantity)?;
    let frf = Frf::new(raw.frequencies_hz, outputs, inputs, raw.values);
    Ok(MeasuredResponse {
        name: String::new(),
        purpose: asked.entry.purpose,
        position: asked.entry.position.clone(),
        quantity,
        frf: frf.map_err(|_| ResponseFault::NoLines)?,
        spread: raw.spread,
        averages: raw.averages,
    })
}

/// What the description says, where the file does not say otherwise.
fn agreed(
    stated: Option<ResponseQuantity>,
    found: Option<ResponseQuantity>,
) -> Result<Option<ResponseQuantity>, ResponseFault> {
    match (stated, found) {
        (Some(stated), Some(found)) if stated.motion() != found.motion() => Err(ResponseFault::Quantity {
            stated: stated.name(),
            found: found.name(),
        }),
        _ => Ok(stated.or(found)),
    }
}

impl Raw {
    fn keep(&mut self, kept: impl Fn(usize) -> bool) {
        let lines = (0..self.frequencies_hz.len()).filter(|k| kept(*k)).collect();
        self.take(lines);
    }

    /// A sweep that went down, from its lowest line on.
    fn ascend(&mut self) {
        if self.frequencies_hz.windows(2).all(|w| w[0] > w[1]) {
            self.take((0..self.frequencies_hz.len()).rev().collect());
        }
    }

    /// These lines alone, in this order.
    fn take(&mut self, order: Vec<usize>) {
        fn some<T: Copy>(all: &mut Vec<T>, lines: usize, order: &[usize]) {
            let size = (all.len() / lines.max(1)).max(1);
            let parts = order.iter().filter_map(|k| all.get(k * size..(k + 1) * size));
            *all = parts.flatten().copied().collect();
        }
        let lines = self.frequencies_hz.len();
        some(&mut self.values, lines, &order);
        match &mut self.spread {
            Spread::Unknown => {}
            Spread::Variance(v) | Spread::Coherence(v) => some(v, lines, &order),
            Spread::Covariance(c) => some(c, lines, &order),
        }
        some(&mut self.frequencies_hz, lines, &order);
    }

    /// Refuses what cannot be a response.
    fn check(&self, asked: &Asked<'_>) -> Result<(), ResponseFault> {
        let f = &self.frequencies_hz;
        if f.is_empty() {
            return Err(ResponseFault::NoLines);
        }
        for (k, &value) in f.iter().enumerate() {
            let problem = if !value.is_finite() {
                "no finite number"
            } else if value < 0.0 {
                "negative"
            } else if k > 0 && f[k - 1] >= value {
                "not above the one before it; sort the lines"
            } else {
                continue;
            };
            let line = k + 1;
            return Err(ResponseFault::Frequency { line, value, problem });
        }
        let (outputs, inputs) = asked.size();
        let finite = |v: &Complex<f64>| v.re.is_finite() && v.im.is_finite();
        // What stands at 0 Hz is not used.
        let first = usize::from(f[0] == 0.0);
        let size = outputs * inputs;
        let bad = |flags: Vec<bool>, name: &'static str| -> Result<(), ResponseFault> {
            let size = flags.len() / f.len();
            let mut wrong = flags
                .iter()
                .enumerate()
                .skip(first * size)
                .filter(|(_, bad)| **bad);
            let count = wrong.clone().count();
            match wrong.next() {
                None => Ok(()),
                Some((at, _)) => Err(ResponseFault::NotFinite {
                    name,
                    line: at / size + 1,
                    frequency_hz: f[at / size],
                    count,
                }),
            }
        };
        bad(self.values.iter().map(|v| !finite(v)).collect(), "response")?;
        let (ny, nu) = asked.names();
        let zero = |on: &dyn Fn(usize) -> bool| {
            let own = self
                .values
                .iter()
                .enumerate()
                .skip(first * size)
                .filter(|(at, _)| on(at % size));
            f.len() > first && own.into_iter().all(|(_, v)| v.norm_sqr() == 0.0)
        };
        let dead = (0..outputs)
            .find(|i| zero(&|at| at % outputs == *i))
            .map(|i| &ny[i]);
        let dead = dead.or_else(|| {
            (0..inputs)
                .find(|j| zero(&|at| at / outputs == *j))
                .map(|j| &nu[j])
        });
        if let Some(channel) = dead {
            return Err(ResponseFault::Dead {
                channel: channel.clone(),
            });
        }
        self.check_spread(first, size, inputs)
    }

    fn check_spread(&self, first: usize, size: usize, inputs: usize) -> Result<(), ResponseFault> {
        let outside = |values: &[f64], name, size: usize, allowed, fits: &dyn Fn(f64) -> bool| {
            let wrong = values
                .iter()
                .enumerate()
                .skip(first * size)
                .find(|(_, v)| !fits(**v));
            wrong.map_or(Ok(()), |(at, &value)| {
                let line = at / size + 1;
                Err(ResponseFault::Spread {
                    name,
                    line,
                    value,
                    allowed,
                })
            })
        };
        const VARIANCE: &str =
            "a variance is finite and above zero; leave `variance` out where it is not known";
        if let Some(averages) = self.averages
            && !(averages.is_finite() && averages >= 1.0)
        {
            return Err(ResponseFault::Spread {
                name: "averages",
                line: 1,
                value: averages,
                allowed: "it is a number of measurements, 1 or more",
            });
        }
        let positive = |v: f64| v.is_finite() && v > 0.0;
        match &self.spread {
            Spread::Unknown => Ok(()),
            Spread::Variance(all) => outside(all, "variance", size, VARIANCE, &positive),
            Spread::Covariance(all) => {
                let matrices = all.chunks_exact(size * size);
                let diagonal: Vec<f64> = matrices
                    .clone()
                    .flat_map(|c| (0..size).map(move |i| c[i * (size + 1)].re))
                    .collect();
                outside(&diagonal, "covariance", size, VARIANCE, &positive)?;
                /// Part of the variances by which rounding may leave the Hermitian form.
                const ROUNDING: f64 = 1e-6;
                let worst = |c: &[Complex<f64>]| {
                    let pairs = (0..size).flat_map(|i| (0..size).map(move |j| (i, j)));
                    let part = |(i, j): (usize, usize)| {
                        let (a, b) = (c[i + size * j], c[j + size * i]);
                        let scale = (c[i * (size + 1)].re * c[j * (size + 1)].re).sqrt();
                        let correlation = a.norm() / scale - 1.0;
                        ((a - b.conj()).norm() / scale).max(correlation)
                    };
                    pairs
                        .map(part)
                        .fold(0.0, |a, b| if b > a || b.is_nan() { b } else { a })
                };
                let off: Vec<f64> = matrices.map(worst).collect();
                let allowed = "a covariance is Hermitian, and no correlation is above one";
                outside(&off, "covariance", 1, allowed, &|v| v <= ROUNDING)
            }
            Spread::Coherence(all) => {
                if inputs > 1 {
                    let problem = "of one input only; give `variance`, or leave `coherence` out";
                    return Err(ResponseFault::Coherence { problem });
                }
                if self.averages.is_none() {
                    let problem = "with the number of averages; add `averages`, or leave `coherence` out";
                    return Err(ResponseFault::Coherence { problem });
                }
                let allowed = "a coherence is above 0 and at most 1";
                outside(all, "coherence", size, allowed, &|v| v > 0.0 && v <= 1.0)
            }
        }
    }

    /// Takes the file's numbers to the units of the description: outputs are multiplied by their scale, inputs too.
    fn scale(&mut self, asked: &Asked<'_>) {
        let (outputs, inputs) = asked.size();
        let of = |scale: &[f64], k: usize| scale.get(k).copied().unwrap_or(1.0);
        let (y, u) = (&asked.channels.output.scale, &asked.channels.input.scale);
        let factors: Vec<f64> = (0..inputs)
            .flat_map(|j| (0..outputs).map(move |i| (i, j)))
            .map(|(i, j)| of(y, i) / of(u, j))
            .collect();
        let n = factors.len();
        let of_channel = |at: usize| factors[at % n];
        let values = self.values.iter_mut().enumerate();
        values.for_each(|(at, v)| *v *= of_channel(at));
        match &mut self.spread {
            Spread::Unknown | Spread::Coherence(_) => {}
            Spread::Variance(all) => {
                let values = all.iter_mut().enumerate();
                values.for_each(|(at, v)| *v *= of_channel(at).powi(2));
            }
            Spread::Covariance(all) => {
                let values = all.iter_mut().enumerate();
                values.for_each(|(at, v)| *v *= factors[at % n] * factors[at / n % n]);
            }
        }
    }
}

impl From<ResponseFault> for RecordError {
    fn from(fault: ResponseFault) -> Self {
        Self::Response(Box::new(fault))
    }
}
