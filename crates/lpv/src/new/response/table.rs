//! Tables with the frequency in one column and parts of responses in the others.

use super::Found;
use super::part::{FILLERS, IMAGINARIES, PHASES, Part, REALS, SIZES, channel, frequency, in_brackets, label};
use crate::PipelineError;
use crate::new::names::words;
use crate::new::refuse;
use crate::new::see::{self, Seen};
use crate::new::write::layout;
use experiment_data::{Quantity, ResponseQuantity};
use std::f64::consts::TAU;

/// A column with what its name says.
struct Column<'a> {
    name: &'a str,
    part: Part,
    /// Output and input, by number or by name.
    channel: Option<(String, String)>,
}

/// What the ranges of all files tell of the columns whose names do not say their unit, and what was guessed from it: one unit for all
/// phases and one for all magnitudes, since one channel, or one file, may stay near zero.
fn look(columns: &mut [Column<'_>], ranges: &[[f64; 2]], unit: impl Fn(&str) -> String) -> Vec<String> {
    let list = |names: &[&str]| {
        names
            .iter()
            .map(|n| format!("`{n}`"))
            .collect::<Vec<_>>()
            .join(", ")
    };
    let are = |names: &[&str]| if names.len() == 1 { "is" } else { "are" };
    let any = |part: Part, goes_beyond: &dyn Fn(&[f64; 2]) -> bool| {
        let mut all = columns.iter().zip(ranges);
        all.any(|(c, range)| c.part == part && goes_beyond(range))
    };
    let in_degrees = any(Part::Phase, &|r| r[0].abs().max(r[1].abs()) > 1.001 * TAU);
    let in_decibel = any(Part::Magnitude, &|r| r[0] < 0.0);
    let (mut phases, mut sizes) = (Vec::new(), Vec::new());
    for column in columns {
        match column.part {
            Part::Phase => {
                column.part = if in_degrees { Part::Degrees } else { Part::Radians };
                phases.push(column.name);
            }
            Part::Magnitude if in_decibel => {
                column.part = Part::Decibel;
                sizes.push(column.name);
            }
            Part::Magnitude if unit(column.name).is_empty() => sizes.push(column.name),
            _ => {}
        }
    }
    let mut guesses = Vec::new();
    if !phases.is_empty() {
        let taken = if in_degrees { "deg" } else { "rad" };
        guesses.push(format!(
            "{} {} in {taken}, by the range",
            list(&phases),
            are(&phases)
        ));
    }
    if !sizes.is_empty() {
        let taken = match in_decibel {
            true => "in dB: values go below zero",
            false => "linear, not in dB: no unit is said, and no value goes below zero",
        };
        guesses.push(format!("{} {} {taken}", list(&sizes), are(&sizes)));
    }
    guesses
}

/// What the columns that all files have tell of a response.
///
/// # Errors
/// Columns that are no whole response, with what is missing.
pub(in crate::new) fn of_tables(seen: &[Seen], common: &[String]) -> Result<Found, PipelineError> {
    let first = &seen[0];
    let wrong = |problem: String| refuse(&first.file, format!("{problem}; {RESPONSE}"));
    let at = frequency(common).ok_or_else(|| wrong("no column is called a frequency".to_owned()))?;
    let unit = |name: &str| see::unit_of(seen, name);
    let lower = at.to_lowercase();
    let in_turns = match unit(at).as_str() {
        "" if lower.contains("khz") || lower.contains("mhz") => {
            return Err(wrong(format!(
                "`{at}` is not in Hz by its name: give it in Hz or rad/s"
            )));
        }
        "" => {
            let turns = ["omega", "w", "rad", "angular", "kreisfrequenz"];
            words(at).iter().any(|w| turns.contains(&w.as_str()))
        }
        "Hz" | "hz" => false,
        "rad/s" => true,
        "1/s" if lower.contains("kreis") || lower.contains("angular") => true,
        other => return Err(wrong(format!("`{at}` is in {other}: give it in Hz or rad/s"))),
    };
    let mut guesses = Vec::new();
    if unit(at).is_empty() && !lower.contains("hz") {
        let taken = if in_turns { "rad/s" } else { "Hz" };
        guesses.push(format!("`{at}` is in {taken}: it says no unit"));
    }
    let mut columns = Vec::new();
    for name in common.iter().filter(|n| *n != at) {
        let Some(part) = Part::of(name, &unit(name)).map_err(wrong)? else {
            guesses.push(format!(
                "`{name}` is left aside: its name says no part of a response"
            ));
            continue;
        };
        if part == Part::Coherence {
            guesses.push(format!(
                "`{name}` is left aside: a coherence needs the number of averages; add `averages` and `y/u coherence` to `columns`"
            ));
            continue;
        }
        let channel = channel(name);
        columns.push(Column { name, part, channel });
    }
    let names: Vec<String> = std::iter::once(at)
        .chain(columns.iter().map(|c| c.name))
        .map(str::to_owned)
        .collect();
    let mut highest_hz = 0.0_f64;
    let mut ranges = vec![[f64::INFINITY, f64::NEG_INFINITY]; columns.len()];
    for file in seen {
        let values = file.read(&names)?;
        highest_hz = values[0].iter().copied().fold(highest_hz, f64::max);
        for (range, values) in ranges.iter_mut().zip(&values[1..]) {
            let (low, high) = lpv_numerics::statistics::range(values);
            *range = [range[0].min(low), range[1].max(high)];
        }
    }
    guesses.extend(look(&mut columns, &ranges, unit));
    if in_turns {
        highest_hz /= TAU;
    }
    let by_digits = columns
        .iter()
        .any(|c| !c.name.contains('/') && c.channel.is_some());
    let (outputs, inputs) = channels(&mut columns).map_err(wrong)?;
    if by_digits {
        let (y, u) = (outputs.join(", "), inputs.join(", "));
        guesses.push(format!("outputs {y} and inputs {u}, by the numbers in the names"));
    }
    let mut places = vec![(
        (if in_turns { "omega" } else { "frequency" }).to_owned(),
        at.to_owned(),
    )];
    for (y, u) in inputs.iter().flat_map(|u| outputs.iter().map(move |y| (y, u))) {
        let own: Vec<&Column<'_>> = columns
            .iter()
            .filter(|c| c.channel.as_ref().is_some_and(|(a, b)| (a, b) == (y, u)))
            .collect();
        let one = |is: &dyn Fn(Part) -> bool| match own.iter().filter(|c| is(c.part)).collect::<Vec<_>>()[..]
        {
            [one] => Ok(Some(*one)),
            [] => Ok(None),
            [a, b, ..] => Err(wrong(format!(
                "`{}` and `{}` are the same part of {y}/{u}",
                a.name, b.name
            ))),
        };
        let re_im = (one(&|p| p == Part::Re)?, one(&|p| p == Part::Im)?);
        let size = one(&|p| p == Part::Magnitude)?.or(one(&|p| p == Part::Decibel)?);
        let polar = (size, one(&Part::is_phase)?);
        let pair = match (re_im, polar) {
            ((Some(re), Some(im)), _) => [re, im],
            (_, (Some(size), Some(phase))) => [size, phase],
            _ => {
                let there: Vec<&str> = own.iter().map(|c| c.name).collect();
                return Err(wrong(format!(
                    "of {y}/{u} there is {} and no real and imaginary part, and no magnitude with its phase",
                    if there.is_empty() {
                        "nothing".to_owned()
                    } else {
                        there.join(", ")
                    }
                )));
            }
        };
        places.extend(pair.map(|c| (format!("{y}/{u} {}", c.part.name()), c.name.to_owned())));
    }
    let parts = columns
        .iter()
        .filter(|c| matches!(c.part, Part::Re | Part::Magnitude));
    let ratios: Vec<String> = parts
        .map(|c| match in_brackets(c.name) {
            Some(_) => String::new(),
            None => unit(c.name),
        })
        .collect();
    if let Some(other) = ratios.iter().find(|r| **r != ratios[0]) {
        let first = &ratios[0];
        return Err(wrong(format!(
            "one part is in `{first}`, another in `{other}`: take a table for each unit, or write `units` and `scale` by hand"
        )));
    }
    for file in seen.iter().skip(1) {
        let named = std::iter::once(at).chain(columns.iter().map(|c| c.name));
        if let Some(name) = named.into_iter().find(|name| file.unit(name) != first.unit(name)) {
            let problem = format!(
                "`{name}` is in `{}`, in the first file in `{}`",
                file.unit(name),
                first.unit(name)
            );
            return Err(refuse(&file.file, format!("{problem}: take files of one unit")));
        }
    }
    let (units, scale, quantity) = of_ratio(ratios.first().map_or("", String::as_str));
    let sources = first.sources(common);
    let placed = |name: &String| {
        sources
            .iter()
            .find(|(n, _)| n == name)
            .map_or(name, |(_, place)| place)
            .clone()
    };
    let told: Vec<String> = places
        .iter()
        .map(|(part, place)| format!("{part} = `{place}`"))
        .collect();
    guesses.insert(0, told.join(", "));
    Ok(Found {
        columns: places
            .iter()
            .map(|(part, place)| (part.clone(), placed(place)))
            .filter(|(part, place)| part != place)
            .collect(),
        layout: see::text(seen).map_or(String::new(), |text| layout(&text)),
        outputs,
        inputs,
        quantity,
        units,
        scale,
        highest_hz,
        guesses,
    })
}

/// Names of outputs and inputs, in the order of the columns. Without a number or a name the words that are left are the output.
fn channels(columns: &mut [Column<'_>]) -> Result<(Vec<String>, Vec<String>), String> {
    if columns.is_empty() {
        return Err("no column is a part of a response".to_owned());
    }
    let named = columns.iter().filter(|c| c.channel.is_some()).count();
    if named != 0 && named != columns.len() {
        let bare = columns
            .iter()
            .find(|c| c.channel.is_none())
            .map_or("", |c| c.name);
        return Err(format!("`{bare}` says no channel where others do"));
    }
    if named == 0 {
        let mut keys: Vec<String> = Vec::new();
        for column in columns.iter_mut() {
            let all = [REALS, IMAGINARIES, SIZES, PHASES, FILLERS].concat();
            let own = words(&label(column.name));
            let key = own
                .into_iter()
                .filter(|w| !all.contains(&w.as_str()))
                .collect::<Vec<_>>()
                .join(" ");
            let number = keys.iter().position(|k| *k == key).unwrap_or_else(|| {
                keys.push(key);
                keys.len() - 1
            });
            column.channel = Some((format!("y{}", number + 1), "u1".to_owned()));
        }
    }
    let distinct = |of: fn(&(String, String)) -> &String| {
        let mut all: Vec<String> = Vec::new();
        for name in columns.iter().filter_map(|c| c.channel.as_ref()).map(of) {
            if !all.contains(name) {
                all.push(name.clone());
            }
        }
        all
    };
    Ok((distinct(|c| &c.0), distinct(|c| &c.1)))
}

/// Units of the outputs and inputs of a ratio such as `m/s^2/N`, what takes outputs in it to these units, and what such a response is.
fn of_ratio(unit: &str) -> (Option<(String, String)>, Option<f64>, Option<ResponseQuantity>) {
    /// Metres a square second of one g.
    const GRAVITY: f64 = 9.806_65;
    let trimmed = |text: &str| text.trim().trim_matches(['(', ')']).to_owned();
    let Some((output, input)) = unit.rsplit_once('/').map(|(y, u)| (trimmed(y), trimmed(u))) else {
        return (None, None, None);
    };
    // `m/s` and `rad/s` are units of a signal.
    if ["s", "s^2", "s2", "s²", ""].contains(&input.as_str()) {
        return (None, None, None);
    }
    let over_force = Quantity::of_unit(&input) == Quantity::Force;
    let quantity = match (Quantity::of_unit(&output), over_force) {
        (Quantity::Position, true) => ResponseQuantity::DisplacementForce,
        (Quantity::Speed, true) => ResponseQuantity::VelocityForce,
        (Quantity::Acceleration, true) => ResponseQuantity::AccelerationForce,
        (Quantity::Position, false) => ResponseQuantity::DisplacementInput,
        (Quantity::Speed, false) => ResponseQuantity::VelocityInput,
        (Quantity::Acceleration, false) => ResponseQuantity::AccelerationInput,
        (Quantity::Force | Quantity::Other, _) => return (None, None, None),
    };
    let (output, scale) = match output.as_str() {
        "g" => ("m/s^2".to_owned(), Some(GRAVITY)),
        _ => (output, None),
    };
    (Some((output, input)), scale, Some(quantity))
}

/// How to describe such a file by hand.
pub(super) const RESPONSE: &str = "these columns are those of a frequency response and no record in time; write an experiment.toml with \
    `kind = \"response\"` for this file, and the columns `frequency` in Hz (or `omega` in rad/s) and, for each output y and input u, \
    `y/u re` and `y/u im`, or `y/u magnitude` or `y/u dB` with `y/u deg` or `y/u rad` (`columns = { \"y/u re\" = ... }` where they have \
    other names); see docs/experiment-format.md";
