//! What the names of columns say of a response.

use crate::new::names::{plain_name, words};
use crate::new::roles::{Role, is_response as is_called_response, role_of};
use experiment_data::Quantity;

/// What a column holds of a response.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
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
    pub(super) fn name(self) -> &'static str {
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
    pub(super) fn of(name: &str, unit: &str) -> Result<Option<Self>, String> {
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
        } else if plain.contains('/') && has(DEGREES) || DEGREES.contains(&unit.as_str()) {
            Some(Self::Degrees)
        } else if plain.contains('/') && has(RADIANS) || RADIANS.contains(&unit.as_str()) {
            Some(Self::Radians)
        } else {
            None
        })
    }

    pub(super) fn is_size(self) -> bool {
        matches!(self, Self::Magnitude | Self::Decibel)
    }

    pub(super) fn is_phase(self) -> bool {
        matches!(self, Self::Degrees | Self::Radians | Self::Phase)
    }
}

pub(super) const REALS: &[&str] = &["re", "real", "realteil"];
pub(super) const IMAGINARIES: &[&str] = &["im", "imag", "imaginary", "imaginärteil"];
pub(super) const SIZES: &[&str] = &[
    "mag",
    "magnitude",
    "amplitude",
    "ampl",
    "gain",
    "abs",
    "betrag",
    "verstärkung",
];
pub(super) const PHASES: &[&str] = &["phase", "phas", "ph", "angle", "arg", "winkel"];
const DEGREES: &[&str] = &["deg", "degree", "degrees", "°", "grad"];
const RADIANS: &[&str] = &["rad", "radian", "radians"];
/// Words beside these that say nothing of the channel.
pub(super) const FILLERS: &[&str] = &[
    "frf",
    "response",
    "transfer",
    "function",
    "part",
    "of",
    "deg",
    "rad",
    "db",
    "d",
    "b",
    "degrees",
    "hz",
    "frequency",
];

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
pub(super) fn label(name: &str) -> String {
    match in_brackets(name) {
        Some((function, inside)) => format!("{function} {inside}"),
        None => plain_name(name),
    }
}

/// The function and what it is of: `Re(H11)`, and not `real(m/N)`.
pub(super) fn in_brackets(name: &str) -> Option<(&str, &str)> {
    // A unit behind it: `arg(G) [rad]`.
    let name = name.trim();
    let name = name.rfind(" [").map_or(name, |unit| &name[..unit]);
    let (function, rest) = name.split_once('(')?;
    let inside = rest.strip_suffix(')')?.trim();
    let all = [REALS, IMAGINARIES, &["abs", "mag", "arg", "angle"][..]].concat();
    let below = inside.rsplit('/').next().unwrap_or_default().trim();
    let is_unit = inside.contains('/') && Quantity::of_unit(below) == Quantity::Force || inside == "dB";
    let is_function = all.contains(&function.trim().to_lowercase().as_str());
    (is_function && !is_unit && !PHASE_UNITS.contains(&inside)).then_some((function.trim(), inside))
}

const PHASE_UNITS: [&str; 4] = ["deg", "rad", "°", "degrees"];

/// The column of the frequencies.
pub(super) fn frequency(common: &[String]) -> Option<&str> {
    const SURE: [&str; 4] = ["frequency", "frequenz", "kreisfrequenz", "freq"];
    const WORDS: [&str; 4] = ["omega", "hz", "f", "w"];
    let with = |list: &'static [&'static str]| {
        common.iter().find(|name| {
            let own = words(&plain_name(name));
            let is_part = Part::of(name, "").ok().flatten().is_some();
            own.iter().any(|w| list.contains(&w.as_str()))
                && (!name.contains('/') || name.contains("/s"))
                && !is_part
        })
    };
    with(&SURE).or_else(|| with(&WORDS)).map(String::as_str)
}

/// Output and input by a name: `y1/u1 re`, `H12_real`, `G_2_1 (dB)`, and with one number the output alone.
pub(super) fn channel(name: &str) -> Option<(String, String)> {
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
