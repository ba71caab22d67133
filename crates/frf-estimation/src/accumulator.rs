//! Periods in, one at a time; averages and scatter kept.

use crate::moments::Moments;
use crate::periodic::{Averages, PeriodicEstimate};
use crate::spectra::{Spectra, sum};
use crate::{CheckedSettings, FrfError, SkipRule};
use lpv_core::PeriodBlock;

/// Shape of the experiments at one scheduling position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layout {
    /// Samples a period, 3 to 2^28.
    pub period: usize,
    /// Plant outputs `n_y`, 1 to 64.
    pub outputs: usize,
    /// Plant inputs `n_u`, 1 to 64.
    pub inputs: usize,
    /// References `n_r`, 0 to 64; 0 where none is recorded.
    pub references: usize,
    /// Experiments `n_e`, `n_u` to 4096; from `2 n_u` on, the groups of `n_u` are taken as realisations.
    pub experiments: usize,
    /// Samples per unit of time, above 0.
    pub sample_rate_hz: f64,
}

impl Layout {
    fn check(&self) -> Result<(), FrfError> {
        let counts = [
            ("period", self.period, 3, 1 << 28, "3 to 268435456"),
            ("outputs", self.outputs, 1, 64, "1 to 64"),
            ("inputs", self.inputs, 1, 64, "1 to 64"),
            ("references", self.references, 0, 64, "0 to 64"),
            ("experiments", self.experiments, 1, 4096, "1 to 4096"),
        ];
        for (field, count, low, high, expected) in counts {
            if !(low..=high).contains(&count) {
                let value = count as f64;
                return Err(FrfError::Layout {
                    field,
                    value,
                    expected,
                });
            }
        }
        // Frequencies are k f_s / N and must neither overflow nor run together.
        if !(self.sample_rate_hz >= 1e-200 && self.sample_rate_hz <= 1e200) {
            return Err(FrfError::Layout {
                field: "sample_rate_hz",
                value: self.sample_rate_hz,
                expected: "1e-200 to 1e200",
            });
        }
        if self.experiments < self.inputs {
            return Err(FrfError::TooFewExperiments {
                experiments: self.experiments,
                inputs: self.inputs,
            });
        }
        Ok(())
    }

    /// Frequency of line `k`.
    pub(crate) fn frequency_hz(&self, k: usize) -> f64 {
        k as f64 * self.sample_rate_hz / self.period as f64
    }
}

/// What is kept of one experiment.
pub(crate) struct Experiment {
    next_period: usize,
    /// Outputs, then inputs.
    pub(crate) moments: Moments,
    /// First period of the references, to see whether the others repeat it.
    first_reference: Vec<f64>,
    pub(crate) reference: Moments,
    reference_repeats: bool,
    pub(crate) reference_moves: bool,
}

impl Experiment {
    /// Averages the references; a period that repeats the first one exactly costs a comparison, not a transform.
    fn push_reference(
        &mut self,
        references: &[Vec<f64>],
        spectra: &mut Spectra,
        planes: &mut [f64],
        (lines, used): (usize, usize),
    ) -> Result<(), FrfError> {
        let size = 2 * references.len() * lines;
        if self.first_reference.is_empty() {
            self.first_reference = references.concat();
            self.reference_moves = references.iter().any(|s| s.iter().any(|v| *v != s[0]));
        } else {
            let first = self.first_reference.chunks_exact(references[0].len());
            let repeats = first.clone().zip(references).all(|(a, b)| a == b);
            if repeats && self.reference_repeats {
                return Ok(());
            }
            if self.reference_repeats {
                // The periods before this one were alike and stand for one entry so far: give each its weight.
                spectra.planes(first, lines, planes)?;
                for _ in 2..used {
                    self.reference.push(&planes[..size]);
                }
                self.reference_repeats = false;
                self.reference_moves = true;
            }
        }
        spectra.planes(references.iter().map(Vec::as_slice), lines, planes)?;
        self.reference.push(&planes[..size]);
        Ok(())
    }
}

/// Streaming estimator for the experiments at one scheduling position.
///
/// Experiments may be interleaved in any order; the periods of an experiment come in order. Memory does not grow with
/// the number of periods: `n_z (n_z + 2) + n_r (n_r + 2)` numbers a line and experiment, `n_z = n_y + n_u`, and `8 n_z` a
/// line for periods that are taken up together; so it helps to push those of one experiment in a row. The transform of a
/// reference that repeats exactly is computed once an experiment, and skipped periods are not transformed at all.
pub struct PeriodicAccumulator {
    layout: Layout,
    settings: CheckedSettings,
    position: Option<f64>,
    skip: usize,
    lines: usize,
    spectra: Option<Spectra>,
    /// Spectra of periods that wait, all of one experiment.
    planes: Vec<f64>,
    waiting: usize,
    waiting_of: usize,
    references: Vec<f64>,
    experiments: Vec<Option<Experiment>>,
}

