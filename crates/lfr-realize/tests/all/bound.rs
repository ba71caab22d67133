//! Bounds between positions.

use crate::common::*;
use lfr_fit::{Candidate, FitError, FrozenData, RandomChannels, RefineSettings, refine};
use lfr_realize::{BetweenWarning, BoundSettings, RealizeError, bound_between, difference_bound};
use lpv_core::nalgebra::{DMatrix, dmatrix};
use lpv_core::num_complex::Complex;
use lpv_core::{Clock, Continuous, CoreError, DeltaBlock, Frf, Lfr, LfrBlocks, SchedulingRange, StateSpace};
use rand::RngExt;

fn settings() -> lfr_realize::BoundSettings {
    BoundSettings::default()
}

/// Largest relative difference on a fine grid.
fn sampled<K: Clock>(model: &Lfr<K>, reference: &Lfr<K>, positions: &[Vec<f64>], lines: &[f64]) -> f64 {
    let one = |p: &Vec<f64>| {
        let own = model.frozen(p).unwrap().frequency_response(lines).unwrap();
        let truth = reference.frozen(p).unwrap().frequency_response(lines).unwrap();
        own.relative_error(&truth)
            .unwrap()
            .into_iter()
            .fold(0.0, f64::max)
    };
    positions.iter().map(one).fold(0.0, f64::max)
}

/// `F = 1 / (2 + delta)`, `G = 1 / 2`, static: the difference is `|delta| / (2 + delta)`, one at delta = -1.
#[test]
fn a_case_by_hand() {
    let one = |v: f64| DMatrix::from_element(1, 1, v);
    let blocks = |d11: f64| LfrBlocks {
        a: DMatrix::zeros(0, 0),
        b1: DMatrix::zeros(0, 1),
        b2: DMatrix::zeros(0, 1),
        c1: DMatrix::zeros(1, 0),
        c2: DMatrix::zeros(1, 0),
        d11: one(d11),
        d12: one(0.5),
        d21: one(d11),
        d22: one(0.5),
    };
    let range = SchedulingRange::interval(-1.0, 1.0).unwrap();
    let lfr = |d11: f64| Lfr::new(blocks(d11), one_parameter(1), range.clone(), clock()).unwrap();
    let found = difference_bound(&lfr(-0.5), &lfr(0.0), &[0.1], &settings()).unwrap();
    assert!(found.largest <= 1.0 && found.bound >= 1.0, "{found:?}");
    assert!(
        found.bound <= found.largest * 1.25 && found.at[0] < -0.7,
        "{found:?}"
    );
    let same = difference_bound(&lfr(-0.5), &lfr(-0.5), &[0.1], &settings()).unwrap();
    assert!(same.largest == 0.0 && same.bound < 1e-6, "{same:?}");
}

/// The bound lies above everything that a fine grid meets, and near it.
#[test]
fn no_sample_passes_the_bound() {
    for seed in 0..6 {
        let truth = continuous(3, seed).to_lfr().unwrap();
        let other = perturbed(truth.blocks(), 0.05, seed + 50);
        let other = Lfr::new(other, one_parameter(3), interval(), Continuous).unwrap();
        let positions: Vec<Vec<f64>> = (0..=1000).map(|i| vec![1.0 + 0.002 * f64::from(i)]).collect();
        let most = sampled(&other, &truth, &positions, &lines(40));
        let found = difference_bound(&other, &truth, &lines(40), &settings()).unwrap();
        assert!(
            found.largest <= found.bound && most <= found.bound,
            "seed {seed}: {most} {found:?}"
        );
        assert!(
            found.bound <= 1.3 * most && found.cells < 20_000,
            "seed {seed}: {most} {found:?}"
        );
    }
    let range = SchedulingRange::new(vec![[1.0, 3.0], [-0.5, 0.1]]).unwrap();
    let deltas = [0, 1].map(|parameter| DeltaBlock {
        parameter,
        repetitions: 2,
    });
    for seed in 0..3 {
        let of = |m: LfrBlocks| Lfr::new(m, deltas.to_vec(), range.clone(), clock()).unwrap();
        let truth = of(blocks(INSIDE, 2, 4, seed));
        let other = of(perturbed(truth.blocks(), 0.05, seed + 50));
        let most = sampled(&other, &truth, &range.grid(41), &lines(20));
        let found = difference_bound(&other, &truth, &lines(20), &settings()).unwrap();
        assert!(
            most <= found.bound && found.bound <= 1.4 * most,
            "seed {seed}: {most} {found:?}"
        );
    }
}

