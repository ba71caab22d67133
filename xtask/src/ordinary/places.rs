//! Machines of several positions, from records in closed loop: friction to ground, and axes that are coupled.
//!
//! `M q'' + D q' + (K + c K')(h(p)) = B u`, `y = C q`: free masses joined by springs whose stiffness or place depends on p, integrated
//! with Runge-Kutta steps of a twentieth of a sample. Nothing here comes from the code that estimates.

use super::{bars, percent_within};
use crate::TaskError;
use experiment_data::Bundle;
use lpv::lpv_core::linalg::eigenvalues;
use lpv::lpv_core::nalgebra::{DMatrix, DVector};
use lpv::validation::{Scope, validate};
use lpv::{IdentifyConfig, ModelFile, identify_bundle, silent};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;

/// What a kind of machine is.
#[derive(Debug, Clone, Copy)]
pub(super) enum Place {
    /// One servo axis, two masses on a spring whose stiffness depends on p, with this friction to ground in N s/m.
    Axis { friction: f64 },
    /// Two drives on a beam and a carriage on a spring that moves along it, with this friction to ground at the drives.
    Gantry { friction: f64, positions: usize },
}

pub(super) const PLACES: [Place; 10] = [
    Place::Axis { friction: 0.0 },
    Place::Axis { friction: 1.0 },
    Place::Axis { friction: 3.0 },
    Place::Axis { friction: 10.0 },
    Place::Axis { friction: 60.0 },
    Place::Gantry {
        friction: 0.0,
        positions: 5,
    },
    Place::Gantry {
        friction: 0.0,
        positions: 7,
    },
    Place::Gantry {
        friction: 8.0,
        positions: 5,
    },
    Place::Gantry {
        friction: 8.0,
        positions: 7,
    },
    Place::Gantry {
        friction: 80.0,
        positions: 11,
    },
];

/// One machine and what came of it.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Case {
    /// Error of the frozen responses over the noise of the FRF, median.
    frozen: f64,
    /// Error in closed loop along the held-out moves over the noise of a sample, the worst output.
    moves: f64,
    /// Frequencies of the modes within three deviations of the truth, of how many.
    within: [usize; 2],
    states: usize,
    seconds: f64,
}

/// All machines of a kind.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Row {
    name: String,
    cases: Vec<Case>,
}

/// Bar of both errors.
const BAR: f64 = 1.3;

impl Row {
    pub(super) fn of(place: &Place, seeds: std::ops::Range<u64>, folder: &Path) -> Result<Self, TaskError> {
        let name = match place {
            Place::Axis { friction } => format!("servo axis, 5 positions, friction {friction} N s/m"),
            Place::Gantry { friction, positions } => {
                format!("coupled gantry, {positions} positions, friction {friction} N s/m")
            }
        };
        let cases = seeds.map(|seed| case(place, seed, folder));
        Ok(Self {
            name,
            cases: cases.collect::<Result<_, _>>()?,
        })
    }

    /// The bars that do not hold.
    pub(super) fn broken(&self) -> Vec<&'static str> {
        let mut broken = Vec::new();
        if self.most(|c| c.frozen) > BAR {
            broken.push("responses");
        }
        if self.most(|c| c.moves) > BAR {
            broken.push("moves");
        }
        if self.within() < 95.0 {
            broken.push("deviations");
        }
        broken
    }

    fn most(&self, value: impl Fn(&Case) -> f64) -> f64 {
        self.cases.iter().map(value).fold(f64::NEG_INFINITY, f64::max)
    }

    pub(super) fn machines(&self) -> usize {
        self.cases.len()
    }

    fn within(&self) -> f64 {
        percent_within(self.cases.iter().map(|c| c.within))
    }

    pub(super) fn line(&self) -> String {
        let broken = self.broken();
        let states: Vec<usize> = self.cases.iter().map(|c| c.states).collect();
        let (least, most) = (states.iter().min(), states.iter().max());
        format!(
            "| {} | {} | {} to {} | {:.2} | {:.2} | {:.1} % | {:.1} | {} |",
            self.name,
            self.cases.len(),
            least.unwrap_or(&0),
            most.unwrap_or(&0),
            self.most(|c| c.frozen),
            self.most(|c| c.moves),
            self.within(),
            self.most(|c| c.seconds),
            bars(&broken)
        )
    }
}

