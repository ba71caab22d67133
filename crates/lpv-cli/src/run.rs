//! The commands: arguments to library calls, results to text.

use crate::arguments::{
    Arguments, Command, Convert, Diagnose, Format, Groups, Identify, Inspect, New, Report, Simulate,
    StructureName, TargetName, Validate,
};
use crate::done::{Done, Tone};
use crate::{bars, fleet};
use clap::{CommandFactory, ValueEnum};
use experiment_data::{Bundle, RecordFormat};
use lpv::account::{Account, Converted, Reported, schema_of, to_json};
use lpv::convert::Target;
use lpv::new::GroupsAre;
use lpv::output::{Inputs, Kind, Overwrite, Place, write_all, yield_to_end};
use lpv::validation::{Scope, validate};
use lpv::verdict::Worth;
use lpv::{
    IdentifyConfig, ModelFile, PipelineError, Structure, convert, diagnose, encode, identify_bundle, inspect,
    new, report, simulate,
};
use lpv_core::counted;
use std::path::Path;

/// Runs a command.
pub(crate) fn run(command: Command) -> Result<Done, PipelineError> {
    let done = answer(command);
    yield_to_end();
    bars::clear();
    done
}

fn answer(command: Command) -> Result<Done, PipelineError> {
    match command {
        Command::New(a) => run_new(a),
        Command::Inspect(a) => run_inspect(&a),
        Command::Simulate(a) => run_simulate(&a),
        Command::Identify(a) => run_identify(&a),
        Command::Validate(a) => run_validate(&a),
        Command::Diagnose(a) => run_diagnose(&a),
        Command::Fleet(a) => fleet::run_fleet(&a),
        Command::Merge(a) => fleet::run_merge(&a),
        Command::Convert(a) => run_convert(&a),
        Command::Report(a) => run_report(&a),
        Command::Schema { of } => {
            let name = of.and_then(|of| Some(of.to_possible_value()?.get_name().to_owned()));
            let of_command = name.and_then(|name| schema_of(&name));
            Ok(of_command.unwrap_or_else(experiment_data::schema).into())
        }
        Command::Completions { shell } => {
            let mut out = Vec::new();
            clap_complete::generate(shell, &mut Arguments::command(), "lpv", &mut out);
            Ok(String::from_utf8_lossy(&out).into_owned().into())
        }
        Command::Man { folder } => match manual(&folder) {
            Ok(()) => Ok(Done::words(format!("manual pages written to {}", shown(&folder)))),
            Err(source) => Err(PipelineError::Write { file: folder, source }),
        },
    }
}

fn manual(folder: &Path) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    clap_mangen::generate_to(Arguments::command(), folder)
}

/// As JSON, or in words, in which `names` may stand.
pub(crate) fn told<'a>(
    json: bool,
    account: &impl Account,
    names: impl IntoIterator<Item = &'a str>,
    text: impl FnOnce() -> String,
) -> Result<Done, PipelineError> {
    Ok(match json {
        true => encode::json(&to_json(account)?).into(),
        false => Done::words(encode::lines(&text(), names)),
    })
}

/// What a model that is worth so much looks like.
fn tone(worth: Worth) -> Tone {
    match worth {
        _ if !worth.is_usable() => Tone::Bad,
        _ if worth.is_good() => Tone::Good,
        _ => Tone::Doubtful,
    }
}

/// Every text of a bundle that its user chose.
fn names(bundle: &Bundle) -> impl Iterator<Item = &str> {
    let description = bundle.description();
    let c = &description.channels;
    let groups = [&c.output, &c.input, &c.reference, &c.scheduling, &c.auxiliary];
    let injected = description.records.iter().map(|r| &r.injection);
    let columns = groups
        .into_iter()
        .chain(injected)
        .flat_map(|g| g.columns.iter().chain(&g.units));
    let files = description.records.iter().map(|r| &r.file);
    let own = [&description.name].into_iter().chain(columns).chain(files);
    let short = (0..bundle.len()).filter_map(|i| bundle.record_name(i).ok());
    own.map(String::as_str).chain(short)
}

