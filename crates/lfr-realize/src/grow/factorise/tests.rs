#![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]

use super::*;
use crate::frozen::{Closure, close};
use crate::test_kit::{candidate, clock};
use lpv_core::{Continuous, Frf};

/// With a nilpotent D11 the frozen system is a polynomial, `S_0 + L R delta + L D R delta^2`: two channels are found
/// again from S at five positions, and the weights do not matter.
#[test]
fn polynomials_are_realised_exactly() {
    let channels = [Channel::Parameter(0); 2];
    let truth = candidate(Continuous, [-1.0, -1.5, -2.0], &channels, 3);
    let (shape, mut m) = (truth.shape(), truth.matrix().clone());
    let (a, b) = (shape.rows(), shape.columns());
    let d11 = DMatrix::from_row_slice(2, 2, &[0.0, 0.6, 0.0, 0.0]);
    m.view_mut((a, b), (2, 2)).copy_from(&d11);
    let s = |m: &DMatrix<f64>, delta: f64| close(m, shape, &[delta; 2], Closure::Value).unwrap().s;
    let response = Frf::new(vec![0.1], 2, 2, vec![num_complex::Complex::from(1.0); 4]).unwrap();
    let coherent = Coherent {
        clock: Continuous,
        shape,
        range: truth.range().clone(),
        models: [-1.0, -0.4, 0.0, 0.5, 1.0].map(|d| (vec![d], s(&m, d))).to_vec(),
        row_weight: DVector::from_fn(a, |i, _| 1.0 + i as f64),
        column_weight: DVector::from_fn(b, |j, _| 3.0 / (1.0 + j as f64)),
        damped: FrozenData::relative(clock(), &[(vec![2.0], response)]).unwrap(),
        damping: 0.0,
    };
    let free = DMatrix::from_element(m.nrows(), m.ncols(), true);
    let found = coherent.factorised(truth.with_free(free).unwrap()).unwrap();
    for delta in [-0.9, 0.1, 0.7] {
        let gap = s(found.matrix(), delta) - s(&m, delta);
        assert!(gap.amax() < 1e-10, "{gap}");
    }
}
