//! What may be hidden in a servo axis, written from physics: forces on the motor, and what drive and encoders do.

/// One effect with its numbers, SI units. Forces act on the motor; positions and speeds are those of the motor.
#[derive(Debug, Clone, PartialEq)]
#[allow(missing_docs, reason = "the sentence on a variant names its numbers")]
pub enum AxisEffect {
    /// Dry friction, N.
    CoulombFriction { level: f64 },
    /// Dry friction of `level + breakaway exp(-(v / speed)^2)`.
    StribeckFriction { level: f64, breakaway: f64, speed: f64 },
    /// Force over speed, N s/m.
    ViscousFriction { coefficient: f64 },
    /// Dry friction of `level + change (1 - exp(-t / time_constant))` along a record.
    FrictionDrift {
        level: f64,
        change: f64,
        time_constant: f64,
    },
    /// Dry friction of `level + coefficient |T|`, T the force that the drive hands on.
    LoadDependentFriction { level: f64, coefficient: f64 },
    /// Viscous friction that is `per_degree` larger each degree above 20, N s/m, in a guide that warms up by `rise` along a record, and by half
    /// of that from one to the next.
    Temperature {
        per_degree: f64,
        rise: f64,
        time_constant: f64,
    },
    /// Viscous friction that is so much more forward and so much less backward, N s/m.
    DirectionDependentFriction { more: f64 },
    /// `-f v |v|`, N s^2/m^2.
    QuadraticDrag { factor: f64 },
    /// A bristle that bends over a distance: `z' = v - |v| z / distance`, force `-level z / distance` (Dahl).
    Hysteresis { level: f64, distance: f64 },
    /// Force that is always there, N.
    ConstantForce { force: f64 },
    /// `-force sin(2 pi (q - start) / turn)`: an arm in the field of gravity; `turn` is the travel of one revolution.
    Gravity { force: f64, turn: f64, start: f64 },
    /// `sum a sin(2 pi q / length + phase)`: smooth over the stroke.
    PositionForce { waves: Vec<[f64; 3]> },
    /// `sine sin(2 pi q / pitch) + cosine cos(2 pi q / pitch)`, and a part of it at another order of the pitch.
    Cogging {
        sine: f64,
        cosine: f64,
        pitch: f64,
        order: f64,
        second: f64,
    },
    /// `-k q`.
    CableStiffness { stiffness: f64 },
    /// `-k q^3`.
    CubicStiffness { cube: f64 },
    /// `-change (1 - exp(-t / time_constant)) q`: a flexure that softens or stiffens along a record.
    StiffnessDrift { change: f64, time_constant: f64 },
    /// A drive that gives `1 + gain` times its command in one record.
    InputGain { gain: f64, record: usize },
    /// Commands that come late, s.
    Delay { time: f64 },
    /// First-order lag of the force, s.
    ActuatorLag { time_constant: f64 },
    /// `F = tanh(u sqrt(softness)) / sqrt(softness)`.
    ActuatorSaturation { softness: f64 },
    /// Force constant `1 + slope q + curvature q^2`.
    PositionDependentGain { slope: f64, curvature: f64 },
    /// Reading `y + sine sin(2 pi y / period) + cosine cos(2 pi y / period)`.
    SensorCyclicError { sine: f64, cosine: f64, period: f64 },
    /// Reading `y + drift (1 - exp(-t / time_constant))`.
    SensorDrift { drift: f64, time_constant: f64 },
    /// Readings rounded to steps of this size, m.
    Quantization { step: f64 },
    /// Force at a fixed frequency, from the start of a record.
    PeriodicDisturbance { sine: f64, cosine: f64, frequency: f64 },
    /// A mass more on the load in one record, or on the motor where there is none, kg.
    Payload { mass: f64, record: usize },
    /// Play between motor and encoder, m.
    Backlash { gap: f64 },
    /// Play between motor and load, m: their spring pulls beyond half of it to either side alone, and never draws them together.
    CouplingBacklash { gap: f64 },
    /// Force from a time of each record on.
    ForceStep { force: f64, time: f64 },
    /// The same from a time of each record on, added without a change of speed.
    MassJump { mass: f64, time: f64 },
    /// Dry friction from a position on, N.
    FrictionZone { level: f64, from: f64 },
    /// `force sin(2 pi (low t + (high - low) t^2 / (2 span)))`: a force whose frequency rises.
    SweptForce {
        force: f64,
        low: f64,
        high: f64,
        span: f64,
    },
    /// Random force, first-order low-pass noise of this deviation, other in each record.
    RandomForce { deviation: f64, corner: f64, seed: u64 },
}

