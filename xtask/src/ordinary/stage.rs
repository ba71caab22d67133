//! Stages of many channels along a line: a rigid body and bending modes that do not move, seen by sensors, or driven by actuators, that
//! the stage passes by.
//!
//! Mode shapes are standing waves over the plane of the stage; responses are sums of partial fractions in z with noise whose covariance is
//! known, so that the truth is known between the positions too. Nothing here comes from the code that estimates.

use super::{C64, MOST_MIB, RATE, bars, mebibytes, normal, pole};
use crate::TaskError;
use crate::memory::measured;
use lpv::lpv_core::{Discrete, Frf, FrfEstimate};
use lpv::{Identified, IdentifyConfig, Moves, identify, silent};
use lpv_numerics::statistics::median;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// What a kind of stage is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stage {
    /// Outputs, and inputs.
    channels: usize,
    modes: usize,
    positions: usize,
    /// Whether the actuators stand on the ground as the sensors do.
    both: bool,
    /// Seconds that it may take.
    seconds: f64,
}

const fn stage(channels: usize, modes: usize, positions: usize, both: bool, seconds: f64) -> Stage {
    Stage {
        channels,
        modes,
        positions,
        both,
        seconds,
    }
}

pub(super) const STAGES: [Stage; 6] = [
    stage(3, 3, 5, false, 60.0),
    stage(3, 3, 5, true, 60.0),
    stage(4, 6, 7, false, 180.0),
    stage(4, 6, 7, true, 180.0),
    stage(6, 12, 7, false, 600.0),
    stage(6, 12, 9, true, 600.0),
];

/// Error over the noise of a response that a model may have.
const BAR: f64 = 1.5;

/// One machine and what came of it.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Case {
    states: usize,
    deltas: usize,
    /// Median over the lines of the error against the truth over the noise of a response: at the positions, and the largest between them.
    error: [f64; 2],
    seconds: f64,
    /// Peak of the resident memory of the process; none where it is not known.
    #[serde(default)]
    mib: Option<f64>,
}

/// All machines of a kind.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Row {
    name: String,
    /// States of the machine.
    states: usize,
    most_seconds: f64,
    cases: Vec<Case>,
}

impl Row {
    pub(super) fn of(stage: &Stage, seeds: std::ops::Range<u64>) -> Result<Self, TaskError> {
        let n = stage.channels;
        let ground = if stage.both {
            "sensors and actuators"
        } else {
            "sensors"
        };
        Ok(Self {
            name: format!(
                "{n} x {n}, {} modes, {} positions, {ground} on the ground",
                stage.modes, stage.positions
            ),
            states: 6 + 2 * stage.modes,
            most_seconds: stage.seconds,
            cases: seeds.map(|seed| case(stage, seed)).collect::<Result<_, _>>()?,
        })
    }

    /// The bars that do not hold.
    pub(super) fn broken(&self) -> Vec<&'static str> {
        let mut broken = Vec::new();
        if self.cases.iter().any(|c| c.states != self.states) {
            broken.push("states");
        }
        if self.most(|c| c.error[0].max(c.error[1])) > BAR {
            broken.push("responses");
        }
        if self.most(|c| c.seconds) > self.most_seconds {
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

    fn most(&self, value: impl Fn(&Case) -> f64) -> f64 {
        self.cases.iter().map(value).fold(f64::NEG_INFINITY, f64::max)
    }

    pub(super) fn line(&self) -> String {
        let least = |value: fn(&Case) -> usize| self.cases.iter().map(value).min().unwrap_or(0);
        let most = |value: fn(&Case) -> usize| self.cases.iter().map(value).max().unwrap_or(0);
        format!(
            "| {} | {} | {} | {} to {} | {} to {} | {:.2} | {:.2} | {:.1} | {} | {} |",
            self.name,
            self.cases.len(),
            self.states,
            least(|c| c.states),
            most(|c| c.states),
            least(|c| c.deltas),
            most(|c| c.deltas),
            self.most(|c| c.error[0]),
            self.most(|c| c.error[1]),
            self.most(|c| c.seconds),
            mebibytes(self.mib()),
            bars(&self.broken())
        )
    }
}

/// Poles, and shapes as functions of the place on the stage.
struct Machine {
    poles: Vec<C64>,
    /// Wave numbers and phases along x and y.
    waves: Vec<[f64; 4]>,
    sensors: Vec<[f64; 2]>,
    actuators: Vec<[f64; 2]>,
    both: bool,
}

impl Machine {
    fn new(stage: &Stage, rng: &mut ChaCha8Rng) -> Self {
        let poles = (0..stage.modes).map(|i| {
            let hz = 100.0 * (1.0 + 0.5 * (i as f64 + rng.random_range(0.1..0.6)));
            pole(hz, rng)
        });
        let poles: Vec<C64> = poles.collect();
        let waves = (0..stage.modes).map(|i| {
            // The first modes have the longest waves.
            let most = 0.5 + 1.0 * i as f64 / stage.modes as f64;
            [
                most * rng.random_range(0.4..1.0),
                rng.random_range(0.0..6.3),
                most * rng.random_range(0.4..1.0),
                rng.random_range(0.0..6.3),
            ]
        });
        let waves: Vec<[f64; 4]> = waves.collect();
        let mut place = || [rng.random_range(-2.5..2.5), rng.random_range(-2.5..2.5)];
        Self {
            sensors: (0..stage.channels).map(|_| place()).collect(),
            actuators: (0..stage.channels).map(|_| place()).collect(),
            poles,
            waves,
            both: stage.both,
        }
    }

