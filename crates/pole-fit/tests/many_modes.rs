//! Tens of modes in one channel and in several: the noise is reached, and the order found.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]

use lpv_core::{Discrete, Frf, FrfEstimate};
use num_complex::Complex;
use pole_fit::{NumeratorDegree, PoleFitSettings, scan_to_noise};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};

type C64 = Complex<f64>;

const RATE: f64 = 2000.0;
const ORDERS: [usize; 6] = [2, 4, 6, 8, 10, 12];
const LARGER: [usize; 9] = [16, 20, 26, 32, 40, 50, 64, 80, 96];

/// Modes at even and random places between 30 and 480 Hz with residues of random sign and size, and noise of a constant size
/// `-snr_db` below the rms of the response.
fn machine(modes: usize, (n_y, n_u): (usize, usize), snr_db: f64, seed: u64) -> (FrfEstimate, Discrete) {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let clock = Discrete::from_rate(RATE).unwrap();
    let spread = 450.0 / modes as f64;
    let poles: Vec<C64> = (0..modes)
        .map(|i| {
            let f = 30.0 + spread * (i as f64 + rng.random_range(0.1..0.9));
            let w = std::f64::consts::TAU * f;
            let d = 0.006 * 2f64.powf(rng.random_range(-1.0..1.0));
            (C64::new(-d * w, w * (1.0 - d * d).sqrt()) / RATE).exp()
        })
        .collect();
    let normal = Normal::new(0.0, 1.0).unwrap();
    let shapes: Vec<Vec<f64>> = (0..modes)
        .map(|_| {
            (0..n_y + n_u)
                .map(|_| rng.random_range(0.5..2.0) * if rng.random_bool(0.5) { 1.0 } else { -1.0 })
                .collect()
        })
        .collect();
    let lines: Vec<f64> = (4..1120).map(|k| 0.5 * f64::from(k)).collect();
    let mut values = Vec::with_capacity(lines.len() * n_y * n_u);
    for f in &lines {
        let z = C64::from_polar(1.0, std::f64::consts::TAU * f / RATE);
        for j in 0..n_u {
            for i in 0..n_y {
                let part = |(l, s): (&C64, &Vec<f64>)| {
                    let gain = C64::i() * s[i] * s[n_y + j];
                    gain / (z - l) + gain.conj() / (z - l.conj())
                };
                values.push(poles.iter().zip(&shapes).map(part).sum::<C64>());
            }
        }
    }
    let rms = (values.iter().map(|v| v.norm_sqr()).sum::<f64>() / values.len() as f64).sqrt();
    let deviation = rms * 10f64.powf(-snr_db / 20.0);
    for v in &mut values {
        *v += C64::new(normal.sample(&mut rng), normal.sample(&mut rng)) * (deviation / 2f64.sqrt());
    }
    let frf = Frf::new(lines.clone(), n_y, n_u, values).unwrap();
    let c_v: Vec<C64> = (0..lines.len())
        .flat_map(|_| {
            (0..n_y * n_y).map(|i| {
                C64::from(if i % (n_y + 1) == 0 {
                    deviation.powi(2)
                } else {
                    0.0
                })
            })
        })
        .collect();
    let s: Vec<C64> = (0..lines.len())
        .flat_map(|_| (0..n_u * n_u).map(|i| C64::from(if i % (n_u + 1) == 0 { 1.0 } else { 0.0 })))
        .collect();
    (FrfEstimate::new(frf, c_v, s, f64::INFINITY, None).unwrap(), clock)
}

#[test]
fn tens_of_modes_are_found() {
    for (modes, channels, seed) in [
        (5, (1, 1), 1),
        (10, (1, 1), 2),
        (17, (1, 1), 3),
        (30, (1, 1), 4),
        (30, (1, 1), 5),
        (12, (3, 2), 6),
    ] {
        let (estimate, clock) = machine(modes, channels, 66.0, seed);
        let settings = PoleFitSettings {
            numerator: NumeratorDegree::StrictlyProper,
            ..PoleFitSettings::new(2)
        };
        let scan = scan_to_noise(&estimate, clock, &settings, &ORDERS, &LARGER).unwrap();
        let fit = scan.chosen().unwrap();
        let over = fit.account.cost / fit.account.expected_cost;
        assert!(over < 1.2, "{modes} modes: {over}");
        assert_eq!(fit.account.order, 2 * modes);
    }
}
