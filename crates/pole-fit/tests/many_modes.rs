//! Tens of modes in one channel and in several: the noise is reached, and the order found.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]

use lpv_core::{Discrete, Frf, FrfEstimate};
use num_complex::Complex;
use pole_fit::{Integrators, NumeratorDegree, PoleFitSettings, scan_counted, scan_to_noise};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};

type C64 = Complex<f64>;

const ORDERS: [usize; 6] = [2, 4, 6, 8, 10, 12];
const LARGER: [usize; 9] = [16, 20, 26, 32, 40, 50, 64, 80, 96];

/// Modes at even and random places between 30 and 480 Hz with residues of random sign and size, beside so many masses that move freely,
/// and noise of a constant size `-snr_db` below the median line.
#[derive(Debug, Clone, Copy)]
struct Kind {
    modes: usize,
    masses: usize,
    channels: (usize, usize),
    snr_db: f64,
    rate: f64,
}

fn machine(kind: Kind, seed: u64) -> (FrfEstimate, Discrete) {
    let Kind {
        modes,
        channels: (n_y, n_u),
        rate,
        ..
    } = kind;
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let clock = Discrete::from_rate(rate).unwrap();
    let spread = 450.0 / modes as f64;
    let poles: Vec<C64> = (0..modes)
        .map(|i| {
            let f = 30.0 + spread * (i as f64 + rng.random_range(0.1..0.9));
            let w = std::f64::consts::TAU * f;
            let d = 0.006 * 2f64.powf(rng.random_range(-1.0..1.0));
            (C64::new(-d * w, w * (1.0 - d * d).sqrt()) / rate).exp()
        })
        .collect();
    let normal = Normal::new(0.0, 1.0).unwrap();
    let shapes: Vec<Vec<f64>> = (0..modes + kind.masses)
        .map(|_| {
            (0..n_y + n_u)
                .map(|_| rng.random_range(0.5..2.0) * if rng.random_bool(0.5) { 1.0 } else { -1.0 })
                .collect()
        })
        .collect();
    let lines: Vec<f64> = (4..1120).map(|k| 0.5 * f64::from(k)).collect();
    let mut values = Vec::with_capacity(lines.len() * n_y * n_u);
    for f in &lines {
        let z = C64::from_polar(1.0, std::f64::consts::TAU * f / rate);
        for j in 0..n_u {
            for i in 0..n_y {
                let part = |(l, s): (&C64, &Vec<f64>)| {
                    let gain = C64::i() * s[i] * s[n_y + j];
                    gain / (z - l) + gain.conj() / (z - l.conj())
                };
                let free = shapes[modes..].iter().map(|s| s[i] * s[n_y + j]).sum::<f64>();
                let w = std::f64::consts::TAU * 60.0 / rate;
                let rigid = (z + 1.0) / (z - 1.0).powu(2) * (0.5 * w * w * free * 10.0 * rate / 2000.0);
                values.push(poles.iter().zip(&shapes).map(part).sum::<C64>() + rigid);
            }
        }
    }
    let mut sizes: Vec<f64> = values
        .chunks(n_y * n_u)
        .map(|l| l.iter().map(|v| v.norm_sqr()).sum())
        .collect();
    sizes.sort_by(f64::total_cmp);
    let deviation = (sizes[sizes.len() / 2] / (n_y * n_u) as f64).sqrt() * 10f64.powf(-kind.snr_db / 20.0);
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
        let kind = Kind {
            modes,
            channels,
            masses: 0,
            snr_db: 60.0,
            rate: 2000.0,
        };
        let (estimate, clock) = machine(kind, seed);
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

/// Channels from one to many, with and without a rigid body of rank up to three, noise over three decades, and lines from the whole circle
/// down to an arc of a hundredth of it.
#[test]
fn the_states_in_the_noise_are_counted() {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
    let (mut right, mut count) = (0, 0);
    for seed in 0..60 {
        let channels = (rng.random_range(1..9), rng.random_range(1..5));
        let masses = rng.random_range(0..4);
        let kind = Kind {
            modes: rng.random_range(7..25),
            masses,
            channels,
            snr_db: rng.random_range(30.0..90.0),
            rate: 1120.0 * 10f64.powf(rng.random_range(0.0..2.0)),
        };
        let (estimate, clock) = machine(kind, seed);
        let integrators = if masses > 0 { 2 } else { 0 };
        let settings = PoleFitSettings {
            numerator: NumeratorDegree::StrictlyProper,
            ..PoleFitSettings::new(2 + integrators)
        };
        let fixed = if masses > 0 {
            Integrators::Fixed(2)
        } else {
            Integrators::Free
        };
        let scans = scan_counted(&estimate, clock, &settings, &[fixed], 96).unwrap();
        let scan = scans.into_iter().next().unwrap();
        let order = scan
            .as_ref()
            .and_then(|s| s.chosen())
            .map(|fit| fit.account.order);
        count += 1;
        right += usize::from(order == Some(2 * kind.modes + integrators));
        if let Some(fit) = scan.as_ref().and_then(|s| s.chosen()) {
            let over = fit.account.cost / fit.account.expected_cost;
            assert!(over < 1.1, "{kind:?}: {over}");
        }
    }
    assert!(right * 100 >= count * 95, "{right} of {count}");
}
