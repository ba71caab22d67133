//! The records of a storage, as one stream of bytes over its blocks, and the values in them.

use super::groups::{Group, Mdf, Stored};
use super::malformed;
use crate::RecordError;
use crate::columns::number::DEFLATE_RATIO;
use crate::memory::FREELY;
use flate2::read::ZlibDecoder;
use std::collections::HashMap;
use std::io::{Read, Seek, SeekFrom};

/// Bytes that are read at a time.
const BLOCK: u64 = 1 << 19;

/// Bytes of records in the file.
#[derive(Debug, Clone, Copy)]
struct Piece {
    at: u64,
    stored: u64,
    /// Bytes that it unpacks to.
    bytes: u64,
    packing: Packing,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Packing {
    None,
    Deflate,
    /// Deflate of a matrix with so many columns, transposed.
    Transposed(u64),
}

impl Mdf {
    /// Whether the blocks of a group can hold as many records as it claims.
    pub(super) fn check_claim(&mut self, name: &str, group: usize) -> Result<(), RecordError> {
        let storage = self.groups[group].storage;
        let bytes = self
            .pieces(storage)?
            .iter()
            .fold(0u64, |all, p| all.saturating_add(p.bytes));
        let own = &self.groups[group];
        let row = own.record_bytes + self.storages[storage].id_bytes as u64;
        if own.rows.saturating_mul(row) > bytes {
            let problem = format!(
                "it claims {} records of {row} bytes, its blocks have {bytes} bytes",
                own.rows
            );
            return Err(malformed(name, &problem));
        }
        Ok(())
    }

    /// The blocks of a storage, in order.
    fn pieces(&mut self, storage: usize) -> Result<Vec<Piece>, RecordError> {
        let mut pieces = Vec::new();
        // Blocks to look at, the next one last.
        let mut open = vec![self.storages[storage].data];
        while let Some(at) = open.pop() {
            if at == 0 {
                continue;
            }
            if open.len() as u64 > self.blocks.bytes / 8 {
                return Err(malformed(
                    "",
                    "its lists of blocks refer to each other in a circle",
                ));
            }
            let block = self
                .blocks
                .block(at, &[b"##DT", b"##DL", b"##HL", b"##DZ", b"##LD", b"##DV"])?;
            match &block.id {
                b"##DT" => pieces.push(Piece {
                    at: block.data_at,
                    stored: block.data_bytes,
                    bytes: block.data_bytes,
                    packing: Packing::None,
                }),
                b"##DL" => open.extend(block.links.iter().take(1).chain(block.links.iter().skip(1).rev())),
                b"##HL" => open.push(block.link(0)),
                b"##DZ" => {
                    let (bytes, stored) = (block.number::<8>(8), block.number::<8>(16));
                    let packing = match block.number::<1>(2) {
                        0 => Packing::Deflate,
                        1 => Packing::Transposed(block.number::<4>(4)),
                        other => return Err(unsupported(&format!("the packing {other}"))),
                    };
                    if stored.saturating_add(24) > block.data_bytes
                        || bytes / DEFLATE_RATIO > stored
                        || bytes > FREELY
                    {
                        return Err(malformed(
                            "",
                            &format!("{stored} bytes that claim to unpack to {bytes}"),
                        ));
                    }
                    pieces.push(Piece {
                        at: block.data_at + 24,
                        stored,
                        bytes,
                        packing,
                    });
                }
                _ => return Err(unsupported("columns apart from their records")),
            }
        }
        let stored = pieces
            .iter()
            .fold(0u64, |all, p: &Piece| all.saturating_add(p.stored));
        if stored > self.blocks.bytes {
            return Err(malformed("", "its blocks of records lie in each other"));
        }
        Ok(pieces)
    }

