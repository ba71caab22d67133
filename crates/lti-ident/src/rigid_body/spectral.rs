//! Inertia, friction and offset from the lines of the spectrum at which the force stands out.
//!
//! Of a mass with viscous friction under a force that is held from sample to sample (`x = F_v T / J`)
//!
//! `J (x/2) coth(x/2) (q+ - 2 q + q-) / T^2 + F_v (q+ - q-) / (2 T) + o = (u + u-) / 2 + (coth(x/2) - 2/x) (u - u-) / 2`
//!
//! holds exactly at each sample and so between windowed spectra, see [`super::lines`]. Noise of the position becomes
//! noise of the equations that grows with the square of the frequency: lines are weighted by what the equations leave
//! in their neighbourhood and used where the force is well above that. Noise is in the regressors too, so that least
//! squares would make the inertia too small; instruments are the motion that the force makes by the last estimate, or
//! that of a reference.

use super::dry::drag;
use super::lines::{ALIKE, C, Linear, OF_CONSTANT, Part, smoothed, solve, spectrum, window};
use super::{Estimator, rounding};
use lpv_core::{Clock, Discrete};
use nalgebra::{Matrix3, Vector3};
use realfft::RealFftPlanner;

pub(super) struct Run<'a> {
    pub(super) force: &'a [f64],
    pub(super) position: &'a [f64],
    pub(super) reference: Option<&'a [f64]>,
}

#[derive(Debug, Clone)]
pub(super) struct Estimate {
    /// `J`, `F_v`, `o`.
    pub(super) theta: [f64; 3],
    pub(super) deviations: [f64; 3],
    pub(super) estimator: Estimator,
    /// Lines used, those of a constant left out.
    pub(super) lines: usize,
    /// The highest of them.
    pub(super) highest_hz: f64,
    /// Cut-off of the filter on the position from which steps and the direction of the motion are taken.
    pub(super) smooth_hz: f64,
    pub(super) condition_number: f64,
    pub(super) relative_error_percent: f64,
}

/// Shortest record, samples.
const SHORTEST: usize = 64;
/// Steps of the iteration on instruments and weights.
const STEPS: usize = 12;
/// Steps to the part of the change of the force.
const SETTLED: usize = 100;
/// Power of the force over that of what the equations leave, from which a line is used.
const STANDS_OUT: f64 = 10.0;
/// Part of the force below which what is left is rounding of numbers.
const EXACT: f64 = 1e-13;
/// Cut-off of the smooth position over the highest line used.
const SMOOTH: f64 = 3.0;

/// Signals of one record between which the equation holds.
struct Lines {
    samples: usize,
    /// Lines that may be used.
    allowed: usize,
    acceleration: Vec<C>,
    velocity: Vec<C>,
    one: Vec<C>,
    mean_force: Vec<C>,
    half_change: Vec<C>,
    reference: Option<[Vec<C>; 2]>,
}

impl Lines {
    fn new(planner: &mut RealFftPlanner<f64>, run: &Run<'_>, t: f64, limit_hz: f64) -> Self {
        let samples = run.position.len() - 2;
        let window = window(samples);
        let mut of = |signal: Vec<f64>| spectrum(planner, &signal, &window);
        let held = |f: fn(f64, f64) -> f64| -> Vec<f64> {
            let pairs = run.force.windows(2).take(samples);
            pairs.map(|u| f(u[0], u[1])).collect()
        };
        let mut motion = |q: &[f64]| {
            let second = q.windows(3).map(|q| second(q, t)).collect();
            let first = q.windows(3).map(|q| first(q, t)).collect();
            [of(second), of(first)]
        };
        let [acceleration, velocity] = motion(run.position);
        let reference = run.reference.map(motion);
        Self {
            samples,
            allowed: (limit_hz * t * samples as f64) as usize + 1,
            acceleration,
            velocity,
            one: of(vec![1.0; samples]),
            mean_force: of(held(|before, now| 0.5 * (now + before))),
            half_change: of(held(|before, now| 0.5 * (now - before))),
            reference,
        }
    }

    /// Angle of a line, radians a sample.
    fn angle(&self, k: usize) -> f64 {
        std::f64::consts::TAU * k as f64 / self.samples as f64
    }

    fn counts(&self) -> usize {
        self.one.len()
    }
}

