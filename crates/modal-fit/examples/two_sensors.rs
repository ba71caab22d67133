//! Three modes seen by three sensors and moved by two actuators: six states, where a common denominator needs twelve.

use modal_fit::lpv_core::num_complex::Complex;
use modal_fit::lpv_core::{Discrete, Frf, FrfEstimate};
use modal_fit::{ModalSettings, modal_fit};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let clock = Discrete::from_rate(1000.0)?;
    let pole = |hz: f64, damping: f64| {
        let w = std::f64::consts::TAU * hz;
        (Complex::new(-damping * w, w * (1.0 - damping * damping).sqrt()) / 1000.0).exp()
    };
    let poles = [pole(40.0, 0.01), pole(95.0, 0.02), pole(180.0, 0.005)];
    let shapes = [[1.0, 0.5, -0.3], [0.2, -1.0, 0.8], [-0.6, 0.4, 1.0]];
    let lines: Vec<f64> = (1..800).map(|k| 0.5 * f64::from(k)).collect();
    let mut values = Vec::new();
    for &f in &lines {
        let z = Complex::from_polar(1.0, std::f64::consts::TAU * f / 1000.0);
        for input in 0..2 {
            for output in 0..3 {
                let part = |(l, s): (&Complex<f64>, &[f64; 3])| {
                    let residue = Complex::i() * s[output] * s[input];
                    residue / (z - l) + residue.conj() / (z - l.conj())
                };
                values.push(poles.iter().zip(&shapes).map(part).sum::<Complex<f64>>());
            }
        }
    }
    let estimate = FrfEstimate::with_unit_covariance(Frf::new(lines, 3, 2, values)?, None)?;
    let begin: Vec<_> = poles.iter().map(|l| l * 0.9999).collect();
    let found = modal_fit(&estimate, clock, &begin, &ModalSettings::default())?;
    println!("{} states", found.model.states());
    for mode in &found.modes {
        println!(
            "{:.3} Hz, damping {:.4}, rank {}",
            mode.frequency_hz, mode.damping, mode.rank
        );
    }
    Ok(())
}
