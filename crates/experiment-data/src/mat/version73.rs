//! MATLAB 7.3: an HDF5 file with a header of 512 bytes, in which variables are data sets and structs are groups. The
//! attribute `MATLAB_class` says what a variable is; files of other programs may lack it.

mod attributes;
mod complex;
mod kind;

pub(super) use self::attributes::Attributes;
pub(super) use self::complex::numbers;
use self::kind::{STRUCT, STRUCT_ARRAY, describe, kind_of_group};
use super::catalog::{Item, Kind};
use super::{Array, DEEPEST};
use crate::RecordError;
use crate::columns::number::DEFLATE_RATIO;
use crate::contents::{ColumnInfo, missing, vector_length};
use crate::memory::{Allowance, FREELY, MOST_A_BYTE};
use hdf5_pure::{ChunkCacheConfig, Dataset, DatasetAccessProperties, Group, Layout, Object};
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// What h5py compresses with where told so.
const LZF: u16 = 32_000;

/// More variables than any measurement has; a damaged file may have groups that contain themselves.
const MOST_VARIABLES: usize = 100_000;

/// The named variables, in the order of the names.
pub(super) fn read(path: &Path, names: &[&str]) -> Result<Vec<Vec<f64>>, RecordError> {
    guarded(|| {
        let walk = Walk::new(path, names)?;
        // The first of a name counts.
        let mut places = HashMap::new();
        for (place, variable) in walk.variables.iter().enumerate() {
            places.entry(variable.name.as_str()).or_insert(place);
        }
        let mut columns = Vec::with_capacity(names.len());
        let mut allowance = Allowance::new(walk.bytes);
        for name in names {
            let Some(&place) = places.get(name) else {
                let real = walk.variables.iter().filter(|v| v.what == What::Numbers);
                let present: Vec<String> = real.map(|v| v.name.clone()).collect();
                return Err(missing(name, &present));
            };
            if walk.variables[place].what == What::Numbers {
                vector_length(name, &walk.variables[place].shape)?;
            }
            columns.push(walk.numbers(place, &mut allowance)?);
        }
        Ok(columns)
    })
}

/// The named arrays with their shapes, in the order of the names.
pub(super) fn read_arrays(path: &Path, names: &[&str]) -> Result<Vec<Array>, RecordError> {
    guarded(|| {
        let walk = Walk::new(path, names)?;
        let mut allowance = Allowance::new(walk.bytes);
        names
            .iter()
            .map(|name| {
                let Some(place) = walk.variables.iter().position(|v| v.name == *name) else {
                    let real = walk.variables.iter().filter(|v| v.what == What::Numbers);
                    let present: Vec<String> = real.map(|v| v.name.clone()).collect();
                    return Err(missing(name, &present));
                };
                Ok(Array {
                    data: walk.numbers(place, &mut allowance)?,
                    shape: walk.variables[place].shape.clone(),
                })
            })
            .collect()
    })
}

/// Every entry, in the order of the file.
pub(super) fn survey(path: &Path) -> Result<Vec<Item>, RecordError> {
    guarded(|| {
        let walk = Walk::new(path, &[])?;
        let items = walk.variables.into_iter().filter_map(|v| {
            let kind = match v.what {
                What::Numbers => Kind::Numbers,
                What::Text(text) => Kind::Text(text),
                What::Empty => return None,
                What::Other(what) if what == STRUCT || what == STRUCT_ARRAY => return None,
                What::Other(what) => Kind::Other(what),
            };
            Some(Item {
                name: v.name,
                shape: v.shape,
                kind,
            })
        });
        Ok(items.collect())
    })
}

/// Units and settings beside the data sets.
pub(super) fn attributes(path: &Path) -> Result<Attributes, RecordError> {
    guarded(|| {
        let file = hdf5_pure::File::open_streaming(path).map_err(|e| malformed("", &e.to_string()))?;
        Attributes::read(&file.root()).map_err(|e| malformed("", &e.to_string()))
    })
}

/// Every vector of real numbers, in the order of the file.
pub(super) fn list(path: &Path) -> Result<Vec<ColumnInfo>, RecordError> {
    guarded(|| {
        let walk = Walk::new(path, &[])?;
        let numbers = walk.variables.into_iter().filter(|v| v.what == What::Numbers);
        Ok(numbers
            .filter(|v| !v.name.contains('('))
            .filter_map(|v| {
                let rows = vector_length(&v.name, &v.shape).ok()?;
                Some(ColumnInfo { name: v.name, rows })
            })
            .collect())
    })
}

/// `hdf5-pure` means to refuse damaged files with errors, but it asserts some of its own invariants; a panic in it is
/// an error of the file here, because nothing of ours is half changed when it happens.
fn guarded<T>(run: impl FnOnce() -> Result<T, RecordError>) -> Result<T, RecordError> {
    catch_unwind(AssertUnwindSafe(run))
        .unwrap_or_else(|_| Err(malformed("", "its structure contradicts itself")))
}

