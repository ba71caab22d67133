//! Random moves that cover positions and speeds: the records that show what constant positions cannot.

use crate::error::positive;
use crate::noise::split_seed;
use crate::{Machine, MoveLimits, PlantError, Profile, Setpoint, Setpoints};
use lpv_core::Discrete;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// What the carriage does during a move.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MoveKind {
    /// One slow sweep from one end to the other over the whole record.
    Sweep,
    /// A sine of one frequency, drawn from `swing-hz`.
    BackAndForth,
    /// A sum of cosines of random frequencies up to `wander-hz`.
    Wander,
}

/// Random moves, unchecked; [`MoveSettings::setpoints`] checks them.
///
/// | field | default | meaning | range |
/// |---|---|---|---|
/// | `samples` | 4000 | samples a record | 2 to 2^24 |
/// | `stroke_fraction` | 0.95 | part of the half stroke that the carriage uses | above 0, at most 1 |
/// | `swing_hz` | 0.02 to 0.04 | frequency of a back-and-forth | > 0 |
/// | `wander_hz` | 0.12 | highest frequency of a wander | > 0 |
/// | `y1_range_m` | 0.1 | setpoints of y'_1 are drawn from plus and minus this | >= 0 |
/// | `y2_range_rad` | 0.001 | setpoints of y'_2 | >= 0 |
/// | `y1_limits` | 0.08, 0.08, 0.15 | speed, acceleration and jerk between setpoints of y'_1, m | > 0 |
/// | `y2_limits` | 0.0008, 0.0008, 0.0015 | the same of y'_2, rad | > 0 |
/// | `dwell` | 2 to 8 | rest between setpoints, units of time | >= 0 |
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct MoveSettings {
    /// Samples a record.
    pub samples: usize,
    /// Part of the half stroke in use.
    pub stroke_fraction: f64,
    /// Least and largest frequency of a back-and-forth.
    pub swing_hz: [f64; 2],
    /// Highest frequency of a wander.
    pub wander_hz: f64,
    /// Range of the setpoints of y'_1.
    pub y1_range_m: f64,
    /// Range of the setpoints of y'_2.
    pub y2_range_rad: f64,
    /// Bounds of the moves of y'_1.
    pub y1_limits: MoveLimits,
    /// Bounds of the moves of y'_2.
    pub y2_limits: MoveLimits,
    /// Least and largest rest between setpoints.
    pub dwell: [f64; 2],
}

impl Default for MoveSettings {
    fn default() -> Self {
        Self {
            samples: 4000,
            stroke_fraction: 0.95,
            swing_hz: [0.02, 0.04],
            wander_hz: 0.12,
            y1_range_m: 0.1,
            y2_range_rad: 1e-3,
            y1_limits: MoveLimits {
                speed: 0.08,
                acceleration: 0.08,
                jerk: 0.15,
            },
            y2_limits: MoveLimits {
                speed: 8e-4,
                acceleration: 8e-4,
                jerk: 1.5e-3,
            },
            dwell: [2.0, 8.0],
        }
    }
}

/// Cosines in a wander.
const COSINES: usize = 6;

impl MoveSettings {
    /// Setpoints of all three loops. Every carriage starts with speed zero; the same seed gives the same moves.
    ///
    /// # Errors
    /// [`PlantError::Setting`] for a field out of range.
    pub fn setpoints(
        &self,
        kind: MoveKind,
        machine: &Machine,
        clock: Discrete,
        seed: u64,
    ) -> Result<Setpoints, PlantError> {
        self.check()?;
        let stream = |name| ChaCha8Rng::seed_from_u64(split_seed(seed, name));
        Ok(Setpoints {
            y1: self.steps(self.y1_range_m, self.y1_limits, clock, &mut stream("y1"))?,
            y2: self.steps(self.y2_range_rad, self.y2_limits, clock, &mut stream("y2"))?,
            x1: self.carriage(kind, machine, clock, &mut stream("x1"))?,
            injection: None,
        })
    }

    fn check(&self) -> Result<(), PlantError> {
        let within = |field, value: f64, least: f64, most: f64, problem| {
            if (least..=most).contains(&value) {
                Ok(())
            } else {
                Err(PlantError::Setting {
                    field,
                    value,
                    problem,
                })
            }
        };
        let range = "give a finite number that is not negative";
        within(
            "samples",
            self.samples as f64,
            2.0,
            16_777_216.0,
            "give 2 to 16,777,216 samples",
        )?;
        within("y1-range-m", self.y1_range_m, 0.0, f64::MAX, range)?;
        within("y2-range-rad", self.y2_range_rad, 0.0, f64::MAX, range)?;
        positive("wander-hz", self.wander_hz)?;
        positive("swing-hz", self.swing_hz[0])?;
        let order = "give a finite number, not below the first of the pair";
        within("swing-hz", self.swing_hz[1], self.swing_hz[0], f64::MAX, order)?;
        within("dwell", self.dwell[0], 0.0, f64::MAX, range)?;
        within("dwell", self.dwell[1], self.dwell[0], f64::MAX, order)
    }

