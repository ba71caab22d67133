//! Many modes and many channels at one position: responses are sums of partial fractions in z, with noise of few periods whose covariance
//! is estimated as from a measurement. Nothing here comes from the code that estimates.

use super::{C64, MOST_MIB, RATE, bars, mebibytes, normal, percent_within, pole};
use crate::TaskError;
use crate::memory::measured;
use lpv::lpv_core::{Discrete, Frf, FrfEstimate};
use lpv::{Identified, IdentifyConfig, Moves, identify, silent};
use lpv_numerics::statistics::median;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

/// What a kind of machine is.
#[derive(Clone, Copy)]
pub(super) struct Kind {
    pub(super) modes: usize,
    /// Outputs and inputs.
    pub(super) size: (usize, usize),
    /// Rank of the gain of the rigid body; none without one.
    rigid: usize,
    lines: usize,
    /// Periods, after which the covariance has `inputs (periods - 1)` degrees of freedom.
    periods: usize,
    /// Response over noise in the mean over the lines, dB.
    snr_db: f64,
    /// Seconds that it may take.
    seconds: f64,
    /// One of so many seeds is enough.
    pub(super) thinned: u64,
}

const fn one_channel(modes: usize) -> Kind {
    Kind {
        modes,
        size: (1, 1),
        rigid: 0,
        lines: 1116,
        periods: 8,
        snr_db: 66.0,
        seconds: 5.0,
        thinned: 1,
    }
}

const fn stage(modes: usize, size: (usize, usize), periods: usize, seconds: f64, thinned: u64) -> Kind {
    Kind {
        modes,
        size,
        rigid: 3,
        lines: 1720,
        periods,
        snr_db: 40.0,
        seconds,
        thinned,
    }
}

pub(super) const KINDS: [Kind; 9] = [
    one_channel(5),
    one_channel(10),
    one_channel(15),
    one_channel(20),
    one_channel(30),
    stage(12, (4, 4), 4, 60.0, 1),
    stage(12, (6, 6), 4, 60.0, 4),
    stage(17, (13, 4), 4, 60.0, 1),
    stage(20, (14, 14), 4, f64::INFINITY, 20),
];

impl Kind {
    /// States of the machine.
    pub(super) fn states(&self) -> usize {
        2 * (self.modes + self.rigid)
    }

    /// Whether other tools are tried on it: they take hours for the largest.
    pub(super) fn has_peers(&self) -> bool {
        self.rigid > 0 && self.size.0 * self.size.1 <= 52
    }
}

/// One machine and what came of it.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Case {
    states: usize,
    cost_over_expected: f64,
    /// Residual over the noise, dB.
    residual_db: f64,
    /// Error of the response over the Cramer-Rao bound of its mean square.
    over_bound: f64,
    /// Frequencies and dampings within three deviations, of how many.
    within: [usize; 2],
    seconds: f64,
    /// Peak of the resident memory of the process; none where it is not known.
    #[serde(default)]
    mib: Option<f64>,
}

/// All machines of a kind.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Row {
    modes: usize,
    outputs: usize,
    inputs: usize,
    /// States of the machine.
    states: usize,
    pub(super) cases: Vec<Case>,
    /// Seconds that it may take; none without a bar.
    most_seconds: Option<f64>,
}

struct Machine {
    poles: Vec<C64>,
    /// Factors of the residues, outputs then inputs.
    shapes: Vec<Vec<f64>>,
    rigid: Vec<Vec<f64>>,
    size: (usize, usize),
}

impl Machine {
    /// Modes of damping 0.2 to 1 % over the band, no two closer than a fifth of their mean distance.
    fn new(kind: &Kind, band: (f64, f64), rng: &mut ChaCha8Rng) -> Self {
        let gap = (band.1 - band.0) / kind.modes as f64;
        let poles = (0..kind.modes).map(|i| {
            let hz = band.0 + gap * (i as f64 + rng.random_range(0.1..0.9));
            pole(hz, rng)
        });
        let poles: Vec<C64> = poles.collect();
        let ports = kind.size.0 + kind.size.1;
        let mut shape = || {
            (0..ports)
                .map(|_| StandardNormal.sample(rng))
                .collect::<Vec<f64>>()
        };
        // One channel sees every mode: sizes within a factor of four.
        let shapes = (0..kind.modes).map(|_| {
            let mut own = shape();
            if ports == 2 {
                own.iter_mut()
                    .for_each(|v| *v = v.signum() * (0.5 + v.abs().min(1.5)));
            }
            own
        });
        Self {
            shapes: shapes.collect(),
            rigid: (0..kind.rigid).map(|_| shape()).collect(),
            poles,
            size: kind.size,
        }
    }

