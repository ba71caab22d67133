//! The bench of hidden effects: random machines with something wrong with them, written as bundles, and `lpv diagnose` on
//! each. The solver sees the bundle only; what was hidden in it stays here.

mod page;
mod score;
pub(crate) mod servo;
mod work;

use crate::{Blind, TaskError};
use experiment_data::{Bundle, RecordFormat};
use lpv::diagnose::{Diagnosis, Given, diagnose};
use lpv::simulate::{CleanMoves, MachineFile, MultisineFile, PositionsFile, simulate};
use lpv::{IdentifyConfig, ModelFile, PipelineError, identify_bundle, silent};
use lpv_core::Discrete;
pub(crate) use page::page;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
pub(crate) use score::score;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::Instant;
use work::Seeded;
pub(crate) use work::{logged, publish};
use xytable_plant::{HiddenEffect, MachineParameters, VerifiedController, split_seed};

/// Effects that the contract of `diagnosis.json` asks for; whatever else the plant can hide is outside.
pub(crate) const CATALOGUE: [&str; 23] = [
    "coulomb-friction",
    "stribeck-friction",
    "viscous-friction",
    "hysteresis",
    "cogging",
    "cable-stiffness",
    "position-dependent-gain",
    "actuator-saturation",
    "motor-asymmetry",
    "actuator-lag",
    "delay",
    "extra-mode",
    "payload",
    "cubic-stiffness",
    "scheduling-rate",
    "second-scheduling",
    "constant-force",
    "periodic-disturbance",
    "abbe-offset",
    "sensor-gain",
    "sensor-cyclic-error",
    "sensor-drift",
    "quantization",
];

/// Deviations of the outputs, in units of the noise.
pub(crate) const SEVERITIES: [f64; 4] = [3.0, 10.0, 100.0, 1000.0];

/// What is hidden in one machine, and the seed of everything else.
#[derive(Debug, Clone)]
struct Case {
    seed: u64,
    effects: Vec<&'static str>,
    deviation: f64,
}

/// One case with what came out.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Outcome {
    pub(crate) seed: u64,
    /// What was hidden.
    pub(crate) hidden: Vec<String>,
    /// Its families.
    pub(crate) families: Vec<String>,
    /// Wanted deviation, units of the noise.
    pub(crate) wanted: f64,
    /// The deviation that was reached.
    pub(crate) deviation: f64,
    /// True values by name.
    pub(crate) facts: Vec<(String, f64)>,
    /// Diagnosis, or why there is none.
    pub(crate) diagnosis: Result<Diagnosis, String>,
    /// Wall clock of the diagnosis.
    pub(crate) seconds: f64,
    /// The same with the small LFR of the machine as it was before something was hidden in it as the base; where asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) identified: Option<Result<Diagnosis, String>>,
}

/// How much of the bench is run.
#[derive(Debug, Clone)]
pub(crate) struct Extent {
    pub(crate) seeds: u64,
    pub(crate) clean: u64,
    pub(crate) pairs: u64,
    /// No new case after so many minutes.
    pub(crate) minutes: f64,
    /// These effects only; empty for all.
    pub(crate) only: Vec<String>,
    /// These deviations only; empty for all.
    pub(crate) severities: Vec<f64>,
    /// Also with an identified model as the base.
    pub(crate) identified: bool,
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

impl Extent {
    /// What the options ask for, with so many clean machines and pairs for each seed.
    pub(crate) fn of(options: &Blind, [clean, pairs]: [u64; 2]) -> Self {
        let asked = |kind: &str| options.only.is_empty() || options.only.iter().any(|o| o == kind);
        Self {
            seeds: options.seeds,
            clean: if asked("clean") { clean * options.seeds } else { 0 },
            pairs: if asked("pairs") { pairs * options.seeds } else { 0 },
            minutes: options.minutes,
            only: options.only.clone(),
            severities: options.severities.clone(),
            identified: options.lfr,
        }
    }

