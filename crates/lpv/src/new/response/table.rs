//! Tables with the frequency in one column and parts of responses in the others.

use super::Found;
use crate::PipelineError;
use crate::new::names::{plain_name, unit_of, words};
use crate::new::refuse;
use crate::new::roles::{Role, is_response as is_called_response, role_of};
use crate::new::see::{self, Seen};
use crate::new::write::layout;
use experiment_data::{Quantity, ResponseQuantity};
use std::f64::consts::TAU;

/// What a column holds of a response.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    Re,
    Im,
    Magnitude,
    Decibel,
    Degrees,
    Radians,
    /// A phase whose unit no name says.
    Phase,
    Coherence,
}

impl Part {
    fn name(self) -> &'static str {
        match self {
            Self::Re => "re",
            Self::Im => "im",
            Self::Magnitude => "magnitude",
            Self::Decibel => "dB",
            Self::Degrees | Self::Phase => "deg",
            Self::Radians => "rad",
            Self::Coherence => "coherence",
        }
    }

    /// By the words of a name and its unit.
    ///
    /// # Errors
    /// A phase in another unit.
    fn of(name: &str, unit: &str) -> Result<Option<Self>, String> {
        let plain = label(name);
        let words = words(&plain);
        let has = |list: &[&str]| words.iter().any(|w| list.contains(&w.as_str()));
        let unit = unit.to_lowercase();
        let lower = plain.to_lowercase();
        let in_decibel = unit == "db" || lower.split(|c: char| !c.is_alphanumeric()).any(|w| w == "db");
        if has(&["coherence", "coh", "kohärenz"]) {
            return Ok(Some(Self::Coherence));
        }
        if has(PHASES) {
            let own = |list: &[&str]| has(list) || list.contains(&unit.as_str());
            return if own(DEGREES) {
                Ok(Some(Self::Degrees))
            } else if own(RADIANS) {
                Ok(Some(Self::Radians))
            } else if unit.is_empty() {
                Ok(Some(Self::Phase))
            } else {
                Err(format!("`{name}` is in {unit}: give it in deg or rad"))
            };
        }
        Ok(if in_decibel {
            Some(Self::Decibel)
        } else if has(REALS) {
            Some(Self::Re)
        } else if has(IMAGINARIES) {
            Some(Self::Im)
        } else if has(SIZES) || plain.starts_with('|') {
            Some(Self::Magnitude)
        } else if plain.contains('/') && has(DEGREES) {
            Some(Self::Degrees)
        } else if plain.contains('/') && has(RADIANS) {
            Some(Self::Radians)
        } else {
            None
        })
    }

    fn is_size(self) -> bool {
        matches!(self, Self::Magnitude | Self::Decibel)
    }

    fn is_phase(self) -> bool {
        matches!(self, Self::Degrees | Self::Radians | Self::Phase)
    }
}

const REALS: &[&str] = &["re", "real", "realteil"];
const IMAGINARIES: &[&str] = &["im", "imag", "imaginary", "imaginärteil"];
const SIZES: &[&str] = &[
    "mag",
    "magnitude",
    "amplitude",
    "ampl",
    "gain",
    "abs",
    "betrag",
    "verstärkung",
];
const PHASES: &[&str] = &["phase", "phas", "angle", "arg", "winkel"];
const DEGREES: &[&str] = &["deg", "degree", "degrees", "°", "grad"];
const RADIANS: &[&str] = &["rad", "radian", "radians"];
/// Words beside these that say nothing of the channel.
const FILLERS: &[&str] = &[
    "frf",
    "response",
    "transfer",
    "function",
    "part",
    "of",
    "deg",
    "rad",
    "db",
    "degrees",
    "hz",
    "frequency",
];

/// A column with what its name says.
struct Column<'a> {
    name: &'a str,
    part: Part,
    /// Output and input, by number or by name.
    channel: Option<(String, String)>,
}

