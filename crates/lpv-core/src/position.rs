//! Where an experiment at constant scheduling was made.

use serde::de::{Error, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::ops::Deref;

/// A constant value of the scheduling signals, one number each, in their units; in files a number where there is one signal, else a
/// list.
///
/// What holds one says whether its numbers may be any: a [`crate::Record`] and a [`crate::FrfEstimate`] refuse those that are not
/// finite.
#[derive(Debug, Clone, PartialEq)]
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

impl Serialize for Position {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.single() {
            Some(value) => value.serialize(serializer),
            None => self.0.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Position {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NumberOrList)
    }
}

struct NumberOrList;

impl<'de> Visitor<'de> for NumberOrList {
    type Value = Position;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number or a list of numbers, one a scheduling signal")
    }
    fn visit_f64<E>(self, value: f64) -> Result<Position, E> {
        Ok(value.into())
    }
    fn visit_i64<E>(self, value: i64) -> Result<Position, E> {
        Ok((value as f64).into())
    }
    fn visit_u64<E>(self, value: u64) -> Result<Position, E> {
        Ok((value as f64).into())
    }
    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Position, A::Error> {
        let mut values = Vec::new();
        while let Some(value) = list.next_element::<f64>()? {
            values.push(value);
        }
        match values.is_empty() {
            true => Err(A::Error::invalid_length(0, &self)),
            false => Ok(values.into()),
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
        for bad in ["\"0.1\"", "[]", "[[0.1]]", "[0.1, \"x\"]", "{}", "true"] {
            assert!(serde_json::from_str::<Position>(bad).is_err(), "{bad}");
        }
    }
}