/// Speed of the middle of three positions, by central differences.
pub(super) fn first(q: &[f64], t: f64) -> f64 {
    (q[2] - q[0]) / (2.0 * t)
}

pub(super) fn second(q: &[f64], t: f64) -> f64 {
    (q[2] - 2.0 * q[1] + q[0]) / (t * t)
}

/// Inertia of the sampled equation to that of the mass, and the part of the change of the force.
fn continuous(sampled: f64, viscous: f64, t: f64) -> (f64, f64) {
    let half = viscous * t / (2.0 * sampled);
    if half.is_nan() || half.abs() > 0.95 {
        return (sampled, (half / 3.0).clamp(-1.0, 1.0));
    }
    let x = 2.0 * half.atanh();
    let change = if x.abs() > 1e-3 {
        1.0 / half - 2.0 / x
    } else {
        x / 6.0
    };
    let inertia = if x.abs() > 1e-6 { viscous * t / x } else { sampled };
    (inertia, change)
}

/// Derivatives of the inertia of the mass with respect to that of the sampled equation, the friction and the offset.
fn slopes(sampled: f64, viscous: f64, inertia: f64, t: f64) -> Vector3<f64> {
    let half = viscous * t / (2.0 * sampled);
    if half.is_nan() || half.abs() > 0.95 || half.abs() < 1e-4 {
        return Vector3::new(1.0, 0.0, 0.0);
    }
    let part = half / ((1.0 - half * half) * half.atanh());
    Vector3::new(inertia / sampled * part, inertia / viscous * (1.0 - part), 0.0)
}

