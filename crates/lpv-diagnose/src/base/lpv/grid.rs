//! A model on a grid of p, and how its inputs and outputs reach the motors.

use crate::TraceError;
use crate::base::{Forces, Pair};
use lpv_core::{Continuous, CoreError, Geometry, StateSpace};

/// A model at equally spaced p, between which cubics lead.
#[derive(Debug, PartialEq)]
pub(super) struct Grid {
    pub(super) name: String,
    pub(super) states: usize,
    pub(super) channels: usize,
    pub(super) range: [f64; 2],
    pub(super) is_constant: bool,
    pub(super) nodes: usize,
    /// By node `[A B]` row by row, C, C A.
    values: Vec<f64>,
    pub(super) drive: Drive,
}

/// How inputs become motor forces, and outputs motor coordinates.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Drive {
    /// Motor forces over inputs, by powers of p.
    force: Vec<[[f64; 2]; 2]>,
    /// Motor coordinates over outputs.
    pub(super) motor: [[f64; 2]; 2],
}

/// Most states of an identified model; effects need room beside them.
const MOST_OF_ITS_OWN: usize = 12;

const IDENTITY: [[f64; 2]; 2] = [[1.0, 0.0], [0.0, 1.0]];

/// Room for a node.
pub(super) const ROOM: usize = MOST_OF_ITS_OWN * (MOST_OF_ITS_OWN + 2);

/// Difference of the cubics from the model, relative, that is small enough.
const CLOSE: f64 = 1e-9;

/// Nodes beyond which none are added.
const MOST_NODES: usize = 1025;

pub(super) fn times(m: &[[f64; 2]; 2], v: Pair) -> Pair {
    [0, 1].map(|i: usize| m[i][0] * v[0] + m[i][1] * v[1])
}

fn solve(m: &[[f64; 2]; 2], v: Pair) -> Pair {
    let [[a, b], [c, d]] = *m;
    let det = a * d - b * c;
    [(d * v[0] - b * v[1]) / det, (a * v[1] - c * v[0]) / det]
}

fn blob(system: &StateSpace<Continuous>) -> Vec<f64> {
    let (a, b, c) = (system.a(), system.b(), system.c());
    let mut out = Vec::with_capacity(a.len() + b.len() + 2 * c.len());
    for i in 0..a.nrows() {
        out.extend(a.row(i).iter().chain(b.row(i).iter()));
    }
    for matrix in [c.clone(), c * a] {
        out.extend(matrix.transpose().iter());
    }
    out
}

impl Grid {
    pub(super) fn new(
        name: String,
        range: Option<[f64; 2]>,
        geometry: Option<&Geometry>,
        frozen: &impl Fn(f64) -> Result<StateSpace<Continuous>, CoreError>,
    ) -> Result<Self, TraceError> {
        let [low, high] = range.unwrap_or([0.0, 1.0]);
        let middle = frozen(0.5 * (low + high))?;
        let (states, channels) = (middle.states(), middle.inputs());
        let refuse = |why| Err(TraceError::NoBase { why });
        if channels > 2 || middle.outputs() != channels {
            return refuse(
                "effects are added to models with one or two inputs and as many outputs; choose channels of the bundle",
            );
        }
        if states > MOST_OF_ITS_OWN {
            return refuse("effects are added to models with at most 12 states; identify a smaller one");
        }
        if middle.d().amax() > 1e-9 * middle.c().amax() * middle.b().amax() {
            return refuse(
                "the model has a direct term, and the controller would act on the output that it causes",
            );
        }
        let mut grid = Self {
            name,
            states,
            channels,
            range: [low, high],
            is_constant: range.is_none(),
            nodes: if range.is_some() { 17 } else { 4 },
            values: Vec::new(),
            drive: Drive::new(geometry, channels)?,
        };
        loop {
            grid.values.clear();
            for k in 0..grid.nodes {
                let p = low + (high - low) * k as f64 / (grid.nodes - 1) as f64;
                grid.values.extend(blob(&frozen(p.min(high))?));
            }
            if grid.is_constant || grid.nodes >= MOST_NODES || grid.leads(frozen)? {
                return Ok(grid);
            }
            grid.nodes = 2 * grid.nodes - 1;
        }
    }

