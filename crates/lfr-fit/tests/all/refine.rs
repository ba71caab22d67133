//! Recovery of known LFRs, coordinates that do not matter, covariance, limits and refusals.

use crate::common::*;
use lfr_fit::{Candidate, Channel, FitError, FrozenData, RefineSettings, StopReason, refine};
use lpv_core::nalgebra::DMatrix;
use lpv_core::num_complex::Complex;
use lpv_core::{
    Continuous, CoreError, DeltaBlock, Discrete, Frf, FrfEstimate, Lfr, LfrBlocks, SchedulingRange,
    WellPosedness,
};
use rand_distr::{Distribution, StandardNormal};

fn settings() -> lfr_fit::RefineSettings {
    RefineSettings::default()
}

/// `y = u / (z - a)` from data of a = 0.5, only a free: one number is found.
#[test]
fn one_free_pole() {
    let start = Lfr::from_lti(&lag(1.0, 0.2), interval()).unwrap();
    let free = DMatrix::from_fn(2, 2, |i, j| (i, j) == (0, 0));
    let start = Candidate::from_lfr(&start).unwrap().with_free(free).unwrap();
    let truth = Candidate::from_lfr(&Lfr::from_lti(&lag(1.0, 0.5), interval()).unwrap()).unwrap();
    let found = refine(&start, &relative(&truth, &[2.0], 9), &settings()).unwrap();
    assert!((found.candidate.matrix()[(0, 0)] - 0.5).abs() < 1e-13);
    assert_eq!(found.account.stop, StopReason::ResidualAtRounding);
    assert_eq!(
        (
            found.account.free,
            found.account.indistinguishable,
            found.account.rank
        ),
        (1, 0, 1)
    );
    assert_eq!(found.account.equations, 18);
    assert!(found.account.costs.is_sorted_by(|a, b| a > b));
    // Nothing else has moved.
    let mut expected = truth.matrix().clone();
    expected[(0, 0)] = found.candidate.matrix()[(0, 0)];
    assert_eq!(found.candidate.matrix(), &expected);
}

#[test]
fn known_continuous_lfrs_are_recovered() {
    for seed in 0..5 {
        let truth = continuous(1, seed);
        let near = perturbed(truth.to_lfr().unwrap().blocks(), 0.1, seed + 50);
        let start = Lfr::new(near, one_parameter(1), interval(), Continuous).unwrap();
        let start = Candidate::from_lfr(&start).unwrap();
        assert!(largest_error(&start, &truth) > 1e-2);
        let found = refine(&start, &relative(&truth, &POSITIONS, 25), &settings()).unwrap();
        let error = largest_error(&found.candidate, &truth);
        assert!(error < 1e-10, "seed {seed}: {error:e} {:?}", found.account.stop);
        // Similarity of two states and of one delta.
        assert_eq!(
            (
                found.account.free,
                found.account.indistinguishable,
                found.account.rank
            ),
            (21, 5, 16)
        );
        assert!(matches!(
            found.account.well_posedness,
            WellPosedness::Proven { .. }
        ));
    }
}

#[test]
fn known_discrete_lfrs_are_recovered() {
    for seed in 0..5 {
        let truth = discrete(2, seed);
        let near = perturbed(truth.to_lfr().unwrap().blocks(), 0.1, seed + 50);
        let start = Lfr::new(near, one_parameter(2), interval(), clock()).unwrap();
        let start = Candidate::from_lfr(&start).unwrap();
        let found = refine(&start, &relative(&truth, &POSITIONS, 25), &settings()).unwrap();
        let error = largest_error(&found.candidate, &truth);
        assert!(error < 1e-9, "seed {seed}: {error:e} {:?}", found.account.stop);
        assert_eq!(found.account.indistinguishable, 4 + 4);
    }
}

/// Two parameters, one delta each.
#[test]
fn two_scheduling_parameters() {
    let range = SchedulingRange::new(vec![[1.0, 3.0], [-0.5, 0.1]]).unwrap();
    let deltas = |order: [usize; 2]| {
        order
            .map(|parameter| DeltaBlock {
                parameter,
                repetitions: 1,
            })
            .to_vec()
    };
    let blocks = blocks(SLOW, 2, 2, 4);
    let make = |m: &LfrBlocks| {
        let lfr = Lfr::new(m.clone(), deltas([0, 1]), range.clone(), Continuous).unwrap();
        Candidate::from_lfr(&lfr).unwrap()
    };
    let truth = make(&blocks);
    let positions: Vec<(Vec<f64>, Frf)> = range
        .grid(4)
        .into_iter()
        .map(|p| (p.clone(), truth.response(&p, &lines(20))))
        .collect();
    let data = FrozenData::relative(clock(), &positions).unwrap();
    let found = refine(&make(&perturbed(&blocks, 0.1, 9)), &data, &settings()).unwrap();
    for p in range.grid(7) {
        let expected = truth.response(&p, &lines(33));
        let error = found
            .candidate
            .response(&p, &lines(33))
            .relative_error(&expected)
            .unwrap();
        assert!(error.into_iter().all(|e| e < 1e-9));
    }
    // Deltas of different parameters do not mix: one scale each.
    assert_eq!(found.account.indistinguishable, 4 + 2);
    assert_eq!(found.position_rms.len(), 16);
}

