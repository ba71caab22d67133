//! A model: frozen, sampled, along signals, and as files.

use crate::arrays::{C64, matrix, response, samples, to_signals};
use crate::error::{core_error, to_python};
use crate::worker;
use lpv::convert::{self, Target};
use lpv::lpv_core::nalgebra::{DMatrix, DVector};
use lpv::lpv_core::{Clock, Discrete, FrozenModel, Lfr, Purpose, Record, RecordKind, Signals, StateSpace};
use lpv::lpv_simulate::{Machine, disturbance, first_state, open_loop, predictor};
use lpv::output::{Inputs, Overwrite, Place, write_all};
use lpv::{ChannelTable, FrozenDeviation, ModelFile, PipelineError, lpv_core, relative_folder};
use numpy::{PyArray1, PyArray2, PyArray3, PyArray4, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What a model file holds.
#[pyclass(frozen, module = "lpvident._lpvident")]
pub(crate) struct Model {
    pub(crate) file: Arc<ModelFile>,
}

/// A, B, C, D and the sample time, zero in continuous time.
type Matrices<'py> = ((Array<'py>, Array<'py>, Array<'py>, Array<'py>), f64);

type Array<'py> = Bound<'py, PyArray2<f64>>;

/// Inputs, outputs, scheduling; samples x channels.
type Measured<'py> = (
    PyReadonlyArray2<'py, f64>,
    PyReadonlyArray2<'py, f64>,
    Option<PyReadonlyArray2<'py, f64>>,
);

/// Positions, frequencies, and two tables of deviations, positions x lines x outputs x inputs.
type Deviation<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    [Bound<'py, PyArray4<f64>>; 2],
);

impl Model {
    /// The model of a bundle, whose folder is kept absolute until it is known where the file goes.
    pub(crate) fn new(mut file: ModelFile, folder: &Path) -> Self {
        if let Some(identification) = &mut file.identification {
            identification.folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
        }
        Self { file: Arc::new(file) }
    }

    /// The model along measured signals.
    fn measured(
        &self,
        (u, y, p): &Measured<'_>,
        sample_time: Option<f64>,
    ) -> Result<(Machine, Record), PipelineError> {
        let machine = self.machine(sample_time)?;
        Ok((
            machine,
            record(u, Some(y), p.as_ref(), self.file.model.outputs())?,
        ))
    }

    /// The file as it is written to a place.
    fn file_at(&self, place: &Path) -> ModelFile {
        let mut file = (*self.file).clone();
        if let Some(identification) = &mut file.identification
            && identification.folder.is_absolute()
        {
            identification.folder = relative_folder(&identification.folder, place);
        }
        file
    }

    /// The clock that is asked for, else the model's own, else that of its records.
    fn clock(&self, sample_time: Option<f64>) -> Result<Discrete, PipelineError> {
        if let Some(own) = self.file.model.clock().filter(|_| sample_time.is_none()) {
            return Ok(own);
        }
        let identification = self.file.identification.as_ref();
        let time = sample_time.or(identification.and_then(|i| i.sample_time));
        let time = time.ok_or(PipelineError::Structure {
            problem: "the model is in continuous time and knows no sample time of its records: give sample_time",
        })?;
        Ok(Discrete::new(time)?)
    }

    fn machine(&self, sample_time: Option<f64>) -> Result<Machine, PipelineError> {
        Ok(Machine::new(&self.file.model, self.clock(sample_time)?)?)
    }
}

/// Part by which two sample times may differ that are the same.
const SAME_TIME: f64 = 1e-9;

/// A record of signals, samples x channels each.
fn record(
    u: &PyReadonlyArray2<'_, f64>,
    y: Option<&PyReadonlyArray2<'_, f64>>,
    p: Option<&PyReadonlyArray2<'_, f64>>,
    outputs: usize,
) -> Result<Record, PipelineError> {
    let inputs = to_signals("u", u);
    let samples = inputs.len();
    let record = Record {
        outputs: match y {
            Some(y) => to_signals("y", y),
            None => Signals {
                names: vec![String::new(); outputs],
                units: Vec::new(),
                columns: vec![vec![0.0; samples]; outputs],
            },
        },
        inputs,
        scheduling: p.map_or_else(Signals::default, |p| to_signals("p", p)),
        ..Record::empty("signals", RecordKind::Transient, Purpose::Validation)
    };
    record.check()?;
    Ok(record)
}

fn system<'py, K: Clock>(py: Python<'py>, s: &StateSpace<K>, time: f64) -> PyResult<Matrices<'py>> {
    let (a, b) = (matrix(py, s.a())?, matrix(py, s.b())?);
    let (c, d) = (matrix(py, s.c())?, matrix(py, s.d())?);
    Ok(((a, b, c, d), time))
}

fn blocks<'py, K: Clock>(py: Python<'py>, m: &Lfr<K>, time: f64) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    for (name, block) in m.blocks().named() {
        all.set_item(name, matrix(py, block)?)?;
    }
    let deltas: Vec<(usize, usize)> = m.deltas().iter().map(|d| (d.parameter, d.repetitions)).collect();
    all.set_item("deltas", deltas)?;
    all.set_item("dt", time)?;
    Ok(all)
}

