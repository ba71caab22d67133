//! The pipeline on bundles that this workspace did not simulate.

use crate::diagnosed::{self, Found};
use crate::{TaskError, root};
use experiment_data::Bundle;
use lpv::inspect::{Inspection, inspect};
use lpv::validation::{Scope, Validation, validate};
use lpv::{IdentifyConfig, ModelFile, Structure, Summary, identify_bundle, silent};
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

/// A bundle of shared data, where it is there.
pub(crate) fn open(name: &str) -> Result<Option<Bundle>, TaskError> {
    let folder: PathBuf = root().join("../shared/data").join(name);
    if !folder.exists() {
        eprintln!("skipped: bundle {name} is not at ../shared/data");
        return Ok(None);
    }
    Ok(Some(Bundle::open(&folder)?))
}

/// Identification with default settings, where the bundle is there.
pub(crate) fn summary(name: &str) -> Result<Option<Summary>, TaskError> {
    let Some(bundle) = open(name)? else {
        return Ok(None);
    };
    Ok(Some(
        identify_bundle(&bundle, &IdentifyConfig::default(), &silent)?.summary,
    ))
}

/// One bundle through `inspect`, `identify` and `validate`.
#[derive(Serialize)]
pub(crate) struct Case {
    pub(crate) inspection: Inspection,
    pub(crate) summary: Summary,
    pub(crate) validation: Validation,
    pub(crate) inspect_seconds: f64,
    pub(crate) identify_seconds: f64,
}

impl Case {
    pub(crate) fn run(bundle: &Bundle, config: &IdentifyConfig) -> Result<Self, TaskError> {
        let start = Instant::now();
        let inspection = inspect(bundle, &silent)?;
        let inspect_seconds = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let outcome = identify_bundle(bundle, config, &silent)?;
        let identify_seconds = start.elapsed().as_secs_f64();
        let summary = outcome.summary.clone();
        let file = ModelFile::of(outcome, bundle, config.clone(), bundle.folder())?;
        let (validation, _) = validate(&file, bundle, Scope::All, &silent)?;
        Ok(Self {
            inspection,
            summary,
            validation,
            inspect_seconds,
            identify_seconds,
        })
    }
}

/// Everything that docs/measured-data.md shows; a part is none where its bundle is missing.
#[derive(Serialize)]
pub(crate) struct Measured {
    pub(crate) machine_plain: Option<Case>,
    pub(crate) two_mass_bench: Option<Case>,
    /// Relative error by output of fits of two-mass-bench of other orders.
    pub(crate) two_mass_orders: Vec<(usize, Vec<f64>)>,
    pub(crate) cd_player_arm: Option<Case>,
    pub(crate) emps: Option<Case>,
    /// What the models lack.
    pub(crate) diagnosed: Vec<Found>,
    /// Megabytes a second of the CSV reader on one core.
    pub(crate) csv_mb_per_second: f64,
}

/// Orders at which two-mass-bench is fitted beside the chosen one.
const ORDERS: [usize; 6] = [2, 4, 6, 8, 10, 12];

/// Runs all bundles with default settings; what is asked for beyond them is in the arguments here.
pub(crate) fn run() -> Result<Measured, TaskError> {
    let case = |name: &str, config: IdentifyConfig| -> Result<Option<Case>, TaskError> {
        open(name)?.map(|bundle| Case::run(&bundle, &config)).transpose()
    };
    let plain = IdentifyConfig::default;
    let mut two_mass_orders = Vec::new();
    if let Some(bundle) = open("two-mass-bench")? {
        for order in ORDERS {
            let config = IdentifyConfig {
                order: Some(order),
                ..plain()
            };
            if let Some(f) = identify_bundle(&bundle, &config, &silent)?.summary.frequency {
                two_mass_orders.push((order, f.relative_rms_percent));
            }
        }
    }
    Ok(Measured {
        machine_plain: case("machine-plain", plain())?,
        two_mass_bench: case("two-mass-bench", plain())?,
        two_mass_orders,
        cd_player_arm: case(
            "cd-player-arm",
            IdentifyConfig {
                hold_out: 0.5,
                ..plain()
            },
        )?,
        emps: case(
            "emps",
            IdentifyConfig {
                structure: Some(Structure::RigidBody),
                ..plain()
            },
        )?,
        diagnosed: diagnosed::run()?,
        csv_mb_per_second: csv_speed()?,
    })
}

/// Reads a CSV record of 64 MB three times on one core and takes the middle.
fn csv_speed() -> Result<f64, TaskError> {
    const MEGABYTES: usize = 64;
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("speed.csv");
    let mut text = String::from("u1,u2,y1,y2,r1,r2,p\n");
    let mut k = 0u32;
    while text.len() < MEGABYTES << 20 {
        use std::fmt::Write as _;
        let t = f64::from(k) * 1e-3;
        writeln!(
            text,
            "{:?},{:?},{:?},{:?},{:?},{:?},{:?}",
            t.sin(),
            (1.3 * t).cos(),
            1e-4 * (0.7 * t).sin(),
            1e-3 * (0.2 * t).cos(),
            0.01 * t.cos(),
            0.02 * (2.0 * t).sin(),
            0.3 * (0.01 * t).sin()
        )?;
        k += 1;
    }
    std::fs::write(&path, &text)?;
    let mut seconds: Vec<f64> = (0..3)
        .map(|_| {
            let start = Instant::now();
            let columns = experiment_data::read_columns(&path, &["u1", "u2", "y1", "y2", "r1", "r2", "p"])?;
            assert_eq!(columns[0].len(), k as usize);
            Ok(start.elapsed().as_secs_f64())
        })
        .collect::<Result<_, TaskError>>()?;
    seconds.sort_by(f64::total_cmp);
    Ok(text.len() as f64 / 1e6 / seconds[1])
}
