//! Local models from responses and poles.

use crate::common::*;
use lfr_fit::{
    Candidate, FitError, FrozenData, LocalModel, LocalSettings, RandomChannels, RigidGain, Sampling,
    local_model,
};
use lpv_core::nalgebra::{DMatrix, dmatrix};
use lpv_core::num_complex::Complex;
use lpv_core::{Continuous, Discrete, Frf, StateSpace};
use rand::RngExt;

type C64 = Complex<f64>;

/// Two modes and a lag, one input and output more than the modes need.
fn flexible<K: Sampling>(clock: K, a: &DMatrix<f64>) -> StateSpace<K> {
    let mut rng = rng(3);
    // Each mode has a residue of rank one: that is what two real rows of B and columns of C make of it.
    StateSpace::new(
        a.clone(),
        random(5, 2, &mut rng),
        random(2, 5, &mut rng),
        DMatrix::zeros(2, 2),
        clock,
    )
    .unwrap()
}

fn continuous_a() -> DMatrix<f64> {
    dmatrix![
        -0.1, 2.0, 0.0, 0.0, 0.0;
        -2.0, -0.1, 0.0, 0.0, 0.0;
        0.0, 0.0, -0.2, 4.0, 0.0;
        0.0, 0.0, -4.0, -0.2, 0.0;
        0.0, 0.0, 0.0, 0.0, -0.7
    ]
}

fn discrete_a() -> DMatrix<f64> {
    dmatrix![
        0.6, 0.7, 0.0, 0.0, 0.0;
        -0.7, 0.6, 0.0, 0.0, 0.0;
        0.0, 0.0, -0.3, 0.8, 0.0;
        0.0, 0.0, -0.8, -0.3, 0.0;
        0.0, 0.0, 0.0, 0.0, 0.4
    ]
}

/// The whole model as a candidate, and its response at one position.
fn truth<K: Sampling>(flexible: &StateSpace<K>, gamma: Option<&DMatrix<f64>>) -> (Candidate<K>, FrozenData)
where
    Candidate<K>: Sampled,
{
    let candidate = Candidate::flexible(flexible, gamma, &[], interval(), RandomChannels::default()).unwrap();
    let data = relative(&candidate, &[2.0], 60);
    (candidate, data)
}

/// Values of z.
fn poles<K: Sampling>(flexible: &StateSpace<K>) -> Vec<C64> {
    let own = flexible.poles().unwrap();
    let is_continuous = flexible.clock().nyquist_hz().is_infinite();
    own.into_iter()
        .map(|p| if is_continuous { (p * 0.5).exp() } else { p })
        .collect()
}

fn check<K: Sampling>(clock: K, a: &DMatrix<f64>)
where
    Candidate<K>: Sampled,
{
    let flexible = flexible(clock, a);
    for gamma in [dmatrix![1.0, 0.0; 0.0, 3.0], dmatrix![1.0, 0.3; -0.2, 3.0]] {
        let (truth, data) = truth(&flexible, Some(&gamma));
        // Of each pair one is enough, and all of them do no harm.
        let all = poles(&flexible);
        let upper: Vec<C64> = all.iter().copied().filter(|p| p.im >= 0.0).collect();
        for poles in [all, upper] {
            let made = local_model(clock, &data, &poles, &LocalSettings::default()).unwrap();
            let found = made.gamma.as_ref().unwrap();
            assert!((found - &gamma).amax() < 1e-9, "{found}");
            // The decision: exactly diagonal where it is so.
            assert_eq!(found[(0, 1)] == 0.0, gamma[(0, 1)] == 0.0);
            assert_eq!(made.modes.len(), 3);
            assert!(
                made.modes.iter().all(|m| m.kept && m.second_rank < 1e-8),
                "{:?}",
                made.modes
            );
            assert!(same_response(&made, &truth) < 1e-9);
        }
    }
}

fn same_response<K: Sampling>(made: &LocalModel<K>, truth: &Candidate<K>) -> f64
where
    Candidate<K>: Sampled,
{
    let random = RandomChannels::default();
    let found = Candidate::flexible(&made.flexible, made.gamma.as_ref(), &[], interval(), random).unwrap();
    let expected = truth.response(&[2.0], &lines(77));
    let errors = found
        .response(&[2.0], &lines(77))
        .relative_error(&expected)
        .unwrap();
    errors.into_iter().fold(0.0, f64::max)
}

#[test]
fn known_models_are_recovered() {
    check(Continuous, &continuous_a());
    check(clock(), &discrete_a());
}

#[test]
fn without_a_rigid_body() {
    let flexible = flexible(Continuous, &continuous_a());
    let (truth, data) = truth(&flexible, None);
    let settings = LocalSettings {
        rigid: RigidGain::Absent,
        ..LocalSettings::default()
    };
    let made = local_model(Continuous, &data, &poles(&flexible), &settings).unwrap();
    assert!(made.gamma.is_none() && same_response(&made, &truth) < 1e-9);
}

