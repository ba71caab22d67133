//! A double integrator with two lightly damped modes, two outputs, one input, seen through noise: scan the orders, then
//! print the modes of the chosen one with their deviations beside the truth.

use lpv_core::num_complex::Complex;
use lpv_core::{Discrete, Frf, FrfEstimate};
use pole_fit::{Integrators, PoleFitSettings, scan};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let clock = Discrete::from_rate(20.0)?;
    let truth = [(1.45, 0.015), (2.0, 0.015)];
    let poles = truth.map(|(f, d): (f64, f64)| {
        let w = std::f64::consts::TAU * f * clock.sample_time();
        Complex::from_polar((-d * w).exp(), w * (1.0 - d * d).sqrt())
    });
    let lines: Vec<f64> = (25..400).map(|k| 0.01 * f64::from(k)).collect();
    let deviation = 2e-3;
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut values = Vec::new();
    for f in &lines {
        let z = Complex::from_polar(1.0, std::f64::consts::TAU * f * clock.sample_time());
        let rigid = (z + 1.0) * 1.25e-3 / (z - 1.0).powu(2);
        for signs in [[1.0, 0.3], [-0.4, 1.0]] {
            let modes: Complex<f64> = (0..2)
                .map(|i| (z + 1.0) * 5e-3 * signs[i] / ((z - poles[i]) * (z - poles[i].conj())))
                .sum();
            let (x, y): (f64, f64) = (StandardNormal.sample(&mut rng), StandardNormal.sample(&mut rng));
            values.push(rigid + modes + Complex::new(x, y) * (deviation / 2f64.sqrt()));
        }
    }
    let n = lines.len();
    let frf = Frf::new(lines, 2, 1, values)?;
    let variance = Complex::new(deviation * deviation, 0.0);
    let zero = Complex::new(0.0, 0.0);
    let covariance = [variance, zero, zero, variance].repeat(n);
    let one = vec![Complex::new(1.0, 0.0); n];
    let estimate = FrfEstimate::new(frf, covariance, one, f64::INFINITY, None)?;

    let settings = PoleFitSettings {
        integrators: Integrators::Fixed(2),
        ..PoleFitSettings::new(6)
    };
    let result = scan(&estimate, clock, &settings, &[2, 4, 6, 8])?;
    println!("order        cost    expected         MDL  stable poles");
    for entry in &result.entries {
        let account = &entry.fit.account;
        let stable = entry.stable.iter().filter(|&&s| s).count();
        println!(
            "{:5} {:11.1} {:11.1} {:11.1} {stable:5} of {}",
            entry.order, account.cost, account.expected_cost, entry.mdl, entry.order
        );
    }
    let Some(best) = result.chosen() else {
        return Ok(());
    };
    println!(
        "\norder {} has the shortest description; its modes:",
        best.account.order
    );
    for (mode, (f, d)) in best.modes().iter().zip(truth) {
        println!(
            "  {:.6} +- {:.6} (true {f}), damping {:.6} +- {:.6} (true {d})",
            mode.frequency_hz, mode.frequency_deviation_hz, mode.damping, mode.damping_deviation
        );
    }
    Ok(())
}
