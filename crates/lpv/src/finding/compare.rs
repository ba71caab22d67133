//! Records against each other: one of several with another sign or unit, and records of one place that disagree.

mod curves;

use super::Finding;
use curves::{corrected, curves};
use lpv_core::Position;
use lpv_core::num_complex::Complex;
use lpv_numerics::statistics::median;

type C64 = Complex<f64>;

/// What a record says at some of the lines of its response; columns a channel.
#[derive(Debug, Clone)]
pub(crate) struct Voice {
    pub(crate) record: String,
    pub(crate) position: Option<Position>,
    /// Hz.
    pub(crate) frequencies_hz: Vec<f64>,
    pub(crate) outputs: Vec<Vec<C64>>,
    pub(crate) inputs: Vec<Vec<C64>>,
    /// Empty without references.
    pub(crate) references: Vec<Vec<C64>>,
    /// Response at its place, by line, then by output, then by input: of all records there.
    pub(crate) response: Vec<C64>,
    /// Standard deviation of the noise in an output, by output, then by line.
    pub(crate) noise: Vec<Vec<f64>>,
}

impl Voice {
    /// The same on some of its lines.
    fn on(&self, lines: &[usize]) -> Self {
        fn part<T: Copy>(all: &[Vec<T>], lines: &[usize]) -> Vec<Vec<T>> {
            all.iter()
                .map(|x| lines.iter().map(|k| x[*k]).collect())
                .collect()
        }
        let each = self.outputs.len() * self.inputs.len();
        let responses = lines
            .iter()
            .flat_map(|k| &self.response[k * each..(k + 1) * each]);
        Self {
            record: self.record.clone(),
            position: self.position.clone(),
            frequencies_hz: lines.iter().map(|k| self.frequencies_hz[*k]).collect(),
            outputs: part(&self.outputs, lines),
            inputs: part(&self.inputs, lines),
            references: part(&self.references, lines),
            response: responses.copied().collect(),
            noise: part(&self.noise, lines),
        }
    }
}

/// Names of the channels.
pub(crate) struct Names<'a> {
    pub(crate) outputs: &'a [String],
    pub(crate) inputs: &'a [String],
}

/// Cosine of the median angle between a record and the others from which its sign is another.
const OPPOSITE: f64 = -0.7;
/// Factor between a record and the others that no machine makes while it moves, if the others agree within its fourth root.
const FACTOR: f64 = 4.0;
const ALIKE: f64 = 4.0;
/// And between two records alone.
const PAIR: f64 = 50.0;
/// Factors that units and signs make, and how well one must fit to be named.
const KNOWN: [f64; 13] = [
    1e3,
    1e-3,
    1e6,
    1e-6,
    1e9,
    1e-9,
    57.295_779_5,
    0.017_453_292_5,
    25.4,
    1.0 / 25.4,
    std::f64::consts::TAU,
    0.5 / std::f64::consts::PI,
    10.0,
];
const FITS: f64 = 0.7;
/// Difference between records of one place, in parts of the response, that no linear machine makes, and how many times the noise
/// it must be.
const DISAGREE: f64 = 0.15;
const OVER_NOISE: f64 = 4.0;
/// Fewest lines that are compared.
const LINES: usize = 8;

/// What the records say against each other.
pub(crate) fn compare(voices: &[Voice], names: &Names<'_>) -> Vec<Finding> {
    let mut found = odd_ones(voices, names);
    if found.is_empty() {
        found = disagreements(voices);
    }
    found
}

/// How a record's channel stands to what the others say of it: size and cosine of the angle, medians over the lines.
#[derive(Debug, Clone, Copy)]
struct Standing {
    factor: f64,
    cosine: f64,
}

