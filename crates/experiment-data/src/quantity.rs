//! What signals and responses are: positions, speeds, accelerations, forces.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a signal is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Quantity {
    /// A length, an angle, counts of an encoder.
    Position,
    /// Its first derivative.
    Speed,
    /// Its second derivative.
    Acceleration,
    /// A force or torque.
    Force,
    /// Anything else.
    Other,
}

/// Units of positions, with a stroke and a time behind them of speeds and accelerations.
const POSITIONS: [&str; 22] = [
    "m", "km", "ft", "cm", "mm", "um", "µm", "μm", "nm", "in", "inch", "rad", "mrad", "urad", "µrad", "deg",
    "°", "rev", "count", "counts", "cts", "inc",
];
const SPEEDS: [&str; 5] = ["rpm", "1/min", "r/min", "U/min", "mph"];
const FORCES: [&str; 11] = [
    "N", "mN", "kN", "Nm", "N m", "N·m", "N*m", "N.m", "mNm", "kNm", "mN m",
];

impl Quantity {
    /// What a unit says: `m`, `rad`, `deg`, `counts` a position, `m/s`, `rpm` a speed, `m/s^2`, `g` an acceleration, `N`, `N m` a
    /// force; any other unit, and none, a position.
    #[must_use]
    pub fn of_unit(unit: &str) -> Self {
        let unit = unit.trim();
        let behind = |endings: &[&str]| {
            let base = endings.iter().find_map(|ending| unit.strip_suffix(ending));
            base.is_some_and(|base| POSITIONS.contains(&base.trim().trim_matches(['(', ')'])))
        };
        if FORCES.contains(&unit) {
            Self::Force
        } else if unit == "g" || behind(&["/s^2", "/s2", "/s²", "/s**2", "/s/s", " s^-2"]) {
            Self::Acceleration
        } else if SPEEDS.contains(&unit) || behind(&["/s", "/sec", "/ms", "/min", "/h", " s^-1"]) {
            Self::Speed
        } else {
            Self::Position
        }
    }

    /// How many times a position is differentiated; none for what is no motion.
    #[must_use]
    pub fn derivatives(self) -> Option<i32> {
        match self {
            Self::Position => Some(0),
            Self::Speed => Some(1),
            Self::Acceleration => Some(2),
            Self::Force | Self::Other => None,
        }
    }

    /// In words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Speed => "speed",
            Self::Acceleration => "acceleration",
            Self::Force => "force",
            Self::Other => "other",
        }
    }
}

/// What a measured frequency response is of, and over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum ResponseQuantity {
    /// Displacement over a measured force.
    #[serde(rename = "displacement/force", alias = "displacement", alias = "receptance")]
    DisplacementForce,
    /// Velocity over a measured force: mobility.
    #[serde(rename = "velocity/force", alias = "velocity", alias = "mobility")]
    VelocityForce,
    /// Acceleration over a measured force: accelerance.
    #[serde(rename = "acceleration/force", alias = "acceleration", alias = "accelerance")]
    AccelerationForce,
    /// Displacement over the samples of the input, which are held from one to the next.
    #[serde(rename = "displacement/input")]
    DisplacementInput,
    /// Velocity over these.
    #[serde(rename = "velocity/input")]
    VelocityInput,
    /// Acceleration over these.
    #[serde(rename = "acceleration/input")]
    AccelerationInput,
}

impl ResponseQuantity {
    /// Of a motion.
    #[must_use]
    pub fn motion(self) -> Quantity {
        match self {
            Self::DisplacementForce | Self::DisplacementInput => Quantity::Position,
            Self::VelocityForce | Self::VelocityInput => Quantity::Speed,
            Self::AccelerationForce | Self::AccelerationInput => Quantity::Acceleration,
        }
    }

    /// Whether it is over a force as it acts, in continuous time, and not over samples that are held.
    #[must_use]
    pub fn is_of_force(self) -> bool {
        matches!(
            self,
            Self::DisplacementForce | Self::VelocityForce | Self::AccelerationForce
        )
    }

    /// As the description has it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::DisplacementForce => "displacement/force",
            Self::VelocityForce => "velocity/force",
            Self::AccelerationForce => "acceleration/force",
            Self::DisplacementInput => "displacement/input",
            Self::VelocityInput => "velocity/input",
            Self::AccelerationInput => "acceleration/input",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_say_what_a_signal_is() {
        for (units, quantity) in [
            (
                &["m", "rad", "mm", "deg", "counts", "", "V", "s", "kg"][..],
                Quantity::Position,
            ),
            (
                &[
                    "m/s", "rad/s", "rpm", "mm/s", " deg/s ", "counts/s", "km/h", "mm/min", "rev/min",
                ],
                Quantity::Speed,
            ),
            (
                &["m/s^2", "g", "rad/s^2", "mm/s2", "m/s²"],
                Quantity::Acceleration,
            ),
            (&["N", "N m", "Nm", "kN"], Quantity::Force),
            (&["V/s", "A/s", "kg/s^2"], Quantity::Position),
        ] {
            for unit in units {
                assert_eq!(Quantity::of_unit(unit), quantity, "{unit}");
            }
        }
    }
}
