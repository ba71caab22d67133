//! Results of this program, told from other files by what is in them.

use crate::convert::TABLE_HEAD;
use crate::fleet::TABLE_HEAD as FLEET_HEAD;
use experiment_data::mat::read_arrays;
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

/// What is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A model as JSON.
    Model,
    /// A model as JSON that `lpv diagnose` wrote: a model from elsewhere is another thing.
    DiagnosedModel,
    /// The account of a diagnosis.
    Diagnosis,
    /// A page.
    Page,
    /// A model as a MATLAB file.
    Matlab,
    /// A model as a table.
    Table,
    /// A model as a module of Python.
    Python,
    /// The list of a fleet, a row or its table, as JSON.
    Fleet,
    /// The table of a fleet.
    FleetTable,
}

/// The keys that tell results apart.
#[derive(Deserialize)]
struct Marks {
    format: Option<serde_json::Value>,
    identification: Option<Origin>,
    fleet: Option<IgnoredAny>,
    verdict: Option<IgnoredAny>,
    base_model: Option<IgnoredAny>,
    candidates: Option<IgnoredAny>,
}

#[derive(Deserialize)]
struct Origin {
    written_by: Option<String>,
}

impl Kind {
    /// In words.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Model => "model of lpv",
            Self::DiagnosedModel => "model of `lpv diagnose`",
            Self::Diagnosis => "account of `lpv diagnose`",
            Self::Page => "page of lpv",
            Self::Matlab => "MATLAB file of `lpv convert`",
            Self::Table => "table of `lpv convert`",
            Self::Python => "module of `lpv convert`",
            Self::Fleet => "file of `lpv fleet` or `lpv merge`",
            Self::FleetTable => "table of `lpv merge`",
        }
    }

    /// Whether a file is a result of this kind.
    pub(super) fn is(self, file: &Path) -> bool {
        let head = head(file);
        let marks = || marks(file, &head);
        match self {
            Self::Model => marks().is_some_and(|m| m.is_model()),
            Self::DiagnosedModel => marks().is_some_and(|m| m.is_model() && m.is_diagnosed()),
            Self::Diagnosis => marks()
                .is_some_and(|m| m.verdict.is_some() && m.base_model.is_some() && m.candidates.is_some()),
            Self::Page => contains(&head, lpv_report::GENERATOR.as_bytes()),
            Self::Matlab => {
                head.starts_with(b"MATLAB 5.0 MAT-file  ") && read_arrays(file, &["lpv.Ts"]).is_ok()
            }
            Self::Table => head.starts_with((TABLE_HEAD.join(",") + "\n").as_bytes()),
            Self::Fleet => marks().is_some_and(|m| m.fleet.is_some()),
            Self::FleetTable => head.starts_with((FLEET_HEAD.join(",") + "\n").as_bytes()),
            Self::Python => contains(&head, b"\nWritten by `lpv convert`."),
        }
    }
}

impl Marks {
    fn is_model(&self) -> bool {
        self.format.as_ref().and_then(|f| f.as_str()) == Some("lpv-model")
    }

    fn is_diagnosed(&self) -> bool {
        let by = self.identification.as_ref().and_then(|i| i.written_by.as_deref());
        by == Some(crate::model_file::DIAGNOSE)
    }
}

/// The first bytes.
fn head(file: &Path) -> Vec<u8> {
    const BYTES: u64 = 2048;
    let mut head = Vec::new();
    if let Ok(open) = File::open(file) {
        // As much as can be read; nothing tells nothing.
        open.take(BYTES).read_to_end(&mut head).ok();
    }
    head
}

fn marks(file: &Path, head: &[u8]) -> Option<Marks> {
    let object = head.trim_ascii_start().starts_with(b"{");
    let open = object.then(|| File::open(file).ok()).flatten()?;
    serde_json::from_reader(BufReader::new(open)).ok()
}

fn contains(head: &[u8], mark: &[u8]) -> bool {
    head.windows(mark.len()).any(|w| w == mark)
}

/// What a file is, as far as its first bytes tell.
pub(super) fn in_words(file: &Path) -> String {
    let head = head(file);
    let begins = |mark: &[u8]| head.starts_with(mark);
    if let Some(m) = marks(file, &head) {
        return match (m.is_model(), m.is_diagnosed()) {
            (true, true) => "a model of `lpv diagnose`".to_owned(),
            (true, false) => "a model".to_owned(),
            _ => "a JSON file".to_owned(),
        };
    }
    let known = [
        (&b"PK\x03\x04"[..], "an archive (npz or zip)"),
        (b"PAR1", "a Parquet file"),
        (b"\x89HDF\r\n\x1a\n", "an HDF5 file"),
        (b"MATLAB", "a MATLAB file"),
        (b"<!DOCTYPE", "a page"),
        (b"<!doctype", "a page"),
    ];
    if let Some((_, words)) = known.iter().find(|(mark, _)| begins(mark)) {
        return (*words).to_owned();
    }
    if head.is_empty() {
        return "a file that cannot be read".to_owned();
    }
    let first = head.split(|b| *b == b'\n').next().unwrap_or_default();
    match std::str::from_utf8(first) {
        Ok(line) if !head.contains(&0) => {
            let mut shown: String = line.trim_end().chars().take(40).collect();
            if shown.len() < line.trim_end().len() {
                shown += " ...";
            }
            format!(
                "a text file that begins with `{}`",
                crate::encode::visible(&shown)
            )
        }
        _ => "a file of another program".to_owned(),
    }
}
