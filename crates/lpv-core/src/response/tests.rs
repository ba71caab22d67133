use super::{Points, ResponseKernel};
use crate::{Continuous, StateSpace};
use nalgebra::{DMatrix, dmatrix};
use num_complex::Complex;
use pulp::Simd;

/// Every kind of register gives the response that the plain inverse gives.
#[test]
fn all_registers_agree() {
    let n = 9;
    let a = DMatrix::from_fn(n, n, |i, j| {
        ((3 * i + 5 * j) as f64).sin() - if i == j { 2.0 } else { 0.0 }
    });
    let b = DMatrix::from_fn(n, 2, |i, j| ((i + 7 * j) as f64).cos());
    let c = DMatrix::from_fn(2, n, |i, j| ((2 * i + j) as f64).sin());
    let d = dmatrix![0.1, 0.0; -0.2, 0.3];
    let system = StateSpace::new(a.clone(), b.clone(), c.clone(), d.clone(), Continuous).unwrap();
    let points: Vec<Complex<f64>> = (0..21).map(|k| Complex::new(0.0, 0.3 * f64::from(k))).collect();
    let complex = |m: &DMatrix<f64>| m.map(|v| Complex::new(v, 0.0));
    let exact: Vec<Complex<f64>> = points
        .iter()
        .flat_map(|z| {
            let gap = DMatrix::identity(n, n) * *z - complex(&a);
            let x = gap.lu().solve(&complex(&b)).unwrap();
            (complex(&c) * x + complex(&d)).as_slice().to_vec()
        })
        .collect();
    let check = |name: &str, run: &dyn Fn(Points<'_>) -> Result<(), usize>| {
        let mut kernel = ResponseKernel::new(&system).unwrap();
        let mut out = vec![Complex::new(0.0, 0.0); exact.len()];
        run(Points {
            kernel: &mut kernel,
            points: &points,
            out: &mut out,
        })
        .unwrap();
        for (o, e) in out.iter().zip(&exact) {
            assert!((o - e).norm() < 1e-11 * e.norm().max(1.0), "{name}: {o} {e}");
        }
    };
    check("scalar", &|p| Simd::vectorize(pulp::Scalar::new(), p));
    #[cfg(target_arch = "x86_64")]
    {
        if let Some(simd) = pulp::x86::V3::try_new() {
            check("AVX2", &|p| Simd::vectorize(simd, p));
        }
        if let Some(simd) = pulp::x86::V4::try_new() {
            check("AVX-512", &|p| Simd::vectorize(simd, p));
        }
    }
}

/// Near the double pole of a free body, coupled to another mode by a rotation of the states, the reduction alone loses half of the
/// digits.
#[test]
fn near_a_pole_nothing_is_lost() {
    let h = 1.0 / 128.0;
    // A free body and a resonance, sampled, with small integers for a rotation that is exact in binary.
    let apart = dmatrix![1.0, h, 0.0; 0.0, 1.0, 0.0; 0.0, 0.0, 0.5];
    let turn = dmatrix![1.0, 2.0, 0.0; 0.0, 1.0, 1.0; 1.0, 3.0, 2.0];
    let back = turn.clone().try_inverse().unwrap().map(f64::round);
    let a = &turn * &apart * &back;
    let (b, c) = (&turn * dmatrix![0.0; 1.0; 1.0], dmatrix![1.0, 0.0, 1.0] * &back);
    let system = StateSpace::new(a, b, c, dmatrix![0.0], Continuous).unwrap();
    let points: Vec<Complex<f64>> = (4..20).map(|k| 1.0 + Complex::new(0.0, 0.5f64.powi(k))).collect();
    let mut out = vec![Complex::new(0.0, 0.0); points.len()];
    ResponseKernel::new(&system)
        .unwrap()
        .evaluate(&points, &mut out)
        .unwrap();
    for (z, o) in points.iter().zip(&out) {
        let exact = h / (z - 1.0).powi(2) + 1.0 / (z - 0.5);
        assert!((o - exact).norm() < 1e-14 * exact.norm(), "{z}: {o} {exact}");
    }
}