    /// The values of these channels, in their order. Ask [`Mdf::check_claim`] and for the memory first.
    pub(super) fn values(&mut self, wanted: &[usize]) -> Result<Vec<Vec<f64>>, RecordError> {
        let mut columns: Vec<Vec<f64>> = wanted
            .iter()
            .map(|&place| Vec::with_capacity(usize::try_from(self.rows(place)).unwrap_or(0)))
            .collect();
        for storage in 0..self.storages.len() {
            let mut takers: Vec<Taker<'_>> = Vec::new();
            for (&place, column) in wanted.iter().zip(&mut columns) {
                let channel = &self.channels[place];
                if let (Ok(stored), true) = (&channel.values, self.groups[channel.group].storage == storage) {
                    takers.push(Taker {
                        group: channel.group,
                        stored: *stored,
                        column,
                    });
                }
            }
            if !takers.is_empty() {
                let pieces = self.pieces(storage)?;
                self.fill(storage, &pieces, &mut takers)?;
            }
        }
        for (column, &place) in columns.iter().zip(wanted) {
            let (found, claimed) = (column.len(), self.rows(place));
            if found as u64 != claimed {
                let name = &self.channels[place].name;
                return Err(malformed(
                    name,
                    &format!("it claims {claimed} records, the file has {found}"),
                ));
            }
        }
        Ok(columns)
    }

