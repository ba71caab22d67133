//! What can go wrong between a bundle and a model, and the exit code that says whose fault it was.

mod response;

use lpv_core::counted;
pub use response::ResponseProblem;
use std::path::{Path, PathBuf};

/// Every refusal of the pipeline.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PipelineError {
    /// The bundle cannot be used.
    #[error(transparent)]
    Data(#[from] experiment_data::DataError),
    /// The data contradict themselves, and no model came of them.
    #[error("{finding}\n(without that: {refused})")]
    Contradicted {
        /// What is wrong with the data.
        finding: Box<crate::Finding>,
        /// How the identification ended.
        refused: Box<PipelineError>,
    },
    /// The frequency responses cannot be estimated.
    #[error("{place}: {source}")]
    Frf {
        /// Position and records.
        place: String,
        /// What is wrong.
        source: frf_estimation::FrfError,
    },
    /// The poles cannot be fitted.
    #[error("{place}: {source}")]
    Poles {
        /// Position or record.
        place: String,
        /// What is wrong.
        source: pole_fit::PoleFitError,
    },
    /// The basis cannot be chosen.
    #[error(
        "basis from the estimated poles: {0}; other values of `order`, `integrators` or `functions`, or more periods, may help"
    )]
    Basis(#[from] obf_basis::BasisError),
    /// The regression or interpolation failed.
    #[error(transparent)]
    Ident(#[from] lpv_ident::IdentError),
    /// The model cannot be realised.
    #[error(transparent)]
    Realize(#[from] lfr_realize::RealizeError),
    /// Of lfr-fit.
    #[error(transparent)]
    Fit(#[from] lfr_fit::FitError),
    /// A model or signal is inconsistent.
    #[error(transparent)]
    Core(#[from] lpv_core::CoreError),
    /// The fit in the time domain failed.
    #[error(transparent)]
    Lti(#[from] lti_ident::LtiIdentError),
    /// The diagnosis failed.
    #[error(transparent)]
    Trace(#[from] lpv_diagnose::TraceError),
    /// The model that the bundle's own responses give is none that effects can be added to.
    #[error(
        "effects cannot be added to the model that the responses of this bundle give ({source}); an effect may have bent them, as \
         friction does where the excitation is small: give --model with a model of an experiment without it, excite more, or give the \
         [geometry] of an xy-table"
    )]
    NoBase {
        /// What is wrong with it.
        source: lpv_diagnose::TraceError,
    },
    /// Bundles of a fleet that do not go together.
    #[error(transparent)]
    Fleet(#[from] crate::fleet::FleetError),
    /// The simulated machine refuses its settings.
    #[error(transparent)]
    Plant(#[from] xytable_plant::PlantError),
    /// A picture or page cannot be made.
    #[error(transparent)]
    Report(#[from] lpv_report::ReportError),
    /// No record that this stage can use.
    #[error(
        "{bundle}: no record with use = \"estimation\" that is periodic or rests at one position; identification from frequency responses needs at least one"
    )]
    NoResponses {
        /// Name of the bundle.
        bundle: String,
    },
    /// A measured frequency response that does not fit the model.
    #[error("record {record}: {problem}")]
    Response {
        /// The record.
        record: String,
        /// What does not fit, and what to do.
        problem: ResponseProblem,
    },
    /// An output that no servo axis has.
    #[error(
        "output `{output}` is {} by its `quantity` or unit; a servo axis has a position or a speed: name that as the output, or, if it is one, say quantity = [\"position\"] in [channels.output] (format = 2)",
        match *quantity { "acceleration" => "an acceleration", "force" => "a force", other => other }
    )]
    NoAxis {
        /// The output.
        output: String,
        /// What it is.
        quantity: &'static str,
    },
    /// Speeds of a free machine at several positions.
    #[error(
        "output `{output}` is a speed, and its response falls as that of a free mass: a model of several positions has the position of such a machine as its output; of measured frequency responses (kind = \"response\" with a `quantity`) say quantity = [\"position\"] in [channels.output], and they are taken to it; of records of samples log or integrate the position; or set `integrators` to 0 for a machine on a spring"
    )]
    FreeSpeed {
        /// The output.
        output: String,
    },
    /// A diagnosis of an output that is no position.
    #[error(
        "output `{output}` is {} by its `quantity` or unit, and effects are traced along positions: log the position beside it and name it as the output{}",
        match *quantity { "acceleration" => "an acceleration", "force" => "a force", "speed" => "a speed", other => other },
        if *quantity == "speed" { ", or integrate the speed; `lpv identify --structure rigid-body` takes it as it is, and tells inertia and friction" } else { "" }
    )]
    NoPosition {
        /// The output.
        output: String,
        /// What it is.
        quantity: &'static str,
    },
    /// Two frequency responses of one place.
    #[error(
        "{} and {} are frequency responses of one place{}; keep one of them, or give each its own `position`",
        records[0], records[1], position.map_or(String::new(), |p| format!(" (p = {p})"))
    )]
    OnePlace {
        /// Where they come from.
        records: Box<[String; 2]>,
        /// Where they were measured.
        position: Option<f64>,
    },
    /// A time-invariant bundle was handed to a step that needs a scheduling variable, or the other way round.
    #[error("{problem}")]
    Structure {
        /// What does not fit, and what to do.
        problem: &'static str,
    },
    /// Records that are at one place or at two.
    #[error(
        "records {} (p = {}) and {} (p = {}) are {:.3e} apart, and record {} (p = {}) is {:.3e} away from its neighbour: if the unit of p is \
         another one there, correct it; if the two are at one place, give both the same `position`; if they are not, give each its own",
        pair[0].0, pair[0].1, pair[1].0, pair[1].1, gaps[0], far.0, far.1, gaps[1]
    )]
    Places {
        /// The two, with their positions.
        pair: Box<[(String, f64); 2]>,
        /// The record beyond the largest gap.
        far: Box<(String, f64)>,
        /// Their gap, and the largest one between neighbours.
        gaps: [f64; 2],
    },
    /// Places that differ where p has several scheduling signals.
    #[error(
        "{}, and what is done here is for one scheduling signal: {}; of records that differ in several, take those into one bundle that \
         differ in one",
        where_several(columns, records), one_of_several(*measured)
    )]
    SchedulingSignals {
        /// The scheduling columns.
        columns: Vec<String>,
        /// Two records with where they rest, in the order of the columns; twice the same one that moves, with its ends.
        records: Box<[(String, Vec<f64>); 2]>,
        /// Whether there are scheduling columns; else `position` alone says where records were made.
        measured: bool,
    },
    /// Of lpv-simulate.
    #[error(transparent)]
    Simulate(#[from] lpv_simulate::SimulateError),
    /// A model with other channels than the bundle.
    #[error(
        "the model has {} and {}, the bundle {} and {}; take the bundle that the model was made from, or one with its channels",
        counted(model.0, "input"), counted(model.1, "output"), bundle.0, bundle.1
    )]
    Channels {
        /// Inputs and outputs of the model.
        model: (usize, usize),
        /// Inputs and outputs of the bundle.
        bundle: (usize, usize),
    },
    /// Several files go to a folder.
    #[error("{place} is a file; give --output a folder, which is made if it is missing")]
    NoFolder {
        /// What was given.
        place: PathBuf,
    },
    /// A model file that cannot be read.
    #[error("{file}: {problem}")]
    Model {
        /// The file.
        file: PathBuf,
        /// What is wrong, and where.
        problem: String,
    },
    /// A file that is to become a record and cannot.
    #[error("{file}: {problem}")]
    RecordFile {
        /// The file.
        file: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// A result that its file format cannot hold.
    #[error("cannot be written in this format: {0}")]
    Format(String),
    /// More frozen systems than a file should hold.
    #[error(
        "{points} points along each of the {parameters} scheduling parameters are {} frozen systems, more than a file holds; {}",
        count_text(*systems), points_text(*most)
    )]
    Grid {
        /// Scheduling parameters of the model.
        parameters: usize,
        /// Points along each.
        points: usize,
        /// Frozen systems.
        systems: f64,
        /// The largest number of points that a file holds; none if two are too many.
        most: Option<usize>,
    },
    /// A setting outside its range.
    #[error("`{name}` is {value}; it must be {allowed}")]
    Setting {
        /// The setting.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// A value of a settings file outside its range.
    #[error("{place}: {key} = {value}: {problem}")]
    Value {
        /// The file, with line and column where the value stands in it.
        place: String,
        /// The key with its table, as in the file.
        key: String,
        /// The value.
        value: f64,
        /// What is allowed.
        problem: String,
    },
    /// A configuration file that cannot be read.
    #[error("{file}: {message}")]
    Config {
        /// The file.
        file: PathBuf,
        /// What the parser said, with line and column.
        message: String,
    },
    /// A refusal that names no place of its own.
    #[error("{place}: {source}")]
    At {
        /// The bundle or file behind it.
        place: PathBuf,
        /// What is wrong.
        source: Box<Self>,
    },
    /// A place where a result may not go.
    #[error("{file}: {problem}")]
    Place {
        /// The place.
        file: PathBuf,
        /// What is wrong with it, and what to do.
        problem: crate::output::PlaceProblem,
    },
    /// A file that cannot be written.
    #[error("{file}: cannot be written: {source}; {}", remedy(source))]
    Write {
        /// The file.
        file: PathBuf,
        /// The system's word.
        source: std::io::Error,
    },
}