/// Parts that do not reach each other, their states mixed, give the sum of their responses; so does one with more inputs than
/// states.
#[test]
fn parts_are_solved_for_apart() {
    let a = dmatrix![0.5, 0.0, 0.3; 0.0, -0.2, 0.0; -0.1, 0.0, 0.4];
    let (b, c) = (dmatrix![1.0, 2.0; -1.0, 0.5; 0.3, 0.7], dmatrix![1.0, 3.0, -2.0]);
    let system = StateSpace::new(a.clone(), b.clone(), c.clone(), dmatrix![0.0, 0.1], Continuous).unwrap();
    let z = Complex::new(0.3, 0.8);
    let mut out = vec![Complex::new(0.0, 0.0); 2];
    ResponseKernel::new(&system)
        .unwrap()
        .evaluate(&[z], &mut out)
        .unwrap();
    for j in 0..2 {
        let det = (z - 0.5) * (z - 0.4) + 0.03;
        let x0 = ((z - 0.4) * b[(0, j)] + 0.3 * b[(2, j)]) / det;
        let x2 = (-0.1 * b[(0, j)] + (z - 0.5) * b[(2, j)]) / det;
        let exact = x0 - 2.0 * x2 + 3.0 * b[(1, j)] / (z + 0.2) + [0.0, 0.1][j];
        assert!((out[j] - exact).norm() < 1e-14, "{j}: {} {exact}", out[j]);
    }
}

/// A chain of weak links, beside a loop that would hide them in its rounding: what feeds one way only is neither scaled nor turned.
#[test]
fn a_chain_keeps_its_numbers() {
    let n = 9;
    let mut a = DMatrix::zeros(n, n);
    for i in 1..6 {
        a[(i, i - 1)] = 1e-4;
    }
    // The last of the chain feeds a loop of three.
    for (i, j, v) in [(6, 5, 1e-3), (6, 8, 0.5), (7, 6, 0.25), (8, 7, -0.5), (6, 6, 0.1)] {
        a[(i, j)] = v;
    }
    let mut b = DMatrix::zeros(n, 1);
    b[0] = 1.0;
    let mut c = DMatrix::zeros(2, n);
    (c[(0, 5)], c[(1, 7)]) = (1.0, 1.0);
    let system = StateSpace::new(a, b, c, DMatrix::zeros(2, 1), Continuous).unwrap();
    let mut kernel = ResponseKernel::new(&system).unwrap();
    for k in 0..16 {
        let z = Complex::from_polar(1.0, 0.2 * f64::from(k));
        let mut out = vec![Complex::new(0.0, 0.0); 2];
        kernel.evaluate(&[z], &mut out).unwrap();
        let chain = 1e-20 * z.powi(-6);
        // x6 (z - 0.1) = 1e-3 x5 + 0.5 x8, x7 z = 0.25 x6, x8 z = -0.5 x7.
        let loop_ = 1e-3 * chain * 0.25 / z / (z - 0.1 + 0.0625 / (z * z));
        for (found, exact) in out.iter().zip([chain, loop_]) {
            assert!(
                (found - exact).norm() < 1e-14 * exact.norm(),
                "{z}: {found} {exact}"
            );
        }
    }
}

fn one(a: DMatrix<f64>, z: Complex<f64>) -> Result<Complex<f64>, usize> {
    let n = a.nrows();
    let (mut b, mut c) = (DMatrix::zeros(n, 1), DMatrix::zeros(1, n));
    (b[0], c[n - 1]) = (1.0, 1.0);
    let system = StateSpace::new(a, b, c, DMatrix::zeros(1, 1), Continuous).unwrap();
    let mut out = [Complex::new(0.0, 0.0)];
    let mut kernel = ResponseKernel::new(&system).unwrap();
    kernel.evaluate(&[z], &mut out).map(|()| out[0])
}

