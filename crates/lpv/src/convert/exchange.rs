//! A model taken apart into named matrices: what all foreign formats hold.

use super::grid::{Frozen, frozen_grid};
use crate::diagnose::{BaseKind, Explanation};
use crate::encode::word;
use crate::{ModelFile, PipelineError};
use lpv_core::nalgebra::{DMatrix, DVector};
use lpv_core::{
    AxisOutput, Clock, Continuous, DeltaBlock, Discrete, InnovationModel, Lfr, LfrBlocks, LpvStateSpace,
    Model, RigidBody, RigidBodyAxis, SchedulingRange, StateSpace,
};

/// Named matrices of a model, and its frozen systems on a grid.
pub(super) struct Exchange {
    /// What the model is, in words.
    pub(super) description: String,
    /// `state-space`, `innovation`, `rigid-body`, `lfr` or `grid` (frozen systems only).
    pub(super) kind: String,
    /// Sample time, 0 for continuous time.
    pub(super) sample_time: f64,
    /// Matrices by name, in order.
    pub(super) blocks: Vec<(String, DMatrix<f64>)>,
    /// Frozen systems: scheduling value, A, B, C, D; empty for a time-invariant model.
    pub(super) grid: Vec<Frozen>,
    /// What the matrices mean, in words.
    pub(super) note: String,
    /// Names of inputs and outputs, where known.
    pub(super) inputs: Vec<String>,
    pub(super) outputs: Vec<String>,
}

impl Exchange {
    /// Takes the model apart; `points` frozen systems a parameter.
    pub(super) fn new(file: &ModelFile, points: usize) -> Result<Self, PipelineError> {
        let account = file.identification.as_ref();
        let mut exchange = Self {
            description: file.model.describe(),
            kind: "state-space".to_owned(),
            sample_time: 0.0,
            blocks: Vec::new(),
            grid: Vec::new(),
            note: String::new(),
            inputs: account.map_or_else(Vec::new, |a| a.inputs.clone()),
            outputs: account.map_or_else(Vec::new, |a| a.outputs.clone()),
        };
        match &file.model {
            Model::DiscreteStateSpace(s) => {
                exchange.sample_time = s.clock().sample_time();
                exchange.system(s);
            }
            Model::ContinuousStateSpace(s) => exchange.system(s),
            Model::InnovationStateSpace(m) => {
                exchange.kind = "innovation".to_owned();
                exchange.sample_time = m.model().clock().sample_time();
                exchange.system(m.model());
                exchange.push("K", m.gain().clone());
                exchange.push("innovation_covariance", m.innovation_covariance().clone());
                exchange.push("input_offset", column(m.input_offset().as_slice()));
                exchange.push("output_offset", column(m.output_offset().as_slice()));
            }
            Model::RigidBody(body) => {
                exchange.kind = "rigid-body".to_owned();
                exchange.system(&body.to_state_space()?);
                let rows = body.axes().iter().flat_map(|a| {
                    [
                        a.inertia,
                        a.viscous,
                        a.offset,
                        a.inertia_deviation,
                        a.viscous_deviation,
                        a.offset_deviation,
                        f64::from(u8::from(!a.output.is_position())),
                    ]
                });
                let rows = DMatrix::from_row_iterator(body.axes().len(), 7, rows);
                // The last column says that an output is a speed; where none is, there is none.
                let kept = 6 + usize::from(rows.column(6).iter().any(|v| *v != 0.0));
                exchange.push("axes", rows.columns(0, kept).into_owned());
            }
            Model::DiscreteLfr(m) => {
                exchange.sample_time = m.clock().sample_time();
                exchange.lfr(m, points)?;
            }
            Model::ContinuousLfr(m) => {
                exchange.lfr(m, points)?;
                exchange.record_sample_time(account.and_then(|a| a.sample_time));
            }
            Model::DiscreteLpv(m) => {
                exchange.sample_time = m.clock().sample_time();
                exchange.lpv(m, points)?;
            }
            Model::ContinuousLpv(m) => {
                exchange.lpv(m, points)?;
                exchange.record_sample_time(account.and_then(|a| a.sample_time));
            }
            Model::SeriesExpansion(m) => {
                let m = m.to_state_space()?;
                exchange.sample_time = m.clock().sample_time();
                exchange.lpv(&m, points)?;
            }
        }
        if let Some(explanation) = &file.explanation {
            exchange.explanation(explanation);
        }
        Ok(exchange)
    }

