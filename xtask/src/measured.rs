//! The pipeline on bundles that this workspace did not simulate.

use crate::{TaskError, root};
use experiment_data::Bundle;
use lpv_cli::{IdentifyConfig, Summary, estimate_bundle, identify};
use std::path::PathBuf;

/// The summaries, where the bundles are there.
pub(crate) struct MeasuredBundles {
    pub(crate) machine_plain: Option<Summary>,
    pub(crate) two_mass_bench: Option<Summary>,
}

pub(crate) fn run() -> Result<MeasuredBundles, TaskError> {
    Ok(MeasuredBundles {
        machine_plain: summary("machine-plain")?,
        two_mass_bench: summary("two-mass-bench")?,
    })
}

fn summary(name: &str) -> Result<Option<Summary>, TaskError> {
    let folder: PathBuf = root().join("../shared/data").join(name);
    if !folder.exists() {
        eprintln!("skipped: bundle {name} is not at ../shared/data");
        return Ok(None);
    }
    let bundle = Bundle::open(&folder)?;
    let config = IdentifyConfig::default();
    let responses = estimate_bundle(&bundle, config.skip_periods)?;
    let identified = identify(&responses.frfs(), responses.clock, &config)?;
    Ok(Some(Summary::new(&identified, &responses)?))
}