/// A machine: what its matrices are at p.
struct Machine {
    mass: DVector<f64>,
    friction: DMatrix<f64>,
    stiffness: f64,
    damping: f64,
    /// The spring sees `h(p)^T q`; its stiffness is multiplied by `1 + slope p`.
    spring: fn(f64) -> Vec<f64>,
    slope: f64,
    input: DMatrix<f64>,
    output: DMatrix<f64>,
    positions: Vec<f64>,
    rate: f64,
    /// Numerator and denominator of each loop, `b0 + b1 z^-1` over `1 + a1 z^-1`.
    control: [f64; 3],
}

impl Machine {
    fn new(place: &Place, rng: &mut ChaCha8Rng) -> Self {
        let mut scatter = || rng.random_range(0.8..1.25);
        let grid = |n: usize| (0..n).map(move |i| -0.3 + 0.6 * i as f64 / (n - 1) as f64);
        match *place {
            Place::Axis { friction } => {
                let (m1, m2) = (3.5 * scatter(), 1.5 * scatter());
                let reduced = m1 * m2 / (m1 + m2);
                let w = std::f64::consts::TAU * 110.0 * scatter();
                Self {
                    mass: DVector::from_vec(vec![m1, m2]),
                    friction: DMatrix::from_diagonal(&DVector::from_vec(vec![friction, 0.0])),
                    stiffness: reduced * w * w,
                    damping: 0.03 * reduced * w,
                    spring: |_| vec![1.0, -1.0],
                    slope: 0.7,
                    input: DMatrix::from_vec(2, 1, vec![1.0, 0.0]),
                    output: DMatrix::from_vec(1, 2, vec![1.0, 0.0]),
                    positions: grid(5).collect(),
                    rate: 2000.0,
                    control: lead(m1 + m2, 14.0, 2000.0),
                }
            }
            Place::Gantry { friction, positions } => {
                let (beam, turn, carriage) = (20.0 * scatter(), 1.7 * scatter(), 10.0 * scatter());
                let (k, d) = (1.7e6 * scatter(), 135.0 * scatter());
                let ends = DMatrix::from_row_slice(3, 2, &[1.0, 1.0, -0.5, 0.5, 0.0, 0.0]);
                Self {
                    mass: DVector::from_vec(vec![beam, turn, carriage]),
                    friction: &ends * ends.transpose() * friction,
                    stiffness: k,
                    damping: d,
                    spring: |p| vec![1.0, p, -1.0],
                    slope: 0.0,
                    output: ends.transpose(),
                    input: ends,
                    positions: grid(positions).collect(),
                    rate: 2000.0,
                    control: lead(6.0, 8.0, 2000.0),
                }
            }
        }
    }

    /// `q''` of the state `[q; v]` under the forces `u`.
    fn acceleration(&self, p: f64, state: &DVector<f64>, forces: &DVector<f64>) -> DVector<f64> {
        let n = self.mass.len();
        let h = (self.spring)(p);
        let along = |part: usize| {
            h.iter()
                .enumerate()
                .map(|(i, h)| h * state[part + i])
                .sum::<f64>()
        };
        let tension = self.stiffness * (1.0 + self.slope * p) * along(0) + self.damping * along(n);
        DVector::from_fn(n, |i, _| {
            let drag: f64 = (0..n).map(|j| self.friction[(i, j)] * state[n + j]).sum();
            (forces[i] - drag - h[i] * tension) / self.mass[i]
        })
    }

