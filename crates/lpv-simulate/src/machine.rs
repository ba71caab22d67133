//! Any model of a file, ready to run along records.

use crate::Frozen;
use crate::SimulateError;
use lpv_core::{Discrete, Model, SchedulingRange, StateSpace};
use nalgebra::{DMatrix, DVector};

/// A model with the clock of the records.
#[derive(Debug, Clone)]
pub struct Machine {
    model: Model,
    clock: Discrete,
    offsets: Option<(DVector<f64>, DVector<f64>)>,
}

impl Machine {
    /// Continuous models are sampled with the input held, discrete ones must have the clock of the records.
    ///
    /// # Errors
    /// [`SimulateError::Clock`] for another sample time.
    pub fn new(model: &Model, clock: Discrete) -> Result<Self, SimulateError> {
        if let Some(own) = model.clock()
            && (own.sample_time() / clock.sample_time() - 1.0).abs() >= 1e-6
        {
            return Err(SimulateError::Clock {
                model: own.sample_time(),
                records: clock.sample_time(),
            });
        }
        Ok(Self {
            offsets: model.offsets(),
            model: model.in_states()?.into_owned(),
            clock,
        })
    }

    /// Inputs and outputs.
    pub fn channels(&self) -> (usize, usize) {
        (self.model.inputs(), self.model.outputs())
    }

    /// Innovation gain, where the model has one.
    pub fn gain(&self) -> Option<&DMatrix<f64>> {
        match &self.model {
            Model::InnovationStateSpace(s) => Some(s.gain()),
            _ => None,
        }
    }

    /// Range of the scheduling variable; none for a time-invariant model.
    pub fn range(&self) -> Option<&SchedulingRange> {
        self.model.range()
    }
}

impl Frozen for Machine {
    fn at(&self, p: &[f64]) -> Result<StateSpace<Discrete>, SimulateError> {
        if self.range().is_some() && p.is_empty() {
            return Err(SimulateError::Structure {
                problem: "the model depends on a scheduling variable and the record has no scheduling channel; name it in [channels.scheduling]",
            });
        }
        Ok(self.model.frozen(p)?.held(self.clock)?)
    }
    fn step(&self, p: &[f64], nodes: [&[f64]; 2]) -> Result<StateSpace<Discrete>, SimulateError> {
        let Model::ContinuousLfr(model) = &self.model else {
            return self.at(p);
        };
        let (a, b) = model.transition(nodes, self.clock)?;
        let here = model.frozen(p)?;
        Ok(StateSpace::new(
            a,
            b,
            here.c().clone(),
            here.d().clone(),
            self.clock,
        )?)
    }
    fn offsets(&self) -> Option<(&DVector<f64>, &DVector<f64>)> {
        self.offsets.as_ref().map(|(u, y)| (u, y))
    }
}