    /// Steps to random targets with random rests; a record starts with a rest at zero.
    fn steps(
        &self,
        range: f64,
        limits: MoveLimits,
        clock: Discrete,
        rng: &mut ChaCha8Rng,
    ) -> Result<Setpoint, PlantError> {
        let length = self.samples as f64 * clock.sample_time();
        let [least, most] = self.dwell;
        let mut profile = Profile::at(0.0, limits)?;
        // Rests and moves of length zero would never fill the record, so their number is bounded by its samples.
        for _ in 0..self.samples {
            if profile.duration() >= length {
                break;
            }
            let dwell = least + (most - least) * rng.random::<f64>();
            let target = range * (2.0 * rng.random::<f64>() - 1.0);
            profile = profile.dwell(dwell)?.move_to(target)?;
        }
        Ok(profile.sample(clock, self.samples))
    }

    fn carriage(
        &self,
        kind: MoveKind,
        machine: &Machine,
        clock: Discrete,
        rng: &mut ChaCha8Rng,
    ) -> Result<Setpoint, PlantError> {
        let fraction = self.stroke_fraction;
        let length = self.samples as f64 * clock.sample_time();
        let sweep = Profile::slow_sweep(machine, fraction, length)?;
        let far = fraction * machine.parameters().half_stroke_m;
        let waves: Vec<(f64, f64)> = match kind {
            MoveKind::Sweep => return Ok(sweep.sample(clock, self.samples)),
            MoveKind::BackAndForth => {
                let [least, most] = self.swing_hz;
                vec![(1.0, least + (most - least) * rng.random::<f64>())]
            }
            MoveKind::Wander => (0..COSINES)
                .map(|_| {
                    let amplitude = 2.0 * rng.random::<f64>() - 1.0;
                    (amplitude, self.wander_hz * rng.random::<f64>())
                })
                .collect(),
        };
        let sign = if rng.random::<bool>() { 1.0 } else { -1.0 };
        // Cosines, since the machine starts at rest.
        let wave = |k: usize| -> f64 {
            let t = k as f64 * clock.sample_time();
            waves.iter().map(|(a, f)| a * (TAU * f * t).cos()).sum()
        };
        let raw: Vec<f64> = (0..self.samples).map(wave).collect();
        let peak = raw.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let scale = sign * far / peak.max(f64::MIN_POSITIVE);
        Setpoint::from_positions(raw.into_iter().map(|v| v * scale).collect(), clock)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MachineParameters;

    #[test]
    fn every_kind_uses_the_stroke_it_is_given_and_starts_at_rest() {
        let machine = MachineParameters::default().check().unwrap();
        let clock = Discrete::from_rate(20.0).unwrap();
        let settings = MoveSettings::default();
        for kind in [MoveKind::Sweep, MoveKind::BackAndForth, MoveKind::Wander] {
            let set = settings.setpoints(kind, &machine, clock, 3).unwrap();
            let p = set.x1.position();
            let peak = p.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
            assert!((peak - 0.285).abs() < 1e-9, "{kind:?}: {peak}");
            assert!((p[1] - p[0]).abs() < 1e-4, "{kind:?}: {}", p[1] - p[0]);
            let y = set.y1.position();
            assert!(y.iter().all(|v| v.abs() <= 0.1) && y.iter().any(|v| v.abs() > 0.03));
            assert_eq!(set, settings.setpoints(kind, &machine, clock, 3).unwrap());
            assert_ne!(set, settings.setpoints(kind, &machine, clock, 4).unwrap());
        }
    }

    #[test]
    fn settings_out_of_range_are_refused() {
        let machine = MachineParameters::default().check().unwrap();
        let clock = Discrete::from_rate(20.0).unwrap();
        let good = MoveSettings::default();
        for bad in [
            MoveSettings { samples: 1, ..good },
            MoveSettings {
                swing_hz: [0.04, 0.02],
                ..good
            },
            MoveSettings {
                stroke_fraction: 1.1,
                ..good
            },
            MoveSettings {
                dwell: [f64::NAN, 1.0],
                ..good
            },
        ] {
            let error = bad.setpoints(MoveKind::Wander, &machine, clock, 0).unwrap_err();
            assert!(matches!(error, PlantError::Setting { .. }), "{error}");
        }
    }
}
