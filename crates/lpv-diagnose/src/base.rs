//! Machines that effects are added to: from first principles, and as they were identified.

mod axis;
mod lpv;
mod xy_table;

pub(crate) use axis::RESONANCE;
pub use axis::{Axis, Load};
pub use lpv::Lpv;
pub use xy_table::XyTable;

use crate::TraceError;
use lpv_core::CoreError;
use nalgebra::DMatrix;

/// Most states of a base model and its effects together.
pub(crate) const MOST_STATES: usize = 16;

/// What a simulation asks of a base model.
pub(crate) trait Body {
    /// The state in which outputs begin so, at rest in itself.
    fn begin(&self, p: f64, start: &Start, x: &mut [f64]);
    /// Forces of the motors from the inputs.
    fn commanded(&self, p: f64, u: Pair) -> Pair;
    /// Where the effects find it.
    fn motion(&self, x: &[f64], p: f64) -> Motion;
    /// Rates of its states.
    fn rates(&self, x: &[f64], p: f64, forces: &Forces, rates: &mut [f64]);
    /// What its sensors tell.
    fn outputs(&self, x: &[f64], p: f64) -> Pair;
    /// What is stiff in its rates under these forces; none where their rule copes with it.
    fn stiff(&self, _forces: &Forces) -> Option<Stiff> {
        None
    }
}

/// A number for each motor, or for each channel; axes with one leave the second zero.
pub type Pair = [f64; 2];

/// A base model.
#[derive(Debug, Clone, PartialEq)]
pub enum Base {
    /// Carriage on a beam between two motors.
    XyTable(XyTable),
    /// One servo axis.
    Axis(Axis),
    /// An identified model.
    Lpv(Lpv),
}

/// One parameter of a base model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BaseParameter {
    /// Name.
    pub name: &'static str,
    /// Unit, empty for a plain number; `u`, `y` and `s` stand for the units of input, output and time.
    pub unit: &'static str,
    /// Value.
    pub value: f64,
    /// Whether it is positive, and fitted as a logarithm.
    pub positive: bool,
    /// Whether it is known, and not fitted.
    pub held: bool,
}

/// Motion of the machine at one instant, where effects find it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Motion {
    /// Coordinates of the motors.
    pub motor_position: Pair,
    /// Their rates.
    pub motor_speed: Pair,
    /// Translation and rotation of the load.
    pub load_position: Pair,
    /// Their rates.
    pub load_speed: Pair,
    /// Deflection of the coupling between motor side and load, translation and rotation.
    pub deflection: Pair,
}

/// How the outputs begin.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Start {
    /// Outputs.
    pub(crate) position: Pair,
    /// Their rates.
    pub(crate) speed: Pair,
}

/// Forces of one instant.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Forces {
    /// Of the motors; effects of the drive replace what comes to them, friction adds to it.
    pub motors: Pair,
    /// Force and torque on the load.
    pub load: Pair,
    /// Force and torque of the coupling beside its own, positive where it pulls the load back.
    pub coupling: Pair,
    /// Mass that an axis has more: at its load, where that is not rigidly joined to the motor.
    pub mass: f64,
    /// Dry friction in them, by motor.
    pub(crate) dry: [Dry; 2],
}

/// Dry friction at a motor.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Dry {
    /// The force that it takes, and the largest one.
    pub(crate) force: f64,
    pub(crate) level: f64,
    /// By how much it grows with the speed: here, and at rest.
    pub(crate) slope: f64,
    pub(crate) slope_at_rest: f64,
}

/// A speed that dry friction takes away, and the position whose rate it is.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stiff {
    /// Number of the state.
    pub(crate) position: usize,
    /// Number of the state.
    pub(crate) speed: usize,
    /// How much speed it takes away in a time: here, and at most.
    pub(crate) taken: f64,
    pub(crate) level: f64,
    /// How fast the speed dies out, here and at rest, 1/s.
    pub(crate) rate: f64,
    pub(crate) rate_at_rest: f64,
}

macro_rules! each {
    ($base:expr, $b:ident => $what:expr) => {
        match $base {
            Base::XyTable($b) => $what,
            Base::Axis($b) => $what,
            Base::Lpv($b) => $what,
        }
    };
}