/// A mode whose stiffness is `omega^2 (1 + move delta)`, damping `zeta`.
fn mode(omega: f64, zeta: f64, shift: f64) -> Candidate<Continuous> {
    let a = dmatrix![0.0, 1.0; -omega * omega, -2.0 * zeta * omega];
    let local = StateSpace::new(
        a,
        dmatrix![0.0; 1.0],
        dmatrix![1.0, 0.0],
        dmatrix![0.0],
        Continuous,
    )
    .unwrap();
    let none = RandomChannels { seed: 0, size: 0.0 };
    let start = Candidate::flexible(&local, None, &one_parameter(1), interval(), none).unwrap();
    let lfr = start.to_lfr().unwrap();
    let blocks = LfrBlocks {
        b1: dmatrix![0.0; -shift * omega * omega],
        c1: dmatrix![1.0, 0.0],
        d11: dmatrix![0.0],
        d12: dmatrix![0.0],
        ..lfr.blocks().clone()
    };
    Candidate::new(
        &blocks,
        start.free().clone(),
        start.channels().to_vec(),
        interval(),
        Continuous,
    )
    .unwrap()
}

#[test]
fn a_fitted_model_is_supported_between_its_positions() {
    let truth = mode(2.0, 0.1, 0.1);
    let positions: Vec<f64> = (0..9).map(|i| 1.0 + 0.25 * f64::from(i)).collect();
    let data = relative(&truth, &positions, 60);
    let fitted = refine(&truth, &data, &RefineSettings::default()).unwrap();
    let between = bound_between(&fitted.candidate, &data, &settings()).unwrap();
    assert_eq!(between.intervals.len(), 8);
    assert!(between.warnings.is_empty(), "{:?}", between.warnings);
    for interval in &between.intervals {
        assert!(
            interval.largest <= interval.bound && interval.bound < 1e-5,
            "{interval:?}"
        );
        assert!(interval.shift < 0.5 && interval.from[0] < interval.to[0]);
    }
    assert_eq!(between.left_out_rms.iter().filter(|r| r.is_none()).count(), 2);
    // Noise: the two halves differ by about what it leaves open, and that is said.
    let mut rng = rng(3);
    let mut noisy = responses(&truth, &positions, 60);
    for (_, frf) in &mut noisy {
        for k in 0..frf.len() {
            let size = 0.02 * frf.line(k).norm();
            frf.line_slice_mut(k).iter_mut().for_each(|v| {
                *v += Complex::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0)) * size
            });
        }
    }
    let data = FrozenData::relative(clock(), &noisy).unwrap();
    let fitted = refine(&truth, &data, &RefineSettings::default()).unwrap();
    let between = bound_between(&fitted.candidate, &data, &settings()).unwrap();
    let error = largest_error(&fitted.candidate, &truth);
    let bound = between.intervals.iter().map(|i| i.bound).fold(0.0, f64::max);
    assert!(bound > 1e-4 && bound < 0.2, "{bound}");
    assert!(error < 2.0 * bound, "{error} {bound}");
}