    /// Parameters of base and effects, each a matrix of one entry, with words on what they are.
    fn explanation(&mut self, explanation: &Explanation) {
        for (name, value) in &explanation.base_parameters {
            self.push(
                &format!("base_{}", word(name)),
                DMatrix::from_element(1, 1, value.value),
            );
        }
        for (i, effect) in explanation.effects.iter().enumerate() {
            for (name, value) in &effect.parameters {
                let name = format!("effect{}_{}_{}", i + 1, word(&effect.effect), word(name));
                self.push(&name, DMatrix::from_element(1, 1, value.value));
            }
        }
        if !self.note.is_empty() {
            self.note += "  ";
        }
        self.note += &format!(
            "The matrices are {}; parameters of its machine, and effects beside it, with standard deviations: {}.",
            match explanation.base {
                BaseKind::Identified =>
                    "those that were identified: multiply A by the factor of the frequencies, and B by the gains over it",
                BaseKind::XyTable
                | BaseKind::ServoAxis
                | BaseKind::SpringAxis
                | BaseKind::MotorAndLoad
                | BaseKind::MotorAndMeasuredLoad => "the linear part",
            },
            explanation.lines().join("; ")
        );
    }

    /// Sample time of the records behind a continuous model, where it is known.
    fn record_sample_time(&mut self, known: Option<f64>) {
        if let Some(time) = known {
            self.push("record_sample_time", DMatrix::from_element(1, 1, time));
        }
    }

    /// Adds a matrix; a name that is there already, or that is too long for MATLAB, gets a number at its end.
    fn push(&mut self, name: &str, matrix: DMatrix<f64>) {
        /// Of a name in MATLAB.
        const LONGEST: usize = 63;
        let fits = |n: &str| n.len() <= LONGEST && self.blocks.iter().all(|(known, _)| known != n);
        let numbered = |i: usize| {
            let end = format!("_{i}");
            format!("{}{end}", &name[..name.len().min(LONGEST - end.len())])
        };
        let name = match fits(name) {
            true => name.to_owned(),
            false => (2..).map(numbered).find(|n| fits(n)).unwrap_or_default(),
        };
        self.blocks.push((name, matrix));
    }

    fn system<K: Clock>(&mut self, s: &StateSpace<K>) {
        for (name, m) in [("A", s.a()), ("B", s.b()), ("C", s.c()), ("D", s.d())] {
            self.push(name, m.clone());
        }
    }

    fn lfr<K: Clock>(&mut self, m: &Lfr<K>, points: usize) -> Result<(), PipelineError> {
        self.kind = "lfr".to_owned();
        self.note = note(self.sample_time);
        for (name, block) in m.blocks().named() {
            self.push(name, block.clone());
        }
        self.range(m.range());
        let deltas = m
            .deltas()
            .iter()
            .flat_map(|d| [d.parameter as f64 + 1.0, d.repetitions as f64]);
        self.push("deltas", DMatrix::from_row_iterator(m.deltas().len(), 2, deltas));
        let sizes = (m.states(), m.outputs(), m.inputs());
        self.grid = frozen_grid(sizes, m.range(), points, |p| m.frozen(p))?;
        Ok(())
    }

    fn lpv<K: Clock>(&mut self, m: &LpvStateSpace<K>, points: usize) -> Result<(), PipelineError> {
        self.kind = "grid".to_owned();
        self.range(m.range());
        let sizes = (m.states(), m.outputs(), m.inputs());
        self.grid = frozen_grid(sizes, m.range(), points, |p| m.frozen(p))?;
        Ok(())
    }

    fn range(&mut self, range: &SchedulingRange) {
        let bounds = range.bounds().iter().flatten().copied();
        self.push("range", DMatrix::from_row_iterator(range.parameters(), 2, bounds));
    }

    fn block(&self, name: &str) -> Result<DMatrix<f64>, String> {
        self.blocks
            .iter()
            .find(|(n, _)| n == name)
            .map(|(_, m)| m.clone())
            .ok_or_else(|| format!("the matrix {name} is missing"))
    }

