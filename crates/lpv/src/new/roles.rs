//! What a column's name and unit say about its role.

use super::names::{plain_name, unit_of, words};

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
            "des",
            "nominal",
            "nom",
            "commanded",
            "demand",
            "excitation",
            "soll",
            "sollwert",
            "vorgabe",
            "führungsgröße",
            "consigne",
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
            "couple",
            "courant",
        ],
    ),
    (
        Role::Output,
        &[
            "output",
            "out",
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
            "regelgröße",
            "regelgroesse",
            "mesure",
            "mesurée",
            "vitesse",
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

/// What is commanded and moves is a setpoint: a `position command`, a `commanded speed`.
const COMMANDED: &[&str] = &["command", "commanded", "cmd", "demanded"];
const MOTIONS: &[&str] = &[
    "pos",
    "position",
    "angle",
    "velocity",
    "speed",
    "vel",
    "acc",
    "accel",
    "acceleration",
    "theta",
    "omega",
];

/// Whether a column is the difference of two others by its name, such as a following error.
pub(super) fn is_difference(column: &str) -> bool {
    const WORDS: [&str; 14] = [
        "error",
        "err",
        "fehler",
        "schleppfehler",
        "following",
        "followerr",
        "diff",
        "difference",
        "differenz",
        "deviation",
        "abweichung",
        "lag",
        "residual",
        "erreur",
    ];
    words(&plain_name(column))
        .iter()
        .any(|w| WORDS.contains(&w.as_str()))
}

/// Whether the columns are those of a frequency response: its frequency and what it is there.
pub(super) fn is_response(columns: &[String]) -> bool {
    const AT: [&str; 5] = ["frequency", "freq", "frequenz", "omega", "hz"];
    const WHAT: [&str; 14] = [
        "mag",
        "magnitude",
        "amplitude",
        "gain",
        "phase",
        "re",
        "im",
        "real",
        "imag",
        "imaginary",
        "db",
        "coherence",
        "betrag",
        "verstärkung",
    ];
    let of = |column: &String| {
        let mut all = words(&plain_name(column));
        all.extend(unit_of(column).map(str::to_lowercase));
        all
    };
    let has = |column: &String, list: &[&str]| of(column).iter().any(|w| list.contains(&w.as_str()));
    let is_time = columns.iter().any(|c| role_of(c) == Some(Role::Time));
    !is_time
        && columns.iter().any(|c| has(c, &AT))
        && columns.iter().filter(|c| has(c, &WHAT)).count() >= columns.len().div_ceil(2).min(2)
}

/// The role that the name suggests; none where it says nothing.
pub(super) fn role_of(column: &str) -> Option<Role> {
    let name = plain_name(column);
    let words = words(&name);
    let lower = name.to_lowercase();
    let has = |of: &[&str]| words.iter().any(|w| of.contains(&w.as_str()));
    if has(COMMANDED) && has(MOTIONS) {
        return Some(Role::Reference);
    }
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

/// Whether a column is one of frequencies by its name: never a clock, however evenly it advances.
pub(super) fn is_frequency(column: &str) -> bool {
    const WORDS: [&str; 6] = ["frequency", "freq", "frequenz", "kreisfrequenz", "hz", "omega"];
    words(&plain_name(column))
        .iter()
        .any(|w| WORDS.contains(&w.as_str()))
}

/// The role that a unit suggests where the name says nothing: forces and currents go in, motions come out.
pub(super) fn role_of_unit(unit: &str) -> Option<Role> {
    match unit.trim() {
        "s" | "sec" | "second" | "seconds" | "Sekunden" | "ms" | "us" | "µs" => Some(Role::Time),
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
            ("Position Command", Some(Role::Reference)),
            ("commanded_speed [mm/s]", Some(Role::Reference)),
            ("motor_cmd", Some(Role::Input)),
            ("Position Actual", Some(Role::Output)),
            ("q_des", Some(Role::Reference)),
            ("s nominal X [mm]", Some(Role::Reference)),
            ("data(2).u", Some(Role::Input)),
            ("r61[0]: Drehzahlistwert (1/min)", Some(Role::Output)),
            ("FPOS(0)", None),
        ] {
            assert_eq!(role_of(name), role, "{name}");
        }
        for name in [
            "Error (mm)",
            "Axis1.PosDiff",
            "following_error",
            "Schleppfehler",
            "trackErr",
        ] {
            assert!(is_difference(name), "{name}");
        }
        for name in ["terror", "position", "lagerkraft", "y"] {
            assert!(!is_difference(name), "{name}");
        }
        let all = |names: &[&str]| names.iter().map(|n| (*n).to_owned()).collect::<Vec<_>>();
        for names in [
            &["Frequency [Hz]", "Mag [dB]", "Phase [deg]"][..],
            &["f (Hz)", "y/u re", "y/u im"],
            &["freq", "real", "imag", "coherence"],
        ] {
            assert!(is_response(&all(names)), "{names:?}");
        }
        for names in [
            &["t", "freq_cmd", "gain", "phase"][..],
            &["t", "u", "y"],
            &["frequency", "u", "y", "z"],
        ] {
            assert!(!is_response(&all(names)), "{names:?}");
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
