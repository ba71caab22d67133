//! Arrays of any shape, real or complex.

use super::{Shape, Wanted, size, walk};
use crate::RecordError;
use crate::contents::missing;
use crate::response::numbers::Numbers;
use std::path::Path;

/// An array by its name, its first index the fastest.
pub(in crate::mat) fn numbers(path: &Path, name: &str) -> Result<Numbers, RecordError> {
    let names = [name];
    let mut wanted = Wanted::new(&names, Shape::Complex, size(path)?);
    walk(path, &mut wanted)?;
    let found = wanted.found.pop().flatten();
    let found = found.ok_or_else(|| missing(name, &[]))?;
    Ok(Numbers {
        shape: found.shape,
        last_fastest: false,
        re: found.data,
        im: wanted.imaginary,
    })
}
