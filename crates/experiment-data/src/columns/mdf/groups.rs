//! Which channels a file has, and how their values are stored.

use super::blocks::{Block, Blocks};
use super::conversion::{Conversion, conversion};
use super::malformed;
use super::raw::Raw;
use crate::RecordError;
use std::collections::HashMap;
use std::path::Path;

/// Structures deeper than this are no measurement.
const DEEPEST: usize = 8;
/// More channels than this are no measurement.
const MOST_CHANNELS: usize = 1 << 20;

/// Records of one kind.
#[derive(Debug)]
pub(super) struct Group {
    pub(super) name: String,
    /// Number of records.
    pub(super) rows: u64,
    pub(super) id: u64,
    /// Bytes of a record, and of these, bytes in front of the bits that say which values are invalid.
    pub(super) record_bytes: u64,
    data_bytes: u64,
    /// Its records have a length each.
    pub(super) is_variable: bool,
    pub(super) storage: usize,
}

/// Records of one group, or of several in turn.
#[derive(Debug)]
pub(super) struct Storage {
    /// Where its blocks begin.
    pub(super) data: u64,
    /// Bytes of the number of a group in front of each record.
    pub(super) id_bytes: usize,
    pub(super) groups: Vec<usize>,
}

/// How the values of a channel are stored.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stored {
    pub(super) raw: Raw,
    pub(super) conversion: Conversion,
    /// Byte of a record and bit in it that tell whether its value is invalid.
    pub(super) invalid: Option<(usize, u8)>,
}

/// A channel.
#[derive(Debug)]
pub(super) struct Channel {
    pub(super) name: String,
    pub(super) unit: String,
    pub(super) group: usize,
    /// Or in words what it is instead of numbers.
    pub(super) values: Result<Stored, String>,
}

/// An open file.
#[derive(Debug)]
pub(super) struct Mdf {
    pub(super) blocks: Blocks,
    pub(super) groups: Vec<Group>,
    pub(super) storages: Vec<Storage>,
    pub(super) channels: Vec<Channel>,
}

impl Mdf {
    pub(super) fn open(path: &Path) -> Result<Self, RecordError> {
        let (blocks, start) = Blocks::open(path)?;
        let mut mdf = Self {
            blocks,
            groups: Vec::new(),
            storages: Vec::new(),
            channels: Vec::new(),
        };
        let mut at = mdf.blocks.block(start, &[b"##HD"])?.link(0);
        while at != 0 {
            let block = mdf.blocks.block(at, &[b"##DG"])?;
            mdf.storage(&block)?;
            at = block.link(0);
        }
        Ok(mdf)
    }

    fn storage(&mut self, block: &Block) -> Result<(), RecordError> {
        let id_bytes = block.number::<1>(0) as usize;
        if !matches!(id_bytes, 0 | 1 | 2 | 4 | 8) {
            return Err(malformed("", &format!("record numbers of {id_bytes} bytes")));
        }
        let storage = self.storages.len();
        let first = self.groups.len();
        let mut at = block.link(1);
        while at != 0 {
            let group = self.blocks.block(at, &[b"##CG"])?;
            self.group(&group, storage)?;
            at = group.link(0);
        }
        let groups: Vec<usize> = (first..self.groups.len()).collect();
        if id_bytes == 0 && groups.len() > 1 {
            return Err(malformed(
                "",
                "records of several groups that nothing tells apart",
            ));
        }
        self.storages.push(Storage {
            data: block.link(2),
            id_bytes,
            groups,
        });
        Ok(())
    }

    fn group(&mut self, block: &Block, storage: usize) -> Result<(), RecordError> {
        let flags = block.number::<2>(16);
        let (data_bytes, invalid_bytes) = (block.number::<4>(24), block.number::<4>(28));
        let group = self.groups.len();
        self.groups.push(Group {
            name: self.blocks.text(block.link(2))?,
            rows: block.number::<8>(8),
            id: block.number::<8>(0),
            record_bytes: data_bytes + invalid_bytes,
            data_bytes,
            is_variable: flags & 1 != 0,
            storage,
        });
        // Bytes of texts belong to a channel elsewhere; its master is another group in files with columns apart.
        if flags & 1 == 0 {
            let apart = flags & 8 != 0;
            self.chain(block.link(1), group, apart, 0)?;
        }
        Ok(())
    }

