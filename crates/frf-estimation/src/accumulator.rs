//! Periods in, one at a time; averages and scatter kept.

use crate::averages::{Averages, Experiment, Layout};
use crate::moments::{Means, Order, Scatter};
use crate::periodic::PeriodicEstimate;
use crate::spectra::{Spectra, equal, sum};
use crate::waiting::Waiting;
use crate::{FrfError, PeriodicSettings, SkipRule};
use lpv_core::{PeriodBlock, Position};

impl Experiment {
    /// Whether the references are those of the first period, as all before were.
    fn repeats(&self, references: &[Vec<f64>]) -> bool {
        let mut first = self.first_reference.iter().zip(references);
        self.reference_repeats && !self.first_reference.is_empty() && first.all(|(a, b)| equal(a, b))
    }

    /// Averages the references; a period that [repeats](Self::repeats) the first one costs no transform. `used` periods
    /// were taken, this one included.
    fn push_reference(
        &mut self,
        references: &[Vec<f64>],
        waiting: &mut Waiting,
        used: usize,
    ) -> Result<(), FrfError> {
        if self.first_reference.is_empty() {
            self.first_reference = references.to_vec();
            self.reference_moves = references.iter().any(|s| s.iter().any(|v| *v != s[0]));
        } else if self.reference_repeats {
            // The periods before this one were alike and stand for one entry so far: give each its weight.
            if used > 2 {
                waiting.push(self.first_reference.iter())?;
                waiting.average(&mut self.reference, used - 2);
            }
            self.reference_repeats = false;
            self.reference_moves = true;
        }
        waiting.push(references.iter())?;
        waiting.average(&mut self.reference, 1);
        Ok(())
    }
}

/// Streaming estimator for the experiments at one scheduling position.
///
/// Experiments may be interleaved in any order; the periods of an experiment come in order. The order changes results by
/// rounding. Memory does not grow with the number of periods: `2 (n_z + 2 n_r)` numbers a line and experiment,
/// `n_z = n_y + n_u`, `n_z^2` a line for the scatter of all experiments, and up to `4 n_z + 2 n_r` a line for periods on
/// their way, odd numbers of channels rounded up; blocks of lines are filled up, by 520 lines at most. It helps to push the
/// periods of one experiment in a row. The transform of a reference that repeats
/// exactly is computed once an experiment, and skipped periods are not transformed at all.
pub struct PeriodicAccumulator {
    layout: Layout,
    settings: PeriodicSettings,
    position: Option<Position>,
    skip: usize,
    lines: usize,
    /// Periods that wait, all of one experiment.
    waiting: Option<Waiting>,
    waiting_of: usize,
    references: Option<Waiting>,
    scatter: Option<Scatter>,
    experiments: Vec<Option<Experiment>>,
}

impl std::fmt::Debug for PeriodicAccumulator {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PeriodicAccumulator")
            .field("layout", &self.layout)
            .field("position", &self.position)
            .finish_non_exhaustive()
    }
}

impl PeriodicAccumulator {
    /// An accumulator without data. `position`: the constant scheduling values of the experiments.
    ///
    /// # Errors
    /// [`FrfError::Layout`], [`FrfError::TooFewExperiments`], [`FrfError::AutoSkipNeedsRecords`] under
    /// [`SkipRule::Auto`], [`FrfError::Line`] for a line beyond the period.
    pub fn new(
        layout: Layout,
        settings: &PeriodicSettings,
        position: Option<Position>,
    ) -> Result<Self, FrfError> {
        settings.check()?;
        layout.check()?;
        let SkipRule::Fixed(skip) = settings.skip else {
            return Err(FrfError::AutoSkipNeedsRecords);
        };
        let mut values = position.iter().flat_map(|p| p.iter());
        if let Some(&value) = values.find(|v| !v.is_finite()) {
            return Err(FrfError::Layout {
                field: "position",
                value,
                expected: "a finite number",
            });
        }
        let lines = Spectra::lines(layout.period);
        if let crate::LineSelection::List(list) = &settings.lines {
            crate::settings::check_lines(list, lines)?;
        }
        Ok(Self {
            layout,
            settings: settings.clone(),
            position,
            skip,
            lines,
            waiting: None,
            waiting_of: 0,
            references: None,
            scatter: None,
            experiments: (0..layout.experiments).map(|_| None).collect(),
        })
    }

    /// Takes one period of one experiment.
    ///
    /// # Errors
    /// [`FrfError::UnknownExperiment`], [`FrfError::PeriodOrder`], [`FrfError::BlockShape`], [`FrfError::NotFinite`];
    /// the accumulator is then as it was before, but for rounding.
    pub fn push(&mut self, block: &PeriodBlock<'_>) -> Result<(), FrfError> {
        let repeats = self.check(block)?;
        let Layout {
            period,
            outputs,
            inputs,
            references,
            ..
        } = self.layout;
        let nz = outputs + inputs;
        if self.waiting_of != block.experiment {
            self.take_up();
            self.waiting_of = block.experiment;
        }
        let waiting = self.waiting.get_or_insert_with(|| Waiting::new(period, nz));
        let order = waiting.order();
        let experiment = self.experiments[block.experiment].get_or_insert_with(|| Experiment {
            next_period: 0,
            signals: Means::new(nz, order),
            first_reference: Vec::new(),
            reference: Means::new(references, order),
            reference_repeats: true,
            reference_moves: false,
        });
        if block.period < self.skip {
            channels_finite(block)?;
            experiment.next_period += 1;
            return Ok(());
        }
        let finite = waiting.push(block.outputs.iter().chain(block.inputs))?;
        // Finite numbers may be too large to be added up: that is for the end to tell.
        if !finite {
            channels_finite(block).inspect_err(|_| waiting.forget())?;
        }
        experiment.next_period += 1;
        if references > 0 && !repeats {
            let used = experiment.next_period - self.skip;
            let beside = self.references.get_or_insert_with(|| waiting.beside(references));
            experiment.push_reference(block.references, beside, used)?;
        }
        if waiting.is_full() {
            self.take_up();
        }
        Ok(())
    }