    fn rate_of(&self, p: f64, state: &DVector<f64>, forces: &DVector<f64>) -> DVector<f64> {
        let n = self.mass.len();
        let a = self.acceleration(p, state, forces);
        DVector::from_fn(2 * n, |i, _| if i < n { state[n + i] } else { a[i - n] })
    }

    /// One sample with p from `p[0]` to `p[1]`.
    fn sample(&self, p: [f64; 2], state: &mut DVector<f64>, forces: &DVector<f64>) {
        const STEPS: usize = 20;
        let h = 1.0 / self.rate / STEPS as f64;
        for step in 0..STEPS {
            let at = |part: f64| p[0] + (p[1] - p[0]) * (step as f64 + part) / STEPS as f64;
            let k1 = self.rate_of(at(0.0), state, forces);
            let k2 = self.rate_of(at(0.5), &(&*state + &k1 * (0.5 * h)), forces);
            let k3 = self.rate_of(at(0.5), &(&*state + &k2 * (0.5 * h)), forces);
            let k4 = self.rate_of(at(1.0), &(&*state + &k3 * h), forces);
            *state += (k1 + (k2 + k3) * 2.0 + k4) * (h / 6.0);
        }
    }

    /// Columns y, u, r, p of a run in closed loop; `noise` on every output.
    fn run(&self, r: &[Vec<f64>], p: &[f64], noise: f64, rng: &mut ChaCha8Rng) -> Vec<Vec<f64>> {
        let (ny, n) = (self.output.nrows(), self.mass.len());
        let [b0, b1, a1] = self.control;
        let mut state = DVector::zeros(2 * n);
        let (mut last_e, mut last_u) = (vec![0.0; ny], vec![0.0; ny]);
        let mut columns = vec![Vec::with_capacity(p.len()); 3 * ny + 1];
        for k in 0..p.len() {
            let seen = &self.output * state.rows(0, n);
            let mut forces = DVector::zeros(n);
            for i in 0..ny {
                let error: f64 = StandardNormal.sample(rng);
                let y = seen[i] + noise * error;
                let e = r[i][k] - y;
                let u = b0 * e + b1 * last_e[i] - a1 * last_u[i];
                (last_e[i], last_u[i]) = (e, u);
                forces += self.input.column(i) * u;
                columns[i].push(y);
                columns[ny + i].push(u);
                columns[2 * ny + i].push(r[i][k]);
            }
            columns[3 * ny].push(p[k]);
            self.sample([p[k], p.get(k + 1).copied().unwrap_or(p[k])], &mut state, &forces);
        }
        columns
    }

    /// The natural frequency of the mode at p, `|s| / 2 pi` of the fastest pole.
    fn frequency_hz(&self, p: f64) -> Result<f64, TaskError> {
        let n = self.mass.len();
        let still = DVector::zeros(n);
        let mut a = DMatrix::zeros(2 * n, 2 * n);
        for j in 0..2 * n {
            let unit = DVector::from_fn(2 * n, |i, _| f64::from(u8::from(i == j)));
            a.set_column(j, &self.rate_of(p, &unit, &still));
        }
        let poles = eigenvalues(&a)?;
        let fastest = poles.iter().map(|s| s.norm()).fold(0.0, f64::max);
        Ok(fastest / std::f64::consts::TAU)
    }
}

/// Lead with unit gain of `1/(m s^2)` times it at `crossover_hz`, held at `rate`.
fn lead(mass: f64, crossover_hz: f64, rate: f64) -> [f64; 3] {
    let w = std::f64::consts::TAU * crossover_hz;
    let (zero, pole) = (w / 3.0, 3.0 * w);
    let gain = mass * w * w / 3.0;
    // gain (s/zero + 1) / (s/pole + 1) by the backward difference.
    let (a, b) = (rate / zero, rate / pole);
    [
        gain * (1.0 + a) / (1.0 + b),
        -gain * a / (1.0 + b),
        -b / (1.0 + b),
    ]
}

/// Noise of a sample, relative to the output of the periodic experiments.
const NOISE: f64 = 5e-3;

