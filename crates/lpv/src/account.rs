//! What a command tells another program: its account as JSON, which begins with the name and version of its schema.
//!
//! Keys may be added within a version; one that goes or changes its meaning makes the next.

use crate::PipelineError;
use crate::diagnose::Diagnosis;
use crate::fleet;
use crate::inspect::Inspection;
use crate::new::{Draft, Drafted};
use crate::simulate::SimulateAccount;
use crate::summary::Summary;
use crate::validation::Validation;
use schemars::generate::SchemaSettings;
use schemars::transform::RecursiveTransform;
use schemars::{JsonSchema, Schema};
use serde::{Serialize, Serializer};
use serde_json::json;
use std::path::{Path, PathBuf};

/// What a command found or did.
pub trait Account: Serialize + JsonSchema {
    /// Name and version of its schema.
    const SCHEMA: &'static str;
}

impl Account for Drafted<'_> {
    const SCHEMA: &'static str = "lpv-new/1";
}

impl Account for Inspection {
    const SCHEMA: &'static str = "lpv-inspect/1";
}

impl Account for SimulateAccount {
    const SCHEMA: &'static str = "lpv-simulate/1";
}

impl Account for Summary {
    const SCHEMA: &'static str = "lpv-identify/1";
}

impl Account for Validation {
    const SCHEMA: &'static str = "lpv-validate/1";
}

/// `diagnosis.json` is this without the name of the schema: it has a `format` of its own.
impl Account for Diagnosis {
    const SCHEMA: &'static str = "lpv-diagnose/1";
}

impl Account for fleet::Account {
    const SCHEMA: &'static str = "lpv-fleet/1";
}

impl Account for fleet::Table {
    const SCHEMA: &'static str = "lpv-merge/1";
}

/// A model that was written for another program.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Converted {
    /// Kind of the model, in words.
    pub model: String,
    /// Where it went.
    #[serde(serialize_with = "path")]
    pub file: PathBuf,
}

impl Account for Converted {
    const SCHEMA: &'static str = "lpv-convert/1";
}

/// A page that was written.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Reported {
    /// The models on it.
    #[serde(serialize_with = "paths")]
    pub models: Vec<PathBuf>,
    /// Where it went.
    #[serde(serialize_with = "path")]
    pub file: PathBuf,
}

impl Account for Reported {
    const SCHEMA: &'static str = "lpv-report/1";
}

/// A path as text; what is no text in it is replaced.
pub(crate) fn path<S: Serializer>(path: &Path, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(&path.to_string_lossy())
}

fn paths<S: Serializer>(paths: &[PathBuf], to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(paths.iter().map(|p| p.to_string_lossy()))
}

/// How a [`lpv_core::Position`] stands in JSON.
#[derive(JsonSchema)]
#[serde(untagged)]
#[expect(dead_code, reason = "its shape is asked for, never a value")]
pub(crate) enum NumberOrList {
    Number(f64),
    List(Vec<f64>),
}

#[derive(Serialize)]
struct Labelled<'a, A> {
    schema: &'static str,
    #[serde(flatten)]
    account: &'a A,
}

/// An account as `--json` prints it.
///
/// # Errors
/// [`PipelineError::Format`].
pub fn to_json<A: Account>(account: &A) -> Result<String, PipelineError> {
    let schema = A::SCHEMA;
    Ok(serde_json::to_string_pretty(&Labelled { schema, account })?)
}

/// The JSON Schema (draft 2020-12) of what [`to_json`] gives. It comes from the structures that are written. JSON has no infinity: a
/// number that is none, as the ratio to no noise, is null.
pub fn schema<A: Account>() -> String {
    let settings = SchemaSettings::draft2020_12()
        .for_serialize()
        .with_transform(RecursiveTransform(|schema: &mut Schema| {
            if schema.get("type") == Some(&json!("number")) {
                schema.insert("type".to_owned(), json!(["number", "null"]));
            }
        }));
    let mut schema = settings.into_generator().into_root_schema_for::<A>();
    schema.insert("title".to_owned(), A::SCHEMA.into());
    let label = json!({ "description": "Name and version of this schema.", "const": A::SCHEMA });
    let root = schema.ensure_object();
    let properties = root.entry("properties").or_insert_with(|| json!({}));
    if let Some(properties) = properties.as_object_mut() {
        properties.insert("schema".to_owned(), label);
    }
    let required = root.entry("required").or_insert_with(|| json!([]));
    if let Some(required) = required.as_array_mut() {
        required.push("schema".into());
    }
    format!("{:#}\n", schema.to_value())
}

/// The schema of what a command prints with `--json`, by the name of the command; none of a command that has no account.
pub fn schema_of(command: &str) -> Option<String> {
    Some(match command {
        "new" => schema::<Drafted<'_>>(),
        "inspect" => schema::<Inspection>(),
        "simulate" => schema::<SimulateAccount>(),
        "identify" => schema::<Summary>(),
        "validate" => schema::<Validation>(),
        "diagnose" => schema::<Diagnosis>(),
        "fleet" => schema::<fleet::Account>(),
        "merge" => schema::<fleet::Table>(),
        "convert" => schema::<Converted>(),
        "report" => schema::<Reported>(),
        _ => return None,
    })
}

impl Draft {
    /// What `lpv new` tells, once the draft is written to `file`.
    pub fn account<'a>(&'a self, file: &'a Path) -> Drafted<'a> {
        Drafted {
            file,
            guesses: &self.guesses,
            questions: &self.questions,
            command: self.command.as_deref(),
        }
    }
}
