//! From the frozen system to what the data see: zero-order hold, and its derivative.

use crate::shape::Shape;
use hold::{Derivative, Hold, Sampled};
use lpv_core::linalg::{balanced, from_blocks};
use lpv_core::{Clock, Continuous, CoreError, Discrete, StateSpace};
use nalgebra::DMatrix;
use num_complex::Complex;

/// A clock whose frozen models can be compared with sampled responses: [`Continuous`] by an exact zero-order hold,
/// [`Discrete`] as it is. No other crate can implement it.
pub trait Sampling: Clock + hold::Hold {}

/// A frozen model as the data see it; none where it is too fast for the clock.
///
/// # Errors
/// [`CoreError::DifferentClocks`] for a discrete model of another clock.
pub fn sampled<K: Sampling>(
    model: &StateSpace<K>,
    clock: Discrete,
) -> Result<Option<StateSpace<Discrete>>, CoreError> {
    model.clock().agrees(clock)?;
    let shape = Shape {
        states: model.states(),
        outputs: model.outputs(),
        inputs: model.inputs(),
    };
    let s = from_blocks(&[&[model.a(), model.b()], &[model.c(), model.d()]])?;
    let sampled = model.clock().sample(&s, shape.states, clock, Derivative::Skip);
    Ok(sampled.and_then(|sampled| shape.system(&sampled.s, clock).ok()))
}

impl Sampling for Continuous {}
impl Sampling for Discrete {}

pub(crate) mod hold {
    use lpv_core::{CoreError, Discrete};
    use nalgebra::DMatrix;
    use num_complex::Complex;

    /// What the crate needs of a clock.
    pub trait Hold: Sized {
        /// Refuses a model that ticks otherwise than the data.
        fn agrees(self, data: Discrete) -> Result<(), CoreError>;

        /// The sampled system `[A_d B_d; C D]`. None where it overflows, or is too stiff for the clock.
        fn sample(self, s: &DMatrix<f64>, states: usize, data: Discrete, want: Derivative)
        -> Option<Sampled>;

        /// Double integrators, one an axis: A and C for `B = [0; gamma]`. The sampled response is
        /// `gamma (T^2/2) (z + 1) / (z - 1)^2`, with each entry of gamma in one place.
        fn double_integrators(self, axes: usize) -> (DMatrix<f64>, DMatrix<f64>);

        /// The pole whose sampled value is `z`.
        fn pole_of_sampled(self, z: Complex<f64>, data: Discrete) -> Complex<f64>;

        /// The response of `1 / (pole of the model)`, sampled.
        fn partial_fraction(self, pole: Complex<f64>, z: Complex<f64>, data: Discrete) -> Complex<f64>;

        /// Turns `F(s)` into `F(s + rate)`: what every pole loses in damping or gains. `m` begins with the rows of
        /// `[A B]`; more columns that move the state may follow.
        fn shift(self, m: &mut DMatrix<f64>, states: usize, rate: f64, data: Discrete);

        /// How fast A moves the state: the unit of random channels.
        fn rate(self, a: &DMatrix<f64>) -> f64;
    }

    /// Whether [`Hold::sample`] gives the derivative too.
    #[derive(Clone, Copy, PartialEq)]
    pub enum Derivative {
        /// No.
        Skip,
        /// Yes.
        Compute,
    }

    /// The sampled system.
    pub struct Sampled {
        /// `[A_d B_d; C D]`.
        pub s: DMatrix<f64>,
        /// How each entry of `[A_d B_d]` (row) moves with each entry of `[A B]` (column), both column-major; none for the
        /// identity.
        pub chain: Option<DMatrix<f64>>,
    }
}

impl Hold for Discrete {
    fn agrees(self, data: Discrete) -> Result<(), CoreError> {
        let (first_nyquist_hz, second_nyquist_hz) = (self.nyquist_hz(), data.nyquist_hz());
        if (first_nyquist_hz - second_nyquist_hz).abs() > 1e-12 * first_nyquist_hz {
            return Err(CoreError::DifferentClocks {
                first_nyquist_hz,
                second_nyquist_hz,
            });
        }
        Ok(())
    }
    fn sample(self, s: &DMatrix<f64>, _: usize, _: Discrete, _: Derivative) -> Option<Sampled> {
        Some(Sampled {
            s: s.clone(),
            chain: None,
        })
    }
    fn double_integrators(self, axes: usize) -> (DMatrix<f64>, DMatrix<f64>) {
        // (T^2/2) (z + 1) / (z - 1)^2 = T^2 / (z - 1)^2 + (T^2/2) / (z - 1).
        let square = self.sample_time().powi(2);
        let mut a = DMatrix::identity(2 * axes, 2 * axes);
        a.view_mut((0, axes), (axes, axes)).fill_diagonal(1.0);
        let mut c = DMatrix::zeros(axes, 2 * axes);
        c.view_mut((0, 0), (axes, axes)).fill_diagonal(square);
        c.view_mut((0, axes), (axes, axes)).fill_diagonal(0.5 * square);
        (a, c)
    }
    fn pole_of_sampled(self, z: Complex<f64>, _: Discrete) -> Complex<f64> {
        z
    }
    fn partial_fraction(self, pole: Complex<f64>, z: Complex<f64>, _: Discrete) -> Complex<f64> {
        (z - pole).inv()
    }
    fn shift(self, m: &mut DMatrix<f64>, states: usize, rate: f64, data: Discrete) {
        // C (e^(rate T) z I - A)^-1 B.
        let mut state = m.rows_mut(0, states);
        state *= (-rate * data.sample_time()).exp();
    }
    fn rate(self, a: &DMatrix<f64>) -> f64 {
        (a - DMatrix::identity(a.nrows(), a.nrows())).norm() / (a.nrows().max(1) as f64).sqrt()
    }
}

