//! The commands: arguments to library calls, results to text.

use crate::arguments::{
    Arguments, Command, Convert, Diagnose, Format, Identify, Inspect, New, Report, Simulate, StructureName,
    TargetName, Validate,
};
use clap::CommandFactory;
use experiment_data::{Bundle, RecordFormat};
use indicatif::{ProgressBar, ProgressStyle};
use lpv_cli::convert::Target;
use lpv_cli::validation::{Scope, validate};
use lpv_cli::{
    IdentifyConfig, ModelFile, PipelineError, Structure, convert, diagnose, identify_bundle, inspect, new,
    report, simulate, write_whole,
};
use serde::Serialize;
use std::sync::Mutex;

/// What a command leaves: a text for standard output, and whether its result may be used.
pub(crate) struct Done {
    pub(crate) text: String,
    pub(crate) usable: bool,
}

impl From<String> for Done {
    fn from(text: String) -> Self {
        Self { text, usable: true }
    }
}

/// Runs a command.
pub(crate) fn run(command: Command) -> Result<Done, PipelineError> {
    let text = match command {
        Command::Identify(a) => return run_identify(&a),
        Command::Validate(a) => return run_validate(&a),
        Command::New(a) => run_new(a)?,
        Command::Inspect(a) => run_inspect(&a)?,
        Command::Simulate(a) => run_simulate(&a)?,
        Command::Diagnose(a) => run_diagnose(&a)?,
        Command::Convert(a) => run_convert(&a)?,
        Command::Report(a) => run_report(&a)?,
        Command::Schema => experiment_data::schema(),
        Command::Completions { shell } => {
            let mut out = Vec::new();
            clap_complete::generate(shell, &mut Arguments::command(), "lpv", &mut out);
            String::from_utf8_lossy(&out).into_owned()
        }
    };
    Ok(text.into())
}

/// Bars on standard error while it is a terminal, nothing else.
struct Bars {
    current: Mutex<Option<(String, ProgressBar)>>,
}

impl Bars {
    fn new() -> Self {
        Self {
            current: Mutex::new(None),
        }
    }
    fn tell(&self, step: &str, done: usize, of: usize) {
        let Ok(mut current) = self.current.lock() else {
            return;
        };
        if current.as_ref().is_none_or(|(name, _)| name != step) {
            if let Some((_, bar)) = current.take() {
                bar.finish_and_clear();
            }
            let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len}")
                .unwrap_or_else(|_| ProgressStyle::default_bar());
            let bar = ProgressBar::new(of as u64)
                .with_style(style)
                .with_message(step.to_owned());
            *current = Some((step.to_owned(), bar));
        }
        if let Some((_, bar)) = current.as_ref() {
            bar.set_position(done as u64);
        }
    }
}

impl Drop for Bars {
    fn drop(&mut self) {
        if let Ok(Some((_, bar))) = self.current.get_mut().map(Option::take) {
            bar.finish_and_clear();
        }
    }
}

/// As JSON or in words.
fn told(json: bool, value: &impl Serialize, text: impl FnOnce() -> String) -> Result<String, PipelineError> {
    if json {
        Ok(serde_json::to_string_pretty(value)?)
    } else {
        Ok(text())
    }
}

fn run_new(a: New) -> Result<String, PipelineError> {
    let known = new::Known {
        name: a.name,
        sample_rate_hz: a.sample_rate,
        period: a.period,
        output: a.output,
        input: a.input,
        reference: a.reference,
        scheduling: a.scheduling,
        validation: a.validation,
    };
    let draft = new::draft(&a.files, &known)?;
    let file = draft.write(if a.force {
        new::Overwrite::Replace
    } else {
        new::Overwrite::Refuse
    })?;
    told(
        a.json,
        &serde_json::json!({ "file": file, "guesses": draft.guesses, "questions": draft.questions }),
        || draft.text_for(&file),
    )
}

fn run_inspect(a: &Inspect) -> Result<String, PipelineError> {
    let bars = Bars::new();
    let bundle = Bundle::open(&a.bundle)?;
    let found = inspect::inspect(&bundle, &|s, d, o| bars.tell(s, d, o))?;
    if a.lines {
        return Ok(found.lines_csv());
    }
    told(a.json, &found, || found.text())
}

fn run_simulate(a: &Simulate) -> Result<String, PipelineError> {
    let Some(output) = a.output.as_ref().filter(|_| !a.print_machine) else {
        return Ok(simulate::MachineFile::template().to_owned());
    };
    let machine = match &a.machine {
        Some(file) => simulate::MachineFile::read(file)?,
        None => simulate::MachineFile::default(),
    };
    let hidden = a.hide.iter().map(|e| e.parse()).collect::<Result<Vec<_>, _>>()?;
    let format = match a.format {
        Format::Npz => RecordFormat::Npz,
        Format::Csv => RecordFormat::Csv,
        Format::Parquet => RecordFormat::Parquet,
        Format::Mat => RecordFormat::Mat,
    };
    let bars = Bars::new();
    let account = simulate::simulate(&machine, &hidden, output, format, &|d, o| {
        bars.tell("simulating", d, o)
    })?;
    let figures = serde_json::json!({
        "bundle": account.bundle,
        "records": account.records,
        "samples": account.samples,
        "transient_periods": account.transient_periods,
        "spectral_radius": account.spectral_radius,
        "substeps": account.substeps,
        "integration_error": account.integration_error,
    });
    told(a.json, &figures, || {
        format!(
            "{} records, {} samples, written to {}\nthe first {} period(s) of each multisine hold its transient; error of the integration {:.1e}",
            account.records,
            account.samples,
            account.bundle.display(),
            account.transient_periods,
            account.integration_error
        )
    })
}

