//! Models for other programs, and back where the file holds the whole model.

mod csv;
mod exchange;
mod grid;
mod mat;
mod python;

pub(crate) use self::csv::HEAD as TABLE_HEAD;
use crate::output::Kind;
use crate::{ModelFile, PipelineError};
use exchange::Exchange;
use std::path::Path;

/// What a model can be written as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// MATLAB 5 file: one struct `lpv` with `A, B1, ... D22` (or `A, B, C, D`) and the frozen state spaces on a grid.
    Mat,
    /// The program's own format.
    Json,
    /// One entry a line: matrix, scheduling value, row, column, value.
    Csv,
    /// A module for Python that builds python-control systems.
    Python,
}

impl Target {
    /// All.
    pub const ALL: [Self; 4] = [Self::Mat, Self::Json, Self::Csv, Self::Python];

    /// How the names of its files end, without the dot.
    pub fn ending(self) -> &'static str {
        match self {
            Self::Mat => "mat",
            Self::Json => "json",
            Self::Csv => "csv",
            Self::Python => "py",
        }
    }

    /// What its files are among the results.
    pub fn kind(self) -> Kind {
        match self {
            Self::Mat => Kind::Matlab,
            Self::Json => Kind::Model,
            Self::Csv => Kind::Table,
            Self::Python => Kind::Python,
        }
    }
}

/// The model as the bytes of a file; `points` frozen systems a scheduling parameter.
///
/// # Errors
/// A model that cannot be frozen somewhere on its range.
pub fn export(file: &ModelFile, target: Target, points: usize) -> Result<Vec<u8>, PipelineError> {
    if target == Target::Json {
        return Ok(file.to_json()?.into_bytes());
    }
    let exchange = Exchange::new(file, points)?;
    match target {
        Target::Mat => mat::write(&exchange),
        Target::Csv => csv::write(&exchange),
        Target::Python => Ok(python::write(&exchange).into_bytes()),
        Target::Json => Ok(Vec::new()),
    }
}

/// Reads a model from JSON, or from a `.mat` or `.csv` file that [`export`] wrote.
///
/// # Errors
/// [`PipelineError::Model`] with the file and the place; a grid of frozen systems alone is no model.
pub fn import(file: &Path) -> Result<ModelFile, PipelineError> {
    let ending = file
        .extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase();
    let refuse = |problem: String| PipelineError::Model {
        file: file.to_owned(),
        problem,
    };
    let exchange = match ending.as_str() {
        "mat" => mat::read(file).map_err(refuse)?,
        "csv" => csv::read(file).map_err(refuse)?,
        "py" => {
            return Err(refuse(
                "a Python file cannot be read back; keep the JSON, MAT or CSV file".to_owned(),
            ));
        }
        _ => return ModelFile::read(file),
    };
    Ok(ModelFile {
        explanation: None,
        model: exchange.model().map_err(refuse)?,
        identification: None,
    })
}