impl Hold for Continuous {
    fn agrees(self, _: Discrete) -> Result<(), CoreError> {
        Ok(())
    }
    fn sample(
        self,
        s: &DMatrix<f64>,
        states: usize,
        data: Discrete,
        derivative: Derivative,
    ) -> Option<Sampled> {
        let mut generator = s.rows(0, states) * data.sample_time();
        let units = in_size(&mut generator, states);
        let mut held = Held::new(&generator, derivative)?;
        if let Some(units) = &units {
            held.undo(units);
        }
        let mut sampled = s.clone();
        sampled.rows_mut(0, states).copy_from(&held.step.rows(0, states));
        Some(Sampled {
            s: sampled,
            chain: (derivative == Derivative::Compute).then(|| held.chain * data.sample_time()),
        })
    }
    fn double_integrators(self, axes: usize) -> (DMatrix<f64>, DMatrix<f64>) {
        let mut a = DMatrix::zeros(2 * axes, 2 * axes);
        a.view_mut((0, axes), (axes, axes)).fill_diagonal(1.0);
        let mut c = DMatrix::zeros(axes, 2 * axes);
        c.view_mut((0, 0), (axes, axes)).fill_diagonal(1.0);
        (a, c)
    }
    fn pole_of_sampled(self, z: Complex<f64>, data: Discrete) -> Complex<f64> {
        z.ln() / data.sample_time()
    }
    fn partial_fraction(self, pole: Complex<f64>, z: Complex<f64>, data: Discrete) -> Complex<f64> {
        // (e^(sT) - 1) / s, by the half angle so that a pole near zero loses no digits.
        let half = pole * (0.5 * data.sample_time());
        let ratio = if half.norm() < 1e-4 {
            1.0 + half * half / 6.0
        } else {
            half.sinh() / half
        };
        half.exp() * ratio * data.sample_time() / (z - (half * 2.0).exp())
    }
    fn shift(self, m: &mut DMatrix<f64>, states: usize, rate: f64, _: Discrete) {
        (0..states).for_each(|i| m[(i, i)] -= rate);
    }
    fn rate(self, a: &DMatrix<f64>) -> f64 {
        a.norm() / (a.nrows().max(1) as f64).sqrt()
    }
}

/// Nodes of Gauss-Legendre quadrature on [0, 1] with their weights; node `q` and the q-th from the end sum to one. For a
/// generator of norm one the rule is exact to 1e-10.
const NODES: [(f64, f64); 5] = [
    (0.046_910_077_030_668_02, 0.118_463_442_528_094_54),
    (0.230_765_344_947_158_45, 0.239_314_335_249_683_24),
    (0.5, 0.284_444_444_444_444_44),
    (0.769_234_655_052_841_6, 0.239_314_335_249_683_24),
    (0.953_089_922_969_332, 0.118_463_442_528_094_54),
];

/// Terms of the exponential series: the last is below rounding for a norm of one.
const TERMS: usize = 19;

/// Most intervals that a sample is divided into: a generator of a larger norm is too stiff for its clock.
const INTERVALS: usize = 4096;

/// `e^X` for `X = [A B; 0 0] T`, and its Fréchet derivative.
struct Held {
    step: DMatrix<f64>,
    chain: DMatrix<f64>,
}

/// States in units in which A is no larger than it needs to be, powers of two, where it is large: a chain of integrators takes any
/// units, and those of time must not set the intervals. The unit of each column; none where A is small as it is.
fn in_size(generator: &mut DMatrix<f64>, states: usize) -> Option<Vec<f64>> {
    /// Norm below which few intervals do.
    const SMALL: f64 = 4.0;
    let mut a = generator.columns(0, states).into_owned();
    let norm = a.column_iter().map(|c| c.abs().sum()).fold(0.0, f64::max);
    if norm <= SMALL || !norm.is_finite() {
        return None;
    }
    let mut units = balanced(&mut a);
    generator.columns_mut(0, states).copy_from(&a);
    for (i, unit) in units.iter().enumerate() {
        let mut inputs = generator.view_mut((i, states), (1, generator.ncols() - states));
        inputs /= *unit;
    }
    units.resize(generator.ncols(), 1.0);
    Some(units)
}

