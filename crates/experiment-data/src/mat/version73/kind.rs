//! What a variable is, as its attributes and type say.

use super::What;
use hdf5_pure::{AttrValue, DType, Dataset};
use std::collections::HashMap;

/// What a data set is, and its shape with rows first. Short texts are read.
pub(super) fn describe(dataset: &Dataset) -> Result<(What, Vec<u64>), hdf5_pure::Error> {
    let attributes = dataset.attrs()?;
    let mut shape = dataset.shape()?;
    shape.reverse();
    if shape.is_empty() {
        // A single number has no dimensions, except in MATLAB.
        shape.push(1);
    }
    let mut what = kind_of_dataset(&attributes, &dataset.dtype()?);
    let short = shape
        .iter()
        .try_fold(1u64, |n, d| n.checked_mul(*d))
        .is_some_and(|n| n <= 256);
    if let What::Text(words) = &mut what
        && short
        && attributes.get("MATLAB_empty").and_then(AttrValue::as_i64) != Some(1)
        && let Ok(letters) = dataset.read_u16()
    {
        *words = String::from_utf16_lossy(&letters);
    }
    Ok((what, shape))
}

pub(super) const STRUCT_ARRAY: &str = "a struct array";
/// A compound data set, as h5py, PyTables and pandas write tables.
pub(super) const TABLE: &str = "one data set of several fields";
pub(super) const STRUCT: &str = "a struct (name a field with a dot)";

/// The real and the imaginary part, as MATLAB and h5py name them.
fn is_complex(fields: &[(String, DType)]) -> bool {
    const NAMES: [[&str; 2]; 4] = [["real", "imag"], ["r", "i"], ["re", "im"], ["real", "imaginary"]];
    let [(re, _), (im, _)] = fields else {
        return false;
    };
    NAMES
        .iter()
        .any(|[a, b]| re.eq_ignore_ascii_case(a) && im.eq_ignore_ascii_case(b))
}

fn class(attributes: &HashMap<String, AttrValue>) -> Option<&str> {
    attributes.get("MATLAB_class").and_then(AttrValue::as_str)
}

pub(super) fn kind_of_group(attributes: &HashMap<String, AttrValue>) -> String {
    match class(attributes) {
        _ if attributes.contains_key("MATLAB_sparse") => "a sparse matrix".to_owned(),
        None | Some("struct") => STRUCT.to_owned(),
        Some(class) => format!("an object of class {class}"),
    }
}

pub(super) fn kind_of_dataset(attributes: &HashMap<String, AttrValue>, dtype: &DType) -> What {
    let other = |what: &str| What::Other(what.to_owned());
    let empty = attributes.get("MATLAB_empty").and_then(AttrValue::as_i64) == Some(1);
    match (class(attributes), dtype) {
        (own, _) if attributes.contains_key("MATLAB_object_decode") => {
            other(&own.map_or("an object".to_owned(), |c| format!("an object of class {c}")))
        }
        (Some("char"), _) | (None, DType::String | DType::VariableLengthString) => What::Text(String::new()),
        (Some("cell"), _) => other("a cell array"),
        (Some("function_handle"), _) => other("a function"),
        (Some("struct") | None, DType::ObjectReference) => other(STRUCT_ARRAY),
        (Some("struct"), _) => other("an empty struct array"),
        (
            Some(
                "double" | "single" | "logical" | "int8" | "int16" | "int32" | "int64" | "uint8" | "uint16"
                | "uint32" | "uint64",
            )
            | None,
            kind,
        ) => match kind {
            _ if empty => What::Empty,
            // Other programs write truth values as names of 0 and 1.
            DType::Enum(_)
            | DType::F32
            | DType::F64
            | DType::I8
            | DType::I16
            | DType::I32
            | DType::I64
            | DType::U8
            | DType::U16
            | DType::U32
            | DType::U64 => What::Numbers,
            DType::Compound(fields) if is_complex(fields) => other("complex numbers"),
            DType::Compound(_) => other(TABLE),
            _ => other("an HDF5 type that is no real number"),
        },
        (Some(class), _) => other(&format!("a variable of class {class}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_fields_are_complex_by_their_names_alone() {
        for (names, is_one) in [
            (["real", "imag"], true),
            (["r", "i"], true),
            (["Re", "Im"], true),
            (["rate", "id"], false),
            (["ref", "in"], false),
            (["imag", "real"], false),
        ] {
            let fields = names.map(|name| (name.to_owned(), DType::F64));
            assert_eq!(is_complex(&fields), is_one, "{names:?}");
        }
        assert!(!is_complex(&[("r".to_owned(), DType::F64)]));
    }
}
