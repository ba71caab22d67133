//! The paper's sizes, the frozen identity, the refusals.

use lfr_realize::{RealizeError, realize};
use lpv_core::nalgebra::{DMatrix, DVector, dmatrix};
use lpv_core::{
    BasisKind, Discrete, FunctionBasis, MatrixFunction, SchedulingRange, SeriesExpansion, StateSpace,
    WellPosedness,
};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn random(rows: usize, columns: usize, rng: &mut ChaCha8Rng) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |_, _| rng.random_range(-1.0..1.0))
}

/// A bank of `functions` first-order filters, and two double integrators.
fn series(functions: usize, basis: BasisKind, seed: u64) -> SeriesExpansion {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let clock = Discrete::new(0.05).unwrap();
    let poles = DVector::from_fn(functions, |i, _| 0.9 - 0.05 * i as f64);
    let bank = StateSpace::new(
        DMatrix::from_diagonal(&poles),
        DMatrix::from_element(functions, 1, 1.0),
        DMatrix::identity(functions, functions),
        DMatrix::zeros(functions, 1),
        clock,
    )
    .unwrap();
    let axis = StateSpace::new(
        dmatrix![1.0, 1.0; 0.0, 1.0],
        dmatrix![1.0; 2.0],
        dmatrix![1.0, 0.0],
        dmatrix![0.0],
        clock,
    )
    .unwrap();
    let basis = FunctionBasis::new(basis).unwrap();
    let weights = (0..basis.len())
        .map(|_| random(2, 2 * functions, &mut rng))
        .collect();
    SeriesExpansion::new(
        axis.beside(&axis).unwrap(),
        bank,
        MatrixFunction::constant(DMatrix::zeros(2, 2)).unwrap(),
        MatrixFunction::new(basis, weights).unwrap(),
        SchedulingRange::interval(-0.3, 0.3).unwrap(),
    )
    .unwrap()
}

fn chebyshev(degree: usize) -> BasisKind {
    BasisKind::Chebyshev {
        degree,
        range: SchedulingRange::interval(-0.3, 0.3).unwrap(),
    }
}

#[test]
fn the_size_of_the_paper() {
    let made = realize(&series(16, chebyshev(17), 1)).unwrap();
    assert_eq!((made.lfr.states(), made.lfr.delta_count()), (36, 34));
    assert!(matches!(made.well_posedness, WellPosedness::Proven { .. }));
    let difference = made
        .largest_difference(&[-0.3, -0.11, 0.0, 0.07, 0.3], &[0.01, 0.5, 2.0, 9.9])
        .unwrap();
    assert!(difference < 1e-10, "{difference}");
}

#[test]
fn splines_are_refused_with_the_way_round() {
    let knots = vec![-0.3, -0.1, 0.1, 0.3];
    let refused = realize(&series(3, BasisKind::Spline { knots }, 1)).unwrap_err();
    assert_eq!(refused, RealizeError::NotPolynomial { basis: "spline" });
    assert!(refused.to_string().contains("Chebyshev"));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn lfr_and_expansion_answer_alike_when_p_moves(functions in 1_usize..6, degree in 0_usize..6, seed in 0_u64..99) {
        let made = realize(&series(functions, chebyshev(degree), seed)).unwrap();
        prop_assert!(made.lfr.delta_count() <= 2 * degree);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let u = random(2, 40, &mut rng);
        let p = random(1, 40, &mut rng) * 0.3;
        let x0 = DVector::zeros(made.lfr.states());
        let y = made.state_space.simulate(&x0, &u, &p).unwrap().outputs;
        let error = (made.lfr.simulate(&x0, &u, &p).unwrap().outputs - &y).amax();
        prop_assert!(error < 1e-11 * y.amax());
    }

    #[test]
    fn wild_positions_and_frequencies_are_refused(p in any::<f64>(), f in any::<f64>()) {
        let made = realize(&series(2, chebyshev(2), 5)).unwrap();
        let inside = (-0.3..=0.3).contains(&p) && f > 0.0 && f <= 10.0;
        // Near zero frequency the integrators overflow: refused or not, but never a panic.
        let result = made.largest_difference(&[p], &[f]);
        prop_assert!(inside || result.is_err());
        prop_assert!(!inside || f < 1e-3 || result.is_ok());
    }
}