/// Periods that are taken up together: what is kept of an experiment is larger than the caches, and read and written once for
/// all of them.
const TOGETHER: usize = 4;

impl std::fmt::Debug for PeriodicAccumulator {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PeriodicAccumulator")
            .field("layout", &self.layout)
            .field("position", &self.position)
            .finish_non_exhaustive()
    }
}

impl PeriodicAccumulator {
    /// An accumulator without data. `position`: the constant scheduling value of the experiments.
    ///
    /// # Errors
    /// [`FrfError::Layout`], [`FrfError::TooFewExperiments`], [`FrfError::AutoSkipNeedsRecords`] under
    /// [`SkipRule::Auto`], [`FrfError::Line`] for a line beyond the period.
    pub fn new(layout: Layout, settings: &CheckedSettings, position: Option<f64>) -> Result<Self, FrfError> {
        layout.check()?;
        let SkipRule::Fixed(skip) = settings.get().skip else {
            return Err(FrfError::AutoSkipNeedsRecords);
        };
        if let Some(value) = position.filter(|p| !p.is_finite()) {
            return Err(FrfError::Layout {
                field: "position",
                value,
                expected: "a finite number",
            });
        }
        let lines = Spectra::lines(layout.period);
        if let crate::LineSelection::List(list) = &settings.get().lines {
            crate::settings::check_lines(list, lines)?;
        }
        Ok(Self {
            layout,
            settings: settings.clone(),
            position,
            skip,
            lines,
            spectra: None,
            planes: Vec::new(),
            waiting: 0,
            waiting_of: 0,
            references: Vec::new(),
            experiments: (0..layout.experiments).map(|_| None).collect(),
        })
    }

    /// Takes one period of one experiment.
    ///
    /// # Errors
    /// [`FrfError::UnknownExperiment`], [`FrfError::PeriodOrder`], [`FrfError::BlockShape`], [`FrfError::NotFinite`];
    /// the accumulator is then as it was before.
    pub fn push(&mut self, block: &PeriodBlock<'_>) -> Result<(), FrfError> {
        self.check(block)?;
        let Layout {
            period,
            outputs,
            inputs,
            references,
            ..
        } = self.layout;
        let (lines, nz) = (self.lines, outputs + inputs);
        if self.waiting_of != block.experiment {
            self.take_up();
            self.waiting_of = block.experiment;
        }
        let experiment = self.experiments[block.experiment].get_or_insert_with(|| Experiment {
            next_period: 0,
            moments: Moments::new(nz, lines),
            first_reference: Vec::new(),
            reference: Moments::new(references, lines),
            reference_repeats: true,
            reference_moves: false,
        });
        if block.period < self.skip {
            experiment.next_period += 1;
            return Ok(());
        }
        let spectra = self.spectra.get_or_insert_with(|| Spectra::new(period));
        let size = 2 * nz * lines;
        self.planes.resize(TOGETHER * size, 0.0);
        let channels = block.outputs.iter().chain(block.inputs).map(Vec::as_slice);
        spectra.planes(channels, lines, &mut self.planes[self.waiting * size..])?;
        self.waiting += 1;
        experiment.next_period += 1;
        if references > 0 {
            self.references.resize(2 * references * lines, 0.0);
            let used = experiment.next_period - self.skip;
            experiment.push_reference(block.references, spectra, &mut self.references, (lines, used))?;
        }
        if self.waiting == TOGETHER {
            self.take_up();
        }
        Ok(())
    }

    /// Takes up the periods that wait.
    fn take_up(&mut self) {
        let size = 2 * (self.layout.outputs + self.layout.inputs) * self.lines;
        if let Some(experiment) = &mut self.experiments[self.waiting_of] {
            experiment.moments.push(&self.planes[..self.waiting * size]);
        }
        self.waiting = 0;
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
            let used = data.as_ref().map_or(0, |d| d.moments.count());
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
        Averages {
            layout: self.layout,
            settings: self.settings.get(),
            position: self.position,
            skipped: self.skip,
            lines: self.lines,
            experiments: &experiments,
        }
        .estimate()
    }

    fn check(&self, block: &PeriodBlock<'_>) -> Result<(), FrfError> {
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
            ("output", "number of outputs", self.layout.outputs, block.outputs),
            ("input", "number of inputs", self.layout.inputs, block.inputs),
            (
                "reference",
                "number of references",
                self.layout.references,
                block.references,
            ),
        ];
        for (what, count, expected, channels) in groups {
            shape(experiment, count, expected, channels.len())?;
            for (channel, samples) in channels.iter().enumerate() {
                shape(
                    experiment,
                    "samples of the period",
                    self.layout.period,
                    samples.len(),
                )?;
                finite(experiment, what, channel, samples)?;
            }
        }
        Ok(())
    }
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
