//! A continuous model whose scheduling moves, seen at the samples of a clock.

use crate::linalg::{dimension, finite, finite_vector};
use crate::{Continuous, CoreError, Discrete, Lfr, StateSpace, Trajectory};
use nalgebra::{DMatrix, DVector};

/// Scheduling at the two Gauss nodes of every interval between samples.
///
/// Between samples p follows the cubic through the four samples around the interval; at the ends the line through the
/// last two is continued for the missing one. After the last sample p stays.
#[derive(Debug, Clone, PartialEq)]
pub struct SchedulingNodes {
    early: DMatrix<f64>,
    late: DMatrix<f64>,
}

/// The nodes lie at `1/2 -+ sqrt(3)/6` of the interval.
const OFFSET: f64 = 0.288_675_134_594_812_9;

/// Weights of the two generators in the two exponentials, `1/4 +- sqrt(3)/6`.
pub(crate) const WEIGHTS: [f64; 2] = [0.25 + OFFSET, 0.25 - OFFSET];

impl SchedulingNodes {
    /// From samples, `n_p x N`.
    pub fn new(scheduling: &DMatrix<f64>) -> Self {
        let at = |fraction: f64| {
            DMatrix::from_fn(scheduling.nrows(), scheduling.ncols(), |i, k| {
                let row = scheduling.row(i);
                cubic(|k| row[k], scheduling.ncols(), k, fraction)
            })
        };
        Self {
            early: at(0.5 - OFFSET),
            late: at(0.5 + OFFSET),
        }
    }

    /// The two nodes of the interval after sample `k`, one column each.
    ///
    /// # Panics
    /// If there is no sample `k`.
    pub fn after(&self, k: usize) -> [&[f64]; 2] {
        let rows = self.early.nrows();
        let part = k * rows..(k + 1) * rows;
        [&self.early.as_slice()[part.clone()], &self.late.as_slice()[part]]
    }
}

/// Lagrange's cubic at `k + s`, `0 <= s <= 1`.
fn cubic(sample: impl Fn(usize) -> f64, samples: usize, k: usize, s: f64) -> f64 {
    let here = sample(k);
    if k + 1 >= samples {
        return here;
    }
    let next = sample(k + 1);
    let before = if k == 0 { 2.0 * here - next } else { sample(k - 1) };
    let after = if k + 2 < samples {
        sample(k + 2)
    } else {
        2.0 * next - here
    };
    let (a, b, c) = (s + 1.0, s - 1.0, s - 2.0);
    -before * s * b * c / 6.0 + here * a * b * c / 2.0 - next * a * s * c / 2.0 + after * a * s * b / 6.0
}

impl Lfr<Continuous> {
    /// `(A_d, B_d)` from one sample to the next while the inputs are held and p moves through the two Gauss nodes
    /// `nodes`: two exponentials of fourth order, without commutators \[blanes2006\]. With equal nodes it is the
    /// zero-order hold. A node beyond the range, where the cubic through samples inside it turns, counts as its bound.
    ///
    /// # Errors
    /// An LFR that is not well-posed at the nodes, or a model too stiff for the clock; another number of parameters.
    pub fn transition(
        &self,
        nodes: [&[f64]; 2],
        clock: Discrete,
    ) -> Result<(DMatrix<f64>, DMatrix<f64>), CoreError> {
        let inside = |p: &[f64]| -> Vec<f64> {
            let bounds = self.range().bounds();
            let held = p.iter().zip(bounds).map(|(v, &[l, u])| v.clamp(l, u));
            held.chain(p.iter().skip(bounds.len()).copied()).collect()
        };
        let [early, late] = [self.frozen(&inside(nodes[0]))?, self.frozen(&inside(nodes[1]))?];
        let half = |first: f64, second: f64| -> Result<StateSpace<Discrete>, CoreError> {
            // exp(T (w_1 G_1 + w_2 G_2)) with w_1 + w_2 = 1/2.
            StateSpace::new(
                early.a() * first + late.a() * second,
                early.b() * first + late.b() * second,
                early.c().clone(),
                early.d().clone(),
                Continuous,
            )?
            .zero_order_hold(clock)
        };
        let [large, small] = WEIGHTS;
        let (one, two) = (half(large, small)?, half(small, large)?);
        Ok((two.a() * one.a(), two.a() * one.b() + two.b()))
    }