/// A ring with a weak link, which balancing makes a ring of equal ones: what the last state is, is hidden by the first.
#[test]
fn a_weak_link_hides_nothing() {
    for n in [3, 10, 30] {
        for weak in [1e-6, 1e-12, 1e-15] {
            let a = DMatrix::from_fn(n, n, |i, j| match (i, j) {
                (0, j) if j == n - 1 => weak,
                (i, j) if i == j + 1 => 1.0,
                _ => 0.0,
            });
            let z = Complex::from_polar(1.0, 0.3);
            let exact = 1.0 / (z.powi(n as i32) - weak);
            let error = (one(a, z).unwrap() - exact).norm();
            assert!(error < 1e-12, "{n}, {weak}: {error:e}");
        }
    }
}

/// Nearer and nearer to a pole that the reduction has moved: an error of some digits, then of all, but none that grows.
#[test]
fn corrections_that_do_not_correct_are_not_taken() {
    let a = dmatrix![1.0, -1.0, 0.0; -1.0, 2.0, -1.0; 0.0, -1.0, 1.0];
    for k in 20..52 {
        let z = Complex::from(1.0 + 0.5f64.powi(k));
        let exact = 1.0 / (z * (z - 1.0) * (z - 3.0));
        let error = one(a.clone(), z).map_or(1.0, |found| (found - exact).norm() / exact.norm());
        assert!(error < if k < 40 { 1e-9 } else { 64.0 }, "{k}: {error:e}");
    }
}

/// Inputs, outputs and states in units that differ by many powers of ten.
#[test]
fn units_do_not_count() {
    let n = 6;
    let plain = DMatrix::from_fn(n, n, |i, j| {
        ((3 * i + 5 * j) as f64).sin() - if i == j { 2.0 } else { 0.0 }
    });
    let unit = |i: usize| 10f64.powi(4 * (i as i32) - 8);
    let a = DMatrix::from_fn(n, n, |i, j| plain[(i, j)] * unit(j) / unit(i));
    let z = Complex::new(0.0, 1.5);
    let gap = DMatrix::identity(n, n) * z - plain.map(Complex::from);
    let exact = gap.try_inverse().unwrap()[(n - 1, 0)] * (unit(0) / unit(n - 1));
    assert!((one(a, z).unwrap() - exact).norm() < 1e-12 * exact.norm());
}

/// A response that no number holds is an error, as a pole is.
#[test]
fn what_overflows_is_an_error() {
    let system = StateSpace::new(
        dmatrix![-1.0],
        dmatrix![1e200],
        dmatrix![1e200],
        dmatrix![0.0],
        Continuous,
    );
    let mut kernel = ResponseKernel::new(&system.unwrap()).unwrap();
    let mut out = [Complex::new(0.0, 0.0)];
    assert_eq!(kernel.evaluate(&[Complex::new(0.0, 1.0)], &mut out), Err(0));
}

/// Triangular matrices, below whose diagonals something has been rounded: what is no more than that is not scaled up to the rest.
#[test]
fn fill_that_is_rounding_does_not_count() {
    let mut state = 1_u64;
    let mut number = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1_u32 << 30) - 1.0
    };
    for n in [3, 4, 6, 8] {
        for fill in [1e-15, 1e-17, 1e-18, 1e-30, 1e-40, 1e-200] {
            for _ in 0..50 {
                let a = DMatrix::from_fn(n, n, |i, j| match i > j {
                    true => fill * number(),
                    false => 0.1 * (10.0 * number()).round(),
                });
                let z = Complex::from_polar(1.0, 0.628);
                let gap = DMatrix::identity(n, n) * z - a.map(Complex::from);
                let all = gap.try_inverse().unwrap();
                let system = StateSpace::new(
                    a,
                    DMatrix::identity(n, n),
                    DMatrix::identity(n, n),
                    DMatrix::zeros(n, n),
                    Continuous,
                );
                let mut out = vec![Complex::new(0.0, 0.0); n * n];
                ResponseKernel::new(&system.unwrap())
                    .unwrap()
                    .evaluate(&[z], &mut out)
                    .unwrap();
                let found = DMatrix::from_column_slice(n, n, &out);
                let error = (&found - &all).norm() / all.norm();
                assert!(error < 1e-13, "{n}, {fill:e}: {error:e}");
            }
        }
    }
}
