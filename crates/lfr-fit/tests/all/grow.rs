//! LFRs grown from a local model.

use crate::common::*;
use lfr_fit::{
    Candidate, DeltaReach, FitError, FrozenData, GainFit, GrowSettings, RandomChannels, RefineSettings,
    Rigid, StartAccount, StartKind, StartOutcome, StartSearch, grow, local_body, merge_lines, refine,
};
use lpv_core::nalgebra::{DMatrix, dmatrix};
use lpv_core::num_complex::Complex;
use lpv_core::{
    Continuous, CoreError, DeltaBlock, Discrete, Frf, FrfEstimate, Lfr, SchedulingRange, StateSpace,
};
use rand::RngExt;

fn centre(truth: &Candidate<Continuous>) -> StateSpace<Continuous> {
    truth.frozen(&[2.0]).unwrap()
}

#[test]
fn known_lfrs_are_reached_from_their_centre() {
    for seed in 0..4 {
        let truth = continuous(2, seed);
        let data = relative(&truth, &POSITIONS, 50);
        let settings = GrowSettings {
            reach: DeltaReach::Outputs,
            target: Some(1e-8),
            ..GrowSettings::default()
        };
        let local = centre(&truth);
        let grown = grow(&local, None, &data, &one_parameter(2), &interval(), &settings).unwrap();
        assert!(grown.reached, "seed {seed}: {:?}", grown.starts);
        assert!(largest_error(&grown.refined.candidate, &truth) < 1e-6);
        assert!(matches!(grown.starts.last().unwrap().outcome, StartOutcome::Refined { rms } if rms <= 1e-8));
        assert_eq!(grown.refined.candidate.delta_count(), 2);
        // The same again, bit by bit.
        let again = grow(&local, None, &data, &one_parameter(2), &interval(), &settings).unwrap();
        assert_eq!(again.refined, grown.refined);
    }
}

/// If the deltas reach states only, there is no direct term at any p, and C does not depend on p.
#[test]
fn outputs_see_states_only() {
    let truth = continuous(2, 1);
    let data = relative(&truth, &POSITIONS, 50);
    let d21 = |reach: DeltaReach| {
        let settings = GrowSettings {
            reach,
            restarts: 0,
            ..GrowSettings::default()
        };
        let grown = grow(
            &centre(&truth),
            None,
            &data,
            &one_parameter(2),
            &interval(),
            &settings,
        )
        .unwrap();
        let lfr = grown.refined.candidate.to_lfr().unwrap();
        let frozen = [1.0, 3.0].map(|p| lfr.frozen(&[p]).unwrap());
        let moves = (frozen[0].c() - frozen[1].c()).amax() + frozen[0].d().amax();
        (lfr.blocks().d21.amax(), moves, grown.refined.account.rms)
    };
    let (states, outputs) = (d21(DeltaReach::States), d21(DeltaReach::Outputs));
    assert_eq!((states.0, states.1), (0.0, 0.0));
    assert!(outputs.0 > 0.0 && outputs.1 > 0.0 && outputs.2 < states.2);
}

#[test]
fn discrete_lfrs_grow_too() {
    let truth = discrete(1, 3);
    let data = relative(&truth, &POSITIONS, 50);
    let local = truth.frozen(&[2.0]).unwrap();
    let settings = GrowSettings {
        reach: DeltaReach::Outputs,
        target: Some(1e-8),
        ..GrowSettings::default()
    };
    let grown = grow(&local, None, &data, &one_parameter(1), &interval(), &settings).unwrap();
    assert!(grown.reached && largest_error(&grown.refined.candidate, &truth) < 1e-6);
}

