//! An axis that is simulated by hand: two effects of which the larger hides what the other is, and motion so damped that few
//! parts of a sample do not integrate it.

use lpv_core::{Controller, Purpose, Record, RecordKind, Signals};
use lpv_diagnose::effect::Effect;
use lpv_diagnose::{Axis, Base, Case, Trace, Track, Verdict, trace};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

const STEP: f64 = 0.01;
const NOISE: f64 = 1e-5;

/// A mass of 10 kg under the controller, with a force from `(position, speed)`, in small steps of the explicit rule.
fn record(name: &str, rate: f64, controller: &Controller, force: impl Fn(f64, f64) -> f64) -> Track {
    let mut noise = ChaCha8Rng::seed_from_u64(name.len() as u64);
    let normal = Normal::new(0.0, NOISE).unwrap();
    let mut state = controller.start().unwrap();
    let (mut x, mut v) = (0.0_f64, 0.0_f64);
    let (mut r, mut u, mut y) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..1500 {
        let t = f64::from(k) * STEP;
        r.push(0.05 * (1.0 - (rate * t).cos()) * (1.0 + 0.3 * (0.37 * rate * t).sin()));
        y.push(x + normal.sample(&mut noise));
        let mut push = [0.0];
        state.step(&[r[k as usize]], &[y[k as usize]], &mut push);
        u.push(push[0]);
        for _ in 0..400 {
            v += 0.0025 * STEP * (push[0] + force(x, v)) / 10.0;
            x += 0.0025 * STEP * v;
        }
    }
    let record = Record {
        name: name.to_owned(),
        kind: RecordKind::Transient,
        purpose: Purpose::Estimation,
        position: None,
        outputs: Signals::new(&["y"], vec![y]),
        inputs: Signals::new(&["u"], vec![u]),
        references: Signals::new(&["r"], vec![r]),
        scheduling: Signals::new(&[], vec![]),
        auxiliary: Signals::new(&[], vec![]),
        injection: Signals::new(&[], vec![]),
    };
    Track::new(&record, STEP, 4, None).unwrap()
}

/// A proportional and differential controller, this much in the unit of its first gain.
pub(super) fn controller(gain: f64) -> Controller {
    let numerator = || vec![vec![3000.0 * gain, -2900.0 * gain]];
    Controller {
        reference_numerator: numerator(),
        feedback_numerator: numerator(),
        denominator: vec![vec![1.0]],
        limit: None,
    }
}

/// What is found from three records of an axis with this force, where the model has no force but this damping.
fn find(controller: &Controller, damping: f64, force: impl Fn(f64, f64) -> f64) -> Trace {
    find_beside(controller, damping, &[], force)
}

/// The same beside effects of a user.
pub(super) fn find_beside(
    controller: &Controller,
    damping: f64,
    own: &[&'static Effect],
    force: impl Fn(f64, f64) -> f64,
) -> Trace {
    let record = |name: &str, rate: f64| record(name, rate, controller, &force);
    trace(&Case {
        base: &Base::Axis(Axis::new(10.0, damping, 0.0)),
        prior: None,
        free: None,
        controller: &controller.start().unwrap(),
        noise: [NOISE, 0.0],
        fitted: &[record("slow", 0.7), record("faster", 1.9)],
        judged: &[record("between", 1.3)],
        own,
        seeks_load: false,
        on_fit: &|_, _| {},
    })
    .unwrap()
}

/// Beside a cable that pulls hard, friction with a peak at low speed passes for Coulomb friction; once the cable is explained,
/// it does not.
#[test]
fn what_passed_for_a_simpler_effect_is_chosen_again() {
    let force = |x: f64, v: f64| {
        let friction = (2.0 + 0.4 * (-(v / 0.01).powi(2)).exp()) * (v / 1e-3).tanh();
        -friction - 12.0 * x - 2000.0 * x.powi(3)
    };
    let found = find(&controller(1.0), 0.0, force);
    let names: Vec<&str> = found.added.iter().map(|a| a.effect.name).collect();
    assert_eq!(found.verdict, Verdict::Explained);
    assert_eq!(names.len(), 2, "{names:?}");
    for name in ["stribeck-friction", "cable-stiffness"] {
        assert!(names.contains(&name), "{names:?}");
    }
    let truth = |name: &str| match name {
        "level" => 2.0,
        "breakaway" => 0.4,
        "creep_speed" => 1e-3,
        "stribeck_speed" => 0.01,
        "stiffness" => 12.0,
        "cubic" => 2000.0,
        other => panic!("{other}"),
    };
    for added in &found.added {
        for (p, (value, deviation)) in added.effect.parameters.iter().zip(&added.values) {
            let off = (value - truth(p.name)) / deviation;
            assert!(off.abs() < 4.0, "{}: {value} with {deviation}", p.name);
        }
    }
    // The noise in the loop with the effects is white to the tests, and the error one step ahead that of the sensor.
    assert!(found.left[0][0].adjusted < 1e-100);
    let surest = &found.left[1][0];
    assert!(surest.adjusted > 1e-3, "{surest:?}");
    let [before, after] = found.one_step.map(|e| e.unwrap()[0] / NOISE);
    assert!(before > 1.5 && (0.9..1.3).contains(&after), "{before} {after}");
    // The table tells every look: without effects, and beside the first.
    let looks = |n: usize| found.candidates.iter().filter(move |t| t.beside.len() == n);
    assert!((0..2).all(|n| looks(n).any(|t| t.fitted)));
    assert_eq!(found.candidates.iter().filter(|t| t.accepted).count(), 2);
    // What each brought, one after the other, is all that was gained.
    let gained: f64 = found.added.iter().map(|a| a.gain_db).sum();
    let fell = 10.0 * (found.before.cost / found.after.cost).log10();
    assert!((gained - fell).abs() < 0.5, "{gained} dB of {fell}");
}

/// Half as many parts of a sample, which serve for differences, diverge at this damping; those of the track do not. What is
/// hidden beside it is found all the same.
#[test]
fn a_machine_that_few_parts_of_a_sample_cannot_integrate() {
    let controller = controller(100.0);
    let damped = |force: &dyn Fn(f64, f64) -> f64| find(&controller, 7400.0, |x, v| force(x, v) - 7500.0 * v);
    let plain = damped(&|_, _| 0.0);
    assert_eq!(plain.verdict, Verdict::NothingMissing);
    assert!(plain.left[0][0].adjusted > 1e-3);
    // What was looked at is told also where nothing is missing.
    assert!(
        plain
            .candidates
            .iter()
            .any(|t| t.effect.name == "coulomb-friction" && t.gain_db.abs() < 0.1)
    );
    let viscous = plain.model.base.parameters()[1].value;
    assert!((viscous - 7500.0).abs() < 4.0 * plain.deviations[1], "{viscous}");
    let rubs = damped(&|_, v| -20.0 * (v / 1e-3).tanh());
    let names: Vec<&str> = rubs.added.iter().map(|a| a.effect.name).collect();
    assert_eq!(names, ["coulomb-friction"]);
}
