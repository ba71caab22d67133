//! Sample intervals and rates that a file states beside its samples: settings, and lines above the names.

use super::names::unit_of;
use super::time_unit::seconds;
use experiment_data::Scalar;

/// An interval that a file states.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stated {
    /// What states it, for messages.
    pub(super) what: String,
    /// The interval; finite and above zero.
    pub(super) seconds: f64,
    /// Whether it says in what unit.
    pub(super) has_unit: bool,
}

/// Names of sample intervals, whole, in small letters without anything else.
const INTERVALS: [&str; 9] = [
    "ts",
    "dt",
    "tsamp",
    "tsample",
    "tsampling",
    "deltat",
    "timestep",
    "wfincrement",
    "abscissaincrement",
];

/// Parts of such names.
const INSIDE_INTERVALS: [&str; 7] = [
    "sampleinterval",
    "samplinginterval",
    "sampletime",
    "samplingtime",
    "sampleperiod",
    "samplingperiod",
    "tastzeit",
];

/// Names of sample rates.
const RATES: [&str; 5] = ["fs", "fsamp", "fsample", "fsampling", "sps"];

/// Parts of such names.
const INSIDE_RATES: [&str; 6] = [
    "samplerate",
    "samplingrate",
    "samplefrequency",
    "samplingfrequency",
    "abtastrate",
    "abtastfrequenz",
];

/// Everything that is stated, in the order of the file: settings first.
pub(super) fn stated(notes: &[Vec<String>], scalars: &[Scalar]) -> Vec<Stated> {
    let settings = scalars.iter().filter_map(|s| {
        let (seconds, has_unit) = interval(&s.name, s.value, None)?;
        let what = format!("`{}` = {}", s.name, s.value);
        Some(Stated {
            what,
            seconds,
            has_unit,
        })
    });
    settings
        .chain(notes.iter().filter_map(|line| of_note(line)))
        .collect()
}

/// Whether the lines above the names are those of a kind of file that has its times in seconds.
pub(super) fn has_seconds(notes: &[Vec<String>]) -> bool {
    let mut cells = notes.iter().flatten();
    cells.any(|cell| cell.starts_with("LabVIEW Measurement"))
}

fn of_note(line: &[String]) -> Option<Stated> {
    // A key with its value in the next cell, or both in one cell; several settings may share a line.
    let (key, rest) = line.split_first()?;
    let in_cells = std::iter::once((key.as_str(), rest.join(" ")));
    let parts = line.iter().flat_map(|cell| cell.split([',', ';', '\t']));
    let in_one = line.iter().map(String::as_str).chain(parts).filter_map(|part| {
        let (key, value) = part.split_once([':', '='])?;
        Some((key, value.to_owned()))
    });
    in_cells
        .chain(in_one)
        .find_map(|(key, value)| setting(key, &value))
}

/// What a key and its value state: a number, with a unit behind it or not, and nothing else.
fn setting(key: &str, value: &str) -> Option<Stated> {
    let value = value.trim();
    let end = value
        .find(|c: char| !(c.is_ascii_digit() || "+-.,eE".contains(c)))
        .unwrap_or(value.len());
    let (number, unit) = value.split_at(end);
    let (key, unit) = (key.trim().trim_start_matches('#').trim(), unit.trim());
    // LabVIEW's name for the interval; with one for each signal it is none of all.
    let name = if key == "Delta_X" { "dt" } else { key };
    let (seconds, has_unit) = interval(name, number_of(number)?, Some(unit).filter(|u| !u.is_empty()))?;
    Some(Stated {
        what: format!("the line `{key}` above the names"),
        seconds,
        has_unit,
    })
}

/// A number with a decimal point or comma; none where a comma may as well part thousands.
fn number_of(text: &str) -> Option<f64> {
    if let Some((whole, part)) = text.split_once(',') {
        let groups = part.len() == 3 && !part.contains(['.', ',']) && !whole.starts_with('0');
        if groups || text.contains('.') {
            return None;
        }
    }
    text.replace(',', ".").parse().ok()
}

/// Whether this is the name of a sample interval or rate.
pub(super) fn is_clock(name: &str) -> bool {
    interval(name, 1.0, None).is_some()
}