#[test]
fn two_parameters() {
    let range = SchedulingRange::new(vec![[1.0, 3.0], [-0.5, 0.1]]).unwrap();
    let deltas: Vec<DeltaBlock> = [0, 1]
        .map(|parameter| DeltaBlock {
            parameter,
            repetitions: 1,
        })
        .to_vec();
    for seed in 0..5 {
        let lfr = Lfr::new(
            blocks(SLOW, 2, 2, seed),
            deltas.clone(),
            range.clone(),
            Continuous,
        )
        .unwrap();
        let truth = Candidate::from_lfr(&lfr).unwrap();
        let at = |p: Vec<f64>| (p.clone(), truth.response(&p, &lines(30)));
        let data: Vec<(Vec<f64>, Frf)> = range.grid(5).into_iter().map(at).collect();
        let data = FrozenData::relative(clock(), &data).unwrap();
        let local = truth.frozen(&range.centre()).unwrap();
        let settings = GrowSettings {
            reach: DeltaReach::Outputs,
            search: StartSearch::All,
            restarts: 1,
            target: Some(1e-8),
            ..GrowSettings::default()
        };
        let grown = grow(&local, None, &data, &deltas, &range, &settings).unwrap();
        let reached = |s: &&StartAccount| matches!(s.outcome, StartOutcome::Refined { rms } if rms <= 1e-8);
        // A product of parameters counts, which a straight line has not.
        let good = grown.starts.iter().filter(reached).count();
        assert!(
            reached(&&grown.starts[0]) && good >= 3,
            "{seed}: {:?}",
            grown.starts
        );
        let p = [1.3, -0.44];
        let error = grown.refined.candidate.response(&p, &lines(33));
        let error = error.relative_error(&truth.response(&p, &lines(33))).unwrap();
        assert!(error.into_iter().all(|e| e < 1e-6));
    }
}

/// One delta cannot do what three do: every start is used up, the best is kept, and the account says so.
#[test]
fn targets_out_of_reach_are_results() {
    let truth = continuous(3, 7);
    let data = relative(&truth, &POSITIONS, 40);
    let settings = GrowSettings {
        seed: 5,
        restarts: 2,
        target: Some(1e-9),
        ..GrowSettings::default()
    };
    let grown = grow(
        &centre(&truth),
        None,
        &data,
        &one_parameter(1),
        &interval(),
        &settings,
    )
    .unwrap();
    assert!(!grown.reached);
    let random = |seed| StartKind::Random { seed };
    let coherent = |degree| StartKind::Coherent { degree };
    // Starts that agree end the search.
    let all = [coherent(2), coherent(3), coherent(1), random(5), random(6)];
    let kinds: Vec<StartKind> = grown.starts.iter().map(|s| s.kind).collect();
    assert!(kinds.len() >= 3 && kinds[..] == all[..kinds.len()], "{kinds:?}");
    let refined: Vec<_> = grown
        .starts
        .iter()
        .filter(|s| matches!(s.outcome, StartOutcome::Refined { .. }))
        .collect();
    assert_eq!(refined, [&grown.starts[grown.winner]]);
    assert!(grown.starts.iter().all(|s| s.few_rms >= refined[0].few_rms));
    assert!(grown.refined.account.rms > 1e-6);
}

/// A gain that comes from one noisy position is 2 % off; freed, it follows all positions.
#[test]
fn a_free_gain_is_fitted_to_all_positions() {
    let local = StateSpace::new(
        dmatrix![-0.2, 2.0; -2.0, -0.2],
        dmatrix![1.0, 0.4; 0.3, 1.0],
        dmatrix![1.0, 0.2; -0.5, 1.0],
        DMatrix::zeros(2, 2),
        Continuous,
    )
    .unwrap();
    let gamma = dmatrix![1.0, 0.0; 0.0, 2.0];
    let random = RandomChannels { seed: 2, size: 0.04 };
    let truth = Candidate::flexible(&local, Some(&gamma), &one_parameter(1), interval(), random).unwrap();
    assert!(POSITIONS.iter().all(|p| {
        truth
            .frozen(&[*p])
            .unwrap()
            .poles()
            .unwrap()
            .iter()
            .all(|s| s.re <= 0.0)
    }));
    let mut rng = rng(1);
    let mut noisy = responses(&truth, &POSITIONS, 60);
    for (_, frf) in &mut noisy {
        for k in 0..frf.len() {
            let size = 0.01 * frf.line(k).norm();
            frf.line_slice_mut(k).iter_mut().for_each(|v| {
                *v += Complex::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0)) * size
            });
        }
    }
    let data = FrozenData::relative(clock(), &noisy).unwrap();
    let start = &gamma * 1.02;
    let fit = |gain: GainFit| {
        let settings = GrowSettings {
            gain,
            restarts: 1,
            ..GrowSettings::default()
        };
        let grown = grow(
            &local,
            Some(&start),
            &data,
            &one_parameter(1),
            &interval(),
            &settings,
        )
        .unwrap();
        let m = grown.refined.candidate.matrix().clone();
        (m.view((2, 6), (2, 2)).into_owned(), grown.refined.account.rms)
    };
    let (fixed, fixed_rms) = fit(GainFit::Fixed);
    assert_eq!(fixed, start);
    let (free, free_rms) = fit(GainFit::Free);
    assert!((&free - &gamma).amax() < 0.005, "{free}");
    assert_eq!((free[(0, 1)], free[(1, 0)]), (0.0, 0.0));
    assert!(free_rms < fixed_rms);
}

