//! Carriage and beam: the machine of Tóth et al. (2011), (7) to (9), at a position that is given.

use super::{BaseParameter, Body, Forces, Motion, Pair, Start};
use crate::TraceError;
use lpv_core::{Continuous, CoreError, LpvStateSpace, MatrixFunction, SchedulingRange};
use nalgebra::DMatrix;
use std::f64::consts::TAU;

/// Two bodies on spring-damper pairs. The carriage (`y1`, `R1`) rides along the beam (`y2`, `R2`) at p; two motors push the
/// ends of the beam. States `[y1, R1, y2, R2]` and their rates.
#[derive(Debug, Clone, PartialEq)]
pub struct XyTable {
    pub(super) carriage_mass: f64,
    pub(super) carriage_inertia: f64,
    pub(super) beam_mass: f64,
    beam_inertia: f64,
    pub(super) stiffness: Pair,
    damping: Pair,
    /// Arms of the motors over those of the geometry.
    lever: f64,
    arms: Pair,
    /// Whether masses, inertia and lever arm are known.
    held: bool,
    /// Motor forces from the inputs: power of p, motor, input.
    force: [[[f64; 2]; 2]; 3],
}

impl XyTable {
    /// From the decoupling `T(p)` (motor forces over inputs, by powers of p), which tells the masses, the arms of the motors,
    /// and two modes for the couplings (translation, rotation; Hz).
    ///
    /// `B T(p)` is the mass matrix of the rigid machine `[m1 + m2, m1 p; m1 p, m1 p^2 + J1 + J2]`, B the map from motor
    /// forces to force and torque.
    ///
    /// # Errors
    /// [`TraceError::NoBase`] for a map that has no such masses.
    pub fn new(
        force: [DMatrix<f64>; 3],
        arms: Pair,
        modes_hz: [f64; 2],
        damping: f64,
    ) -> Result<Self, TraceError> {
        let b = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, arms[0], arms[1]]);
        let rigid = [&b * &force[0], &b * &force[1], &b * &force[2]];
        let (total, inertia) = (rigid[0][(0, 0)], rigid[0][(1, 1)]);
        let carriage = rigid[1][(0, 1)];
        let beam = total - carriage;
        if !(carriage > 0.0 && beam > 0.0 && inertia > 0.0) {
            return Err(TraceError::NoBase {
                why: "[geometry] force_from_input is not the decoupling of a carriage on a beam: its masses are not positive; \
                      the first input and output are those of the translation, the second those of the rotation",
            });
        }
        // The geometry tells the sum of the inertias only.
        let (carriage_inertia, beam_inertia) = (0.2 * inertia, 0.8 * inertia);
        let reduced = [carriage * beam / total, carriage_inertia * beam_inertia / inertia];
        let w = modes_hz.map(|f| TAU * f);
        Ok(Self {
            carriage_mass: carriage,
            carriage_inertia,
            beam_mass: beam,
            beam_inertia,
            stiffness: [0, 1].map(|i: usize| w[i] * w[i] * reduced[i]),
            damping: [0, 1].map(|i: usize| 2.0 * damping * w[i] * reduced[i]),
            lever: 1.0,
            arms,
            held: false,
            force: [0, 1, 2].map(|k: usize| [0, 1].map(|i: usize| [0, 1].map(|j: usize| force[k][(i, j)]))),
        })
    }

    /// What a geometry tells first, then the couplings.
    pub(super) fn parameters(&self) -> Vec<BaseParameter> {
        let all = [
            ("carriage mass", "kg", self.carriage_mass),
            ("beam mass", "kg", self.beam_mass),
            (
                "inertia of carriage and beam",
                "kg m^2",
                self.carriage_inertia + self.beam_inertia,
            ),
            ("lever arm over that of the geometry", "", self.lever),
            (
                "inertia of the carriage over that of the beam",
                "",
                self.carriage_inertia / self.beam_inertia,
            ),
            ("stiffness, translation", "N/m", self.stiffness[0]),
            ("stiffness, rotation", "N m/rad", self.stiffness[1]),
            ("damping, translation", "N s/m", self.damping[0]),
            ("damping, rotation", "N m s/rad", self.damping[1]),
        ];
        let one = |(i, (name, unit, value)): (usize, (&'static str, &'static str, f64))| BaseParameter {
            name,
            unit,
            value,
            positive: true,
            held: self.held && i < Self::TOLD,
        };
        all.into_iter().enumerate().map(one).collect()
    }

    pub(super) fn set(&mut self, v: &[f64]) {
        self.carriage_mass = v[0];
        self.beam_mass = v[1];
        let (inertia, ratio) = (v[2], v[4]);
        (self.carriage_inertia, self.beam_inertia) =
            (inertia * ratio / (1.0 + ratio), inertia / (1.0 + ratio));
        self.lever = v[3];
        self.stiffness = [v[5], v[6]];
        self.damping = [v[7], v[8]];
    }

    /// Parameters that a geometry tells, the first ones.
    pub(crate) const TOLD: usize = 4;

    /// The same with the masses, the inertia and the lever arm of another, taken for true.
    pub(crate) fn holding(&self, like: &Self) -> Self {
        let of = |t: &Self| t.parameters().iter().map(|p| p.value).collect::<Vec<_>>();
        let (told, own) = (of(like), of(self));
        let mut table = self.clone();
        table.set(&[&told[..Self::TOLD], &own[Self::TOLD..]].concat());
        table.held = true;
        table
    }

    /// The same with all masses, inertias, stiffnesses and dampings so many times as large: the same modes, another gain.
    pub(crate) fn weighing(mut self, times: f64) -> Self {
        for value in [
            &mut self.carriage_mass,
            &mut self.carriage_inertia,
            &mut self.beam_mass,
            &mut self.beam_inertia,
        ]
        .into_iter()
        .chain(&mut self.stiffness)
        .chain(&mut self.damping)
        {
            *value *= times;
        }
        self
    }

    /// The same with this share of the inertia on the carriage, and the same mode of rotation.
    pub(crate) fn with_carriage_share(&self, share: f64) -> Self {
        let total = self.carriage_inertia + self.beam_inertia;
        let mut table = self.clone();
        (table.carriage_inertia, table.beam_inertia) = (share * total, (1.0 - share) * total);
        let reduced = |t: &Self| t.carriage_inertia * t.beam_inertia / total;
        let change = reduced(&table) / reduced(self);
        table.stiffness[1] *= change;
        table.damping[1] *= change;
        table
    }

    /// The lower of the uncoupled modes, Hz.
    pub(crate) fn lowest_mode(&self) -> f64 {
        let reduced = |a: f64, b: f64| a * b / (a + b);
        let translation = self.stiffness[0] / reduced(self.carriage_mass, self.beam_mass);
        let rotation = self.stiffness[1] / reduced(self.carriage_inertia, self.beam_inertia);
        translation.min(rotation).sqrt() / TAU
    }

    /// The table as an LPV state space with coefficients of second degree in p, which it is.
    ///
    /// # Errors
    /// None for finite parameters.
    pub fn to_lpv(&self, range: SchedulingRange) -> Result<LpvStateSpace<Continuous>, CoreError> {
        let [before, at, after] = [-1.0, 0.0, 1.0].map(|p| self.frozen(p));
        let through = |i: usize| {
            let (a, b, c) = (&before[i], &at[i], &after[i]);
            MatrixFunction::polynomial(vec![b.clone(), 0.5 * (c - a), 0.5 * (c + a) - b])
        };
        let direct = MatrixFunction::constant(DMatrix::zeros(2, 2))?;
        LpvStateSpace::new(through(0)?, through(1)?, through(2)?, direct, range, Continuous)
    }

    /// A, B and C of `x' = A x + B u`, `y = C x` at a constant p.
    pub fn frozen(&self, p: f64) -> [DMatrix<f64>; 3] {
        let mut a = DMatrix::zeros(8, 8);
        let mut b = DMatrix::zeros(8, 2);
        let mut c = DMatrix::zeros(2, 8);
        let mut column = [0.0; 8];
        for j in 0..8 {
            let x: [f64; 8] = std::array::from_fn(|i| f64::from(u8::from(i == j)));
            self.rates(&x, p, &Forces::default(), &mut column);
            a.column_mut(j).copy_from_slice(&column);
            c.column_mut(j).copy_from_slice(&self.outputs(&x, p));
        }
        for j in 0..2 {
            let u: Pair = std::array::from_fn(|i| f64::from(u8::from(i == j)));
            let forces = Forces {
                motors: self.commanded(p, u),
                ..Forces::default()
            };
            self.rates(&[0.0; 8], p, &forces, &mut column);
            b.column_mut(j).copy_from_slice(&column);
        }
        [a, b, c]
    }
}

