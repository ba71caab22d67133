//! A simulated servo axis: one mass on a guide, the same on a flexure, or motor and load on a spring, driven by a tracking controller or
//! by a command that was computed beforehand, and read by encoders that round.
//!
//! `m q'' + c q' + k q + o = F + f`: F is the force that the drive makes of its command, f what is hidden ([`AxisEffect`]). With a load
//! the motor has the rest of the mass, and guide, flexure and motor force act on the motor. Commands are held from sample to sample.
//!
//! Dry friction is integrated with its rest: at zero speed the mass stays until the other forces exceed the breakaway force, and a
//! reversal is found inside a step. Everything else is smooth within a step, which the rule of Runge and Kutta takes.

mod acting;
mod effect;
mod moves;
mod run;
mod visible;

pub use effect::AxisEffect;
pub use moves::AxisMoves;
pub use run::AxisRun;
pub use visible::{Known, deviation};

/// The machine without anything hidden in it, SI units.
#[derive(Debug, Clone, PartialEq)]
pub struct ServoAxis {
    /// Motor and load together, kg.
    pub mass_kg: f64,
    /// Viscous friction of the guide, N s/m.
    pub viscous_n_s_per_m: f64,
    /// Force that the motor needs at rest, N.
    pub offset_n: f64,
    /// Of a flexure to ground, N/m; zero for a guide.
    pub stiffness_n_per_m: f64,
    /// The load, where it is not rigid.
    pub load: Option<Load>,
    /// Samples a second.
    pub rate_hz: f64,
    /// Step of the encoders, m.
    pub resolution_m: f64,
    /// What makes the commands.
    pub drive: Drive,
}

/// A load that a spring joins to the motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Load {
    /// Its part of the mass.
    pub part: f64,
    /// Resonance of motor and load against each other, Hz.
    pub resonance_hz: f64,
    /// Damping ratio of that resonance.
    pub damping: f64,
    /// Where the encoders are; the controller reads the first.
    pub encoders: Encoders,
}

/// Where the encoders of an axis with a load are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoders {
    /// One, on the motor.
    Motor,
    /// One, on the load.
    Load,
    /// On the motor, then on the load.
    Both,
}

/// What makes the commands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Drive {
    /// `u = k_p (r - y) + k_d (r' - (y_k - y_k-1) / T) + g m r'' + c r' + k r + o` at the samples.
    Tracking {
        /// Natural frequency of the loop, Hz: `k_p = m w^2`, `k_d = 1.4 w m`.
        bandwidth_hz: f64,
        /// g: what the feedforward takes for the mass, over the mass.
        feedforward: f64,
    },
    /// The same without its first two terms.
    Open {
        /// g.
        feedforward: f64,
    },
}

impl ServoAxis {
    /// Masses of motor and load, stiffness and damping of the spring between them; a rigid axis has no load.
    pub(crate) fn bodies(&self) -> [f64; 4] {
        let Some(load) = self.load else {
            return [self.mass_kg, 0.0, 0.0, 0.0];
        };
        let [motor, part] = [1.0 - load.part, load.part].map(|p| p * self.mass_kg);
        let reduced = motor * part / self.mass_kg;
        let w = std::f64::consts::TAU * load.resonance_hz;
        [motor, part, reduced * w * w, 2.0 * load.damping * reduced * w]
    }

    /// Deviation of one reading from its rounding, m.
    pub fn noise_m(&self) -> f64 {
        self.resolution_m / 12_f64.sqrt()
    }

    /// How many encoders there are.
    pub fn encoders(&self) -> usize {
        match self.load {
            Some(Load {
                encoders: Encoders::Both,
                ..
            }) => 2,
            _ => 1,
        }
    }
}

#[cfg(test)]
mod tests;
