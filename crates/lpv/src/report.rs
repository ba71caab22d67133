//! The page of a folder with models: Bode plots of all channels over positions, poles, coefficient functions, errors, time
//! responses.

mod band;
mod beside;
mod bode;
mod coefficients;
mod errors;
mod lead;
mod over_p;
mod poles;
mod small;
mod time;

use crate::output::Inputs;
use crate::progress::Progress;
use crate::validation::{Evidence, Scope, Validation, validate};
use crate::verdict::{Verdict, Worth};
use crate::{AxisSummary, Identification, ModelFile, PipelineError};
use band::Known;
use beside::Row;
use experiment_data::Bundle;
use lpv_core::{Discrete, StateSpace};
use lpv_report::{Block, Cell, Format, KeyFigure, Page, Section, Table, Tone};
use lpv_simulate::{Frozen, Machine};
use std::path::{Path, PathBuf};

/// Positions at which a model is drawn.
const POSITIONS: usize = 5;

/// Everything that the figures of one model need.
struct Subject {
    file: ModelFile,
    machine: Machine,
    clock: Discrete,
    inputs: Vec<String>,
    outputs: Vec<String>,
    /// Scheduling values at which the frozen model is drawn; one empty value for a time-invariant model.
    positions: Vec<Vec<f64>>,
    validation: Option<Validation>,
    evidence: Evidence,
}

impl Subject {
    /// The frozen models at the positions that are drawn.
    fn frozen(&self) -> Result<Vec<StateSpace<Discrete>>, PipelineError> {
        self.positions.iter().map(|p| Ok(self.machine.at(p)?)).collect()
    }
}

/// The page of all models in a folder, each against the bundle that it names, or against `bundle`.
///
/// # Errors
/// [`PipelineError::Model`] for a folder without a model or a file that cannot be read; a bundle that is given and does not
/// fit. A bundle that a model names and that is gone is noted on the page.
pub fn page(folder: &Path, bundle: Option<&Path>, progress: Progress<'_>) -> Result<Page, PipelineError> {
    let files = model_files(folder)?;
    let mut page = Page::new(match files.len() {
        1 => "Identified model",
        _ => "Identified models",
    });
    let mut rows = Vec::new();
    for file in &files {
        let name = file
            .file_name()
            .map_or(String::new(), |n| n.to_string_lossy().into_owned());
        let found = ModelFile::read(file).and_then(|model| subject(model, file, bundle, progress));
        let (subject, note) = match found {
            Ok(found) => found,
            // Of several models one that cannot be shown is noted beside the others.
            Err(e) if files.len() > 1 => {
                page = page.section(Section::new(name).note(format!("Not shown: {e}")));
                continue;
            }
            Err(e) => return Err(e),
        };
        let verdict = verdict(&subject);
        let known = bode::known(&subject)?;
        let words = lead::words(&subject, verdict);
        let mut own = sections(&name, &subject, note, &known)?;
        if files.len() == 1 {
            page = page.lead(words);
            if let Some(figure) = lead::figure(&subject, &known, verdict) {
                let figure = Block::Figure(Box::new(figure));
                // No figure stands on the page twice.
                own.iter_mut()
                    .for_each(|section| section.blocks.retain(|block| *block != figure));
                page = page.lead([figure]);
            }
        } else {
            own[0].blocks.splice(..0, words);
            rows.push(Row::of(&name, &subject, verdict));
        }
        page.sections.append(&mut own);
        if let Some(account) = &subject.file.identification {
            page = page.fact(format!("{name}: bundle"), account.bundle.clone());
            page = page.fact(format!("{name}: seed"), account.config.seed.to_string());
        }
    }
    if !rows.is_empty() {
        page.lead = beside::lead(&rows);
        page.sections.insert(0, beside::section(&rows));
    }
    Ok(page.fact("lpv", env!("CARGO_PKG_VERSION")))
}

/// What a page or a conversion of these models reads: they, and the bundles that they name, or `bundle`.
pub fn read_for(models: &[PathBuf], bundle: Option<&Path>) -> Inputs {
    let mut inputs = Inputs::none();
    let mut folders: Vec<PathBuf> = bundle.map(Path::to_owned).into_iter().collect();
    for file in models {
        inputs = inputs.file(file, "a model");
        let account = ModelFile::read(file).ok().and_then(|m| m.identification);
        folders.extend(account.map(|a| bundle_of(&a, file)));
    }
    folders.sort();
    folders.dedup();
    let opened = folders.iter().filter_map(|folder| Bundle::open(folder).ok());
    opened.fold(inputs, |inputs, bundle| inputs.bundle(&bundle))
}