/// A narrow mode that moves by several half-widths between positions.
#[test]
fn a_coarse_grid_is_said() {
    let truth = mode(2.0, 0.01, 0.3);
    let data = relative(&truth, &[1.0, 1.5, 2.0, 2.5, 3.0], 60);
    let between = bound_between(&truth, &data, &settings()).unwrap();
    assert!(
        between.intervals.iter().all(|i| i.shift > 1.0),
        "{:?}",
        between.intervals
    );
    let coarse = between.warnings.iter().filter(
        |w| matches!(w, BetweenWarning::Coarse { frequency_hz, .. } if (frequency_hz - 0.32).abs() < 0.06),
    );
    assert_eq!(coarse.count(), 4);
}

/// One position of a machine that does something else there: its neighbours do not predict it.
#[test]
fn a_position_that_its_neighbours_do_not_predict() {
    let (truth, odd) = (mode(2.0, 0.1, 0.1), mode(2.15, 0.1, 0.1));
    let positions: Vec<f64> = (0..9).map(|i| 1.0 + 0.25 * f64::from(i)).collect();
    let mut all: Vec<(Vec<f64>, Frf)> = responses(&truth, &positions, 60);
    all[3].1 = odd.response(&[positions[3]], &lines(60));
    let data = FrozenData::relative(clock(), &all).unwrap();
    // A model with enough deltas to follow.
    let wide = Candidate::flexible(
        &truth.frozen(&[2.0]).unwrap(),
        None,
        &one_parameter(4),
        interval(),
        RandomChannels { seed: 1, size: 0.05 },
    )
    .unwrap();
    let fitted = refine(&wide, &data, &RefineSettings::default()).unwrap();
    let between = bound_between(&fitted.candidate, &data, &settings()).unwrap();
    let predicted = |w: &BetweenWarning| matches!(w, BetweenWarning::NotPredicted { position: 3, .. });
    assert!(between.warnings.iter().any(predicted), "{between:?}");
    // Nor do they determine the model beside it.
    let beside = &between.intervals[2..4];
    assert!(beside.iter().all(|i| i.bound > 0.3), "{between:?}");
}

#[test]
fn what_does_not_fit_is_refused() {
    let truth = mode(2.0, 0.1, 0.1);
    let data = relative(&truth, &[1.0, 2.0, 3.0], 20);
    assert!(matches!(
        bound_between(&truth, &data, &settings()),
        Err(RealizeError::Fit(FitError::Empty { .. }))
    ));
    let lfr = truth.to_lfr().unwrap();
    assert!(matches!(
        difference_bound(&lfr, &lfr, &[], &settings()),
        Err(RealizeError::Fit(FitError::Empty { what: "lines" }))
    ));
    let other = continuous(1, 1).to_lfr().unwrap();
    assert!(matches!(
        difference_bound(&lfr, &other, &[0.1], &settings()),
        Err(RealizeError::Fit(FitError::Core(CoreError::Dimension { .. })))
    ));
    let narrow = Lfr::new(
        lfr.blocks().clone(),
        one_parameter(1),
        SchedulingRange::interval(1.0, 2.0).unwrap(),
        Continuous,
    )
    .unwrap();
    assert!(matches!(
        difference_bound(&lfr, &narrow, &[0.1], &settings()),
        Err(RealizeError::Fit(FitError::Core(CoreError::OutsideRange { .. })))
    ));
    for (name, settings) in [
        (
            "tolerance",
            BoundSettings {
                tolerance: 0.0,
                ..BoundSettings::default()
            },
        ),
        (
            "floor",
            BoundSettings {
                floor: -1.0,
                ..BoundSettings::default()
            },
        ),
        (
            "max_cells",
            BoundSettings {
                max_cells: 0,
                ..BoundSettings::default()
            },
        ),
        (
            "lines",
            BoundSettings {
                lines: 0,
                ..BoundSettings::default()
            },
        ),
        (
            "iterations",
            BoundSettings {
                iterations: 0,
                ..BoundSettings::default()
            },
        ),
    ] {
        assert!(matches!(settings.check(), Err(FitError::Setting { name: n, .. }) if n == name));
    }
}