    /// A minute: effects that are seen at a glance, and clean machines.
    pub(crate) fn quick() -> Self {
        Self {
            seeds: 1,
            clean: 1,
            pairs: 0,
            minutes: 10.0,
            only: ["coulomb-friction", "cogging", "payload", "delay"]
                .map(String::from)
                .to_vec(),
            severities: vec![100.0],
            identified: false,
        }
    }
}

/// Runs cases in an order that is fair to all effects when the time is short; each is appended to `log`. Those that are `done` are not
/// run again.
///
/// # Errors
/// Of the file system, and of a plant that refuses its machine.
pub(crate) fn run(
    extent: &Extent,
    seed: u64,
    log: &Path,
    done: Vec<Outcome>,
) -> Result<(Vec<Outcome>, Option<f64>), TaskError> {
    let all = cases(extent, seed);
    let seconds = extent.only.is_empty().then(|| longest(&all));
    let solve = |case: &Case| solve(case, extent.identified);
    let outcomes = work::work(&all, (log, extent.minutes), done, solve, score::line)?;
    Ok((outcomes, seconds))
}

/// Seconds that a diagnosis alone takes at the most: of a clean machine, of one with each effect at its largest deviation, and of one
/// with two.
fn longest(all: &[Case]) -> f64 {
    let kind = |case: &Case| match case.effects.as_slice() {
        [_, _, ..] => None,
        single => Some(single.first().copied()),
    };
    let mut timed: Vec<&Case> = Vec::new();
    for case in all {
        match timed.iter_mut().find(|t| kind(t) == kind(case)) {
            Some(smaller) if smaller.deviation < case.deviation => *smaller = case,
            Some(_) => {}
            None => timed.push(case),
        }
    }
    let alone = |case: &Case| match solve(case, false) {
        Ok(outcome) => {
            println!("alone: {}", score::line(&outcome));
            outcome.seconds
        }
        // A severity that the integration cannot hold, say.
        Err(error) => {
            println!("alone: not simulated: {error}");
            0.0
        }
    };
    timed.into_iter().map(alone).fold(0.0, f64::max)
}

/// Machines that an extent asks for.
pub(crate) fn count(extent: &Extent, seed: u64) -> usize {
    cases(extent, seed).len()
}

fn cases(extent: &Extent, seed: u64) -> Vec<Case> {
    let outside: Vec<&'static str> = HiddenEffect::catalogue()
        .map(|info| info.name)
        .filter(|name| !CATALOGUE.contains(name))
        .collect();
    let wanted = |name: &str| extent.only.is_empty() || extent.only.iter().any(|o| o == name);
    let mut all = Vec::new();
    for round in 0..extent.seeds.max(extent.clean).max(extent.pairs) {
        let case = |what: &str, effects: Vec<&'static str>, deviation: f64| Case {
            seed: split_seed(split_seed(seed, what), &round.to_string()),
            effects,
            deviation,
        };
        if round < extent.seeds {
            for severity in SEVERITIES {
                if !(extent.severities.is_empty() || extent.severities.contains(&severity)) {
                    continue;
                }
                for name in CATALOGUE
                    .into_iter()
                    .chain(outside.iter().copied())
                    .filter(|n| wanted(n))
                {
                    all.push(case(&format!("{name} {severity}"), vec![name], severity));
                }
            }
        }
        if round < extent.clean {
            all.push(case("clean", Vec::new(), 0.0));
        }
        if round < extent.pairs {
            let mut rng = ChaCha8Rng::seed_from_u64(split_seed(seed, &format!("pair {round}")));
            let one = rng.random_range(0..CATALOGUE.len());
            let other = (one + rng.random_range(1..CATALOGUE.len())) % CATALOGUE.len();
            all.push(case("pair", vec![CATALOGUE[one], CATALOGUE[other]], 100.0));
        }
    }
    all
}

/// A machine that nobody has seen.
fn machine(seed: u64) -> Result<MachineFile, TaskError> {
    let clock = Discrete::from_rate(20.0)?;
    let mut rng = ChaCha8Rng::seed_from_u64(split_seed(seed, "machine"));
    loop {
        let mut about = |low: f64, high: f64| low * (high / low).powf(rng.random::<f64>());
        let modes = [about(1.2, 1.8), about(1.7, 2.5)];
        let damping = about(6e-3, 0.03);
        let mut machine = MachineParameters::from_modes(modes, damping);
        // The couplings belong to other masses now: the modes move a little more.
        machine.carriage_mass_kg *= about(0.8, 1.25);
        machine.beam_mass_kg *= about(0.8, 1.25);
        machine.carriage_inertia_kg_m2 *= about(0.8, 1.25);
        machine.beam_inertia_kg_m2 *= about(0.8, 1.25);
        machine.half_beam_m *= about(0.9, 1.1);
        machine.servo_mass_kg = machine.carriage_mass_kg;
        let file = MachineFile {
            name: "blind".to_owned(),
            seed,
            second_signal: true,
            machine,
            positions: PositionsFile {
                count: 11,
                values: Vec::new(),
            },
            multisine: MultisineFile {
                crest_iterations: 10,
                ..MultisineFile::default()
            },
            moves: lpv::simulate::MovesFile {
                estimation: 3,
                validation: 2,
                ..lpv::simulate::MovesFile::default()
            },
            ..MachineFile::default()
        };
        if VerifiedController::by_rule(&machine.check()?, &file.controller, clock).is_ok() {
            return Ok(file);
        }
    }
}

