//! Records along a moving p, and the loop that they are compared in.

use crate::FitError;
use lpv_core::{CoreError, Discrete, Record, SchedulingNodes, StateSpace};
use nalgebra::{DMatrix, DVector};

/// Records with moving scheduling, made with inputs that are held between samples.
///
/// A model is compared with them in the closed loop that made them: its input is the recorded one plus what the
/// controller would add for the output that differs, `u = u_rec + K (y_rec - y)`. So references, injections and the
/// controller's limits need not be known, the error stays bounded where the machine integrates, and what noise leaves is
/// the noise as the loop passes it on.
#[derive(Debug, Clone)]
pub struct MovingData {
    clock: Discrete,
    feedback: StateSpace<Discrete>,
    noise: Vec<f64>,
    records: Vec<MovingRecord>,
}

/// One record, one column a sample.
#[derive(Debug, Clone)]
pub(crate) struct MovingRecord {
    /// Place among the records.
    pub(crate) index: usize,
    pub(crate) inputs: DMatrix<f64>,
    pub(crate) outputs: DMatrix<f64>,
    pub(crate) scheduling: DMatrix<f64>,
    pub(crate) nodes: SchedulingNodes,
    /// Whether the machine rests at zero at the first sample; else its first state is fitted.
    pub(crate) at_rest: bool,
}

/// A first output within this many deviations of its noise, or this part of its largest value, is zero.
const REST: (f64, f64) = (5.0, 1e-6);

impl MovingData {
    /// Records with scheduling, the deviation of each output's noise (its unit; above zero: what an error is measured
    /// in), and the controller's feedback part K, `n_y` inputs and `n_u` outputs; None leaves the loop open, for machines
    /// that do not integrate.
    ///
    /// # Errors
    /// [`FitError::Empty`] without records or samples; [`FitError::Setting`] for noise that is not above zero;
    /// [`FitError::Core`] for signals, or a controller, that do not fit.
    pub fn new(
        clock: Discrete,
        records: &[Record],
        noise: &[f64],
        feedback: Option<&StateSpace<Discrete>>,
    ) -> Result<Self, FitError> {
        let first = records.first().ok_or(FitError::Empty {
            what: "moving records",
        })?;
        let (nu, ny, np) = (
            first.inputs.channels(),
            first.outputs.channels(),
            first.scheduling.channels(),
        );
        if let Some(&value) = noise.iter().find(|s| !(s.is_finite() && **s > 0.0)) {
            return Err(FitError::Setting {
                name: "noise",
                value,
                allowed: "give a deviation above zero for each output",
            });
        }
        let fits = |what, expected, found| {
            if expected == found {
                Ok(())
            } else {
                Err(FitError::Core(CoreError::Dimension {
                    what,
                    expected,
                    found,
                }))
            }
        };
        fits("moving records: noise deviations", ny, noise.len())?;
        let feedback = match feedback {
            Some(k) => {
                fits("moving records: inputs of the feedback", ny, k.inputs())?;
                fits("moving records: outputs of the feedback", nu, k.outputs())?;
                k.clone()
            }
            None => StateSpace::gain(DMatrix::zeros(nu, ny), clock)?,
        };
        let records = records.iter().enumerate().map(|(index, record)| {
            record.check()?;
            fits("moving record: inputs", nu, record.inputs.channels())?;
            fits("moving record: outputs", ny, record.outputs.channels())?;
            fits("moving record: scheduling", np, record.scheduling.channels())?;
            if record.len() < 2 {
                return Err(FitError::Empty {
                    what: "samples in a moving record",
                });
            }
            let matrix =
                |columns: &[Vec<f64>]| DMatrix::from_fn(columns.len(), record.len(), |i, k| columns[i][k]);
            let scheduling = matrix(&record.scheduling.columns);
            let outputs = matrix(&record.outputs.columns);
            let at_rest = outputs
                .row_iter()
                .zip(noise)
                .all(|(row, noise)| row[0].abs() <= (REST.0 * noise).max(REST.1 * row.amax()));
            Ok(MovingRecord {
                index,
                inputs: matrix(&record.inputs.columns),
                nodes: SchedulingNodes::new(&scheduling),
                outputs,
                scheduling,
                at_rest,
            })
        });
        Ok(Self {
            clock,
            feedback,
            noise: noise.to_vec(),
            records: records.collect::<Result<_, FitError>>()?,
        })
    }

    /// The clock of the records.
    pub fn clock(&self) -> Discrete {
        self.clock
    }
    /// Deviation of each output's noise.
    pub fn noise(&self) -> &[f64] {
        &self.noise
    }
    /// Number of records.
    #[allow(clippy::len_without_is_empty, reason = "never empty")]
    pub fn len(&self) -> usize {
        self.records.len()
    }
    /// Samples times outputs over all records.
    pub fn equations(&self) -> usize {
        self.records.iter().map(|r| r.outputs.len()).sum()
    }
    /// The first samples of every record.
    pub(crate) fn beginnings(&self, samples: usize) -> Self {
        let records = self.records.iter().map(|record| {
            let length = samples.min(record.len());
            let first = |m: &DMatrix<f64>| m.columns(0, length).into_owned();
            MovingRecord {
                inputs: first(&record.inputs),
                outputs: first(&record.outputs),
                scheduling: first(&record.scheduling),
                ..record.clone()
            }
        });
        Self {
            records: records.collect(),
            noise: self.noise.clone(),
            feedback: self.feedback.clone(),
            ..*self
        }
    }
    /// The same records, every output, input and p divided by its unit.
    pub(crate) fn in_units(
        &self,
        outputs: &[f64],
        inputs: &[f64],
        clock: Discrete,
        places: impl Fn(&[f64]) -> Vec<f64>,
    ) -> Result<Self, FitError> {
        let diagonal = |units: &[f64], factor: fn(f64) -> f64| {
            DMatrix::from_diagonal(&DVector::from_iterator(
                units.len(),
                units.iter().map(|v| factor(*v)),
            ))
        };
        let (y, u) = (diagonal(outputs, |v| v), diagonal(inputs, f64::recip));
        let k = &self.feedback;
        let records = self.records.iter().map(|record| {
            let mut scheduling = record.scheduling.clone();
            for mut column in scheduling.column_iter_mut() {
                column.copy_from_slice(&places(&column.iter().copied().collect::<Vec<_>>()));
            }
            MovingRecord {
                index: record.index,
                inputs: &u * &record.inputs,
                outputs: diagonal(outputs, f64::recip) * &record.outputs,
                nodes: SchedulingNodes::new(&scheduling),
                scheduling,
                at_rest: record.at_rest,
            }
        });
        Ok(Self {
            records: records.collect(),
            feedback: StateSpace::new(k.a().clone(), k.b() * &y, &u * k.c(), &u * k.d() * &y, clock)?,
            noise: self.noise.iter().zip(outputs).map(|(n, y)| n / y).collect(),
            clock,
        })
    }
    pub(crate) fn records(&self) -> &[MovingRecord] {
        &self.records
    }
    pub(crate) fn feedback(&self) -> &StateSpace<Discrete> {
        &self.feedback
    }
}

impl MovingRecord {
    pub(crate) fn len(&self) -> usize {
        self.inputs.ncols()
    }
    /// Middle of the interval after sample `k`, and the step of p over it.
    pub(crate) fn middle(&self, k: usize) -> (DVector<f64>, DVector<f64>) {
        let next = (k + 1).min(self.len() - 1);
        let (here, there) = (self.scheduling.column(k), self.scheduling.column(next));
        ((here + there) * 0.5, there - here)
    }
}
