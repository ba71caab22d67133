//! The same for servo axes whose controller nobody knows: simulated axes with encoders, one effect hidden or none, diagnosed as
//! bundles.

mod draw;
mod page;
mod score;

use super::Extent;
use super::work::{Seeded, logged, publish, work};
use crate::{Blind, TaskError};
use draw::{Drawn, Machine, RECORDS};
use experiment_data::{Bundle, BundleWriter, Description, RecordFormat};
use lpv::diagnose::{Diagnosis, Given, diagnose};
use lpv::silent;
use lpv_core::{Purpose, Record, RecordKind, Signals};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::Instant;
use xytable_plant::servo_axis::{AxisEffect, AxisRun, Known, deviation};
use xytable_plant::split_seed;

/// Effects that `lpv diagnose` should name on axes, or find in the parameters of the axis.
pub(super) const CATALOGUE: [&str; 31] = [
    "coulomb-friction",
    "stribeck-friction",
    "viscous-friction",
    "direction-dependent-friction",
    "hysteresis",
    "constant-force",
    "gravity",
    "position-force",
    "cogging",
    "cogging-two-orders",
    "cable-stiffness",
    "cubic-stiffness",
    "delay",
    "actuator-lag",
    "actuator-saturation",
    "position-dependent-gain",
    "sensor-cyclic-error",
    "sensor-drift",
    "quantization",
    "periodic-disturbance",
    "payload",
    "quadratic-friction",
    "force-step",
    "mass-jump",
    "stiffness-drift",
    "input-gain",
    "backlash",
    "backlash-of-the-load",
    "friction-drift",
    "load-dependent-friction",
    "temperature",
];

/// Those that it has no name for.
pub(super) const OUTSIDE: [&str; 3] = ["friction-zone", "swept-force", "random-force"];

/// Deviations in units of the noise of a reading: at the first a plot shows nothing, at the last an engineer sees it.
pub(super) const SEVERITIES: [f64; 3] = [10.0, 100.0, 1000.0];

/// What the axis of a diagnosis has as parameters of its own.
pub(super) const OF_THE_AXIS: [&str; 2] = ["viscous-friction", "constant-force"];

#[derive(Debug, Clone)]
struct Case {
    seed: u64,
    effect: Option<&'static str>,
    severity: f64,
}

/// One machine with what came out.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Outcome {
    pub(super) seed: u64,
    /// What was hidden, if anything.
    pub(super) hidden: Option<String>,
    /// Wanted deviation, units of the noise of a reading.
    pub(super) wanted: f64,
    /// That which was reached.
    pub(super) deviation: f64,
    /// Kind of machine.
    pub(super) machine: String,
    /// Axis that has the effect.
    pub(super) axis: usize,
    /// Axes of the machine.
    pub(super) axes: usize,
    /// True values by name.
    pub(super) facts: Vec<(String, f64)>,
    /// Those of each axis.
    pub(super) base: Vec<Vec<(String, f64)>>,
    /// Diagnosis, or why there is none.
    pub(super) diagnosis: Result<Diagnosis, String>,
    /// Wall clock of the diagnosis.
    pub(super) seconds: f64,
}

impl Seeded for Case {
    fn seed(&self) -> u64 {
        self.seed
    }
}

impl Seeded for Outcome {
    fn seed(&self) -> u64 {
        self.seed
    }
}

/// The bench, its page and its figures.
pub(crate) fn run(options: &Blind) -> Result<bool, TaskError> {
    let extent = if options.quick {
        quick()
    } else {
        Extent::of(options, [10, 0])
    };
    let folder = options.output.join("servo");
    std::fs::create_dir_all(&folder)?;
    let log = folder.join("cases.jsonl");
    let done = if options.resume { logged(&log)? } else { Vec::new() };
    let cases = cases(&extent, options.seed);
    let solve = |case: &Case| solve(case, options.keep.as_deref());
    let all = work(&cases, (&log, extent.minutes), done, solve, score::line)?;
    let metrics = score::score(&all);
    let command = format!(
        "cargo xtask blind --servo --seeds {} --seed {}",
        options.seeds, options.seed
    );
    let page = page::page(&metrics, &all, (&command, cases.len()));
    publish((&folder, "blind-servo"), &metrics, &page, options.bless)?;
    Ok(!options.quick || metrics.meets_quick_bars())
}

