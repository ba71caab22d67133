//! Experiments on a linear machine: multisines, moves, loops with sampled controllers, sensors.

use super::draw::Draw;
use super::machine::{C64, Linear};
use lpv_core::nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

/// Coefficients of z^-k of `u = B_r/A r - B_y/A y`, one loop; as in a description.
#[derive(Debug, Clone)]
pub(crate) struct Controller {
    pub(crate) reference: Vec<f64>,
    pub(crate) feedback: Vec<f64>,
    pub(crate) denominator: Vec<f64>,
}

impl Controller {
    /// A lead filter for the mass `mass` with this bandwidth, by Tustin's rule: `K(s) = m w^2/3 (1 + 3 s/w)/(1 + s/(3 w))`.
    pub(crate) fn lead(mass: f64, bandwidth_hz: f64, h: f64) -> Self {
        let w = TAU * bandwidth_hz;
        let gain = mass * w * w / 3.0;
        let s = 2.0 / h;
        let (n0, n1) = (1.0 + 3.0 * s / w, 1.0 - 3.0 * s / w);
        let (d0, d1) = (1.0 + s / (3.0 * w), 1.0 - s / (3.0 * w));
        let numerator = vec![gain * n0 / d0, gain * n1 / d0];
        Self {
            reference: numerator.clone(),
            feedback: numerator,
            denominator: vec![1.0, d1 / d0],
        }
    }
    /// `B_y/A` at `cycles` a sample.
    pub(crate) fn response(&self, cycles: f64) -> C64 {
        let at = |c: &[f64]| {
            c.iter().enumerate().fold(C64::new(0.0, 0.0), |sum, (k, v)| {
                sum + C64::from_polar(1.0, -TAU * cycles * k as f64) * *v
            })
        };
        at(&self.feedback) / at(&self.denominator)
    }
    /// The table of a description.
    pub(crate) fn table(&self) -> String {
        format!(
            "[controller]\nreference_numerator = {:?}\nfeedback_numerator = {:?}\ndenominator = {:?}\n",
            self.reference, self.feedback, self.denominator
        )
    }
}

/// A loop for each channel, or none, and what acts.
#[derive(Debug, Clone, Default)]
pub(crate) struct Run {
    /// Setpoints by channel; of a machine without controllers, its inputs.
    pub(crate) reference: Vec<Vec<f64>>,
    /// Force beside the controller's, by channel; or none.
    pub(crate) injected: Vec<Vec<f64>>,
    /// Deviation of the noise of each output.
    pub(crate) noise: Vec<f64>,
    /// The amplifier's limit, which the logged command does not know.
    pub(crate) hidden_limit: Option<f64>,
}

/// Signals by channel.
#[derive(Debug, Clone, Default)]
pub(crate) struct Signals {
    pub(crate) y: Vec<Vec<f64>>,
    pub(crate) u: Vec<Vec<f64>>,
    pub(crate) r: Vec<Vec<f64>>,
}

/// Runs a sampled machine from rest.
pub(crate) fn simulate(machine: &Linear, loops: &[Controller], run: &Run, draw: &mut Draw) -> Signals {
    let (inputs, outputs) = (machine.b.ncols(), machine.c.nrows());
    let samples = run.reference.first().or(run.injected.first()).map_or(0, Vec::len);
    let mut x = DVector::zeros(machine.a.nrows());
    let mut out = Signals {
        y: vec![Vec::with_capacity(samples); outputs],
        u: vec![Vec::with_capacity(samples); inputs],
        r: run.reference.clone(),
    };
    let past = |signal: &[f64], k: usize, j: usize| if k >= j { signal[k - j] } else { 0.0 };
    for k in 0..samples {
        let clean = &machine.c * &x;
        for (i, y) in out.y.iter_mut().enumerate() {
            y.push(clean[i] + run.noise.get(i).map_or(0.0, |s| s * draw.normal()));
        }
        let mut u = DVector::zeros(inputs);
        for i in 0..inputs {
            let mut command = match loops.get(i) {
                None => run.reference[i][k],
                Some(c) => {
                    let r = run.reference.get(i).map_or(&[][..], Vec::as_slice);
                    let of = |b: &[f64], s: &[f64]| -> f64 {
                        b.iter().enumerate().map(|(j, b)| b * past(s, k, j)).sum()
                    };
                    let set = if r.is_empty() { 0.0 } else { of(&c.reference, r) };
                    let back: f64 = (1..c.denominator.len())
                        .map(|j| c.denominator[j] * past(&out.u[i], k, j))
                        .sum();
                    set - of(&c.feedback, &out.y[i]) - back
                }
            };
            command += run.injected.get(i).map_or(0.0, |f| f[k]);
            out.u[i].push(command);
            u[i] = run.hidden_limit.map_or(command, |l| command.clamp(-l, l));
        }
        x = machine.step(&x, &u);
    }
    out
}

