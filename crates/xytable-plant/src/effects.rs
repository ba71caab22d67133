//! What may be wrong with a real machine: effects that are hidden in the simulation, one file a family.
//!
//! An effect acts where it lives: on the commands, the motor forces, the bodies or the sensors, at every stage of the
//! integration. Decoupling, controllers and feed-forward stay those of the nominal machine, which knows nothing of it.
//! To add one: implement [`Effect`] and add an [`EffectInfo`] to the list of its family.

mod actuator;
mod disturbance;
mod friction;
mod position_force;
mod scheduling;
mod sensor;
mod structure;
mod timing;

pub use scheduling::second_signal;

use crate::mechanics::State;
use crate::{MachineParameters, PlantError, split_seed};
use std::f64::consts::TAU;
use std::fmt;
use std::str::FromStr;

/// The families in the order of the signal path, which is the order in which effects act on a force or an output.
const FAMILIES: [&[EffectInfo]; 8] = [
    timing::EFFECTS,
    actuator::EFFECTS,
    friction::EFFECTS,
    position_force::EFFECTS,
    structure::EFFECTS,
    scheduling::EFFECTS,
    disturbance::EFFECTS,
    sensor::EFFECTS,
];

/// Which records of a bundle have an effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Since {
    /// All: the effect was there when the grid was measured.
    Grid,
    /// Only the moves: something was changed after the grid was measured.
    Moves,
}

/// One effect that can be hidden.
///
/// Severities of forces are in m/s²: the force along y on the rigid machine over its mass, in the unit of u'_1. Both
/// motors or guides take half of it.
#[derive(Debug, Clone, Copy)]
pub struct EffectInfo {
    /// Name, as `lpv diagnose` writes it.
    pub name: &'static str,
    /// Family.
    pub family: &'static str,
    /// Unit of the severity; empty for a plain number.
    pub unit: &'static str,
    /// What the severity is.
    pub meaning: &'static str,
    /// Severity without a value: shows 30 to 100 times above the noise of y' in closed loop on the default moves; the lag,
    /// where less would make the integration stiff, 1200 times.
    pub default: f64,
    /// Least and largest severity.
    pub range: [f64; 2],
    /// Which records have it.
    pub since: Since,
    pub(crate) make: fn(f64, &MachineParameters, Shape) -> Box<dyn Effect>,
}

/// An effect with its severity, from `"name"` or `"name=severity"`.
#[derive(Debug, Clone, Copy)]
pub struct HiddenEffect {
    info: &'static EffectInfo,
    severity: f64,
    shape: Shape,
}

/// What a severity does not say: pitches, phases, frequencies, time constants. The usual ones, or drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Shape(Option<u64>);

impl Shape {
    /// The usual value, or one between two bounds, uniform in its logarithm.
    pub(crate) fn pick(self, what: &str, usual: f64, [least, most]: [f64; 2]) -> f64 {
        self.0
            .map_or(usual, |seed| least * (most / least).powf(part(seed, what)))
    }
    /// The usual phase, or any, rad.
    pub(crate) fn phase(self, what: &str, usual: f64) -> f64 {
        self.0.map_or(usual, |seed| TAU * part(seed, what))
    }
}

/// Uniform from zero to one.
fn part(seed: u64, what: &str) -> f64 {
    (split_seed(seed, what) >> 11) as f64 / (1_u64 << 53) as f64
}

impl HiddenEffect {
    /// All effects that exist, in the order of the signal path.
    pub fn catalogue() -> impl Iterator<Item = &'static EffectInfo> {
        FAMILIES.into_iter().flatten()
    }
    /// What it is.
    pub fn info(&self) -> &'static EffectInfo {
        self.info
    }
    /// How strong it is, in the unit of its [`EffectInfo`].
    pub fn severity(&self) -> f64 {
        self.severity
    }
    /// The same effect with another severity.
    ///
    /// # Errors
    /// [`PlantError::Severity`].
    pub fn with_severity(self, severity: f64) -> Result<Self, PlantError> {
        let Self { info, shape, .. } = self;
        if !(info.range[0]..=info.range[1]).contains(&severity) {
            return Err(info.refuse(&severity.to_string()));
        }
        Ok(Self {
            info,
            severity,
            shape,
        })
    }
    /// The same severity with pitches, phases, frequencies and time constants drawn from a seed.
    #[must_use]
    pub fn varied(self, seed: u64) -> Self {
        let seed = split_seed(seed, self.info.name);
        Self {
            shape: Shape(Some(seed)),
            ..self
        }
    }
    /// Its numbers by name, severity and shape, in SI units, forces over the mass as in [`EffectInfo`].
    pub fn facts(&self, machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        self.make(machine).facts(machine)
    }
    pub(crate) fn make(&self, machine: &MachineParameters) -> Box<dyn Effect> {
        (self.info.make)(self.severity, machine, self.shape)
    }

    /// In the order of the signal path, so that the order of asking does not matter.
    pub(crate) fn in_order(effects: &[Self]) -> Result<Vec<Self>, PlantError> {
        let mut ordered = Vec::with_capacity(effects.len());
        for info in Self::catalogue() {
            let mut same = effects.iter().filter(|e| e.info.name == info.name);
            ordered.extend(same.next());
            if same.next().is_some() {
                return Err(PlantError::EffectTwice { name: info.name });
            }
        }
        Ok(ordered)
    }
}

impl PartialEq for HiddenEffect {
    fn eq(&self, other: &Self) -> bool {
        self.info.name == other.info.name && self.severity == other.severity && self.shape == other.shape
    }
}

