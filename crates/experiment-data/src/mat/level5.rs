//! MATLAB 5: a header of 128 bytes, then elements with a tag each, compressed or not.

mod complex;
mod fields;

pub(super) use self::complex::numbers;
use self::fields::fields;
use super::catalog::{Item, Kind};
use super::element::{COMPRESSED, Damage, Elements, MATRIX};
use super::value::count;
use super::{Array, DEEPEST};
use crate::RecordError;
use crate::columns::number::DEFLATE_RATIO;
use crate::contents::{ColumnInfo, SUPPORTED, missing, vector_length};
use crate::memory::Allowance;
use flate2::read::ZlibDecoder;
use std::collections::{HashMap, HashSet};
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::Path;

/// The named variables as vectors, in the order of the names; `a.b` is the field `b` of the struct `a`.
pub(super) fn read(path: &Path, names: &[&str]) -> Result<Vec<Vec<f64>>, RecordError> {
    let arrays = read_arrays(path, names, Shape::Vector)?;
    Ok(arrays.into_iter().map(|a| a.data).collect())
}

const COMPLEX: &str = "complex numbers";

/// More entries than any measurement has.
const MOST_ENTRIES: usize = 100_000;

/// Which arrays are accepted.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Shape {
    Vector,
    Any,
    /// Of complex numbers too.
    Complex,
}

/// The named variables, in the order of the names.
pub(super) fn read_arrays(path: &Path, names: &[&str], shape: Shape) -> Result<Vec<Array>, RecordError> {
    let mut wanted = Wanted::new(names, shape, size(path)?);
    walk(path, &mut wanted)?;
    if let Some(absent) = wanted.found.iter().position(Option::is_none) {
        // Only now the names of everything in the file are worth their time.
        wanted.present = Some(Vec::new());
        walk(path, &mut wanted)?;
        let is_numbers = |p: &Item| match &p.kind {
            Kind::Numbers => true,
            Kind::Other(what) => what == COMPLEX,
            Kind::Text(_) => false,
        };
        let numbers = wanted.present.into_iter().flatten().filter(is_numbers);
        let present: Vec<String> = numbers.map(|p| p.name).collect();
        return Err(missing(names[absent], &present));
    }
    Ok(wanted.found.into_iter().flatten().collect())
}

/// Every vector of real numbers, in the order of the file.
pub(super) fn list(path: &Path) -> Result<Vec<ColumnInfo>, RecordError> {
    let mut wanted = Wanted::new(&[], Shape::Vector, 0);
    wanted.present = Some(Vec::new());
    walk(path, &mut wanted)?;
    let vector = |p: Item| {
        let rows = vector_length(&p.name, &p.shape)
            .ok()
            .filter(|_| p.kind == Kind::Numbers)?;
        // What an element of a struct array holds, only its address names.
        (!p.name.contains('(')).then_some(ColumnInfo { name: p.name, rows })
    };
    Ok(wanted.present.into_iter().flatten().filter_map(vector).collect())
}

/// Every entry, in the order of the file.
pub(super) fn survey(path: &Path) -> Result<Vec<Item>, RecordError> {
    let mut wanted = Wanted::new(&[], Shape::Any, 0);
    wanted.present = Some(Vec::new());
    walk(path, &mut wanted)?;
    Ok(wanted.present.unwrap_or_default())
}

struct Wanted<'a> {
    /// Where each name stands in the answer.
    places: HashMap<&'a str, usize>,
    /// The structs around the names.
    structs: HashSet<&'a str>,
    shape: Shape,
    found: Vec<Option<Array>>,
    /// The imaginary parts of what was found last.
    imaginary: Option<Vec<f64>>,
    /// All entries, while they are collected.
    present: Option<Vec<Item>>,
    allowance: Allowance,
}

fn size(path: &Path) -> Result<u64, RecordError> {
    Ok(path.metadata().map_err(RecordError::io("read"))?.len())
}

impl<'a> Wanted<'a> {
    fn note(&mut self, name: String, shape: Vec<u64>, kind: Kind) {
        // A damaged file may claim any number of entries.
        if let Some(present) = self.present.as_mut().filter(|p| p.len() < MOST_ENTRIES) {
            present.push(Item { name, shape, kind });
        }
    }
    fn new(names: &'a [&'a str], shape: Shape, file_bytes: u64) -> Self {
        let around = |name: &'a str| name.match_indices(['.', '(']).map(move |(dot, _)| &name[..dot]);
        Self {
            // The first of equal names gets what is found.
            places: names.iter().enumerate().rev().map(|(i, n)| (*n, i)).collect(),
            structs: names.iter().flat_map(|n| around(n)).collect(),
            shape,
            found: vec![None; names.len()],
            imaginary: None,
            present: None,
            allowance: Allowance::new(file_bytes),
        }
    }
    fn index(&self, name: &str) -> Option<usize> {
        if self.present.is_some() {
            None
        } else {
            self.places.get(name).copied()
        }
    }
    fn enters(&self, name: &str) -> bool {
        self.present.is_some() || self.structs.contains(name)
    }
}