    /// Heave, two tilts, and the modes.
    fn shape(&self, [x, y]: [f64; 2]) -> Vec<f64> {
        let waves = self
            .waves
            .iter()
            .map(|[k, a, l, b]| (k * x + a).cos() * (l * y + b).cos());
        [1.0, 0.5 * x, 0.5 * y].into_iter().chain(waves).collect()
    }

    /// One column an input.
    fn response(&self, p: f64, f: f64) -> Vec<C64> {
        let z = C64::from_polar(1.0, std::f64::consts::TAU * f / RATE);
        let body = (z + 1.0) / ((z - 1.0) * (z - 1.0)) * (50.0 / RATE / RATE);
        let fractions: Vec<C64> = self
            .poles
            .iter()
            .map(|l| (C64::i() / (z - l) - C64::i() / (z - l.conj())) * 1e-3)
            .collect();
        let seen: Vec<Vec<f64>> = self
            .sensors
            .iter()
            .map(|s| self.shape([s[0] - p, s[1]]))
            .collect();
        let moved = if self.both { p } else { 0.0 };
        self.actuators
            .iter()
            .flat_map(|a| {
                let into = self.shape([a[0] - moved, a[1]]);
                let gain = |out: &Vec<f64>| -> C64 {
                    let term = |i: usize| {
                        let of_mode = i.checked_sub(3).map_or(body, |k| fractions[k]);
                        of_mode * (out[i] * into[i])
                    };
                    (0..into.len()).map(term).sum()
                };
                seen.iter().map(gain).collect::<Vec<_>>()
            })
            .collect()
    }
}

fn case(stage: &Stage, seed: u64) -> Result<Case, TaskError> {
    /// Response over noise at the median line, dB.
    const SNR_DB: f64 = 60.0;
    const STEP_HZ: f64 = 1.2;
    const LINES: usize = 1400;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let machine = Machine::new(stage, &mut rng);
    let n = stage.channels;
    let lines: Vec<f64> = (8..8 + LINES).map(|k| STEP_HZ * k as f64).collect();
    let norm = |line: &[C64]| line.iter().map(|v| v.norm_sqr()).sum::<f64>().sqrt();
    let sizes: Vec<f64> = lines.iter().map(|f| norm(&machine.response(0.0, *f))).collect();
    let noise = median(&sizes) / n as f64 * 10f64.powf(-SNR_DB / 20.0);
    let positions: Vec<f64> = (0..stage.positions)
        .map(|i| 2.0 * i as f64 / (stage.positions - 1) as f64 - 1.0)
        .collect();
    let clock = Discrete::from_rate(RATE)?;
    let one = |v: f64| -> Vec<C64> {
        let of = |i: usize| C64::from(if i.is_multiple_of(n + 1) { v } else { 0.0 });
        (0..LINES).flat_map(|_| (0..n * n).map(of)).collect()
    };
    let mut estimates = Vec::with_capacity(positions.len());
    for p in &positions {
        let mut values: Vec<C64> = lines.iter().flat_map(|f| machine.response(*p, *f)).collect();
        values.iter_mut().for_each(|v| *v += normal(&mut rng) * noise);
        let frf = Frf::new(lines.clone(), n, n, values)?;
        let place = Some(vec![*p].into());
        estimates.push(FrfEstimate::new(
            frf,
            one(noise * noise),
            one(1.0),
            f64::INFINITY,
            place,
        )?);
    }
    let config = IdentifyConfig::default();
    let moves = Moves::none("there are none");
    let (found, taken) = measured(|| identify(&estimates, clock, &moves, &config, &silent));
    let found = found?;
    let small = match &found {
        Identified::Lpv(stage) => stage.small.as_ref(),
        Identified::Lti(_) => None,
    };
    let [states, deltas] = small.map_or([0, 0], |s| [s.lfr.states(), s.lfr.delta_count()]);
    let error = |p: f64| -> Result<f64, TaskError> {
        let model = found.response(p, &lines, clock)?;
        let over = lines.iter().enumerate().map(|(k, f)| {
            let truth = machine.response(p, *f);
            let gap: Vec<C64> = model
                .line_slice(k)
                .iter()
                .zip(&truth)
                .map(|(a, b)| a - b)
                .collect();
            norm(&gap) / (noise * n as f64)
        });
        Ok(median(&over.collect::<Vec<_>>()))
    };
    let worst = |places: &[f64]| -> Result<f64, TaskError> {
        places
            .iter()
            .try_fold(0.0, |most: f64, p| Ok(most.max(error(*p)?)))
    };
    Ok(Case {
        states,
        deltas,
        error: [
            worst(&positions)?,
            worst(&[-0.93, -0.58, -0.27, 0.11, 0.44, 0.71, 0.95])?,
        ],
        seconds: taken.seconds,
        mib: taken.mib,
    })
}
