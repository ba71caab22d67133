//! Machines that people have: many modes and many channels at one position, with the truth known by construction.
//!
//! Responses are sums of partial fractions in z with noise of few periods, whose covariance is estimated as from a measurement;
//! nothing here comes from the code that estimates.

mod places;
mod stage;

use crate::{TaskError, reproduce, root};
use lpv::lpv_core::num_complex::Complex;
use lpv::lpv_core::{Discrete, Frf, FrfEstimate};
use lpv::{Identified, IdentifyConfig, Moves, identify, silent};
use lpv_numerics::statistics::median;
use places::{PLACES, Place};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use stage::STAGES;
use std::path::PathBuf;
use std::time::Instant;

type C64 = Complex<f64>;

/// Options of the bench.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Write the page and the figures to docs/ too.
    #[arg(long)]
    bless: bool,
    /// Two seeds of the cheap machines; fails where a bar other than time is broken.
    #[arg(long, conflicts_with_all = ["bless", "seeds"])]
    quick: bool,
    /// Seeds a machine; a twentieth of them of the largest.
    #[arg(long, default_value_t = 20)]
    seeds: u64,
    /// Only the machines of several positions, stages among them; what the page says of the others is kept.
    #[arg(long, conflicts_with = "quick")]
    places: bool,
    /// Where the results go.
    #[arg(long, value_name = "FOLDER", default_value = "target/ordinary")]
    output: PathBuf,
}

/// What a kind of machine is.
#[derive(Clone, Copy)]
struct Kind {
    modes: usize,
    /// Outputs and inputs.
    size: (usize, usize),
    /// Rank of the gain of the rigid body; none without one.
    rigid: usize,
    lines: usize,
    /// Periods, after which the covariance has `inputs (periods - 1)` degrees of freedom.
    periods: usize,
    /// Response over noise in the mean over the lines, dB.
    snr_db: f64,
    /// Seconds that it may take.
    seconds: f64,
    large: bool,
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
        large: false,
    }
}

const fn stage(modes: usize, size: (usize, usize), periods: usize, seconds: f64, large: bool) -> Kind {
    Kind {
        modes,
        size,
        rigid: 3,
        lines: 1720,
        periods,
        snr_db: 40.0,
        seconds,
        large,
    }
}

const KINDS: [Kind; 9] = [
    one_channel(5),
    one_channel(10),
    one_channel(15),
    one_channel(20),
    one_channel(30),
    stage(12, (4, 4), 4, 60.0, false),
    stage(12, (6, 6), 4, 60.0, true),
    stage(17, (13, 4), 4, 60.0, true),
    stage(20, (14, 14), 4, f64::INFINITY, true),
];

/// One machine and what came of it.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Case {
    states: usize,
    cost_over_expected: f64,
    /// Residual over the noise, dB.
    residual_db: f64,
    /// Error of the response over the Cramer-Rao bound of its mean square.
    over_bound: f64,
    /// Frequencies and dampings within three deviations, of how many.
    within: [usize; 2],
    seconds: f64,
}

/// All machines of a kind.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Row {
    modes: usize,
    outputs: usize,
    inputs: usize,
    /// States of the machine.
    states: usize,
    cases: Vec<Case>,
    /// Seconds that it may take; none without a bar.
    most_seconds: Option<f64>,
}

/// All of the bench: machines at one position, at several, and stages of many channels.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Rows {
    one: Vec<Row>,
    places: Vec<places::Row>,
    /// Stages of many channels along a line.
    #[serde(default)]
    stages: Vec<stage::Row>,
}