    fn response(&self, f: f64) -> Vec<C64> {
        let z = C64::from_polar(1.0, std::f64::consts::TAU * f / RATE);
        let phi = (z + 1.0) / ((z - 1.0) * (z - 1.0)) * (0.5 / RATE / RATE);
        let fractions: Vec<C64> = self.poles.iter().map(|l| C64::i() / (z - l)).collect();
        let conjugates: Vec<C64> = self.poles.iter().map(|l| -C64::i() / (z - l.conj())).collect();
        let mut values = Vec::new();
        for j in 0..self.size.1 {
            for i in 0..self.size.0 {
                let gain = |s: &Vec<f64>| s[i] * s[self.size.0 + j];
                let terms = self.shapes.iter().zip(fractions.iter().zip(&conjugates));
                let flexible: C64 = terms.map(|(s, (a, b))| (a + b) * (gain(s) * 1e-3)).sum();
                values.push(flexible + phi * (100.0 * self.rigid.iter().map(gain).sum::<f64>()));
            }
        }
        values
    }
}

/// Frequency and damping of a mode, each with its deviation.
macro_rules! figures {
    ($mode:expr) => {
        [
            $mode.frequency_hz,
            $mode.frequency_deviation_hz,
            $mode.damping,
            $mode.damping_deviation,
        ]
    };
}

/// A measurement of a machine.
pub(super) struct Measurement {
    machine: Machine,
    pub(super) estimate: FrfEstimate,
    truth: Vec<Vec<C64>>,
    /// Of an entry of the response.
    deviation: f64,
    /// Real unknowns of the machine.
    unknowns: usize,
}

impl Measurement {
    pub(super) fn new(kind: &Kind, seed: u64) -> Result<Self, TaskError> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let (n_y, n_u) = kind.size;
        let step = 1.1;
        let lines: Vec<f64> = (8..8 + kind.lines).map(|k| step * k as f64).collect();
        let band = (60.0, 0.85 * step * kind.lines as f64);
        let machine = Machine::new(kind, band, &mut rng);
        let truth: Vec<Vec<C64>> = lines.iter().map(|&f| machine.response(f)).collect();
        // The noise is measured by the median line: a rigid body is far above it at the first ones.
        let sizes: Vec<f64> = truth
            .iter()
            .map(|line| line.iter().map(|v| v.norm_sqr()).sum::<f64>() / line.len() as f64)
            .collect();
        let middle = match kind.rigid {
            0 => sizes.iter().sum::<f64>() / sizes.len() as f64,
            _ => median(&sizes),
        };
        let deviation = middle.sqrt() * 10f64.powf(-kind.snr_db / 20.0);
        let (mut values, mut c_v, mut s) = (Vec::new(), Vec::new(), Vec::new());
        let free = (n_u * (kind.periods - 1)) as f64;
        for line in &truth {
            let mut line = line.clone();
            let mut covariance = vec![C64::from(0.0); n_y * n_y];
            for column in line.chunks_exact_mut(n_y) {
                // Noise of each period; its mean is the error, its scatter the covariance.
                let draws: Vec<Vec<C64>> = (0..kind.periods)
                    .map(|_| {
                        let of = |_| normal(&mut rng) * (deviation * (kind.periods as f64).sqrt());
                        (0..n_y).map(of).collect()
                    })
                    .collect();
                let mean: Vec<C64> = (0..n_y)
                    .map(|i| draws.iter().map(|d| d[i]).sum::<C64>() / kind.periods as f64)
                    .collect();
                for (v, m) in column.iter_mut().zip(&mean) {
                    *v += m;
                }
                for draw in &draws {
                    for j in 0..n_y {
                        for i in 0..n_y {
                            covariance[j * n_y + i] += (draw[i] - mean[i]) * (draw[j] - mean[j]).conj();
                        }
                    }
                }
            }
            values.extend(line);
            c_v.extend(covariance.iter().map(|v| v / (free * kind.periods as f64)));
            s.extend((0..n_u * n_u).map(|i| C64::from(f64::from(u8::from(i % (n_u + 1) == 0)))));
        }
        let estimate = FrfEstimate::new(Frf::new(lines, n_y, n_u, values)?, c_v, s, free, None)?;
        // White noise of one size: each real unknown of the machine takes half of a variance.
        let per_mode = if n_y.min(n_u) > 1 { 2 * (n_y + n_u) } else { 4 };
        let of_body = kind.rigid * (n_y + n_u) - kind.rigid * kind.rigid;
        Ok(Self {
            unknowns: kind.modes * per_mode + of_body,
            machine,
            estimate,
            truth,
            deviation,
        })
    }

    /// Of a response: its residual over the noise, dB, and its error over the Cramer-Rao bound of the mean square.
    pub(super) fn score<'a>(&self, line: impl Fn(usize) -> &'a [C64]) -> [f64; 2] {
        let (mut error, mut residual, mut count) = (0.0, 0.0, 0);
        for (k, own) in self.truth.iter().enumerate() {
            let measured = self.estimate.frf().line_slice(k);
            for ((g, t), m) in line(k).iter().zip(own).zip(measured) {
                error += (g - t).norm_sqr();
                residual += (g - m).norm_sqr();
                count += 1;
            }
        }
        let variance = self.deviation * self.deviation;
        [
            10.0 * (residual / (f64::from(count) * variance)).log10(),
            (error / (0.5 * self.unknowns as f64 * variance)).sqrt(),
        ]
    }

    /// Frequencies and dampings within three of their deviations, of how many. `modes`: frequency and damping, each with its deviation.
    fn within(&self, modes: &[[f64; 4]]) -> [usize; 2] {
        let mut within = [0, 0];
        for pole in &self.machine.poles {
            let s = pole.ln() * RATE;
            let (f, d) = (s.norm() / std::f64::consts::TAU, -s.re / s.norm());
            within[1] += 2;
            let nearest = modes
                .iter()
                .min_by(|a, b| (a[0] - f).abs().total_cmp(&(b[0] - f).abs()));
            if let Some([own_f, dev_f, own_d, dev_d]) = nearest {
                within[0] += usize::from((own_f - f).abs() <= 3.0 * dev_f);
                within[0] += usize::from((own_d - d).abs() <= 3.0 * dev_d);
            }
        }
        within
    }
}