/// Samples of a period, and periods.
const PERIOD: usize = 2000;
const PERIODS: usize = 8;
/// Periods at the beginning that are not kept.
const WARM: usize = 3;

fn case(place: &Place, seed: u64, folder: &Path) -> Result<Case, TaskError> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let machine = Machine::new(place, &mut rng);
    let ny = machine.output.nrows();
    let folder = folder.join("bundle");
    if folder.exists() {
        std::fs::remove_dir_all(&folder)?;
    }
    std::fs::create_dir_all(&folder)?;
    let names: Vec<String> = ["y", "u", "r"]
        .iter()
        .flat_map(|name| (1..=ny).map(move |i| format!("{name}{i}")))
        .chain(["p".to_owned()])
        .collect();
    let write = |file: &str, columns: &[Vec<f64>], from: usize| -> Result<(), TaskError> {
        let mut text = names.join(",") + "\n";
        for k in from..columns[0].len() {
            let row: Vec<String> = columns.iter().map(|c| c[k].to_string()).collect();
            text.push_str(&row.join(","));
            text.push('\n');
        }
        Ok(std::fs::write(folder.join(file), text)?)
    };
    let mut records = String::new();
    let highest = 500;
    let mut noise = 0.0;
    for (index, &p) in machine.positions.iter().enumerate() {
        let lines: Vec<(Vec<f64>, Vec<f64>)> = (0..ny)
            .map(|_| {
                let phases = (2..highest).map(|_| rng.random_range(0.0..std::f64::consts::TAU));
                let sizes = (2..highest).map(|k| 1e-6 * (1.0 + (k as f64 / 60.0).powi(2)).min(20.0));
                (phases.collect(), sizes.collect())
            })
            .collect();
        for experiment in 0..ny {
            // Signs of a Hadamard matrix: inputs that are orthogonal over the experiments.
            let period: Vec<Vec<f64>> = lines
                .iter()
                .enumerate()
                .map(|(i, (phases, sizes))| {
                    let sign = if experiment == 1 && i == 1 { -1.0 } else { 1.0 };
                    let at = |t: usize| {
                        let angle = std::f64::consts::TAU * t as f64 / PERIOD as f64;
                        let one = |(k, (phase, size)): (usize, (&f64, &f64))| {
                            size * ((k + 2) as f64 * angle + phase).cos()
                        };
                        sign * phases.iter().zip(sizes).enumerate().map(one).sum::<f64>()
                    };
                    (0..PERIOD).map(at).collect()
                })
                .collect();
            let length = PERIOD * (PERIODS + WARM);
            let r: Vec<Vec<f64>> = period
                .iter()
                .map(|one| (0..length).map(|k| one[k % PERIOD]).collect())
                .collect();
            if noise == 0.0 {
                // A part of what the output does at the frequencies of the mode.
                let quiet = machine.run(&r, &vec![p; length], 0.0, &mut rng);
                let kept = &quiet[0][WARM * PERIOD..];
                let size = (kept.iter().map(|v| v * v).sum::<f64>() / kept.len() as f64).sqrt();
                noise = NOISE * size;
            }
            let columns = machine.run(&r, &vec![p; length], noise, &mut rng);
            let file = format!("g{index}_{experiment}.csv");
            write(&file, &columns, WARM * PERIOD)?;
            let _ = writeln!(
                records,
                "[[records]]\nfile = \"{file}\"\nkind = \"periodic\"\nuse = \"estimation\"\nperiod = {PERIOD}\n"
            );
        }
    }
    for (index, held_out) in [false, false, true, true].into_iter().enumerate() {
        let length = 4000;
        let phase = rng.random_range(0.0..std::f64::consts::TAU);
        let share = |k: usize| k as f64 / length as f64;
        let p: Vec<f64> = (0..length)
            .map(|k| 0.28 * (phase + std::f64::consts::TAU * 1.2 * share(k)).sin())
            .collect();
        let r: Vec<Vec<f64>> = (0..ny)
            .map(|_| {
                let (size, from) = (
                    rng.random_range(1e-3..4e-3),
                    rng.random_range(0.0..std::f64::consts::TAU),
                );
                let shake: Vec<f64> = (0..length).map(|_| StandardNormal.sample(&mut rng)).collect();
                (0..length)
                    .map(|k| {
                        let slow = (from + std::f64::consts::TAU * 2.0 * share(k)).sin() - from.sin();
                        size * slow + 3e-6 * shake[k]
                    })
                    .collect()
            })
            .collect();
        let file = format!("m{index}.csv");
        write(&file, &machine.run(&r, &p, noise, &mut rng), 0)?;
        let purpose = if held_out { "validation" } else { "estimation" };
        let _ = writeln!(
            records,
            "[[records]]\nfile = \"{file}\"\nkind = \"transient\"\nuse = \"{purpose}\"\n"
        );
    }
    let [b0, b1, a1] = machine.control;
    let each = |polynomial: String| vec![polynomial; ny].join(", ");
    let of = |name: &str| -> Vec<String> { (1..=ny).map(|i| format!("{name}{i}")).collect() };
    let numerator = each(format!("[{b0:e}, {b1:e}]"));
    let description = format!(
        "format = 1\nname = \"ordinary\"\nsample_rate = {:?}\n\n[channels.output]\ncolumns = {:?}\n[channels.input]\ncolumns = {:?}\n\
         [channels.reference]\ncolumns = {:?}\n[channels.scheduling]\ncolumns = [\"p\"]\n[controller]\nreference_numerator = [{numerator}]\n\
         feedback_numerator = [{numerator}]\ndenominator = [{}]\n\n{records}",
        machine.rate,
        of("y"),
        of("u"),
        of("r"),
        each(format!("[1.0, {a1:e}]")),
    );
    std::fs::write(folder.join("experiment.toml"), description)?;
    let bundle = Bundle::open(&folder)?;
    let begin = Instant::now();
    let outcome = identify_bundle(&bundle, &IdentifyConfig::default(), &silent)?;
    let seconds = begin.elapsed().as_secs_f64();
    judge(&machine, &bundle, &outcome, seconds)
}

