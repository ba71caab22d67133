//! Machines that people have: many modes and channels, friction, coupled axes, with the truth known by construction.

mod one;
mod peers;
mod places;
mod stage;

use crate::{TaskError, reproduce, root};
use lpv::lpv_core::num_complex::Complex;
use places::{PLACES, Place};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use stage::STAGES;
use std::path::PathBuf;

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
    /// Seeds a machine; a part of them of the largest.
    #[arg(long, default_value_t = 20)]
    seeds: u64,
    /// Only these parts; what the page says of the others is kept.
    #[arg(long, conflicts_with = "quick", value_delimiter = ',')]
    only: Vec<Part>,
    /// A Python with numpy and scikit-rf, for the same responses by their methods; without it, what the page says of them is kept.
    #[arg(long, value_name = "PYTHON")]
    peers: Option<PathBuf>,
    /// Where the results go.
    #[arg(long, value_name = "FOLDER", default_value = "target/ordinary")]
    output: PathBuf,
}

/// A part of the bench.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Part {
    /// Many modes and channels at one position.
    One,
    /// Friction and coupled axes at several positions.
    Places,
    /// Stages of many channels along a line.
    Stages,
}

/// All of the bench: machines at one position, at several, and stages of many channels.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Rows {
    one: Vec<one::Row>,
    /// Other tools on the first machine of each stage of many channels.
    #[serde(default)]
    peers: Vec<peers::Peer>,
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
    let kept = std::fs::read_to_string(root().join("docs/metrics/ordinary.json"))?;
    let kept: Rows = serde_json::from_str(&kept)?;
    let is_wanted = |part| options.only.is_empty() || options.only.contains(&part);
    std::fs::create_dir_all(&options.output)?;
    let mut rows = kept;
    if is_wanted(Part::One) {
        (rows.one, rows.peers) = one_position(options, rows.peers)?;
    }
    if is_wanted(Part::Places) {
        rows.places = several_positions(options)?;
    }
    if is_wanted(Part::Stages) {
        rows.stages = along_a_line(options)?;
    }
    let page = page(&rows, options);
    reproduce::write_json(&options.output.join("metrics.json"), &rows)?;
    std::fs::write(options.output.join("ordinary-machines.md"), &page)?;
    if options.bless {
        let docs = root().join("docs");
        reproduce::write_json(&docs.join("metrics/ordinary.json"), &rows)?;
        std::fs::write(docs.join("ordinary-machines.md"), &page)?;
    }
    // A busy machine is no reason to fail: time is a bar of the page.
    let held = |r: &one::Row| r.broken().iter().all(|bar| *bar == "time");
    let moving = rows.places.iter().all(|r| r.broken().is_empty());
    let stages = rows
        .stages
        .iter()
        .all(|r| r.broken().iter().all(|bar| *bar == "time"));
    Ok(!options.quick || rows.one.iter().all(held) && moving && stages)
}

/// The machines at one position, and what other tools make of some; `kept`: what is known of these.
fn one_position(
    options: &Options,
    kept: Vec<peers::Peer>,
) -> Result<(Vec<one::Row>, Vec<peers::Peer>), TaskError> {
    let mut rows = Vec::new();
    let mut found = Vec::new();
    for (index, kind) in one::KINDS.iter().enumerate() {
        if options.quick && (kind.size.0 > 4 || kind.modes == 30) {
            continue;
        }
        let seeds = if options.quick {
            2
        } else {
            options.seeds.div_ceil(kind.thinned)
        };
        let first = 1000 * index as u64;
        let row = one::Row::new(kind, first..first + seeds)?;
        println!("{}", row.line());
        rows.push(row);
        if let Some(python) = options.peers.as_ref().filter(|_| kind.has_peers()) {
            for peer in peers::compare(kind, first, python, &options.output)? {
                println!("{}", peer.line());
                found.push(peer);
            }
        }
    }
    let peers = if options.peers.is_some() { found } else { kept };
    Ok((rows, peers))
}

fn several_positions(options: &Options) -> Result<Vec<places::Row>, TaskError> {
    let mut rows = Vec::new();
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
            rows.push(row);
        }
    }
    Ok(rows)
}

fn along_a_line(options: &Options) -> Result<Vec<stage::Row>, TaskError> {
    let mut rows = Vec::new();
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
            rows.push(row);
        }
    }
    Ok(rows)
}

const RATE: f64 = 5000.0;

/// The sampled pole of a mode at this frequency, damped by 0.2 to 1 %.
fn pole(hz: f64, rng: &mut ChaCha8Rng) -> C64 {
    let (w, d) = (
        std::f64::consts::TAU * hz,
        10f64.powf(rng.random_range(-2.7..-2.0)),
    );
    (C64::new(-d * w, w * (1.0 - d * d).sqrt()) / RATE).exp()
}

fn normal(rng: &mut ChaCha8Rng) -> C64 {
    let (re, im): (f64, f64) = (StandardNormal.sample(rng), StandardNormal.sample(rng));
    C64::new(re, im) / 2f64.sqrt()
}

/// Peak memory that a fit may take, MiB.
const MOST_MIB: f64 = 1024.0;

/// A column of peak memory, empty where it is not known.
fn mebibytes(peak: f64) -> String {
    if peak.is_finite() {
        format!("{peak:.0}")
    } else {
        String::new()
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
    let lines: Vec<String> = rows.one.iter().map(one::Row::line).collect();
    let peers: Vec<String> = rows.peers.iter().map(peers::Peer::line).collect();
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
         - *seconds*: the slowest, from the response to the model. Bars: 5 of one channel, 60 of the stages up to 13 x 4.\n\
         - *MiB*: the largest peak of the resident memory of the process meanwhile. Bar: 1024.\n\n\
         | channels | modes | states | found | residual, dB | cost | over the bound | deviations | seconds | MiB | bars |\n\
         |---|---|---|---|---|---|---|---|---|---|---|\n{}\n\n\
         The first machines of some rows by other tools, with `--peers PYTHON`: vector fitting of scikit-rf and the subspace method of McKelvey, Akcay \
         and Ljung (1996) in numpy. Both are given the integrators and the number of modes, and state no deviations. The columns are those above; the \
         memory is that of Python.\n\n\
         | channels | tool | residual, dB | over the bound | seconds | MiB |\n\
         |---|---|---|---|---|---|\n{}\n\n\
         ## Friction to ground and coupled axes\n\n\
         Made by `cargo xtask ordinary --only places,stages --seeds {machines}` where not with the above. Records in closed loop at several positions and along moves, from masses and springs that are integrated with Runge-Kutta steps of a \
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
         - *seconds*: the slowest, from the responses to the model. Bars: 60, 180, 600.\n\
         - *MiB*: as above.\n\n\
         | stage | machines | states | of the models | deltas | at | between | seconds | MiB | bars |\n\
         |---|---|---|---|---|---|---|---|---|---|\n{}\n",
        lines.join("\n"),
        peers.join("\n"),
        places.join("\n"),
        stages.join("\n")
    )
}