impl fmt::Display for HiddenEffect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.info.name, self.severity)
    }
}

impl FromStr for HiddenEffect {
    type Err = PlantError;

    /// # Errors
    /// [`PlantError::UnknownEffect`] with the names that exist, [`PlantError::Severity`].
    fn from_str(text: &str) -> Result<Self, PlantError> {
        let (name, value) = match text.split_once('=') {
            Some((name, value)) => (name.trim(), Some(value.trim())),
            None => (text.trim(), None),
        };
        let info = Self::catalogue()
            .find(|info| info.name == name)
            .ok_or_else(|| unknown(name))?;
        let plain = Self {
            info,
            severity: info.default,
            shape: Shape(None),
        };
        let Some(value) = value else { return Ok(plain) };
        let severity = value.parse().map_err(|_| info.refuse(value))?;
        plain.with_severity(severity)
    }
}

impl EffectInfo {
    fn refuse(&self, value: &str) -> PlantError {
        PlantError::Severity {
            name: self.name,
            value: value.to_owned(),
            least: self.range[0],
            most: self.range[1],
            unit: self.unit,
            meaning: self.meaning,
        }
    }
}

fn unknown(name: &str) -> PlantError {
    let known: Vec<&str> = HiddenEffect::catalogue().map(|info| info.name).collect();
    let nearest = known
        .iter()
        // The beginning of a name means that name, however long the rest is.
        .map(|known| {
            let begins = !name.is_empty() && known.starts_with(name);
            (!begins, strsim::damerau_levenshtein(name, known), *known)
        })
        .min()
        .map_or("", |(.., known)| known);
    PlantError::UnknownEffect {
        name: name.to_owned(),
        nearest,
        known: known.join(", "),
    }
}

/// Where an effect finds the machine.
pub(crate) struct Moment<'a> {
    /// Time from the start of the record.
    pub(crate) time: f64,
    /// Positions `[x1, y1, R1, y2, R2]` and then their rates.
    pub(crate) state: &'a State,
    /// The machine with what is mounted on it.
    pub(crate) machine: &'a MachineParameters,
}

impl Moment<'_> {
    /// Coordinates of the left and the right motor along y.
    pub(crate) fn motor_positions(&self) -> [f64; 2] {
        self.ends(3)
    }
    /// Speeds of the left and the right motor.
    pub(crate) fn motor_speeds(&self) -> [f64; 2] {
        self.ends(8)
    }
    fn ends(&self, at: usize) -> [f64; 2] {
        let turn = self.machine.half_beam_m * self.state[at + 1];
        [self.state[at] - turn, self.state[at] + turn]
    }
    /// Of the coupling between carriage and beam in y.
    pub(crate) fn deflection(&self) -> f64 {
        let [p, y1, _, y2, turn, ..] = *self.state;
        y1 - y2 - p * turn
    }
    /// Its rate, that of p left out as in (8).
    pub(crate) fn deflection_rate(&self) -> f64 {
        let x = self.state;
        x[6] - x[8] - x[0] * x[9]
    }
}

/// Forces at one stage of the integration.
pub(crate) struct Forces {
    /// Of the left and the right motor, N. An effect of the drive replaces what comes to it.
    pub(crate) motors: [f64; 2],
    /// On the coordinates `[x1, y1, R1, y2, R2]`, N and N m; effects add to it.
    pub(crate) bodies: [f64; 5],
}

impl Forces {
    /// Adds forces on the two ends of the beam, where motors and guides are.
    pub(crate) fn push_ends(&mut self, machine: &MachineParameters, [left, right]: [f64; 2]) {
        self.bodies[3] += left + right;
        self.bodies[4] += machine.half_beam_m * (right - left);
    }
    /// Adds a force of the coupling in y, positive where it pulls the carriage back.
    pub(crate) fn pull_coupling(&mut self, at: &Moment<'_>, pull: f64) {
        self.bodies[1] -= pull;
        self.bodies[3] += pull;
        self.bodies[4] += at.state[0] * pull;
    }
}

/// An effect at work; each method has a default that does nothing.
pub(crate) trait Effect: fmt::Debug + Send + Sync {
    /// Changes masses and the like.
    fn mount(&self, _machine: &mut MachineParameters) {}
    /// Time from a command to the motors.
    fn delay(&self) -> f64 {
        0.0
    }
    /// First values of its own states; their number is that of the states.
    fn start(&self, _machine: &State) -> Vec<f64> {
        Vec::new()
    }
    /// Rates of its own states, all of them, and forces.
    fn act(&self, _at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], _forces: &mut Forces) {}
    /// What the sensors read, before their noise.
    fn sense(&self, _at: &Moment<'_>, _outputs: &mut [f64; 2]) {}
    /// Steps to which the readings are rounded after the noise.
    fn resolution(&self) -> Option<[f64; 2]> {
        None
    }
    /// See [`HiddenEffect::facts`].
    fn facts(&self, _machine: &MachineParameters) -> Vec<(&'static str, f64)> {
        Vec::new()
    }
}

/// Force of each of two motors or guides for a severity in m/s².
fn half_force(severity: f64, machine: &MachineParameters) -> f64 {
    0.5 * severity * (machine.carriage_mass_kg + machine.beam_mass_kg)
}

/// The other way round.
fn severity_of(half_force: f64, machine: &MachineParameters) -> f64 {
    half_force / (0.5 * (machine.carriage_mass_kg + machine.beam_mass_kg))
}

#[cfg(test)]
mod tests;
