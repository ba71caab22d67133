//! The functions against formulas and identities.
use lpv_core::nalgebra::{DMatrix, DVector};
use lpv_core::{Discrete, ResponseKernel, StateSpace};
use num_complex::{Complex, c64};
use obf_basis::{OrthonormalBasis, PoleSet, PoleUnit, kolmogorov_cost_db, pseudo_hyperbolic_distance};
use proptest::prelude::*;

fn clock() -> Discrete {
    Discrete::new(0.05).unwrap()
}

fn response(system: &StateSpace<Discrete>, z: Complex<f64>) -> Vec<Complex<f64>> {
    let mut out = vec![c64(0.0, 0.0); system.outputs()];
    ResponseKernel::new(system)
        .unwrap()
        .evaluate(&[z], &mut out)
        .unwrap();
    out
}

fn on_circle(angle: f64) -> Complex<f64> {
    Complex::from_polar(1.0, angle)
}

fn units(most: usize, radius: f64) -> impl Strategy<Value = PoleSet> {
    let unit = prop_oneof![
        (-radius..radius).prop_map(PoleUnit::Real),
        (0.0..radius, 0.0..std::f64::consts::PI)
            .prop_map(|(r, t)| PoleUnit::Pair(c64(r * t.cos(), r * t.sin().abs()))),
    ];
    prop::collection::vec(unit, 1..most).prop_map(|u| PoleSet::from_units(u).unwrap())
}

#[test]
fn pole_zero_gives_pulses() {
    let basis = OrthonormalBasis::laguerre(0.0, 4, clock()).unwrap();
    let z = on_circle(0.7);
    for (i, phi) in response(basis.state_space(), z).iter().enumerate() {
        assert!((phi - z.powi(-(i as i32 + 1))).norm() < 1e-14);
    }
}

#[test]
fn laguerre_and_kautz_meet_their_formulas() {
    let (a, z) = (0.6, on_circle(0.9));
    let laguerre = OrthonormalBasis::laguerre(a, 5, clock()).unwrap();
    for (i, phi) in response(laguerre.state_space(), z).iter().enumerate() {
        let formula = (1.0 - a * a).sqrt() / (z - a) * ((1.0 - a * z) / (z - a)).powi(i as i32);
        assert!((phi - formula).norm() < 1e-13);
    }
    // Kautz functions with b = 2 Re(l) / (1 + |l|^2), c = -|l|^2 (Wahlberg 1994), in the order of the states.
    let l = c64(0.5, -0.6);
    let kautz = OrthonormalBasis::kautz(l, 3, clock()).unwrap();
    assert_eq!(kautz.functions(), 6);
    let (b, c) = (2.0 * l.re / (1.0 + l.norm_sqr()), -l.norm_sqr());
    let denominator = z * z + z * (b * (c - 1.0)) - c;
    let all_pass = (1.0 + z * (b * (c - 1.0)) - z * z * c) / denominator;
    for (i, phi) in response(kautz.state_space(), z).chunks(2).enumerate() {
        let scale = (1.0 - c * c).sqrt() * all_pass.powi(i as i32) / denominator;
        assert!((phi[0] - scale * (z - b)).norm() < 1e-12);
        assert!((phi[1] - scale * (1.0 - b * b).sqrt()).norm() < 1e-12);
    }
}

