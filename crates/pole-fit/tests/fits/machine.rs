//! The default two-body machine, frozen at a position, and noise as its experiments give it.

use lpv_core::{Continuous, Discrete, Frf, FrfEstimate, StateSpace};
use nalgebra::DMatrix;
use num_complex::Complex;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

pub(crate) type C64 = Complex<f64>;

pub(crate) fn clock() -> Discrete {
    Discrete::from_rate(20.0).unwrap()
}

fn continuous(p: f64) -> StateSpace<Continuous> {
    let (m1, m2, j1, j2) = (12.0, 20.0, 0.25, 1.2);
    // Stiffness and damping for uncoupled modes at 1.45 and 2.00 with damping ratio 0.015 at p = 0.
    let (my, mr) = (m1 * m2 / (m1 + m2), j1 * j2 / (j1 + j2));
    let (wy, wr) = (std::f64::consts::TAU * 1.45, std::f64::consts::TAU * 2.0);
    let stiffness = DMatrix::from_diagonal(&nalgebra::dvector![my * wy * wy, mr * wr * wr]);
    let damping = DMatrix::from_diagonal(&nalgebra::dvector![0.03 * my * wy, 0.03 * mr * wr]);
    let e = nalgebra::dmatrix![1.0, 0.0; 0.0, 1.0; -1.0, 0.0; -p, -1.0];
    let inverse_mass = DMatrix::from_diagonal(&nalgebra::dvector![1.0 / m1, 1.0 / j1, 1.0 / m2, 1.0 / j2]);
    let k = &inverse_mass * &e * stiffness * e.transpose();
    let d = &inverse_mass * &e * damping * e.transpose();
    let rigid = nalgebra::dmatrix![m1 + m2, m1 * p; m1 * p, m1 * p * p + j1 + j2];
    let mut a = DMatrix::zeros(8, 8);
    a.view_mut((0, 4), (4, 4)).fill_with_identity();
    a.view_mut((4, 0), (4, 4)).copy_from(&-k);
    a.view_mut((4, 4), (4, 4)).copy_from(&-d);
    let mut force = DMatrix::zeros(4, 2);
    force.view_mut((2, 0), (2, 2)).copy_from(&rigid);
    let mut b = DMatrix::zeros(8, 2);
    b.view_mut((4, 0), (4, 2)).copy_from(&(inverse_mass * force));
    let mut c = DMatrix::zeros(2, 8);
    c[(0, 0)] = 1.0;
    c[(0, 1)] = -p;
    c[(1, 1)] = 1.0;
    StateSpace::new(a, b, c, DMatrix::zeros(2, 2), Continuous).unwrap()
}

pub(crate) fn sampled(p: f64) -> StateSpace<Discrete> {
    continuous(p).zero_order_hold(clock()).unwrap()
}

/// The four flexible poles in `z`, positive imaginary part first, lower mode first.
pub(crate) fn flexible_poles(p: f64) -> Vec<C64> {
    let mut upper: Vec<C64> = continuous(p)
        .poles()
        .unwrap()
        .into_iter()
        .filter(|s| s.im > 1.0)
        .collect();
    upper.sort_by(|a, b| a.norm().total_cmp(&b.norm()));
    upper
        .into_iter()
        .flat_map(|s| {
            let z = (s * 0.05).exp();
            [z, z.conj()]
        })
        .collect()
}

/// Lines from 0.5 to 4, `stride` times 20 / 32768 apart.
pub(crate) fn lines(stride: usize) -> Vec<f64> {
    (820..=6553)
        .step_by(stride)
        .map(|k| k as f64 * 20.0 / 32768.0)
        .collect()
}

pub(crate) fn response(p: f64, frequencies: &[f64]) -> Frf {
    sampled(p).frequency_response(frequencies).unwrap()
}

/// What `fit` sees of an experiment.
#[derive(Clone, Copy)]
pub(crate) enum Known {
    /// The covariance is exact.
    Exactly,
    /// It is the sample covariance with so many degrees of freedom.
    From(usize),
}

fn circular(rng: &mut ChaCha8Rng) -> C64 {
    let mut half = || -> f64 {
        let x: f64 = StandardNormal.sample(rng);
        x * 0.5f64.sqrt()
    };
    C64::new(half(), half())
}

/// `F + V G`: coloured correlated output noise with the deviations of the two sensors, and a full `G` that varies.
pub(crate) fn noisy(truth: &Frf, known: Known, level: f64, seed: u64) -> FrfEstimate {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut frf = truth.clone();
    let (mut covariance, mut factor) = (Vec::new(), Vec::new());
    let root = nalgebra::matrix![
        C64::new(3.33e-8, 0.0), C64::new(0.0, 0.0);
        C64::new(2e-7, 4e-7), C64::new(1.6e-6, 0.0)
    ] * C64::new(level, 0.0);
    for k in 0..truth.len() {
        let f = truth.frequencies_hz()[k];
        let colour = C64::new(1.0 + 0.2 * f, 0.0);
        let g = nalgebra::matrix![
            C64::new(1.0, 0.0), C64::new(0.8, 0.3 * f);
            C64::new(0.9, -0.2), C64::new(-1.0, 0.1)
        ] * C64::new(2000.0, 0.0);
        let mut draw = || {
            let v = nalgebra::Vector2::new(circular(&mut rng), circular(&mut rng));
            root * v * colour
        };
        let v = nalgebra::Matrix2::from_columns(&[draw(), draw()]);
        let error = v * g;
        for (x, e) in frf.line_slice_mut(k).iter_mut().zip(error.iter()) {
            *x += e;
        }
        let c = match known {
            Known::Exactly => root * root.adjoint() * colour * colour,
            Known::From(n) => {
                let mut sum = nalgebra::Matrix2::zeros();
                for _ in 0..n {
                    let v = draw();
                    sum += v * v.adjoint();
                }
                sum / C64::new(n as f64, 0.0)
            }
        };
        covariance.extend(c.iter().copied());
        factor.extend((g.adjoint() * g).iter().copied());
    }
    let degrees = match known {
        Known::Exactly => f64::INFINITY,
        Known::From(n) => n as f64,
    };
    FrfEstimate::new(frf, covariance, factor, degrees, None).unwrap()
}
