//! Splits any row into fields.

use crate::text::Separator;
use csv_core::ReadRecordResult;

/// The fields of the row that was split last.
pub(super) struct Splitter {
    /// None splits at blanks.
    core: Option<csv_core::Reader>,
    text: Vec<u8>,
    ends: Vec<usize>,
    fields: usize,
}

impl Splitter {
    pub(super) fn new(separator: Separator) -> Self {
        let delimiter = match separator {
            Separator::Comma => Some(b','),
            Separator::Semicolon => Some(b';'),
            Separator::Tab => Some(b'\t'),
            Separator::Blanks => None,
        };
        Self {
            core: delimiter.map(|d| csv_core::ReaderBuilder::new().delimiter(d).build()),
            text: Vec::new(),
            ends: Vec::new(),
            fields: 0,
        }
    }

    /// The length of the first row, its end included; none if it does not end here.
    pub(super) fn split(&mut self, input: &[u8]) -> Option<usize> {
        let Some(core) = &mut self.core else {
            return self.split_at_blanks(input);
        };
        core.reset();
        let (mut used, mut written) = (0, 0);
        self.fields = 0;
        loop {
            let (result, i, o, e) = core.read_record(
                &input[used..],
                &mut self.text[written..],
                &mut self.ends[self.fields..],
            );
            used += i;
            written += o;
            self.fields += e;
            match result {
                ReadRecordResult::Record => return Some(used),
                ReadRecordResult::OutputFull => self.text.resize(2 * self.text.len() + 64, 0),
                ReadRecordResult::OutputEndsFull => self.ends.resize(2 * self.ends.len() + 8, 0),
                ReadRecordResult::InputEmpty | ReadRecordResult::End => return None,
            }
        }
    }

    /// A field in quotation marks may hold blanks, but no line end.
    fn split_at_blanks(&mut self, input: &[u8]) -> Option<usize> {
        let end = memchr::memchr2(b'\n', b'\r', input)?;
        self.text.clear();
        self.ends.clear();
        let mut rest = input[..end].trim_ascii_start();
        while !rest.is_empty() {
            let quoted = rest[0] == b'"';
            let length = if quoted {
                memchr::memchr(b'"', &rest[1..]).map_or(rest.len(), |at| at + 2)
            } else {
                memchr::memchr2(b' ', b'\t', rest).unwrap_or(rest.len())
            };
            let field = &rest[..length];
            let field = if quoted { &field[1..] } else { field };
            let field = field.strip_suffix(b"\"").unwrap_or(field);
            self.text.extend_from_slice(field);
            self.ends.push(self.text.len());
            rest = rest[length..].trim_ascii_start();
        }
        self.fields = self.ends.len();
        Some(end + 1)
    }

    pub(super) fn len(&self) -> usize {
        self.fields
    }

    pub(super) fn fields(&self) -> impl Iterator<Item = &[u8]> {
        (0..self.fields).map(|k| self.field(k))
    }

    pub(super) fn field(&self, k: usize) -> &[u8] {
        let start = if k == 0 { 0 } else { self.ends[k - 1] };
        &self.text[start..self.ends[k]]
    }
}

/// The text of a name: UTF-8, or Latin-1 where it is not.
pub(super) fn words(field: &[u8]) -> String {
    match std::str::from_utf8(field) {
        Ok(text) => text.trim().to_owned(),
        Err(_) => field
            .iter()
            .map(|b| char::from(*b))
            .collect::<String>()
            .trim()
            .to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_by_hand() {
        for (separator, row, fields) in [
            (Separator::Comma, "a,\"b,c\",\n", &["a", "b,c", ""][..]),
            (Separator::Semicolon, "1,5;2\r\n", &["1,5", "2"]),
            (Separator::Tab, "\ta b\t\n", &["", "a b", ""]),
            (Separator::Blanks, "  1.5 \t-2  \"a b\" \n", &["1.5", "-2", "a b"]),
            (Separator::Blanks, "\"open 1\n", &["open 1"]),
            (Separator::Blanks, " \n", &[]),
        ] {
            let mut splitter = Splitter::new(separator);
            assert!(splitter.split(row.as_bytes()).is_some());
            assert_eq!(splitter.fields().map(words).collect::<Vec<_>>(), fields, "{row}");
            assert_eq!(
                splitter.split(row.trim_end_matches(['\n', '\r']).as_bytes()),
                None
            );
        }
        assert_eq!(words(b"Weg [\xb5m]"), "Weg [µm]");
    }
}
