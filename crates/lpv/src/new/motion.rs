//! What an output tells of a motion: a position, a speed, an acceleration.

use super::names::{plain_name, words};
use experiment_data::Quantity;

/// What an output is: as its unit says, and where it has none as its name says.
pub(super) fn quantity_of(column: &str, unit: &str) -> Quantity {
    const ACCELERATIONS: [&str; 5] = ["acc", "accel", "acceleration", "accelerometer", "beschleunigung"];
    let has_acceleration = || {
        words(&plain_name(column))
            .iter()
            .any(|w| ACCELERATIONS.contains(&w.as_str()))
    };
    if !unit.is_empty() {
        Quantity::of_unit(unit)
    } else if has_acceleration() {
        Quantity::Acceleration
    } else if is_speed(column) == Some(true) {
        Quantity::Speed
    } else {
        Quantity::Position
    }
}

/// Whether a column is named after a speed or a position.
pub(super) fn is_speed(column: &str) -> Option<bool> {
    let name = plain_name(column).to_lowercase();
    let any = |parts: &[&str]| parts.iter().any(|p| name.contains(p));
    if any(&["speed", "velocity", "geschw", "drehzahl", "omega"])
        || words(&plain_name(column)).contains(&"vel".into())
    {
        Some(true)
    } else if any(&["pos", "angle", "winkel", "lage", "weg", "encoder", "theta"]) {
        Some(false)
    } else {
        None
    }
}

/// The factor from a unit of position or speed to its base unit: metres or radians, and a second.
pub(super) fn base_factor(unit: &str) -> Option<f64> {
    use std::f64::consts::TAU;
    Some(match unit.trim() {
        "m" | "m/s" | "rad" | "rad/s" => 1.0,
        "mm" | "mm/s" | "mrad" | "mrad/s" => 1e-3,
        "um" | "µm" | "um/s" | "µm/s" => 1e-6,
        "nm" | "nm/s" => 1e-9,
        "cm" | "cm/s" => 1e-2,
        "deg" | "°" | "deg/s" | "°/s" => TAU / 360.0,
        "rev" | "rev/s" => TAU,
        "rpm" | "1/min" | "U/min" | "rev/min" => TAU / 60.0,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_before_names() {
        for (name, unit, quantity) in [
            ("speed", "", Quantity::Speed),
            ("motor_vel", "", Quantity::Speed),
            ("Drehzahl", "rpm", Quantity::Speed),
            ("speed", "m", Quantity::Position),
            ("AccX", "", Quantity::Acceleration),
            ("acc_pos", "mm", Quantity::Position),
            ("vacuum", "", Quantity::Position),
            ("y", "", Quantity::Position),
        ] {
            assert_eq!(quantity_of(name, unit), quantity, "{name}");
        }
    }
}
