//! One position whose output is distorted: what is no noise is not taken for dynamics.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]

use lpv::IdentifyConfig;
use lpv_core::num_complex::Complex;
use lpv_core::{Discrete, Frf, FrfEstimate};
use rand::{RngExt, SeedableRng};
use std::f64::consts::TAU;

type C64 = Complex<f64>;

const SAMPLES: usize = 2048;
const LINES: usize = 500;

/// A free body with three modes in a multisine, a cubic distortion of its output of a given part, and noise far below it.
fn machine(part: f64, integrators: i32, seed: u64) -> (FrfEstimate, Vec<C64>, Discrete) {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let clock = Discrete::from_rate(SAMPLES as f64).unwrap();
    let modes: Vec<(C64, f64)> = (0..3)
        .map(|i| {
            let w = TAU * (60.0 + 130.0 * f64::from(i) + rng.random_range(0.0..80.0)) / SAMPLES as f64;
            let l = C64::new(-rng.random_range(0.003..0.02) * w, w).exp();
            (l, rng.random_range(0.3..1.0) * w)
        })
        .collect();
    let slow = rng.random_range(2.0..20.0) * TAU / SAMPLES as f64;
    let response = |k: usize| {
        let z = C64::from_polar(1.0, TAU * k as f64 / SAMPLES as f64);
        let w = TAU * 20.0 / SAMPLES as f64;
        let body = match integrators {
            2 => (z + 1.0) / (z - 1.0).powi(2) * (0.5 * w * w),
            1 => z.inv() * (w * w) / ((z - 1.0) * (1.0 - z.inv() * (-slow).exp())),
            _ => C64::from(0.0),
        };
        let bent = modes.iter().map(|(l, gain)| {
            let r = C64::i() * (-0.005 * gain);
            r / (z - l) + r.conj() / (z - l.conj())
        });
        body + bent.sum::<C64>()
    };
    let exact: Vec<C64> = (1..=LINES).map(response).collect();
    let input: Vec<C64> = (0..LINES)
        .map(|_| C64::from_polar(1.0, rng.random_range(0.0..TAU)))
        .collect();
    let turn = |n: usize, k: usize| C64::from_polar(1.0, TAU * ((n * k) % SAMPLES) as f64 / SAMPLES as f64);
    let y: Vec<f64> = (0..SAMPLES)
        .map(|n| {
            (0..LINES)
                .map(|i| (exact[i] * input[i] * turn(n, i + 1)).re)
                .sum()
        })
        .collect();
    let rms = (y.iter().map(|v| v * v).sum::<f64>() / SAMPLES as f64).sqrt();
    let bent: Vec<f64> = y
        .iter()
        .map(|v| v + part * rms * (v / rms).powi(3) / 3.0)
        .collect();
    let measured: Vec<C64> = (0..LINES)
        .map(|i| {
            let sum: C64 = bent
                .iter()
                .enumerate()
                .map(|(n, v)| turn(n, i + 1).conj() * *v)
                .sum();
            sum * (2.0 / SAMPLES as f64) / input[i]
        })
        .collect();
    let lines: Vec<f64> = (1..=LINES).map(|k| k as f64).collect();
    let noise = exact[LINES / 2].norm() * 1e-5;
    let noisy: Vec<C64> = measured
        .iter()
        .map(|v| {
            v + C64::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0)) * (noise * 1.5f64.sqrt())
        })
        .collect();
    let frf = Frf::new(lines, 1, 1, noisy).unwrap();
    let of = |v: f64| vec![C64::from(v); LINES];
    (
        FrfEstimate::new(frf, of(noise * noise), of(1.0), f64::INFINITY, None).unwrap(),
        exact,
        clock,
    )
}

#[test]
fn distortion_is_no_dynamics() {
    let (mut right, mut count) = (0, 0);
    for integrators in [2, 1, 0] {
        for part in [1e-3, 3e-3, 1e-2] {
            for seed in 0..2 {
                let (estimate, exact, clock) = machine(part, integrators, seed);
                let config = IdentifyConfig::default();
                let found = lpv::fit_poles(std::slice::from_ref(&estimate), clock, &config).unwrap();
                let frf = found.fits[0].response(estimate.frf().frequencies_hz()).unwrap();
                let error = |k: usize| (frf.line(k)[(0, 0)] - exact[k]).norm_sqr() / exact[k].norm_sqr();
                let rms = |n: usize| ((0..n).map(error).sum::<f64>() / n as f64).sqrt();
                println!(
                    "{} integrators ({integrators}), distortion {part}, seed {seed}: order {}, error at the lowest lines {:.4}, at all \
                     {:.4}, relative error in the weights {:.4}",
                    found.integrators,
                    found.order,
                    rms(8),
                    rms(LINES),
                    found.relative_error
                );
                // A cubic term has a gain of its own: no linear model of the output is better.
                assert!(rms(8) < 1.3 * part, "{}", rms(8));
                assert!(rms(LINES) < 2.0 * part, "{}", rms(LINES));
                count += 1;
                let order = 6 + if integrators > 0 { 2 } else { 0 };
                right += usize::from(found.integrators == integrators as usize && found.order == order);
            }
        }
    }
    assert!(10 * right >= 9 * count, "{right} of {count}");
}
