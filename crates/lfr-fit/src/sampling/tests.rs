use super::*;
use crate::test_kit::{random, rng};
use lpv_core::StateSpace;

fn continuous(scale: f64, seed: u64) -> (DMatrix<f64>, StateSpace<Continuous>) {
    let s = random(3 + 2, 3 + 2, &mut rng(seed)) * scale;
    let part = |at, size| s.view(at, size).into_owned();
    let system = StateSpace::new(
        part((0, 0), (3, 3)),
        part((0, 3), (3, 2)),
        part((3, 0), (2, 3)),
        part((3, 3), (2, 2)),
        Continuous,
    );
    (s, system.unwrap())
}

/// Norms of the generator from small to far above one, where the sample is divided into intervals.
const SCALES: [f64; 4] = [1e-3, 1.0, 6.0, 40.0];

#[test]
fn hold_is_that_of_the_core() {
    let clock = Discrete::new(0.3).unwrap();
    for scale in SCALES {
        let (s, system) = continuous(scale, 2);
        let sampled = Continuous.sample(&s, 3, clock, Derivative::Skip).unwrap();
        let expected = system.zero_order_hold(clock).unwrap();
        let largest = expected.a().amax().max(expected.b().amax());
        assert!((sampled.s.view((0, 0), (3, 3)) - expected.a()).amax() < 1e-12 * largest);
        assert!((sampled.s.view((0, 3), (3, 2)) - expected.b()).amax() < 1e-12 * largest);
        assert_eq!(sampled.s.rows(3, 2), s.rows(3, 2));
        assert!(sampled.chain.is_none());
    }
}

#[test]
fn derivative_meets_a_finite_difference() {
    let clock = Discrete::new(0.3).unwrap();
    let shape = Shape {
        states: 3,
        outputs: 2,
        inputs: 2,
    };
    for scale in SCALES {
        let (s, _) = continuous(scale, 5);
        let direction = random(5, 5, &mut rng(11)) * scale;
        let h = 1e-5 / scale.max(1.0);
        let at = |h: f64| {
            Continuous
                .sample(&(&s + &direction * h), 3, clock, Derivative::Skip)
                .unwrap()
                .s
        };
        let difference = (at(h) - at(-h)) / (2.0 * h);
        let chain = Continuous
            .sample(&s, 3, clock, Derivative::Compute)
            .unwrap()
            .chain;
        let column = DMatrix::from_column_slice(25, 1, direction.as_slice());
        let exact = apply_chain(chain.as_ref(), shape, column);
        let error = (DMatrix::from_column_slice(5, 5, exact.as_slice()) - &difference).amax();
        assert!(error < 1e-7 * difference.amax(), "{scale}: {error:e}");
    }
}

#[test]
fn discrete_models_are_taken_as_they_are() {
    let (s, _) = continuous(1.0, 1);
    let clock = Discrete::new(0.3).unwrap();
    let sampled = clock.sample(&s, 3, clock, Derivative::Compute).unwrap();
    assert_eq!(sampled.s, s);
    assert!(sampled.chain.is_none() && clock.agrees(clock).is_ok());
    assert!(clock.agrees(Discrete::new(0.31).unwrap()).is_err());
}

#[test]
fn what_is_too_stiff_or_not_finite_has_no_sample() {
    let clock = Discrete::new(1.0).unwrap();
    for bad in [1e5, f64::NAN, f64::INFINITY] {
        let s = DMatrix::from_element(2, 2, bad);
        assert!(Continuous.sample(&s, 1, clock, Derivative::Skip).is_none());
    }
}