fn run_identify(a: &Identify) -> Result<Done, PipelineError> {
    let (Some(folder), Some(output)) = (a.bundle.as_ref(), a.output.as_ref().filter(|_| !a.print_config))
    else {
        return Ok(IdentifyConfig::template().to_owned().into());
    };
    let mut config = match &a.config {
        Some(file) => IdentifyConfig::read(file)?,
        None => IdentifyConfig::default(),
    };
    let structure = a.structure.map(|s| match s {
        StructureName::Lpv => Structure::Lpv,
        StructureName::Lti => Structure::Lti,
        StructureName::RigidBody => Structure::RigidBody,
        StructureName::XyTable => Structure::XyTable,
    });
    config.structure = structure.or(config.structure);
    config.functions = a.functions.or(config.functions);
    config.hold_out = a.hold_out.unwrap_or(config.hold_out);
    config.seed = a.seed.unwrap_or(config.seed);
    let bars = Bars::new();
    let bundle = Bundle::open(folder)?;
    let outcome = identify_bundle(&bundle, &config, &|s, d, o| bars.tell(s, d, o))?;
    drop(bars);
    let summary = outcome.summary.clone();
    let file = ModelFile::of(outcome, &bundle, config, output)?;
    write_whole(output, file.to_json()?.as_bytes())?;
    Ok(Done {
        usable: summary.verdict.as_ref().is_none_or(|v| v.worth.is_usable()),
        text: told(a.json, &summary, || {
            format!("{}\nmodel written to {}", summary.text(), output.display())
        })?,
    })
}

fn run_validate(a: &Validate) -> Result<Done, PipelineError> {
    let bars = Bars::new();
    let model = convert::import(&a.model)?;
    let bundle = Bundle::open(&a.bundle)?;
    let scope = if a.all { Scope::All } else { Scope::HeldOut };
    let (found, _) = validate(&model, &bundle, scope, &|s, d, o| bars.tell(s, d, o))?;
    Ok(Done {
        usable: found.verdict.worth.is_usable(),
        text: told(a.json, &found, || found.text())?,
    })
}

fn run_diagnose(a: &Diagnose) -> Result<String, PipelineError> {
    if a.output.exists() && !a.output.is_dir() {
        return Err(PipelineError::NoFolder {
            place: a.output.clone(),
        });
    }
    let bars = Bars::new();
    let bundle = Bundle::open(&a.bundle)?;
    let model = a.model.as_deref().map(convert::import).transpose()?;
    let found = diagnose::diagnose(&bundle, model.as_ref(), &|s, d, o| bars.tell(s, d, o))?;
    drop(bars);
    std::fs::create_dir_all(&a.output).map_err(|source| PipelineError::Write {
        file: a.output.clone(),
        source,
    })?;
    let json = serde_json::to_string_pretty(&found.diagnosis)?;
    write_whole(&a.output.join("diagnosis.json"), json.as_bytes())?;
    write_whole(
        &a.output.join("diagnosis.html"),
        found.page().to_html()?.as_bytes(),
    )?;
    let file = a.output.join("model.json");
    write_whole(&file, found.model_file(&bundle, &file)?.to_json()?.as_bytes())?;
    told(a.json, &found.diagnosis, || {
        format!("{}\nwritten to {}", found.diagnosis.text(), a.output.display())
    })
}

fn run_convert(a: &Convert) -> Result<String, PipelineError> {
    let (target, ending) = match a.to {
        TargetName::Mat => (Target::Mat, "mat"),
        TargetName::Json => (Target::Json, "json"),
        TargetName::Csv => (Target::Csv, "csv"),
        TargetName::Python => (Target::Python, "py"),
    };
    let output = a.output.clone().unwrap_or_else(|| a.model.with_extension(ending));
    let model = convert::import(&a.model)?;
    if output
        .canonicalize()
        .ok()
        .is_some_and(|o| a.model.canonicalize().is_ok_and(|m| m == o))
    {
        return Err(PipelineError::Structure {
            problem: "the model would be written over itself; give another file with --output",
        });
    }
    let bytes = convert::export(&model, target, usize::from(a.points))?;
    write_whole(&output, &bytes)?;
    Ok(format!(
        "{} written to {}",
        convert::describe(&model.model),
        output.display()
    ))
}

fn run_report(a: &Report) -> Result<String, PipelineError> {
    let bars = Bars::new();
    let output = a.output.clone().unwrap_or_else(|| a.folder.join("report.html"));
    let page = report::page(&a.folder, a.bundle.as_deref(), &|s, d, o| bars.tell(s, d, o))?;
    write_whole(&output, page.to_html()?.as_bytes())?;
    Ok(format!("report written to {}", output.display()))
}