/// The effect with the severity that makes this deviation, within a tenth of it, or as near as its range goes.
fn scaled(
    clean: &CleanMoves<'_>,
    effect: HiddenEffect,
    wanted: f64,
) -> Result<(HiddenEffect, f64), TaskError> {
    let [least, most] = effect.info().range;
    let sign = effect.severity().signum();
    let low = least.max(1e-12);
    let at = |size: f64| -> Result<(HiddenEffect, f64), TaskError> {
        let hidden = effect.with_severity(sign * size)?;
        Ok((hidden, clean.deviation(&[hidden])?.max(1e-9)))
    };
    let mut known = (effect.severity().abs(), at(effect.severity().abs())?);
    let mut slope = if effect.info().name == "actuator-saturation" {
        -2.0
    } else {
        1.0
    };
    for _ in 0..6 {
        let (size, (_, found)) = known;
        let short = (wanted / found).ln();
        if short.abs() < 0.1 {
            break;
        }
        let next = (size * (short / slope).clamp(-6.0, 6.0).exp()).clamp(low, most.abs());
        if (next / size).ln().abs() < 1e-6 {
            break;
        }
        let Ok(there) = at(next) else { break };
        let seen = (there.1 / found).ln() / (next / size).ln();
        if seen.abs() > 0.3 && seen.abs() < 4.0 {
            slope = seen;
        }
        known = (next, there);
    }
    Ok(known.1)
}

fn solve(case: &Case, identified: bool) -> Result<Outcome, TaskError> {
    let file = machine(case.seed)?;
    let clean = CleanMoves::new(&file)?;
    let mut hidden = Vec::new();
    let mut reached = 0.0;
    for name in &case.effects {
        let effect: HiddenEffect = name.parse()?;
        let mut effect = effect.varied(split_seed(case.seed, "shape"));
        if effect.info().range[0] < 0.0 && split_seed(case.seed, "sign").is_multiple_of(2) {
            effect = effect.with_severity(-effect.severity())?;
        }
        let (effect, found) = scaled(&clean, effect, case.deviation)?;
        hidden.push(effect);
        reached = found;
    }
    let folder = tempfile::tempdir()?;
    let out = folder.path().join("bundle");
    simulate(&file, &hidden, &out, RecordFormat::Npz, &|_, _| ())?;
    let bundle = Bundle::open(&out)?;
    let start = Instant::now();
    let found = diagnose(&bundle, Given::default(), &silent);
    let seconds = start.elapsed().as_secs_f64();
    let identified = match identified {
        true => {
            let clean = folder.path().join("clean");
            simulate(&file, &[], &clean, RecordFormat::Npz, &|_, _| ())?;
            Some(with_identified(&Bundle::open(&clean)?, &bundle).map_err(|e| e.to_string()))
        }
        false => None,
    };
    Ok(Outcome {
        identified,
        seed: case.seed,
        hidden: hidden.iter().map(|h| h.info().name.to_owned()).collect(),
        families: hidden.iter().map(|h| h.info().family.to_owned()).collect(),
        wanted: case.deviation,
        deviation: reached,
        facts: hidden
            .iter()
            .flat_map(|h| h.facts(&file.machine))
            .map(|(name, value)| (name.to_owned(), value))
            .collect(),
        diagnosis: found.map(|d| d.diagnosis).map_err(|e| e.to_string()),
        seconds,
    })
}

/// The diagnosis of a bundle with the model of another as the base.
fn with_identified(clean: &Bundle, bundle: &Bundle) -> Result<Diagnosis, PipelineError> {
    let config = IdentifyConfig::default();
    let outcome = identify_bundle(clean, &config, &silent)?;
    let file = ModelFile::of(outcome, clean, config, clean.folder())?;
    Ok(diagnose(
        bundle,
        Given {
            model: Some(&file),
            ..Given::default()
        },
        &silent,
    )?
    .diagnosis)
}