/// The response of a partial fraction, and of double integrators, is that of the state space held by the core.
#[test]
fn fractions_and_integrators_are_those_of_the_hold() {
    let clock = Discrete::new(0.4).unwrap();
    let frequencies_hz = [0.1, 0.7, 1.2];
    for pole in [-0.3, -1e-9, 0.2] {
        let one = |v: f64| DMatrix::from_element(1, 1, v);
        let system = StateSpace::new(one(pole), one(1.0), one(1.0), one(0.0), Continuous).unwrap();
        let response = system
            .zero_order_hold(clock)
            .unwrap()
            .frequency_response(&frequencies_hz)
            .unwrap();
        for (k, f) in frequencies_hz.iter().enumerate() {
            let expected = response.line(k)[(0, 0)];
            let found = Continuous.partial_fraction(Complex::from(pole), clock.point(*f), clock);
            assert!((found - expected).norm() < 1e-12 * expected.norm());
            let sampled = Complex::from((pole * 0.4).exp());
            assert!((Continuous.pole_of_sampled(sampled, clock) - pole).norm() < 1e-15);
        }
    }
    let response = |a: DMatrix<f64>, c: DMatrix<f64>, f: f64| {
        let mut b = DMatrix::zeros(2, 1);
        b[1] = 3.0;
        let system = StateSpace::new(a, b, c, DMatrix::zeros(1, 1), clock).unwrap();
        system.frequency_response(&[f]).unwrap().line(0)[(0, 0)]
    };
    for f in frequencies_hz {
        let z = clock.point(f);
        let expected = (z + 1.0) / ((z - 1.0) * (z - 1.0)) * (3.0 * 0.08);
        let (a, c) = clock.double_integrators(1);
        assert!((response(a, c, f) - expected).norm() < 1e-13 * expected.norm());
        let (a, c) = Continuous.double_integrators(1);
        let s =
            lpv_core::linalg::from_blocks(&[&[&a, &DMatrix::from_column_slice(2, 1, &[0.0, 3.0])]]).unwrap();
        let held = Continuous.sample(&s, 2, clock, Derivative::Skip).unwrap().s;
        let system = StateSpace::new(
            held.view((0, 0), (2, 2)).into_owned(),
            held.view((0, 2), (2, 1)).into_owned(),
            c,
            DMatrix::zeros(1, 1),
            clock,
        );
        let found = system.unwrap().frequency_response(&[f]).unwrap().line(0)[(0, 0)];
        assert!((found - expected).norm() < 1e-13 * expected.norm());
    }
}

/// `F(s + rate)`, in discrete time `F(e^(rate T) z)`: 1 / (s + 2 + rate), 3 / (r z - 0.5) with r = e^(rate T).
#[test]
fn shifts_move_every_pole() {
    let clock = Discrete::new(0.5).unwrap();
    let mut m = DMatrix::from_row_slice(2, 3, &[-2.0, 1.0, 4.0, 1.0, 0.0, 5.0]);
    Continuous.shift(&mut m, 1, 0.7, clock);
    assert_eq!(m.as_slice(), [-2.7, 1.0, 1.0, 0.0, 4.0, 5.0]);
    let mut m = DMatrix::from_row_slice(2, 2, &[0.5, 3.0, 1.0, 0.0]);
    Discrete::shift(clock, &mut m, 1, 0.7, clock);
    let (r, z) = (0.35_f64.exp(), Complex::new(0.3, 0.8));
    let found = Complex::from(m[(0, 1)]) / (z - m[(0, 0)]);
    assert!((found - 3.0 / (r * z - 0.5)).norm() < 1e-14);
}

/// A chain of integrators at a clock that is very slow in its unit of time.
#[test]
fn a_slow_clock_takes_the_same_samples() {
    let with = |time: f64| {
        let mut s = random(6, 5, &mut rng(3));
        s.fill(0.0);
        s[(0, 1)] = 1.0;
        s.view_mut((2, 2), (2, 2))
            .copy_from(&nalgebra::dmatrix![-0.1, -3.0; 3.0, -0.1]);
        s[(1, 4)] = 2.0;
        s[(2, 4)] = 1.0;
        s[(4, 0)] = 1.0;
        s[(4, 2)] = 0.5;
        // Positions keep their unit, speeds and the mode's derivative take that of time.
        s.view_mut((2, 2), (2, 2)).scale_mut(1.0 / time);
        s[(1, 4)] /= time * time;
        s[(2, 4)] /= time;
        let clock = Discrete::new(0.2 * time).unwrap();
        Continuous.sample(&s, 4, clock, Derivative::Compute)
    };
    let plain = with(1.0).unwrap();
    for time in [1e6, 1e12, 1e-9] {
        let slow = with(time).unwrap();
        assert!((slow.s[(0, 4)] - plain.s[(0, 4)]).abs() < 1e-12 * plain.s[(0, 4)].abs());
        assert!((slow.s[(3, 3)] - plain.s[(3, 3)]).abs() < 1e-12);
        let (chain, expected) = (slow.chain.unwrap(), plain.chain.as_ref().unwrap());
        // Entry (0, 4) of the result by entry (1, 4) of the generator: rows and columns of four.
        let (at, by) = (4 * 4, 4 * 4 + 1);
        let scaled = chain[(at, by)] / (time * time);
        assert!(
            (scaled - expected[(at, by)]).abs() < 1e-10 * expected[(at, by)].abs(),
            "{time}"
        );
    }
}
