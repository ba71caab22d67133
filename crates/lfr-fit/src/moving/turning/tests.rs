use super::*;

#[test]
fn basis_turns_by_g() {
    let mut turning = Turning::of_pairs(4, 2);
    turning
        .coefficients
        .copy_from_slice(&[0.3, -0.2, 0.5, 0.1, 0.0, 0.4, -0.3, 0.2, 0.1, 0.1, 0.0, -0.2]);
    assert_eq!(turning.basis(0.0), DMatrix::identity(4, 4));
    let h = 1e-4;
    let slope = (turning.basis(0.6 + h) - turning.basis(0.6 - h)) / (2.0 * h);
    let expected = -turning.basis(0.6) * turning.at(0.6);
    assert!((slope - expected).amax() < 1e-7);
}
