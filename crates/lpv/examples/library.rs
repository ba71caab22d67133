//! A bundle to a low-order LFR, its validation, and one step ahead along a record:
//! `cargo run -p lpv --example library BUNDLE`. It names no crate but `lpv`.

use lpv::experiment_data::Bundle;
use lpv::lpv_simulate::{Machine, Predictor};
use lpv::validation::{Scope, validate};
use lpv::{IdentifyConfig, ModelFile, identify_bundle, silent};
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("give a bundle")?;
    let bundle = Bundle::open(Path::new(&path))?;
    let config = IdentifyConfig::default();
    let outcome = identify_bundle(&bundle, &config, &silent)?;
    println!("{}", outcome.model.describe());
    let file = ModelFile::of(outcome, &bundle, config, Path::new("model.json"))?;
    let (found, _) = validate(&file, &bundle, Scope::HeldOut, &silent)?;
    println!("{}", found.verdict.sentence);
    let machine = Machine::new(&file.model, bundle.clock()?)?;
    let transient = bundle.description().records.iter().position(|r| !r.is_periodic());
    if let Some(index) = transient {
        let record = bundle.load(index)?;
        let noise = vec![1e-6; record.outputs.channels()];
        let disturbance = vec![1e-3; record.inputs.channels()];
        let predictor = Predictor::for_disturbance(&machine, &disturbance, &noise);
        let errors = predictor.errors(&record, None, record.len())?;
        println!("{}: at most {:.1e} one step ahead", record.name, errors.amax());
    }
    Ok(())
}
