//! Many bundles: `lpv fleet` on each machine of a cluster, `lpv merge` over what they wrote.

use crate::bars;
use crate::done::{Done, Tone};
use crate::run::{shown, told};
use clap::{Args, ValueEnum};
use lpv::fleet::{self, Shard, Table};
use lpv::output::{Kind, Overwrite, Place, one_by_one, write_all};
use lpv::{IdentifyConfig, PipelineError};
use std::path::PathBuf;

#[derive(Args)]
pub(crate) struct Fleet {
    /// The bundles: folders with an experiment.toml, or those files; the same list in the same order for every shard.
    #[arg(required = true, value_name = "BUNDLE")]
    pub(crate) bundles: Vec<PathBuf>,
    /// What is done with each.
    #[arg(long, value_enum, default_value_t = TaskName::Diagnose)]
    pub(crate) task: TaskName,
    /// Number k of N parts of the list, from 1; the whole list without.
    #[arg(long, value_name = "k/N")]
    pub(crate) shard: Option<Shard>,
    /// Of a diagnosis, the model that effects are added to; made from each bundle without.
    #[arg(short, long, value_name = "FILE", conflicts_with = "config")]
    pub(crate) model: Option<PathBuf>,
    /// Of a diagnosis, a TOML file with effects of your own, which are tried beside those of the catalogue.
    #[arg(long, value_name = "FILE", conflicts_with = "config")]
    pub(crate) effects: Option<PathBuf>,
    /// Of an identification, its settings, a TOML file.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) config: Option<PathBuf>,
    /// The folder of the results, one folder a bundle in it; shards may share it.
    #[arg(short, long, value_name = "FOLDER")]
    pub(crate) output: PathBuf,
    /// Replace a file that is no result of lpv, if one stands where a result goes.
    #[arg(long)]
    pub(crate) force: bool,
    /// Print the rows as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

/// What can be done with each bundle.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum TaskName {
    Diagnose,
    Identify,
}

#[derive(Args)]
pub(crate) struct Merge {
    /// Folders that `lpv fleet` wrote, of all shards.
    #[arg(required = true, value_name = "FOLDER")]
    pub(crate) folders: Vec<PathBuf>,
    /// Where the table goes, as .json or .csv; without it only the text is printed.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Replace a file that is no table of lpv, if one stands there.
    #[arg(long)]
    pub(crate) force: bool,
    /// Print the table as JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

/// A table as the text of a file.
type Written = fn(&Table) -> Result<String, PipelineError>;

fn slip(problem: &'static str) -> PipelineError {
    PipelineError::Structure { problem }
}

pub(crate) fn run_fleet(a: &Fleet) -> Result<Done, PipelineError> {
    let task = match (a.task, &a.config) {
        (TaskName::Diagnose, None) => fleet::Task::Diagnose {
            model: a.model.clone(),
            effects: a.effects.clone(),
        },
        (TaskName::Diagnose, Some(_)) => {
            return Err(slip(
                "--config has settings of an identification: add --task identify, or leave it out",
            ));
        }
        (TaskName::Identify, _) if a.model.is_some() || a.effects.is_some() => {
            return Err(slip(
                "--model and --effects are for --task diagnose; leave them out",
            ));
        }
        (TaskName::Identify, None) => fleet::Task::Identify(Box::default()),
        (TaskName::Identify, Some(file)) => fleet::Task::Identify(Box::new(IdentifyConfig::read(file)?)),
    };
    one_by_one();
    let shard = a.shard.unwrap_or(Shard::ALL);
    let to = (a.output.as_path(), Overwrite::if_asked(a.force));
    let found = fleet::run(&a.bundles, &task, shard, to, &bars::tell)?;
    let names = found.rows.iter().map(|r| r.bundle.as_str());
    let said = told(a.json, &found, names, || {
        let mut text = format!(
            "{} of {} bundles in this shard, {} of them kept from before; written to {}",
            found.rows.len(),
            a.bundles.len(),
            found.kept,
            shown(&a.output)
        );
        for row in &found.rows {
            let word = row.error.as_ref().or(row.verdict.as_ref());
            let first = word.and_then(|w| w.lines().next()).unwrap_or_default();
            text += &format!("\n{}: {first}", row.bundle);
        }
        text
    })?;
    let usable = found.rows.iter().all(|r| r.exit_code == 0);
    Ok(said.judged(if usable { Tone::Good } else { Tone::Bad }))
}

pub(crate) fn run_merge(a: &Merge) -> Result<Done, PipelineError> {
    let to = a.output.as_deref().map(|file| {
        let ending = file
            .extension()
            .unwrap_or_default()
            .to_string_lossy()
            .to_lowercase();
        let (kind, write): (Kind, Written) = match ending.as_str() {
            "json" => (Kind::Fleet, Table::to_json),
            "csv" => (Kind::FleetTable, Table::to_csv),
            _ => return Err(slip("--output of `lpv merge` ends in .json or .csv")),
        };
        let place = Place::check(
            file,
            kind,
            &fleet::reads(&a.folders),
            Overwrite::if_asked(a.force),
        )?;
        Ok((place, write))
    });
    let to = to.transpose()?;
    let table = fleet::merge(&a.folders)?;
    if let Some((place, write)) = to {
        write_all(&[(&place, write(&table)?.as_bytes())])?;
    }
    let names = table.rows.iter().map(|r| r.bundle.as_str());
    let names = names.chain(table.missing.iter().map(String::as_str));
    let said = told(a.json, &table, names, || table.text())?;
    Ok(said.judged(if table.is_whole() { Tone::Good } else { Tone::Bad }))
}
