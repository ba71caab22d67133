//! A mass on a guide with one motor, free or held by a spring to ground, or a motor with a load on a spring.

use super::{BaseParameter, Body, Forces, Motion, Pair, Start, Stiff};
use crate::track::cubic;
use nalgebra::{DMatrix, dmatrix};
use num_complex::Complex64 as C64;

/// Largest part of the mass that a load has.
const MOST_PART: f64 = 0.999;
/// Parameter of a load on a spring: the frequency at which motor and load swing against each other.
pub(crate) const RESONANCE: &str = "resonance";

/// `M q'' + F_v q' + k q + offset = force`, k zero unless a spring holds the mass; the input the force of the motor, the output its position.
/// A load on a spring pulls with `k_c (q - q_l) + d_c (q' - q_l') = M_l q_l''` ([`Load`]).
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Motor and load together.
    pub(super) mass: f64,
    viscous: f64,
    offset: f64,
    /// Of the spring to ground, if there is one.
    stiffness: Option<f64>,
    /// Of a load that is not rigidly joined to the motor.
    load: Option<(Load, Bodies)>,
    /// Whether responses are fitted, which do not know the offset.
    linear: bool,
}

/// A load that a spring joins to the motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Load {
    /// Its part of the mass.
    pub part: f64,
    /// Natural frequency of motor and load against each other, without guide and ground, Hz.
    pub hz: f64,
    /// Damping ratio of that.
    pub ratio: f64,
    /// Whether the encoder is on the load; else it is on the motor.
    pub is_measured: bool,
}

/// Motor and load, and what is between them.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Bodies {
    motor: f64,
    load: f64,
    stiffness: f64,
    damping: f64,
}

impl Load {
    fn of(&self, mass: f64) -> Bodies {
        let w = std::f64::consts::TAU * self.hz;
        let reduced = self.part * (1.0 - self.part) * mass;
        Bodies {
            motor: (1.0 - self.part) * mass,
            load: self.part * mass,
            stiffness: reduced * w * w,
            damping: 2.0 * self.ratio * w * reduced,
        }
    }
}

impl Bodies {
    /// What it pulls with along a motion of the motor, from rest in itself: positions and speeds at samples `step` apart, cubic between them.
    fn pulls(&self, [q, v]: [&[f64]; 2], step: f64) -> Vec<f64> {
        /// Largest phase of the load on its spring in a part of a sample.
        const PHASE: f64 = 0.3;
        let fast = (self.stiffness / self.load).sqrt().max(self.damping / self.load);
        let parts = (fast * step / PHASE).ceil().clamp(1.0, 64.0);
        let h = step / parts;
        let pull =
            |[x, rate]: [f64; 2], [q, v]: [f64; 2]| self.stiffness * (q - x) + self.damping * (v - rate);
        let mut state = [
            q.first().copied().unwrap_or(0.0),
            v.first().copied().unwrap_or(0.0),
        ];
        let mut found = Vec::with_capacity(q.len());
        for k in 0..q.len() {
            found.push(pull(state, [q[k], v[k]]));
            let Some(next) = q.get(k + 1) else { break };
            let motor = |part: f64| {
                let [q, rise] = cubic([q[k], *next], [v[k] * step, v[k + 1] * step], part);
                [q, rise / step]
            };
            for part in 0..parts as usize {
                let at = |half: f64| motor((part as f64 + half) / parts);
                let rates = |state: [f64; 2], motor: [f64; 2]| [state[1], pull(state, motor) / self.load];
                let moved = |k: [f64; 2], h: f64| [state[0] + h * k[0], state[1] + h * k[1]];
                let a = rates(state, at(0.0));
                let b = rates(moved(a, 0.5 * h), at(0.5));
                let c = rates(moved(b, 0.5 * h), at(0.5));
                let d = rates(moved(c, h), at(1.0));
                state = [0, 1].map(|i: usize| state[i] + h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]));
            }
        }
        found
    }
}

impl Axis {
    /// Mass, viscous friction, and the force that the motor needs at rest.
    pub fn new(mass: f64, viscous: f64, offset: f64) -> Self {
        Self {
            mass,
            viscous,
            offset,
            stiffness: None,
            load: None,
            linear: false,
        }
    }

    /// The same on a spring to ground.
    #[must_use]
    pub fn on_spring(self, stiffness: f64) -> Self {
        Self {
            stiffness: Some(stiffness),
            ..self
        }
    }

    /// The same with a load that has a part of its mass.
    #[must_use]
    pub fn with_load(self, load: Load) -> Self {
        Self {
            load: Some((load, load.of(self.mass))),
            ..self
        }
    }