/// What stops a walk.
enum Stop {
    Damage(Damage),
    Refuse(RecordError),
}

impl<T: Into<Damage>> From<T> for Stop {
    fn from(damage: T) -> Self {
        Self::Damage(damage.into())
    }
}

fn walk(path: &Path, wanted: &mut Wanted<'_>) -> Result<(), RecordError> {
    let file = File::open(path).map_err(RecordError::io("open"))?;
    let length = file.metadata().map_err(RecordError::io("read"))?.len();
    let mut file = BufReader::new(file);
    let big_endian = file_header(&mut file)?;
    let mut at = 128;
    while at + 8 <= length {
        let here = |d: Damage, name: String| RecordError::Malformed {
            format: "MAT",
            variable: name,
            problem: format!("{} (element at byte {at})", d.0),
        };
        file.seek(SeekFrom::Start(at)).map_err(RecordError::io("read"))?;
        let mut elements = Elements::new(&mut file, big_endian, length - at);
        let tag = elements.tag().map_err(|d| here(d, String::new()))?;
        let (left, bytes) = (elements.left(), u64::from(tag.bytes));
        if bytes > left {
            let d = format!("an element claims {bytes} bytes, the file has {left} more");
            return Err(here(Damage(d), String::new()));
        }
        let mut name = String::new();
        let result = match tag.kind {
            MATRIX => {
                let mut inner = Elements::new((&mut file).take(bytes), big_endian, bytes);
                matrix(&mut inner, "", 0, wanted, &mut name)
            }
            COMPRESSED => compressed((&mut file).take(bytes), bytes, big_endian, wanted, &mut name),
            // Anything else at the top level is no variable.
            _ => Ok(()),
        };
        match result {
            Ok(()) => {}
            Err(Stop::Damage(d)) => return Err(here(d, name)),
            Err(Stop::Refuse(e)) => return Err(e),
        }
        // Compressed elements are not padded.
        let padding = if tag.kind == COMPRESSED {
            0
        } else {
            (8 - bytes % 8) % 8
        };
        at += 8 + bytes + padding;
        if wanted.present.is_none() && wanted.found.iter().all(Option::is_some) {
            break;
        }
    }
    Ok(())
}

/// The 128 bytes in front; true for big endian.
fn file_header(file: &mut impl Read) -> Result<bool, RecordError> {
    let malformed = |problem: &str| RecordError::Malformed {
        format: "MAT",
        variable: String::new(),
        problem: problem.to_owned(),
    };
    let mut header = Vec::new();
    file.take(128)
        .read_to_end(&mut header)
        .map_err(RecordError::io("read"))?;
    let refused = |found: &str| {
        Err(RecordError::UnsupportedFormat {
            found: found.to_owned(),
            supported: SUPPORTED,
        })
    };
    if header.len() < 128 {
        return Err(malformed("it is shorter than the header of a MAT file"));
    }
    match &header[126..128] {
        b"IM" => Ok(false),
        b"MI" => Ok(true),
        // Level 4 files start with a number below 5000 and have no text.
        _ if header[..4].contains(&0) => refused("a MAT file of level 4 (save it with `-v7`)"),
        _ => Err(malformed("it does not have the mark of a level 5 MAT file")),
    }
}

fn compressed(
    source: impl Read,
    packed: u64,
    big_endian: bool,
    wanted: &mut Wanted<'_>,
    name: &mut String,
) -> Result<(), Stop> {
    let mut outer = Elements::new(ZlibDecoder::new(source), big_endian, 8);
    let tag = outer.tag()?;
    if tag.kind != MATRIX {
        return Ok(());
    }
    let bytes = u64::from(tag.bytes);
    if bytes / DEFLATE_RATIO > packed {
        let text = format!("{packed} bytes that claim to unpack to {bytes}");
        return Err(Damage(text).into());
    }
    let mut inner = Elements::new(outer.into_source(), big_endian, bytes);
    let found = |w: &Wanted<'_>| w.found.iter().flatten().count();
    let before = found(wanted);
    matrix(&mut inner, "", 0, wanted, name)?;
    // What was decoded must also have the right checksum, which stands at the end.
    if found(wanted) > before {
        inner.finish()?;
    }
    Ok(())
}

