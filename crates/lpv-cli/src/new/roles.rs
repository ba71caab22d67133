//! What a column's name says about its role.

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
    (Role::Time, &["time", "timestamp", "zeit", "clock", "seconds"]),
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
        ],
    ),
    (Role::Scheduling, &["sched", "scheduling", "carriage", "location"]),
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
            "control",
            "volt",
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
            "acc",
            "omega",
            "displacement",
            "measured",
            "meas",
            "sensor",
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
    // Of a struct only the field says what it is, and a unit in brackets does not count.
    let name = column.rsplit('.').next().unwrap_or(column).to_lowercase();
    let name = name.split(['[', '(']).next().unwrap_or("").trim();
    let words: Vec<&str> = name
        .split(|c: char| !c.is_alphabetic())
        .filter(|w| !w.is_empty())
        .collect();
    for (role, parts) in PARTS {
        let inside = |part: &&str| part.len() > 3 && name.contains(*part);
        if words.iter().any(|w| parts.contains(w)) || parts.iter().any(inside) {
            return Some(role);
        }
    }
    let first = words.first()?;
    LETTERS
        .iter()
        .find(|(_, letters)| letters.contains(first))
        .map(|(role, _)| *role)
}

/// The unit in brackets behind a name: `force [N]`, `pos (mm)`.
pub(super) fn unit_of(column: &str) -> Option<&str> {
    let open = column.rfind(['[', '('])?;
    let inside = column
        .get(open + 1..)?
        .trim_end()
        .strip_suffix([']', ')'])?
        .trim();
    (!inside.is_empty()).then_some(inside)
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
            ("temperature", None),
            ("", None),
        ] {
            assert_eq!(role_of(name), role, "{name}");
        }
        assert_eq!(unit_of("force [N]"), Some("N"));
        assert_eq!(unit_of("pos (mm) "), Some("mm"));
        assert_eq!(unit_of("x"), None);
    }
}
