//! Records to a bundle.

use crate::checks::{self, Expectation};
use crate::columns::{self, RecordFormat};
use crate::description::{ChannelGroup, Description, EntryKind, RecordEntry};
use crate::description_check::{check_entry, check_head};
use crate::key_path::KeyPath;
use crate::stage::Stage;
use crate::{Bundle, DataError, RecordError, RecordPlace, mat, toml_file};
use lpv_core::{Record, RecordKind, Signals};
use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Writes a bundle: the records as they come, `experiment.toml` last.
///
/// Until [`BundleWriter::finish`] everything is in a folder with a name of its own within that of the bundle, which goes when the
/// writer is dropped: a broken run leaves nothing. One that a killed process left behind is removed by the next writer there. Nothing
/// that exists is overwritten. Every record passes the checks of the reader before it is written, so what is written can be
/// read. The files depend on the records and the description only: no date, no order of threads.
#[derive(Debug)]
pub struct BundleWriter {
    folder: PathBuf,
    stage: Stage,
    description: Description,
    format: RecordFormat,
    scheduling_scale: f64,
}

impl BundleWriter {
    /// Starts a bundle in a folder, which is made if needed.
    ///
    /// Records hold scaled values, so the `scale` and `offset` lists of the description are dropped; its record entries and
    /// its `[text]` too, since [`BundleWriter::write`] makes the files.
    ///
    /// # Errors
    /// [`DataError::Exists`] if there is an `experiment.toml` already; [`DataError::Description`];
    /// [`DataError::Io`].
    pub fn create(
        folder: &Path,
        mut description: Description,
        format: RecordFormat,
    ) -> Result<Self, DataError> {
        check_head(&description).map_err(|f| toml_file::unlocated(folder, f))?;
        let c = &mut description.channels;
        for group in [
            &mut c.output,
            &mut c.input,
            &mut c.reference,
            &mut c.scheduling,
            &mut c.auxiliary,
        ] {
            group.scale.clear();
            group.offset.clear();
        }
        description.text = None;
        description.records.clear();
        let toml = folder.join("experiment.toml");
        if toml.symlink_metadata().is_ok() {
            return Err(DataError::Exists { path: toml });
        }
        Ok(Self {
            folder: folder.to_owned(),
            stage: Stage::create(folder)?,
            description,
            format,
            scheduling_scale: 0.0,
        })
    }

    /// Writes one record to `records/<name>.<ending>` and notes its entry.
    ///
    /// The record's channels must have the names of the description, in its order; only the injection is the record's
    /// own. Units are those of the description.
    ///
    /// # Errors
    /// [`DataError::RecordName`], [`DataError::Exists`], [`DataError::Record`] for samples that the reader would
    /// refuse, [`DataError::Description`] for a period or position that it would refuse, [`DataError::Io`].
    pub fn write(&mut self, record: &Record) -> Result<(), DataError> {
        let file = self.file_name(&record.name)?;
        let path = self.folder.join(&file);
        let index = self.description.records.len();
        let place = |problem| DataError::Record {
            place: Box::new(RecordPlace {
                index,
                file: path.clone(),
            }),
            problem: Box::new(problem),
        };
        let entry = entry(record, file.clone());
        check_entry(&entry, &KeyPath::key("records").at(index))
            .map_err(|f| toml_file::unlocated(&self.folder, f))?;
        self.check(record).map_err(place)?;
        if path.symlink_metadata().is_ok() || self.description.records.iter().any(|e| e.file == file) {
            return Err(DataError::Exists { path });
        }
        let (names, columns) = unique_columns(record).map_err(place)?;
        let staged = self.stage.path().join(&file);
        if let Some(parent) = staged.parent() {
            fs::create_dir_all(parent).map_err(DataError::io("make the folder", parent))?;
        }
        // `create_new`: a file that appeared in the meantime is not overwritten either.
        let out = OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(&staged)
            .map_err(DataError::io("create", &path))?;
        let written = match self.format {
            RecordFormat::Npz => columns::write_npz(out, &names, &columns),
            RecordFormat::Csv => columns::write_csv(out, &names, &columns),
            RecordFormat::Mat => mat::write(out, &names, &columns),
            RecordFormat::Parquet => columns::write_parquet(out, &names, &columns),
            RecordFormat::Hdf5 | RecordFormat::Tdms | RecordFormat::Mdf | RecordFormat::Uff => {
                Err(RecordError::UnsupportedFormat {
                    found: format!("a record to write as `{}`", self.format.ending()),
                    supported: "npz, csv, mat, parquet",
                })
            }
        }
        .and_then(|file: File| file.sync_all().map_err(RecordError::io("write")));
        if let Err(problem) = written {
            // The record can be tried again, so its torn file goes; if that fails too, the first error counts.
            let _ = fs::remove_file(&staged);
            return Err(place(problem));
        }
        self.scheduling_scale = largest(&record.scheduling).max(self.scheduling_scale);
        self.description.records.push(entry);
        Ok(())
    }