/// The folder of the bundle behind a model.
fn bundle_of(account: &Identification, file: &Path) -> PathBuf {
    file.parent().unwrap_or(Path::new(".")).join(&account.folder)
}

/// The model files of a folder in the order of their names; a file is itself.
///
/// # Errors
/// [`PipelineError::Model`] for a folder that cannot be read, or without a model.
pub fn model_files(folder: &Path) -> Result<Vec<PathBuf>, PipelineError> {
    let refuse = |problem: String| PipelineError::Model {
        file: folder.to_owned(),
        problem,
    };
    if folder.is_file() {
        return Ok(vec![folder.to_owned()]);
    }
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| refuse(e.to_string()))? {
        let path = entry.map_err(|e| refuse(e.to_string()))?.path();
        let json = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
        // Other JSON files may lie beside the models.
        if json && std::fs::read_to_string(&path).is_ok_and(|t| t.contains("\"lpv-model\"")) {
            files.push(path);
        }
    }
    files.sort();
    if files.is_empty() {
        return Err(refuse(
            "no model here; write one with `lpv identify BUNDLE -o FOLDER/model.json`".to_owned(),
        ));
    }
    Ok(files)
}

fn subject(
    file: ModelFile,
    path: &Path,
    bundle: Option<&Path>,
    progress: Progress<'_>,
) -> Result<(Subject, Option<String>), PipelineError> {
    let named = file.identification.as_ref().map(|i| bundle_of(i, path));
    let (opened, note) = match (bundle, named) {
        (Some(given), _) => (Some(Bundle::open(given)?), None),
        (None, Some(named)) => match Bundle::open(&named) {
            Ok(bundle) => (Some(bundle), None),
            Err(e) => (None, Some(format!("Without measurements: {e}. Give the folder with --bundle."))),
        },
        (None, None) => (
            None,
            Some("Without measurements: the model does not say where it comes from. Give a bundle with --bundle.".to_owned()),
        ),
    };
    let clock = match &opened {
        Some(bundle) => bundle.clock()?,
        None => own_clock(&file)?,
    };
    let machine = Machine::new(&file.model, clock)?;
    let (validation, evidence) = match &opened {
        Some(bundle) => {
            let (v, e) = validate(&file, bundle, Scope::HeldOut, progress)?;
            (Some(v), e)
        }
        None => (None, Evidence::default()),
    };
    let first = machine.range().map_or_else(Vec::new, |r| r.centre());
    let frozen = machine.at(&first)?;
    let account = file.identification.as_ref();
    let names = |given: Option<&Vec<String>>, letter: &str, count: usize| match given {
        Some(names) if names.len() == count => names.clone(),
        _ => (1..=count).map(|i| format!("{letter}{i}")).collect(),
    };
    let positions = match machine.range() {
        Some(range) if range.parameters() == 1 => {
            let mut measured: Vec<f64> = evidence
                .estimates
                .iter()
                .filter_map(|e| e.single_position())
                .collect();
            if measured.is_empty() {
                let known = account.and_then(|a| a.frozen_deviation.as_ref());
                measured.extend(known.iter().flat_map(|k| k.positions.iter().copied()));
            }
            drawn_positions(&measured, range.bounds()[0])
        }
        Some(range) => vec![range.centre()],
        None => vec![Vec::new()],
    };
    let subject = Subject {
        inputs: names(account.map(|a| &a.inputs), "u", frozen.inputs()),
        outputs: names(account.map(|a| &a.outputs), "y", frozen.outputs()),
        file,
        machine,
        clock,
        positions,
        validation,
        evidence,
    };
    Ok((subject, note))
}

/// Measured positions spread over the range, so that data and model are drawn at the same places.
fn drawn_positions(measured: &[f64], [low, high]: [f64; 2]) -> Vec<Vec<f64>> {
    let steps = (POSITIONS - 1) as f64;
    let mut drawn: Vec<f64> = (0..POSITIONS)
        .map(|i| {
            let wanted = low + (high - low) * i as f64 / steps;
            measured
                .iter()
                .copied()
                .min_by(|a, b| (a - wanted).abs().total_cmp(&(b - wanted).abs()))
                .unwrap_or(wanted)
        })
        .collect();
    drawn.dedup();
    drawn.into_iter().map(|p| vec![p]).collect()
}

/// The clock of a model; for a continuous one that of its records, or 1000 samples a unit of time where it is not known.
fn own_clock(file: &ModelFile) -> Result<Discrete, PipelineError> {
    let recorded = file.identification.as_ref().and_then(|i| i.sample_time);
    Ok(match (file.model.clock(), recorded) {
        (Some(clock), _) => clock,
        (None, Some(time)) => Discrete::new(time)?,
        (None, None) => Discrete::from_rate(1000.0)?,
    })
}

