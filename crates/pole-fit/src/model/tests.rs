//! Every derivative against a finite difference.

use super::*;
use crate::search::tangent;
use crate::{Integrators, PoleFitSettings};
use lpv_core::{Discrete, Frf, FrfEstimate};

/// Three outputs, two inputs, two conjugate pairs, `m` integrators; full covariance that varies from line to line.
fn estimate(m: usize, error: f64) -> FrfEstimate {
    // More than two blocks.
    let frequencies: Vec<f64> = (1..150).map(|k| k as f64 / 320.0).collect();
    let mut values = Vec::new();
    let (mut c_v, mut s) = (Vec::new(), Vec::new());
    for (k, f) in frequencies.iter().enumerate() {
        let z = C64::from_polar(1.0, std::f64::consts::TAU * f);
        let a = (z * z - z * 1.6 + 0.9) * (z * z - z * 0.5 + 0.8) * (z - 1.0).powu(m as u32);
        for c in 0..6 {
            let b = z * z * (1.0 + c as f64) - z * (0.3 * c as f64) + 0.5;
            let wiggle = C64::new((7.0 * c as f64 + k as f64).sin(), (3.0 * k as f64).cos());
            values.push(b / a + wiggle * error);
        }
        let w = DMatrix::from_fn(3, 3, |i, j| {
            C64::new((1 + i + 2 * j + k) as f64, (k * i) as f64).sin().conj() / 20.0
        });
        let unit = DMatrix::<C64>::identity(3, 3);
        let root = w.map(|v| v / (1.0 + v.norm())) + &unit;
        c_v.extend((&root * root.adjoint()).iter().copied());
        let g = DMatrix::from_fn(2, 2, |i, j| C64::new((i + j) as f64 - 0.6, 0.3 * f));
        s.extend((g.adjoint() * g).iter().copied());
    }
    let frf = Frf::new(frequencies, 3, 2, values).unwrap();
    FrfEstimate::new(frf, c_v, s, f64::INFINITY, None).unwrap()
}

fn with_setup(m: usize, error: f64, check: impl Fn(&Setup<'_>, &Basis)) {
    let settings = PoleFitSettings {
        integrators: Integrators::Fixed(m),
        ..PoleFitSettings::new(4 + m)
    };
    let clock = Discrete::new(1.0).unwrap();
    let lines = Lines::new(&estimate(m, error), clock, &settings).unwrap();
    assert_eq!(lines.diagonal_fallbacks, 0);
    assert_eq!(lines.coupled.len(), 15);
    let setup = Setup::new(&lines, 4 + m, m, 5 + m);
    let basis = setup.basis(&vec![C64::new(1.0, 0.0); lines.len()]).unwrap();
    check(&setup, &basis);
}

#[test]
fn gradient_meets_finite_differences() {
    for m in [0, 2] {
        with_setup(m, 0.1, |setup, basis| {
            let alpha = DVector::from_vec(vec![0.5, -0.3, 0.2, 0.7, 0.9]);
            let point = Point::new(setup, basis, alpha.clone()).unwrap();
            let gradient = point.gradient(setup, basis, &point.model(setup));
            for j in 0..5 {
                let at = |h: f64| {
                    let mut moved = alpha.clone();
                    moved[j] += h;
                    Point::new(setup, basis, moved).unwrap().cost
                };
                let difference = (at(1e-5) - at(-1e-5)) / 2e-5;
                let error = (2.0 * gradient[j] - difference).abs();
                assert!(error < 1e-6 * gradient.norm(), "m {m} j {j}: {error:e}");
            }
        });
    }
}

#[test]
fn gauss_newton_matrix_meets_finite_differences_of_the_residual() {
    // At a residual of zero the change of the residual with re-optimised numerators is the reduced Jacobian.
    for m in [0, 1] {
        with_setup(m, 0.0, |setup, basis| {
            let lines = setup.lines;
            let truth: Vec<C64> = lines
                .z
                .iter()
                .map(|z| (z * z - z * 1.6 + 0.9) * (z * z - z * 0.5 + 0.8))
                .collect();
            let alpha = basis.project(5, &truth).normalize();
            let point = Point::new(setup, basis, alpha.clone()).unwrap();
            assert!(point.cost < 1e-18, "cost {:e}", point.cost);
            let reduced = point.reduce(setup, basis, &point.model(setup)).unwrap();
            let q = tangent(&alpha);
            assert!((q.tr_mul(&q) - DMatrix::identity(4, 4)).norm() < 1e-14);
            assert!(q.tr_mul(&alpha).norm() < 1e-14);
            let h = 1e-5;
            let change = |d: usize| -> Columns {
                let at = |h: f64| {
                    let moved = &alpha + q.column(d) * h;
                    Point::new(setup, basis, moved).unwrap().residual
                };
                let (ahead, back) = (at(h), at(-h));
                let pairs = ahead.parts().iter().zip(back.parts());
                Columns::from_parts(lines.len(), pairs.map(|(x, y)| (x - y) / (2.0 * h)).collect())
            };
            let changes: Vec<Columns> = (0..4).map(change).collect();
            let expected = DMatrix::from_fn(4, 4, |i, j| {
                let mut weighted = changes[j].clone();
                lines.weighted(&changes[j], &mut weighted);
                dot(changes[i].parts(), weighted.parts())
            });
            let found = q.tr_mul(&reduced.m) * &q;
            let error = (&found - &expected).norm() / expected.norm();
            assert!(error < 1e-6, "m {m}: {error:e}\n{found}{expected}");
        });
    }
}

#[test]
fn numerators_leave_a_residual_without_projection() {
    with_setup(1, 0.3, |setup, basis| {
        let alpha = DVector::from_vec(vec![0.1, 0.2, -0.4, 0.3, 0.8]);
        let point = Point::new(setup, basis, alpha).unwrap();
        for c in 0..6 {
            let mut x = Columns::zeros(setup.lines.len(), 1);
            conjugate_product(point.over_ta.column(0), point.weighted.column(c), x.column_mut(0));
            let scale: f64 = (0..setup.lines.len()).map(|k| x.at(k, 0).norm()).sum();
            assert!(basis.correlate(setup.n_b, &x).amax() < 1e-12 * scale);
        }
    });
}