fn case(kind: &Kind, seed: u64) -> Result<Case, TaskError> {
    let measurement = Measurement::new(kind, seed)?;
    let clock = Discrete::from_rate(RATE)?;
    let moves = Moves::none("one position");
    let config = IdentifyConfig::default();
    let one = std::slice::from_ref(&measurement.estimate);
    let (found, taken) = measured(|| identify(one, clock, &moves, &config, &silent));
    let found = found?;
    let Identified::Lti(stage) = &found else {
        return Err("one position gave a model of several".into());
    };
    let account = &stage.poles.fits[0].account;
    let modal = stage.modal.as_ref();
    let modes: Vec<[f64; 4]> = match modal {
        Some(modal) => modal.modes.iter().map(|m| figures!(m)).collect(),
        None => stage.poles.fits[0].modes().iter().map(|m| figures!(m)).collect(),
    };
    let model = found.response(0.0, measurement.estimate.frf().frequencies_hz(), clock)?;
    let [residual_db, over_bound] = measurement.score(|k| model.line_slice(k));
    Ok(Case {
        states: stage.model.states(),
        cost_over_expected: modal.map_or(account.cost / account.expected_cost, |m| {
            m.account.cost / m.account.expected_cost
        }),
        residual_db,
        over_bound,
        within: measurement.within(&modes),
        seconds: taken.seconds,
        mib: taken.mib,
    })
}

impl Row {
    pub(super) fn new(kind: &Kind, seeds: std::ops::Range<u64>) -> Result<Self, TaskError> {
        Ok(Self {
            modes: kind.modes,
            outputs: kind.size.0,
            inputs: kind.size.1,
            states: kind.states(),
            cases: seeds.map(|seed| case(kind, seed)).collect::<Result<_, _>>()?,
            most_seconds: kind.seconds.is_finite().then_some(kind.seconds),
        })
    }

    fn right(&self) -> usize {
        self.cases.iter().filter(|c| c.states == self.states).count()
    }

    fn of(&self, value: impl Fn(&Case) -> f64) -> f64 {
        median(&self.cases.iter().map(value).collect::<Vec<_>>())
    }

    fn most(&self, value: impl Fn(&Case) -> f64) -> f64 {
        self.cases.iter().map(value).fold(f64::NEG_INFINITY, f64::max)
    }

    fn within(&self) -> f64 {
        percent_within(self.cases.iter().map(|c| c.within))
    }

    /// The bars that do not hold.
    pub(super) fn broken(&self) -> Vec<&'static str> {
        let mut broken = Vec::new();
        if self.outputs * self.inputs == 1 {
            if self.most(|c| c.residual_db) > 1.0 {
                broken.push("residual");
            }
        } else {
            if self.right() < self.cases.len() {
                broken.push("states");
            }
            if self.within() < 95.0 {
                broken.push("deviations");
            }
            if self.of(|c| (c.cost_over_expected - 1.0).abs()) > 0.05 {
                broken.push("cost");
            }
            if self.of(|c| c.over_bound) > 1.2 {
                broken.push("bound");
            }
        }
        if self
            .most_seconds
            .is_some_and(|most| self.most(|c| c.seconds) > most)
        {
            broken.push("time");
        }
        if self.mib() > MOST_MIB {
            broken.push("memory");
        }
        broken
    }

    fn mib(&self) -> f64 {
        self.most(|c| c.mib.unwrap_or(f64::NEG_INFINITY))
    }

    pub(super) fn line(&self) -> String {
        let broken = self.broken();
        format!(
            "| {} x {} | {} | {} | {} of {} | {:+.2} | {:.3} | {:.2} | {:.1} % | {:.1} | {} | {} |",
            self.outputs,
            self.inputs,
            self.modes,
            self.states,
            self.right(),
            self.cases.len(),
            self.most(|c| c.residual_db),
            self.of(|c| c.cost_over_expected),
            self.of(|c| c.over_bound),
            self.within(),
            self.most(|c| c.seconds),
            mebibytes(self.mib()),
            bars(&broken)
        )
    }
}