    /// The model again.
    pub(super) fn model(&self) -> Result<Model, String> {
        let text = |e: lpv_core::CoreError| e.to_string();
        let discrete = || Discrete::new(self.sample_time).map_err(text);
        match (self.kind.as_str(), self.sample_time > 0.0) {
            ("state-space", true) => Ok(Model::DiscreteStateSpace(self.state_space(discrete()?)?)),
            ("state-space", false) => Ok(Model::ContinuousStateSpace(self.state_space(Continuous)?)),
            ("lfr", true) => Ok(Model::DiscreteLfr(self.to_lfr(discrete()?)?)),
            ("lfr", false) => Ok(Model::ContinuousLfr(self.to_lfr(Continuous)?)),
            ("innovation", _) => {
                let vector = |name: &str| Ok::<_, String>(DVector::from_column_slice(self.block(name)?.as_slice()));
                InnovationModel::new(
                    self.state_space(discrete()?)?,
                    self.block("K")?,
                    self.block("innovation_covariance")?,
                    vector("input_offset")?,
                    vector("output_offset")?,
                )
                .map(Model::InnovationStateSpace)
                .map_err(text)
            }
            ("rigid-body", _) => {
                let rows = self.block("axes")?;
                if !matches!(rows.ncols(), 6 | 7) {
                    return Err(format!("the matrix axes has {} columns, not 6 or 7", rows.ncols()));
                }
                let axes = rows
                    .row_iter()
                    .map(|r| RigidBodyAxis {
                        inertia: r[0],
                        viscous: r[1],
                        offset: r[2],
                        inertia_deviation: r[3],
                        viscous_deviation: r[4],
                        offset_deviation: r[5],
                        output: match r.iter().nth(6) {
                            Some(speed) if *speed != 0.0 => AxisOutput::Speed,
                            _ => AxisOutput::Position,
                        },
                    })
                    .collect();
                RigidBody::new(axes).map(Model::RigidBody).map_err(text)
            }
            ("grid", _) => Err("it holds frozen systems on a grid, from which the coefficient functions cannot be had back; keep the JSON file".to_owned()),
            (other, _) => Err(format!("unknown kind of model `{other}`")),
        }
    }

    fn state_space<K: Clock>(&self, clock: K) -> Result<StateSpace<K>, String> {
        StateSpace::new(
            self.block("A")?,
            self.block("B")?,
            self.block("C")?,
            self.block("D")?,
            clock,
        )
        .map_err(|e| e.to_string())
    }

    fn to_lfr<K: Clock>(&self, clock: K) -> Result<Lfr<K>, String> {
        let deltas = self.block("deltas")?;
        let range = self.block("range")?;
        if deltas.ncols() != 2 || range.ncols() != 2 {
            return Err("the matrices range and deltas must have two columns".to_owned());
        }
        let whole = |v: f64| {
            if v >= 0.0 && v.fract() == 0.0 && v < 1e6 {
                Ok(v as usize)
            } else {
                Err(format!("the matrix deltas holds {v}, which is no count"))
            }
        };
        let deltas = deltas
            .row_iter()
            .map(|r| {
                Ok(DeltaBlock {
                    parameter: whole(r[0] - 1.0)?,
                    repetitions: whole(r[1])?,
                })
            })
            .collect::<Result<Vec<_>, String>>()?;
        let bounds = range.row_iter().map(|r| [r[0], r[1]]).collect();
        let blocks = LfrBlocks {
            a: self.block("A")?,
            b1: self.block("B1")?,
            b2: self.block("B2")?,
            c1: self.block("C1")?,
            d11: self.block("D11")?,
            d12: self.block("D12")?,
            c2: self.block("C2")?,
            d21: self.block("D21")?,
            d22: self.block("D22")?,
        };
        let range = SchedulingRange::new(bounds).map_err(|e| e.to_string())?;
        Lfr::new(blocks, deltas, range, clock).map_err(|e| e.to_string())
    }
}

/// The equations of an LFR and the normalisation of its deltas.
fn note(sample_time: f64) -> String {
    let next = if sample_time > 0.0 { "x+" } else { "dx/dt" };
    format!(
        "{next} = A x + B1 w + B2 u,  z = C1 x + D11 w + D12 u,  y = C2 x + D21 w + D22 u,  w = Delta(p) z.  \
         Delta(p) is diagonal: row by row of the matrix deltas (number of the parameter from 1, repetitions) \
         delta = (p - centre) / half_width, repeated, with centre = (low + high) / 2 and \
         half_width = (high - low) / 2 of that parameter's row (low, high) of the matrix range; \
         so delta runs from -1 to 1."
    )
}

fn column(values: &[f64]) -> DMatrix<f64> {
    DMatrix::from_column_slice(values.len(), 1, values)
}