    /// What is half done: this folder, and then those that were made for the bundle as far as they are empty, outermost first. For a
    /// process that ends before this value is dropped.
    pub fn unfinished(&self) -> (&Path, &[PathBuf]) {
        (self.stage.path(), self.stage.made())
    }

    /// Writes `experiment.toml`, puts all files in their places, and opens the bundle.
    ///
    /// # Errors
    /// [`DataError::Description`] without any record; [`DataError::Exists`]; [`DataError::Io`].
    pub fn finish(self) -> Result<Bundle, DataError> {
        let file = self.folder.join("experiment.toml");
        crate::description_check::check_entries(&self.description.records)
            .map_err(|f| toml_file::unlocated(&self.folder, f))?;
        let text = toml_file::print(&self.description).map_err(|e| DataError::Io {
            action: "write",
            path: file.clone(),
            source: std::io::Error::other(e.to_string()),
        })?;
        File::create_new(self.stage.path().join("experiment.toml"))
            .and_then(|mut out| out.write_all(text.as_bytes()).and_then(|()| out.sync_all()))
            .map_err(DataError::io("write", &file))?;
        self.stage.publish()?;
        Bundle::open(&self.folder)
    }

    fn file_name(&self, name: &str) -> Result<String, DataError> {
        let good = |part: &str| {
            !part.is_empty()
                && !part.starts_with('.')
                && part
                    .chars()
                    .all(|c| c.is_alphanumeric() || matches!(c, '_' | '-' | '.'))
        };
        if name.len() > 200 || !name.split('/').all(good) {
            return Err(DataError::RecordName {
                name: name.to_owned(),
            });
        }
        Ok(format!("records/{name}{}", self.format.ending()))
    }

    fn check(&self, record: &Record) -> Result<(), RecordError> {
        let c = &self.description.channels;
        let pairs = [
            ("output", &c.output, &record.outputs),
            ("input", &c.input, &record.inputs),
            ("reference", &c.reference, &record.references),
            ("scheduling", &c.scheduling, &record.scheduling),
            ("auxiliary", &c.auxiliary, &record.auxiliary),
        ];
        for (group, expected, signals) in pairs {
            lists(group, signals)?;
            if signals.names != expected.columns {
                return Err(RecordError::Channels {
                    group,
                    expected: expected.columns.clone(),
                    found: signals.names.clone(),
                });
            }
        }
        lists("injection", &record.injection)?;
        let scale = largest(&record.scheduling).max(self.scheduling_scale);
        let expectation = Expectation {
            declared_position: record.position.clone(),
            // Which records are still to come is not known: what rests beside the largest |p| may rest.
            scheduling_range: Box::new(move |_| scale),
        };
        checks::check(record, &expectation).map(drop)
    }
}

fn lists(group: &'static str, s: &Signals) -> Result<(), RecordError> {
    let (columns, names, units) = (s.columns.len(), s.names.len(), s.units.len());
    if columns != names || (units != 0 && units != columns) {
        return Err(RecordError::SignalLists {
            group,
            columns,
            names,
            units,
        });
    }
    Ok(())
}

fn largest(s: &Signals) -> f64 {
    s.columns
        .iter()
        .flatten()
        .map(|v| v.abs())
        .filter(|v| v.is_finite())
        .fold(0.0, f64::max)
}

fn entry(record: &Record, file: String) -> RecordEntry {
    let (kind, period) = match record.kind {
        RecordKind::Periodic { period } => (EntryKind::Periodic, Some(period)),
        RecordKind::Transient => (EntryKind::Transient, None),
    };
    let injection = ChannelGroup {
        columns: record.injection.names.clone(),
        units: record.injection.units.clone(),
        ..ChannelGroup::default()
    };
    RecordEntry {
        quantity: None,
        file,
        kind,
        period,
        purpose: record.purpose,
        position: record.position.clone(),
        injection,
        columns: BTreeMap::new(),
        rows: None,
    }
}

/// Every column once: a name that serves two roles must hold the same samples in both.
fn unique_columns(record: &Record) -> Result<(Vec<&str>, Vec<&[f64]>), RecordError> {
    let (mut names, mut columns): (Vec<&str>, Vec<&[f64]>) = (Vec::new(), Vec::new());
    for (group, signals) in record.named_groups() {
        for (name, column) in signals.names.iter().zip(&signals.columns) {
            match names.iter().position(|n| n == name) {
                Some(first) if columns[first] != column.as_slice() => {
                    return Err(RecordError::TwoContents {
                        column: name.clone(),
                        group,
                    });
                }
                Some(_) => {}
                None => {
                    names.push(name);
                    columns.push(column);
                }
            }
        }
    }
    Ok((names, columns))
}