/// One array: flags, dimensions, name, content. Leaves off anywhere if the rest is not needed.
fn matrix<R: Read>(
    e: &mut Elements<R>,
    path: &str,
    depth: usize,
    wanted: &mut Wanted<'_>,
    name: &mut String,
) -> Result<(), Stop> {
    // An empty element is MATLAB's [].
    if e.left() == 0 {
        return Ok(());
    }
    let tag = e.tag()?;
    let flags = e.data(tag)?;
    if flags.len() < 4 {
        return Err("array flags of less than four bytes".into());
    }
    let flags = e.u32(&flags);
    let (class, complex) = (flags & 0xff, flags & 0x800 != 0);
    if class == 17 {
        // An opaque object has no dimensions, only names; its own program alone knows what follows.
        if wanted.present.is_some() {
            let mut words = Vec::new();
            for _ in 0..3 {
                let tag = e.tag()?;
                words.push(
                    String::from_utf8_lossy(&e.data(tag)?)
                        .trim_end_matches('\0')
                        .to_owned(),
                );
            }
            let full = if depth == 0 {
                words[0].clone()
            } else {
                path.to_owned()
            };
            wanted.note(
                full,
                Vec::new(),
                Kind::Other(format!("an object of class {}", words[2])),
            );
        }
        return Ok(());
    }
    let tag = e.tag()?;
    let dimensions = e.data(tag)?;
    let mut shape = Vec::new();
    for n in e.i32s(&dimensions) {
        shape.push(u64::try_from(n).map_err(|_| Damage("a negative dimension".to_owned()))?);
    }
    let tag = e.tag()?;
    let own = String::from_utf8_lossy(&e.data(tag)?)
        .trim_end_matches('\0')
        .to_owned();
    // Fields carry their name in the struct.
    let full = if depth == 0 { own } else { path.to_owned() };
    name.clone_from(&full);
    let index = wanted.index(&full);
    let not_numeric = |found: &str| {
        Stop::Refuse(RecordError::NotNumeric {
            column: full.clone(),
            found: found.to_owned(),
        })
    };
    match class {
        6..=15 => {
            if wanted.present.is_some() {
                let kind = if complex {
                    Kind::Other(COMPLEX.to_owned())
                } else {
                    Kind::Numbers
                };
                wanted.note(full, shape, kind);
                return Ok(());
            }
            let Some(index) = index else { return Ok(()) };
            if complex && wanted.shape != Shape::Complex {
                return Err(not_numeric(COMPLEX));
            }
            let length = match wanted.shape {
                Shape::Vector => vector_length(&full, &shape).map_err(Stop::Refuse)?,
                Shape::Any | Shape::Complex => count(&shape).unwrap_or(u64::MAX),
            };
            let tag = e.tag()?;
            // More numbers than bytes are a false claim, which is refused below.
            if length <= u64::from(tag.bytes) {
                wanted.allowance.take(&full, length).map_err(Stop::Refuse)?;
            }
            let data = e.numbers(tag, length)?;
            if complex {
                let tag = e.tag()?;
                wanted.imaginary = Some(e.numbers(tag, length)?);
            }
            wanted.found[index] = Some(Array { shape, data });
            Ok(())
        }
        2 if wanted.enters(&full) => {
            let elements = count(&shape).unwrap_or(u64::MAX);
            if elements != 1 && index.is_some() {
                return Err(not_numeric("a struct array"));
            }
            if depth >= DEEPEST {
                return Err("structs nested too deep".into());
            }
            fields(e, &full, elements, depth, wanted, name)
        }
        _ if wanted.present.is_some() => {
            let kind = match class {
                1 => Kind::Other("a cell array".to_owned()),
                3 => {
                    let tag = e.tag()?;
                    let class = e.data(tag)?;
                    let class = String::from_utf8_lossy(&class).trim_end_matches('\0').to_owned();
                    Kind::Other(format!("an object of class {class}"))
                }
                4 if count(&shape).is_some_and(|n| n <= LONGEST_NAME) => {
                    let tag = e.tag()?;
                    Kind::Text(e.text(tag)?)
                }
                4 => Kind::Text(String::new()),
                5 => Kind::Other("a sparse matrix".to_owned()),
                16 => Kind::Other("a function".to_owned()),
                _ => Kind::Other("a variable of unknown class".to_owned()),
            };
            wanted.note(full, shape, kind);
            Ok(())
        }
        _ if index.is_some() => Err(not_numeric(match class {
            1 => "a cell array",
            2 => "a struct (name a field with a dot)",
            3 => "an object",
            4 => "characters",
            5 => "a sparse matrix",
            16 => "a function",
            _ => "a variable of unknown class",
        })),
        _ => Ok(()),
    }
}

/// Letters of the longest name of a signal that is read.
const LONGEST_NAME: u64 = 256;
