//! Structs and struct arrays.

use super::super::element::{Elements, MATRIX};
use super::{Stop, Wanted, matrix};
use std::io::Read;

/// The fields of a struct, or of each element of a struct array.
pub(super) fn fields<R: Read>(
    e: &mut Elements<R>,
    path: &str,
    elements: u64,
    depth: usize,
    wanted: &mut Wanted<'_>,
    name: &mut String,
) -> Result<(), Stop> {
    let tag = e.tag()?;
    let length = e.data(tag)?;
    let length = e.i32s(&length).first().copied().unwrap_or(0);
    let length = usize::try_from(length).unwrap_or(0);
    if length == 0 {
        return Err("field names of no length".into());
    }
    let tag = e.tag()?;
    let names = e.data(tag)?;
    let count = (names.len() / length) as u64;
    // A false number of elements ends with the bytes, if there are fields.
    for k in 0..elements.saturating_mul(count) {
        let at = (k % count) as usize * length;
        let field = &names[at..at + length];
        let field = field.split(|b| *b == 0).next().unwrap_or_default();
        let field = String::from_utf8_lossy(field);
        let full = if elements == 1 {
            format!("{path}.{field}")
        } else {
            format!("{path}({}).{field}", k / count + 1)
        };
        let tag = e.tag()?;
        if tag.kind != MATRIX {
            return Err("a field that is no array".into());
        }
        if wanted.index(&full).is_none() && !wanted.enters(&full) {
            e.skip(tag)?;
            continue;
        }
        let outside = e.enter(tag)?;
        matrix(e, &full, depth + 1, wanted, name)?;
        e.leave(outside)?;
    }
    Ok(())
}