fn standing(of: &[C64], others: &[C64]) -> Option<Standing> {
    let ratios: Vec<C64> = of
        .iter()
        .zip(others)
        .map(|(a, b)| a / b)
        .filter(|r| r.norm() > 0.0 && r.is_finite())
        .collect();
    (ratios.len() >= LINES).then(|| Standing {
        factor: median(&ratios.iter().map(|r| r.norm()).collect::<Vec<_>>()),
        cosine: median(&ratios.iter().map(|r| r.re / r.norm()).collect::<Vec<_>>()),
    })
}

/// Middle of real and imaginary parts.
fn middle(values: &[C64]) -> C64 {
    let part = |f: fn(&C64) -> f64| median(&values.iter().map(f).collect::<Vec<_>>());
    C64::new(part(|v| v.re), part(|v| v.im))
}

fn odd_ones(voices: &[Voice], names: &Names<'_>) -> Vec<Finding> {
    let Some(first) = voices.first() else {
        return Vec::new();
    };
    let (ny, nu) = (first.outputs.len(), first.inputs.len());
    let alike = |v: &&Voice| v.frequencies_hz == first.frequencies_hz;
    let voices: Vec<&Voice> = voices.iter().filter(alike).collect();
    // With several inputs, one record and lever arms that change sign along the stroke look like another sign.
    if nu != 1 || voices.len() < 2 || first.frequencies_hz.len() < LINES {
        return Vec::new();
    }
    let mut found = Vec::new();
    for i in 0..ny {
        let heard = heard(&voices, i);
        let voices: Vec<&Voice> = heard.iter().collect();
        // The middle one of three is not that of the odd one, whether it is among them or not.
        let of_all = (voices.len() > 2).then(|| responses(&voices, i, nu, &middle));
        let by_middle = |v: &Voice| match &of_all {
            Some(all) => Some(through(v, nu, all)),
            None => {
                let others = others(&voices, v, nu);
                (!others.is_empty()).then(|| through(v, nu, &responses(&others, i, nu, &middle)))
            }
        };
        let standings = voices.iter().map(|v| standing(&v.outputs[i], &by_middle(v)?));
        let Some(all) = standings.collect::<Option<Vec<_>>>() else {
            continue;
        };
        for (e, odd) in odd(&all) {
            let voice = voices[e];
            // A lever arm or a mode shape changes size and sign with the place: a curve through the other places then says the same.
            let others = others(&voices, voice, nu);
            let by_curve = curves(&others, voice).into_iter().map(|weights| {
                let on_curve = |values: &[C64]| values.iter().zip(&weights).map(|(v, w)| v * w).sum();
                through(voice, nu, &responses(&others, i, nu, &on_curve))
            });
            let by_curve: Vec<Vec<C64>> = by_curve.collect();
            // Where there is a line, it tells the factor better.
            let by_line = by_curve.get(1).and_then(|line| standing(&voice.outputs[i], line));
            let odd = named(by_line.map_or(odd, |s| s.factor * odd.signum()));
            let by_middle = by_middle(voice);
            let mut predicted = by_curve.iter().chain(&by_middle);
            if !predicted.all(|predicted| corrected(&voice.outputs[i], odd, predicted)) {
                continue;
            }
            // References tell whether the input stands apart, or the output.
            let by_input = (nu == 1).then(|| input_standing(&voices, voice)).flatten();
            let of_input = by_input.is_some_and(|s| apart(&s));
            let column = if of_input {
                names.inputs.first()
            } else {
                names.outputs.get(i)
            };
            found.push(Finding::RecordStandsApart {
                record: voice.record.clone(),
                column: column.cloned().unwrap_or_default(),
                factor: odd,
                records: voices.len(),
                sure: by_input.is_some(),
            });
        }
    }
    found.dedup_by(|a, b| a.place() == b.place());
    found
}

