//! Two axes with motors and sensors of their own, simulated by hand, the second with something wrong with it: an effect is found
//! where it is.

use lpv_core::{Continuous, Controller, Purpose, Record, RecordKind, Signals, StateSpace};
use lpv_diagnose::effect::Place;
use lpv_diagnose::{Base, Case, Lpv, Trace, Track, Verdict, trace};
use nalgebra::{DMatrix, dmatrix};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

const STEP: f64 = 0.01;
const NOISE: f64 = 1e-5;
const MASSES: [f64; 2] = [10.0, 4.0];
const DAMPING: f64 = 20.0;

/// What is wrong with the second axis.
#[derive(Default)]
struct Wrong {
    /// Coulomb friction, N.
    friction: f64,
    /// Of the commands, by axis, samples.
    delay: [f64; 2],
    /// What its sensor drifts by, with a time constant of 3 s.
    drift: f64,
    /// A force that does not change, N.
    force: f64,
    /// What its sensor reads at zero.
    offset: f64,
}

/// A proportional and differential controller on each axis.
fn controller() -> Controller {
    let numerator = || MASSES.map(|m| vec![300.0 * m, -290.0 * m]).to_vec();
    Controller {
        reference_numerator: numerator(),
        feedback_numerator: numerator(),
        denominator: vec![vec![1.0]; 2],
        limit: None,
    }
}

/// Both axes move, in small steps.
fn record(name: &str, rate: f64, wrong: &Wrong) -> Track {
    /// Parts of a sample.
    const PARTS: usize = 200;
    let mut noise = ChaCha8Rng::seed_from_u64(name.len() as u64);
    let normal = Normal::new(0.0, NOISE).unwrap();
    let mut state = controller().start().unwrap();
    let (mut x, mut v) = ([0.0_f64; 2], [0.0_f64; 2]);
    let [mut r, mut u, mut y] = [(); 3].map(|()| vec![Vec::new(); 2]);
    let mut sent = vec![[0.0; 2]];
    for k in 0..1200 {
        let t = f64::from(k) * STEP;
        let wave = |rate: f64| 0.05 * (1.0 - (rate * t).cos()) * (1.0 + 0.3 * (0.37 * rate * t).sin());
        let wanted = [wave(rate), wave(1.3 * rate)];
        let off = [0.0, wrong.offset - wrong.drift * (-t / 3.0).exp_m1()];
        let told = [0, 1].map(|i: usize| x[i] + off[i] + normal.sample(&mut noise));
        let mut push = [0.0; 2];
        state.step(&wanted, &told, &mut push);
        for i in 0..2 {
            r[i].push(wanted[i]);
            u[i].push(push[i]);
            y[i].push(told[i]);
        }
        let earlier = *sent.last().unwrap();
        sent.push(push);
        for part in 0..PARTS {
            let late = wrong.delay.map(|d| (part as f64) < d * PARTS as f64);
            let acting = [0, 1].map(|i: usize| if late[i] { earlier[i] } else { push[i] });
            for i in 0..2 {
                let pushed = match i {
                    1 => wrong.force - wrong.friction * (v[i] / 1e-3).tanh(),
                    _ => 0.0,
                };
                let before = v[i];
                v[i] += STEP / PARTS as f64 * (acting[i] + pushed - DAMPING * v[i]) / MASSES[i];
                x[i] += STEP / PARTS as f64 * 0.5 * (before + v[i]);
            }
        }
    }
    let none = || Signals::new(&[], vec![]);
    let record = Record {
        name: name.to_owned(),
        kind: RecordKind::Transient,
        purpose: Purpose::Estimation,
        position: None,
        outputs: Signals::new(&["y1", "y2"], y),
        inputs: Signals::new(&["u1", "u2"], u),
        references: Signals::new(&["r1", "r2"], r),
        scheduling: none(),
        auxiliary: none(),
        injection: none(),
    };
    Track::new(&record, STEP, 4, None).unwrap()
}

