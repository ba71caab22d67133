//! An axis of two masses on a spring that depends on p, with friction to ground: one delta is all that the machine has.

use crate::common::rng;
use lfr_fit::moving::{MovingData, StaticLfrSettings, fit_static, simulate_errors};
use lfr_fit::{
    DeltaSplit, FrozenData, GainFit, GrowSettings, RefineSettings, Rigid, grow, local_body, merge_lines,
};
use lpv_core::nalgebra::{DMatrix, DVector, dmatrix};
use lpv_core::num_complex::Complex;
use lpv_core::{
    Continuous, DeltaBlock, Discrete, Frf, FrfEstimate, Purpose, Record, RecordKind, SchedulingRange,
    Signals, StateSpace,
};
use rand_distr::{Distribution, StandardNormal};

/// Sample time, where the mode turns by one a unit of time.
const STEP: f64 = 0.35;
/// Deviation of a response over its size, and of a sample.
const NOISE: [f64; 2] = [2e-3, 1e-2];
const SAMPLES: usize = 2000;

/// Masses that make one mode of frequency one at p = 0, its spring `1 + 0.7 p`, and friction at the drive.
fn machine(p: f64, friction: f64) -> StateSpace<Continuous> {
    let (m1, m2) = (3.5, 1.5);
    let reduced = m1 * m2 / (m1 + m2);
    let (k, d) = (reduced * (1.0 + 0.7 * p), 0.03 * reduced);
    let a = dmatrix![
        0.0, 0.0, 1.0, 0.0;
        0.0, 0.0, 0.0, 1.0;
        -k / m1, k / m1, -(d + friction) / m1, d / m1;
        k / m2, -k / m2, d / m2, -d / m2
    ];
    StateSpace::new(
        a,
        dmatrix![0.0; 0.0; 1.0 / m1; 0.0],
        dmatrix![1.0, 0.0, 0.0, 0.0],
        dmatrix![0.0],
        Continuous,
    )
    .unwrap()
}

fn estimate(p: f64, friction: f64, clock: Discrete, seed: u64) -> (Vec<f64>, FrfEstimate) {
    let mut rng = rng(seed);
    let lines: Vec<f64> = (1..120).map(|k| 0.0035 * f64::from(k)).collect();
    let held = machine(p, friction).zero_order_hold(clock).unwrap();
    let truth = held.frequency_response(&lines).unwrap();
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let noisy = truth.values().iter().map(|g| {
        let error = Complex::new(normal(), normal()) / 2f64.sqrt();
        g * (1.0 + error * NOISE[0])
    });
    let noisy: Vec<Complex<f64>> = noisy.collect();
    let variance = truth
        .values()
        .iter()
        .map(|g| Complex::from((NOISE[0] * g.norm()).powi(2)));
    let variance = variance.collect();
    let one = vec![Complex::from(1.0); lines.len()];
    let frf = Frf::new(lines, 1, 1, noisy).unwrap();
    (
        vec![p],
        FrfEstimate::new(frf, variance, one, f64::INFINITY, None).unwrap(),
    )
}