/// Numbers in a list.
/// Where two records are, or one moves.
fn where_several(columns: &[String], records: &[(String, Vec<f64>); 2]) -> String {
    let [(a, from), (b, to)] = records;
    let [from, to] = [from, to].map(|p| short_place(p));
    let signals = columns.join(" and ");
    match a == b {
        true => format!("record {a} moves from {from} to {to} of the scheduling signals {signals}"),
        false => format!("records {a} and {b} rest at {from} and {to} of the scheduling signals {signals}"),
    }
}

fn one_of_several(measured: bool) -> &'static str {
    match measured {
        true => {
            "keep the signal that changes in [channels.scheduling] and name the others in [channels.auxiliary]"
        }
        false => "write in `position` the one number that changes",
    }
}

/// A place in five digits, the first numbers of many.
pub(crate) fn short_place(values: &[f64]) -> String {
    /// Numbers that are written.
    const MOST: usize = 6;
    let number = |v: &f64| match v.abs() {
        size if size == 0.0 || (1e-3..1e6).contains(&size) => {
            let rounded = format!("{v:.4e}").parse().unwrap_or(*v);
            format!("{rounded}")
        }
        _ => format!("{v:.4e}"),
    };
    let mut all: Vec<String> = values.iter().take(MOST).map(number).collect();
    if values.len() > MOST {
        all.push(format!("... {} numbers", values.len()));
    }
    match all.as_slice() {
        [one] => one.clone(),
        _ => format!("({})", all.join(", ")),
    }
}