impl AxisEffect {
    /// Name, as `lpv diagnose` writes it where it knows the effect.
    pub fn name(&self) -> &'static str {
        match self {
            Self::CoulombFriction { .. } => "coulomb-friction",
            Self::StribeckFriction { .. } => "stribeck-friction",
            Self::FrictionDrift { .. } => "friction-drift",
            Self::LoadDependentFriction { .. } => "load-dependent-friction",
            Self::StiffnessDrift { .. } => "stiffness-drift",
            Self::InputGain { .. } => "input-gain",
            Self::ViscousFriction { .. } => "viscous-friction",
            Self::DirectionDependentFriction { .. } => "direction-dependent-friction",
            Self::QuadraticDrag { .. } => "quadratic-friction",
            Self::Temperature { .. } => "temperature",
            Self::Hysteresis { .. } => "hysteresis",
            Self::ConstantForce { .. } => "constant-force",
            Self::Gravity { .. } => "gravity",
            Self::PositionForce { .. } => "position-force",
            Self::Cogging { second: 0.0, .. } => "cogging",
            Self::Cogging { .. } => "cogging-two-orders",
            Self::CableStiffness { .. } => "cable-stiffness",
            Self::CubicStiffness { .. } => "cubic-stiffness",
            Self::Delay { .. } => "delay",
            Self::ActuatorLag { .. } => "actuator-lag",
            Self::ActuatorSaturation { .. } => "actuator-saturation",
            Self::PositionDependentGain { .. } => "position-dependent-gain",
            Self::SensorCyclicError { .. } => "sensor-cyclic-error",
            Self::SensorDrift { .. } => "sensor-drift",
            Self::Quantization { .. } => "quantization",
            Self::PeriodicDisturbance { .. } => "periodic-disturbance",
            Self::Payload { .. } => "payload",
            Self::Backlash { .. } => "backlash",
            Self::CouplingBacklash { .. } => "backlash-of-the-load",
            Self::ForceStep { .. } => "force-step",
            Self::MassJump { .. } => "mass-jump",
            Self::FrictionZone { .. } => "friction-zone",
            Self::SweptForce { .. } => "swept-force",
            Self::RandomForce { .. } => "random-force",
        }
    }

    /// Its numbers by the names that a diagnosis gives them, forces over motion of the motor.
    pub fn facts(&self) -> Vec<(&'static str, f64)> {
        match *self {
            Self::CoulombFriction { level } => vec![("level", level)],
            Self::StribeckFriction {
                level,
                breakaway,
                speed,
            } => {
                vec![
                    ("level", level),
                    ("breakaway", breakaway),
                    ("stribeck_speed", speed),
                ]
            }
            Self::FrictionDrift {
                level,
                change,
                time_constant,
            } => {
                vec![
                    ("level", level),
                    ("change", change),
                    ("time_constant", time_constant),
                ]
            }
            Self::LoadDependentFriction { level, coefficient } => {
                vec![("level", level), ("coefficient", coefficient)]
            }
            Self::StiffnessDrift {
                change,
                time_constant,
            } => vec![("change", change), ("time_constant", time_constant)],
            Self::InputGain { gain, .. } => vec![("gain", gain)],
            Self::Backlash { gap } | Self::CouplingBacklash { gap } => vec![("gap", gap)],
            Self::DirectionDependentFriction { more } => vec![("viscous_forward_more", more)],
            Self::QuadraticDrag { factor } => vec![("coefficient", factor)],
            Self::Temperature { per_degree, .. } => vec![("viscous_per_degree", per_degree)],
            Self::Payload { mass, .. } => vec![("mass", mass)],
            Self::MassJump { mass, time } => vec![("mass", mass), ("begins", time)],
            Self::ForceStep { force, time } => vec![("force", force), ("begins", time)],
            Self::Hysteresis { level, distance } => vec![("level", level), ("distance", distance)],
            Self::Cogging {
                sine,
                cosine,
                pitch,
                second: 0.0,
                ..
            } => {
                vec![("sine", sine), ("cosine", cosine), ("pitch", pitch)]
            }
            Self::CableStiffness { stiffness } => vec![("stiffness", stiffness)],
            Self::CubicStiffness { cube } => vec![("cube", cube), ("cubic", cube)],
            Self::Delay { time } => vec![("time", time)],
            Self::ActuatorLag { time_constant } => vec![("time_constant", time_constant)],
            Self::ActuatorSaturation { softness } => vec![("softness", softness)],
            Self::PositionDependentGain { slope, curvature } => {
                vec![("slope", slope), ("curvature", curvature)]
            }
            Self::SensorCyclicError { sine, cosine, period } => {
                vec![("sine", sine), ("cosine", cosine), ("period", period)]
            }
            Self::SensorDrift { drift, time_constant } => {
                vec![("drift", drift), ("time_constant", time_constant)]
            }
            Self::Quantization { step } => vec![("step", step)],
            Self::PeriodicDisturbance {
                sine,
                cosine,
                frequency,
            } => {
                vec![("sine", sine), ("cosine", cosine), ("frequency", frequency)]
            }
            _ => Vec::new(),
        }
    }

    /// The temperature that is measured beside it, in a record and at a time of it.
    pub fn degrees(&self, record: usize, time: f64) -> Option<f64> {
        match *self {
            Self::Temperature {
                rise, time_constant, ..
            } => Some(20.0 + rise * (0.5 * record as f64 - (-time / time_constant).exp_m1())),
            _ => None,
        }
    }

    /// The same shape at so many times its size; pitches, times and the like stay.
    #[must_use]
    pub fn times(&self, s: f64) -> Self {
        let mut other = self.clone();
        match &mut other {
            Self::CoulombFriction { level }
            | Self::Hysteresis { level, .. }
            | Self::FrictionZone { level, .. } => *level *= s,
            Self::StribeckFriction { level, breakaway, .. } => {
                *level *= s;
                *breakaway *= s;
            }
            Self::FrictionDrift {
                level: a, change: b, ..
            }
            | Self::LoadDependentFriction {
                level: a,
                coefficient: b,
            } => {
                *a *= s;
                *b *= s;
            }
            Self::ViscousFriction { coefficient: a }
            | Self::DirectionDependentFriction { more: a }
            | Self::QuadraticDrag { factor: a }
            | Self::Temperature { per_degree: a, .. }
            | Self::ConstantForce { force: a }
            | Self::Gravity { force: a, .. }
            | Self::CableStiffness { stiffness: a }
            | Self::CubicStiffness { cube: a }
            | Self::Delay { time: a }
            | Self::ActuatorLag { time_constant: a }
            | Self::ActuatorSaturation { softness: a }
            | Self::SensorDrift { drift: a, .. }
            | Self::Quantization { step: a }
            | Self::Payload { mass: a, .. }
            | Self::Backlash { gap: a }
            | Self::CouplingBacklash { gap: a }
            | Self::StiffnessDrift { change: a, .. }
            | Self::InputGain { gain: a, .. }
            | Self::ForceStep { force: a, .. }
            | Self::SweptForce { force: a, .. }
            | Self::MassJump { mass: a, .. }
            | Self::RandomForce { deviation: a, .. } => *a *= s,
            Self::PositionForce { waves } => waves.iter_mut().for_each(|w| w[0] *= s),
            Self::PositionDependentGain {
                slope: a,
                curvature: b,
            }
            | Self::Cogging {
                sine: a, cosine: b, ..
            }
            | Self::SensorCyclicError {
                sine: a, cosine: b, ..
            }
            | Self::PeriodicDisturbance {
                sine: a, cosine: b, ..
            } => {
                *a *= s;
                *b *= s;
            }
        }
        other
    }
}
