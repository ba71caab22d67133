//! Times, to be read; run with `--ignored --nocapture`.

use crate::machine::{C64, Known, clock, lines, noisy, response};
use lpv_core::{Discrete, Frf};
use pole_fit::{Integrators, PoleFit, PoleFitSettings, fit};
use std::hint::black_box;
use std::time::{Duration, Instant};

fn report(name: &str, run: impl Fn() -> PoleFit) {
    let mut best = Duration::MAX;
    for _ in 0..40 {
        let start = Instant::now();
        black_box(run());
        best = best.min(start.elapsed());
    }
    let account = run().account;
    println!(
        "{name}: {best:?} at best, {} factorisations, {:?}, excess {:.2}",
        account.factorisations,
        account.stop,
        account.cost_excess()
    );
}

#[test]
#[ignore = "prints times"]
fn thousands_of_lines() {
    let truth = response(-0.13, &lines(1)).select(|k, _| k < 5000);
    let estimate = noisy(&truth, Known::From(28), 1.0, 1);
    let settings = PoleFitSettings {
        integrators: Integrators::Fixed(2),
        ..PoleFitSettings::new(6)
    };
    report("5000 lines, order 6, 2 x 2", || {
        fit(&estimate, clock(), &settings).unwrap()
    });
}

#[test]
#[ignore = "prints times"]
fn twelve_poles() {
    // Twelve poles over 401 lines, two by two.
    let frequencies: Vec<f64> = (1..=401).map(|k| f64::from(k) * 0.00124).collect();
    let mut values = Vec::new();
    for f in &frequencies {
        let z = C64::from_polar(1.0, std::f64::consts::TAU * f);
        for c in 0..4 {
            let sum: C64 = (0..6)
                .map(|i| {
                    let pole = C64::from_polar(0.995, 0.3 + 0.45 * f64::from(i));
                    let residue = C64::new((f64::from(i * 4 + c)).sin(), (f64::from(i + c)).cos());
                    residue / (z - pole) + residue.conj() / (z - pole.conj())
                })
                .sum();
            values.push(sum * 1e-3);
        }
    }
    let truth = Frf::new(frequencies, 2, 2, values).unwrap();
    let estimate = noisy(&truth, Known::From(28), 0.1, 1);
    let settings = PoleFitSettings::new(12);
    let one = Discrete::new(1.0).unwrap();
    report("401 lines, order 12, 2 x 2", || {
        fit(&estimate, one, &settings).unwrap()
    });
}
