//! What a file claims, compared with what it can hold, before the crate `parquet` allocates for it: that crate makes
//! room for sizes in page headers and numbers of dictionary entries as they stand there.

use parquet::basic::Compression;
use parquet::file::metadata::ColumnChunkMetaData;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};

/// Bytes that snappy can make of one: its longest copy is 64 bytes from three.
const SNAPPY_RATIO: u64 = 22;
/// Rows a byte of file: one bit a row is the least that a column needs which is not constant, and snappy packs that.
const MOST_ROWS_A_BYTE: u64 = 8 * SNAPPY_RATIO;

pub(super) fn check_rows(rows: u64, bytes: u64) -> Result<(), String> {
    if rows / MOST_ROWS_A_BYTE > bytes {
        return Err(format!(
            "its footer claims {rows} rows, the file has {bytes} bytes"
        ));
    }
    Ok(())
}

/// The largest size that a packed byte can unpack to; the name of the codec if it is not read.
pub(super) fn ratio(chunk: &ColumnChunkMetaData) -> Result<u64, String> {
    match chunk.compression() {
        Compression::UNCOMPRESSED => Ok(1),
        Compression::SNAPPY => Ok(SNAPPY_RATIO),
        other => {
            let name = other.to_string();
            Err(name.split('(').next().unwrap_or_default().to_owned())
        }
    }
}

/// Walks over the headers of all pages of a column in one row group.
pub(super) fn check_chunk(
    file: &File,
    bytes: u64,
    chunk: &ColumnChunkMetaData,
    ratio: u64,
    rows: u64,
) -> Result<(), String> {
    let start = chunk
        .dictionary_page_offset()
        .unwrap_or_else(|| chunk.data_page_offset());
    let range = u64::try_from(start)
        .ok()
        .zip(u64::try_from(chunk.compressed_size()).ok());
    let range = range.and_then(|(start, size)| Some((start, start.checked_add(size)?)));
    let Some((mut at, end)) = range.filter(|(_, end)| *end <= bytes) else {
        return Err("its pages lie outside the file".to_owned());
    };
    let mut source = BufReader::with_capacity(256, file);
    while at < end {
        source.seek(SeekFrom::Start(at)).map_err(|e| e.to_string())?;
        let mut compact = Compact {
            source: &mut source,
            left: end - at,
        };
        let mut page = Page::default();
        compact.structure(&mut Vec::new(), &mut |path, value| page.note(path, value))?;
        let body = compact.left;
        if page.packed > body || page.unpacked / ratio > page.packed {
            return Err(format!(
                "a page of {} bytes that claims to unpack to {} bytes",
                page.packed, page.unpacked
            ));
        }
        // A dictionary holds its entries one by one, a bit each at least.
        if page.entries / 8 > page.unpacked || page.values > rows {
            return Err(format!("a page of {} bytes claims too many values", page.packed));
        }
        at = end - body + page.packed;
    }
    Ok(())
}

/// Sizes of a page as its header says; what is absent or negative counts as endless.
struct Page {
    unpacked: u64,
    packed: u64,
    entries: u64,
    values: u64,
}

impl Default for Page {
    fn default() -> Self {
        Self {
            unpacked: u64::MAX,
            packed: u64::MAX,
            entries: 0,
            values: 0,
        }
    }
}

impl Page {
    /// Field numbers of `PageHeader` in the format's Thrift definition.
    fn note(&mut self, path: &[i64], value: i64) {
        let value = u64::try_from(value).unwrap_or(u64::MAX);
        match path {
            [2] => self.unpacked = value,
            [3] => self.packed = value,
            [5 | 8, 1] => self.values = value,
            [7, 1] => self.entries = value,
            _ => {}
        }
    }
}

/// Thrift's compact protocol, of which only integers are looked at.
struct Compact<'a, R> {
    source: &'a mut R,
    left: u64,
}

impl<R: Read> Compact<'_, R> {
    /// Reports every integer with the field numbers that lead to it.
    fn structure(&mut self, path: &mut Vec<i64>, found: &mut impl FnMut(&[i64], i64)) -> Result<(), String> {
        let mut field = 0i64;
        if path.len() > 16 {
            return Err("a page header nested too deep".to_owned());
        }
        loop {
            let start = self.byte()?;
            if start == 0 {
                return Ok(());
            }
            field = match start >> 4 {
                0 => self.integer()?,
                step => field + i64::from(step),
            };
            path.push(field);
            match start & 15 {
                // The values of truth stand in the type itself.
                1 | 2 => {}
                kind => self.value(kind, path, found)?,
            }
            path.pop();
        }
    }

    fn value(
        &mut self,
        kind: u8,
        path: &mut Vec<i64>,
        found: &mut impl FnMut(&[i64], i64),
    ) -> Result<(), String> {
        match kind {
            1..=3 => self.skip(1),
            4..=6 => {
                let value = self.integer()?;
                found(path, value);
                Ok(())
            }
            7 => self.skip(8),
            8 => {
                let length = self.varint()?;
                self.skip(length)
            }
            12 => self.structure(path, found),
            _ => Err("a page header with a list".to_owned()),
        }
    }

    fn byte(&mut self) -> Result<u8, String> {
        let mut byte = [0];
        self.claim(1)?;
        self.source.read_exact(&mut byte).map_err(|e| e.to_string())?;
        Ok(byte[0])
    }

    fn varint(&mut self) -> Result<u64, String> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 127) << shift;
            if byte < 128 {
                return Ok(value);
            }
        }
        Err("a page header with a number of more than 64 bits".to_owned())
    }

    fn integer(&mut self) -> Result<i64, String> {
        let value = self.varint()?;
        Ok((value >> 1) as i64 ^ -((value & 1) as i64))
    }

    fn skip(&mut self, bytes: u64) -> Result<(), String> {
        self.claim(bytes)?;
        let skipped = std::io::copy(&mut self.source.take(bytes), &mut std::io::sink());
        match skipped {
            Ok(skipped) if skipped == bytes => Ok(()),
            _ => Err("it ends inside a page header".to_owned()),
        }
    }

    fn claim(&mut self, bytes: u64) -> Result<(), String> {
        self.left = self
            .left
            .checked_sub(bytes)
            .ok_or("a page header longer than its column")?;
        Ok(())
    }
}
