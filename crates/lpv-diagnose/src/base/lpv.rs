//! An identified model as a base: continuous, with matrices that follow p.

mod grid;

use super::{BaseParameter, Body, Forces, Motion, Pair, Start};
use crate::TraceError;
use grid::{Grid, ROOM, times};
use lpv_core::linalg::{eigenvalues, least_squares};
use lpv_core::{Continuous, CoreError, Discrete, Geometry, StateSpace};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

/// `x' = a A(p) x + B(p) G(p) u / a`, `y = C(p) x`: a model of lpv-core with what may be wrong with it, a gain of each input that
/// is linear in p, and a common factor a of the frequencies of its modes. The factors leave a double integrator as it is.
///
/// Where the bundle has a geometry, effects act on its motors; else on the channels.
#[derive(Debug, Clone, PartialEq)]
pub struct Lpv {
    grid: Arc<Grid>,
    /// Gains of the inputs in the middle of the range.
    gain: Pair,
    /// What they change by from the middle to the end of the range.
    slope: Pair,
    /// Frequencies of the modes over those of the model.
    tempo: f64,
    /// Inputs and outputs that count as zero.
    offsets: [Pair; 2],
}

impl Lpv {
    /// From a model that can be frozen at every p of `range`, named in words; `range` is none where nothing depends on p.
    /// With a geometry effects act on its motors.
    ///
    /// # Errors
    /// [`TraceError::NoBase`] for more than two channels, more than twelve states, a direct term, other numbers of inputs
    /// than of outputs, a geometry of other channels; [`TraceError::Core`] of `frozen`.
    pub fn new(
        name: String,
        range: Option<[f64; 2]>,
        geometry: Option<&Geometry>,
        frozen: impl Fn(f64) -> Result<StateSpace<Continuous>, CoreError>,
    ) -> Result<Self, TraceError> {
        Ok(Self {
            grid: Arc::new(Grid::new(name, range, geometry, &frozen)?),
            gain: [1.0; 2],
            slope: [0.0; 2],
            tempo: 1.0,
            offsets: [[0.0; 2]; 2],
        })
    }

    /// The same about a working point: inputs and outputs that count as zero.
    #[must_use]
    pub fn about(self, inputs: Pair, outputs: Pair) -> Self {
        Self {
            offsets: [inputs, outputs],
            ..self
        }
    }

    /// p from which to which the model holds.
    pub fn range(&self) -> [f64; 2] {
        self.grid.range
    }

    /// Parts of a sample in which the fourth-order rule follows its fastest mode.
    pub(super) fn parts(&self, step: f64) -> usize {
        /// Largest product of a rate and a part.
        const PART: f64 = 0.12;
        let n = self.grid.states;
        let fastest = (0..self.grid.nodes).map(|k| {
            let node = self.grid.node(k);
            let a = DMatrix::from_fn(n, n, |i, j| node[i * (n + self.grid.channels) + j]);
            eigenvalues(&a).map_or(f64::INFINITY, |all| {
                all.iter().map(|l| l.norm()).fold(0.0, f64::max)
            })
        });
        let fastest = fastest.fold(0.0, f64::max);
        // An even number has a coarse half.
        2 * ((0.5 * fastest * step / PART).ceil() as usize).clamp(1, 24)
    }

    pub(super) fn states(&self) -> usize {
        self.grid.states
    }

    /// Whether it is the same at every p.
    pub fn is_constant(&self) -> bool {
        self.grid.is_constant
    }

    /// Number of inputs and of outputs.
    pub fn channels(&self) -> usize {
        self.grid.channels
    }

    pub(super) fn name(&self) -> &str {
        &self.grid.name
    }

    pub(super) fn parameters(&self) -> Vec<BaseParameter> {
        const GAINS: [&str; 2] = ["gain of the first input", "gain of the second input"];
        const SLOPES: [&str; 2] = [
            "gain of the first input, along p",
            "gain of the second input, along p",
        ];
        let parameter = |name, value, positive| BaseParameter {
            name,
            unit: "",
            value,
            positive,
            held: false,
        };
        let mut all = Vec::new();
        for i in 0..self.grid.channels {
            all.push(parameter(GAINS[i], self.gain[i], true));
            all.push(BaseParameter {
                held: self.grid.is_constant,
                ..parameter(SLOPES[i], self.slope[i], false)
            });
        }
        all.push(parameter(
            "frequencies of the modes over those of the model",
            self.tempo,
            true,
        ));
        all
    }

    pub(super) fn set(&mut self, v: &[f64]) {
        for (i, pair) in v.chunks_exact(2).enumerate() {
            [self.gain[i], self.slope[i]] = [pair[0], pair[1]];
        }
        self.tempo = v[v.len() - 1];
    }

    /// The model in the middle of the range, sampled; commands are held.
    pub(crate) fn sampled(&self, clock: Discrete) -> Result<StateSpace<Discrete>, CoreError> {
        let [low, high] = self.grid.range;
        self.frozen(0.5 * (low + high))?.zero_order_hold(clock)
    }

