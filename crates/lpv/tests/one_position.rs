//! Bodies on the ground at one position: friction, springs and free masses are told apart wherever the lines can tell.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]

use lpv::IdentifyConfig;
use lpv_core::nalgebra::{Matrix2, Matrix3, RowVector2, Vector2};
use lpv_core::num_complex::Complex;
use lpv_core::{Discrete, Frf, FrfEstimate};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::TAU;
use std::ops::Range;

type C64 = Complex<f64>;

/// `m x'' + c x' + k x = u` behind a hold, m = 1: response of x on a line.
struct Mass {
    a: Matrix2<f64>,
    b: Vector2<f64>,
}

impl Mass {
    fn new(c: f64, k: f64, rate: f64) -> Self {
        let whole = Matrix3::new(0.0, 1.0, 0.0, -k, -c, 1.0, 0.0, 0.0, 0.0) / rate;
        let whole = whole.exp();
        Self {
            a: whole.fixed_view::<2, 2>(0, 0).into_owned(),
            b: whole.fixed_view::<2, 1>(0, 2).into_owned(),
        }
    }

    fn response(&self, z: C64) -> C64 {
        let m = Matrix2::identity().map(|v: f64| C64::from(v)) * z - self.a.map(C64::from);
        let x = m.try_inverse().unwrap() * self.b.map(C64::from);
        (RowVector2::new(1.0, 0.0).map(C64::from) * x)[0]
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Ground {
    /// Free.
    Free,
    /// Viscous friction.
    Friction,
    /// A spring, with damping.
    Spring,
}

struct Case {
    estimate: FrfEstimate,
    clock: Discrete,
    exact: Vec<C64>,
    deviation: f64,
    order: usize,
    what: String,
}

/// A machine with so many lines and fewer modes than that.
fn case(seed: u64, counts: Range<u32>, more_modes: u32) -> (Ground, Case) {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let ground = [Ground::Free, Ground::Friction, Ground::Friction, Ground::Spring][rng.random_range(0..4)];
    let n = [1, 1, 2, 3][rng.random_range(0..4)];
    let modes = rng.random_range(0..more_modes);
    let lowest = 10f64.powf(rng.random_range(-0.5..0.7));
    let span = 10f64.powf(rng.random_range(1.3..2.3));
    let rate = lowest * span * 10f64.powf(rng.random_range(0.35..1.0));
    let snr_db = rng.random_range(40.0..80.0);
    let clock = Discrete::from_rate(rate).unwrap();
    let corner = lowest * 10f64.powf(rng.random_range(-1.0..0.7));
    let bodies: Vec<(f64, Mass)> = (0..n)
        .map(|_| {
            let w = TAU * corner * rng.random_range(0.7..1.4);
            let (c, k) = match ground {
                Ground::Free => (0.0, 0.0),
                Ground::Friction => (w, 0.0),
                Ground::Spring => (2.0 * rng.random_range(0.01..0.5) * w, w * w),
            };
            (10f64.powf(rng.random_range(-0.3..0.3)), Mass::new(c, k, rate))
        })
        .collect();
    let top = 0.8 * lowest * span;
    let flexible: Vec<(Vec<f64>, Mass)> = (0..modes)
        .map(|i| {
            let from = (8.0 * lowest).max(top / 20.0);
            let f = from * (top / from).powf((f64::from(i) + rng.random_range(0.2..0.8)) / f64::from(modes));
            let (w, d) = (TAU * f, 10f64.powf(rng.random_range(-2.5..-1.3)));
            let shape = (0..2 * n)
                .map(|_| rng.random_range(0.4..1.2) * if rng.random_bool(0.5) { 1.0 } else { -1.0 });
            (shape.collect(), Mass::new(2.0 * d * w, w * w, rate))
        })
        .collect();
    let count = rng.random_range(counts);
    let lines: Vec<f64> = (0..count)
        .map(|k| lowest * (1.0 + (span - 1.0) * f64::from(k) / f64::from(count)))
        .collect();
    let mut exact = Vec::new();
    for f in &lines {
        let z = C64::from_polar(1.0, TAU * f / rate);
        let body: Vec<C64> = bodies.iter().map(|(g, m)| m.response(z) * *g).collect();
        let parts: Vec<C64> = flexible.iter().map(|(_, m)| m.response(z)).collect();
        for j in 0..n {
            for i in 0..n {
                let rigid = if i == j { body[i] } else { C64::from(0.0) };
                let bent = flexible.iter().zip(&parts).map(|((s, _), r)| r * s[i] * s[n + j]);
                exact.push(rigid + bent.sum::<C64>());
            }
        }
    }
    let mut sizes: Vec<f64> = exact
        .chunks(n * n)
        .map(|l| l.iter().map(C64::norm_sqr).sum())
        .collect();
    sizes.sort_by(f64::total_cmp);
    let deviation = (sizes[sizes.len() / 2] / (n * n) as f64).sqrt() * 10f64.powf(-snr_db / 20.0);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let noisy: Vec<C64> = exact
        .iter()
        .map(|v| v + C64::new(normal(), normal()) * (deviation / 2f64.sqrt()))
        .collect();
    let frf = Frf::new(lines, n, n, noisy).unwrap();
    let unit = |v: f64| -> Vec<C64> {
        (0..count as usize * n * n)
            .map(|i| C64::from(if (i % (n * n)) % (n + 1) == 0 { v } else { 0.0 }))
            .collect()
    };
    let estimate =
        FrfEstimate::new(frf, unit(deviation * deviation), unit(1.0), f64::INFINITY, None).unwrap();
    let rigid = match ground {
        Ground::Free => 2,
        Ground::Friction => 1 + n,
        Ground::Spring => 2 * n,
    };
    let what = format!(
        "seed {seed}: {n} x {n}, {ground:?}, corner {:.2} of the lowest line, {modes} modes, {snr_db:.0} dB, {count} lines over {span:.0}, rate {:.1} of the last",
        corner / lowest,
        rate / lowest / span
    );
    (
        ground,
        Case {
            estimate,
            clock,
            exact,
            deviation,
            order: rigid + 2 * modes as usize,
            what,
        },
    )
}

/// Whether the structure is the true one, and the error of the response over what the noise makes of so many unknowns.
fn judge(ground: Ground, case: &Case) -> (bool, f64) {
    let config = IdentifyConfig::default();
    let found = lpv::fit_poles(std::slice::from_ref(&case.estimate), case.clock, &config).unwrap();
    let fit = &found.fits[0];
    let frf = fit.response(case.estimate.frf().frequencies_hz()).unwrap();
    let fitted = (0..frf.len()).flat_map(|k| frf.line(k).iter().copied().collect::<Vec<_>>());
    let square: f64 = fitted.zip(&case.exact).map(|(v, e)| (v - e).norm_sqr()).sum();
    let integrators = match ground {
        Ground::Free => 2,
        Ground::Friction => 1,
        Ground::Spring => 0,
    };
    let over = (square / (0.5 * fit.account.unknowns as f64)).sqrt() / case.deviation;
    // Axes with nearly the same friction may share a pole.
    let right = found.integrators == integrators && found.order <= case.order;
    println!(
        "{} {}: order {} ({}), integrators {} ({integrators}), error {over:.2} of its bound",
        if right { "right" } else { "WRONG" },
        case.what,
        found.order,
        case.order,
        found.integrators
    );
    (right, over)
}

/// How many have the true structure, and the largest error over its bound.
fn judge_all(seeds: Range<u64>, counts: Range<u32>, more_modes: u32) -> (f64, f64) {
    let all = seeds.end - seeds.start;
    let judged: Vec<(bool, f64)> = seeds
        .map(|seed| {
            let (ground, case) = case(seed, counts.clone(), more_modes);
            judge(ground, &case)
        })
        .collect();
    let right = judged.iter().filter(|j| j.0).count();
    let worst = judged.iter().map(|j| j.1).fold(0.0, f64::max);
    println!("{right} of {all} right, worst error {worst:.2} of its bound");
    (right as f64 / all as f64, worst)
}

#[test]
fn bodies_on_the_ground_are_told_apart() {
    let (right, worst) = judge_all(0..80, 150..500, 6);
    assert!(right >= 0.93 && worst < 2.0, "{right}, {worst}");
}

/// Fifteen to sixty lines, where chance may look like states.
#[test]
fn few_lines_are_not_overfitted() {
    let (right, worst) = judge_all(1000..1160, 15..60, 3);
    assert!(right >= 0.93 && worst < 4.0, "{right}, {worst}");
}

/// Two outputs and one input at four positions: there is no square response whose lowest lines tell the rigid body.
#[test]
fn friction_is_found_at_several_positions_of_an_oblong_response() {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(11);
    for case in 0..8 {
        let rate = 1000.0;
        let clock = Discrete::from_rate(rate).unwrap();
        let lines: Vec<f64> = (1..240).map(f64::from).collect();
        let body = Mass::new(TAU * 10f64.powf(rng.random_range(-0.3..0.8)), 0.0, rate);
        let hz = rng.random_range(40.0..150.0);
        let mode = Mass::new(0.02 * TAU * hz, (TAU * hz).powi(2), rate);
        let shape: Vec<f64> = (0..4).map(|_| rng.random_range(0.3..1.0)).collect();
        let estimates: Vec<FrfEstimate> = [-1.0, -0.3, 0.3, 1.0]
            .iter()
            .map(|p| {
                let exact = lines.iter().flat_map(|f| {
                    let z = C64::from_polar(1.0, TAU * f / rate);
                    let part = |i: usize| shape[i] + 0.4 * shape[2 + i] * p;
                    [0, 1].map(|i| body.response(z) + mode.response(z) * part(i))
                });
                let exact: Vec<C64> = exact.collect();
                let middle = exact[exact.len() / 2].norm();
                let deviation = 1e-3 * middle;
                let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
                let noisy: Vec<C64> = exact
                    .iter()
                    .map(|v| v + C64::new(normal(), normal()) * (deviation / 2f64.sqrt()))
                    .collect();
                let frf = Frf::new(lines.clone(), 2, 1, noisy).unwrap();
                let square = deviation * deviation;
                let c_v = lines
                    .iter()
                    .flat_map(|_| [square, 0.0, 0.0, square].map(C64::from));
                let one = vec![C64::from(1.0); lines.len()];
                FrfEstimate::new(frf, c_v.collect(), one, f64::INFINITY, Some(vec![*p].into())).unwrap()
            })
            .collect();
        let found = lpv::fit_poles(&estimates, clock, &IdentifyConfig::default()).unwrap();
        assert_eq!(found.integrators, 1, "case {case}: {:?}", found.reasons);
    }
}