/// Runs the bench; false where `--quick` finds a bar broken.
///
/// # Errors
/// What cannot be identified or written.
pub(crate) fn run(options: &Options) -> Result<bool, TaskError> {
    let mut rows = Vec::new();
    if options.places {
        let kept = std::fs::read_to_string(root().join("docs/metrics/ordinary.json"))?;
        rows = serde_json::from_str::<Rows>(&kept)?.one;
    }
    for (index, kind) in KINDS.iter().enumerate() {
        if options.places || options.quick && (kind.large || kind.modes == 30) {
            continue;
        }
        let seeds = match (options.quick, kind.large) {
            (true, _) => 2,
            (false, false) => options.seeds,
            (false, true) => options.seeds.div_ceil(20),
        };
        let cases: Vec<Case> = (0..seeds)
            .map(|seed| case(kind, 1000 * index as u64 + seed))
            .collect::<Result<_, _>>()?;
        let row = Row {
            modes: kind.modes,
            outputs: kind.size.0,
            inputs: kind.size.1,
            states: 2 * (kind.modes + kind.rigid),
            cases,
            most_seconds: kind.seconds.is_finite().then_some(kind.seconds),
        };
        println!("{}", row.line());
        rows.push(row);
    }
    std::fs::create_dir_all(&options.output)?;
    let mut places = Vec::new();
    for (index, place) in PLACES.iter().enumerate() {
        let axis = matches!(place, Place::Axis { .. });
        let seeds = match (options.quick, axis) {
            (true, _) => u64::from(index % 4 == 3),
            (false, true) => options.seeds,
            (false, false) => options.seeds.div_ceil(7),
        };
        if seeds > 0 {
            let first = 100_000 * (index as u64 + 1);
            let row = places::Row::of(place, first..first + seeds, &options.output)?;
            println!("{}", row.line());
            places.push(row);
        }
    }
    let mut stages = Vec::new();
    for (index, kind) in STAGES.iter().enumerate() {
        // The larger the stage, the fewer of them.
        let seeds = match options.quick {
            true => u64::from(index == 0),
            false => options.seeds.div_ceil([4, 7, 20][(index / 2).min(2)]),
        };
        if seeds > 0 {
            let first = 900_000 + 1000 * index as u64;
            let row = stage::Row::of(kind, first..first + seeds)?;
            println!("{}", row.line());
            stages.push(row);
        }
    }
    let rows = Rows {
        one: rows,
        places,
        stages,
    };
    let page = page(&rows, options);
    reproduce::write_json(&options.output.join("metrics.json"), &rows)?;
    std::fs::write(options.output.join("ordinary-machines.md"), &page)?;
    if options.bless {
        let docs = root().join("docs");
        reproduce::write_json(&docs.join("metrics/ordinary.json"), &rows)?;
        std::fs::write(docs.join("ordinary-machines.md"), &page)?;
    }
    // A busy machine is no reason to fail: time is a bar of the page.
    let held = |r: &Row| r.broken().iter().all(|bar| *bar == "time");
    let moving = rows.places.iter().all(|r| r.broken().is_empty());
    let stages = rows
        .stages
        .iter()
        .all(|r| r.broken().iter().all(|bar| *bar == "time"));
    Ok(!options.quick || rows.one.iter().all(held) && moving && stages)
}

const RATE: f64 = 5000.0;

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
            let f = band.0 + gap * (i as f64 + rng.random_range(0.1..0.9));
            let (w, d) = (
                std::f64::consts::TAU * f,
                10f64.powf(rng.random_range(-2.7..-2.0)),
            );
            (C64::new(-d * w, w * (1.0 - d * d).sqrt()) / RATE).exp()
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

