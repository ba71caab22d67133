//! Weights against the errors that they are for.

use super::*;
use crate::PoleFitSettings;
use crate::hermitian::cholesky;
use lpv_core::Frf;
use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use std::cmp::Ordering;

#[test]
fn whitened_errors_have_unit_covariance() {
    let (n, m, experiments) = (3, 2, 3);
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    let mut draw = |rows: usize, columns: usize| {
        DMatrix::from_fn(rows, columns, |_, _| {
            let x: f64 = StandardNormal.sample(&mut rng);
            let y: f64 = StandardNormal.sample(&mut rng);
            C64::new(x, y) * 0.5f64.sqrt()
        })
    };
    let root = draw(n, n);
    let g = draw(experiments, m);
    let frf = Frf::new(vec![0.1], n, m, vec![C64::new(1.0, 0.0); n * m]).unwrap();
    let c_v = (&root * root.adjoint()).iter().copied().collect();
    let s = (g.adjoint() * &g).iter().copied().collect();
    let estimate = FrfEstimate::new(frf, c_v, s, f64::INFINITY, None).unwrap();
    let settings = PoleFitSettings::new(1);
    let lines = Lines::new(&estimate, Discrete::new(1.0).unwrap(), &settings).unwrap();
    // K = L L^H: the whitened error is L^H vec(dF).
    let weight = DMatrix::from_fn(n * m, n * m, |c, d| {
        let pair = |c, d| lines.coupled.iter().position(|p| *p == (c, d)).unwrap();
        match c.cmp(&d) {
            Ordering::Equal => C64::from(lines.weight(0, c)),
            Ordering::Less => lines.coupling.at(0, pair(c, d)),
            Ordering::Greater => lines.coupling.at(0, pair(d, c)).conj(),
        }
    });
    let mut factor = weight.as_slice().to_vec();
    assert!(cholesky(n * m, &mut factor));
    let l = DMatrix::from_vec(n * m, n * m, factor).lower_triangle();
    let draws = 20_000;
    let mut sum = DMatrix::<C64>::zeros(n * m, n * m);
    for _ in 0..draws {
        let error = &root * draw(n, experiments) * &g;
        let whitened = l.adjoint() * DMatrix::from_column_slice(n * m, 1, error.as_slice());
        sum += &whitened * whitened.adjoint();
    }
    let distance = sum / C64::new(f64::from(draws), 0.0) - DMatrix::identity(n * m, n * m);
    let worst = distance.iter().map(|v| v.norm()).fold(0.0, f64::max);
    assert!(worst < 5.0 / f64::from(draws).sqrt(), "worst entry {worst}");
    // And the stated covariance is the inverse of the weight.
    let mut sigma = vec![ZERO; 36];
    lines.covariance(0, &mut sigma);
    let product = DMatrix::from_vec(6, 6, sigma) * weight;
    assert!((product - DMatrix::identity(6, 6)).norm() < 1e-8);
}

#[test]
fn smoothing_averages_the_covariance_and_multiplies_the_degrees_of_freedom() {
    let frf = Frf::new(vec![0.1, 0.2, 0.3], 1, 1, vec![C64::new(1.0, 0.0); 3]).unwrap();
    let c_v = [1.0, 2.0, 6.0].map(|v| C64::new(v, 0.0)).to_vec();
    let s = vec![C64::new(1.0, 0.0); 3];
    let estimate = FrfEstimate::new(frf, c_v, s, 10.0, None).unwrap();
    let settings = PoleFitSettings {
        smoothing_lines: 1,
        ..PoleFitSettings::new(1)
    };
    let lines = Lines::new(&estimate, Discrete::new(1.0).unwrap(), &settings).unwrap();
    for (k, mean) in [1.5, 3.0, 4.0].into_iter().enumerate() {
        assert!((lines.weight(k, 0) * mean - 1.0).abs() < 1e-9);
    }
    assert!((lines.degrees_of_freedom - 70.0 / 3.0).abs() < 1e-12);
}