fn malformed(variable: &str, problem: &str) -> RecordError {
    RecordError::Malformed {
        format: "MAT (version 7.3)",
        variable: variable.to_owned(),
        problem: problem.to_owned(),
    }
}

#[derive(Debug, PartialEq)]
enum What {
    Numbers,
    /// An empty array stores its shape in the place of its numbers.
    Empty,
    /// Characters; the words of short ones.
    Text(String),
    Other(String),
}

struct Variable {
    name: String,
    what: What,
    /// As MATLAB counts: rows first.
    shape: Vec<u64>,
    /// Where the numbers are; none for groups.
    dataset: Option<Place>,
}

/// Where a data set is: in a group by its name, or behind a reference.
enum Place {
    Named(Group, String),
    Referred(Box<Dataset>),
}

/// All variables of a file, in the order of the file.
struct Walk<'a> {
    /// Structs are entered if they lead to one of these; all are, if there is none.
    names: &'a [&'a str],
    bytes: u64,
    variables: Vec<Variable>,
}

impl<'a> Walk<'a> {
    fn new(path: &Path, names: &'a [&'a str]) -> Result<Self, RecordError> {
        let bytes = path.metadata().map_err(RecordError::io("open"))?.len();
        let file = hdf5_pure::File::open_streaming(path).map_err(|e| malformed("", &e.to_string()))?;
        let mut walk = Self {
            names,
            bytes,
            variables: Vec::new(),
        };
        walk.group(&file.root(), "", 0)?;
        Ok(walk)
    }

    fn group(&mut self, group: &Group, path: &str, depth: usize) -> Result<(), RecordError> {
        let damaged = |e: hdf5_pure::Error| malformed(path, &e.to_string());
        let full = |name: &str| {
            if path.is_empty() {
                name.to_owned()
            } else {
                format!("{path}.{name}")
            }
        };
        for (own, dataset) in group.iter_datasets().map_err(damaged)? {
            let name = full(&own);
            let damaged = |e: hdf5_pure::Error| malformed(&name, &e.to_string());
            let (what, shape) = describe(&dataset).map_err(damaged)?;
            if what == What::Other(STRUCT_ARRAY.to_owned()) && self.enters(path) {
                self.elements(&dataset, path, &own, &shape)?;
            }
            self.push(Variable {
                name,
                what,
                shape,
                dataset: Some(Place::Named(group.clone(), own)),
            })?;
        }
        for (own, inner) in group.iter_groups().map_err(damaged)? {
            // Where MATLAB keeps the contents of cells and objects.
            if depth == 0 && own.starts_with('#') {
                continue;
            }
            let name = full(&own);
            let attributes = inner.attrs().map_err(|e| malformed(&name, &e.to_string()))?;
            let what = kind_of_group(&attributes);
            let is_struct = what == STRUCT;
            self.push(Variable {
                name: name.clone(),
                what: What::Other(what),
                shape: Vec::new(),
                dataset: None,
            })?;
            if is_struct && self.enters(&name) {
                if depth + 1 >= DEEPEST {
                    return Err(malformed(&name, "structs nested too deep"));
                }
                self.group(&inner, &name, depth + 1)?;
            }
        }
        Ok(())
    }

    /// One field of all elements of a struct array, which is a list of references to data sets.
    fn elements(
        &mut self,
        dataset: &Dataset,
        path: &str,
        field: &str,
        shape: &[u64],
    ) -> Result<(), RecordError> {
        let count = shape.iter().try_fold(1u64, |n, d| n.checked_mul(*d));
        if count.is_none_or(|n| n > MOST_VARIABLES as u64) {
            return Err(malformed(path, "more elements than any measurement has"));
        }
        // A reference to nothing is a field without a value.
        let Ok(objects) = dataset.dereference() else {
            return Ok(());
        };
        for (k, object) in objects.into_iter().enumerate() {
            let name = format!("{path}({}).{field}", k + 1);
            if let Object::Dataset(inner) = object {
                let (what, shape) = describe(&inner).map_err(|e| malformed(&name, &e.to_string()))?;
                self.push(Variable {
                    name,
                    what,
                    shape,
                    dataset: Some(Place::Referred(inner)),
                })?;
            }
        }
        Ok(())
    }

    fn enters(&self, name: &str) -> bool {
        let inside = |n: &&str| {
            n.strip_prefix(name)
                .is_some_and(|rest| rest.starts_with(['.', '(']))
        };
        self.names.is_empty() || self.names.iter().any(inside)
    }

    fn push(&mut self, variable: Variable) -> Result<(), RecordError> {
        if self.variables.len() == MOST_VARIABLES {
            return Err(malformed("", "more variables than any measurement has"));
        }
        self.variables.push(variable);
        Ok(())
    }

    fn numbers(&self, place: usize, allowance: &mut Allowance) -> Result<Vec<f64>, RecordError> {
        let variable = &self.variables[place];
        let name = &variable.name;
        let place = match (&variable.what, &variable.dataset) {
            (What::Empty, _) => return Ok(Vec::new()),
            (What::Text(_), _) => {
                return Err(RecordError::NotNumeric {
                    column: name.clone(),
                    found: "characters".to_owned(),
                });
            }
            (What::Numbers, Some(place)) => place,
            (What::Other(found), _) => {
                return Err(RecordError::NotNumeric {
                    column: name.clone(),
                    found: found.clone(),
                });
            }
            (What::Numbers, None) => return Err(malformed(name, "numbers without a data set")),
        };
        let damaged = |e: hdf5_pure::Error| malformed(name, &e.to_string());
        let length = variable.shape.iter().try_fold(1u64, |n, d| n.checked_mul(*d));
        let length = length.ok_or_else(|| malformed(name, "a shape of too many numbers"))?;
        // Every part is read once.
        let once = DatasetAccessProperties::new().with_chunk_cache(ChunkCacheConfig::disabled());
        let opened;
        let dataset = match place {
            Place::Named(group, own) => {
                opened = group.dataset_with_options(own, once).map_err(damaged)?;
                &opened
            }
            Place::Referred(dataset) => dataset.as_ref(),
        };
        self.check_claim(name, dataset, length)?;
        allowance.take(name, length)?;
        let column = dataset.read_f64().map_err(damaged)?;
        if column.len() as u64 != length {
            let problem = format!("its header claims {length} values, the file has {}", column.len());
            return Err(malformed(name, &problem));
        }
        Ok(column)
    }

    /// Compares what a data set claims to hold with what the file can hold, before any of it is read.
    fn check_claim(&self, name: &str, dataset: &hdf5_pure::Dataset, length: u64) -> Result<(), RecordError> {
        let damaged = |e: hdf5_pure::Error| malformed(name, &e.to_string());
        let unsupported = |what: String, supported| {
            let found = format!("`{name}` with {what}");
            Err(RecordError::UnsupportedFormat { found, supported })
        };
        let size = dataset.element_size().map_err(damaged)?;
        let too_much = || {
            let bytes = self.bytes;
            let problem =
                format!("its header claims {length} values of {size} bytes, the file has {bytes} bytes");
            malformed(name, &problem)
        };
        let claimed = length.checked_mul(size).ok_or_else(too_much)?;
        let chunk_shape = match dataset.layout().map_err(damaged)? {
            Layout::Compact { .. } | Layout::Contiguous { .. } if claimed <= self.bytes => return Ok(()),
            Layout::Chunked { chunk_shape, .. } => chunk_shape,
            Layout::Virtual => {
                return unsupported("values in other files".to_owned(), "values in the file itself");
            }
            _ => return Err(too_much()),
        };
        if let Some(other) = dataset.filters().into_iter().find(|id| !matches!(id, 1..=3)) {
            let found = match other {
                LZF => "the HDF5 filter lzf".to_owned(),
                other => format!("the HDF5 filter {other}"),
            };
            return unsupported(
                found,
                "deflate, shuffle, checksums; in Python, into a new file: new[name] = old[name][()]",
            );
        }
        // A part is unpacked as a whole, whatever the data set has of it.
        let most = FREELY.max(self.bytes.saturating_mul(MOST_A_BYTE));
        let chunk = chunk_shape.iter().try_fold(size, |all, n| all.checked_mul(*n));
        // A chunk has at least one entry of 8 bytes in an index, and unpacks to so many times its size at most.
        let chunks = match chunk {
            Some(chunk) if chunk > 0 && chunk <= most => claimed.div_ceil(chunk),
            _ => return Err(too_much()),
        };
        if claimed / DEFLATE_RATIO > self.bytes || chunks > self.bytes / 8 {
            return Err(too_much());
        }
        let stored = dataset.chunks().map_err(damaged)?;
        for c in &stored {
            let end = c.address.checked_add(c.storage_size);
            if end.is_none_or(|end| end > self.bytes) {
                let (size, at, bytes) = (c.storage_size, c.address, self.bytes);
                let problem = format!("a part of {size} bytes at byte {at}, the file has {bytes} bytes");
                return Err(malformed(name, &problem));
            }
        }
        let stored: u64 = stored.iter().map(|c| c.storage_size).sum();
        if claimed / DEFLATE_RATIO > stored {
            return Err(too_much());
        }
        Ok(())
    }
}