fn normal(rng: &mut ChaCha8Rng) -> C64 {
    let (re, im): (f64, f64) = (StandardNormal.sample(rng), StandardNormal.sample(rng));
    C64::new(re, im) / 2f64.sqrt()
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

fn case(kind: &Kind, seed: u64) -> Result<Case, TaskError> {
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
    let estimate = FrfEstimate::new(Frf::new(lines.clone(), n_y, n_u, values)?, c_v, s, free, None)?;
    let clock = Discrete::from_rate(RATE)?;
    let begin = Instant::now();
    let moves = Moves::none("one position");
    let found = identify(
        std::slice::from_ref(&estimate),
        clock,
        &moves,
        &IdentifyConfig::default(),
        &silent,
    )?;
    let seconds = begin.elapsed().as_secs_f64();
    let Identified::Lti(stage) = &found else {
        return Err("one position gave a model of several".into());
    };
    let account = &stage.poles.fits[0].account;
    let modal = stage.modal.as_ref();
    let modes: Vec<[f64; 4]> = match modal {
        Some(modal) => modal.modes.iter().map(|m| figures!(m)).collect(),
        None => stage.poles.fits[0].modes().iter().map(|m| figures!(m)).collect(),
    };
    let mut within = [0, 0];
    for pole in &machine.poles {
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
    let model = found.response(0.0, &lines, clock)?;
    let (mut error, mut residual) = (0.0, 0.0);
    for (k, own) in truth.iter().enumerate() {
        let (fitted, measured) = (model.line_slice(k), estimate.frf().line_slice(k));
        for ((g, t), m) in fitted.iter().zip(own).zip(measured) {
            error += (g - t).norm_sqr();
            residual += (g - m).norm_sqr();
        }
    }
    let channels = (lines.len() * n_y * n_u) as f64;
    // White noise of one size: each real unknown of the machine takes half of a variance.
    let per_mode = if n_y.min(n_u) > 1 { 2 * (n_y + n_u) } else { 4 };
    let of_body = kind.rigid * (n_y + n_u) - kind.rigid * kind.rigid;
    let unknowns = (kind.modes * per_mode + of_body) as f64;
    Ok(Case {
        states: stage.model.states(),
        cost_over_expected: modal.map_or(account.cost / account.expected_cost, |m| {
            m.account.cost / m.account.expected_cost
        }),
        residual_db: 10.0 * (residual / (channels * deviation * deviation)).log10(),
        over_bound: (error / (0.5 * unknowns * deviation * deviation)).sqrt(),
        within,
        seconds,
    })
}

impl Row {
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
    fn broken(&self) -> Vec<&'static str> {
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
        broken
    }

    fn line(&self) -> String {
        let broken = self.broken();
        format!(
            "| {} x {} | {} | {} | {} of {} | {:+.2} | {:.3} | {:.2} | {:.1} % | {:.1} | {} |",
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
            bars(&broken)
        )
    }
}

/// The last column of a row: the bars that do not hold.
fn bars(broken: &[&str]) -> String {
    match broken {
        [] => "hold".to_owned(),
        broken => format!("missed: {}", broken.join(", ")),
    }
}

/// Percent of the figures that lie within their deviations, from how many of how many.
fn percent_within(cases: impl Iterator<Item = [usize; 2]>) -> f64 {
    let [within, of] = cases.fold([0, 0], |sum, case| [sum[0] + case[0], sum[1] + case[1]]);
    100.0 * within as f64 / of as f64
}

fn page(rows: &Rows, options: &Options) -> String {
    let command = match options.quick {
        true => "--quick".to_owned(),
        false => format!(
            "--seeds {}",
            rows.one.first().map_or(options.seeds, |r| r.cases.len() as u64)
        ),
    };
    let lines: Vec<String> = rows.one.iter().map(Row::line).collect();
    let places: Vec<String> = rows.places.iter().map(places::Row::line).collect();
    let stages: Vec<String> = rows.stages.iter().map(stage::Row::line).collect();
    let machines = rows.places.iter().map(places::Row::machines).max().unwrap_or(0);
    format!(
        "# Ordinary machines\n\n\
         Made by `cargo xtask ordinary {command}`. Many modes and many channels at one position: responses are sums of partial fractions in z, with \
         noise of few periods whose covariance is estimated from their scatter; the truth is known by construction, and nothing of it comes \
         from the code that estimates. One channel: 66 dB in the mean, 8 periods. Stages: a rigid body of rank three (z, Rx, Ry) and flexible modes of \
         0.2 to 1 % damping, 40 dB at the median line, 4 periods. Everything is chosen from the data.\n\n\
         - *states*: of the machine, and machines for which the model has as many. One channel sees some modes below its noise, so that fewer may be right there.\n\
         - *residual*: against the measured response, over its noise; the largest. Bar of one channel: 1 dB.\n\
         - *cost*: over its expectation, median. Bar: within 5 %.\n\
         - *over the bound*: error against the truth over the Cramer-Rao bound of the whole response, median. Bar: 1.2.\n\
         - *deviations*: frequencies and dampings within three of the stated deviations. Bar: 95 %.\n\
         - *seconds*: the slowest, from the response to the model. Bars: 5 of one channel, 60 of the stages up to 13 x 4.\n\n\
         | channels | modes | states | found | residual, dB | cost | over the bound | deviations | seconds | bars |\n\
         |---|---|---|---|---|---|---|---|---|---|\n{}\n\n\
         ## Friction to ground and coupled axes\n\n\
         Made by `cargo xtask ordinary --places --seeds {machines}` where not with the above. Records in closed loop at several positions and along moves, from masses and springs that are integrated with Runge-Kutta steps of a \
         twentieth of a sample. The axis: two masses on a spring whose stiffness depends on p, friction at the drive. The gantry: two drives on a \
         beam with a carriage on a spring at p along it, so that the gain of the rigid body is full and depends on p. Masses and springs are drawn \
         within a quarter of their means.\n\n\
         - *responses*: error of the frozen model over the noise of the FRF, median over lines, the largest of the machines. Bar: 1.3.\n\
         - *moves*: error in closed loop along moves that were not fitted, over the noise of a sample, the largest of outputs and machines. Bar: 1.3.\n\
         - *deviations*: frequencies of the mode within three of their stated deviations. Bar: 95 %.\n\n\
         | machine | machines | states | responses | moves | deviations | seconds | bars |\n\
         |---|---|---|---|---|---|---|---|\n{}\n\n\
         ## Stages of many channels along a line\n\n\
         Made with the same command. A rigid body (z, Rx, Ry) and bending modes whose frequencies do not depend on p; sensors on the ground, or sensors and \
         actuators, see other points of the standing waves as the stage moves. Responses with noise of known covariance, 60 dB at the median line; the \
         truth is known between the positions. The model is the small LFR.\n\n\
         - *states*: of the machine, and of the models. Bar: the same.\n\
         - *at, between*: error against the truth over the noise of a response, median over lines, at the positions and at seven places between \
         them, the largest. Bar: 1.5.\n\
         - *seconds*: the slowest, from the responses to the model. Bars: 60, 180, 600.\n\n\
         | stage | machines | states | of the models | deltas | at | between | seconds | bars |\n\
         |---|---|---|---|---|---|---|---|---|\n{}\n",
        lines.join("\n"),
        places.join("\n"),
        stages.join("\n")
    )
}
