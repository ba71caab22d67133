//! What a column's name and unit say about its role.

/// What a column holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    Time,
    Input,
    Output,
    Reference,
    Scheduling,
}

/// Parts of names, in the order in which they decide: a "current reference" is a reference.
const PARTS: [(Role, &[&str]); 5] = [
    (
        Role::Time,
        &[
            "time",
            "timestamp",
            "zeit",
            "clock",
            "seconds",
            "uhrzeit",
            "datum",
            "date",
        ],
    ),
    (
        Role::Reference,
        &[
            "ref",
            "setpoint",
            "set",
            "target",
            "desired",
            "demand",
            "excitation",
            "soll",
            "sollwert",
            "vorgabe",
            "führungsgröße",
        ],
    ),
    (
        Role::Scheduling,
        &["sched", "scheduling", "carriage", "location", "stellung"],
    ),
    (
        Role::Input,
        &[
            "input",
            "force",
            "torque",
            "current",
            "voltage",
            "drive",
            "motor_cmd",
            "command",
            "cmd",
            "iq",
            "cur",
            "curr",
            "amps",
            "trq",
            "tau",
            "pwm",
            "control",
            "volt",
            "moment",
            "drehmoment",
            "kraft",
            "strom",
            "spannung",
            "stellgröße",
            "stellgroesse",
        ],
    ),
    (
        Role::Output,
        &[
            "output",
            "pos",
            "position",
            "angle",
            "theta",
            "encoder",
            "enc",
            "velocity",
            "speed",
            "vel",
            "acc",
            "accel",
            "acceleration",
            "omega",
            "displacement",
            "measured",
            "meas",
            "sensor",
            "drehzahl",
            "geschwindigkeit",
            "beschleunigung",
            "weg",
            "lage",
            "winkel",
            "ist",
            "istwert",
            "auslenkung",
        ],
    ),
];

/// Single letters of the field, alone or with a number or index behind them.
const LETTERS: [(Role, &[&str]); 5] = [
    (Role::Time, &["t"]),
    (Role::Reference, &["r", "w", "sp"]),
    (Role::Scheduling, &["p"]),
    (Role::Input, &["u", "f", "i", "v"]),
    (Role::Output, &["y", "q", "x", "z", "phi"]),
];

/// The role that the name suggests; none where it says nothing.
pub(super) fn role_of(column: &str) -> Option<Role> {
    let name = plain_name(column);
    let words = words(&name);
    let lower = name.to_lowercase();
    for (role, parts) in PARTS {
        let inside = |part: &&str| part.chars().count() > 3 && lower.contains(*part);
        if words.iter().any(|w| parts.contains(&w.as_str())) || parts.iter().any(inside) {
            return Some(role);
        }
    }
    let first = lower
        .split(|c: char| !c.is_alphabetic())
        .find(|w| !w.is_empty())?;
    LETTERS
        .iter()
        .find(|(_, letters)| letters.contains(&first))
        .map(|(role, _)| *role)
}

/// The role that a unit suggests where the name says nothing: forces and currents go in, motions come out.
pub(super) fn role_of_unit(unit: &str) -> Option<Role> {
    match unit.trim() {
        "N" | "kN" | "mN" | "Nm" | "mNm" | "N m" | "N*m" | "A" | "mA" | "V" | "mV" => Some(Role::Input),
        "m" | "mm" | "um" | "µm" | "nm" | "rad" | "mrad" | "deg" | "°" | "m/s" | "mm/s" | "rad/s"
        | "deg/s" | "rpm" | "1/min" | "U/min" | "m/s^2" | "m/s²" | "rad/s^2" | "rad/s²" | "inc"
        | "counts" => Some(Role::Output),
        _ => None,
    }
}

