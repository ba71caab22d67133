//! Arrays of any shape, real or complex.

use super::header::{Header, number};
use super::{malformed, open, refused, size};
use crate::RecordError;
use crate::columns::number::DEFLATE_RATIO;
use crate::memory::Allowance;
use crate::response::numbers::{Entries, Numbers};
use npyz::npz::{array_name_from_file_name, file_name_from_array_name};
use std::io::Read;
use std::path::Path;

/// The names of all arrays.
pub(crate) fn entries(path: &Path) -> Result<Entries, RecordError> {
    let mut archive = open(path)?;
    let names = archive.zip_archive().file_names();
    let mut names: Vec<String> = names
        .filter_map(array_name_from_file_name)
        .map(str::to_owned)
        .collect();
    names.sort();
    Ok(Entries {
        names,
        texts: Vec::new(),
    })
}

/// An array that is there.
pub(crate) fn numbers(path: &Path, name: &str) -> Result<Numbers, RecordError> {
    let mut archive = open(path)?;
    let archive = archive.zip_archive();
    let mut entry = archive
        .by_name(&file_name_from_array_name(name))
        .map_err(|e| refused(name, &e))?;
    let header = Header::read(&mut entry).map_err(|problem| malformed(name, problem))?;
    // Complex numbers are two floats each.
    let (is_complex, part) = match header.descr.get(1..) {
        Some("c16") => (true, format!("{}f8", &header.descr[..1])),
        Some("c8") => (true, format!("{}f4", &header.descr[..1])),
        _ => (false, header.descr.clone()),
    };
    let Some(part) = number(&part) else {
        let found = format!("the dtype '{}'", header.descr);
        let column = name.to_owned();
        return Err(RecordError::NotNumeric { column, found });
    };
    let count = header
        .shape
        .iter()
        .try_fold(1 + u64::from(is_complex), |n, d| n.checked_mul(*d));
    let bytes = count.and_then(|n| n.checked_mul(part.size as u64));
    let (unpacked, packed) = (entry.size(), entry.compressed_size());
    let (Some(count), true) = (
        count,
        bytes.and_then(|b| b.checked_add(header.length)) == Some(unpacked),
    ) else {
        let problem = format!(
            "its header claims an array of {:?}, the archive holds {} bytes of values",
            header.shape,
            unpacked.saturating_sub(header.length)
        );
        return Err(malformed(name, &problem));
    };
    if unpacked / DEFLATE_RATIO > packed {
        let problem = format!("{packed} bytes that claim to unpack to {unpacked}");
        return Err(malformed(name, &problem));
    }
    Allowance::new(size(path)?).take(name, count)?;
    let failed = |e: std::io::Error| malformed(name, &e.to_string());
    let all = part.column(&mut entry, count).map_err(failed)?;
    // Reading on to the end lets the archive compare its checksum.
    let more = entry.read(&mut [0]).map_err(failed)?;
    if all.len() as u64 != count || more != 0 {
        return Err(malformed(name, "it has not as many values as its header claims"));
    }
    let every_second = |first: usize| all.iter().skip(first).step_by(2).copied().collect();
    Ok(Numbers {
        shape: header.shape,
        last_fastest: !header.first_fastest,
        re: if is_complex { every_second(0) } else { all.clone() },
        im: is_complex.then(|| every_second(1)),
    })
}