impl Body for XyTable {
    fn begin(&self, p: f64, start: &Start, x: &mut [f64]) {
        for (x, [y, r]) in x.chunks_exact_mut(4).zip([start.position, start.speed]) {
            x.copy_from_slice(&[y + p * r, r, y, r]);
        }
    }

    #[inline]
    fn commanded(&self, p: f64, u: Pair) -> Pair {
        let at =
            |i: usize, j: usize| self.force[0][i][j] + p * (self.force[1][i][j] + p * self.force[2][i][j]);
        [
            at(0, 0) * u[0] + at(0, 1) * u[1],
            at(1, 0) * u[0] + at(1, 1) * u[1],
        ]
    }

    #[inline]
    fn motion(&self, x: &[f64], p: f64) -> Motion {
        let arms = [self.arms[0] * self.lever, self.arms[1] * self.lever];
        Motion {
            motor_position: [x[2] + arms[0] * x[3], x[2] + arms[1] * x[3]],
            motor_speed: [x[6] + arms[0] * x[7], x[6] + arms[1] * x[7]],
            load_position: [x[0], x[1]],
            load_speed: [x[4], x[5]],
            deflection: [x[0] - x[2] - p * x[3], x[1] - x[3]],
        }
    }

    #[inline]
    fn rates(&self, x: &[f64], p: f64, forces: &Forces, rates: &mut [f64]) {
        let pull =
            |i: usize, e: f64, v: f64| self.stiffness[i] * e + self.damping[i] * v + forces.coupling[i];
        let f_y = pull(0, x[0] - x[2] - p * x[3], x[4] - x[6] - p * x[7]);
        let f_r = pull(1, x[1] - x[3], x[5] - x[7]);
        let [left, right] = forces.motors;
        let torque = self.lever * (self.arms[0] * left + self.arms[1] * right);
        rates[..4].copy_from_slice(&x[4..8]);
        rates[4] = (forces.load[0] - f_y) / self.carriage_mass;
        rates[5] = (forces.load[1] - f_r) / self.carriage_inertia;
        rates[6] = (f_y + left + right) / self.beam_mass;
        rates[7] = (p * f_y + f_r + torque) / self.beam_inertia;
    }

    #[inline]
    fn outputs(&self, x: &[f64], p: f64) -> Pair {
        [x[0] - p * x[1], x[1]]
    }
}
