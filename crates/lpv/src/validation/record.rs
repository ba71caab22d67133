//! The model along one record.

use super::check::{ErrorFigure, OutputCheck, RecordCheck};
use super::disturbance::errors_about;
use super::rigid;
use crate::PipelineError;
use crate::finding::Finding;
use experiment_data::Travel;
use lpv_core::nalgebra::{DMatrix, DVector};
use lpv_core::{Controller, Purpose, Record};
use lpv_diagnose::{Base, Explained, Response, Track};
use lpv_numerics::statistics::{mean, standard_deviation};
use lpv_simulate::{Machine, Run, SimulateError, at_rest, closed_loop, first_state, open_loop, predictor};

/// Why a model of a diagnosis without a controller is not judged here.
pub(super) const OBSERVED: &str = "the bundle has no [controller], and the effects of this model are simulated with one: `lpv diagnose` told \
                                   its errors on held-out records, through an observer";
/// Why its frozen response does not judge a model.
pub(super) const BENT: &str = "effects of the model, as friction, bend a response when it is measured, and its frozen response is that of the \
                               linear part: the records along time judge it";

/// Whether a measured response is not that of the linear part: there are effects beside those that a response shows.
pub(super) fn bends_a_response(explained: &Explained) -> bool {
    explained.effects.iter().any(|(e, _)| e.on_response.is_none())
}

/// Whether the linear model alone is not what was explained: there are effects, or gains of an identified base.
pub(super) fn is_refitted(explained: &Explained) -> bool {
    !explained.effects.is_empty() || matches!(explained.base, Base::Lpv(_))
}

/// A mean this many times the deviation is what the error consists of.
const CONSTANT: f64 = 3.0;

/// A constant that counts, in parts of the motion.
const OF_MOTION: f64 = 0.01;

/// A one-step error this many times the closed-loop one comes from a prediction that does not hold on to the record.
const LOST: f64 = 3.0;

/// The check of a record, and the simulations behind it.
pub(super) struct Along {
    pub(super) check: RecordCheck,
    pub(super) open: Run,
    pub(super) closed: Option<Run>,
    /// Levels that differ.
    pub(super) findings: Vec<Finding>,
    pub(super) notes: Vec<String>,
}

/// What all records share.
pub(super) struct Context<'a> {
    pub(super) machine: &'a Machine,
    /// From first principles, or with effects.
    pub(super) explained: Option<&'a Explained>,
    pub(super) body: Option<&'a lpv_core::RigidBody>,
    pub(super) clock: lpv_core::Discrete,
    pub(super) controller: Option<&'a Controller>,
    pub(super) noise: Option<&'a [f64]>,
    pub(super) units: &'a [String],
    pub(super) disturbance: f64,
}

