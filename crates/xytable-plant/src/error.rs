//! What this crate refuses, with the facts in fields.

use lpv_core::CoreError;

/// Every refusal of this crate. The text says what is wrong, where, and what to do.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlantError {
    /// A machine parameter or a setting is outside its range.
    #[error("{field} = {value}: {problem}")]
    Setting {
        /// Name of the field.
        field: &'static str,
        /// The value given.
        value: f64,
        /// What is wrong and what to give instead.
        problem: &'static str,
    },
    /// A position that the carriage cannot reach.
    #[error(
        "position {position} m is outside the stroke [-{half_stroke_m}, {half_stroke_m}] m; choose one inside"
    )]
    Position {
        /// The position asked for.
        position: f64,
        /// Half the stroke of the machine.
        half_stroke_m: f64,
    },
    /// The carriage left its stroke during a simulation.
    #[error(
        "at sample {sample} the carriage reached {position} m, outside the stroke [-{half_stroke_m}, {half_stroke_m}] m; \
         shorten or slow down the setpoint of x1"
    )]
    LeftStroke {
        /// Sample, from 0.
        sample: usize,
        /// Position reached.
        position: f64,
        /// Half the stroke of the machine.
        half_stroke_m: f64,
    },
    /// A signal or list has the wrong length.
    #[error("{what}: expected {expected} entries, found {found}")]
    Length {
        /// The signal or list.
        what: &'static str,
        /// What the rest asks for.
        expected: usize,
        /// What was given.
        found: usize,
    },
    /// A signal has an entry that is NaN or infinite.
    #[error("{what}: entry {index} is not a finite number; remove or repair it")]
    NotFinite {
        /// The signal.
        what: &'static str,
        /// Index, from 0.
        index: usize,
    },
    /// A multisine line that the period does not have, or that is listed twice.
    #[error(
        "multisine line {line} at index {index} of the list: lines are strictly increasing, from 1 to {highest}"
    )]
    Line {
        /// Index in the list, from 0.
        index: usize,
        /// The line, in cycles a period.
        line: usize,
        /// The highest line that is allowed.
        highest: usize,
    },
    /// A multisine without any line.
    #[error(
        "a multisine of period {period} has no line left with these settings; use a longer period or more lines"
    )]
    NoLines {
        /// Samples a period.
        period: usize,
    },
    /// A loop whose sampled closed loop is not stable over the whole stroke.
    #[error(
        "closed loop not stable at p = {position} m: spectral radius {spectral_radius:.6}; lower the bandwidth or raise the sample rate"
    )]
    NotStable {
        /// Worst position.
        position: f64,
        /// Spectral radius there.
        spectral_radius: f64,
    },
    /// A loop that is stable but too close to instability.
    #[error(
        "closed loop not robust: largest sensitivity {sensitivity:.3} at p = {position} m, {frequency_hz} Hz, \
         is above {limit}; lower the bandwidth or allow more"
    )]
    NotRobust {
        /// Largest singular value of the sensitivity.
        sensitivity: f64,
        /// Worst position.
        position: f64,
        /// Worst frequency.
        frequency_hz: f64,
        /// Largest value allowed.
        limit: f64,
    },
    /// A controller with more states than the simulation kernel holds.
    #[error("controller {index} has order {order}; the simulation holds orders up to {most}, reduce it")]
    ControllerOrder {
        /// Which controller, from 0.
        index: usize,
        /// Its order.
        order: usize,
        /// Largest order.
        most: usize,
    },
    /// A simulation whose signals are no longer finite.
    #[error("the simulation diverged before sample {sample}; verify the controller for this machine")]
    Diverged {
        /// Sample, from 0.
        sample: usize,
    },
    /// Sub-steps were doubled to the limit without reaching the tolerance.
    #[error(
        "integration: two runs still differ by {difference:e} with {substeps} sub-steps a sample, tolerance {tolerance:e}; \
         raise the tolerance, shorten the sample time, or weaken a hidden effect that the loop cannot hold"
    )]
    Integration {
        /// Largest difference of an output between the last two runs.
        difference: f64,
        /// Sub-steps a sample of the last run.
        substeps: usize,
        /// Tolerance asked for.
        tolerance: f64,
    },
    /// Resonances too fast for the sample time.
    #[error(
        "integration, sample {sample}: the resonances of the machine are too fast for its sample time, even in 1024 parts; lower \
         stiffnesses and dampings, raise masses, or shorten the sample time"
    )]
    Stiff {
        /// The sample.
        sample: usize,
    },
    /// A hidden effect that does not exist.
    #[error("there is no effect `{name}`; nearest: `{nearest}`; there are {known}")]
    UnknownEffect {
        /// The name given.
        name: String,
        /// The most similar name.
        nearest: &'static str,
        /// All names.
        known: String,
    },
    /// A severity that is no number or out of range.
    #[error("{name}={value}: give a number from {least} to {most} {unit} ({meaning})")]
    Severity {
        /// The effect.
        name: &'static str,
        /// What was given.
        value: String,
        /// Least severity.
        least: f64,
        /// Largest severity.
        most: f64,
        /// Its unit.
        unit: &'static str,
        /// What it is.
        meaning: &'static str,
    },
    /// One effect asked for twice.
    #[error("effect `{name}` is given twice; give it once, with the severity meant")]
    EffectTwice {
        /// The effect.
        name: &'static str,
    },
    /// Effects in a loop with a continuous controller.
    #[error("hidden effects need the digital loop; choose the digital loop or leave the effects out")]
    EffectsNeedDigitalLoop,
    /// A refusal of lpv-core.
    #[error(transparent)]
    Core(#[from] CoreError),
    /// A refusal of the Fourier transform; its text says which length did not fit.
    #[error("Fourier transform of a multisine: {message}")]
    Fourier {
        /// What the transform said.
        message: String,
    },
}

impl From<realfft::FftError> for PlantError {
    fn from(error: realfft::FftError) -> Self {
        Self::Fourier {
            message: error.to_string(),
        }
    }
}

/// Accepts finite numbers above zero.
pub(crate) fn positive(field: &'static str, value: f64) -> Result<(), PlantError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(PlantError::Setting {
            field,
            value,
            problem: "give a finite number above zero",
        })
    }
}

/// Accepts finite numbers that are not negative.
pub(crate) fn not_negative(field: &'static str, value: f64) -> Result<(), PlantError> {
    if value.is_finite() && value >= 0.0 {
        Ok(())
    } else {
        Err(PlantError::Setting {
            field,
            value,
            problem: "give a finite number that is not negative",
        })
    }
}

/// Accepts signals without NaN or infinity.
pub(crate) fn finite(what: &'static str, samples: &[f64]) -> Result<(), PlantError> {
    match samples.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(index) => Err(PlantError::NotFinite { what, index }),
    }
}
