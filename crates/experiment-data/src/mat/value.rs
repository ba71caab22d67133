//! Arrays, texts and structs of any depth to a level 5 file.

use super::element::MATRIX;
use super::writer::{element, header, writable};
use crate::RecordError;
use std::io::Write;

/// Real numbers of any shape, first index fastest.
#[derive(Debug, Clone, PartialEq)]
pub struct Array {
    /// Sizes; MATLAB has at least two.
    pub shape: Vec<u64>,
    /// As many numbers as the product of the sizes.
    pub data: Vec<f64>,
}

/// A MATLAB value.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// Doubles.
    Array(Array),
    /// A row of characters.
    Text(String),
    /// A 1 x 1 struct with its fields in order.
    Struct(Vec<(String, Value)>),
    /// A row of structs with the fields of the first.
    Structs(Vec<Vec<(String, Value)>>),
}

/// Field names have this many bytes, the last of them zero.
const FIELD_BYTES: usize = 64;

/// Named values as the bytes of a level 5 file, uncompressed, without a date: the same values give the same bytes.
///
/// # Errors
/// [`RecordError::Unwritable`] for a name that MATLAB does not take or an array of 2 GiB; [`RecordError::Malformed`] for an
/// array whose shape is not that of its numbers.
pub fn write_values(values: &[(String, Value)]) -> Result<Vec<u8>, RecordError> {
    let mut out = Vec::new();
    header(&mut out).map_err(RecordError::io("write"))?;
    for (name, value) in values {
        check(name, value)?;
        let body = matrix(name, value);
        put(&mut out, MATRIX, &body);
    }
    Ok(out)
}

fn check(name: &str, value: &Value) -> Result<(), RecordError> {
    match value {
        Value::Array(a) => {
            writable(name, a.data.len())?;
            if count(&a.shape) != Some(a.data.len() as u64) || a.shape.len() < 2 {
                return Err(RecordError::Malformed {
                    format: "MAT",
                    variable: name.to_owned(),
                    problem: format!("{} numbers in the shape {:?}", a.data.len(), a.shape),
                });
            }
            Ok(())
        }
        Value::Text(text) => writable(name, text.len()),
        Value::Struct(fields) => {
            writable(name, fields.len())?;
            fields.iter().try_for_each(|(field, value)| check(field, value))
        }
        Value::Structs(elements) => {
            writable(name, elements.len())?;
            let names = |fields: &[(String, Value)]| fields.iter().map(|f| f.0.clone()).collect::<Vec<_>>();
            if elements.iter().any(|e| names(e) != names(&elements[0])) {
                return Err(RecordError::Malformed {
                    format: "MAT",
                    variable: name.to_owned(),
                    problem: "structs of one row with other fields".to_owned(),
                });
            }
            elements
                .iter()
                .flatten()
                .try_for_each(|(field, value)| check(field, value))
        }
    }
}

/// Flags, dimensions, name, content.
fn matrix(name: &str, value: &Value) -> Vec<u8> {
    let mut out = Vec::new();
    let (class, shape): (u32, Vec<i32>) = match value {
        Value::Array(a) => (6, a.shape.iter().map(|n| *n as i32).collect()),
        Value::Text(text) => (4, vec![1, text.encode_utf16().count() as i32]),
        Value::Struct(_) => (2, vec![1, 1]),
        Value::Structs(elements) => (2, vec![1, elements.len() as i32]),
    };
    let mut flags = class.to_le_bytes().to_vec();
    flags.extend([0; 4]);
    put(&mut out, 6, &flags);
    put(
        &mut out,
        5,
        &shape.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<_>>(),
    );
    put(&mut out, 1, name.as_bytes());
    match value {
        Value::Array(a) => put(
            &mut out,
            9,
            &a.data.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>(),
        ),
        Value::Text(text) => put(
            &mut out,
            17,
            &text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<_>>(),
        ),
        Value::Struct(fields) => structs(&mut out, std::slice::from_ref(fields)),
        Value::Structs(elements) => structs(&mut out, elements),
    }
    out
}

/// Field names, and the fields of one struct after another.
fn structs(out: &mut Vec<u8>, elements: &[Vec<(String, Value)>]) {
    let fields = elements.first().map_or(&[][..], Vec::as_slice);
    // The length of a field name is a small element: size and kind share its tag.
    out.extend((4u32 << 16 | 5).to_le_bytes());
    out.extend((FIELD_BYTES as u32).to_le_bytes());
    let mut names = vec![0; FIELD_BYTES * fields.len()];
    for (slot, (field, _)) in names.chunks_exact_mut(FIELD_BYTES).zip(fields) {
        slot[..field.len()].copy_from_slice(field.as_bytes());
    }
    put(out, 1, &names);
    for (_, value) in elements.iter().flatten() {
        let body = matrix("", value);
        put(out, MATRIX, &body);
    }
}

/// An element with its tag, padded to eight bytes.
fn put(out: &mut Vec<u8>, kind: u32, data: &[u8]) {
    // Writing to memory does not fail.
    element(out, kind, data.len()).ok();
    out.write_all(data).ok();
    out.resize(out.len().next_multiple_of(8), 0);
}

/// How many entries an array of this shape has; none for more than can be counted.
pub(super) fn count(shape: &[u64]) -> Option<u64> {
    shape.iter().try_fold(1_u64, |n, d| n.checked_mul(*d))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let array = |shape: &[u64], data: &[f64]| {
            Value::Array(Array {
                shape: shape.to_vec(),
                data: data.to_vec(),
            })
        };
        let cube: Vec<f64> = (0..24).map(f64::from).collect();
        let inner = Value::Struct(vec![
            ("a".into(), array(&[2, 3, 4], &cube)),
            ("empty".into(), array(&[0, 5], &[])),
        ]);
        let values = [(
            "m".to_owned(),
            Value::Struct(vec![
                ("note".into(), Value::Text("é, text".into())),
                ("inner".into(), inner),
                (
                    "x".into(),
                    array(&[2, 2], &[1.0, f64::MIN_POSITIVE, -0.0, 3.5e300]),
                ),
            ]),
        )];
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("v.mat");
        std::fs::write(&path, write_values(&values).unwrap()).unwrap();
        let found = super::super::read_arrays(&path, &["m.x", "m.inner.a", "m.inner.empty"]).unwrap();
        assert_eq!(found[0].shape, [2, 2]);
        assert_eq!(found[0].data, [1.0, f64::MIN_POSITIVE, -0.0, 3.5e300]);
        assert_eq!(
            (found[1].shape.as_slice(), found[1].data.as_slice()),
            (&[2, 3, 4][..], &cube[..])
        );
        assert!(found[2].data.is_empty());
        // A matrix is no column of a record.
        assert!(crate::read_columns(&path, &["m.x"]).is_err());
        let wrong = [("x".to_owned(), array(&[2, 2], &[1.0]))];
        assert!(write_values(&wrong).is_err());
        assert!(write_values(&[("1x".to_owned(), Value::Text(String::new()))]).is_err());
    }
}
