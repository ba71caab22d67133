//! The values of a set, with their abscissas in turn where these are uneven.

use super::header::Spacing;
use super::malformed;
use super::sets::{Coding, Set};
use super::source::Source;
use crate::RecordError;
use crate::columns::number::{Class, DOUBLE, Number};
use std::io::{Read, Seek};

impl Set {
    /// Numbers that it claims: a value has one or two, and its abscissa one where these are stored.
    pub(super) fn numbers(&self) -> u64 {
        let each = 1 + u64::from(self.header.is_complex) + u64::from(self.header.spacing == Spacing::Uneven);
        self.header.points.saturating_mul(each)
    }

    /// Compares what it claims with what it has, before any memory is taken.
    pub(super) fn check_claim(&self, name: &str) -> Result<(), RecordError> {
        let has = self.values.end - self.values.start;
        // Of text, a number takes a digit and what stands between it and the next. Bytes were counted when the set was found.
        let fits = self.coding != Coding::Text || self.numbers().saturating_mul(2) <= has.saturating_add(1);
        if fits {
            return Ok(());
        }
        let points = self.header.points;
        Err(malformed(
            name,
            &format!("its header claims {points} values, which do not fit its {has} bytes"),
        ))
    }

    /// All numbers in their order. Ask [`Set::check_claim`] first.
    pub(super) fn values<R: Read + Seek>(
        &self,
        name: &str,
        source: &mut Source<R>,
    ) -> Result<Vec<f64>, RecordError> {
        match self.coding {
            Coding::Text => {
                let mut text = Vec::new();
                source.pieces(self.values.clone(), 1, |piece| text.extend_from_slice(piece))?;
                self.of_text(name, &text)
            }
            Coding::Bytes {
                big_endian,
                abscissa_bytes,
            } => {
                let values = 1 + usize::from(self.header.is_complex);
                let point = abscissa_bytes + self.header.width() * values;
                let mut all = Vec::with_capacity(self.numbers() as usize);
                source.pieces(self.values.clone(), point, |piece| {
                    self.of_bytes(piece, (big_endian, abscissa_bytes, point), &mut all);
                })?;
                Ok(all)
            }
        }
    }

    /// The numbers of whole points.
    fn of_bytes(
        &self,
        part: &[u8],
        (big_endian, abscissa_bytes, point): (bool, usize, usize),
        all: &mut Vec<f64>,
    ) {
        let number = |size| Number {
            class: Class::Float,
            size,
            big_endian,
        };
        let value = number(self.header.width());
        if abscissa_bytes == 0 {
            let numbers = part.chunks_exact(value.size);
            match value {
                DOUBLE => all.extend(numbers.map(|c| f64::from_le_bytes(std::array::from_fn(|i| c[i])))),
                _ => all.extend(numbers.map(|c| value.value(c))),
            }
            return;
        }
        let abscissa = number(abscissa_bytes);
        for c in part.chunks_exact(point) {
            let values = c[abscissa_bytes..].chunks_exact(value.size);
            all.push(abscissa.value(&c[..abscissa_bytes]));
            all.extend(values.map(|v| value.value(v)));
        }
    }

    fn of_text(&self, name: &str, part: &[u8]) -> Result<Vec<f64>, RecordError> {
        let claimed = self.numbers();
        let mut values = Vec::new();
        let mut rest = part;
        while let Some((token, behind)) = token(rest) {
            rest = behind;
            let value = number(token).ok_or_else(|| {
                let text = String::from_utf8_lossy(&token[..token.len().min(40)]).into_owned();
                malformed(name, &format!("`{text}` is no number"))
            })?;
            values.push(value);
        }
        let found = values.len() as u64;
        // The last line may be filled up with zeros.
        let filled =
            found > claimed && found - claimed < 6 && values[claimed as usize..].iter().all(|v| *v == 0.0);
        if found != claimed && !filled {
            return Err(malformed(
                name,
                &format!("its header claims {claimed} numbers, it has {found}"),
            ));
        }
        values.truncate(claimed as usize);
        Ok(values)
    }
}

/// The next number: up to a blank, or to a sign that is not that of an exponent, because numbers of full width touch.
fn token(text: &[u8]) -> Option<(&[u8], &[u8])> {
    let start = text.iter().position(|b| !b.is_ascii_whitespace())?;
    let text = &text[start..];
    let ends = |k: usize| {
        let (b, before) = (text[k], text[k - 1]);
        b.is_ascii_whitespace() || (matches!(b, b'+' | b'-') && !matches!(before, b'e' | b'E' | b'd' | b'D'))
    };
    let end = (1..text.len()).find(|k| ends(*k)).unwrap_or(text.len());
    Some(text.split_at(end))
}

fn number(token: &[u8]) -> Option<f64> {
    if let Ok(value) = fast_float2::parse(token) {
        return Some(value);
    }
    // FORTRAN writes D before the exponent of a double.
    let text = std::str::from_utf8(token).ok()?;
    text.replace(['D', 'd'], "E").parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_that_touch() {
        let mut text = &b" 1.5E+00-2.5E-01  3\r\n-4.0D+02+5.0"[..];
        let mut found = Vec::new();
        while let Some((one, rest)) = token(text) {
            found.push(number(one).unwrap());
            text = rest;
        }
        assert_eq!(found, [1.5, -0.25, 3.0, -400.0, 5.0]);
        assert_eq!(number(b"x"), None);
        assert_eq!(token(b" \n"), None);
    }
}