impl Held {
    /// In states of the size one again.
    fn undo(&mut self, units: &[f64]) {
        let (n, all) = (self.chain.nrows() / units.len(), units.len());
        for j in 0..all {
            for i in 0..all {
                self.step[(i, j)] *= units[i] / units[j];
            }
        }
        // Rows: entries (i, l) of the result, columns: entries (k, m) of the generator.
        for m in 0..if n > 0 { all } else { 0 } {
            for k in 0..n {
                let mut column = self.chain.column_mut(m * n + k);
                column *= units[m] / units[k];
                for l in 0..all {
                    for i in 0..n {
                        column[l * n + i] *= units[i] / units[l];
                    }
                }
            }
        }
    }

    /// `L(X, E) = int_0^1 e^((1-s) X) E e^(s X) ds` (Higham, Functions of Matrices, 10.2) by quadrature on intervals on
    /// which X has norm one at most, so that the derivative is a sum of outer products for all entries at once.
    fn new(generator: &DMatrix<f64>, derivative: Derivative) -> Option<Self> {
        let (n, all) = generator.shape();
        // B enters linearly: its size changes no relative error.
        let norm = generator
            .columns(0, n)
            .column_iter()
            .map(|c| c.abs().sum())
            .fold(0.0, f64::max);
        if norm.is_nan() || norm > INTERVALS as f64 {
            return None;
        }
        let intervals = (norm.ceil() as usize).max(1);
        let mut x = DMatrix::zeros(all, all);
        x.rows_mut(0, n).copy_from(&(generator / intervals as f64));
        let powers = powers(&x);
        let whole = series(&powers, 1.0);
        let starts = std::iter::successors(Some(DMatrix::identity(all, all)), |e| Some(e * &whole));
        let starts: Vec<DMatrix<f64>> = starts.take(intervals + 1).collect();
        let step = starts[intervals].clone();
        if !step.iter().all(|v| v.is_finite()) {
            return None;
        }
        if derivative == Derivative::Skip {
            return Some(Self {
                step,
                chain: DMatrix::zeros(0, 0),
            });
        }
        let nodes = NODES.map(|(s, _)| series(&powers, s));
        let mut chain = DMatrix::zeros(n * all, n * all);
        for j in 0..intervals {
            for (q, (_, weight)) in NODES.iter().enumerate() {
                let before = &nodes[q] * &starts[j];
                let after = &nodes[NODES.len() - 1 - q] * &starts[intervals - 1 - j];
                let weight = weight / intervals as f64;
                // Entry (i, l) of L moves by after(i, k) before(m, l) with entry (k, m) of E.
                for m in 0..all {
                    for k in 0..n {
                        let mut column = chain.column_mut(m * n + k);
                        for l in 0..all {
                            let factor = weight * before[(m, l)];
                            // The rows of B are those of the identity.
                            if factor == 0.0 {
                                continue;
                            }
                            for i in 0..n {
                                column[l * n + i] += factor * after[(i, k)];
                            }
                        }
                    }
                }
            }
        }
        Some(Self { step, chain })
    }
}

/// `X^k / k!`.
fn powers(x: &DMatrix<f64>) -> Vec<DMatrix<f64>> {
    let first = DMatrix::identity(x.nrows(), x.nrows());
    let mut powers = vec![first];
    for k in 1..TERMS {
        powers.push(&powers[k - 1] * x / k as f64);
    }
    powers
}

/// `e^(s X)`, summed from the smallest term.
fn series(powers: &[DMatrix<f64>], s: f64) -> DMatrix<f64> {
    let size = powers[0].nrows();
    let mut sum = DMatrix::zeros(size, size);
    for (k, term) in powers.iter().enumerate().rev() {
        let factor = s.powi(k as i32);
        sum.zip_apply(term, |sum: &mut f64, term| *sum += factor * term);
    }
    sum
}

/// The rows of the derivative that belong to all of S: identity for C and D.
pub(crate) fn apply_chain(chain: Option<&DMatrix<f64>>, shape: Shape, columns: DMatrix<f64>) -> DMatrix<f64> {
    let Some(chain) = chain else {
        return columns;
    };
    let (n, rows) = (shape.states, shape.rows());
    let top: Vec<usize> = (0..shape.columns())
        .flat_map(|b| (0..n).map(move |a| b * rows + a))
        .collect();
    let moved = chain * columns.select_rows(&top);
    let mut all = columns;
    for (from, &to) in top.iter().enumerate() {
        all.row_mut(to).copy_from(&moved.row(from));
    }
    all
}

#[cfg(test)]
mod tests;
