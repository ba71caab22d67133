//! Converts a bundle to another record format: `convert <bundle> <new folder> <npz|csv|mat|parquet>`.
//! Without arguments it makes a small bundle in a temporary folder and converts that.

use experiment_data::{Bundle, BundleWriter, DataError, Description, RecordFormat};
use lpv_core::{Purpose, Record, RecordKind, Signals};
use std::path::{Path, PathBuf};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [from, to, format] = arguments.as_slice() {
        convert(
            Path::new(from),
            Path::new(to),
            RecordFormat::of(&format!("x.{format}"))?,
        )?;
        return Ok(());
    }
    let scratch = std::env::temp_dir().join(format!("experiment-data-{}", std::process::id()));
    let made = small_bundle(&scratch.join("csv"))?;
    convert(&made, &scratch.join("mat"), RecordFormat::Mat)?;
    std::fs::remove_dir_all(&scratch)?;
    Ok(())
}

fn convert(from: &Path, to: &Path, format: RecordFormat) -> Result<(), DataError> {
    let bundle = Bundle::open(from)?;
    let mut writer = BundleWriter::create(to, bundle.description().clone(), format)?;
    for record in bundle.records() {
        let record = record?;
        println!(
            "{:12} {:?}, {} samples, position {:?}",
            record.name,
            record.kind,
            record.len(),
            record.position
        );
        writer.write(&record)?;
    }
    let new = writer.finish()?;
    println!("{}: {} records", new.folder().display(), new.len());
    Ok(())
}

fn small_bundle(folder: &Path) -> Result<PathBuf, DataError> {
    let mut writer = BundleWriter::create(
        folder,
        Description::new("small", 20.0, &["y"], &["u"]),
        RecordFormat::Csv,
    )?;
    let wave = |phase: f64| {
        (0..80)
            .map(|k| (0.37 * f64::from(k) + phase).sin())
            .collect::<Vec<f64>>()
    };
    writer.write(&Record {
        name: "sway".to_owned(),
        kind: RecordKind::Transient,
        purpose: Purpose::Estimation,
        position: None,
        outputs: Signals::new(&["y"], vec![wave(0.5)]),
        inputs: Signals::new(&["u"], vec![wave(0.0)]),
        references: Signals::default(),
        scheduling: Signals::default(),
        auxiliary: Signals::default(),
        injection: Signals::default(),
    })?;
    Ok(writer.finish()?.folder().to_owned())
}