/// Effects that are named on the machines of the first round, and a clean one: the run fails where they no longer are.
fn quick() -> Extent {
    let only = [
        "viscous-friction",
        "constant-force",
        "cogging",
        "actuator-saturation",
    ];
    Extent {
        severities: vec![1000.0],
        only: only.map(String::from).to_vec(),
        ..Extent::quick()
    }
}

fn cases(extent: &Extent, seed: u64) -> Vec<Case> {
    let wanted = |name: &str| extent.only.is_empty() || extent.only.iter().any(|o| o == name);
    let named: Vec<&'static str> = CATALOGUE
        .into_iter()
        .chain(OUTSIDE)
        .filter(|n| wanted(n))
        .collect();
    let severities: Vec<f64> = SEVERITIES
        .into_iter()
        .filter(|s| extent.severities.is_empty() || extent.severities.contains(s))
        .collect();
    let rounds = extent.seeds.max(1);
    let mut all = Vec::new();
    for round in 0..rounds {
        let case = |what: &str, number: u64, effect: Option<&'static str>, severity: f64| Case {
            seed: split_seed(split_seed(seed, &format!("servo {what}")), &number.to_string()),
            effect,
            severity,
        };
        // Clean machines are shared out over the rounds, so that a run that is cut short has its part of them.
        let clean = extent.clean * round / rounds..extent.clean * (round + 1) / rounds;
        all.extend(clean.map(|number| case("clean", number, None, 0.0)));
        // Neighbours have other severities, so that a run that is cut short has its part of each.
        for pass in 0..severities.len() {
            let here = named.iter().enumerate().map(|(i, name)| {
                let severity = severities[(i + pass) % severities.len()];
                case(&format!("{name} {severity}"), round, Some(name), severity)
            });
            all.extend(here);
        }
    }
    all
}

/// Simulates and diagnoses a machine; its bundle stays where it is to be kept.
fn solve(case: &Case, keep: Option<&Path>) -> Result<Outcome, TaskError> {
    let machine = draw::machine(case.seed, case.effect);
    let of = &machine.axes[machine.hidden_in];
    let (hidden, reached) = match case.effect {
        None => (None, 0.0),
        Some(name) => {
            let effect =
                draw::effect(name, case.seed, of, machine.samples).ok_or("an effect without a shape")?;
            let known = if OF_THE_AXIS.contains(&name) {
                Known::Machine
            } else {
                Known::Nothing
            };
            let (effect, reached) = scaled(&effect, of, machine.samples, (case.severity, known))?;
            (Some(effect), reached)
        }
    };
    let folder = tempfile::tempdir()?;
    let bundle = match keep {
        Some(kept) => kept.join(case.seed.to_string()),
        None => folder.path().join("bundle"),
    };
    let bundle = write(&machine, hidden.as_ref(), &bundle)?;
    let start = Instant::now();
    let found = diagnose(&bundle, Given::default(), &silent);
    let seconds = start.elapsed().as_secs_f64();
    let base = |drawn: &Drawn| {
        let axis = &drawn.axis;
        let mut all = vec![
            ("mass".to_owned(), axis.mass_kg),
            ("viscous friction".to_owned(), axis.viscous_n_s_per_m),
            ("offset".to_owned(), axis.offset_n),
        ];
        if axis.stiffness_n_per_m > 0.0 {
            all.push(("stiffness".to_owned(), axis.stiffness_n_per_m));
        }
        all
    };
    let mut base: Vec<Vec<(String, f64)>> = machine.axes.iter().map(base).collect();
    match hidden {
        Some(AxisEffect::ViscousFriction { coefficient }) => base[machine.hidden_in][1].1 += coefficient,
        Some(AxisEffect::ConstantForce { force }) => base[machine.hidden_in][2].1 -= force,
        _ => {}
    }
    Ok(Outcome {
        seed: case.seed,
        hidden: case.effect.map(str::to_owned),
        wanted: case.severity,
        deviation: reached,
        machine: machine.kind.to_owned(),
        axis: machine.hidden_in,
        axes: machine.axes.len(),
        facts: hidden
            .iter()
            .flat_map(AxisEffect::facts)
            .map(|(name, value)| (name.to_owned(), value))
            .collect(),
        base,
        diagnosis: found.map(|d| d.diagnosis).map_err(|e| e.to_string()),
        seconds,
    })
}

