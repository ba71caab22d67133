use super::*;
use crate::lanes::write_lines;
use num_complex::Complex;
use pulp::Scalar;

type C64 = Complex<f64>;
const ZERO: C64 = C64::new(0.0, 0.0);

fn c(re: f64, im: f64) -> C64 {
    C64::new(re, im)
}

fn lanes(values: &[C64]) -> Vec<ComplexLanes<Scalar>> {
    values.iter().copied().map(ComplexLanes::one).collect()
}

/// Gain and condition number of one line.
fn gain(inputs: usize, experiments: usize, u: &[C64], x: Option<&[C64]>) -> (Vec<C64>, f64) {
    let mut kernel = GainKernel::new(Scalar::new(), inputs, experiments);
    let [condition, ..] = kernel.compute(&lanes(u), x.map(lanes).as_deref());
    (kernel.gain().iter().map(|g| g.value()).collect(), condition)
}

#[test]
fn diagonal_experiments_by_hand() {
    // U = diag(2, 4j), X = I: A = U, G = diag(1/2, -j/4); orthogonal, so the condition number is 1.
    let u = [c(2.0, 0.0), ZERO, ZERO, c(0.0, 4.0)];
    let x = [c(1.0, 0.0), ZERO, ZERO, c(1.0, 0.0)];
    for instrument in [Some(&x[..]), None] {
        let (gain, condition) = gain(2, 2, &u, instrument);
        assert!((condition - 1.0).abs() < 1e-15);
        let expected = [c(0.5, 0.0), ZERO, ZERO, c(0.0, -0.25)];
        assert!(gain.iter().zip(expected).all(|(a, b)| (a - b).norm() < 1e-15));
    }
}

#[test]
fn dependent_experiments_are_singular() {
    let u = [c(1.0, 1.0), c(2.0, 0.0), c(2.0, 2.0), c(4.0, 0.0)];
    assert!(gain(2, 2, &u, None).1 > 1e12);
    assert_eq!(gain(2, 2, &[ZERO; 4], None).1, f64::INFINITY);
    assert_eq!(gain(2, 2, &[c(f64::NAN, 0.0); 4], None).1, f64::INFINITY);
}

#[test]
fn two_rows_are_inverted_as_by_elimination() {
    let left = [c(0.3, -0.2), c(0.9, 0.1), c(-0.5, 0.8), c(0.1, 0.4)];
    let mut work = [ZERO; 8];
    [work[0], work[1], work[4], work[5]] = left;
    (work[2], work[7]) = (c(1.0, 0.0), c(1.0, 0.0));
    let (mut one, mut other) = (lanes(&work), lanes(&work));
    cramer(&mut one);
    eliminate(&mut other, 2);
    for i in [2, 3, 6, 7] {
        let (one, other) = (one[i].value(), other[i].value());
        assert!((one - other).norm() < 1e-15, "{one} {other}");
    }
}

#[test]
fn gain_is_a_right_inverse_of_the_inputs() {
    // U G = U X^H (U X^H)^-1 = I for three experiments and two inputs.
    let u: Vec<C64> = (0..6)
        .map(|i| C64::from_polar(1.0 + i as f64, (i * i) as f64))
        .collect();
    let x: Vec<C64> = (0..6)
        .map(|i| C64::from_polar(1.0, 0.7 * i as f64 + 0.1 * (i * i) as f64))
        .collect();
    let (gain, condition) = gain(2, 3, &u, Some(&x));
    assert!(condition.is_finite());
    for i in 0..2 {
        for j in 0..2 {
            let sum: C64 = (0..3).map(|e| u[e * 2 + i] * gain[j * 3 + e]).sum();
            assert!((sum - if i == j { 1.0 } else { 0.0 }).norm() < 1e-12);
        }
    }
}

#[test]
fn residual_covariance_by_hand() {
    // y = f u + v with f = 2j, var u = 1, var v = 3: C = [4 + 3, 2j; -2j, 1].
    let cz = [c(7.0, 0.0), c(0.0, -2.0), c(0.0, 2.0), c(1.0, 0.0)];
    let mut out = lanes(&[ZERO]);
    let f = lanes(&[c(0.0, 2.0)]);
    residual_covariance(Scalar::new(), &lanes(&cz), &f, 1, 1, 0.5, &mut out);
    assert!((out[0].value() - 1.5).norm() < 1e-15);
}

#[test]
fn lines_side_by_side_are_as_one_by_one() {
    // Four inputs, another pivot in each lane: the same bits.
    let entry = |line: usize, i: usize| {
        let x = (line * 16 + i) as f64;
        C64::from_polar(1.0 + (3.7 * x).sin(), x * x)
    };
    struct Together<F>(F);
    impl<F: Fn(usize, usize) -> C64> pulp::WithSimd for Together<F> {
        type Output = Vec<(Vec<C64>, f64)>;
        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
            let part = |i: usize, of: fn(C64) -> f64| {
                Lanes::new(simd, std::array::from_fn(|line| of(self.0(line, i))))
            };
            let u: Vec<ComplexLanes<S>> = (0..16)
                .map(|i| ComplexLanes {
                    re: part(i, |z| z.re),
                    im: part(i, |z| z.im),
                })
                .collect();
            let mut kernel = GainKernel::new(simd, 4, 4);
            let conditions = kernel.compute(&u, None);
            let mut gains = vec![ZERO; 16 * S::F64_LANES];
            write_lines(kernel.gain(), &mut gains);
            let gains = gains.chunks_exact(16).map(<[C64]>::to_vec);
            gains.zip(conditions).collect()
        }
    }
    let check = |lanes: &str, all: Vec<(Vec<C64>, f64)>| {
        for (line, (found, condition)) in all.iter().enumerate() {
            let u: Vec<C64> = (0..16).map(|i| entry(line, i)).collect();
            let alone = gain(4, 4, &u, None);
            assert_eq!((found.clone(), *condition), alone, "{lanes}, line {line}");
        }
    };
    check("as here", pulp::Arch::new().dispatch(Together(entry)));
    #[cfg(target_arch = "x86_64")]
    {
        use pulp::x86::{V3, V4};
        match V3::try_new() {
            Some(simd) => check("four", Simd::vectorize(simd, Together(entry))),
            None => println!("skipped: no registers of four numbers"),
        }
        match V4::try_new() {
            Some(simd) => check("eight", Simd::vectorize(simd, Together(entry))),
            None => println!("skipped: no registers of eight numbers"),
        }
    }
}