/// A period of a multisine on these lines, of unit rms; of some draws of its phases the one with the lowest peak.
pub(crate) fn multisine(draw: &mut Draw, period: usize, lines: &[usize]) -> Vec<f64> {
    let amplitude = (2.0 / lines.len() as f64).sqrt();
    let turns: Vec<f64> = (0..period)
        .map(|t| (TAU * t as f64 / period as f64).cos())
        .collect();
    let quarter = |t: usize, phase: usize| turns[(t + phase) % period];
    let one = |draw: &mut Draw| -> Vec<f64> {
        let phases: Vec<usize> = lines.iter().map(|_| draw.integer(0, period - 1)).collect();
        let at = |t: usize| {
            lines
                .iter()
                .zip(&phases)
                .map(|(k, phase)| quarter((k * t) % period, *phase))
                .sum::<f64>()
        };
        (0..period).map(|t| amplitude * at(t)).collect()
    };
    let peak = |signal: &[f64]| signal.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let mut best = one(draw);
    for _ in 0..5 {
        let next = one(draw);
        if peak(&next) < peak(&best) {
            best = next;
        }
    }
    best
}

/// A period, so many times.
pub(crate) fn repeated(period: &[f64], times: usize) -> Vec<f64> {
    period
        .iter()
        .copied()
        .cycle()
        .take(period.len() * times)
        .collect()
}

/// The setpoint that makes a controller give this periodic force where the output rests.
pub(crate) fn setpoint_of(force: &[f64], controller: &Controller, lines: &[usize]) -> Vec<f64> {
    let n = force.len();
    let mut setpoint = vec![0.0; n];
    for k in lines {
        let turn = |t: usize| TAU * ((k * t) % n) as f64 / n as f64;
        let sum = force
            .iter()
            .enumerate()
            .fold(C64::new(0.0, 0.0), |s, (t, f)| s + C64::from_polar(*f, -turn(t)));
        let wanted = sum * 2.0 / n as f64 / controller.response(*k as f64 / n as f64);
        for (t, r) in setpoint.iter_mut().enumerate() {
            *r += (wanted * C64::from_polar(1.0, turn(t))).re;
        }
    }
    setpoint
}

/// A path that rests, moves smoothly to each target within `steps` samples, and rests again.
pub(crate) fn moves(targets: &[f64], steps: usize, rest: usize) -> Vec<f64> {
    let mut path = vec![0.0; rest];
    let mut from = 0.0;
    for target in targets {
        path.extend((1..=steps).map(|k| {
            let t = k as f64 / steps as f64;
            from + (target - from) * t * t * t * (10.0 - 15.0 * t + 6.0 * t * t)
        }));
        path.extend(std::iter::repeat_n(*target, rest));
        from = *target;
    }
    path
}

/// Root mean square.
pub(crate) fn rms(signal: &[f64]) -> f64 {
    (signal.iter().map(|v| v * v).sum::<f64>() / signal.len().max(1) as f64).sqrt()
}

/// The loop of a machine with its controllers, as its state matrix of one sample; for its stability.
pub(crate) fn loop_radius(machine: &Linear, loops: &[Controller]) -> f64 {
    // Controllers of first order: u = d0 e + c x_k, x_k' = a x_k + b e.
    let (n, m) = (machine.a.nrows(), machine.b.ncols());
    let mut a = DMatrix::zeros(n + m, n + m);
    a.view_mut((0, 0), (n, n)).copy_from(&machine.a);
    for (i, c) in loops.iter().enumerate() {
        let pole = -c.denominator.get(1).copied().unwrap_or(0.0);
        let (d0, d1) = (c.feedback[0], c.feedback.get(1).copied().unwrap_or(0.0));
        let row = machine.c.row(i);
        let column = machine.b.column(i);
        let from_y = column * row * d0;
        let mut top = a.view_mut((0, 0), (n, n));
        top -= &from_y;
        a.view_mut((0, n + i), (n, 1)).copy_from(&column);
        a.view_mut((n + i, 0), (1, n))
            .copy_from(&(row * -(d1 + pole * d0)));
        a[(n + i, n + i)] = pole;
    }
    Linear {
        a,
        b: DMatrix::zeros(n + m, 1),
        c: DMatrix::zeros(1, n + m),
        d: DMatrix::zeros(1, 1),
    }
    .radius()
}