    fn fill(&self, storage: usize, pieces: &[Piece], takers: &mut [Taker<'_>]) -> Result<(), RecordError> {
        let own = &self.storages[storage];
        let mut buffer = Vec::new();
        for piece in pieces {
            if self.is_full(takers) {
                break;
            }
            match piece.packing {
                Packing::None => {
                    let mut done = 0;
                    while done < piece.stored {
                        let now = BLOCK.min(piece.stored - done);
                        self.append(piece.at + done, now, &mut buffer)?;
                        done += now;
                        self.take(&mut buffer, storage, takers)?;
                    }
                }
                packing => {
                    let mut packed = Vec::new();
                    self.append(piece.at, piece.stored, &mut packed)?;
                    let mut plain = Vec::new();
                    ZlibDecoder::new(packed.as_slice())
                        .take(piece.bytes)
                        .read_to_end(&mut plain)
                        .map_err(|e| malformed("", &format!("a packed block: {e}")))?;
                    if plain.len() as u64 != piece.bytes {
                        return Err(malformed("", "a packed block is shorter than it claims"));
                    }
                    match packing {
                        Packing::Transposed(columns) => untranspose(&plain, columns, &mut buffer),
                        _ => buffer.append(&mut plain),
                    }
                    self.take(&mut buffer, storage, takers)?;
                }
            }
        }
        // Channels that are stored nowhere.
        if own.id_bytes == 0 && self.groups[takers[0].group].record_bytes == 0 {
            let rows = self.groups[takers[0].group].rows;
            takers.iter_mut().for_each(|t| {
                t.column
                    .extend((0..rows).map(|k| t.stored.conversion.apply(k as f64)))
            });
        }
        Ok(())
    }

    /// Takes the whole records at the front of the buffer out of it.
    fn take(
        &self,
        buffer: &mut Vec<u8>,
        storage: usize,
        takers: &mut [Taker<'_>],
    ) -> Result<(), RecordError> {
        let used = if self.storages[storage].id_bytes == 0 {
            sorted(buffer, &self.groups[takers[0].group], takers)
        } else {
            self.mixed(buffer, storage, takers)?
        };
        buffer.drain(..used);
        Ok(())
    }

    /// Whether every column has all its values.
    fn is_full(&self, takers: &[Taker<'_>]) -> bool {
        takers
            .iter()
            .all(|t| t.column.len() as u64 == self.groups[t.group].rows)
    }

    /// Bytes of the file behind those of the buffer.
    fn append(&self, at: u64, count: u64, buffer: &mut Vec<u8>) -> Result<(), RecordError> {
        let mut file = &self.blocks.file;
        file.seek(SeekFrom::Start(at)).map_err(RecordError::io("read"))?;
        let found = file
            .take(count)
            .read_to_end(buffer)
            .map_err(RecordError::io("read"))?;
        if (found as u64) < count {
            return Err(malformed("", "the file ends inside its records"));
        }
        Ok(())
    }

    /// Takes whole records of several groups; how many bytes they had.
    fn mixed(&self, buffer: &[u8], storage: usize, takers: &mut [Taker<'_>]) -> Result<usize, RecordError> {
        let own = &self.storages[storage];
        let groups: HashMap<u64, usize> = own.groups.iter().map(|&g| (self.groups[g].id, g)).collect();
        let mut at = 0;
        loop {
            let rest = &buffer[at..];
            let Some((id, rest)) = little(rest, own.id_bytes) else {
                return Ok(at);
            };
            let Some(&group) = groups.get(&id) else {
                return Err(malformed(
                    "",
                    &format!("a record of the group {id}, which is not described"),
                ));
            };
            let own_group = &self.groups[group];
            let (length, rest, head) = if own_group.is_variable {
                let Some((length, rest)) = little(rest, 4) else {
                    return Ok(at);
                };
                (length, rest, own.id_bytes + 4)
            } else {
                (own_group.record_bytes, rest, own.id_bytes)
            };
            let length = length as usize;
            let Some(record) = rest.get(..length) else {
                return Ok(at);
            };
            for taker in takers.iter_mut().filter(|t| t.group == group) {
                if (taker.column.len() as u64) < own_group.rows {
                    let index = taker.column.len() as u64;
                    taker.column.push(taker.stored.value(record, index));
                }
            }
            at += head + length;
        }
    }
}

/// Where the values of a channel go.
struct Taker<'a> {
    group: usize,
    stored: Stored,
    column: &'a mut Vec<f64>,
}

impl Stored {
    fn value(&self, record: &[u8], index: u64) -> f64 {
        if let Some((byte, bit)) = self.invalid
            && record[byte] & (1 << bit) != 0
        {
            return f64::NAN;
        }
        self.conversion.apply(self.raw.value(record, index))
    }
}

/// Takes whole records of one group; how many bytes they had.
fn sorted(buffer: &[u8], group: &Group, takers: &mut [Taker<'_>]) -> usize {
    let bytes = group.record_bytes as usize;
    if bytes == 0 {
        return buffer.len();
    }
    for taker in takers {
        let first = taker.column.len() as u64;
        let left = usize::try_from(group.rows - first).unwrap_or(usize::MAX);
        let records = buffer.chunks_exact(bytes).take(left);
        let stored = taker.stored;
        match (stored.raw.double(), stored.invalid) {
            // What most channels hold.
            (Some(at), None) => taker.column.extend(records.map(|record| {
                let own: [u8; 8] = std::array::from_fn(|i| record[at + i]);
                stored.conversion.apply(f64::from_le_bytes(own))
            })),
            _ => taker.column.extend(
                records
                    .zip(first..)
                    .map(|(record, index)| stored.value(record, index)),
            ),
        }
    }
    buffer.len() / bytes * bytes
}

/// A little-endian number in front, and what is behind it.
fn little(bytes: &[u8], size: usize) -> Option<(u64, &[u8])> {
    let (own, rest) = bytes.split_at_checked(size)?;
    let mut le = [0; 8];
    le[..size].copy_from_slice(own);
    Some((u64::from_le_bytes(le), rest))
}

/// A matrix of so many columns back in its order; bytes behind the last whole row stay as they are.
fn untranspose(plain: &[u8], columns: u64, out: &mut Vec<u8>) {
    let columns = usize::try_from(columns).unwrap_or(0).max(1);
    let rows = plain.len() / columns;
    for row in 0..rows {
        out.extend((0..columns).map(|column| plain[column * rows + row]));
    }
    out.extend_from_slice(&plain[rows * columns..]);
}

fn unsupported(what: &str) -> RecordError {
    RecordError::UnsupportedFormat {
        found: format!("MDF with {what}"),
        supported: "records, plain or deflated; save it as MDF 4.1",
    }
}

#[cfg(test)]
mod tests {
    use super::untranspose;

    #[test]
    fn transposed_by_hand() {
        let mut out = vec![9];
        untranspose(&[1, 3, 5, 2, 4, 6, 7], 2, &mut out);
        assert_eq!(out, [9, 1, 2, 3, 4, 5, 6, 7]);
        out.clear();
        untranspose(&[1, 2], 0, &mut out);
        untranspose(&[3], 5, &mut out);
        assert_eq!(out, [1, 2, 3]);
    }
}