proptest! {
    #[test]
    fn the_state_is_orthonormal(poles in units(8, 0.999)) {
        let basis = OrthonormalBasis::takenaka_malmquist(&poles, clock()).unwrap();
        let (system, inner) = (basis.state_space(), basis.inner_function());
        let (a, b, n) = (system.a(), system.b(), poles.len());
        prop_assert_eq!(system.states(), n);
        prop_assert!((a * a.transpose() + b * b.transpose() - DMatrix::identity(n, n)).amax() < 1e-12);
        prop_assert!((a.transpose() * a + inner.c().transpose() * inner.c() - DMatrix::identity(n, n)).amax() < 1e-12);
    }

    #[test]
    fn the_gram_matrix_on_the_circle_is_the_identity(poles in units(5, 0.9)) {
        let basis = OrthonormalBasis::takenaka_malmquist(&poles, clock()).unwrap();
        let n = poles.len();
        let mut kernel = ResponseKernel::new(basis.state_space()).unwrap();
        let mut gram = DMatrix::from_element(n, n, c64(0.0, 0.0));
        let mut phi = DVector::from_element(n, c64(0.0, 0.0));
        // The trapezoidal rule on the circle is exact up to |pole|^points.
        let points = 1024;
        for k in 0..points {
            let angle = std::f64::consts::TAU * f64::from(k) / f64::from(points);
            prop_assert!(kernel.evaluate(&[on_circle(angle)], phi.as_mut_slice()).is_ok());
            gram += &phi * phi.adjoint() / c64(f64::from(points), 0.0);
        }
        for i in 0..n {
            for j in 0..n {
                prop_assert!((gram[(i, j)] - f64::from(u8::from(i == j))).norm() < 1e-9);
            }
        }
    }

    #[test]
    fn real_poles_meet_the_takenaka_malmquist_formula(
        a in prop::collection::vec(-0.95..0.95f64, 1..7), angle in 0.0..std::f64::consts::PI,
    ) {
        let poles = PoleSet::from_units(a.iter().map(|&a| PoleUnit::Real(a)).collect()).unwrap();
        let basis = OrthonormalBasis::takenaka_malmquist(&poles, clock()).unwrap();
        let z = on_circle(angle);
        let mut product = c64(1.0, 0.0);
        for (phi, &a) in response(basis.state_space(), z).iter().zip(&a) {
            let formula = product * (1.0 - a * a).sqrt() / (z - a);
            prop_assert!((phi - formula).norm() < 1e-11 * (1.0 + formula.norm()));
            product *= (1.0 - a * z) / (z - a);
        }
    }

    #[test]
    fn the_inner_function_is_all_pass_and_the_blaschke_product(poles in units(8, 0.99), angle in 0.0..std::f64::consts::TAU) {
        let basis = OrthonormalBasis::takenaka_malmquist(&poles, clock()).unwrap();
        let z = on_circle(angle);
        let inner = response(basis.inner_function(), z)[0];
        let formula: Complex<f64> = poles.as_slice().iter().map(|l| (1.0 - l.conj() * z) / (z - l)).product();
        prop_assert!((inner.norm() - 1.0).abs() < 1e-9);
        prop_assert!((inner - formula).norm() < 1e-9);
    }

    #[test]
    fn a_pole_loses_the_kappa_product_with_every_repetition(
        poles in units(4, 0.8), r in 0.3..0.9f64, t in 0.0..std::f64::consts::PI,
    ) {
        // <a^t, phi_i> = sum_t a^t x_i(t) = ((I - a A)^-1 B)_i; one more inner function multiplies it by G_b(1/a).
        let a = Complex::from_polar(r, t);
        let kappa: f64 = poles.as_slice().iter().map(|&l| pseudo_hyperbolic_distance(a, l)).product();
        let basis = OrthonormalBasis::hambo(&poles, 2, clock()).unwrap();
        let n = basis.functions();
        let m = DMatrix::from_fn(n, n, |i, j| f64::from(u8::from(i == j)) - a * basis.state_space().a()[(i, j)]);
        let b = basis.state_space().b().map(|v| c64(v, 0.0));
        let coefficients = m.lu().solve(&b).unwrap();
        let (first, second) = (coefficients.rows(0, n / 2).norm(), coefficients.rows(n / 2, n / 2).norm());
        prop_assert!((second - kappa * first).abs() < 1e-8 * (1.0 + first));
    }

    #[test]
    fn the_expansion_error_falls_at_the_rate_of_the_cost(
        basis_poles in units(4, 0.7),
        system in prop::collection::vec((0.1..0.9f64, 0.1..3.0f64, 0.3..2.0f64), 1..4),
    ) {
        // g(t) = sum_q Re(r_q a_q^t), error energy = |g|^2 - |coefficients|^2.
        let observed: Vec<_> = system.iter().map(|&(r, t, _)| Complex::from_polar(r, t)).collect();
        let rate = 10f64.powf(kolmogorov_cost_db(&basis_poles, &observed).unwrap() / 20.0);
        let basis = OrthonormalBasis::hambo(&basis_poles, 7, clock()).unwrap();
        let (n, block) = (basis.functions(), basis_poles.len());
        let mut coefficients = DVector::zeros(n);
        let mut bound = 0.0;
        for (&a, &(_, _, gain)) in observed.iter().zip(&system) {
            let m = DMatrix::from_fn(n, n, |i, j| f64::from(u8::from(i == j)) - a * basis.state_space().a()[(i, j)]);
            let b = basis.state_space().b().map(|v| c64(v, 0.0));
            let c = m.lu().solve(&b).unwrap();
            coefficients += DVector::from_fn(n, |i, _| gain * c[i].re);
            bound += gain / (1.0 - a.norm_sqr()).sqrt();
        }
        for repetitions in 0..7 {
            // Blocks after the first `repetitions` hold the error that a basis of that size leaves.
            let tail = coefficients.rows(repetitions * block, n - repetitions * block).norm();
            prop_assert!(tail <= bound * rate.powi(repetitions as i32) * (1.0 + 1e-9) + 1e-9);
        }
    }
}
