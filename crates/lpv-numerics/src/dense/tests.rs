use super::*;
use crate::test_kit::{random, rng};

#[test]
fn a_triangle_keeps_the_products_of_all_blocks() {
    let all = random(50, 6, &mut rng(1));
    let blocks: Vec<DMatrix<f64>> = [(0, 20), (20, 3), (23, 27)]
        .map(|(from, rows)| all.rows(from, rows).into_owned())
        .to_vec();
    let mut triangle = Triangle::new(6, 27);
    for block in &blocks {
        for j in 0..6 {
            triangle.column_mut(j)[..block.nrows()].copy_from_slice(block.column(j).as_slice());
        }
        triangle.absorb(block.nrows());
    }
    let expected = all.transpose() * &all;
    for r in [triangle.factor(), triangle_of(6, blocks.iter())] {
        assert!((r.transpose() * &r - &expected).amax() < 1e-13);
        assert!((0..6).all(|j| (j + 1..6).all(|i| r[(i, j)] == 0.0)));
    }
}

#[test]
fn complements_are_orthonormal_and_orthogonal() {
    let mut rng = rng(2);
    // Rank 3 of 5 columns; more columns than rows; nothing at all.
    let low = random(9, 3, &mut rng) * random(3, 5, &mut rng);
    for (columns, left) in [
        (low, 6),
        (random(4, 7, &mut rng), 0),
        (random(40, 21, &mut rng), 19),
        (DMatrix::zeros(3, 2), 3),
        (DMatrix::zeros(3, 0), 3),
    ] {
        let basis = complement(&columns, 1e-10);
        assert_eq!(basis.ncols(), left);
        let gram = basis.transpose() * &basis;
        assert!((gram - DMatrix::identity(left, left)).norm() < 1e-13);
        assert!((basis.transpose() * columns).norm() < 1e-12);
    }
}

#[test]
fn singular_vectors_of_tall_and_wide_matrices() {
    let mut rng = rng(3);
    for (rows, columns) in [(9, 4), (4, 4), (3, 7)] {
        let m = random(rows, columns, &mut rng);
        let (values, vectors) = right_singular(&m).unwrap();
        let square = m.transpose() * &m;
        let again = &vectors * DMatrix::from_diagonal(&values.map(|v| v * v)) * vectors.transpose();
        assert!((square - again).amax() < 1e-13);
        assert!(values.as_slice().is_sorted_by(|a, b| a >= b) && values.len() == columns);
    }
}