    /// Takes up the periods that wait.
    fn take_up(&mut self) {
        let nz = self.layout.outputs + self.layout.inputs;
        if let (Some(experiment), Some(waiting)) = (&mut self.experiments[self.waiting_of], &mut self.waiting)
        {
            let order = waiting.order();
            let scatter = self.scatter.get_or_insert_with(|| Scatter::new(nz, order));
            waiting.take_up(&mut experiment.signals, scatter);
        }
    }

    /// The estimate from all periods.
    ///
    /// # Errors
    /// [`FrfError::TooFewPeriods`], [`FrfError::References`], [`FrfError::NoExcitation`], [`FrfError::Singular`],
    /// [`FrfError::Core`] where numbers overflow.
    pub fn finish(mut self) -> Result<PeriodicEstimate, FrfError> {
        self.take_up();
        let mut experiments = Vec::with_capacity(self.experiments.len());
        for (experiment, data) in self.experiments.into_iter().enumerate() {
            let used = data.as_ref().map_or(0, |d| d.signals.count());
            match data {
                Some(data) if used >= 2 => experiments.push(data),
                _ => {
                    return Err(FrfError::TooFewPeriods {
                        experiment,
                        used,
                        skipped: self.skip,
                    });
                }
            }
        }
        // There are periods, so there is a scatter.
        let nz = self.layout.outputs + self.layout.inputs;
        let order = self
            .waiting
            .as_ref()
            .map_or(Order::Ascending(self.lines), Waiting::order);
        let scatter = self.scatter.unwrap_or_else(|| Scatter::new(nz, order));
        let transforms = [self.waiting, self.references];
        Averages {
            layout: self.layout,
            settings: &self.settings,
            position: self.position.clone(),
            skipped: self.skip,
            lines: self.lines,
            order,
            transforms: transforms.iter().flatten().map(Waiting::transforms).sum(),
            scatter: &scatter,
            experiments: &experiments,
        }
        .estimate()
    }

    /// Whether the references repeat those before. Outputs and inputs may yet hold what is not finite.
    fn check(&self, block: &PeriodBlock<'_>) -> Result<bool, FrfError> {
        let experiment = block.experiment;
        let Some(slot) = self.experiments.get(experiment) else {
            return Err(FrfError::UnknownExperiment {
                experiment,
                experiments: self.layout.experiments,
            });
        };
        let expected = slot.as_ref().map_or(0, |e| e.next_period);
        if block.period != expected {
            return Err(FrfError::PeriodOrder {
                experiment,
                expected,
                found: block.period,
            });
        }
        let groups = [
            ("number of outputs", self.layout.outputs, block.outputs),
            ("number of inputs", self.layout.inputs, block.inputs),
            ("number of references", self.layout.references, block.references),
        ];
        for (count, expected, channels) in groups {
            shape(experiment, count, expected, channels.len())?;
            for samples in channels {
                shape(
                    experiment,
                    "samples of the period",
                    self.layout.period,
                    samples.len(),
                )?;
            }
        }
        // What equals what was finite before is finite.
        let repeats = slot.as_ref().is_some_and(|e| e.repeats(block.references));
        if !repeats {
            all_finite(experiment, "reference", block.references)?;
        }
        Ok(repeats)
    }
}

/// Outputs and inputs are finite.
fn channels_finite(block: &PeriodBlock<'_>) -> Result<(), FrfError> {
    all_finite(block.experiment, "output", block.outputs)?;
    all_finite(block.experiment, "input", block.inputs)
}

fn all_finite(experiment: usize, what: &'static str, channels: &[Vec<f64>]) -> Result<(), FrfError> {
    let mut all = channels.iter().enumerate();
    all.try_for_each(|(channel, samples)| finite(experiment, what, channel, samples))
}

pub(crate) fn shape(
    experiment: usize,
    what: &'static str,
    expected: usize,
    found: usize,
) -> Result<(), FrfError> {
    if expected == found {
        return Ok(());
    }
    Err(FrfError::BlockShape {
        experiment,
        what,
        expected,
        found,
    })
}

pub(crate) fn finite(
    experiment: usize,
    what: &'static str,
    channel: usize,
    samples: &[f64],
) -> Result<(), FrfError> {
    // A sum with something in it that is not finite is not finite either.
    if sum(samples).is_finite() {
        return Ok(());
    }
    match samples.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(sample) => Err(FrfError::NotFinite {
            experiment,
            what,
            channel,
            sample,
        }),
    }
}