    pub(super) fn node(&self, k: usize) -> &[f64] {
        let length = self.values.len() / self.nodes;
        &self.values[k * length..(k + 1) * length]
    }

    /// Part of a node at p, by the cubic through the four nodes around; at the ends of the range beyond it.
    pub(super) fn at(&self, p: f64, part: std::ops::Range<usize>, out: &mut [f64; ROOM]) {
        let [low, high] = self.range;
        let t = ((p - low) / (high - low)).clamp(0.0, 1.0) * (self.nodes - 1) as f64;
        let first = (t.floor() as usize).saturating_sub(1).min(self.nodes - 4);
        let s = t - first as f64;
        let weights = [
            -(s - 1.0) * (s - 2.0) * (s - 3.0) / 6.0,
            s * (s - 2.0) * (s - 3.0) / 2.0,
            -s * (s - 1.0) * (s - 3.0) / 2.0,
            s * (s - 1.0) * (s - 2.0) / 6.0,
        ];
        let [a, b, c, d] = [0, 1, 2, 3].map(|k: usize| &self.node(first + k)[part.clone()]);
        for (i, out) in out[..part.len()].iter_mut().enumerate() {
            *out = weights[0] * a[i] + weights[1] * b[i] + (weights[2] * c[i] + weights[3] * d[i]);
        }
    }

    /// Whether the cubics are close to the model between the nodes.
    fn leads(
        &self,
        frozen: &impl Fn(f64) -> Result<StateSpace<Continuous>, CoreError>,
    ) -> Result<bool, CoreError> {
        let [low, high] = self.range;
        let n = self.states * (self.states + self.channels);
        let mut out = [0.0; ROOM];
        for k in 0..self.nodes - 1 {
            let p = low + (high - low) * (k as f64 + 0.5) / (self.nodes - 1) as f64;
            let exact = blob(&frozen(p)?);
            let size = exact.iter().fold(0.0_f64, |s, v| s.max(v.abs()));
            for part in [0..n, n..exact.len()] {
                self.at(p, part.clone(), &mut out);
                if exact[part]
                    .iter()
                    .zip(&out)
                    .any(|(e, o)| (e - o).abs() > CLOSE * size)
                {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }
}

impl Drive {
    fn new(geometry: Option<&Geometry>, channels: usize) -> Result<Self, TraceError> {
        let Some(geometry) = geometry else {
            return Ok(Self {
                force: vec![IDENTITY],
                motor: IDENTITY,
            });
        };
        let map = geometry.motor_from_output_matrix();
        let square = |m: &Vec<Vec<f64>>| m.len() == 2 && m.iter().all(|row| row.len() == 2);
        if channels != 2 || map.shape() != (2, 2) || !geometry.force_from_input.iter().all(square) {
            return Err(TraceError::NoBase {
                why: "the [geometry] belongs to other channels than those of the model: it needs two motors, two inputs and two outputs",
            });
        }
        let force = geometry.force_from_input.iter();
        Ok(Self {
            force: force.map(|m| [0, 1].map(|i: usize| [m[i][0], m[i][1]])).collect(),
            motor: [0, 1].map(|i: usize| [map[(i, 0)], map[(i, 1)]]),
        })
    }

    pub(super) fn force_at(&self, p: f64) -> [[f64; 2]; 2] {
        let mut sum = [[0.0; 2]; 2];
        for power in self.force.iter().rev() {
            for i in 0..2 {
                for j in 0..2 {
                    sum[i][j] = sum[i][j] * p + power[i][j];
                }
            }
        }
        sum
    }

    /// Inputs that do what forces on motors and load do; a force on the load does the work of its outputs.
    pub(super) fn as_input(&self, p: f64, forces: &Forces) -> Pair {
        let [[a, b], [c, d]] = self.motor;
        let load = solve(&[[a, c], [b, d]], forces.load);
        let all = [0, 1].map(|i: usize| forces.motors[i] + load[i]);
        solve(&self.force_at(p), all)
    }
}