/// The interval in seconds that a value of this name and unit is, and whether there is a unit; the name may have it in brackets.
fn interval(name: &str, value: f64, unit: Option<&str>) -> Option<(f64, bool)> {
    let unit = unit_of(name).or(unit);
    let own = name.rsplit('.').next().unwrap_or(name);
    let own = own.split(['[', '(']).next().unwrap_or(own);
    let letters: String = own
        .chars()
        .filter(|c| c.is_alphabetic())
        .flat_map(char::to_lowercase)
        .collect();
    let is = |whole: &[&str], inside: &[&str]| {
        whole.contains(&letters.as_str()) || inside.iter().any(|part| letters.contains(part))
    };
    let found = if is(&RATES, &INSIDE_RATES) {
        let hertz = match unit {
            None | Some("Hz" | "hz" | "S/s" | "1/s" | "samples/s") => 1.0,
            Some("kHz" | "kS/s" | "khz") => 1e3,
            Some("MHz" | "MS/s") => 1e6,
            Some(_) => return None,
        };
        1.0 / (value * hertz)
    } else if is(&INTERVALS, &INSIDE_INTERVALS) {
        value * unit.map_or(Some(1.0), seconds)?
    } else {
        return None;
    };
    (found.is_finite() && found > 0.0).then_some((found, unit.is_some()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_units_by_hand() {
        for (name, value, unit, seconds) in [
            ("fs", 2000.0, None, Some(5e-4)),
            ("settings.Fs", 2000.0, None, Some(5e-4)),
            ("Sample_Rate", 2.0, Some("kHz"), Some(5e-4)),
            ("Sampling frequency [Hz]", 2000.0, None, Some(5e-4)),
            ("Ts", 4.0, None, Some(4.0)),
            ("SampleTime[ms]", 0.5, None, Some(5e-4)),
            ("wf_increment", 1e-5, None, Some(1e-5)),
            ("Delta_X", 0.1, None, None),
            ("dt", 0.1, Some("ms"), Some(1e-4)),
            ("fs", 0.0, None, None),
            ("Ts", -1.0, None, None),
            ("Ts", f64::NAN, None, None),
            ("J", 1e-4, None, None),
            ("Tsim", 20.0, None, None),
            ("gains", 20.0, None, None),
            ("dt", 3.0, Some("mm"), None),
        ] {
            let found = interval(name, value, unit).map(|(seconds, _)| seconds);
            let near = match (found, seconds) {
                (Some(a), Some(b)) => (a / b - 1.0f64).abs() < 1e-12,
                (a, b) => a.is_none() && b.is_none(),
            };
            assert!(near, "{name} {value}: {found:?}");
        }
    }

    #[test]
    fn lines_above_the_names() {
        for (line, seconds) in [
            (&["Sample Interval", "5e-04"][..], Some(5e-4)),
            (&["SampleTime[ms]", "0,5"], Some(5e-4)),
            (&["Sample rate: 2 kHz"], Some(5e-4)),
            (&["# fs = 2000 Hz", ""], Some(5e-4)),
            (&["Delta_X", "5E-4", "5E-4"], None),
            (&["Delta_X", "5E-4"], Some(5e-4)),
            (&["Sampling rate", "2000 Hz"], Some(5e-4)),
            (&["dt=0.5ms"], Some(5e-4)),
            (&["Abtastrate", "2000"], Some(5e-4)),
            (&["Abtastrate", "2000,0", "Hz"], Some(5e-4)),
            (&["rig 3, dt = 0.5 ms, N = 4096"], Some(5e-4)),
            (&["rig 3", "Ts: 0,0005s"], Some(5e-4)),
            (&["fs", "2,000 Hz"], None),
            (&["dt", "0,500", "ms"], Some(5e-4)),
            (&["fs", "2000 Hz or so"], None),
            (&["Gain", "0.5"], None),
            (&["fs", "much"], None),
            (&["fs"], None),
            (&[], None),
        ] {
            let line: Vec<String> = line.iter().map(ToString::to_string).collect();
            let found = of_note(&line).map(|s| s.seconds);
            assert!(
                found.is_some() == seconds.is_some()
                    && found
                        .zip(seconds)
                        .is_none_or(|(a, b)| (a / b - 1.0f64).abs() < 1e-12),
                "{line:?}: {found:?}"
            );
        }
    }
}