    /// The model at p.
    ///
    /// # Errors
    /// None for a model that exists.
    pub fn frozen(&self, p: f64) -> Result<StateSpace<Continuous>, CoreError> {
        let m = self.grid.channels;
        let (a, b, c) = self.matrices(p);
        let gains = DMatrix::from_diagonal(&DVector::from_column_slice(&self.gains(p)[..m]));
        let b = b * gains / self.tempo;
        StateSpace::new(a * self.tempo, b, c, DMatrix::zeros(m, m), Continuous)
    }

    fn gains(&self, p: f64) -> Pair {
        let [low, high] = self.grid.range;
        let part = (2.0 * p - low - high) / (high - low);
        [0, 1].map(|i: usize| self.gain[i] + part * self.slope[i])
    }

    /// A, B, C without the factors.
    fn matrices(&self, p: f64) -> (DMatrix<f64>, DMatrix<f64>, DMatrix<f64>) {
        let (n, m) = (self.grid.states, self.grid.channels);
        let mut node = [0.0; ROOM];
        self.grid.at(p, 0..n * (n + m), &mut node);
        let both = DMatrix::from_row_slice(n, n + m, &node[..n * (n + m)]);
        let first = n * (n + m);
        self.grid.at(p, first..first + m * n, &mut node);
        let c = DMatrix::from_row_slice(m, n, &node[..m * n]);
        (
            both.columns(0, n).into_owned(),
            both.columns(n, m).into_owned(),
            c,
        )
    }
}

impl Body for Lpv {
    /// The state at which outputs stand still, or move at a steady speed.
    fn begin(&self, p: f64, start: &Start, x: &mut [f64]) {
        let (n, m) = (self.grid.states, self.grid.channels);
        let (a, b, c) = self.matrices(p);
        let size = a.amax().max(f64::MIN_POSITIVE);
        // The input holds it there, none where an integrator does.
        let push = b.amax().max(f64::MIN_POSITIVE);
        let moves = start.speed.iter().any(|v| *v != 0.0);
        // At rest `A x + B u = 0`; at a steady speed its rate is zero, and `C (A x + B u)` is the speed.
        let (a, b) = (a / size, b / push);
        let mut rows = DMatrix::zeros(n + 2 * m, n + m);
        let (still, drive) = if moves {
            (&a * &a, &a * &b)
        } else {
            (a.clone(), b.clone())
        };
        rows.view_mut((0, 0), (n, n)).copy_from(&still);
        rows.view_mut((0, n), (n, m)).copy_from(&drive);
        rows.view_mut((n, 0), (m, n)).copy_from(&c);
        let mut right = DVector::zeros(n + 2 * m);
        (0..m).for_each(|i| right[n + i] = start.position[i] - self.offsets[1][i]);
        if moves {
            rows.view_mut((n + m, 0), (m, n)).copy_from(&(&c * &a));
            rows.view_mut((n + m, n), (m, m)).copy_from(&(&c * &b));
            (0..m).for_each(|i| right[n + m + i] = start.speed[i] / (size * self.tempo));
        }
        if let Ok(found) = least_squares(rows, &right, 1e-10) {
            x[..n].copy_from_slice(&found.as_slice()[..n]);
        }
    }

    fn commanded(&self, p: f64, u: Pair) -> Pair {
        times(&self.grid.drive.force_at(p), u)
    }

    fn motion(&self, x: &[f64], p: f64) -> Motion {
        let (n, m) = (self.grid.states, self.grid.channels);
        let mut node = [0.0; ROOM];
        let first = n * (n + m);
        self.grid.at(p, first..first + 2 * m * n, &mut node);
        let row = |k: usize| -> f64 { node[k * n..(k + 1) * n].iter().zip(x).map(|(c, x)| c * x).sum() };
        let mut motion = Motion::default();
        for i in 0..m {
            motion.load_position[i] = row(i) + self.offsets[1][i];
            motion.load_speed[i] = self.tempo * row(m + i);
        }
        let motor = &self.grid.drive.motor;
        motion.motor_position = times(motor, motion.load_position);
        motion.motor_speed = times(motor, motion.load_speed);
        motion
    }

    fn rates(&self, x: &[f64], p: f64, forces: &Forces, rates: &mut [f64]) {
        let (n, m) = (self.grid.states, self.grid.channels);
        let mut node = [0.0; ROOM];
        self.grid.at(p, 0..n * (n + m), &mut node);
        let (gains, u) = (self.gains(p), self.grid.drive.as_input(p, forces));
        let u = [0, 1].map(|i: usize| gains[i] * (u[i] - self.offsets[0][i]));
        for (i, rate) in rates.iter_mut().enumerate().take(n) {
            let row = &node[i * (n + m)..(i + 1) * (n + m)];
            let own: f64 = row[..n].iter().zip(x).map(|(a, x)| a * x).sum();
            let input: f64 = row[n..].iter().zip(&u).map(|(b, u)| b * u).sum();
            *rate = self.tempo * own + input / self.tempo;
        }
    }

