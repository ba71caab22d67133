//! Setpoints: moves of bounded speed, acceleration and jerk, in the shortest time, with rests between them.

use crate::error::{finite, not_negative, positive};
use crate::{Machine, PlantError};
use lpv_core::Discrete;
use serde::{Deserialize, Serialize};

/// Bounds of a move, unchecked; in units of the coordinate (m or rad) and time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct MoveLimits {
    /// Largest speed, > 0.
    pub speed: f64,
    /// Largest acceleration, > 0.
    pub acceleration: f64,
    /// Largest jerk, > 0.
    pub jerk: f64,
}

/// Where a profile is, how fast, and with which acceleration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProfilePoint {
    /// Position.
    pub position: f64,
    /// Speed with sign.
    pub velocity: f64,
    /// Acceleration.
    pub acceleration: f64,
}

/// Constant jerk from `start` on.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Segment {
    start: f64,
    point: ProfilePoint,
    jerk: f64,
}

/// A third-order profile: a start, moves and rests. Before the start and after the end it stands still.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    limits: MoveLimits,
    segments: Vec<Segment>,
    end: f64,
    end_position: f64,
}

/// Samples of a profile: position and velocity at the sample instants.
#[derive(Debug, Clone, PartialEq)]
pub struct Setpoint {
    position: Vec<f64>,
    velocity: Vec<f64>,
}

impl Profile {
    /// A profile that stands at `position`.
    ///
    /// # Errors
    /// [`PlantError::Setting`] for limits that are not finite and above zero, or a position that is not finite.
    pub fn at(position: f64, limits: MoveLimits) -> Result<Self, PlantError> {
        positive("speed", limits.speed)?;
        positive("acceleration", limits.acceleration)?;
        positive("jerk", limits.jerk)?;
        not_negative("absolute start position", position.abs())?;
        Ok(Self {
            limits,
            segments: Vec::new(),
            end: 0.0,
            end_position: position,
        })
    }

    /// Adds the fastest move to `target` within the limits, from rest to rest.
    ///
    /// Seven segments of constant jerk, some of length zero: whether the bounds of acceleration and of speed are
    /// reached follows from the distance D. With jerk time `t_j` and time at full acceleration `t_a`, the peak speed is
    /// `J t_j (t_j + t_a)` and the distance without cruise `J t_j (t_j + t_a)(2 t_j + t_a)`.
    ///
    /// # Errors
    /// [`PlantError::Setting`] if the target is not finite, or so far away that the duration overflows.
    pub fn move_to(mut self, target: f64) -> Result<Self, PlantError> {
        let distance = (target - self.end_position).abs();
        not_negative("distance of a move", distance)?;
        let MoveLimits {
            speed,
            acceleration,
            jerk,
        } = self.limits;
        let t_j = (0.5 * distance / jerk)
            .cbrt()
            .min((speed / jerk).sqrt())
            .min(acceleration / jerk);
        let reached = jerk * t_j;
        let mut t_a = 0.0;
        let mut t_v = 0.0;
        if reached > 0.0 {
            let by_distance = 0.5 * ((t_j * t_j + 4.0 * distance / reached).sqrt() - 3.0 * t_j);
            let by_speed = speed / reached - t_j;
            t_a = by_distance.min(by_speed).max(0.0);
            let peak = reached * (t_j + t_a);
            t_v = (distance / peak - (2.0 * t_j + t_a)).max(0.0);
        }
        let sign = if target < self.end_position { -jerk } else { jerk };
        let segments = [
            (t_j, sign),
            (t_a, 0.0),
            (t_j, -sign),
            (t_v, 0.0),
            (t_j, -sign),
            (t_a, 0.0),
            (t_j, sign),
        ];
        let mut point = self.rest();
        let mut time = self.end;
        for (duration, jerk) in segments {
            if duration > 0.0 {
                self.segments.push(Segment {
                    start: time,
                    point,
                    jerk,
                });
                point = advance(point, jerk, duration);
                time += duration;
            }
        }
        not_negative("duration of a move", time)?;
        self.end = time;
        // Rounding over seven segments must not add up over many moves: the next one starts at the target itself.
        self.end_position = target;
        Ok(self.stand())
    }

    /// Adds a rest.
    ///
    /// # Errors
    /// [`PlantError::Setting`] for a duration that is negative or not finite.
    pub fn dwell(mut self, duration: f64) -> Result<Self, PlantError> {
        not_negative("duration of a rest", duration)?;
        not_negative("end of a rest", self.end + duration)?;
        self.end += duration;
        Ok(self.stand())
    }

    /// Moves to each target in turn with a rest of `dwell` before each and after the last: the step-like pattern.
    ///
    /// # Errors
    /// As [`Profile::move_to`] and [`Profile::dwell`].
    pub fn steps(mut self, targets: &[f64], dwell: f64) -> Result<Self, PlantError> {
        self = self.dwell(dwell)?;
        for &target in targets {
            self = self.move_to(target)?.dwell(dwell)?;
        }
        Ok(self)
    }

    /// Moves from the start to `far` and back, `times` times, without rests.
    ///
    /// # Errors
    /// As [`Profile::move_to`].
    pub fn back_and_forth(mut self, far: f64, times: usize) -> Result<Self, PlantError> {
        let near = self.end_position;
        for _ in 0..times {
            self = self.move_to(far)?.move_to(near)?;
        }
        Ok(self)
    }