/// The records of an axis.
fn runs(drawn: &Drawn, effects: &[AxisEffect], samples: usize) -> Result<Vec<AxisRun>, TaskError> {
    let one = |i: usize| drawn.axis.run(effects, &drawn.moves[i], (i, samples));
    Ok((0..RECORDS).map(one).collect::<Result<_, _>>()?)
}

/// The effect with the size that makes this deviation, and the deviation over the noise of a reading.
fn scaled(
    effect: &AxisEffect,
    drawn: &Drawn,
    samples: usize,
    (wanted, known): (f64, Known),
) -> Result<(AxisEffect, f64), TaskError> {
    const STEPS: usize = 8;
    const NEAR: f64 = 0.1;
    if let AxisEffect::Quantization { .. } = effect {
        // Its deviation is that of its own rounding.
        return Ok((effect.times(wanted), wanted));
    }
    let shown = |size: f64| -> Result<f64, TaskError> {
        let runs = runs(drawn, &[effect.times(size)], samples)?;
        Ok(deviation(&drawn.axis, &runs, drawn.speed, known)? / drawn.axis.noise_m())
    };
    let (mut size, mut slope) = (1.0, 1.0);
    let mut found = shown(size)?;
    for _ in 0..STEPS {
        let short = (wanted / found.max(1e-12)).ln();
        if short.abs() < NEAR {
            break;
        }
        let next = size * (short / slope).clamp(-5.0, 5.0).exp();
        let Ok(there) = shown(next) else { break };
        let seen = (there / found).ln() / (next / size).ln();
        if seen > 0.3 && seen < 4.0 {
            slope = seen;
        }
        (size, found) = (next, there);
    }
    Ok((effect.times(size), found))
}

fn write(machine: &Machine, hidden: Option<&AxisEffect>, folder: &Path) -> Result<Bundle, TaskError> {
    let mut all = Vec::new();
    for (i, drawn) in machine.axes.iter().enumerate() {
        let effects: Vec<AxisEffect> = hidden
            .filter(|_| i == machine.hidden_in)
            .cloned()
            .into_iter()
            .collect();
        all.push(runs(drawn, &effects, machine.samples)?);
    }
    let encoders: usize = machine.axes.iter().map(|d| d.axis.encoders()).sum();
    let names =
        |letter: &str, count: usize| -> Vec<String> { (1..=count).map(|i| format!("{letter}{i}")).collect() };
    let (outputs, inputs) = (names("y", encoders), names("u", machine.axes.len()));
    let [outputs, inputs] = [&outputs, &inputs].map(|n| n.iter().map(String::as_str).collect::<Vec<_>>());
    let mut description = Description::new("axis", machine.axes[0].axis.rate_hz, &outputs, &inputs);
    let units = |unit: &str, count: usize| vec![unit.to_owned(); count];
    description.channels.output.units = units("m", outputs.len());
    description.channels.input.units = units("N", inputs.len());
    let step = 1.0 / machine.axes[0].axis.rate_hz;
    let warm = |i: usize| -> Option<Vec<f64>> {
        let at = |k: usize| hidden?.degrees(i, k as f64 * step);
        (0..machine.samples).map(at).collect()
    };
    let warming: &[&str] = if warm(0).is_some() { &["guide"] } else { &[] };
    description.channels.auxiliary.columns = warming.iter().map(ToString::to_string).collect();
    description.channels.auxiliary.units = units("degC", warming.len());
    let mut writer = BundleWriter::create(folder, description, RecordFormat::Npz)?;
    for i in 0..RECORDS {
        let purpose = if i + 1 < RECORDS {
            Purpose::Estimation
        } else {
            Purpose::Validation
        };
        let columns = |of: fn(&AxisRun) -> Vec<Vec<f64>>| all.iter().flat_map(|runs| of(&runs[i])).collect();
        writer.write(&Record {
            outputs: Signals {
                units: units("m", outputs.len()),
                ..Signals::new(&outputs, columns(|r| r.outputs.clone()))
            },
            inputs: Signals {
                units: units("N", inputs.len()),
                ..Signals::new(&inputs, columns(|r| vec![r.inputs.clone()]))
            },
            auxiliary: Signals {
                units: units("degC", warming.len()),
                ..Signals::new(warming, warm(i).into_iter().collect())
            },
            ..Record::empty(&format!("move{}", i + 1), RecordKind::Transient, purpose)
        })?;
    }
    Ok(writer.finish()?)
}