    fn outputs(&self, x: &[f64], p: f64) -> Pair {
        let (n, m) = (self.grid.states, self.grid.channels);
        let mut node = [0.0; ROOM];
        let first = n * (n + m);
        self.grid.at(p, first..first + m * n, &mut node);
        std::array::from_fn(|i| match i < m {
            true => {
                let row = node[i * n..(i + 1) * n].iter().zip(x);
                self.offsets[1][i] + row.map(|(c, x)| c * x).sum::<f64>()
            }
            false => 0.0,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{Forces, Lpv};
    use crate::base::{Base, Body, Start, table_from_geometry};
    use crate::{Explained, Track};
    use lpv_core::{Continuous, Controller, Geometry, Purpose, Record, RecordKind, Signals, StateSpace};
    use nalgebra::DMatrix;

    fn geometry() -> Geometry {
        let rows = |m: [[f64; 2]; 2]| m.map(Vec::from).to_vec();
        Geometry {
            force_from_input: vec![
                rows([[15.0, -1.5], [15.0, 1.5]]),
                rows([[-11.5, 5.75], [11.5, 5.75]]),
                rows([[0.0, -11.5], [0.0, 11.5]]),
            ],
            motor_from_output: rows([[1.0, -0.5], [1.0, 0.5]]),
        }
    }

    /// The first-principles table through its matrices moves as the table itself, in closed loop along a moving p.
    #[test]
    fn matrices_of_a_table_move_as_the_table() -> Result<(), Box<dyn std::error::Error>> {
        let table = table_from_geometry(&geometry(), [1.2, 1.9], 0.03)?;
        let named = || "table".to_owned();
        let lpv = Lpv::new(named(), Some([-0.4, 0.4]), Some(&geometry()), |p| {
            let [a, b, c] = table.frozen(p);
            StateSpace::new(a, b, c, DMatrix::zeros(2, 2), Continuous)
        })?;
        assert_eq!(lpv.parts(0.05), 6);
        let n = 600;
        let wave = |scale: f64, rate: f64| -> Vec<f64> {
            (0..n)
                .map(|k| scale * (1.0 - (rate * f64::from(k)).cos()))
                .collect()
        };
        let zero = || vec![0.0; n as usize];
        let p = wave(0.15, 0.02).iter().map(|v| v - 0.1).collect();
        let record = Record {
            name: "move".to_owned(),
            kind: RecordKind::Transient,
            purpose: Purpose::Validation,
            position: None,
            outputs: Signals::new(&["y1", "y2"], vec![wave(0.02, 0.03), zero()]),
            inputs: Signals::new(&["u1", "u2"], vec![zero(), zero()]),
            references: Signals::new(&["r1", "r2"], vec![wave(0.02, 0.03), wave(0.004, 0.045)]),
            scheduling: Signals::new(&["p"], vec![p]),
            auxiliary: Signals::new(&[], vec![]),
            injection: Signals::new(&[], vec![]),
        };
        let track = Track::new(&record, 0.05, 6, None)?;
        let controller = Controller {
            reference_numerator: vec![vec![15.0, -14.6], vec![15.0, -14.6]],
            feedback_numerator: vec![vec![15.0, -14.6], vec![15.0, -14.6]],
            denominator: vec![vec![1.0, -0.3], vec![1.0, -0.3]],
            limit: None,
        };
        let run = |base: Base| {
            let model = Explained {
                base,
                effects: Vec::new(),
            };
            model.closed_loop(&controller.start().ok()?, &track)
        };
        let (own, matrices) = (run(Base::XyTable(table)).unwrap(), run(Base::Lpv(lpv)).unwrap());
        let moved = own.outputs.iter().fold(0.0_f64, |m, y| m.max(y[0].abs()));
        assert!(moved > 0.02, "{moved}");
        for (a, b) in own.outputs.iter().zip(&matrices.outputs) {
            assert!(
                (a[0] - b[0]).abs() < 1e-9 && (a[1] - b[1]).abs() < 1e-9,
                "{a:?} {b:?}"
            );
        }
        Ok(())
    }

    /// By hand: `x' = -x + u`, `y = x + 3` stands still at y = 5 with x = 2, and with u = 2 beyond its zero of 1.
    #[test]
    fn a_stable_machine_stands_still_where_it_is_put() -> Result<(), Box<dyn std::error::Error>> {
        let lpv = Lpv::new("lag".to_owned(), None, None, |_| {
            let one = |v: f64| DMatrix::from_element(1, 1, v);
            StateSpace::new(one(-1.0), one(1.0), one(1.0), one(0.0), Continuous)
        })?
        .about([1.0, 0.0], [3.0, 0.0]);
        let mut x = [0.0; 16];
        let start = Start {
            position: [5.0, 0.0],
            speed: [0.0; 2],
        };
        lpv.begin(0.0, &start, &mut x);
        assert!((x[0] - 2.0).abs() < 1e-12, "{}", x[0]);
        assert!((lpv.outputs(&x, 0.0)[0] - 5.0).abs() < 1e-12);
        let mut rates = [1.0; 16];
        let forces = Forces {
            motors: [3.0, 0.0],
            ..Forces::default()
        };
        lpv.rates(&x, 0.0, &forces, &mut rates);
        assert!(rates[0].abs() < 1e-12, "{}", rates[0]);
        Ok(())
    }
}
