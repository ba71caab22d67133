//! Bundles that are broken, each in one way, with what the reader says. The tests of this crate and of the program run
//! through them, and docs/bad-input.md is written from them. Needs the crates experiment-data (with its feature
//! `parquet`) and hdf5-pure.
#![allow(
    dead_code,
    unreachable_pub,
    clippy::unwrap_used,
    reason = "a test that cannot be set up must fail"
)]

pub(crate) mod arrays;
mod csv;
mod description;
pub mod hdf5;
mod matlab;
mod parquet;
mod places;
mod responses;
mod samples;
pub mod small;

use experiment_data::{Bundle, BundleWriter, RecordFormat};
use std::path::Path;

/// One way to break a bundle.
pub struct Case {
    /// Heading under which it stands.
    pub part: &'static str,
    /// Unique, for messages of tests.
    pub name: &'static str,
    /// What is broken, in one line.
    pub what: &'static str,
    /// Writes the bundle into a folder that exists and is empty.
    pub build: fn(&Path),
    /// Parts of the message; places of experiment.toml start with a colon.
    pub message: &'static [&'static str],
}

/// All of them, in the order of the page.
pub fn cases() -> Vec<Case> {
    let mut all = Vec::new();
    for (part, cases) in [
        ("The folder and its files", places::CASES),
        ("experiment.toml", description::CASES),
        ("CSV", csv::CASES),
        ("NPZ", arrays::CASES),
        ("MATLAB", matlab::CASES),
        ("Parquet", parquet::CASES),
        ("Samples", samples::CASES),
        ("Measured frequency responses", responses::CASES),
    ] {
        all.extend(cases.iter().map(|&(name, what, build, message)| Case {
            part,
            name,
            what,
            build,
            message,
        }));
    }
    all
}

/// A case without its heading: name, what is broken, how, and the message.
type Row = (&'static str, &'static str, fn(&Path), &'static [&'static str]);

/// The first thing that the reader says about a bundle, if it opens it and loads all records.
pub fn first_error(folder: &Path) -> Option<String> {
    let bundle = match Bundle::open(folder) {
        Ok(bundle) => bundle,
        Err(e) => return Some(e.to_string()),
    };
    let entries = &bundle.description().records;
    let error = |i: usize| match entries[i].is_response() {
        true => bundle.load_response(i).err(),
        false => bundle.load(i).err(),
    };
    (0..bundle.len()).find_map(|i| Some(error(i)?.to_string()))
}

/// The correct bundle in another format, its first record changed byte by byte.
fn grid_as(dir: &Path, format: RecordFormat, change: impl FnOnce(&mut Vec<u8>)) {
    let source = dir.join("source");
    std::fs::create_dir(&source).unwrap();
    small::write(&source);
    let bundle = Bundle::open(&source).unwrap();
    let mut writer = BundleWriter::create(dir, bundle.description().clone(), format).unwrap();
    for record in bundle.records() {
        writer.write(&record.unwrap()).unwrap();
    }
    writer.finish().unwrap();
    std::fs::remove_dir_all(source).unwrap();
    let path = dir.join(format!("records/grid{}", format.ending()));
    let mut bytes = std::fs::read(&path).unwrap();
    change(&mut bytes);
    std::fs::write(path, bytes).unwrap();
}

/// A bundle of one file, in which one column is an output and another an input.
fn one_file(dir: &Path, file: &str, content: &[u8], output: &str, input: &str) {
    let toml = format!(
        "format = 1\nname = \"one file\"\nsample_rate = 20.0\n[channels.output]\ncolumns = [\"{output}\"]\n\
         [channels.input]\ncolumns = [\"{input}\"]\n[[records]]\nfile = \"{file}\"\nkind = \"transient\"\n\
         use = \"estimation\"\n"
    );
    small::put(dir, "experiment.toml", toml);
    small::put(dir, file, content);
}

/// Where some bytes are, which must be there.
fn find(bytes: &[u8], what: &[u8]) -> usize {
    bytes.windows(what.len()).position(|w| w == what).unwrap()
}

/// Bytes in the place of others as long, wherever they are.
fn replace(bytes: &mut [u8], from: &[u8], to: &[u8]) {
    assert_eq!(from.len(), to.len());
    let mut at = find(bytes, from);
    loop {
        bytes[at..at + to.len()].copy_from_slice(to);
        match bytes.windows(from.len()).position(|w| w == from) {
            Some(next) => at = next,
            None => return,
        }
    }
}
