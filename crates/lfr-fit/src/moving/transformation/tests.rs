use super::*;

#[test]
fn basis_turns_by_g() {
    let mut transformation = StateTransformation::of_pairs(4, 2);
    transformation
        .coefficients
        .copy_from_slice(&[0.3, -0.2, 0.5, 0.1, 0.0, 0.4, -0.3, 0.2, 0.1, 0.1, 0.0, -0.2]);
    assert_eq!(transformation.basis(0.0), DMatrix::identity(4, 4));
    let h = 1e-4;
    let slope = (transformation.basis(0.6 + h) - transformation.basis(0.6 - h)) / (2.0 * h);
    let expected = -transformation.basis(0.6) * transformation.at(0.6);
    assert!((slope - expected).amax() < 1e-7);
}
