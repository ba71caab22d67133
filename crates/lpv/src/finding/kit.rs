//! Random numbers and machines for the tests of the detectors.

use lpv_core::{Purpose, Record, RecordKind, Signals};

/// Reproducible random numbers (xorshift).
pub(super) struct Random(u64);

impl Random {
    pub(super) fn new(seed: u64) -> Self {
        let mut random = Self((seed + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        (0..8).for_each(|_| {
            random.unit();
        });
        random
    }

    pub(super) fn unit(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(super) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// A factor within so many decades either way.
    pub(super) fn decades(&mut self, decades: f64) -> f64 {
        10f64.powf(self.between(-decades, decades))
    }

    pub(super) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.unit()).cos()
    }

    pub(super) fn noise(&mut self, samples: usize, deviation: f64) -> Vec<f64> {
        (0..samples).map(|_| deviation * self.normal()).collect()
    }
}

/// A plant with one input and one output, `a y = b u`, coefficients of `z^0, z^-1, ...`; the first of `b` is zero where it has
/// no direct term.
#[derive(Clone)]
pub(super) struct Plant {
    pub(super) a: Vec<f64>,
    pub(super) b: Vec<f64>,
}

fn product(p: &[f64], q: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; p.len() + q.len() - 1];
    for (i, a) in p.iter().enumerate() {
        for (j, b) in q.iter().enumerate() {
            out[i + j] += a * b;
        }
    }
    out
}

impl Plant {
    /// A mode at `frequency` cycles a sample beside a real pair of poles: at 1 a free mass, inside a spring or a slow lag.
    pub(super) fn machine(frequency: f64, damping: f64, slow: [f64; 2], gain: f64) -> Self {
        let w = std::f64::consts::TAU * frequency;
        let r = (-damping * w).exp();
        let mode = [1.0, -2.0 * r * w.cos(), r * r];
        let size: f64 = mode.iter().sum();
        let slow = [1.0, -slow[0] - slow[1], slow[0] * slow[1]];
        // The mode has the gain 1 at rest; the slow part keeps that of a mass.
        Self {
            a: product(&mode, &slow),
            b: vec![0.0, 0.5 * gain * size, 0.5 * gain * size],
        }
    }

    /// Input and output in the loop `u = r - b_y / a_c y` with noise `e` on the output that is measured.
    pub(super) fn in_loop(&self, controller: &[Vec<f64>; 2], r: &[f64], e: &[f64]) -> [Vec<f64>; 2] {
        let [b, a] = controller;
        let (mut u, mut y, mut x) = (Vec::new(), Vec::new(), Vec::<f64>::new());
        let past = |p: &[f64], s: &[f64], k: usize| -> f64 {
            (1..p.len().min(k + 1)).map(|i| p[i] * s[k - i]).sum()
        };
        let mut v = Vec::<f64>::new();
        for k in 0..r.len() {
            x.push((past(&self.b, &u, k) - past(&self.a, &x, k)) / self.a[0]);
            y.push(x[k] + e[k]);
            v.push((b[0] * y[k] + past(b, &y, k) - past(a, &v, k)) / a[0]);
            u.push(r[k] - v[k]);
        }
        [u, y]
    }

    /// Output without a loop.
    pub(super) fn open(&self, u: &[f64]) -> Vec<f64> {
        let mut y = Vec::with_capacity(u.len());
        for k in 0..u.len() {
            let from = |p: &[f64], s: &[f64], first: usize| -> f64 {
                (first..p.len().min(k + 1)).map(|i| p[i] * s[k - i]).sum()
            };
            let new = from(&self.b, u, 0) - from(&self.a, &y, 1);
            y.push(new / self.a[0]);
        }
        y
    }
}

/// A random-phase multisine with so many lines from the first on, rms 1, repeated.
pub(super) fn multisine(random: &mut Random, period: usize, lines: usize, samples: usize) -> Vec<f64> {
    let phases: Vec<f64> = (0..lines)
        .map(|_| std::f64::consts::TAU * random.unit())
        .collect();
    let size = (2.0 / lines as f64).sqrt();
    let one: Vec<f64> = (0..period)
        .map(|t| {
            let angle = |k: usize| std::f64::consts::TAU * ((k + 1) * t % period) as f64 / period as f64;
            phases
                .iter()
                .enumerate()
                .map(|(k, p)| size * (angle(k) + p).cos())
                .sum()
        })
        .collect();
    (0..samples).map(|t| one[t % period]).collect()
}

/// A record with these signals; empty ones are left out.
pub(super) fn record(period: Option<usize>, r: &[f64], u: &[f64], y: &[f64]) -> Record {
    let signals = |name: &str, x: &[f64]| {
        if x.is_empty() {
            Signals::default()
        } else {
            Signals::new(&[name], vec![x.to_vec()])
        }
    };
    Record {
        name: "run".to_owned(),
        kind: period.map_or(RecordKind::Transient, |period| RecordKind::Periodic { period }),
        purpose: Purpose::Estimation,
        position: None,
        outputs: signals("y", y),
        inputs: signals("u", u),
        references: signals("r", r),
        scheduling: Signals::default(),
        auxiliary: Signals::default(),
        injection: Signals::default(),
    }
}
