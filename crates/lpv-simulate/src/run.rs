//! Models that run along a record.

use crate::SimulateError;
use lpv_core::{Controller, Discrete, Record, SchedulingNodes, StateSpace};
use nalgebra::{DMatrix, DVector};

/// A model that can be frozen at any p: what the simulations need.
pub trait Frozen {
    /// The model at p.
    ///
    /// # Errors
    /// p outside the range.
    fn at(&self, p: &[f64]) -> Result<StateSpace<Discrete>, SimulateError>;

    /// The model over the sample after p, while the scheduling passes the two Gauss `nodes` of the interval: A and B
    /// take the state to the next sample, C and D hold at this one. A discrete model knows nothing between its samples.
    ///
    /// # Errors
    /// As [`Frozen::at`].
    fn step(&self, p: &[f64], _nodes: [&[f64]; 2]) -> Result<StateSpace<Discrete>, SimulateError> {
        self.at(p)
    }

    /// Input and output that count as zero; none where zero does.
    fn offsets(&self) -> Option<(&DVector<f64>, &DVector<f64>)> {
        None
    }
}

impl Frozen for lpv_core::LpvStateSpace<Discrete> {
    fn at(&self, p: &[f64]) -> Result<StateSpace<Discrete>, SimulateError> {
        Ok(self.frozen(p)?)
    }
}

impl Frozen for lpv_core::Lfr<Discrete> {
    fn at(&self, p: &[f64]) -> Result<StateSpace<Discrete>, SimulateError> {
        Ok(self.frozen(p)?)
    }
}

/// A simulated record, one column a sample.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Outputs, `n_y x N`.
    pub outputs: DMatrix<f64>,
    /// Inputs: those of the record in open loop, those of the controller in closed loop, `n_u x N`.
    pub inputs: DMatrix<f64>,
}

/// Response of a model to the recorded inputs along the recorded scheduling, from `initial_state` or from rest.
///
/// # Errors
/// p outside the range of the model, channels that do not fit.
pub fn open_loop(
    model: &impl Frozen,
    record: &Record,
    initial_state: Option<&DVector<f64>>,
) -> Result<Run, SimulateError> {
    run(model, record, initial_state, |k, _, u| {
        for (u, column) in u.iter_mut().zip(&record.inputs.columns) {
            *u = column[k];
        }
    })
}

/// Response of the model in closed loop with the bundle's controller, in the state in which the record begins, along the recorded references,
/// injections and scheduling. The model must be strictly proper.
///
/// # Errors
/// As [`open_loop`]; a controller that does not fit; a direct term.
pub fn closed_loop(
    model: &impl Frozen,
    controller: &Controller,
    record: &Record,
    initial_state: Option<&DVector<f64>>,
) -> Result<Run, SimulateError> {
    let at_rest = controller.start()?;
    let mut state = at_rest.begun(record).unwrap_or(at_rest);
    let mut r = vec![0.0; record.references.channels()];
    let at_start = Steps::new(model, record).at(0)?;
    if at_start.d().amax() > ROUNDING * at_start.c().amax() * at_start.b().amax() {
        return Err(SimulateError::Structure {
            problem: "closed loop: the model has a direct term, so the controller would act on the output that it causes; a sampled machine has none",
        });
    }
    run(model, record, initial_state, move |k, y, u| {
        for (r, column) in r.iter_mut().zip(&record.references.columns) {
            *r = column[k];
        }
        state.step(&r, y, u);
        for (u, column) in u.iter_mut().zip(&record.injection.columns) {
            *u += column[k];
        }
    })
}

/// A direct term below this part of `|C| |B|` is what a realisation leaves of zero.
const ROUNDING: f64 = 1e-12;

/// The model along the scheduling of a record.
pub struct Steps<'a, M> {
    model: &'a M,
    scheduling: DMatrix<f64>,
    nodes: SchedulingNodes,
}

impl<'a, M: Frozen> Steps<'a, M> {
    /// Along this record; at its position where it has no scheduling signal.
    pub fn new(model: &'a M, record: &Record) -> Self {
        let columns = &record.scheduling.columns;
        let scheduling = match &record.position {
            // Without a signal the position says where it was made.
            Some(p) if columns.is_empty() => DMatrix::from_fn(p.len(), record.len(), |i, _| p[i]),
            _ => DMatrix::from_fn(columns.len(), record.len(), |i, k| columns[i][k]),
        };
        let nodes = SchedulingNodes::new(&scheduling);
        Self {
            model,
            scheduling,
            nodes,
        }
    }

    /// The model from sample `k` to the next.
    pub fn at(&self, k: usize) -> Result<StateSpace<Discrete>, SimulateError> {
        let p = self.scheduling.column(k);
        self.model.step(p.as_slice(), self.nodes.after(k))
    }

    /// Whether the model at sample `k` is that of the sample before.
    pub fn stays(&self, k: usize) -> bool {
        k > 0
            && self.scheduling.column(k) == self.scheduling.column(k - 1)
            && self.nodes.after(k) == self.nodes.after(k - 1)
    }
}

fn run(
    model: &impl Frozen,
    record: &Record,
    initial_state: Option<&DVector<f64>>,
    mut input: impl FnMut(usize, &[f64], &mut [f64]),
) -> Result<Run, SimulateError> {
    let steps = Steps::new(model, record);
    let mut frozen = steps.at(0)?;
    let (nu, ny) = (record.inputs.channels(), frozen.outputs());
    if frozen.inputs() != nu || ny != record.outputs.channels() {
        return Err(SimulateError::Structure {
            problem: "simulation: the record has another number of inputs or outputs than the model",
        });
    }
    let (input_offset, output_offset) = match model.offsets() {
        Some((u, y)) => (u.clone(), y.clone()),
        None => (DVector::zeros(nu), DVector::zeros(ny)),
    };
    let mut x = initial_state.map_or_else(|| DVector::zeros(frozen.states()), DVector::clone);
    let mut u = DVector::zeros(nu);
    let mut run = Run {
        outputs: DMatrix::zeros(ny, record.len()),
        inputs: DMatrix::zeros(nu, record.len()),
    };
    for k in 0..record.len() {
        if !steps.stays(k) {
            frozen = steps.at(k)?;
        }
        let before = frozen.c() * &x + &output_offset;
        input(k, before.as_slice(), u.as_mut_slice());
        let effective = &u - &input_offset;
        run.outputs.set_column(k, &(before + frozen.d() * &effective));
        run.inputs.set_column(k, &u);
        x = frozen.a() * &x + frozen.b() * &effective;
    }
    Ok(run)
}

/// Root mean square of `simulated - recorded` over the samples that both have, one value an output.
pub fn rms_error(simulated: &DMatrix<f64>, record: &Record) -> Vec<f64> {
    record
        .outputs
        .columns
        .iter()
        .enumerate()
        .take(simulated.nrows())
        .map(|(i, y)| {
            let sum: f64 = y
                .iter()
                .zip(simulated.row(i).iter())
                .map(|(y, s)| (s - y).powi(2))
                .sum();
            (sum / y.len().min(simulated.ncols()).max(1) as f64).sqrt()
        })
        .collect()
}