/// The records on the lines on which all of them stand out of the noise of this output: on the others a ratio is that of two noises.
/// On all lines where too few do.
fn heard(voices: &[&Voice], i: usize) -> Vec<Voice> {
    /// Most noise in parts of the output.
    const MOST: f64 = 0.3;
    let lines = 0..voices.first().map_or(0, |v| v.frequencies_hz.len());
    let stands_out = |k: &usize| {
        voices
            .iter()
            .all(|v| v.noise[i][*k] < MOST * v.outputs[i][*k].norm())
    };
    let heard: Vec<usize> = lines.clone().filter(stands_out).collect();
    let lines = if heard.len() < LINES {
        lines.collect()
    } else {
        heard
    };
    voices.iter().map(|v| v.on(&lines)).collect()
}

/// The records that say something about one: all others, and with several inputs those of other places.
fn others<'a>(voices: &[&'a Voice], voice: &Voice, nu: usize) -> Vec<&'a Voice> {
    let other = |v: &&&Voice| !std::ptr::eq(**v, voice) && (nu == 1 || v.position != voice.position);
    voices.iter().filter(other).copied().collect()
}

/// What these records together say of the response of output `i`, by line, then by input.
fn responses(of: &[&Voice], i: usize, nu: usize, together: &dyn Fn(&[C64]) -> C64) -> Vec<C64> {
    let lines = of.first().map_or(0, |v| v.frequencies_hz.len());
    let mut out = Vec::with_capacity(lines * nu);
    for k in 0..lines {
        for j in 0..nu {
            let own = |v: &&Voice| match nu {
                1 => v.outputs[i][k] / v.inputs[0][k],
                _ => v.response[(k * v.outputs.len() + i) * nu + j],
            };
            out.push(together(&of.iter().map(own).collect::<Vec<_>>()));
        }
    }
    out
}

/// What the inputs of a record give through a response of one output.
fn through(voice: &Voice, nu: usize, response: &[C64]) -> Vec<C64> {
    let lines = response.chunks_exact(nu).enumerate();
    lines
        .map(|(k, row)| row.iter().zip(&voice.inputs).map(|(g, u)| g * u[k]).sum())
        .collect()
}

/// The input over the reference against that of the others; none without references.
fn input_standing(voices: &[&Voice], voice: &Voice) -> Option<Standing> {
    let own = |v: &Voice, k: usize| Some(v.inputs.first()?[k] / v.references.first()?[k]);
    let lines = 0..voice.frequencies_hz.len();
    let of = lines.clone().map(|k| own(voice, k)).collect::<Option<Vec<_>>>()?;
    let others: Vec<&&Voice> = voices
        .iter()
        .filter(|v| voices.len() > 2 || !std::ptr::eq(**v, voice))
        .collect();
    let others = lines
        .map(|k| {
            Some(middle(
                &others.iter().map(|v| own(v, k)).collect::<Option<Vec<_>>>()?,
            ))
        })
        .collect::<Option<Vec<_>>>()?;
    standing(&of, &others)
}

fn apart(s: &Standing) -> bool {
    s.cosine < OPPOSITE || s.factor.ln().abs() > FACTOR.ln()
}

/// The records that stand apart, with sign and factor, where the others agree: of two both do, and the second is named.
fn odd(all: &[Standing]) -> Vec<(usize, f64)> {
    let odd: Vec<usize> = (0..all.len()).filter(|e| apart(&all[*e])).collect();
    let value = |e: usize| all[e].factor * if all[e].cosine < OPPOSITE { -1.0 } else { 1.0 };
    // Of two places an output may turn about the middle.
    if all.len() == 2 && odd.len() == 2 && all[1].factor.ln().abs() > PAIR.ln() {
        return vec![(1, value(1))];
    }
    if odd.is_empty() || 2 * odd.len() >= all.len() {
        return Vec::new();
    }
    // What is no sign must stand out of what the machine itself does over its positions.
    let spread = (0..all.len())
        .filter(|e| !odd.contains(e))
        .map(|e| all[e].factor.ln().abs())
        .fold(0.0, f64::max);
    let clear = |e: &usize| all[*e].cosine < OPPOSITE || all[*e].factor.ln().abs() > ALIKE * spread;
    odd.into_iter().filter(clear).map(|e| (e, value(e))).collect()
}

