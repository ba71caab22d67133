use super::*;
use crate::test_kit::{random, rng};

const SHAPE: Shape = Shape {
    states: 3,
    outputs: 2,
    inputs: 1,
};

#[test]
fn one_state_and_one_delta_by_hand() {
    // Rows x+, y, z; columns x, u, w.
    let m = DMatrix::from_row_slice(3, 3, &[0.5, 1.0, 0.2, 1.0, 0.0, 0.1, 2.0, 0.3, 0.4]);
    let shape = Shape {
        states: 1,
        outputs: 1,
        inputs: 1,
    };
    // K = 0.5 / (1 - 0.4 * 0.5) = 0.625.
    let frozen = close(&m, shape, &[0.5], Closure::Derivative).unwrap();
    let expected = DMatrix::from_row_slice(2, 2, &[0.75, 1.0375, 1.125, 0.01875]);
    assert!((frozen.s - expected).amax() < 1e-15);
    assert!((frozen.left[(0, 2)] - 0.125).abs() < 1e-15 && (frozen.right[(2, 0)] - 1.25).abs() < 1e-15);
    assert!(frozen.positive);
    // 1 - 0.4 * 2.5 = 0 has no solution, and beyond it the determinant is negative.
    assert!(close(&m, shape, &[2.5], Closure::Value).is_none());
    assert!(!close(&m, shape, &[3.0], Closure::Value).unwrap().positive);
}

#[test]
fn without_channels_nothing_is_closed() {
    let m = random(5, 4, &mut rng(3));
    let frozen = close(&m, SHAPE, &[], Closure::Derivative).unwrap();
    assert_eq!(frozen.s, m);
    assert_eq!(
        (frozen.left, frozen.right),
        (DMatrix::identity(5, 5), DMatrix::identity(4, 4))
    );
}

#[test]
fn derivative_meets_a_finite_difference() {
    let mut rng = rng(7);
    let m = random(5 + 3, 4 + 3, &mut rng) * 0.4;
    let delta = [1.0, -0.8, 0.6];
    let frozen = close(&m, SHAPE, &delta, Closure::Derivative).unwrap();
    for _ in 0..5 {
        let direction = random(8, 7, &mut rng);
        let h = 1e-5;
        let at = |h: f64| {
            close(&(&m + &direction * h), SHAPE, &delta, Closure::Value)
                .unwrap()
                .s
        };
        let difference = (at(h) - at(-h)) / (2.0 * h);
        let exact = &frozen.left * &direction * &frozen.right;
        assert!((difference - &exact).amax() < 1e-8 * exact.amax());
    }
}