impl Context<'_> {
    pub(super) fn record(&self, record: &Record, from: usize) -> Result<Along, PipelineError> {
        let mut notes = Vec::new();
        let moving = self.controller.and_then(|c| c.start().ok()?.begun(record));
        let at_rest = moving.is_none() && at_rest(self.machine, record, self.noise);
        let x0 = if at_rest {
            None
        } else {
            Some(first_state(self.machine, record)?)
        };
        let x0 = x0.as_ref();
        let with_effects = match self
            .explained
            .filter(|_| moving.is_some() || self.stands_still(record))
        {
            Some(explained) => self.explained(explained, record),
            None => None,
        };
        if self.explained.is_some() && with_effects.is_none() {
            notes.push(format!(
                "record {}: simulated with the linear part alone, since it has no references, does not start at rest at them, or the model \
                 with its effects diverges along it",
                record.name
            ));
        }
        // Of a model with effects, or with gains of an identified base, the linear part alone predicts nothing.
        let refitted = self.explained.filter(|e| is_refitted(e));
        let errors = match (refitted, &with_effects) {
            (Some(explained), Some((open, closed))) => {
                let about = closed.as_ref().unwrap_or(open);
                errors_about(explained, self.clock, about, record, self.noise).or_else(|e| {
                    notes.push(format!(
                        "record {}: nothing is predicted one step ahead: {e}",
                        record.name
                    ));
                    Ok(DMatrix::zeros(0, record.len()))
                })
            }
            (Some(_), None) => Ok(DMatrix::zeros(0, record.len())),
            (None, _) => {
                predictor(self.machine, record, self.disturbance, self.noise).errors(record, x0, record.len())
            }
        };
        let (open, closed) = match with_effects {
            Some(runs) => runs,
            None => self.linear(record, x0, &mut notes)?,
        };
        let residuals: Vec<Vec<f64>> = match errors {
            Ok(errors) if errors.iter().all(|e| e.is_finite()) => lpv_simulate::rows(&errors)
                .into_iter()
                .map(|r| r[from..].to_vec())
                .collect(),
            Ok(_) => {
                notes.push(format!(
                    "record {}: the one-step prediction diverges; the model and this record do not belong together, or its gain suits no noise as small as this",
                    record.name
                ));
                Vec::new()
            }
            Err(SimulateError::Structure { problem }) => {
                notes.push(problem.to_owned());
                Vec::new()
            }
            Err(other) => return Err(other.into()),
        };
        let inputs: Vec<&[f64]> = record.inputs.columns.iter().map(|u| &u[from..]).collect();
        let difference = |simulated: &DMatrix<f64>, i: usize| -> Vec<f64> {
            let y = &record.outputs.columns[i];
            (from..record.len()).map(|k| y[k] - simulated[(i, k)]).collect()
        };
        let outputs: Vec<OutputCheck> = (0..record.outputs.channels())
            .map(|i| {
                let y = &record.outputs.columns[i][from..];
                let figure = |error: &[f64]| ErrorFigure::new(y, error, self.noise.map(|n| n[i]));
                let open_error = difference(&open.outputs, i);
                OutputCheck {
                    name: record.outputs.names[i].clone(),
                    unit: self.units.get(i).cloned().unwrap_or_default(),
                    one_step: residuals.get(i).map(|r| figure(r)),
                    open_loop: figure(&open_error),
                    open_loop_by_inputs: lpv_simulate::share_of_inputs(&open_error, &inputs),
                    open_loop_predictable: lpv_simulate::predictable_share(&open_error),
                    change_rms: (y.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum::<f64>()
                        / y.len().max(2) as f64)
                        .sqrt(),
                    closed_loop: closed.as_ref().map(|run| figure(&difference(&run.outputs, i))),
                }
            })
            .collect();
        let lost = outputs.iter().any(|o| match (&o.one_step, &o.closed_loop) {
            (Some(one), Some(closed)) => one.rms > LOST * closed.rms,
            _ => false,
        });
        if lost && self.explained.is_none() {
            notes.push(format!(
                "record {}: its one-step and open-loop errors are larger than the closed-loop one, since errors grow along it where no controller holds the machine; the closed loop is the one to judge by",
                record.name
            ));
        }
        let run = closed.as_ref().unwrap_or(&open);
        let levels = record.outputs.names.iter().enumerate();
        let findings = levels
            .filter_map(|(i, name)| self.level(record, from, name, i, &difference(&run.outputs, i)))
            .collect();
        let mut cross_correlation = Vec::new();
        for (residual, output) in residuals.iter().zip(&record.outputs.names) {
            for (u, input) in record.inputs.columns.iter().zip(&record.inputs.names) {
                cross_correlation.push(lpv_simulate::cross_correlation(
                    output,
                    residual,
                    input,
                    &u[from..],
                ));
            }
        }
        let check = RecordCheck {
            name: record.name.clone(),
            purpose: match record.purpose {
                Purpose::Estimation => "estimation",
                Purpose::Validation => "validation",
            },
            from,
            start: if at_rest {
                "at rest"
            } else {
                "fitted to the first samples"
            },
            outputs,
            whiteness: residuals
                .iter()
                .zip(&record.outputs.names)
                .map(|(r, name)| lpv_simulate::whiteness(name, r, &inputs))
                .collect(),
            moves: self.machine.range().is_some_and(|range| {
                let widths = range.half_width().into_iter().map(|half| 2.0 * half);
                let mut pairs = record.scheduling.columns.iter().zip(widths);
                pairs.any(|(p, width)| !Travel::of(p).rests(|| width))
            }),
            cross_correlation,
            axes: match self.body {
                // Its inverse dynamics know nothing of effects.
                Some(_) if refitted.is_some() => Vec::new(),
                Some(body) => rigid::check(body, self.clock, record, &open, closed.as_ref())?,
                None => Vec::new(),
            },
        };
        Ok(Along {
            check,
            open,
            closed,
            findings,
            notes,
        })
    }

    /// A level that no model of these records has: the error is a constant.
    fn level(&self, record: &Record, from: usize, name: &str, i: usize, error: &[f64]) -> Option<Finding> {
        let motion = standard_deviation(&record.outputs.columns[i][from..]);
        let noise = self.noise.map_or(0.0, |n| n[i]);
        // Where the state of the start has decayed, which a wrong level bends.
        let late = &error[error.len() / 2..];
        let (level, left) = (mean(late), standard_deviation(late));
        let stands_out = level.abs() > CONSTANT * left && level.abs() > OF_MOTION * motion + CONSTANT * noise;
        stands_out.then(|| Finding::LevelDiffers {
            record: record.name.clone(),
            column: name.to_owned(),
            level,
            percent: crate::signal::finite(100.0 * level.abs() / motion),
            percent_left: crate::signal::finite(100.0 * left / motion),
        })
    }

    /// Open and closed loop of the linear model.
    fn linear(
        &self,
        record: &Record,
        x0: Option<&DVector<f64>>,
        notes: &mut Vec<String>,
    ) -> Result<(Run, Option<Run>), PipelineError> {
        let open = open_loop(self.machine, record, x0)?;
        let Some(controller) = self.controller else {
            return Ok((open, None));
        };
        match closed_loop(self.machine, controller, record, x0) {
            Ok(run) => Ok((open, Some(run))),
            Err(SimulateError::Structure { problem }) => {
                notes.push(problem.to_owned());
                Ok((open, None))
            }
            Err(other) => Err(other.into()),
        }
    }

    /// Whether a record starts where its first references want it.
    fn stands_still(&self, record: &Record) -> bool {
        let pairs = record.outputs.columns.iter().zip(&record.references.columns);
        let near = |(i, (y, r)): (usize, (&Vec<f64>, &Vec<f64>))| {
            let largest = y.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            let noise = self.noise.and_then(|n| n.get(i)).copied().unwrap_or(0.0);
            (y[0] - r[0]).abs() <= (10.0 * noise).max(1e-3 * largest)
        };
        !record.references.columns.is_empty() && pairs.enumerate().all(near)
    }

    /// The same with effects; none where it diverges.
    fn explained(&self, explained: &Explained, record: &Record) -> Option<(Run, Option<Run>)> {
        /// Parts of a sample over those of a fit: some effects are fast.
        const FINER: usize = 4;
        let step = self.clock.sample_time();
        let start = self.controller.and_then(|c| c.start().ok());
        let track = Track::new(record, step, FINER * explained.base.parts(step), start.as_ref()).ok()?;
        let run = |found: Response| {
            let rows = |n: usize, of: &[[f64; 2]]| DMatrix::from_fn(n, of.len(), |i, k| of[k][i]);
            Run {
                outputs: rows(record.outputs.channels(), &found.outputs),
                inputs: rows(record.inputs.channels(), &found.inputs),
            }
        };
        let closed = match &start {
            Some(controller) => Some(run(explained.closed_loop(controller, &track)?)),
            None => None,
        };
        Some((run(explained.open_loop(&track)?), closed))
    }
}
