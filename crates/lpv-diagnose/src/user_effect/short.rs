//! Parameters and states in their short form: a text in the place of a table.

use super::{UserParameter, UserState};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::marker::PhantomData;

/// What has a short form.
trait Short: Sized {
    /// What a table is expected to be, for messages.
    const EXPECTED: &'static str;
    fn of_text(text: &str) -> Self;
    fn of_table<'de, D: Deserializer<'de>>(table: D) -> Result<Self, D::Error>;
}

impl Short for UserParameter {
    const EXPECTED: &'static str = "a unit, or a table with `unit`, `starts` and `positive`";

    fn of_text(text: &str) -> Self {
        Self {
            unit: text.to_owned(),
            ..Self::default()
        }
    }

    fn of_table<'de, D: Deserializer<'de>>(table: D) -> Result<Self, D::Error> {
        Self::deserialize(table)
    }
}

impl Short for UserState {
    const EXPECTED: &'static str = "the formula of a rate, or a table with `rate` and `start`";

    fn of_text(text: &str) -> Self {
        Self {
            rate: text.to_owned(),
            ..Self::default()
        }
    }

    fn of_table<'de, D: Deserializer<'de>>(table: D) -> Result<Self, D::Error> {
        Self::deserialize(table)
    }
}

struct Either<T>(PhantomData<T>);

impl<'de, T: Short> Visitor<'de> for Either<T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(T::EXPECTED)
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<T, E> {
        Ok(T::of_text(text))
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<T, A::Error> {
        T::of_table(MapAccessDeserializer::new(map))
    }
}

macro_rules! either {
    ($type:ty) => {
        impl<'de> Deserialize<'de> for $type {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                deserializer.deserialize_any(Either(PhantomData))
            }
        }

        impl Serialize for $type {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                Self::serialize(self, serializer)
            }
        }
    };
}

either!(UserParameter);
either!(UserState);
