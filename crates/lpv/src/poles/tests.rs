use super::*;
use crate::{Identified, Moves, identify, silent};
use lpv_core::num_complex::Complex;
use lpv_core::{Clock as _, Frf};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

type C64 = Complex<f64>;

/// Modes with one shape each, a direct term, and outputs in given units, at a relative noise of the mean line.
fn machine(hz: &[f64], direct: f64, (units, noise): ([f64; 2], f64), seed: u64) -> (FrfEstimate, Discrete) {
    let clock = Discrete::from_rate(1000.0).unwrap();
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let poles: Vec<C64> = hz
        .iter()
        .map(|f| {
            let w = std::f64::consts::TAU * f / 1000.0;
            C64::new(-0.01 * w, w).exp()
        })
        .collect();
    let shapes: Vec<[f64; 4]> = poles
        .iter()
        .map(|_| [normal(), normal(), normal(), normal()])
        .collect();
    let lines: Vec<f64> = (1..900).map(|k| 0.5 * f64::from(k)).collect();
    let exact: Vec<C64> = lines
        .iter()
        .flat_map(|f| {
            let z = clock.point(*f);
            let at = |i: usize, j: usize| -> C64 {
                let mode = |(l, s): (&C64, &[f64; 4])| {
                    let r = C64::i() * (1e-2 * s[i] * s[2 + j]);
                    r / (z - l) + r.conj() / (z - l.conj())
                };
                poles.iter().zip(&shapes).map(mode).sum::<C64>() + direct * f64::from(u8::from(i == j))
            };
            [at(0, 0), at(1, 0), at(0, 1), at(1, 1)]
        })
        .collect();
    let rms = (exact.iter().map(|v| v.norm_sqr()).sum::<f64>() / exact.len() as f64).sqrt();
    let deviation = noise * rms;
    let values = exact
        .iter()
        .enumerate()
        .map(|(i, v)| (v + C64::new(normal(), normal()) * (deviation / 2f64.sqrt())) * units[i % 2]);
    let values: Vec<C64> = values.collect();
    let c_v = lines.iter().flat_map(|_| {
        let variance = units.map(|u| C64::from((deviation * u).powi(2)));
        [variance[0], C64::from(0.0), C64::from(0.0), variance[1]]
    });
    let c_v: Vec<C64> = c_v.collect();
    let s = lines
        .iter()
        .flat_map(|_| [1.0, 0.0, 0.0, 1.0].map(C64::from))
        .collect();
    let frf = Frf::new(lines, 2, 2, values).unwrap();
    (FrfEstimate::new(frf, c_v, s, f64::INFINITY, None).unwrap(), clock)
}

fn found(estimate: &FrfEstimate, clock: Discrete) -> (usize, f64, f64) {
    let moves = Moves::none("one position");
    let config = IdentifyConfig::default();
    let Identified::Lti(stage) =
        identify(std::slice::from_ref(estimate), clock, &moves, &config, &silent).unwrap()
    else {
        panic!("one position");
    };
    let modal = stage.modal.as_ref().expect("two inputs and outputs");
    let radius = stage
        .model
        .poles()
        .unwrap()
        .iter()
        .map(|p| p.norm())
        .fold(0.0, f64::max);
    (
        stage.model.states(),
        modal.account.cost / modal.account.expected_cost,
        radius,
    )
}

#[test]
fn a_direct_term_is_no_pole_outside_the_unit_circle() {
    for (seed, direct) in [(1, 0.0), (2, 0.02), (3, 0.5), (4, 20.0)] {
        let (estimate, clock) = machine(&[40.0, 95.0, 210.0], direct, ([1.0, 1.0], 1e-3), seed);
        let (states, cost, radius) = found(&estimate, clock);
        assert_eq!(states, 6, "D = {direct}");
        assert!(
            (cost - 1.0).abs() < 0.1 && radius < 1.0,
            "D = {direct}: {cost}, {radius}"
        );
    }
}

#[test]
fn units_of_the_outputs_change_no_model() {
    for units in [[1.0, 1.0], [1e-6, 1e3], [1e-12, 1e12]] {
        let (estimate, clock) = machine(&[40.0, 95.0, 210.0], 0.0, (units, 1e-2), 5);
        let (states, cost, _) = found(&estimate, clock);
        assert_eq!(states, 6, "{units:?}");
        assert!((cost - 1.0).abs() < 0.05, "{units:?}: {cost}");
    }
}

/// Modes whose compliance hides the slope of a free body at the lowest lines, at three positions: there are two integrators
/// all the same, whether the compliance is a hundredth of the body's or thirty times it.
#[test]
fn integrators_behind_the_compliance_of_modes_are_found_at_several_positions() {
    let clock = Discrete::from_rate(1000.0).unwrap();
    let lines: Vec<f64> = (4..900).map(|k| 0.5 * f64::from(k)).collect();
    for (seed, compliance) in [0.01, 0.1, 0.3, 1.0, 3.0, 30.0].into_iter().enumerate() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed as u64);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let estimates: Vec<FrfEstimate> = [-1.0, 0.0, 1.0]
            .iter()
            .map(|p| {
                let response = |f: f64| {
                    let z = clock.point(f);
                    let body = (z + 1.0) / ((z - 1.0) * (z - 1.0)) * 1e-4;
                    // Both are alike at the lowest line for a compliance of one.
                    let mode = |hz: f64, shape: f64| -> C64 {
                        let w = std::f64::consts::TAU * hz / 1000.0;
                        let l = C64::new(-0.01 * w, w).exp();
                        let r = C64::i() * (0.5 * compliance * shape * w);
                        r / (z - l) + r.conj() / (z - l.conj())
                    };
                    body + mode(60.0, 1.0 + 0.3 * p) + mode(140.0, 0.8 + 0.5 * p)
                };
                let exact: Vec<C64> = lines.iter().map(|f| response(*f)).collect();
                let mut sizes: Vec<f64> = exact.iter().map(|v| v.norm()).collect();
                sizes.sort_by(f64::total_cmp);
                let deviation = 1e-3 * sizes[sizes.len() / 2];
                let noisy = exact
                    .iter()
                    .map(|v| v + C64::new(normal(), normal()) * (deviation / 2f64.sqrt()));
                let frf = Frf::new(lines.clone(), 1, 1, noisy.collect()).unwrap();
                let [c_v, one] = [deviation * deviation, 1.0].map(|v| vec![C64::from(v); lines.len()]);
                FrfEstimate::new(frf, c_v, one, f64::INFINITY, Some(vec![*p].into())).unwrap()
            })
            .collect();
        let found = fit_poles(&estimates, clock, &IdentifyConfig::default()).unwrap();
        let (slope, _) = integrators_from_slope(&estimates[1]);
        assert_eq!(
            found.integrators, 2,
            "compliance {compliance}, slope {slope}: {:?}",
            found.reasons
        );
    }
}
