//! Responses as columns of real numbers: `frequency`, and of each channel `y/u re` and `y/u im`, or magnitude and phase.

use super::names::{
    COHERENCE, DECIBEL, DEGREES, FREQUENCY, IM, MAGNITUDE, OMEGA, RADIANS, RE, VARIANCE, column,
};
use super::raw::{Asked, Raw, Spread};
use crate::RecordError;
use crate::columns;
use crate::error::ResponseFault;
use lpv_core::num_complex::Complex;
use std::f64::consts::TAU;

pub(super) fn read(asked: &Asked<'_>) -> Result<Raw, RecordError> {
    let (outputs, inputs) = asked.names();
    // Column by column, as a matrix is kept.
    let channels: Vec<(&String, &String)> = inputs
        .iter()
        .flat_map(|u| outputs.iter().map(move |y| (y, u)))
        .collect();
    let of = |part: &str| -> Vec<String> { channels.iter().map(|(y, u)| column(y, u, part)).collect() };
    // A column that is there and cannot be read is no absent one.
    let there = |name: &String| {
        let source = asked.entry.source_of(name);
        let read = columns::read_columns_as(asked.path, &[source], asked.text);
        source != name || !matches!(read, Err(RecordError::ColumnMissing { .. }))
    };
    let first_of = |parts: &[&'static str]| parts.iter().copied().find(|part| of(part).iter().any(there));
    // What is not there at all is missed by its real and imaginary parts.
    let polar = match first_of(&[RE, IM]) {
        Some(_) => None,
        None => first_of(&[MAGNITUDE, DECIBEL]).map(|size| {
            let phase = first_of(&[DEGREES, RADIANS]).unwrap_or(DEGREES);
            (size, phase)
        }),
    };
    let (one, other) = polar.unwrap_or((RE, IM));
    // What the description says goes before what a name says.
    let says = |name: &str| asked.entry.columns.contains_key(name);
    let in_turns =
        says(OMEGA) || !says(FREQUENCY) && !there(&FREQUENCY.to_owned()) && there(&OMEGA.to_owned());
    let at = match in_turns {
        true => OMEGA,
        false => FREQUENCY,
    };
    let mut names = vec![at.to_owned()];
    names.extend(of(one));
    names.extend(of(other));
    let parts = channels.len();
    let spread = first_of(&[VARIANCE, COHERENCE]);
    names.extend(spread.map(of).into_iter().flatten());
    let averages = Some("averages".to_owned()).filter(there);
    names.extend(averages.clone());
    let sources: Vec<&str> = names.iter().map(|n| asked.entry.source_of(n)).collect();
    let all = match columns::read_columns_as(asked.path, &sources, asked.text) {
        Err(RecordError::ColumnMissing { column, nearest, .. }) => {
            return Err(missing(asked, &names, &column, nearest));
        }
        read => read?,
    };
    let lines = all[0].len();
    let of_lines = all.len() - usize::from(averages.is_some());
    if let Some(k) = all[..of_lines].iter().position(|c| c.len() != lines) {
        return Err(RecordError::UnequalLengths {
            column: names[k].clone(),
            found: all[k].len(),
            first: names[0].clone(),
            expected: lines,
        });
    }
    let block = |first: usize| &all[first..first + parts];
    let by_line = |columns: &[Vec<f64>]| -> Vec<f64> {
        (0..lines)
            .flat_map(|k| columns.iter().map(move |c| c[k]))
            .collect()
    };
    let pairs = by_line(block(1)).into_iter().zip(by_line(block(1 + parts)));
    let value = |(a, b): (f64, f64)| match polar {
        None => Complex::new(a, b),
        Some((size, phase)) => {
            let size = if size == DECIBEL {
                10.0_f64.powf(a / 20.0)
            } else {
                a
            };
            let phase = if phase == DEGREES { b.to_radians() } else { b };
            // Not `from_polar`, which asks for a finite phase: what is not finite is refused below, by its line.
            Complex::new(size * phase.cos(), size * phase.sin())
        }
    };
    let spread = match spread {
        Some(VARIANCE) => Spread::Variance(by_line(block(1 + 2 * parts))),
        Some(_) => Spread::Coherence(by_line(block(1 + 2 * parts))),
        None => Spread::Unknown,
    };
    Ok(Raw {
        frequencies_hz: match at {
            OMEGA => all[0].iter().map(|w| w / TAU).collect(),
            _ => all[0].clone(),
        },
        values: pairs.map(value).collect(),
        spread,
        averages: averages.and_then(|_| all[all.len() - 1].first().copied()),
        quantity: None,
    })
}

/// The refusal of a column that is not there, with those that are.
fn missing(asked: &Asked<'_>, names: &[String], source: &str, nearest: Vec<String>) -> RecordError {
    let name = names.iter().find(|n| asked.entry.source_of(n) == source);
    let present = columns::look_into(asked.path).map_or_else(|_| Vec::new(), |found| found.columns);
    ResponseFault::Missing {
        name: name.map_or(source, String::as_str).to_owned(),
        nearest,
        present: present.into_iter().map(|c| c.source.unwrap_or(c.name)).collect(),
    }
    .into()
}
