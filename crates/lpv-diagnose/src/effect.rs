//! What an effect is.

use crate::base::{Base, Forces, Motion, Pair};
use crate::screen::Screen;
use crate::track::Track;
use num_complex::Complex64 as C64;
use serde::{Deserialize, Serialize};
use std::fmt::{self, Debug};

/// Families of effects, as the contract of `diagnosis.json` names them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Family {
    /// Forces against the motion of the guides.
    Friction,
    /// Forces that depend on where a motor is.
    PositionForce,
    /// Force constants.
    Actuator,
    /// When commands act.
    Timing,
    /// Masses and couplings.
    Structure,
    /// Dependence on the scheduling.
    Scheduling,
    /// Forces from outside.
    Disturbance,
    /// What the sensors tell.
    Sensor,
}

impl Family {
    /// The name in `diagnosis.json`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Friction => "friction",
            Self::PositionForce => "position-force",
            Self::Actuator => "actuator",
            Self::Timing => "timing",
            Self::Structure => "structure",
            Self::Scheduling => "scheduling",
            Self::Disturbance => "disturbance",
            Self::Sensor => "sensor",
        }
    }
}

/// How a parameter is fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// As it is; zero is no effect.
    Linear,
    /// As its logarithm.
    Logarithmic,
    /// As its logarithm; a length over which something repeats, and a record must travel all of it to tell.
    Wavelength,
    /// As its logarithm; a time in which something changes, and a record must have samples meanwhile to tell.
    Duration,
    /// As its logarithm; a time of a record at which something changes, and the record must tell what was before and what is after.
    Instant,
    /// As its logarithm; of something that repeats in time, and a record must be longer than its period to tell.
    Frequency,
    /// As it is, and not below zero.
    NotNegative,
    /// As it is; a fit may go below zero, but what it finds there is not this effect.
    Positive,
    /// As it is; no value of it is without effect.
    Free,
    /// Not at all: a number that a start chooses, such as that of a record.
    Chosen,
}

impl Scale {
    /// Whether a fit sees the logarithm.
    pub fn is_logarithm(self) -> bool {
        matches!(
            self,
            Self::Logarithmic | Self::Wavelength | Self::Duration | Self::Instant | Self::Frequency
        )
    }

    /// Whether a fit moves it.
    pub fn is_fitted(self) -> bool {
        self != Self::Chosen
    }

    /// Whether it is that of an amplitude, of which zero is no effect.
    pub(crate) fn is_amplitude(self) -> bool {
        self.is_fitted() && !self.is_logarithm() && self != Self::Free
    }
}

/// One parameter of an effect.
#[derive(Debug, Clone, Copy)]
pub struct EffectParameter {
    /// Name in `diagnosis.json`.
    pub name: &'static str,
    /// Unit; `u`, `y` and `s` stand for the units of the input and of the output of its channel, and of time, `y2` for that of
    /// the second output.
    pub unit: &'static str,
    /// How it is fitted.
    pub scale: Scale,
}

/// How an effect refines another.
#[derive(Debug, Clone, Copy)]
pub struct Extends {
    /// The simpler effect.
    pub name: &'static str,
    /// Starts from the fitted values of the simpler one.
    pub starts: fn(&[f64], &Screen<'_>, Place) -> Vec<Vec<f64>>,
}

/// What an effect sees of a frequency response of a rigid axis.
#[derive(Debug, Clone, Copy)]
pub struct Lines {
    /// Lowest and highest line, Hz.
    pub band_hz: [f64; 2],
    /// Number of outputs.
    pub outputs: usize,
    /// The moved mass.
    pub mass: f64,
}

impl Lines {
    /// Times that turn the highest line a little.
    pub fn short_times(&self) -> Vec<Vec<f64>> {
        [0.01, 0.1].map(|part| vec![part / self.band_hz[1]]).to_vec()
    }
}

/// Starts of an effect on a frequency response.
pub type StartsOnLines = fn(&Lines) -> Vec<Vec<f64>>;

/// Where an effect acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// At what the input of this index drives; where the motors are coupled, the first stands for all.
    Motor(usize),
    /// At what every input drives, all alike, though each drives a motor of its own.
    AllMotors,
    /// At the sensor of the output of this index.
    Output(usize),
}