/// The model in other coordinates of states and deltas has the same cost, now and at the end.
#[test]
fn coordinates_do_not_matter() {
    let truth = discrete(2, 1);
    let near = perturbed(truth.to_lfr().unwrap().blocks(), 0.05, 3);
    let mut rng = rng(8);
    let other = |n: usize, rng: &mut _| {
        let t = random(n, n, rng) * 0.4 + DMatrix::identity(n, n);
        (t.clone(), t.try_inverse().unwrap())
    };
    let ((x, x_inverse), (y, y_inverse)) = (other(2, &mut rng), other(2, &mut rng));
    let m = near.clone();
    let moved = LfrBlocks {
        a: &x * m.a * &x_inverse,
        b1: &x * m.b1 * &y_inverse,
        b2: &x * m.b2,
        c1: &y * m.c1 * &x_inverse,
        d11: &y * m.d11 * &y_inverse,
        d12: &y * m.d12,
        c2: m.c2 * &x_inverse,
        d21: m.d21 * &y_inverse,
        d22: m.d22,
    };
    // With errors of 1 %, so that the end is a minimum and not zero.
    let mut noisy = responses(&truth, &POSITIONS, 15);
    for (_, frf) in &mut noisy {
        for k in 0..frf.len() {
            let error = random(4, 1, &mut rng) * 0.01 * frf.line(k).norm();
            frf.line_slice_mut(k)
                .iter_mut()
                .zip(error.iter())
                .for_each(|(v, e)| *v += e);
        }
    }
    let data = FrozenData::relative(clock(), &noisy).unwrap();
    let settings = RefineSettings {
        tolerance: 1e-9,
        max_iterations: 500,
        ..RefineSettings::default()
    };
    let fitted = [near, moved].map(|blocks| {
        let lfr = Lfr::new(blocks, one_parameter(2), interval(), clock()).unwrap();
        refine(&Candidate::from_lfr(&lfr).unwrap(), &data, &settings).unwrap()
    });
    let [one, two] = fitted.each_ref().map(|f| f.account.costs[0]);
    assert!((one - two).abs() < 1e-11 * one);
    let [one, two] = fitted.each_ref().map(|f| f.account.rms);
    assert!((one - two).abs() < 1e-5 * one, "{one} {two}");
    let [one, two] = fitted.each_ref().map(|f| f.account.rank);
    assert_eq!(one, two);
}

/// Estimates with the variance of a channel given, and normal errors of that variance.
fn noisy(exact: &[(Vec<f64>, Frf)], deviation: f64, seed: u64) -> Vec<(Vec<f64>, FrfEstimate)> {
    let mut rng = rng(seed);
    let mut normal = || {
        let value: f64 = StandardNormal.sample(&mut rng);
        value * deviation / 2f64.sqrt()
    };
    let one = |(p, frf): &(Vec<f64>, Frf)| {
        let mut frf = frf.clone();
        let n = frf.len();
        for k in 0..n {
            frf.line_slice_mut(k)
                .iter_mut()
                .for_each(|v| *v += Complex::new(normal(), normal()));
        }
        let c = vec![Complex::from(deviation * deviation); n];
        let s = vec![Complex::from(1.0); n];
        (
            p.clone(),
            FrfEstimate::new(frf, c, s, f64::INFINITY, None).unwrap(),
        )
    };
    exact.iter().map(one).collect()
}