/// Opens a bundle; of a file that is none, says which command it is for.
fn open(place: &Path) -> Result<Bundle, PipelineError> {
    let ending = place
        .extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase();
    let problem = match ending.as_str() {
        _ if !place.is_file() => None,
        _ if ending == "npy" || RecordFormat::of(&place.to_string_lossy()).is_ok() => {
            let folder = place.parent().filter(|f| f.join("experiment.toml").is_file());
            Some(match folder {
                Some(folder) => format!(
                    "this is a file, and a bundle is asked for: give the folder of its experiment.toml, {}",
                    match folder.as_os_str().is_empty() {
                        true => ".".into(),
                        false => folder.to_string_lossy(),
                    }
                ),
                None => "this is a file, and a bundle is asked for: draft its description with `lpv new`, then give the folder".to_owned(),
            })
        }
        "json" => Some(
            "this is no bundle; a model is shown with `lpv report`, compared with a bundle by `lpv validate MODEL BUNDLE`".to_owned(),
        ),
        _ => None,
    };
    match problem {
        Some(problem) => Err(PipelineError::RecordFile {
            file: place.to_owned(),
            problem,
        }),
        None => Ok(Bundle::open(place)?),
    }
}

/// A path in one line.
pub(crate) fn shown(path: &Path) -> String {
    encode::visible(&path.to_string_lossy())
}

/// Commas part names, but not inside brackets: `data(:,3)` is one.
fn whole_names(parts: Vec<String>) -> Vec<String> {
    let open = |name: &String| name.matches(['(', '[']).count() > name.matches([')', ']']).count();
    let mut names: Vec<String> = Vec::new();
    for part in parts {
        match names.last_mut() {
            Some(last) if open(last) => *last += &format!(",{part}"),
            _ => names.push(part),
        }
    }
    names
}

fn run_new(a: New) -> Result<Done, PipelineError> {
    let known = new::Known {
        name: a.name,
        sample_rate_hz: a.sample_rate,
        period: a.period,
        output: whole_names(a.output),
        input: whole_names(a.input),
        reference: whole_names(a.reference),
        scheduling: whole_names(a.scheduling),
        validation: a.validation,
        groups: a.groups.map(|g| match g {
            Groups::Runs => GroupsAre::Runs,
            Groups::Axes => GroupsAre::Axes,
        }),
    };
    let draft = new::draft(&a.files, &known)?;
    let file = draft.write(Overwrite::if_asked(a.force))?;
    told(a.json, &draft.account(&file), [], || draft.text_for(&file))
}

fn run_inspect(a: &Inspect) -> Result<Done, PipelineError> {
    let bundle = open(&a.bundle)?;
    let found = inspect::inspect(&bundle, &bars::tell).map_err(|e| e.at(&a.bundle))?;
    if a.lines {
        return Ok(found.lines_csv().into());
    }
    let said = told(a.json, &found, names(&bundle), || found.text())?;
    Ok(said.in_short(encode::lines(&found.warnings.join("\n"), names(&bundle))))
}