/// What is found without a geometry, from a model of both axes as they should be.
fn find(wrong: &Wrong) -> Trace {
    let [a, b] = MASSES;
    let lpv = Lpv::new("two axes".to_owned(), None, None, |_| {
        StateSpace::new(
            dmatrix![0.0, 1.0, 0.0, 0.0; 0.0, -DAMPING / a, 0.0, 0.0; 0.0, 0.0, 0.0, 1.0; 0.0, 0.0, 0.0, -DAMPING / b],
            dmatrix![0.0, 0.0; 1.0 / a, 0.0; 0.0, 0.0; 0.0, 1.0 / b],
            dmatrix![1.0, 0.0, 0.0, 0.0; 0.0, 0.0, 1.0, 0.0],
            DMatrix::zeros(2, 2),
            Continuous,
        )
    })
    .unwrap();
    trace(&Case {
        base: &Base::Lpv(lpv),
        prior: None,
        free: None,
        controller: &controller().start().unwrap(),
        noise: [NOISE; 2],
        fitted: &[record("slow", 0.7, wrong), record("faster", 1.9, wrong)],
        judged: &[record("between", 1.3, wrong)],
        own: &[],
        seeks_load: false,
        on_fit: &|_, _| {},
    })
    .unwrap()
}

/// Finds one effect, at this place, whose first parameter is this.
fn finds(wrong: &Wrong, (name, place): (&str, Place), truth: f64) {
    let found = find(wrong);
    let names: Vec<_> = found
        .added
        .iter()
        .map(|a| (a.effect.name, a.effect.place))
        .collect();
    assert_eq!(names, [(name, place)], "{:?}", found.verdict);
    assert_eq!(found.verdict, Verdict::Explained);
    let (value, deviation) = found.added[0].values[0];
    assert!(
        (value - truth).abs() < 4.0 * deviation,
        "{value} with {deviation}"
    );
    assert!(deviation < 0.1 * truth, "{value} with {deviation}");
}

#[test]
fn nothing_where_nothing_is_wrong() {
    assert_eq!(find(&Wrong::default()).verdict, Verdict::NothingMissing);
}

/// No effect of the catalogue, and no wave so long, or drift so quick, that it looks like one.
fn has_no_name(wrong: &Wrong) {
    let found = find(wrong);
    let names: Vec<_> = found.added.iter().map(|a| (a.effect.name, &a.values)).collect();
    assert_eq!(found.verdict, Verdict::Unexplained, "{names:?}");
}

#[test]
fn a_constant_force_of_the_second_axis() {
    let wrong = Wrong {
        force: 0.3,
        ..Wrong::default()
    };
    finds(&wrong, ("constant-force", Place::Motor(1)), 0.3);
}

#[test]
fn an_offset_of_a_sensor_has_no_name() {
    has_no_name(&Wrong {
        offset: 2e-4,
        ..Wrong::default()
    });
}

#[test]
fn friction_of_the_second_axis() {
    let wrong = Wrong {
        friction: 1.0,
        ..Wrong::default()
    };
    finds(&wrong, ("coulomb-friction", Place::Motor(1)), 1.0);
}

#[test]
fn a_delay_of_the_second_input() {
    let wrong = Wrong {
        delay: [0.0, 0.4],
        ..Wrong::default()
    };
    finds(&wrong, ("delay", Place::Motor(1)), 0.4 * STEP);
}

#[test]
fn a_delay_of_both_inputs() {
    let wrong = Wrong {
        delay: [0.4; 2],
        ..Wrong::default()
    };
    finds(&wrong, ("delay", Place::AllMotors), 0.4 * STEP);
}

#[test]
fn a_drift_of_the_second_sensor() {
    let wrong = Wrong {
        drift: 4e-4,
        ..Wrong::default()
    };
    finds(&wrong, ("sensor-drift", Place::Output(1)), 4e-4);
}
