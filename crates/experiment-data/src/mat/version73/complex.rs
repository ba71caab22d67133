//! Arrays of any shape, real or complex: complex numbers are compounds of two floats.

use super::{Place, Walk, What, guarded, malformed};
use crate::RecordError;
use crate::columns::number::{Class, Number};
use crate::contents::missing;
use crate::memory::Allowance;
use crate::response::numbers::Numbers;
use hdf5_pure::{Datatype, DatatypeByteOrder, Error};
use std::path::Path;

/// An array by its name, its first index the fastest.
pub(in crate::mat) fn numbers(path: &Path, name: &str) -> Result<Numbers, RecordError> {
    guarded(|| {
        let names = [name];
        let walk = Walk::new(path, &names)?;
        let Some(place) = walk.variables.iter().position(|v| v.name == name) else {
            let present: Vec<String> = walk.variables.iter().map(|v| v.name.clone()).collect();
            return Err(missing(name, &present));
        };
        let mut allowance = Allowance::new(walk.bytes);
        let variable = &walk.variables[place];
        let shape = variable.shape.clone();
        let (re, im) = match (&variable.what, &variable.dataset) {
            (What::Other(what), Some(at)) if what == "complex numbers" => {
                let (re, im) = walk.complex(name, &shape, at, &mut allowance)?;
                (re, Some(im))
            }
            _ => (walk.numbers(place, &mut allowance)?, None),
        };
        Ok(Numbers {
            shape,
            last_fastest: false,
            re,
            im,
        })
    })
}

impl Walk<'_> {
    /// Real and imaginary parts.
    fn complex(
        &self,
        name: &str,
        shape: &[u64],
        at: &Place,
        allowance: &mut Allowance,
    ) -> Result<(Vec<f64>, Vec<f64>), RecordError> {
        let damaged = |e: Error| malformed(name, &e.to_string());
        let opened;
        let dataset = match at {
            Place::Named(group, own) => {
                opened = group.dataset(own).map_err(damaged)?;
                &opened
            }
            Place::Referred(dataset) => dataset.as_ref(),
        };
        let length = shape.iter().try_fold(1u64, |n, d| n.checked_mul(*d));
        let length = length.ok_or_else(|| malformed(name, "a shape of too many numbers"))?;
        self.check_claim(name, dataset, length)?;
        allowance.take(name, length.saturating_mul(2))?;
        let [re, im] =
            halves(&dataset.datatype().map_err(damaged)?).ok_or_else(|| RecordError::NotNumeric {
                column: name.to_owned(),
                found: "a compound that is no pair of floats".to_owned(),
            })?;
        let raw = dataset.read_raw().map_err(damaged)?;
        let size = usize::try_from(dataset.element_size().map_err(damaged)?).unwrap_or(usize::MAX);
        let of = |(at, number): (usize, Number)| -> Vec<f64> {
            let own = at..at.saturating_add(number.size);
            let parts = raw.chunks_exact(size.max(1)).filter_map(|c| c.get(own.clone()));
            parts.map(|bytes| number.value(bytes)).collect()
        };
        let (re, im) = (of(re), of(im));
        if re.len() as u64 != length || im.len() != re.len() {
            let problem = format!("its header claims {length} values, the file has {}", re.len());
            return Err(malformed(name, &problem));
        }
        Ok((re, im))
    }
}

/// Where the two halves of a complex number are, and how they are stored: `real`, `imag` of MATLAB, `r`, `i` of h5py.
fn halves(datatype: &Datatype) -> Option<[(usize, Number); 2]> {
    let Datatype::Compound { members, .. } = datatype else {
        return None;
    };
    let half = |names: [&str; 2]| {
        let member = members.iter().find(|m| names.contains(&m.name.as_str()))?;
        let Datatype::FloatingPoint { size, byte_order, .. } = &member.datatype else {
            return None;
        };
        let big_endian = match byte_order {
            DatatypeByteOrder::LittleEndian => false,
            DatatypeByteOrder::BigEndian => true,
            DatatypeByteOrder::Vax => return None,
        };
        let number = Number {
            class: Class::Float,
            size: usize::try_from(*size).ok().filter(|n| matches!(n, 4 | 8))?,
            big_endian,
        };
        Some((usize::try_from(member.byte_offset).ok()?, number))
    };
    Some([half(["real", "r"])?, half(["imag", "i"])?])
}
