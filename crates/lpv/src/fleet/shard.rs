//! A part of a list.

use super::FleetError;
use std::str::FromStr;

/// Number `k` of `N` parts of a list, written `k/N`: the entries k, k + N, k + 2 N, ... from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    number: usize,
    of: usize,
}

impl Shard {
    /// The whole list.
    pub const ALL: Self = Self { number: 1, of: 1 };

    /// Whether it holds the entry at this index, from 0. Neighbours go to different shards, since they often take as long as each other.
    pub fn takes(self, index: usize) -> bool {
        index % self.of == self.number - 1
    }
}

impl FromStr for Shard {
    type Err = FleetError;

    fn from_str(text: &str) -> Result<Self, FleetError> {
        let parts = text.split_once('/');
        let (number, of) = parts.ok_or(FleetError::Shard)?;
        match (number.parse(), of.parse()) {
            (Ok(number), Ok(of)) if (1..=of).contains(&number) => Ok(Self { number, of }),
            _ => Err(FleetError::Shard),
        }
    }
}
