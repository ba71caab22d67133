//! A bundle on disk: the description in memory, the records where they are.

mod memory;
mod open;
mod place;

use self::open::{read_text, record_names};
use crate::checks::{self, Expectation, PeriodicCheck};
use crate::description::{ChannelGroup, Description};
use crate::description_check::fault;
use crate::error::ResponseFault;
use crate::key_path::KeyPath;
use crate::source::Source;
use crate::{DataError, DescriptionError, RecordError, RecordPlace, paths, toml_file};
use lpv_core::{Discrete, Position, Record, RecordKind, Signals};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// A parsed and checked description, with its record files known to exist. No samples are loaded.
#[derive(Debug)]
pub struct Bundle {
    folder: PathBuf,
    /// The folder without links.
    root: PathBuf,
    file: PathBuf,
    text: String,
    description: Description,
    names: Vec<String>,
    /// Range of each scheduling column over the bundle; computed only when a record is in doubt.
    scheduling_ranges: OnceLock<Vec<f64>>,
}

impl Bundle {
    /// Opens a bundle by its folder or by its `experiment.toml`.
    ///
    /// # Errors
    /// [`DataError::NotABundle`], [`DataError::Io`], [`DataError::Toml`], [`DataError::Description`] with the position
    /// in the file: every clause that can be told without reading samples, including record files that are missing,
    /// of an unsupported kind or outside the folder.
    pub fn open(folder_or_toml: &Path) -> Result<Self, DataError> {
        let file = if folder_or_toml.is_dir() {
            folder_or_toml.join("experiment.toml")
        } else {
            folder_or_toml.to_owned()
        };
        let folder = match file.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
            _ => PathBuf::from("."),
        };
        if !file.exists() {
            let folder = if folder_or_toml.is_dir() {
                folder
            } else {
                folder_or_toml.to_owned()
            };
            return Err(DataError::NotABundle { folder });
        }
        let root = folder.canonicalize().map_err(DataError::io("open", &folder))?;
        let text = read_text(&file)?;
        let text = text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text);
        let description = toml_file::parse(&file, &text)?;
        let bundle = Self {
            names: record_names(&description),
            folder,
            root,
            file,
            text,
            description,
            scheduling_ranges: OnceLock::new(),
        };
        bundle.check_files()?;
        Ok(bundle)
    }

    /// The description.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// The same records with these outputs and inputs alone, by their indices: one machine of several. References, which are those of
    /// all of them, are left out.
    #[must_use]
    pub fn of_channels(&self, outputs: &[usize], inputs: &[usize]) -> Self {
        let mut description = self.description.clone();
        let channels = &mut description.channels;
        channels.output = channels.output.only(outputs);
        channels.input = channels.input.only(inputs);
        channels.reference = ChannelGroup::default();
        Self {
            folder: self.folder.clone(),
            root: self.root.clone(),
            file: self.file.clone(),
            text: self.text.clone(),
            names: self.names.clone(),
            description,
            scheduling_ranges: OnceLock::new(),
        }
    }

    /// Number of records.
    pub fn len(&self) -> usize {
        self.description.records.len()
    }

    /// Whether there is no record; never true for an open bundle.
    pub fn is_empty(&self) -> bool {
        self.description.records.is_empty()
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The description file.
    pub fn description_file(&self) -> &Path {
        &self.file
    }

    /// The file of a record.
    ///
    /// # Errors
    /// [`DataError::Index`]; [`DataError::Description`] if the file has gone since the bundle was opened.
    pub fn record_path(&self, index: usize) -> Result<PathBuf, DataError> {
        Ok(self.resolve(index)?.path)
    }

    /// The clock of all records.
    ///
    /// # Errors
    /// [`DataError::Core`]; not for a checked description.
    pub fn clock(&self) -> Result<Discrete, DataError> {
        Ok(Discrete::from_rate(self.description.sample_rate_hz)?)
    }

    /// Reads one record: only the columns that the description names, scaled and checked.
    ///
    /// The record's name is the file's path without `records/` in front and without its ending (with both, where two
    /// records would share a name). `position` is the declared one; for a periodic record with scheduling signals
    /// and no declaration it is the mean of each.
    ///
    /// # Errors
    /// [`DataError::Index`], [`DataError::Record`] with the file, the record, the column and the place in it.
    pub fn load(&self, index: usize) -> Result<Record, DataError> {
        let entry = self.entry(index)?;
        let path = self.record_path(index)?;
        if entry.is_response() {
            return Err(self.record_fault(index, path, ResponseFault::NoSamples.into()));
        }
        let names = self.columns_of(entry);
        let source = self.source(entry, &path);
        let record = source.read(&names).and_then(|data| {
            let mut record = self.record(index, &names, data);
            record.position = checks::check(&record, &self.expectation(entry))?;
            Ok(record)
        });
        record.map_err(|problem| self.record_fault(index, path, problem))
    }

    /// Reads a periodic record a period at a time, each as a record of its own, scaled: NPZ and CSV files that are larger than the
    /// memory can be read so; of an NPZ file every column is open at once. A transient record comes in one piece. Gives the
    /// position, as in [`Bundle::load`].
    ///
    /// # Errors
    /// As [`Bundle::load`], at the end: the clauses of the format hold for all periods together, and what `sink` was given
    /// counts only where they do.
    pub fn each_period(
        &self,
        index: usize,
        mut sink: impl FnMut(Record),
    ) -> Result<Option<Position>, DataError> {
        let entry = self.entry(index)?;
        let RecordKind::Periodic { period } = entry.record_kind() else {
            let record = self.load(index)?;
            let position = record.position.clone();
            sink(record);
            return Ok(position);
        };
        let path = self.record_path(index)?;
        let names = self.columns_of(entry);
        let mut check =
            PeriodicCheck::new(&self.record(index, &names, vec![Vec::new(); names.len()]), period);
        let read = self
            .source(entry, &path)
            .each_block(&names, period.max(1), &mut |block| {
                let whole = block.iter().all(|c| c.len() == period);
                let record = self.record(index, &names, block);
                check.push(&record);
                if whole {
                    sink(record);
                }
            });
        read.and_then(|()| check.finish(&self.expectation(entry)))
            .map_err(|problem| self.record_fault(index, path, problem))
    }

    /// What of a file belongs to a record.
    fn source<'a>(&'a self, entry: &'a crate::RecordEntry, path: &'a Path) -> Source<'a> {
        Source {
            path,
            text: self.description.text.as_ref(),
            entry,
        }
    }

    /// What is wrong with a record, and where.
    pub(crate) fn record_fault(&self, index: usize, file: PathBuf, mut problem: RecordError) -> DataError {
        if let Some(entry) = self.description.records.get(index) {
            self.source(entry, &file).add_lines(&mut problem);
        }
        DataError::Record {
            place: Box::new(RecordPlace { index, file }),
            problem: Box::new(problem),
        }
    }

    fn expectation<'a>(&'a self, entry: &'a crate::RecordEntry) -> Expectation<'a> {
        Expectation {
            declared_position: entry.position.clone(),
            scheduling_range: Box::new(|column| self.scheduling_range(column)),
        }
    }

    /// The name that [`Bundle::load`] gives a record.
    ///
    /// # Errors
    /// [`DataError::Index`].
    pub fn record_name(&self, index: usize) -> Result<&str, DataError> {
        self.entry(index)?;
        Ok(&self.names[index])
    }

    /// All records in order, one in memory at a time.
    pub fn records(&self) -> impl Iterator<Item = Result<Record, DataError>> {
        (0..self.len()).map(|index| self.load(index))
    }

    fn entry(&self, index: usize) -> Result<&crate::RecordEntry, DataError> {
        let records = self.len();
        self.description
            .records
            .get(index)
            .ok_or(DataError::Index { index, records })
    }

    fn resolve(&self, index: usize) -> Result<paths::Resolved, DataError> {
        let entry = self.entry(index)?;
        paths::resolve(&self.folder, &self.root, &entry.file).map_err(|p| self.file_fault(index, p))
    }

    fn check_files(&self) -> Result<(), DataError> {
        let records = &self.description.records;
        let mut seen: HashMap<PathBuf, Vec<usize>> = HashMap::new();
        for (index, entry) in records.iter().enumerate() {
            // After following links, so that one file under two names is seen too.
            let earlier = seen.entry(self.resolve(index)?.real).or_default();
            let file = || entry.file.clone();
            let shares = |k: &&usize| entry.shares_samples(&records[**k], &self.description.channels);
            if let Some(&first) = earlier.iter().find(shares) {
                let problem = DescriptionError::DuplicateRecord { file: file(), first };
                return Err(self.file_fault(index, problem));
            }
            if earlier.len() == MOST_PARTS {
                let problem = DescriptionError::ManyParts {
                    file: file(),
                    most: MOST_PARTS,
                };
                return Err(self.file_fault(index, problem));
            }
            earlier.push(index);
        }
        Ok(())
    }

    fn file_fault(&self, index: usize, problem: DescriptionError) -> DataError {
        let path = KeyPath::key("records").at(index).then("file");
        toml_file::locate_in(&self.file, &self.text, fault(path, problem))
    }

    /// The names of the columns of a record, each once.
    pub(crate) fn column_names(&self, index: usize) -> Result<Vec<&str>, DataError> {
        Ok(self.columns_of(self.entry(index)?))
    }

    /// The columns of a record, each once.
    fn columns_of<'a>(&'a self, entry: &'a crate::RecordEntry) -> Vec<&'a str> {
        let mut seen = HashSet::new();
        let columns = self.groups(entry).into_iter().flat_map(|g| &g.columns);
        columns.map(String::as_str).filter(|c| seen.insert(*c)).collect()
    }

    fn groups<'a>(&'a self, entry: &'a crate::RecordEntry) -> [&'a ChannelGroup; 6] {
        let c = &self.description.channels;
        [
            &c.output,
            &c.input,
            &c.reference,
            &c.scheduling,
            &c.auxiliary,
            &entry.injection,
        ]
    }

    /// The record with these columns, scaled.
    fn record(&self, index: usize, names: &[&str], data: Vec<Vec<f64>>) -> Record {
        let entry = &self.description.records[index];
        let c = &self.description.channels;
        let groups = self.groups(entry);
        let mut data: Vec<Option<Vec<f64>>> = data.into_iter().map(Some).collect();
        let places: HashMap<&str, usize> = names.iter().enumerate().map(|(i, n)| (*n, i)).collect();
        let mut uses = vec![0_usize; names.len()];
        for column in groups.iter().flat_map(|g| &g.columns) {
            if let Some(&i) = places.get(column.as_str()) {
                uses[i] += 1;
            }
        }
        let mut signals = |group: &ChannelGroup| -> Signals {
            let mut columns = Vec::with_capacity(group.len());
            for (k, name) in group.columns.iter().enumerate() {
                let Some(&i) = places.get(name.as_str()) else {
                    continue;
                };
                uses[i] -= 1;
                // The last use takes the samples; earlier ones copy.
                let samples = if uses[i] == 0 {
                    data[i].take()
                } else {
                    data[i].clone()
                };
                let mut samples = samples.unwrap_or_default();
                scale_column(group, k, &mut samples);
                columns.push(samples);
            }
            Signals {
                names: group.columns.clone(),
                units: group.units.clone(),
                columns,
            }
        };
        Record {
            name: self.names[index].clone(),
            kind: entry.record_kind(),
            purpose: entry.purpose,
            position: entry.position.clone(),
            outputs: signals(&c.output),
            inputs: signals(&c.input),
            references: signals(&c.reference),
            scheduling: signals(&c.scheduling),
            auxiliary: signals(&c.auxiliary),
            injection: signals(&entry.injection),
        }
    }
}

/// Records that are parts of one file: each is held against all others.
const MOST_PARTS: usize = 1000;
/// Rows that are read at once of a signal that need not be whole.
const BLOCK: usize = 1 << 16;

/// The numbers of a column in the units of the description.
fn scale_column(group: &ChannelGroup, k: usize, samples: &mut [f64]) {
    if let Some(&scale) = group.scale.get(k)
        && scale != 1.0
    {
        samples.iter_mut().for_each(|v| *v *= scale);
    }
    if let Some(&offset) = group.offset.get(k)
        && offset != 0.0
    {
        samples.iter_mut().for_each(|v| *v -= offset);
    }
}