impl PipelineError {
    /// With the bundle or file behind it, where the message itself names none.
    #[must_use]
    pub fn at(self, place: &Path) -> Self {
        match self {
            Self::Basis(_)
            | Self::Ident(_)
            | Self::Realize(_)
            | Self::Core(_)
            | Self::Lti(_)
            | Self::Trace(_)
            | Self::NoBase { .. }
            | Self::Structure { .. }
            | Self::Simulate(_)
            | Self::Channels { .. } => Self::At {
                place: place.to_owned(),
                source: Box::new(self),
            },
            placed => placed,
        }
    }

    /// 2 where the input or its use is at fault, 1 for anything else.
    pub fn exit_code(&self) -> u8 {
        match self {
            // A folder in the place of a file, or a file in that of a folder, is a slip of whoever called.
            Self::Write { source, .. } if crate::output::is_slip(source) => 2,
            Self::Write { .. } | Self::Report(_) | Self::Format(_) => 1,
            Self::At { source, .. } => source.exit_code(),
            Self::Data(e) if e.is_of_the_machine() => 1,
            Self::Contradicted { .. } => 3,
            _ => 2,
        }
    }
}

/// What to do about a file that cannot be written.
fn remedy(source: &std::io::Error) -> &'static str {
    use std::io::ErrorKind;
    match source.kind() {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => "make room, or choose a place on another disk",
        ErrorKind::InvalidFilename => "choose a shorter name",
        _ => "choose a file name in a folder that may be written to",
    }
}

impl From<serde_json::Error> for PipelineError {
    fn from(e: serde_json::Error) -> Self {
        Self::Format(e.to_string())
    }
}

fn count_text(count: f64) -> String {
    if count < 1e7 {
        format!("{count}")
    } else {
        format!("{count:.0e}")
    }
}

fn points_text(most: Option<usize>) -> String {
    match most {
        Some(points) => format!("give --points {points} or less"),
        None => "write the model as JSON, which needs no frozen systems".to_owned(),
    }
}