    /// The load, where it is not rigidly joined to the motor.
    pub fn load(&self) -> Option<Load> {
        self.load.map(|(load, _)| load)
    }

    /// Stiffness and damping of the spring that joins it; none without.
    pub(super) fn spring_of_load(&self) -> Pair {
        self.load
            .map_or([0.0; 2], |(_, bodies)| [bodies.stiffness, bodies.damping])
    }

    /// Stiffness of the spring to ground; none for a free axis.
    pub fn stiffness(&self) -> Option<f64> {
        self.stiffness
    }

    /// The same for frequency responses, which do not know the offset.
    #[must_use]
    pub fn linear(self) -> Self {
        Self {
            offset: 0.0,
            linear: true,
            ..self
        }
    }

    /// Mass, of motor and load together.
    pub fn mass(&self) -> f64 {
        self.mass
    }

    /// Mass of the motor with all that is rigidly joined to it.
    pub fn motor_mass(&self) -> f64 {
        self.load.map_or(self.mass, |(_, bodies)| bodies.motor)
    }

    /// Force of the motor along a motion of the encoder: its positions, speeds and accelerations at samples `step` apart. A load follows a motor that is
    /// measured; where it is measured itself, the motor counts as rigidly joined to it, which holds far below the resonance.
    pub fn force_along(&self, [q, v, a]: [&[f64]; 3], step: f64) -> Vec<f64> {
        let pulls = match self.load {
            Some((load, bodies)) if !load.is_measured => bodies.pulls([q, v], step),
            Some((_, bodies)) => a.iter().map(|a| bodies.load * a).collect(),
            None => vec![0.0; q.len()],
        };
        let (mass, k) = (self.motor_mass(), self.stiffness.unwrap_or(0.0));
        let rows = q.iter().zip(v).zip(a).zip(pulls);
        rows.map(|(((q, v), a), pull)| mass * a + self.viscous * v + k * q + self.offset + pull)
            .collect()
    }

    /// Force over motion of the motor at the complex frequency s.
    pub(crate) fn dynamic(&self, s: C64) -> C64 {
        let load = self.load.map_or(C64::ZERO, |(_, bodies)| {
            let spring = s * bodies.damping + bodies.stiffness;
            s * s * bodies.load * spring / (s * s * bodies.load + spring)
        });
        s * (s * self.motor_mass() + self.viscous) + self.stiffness.unwrap_or(0.0) + load
    }

    /// An axis of each of its parameters alone, as one: its force is the sum of theirs; none where a load swings on it.
    pub(crate) fn units(&self) -> Option<Vec<Self>> {
        let count = self.parameters().len();
        let alone = |i: usize| self.of((0..count).map(|j| f64::from(u8::from(i == j))).collect());
        self.load.is_none().then(|| (0..count).map(alone).collect())
    }

    /// The same axis without mass, friction and all else.
    pub(crate) fn of_nothing(&self) -> Self {
        self.of(vec![0.0; self.parameters().len()])
    }

    /// The same axis with other parameters; none where what must be more than nothing is not.
    pub(crate) fn with_parameters(&self, values: &[f64]) -> Option<Self> {
        let other = self.of(values.to_vec());
        let is_one = |p: BaseParameter| !p.positive || p.value > 0.0;
        other.parameters().into_iter().all(is_one).then_some(other)
    }

    fn of(&self, values: Vec<f64>) -> Self {
        let mut other = self.clone();
        other.set(&values);
        other
    }

    pub(super) fn states(&self) -> usize {
        if self.load.is_some() { 4 } else { 2 }
    }

    /// Parts of a sample that follow a resonance.
    pub(super) fn parts(&self, step: f64) -> usize {
        /// Largest phase of it in a part: the rule of Runge and Kutta errs by less than a thousandth of its frequency.
        const PHASE: f64 = 0.6;
        let turn = std::f64::consts::TAU * step / PHASE;
        let fast = self.load.map_or(0.0, |(load, _)| turn * load.hz);
        2 * ((0.5 * fast).ceil() as usize).clamp(1, 8)
    }