#[test]
fn what_does_not_fit_is_refused() {
    let truth = continuous(1, 1);
    let data = relative(&truth, &POSITIONS, 30);
    let settings = GrowSettings::default();
    let local = centre(&truth);
    let deltas = one_parameter(1);
    let refused = |deltas: &[DeltaBlock], range: SchedulingRange, gamma: Option<&DMatrix<f64>>| {
        grow(&local, gamma, &data, deltas, &range, &settings).unwrap_err()
    };
    assert_eq!(refused(&[], interval(), None), FitError::Empty { what: "deltas" });
    assert_eq!(
        refused(&one_parameter(0), interval(), None),
        FitError::Empty { what: "deltas" }
    );
    let narrow = SchedulingRange::interval(1.5, 3.0).unwrap();
    assert!(matches!(
        refused(&deltas, narrow, None),
        FitError::Core(CoreError::OutsideRange { .. })
    ));
    let unknown = [DeltaBlock {
        parameter: 1,
        repetitions: 1,
    }];
    assert!(matches!(
        refused(&unknown, interval(), None),
        FitError::Core(CoreError::Dimension { .. })
    ));
    assert!(matches!(
        refused(&deltas, interval(), Some(&DMatrix::zeros(2, 3))),
        FitError::Core(CoreError::Dimension { found: 3, .. })
    ));
    assert!(matches!(
        discrete(1, 1).with_free_gain(),
        Err(FitError::Core(CoreError::Dimension {
            expected: 4,
            found: 2,
            ..
        }))
    ));
    for (name, settings) in [
        (
            "size",
            GrowSettings {
                size: 0.0,
                ..GrowSettings::default()
            },
        ),
        (
            "restarts",
            GrowSettings {
                restarts: 1001,
                ..GrowSettings::default()
            },
        ),
        (
            "lines",
            GrowSettings {
                lines: 0,
                ..GrowSettings::default()
            },
        ),
        (
            "start_iterations",
            GrowSettings {
                start_iterations: 0,
                ..GrowSettings::default()
            },
        ),
        (
            "target",
            GrowSettings {
                target: Some(0.0),
                ..GrowSettings::default()
            },
        ),
        (
            "tolerance",
            GrowSettings {
                refine: RefineSettings {
                    tolerance: 1.0,
                    ..RefineSettings::default()
                },
                ..GrowSettings::default()
            },
        ),
    ] {
        assert!(matches!(settings.check(), Err(FitError::Setting { name: n, .. }) if n == name));
    }
}

/// A model fitted to a hundredth of the lines has nothing left to win on all of them.
#[test]
fn condensed_lines_know_what_all_lines_know() {
    let truth = continuous(1, 1);
    let mut rng = rng(4);
    let noisy: Vec<(Vec<f64>, FrfEstimate)> = responses(&truth, &POSITIONS, 4000)
        .into_iter()
        .map(|(p, mut frf)| {
            let (mut c, mut s) = (Vec::new(), Vec::new());
            for k in 0..frf.len() {
                // Noise that depends on the line and is not the same in both outputs, nor independent.
                let deviation = 0.02 + 0.05 * frf.frequencies_hz()[k];
                let half = |v: f64| deviation * (6.0_f64 / 4.0).sqrt() * v;
                let one = [(); 2].map(|()| {
                    Complex::new(
                        half(rng.random_range(-1.0..1.0)),
                        half(rng.random_range(-1.0..1.0)),
                    )
                });
                let other = [(); 2].map(|()| {
                    Complex::new(
                        half(rng.random_range(-1.0..1.0)),
                        half(rng.random_range(-1.0..1.0)),
                    )
                });
                for (j, column) in frf.line_slice_mut(k).chunks_exact_mut(2).enumerate() {
                    column[0] += one[j];
                    column[1] += one[j] * 0.5 + other[j];
                }
                let v = deviation * deviation;
                c.extend([v, 0.5 * v, 0.5 * v, 1.25 * v].map(Complex::from));
                s.extend([1.0, 0.0, 0.0, 1.0].map(Complex::from));
            }
            (p, FrfEstimate::new(frf, c, s, f64::INFINITY, None).unwrap())
        })
        .collect();
    let data = FrozenData::weighted(clock(), &noisy, 0.0).unwrap();
    let settings = GrowSettings {
        reach: DeltaReach::Outputs,
        ..GrowSettings::default()
    };
    let local = centre(&truth);
    let few = merge_lines(&local, None, &data, &interval(), &settings).unwrap();
    assert!(
        few.equations() * 50 < data.equations(),
        "{} equations",
        few.equations()
    );
    let fit = |data: &FrozenData| {
        let grown = grow(&local, None, data, &one_parameter(1), &interval(), &settings).unwrap();
        let rms = grown.refined.account.rms;
        assert!(
            grown.reached && (0.9..1.1).contains(&rms),
            "{rms} {:?}",
            grown.starts
        );
        grown.refined.candidate
    };
    let as_it_is = RefineSettings {
        max_iterations: 0,
        ..RefineSettings::default()
    };
    let judged = refine(&fit(&few), &data, &as_it_is).unwrap().account;
    // Less than the square of a fifth of a deviation in each direction that the data determine: an error 2 % larger.
    assert!(
        judged.decrease < 0.04 * judged.rank as f64,
        "{} of {}",
        judged.decrease,
        judged.rank
    );
    assert!((judged.rms - 1.0).abs() < 0.01, "{}", judged.rms);
}

