//! The values of one channel.

use super::malformed;
use super::segments::{Piece, Tdms};
use crate::RecordError;
use crate::columns::number::Number;
use std::io::{BufReader, Read, Seek, SeekFrom};

/// Bytes that are read at a time where values lie apart.
const BLOCK: usize = 1 << 18;

impl Tdms {
    /// All values of a channel. Ask for the memory first.
    pub(super) fn values(&mut self, name: &str, place: usize) -> Result<Vec<f64>, RecordError> {
        let Ok(number) = self.channels[place].number() else {
            return Ok(Vec::new());
        };
        // No more than the file has bytes.
        let mut column = Vec::with_capacity(self.channels[place].length as usize);
        let mut reader = BufReader::with_capacity(BLOCK, &self.file);
        for piece in &self.channels[place].pieces {
            let number = Number {
                big_endian: piece.big_endian,
                ..number
            };
            for chunk in 0..piece.chunks {
                let before = column.len() as u64;
                let at = piece.offset + chunk * piece.chunk_bytes;
                seek(&mut reader, at)?;
                if piece.stride == number.size as u64 {
                    column.extend(
                        number
                            .column(&mut reader, piece.count)
                            .map_err(RecordError::io("read"))?,
                    );
                } else {
                    apart(&mut reader, number, piece, &mut column)?;
                }
                if column.len() as u64 != before + piece.count {
                    return Err(malformed(name, "the file ends inside its values"));
                }
            }
        }
        Ok(column)
    }
}

/// Goes on in what is buffered, where that is possible.
fn seek(reader: &mut BufReader<&std::fs::File>, at: u64) -> Result<(), RecordError> {
    let now = reader.stream_position().map_err(RecordError::io("read"))?;
    let moved = match (i64::try_from(at), i64::try_from(now)) {
        (Ok(at), Ok(now)) => reader.seek_relative(at - now),
        _ => reader.seek(SeekFrom::Start(at)).map(drop),
    };
    moved.map_err(RecordError::io("read"))
}

/// Values that lie a stride apart.
fn apart(
    reader: &mut impl Read,
    number: Number,
    piece: &Piece,
    column: &mut Vec<f64>,
) -> Result<(), RecordError> {
    let stride = usize::try_from(piece.stride).unwrap_or(usize::MAX);
    let rows = (BLOCK / stride.max(1)).max(1) as u64;
    let mut left = piece.count;
    let mut block = Vec::new();
    while left > 0 {
        let now = left.min(rows);
        block.clear();
        // The last value needs no whole stride.
        let bytes = (now - 1) * piece.stride + number.size as u64;
        let bytes = if now < left { now * piece.stride } else { bytes };
        let found = reader
            .by_ref()
            .take(bytes)
            .read_to_end(&mut block)
            .map_err(RecordError::io("read"))?;
        column.extend(
            block
                .chunks(stride)
                .filter(|c| c.len() >= number.size)
                .map(|c| number.value(c)),
        );
        if (found as u64) < bytes {
            return Ok(());
        }
        left -= now;
    }
    Ok(())
}