    pub(super) fn frozen(&self) -> [DMatrix<f64>; 3] {
        let (m, v, k) = (self.motor_mass(), self.viscous, self.stiffness.unwrap_or(0.0));
        let Some((load, bodies)) = self.load else {
            return [
                dmatrix![0.0, 1.0; -k / m, -v / m],
                dmatrix![0.0; 1.0 / m],
                dmatrix![1.0, 0.0],
            ];
        };
        let (kc, dc) = (bodies.stiffness, bodies.damping);
        let [on_motor, on_load] = [m, bodies.load].map(|m| [kc / m, dc / m]);
        [
            dmatrix![
                0.0, 1.0, 0.0, 0.0;
                -k / m - on_motor[0], -v / m - on_motor[1], on_motor[0], on_motor[1];
                0.0, 0.0, 0.0, 1.0;
                on_load[0], on_load[1], -on_load[0], -on_load[1]
            ],
            dmatrix![0.0; 1.0 / m; 0.0; 0.0],
            match load.is_measured {
                true => dmatrix![0.0, 0.0, 1.0, 0.0],
                false => dmatrix![1.0, 0.0, 0.0, 0.0],
            },
        ]
    }

    pub(super) fn parameters(&self) -> Vec<BaseParameter> {
        let parameter = |name, unit, value, positive| BaseParameter {
            name,
            unit,
            value,
            positive,
            held: false,
        };
        let offset = BaseParameter {
            held: self.linear,
            ..parameter("offset", "u", self.offset, false)
        };
        let spring = self.stiffness.map(|k| parameter("stiffness", "u/y", k, true));
        let load = self.load.map(|(load, _)| {
            [
                parameter(RESONANCE, "Hz", load.hz, true),
                parameter("damping of the resonance", "", load.ratio, true),
                parameter("load part", "", load.part, true),
            ]
        });
        [
            parameter("mass", "u s^2/y", self.mass, true),
            parameter("viscous friction", "u s/y", self.viscous, false),
            offset,
        ]
        .into_iter()
        .chain(spring)
        .chain(load.into_iter().flatten())
        .collect()
    }

    pub(super) fn set(&mut self, v: &[f64]) {
        self.mass = v[0];
        self.viscous = v[1];
        self.offset = v[2];
        let mut more = &v[3..];
        if let (Some(stiffness), [value, rest @ ..]) = (&mut self.stiffness, more) {
            *stiffness = *value;
            more = rest;
        }
        if let (Some((load, bodies)), &[hz, ratio, part]) = (&mut self.load, more) {
            // A part of one would leave the motor without mass.
            (load.hz, load.ratio, load.part) = (hz, ratio, part.min(MOST_PART));
            *bodies = load.of(self.mass);
        }
    }
}

impl Body for Axis {
    fn begin(&self, _p: f64, start: &Start, x: &mut [f64]) {
        let one = [start.position[0], start.speed[0]];
        x.chunks_exact_mut(2).for_each(|body| body.copy_from_slice(&one));
    }

    fn commanded(&self, _p: f64, u: Pair) -> Pair {
        u
    }

    fn motion(&self, x: &[f64], _p: f64) -> Motion {
        let at = self.states() - 2;
        Motion {
            motor_position: [x[0], 0.0],
            motor_speed: [x[1], 0.0],
            load_position: [x[at], 0.0],
            load_speed: [x[at + 1], 0.0],
            deflection: [x[0] - x[at], 0.0],
        }
    }

    fn rates(&self, x: &[f64], _p: f64, forces: &Forces, rates: &mut [f64]) {
        rates[0] = x[1];
        let spring = self.stiffness.unwrap_or(0.0) * x[0];
        let own = forces.motors[0] - self.viscous * x[1] - spring - self.offset;
        let Some((_, bodies)) = self.load else {
            rates[1] = (own + forces.load[0]) / (self.mass + forces.mass);
            return;
        };
        let pull = bodies.stiffness * (x[0] - x[2]) + bodies.damping * (x[1] - x[3]) + forces.coupling[0];
        rates[1] = (own - pull) / bodies.motor;
        rates[2] = x[3];
        rates[3] = (pull + forces.load[0]) / (bodies.load + forces.mass);
    }

    fn stiff(&self, forces: &Forces) -> Option<Stiff> {
        let carried = if self.load.is_none() { forces.mass } else { 0.0 };
        let mass = self.motor_mass() + carried;
        let [dry, _] = forces.dry;
        (dry.level > 0.0).then(|| Stiff {
            position: 0,
            speed: 1,
            taken: dry.force / mass,
            level: dry.level / mass,
            rate: dry.slope / mass,
            rate_at_rest: dry.slope_at_rest / mass,
        })
    }

    fn outputs(&self, x: &[f64], _p: f64) -> Pair {
        match self.load {
            Some((load, _)) if load.is_measured => [x[2], 0.0],
            _ => [x[0], 0.0],
        }
    }
}
