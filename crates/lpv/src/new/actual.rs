//! Inputs that a file has as commanded and as measured, or in several quantities: what acts on the machine is the input.

use super::names::{plain_name, unit_of, words};
use super::roles::{Role, role_of};
use super::{Groups, Known};

/// Words of what is wanted.
const COMMANDED: [&str; 18] = [
    "cmd",
    "command",
    "commanded",
    "ref",
    "reference",
    "set",
    "setpoint",
    "target",
    "des",
    "desired",
    "demand",
    "demanded",
    "nominal",
    "nom",
    "soll",
    "sollwert",
    "requested",
    "vorgabe",
];
/// Words of what is.
const ACTUAL: [&str; 10] = [
    "act", "actual", "meas", "measured", "ist", "istwert", "fbk", "feedback", "fb", "mes",
];

/// A name without the words that tell a command from what is measured.
#[derive(Debug, PartialEq)]
struct Signal {
    container: String,
    words: Vec<String>,
    digits: Vec<String>,
}

impl Signal {
    fn of(column: &str) -> Self {
        let plain = plain_name(column);
        let told = |w: &String| !COMMANDED.contains(&w.as_str()) && !ACTUAL.contains(&w.as_str());
        let digits = plain.split(|c: char| !c.is_ascii_digit());
        Self {
            container: column
                .rsplit_once('.')
                .map_or(String::new(), |(c, _)| c.to_owned()),
            words: words(&plain).into_iter().filter(told).collect(),
            digits: digits.filter(|d| !d.is_empty()).map(str::to_owned).collect(),
        }
    }

    fn role(&self) -> Option<Role> {
        role_of(&self.words.join("_"))
    }
}

fn is_commanded(column: &str) -> bool {
    let all = words(&plain_name(column));
    all.iter().any(|w| COMMANDED.contains(&w.as_str()))
}

/// Quantities of inputs, the one that is nearest to the force first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Quantity {
    Force,
    Current,
    Voltage,
}

/// What they are called.
const NAMES: [(Quantity, &[&str]); 3] = [
    (
        Quantity::Force,
        &[
            "force",
            "torque",
            "trq",
            "tau",
            "moment",
            "drehmoment",
            "kraft",
            "couple",
        ],
    ),
    (
        Quantity::Current,
        &["current", "cur", "curr", "iq", "amps", "strom", "courant", "i"],
    ),
    (
        Quantity::Voltage,
        &["voltage", "volt", "pwm", "spannung", "tension"],
    ),
];

impl Quantity {
    fn of(column: &str, unit: &str) -> Option<Self> {
        let all = words(&plain_name(column));
        let by_name = NAMES
            .iter()
            .find(|(_, names)| all.iter().any(|w| names.contains(&w.as_str())));
        match unit_of(column).unwrap_or(unit).trim() {
            "N" | "kN" | "mN" | "Nm" | "mNm" | "N m" | "N*m" => Some(Self::Force),
            "A" | "mA" => Some(Self::Current),
            "V" | "mV" => Some(Self::Voltage),
            _ => by_name.map(|(q, _)| *q),
        }
    }
}