/// One state and one delta, one input and output: the covariance that a fit gives is the scatter of 200 fits.
#[test]
fn covariance_is_the_scatter_of_many_fits() {
    let one = |v: f64| DMatrix::from_element(1, 1, v);
    let blocks = LfrBlocks {
        a: one(0.6),
        b1: one(0.2),
        b2: one(1.0),
        c1: one(1.0),
        d11: one(0.3),
        d12: one(0.4),
        c2: one(1.2),
        d21: one(0.5),
        d22: one(0.0),
    };
    let lfr = Lfr::new(blocks, one_parameter(1), interval(), clock()).unwrap();
    let truth = Candidate::from_lfr(&lfr).unwrap();
    let exact = responses(&truth, &POSITIONS, 12);
    let (p, at) = ([1.5], [0.05, 0.3, 0.8]);
    let (fits, deviation) = (200, 0.02);
    let expected = truth.response(&p, &at);
    let (mut scatter, mut predicted) = (vec![DMatrix::zeros(2, 2); 3], vec![DMatrix::zeros(2, 2); 3]);
    let mut cost = 0.0;
    let mut degrees = 0;
    for seed in 0..fits {
        let data = FrozenData::weighted(clock(), &noisy(&exact, deviation, seed), 0.0).unwrap();
        let found = refine(&truth, &data, &settings()).unwrap();
        let covariances = found.response_covariance(&p, &at).unwrap();
        let deviations = found.response_deviation(&p, &at).unwrap();
        let response = found.candidate.response(&p, &at);
        for (k, covariance) in covariances.iter().enumerate() {
            let error = response.line(k)[(0, 0)] - expected.line(k)[(0, 0)];
            let error = DMatrix::from_column_slice(2, 1, &[error.re, error.im]);
            scatter[k] += &error * error.transpose() / fits as f64;
            predicted[k] += covariance / fits as f64;
            assert!((deviations[k][(0, 0)].powi(2) - covariance.trace()).abs() < 1e-12 * covariance.trace());
        }
        cost += found.account.costs.last().unwrap();
        degrees += found.account.degrees_of_freedom();
        // Two scales are changes of coordinates, and the covariance along them is zero.
        assert_eq!(
            (
                found.account.indistinguishable,
                found.account.rank,
                found.account.variance
            ),
            (2, 6, 1.0)
        );
        assert_eq!(found.parameter_covariance().rank(1e-12), 6);
    }
    // The variance of a scatter of 200 has a deviation of 10 %.
    for (scatter, predicted) in scatter.iter().zip(&predicted) {
        let ratio = scatter.trace() / predicted.trace();
        assert!((0.7..1.4).contains(&ratio), "{ratio}");
        assert!((scatter - predicted).amax() < 0.4 * predicted.trace());
    }
    // Noise alone leaves one in each equation.
    assert!(
        (cost / degrees as f64 - 1.0).abs() < 0.02,
        "{}",
        cost / degrees as f64
    );
}

/// With relative weights the level of the noise is taken from the residual.
#[test]
fn the_variance_of_relative_fits_comes_from_the_residual() {
    let truth = discrete(1, 2);
    let level = 1e-3;
    let mut rng = rng(4);
    let mut normal = || {
        let value: f64 = StandardNormal.sample(&mut rng);
        value * level
    };
    let mut data = responses(&truth, &POSITIONS, 40);
    for (_, frf) in &mut data {
        for k in 0..frf.len() {
            let size = frf.line(k).norm();
            frf.line_slice_mut(k)
                .iter_mut()
                .for_each(|v| *v += Complex::new(normal(), normal()) * size);
        }
    }
    let data = FrozenData::relative(clock(), &data).unwrap();
    let found = refine(&truth, &data, &settings()).unwrap();
    assert!((found.account.variance.sqrt() / level - 1.0).abs() < 0.1);
    // Eight real equations a line.
    assert!((found.account.rms / (8f64.sqrt() * level) - 1.0).abs() < 0.1);
    assert!(found.account.largest > found.account.rms);
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let truth = continuous(2, 3);
    let data = relative(&truth, &POSITIONS, 30);
    let start = continuous(2, 6);
    let settings = RefineSettings {
        max_iterations: 15,
        minimax_passes: 2,
        ..RefineSettings::default()
    };
    let [one, three] = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| refine(&start, &data, &settings).unwrap())
    });
    assert_eq!(one, three);
}

#[test]
fn reweighted_fits_lower_the_largest_residual() {
    // One delta cannot do what two do.
    let data = relative(&continuous(2, 4), &POSITIONS, 30);
    let fit = |passes: usize| {
        let settings = RefineSettings {
            minimax_passes: passes,
            ..RefineSettings::default()
        };
        refine(&continuous(1, 4), &data, &settings).unwrap()
    };
    let (plain, minimax) = (fit(0), fit(30));
    assert!(minimax.account.largest < 0.8 * plain.account.largest);
    assert!(minimax.account.rms >= plain.account.rms * (1.0 - 1e-6));
}