/// Whether a column that rests in each file tells about the surroundings or the test and not about the position.
pub(super) fn is_no_position(column: &str) -> bool {
    const OTHER: [&str; 24] = [
        "temp",
        "temperature",
        "temperatur",
        "humidity",
        "feuchte",
        "pressure",
        "druck",
        "amp",
        "amplitude",
        "gain",
        "run",
        "nr",
        "no",
        "number",
        "nummer",
        "index",
        "idx",
        "seed",
        "count",
        "counter",
        "id",
        "date",
        "datum",
        "trial",
    ];
    const INSIDE: [&str; 4] = ["temperat", "humid", "amplitud", "celsius"];
    let name = plain_name(column);
    role_of(column) == Some(Role::Time)
        || matches!(
            unit_of(column),
            Some("°C" | "degC" | "C" | "K" | "%" | "bar" | "s" | "ms")
        )
        || words(&name).iter().any(|w| OTHER.contains(&w.as_str()))
        || INSIDE.iter().any(|part| name.to_lowercase().contains(part))
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

/// Of a struct only the field says what it is, and a unit in brackets does not count.
fn plain_name(column: &str) -> String {
    let column = column.split("(:").next().unwrap_or(column);
    let field = match column.find(['[', '(']) {
        Some(open) => column[..open].rsplit('.').next().unwrap_or(column),
        None => column.rsplit('.').next().unwrap_or(column),
    };
    field.trim().to_owned()
}

/// The words of a name in small letters, apart where anything but a letter or a capital after a small letter parts them.
fn words(name: &str) -> Vec<String> {
    let mut all = vec![String::new()];
    let mut small_before = false;
    for c in name.chars() {
        let begins = c.is_uppercase() && small_before;
        if (begins || !c.is_alphabetic()) && all.last().is_some_and(|w| !w.is_empty()) {
            all.push(String::new());
        }
        if c.is_alphabetic()
            && let Some(word) = all.last_mut()
        {
            word.extend(c.to_lowercase());
        }
        small_before = c.is_lowercase();
    }
    all.retain(|w| !w.is_empty());
    all
}

/// The unit in brackets behind a name: `force [N]`, `pos (mm)`.
pub(super) fn unit_of(column: &str) -> Option<&str> {
    let open = column.rfind(['[', '('])?;
    let inside = column
        .get(open + 1..)?
        .trim_end()
        .strip_suffix([']', ')'])?
        .trim();
    // The column of a matrix is no unit.
    (!inside.is_empty() && !inside.contains([':', '='])).then_some(inside)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_the_field() {
        for (name, role) in [
            ("u1", Some(Role::Input)),
            ("y_2", Some(Role::Output)),
            ("r", Some(Role::Reference)),
            ("p", Some(Role::Scheduling)),
            ("t", Some(Role::Time)),
            ("Time (s)", Some(Role::Time)),
            ("iq_ref", Some(Role::Reference)),
            ("motor current [A]", Some(Role::Input)),
            ("theta_mx", Some(Role::Output)),
            ("log.encoder", Some(Role::Output)),
            ("Zeit [ms]", Some(Role::Time)),
            ("Drehzahl [rad/s]", Some(Role::Output)),
            ("Moment [Nm]", Some(Role::Input)),
            ("Soll [rad/s]", Some(Role::Reference)),
            ("target_position", Some(Role::Reference)),
            ("ActPos", Some(Role::Output)),
            ("input (V)", Some(Role::Input)),
            ("data(:,3)", None),
            ("rec.pos(2,:)", Some(Role::Output)),
            ("uEst", None),
            ("temperature", None),
            ("", None),
        ] {
            assert_eq!(role_of(name), role, "{name}");
        }
        assert_eq!(unit_of("force [N]"), Some("N"));
        assert_eq!(unit_of("pos (mm) "), Some("mm"));
        assert_eq!((unit_of("x"), unit_of("data(:,3)")), (None, None));
        assert_eq!(role_of_unit("N"), Some(Role::Input));
        for name in [
            "Temp",
            "temperature_1",
            "t_room [°C]",
            "amplitude",
            "runNr",
            "time",
        ] {
            assert!(is_no_position(name), "{name}");
        }
        for name in ["x_pos", "q", "stellung", "slide", "templar"] {
            assert!(!is_no_position(name), "{name}");
        }
    }
}