fn table<'py>(py: Python<'py>, t: &ChannelTable) -> PyResult<Bound<'py, PyArray4<f64>>> {
    let lines = t.first().map_or(0, Vec::len);
    let line = t.first().and_then(|p| p.first());
    let (outputs, inputs) = (
        line.map_or(0, Vec::len),
        line.and_then(|l| l.first()).map_or(0, Vec::len),
    );
    let values: Vec<f64> = t.iter().flatten().flatten().flatten().copied().collect();
    PyArray1::from_vec(py, values).reshape([t.len(), lines, outputs, inputs])
}

#[pymethods]
impl Model {
    /// Reads .json, or .mat and .csv that hold the whole model.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let file = py
            .detach(|| convert::import(&path))
            .map_err(|e| to_python(py, &e))?;
        let folder = file.identification.as_ref().map(|i| i.folder.clone());
        // Relative to the file; one that is not there any more stays as it is written, as does none.
        let named = folder.filter(|f| !f.as_os_str().is_empty());
        let found = named.and_then(|f| path.parent().unwrap_or(Path::new("")).join(f).canonicalize().ok());
        Ok(match found {
            Some(folder) => Self::new(file, &folder),
            None => Self { file: Arc::new(file) },
        })
    }

    fn describe(&self) -> String {
        self.file.model.describe()
    }

    /// Inputs, outputs.
    fn channels(&self) -> (usize, usize) {
        (self.file.model.inputs(), self.file.model.outputs())
    }

    /// Bounds of each scheduling signal; none of a time-invariant model.
    fn range(&self) -> Option<Vec<[f64; 2]>> {
        self.file.model.range().map(|r| r.bounds().to_vec())
    }

    /// Of the model, else of its records.
    fn sample_time(&self) -> Option<f64> {
        self.clock(None).ok().map(Discrete::sample_time)
    }

    fn is_continuous(&self) -> bool {
        self.file.model.clock().is_none()
    }

    /// How it was made, as JSON; none of a model from elsewhere.
    fn identification(&self, py: Python<'_>) -> PyResult<Option<String>> {
        let text = self.file.identification.as_ref().map(serde_json::to_string);
        text.transpose().map_err(|e| to_python(py, &e.into()))
    }

    /// The machine behind it, in lines; empty of a plain model.
    fn explanation(&self) -> Vec<String> {
        self.file
            .explanation
            .as_ref()
            .map_or_else(Vec::new, |e| e.lines())
    }

    /// Names of its effects, each with its channel; empty of a plain model.
    fn effects(&self) -> Vec<String> {
        let all = self.file.explanation.iter().flat_map(|e| &e.effects);
        all.map(|e| format!("{} at {}", e.effect, e.channel)).collect()
    }

    /// What a person is told of the identification.
    fn text(&self) -> Option<String> {
        let summary = self.file.identification.as_ref().map(|i| i.summary.text());
        summary.map(|text| lpv::encode::for_terminal(&text))
    }

    fn frozen<'py>(&self, py: Python<'py>, p: Vec<f64>) -> PyResult<Matrices<'py>> {
        match self.file.model.frozen(&p).map_err(|e| core_error(py, e))? {
            FrozenModel::Continuous(s) => system(py, &s, 0.0),
            FrozenModel::Discrete(s) => system(py, &s, s.clock().sample_time()),
        }
    }

    fn sampled<'py>(
        &self,
        py: Python<'py>,
        p: Vec<f64>,
        sample_time: Option<f64>,
    ) -> PyResult<Matrices<'py>> {
        let s = self.held(&p, sample_time).map_err(|e| to_python(py, &e))?;
        system(py, &s, s.clock().sample_time())
    }

    fn poles<'py>(&self, py: Python<'py>, p: Vec<f64>) -> PyResult<Bound<'py, PyArray1<C64>>> {
        let found = match self.file.model.frozen(&p).map_err(|e| core_error(py, e))? {
            FrozenModel::Continuous(s) => s.poles(),
            FrozenModel::Discrete(s) => s.poles(),
        };
        Ok(PyArray1::from_vec(py, found.map_err(|e| core_error(py, e))?))
    }

    /// The response at a constant p, sampled with the input held or as the model is written.
    fn frequency_response<'py>(
        &self,
        py: Python<'py>,
        p: Vec<f64>,
        frequencies_hz: PyReadonlyArray1<'py, f64>,
        sampled: bool,
        sample_time: Option<f64>,
    ) -> PyResult<Bound<'py, PyArray3<C64>>> {
        let lines: Vec<f64> = frequencies_hz.as_array().iter().copied().collect();
        let found = py.detach(|| -> Result<_, PipelineError> {
            if sampled {
                return Ok(self.held(&p, sample_time)?.frequency_response(&lines)?);
            }
            Ok(match self.file.model.frozen(&p)? {
                FrozenModel::Continuous(s) => s.frequency_response(&lines)?,
                FrozenModel::Discrete(s) => s.frequency_response(&lines)?,
            })
        });
        response(py, &found.map_err(|e| to_python(py, &e))?)
    }

    /// Outputs for inputs along p, samples x channels each, from a state or from rest.
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        u: PyReadonlyArray2<'py, f64>,
        p: Option<PyReadonlyArray2<'py, f64>>,
        x0: Option<Vec<f64>>,
        sample_time: Option<f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let machine = self.machine(sample_time).map_err(|e| to_python(py, &e))?;
        let record =
            record(&u, None, p.as_ref(), self.file.model.outputs()).map_err(|e| to_python(py, &e))?;
        let start = x0.map(DVector::from_vec);
        let run = worker::run(py, None, move |_| {
            Ok(open_loop(&machine, &record, start.as_ref())?)
        })?;
        samples(py, &run.outputs)
    }

    /// One-step predictions of the outputs, samples x channels. The gain is the model's own, else that of a Kalman filter for
    /// inputs that are disturbed by the most likely part of their size.
    fn predict<'py>(
        &self,
        py: Python<'py>,
        signals: Measured<'py>,
        x0: Option<Vec<f64>>,
        noise: Option<Vec<f64>>,
        sample_time: Option<f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (machine, record) = self
            .measured(&signals, sample_time)
            .map_err(|e| to_python(py, &e))?;
        let start = x0.map(DVector::from_vec);
        let predicted = worker::run(py, None, move |_| {
            let noise = noise.as_deref();
            let part = disturbance(&machine, std::slice::from_ref(&record), noise);
            let errors =
                predictor(&machine, &record, part, noise).errors(&record, start.as_ref(), record.len())?;
            let y = DMatrix::from_fn(errors.nrows(), errors.ncols(), |i, k| {
                record.outputs.columns[i][k]
            });
            Ok(y - errors)
        })?;
        samples(py, &predicted)
    }

    /// The state in which a record begins, by least squares.
    fn first_state<'py>(
        &self,
        py: Python<'py>,
        signals: Measured<'py>,
        sample_time: Option<f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (machine, record) = self
            .measured(&signals, sample_time)
            .map_err(|e| to_python(py, &e))?;
        let found = worker::run(py, None, move |_| Ok(first_state(&machine, &record)?))?;
        Ok(PyArray1::from_slice(py, found.as_slice()))
    }

    /// How well the frozen response is known; none where that is not known itself.
    fn frozen_deviation<'py>(&self, py: Python<'py>) -> PyResult<Option<Deviation<'py>>> {
        let known = self
            .file
            .identification
            .as_ref()
            .and_then(|i| i.frozen_deviation.as_ref());
        let convert = |d: &FrozenDeviation| -> PyResult<Deviation<'py>> {
            Ok((
                PyArray1::from_slice(py, &d.positions),
                PyArray1::from_slice(py, &d.frequencies_hz),
                [table(py, &d.in_phase)?, table(py, &d.quadrature)?],
            ))
        };
        known.map(convert).transpose()
    }

    /// The blocks of a linear fractional representation; none of another model.
    fn lfr<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        match &self.file.model {
            lpv_core::Model::ContinuousLfr(m) => blocks(py, m, 0.0).map(Some),
            lpv_core::Model::DiscreteLfr(m) => blocks(py, m, m.clock().sample_time()).map(Some),
            _ => Ok(None),
        }
    }

    /// The text of the file, with the folder of the bundle absolute.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        self.file.to_json().map_err(|e| to_python(py, &e))
    }

    /// Writes a file of the kind of its ending: json, mat, csv, py.
    fn save(&self, py: Python<'_>, path: PathBuf, points: usize, overwrite: bool) -> PyResult<()> {
        let file = self.file_at(&path);
        py.detach(|| write(&file, &path, points, overwrite))
            .map_err(|e| to_python(py, &e))
    }
}

impl Model {
    fn held(&self, p: &[f64], sample_time: Option<f64>) -> Result<StateSpace<Discrete>, PipelineError> {
        if let (Some(own), Some(time)) = (self.file.model.clock(), sample_time)
            && (time / own.sample_time() - 1.0).abs() > SAME_TIME
        {
            return Err(PipelineError::Structure {
                problem: "the model is in discrete time, of a sample time of its own: leave sample_time out, or identify one in continuous time",
            });
        }
        Ok(self.file.model.frozen(p)?.held(self.clock(sample_time)?)?)
    }
}

fn write(file: &ModelFile, path: &Path, points: usize, overwrite: bool) -> Result<(), PipelineError> {
    let ending = path
        .extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase();
    let Some(target) = Target::ALL.into_iter().find(|t| t.ending() == ending) else {
        let problem = "a model goes to a file that ends in .json, .mat, .csv or .py".to_owned();
        return Err(PipelineError::Model {
            file: path.to_owned(),
            problem,
        });
    };
    let replace = Overwrite::if_asked(overwrite);
    let place = Place::check(path, target.kind(), &Inputs::none(), replace)?;
    let bytes = convert::export(file, target, points)?;
    write_all(&[(&place, &bytes)])
}
