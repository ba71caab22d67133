use super::*;
use crate::test_kit::{candidate, clock, random, responses, rng, weighted};
use crate::{Channel, FrozenData};

const SHAPE: Shape = Shape {
    states: 3,
    outputs: 2,
    inputs: 2,
};

fn system(seed: u64) -> DMatrix<f64> {
    let mut rng = rng(seed);
    let mut s = random(5, 5, &mut rng) * 0.3;
    s.view_mut((0, 0), (3, 3)).fill_diagonal(0.4);
    s
}

/// Both weightings, data that the system does not fit.
fn data() -> [FrozenData; 2] {
    let own = candidate(clock(), [0.2, 0.5, -0.6], &[Channel::Parameter(0)], 4);
    let responses = responses(&own, 30);
    [
        FrozenData::relative(clock(), &responses).unwrap(),
        weighted(&responses, 0.1, 5),
    ]
}

/// By the definition, with whole matrices.
fn residual(s: &DMatrix<f64>, position: &Position, k: usize) -> DMatrix<C64> {
    let complex = |at, size: (usize, usize)| s.view(at, size).map(C64::from);
    let resolvent = DMatrix::<C64>::identity(3, 3) * position.z[k] - complex((0, 0), (3, 3));
    let x = resolvent.lu().solve(&complex((0, 3), (3, 2))).unwrap();
    let f = complex((3, 0), (2, 3)) * x + complex((3, 3), (2, 2));
    let error = f - position.frf.line(k);
    match &position.whitening {
        None => error * C64::from(position.scale[k]),
        Some(w) => {
            DMatrix::from_column_slice(2, 2, w.left(k)) * error * DMatrix::from_column_slice(2, 2, w.right(k))
        }
    }
}

#[test]
fn residuals_are_those_of_the_definition() {
    let s = system(1);
    for data in data() {
        for position in data.positions() {
            let squares = squared_residuals(&s, SHAPE, position, position.frf.values()).unwrap();
            for (k, square) in squares.iter().enumerate() {
                let expected = residual(&s, position, k).norm_squared();
                assert!((square - expected).abs() < 1e-12 * expected);
            }
        }
        let all: f64 = data.positions().iter().map(Position::energy).sum();
        let lines = data.positions()[0].z.len() * data.len();
        assert!(data.unit() != crate::ResidualUnit::Relative || (all - lines as f64).abs() < 1e-9);
    }
}

#[test]
fn jacobian_and_residual_meet_a_finite_difference() {
    let s = system(2);
    let entries: Vec<(usize, usize)> = (0..5).flat_map(|j| (0..5).map(move |i| (i, j))).collect();
    let direction = random(5, 5, &mut rng(9));
    for data in data() {
        let position = &data.positions()[2];
        let emphasis: Vec<f64> = (0..30).map(|k| 1.0 + 0.1 * k as f64).collect();
        let range = 7..19;
        let chunk = Chunk::new(
            &s,
            SHAPE,
            position,
            (position.frf.values(), &emphasis),
            range.clone(),
        )
        .unwrap();
        let exact =
            chunk.jacobian(&entries) * direction.clone().reshape_generic(nalgebra::Dyn(25), nalgebra::U1);
        let h = 1e-6;
        let n = range.len();
        for (at, k) in range.enumerate() {
            let side = |h: f64| residual(&(&s + &direction * h), position, k);
            let difference = (side(h) - side(-h)) * C64::from(emphasis[k] / (2.0 * h));
            let here = residual(&s, position, k) * C64::from(emphasis[k]);
            for (channel, expected) in difference.iter().enumerate() {
                let found = C64::new(exact[channel * 2 * n + at], exact[channel * 2 * n + n + at]);
                assert!(
                    (found - expected).norm() < 1e-7 * difference.norm(),
                    "{found} {expected}"
                );
                let plane = &chunk.residual[channel];
                let kept = C64::new(plane.re[at], plane.im[at]);
                assert!((kept - here[channel]).norm() < 1e-12 * here.norm());
            }
        }
    }
}

/// The triangle keeps all products of the projected columns and the residual.
#[test]
fn a_filled_triangle_is_the_factor_of_all_rows() {
    let s = system(3);
    let entries = [(0, 0), (1, 2), (4, 4), (2, 3)];
    let basis = random(4, 3, &mut rng(1));
    let data = &data()[1];
    let position = &data.positions()[0];
    let ones = vec![1.0; 30];
    let chunk = Chunk::new(&s, SHAPE, position, (position.frf.values(), &ones), 0..30).unwrap();
    let mut triangle = Triangle::new(4, chunk.rows());
    chunk.fill(&entries, &basis, &mut Vec::new(), &mut triangle);
    triangle.absorb(chunk.rows());
    let r = triangle.factor();
    let projected = chunk.jacobian(&entries) * basis;
    let products = r.transpose() * &r;
    assert!(
        (products.view((0, 0), (3, 3)) - projected.transpose() * &projected).amax() < 1e-10 * products.amax()
    );
    let squares = squared_residuals(&s, SHAPE, position, position.frf.values()).unwrap();
    assert!((products[(3, 3)] - squares.iter().sum::<f64>()).abs() < 1e-10 * products[(3, 3)]);
}
