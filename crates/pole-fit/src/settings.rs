//! Settings.

use crate::PoleFitError;

/// Highest order that [`PoleFitSettings::check`] accepts.
pub const ORDER_LIMIT: usize = 100;

/// What is known about poles at `z = 1`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Integrators {
    /// All poles are estimated, those near `z = 1` too.
    #[default]
    Free,
    /// The denominator has the exact factor `(z - 1)^k`.
    Fixed(usize),
}

/// Degree of the numerators.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum NumeratorDegree {
    /// Degree up to that of the denominator: there may be a direct feed-through.
    #[default]
    Proper,
    /// One degree less. Right for a sampled plant behind a zero-order hold.
    StrictlyProper,
}

/// What a residual is measured against.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Weighting {
    /// The Kronecker covariance of the estimate: maximum likelihood for circular normal errors.
    #[default]
    Covariance,
    /// Its diagonal only, channel by channel.
    DiagonalCovariance,
    /// The size of the response: row `i` of line `k` is divided by `||F_i(k)||`, whatever the unit of output `i`.
    Relative,
    /// Weight one for each channel and line.
    Uniform,
}

impl Weighting {
    /// Whether the size of the noise is in the weights, so that a cost has an expectation.
    pub(crate) fn knows_noise(self) -> bool {
        matches!(self, Self::Covariance | Self::DiagonalCovariance)
    }
}

/// How to fit. What takes them checks every field against this table.
///
/// | field | default | meaning | range |
/// |---|---|---|---|
/// | `order` | none | degree of the denominator, fixed integrators included | k, at least 1 if strictly proper, to 100 |
/// | `integrators` | `Free` | known poles at `z = 1` | `Free`, `Fixed(k)` |
/// | `numerator` | `Proper` | degree of the numerators | |
/// | `band` | `None` | lines used, Hz, both limits included | `0 <= lower < upper` |
/// | `weighting` | `Covariance` | what a residual is measured against | |
/// | `delay_samples` | 0 | known delay: the response fitted is `z^-d B / a` | below 1e6 |
/// | `smoothing_lines` | 0 | `C_V` is averaged over this many lines to each side | 0 to 1000 |
/// | `relative_floor` | 1e-9 | deviations are taken to be at least this part of the response | 1e-14 to 0.1 |
/// | `rigid_body_hz` | `None` | with `Free`: poles below this natural frequency are not flexible; `None`: see [`crate::PoleFit::flexible_poles`] | above 0 |
/// | `start_iterations` | 12 | reweighted total least squares before the search | 1 to 1000 |
/// | `max_iterations` | 60 | Gauss-Newton iterations | 0 to 10000 |
/// | `keep_stable` | false | a search that begins with all poles inside the unit circle takes no step that moves one out | |
/// | `several_starts` | true | where the first start leaves more than noise, vector fits start the search too | |
/// | `tolerance` | 1e-3 | the search ends when a step is below this part of a standard deviation | 0 to 0.1, 0 excluded |
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoleFitSettings {
    /// Degree of the denominator, fixed integrators included.
    pub order: usize,
    /// Known poles at `z = 1`.
    pub integrators: Integrators,
    /// Degree of the numerators.
    pub numerator: NumeratorDegree,
    /// Lines used, Hz, both limits included.
    pub band: Option<(f64, f64)>,
    /// What a residual is measured against.
    pub weighting: Weighting,
    /// Known delay of the response in samples.
    pub delay_samples: usize,
    /// `C_V` is averaged over this many lines to each side.
    pub smoothing_lines: usize,
    /// Least standard deviation of a row of the response, relative to the row.
    pub relative_floor: f64,
    /// Limit between rigid-body and flexible poles with free integrators, Hz.
    pub rigid_body_hz: Option<f64>,
    /// Most iterations of the start.
    pub start_iterations: usize,
    /// Most Gauss-Newton iterations.
    pub max_iterations: usize,
    /// Whether a search that begins with stable poles keeps them so.
    pub keep_stable: bool,
    /// Whether other starts are tried where the first leaves more than noise.
    pub several_starts: bool,
    /// Length of a step, in standard deviations, at which the search ends.
    pub tolerance: f64,
}

impl PoleFitSettings {
    pub(crate) fn fixed_integrators(&self) -> usize {
        match self.integrators {
            Integrators::Free => 0,
            Integrators::Fixed(k) => k,
        }
    }

    /// The defaults at an order.
    #[must_use]
    pub fn new(order: usize) -> Self {
        Self {
            order,
            integrators: Integrators::default(),
            numerator: NumeratorDegree::default(),
            band: None,
            weighting: Weighting::default(),
            delay_samples: 0,
            smoothing_lines: 0,
            relative_floor: 1e-9,
            rigid_body_hz: None,
            start_iterations: 12,
            max_iterations: 60,
            keep_stable: false,
            several_starts: true,
            tolerance: 1e-3,
        }
    }
    /// Checks every field against the table above.
    ///
    /// # Errors
    /// [`PoleFitError::Order`], [`PoleFitError::Setting`].
    pub fn check(&self) -> Result<(), PoleFitError> {
        let integrators = match self.integrators {
            Integrators::Free => 0,
            Integrators::Fixed(k) => k,
        };
        let least = match self.numerator {
            // A constant.
            NumeratorDegree::Proper => integrators,
            NumeratorDegree::StrictlyProper => integrators.max(1),
        };
        if self.order < least || self.order > ORDER_LIMIT {
            return Err(PoleFitError::Order {
                order: self.order,
                integrators,
                limit: ORDER_LIMIT,
            });
        }
        let range = |name, value: f64, inside: bool, allowed| {
            if inside {
                Ok(())
            } else {
                Err(PoleFitError::Setting { name, value, allowed })
            }
        };
        if let Some((lower, upper)) = self.band {
            let lower_is_good = lower.is_finite() && lower >= 0.0;
            range(
                "band.0",
                lower,
                lower_is_good,
                "give a finite frequency, not negative",
            )?;
            let upper_is_good = upper.is_finite() && upper > lower;
            range(
                "band.1",
                upper,
                upper_is_good,
                "give a finite frequency above the lower limit",
            )?;
        }
        if let Some(limit) = self.rigid_body_hz {
            let good = limit.is_finite() && limit > 0.0;
            range("rigid_body_hz", limit, good, "give a finite frequency above 0")?;
        }
        let delay = self.delay_samples as f64;
        range("delay_samples", delay, delay < 1e6, "give less than 1e6")?;
        let smoothing = self.smoothing_lines;
        range(
            "smoothing_lines",
            smoothing as f64,
            smoothing <= 1000,
            "give 0 to 1000",
        )?;
        let floor = self.relative_floor;
        let good = (1e-14..=0.1).contains(&floor);
        range("relative_floor", floor, good, "give 1e-14 to 0.1")?;
        let start = self.start_iterations;
        let good = (1..=1000).contains(&start);
        range("start_iterations", start as f64, good, "give 1 to 1000")?;
        let most = self.max_iterations;
        range("max_iterations", most as f64, most <= 10_000, "give 0 to 10000")?;
        let tolerance = self.tolerance;
        let good = tolerance > 0.0 && tolerance <= 0.1;
        range("tolerance", tolerance, good, "give above 0, at most 0.1")?;
        Ok(())
    }
}
