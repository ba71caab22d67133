//! What the units of signals say: which are angles, and which further signals are temperatures.

use super::Track;
use lpv_core::Signals;
use lpv_numerics::statistics::{mean, range};
use std::f64::consts::TAU;

/// A whole turn in the unit of an angle; none of another unit.
pub(crate) fn turn_in(unit: &str) -> Option<f64> {
    match unit.trim() {
        "rad" => Some(TAU),
        "mrad" => Some(1e3 * TAU),
        "urad" | "µrad" | "μrad" => Some(1e6 * TAU),
        "deg" | "°" | "degree" | "degrees" => Some(360.0),
        "rev" | "turn" | "turns" => Some(1.0),
        _ => None,
    }
}

/// Units of a temperature. Kelvin and degrees of Fahrenheit have no other meaning beside an axis.
const UNITS: [&str; 10] = [
    "°c", "degc", "deg c", "celsius", "°f", "degf", "k", "kelvin", "grad c", "c",
];
/// Words of a name that say so.
const WORDS: [&str; 5] = ["temp", "temperature", "temperatur", "tmp", "celsius"];

/// Indices of the signals that are temperatures, by their units, and where those are not given by a word of their names.
pub(super) fn temperatures(signals: &Signals) -> Vec<usize> {
    let is_one = |i: &usize| {
        let unit = signals.units.get(*i).map_or("", String::as_str).trim();
        let name = signals.names.get(*i).map_or("", String::as_str);
        match unit {
            "" => words(name).any(|w| WORDS.contains(&w.as_str())),
            unit => UNITS.contains(&unit.to_lowercase().as_str()),
        }
    };
    (0..signals.channels()).filter(is_one).collect()
}

/// Words of a name, in small letters: `coilTemp_2` has `coil` and `temp`.
fn words(name: &str) -> impl Iterator<Item = String> {
    let mut parts = vec![String::new()];
    let mut before = ' ';
    for c in name.chars() {
        if !c.is_alphabetic() || c.is_uppercase() && before.is_lowercase() {
            parts.push(String::new());
        }
        if let (true, Some(last)) = (c.is_alphabetic(), parts.last_mut()) {
            last.extend(c.to_lowercase());
        }
        before = c;
    }
    parts.into_iter().filter(|w| !w.is_empty())
}

impl Track {
    /// Value of a further signal between two samples.
    pub(crate) fn auxiliary_at(&self, signal: usize, k: usize, part: f64) -> f64 {
        let Some(column) = self.auxiliary.get(signal) else {
            return 0.0;
        };
        let next = column[(k + 1).min(self.samples - 1)];
        column[k] + part * (next - column[k])
    }

    /// Temperatures that all records have and that change within or among them, with their means.
    pub(crate) fn warming(tracks: &[Self]) -> Vec<(usize, f64)> {
        let first = tracks.first().map_or(&[][..], |t| &t.temperatures);
        let all = first
            .iter()
            .filter(|i| tracks.iter().all(|t| t.temperatures.contains(i)));
        let seen = all.filter_map(|&i| {
            let values: Vec<f64> = tracks
                .iter()
                .flat_map(|t| t.auxiliary[i].iter().copied())
                .collect();
            let (low, high) = range(&values);
            (high > low).then(|| (i, mean(&values)))
        });
        seen.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_temperature_is_known_by_its_unit_or_its_name() {
        let all = [
            ("T_1", "°C", true),
            ("coilTemp", "", true),
            ("motor temperature 2", "", true),
            ("Temp", "V", false),
            ("vel_mot_1", "", false),
            ("vel_mot_1", "deg/s", false),
            ("template", "", false),
            ("hall", "K", true),
        ];
        for (name, unit, wanted) in all {
            let signals = Signals {
                names: vec![name.to_owned()],
                units: vec![unit.to_owned()],
                columns: vec![vec![0.0]],
            };
            assert_eq!(!temperatures(&signals).is_empty(), wanted, "{name} {unit}");
        }
    }
}
