//! The frozen poles over the stroke, and a short noisy experiment.
//!
//! Run it with `cargo run --release --example simulate -p xytable-plant`.

use lpv_core::Discrete;
use std::f64::consts::TAU;
use xytable_plant::{
    ControllerSettings, Experiment, ExperimentSettings, MachineParameters, MultisineSettings, PlantError,
    VerifiedController,
};

fn main() -> Result<(), PlantError> {
    let machine = MachineParameters::default().check()?;
    let clock = Discrete::from_rate(20.0)?;
    println!("flexible modes over the stroke (Hz, damping ratio)");
    for p in machine.positions(7) {
        let modes: Vec<String> = machine
            .flexible_poles(p)?
            .iter()
            .filter(|s| s.im > 0.0)
            .map(|s| format!("{:.4} ({:.4})", s.norm() / TAU, -s.re / s.norm()))
            .collect();
        println!("  p = {p:+.2} m: {}", modes.join("  "));
    }
    let controller = VerifiedController::by_rule(&machine, &ControllerSettings::default(), clock)?;
    let account = controller.robustness();
    println!(
        "closed loop: spectral radius {:.4}, modulus margin {:.3}",
        account.spectral_radius(),
        account.modulus_margin()
    );
    let multisine = MultisineSettings {
        period: 4096,
        ..MultisineSettings::default()
    }
    .check()?;
    println!(
        "multisine: {} lines, crest factor {:.3} (was {:.3}) after {} iterations",
        multisine.lines().len(),
        multisine.crest_factor(),
        multisine.first_crest_factor(),
        multisine.iterations()
    );
    let settings = ExperimentSettings {
        periods: 4,
        ..ExperimentSettings::default()
    };
    let experiment = Experiment::new(&machine, &controller, &multisine, 0.3, settings)?;
    experiment.run(&mut |block| -> Result<(), PlantError> {
        let rms = |c: &[f64]| (c.iter().map(|v| v * v).sum::<f64>() / c.len() as f64).sqrt();
        println!(
            "experiment {} period {}: rms y1 {:.3e} m, y2 {:.3e} rad, u1 {:.3e} m/s^2, u2 {:.3e} rad/s^2",
            block.experiment,
            block.period,
            rms(&block.outputs[0]),
            rms(&block.outputs[1]),
            rms(&block.inputs[0]),
            rms(&block.inputs[1])
        );
        Ok(())
    })?;
    Ok(())
}