/// The factor that units and signs make, if one is near.
pub(super) fn named(factor: f64) -> f64 {
    let size = factor.abs();
    let off = |known: &f64| (size / known).ln().abs();
    let nearest = KNOWN.into_iter().min_by(|a, b| off(a).total_cmp(&off(b)));
    let size = if (1.0 / FACTOR..FACTOR).contains(&size) {
        // A sign alone; the machine changes a little over its positions.
        1.0
    } else {
        nearest.filter(|known| off(known) < FITS).unwrap_or(size)
    };
    factor.signum() * size
}

/// Whether units and signs make this factor.
pub(super) fn is_known(factor: f64) -> bool {
    factor == -1.0 || KNOWN.contains(&factor.abs())
}

/// Records of one place whose responses differ by more than noise; for one input.
fn disagreements(voices: &[Voice]) -> Vec<Finding> {
    let mut found = Vec::new();
    let mut done: Vec<&Option<Position>> = Vec::new();
    for voice in voices {
        if voice.inputs.len() != 1 || done.contains(&&voice.position) {
            continue;
        }
        done.push(&voice.position);
        let here: Vec<&Voice> = voices
            .iter()
            .filter(|v| v.position == voice.position && v.frequencies_hz == voice.frequencies_hz)
            .collect();
        if here.len() < 2 || voice.frequencies_hz.len() < LINES {
            continue;
        }
        let worst = (0..voice.outputs.len())
            .filter_map(|i| worst(&here, i))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((record, part, noise)) = worst {
            found.push(Finding::RecordsDisagree {
                place: match &voice.position {
                    Some(p) => format!("position {p:.4}"),
                    None => here
                        .iter()
                        .map(|v| v.record.as_str())
                        .collect::<Vec<_>>()
                        .join(", "),
                },
                record,
                records: here.len(),
                percent: crate::signal::finite(100.0 * part),
                noise_percent: crate::signal::finite(100.0 * noise),
            });
        }
    }
    found
}

/// The record whose response differs most from those of the others at one place, by how much of the response, and the noise of it.
fn worst(here: &[&Voice], i: usize) -> Option<(String, f64, f64)> {
    let response = |v: &Voice, k: usize| v.outputs[i][k] / v.inputs[0][k];
    let lines = 0..here.first().map_or(0, |v| v.frequencies_hz.len());
    let sums: Vec<C64> = lines
        .clone()
        .map(|k| here.iter().map(|v| response(v, k)).sum())
        .collect();
    let weakest = |k: usize| {
        here.iter()
            .map(|v| v.outputs[i][k].norm())
            .fold(f64::INFINITY, f64::min)
    };
    let weakest: Vec<f64> = lines.map(weakest).collect();
    let judged = here.iter().filter_map(|voice| {
        let (mut squares, mut noise, mut lines) = (0.0_f64, 0.0_f64, 0.0_f64);
        for k in 0..voice.frequencies_hz.len() {
            let own = response(voice, k);
            let other = (sums[k] - own) / (here.len() - 1) as f64;
            let size = 0.5 * (own.norm() + other.norm());
            let (a, b) = (
                ((own - other) / size).norm_sqr(),
                2.0 * (voice.noise[i][k] / weakest[k]).powi(2),
            );
            if a.is_finite() && b.is_finite() && b < 1.0 {
                squares += a.min(1.0);
                noise += b;
                lines += 1.0;
            }
        }
        let (part, noise) = ((squares / lines).sqrt(), (noise / lines).sqrt());
        (lines >= LINES as f64 && part > DISAGREE && part > OVER_NOISE * noise)
            .then(|| (voice.record.clone(), part, noise))
    });
    judged.max_by(|a, b| a.1.total_cmp(&b.1))
}

#[cfg(test)]
#[path = "compare/tests.rs"]
mod tests;