fn run_simulate(a: &Simulate) -> Result<Done, PipelineError> {
    let Some(output) = a.output.as_ref().filter(|_| !a.print_machine) else {
        return Ok(simulate::MachineFile::template().to_owned().into());
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
    bars::tell("simulating", 0, 1);
    let told_of = |done, of| bars::tell("simulating", done, of);
    let account =
        simulate::simulate(&machine, &hidden, output, format, &told_of).map_err(|e| match &a.machine {
            Some(file) => machine.explain(file, e),
            None => e,
        })?;
    told(a.json, &account, [], || {
        format!(
            "{} records, {} samples, written to {}\nthe transient takes the first {} of each multisine; error of the integration {:.1e}",
            account.records,
            account.samples,
            shown(&account.bundle),
            counted(account.transient_periods, "period"),
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
    let bundle = open(folder)?;
    let inputs = Inputs::none().bundle(&bundle);
    let inputs = match &a.config {
        Some(file) => inputs.file(file, "the settings"),
        None => inputs,
    };
    let place = Place::check(output, Kind::Model, &inputs, Overwrite::if_asked(a.force))?;
    let outcome = identify_bundle(&bundle, &config, &bars::tell).map_err(|e| e.at(folder))?;
    let summary = outcome.summary.clone();
    let file = ModelFile::of(outcome, &bundle, config, output)?;
    write_all(&[(&place, file.to_json()?.as_bytes())])?;
    let said = told(a.json, &summary, names(&bundle), || {
        format!("{}\nmodel written to {}", summary.text(), shown(output))
    })?;
    let worth = summary.verdict.as_ref().map(|v| v.worth);
    Ok(worth.map_or(said.clone(), |worth| said.judged(tone(worth))))
}

fn run_validate(a: &Validate) -> Result<Done, PipelineError> {
    let model = convert::import(&a.model)?;
    let bundle = open(&a.bundle)?;
    let scope = if a.all { Scope::All } else { Scope::HeldOut };
    let (found, _) = validate(&model, &bundle, scope, &bars::tell).map_err(|e| e.at(&a.bundle))?;
    let said = told(a.json, &found, names(&bundle), || found.text())?;
    Ok(said.judged(tone(found.verdict.worth)))
}

fn run_diagnose(a: &Diagnose) -> Result<Done, PipelineError> {
    let bundle = open(&a.bundle)?;
    let inputs = Inputs::none().bundle(&bundle);
    let inputs = inputs.beside(a.model.as_deref(), a.effects.as_deref());
    let files = diagnose::ResultFiles::check(&a.output, &inputs, Overwrite::if_asked(a.force))?;
    let model = a.model.as_deref().map(convert::import).transpose()?;
    let effects = a.effects.as_deref().map(diagnose::read_effects).transpose()?;
    let given = diagnose::Given {
        model: model.as_ref(),
        effects: effects.as_deref().unwrap_or_default(),
    };
    let found = diagnose::diagnose(&bundle, given, &bars::tell).map_err(|e| e.at(&a.bundle))?;
    files.write(&found, &bundle)?;
    let said = told(a.json, &found.diagnosis, names(&bundle), || {
        format!("{}\nwritten to {}", found.diagnosis.text(), shown(&a.output))
    })?;
    Ok(said.judged(match found.diagnosis.verdict.as_str() {
        _ if !found.diagnosis.contradictions.is_empty() => Tone::Bad,
        "explained" | "nothing-missing" => Tone::Good,
        _ => Tone::Doubtful,
    }))
}

fn run_convert(a: &Convert) -> Result<Done, PipelineError> {
    let target = match a.to {
        TargetName::Mat => Target::Mat,
        TargetName::Json => Target::Json,
        TargetName::Csv => Target::Csv,
        TargetName::Python => Target::Python,
    };
    let beside = || a.model.with_extension(target.ending());
    let output = a.output.clone().unwrap_or_else(beside);
    let model = convert::import(&a.model)?;
    let inputs = report::read_for(std::slice::from_ref(&a.model), None);
    let place = Place::check(&output, target.kind(), &inputs, Overwrite::if_asked(a.force))?;
    let bytes = convert::export(&model, target, usize::from(a.points)).map_err(|e| e.at(&a.model))?;
    write_all(&[(&place, &bytes)])?;
    let account = Converted {
        model: model.model.describe(),
        file: output,
    };
    told(a.json, &account, [], || {
        format!("{} written to {}", account.model, shown(&account.file))
    })
}

fn run_report(a: &Report) -> Result<Done, PipelineError> {
    let files = report::model_files(&a.folder)?;
    let beside = match a.folder.is_dir() {
        true => a.folder.join("report.html"),
        false => a.folder.with_file_name("report.html"),
    };
    let output = a.output.clone().unwrap_or(beside);
    let inputs = report::read_for(&files, a.bundle.as_deref());
    let place = Place::check(&output, Kind::Page, &inputs, Overwrite::if_asked(a.force))?;
    let page = report::page(&a.folder, a.bundle.as_deref(), &bars::tell)?;
    write_all(&[(&place, page.to_html()?.as_bytes())])?;
    let account = Reported {
        models: files,
        file: output,
    };
    told(a.json, &account, [], || {
        format!("report written to {}", shown(&account.file))
    })
}