impl Place {
    /// Index of its channel, or of the first of several.
    #[must_use]
    pub const fn first(self) -> usize {
        match self {
            Self::Motor(i) | Self::Output(i) => i,
            Self::AllMotors => 0,
        }
    }
}

/// What a machine must have for an effect to be there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Needs {
    /// Any machine.
    Nothing,
    /// Two motors, inputs and outputs.
    TwoChannels,
    /// Two motors, which every input drives together.
    CoupledMotors,
    /// An input of this channel that drives a motor of its own.
    OwnMotor(usize),
    /// Two inputs, each of which drives a motor of its own.
    TwoMotors,
    /// An input of this channel that drives a motor of its own, which no spring of the base holds.
    FreeMotor(usize),
    /// An axis that a spring of the base holds to the ground.
    Spring,
    /// A servo axis, whose mass and force at rest are parameters of its own.
    Axis,
    /// The same, and no spring of the base holds it.
    FreeAxis,
    /// A servo axis with a load on a spring.
    Load,
    /// The same, or the masses and couplings of the xy-table from first principles.
    Coupling,
    /// The latter alone.
    Table,
}

impl Needs {
    /// Whether a machine has it.
    fn are_met(&self, base: &Base) -> bool {
        match self {
            Self::Nothing => true,
            Self::TwoChannels => base.channels() > 1,
            Self::CoupledMotors => !base.has_motors_of_their_own(),
            Self::OwnMotor(channel) => base.has_motors_of_their_own() && *channel < base.channels(),
            Self::TwoMotors => base.has_motors_of_their_own() && base.channels() > 1,
            Self::FreeMotor(channel) => Self::OwnMotor(*channel).are_met(base) && !base.is_on_spring(),
            Self::Spring => base.is_on_spring(),
            Self::Load => matches!(base, Base::Axis(axis) if axis.load().is_some()),
            Self::FreeAxis => Self::Axis.are_met(base) && !base.is_on_spring(),
            Self::Axis => matches!(base, Base::Axis(_)),
            Self::Coupling => Self::Load.are_met(base) || Self::Table.are_met(base),
            Self::Table => base.is_table(),
        }
    }
    /// Of what acts at a place and needs no more: where the motors are coupled, those of the first input are all.
    pub(crate) const fn of(place: Place) -> Self {
        match place {
            Place::Motor(0) | Place::Output(0) => Self::Nothing,
            Place::Motor(i) => Self::OwnMotor(i),
            Place::Output(_) => Self::TwoChannels,
            Place::AllMotors => Self::TwoMotors,
        }
    }
}

/// Points from which a fit may start, in the order of the parameters.
pub type Starts = dyn Fn(&Screen<'_>, Place) -> Vec<Vec<f64>> + Send + Sync;
/// The block at given values, on a machine.
pub type Make = dyn Fn(&[f64], &Base, Place) -> Box<dyn Block> + Send + Sync;

/// An entry of the catalogue: what it is called, what it predicts, how it is simulated.
pub struct Effect {
    /// Name in `diagnosis.json`; the same at every place.
    pub name: &'static str,
    /// Family.
    pub family: Family,
    /// Where it acts.
    pub place: Place,
    /// What the machine must have.
    pub needs: Needs,
    /// What it is, in a sentence.
    pub meaning: &'static str,
    /// Its parameters; amplitudes first.
    pub parameters: &'static [EffectParameter],
    /// An effect that this one is a refinement of, and how its values become starts: a refinement is hard to see before the
    /// rough part is fitted.
    pub extends: Option<Extends>,
    /// Points from which to start, in the order of the parameters; none where the base or the data do not know it.
    pub starts: &'static Starts,
    /// The same on a frequency response; none of what a response does not show.
    pub on_response: Option<StartsOnLines>,
    /// The block at given values, on a machine.
    pub block: &'static Make,
}

impl Debug for Effect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} at {:?}", self.name, self.place)
    }
}