/// What the columns that all files have tell of a response.
///
/// # Errors
/// Columns that are no whole response, with what is missing.
pub(in crate::new) fn of_tables(seen: &[Seen], common: &[String]) -> Result<Found, PipelineError> {
    let first = &seen[0];
    let wrong = |problem: String| refuse(&first.file, format!("{problem}; {RESPONSE}"));
    let at = frequency(common).ok_or_else(|| wrong("no column is called a frequency".to_owned()))?;
    let unit = |name: &str| match first.unit(name) {
        "" => unit_of(name).unwrap_or("").to_owned(),
        unit => unit.to_owned(),
    };
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
    let values = |name: &str| -> Result<Vec<f64>, PipelineError> {
        Ok(first.read(&[name.to_owned()])?.swap_remove(0))
    };
    for column in &mut columns {
        let one = values(column.name)?;
        let (low, high) = lpv_numerics::statistics::range(&one);
        if column.part == Part::Phase {
            let is_radians = low.abs().max(high.abs()) <= 1.001 * TAU;
            column.part = if is_radians { Part::Radians } else { Part::Degrees };
            guesses.push(format!(
                "`{}` is in {}, by its range",
                column.name,
                column.part.name()
            ));
        }
        if column.part == Part::Magnitude && low < 0.0 {
            column.part = Part::Decibel;
            guesses.push(format!("`{}` is in dB: it goes below zero", column.name));
        }
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
        let polar = (
            one(&|p| p == Part::Magnitude)?.map_or_else(|| one(&Part::is_size), |c| Ok(Some(c)))?,
            one(&Part::is_phase)?,
        );
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
    let mut highest_hz = 0.0_f64;
    for file in seen {
        let frequencies = file.read(&[at.to_owned()])?.swap_remove(0);
        highest_hz = frequencies.into_iter().fold(highest_hz, f64::max);
    }
    if in_turns {
        highest_hz /= TAU;
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

/// Whether columns are those of a response: a frequency, and both parts of a number in half of the others.
pub(in crate::new) fn is_response(common: &[String], unit: impl Fn(&str) -> String) -> bool {
    let Some(at) = frequency(common) else {
        return false;
    };
    let others: Vec<&String> = common.iter().filter(|n| *n != at).collect();
    if others.iter().any(|n| role_of(n) == Some(Role::Time)) {
        return false;
    }
    let parts: Vec<Part> = others
        .iter()
        .filter_map(|n| Part::of(n, &unit(n)).ok().flatten())
        .collect();
    let has = |is: &dyn Fn(Part) -> bool| parts.iter().any(|p| is(*p));
    let both =
        has(&|p| p == Part::Re) && has(&|p| p == Part::Im) || has(&Part::is_size) && has(&Part::is_phase);
    both && 2 * parts.len() >= others.len() || is_called_response(common)
}

/// A name without its unit; of `Re(H11)` what stands in the brackets is none.
fn label(name: &str) -> String {
    match in_brackets(name) {
        Some((function, inside)) => format!("{function} {inside}"),
        None => plain_name(name),
    }
}

/// The function and what it is of: `Re(H11)`, and not `real(m/N)`.
fn in_brackets(name: &str) -> Option<(&str, &str)> {
    let (function, rest) = name.trim().split_once('(')?;
    let inside = rest.strip_suffix(')')?.trim();
    let all = [REALS, IMAGINARIES, &["abs", "mag", "arg", "angle"][..]].concat();
    let below = inside.rsplit('/').next().unwrap_or_default().trim();
    let is_unit = inside.contains('/') && Quantity::of_unit(below) == Quantity::Force || inside == "dB";
    let is_function = all.contains(&function.trim().to_lowercase().as_str());
    (is_function && !is_unit && !PHASE_UNITS.contains(&inside)).then_some((function.trim(), inside))
}

const PHASE_UNITS: [&str; 4] = ["deg", "rad", "°", "degrees"];

/// The column of the frequencies.
fn frequency(common: &[String]) -> Option<&str> {
    const SURE: [&str; 4] = ["frequency", "frequenz", "kreisfrequenz", "freq"];
    const WORDS: [&str; 4] = ["omega", "hz", "f", "w"];
    let with = |list: &'static [&'static str]| {
        common.iter().find(|name| {
            let own = words(&plain_name(name));
            let is_part = Part::of(name, "").ok().flatten().is_some();
            own.iter().any(|w| list.contains(&w.as_str()))
                && !name.contains('/') | name.contains("/s")
                && !is_part
        })
    };
    with(&SURE).or_else(|| with(&WORDS)).map(String::as_str)
}

/// Output and input by a name: `y1/u1 re`, `H12_real`, `G_2_1 (dB)`, and with one number the output alone.
fn channel(name: &str) -> Option<(String, String)> {
    let plain = match in_brackets(name) {
        Some((_, inside)) => inside.to_owned(),
        None => plain_name(name),
    };
    if let Some((output, rest)) = plain.split_once('/') {
        let input = rest.split([' ', '_']).next().unwrap_or(rest);
        let output = output.rsplit([' ', '(']).next().unwrap_or(output);
        if !output.is_empty() && !input.is_empty() {
            return Some((output.to_owned(), input.to_owned()));
        }
    }
    let numbers: Vec<&str> = plain
        .split(|c: char| !c.is_ascii_digit())
        .filter(|n| !n.is_empty())
        .collect();
    match numbers[..] {
        [y, u] => Some((format!("y{y}"), format!("u{u}"))),
        [both] if both.len() == 2 => Some((format!("y{}", &both[..1]), format!("u{}", &both[1..]))),
        [y] => Some((format!("y{y}"), "u1".to_owned())),
        _ => None,
    }
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
            let all = [REALS, IMAGINARIES, SIZES, PHASES, FILLERS, &["d", "b"]].concat();
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
const RESPONSE: &str = "these columns are those of a frequency response and no record in time; write an experiment.toml with \
    `kind = \"response\"` for this file, and the columns `frequency` in Hz (or `omega` in rad/s) and, for each output y and input u, \
    `y/u re` and `y/u im`, or `y/u magnitude` or `y/u dB` with `y/u deg` or `y/u rad` (`columns = { \"y/u re\" = ... }` where they have \
    other names); see docs/experiment-format.md";
