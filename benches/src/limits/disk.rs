//! A bundle on disk, as long as it may be.

use crate::Failure;
use crate::works::Work;
use experiment_data::{Bundle, BundleWriter, ChannelGroup, Description, RecordFormat};
use lpv::{estimate_bundle, silent};
use lpv_core::{Purpose, Record, RecordKind, Signals};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::hint::black_box;

/// Samples of a period.
const PERIOD: usize = 1 << 15;
/// Two experiments at each of two positions.
const RECORDS: usize = 4;
/// Outputs, inputs, references and p.
const COLUMNS: usize = 7;

/// Periods of a record in a bundle of so many MB.
pub(crate) fn periods(megabytes: usize) -> usize {
    (megabytes * 1_000_000)
        .div_ceil(RECORDS * COLUMNS * 8 * PERIOD)
        .max(4)
}

/// Responses at all positions of a bundle of so many MB.
pub(crate) fn responses<'a>(megabytes: usize) -> Result<Work<'a>, Failure> {
    std::fs::create_dir_all("target/limits")?;
    let folder = tempfile::tempdir_in("target/limits")?;
    let bundle = write(&folder.path().join("bundle"), periods(megabytes))?;
    Ok(Box::new(move || {
        let _kept = &folder;
        black_box(estimate_bundle(&bundle, None, &silent)?);
        Ok(())
    }))
}

fn write(folder: &std::path::Path, periods: usize) -> Result<Bundle, Failure> {
    let mut description = Description::new("disk", 20.0, &["y1", "y2"], &["u1", "u2"]);
    description.channels.reference = ChannelGroup::new(&["r1", "r2"]);
    description.channels.scheduling = ChannelGroup::new(&["p"]);
    let mut writer = BundleWriter::create(folder, description, RecordFormat::Npz)?;
    for index in 0..RECORDS {
        writer.write(&record(index, periods))?;
    }
    Ok(writer.finish()?)
}

/// References [r, r] and [r, -r]; inputs that follow them, outputs that follow the inputs a sample later, all with noise of their own.
fn record(index: usize, periods: usize) -> Record {
    let mut rng = ChaCha8Rng::seed_from_u64(index as u64);
    let sign = if index.is_multiple_of(2) { 1.0 } else { -1.0 };
    let r: Vec<f64> = (0..PERIOD).map(|_| rng.random::<f64>() - 0.5).collect();
    let mut along = |gains: [f64; 2], delay: usize, noise: f64| -> Vec<f64> {
        (0..periods * PERIOD)
            .map(|k| {
                let now = r[(k + PERIOD - delay) % PERIOD];
                (gains[0] + sign * gains[1]) * now + noise * (rng.random::<f64>() - 0.5)
            })
            .collect()
    };
    let position = [-0.1, 0.1][index / 2];
    Record {
        name: format!("record{index}"),
        kind: RecordKind::Periodic { period: PERIOD },
        purpose: Purpose::Estimation,
        position: Some(position.into()),
        outputs: Signals::new(
            &["y1", "y2"],
            vec![along([0.5, 0.1], 1, 1e-3), along([0.1, 0.3], 1, 1e-3)],
        ),
        inputs: Signals::new(
            &["u1", "u2"],
            vec![along([1.0, 0.0], 0, 1e-3), along([0.0, 1.0], 0, 1e-3)],
        ),
        references: Signals::new(
            &["r1", "r2"],
            vec![along([1.0, 0.0], 0, 0.0), along([0.0, 1.0], 0, 0.0)],
        ),
        scheduling: Signals::new(&["p"], vec![vec![position; periods * PERIOD]]),
        auxiliary: Signals::new(&[], vec![]),
        injection: Signals::new(&[], vec![]),
    }
}