fn judge(
    machine: &Machine,
    bundle: &Bundle,
    outcome: &lpv::Outcome,
    seconds: f64,
) -> Result<Case, TaskError> {
    let file = ModelFile {
        model: outcome.model.clone(),
        identification: None,
        explanation: None,
    };
    let (found, _) = validate(&file, bundle, Scope::HeldOut, &silent)?;
    let frozen = found
        .frozen
        .as_ref()
        .map_or(f64::NAN, |f| f.error_over_noise.unwrap_or(f64::NAN));
    let loops = found.records.iter().flat_map(|r| &r.outputs);
    let moves = loops
        .filter_map(|o| o.closed_loop.as_ref()?.over_noise)
        .fold(0.0, f64::max);
    let mut within = [0, 0];
    if let lpv::Stages::Frequency(identified) = &outcome.stages
        && let lpv::Identified::Lpv(stage) = identified.as_ref()
    {
        for (fit, &p) in stage.poles.fits.iter().zip(&machine.positions) {
            let truth = machine.frequency_hz(p)?;
            let nearest = fit.modes().into_iter().min_by(|a, b| {
                (a.frequency_hz - truth)
                    .abs()
                    .total_cmp(&(b.frequency_hz - truth).abs())
            });
            within[1] += 1;
            within[0] += usize::from(
                nearest.is_some_and(|m| (m.frequency_hz - truth).abs() <= 3.0 * m.frequency_deviation_hz),
            );
        }
    }
    let states = match &outcome.model {
        lpv::lpv_core::Model::ContinuousLfr(lfr) => lfr.states(),
        lpv::lpv_core::Model::DiscreteLfr(lfr) => lfr.states(),
        _ => 0,
    };
    Ok(Case {
        frozen,
        moves,
        within,
        states,
        seconds,
    })
}
