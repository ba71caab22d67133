#![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]

use super::*;
use crate::frozen::{Closure, close};
use crate::test_kit::candidate;
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
    let mut weights = Weights::new(shape.states, shape.inputs, a);
    for line in [0, 3] {
        let ones = vec![num_complex::Complex::from(1.0); shape.outputs * shape.inputs * line];
        let lines = (0..line).map(|k| 0.1 + 0.2 * k as f64).collect();
        if let Ok(frf) = Frf::new(lines, shape.outputs, shape.inputs, ones) {
            weights.add(&shape.system(&s(&m, 0.0), Continuous).unwrap(), &frf);
        }
        let places = [-1.0, -0.4, 0.0, 0.5, 1.0];
        let samples = places.map(|d| s(&m, d));
        let expansion = Expansion::new(&places.map(|d| vec![d]), &samples, 2).unwrap();
        let found = expansion.channels(&weights, &channels).unwrap();
        let mut own = m.clone();
        own.view_mut((0, 0), (a, b)).copy_from(expansion.constant());
        own.view_mut((0, b), (a, 2)).copy_from(&found.left);
        own.view_mut((a, 0), (2, b)).copy_from(&found.right);
        own.view_mut((a, b), (2, 2)).copy_from(&found.inner);
        for delta in [-0.9, 0.1, 0.7] {
            let gap = s(&own, delta) - s(&m, delta);
            assert!(gap.amax() < 1e-9, "{gap}");
        }
    }
}