impl Groups {
    /// Takes setpoints of inputs, and quantities of the same input that are farther from its force, to the further signals.
    pub(super) fn keep_what_acts(
        &mut self,
        known: &Known,
        unit: impl Fn(&str) -> String,
        guesses: &mut Vec<String>,
    ) {
        if known.reference.is_empty() {
            let wants_input = |name: &String| Signal::of(name).role() == Some(Role::Input);
            let of_inputs: Vec<String> = self
                .reference
                .iter()
                .filter(|n| wants_input(n))
                .cloned()
                .collect();
            self.reference.retain(|n| !of_inputs.contains(n));
            match self.input.is_empty() && known.input.is_empty() {
                true => self.input = of_inputs,
                false => {
                    for name in of_inputs {
                        guesses.push(format!("`{name}` is left aside: it is the setpoint of an input"));
                        self.auxiliary.push(name);
                    }
                }
            }
        }
        if !known.input.is_empty() {
            return;
        }
        let all = self.input.clone();
        let measured = |name: &String| {
            let others = all.iter().filter(|o| *o != name && !is_commanded(o));
            let mut same = others.filter(|o| Signal::of(o) == Signal::of(name));
            same.next().cloned()
        };
        for name in all.iter().filter(|n| is_commanded(n)) {
            if let Some(other) = measured(name) {
                guesses.push(format!(
                    "`{name}` is left aside: it is what is wanted of `{other}`, which is the input"
                ));
                self.input.retain(|n| n != name);
                self.auxiliary.push(name.clone());
            }
        }
        let quantity = |name: &String| Quantity::of(name, &unit(name));
        // The torque of a load is no other quantity of a current.
        let rest = |name: &String| {
            let is_quantity = |w: &String| NAMES.iter().any(|(_, names)| names.contains(&w.as_str()));
            let mut signal = Signal::of(name);
            signal.words.retain(|w| !is_quantity(w));
            signal
        };
        let are_one = self.input.windows(2).all(|w| rest(&w[0]) == rest(&w[1]));
        let kinds: Option<Vec<Quantity>> = self.input.iter().map(quantity).collect();
        let nearest = kinds.and_then(|k| k.into_iter().min());
        if let Some(nearest) = nearest.filter(|_| are_one && self.input.len() > self.output.len()) {
            let (kept, gone): (Vec<String>, Vec<String>) = std::mem::take(&mut self.input)
                .into_iter()
                .partition(|n| quantity(n) == Some(nearest));
            for name in &gone {
                guesses.push(format!(
                    "`{name}` is left aside: {} {} nearer to the force that it makes; if it is an input of its own, give --input",
                    kept.join(", "),
                    if kept.len() == 1 { "is" } else { "are" }
                ));
            }
            self.input = kept;
            self.auxiliary.extend(gone);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn laid(outputs: &[&str], inputs: &[&str], references: &[&str]) -> [Vec<String>; 4] {
        let [output, input, reference] =
            [outputs, inputs, references].map(|n| n.iter().map(ToString::to_string).collect());
        let mut groups = Groups {
            output,
            input,
            reference,
            ..Groups::default()
        };
        groups.keep_what_acts(&Known::default(), |_| String::new(), &mut Vec::new());
        [groups.output, groups.input, groups.reference, groups.auxiliary]
    }

    #[test]
    fn what_acts_is_the_input() {
        /// Outputs, inputs, references; inputs, references and further signals that are wanted.
        type Case = [&'static [&'static str]; 6];
        let all: [Case; 10] = [
            [
                &["pos"],
                &["current_cmd", "current_act"],
                &[],
                &["current_act"],
                &[],
                &["current_cmd"],
            ],
            [
                &["q1", "q2"],
                &["tau_des_1", "tau_1", "tau_des_2", "tau_2"],
                &["q_des"],
                &["tau_1", "tau_2"],
                &["q_des"],
                &["tau_des_1", "tau_des_2"],
            ],
            [
                &["pos"],
                &["Actual Current (A)"],
                &["Set Current (A)", "Set Position (mm)"],
                &["Actual Current (A)"],
                &["Set Position (mm)"],
                &["Set Current (A)"],
            ],
            // The only one there is.
            [&["pos"], &[], &["iq_ref"], &["iq_ref"], &[], &[]],
            [&["pos"], &["motor_cmd"], &[], &["motor_cmd"], &[], &[]],
            [
                &["pos"],
                &["voltage", "current"],
                &[],
                &["current"],
                &[],
                &["voltage"],
            ],
            [
                &["pos"],
                &["strom", "drehmoment [Nm]"],
                &["soll"],
                &["drehmoment [Nm]"],
                &["soll"],
                &["strom"],
            ],
            // A disturbance that was measured.
            [
                &["speed"],
                &["current", "load_torque"],
                &[],
                &["current", "load_torque"],
                &[],
                &[],
            ],
            // Two actuators, and what says nothing of its quantity.
            [
                &["x", "y"],
                &["voltage", "current"],
                &[],
                &["voltage", "current"],
                &[],
                &[],
            ],
            [&["y"], &["u", "current"], &[], &["u", "current"], &[], &[]],
        ];
        for [outputs, inputs, references, input, reference, auxiliary] in all {
            let found = laid(outputs, inputs, references);
            assert_eq!(
                found,
                [outputs, input, reference, auxiliary].map(|n| n.to_vec()),
                "{inputs:?}"
            );
        }
    }
}