    /// Response, at the samples of `clock`, to `inputs` (`n_u x N`) that are held between samples along `scheduling`
    /// (`n_p x N`), which moves smoothly between them ([`SchedulingNodes`]), from `initial_state`.
    ///
    /// # Errors
    /// [`CoreError::OutsideRange`], [`CoreError::IllPosed`], [`CoreError::TooStiff`], [`CoreError::Dimension`],
    /// [`CoreError::NotFinite`].
    pub fn simulate_held(
        &self,
        initial_state: &DVector<f64>,
        inputs: &DMatrix<f64>,
        scheduling: &DMatrix<f64>,
        clock: Discrete,
    ) -> Result<Trajectory, CoreError> {
        dimension("simulation: initial state", self.states(), initial_state.len())?;
        dimension("simulation: rows of the input", self.inputs(), inputs.nrows())?;
        dimension(
            "simulation: samples of the scheduling",
            inputs.ncols(),
            scheduling.ncols(),
        )?;
        finite("simulation: input", inputs)?;
        finite("simulation: scheduling", scheduling)?;
        finite_vector("simulation: initial state", initial_state)?;
        let nodes = SchedulingNodes::new(scheduling);
        let mut x = initial_state.clone();
        let mut outputs = DMatrix::zeros(self.outputs(), inputs.ncols());
        for k in 0..inputs.ncols() {
            let u = inputs.column(k);
            let frozen = self.frozen(scheduling.column(k).as_slice())?;
            outputs.set_column(k, &(frozen.c() * &x + frozen.d() * u));
            let (a, b) = self.transition(nodes.after(k), clock)?;
            x = a * x + b * u;
        }
        Ok(Trajectory {
            outputs,
            final_state: x,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{LfrBlocks, SchedulingRange};
    use nalgebra::dmatrix;

    #[test]
    fn cubics_are_followed_exactly_and_bounds_hold() {
        let f = |t: f64| 0.1 + 0.02 * t - 0.003 * t * t + 1e-4 * t * t * t;
        let samples = DMatrix::from_fn(1, 9, |_, k| f(k as f64));
        let nodes = SchedulingNodes::new(&samples);
        for k in 1..7 {
            let [early, late] = nodes.after(k);
            assert!((early[0] - f(k as f64 + 0.5 - OFFSET)).abs() < 1e-15);
            assert!((late[0] - f(k as f64 + 0.5 + OFFSET)).abs() < 1e-15);
        }
        assert_eq!(nodes.after(8), [&[samples[8]][..], &[samples[8]][..]]);
    }

    #[test]
    fn at_rest_in_p_it_is_the_zero_order_hold() {
        let m = LfrBlocks {
            a: dmatrix![0.0, 1.0; -4.0, -0.2],
            b1: dmatrix![0.0; 1.0],
            b2: dmatrix![0.0; 1.0],
            c1: dmatrix![-1.0, 0.0],
            d11: dmatrix![0.1],
            d12: dmatrix![0.0],
            c2: dmatrix![1.0, 0.0],
            d21: dmatrix![0.0],
            d22: dmatrix![0.0],
        };
        let deltas = vec![crate::DeltaBlock {
            parameter: 0,
            repetitions: 1,
        }];
        let range = SchedulingRange::interval(0.0, 2.0).unwrap();
        let lfr = Lfr::new(m, deltas, range, Continuous).unwrap();
        let clock = Discrete::new(0.1).unwrap();
        let (a, b) = lfr.transition([&[1.7], &[1.7]], clock).unwrap();
        let held = lfr.frozen(&[1.7]).unwrap().zero_order_hold(clock).unwrap();
        assert!((a - held.a()).amax() < 1e-14 && (b - held.b()).amax() < 1e-14);
        let (bound, _) = lfr.transition([&[2.0], &[2.1]], clock).unwrap();
        assert_eq!(bound, lfr.transition([&[2.0], &[2.0]], clock).unwrap().0);
        assert!(lfr.transition([&[1.7, 0.0], &[1.7, 0.0]], clock).is_err());
    }
}