/// Slow waves and a shake, p there and back; integrated with twenty Runge-Kutta steps a sample.
fn record(friction: f64, phase: f64, seed: u64) -> Record {
    let mut rng = rng(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let share = |k: usize| std::f64::consts::TAU * k as f64 / SAMPLES as f64;
    let p: Vec<f64> = (0..=SAMPLES)
        .map(|k| 0.28 * (phase + 3.0 * share(k)).sin())
        .collect();
    let (mut y, mut u) = (Vec::new(), Vec::new());
    let mut x = DVector::zeros(4);
    for k in 0..SAMPLES {
        let force = (2.0 * share(k)).cos() + 0.5 * (7.0 * share(k)).cos() + 0.1 * normal();
        y.push(x[0]);
        u.push(force);
        let h = STEP / 20.0;
        for j in 0..20 {
            let rate = |part: f64, x: &DVector<f64>| {
                let here = p[k] + (p[k + 1] - p[k]) * (f64::from(j) + part) / 20.0;
                let m = machine(here, friction);
                m.a() * x + m.b() * DVector::from_element(1, force)
            };
            let k1 = rate(0.0, &x);
            let k2 = rate(0.5, &(&x + &k1 * (0.5 * h)));
            let k3 = rate(0.5, &(&x + &k2 * (0.5 * h)));
            let k4 = rate(1.0, &(&x + &k3 * h));
            x += (k1 + (k2 + k3) * 2.0 + k4) * (h / 6.0);
        }
    }
    y.iter_mut().for_each(|v| *v += NOISE[1] * normal());
    Record {
        name: "move".to_owned(),
        outputs: Signals::new(&["y"], vec![y]),
        inputs: Signals::new(&["u"], vec![u]),
        references: Signals::default(),
        scheduling: Signals::new(&["p"], vec![p[..SAMPLES].to_vec()]),
        auxiliary: Signals::default(),
        injection: Signals::default(),
        kind: RecordKind::Transient,
        purpose: Purpose::Estimation,
        position: None,
    }
}

/// A structure with more deltas than the machine has follows the records that it is fitted to and errs along others, since it may give the
/// rigid body a mass that depends on p: the smallest that explains them is taken.
#[test]
fn a_spring_that_depends_on_p_takes_one_delta() {
    let clock = Discrete::new(STEP).unwrap();
    for (friction, seed) in [(0.0, 1), (0.002, 2), (0.03, 3), (0.3, 4)] {
        let positions = [-0.3, -0.15, 0.0, 0.15, 0.3];
        let responses =
            positions.map(|p| estimate(p, friction, clock, seed * 100 + (1e3 * (p + 1.0)) as u64));
        let data = FrozenData::weighted(clock, &responses, 0.0).unwrap();
        let middle = data.subset(|p| p[0] == 0.0).unwrap();
        let held = machine(0.0, friction).zero_order_hold(clock).unwrap();
        let poles = lpv_core::linalg::eigenvalues(held.a()).unwrap();
        let modes: Vec<Complex<f64>> = poles.into_iter().filter(|z| z.im > 0.1).collect();
        let kind = if friction > 0.0 {
            Rigid::Friction
        } else {
            Rigid::Varying
        };
        let (gain, rate) = (dmatrix![0.2], dmatrix![friction / 5.0]);
        let local = local_body(&middle, &modes, kind, (&gain, &rate), &RefineSettings::default()).unwrap();
        let range = SchedulingRange::interval(-0.3, 0.3).unwrap();
        let settings = GrowSettings {
            gain: GainFit::Free,
            ..GrowSettings::default()
        };
        let few = merge_lines(&local.model, kind, &data, &range, &settings).unwrap();
        let delta = [DeltaBlock {
            parameter: 0,
            repetitions: 1,
        }];
        let grown = grow(&local.model, kind, &few, &delta, &range, &settings).unwrap();
        let noise = [NOISE[1]];
        let data_of = |phases: [f64; 2]| {
            let records = phases.map(|phase| record(friction, phase, seed + (10.0 * phase) as u64));
            MovingData::new(clock, &records, &noise, None).unwrap()
        };
        let found = fit_static(
            &grown.refined,
            &few,
            &data_of([0.3, 2.0]),
            &StaticLfrSettings::default(),
        )
        .unwrap()
        .unwrap();
        let forces = DeltaSplit {
            forces: 1,
            ..DeltaSplit::default()
        };
        assert_eq!(found.split, forces, "{friction}: {:?}", found.moving_rms);
        let errors: Vec<DMatrix<f64>> = simulate_errors(&found.candidate, &data_of([1.1, 4.0])).unwrap();
        for e in errors {
            let rms = e.norm() / (e.len() as f64).sqrt() / noise[0];
            assert!(rms < 1.1, "{friction}: {rms}");
        }
    }
}