impl Effect {
    /// Number of parameters that a fit moves.
    pub fn fitted(&self) -> usize {
        self.parameters.iter().filter(|p| p.scale.is_fitted()).count()
    }
    /// Whether it is the same effect at the same place, in the same form.
    pub fn is(&self, other: &Self) -> bool {
        let names = |e: &Self| e.parameters.iter().map(|p| p.name);
        self.is_called(other) && names(self).eq(names(other))
    }
    /// Whether it is the same effect at the same place, in any form.
    pub fn is_called(&self, other: &Self) -> bool {
        self.name == other.name && self.place == other.place
    }
    /// Whether it refines another, or the simpler form of its own.
    pub fn refines(&self, other: &Self) -> bool {
        let extends = |e: Extends| e.name == other.name;
        self.place == other.place && self.extends.is_some_and(extends) && !self.is(other)
    }
    /// Whether a machine has what the effect acts on.
    pub fn suits(&self, base: &Base) -> bool {
        self.needs.are_met(base)
    }
    /// Whether the effect exists with these values, in the order of its parameters.
    pub fn allows(&self, values: &[f64]) -> bool {
        let fits = |(v, p): (&f64, &EffectParameter)| {
            v.is_finite()
                && match p.scale {
                    Scale::Linear | Scale::Free | Scale::Chosen => true,
                    Scale::NotNegative => *v >= 0.0,
                    Scale::Positive => *v > 0.0,
                    scale => scale.is_logarithm() && *v > 0.0,
                }
        };
        values.len() == self.parameters.len() && values.iter().zip(self.parameters).all(fits)
    }
}

/// One instant of a simulation.
pub struct Moment<'a> {
    /// Time from the start of the record.
    pub time: f64,
    /// Scheduling.
    pub p: f64,
    /// Its rate.
    pub rate: f64,
    /// Time of one step of the integration.
    pub step: f64,
    /// Where the machine is.
    pub motion: Motion,
    /// The machine.
    pub machine: &'a Base,
    pub(crate) track: &'a Track,
    pub(crate) sample: usize,
    pub(crate) part: f64,
}

impl Moment<'_> {
    /// Indices of the motors that there are.
    pub fn motors(&self) -> std::ops::Range<usize> {
        0..self.machine.channels()
    }

    /// A further measured signal.
    pub fn auxiliary(&self, signal: usize) -> f64 {
        self.track.auxiliary_at(signal, self.sample, self.part)
    }
}

/// An axis at one complex frequency, as linear effects change it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Path {
    /// Actual force over commanded force.
    pub command: C64,
    /// Force over motion of the motor.
    pub dynamic: C64,
    /// Motion of the load over that of the motor.
    pub follow: C64,
    /// What the sensor of the motor tells over its motion.
    pub sensor: C64,
}

/// An effect in a simulation. Every part does nothing unless it is given.
pub trait Block: Debug + Send + Sync {
    /// Changes the machine before the start.
    fn mount(&self, _machine: &mut Base) {}
    /// States of its own.
    fn states(&self) -> usize {
        0
    }
    /// Their values at the start.
    fn start(&self, _at: &Moment<'_>, _own: &mut [f64]) {}
    /// Adds to the forces, and gives the rates of its states.
    fn act(&self, _at: &Moment<'_>, _own: &[f64], _rates: &mut [f64], _forces: &mut Forces) {}
    /// Changes what the sensors tell.
    fn sense(&self, _at: &Moment<'_>, _own: &[f64], _outputs: &mut Pair) {}
    /// What it does to an axis at the complex frequency s.
    fn respond(&self, _s: C64, _path: &mut Path) {}
    /// Times by which the commands come late, by input.
    fn delay(&self) -> Pair {
        [0.0; 2]
    }
    /// Time constants with which commands act, by motor.
    fn lag(&self) -> Pair {
        [0.0; 2]
    }
}
