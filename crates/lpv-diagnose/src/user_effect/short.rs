//! Parameters and states in their short form: a text in the place of a table.

use super::{UserParameter, UserState};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;

/// Reads a type from a table, or from a text that is one field of it; `#[serde(remote = "Self")]` leaves the table to it.
macro_rules! either {
    ($type:ident, $field:ident, $expected:literal) => {
        impl<'de> Deserialize<'de> for $type {
            fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                struct Either;

                impl<'de> Visitor<'de> for Either {
                    type Value = $type;

                    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                        f.write_str($expected)
                    }

                    fn visit_str<E: Error>(self, text: &str) -> Result<$type, E> {
                        Ok($type {
                            $field: text.to_owned(),
                            ..$type::default()
                        })
                    }

                    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<$type, A::Error> {
                        $type::deserialize(MapAccessDeserializer::new(map))
                    }
                }

                deserializer.deserialize_any(Either)
            }
        }

        impl Serialize for $type {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                Self::serialize(self, serializer)
            }
        }
    };
}

either!(
    UserParameter,
    unit,
    "a unit, or a table with `unit`, `starts` and `positive`"
);
either!(
    UserState,
    rate,
    "the formula of a rate, or a table with `rate` and `start`"
);