    fn chain(&mut self, first: u64, group: usize, apart: bool, depth: usize) -> Result<(), RecordError> {
        if depth == DEEPEST {
            return Err(malformed("", "structures nested too deep"));
        }
        let mut at = first;
        while at != 0 {
            let block = self.blocks.block(at, &[b"##CN"])?;
            if self.channels.len() == MOST_CHANNELS {
                return Err(malformed("", "more channels than any measurement has"));
            }
            let inner = block.link(1);
            let inner = match inner {
                0 => None,
                _ => Some(
                    self.blocks
                        .block(inner, &[b"##CN", b"##CA", b"##DS", b"##CL", b"##CU", b"##CV"])?
                        .id,
                ),
            };
            if inner == Some(*b"##CN") {
                self.chain(block.link(1), group, apart, depth + 1)?;
            } else {
                let channel = self.channel(&block, group, apart, inner.is_some())?;
                self.channels.push(channel);
            }
            at = block.link(0);
        }
        Ok(())
    }

    fn channel(
        &mut self,
        block: &Block,
        group: usize,
        apart: bool,
        is_array: bool,
    ) -> Result<Channel, RecordError> {
        let (kind, synchronises) = (block.number::<1>(0), block.number::<1>(1));
        let (conversion, converted_unit) = conversion(&mut self.blocks, block.link(4))?;
        let mut unit = self.blocks.text(block.link(6))?;
        if unit.is_empty() {
            unit = converted_unit;
        }
        // A master of times has them in seconds.
        if unit.is_empty() && matches!(kind, 2 | 3) && synchronises == 1 {
            "s".clone_into(&mut unit);
        }
        let own = &self.groups[group];
        let raw = match kind {
            _ if is_array => Err("an array".to_owned()),
            _ if apart => Err("columns apart from their records".to_owned()),
            1 => Err("text".to_owned()),
            3 | 6 => Ok(Raw::Index),
            _ => Raw::new(
                block.number::<1>(2),
                block.number::<4>(4),
                block.number::<1>(3),
                block.number::<4>(8),
                own.record_bytes,
            ),
        };
        let flags = block.number::<4>(12);
        let bit = block.number::<4>(16);
        let byte = own.data_bytes + bit / 8;
        let invalid = match flags & 3 {
            0 => Ok(None),
            2 if byte < own.record_bytes => Ok(Some((byte as usize, (bit % 8) as u8))),
            _ => Err("values that are all invalid".to_owned()),
        };
        let values = match (raw, conversion, invalid) {
            (Ok(raw), Ok(conversion), Ok(invalid)) => Ok(Stored {
                raw,
                conversion,
                invalid,
            }),
            (Err(what), ..) | (_, Err(what), _) | (.., Err(what)) => Err(what),
        };
        Ok(Channel {
            name: self.blocks.text(block.link(2))?,
            unit,
            group,
            values,
        })
    }

    pub(super) fn bytes(&self) -> u64 {
        self.blocks.bytes
    }

    /// Number of values of a channel.
    pub(super) fn rows(&self, place: usize) -> u64 {
        self.groups[self.channels[place].group].rows
    }

    /// Names of all channels where they are unique, with their group otherwise.
    pub(super) fn names(&self) -> Vec<String> {
        let mut times: HashMap<&str, usize> = HashMap::new();
        for channel in &self.channels {
            *times.entry(channel.name.as_str()).or_default() += 1;
        }
        let full = self.full_names();
        let own = self.channels.iter().zip(full);
        own.map(|(channel, full)| match times.get(channel.name.as_str()) {
            Some(1) => channel.name.clone(),
            _ => full,
        })
        .collect()
    }

    /// All names with that of the group, or with the number of the group where that has no name of its own.
    pub(super) fn full_names(&self) -> Vec<String> {
        let mut times: HashMap<&str, usize> = HashMap::new();
        for group in &self.groups {
            *times.entry(group.name.as_str()).or_default() += 1;
        }
        let label = |k: usize| match self.groups[k].name.as_str() {
            own if !own.is_empty() && times.get(own) == Some(&1) => own.to_owned(),
            _ => format!("group{}", k + 1),
        };
        let channels = self.channels.iter();
        channels
            .map(|c| format!("{}.{}", label(c.group), c.name))
            .collect()
    }
}
