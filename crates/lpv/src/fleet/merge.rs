//! The rows of all shards as one table.

use super::{FleetError, LIST, List, ROW, Row, VERSION, inputs, read};
use crate::PipelineError;
use crate::diagnose::FoundEffect;
use crate::encode::cell;
use crate::output::Inputs;
use crate::table::TextTable;
use schemars::JsonSchema;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Head of the table as CSV.
pub(crate) const HEAD: [&str; 6] = ["bundle", "worth", "verdict", "effects", "error", "exit_code"];

/// All rows of a fleet, in the order of its list: the same bits whatever the shards were and however often they were stopped. Times are
/// left to the rows' own files.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Table {
    fleet: u32,
    /// `diagnose` or `identify`.
    pub task: String,
    /// Bundles in the list.
    pub bundles: usize,
    /// Those without a row.
    pub missing: Vec<String>,
    /// The rows that are there.
    pub rows: Vec<TableRow>,
}

/// A row of the table.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct TableRow {
    /// The bundle, as it was given.
    pub bundle: String,
    /// The judgement in a word.
    pub worth: Option<String>,
    /// The same in a sentence.
    pub verdict: Option<String>,
    /// Effects that were found.
    pub effects: Vec<FoundEffect>,
    /// Why there is no result.
    pub error: Option<String>,
    /// What the program would have ended with.
    pub exit_code: u8,
}

/// What a merge of these folders reads.
pub fn reads(folders: &[PathBuf]) -> Inputs {
    let rows = |folder: &PathBuf| {
        let below = std::fs::read_dir(folder).into_iter().flatten().flatten();
        below.map(|entry| entry.path().join(ROW)).collect::<Vec<_>>()
    };
    folders.iter().fold(Inputs::none(), |inputs, folder| {
        let inputs = inputs.file(&folder.join(LIST), "the list of a shard");
        let all = rows(folder).into_iter();
        all.fold(inputs, |inputs, row| inputs.file(&row, "a row of a shard"))
    })
}

/// Puts the rows in these folders together.
///
/// # Errors
/// [`FleetError::File`] for a folder that no shard wrote or a row that is damaged, [`FleetError::Lists`] for folders of different lists,
/// [`FleetError::Rows`] for two rows of one bundle that differ.
pub fn merge(folders: &[PathBuf]) -> Result<Table, PipelineError> {
    let lists = folders
        .iter()
        .map(|f| read::<List>(&f.join(LIST)))
        .collect::<Result<Vec<_>, _>>()?;
    if let Some(other) = lists.iter().position(|l| *l != lists[0]) {
        let folders = Box::new([folders[0].clone(), folders[other].clone()]);
        return Err(FleetError::Lists { folders }.into());
    }
    let mut table = Table {
        fleet: VERSION,
        task: lists.first().map_or_else(String::new, |l| l.task.clone()),
        bundles: lists.first().map_or(0, |l| l.bundles.len()),
        missing: Vec::new(),
        rows: Vec::new(),
    };
    for name in lists.first().map_or(&[][..], |l| &l.bundles) {
        let mut found: Option<(&PathBuf, TableRow)> = None;
        for folder in folders {
            let file = folder.join(inputs::folder_name(Path::new(name))).join(ROW);
            if !file.exists() {
                continue;
            }
            let row = TableRow::from(read::<Row>(&file)?);
            if row.bundle != *name {
                let problem = format!("the row of {} stands in the place of that of {name}", row.bundle);
                return Err(FleetError::File { file, problem }.into());
            }
            match &found {
                Some((first, other)) if *other != row => {
                    let (bundle, folders) = (name.clone(), Box::new([(*first).clone(), folder.clone()]));
                    return Err(FleetError::Rows { bundle, folders }.into());
                }
                Some(_) => {}
                None => found = Some((folder, row)),
            }
        }
        match found {
            Some((_, row)) => table.rows.push(row),
            None => table.missing.push(name.clone()),
        }
    }
    Ok(table)
}

impl From<Row> for TableRow {
    fn from(row: Row) -> Self {
        Self {
            bundle: row.bundle,
            worth: row.worth,
            verdict: row.verdict,
            effects: row.effects,
            error: row.error,
            exit_code: row.exit_code,
        }
    }
}

impl TableRow {
    fn effects(&self) -> String {
        let names = self
            .effects
            .iter()
            .map(|e| format!("{} at {}", e.effect, e.channel));
        names.collect::<Vec<_>>().join("; ")
    }
}

impl Table {
    /// Whether every bundle has a result that may be used.
    pub fn is_whole(&self) -> bool {
        self.missing.is_empty() && self.rows.iter().all(|r| r.exit_code == 0)
    }

    /// As JSON.
    ///
    /// # Errors
    /// None that is known.
    pub fn to_json(&self) -> Result<String, PipelineError> {
        Ok(serde_json::to_string_pretty(self)?)
    }

    /// As CSV: a row for each bundle of the list that has one.
    ///
    /// # Errors
    /// None that is known.
    pub fn to_csv(&self) -> Result<String, PipelineError> {
        let failed = |e: String| PipelineError::Format(e);
        let mut out = csv::Writer::from_writer(Vec::new());
        out.write_record(HEAD).map_err(|e| failed(e.to_string()))?;
        for row in &self.rows {
            let text = |value: &Option<String>| cell(value.as_deref().unwrap_or_default());
            let cells = [
                cell(&row.bundle),
                text(&row.worth),
                text(&row.verdict),
                cell(&row.effects()),
                text(&row.error),
                row.exit_code.to_string(),
            ];
            out.write_record(cells).map_err(|e| failed(e.to_string()))?;
        }
        let bytes = out.into_inner().map_err(|e| failed(e.to_string()))?;
        String::from_utf8(bytes).map_err(|e| failed(e.to_string()))
    }

    /// In words: how many there are, what is missing, and a line for each.
    pub fn text(&self) -> String {
        let refused = self.rows.iter().filter(|r| r.error.is_some()).count();
        let mut out = format!(
            "{} of {} bundles have a row, {refused} of them an error\n",
            self.rows.len(),
            self.bundles
        );
        for name in &self.missing {
            out += &format!("missing: {name}\n");
        }
        let mut table = TextTable::new(&["bundle", "worth", "effects", "error"]);
        for row in &self.rows {
            let first = |e: &String| e.lines().next().unwrap_or_default().to_owned();
            table.row(vec![
                row.bundle.clone(),
                row.worth.clone().unwrap_or_default(),
                row.effects(),
                row.error.as_ref().map(first).unwrap_or_default(),
            ]);
        }
        out + &table.text()
    }
}