    /// One move of the carriage from `-fraction` to `+fraction` of the half stroke. A servo overshoots a little, so
    /// leave it some room: a fraction of 0.98, say.
    ///
    /// # Errors
    /// [`PlantError::Setting`] for a fraction outside (0, 1].
    pub fn sweep(machine: &Machine, fraction: f64, limits: MoveLimits) -> Result<Self, PlantError> {
        let far = fraction_of_stroke(machine, fraction)?;
        Self::at(-far, limits)?.move_to(far)
    }

    /// As [`Profile::sweep`], slow enough that the move takes `duration`, mostly at constant speed.
    ///
    /// # Errors
    /// [`PlantError::Setting`] for a fraction outside (0, 1] or a duration that is not finite and above zero.
    pub fn slow_sweep(machine: &Machine, fraction: f64, duration: f64) -> Result<Self, PlantError> {
        let far = fraction_of_stroke(machine, fraction)?;
        positive("duration of a sweep", duration)?;
        // A ramp of a tenth of the duration at each end: t_v + 4 t_j = duration with t_j = duration / 20.
        let t_j = duration / 20.0;
        let speed = 2.0 * far / (duration - 2.0 * t_j);
        let limits = MoveLimits {
            speed,
            acceleration: speed / t_j,
            jerk: speed / (t_j * t_j),
        };
        Self::at(-far, limits)?.move_to(far)
    }

    /// Time of the last segment's end.
    pub fn duration(&self) -> f64 {
        self.end
    }
    /// Position after the end.
    pub fn end_position(&self) -> f64 {
        self.end_position
    }
    /// The limits.
    pub fn limits(&self) -> &MoveLimits {
        &self.limits
    }

    /// The profile at a time.
    pub fn point(&self, time: f64) -> ProfilePoint {
        if time >= self.end {
            return self.rest();
        }
        match self.segments.partition_point(|s| s.start <= time).checked_sub(1) {
            Some(i) => advance(
                self.segments[i].point,
                self.segments[i].jerk,
                time - self.segments[i].start,
            ),
            None => ProfilePoint {
                position: self
                    .segments
                    .first()
                    .map_or(self.end_position, |s| s.point.position),
                velocity: 0.0,
                acceleration: 0.0,
            },
        }
    }

    /// Samples at 0, T, 2T, ...; after its end the profile stands still.
    pub fn sample(&self, clock: Discrete, samples: usize) -> Setpoint {
        let (position, velocity) = (0..samples)
            .map(|k| self.point(k as f64 * clock.sample_time()))
            .map(|p| (p.position, p.velocity))
            .unzip();
        Setpoint { position, velocity }
    }

    fn rest(&self) -> ProfilePoint {
        ProfilePoint {
            position: self.end_position,
            velocity: 0.0,
            acceleration: 0.0,
        }
    }

    /// Closes with a segment at rest, which a rest extends.
    fn stand(mut self) -> Self {
        let point = self.rest();
        self.segments.push(Segment {
            start: self.end,
            point,
            jerk: 0.0,
        });
        self
    }
}

impl Setpoint {
    /// A constant.
    pub fn constant(value: f64, samples: usize) -> Self {
        Self {
            position: vec![value; samples],
            velocity: vec![0.0; samples],
        }
    }

    /// From positions alone; velocities are central differences.
    ///
    /// # Errors
    /// [`PlantError::NotFinite`].
    pub fn from_positions(position: Vec<f64>, clock: Discrete) -> Result<Self, PlantError> {
        finite("setpoint", &position)?;
        let last = position.len().saturating_sub(1);
        let velocity = (0..position.len())
            .map(|k| {
                let (before, after) = (k.saturating_sub(1), (k + 1).min(last));
                let steps = (after - before).max(1) as f64;
                (position[after] - position[before]) / (steps * clock.sample_time())
            })
            .collect();
        Ok(Self { position, velocity })
    }

    /// Positions at the samples.
    pub fn position(&self) -> &[f64] {
        &self.position
    }
    /// Velocities at the samples.
    pub fn velocity(&self) -> &[f64] {
        &self.velocity
    }
    /// Number of samples.
    pub fn len(&self) -> usize {
        self.position.len()
    }
    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.position.is_empty()
    }
}

fn advance(from: ProfilePoint, jerk: f64, t: f64) -> ProfilePoint {
    let ProfilePoint {
        position,
        velocity,
        acceleration,
    } = from;
    ProfilePoint {
        position: position + t * (velocity + t * (0.5 * acceleration + t * jerk / 6.0)),
        velocity: velocity + t * (acceleration + 0.5 * t * jerk),
        acceleration: acceleration + t * jerk,
    }
}

fn fraction_of_stroke(machine: &Machine, fraction: f64) -> Result<f64, PlantError> {
    if fraction > 0.0 && fraction <= 1.0 {
        Ok(fraction * machine.parameters().half_stroke_m)
    } else {
        Err(PlantError::Setting {
            field: "fraction of the stroke",
            value: fraction,
            problem: "give a number above 0, at most 1",
        })
    }
}