/// The estimate from the lines up to a limit; none where no line stands out or the records are too short.
pub(super) fn estimate(runs: &[Run<'_>], clock: Discrete, limit_hz: f64) -> Option<Estimate> {
    if runs.iter().any(|r| r.position.len() < SHORTEST) {
        return None;
    }
    let t = clock.sample_time();
    let mut planner = RealFftPlanner::new();
    let lines: Vec<Lines> = runs
        .iter()
        .map(|r| Lines::new(&mut planner, r, t, limit_hz))
        .collect();
    let by_force = Fit::new(&lines, t, false).and_then(|fit| fit.finished(runs, &lines, clock));
    if lines.iter().any(|l| l.reference.is_none()) {
        return by_force;
    }
    // References that do not move the axis say little about it.
    const LARGEST_LOSS: f64 = 3.0;
    let by_reference = Fit::new(&lines, t, true).and_then(|fit| fit.finished(runs, &lines, clock));
    match (by_reference, by_force) {
        (Some(r), Some(f)) if f.theta[0] > 0.0 && r.deviations[0] > LARGEST_LOSS * f.deviations[0] => Some(f),
        (Some(r), _) if r.theta[0] > 0.0 => Some(r),
        (r, f) => f.or(r),
    }
}

/// The state of the iteration.
struct Fit {
    parts: Vec<Part<3>>,
    linear: Linear<3>,
    inertia: f64,
    /// The part of the change of the force.
    change: f64,
    /// Local power of what is left, at each line of each record.
    powers: Vec<Vec<f64>>,
    /// How many lines each of these powers is the mean of.
    counts: Vec<Vec<f64>>,
    by_reference: bool,
}

impl Fit {
    fn new(lines: &[Lines], t: f64, by_reference: bool) -> Option<Self> {
        let part = |l: &Lines| {
            let x: Vec<[C; 3]> = (0..l.counts())
                .map(|k| [l.acceleration[k], l.velocity[k], l.one[k]])
                .collect();
            // Noise of the position that is white.
            let noise = |k: usize| match k < l.allowed.max(OF_CONSTANT) {
                true => (l.angle(k.max(OF_CONSTANT)) / t).powi(4),
                false => f64::INFINITY,
            };
            Part {
                z: x.clone(),
                x,
                u: l.mean_force.clone(),
                noise: (0..l.counts()).map(noise).collect(),
            }
        };
        let parts: Vec<Part<3>> = lines.iter().map(part).collect();
        let linear = solve(&parts)?;
        let mut fit = Self {
            parts,
            linear,
            inertia: 0.0,
            change: 0.0,
            powers: Vec::new(),
            counts: Vec::new(),
            by_reference,
        };
        fit.weigh(lines, t);
        for _ in 1..STEPS {
            fit.instruments(lines, t);
            fit.linear = solve(&fit.parts)?;
            fit.weigh(lines, t);
        }
        (fit.used() > 0).then_some(fit)
    }

    /// Lines used, those of a constant left out.
    fn used(&self) -> usize {
        let of = |p: &Part<3>| p.noise.iter().skip(OF_CONSTANT).filter(|n| n.is_finite()).count();
        self.parts.iter().map(of).sum()
    }

    /// Force of the exact equation, powers of what is left of it, and the lines that stand out.
    fn weigh(&mut self, lines: &[Lines], t: f64) {
        // The equations are linear in the part of the change too, which the estimate sets.
        let slope: Vector3<f64> = self
            .parts
            .iter()
            .zip(lines)
            .map(|(part, l)| self.shift(part, &l.half_change))
            .sum();
        let (start, before) = (self.linear.theta, self.change);
        for _ in 0..SETTLED {
            (self.inertia, self.change) = continuous(self.linear.theta[0], self.linear.theta[1], t);
            self.linear.theta = start + slope * (self.change - before);
        }
        let change = self.change;
        self.powers.clear();
        self.counts.clear();
        for (part, l) in self.parts.iter_mut().zip(lines) {
            let residual = part.residual(&self.linear.theta);
            let used: Vec<f64> = self.linear.leverage(part).iter().map(|h| 1.0 - h).collect();
            let power: Vec<f64> = residual.iter().map(|e| e.norm_sqr()).collect();
            let (mut power, counts) = smoothed(&power, &used);
            let largest = l.mean_force.iter().fold(0.0, |m: f64, u| m.max(u.norm()));
            let least = (EXACT * largest).powi(2).max(f64::MIN_POSITIVE);
            power.iter_mut().for_each(|p| *p = p.max(least));
            for k in 0..part.u.len() {
                part.u[k] = l.mean_force[k] + l.half_change[k] * change;
                let stands_out =
                    k < OF_CONSTANT || (k < l.allowed && part.u[k].norm_sqr() > STANDS_OUT * power[k]);
                part.noise[k] = if stands_out { power[k] } else { f64::INFINITY };
            }
            self.powers.push(power);
            self.counts.push(counts);
        }
    }

    /// The motion of the reference, or that of the force by the last estimate: `q'' = s q'`, `q' = u / (F_v + J s)`
    /// with `s = 2 j tan(w T / 2) / T`.
    fn instruments(&mut self, lines: &[Lines], t: f64) {
        let theta = self.linear.theta;
        for (part, l) in self.parts.iter_mut().zip(lines) {
            for k in 0..part.u.len() {
                part.z[k] = match &l.reference {
                    Some([acceleration, velocity]) if self.by_reference => {
                        [acceleration[k], velocity[k], l.one[k]]
                    }
                    _ => {
                        let s = C::new(0.0, 2.0 * (0.5 * l.angle(k)).tan() / t);
                        let impedance = s * theta[0] + theta[1];
                        let velocity = (part.u[k] - l.one[k] * theta[2]) / impedance;
                        let is_known = velocity.re.is_finite() && velocity.im.is_finite();
                        let velocity = if is_known { velocity } else { C::default() };
                        [s * velocity, velocity, l.one[k]]
                    }
                };
            }
        }
    }

    fn finished(mut self, runs: &[Run<'_>], lines: &[Lines], clock: Discrete) -> Option<Estimate> {
        let (rate, nyquist) = (1.0 / clock.sample_time(), clock.nyquist_hz());
        let highest = |(part, l): (&Part<3>, &Lines)| {
            let last = part.noise.iter().rposition(|n| n.is_finite()).unwrap_or(0);
            last as f64 * rate / l.samples as f64
        };
        let highest_hz = self.parts.iter().zip(lines).map(highest).fold(0.0, f64::max);
        let longest = lines.iter().map(|l| l.samples).max()? as f64;
        let smooth_hz = (SMOOTH * highest_hz).max(8.0 * rate / longest).min(0.8 * nyquist);
        let random = self.linear.covariance(&self.parts, &self.powers) * self.student();
        let rounding = self.rounding(runs, clock, smooth_hz);
        let drag = drag(
            runs,
            &self.parts,
            &self.linear.theta,
            clock,
            [smooth_hz, highest_hz],
        );
        if let Some(inertia) = drag.inertia {
            self.hold(inertia, clock.sample_time());
        }
        let linear = random + rounding + Matrix3::from_diagonal(&drag.moved.component_mul(&drag.moved));
        let slopes = slopes(
            self.linear.theta[0],
            self.linear.theta[1],
            self.inertia,
            clock.sample_time(),
        );
        let mut variance = linear.diagonal();
        variance[0] = (slopes.transpose() * linear * slopes)[0];
        let theta = Vector3::new(self.inertia, self.linear.theta[1], self.linear.theta[2]);
        // What is left of the force in the band of the lines, not only at them.
        let [mut left, mut all] = [0.0; 2];
        for (part, l) in self.parts.iter().zip(lines) {
            let last = 1.2 * highest_hz / rate * l.samples as f64;
            let residual = part.residual(&self.linear.theta);
            for (e, u) in residual.iter().zip(&part.u).take(last as usize + 2 * OF_CONSTANT) {
                left += e.norm_sqr();
                all += u.norm_sqr();
            }
        }
        let deviations = variance.map(f64::sqrt);
        let is_finite = theta.iter().chain(deviations.iter()).all(|v| v.is_finite());
        is_finite.then(|| Estimate {
            theta: theta.into(),
            deviations: deviations.into(),
            estimator: match self.by_reference {
                true => Estimator::ReferenceInstruments,
                false => Estimator::InputInstruments,
            },
            lines: self.used(),
            highest_hz,
            smooth_hz,
            condition_number: self.linear.condition_number,
            relative_error_percent: 100.0 * (left / all).sqrt(),
        })
    }

    /// Friction and offset of the lines beside an inertia that is known from elsewhere.
    fn hold(&mut self, sampled: f64, t: f64) {
        let theta = &mut self.linear.theta;
        let Some(normal) = self.linear.inverse.try_inverse() else {
            return;
        };
        let Some(rest) = normal.fixed_view::<2, 2>(1, 1).into_owned().try_inverse() else {
            return;
        };
        let moved = rest * normal.fixed_view::<2, 1>(1, 0) * (theta[0] - sampled);
        *theta = Vector3::new(sampled, theta[1] + moved[0], theta[2] + moved[1]);
        self.inertia = continuous(sampled, theta[1], t).0;
    }

    /// Variance of Student's distribution with the degrees of freedom of the powers that count.
    fn student(&self) -> f64 {
        let [mut sum, mut weights] = [0.0; 2];
        for (part, counts) in self.parts.iter().zip(&self.counts) {
            let leverage = self.linear.leverage(part);
            for k in OF_CONSTANT..counts.len() {
                sum += leverage[k] * 2.0 * counts[k] / ALIKE;
                weights += leverage[k];
            }
        }
        let freedom = if weights > 0.0 {
            (sum / weights).max(3.0)
        } else {
            3.0
        };
        freedom / (freedom - 2.0)
    }

    /// What the steps of the encoder do to the estimate, as a covariance.
    fn rounding(&self, runs: &[Run<'_>], clock: Discrete, smooth_hz: f64) -> Matrix3<f64> {
        let t = clock.sample_time();
        let [sampled, viscous] = [self.linear.theta[0], self.linear.theta[1]];
        let force = |q: &[f64]| sampled * second(q, t) + viscous * first(q, t);
        let mut shifts = vec![Vector3::zeros(); rounding::TIMES];
        for (run, part) in runs.iter().zip(&self.parts) {
            let Some(forces) = rounding::forces(run.position, clock, smooth_hz, force) else {
                continue;
            };
            for (shift, lines) in shifts.iter_mut().zip(&forces) {
                *shift += self.shift(part, lines);
            }
        }
        shifts.iter().map(|s| s * s.transpose()).sum::<Matrix3<f64>>() / rounding::TIMES as f64
    }

    /// What a force beside does to the estimate.
    fn shift(&self, part: &Part<3>, force: &[C]) -> Vector3<f64> {
        let mut sum = Vector3::zeros();
        for ((z, noise), f) in part.z.iter().zip(&part.noise).zip(force) {
            if noise.is_finite() {
                sum += Vector3::from_fn(|i, _| (z[i].conj() * f).re / noise);
            }
        }
        self.linear.inverse * sum
    }
}