/// Data of an unstable system: the model goes to the edge and no further.
#[test]
fn stable_models_stay_stable() {
    let with_poles = |re: f64, im: f64| {
        let blocks = blocks([re, im, -im, re], 2, 1, 3);
        let mut m = blocks;
        m.b1.fill(0.0);
        let lfr = Lfr::new(m, one_parameter(1), interval(), clock()).unwrap();
        Candidate::from_lfr(&lfr).unwrap()
    };
    let data = relative(&with_poles(0.7, 0.75), &[1.0, 2.0, 3.0], 50);
    let start = with_poles(0.6, 0.65);
    let found = refine(&start, &data, &settings()).unwrap();
    for p in [1.0, 2.0, 3.0] {
        assert!(found.candidate.frozen(&[p]).unwrap().is_stable().unwrap());
    }
    assert!(found.account.costs.last().unwrap() < &found.account.costs[0]);
    // Without a stable start the way is free.
    let free = refine(&with_poles(0.69, 0.73), &data, &settings()).unwrap();
    assert!(free.account.rms < 1e-10);
}

#[test]
fn limits_end_a_search() {
    let data = relative(&discrete(2, 1), &POSITIONS, 10);
    let start = discrete(2, 2);
    let fit = |settings: RefineSettings| refine(&start, &data, &settings).unwrap();
    let none = fit(RefineSettings {
        max_iterations: 0,
        ..RefineSettings::default()
    });
    assert_eq!(
        (none.account.stop, none.account.iterations()),
        (StopReason::IterationLimit, 0)
    );
    assert_eq!(none.candidate, start);
    let target = 0.5 * none.account.rms;
    let reached = fit(RefineSettings {
        target,
        ..RefineSettings::default()
    });
    assert_eq!(reached.account.stop, StopReason::TargetReached);
    assert!(reached.account.rms <= target);
    let nothing = start.clone().with_free(start.free().map(|_| false)).unwrap();
    let nothing = refine(&nothing, &data, &settings()).unwrap();
    assert_eq!(
        (nothing.account.stop, nothing.account.rank),
        (StopReason::NothingFree, 0)
    );
}

/// Direct channels are a way to write: the plain LFR has the same responses.
#[test]
fn direct_channels_are_eliminated() {
    let blocks = blocks(INSIDE, 2, 3, 5);
    let channels = vec![Channel::Parameter(0), Channel::Direct, Channel::Parameter(0)];
    let free = DMatrix::from_element(7, 7, true);
    let candidate = Candidate::new(&blocks, free, channels, interval(), clock()).unwrap();
    let plain = candidate.to_lfr().unwrap();
    assert_eq!((plain.delta_count(), candidate.delta_count()), (2, 2));
    for p in POSITIONS {
        let expected = plain.frozen(&[p]).unwrap().frequency_response(&lines(9)).unwrap();
        let error = candidate
            .response(&[p], &lines(9))
            .relative_error(&expected)
            .unwrap();
        assert!(error.into_iter().all(|e| e < 1e-13));
    }
}

#[test]
fn data_can_be_selected() {
    let data = relative(&continuous(1, 1), &POSITIONS, 60);
    assert_eq!(
        (data.len(), data.outputs(), data.inputs(), data.equations()),
        (7, 2, 2, 7 * 60 * 8)
    );
    let some = data.subset(|p| p[0] < 1.5).unwrap();
    assert_eq!(some.scheduling().collect::<Vec<_>>(), [&[1.0][..], &[1.3]]);
    assert_eq!(
        data.subset(|_| false).unwrap_err(),
        FitError::Empty { what: "positions" }
    );
    let thin = data.thinned(20);
    for (thin, all) in thin.responses().zip(data.responses()) {
        let (kept, lines) = (thin.frequencies_hz(), all.frequencies_hz());
        assert!((15..=20).contains(&kept.len()), "{}", kept.len());
        assert_eq!((kept[0], kept.last()), (lines[0], lines.last()));
        // Half of the lines are spread evenly, so that no gap is longer than twice the mean.
        assert!(kept.windows(2).all(|w| w[1] - w[0] < 2.2 / 19.0));
    }
    assert_eq!(data.thinned(60).equations(), data.equations());
}

