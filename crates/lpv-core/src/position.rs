//! Where an experiment at constant scheduling was made.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::Deref;

/// A constant value of the scheduling signals, one number each, in their units; in files a number where there is one signal, else a
/// list.
///
/// What holds one says whether its numbers may be any: a [`crate::Record`] and a [`crate::FrfEstimate`] refuse those that are not
/// finite.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(from = "Written", into = "Written")]
pub struct Position(Vec<f64>);

impl Position {
    /// The value of the only scheduling signal; none where there are several.
    #[must_use]
    pub fn single(&self) -> Option<f64> {
        match self.0.as_slice() {
            [value] => Some(*value),
            _ => None,
        }
    }
}

impl Deref for Position {
    type Target = [f64];
    fn deref(&self) -> &[f64] {
        &self.0
    }
}

impl From<f64> for Position {
    fn from(value: f64) -> Self {
        Self(vec![value])
    }
}

impl From<Vec<f64>> for Position {
    fn from(values: Vec<f64>) -> Self {
        Self(values)
    }
}

/// One number as it is, several in parentheses.
impl fmt::Display for Position {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let [value] = self.0.as_slice() {
            return value.fmt(f);
        }
        f.write_str("(")?;
        for (i, value) in self.0.iter().enumerate() {
            if i > 0 {
                f.write_str(", ")?;
            }
            value.fmt(f)?;
        }
        f.write_str(")")
    }
}

#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Written {
    One(f64),
    Several(Vec<f64>),
}

impl From<Written> for Position {
    fn from(written: Written) -> Self {
        match written {
            Written::One(value) => Self(vec![value]),
            Written::Several(values) => Self(values),
        }
    }
}

impl From<Position> for Written {
    fn from(position: Position) -> Self {
        match position.single() {
            Some(value) => Self::One(value),
            None => Self::Several(position.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Position;

    #[test]
    fn one_is_a_number_and_several_are_a_list() {
        for (position, text, json) in [
            (Position::from(0.25), "0.25", "0.25"),
            (Position::from(vec![0.1, -0.05]), "(0.1, -0.05)", "[0.1,-0.05]"),
        ] {
            assert_eq!(position.to_string(), text);
            assert_eq!(serde_json::to_string(&position).unwrap(), json);
            assert_eq!(serde_json::from_str::<Position>(json).unwrap(), position);
        }
        assert_eq!(format!("{:.1}", Position::from(vec![0.123, 2.0])), "(0.1, 2.0)");
        assert_eq!(Position::from(vec![1.0, 2.0]).single(), None);
    }
}
