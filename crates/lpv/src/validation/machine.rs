//! Any model of a file, ready to run along records.

use super::Frozen;
use crate::PipelineError;
use lpv_core::nalgebra::{DMatrix, DVector};
use lpv_core::{Discrete, Model, SchedulingRange, StateSpace};

/// A model with the clock of the records.
#[derive(Debug, Clone)]
pub struct Machine {
    kind: Kind,
    offsets: Option<(DVector<f64>, DVector<f64>)>,
    gain: Option<DMatrix<f64>>,
    range: Option<SchedulingRange>,
}

#[derive(Debug, Clone)]
enum Kind {
    Fixed(StateSpace<Discrete>),
    Lfr(lpv_core::Lfr<Discrete>),
    Lpv(lpv_core::LpvStateSpace<Discrete>),
    ContinuousLfr(lpv_core::Lfr<lpv_core::Continuous>, Discrete),
    ContinuousLpv(lpv_core::LpvStateSpace<lpv_core::Continuous>, Discrete),
}

impl Machine {
    /// Continuous models are sampled with the input held, discrete ones must have the clock of the records.
    ///
    /// # Errors
    /// [`PipelineError::Clock`] for another sample time; a continuous model that cannot be sampled.
    pub fn new(model: &Model, clock: Discrete) -> Result<Self, PipelineError> {
        let same = |model: Discrete| {
            let ratio = model.sample_time() / clock.sample_time();
            if (ratio - 1.0).abs() < 1e-6 {
                Ok(())
            } else {
                Err(PipelineError::Clock {
                    model: model.sample_time(),
                    records: clock.sample_time(),
                })
            }
        };
        let mut machine = Self {
            kind: Kind::Fixed(StateSpace::gain(DMatrix::zeros(0, 0), clock)?),
            offsets: None,
            gain: None,
            range: None,
        };
        machine.kind = match model {
            Model::DiscreteStateSpace(s) => {
                same(s.clock())?;
                Kind::Fixed(s.clone())
            }
            Model::ContinuousStateSpace(s) => Kind::Fixed(s.zero_order_hold(clock)?),
            Model::InnovationStateSpace(s) => {
                same(s.model().clock())?;
                machine.offsets = Some((s.input_offset().clone(), s.output_offset().clone()));
                machine.gain = Some(s.gain().clone());
                Kind::Fixed(s.model().clone())
            }
            Model::RigidBody(body) => {
                let offsets = body.axes().iter().map(|a| a.offset);
                let n = body.axes().len();
                machine.offsets = Some((DVector::from_iterator(n, offsets), DVector::zeros(n)));
                Kind::Fixed(body.to_state_space()?.zero_order_hold(clock)?)
            }
            Model::DiscreteLfr(m) => {
                same(m.clock())?;
                machine.range = Some(m.range().clone());
                Kind::Lfr(m.clone())
            }
            Model::DiscreteLpv(m) => {
                same(m.clock())?;
                machine.range = Some(m.range().clone());
                Kind::Lpv(m.clone())
            }
            Model::SeriesExpansion(m) => {
                let m = m.to_state_space()?;
                same(m.clock())?;
                machine.range = Some(m.range().clone());
                Kind::Lpv(m)
            }
            Model::ContinuousLfr(m) => {
                machine.range = Some(m.range().clone());
                Kind::ContinuousLfr(m.clone(), clock)
            }
            Model::ContinuousLpv(m) => {
                machine.range = Some(m.range().clone());
                Kind::ContinuousLpv(m.clone(), clock)
            }
            _ => {
                return Err(PipelineError::Structure {
                    problem: "this kind of model cannot be simulated by this version of the program",
                });
            }
        };
        Ok(machine)
    }

    /// Inputs and outputs.
    ///
    /// # Errors
    /// A model that cannot be frozen at the centre of its range.
    pub fn channels(&self) -> Result<(usize, usize), PipelineError> {
        let centre = self.range.as_ref().map_or_else(Vec::new, SchedulingRange::centre);
        let frozen = self.at(&centre)?;
        Ok((frozen.inputs(), frozen.outputs()))
    }

    /// Innovation gain, where the model has one.
    pub fn gain(&self) -> Option<&DMatrix<f64>> {
        self.gain.as_ref()
    }
    /// Range of the scheduling variable; none for a time-invariant model.
    pub fn range(&self) -> Option<&SchedulingRange> {
        self.range.as_ref()
    }
}

impl Frozen for Machine {
    fn at(&self, p: &[f64]) -> Result<StateSpace<Discrete>, PipelineError> {
        if self.range.is_some() && p.is_empty() {
            return Err(PipelineError::Structure {
                problem: "the model depends on a scheduling variable and the record has no scheduling channel; name it in [channels.scheduling]",
            });
        }
        Ok(match &self.kind {
            Kind::Fixed(s) => s.clone(),
            Kind::Lfr(m) => m.frozen(p)?,
            Kind::Lpv(m) => m.frozen(p)?,
            Kind::ContinuousLfr(m, clock) => m.frozen(p)?.zero_order_hold(*clock)?,
            Kind::ContinuousLpv(m, clock) => m.frozen(p)?.zero_order_hold(*clock)?,
        })
    }
    fn step(&self, p: &[f64], nodes: [&[f64]; 2]) -> Result<StateSpace<Discrete>, PipelineError> {
        let Kind::ContinuousLfr(model, clock) = &self.kind else {
            return self.at(p);
        };
        let (a, b) = model.transition(nodes, *clock)?;
        let here = model.frozen(p)?;
        Ok(StateSpace::new(a, b, here.c().clone(), here.d().clone(), *clock)?)
    }
    fn offsets(&self) -> Option<(&DVector<f64>, &DVector<f64>)> {
        self.offsets.as_ref().map(|(u, y)| (u, y))
    }
}