fn sections(
    name: &str,
    s: &Subject,
    note: Option<String>,
    known: &[Option<Known<'_>>],
) -> Result<Vec<Section>, PipelineError> {
    let mut head = Section::new(name.to_owned());
    head = head.paragraph(format!("{}.", s.file.model.describe()));
    if let Some(note) = note {
        head = head.note(note);
    }
    head = head.key_figures(key_figures(s));
    if let Some(account) = &s.file.identification {
        if !account.summary.axes.is_empty() {
            head = head.table(axes(&account.summary.axes));
        }
        head = head.heading("Choices").list(account.summary.reasons.clone());
    }
    let mut all = vec![head];
    all.extend(small::section(s));
    all.push(bode::section(s, known)?);
    all.push(poles::section(s)?);
    all.extend(coefficients::section(s)?);
    all.extend(over_p::section(s));
    all.extend(errors::section(s)?);
    all.extend(time::section(s));
    Ok(all)
}

/// Against the measurements where they are there, else as the file says.
fn verdict(s: &Subject) -> Option<&Verdict> {
    let own = s
        .file
        .identification
        .as_ref()
        .and_then(|i| i.summary.verdict.as_ref());
    match (&s.validation, own) {
        // What the file knows of its data, a comparison with them does not.
        (_, Some(own)) if own.worth == Worth::ContradictoryData => Some(own),
        (Some(validation), _) => Some(&validation.verdict),
        (None, own) => own,
    }
}

fn tone(worth: Worth) -> Tone {
    match worth {
        Worth::Good => Tone::Good,
        Worth::GoodUpTo { .. } | Worth::GoodAtRest | Worth::Approximate | Worth::Unjudged => Tone::Caution,
        Worth::ContradictoryData | Worth::NotAModel => Tone::Bad,
    }
}

fn axes(found: &[AxisSummary]) -> Table {
    let head = ["axis", "parameter", "value", "standard deviation"];
    let mut table = Table::new("Servo axes.", head);
    for a in found {
        for (name, [value, deviation], unit) in a.parameters() {
            table = table.row([
                Cell::text(format!("{} to {}", a.input, a.output)),
                Cell::text(name),
                Cell::number(value, Format::Significant(5)).unit(unit),
                Cell::number(deviation, Format::Significant(2)).unit(unit),
            ]);
        }
    }
    table
}

fn key_figures(s: &Subject) -> Vec<KeyFigure> {
    let mut figures = Vec::new();
    if let Some(f) = s.validation.as_ref().and_then(|v| v.frozen.as_ref()) {
        figures.push(
            KeyFigure::new(Cell::decibel(f.error.median_db, 1), "frozen error, median").remark(
                f.noise_db.map_or("its noise is not stated".to_owned(), |n| {
                    format!("noise of the response {n:.1} dB")
                }),
            ),
        );
        figures.extend(f.error_over_noise.map(|over| {
            KeyFigure::new(
                Cell::number(over, Format::Fixed(2)),
                "frozen error over its noise, median",
            )
            .remark(format!("{} records", f.source))
        }));
    }
    let records = s.validation.iter().flat_map(|v| &v.records);
    let worst = records
        .flat_map(|r| &r.outputs)
        .filter_map(|o| {
            let (kind, e) = match &o.closed_loop {
                Some(e) => ("closed loop", e),
                None => ("open loop", &o.open_loop),
            };
            e.over_noise.map(|n| (kind, n))
        })
        .max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((kind, over)) = worst {
        figures.push(
            KeyFigure::new(
                Cell::number(over, Format::Fixed(2)),
                "largest error in time over the noise",
            )
            .remark(kind.to_owned()),
        );
    }
    if let Some(time) = s
        .file
        .identification
        .as_ref()
        .and_then(|i| i.summary.time.as_ref())
    {
        let fit = time
            .held_out
            .as_ref()
            .map_or(&time.simulated_fit_percent, |h| &h.simulated_fit_percent);
        for (name, fit) in s.outputs.iter().zip(fit) {
            figures.push(
                KeyFigure::new(
                    Cell::number(*fit, Format::Fixed(1)).unit("%"),
                    format!("simulated fit of {name}"),
                )
                .remark(if time.held_out.is_some() {
                    "held out"
                } else {
                    "fitted samples"
                }),
            );
        }
    }
    let tone = verdict(s).map(|v| tone(v.worth));
    figures.iter_mut().for_each(|f: &mut KeyFigure| f.tone = tone);
    figures
}

/// Continuous time, for the pole of a sampled system.
fn to_continuous(
    z: lpv_core::num_complex::Complex<f64>,
    clock: Discrete,
) -> lpv_core::num_complex::Complex<f64> {
    z.ln() / clock.sample_time()
}