/// Poles a little off, as a fit gives them: the refinement moves them.
#[test]
fn poles_need_not_be_exact() {
    let flexible = flexible(Continuous, &continuous_a());
    let gamma = dmatrix![1.0, 0.0; 0.0, 3.0];
    let (truth, data) = truth(&flexible, Some(&gamma));
    let off: Vec<C64> = poles(&flexible)
        .into_iter()
        .map(|z| (z.ln() * 1.02).exp())
        .collect();
    let made = local_model(Continuous, &data, &off, &LocalSettings::default()).unwrap();
    assert!(made.account.costs[0] > 1e-4 && same_response(&made, &truth) < 1e-9);
}

/// Two poles that noise made have small shares and are dropped.
#[test]
fn weak_modes_are_dropped() {
    let flexible = flexible(Continuous, &continuous_a());
    let gamma = dmatrix![1.0, 0.0; 0.0, 3.0];
    let (_, data) = truth(&flexible, Some(&gamma));
    let mut rng = rng(8);
    let mut noisy: Vec<(Vec<f64>, Frf)> = data
        .scheduling()
        .zip(data.responses())
        .map(|(p, frf)| (p.to_vec(), frf.clone()))
        .collect();
    for (_, frf) in &mut noisy {
        for k in 0..frf.len() {
            let size = frf.line(k).norm();
            frf.line_slice_mut(k).iter_mut().for_each(|v| {
                *v += C64::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0)) * (1e-3 * size)
            });
        }
    }
    let data = FrozenData::relative(clock(), &noisy).unwrap();
    let mut given = vec![C64::from_polar(0.98, 1.9), C64::from_polar(0.95, 2.6)];
    given.extend(poles(&flexible));
    let settings = LocalSettings {
        states: Some(5),
        ..LocalSettings::default()
    };
    let made = local_model(Continuous, &data, &given, &settings).unwrap();
    assert_eq!(
        made.modes.iter().map(|m| m.kept).collect::<Vec<_>>(),
        [false, false, true, true, true]
    );
    assert_eq!(made.flexible.states(), 5);
    assert!(made.modes[0].share < 0.1 * made.modes[2].share);
    assert!(made.account.rms < 3e-3);
    // The off-diagonal gains are noise, and are set to zero; all of them stay if that is asked for.
    let found = made.gamma.unwrap();
    assert!((&found - &gamma).amax() < 0.02 && found[(0, 1)] == 0.0);
    let full = LocalSettings {
        states: Some(5),
        rigid: RigidGain::Full,
        ..LocalSettings::default()
    };
    let full = local_model(Continuous, &data, &given, &full)
        .unwrap()
        .gamma
        .unwrap();
    assert!(full[(0, 1)] != 0.0 && (full - &gamma).amax() < 0.02);
}

#[test]
fn what_cannot_be_is_refused() {
    let flexible = flexible(Continuous, &continuous_a());
    let (truth, data) = truth(&flexible, Some(&dmatrix![1.0, 0.0; 0.0, 3.0]));
    let settings = LocalSettings::default();
    let refused = |poles: &[C64]| local_model(Continuous, &data, poles, &settings).unwrap_err();
    assert_eq!(refused(&[]), FitError::Empty { what: "poles" });
    for (index, pole) in [
        (0, C64::from(f64::NAN)),
        (1, C64::new(1.0, 1e-12)),
        (0, C64::from(-0.5)),
        (1, C64::from(0.0)),
        (1, C64::new(0.5, 0.5)),
    ] {
        let mut given = vec![C64::new(0.5, 0.5)];
        given.insert(index, pole);
        assert!(matches!(refused(&given), FitError::Pole { index: i, .. } if i == index));
    }
    // A discrete model may have it.
    let discrete = |poles: &[C64]| local_model(clock(), &data, poles, &settings);
    assert!(discrete(&[C64::from(-0.5), C64::new(0.5, 0.8)]).is_ok());
    assert!(matches!(
        local_model(Discrete::new(0.4).unwrap(), &data, &[C64::from(0.5)], &settings),
        Err(FitError::Core(_))
    ));
    let several = relative(&truth, &[1.0, 2.0], 30);
    assert!(matches!(
        local_model(Continuous, &several, &poles(&flexible), &settings),
        Err(FitError::Data { found: 2, .. })
    ));
    let few = relative(&truth, &[2.0], 2);
    assert!(matches!(
        local_model(Continuous, &few, &poles(&flexible), &settings),
        Err(FitError::TooFewEquations { .. })
    ));
    assert!(matches!(
        LocalSettings {
            states: Some(0),
            ..LocalSettings::default()
        }
        .check(),
        Err(FitError::Setting { name: "states", .. })
    ));
}