/// A mass with friction to ground behind a spring whose stiffness depends on p, from exact responses over three decades of friction.
#[test]
fn rigid_bodies_with_friction_grow() {
    let clock = Discrete::new(0.05).unwrap();
    let lines: Vec<f64> = (1..80).map(|k| 0.02 * f64::from(k)).collect();
    for friction in [0.003, 0.03, 0.3, 3.0] {
        let machine = |p: f64| {
            // Two masses, 3 and 1, on a spring 4 (1 + p / 4); friction on the first.
            let (k, d) = (4.0 * (1.0 + 0.25 * p), 0.04);
            let a = dmatrix![
                0.0, 0.0, 1.0, 0.0;
                0.0, 0.0, 0.0, 1.0;
                -k / 3.0, k / 3.0, -(d + friction) / 3.0, d / 3.0;
                k, -k, d, -d
            ];
            let b = dmatrix![0.0; 0.0; 1.0 / 3.0; 0.0];
            StateSpace::new(a, b, dmatrix![1.0, 0.0, 0.0, 0.0], dmatrix![0.0], Continuous).unwrap()
        };
        let responses: Vec<(Vec<f64>, Frf)> = [-1.0, -0.5, 0.0, 0.5, 1.0]
            .into_iter()
            .map(|p| {
                let held = machine(p).zero_order_hold(clock).unwrap();
                (vec![p], held.frequency_response(&lines).unwrap())
            })
            .collect();
        let data = FrozenData::relative(clock, &responses).unwrap();
        let middle = data.subset(|p| p[0] == 0.0).unwrap();
        let held = machine(0.0).zero_order_hold(clock).unwrap();
        let poles = lpv_core::linalg::eigenvalues(held.a()).unwrap();
        let modes: Vec<_> = poles.into_iter().filter(|z| z.im != 0.0).collect();
        let (gain, rate) = (dmatrix![0.25], dmatrix![0.25 * friction]);
        let settings = RefineSettings::default();
        let local = local_body(&middle, &modes, Rigid::Friction, (&gain, &rate), &settings).unwrap();
        assert!(local.account.rms < 1e-4, "{friction}: {}", local.account.rms);
        let range = SchedulingRange::interval(-1.0, 1.0).unwrap();
        let settings = GrowSettings::default();
        let grown = grow(
            &local.model,
            Rigid::Friction,
            &data,
            &one_parameter(2),
            &range,
            &settings,
        )
        .unwrap();
        assert!(grown.reached, "{friction}: {:?}", grown.starts);
        let between = grown.refined.candidate.frozen(&[0.3]).unwrap();
        let own = between
            .zero_order_hold(clock)
            .unwrap()
            .frequency_response(&lines)
            .unwrap();
        let truth = machine(0.3).zero_order_hold(clock).unwrap();
        let truth = truth.frequency_response(&lines).unwrap();
        let error = own.relative_error(&truth).unwrap();
        assert!(error.iter().all(|e| *e < 1e-2), "{friction}: {error:?}");
        // The integral is exact.
        assert_eq!(between.a().column(0).amax(), 0.0);
        // A rigid body of another kind is none within a local model, and two positions are no local model.
        let other = local_body(&middle, &modes, Rigid::Absent, (&gain, &rate), &settings.refine);
        assert!(matches!(other, Err(FitError::Empty { .. })));
        let several = local_body(&data, &modes, Rigid::Friction, (&gain, &rate), &settings.refine);
        assert!(matches!(several, Err(FitError::Data { .. })));
    }
}