#[test]
fn what_does_not_fit_is_refused() {
    let model = discrete(1, 1);
    let good = responses(&model, &POSITIONS, 10);
    let narrow = |count: usize| {
        let frf = Frf::new(lines(count), 1, 1, vec![Complex::from(1.0); count]).unwrap();
        FrozenData::relative(clock(), &[(vec![2.0], frf)])
    };
    let refused = |data: FrozenData| refine(&model, &data, &settings()).unwrap_err();
    assert!(matches!(
        refused(narrow(5).unwrap()),
        FitError::Data {
            what: "outputs",
            expected: 2,
            found: 1,
            ..
        }
    ));
    let slower = FrozenData::relative(Discrete::new(0.4).unwrap(), &good).unwrap();
    assert!(matches!(
        refused(slower),
        FitError::Core(CoreError::DifferentClocks { .. })
    ));
    let mut outside = good.clone();
    outside[0].0[0] = 3.1;
    let outside = FrozenData::relative(clock(), &outside).unwrap();
    assert!(matches!(
        refused(outside),
        FitError::Core(CoreError::OutsideRange { .. })
    ));
    let few = FrozenData::relative(clock(), &responses(&model, &[1.0], 1)).unwrap();
    assert_eq!(
        refine(&model, &few, &settings()).unwrap_err(),
        FitError::TooFewEquations {
            equations: 8,
            unknowns: 21 - 5,
        }
    );

    assert!(matches!(
        FrozenData::relative(clock(), &[]),
        Err(FitError::Empty { what: "positions" })
    ));
    let mut mixed = good.clone();
    mixed[1].0.push(0.0);
    assert!(matches!(
        FrozenData::relative(clock(), &mixed),
        Err(FitError::Data { index: 1, .. })
    ));
    let mut zero = good.clone();
    zero[2].1.line_slice_mut(4).fill(Complex::from(0.0));
    assert!(matches!(
        FrozenData::relative(clock(), &zero),
        Err(FitError::Line {
            index: 2,
            line: 4,
            ..
        })
    ));
    let mut unknown = good.clone();
    unknown[0].0[0] = f64::NAN;
    assert!(matches!(
        FrozenData::relative(clock(), &unknown),
        Err(FitError::Core(CoreError::NotFinite { .. }))
    ));
    assert!(matches!(
        FrozenData::relative(Discrete::new(5.0).unwrap(), &good),
        Err(FitError::Line { index: 0, .. })
    ));
    let certain = FrfEstimate::new(
        good[0].1.clone(),
        vec![Complex::from(0.0); 40],
        vec![Complex::from(0.0); 40],
        1.0,
        None,
    );
    let certain = [(vec![1.0], certain.unwrap())];
    assert!(matches!(
        FrozenData::weighted(clock(), &certain, 0.0),
        Err(FitError::Line { line: 0, .. })
    ));
    assert!(matches!(
        FrozenData::weighted(clock(), &certain, f64::NAN),
        Err(FitError::Setting {
            name: "model_error",
            ..
        })
    ));

    let mask = DMatrix::from_element(2, 2, true);
    assert!(matches!(
        model.clone().with_free(mask),
        Err(FitError::Core(CoreError::Dimension { .. }))
    ));
    for (name, settings) in [
        (
            "max_iterations",
            RefineSettings {
                max_iterations: usize::MAX,
                ..RefineSettings::default()
            },
        ),
        (
            "tolerance",
            RefineSettings {
                tolerance: 0.0,
                ..RefineSettings::default()
            },
        ),
        (
            "target",
            RefineSettings {
                target: f64::INFINITY,
                ..RefineSettings::default()
            },
        ),
        (
            "minimax_passes",
            RefineSettings {
                minimax_passes: 1001,
                ..RefineSettings::default()
            },
        ),
    ] {
        assert!(matches!(settings.check(), Err(FitError::Setting { name: n, .. }) if n == name));
    }
}

/// A start that is not well-posed at a position of the data, or has no response there.
#[test]
fn starts_without_a_response_are_refused() {
    let mut ill = blocks(INSIDE, 2, 1, 1);
    ill.d11[(0, 0)] = 1.0;
    let lfr = Lfr::new(ill, one_parameter(1), interval(), clock()).unwrap();
    let data = relative(&discrete(1, 1), &POSITIONS, 10);
    let refused = refine(&Candidate::from_lfr(&lfr).unwrap(), &data, &settings()).unwrap_err();
    assert!(matches!(refused, FitError::Start { p, .. } if p == [3.0]));

    let stiff = DMatrix::from_diagonal_element(2, 2, -1e6);
    let system = lpv_core::StateSpace::new(
        stiff,
        DMatrix::identity(2, 2),
        DMatrix::identity(2, 2),
        DMatrix::zeros(2, 2),
        Continuous,
    );
    let stiff = Candidate::from_lfr(&Lfr::from_lti(&system.unwrap(), interval()).unwrap()).unwrap();
    assert!(matches!(
        refine(&stiff, &data, &settings()),
        Err(FitError::Start { .. })
    ));
}
