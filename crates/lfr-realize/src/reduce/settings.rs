//! Settings of a reduction: unchecked as written, checked once.

use crate::settings::range;
use crate::{CheckedRefineSettings, DeltaReach, GainFit, RealizeError, RefineSettings, ResidualUnit};

/// How to reduce. Fields are unchecked; [`ReduceSettings::check`] gives what [`crate::reduce`] accepts.
///
/// | field | default | meaning | range |
/// |---|---|---|---|
/// | `positions` | `None` | grid points a parameter of the fit; `None`: 21 for one parameter, 7 for two, 5 for three, 3 beyond | 2 to 1001 |
/// | `lines` | 160 | equidistant lines up to Nyquist; more are set around the poles of each position | 1 or more |
/// | `refine` | those of [`RefineSettings`] | the last fit, on all lines | |
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReduceSettings {
    /// Grid points a parameter.
    pub positions: Option<usize>,
    /// Equidistant lines.
    pub lines: usize,
    /// The last fit.
    pub refine: RefineSettings,
}

impl Default for ReduceSettings {
    fn default() -> Self {
        Self {
            positions: None,
            lines: 160,
            refine: RefineSettings::default(),
        }
    }
}

impl ReduceSettings {
    /// The defaults.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }
    /// Sets the grid points a parameter.
    #[must_use]
    pub fn positions(mut self, positions: usize) -> Self {
        self.positions = Some(positions);
        self
    }
    /// Sets the equidistant lines.
    #[must_use]
    pub fn lines(mut self, lines: usize) -> Self {
        self.lines = lines;
        self
    }
    /// Sets the last fit.
    #[must_use]
    pub fn refine(mut self, refine: RefineSettings) -> Self {
        self.refine = refine;
        self
    }
    /// Checks every field against the table above.
    ///
    /// # Errors
    /// [`RealizeError::Setting`].
    pub fn check(self) -> Result<CheckedReduceSettings, RealizeError> {
        if let Some(positions) = self.positions {
            let good = (2..=1001).contains(&positions);
            range("positions", positions as f64, good, "give 2 to 1001")?;
        }
        range("lines", self.lines as f64, self.lines > 0, "give 1 or more")?;
        Ok(CheckedReduceSettings {
            refine: self.refine.check()?,
            settings: self,
        })
    }
}

/// Settings that passed [`ReduceSettings::check`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CheckedReduceSettings {
    settings: ReduceSettings,
    pub(super) refine: CheckedRefineSettings,
}

impl CheckedReduceSettings {
    /// The settings, to be read.
    #[must_use]
    pub fn get(&self) -> &ReduceSettings {
        &self.settings
    }
    pub(super) fn positions(&self, parameters: usize) -> usize {
        self.settings.positions.unwrap_or(match parameters {
            0 | 1 => 21,
            2 => 7,
            3 => 5,
            _ => 3,
        })
    }
}

/// How to fit from coherent local models. Fields are unchecked; [`CoherentSettings::check`] gives what
/// [`crate::coherent`] accepts.
///
/// | field | default | meaning | range |
/// |---|---|---|---|
/// | `lines` | 40 | lines a position of the quick fit of each start | 1 or more |
/// | `start_iterations` | 60 | most iterations of a quick fit | 1 to 100000 |
/// | `reach` | `States` | whether D21 is free | |
/// | `gain` | `Fixed` | whether the fits of all positions move the gain of the rigid body | |
/// | `target` | `None` | rms residual at which no further start is needed; `None`: 3e-5 relative, 1.1 standard deviations | above 0 |
/// | `refine` | those of [`RefineSettings`] | the long fit | |
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoherentSettings {
    /// Lines a position of the quick fits.
    pub lines: usize,
    /// Most iterations of a quick fit.
    pub start_iterations: usize,
    /// Whether D21 is free.
    pub reach: DeltaReach,
    /// Whether the gain of the rigid body is free.
    pub gain: GainFit,
    /// Rms residual at which no further start is needed.
    pub target: Option<f64>,
    /// The long fit.
    pub refine: RefineSettings,
}

impl Default for CoherentSettings {
    fn default() -> Self {
        Self {
            lines: 40,
            start_iterations: 60,
            reach: DeltaReach::default(),
            gain: GainFit::default(),
            target: None,
            refine: RefineSettings::default(),
        }
    }
}

impl CoherentSettings {
    /// The defaults.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }
    /// Sets the lines a position of the quick fits.
    #[must_use]
    pub fn lines(mut self, lines: usize) -> Self {
        self.lines = lines;
        self
    }
    /// Sets the most iterations of a quick fit.
    #[must_use]
    pub fn start_iterations(mut self, iterations: usize) -> Self {
        self.start_iterations = iterations;
        self
    }
    /// Sets whether D21 is free.
    #[must_use]
    pub fn reach(mut self, reach: DeltaReach) -> Self {
        self.reach = reach;
        self
    }
    /// Sets whether the gain of the rigid body is free.
    #[must_use]
    pub fn gain(mut self, gain: GainFit) -> Self {
        self.gain = gain;
        self
    }
    /// Sets the rms residual at which no further start is needed.
    #[must_use]
    pub fn target(mut self, rms: f64) -> Self {
        self.target = Some(rms);
        self
    }
    /// Sets the long fit.
    #[must_use]
    pub fn refine(mut self, refine: RefineSettings) -> Self {
        self.refine = refine;
        self
    }
    /// Checks every field against the table above.
    ///
    /// # Errors
    /// [`RealizeError::Setting`].
    pub fn check(self) -> Result<CheckedCoherentSettings, RealizeError> {
        range("lines", self.lines as f64, self.lines > 0, "give 1 or more")?;
        let most = self.start_iterations;
        let good = (1..=100_000).contains(&most);
        range("start_iterations", most as f64, good, "give 1 to 100000")?;
        if let Some(target) = self.target {
            let good = target.is_finite() && target > 0.0;
            range("target", target, good, "give a finite number above 0")?;
        }
        Ok(CheckedCoherentSettings {
            refine: self.refine.check()?,
            settings: self,
        })
    }
}

/// Settings that passed [`CoherentSettings::check`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CheckedCoherentSettings {
    settings: CoherentSettings,
    pub(super) refine: CheckedRefineSettings,
}

impl CheckedCoherentSettings {
    /// The settings, to be read.
    #[must_use]
    pub fn get(&self) -> &CoherentSettings {
        &self.settings
    }
    pub(super) fn target(&self, unit: ResidualUnit) -> f64 {
        self.settings.target.unwrap_or(match unit {
            ResidualUnit::Relative => 3e-5,
            ResidualUnit::StandardDeviation => 1.1,
        })
    }
}