impl Base {
    /// Number of states.
    pub fn states(&self) -> usize {
        match self {
            Self::XyTable(_) => 8,
            Self::Axis(b) => b.states(),
            Self::Lpv(b) => b.states(),
        }
    }
    /// Number of motors, inputs and outputs.
    pub fn channels(&self) -> usize {
        match self {
            Self::XyTable(_) => 2,
            Self::Axis(_) => 1,
            Self::Lpv(b) => b.channels(),
        }
    }
    /// Parts of a sample in which a simulation follows it.
    pub fn parts(&self, step: f64) -> usize {
        match self {
            Self::XyTable(_) => 6,
            Self::Axis(b) => b.parts(step),
            Self::Lpv(b) => b.parts(step),
        }
    }
    /// What it is, in words.
    pub fn name(&self) -> &str {
        match self {
            Self::XyTable(_) => "xy-table from first principles",
            Self::Axis(b) if b.load().is_some() => "motor and load on a spring",
            Self::Axis(b) if b.stiffness().is_some() => "axis on a spring to ground",
            Self::Axis(_) => "servo axis",
            Self::Lpv(b) => b.name(),
        }
    }
    /// Its parameters.
    pub fn parameters(&self) -> Vec<BaseParameter> {
        each!(self, b => b.parameters())
    }
    /// The parameters as the fit sees them: those that are not held, logarithms of positive ones.
    pub fn coordinates(&self) -> Vec<f64> {
        let value = |p: BaseParameter| if p.positive { p.value.ln() } else { p.value };
        self.fitted().map(value).collect()
    }
    /// The parameters that are not held.
    pub fn fitted(&self) -> impl Iterator<Item = BaseParameter> {
        self.parameters().into_iter().filter(|p| !p.held)
    }
    /// The same machine with other coordinates; missing ones stay.
    #[must_use]
    pub fn with_coordinates(&self, coordinates: &[f64]) -> Self {
        let mut coordinates = coordinates.iter();
        let mut value = |p: BaseParameter| match p.held {
            true => p.value,
            false => match coordinates.next() {
                None => p.value,
                Some(c) if p.positive => c.exp(),
                Some(c) => *c,
            },
        };
        let values: Vec<f64> = self.parameters().into_iter().map(&mut value).collect();
        self.with_all(&values)
    }
    /// Adds mass and inertia to the load.
    pub(crate) fn load_more(&mut self, mass: f64, inertia: f64) {
        match self {
            Self::XyTable(b) => {
                b.carriage_mass += mass;
                b.carriage_inertia += inertia;
            }
            Self::Axis(b) => b.mass += mass,
            // Its gains are free.
            Self::Lpv(_) => {}
        }
    }
    pub(crate) fn coupling_stiffness(&self) -> Pair {
        match self {
            Self::XyTable(b) => b.stiffness,
            Self::Axis(axis) => [axis.spring_of_load()[0], 0.0],
            Self::Lpv(_) => [0.0; 2],
        }
    }
    /// Stiffness and damping of the spring between the motor of an axis and its load; none without.
    pub(crate) fn spring_of_load(&self) -> Pair {
        match self {
            Self::Axis(axis) => axis.spring_of_load(),
            Self::XyTable(_) | Self::Lpv(_) => [0.0; 2],
        }
    }
    /// A, B and C of `x' = A x + B u`, `y = C x` at a constant p.
    ///
    /// # Errors
    /// None for a base that exists.
    pub fn frozen(&self, p: f64) -> Result<[DMatrix<f64>; 3], CoreError> {
        Ok(match self {
            Self::XyTable(b) => b.frozen(p),
            Self::Axis(b) => b.frozen(),
            Self::Lpv(b) => {
                let s = b.frozen(p)?;
                [s.a().clone(), s.b().clone(), s.c().clone()]
            }
        })
    }
    /// The same base with other values; parameters that `value` does not know stay.
    #[must_use]
    pub fn with_values(&self, value: impl Fn(&str) -> Option<f64>) -> Self {
        let values: Vec<f64> = self
            .parameters()
            .iter()
            .map(|p| value(p.name).unwrap_or(p.value))
            .collect();
        self.with_all(&values)
    }
    fn with_all(&self, values: &[f64]) -> Self {
        let mut other = self.clone();
        each!(&mut other, b => b.set(values));
        other
    }
    #[inline]
    pub(crate) fn commanded(&self, p: f64, u: Pair) -> Pair {
        each!(self, b => b.commanded(p, u))
    }
    /// Whether it is the table with its couplings.
    pub(crate) fn is_table(&self) -> bool {
        matches!(self, Self::XyTable(_))
    }
    /// Whether it is an axis with a load on a spring.
    pub fn has_load(&self) -> bool {
        matches!(self, Self::Axis(axis) if axis.load().is_some())
    }
    /// Part of an observer's correction that acts on the load, zero where that is rigidly joined to the motor: by the masses, so that it
    /// moves both alike. On the motor alone it would let a spring between encoder and motor swing.
    pub(crate) fn correction_of_load(&self) -> f64 {
        match self {
            Self::Axis(axis) => axis.load().map_or(0.0, |load| load.part),
            Self::XyTable(_) | Self::Lpv(_) => 0.0,
        }
    }
    /// Whether a spring holds it to the ground.
    pub(crate) fn is_on_spring(&self) -> bool {
        matches!(self, Self::Axis(axis) if axis.stiffness().is_some())
    }
    /// Whether each input drives a motor of its own.
    pub fn has_motors_of_their_own(&self) -> bool {
        self.commanded(0.0, [1.0, 0.0])[1] == 0.0 && self.commanded(0.0, [0.0, 1.0])[0] == 0.0
    }
    /// Inputs that do what these motor forces do.
    pub(crate) fn as_input(&self, p: f64, motors: Pair) -> Pair {
        let unit = [self.commanded(p, [1.0, 0.0]), self.commanded(p, [0.0, 1.0])];
        if self.channels() == 1 {
            return [motors[0] / unit[0][0], 0.0];
        }
        let [[a, c], [b, d]] = unit;
        let det = a * d - b * c;
        [
            (d * motors[0] - b * motors[1]) / det,
            (a * motors[1] - c * motors[0]) / det,
        ]
    }
}

/// The machine that a geometry belongs to.
///
/// # Errors
/// [`TraceError::NoBase`] where the geometry is that of neither kind.
pub fn table_from_geometry(
    geometry: &lpv_core::Geometry,
    modes_hz: [f64; 2],
    damping: f64,
) -> Result<XyTable, TraceError> {
    let map = geometry.motor_from_output_matrix();
    if map.shape() != (2, 2) || geometry.force_from_input.len() != 3 {
        return Err(TraceError::NoBase {
            why: "the first-principles xy-table needs a [geometry] with two motors, two inputs and a quadratic force map",
        });
    }
    let t: Vec<DMatrix<f64>> = geometry
        .force_from_input
        .iter()
        .map(|m| DMatrix::from_fn(2, 2, |i, j| m[i][j]))
        .collect();
    XyTable::new(
        [t[0].clone(), t[1].clone(), t[2].clone()],
        [map[(0, 1)], map[(1, 1)]],
        modes_hz,
        damping,
    )
}
