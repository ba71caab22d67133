//! Five degrees of freedom in motion: accelerations, the maps at motors and sensors, and one step by a Taylor series.

use crate::Machine;

/// Positions `[x1, y1, R1, y2, R2]` and then their rates, in m, rad and per unit of time.
pub(crate) type State = [f64; 10];

/// Highest order of a series: at an angular frequency w, its terms fall below rounding where `w h < 6`.
const MOST_TERMS: usize = 32;

/// The order from which it is asked whether further terms count.
const LEAST_TERMS: usize = 6;

/// `1 / k`.
const RECIPROCALS: [f64; MOST_TERMS + 1] = {
    let mut all = [0.0; MOST_TERMS + 1];
    let mut k = 1;
    while k <= MOST_TERMS {
        all[k] = 1.0 / k as f64;
        k += 1;
    }
    all
};

/// Coefficient of the product of a polynomial of degree two with a series, whose latest three coefficients are given, the last one
/// first.
#[inline]
fn product(p: [f64; 3], latest: [f64; 3]) -> f64 {
    p[0] * latest[0] + p[1] * latest[1] + p[2] * latest[2]
}

/// The machine's numbers in the form that the innermost loop needs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Mechanics {
    pub(crate) inverse_masses: [f64; 5],
    stiffness: [f64; 2],
    damping: [f64; 2],
    half_beam: f64,
    /// `T_u`: row, column, power of p.
    decoupling: [[[f64; 3]; 2]; 2],
}

impl Mechanics {
    pub(crate) fn new(machine: &Machine) -> Self {
        let q = machine.parameters();
        let t = machine.input_decoupling();
        Self {
            inverse_masses: [
                q.servo_mass_kg,
                q.carriage_mass_kg,
                q.carriage_inertia_kg_m2,
                q.beam_mass_kg,
                q.beam_inertia_kg_m2,
            ]
            .map(f64::recip),
            stiffness: [q.stiffness_y_n_per_m, q.stiffness_r_n_m_per_rad],
            damping: [q.damping_y_n_s_per_m, q.damping_r_n_m_s_per_rad],
            half_beam: q.half_beam_m,
            decoupling: [0, 1].map(|i: usize| [0, 1].map(|j: usize| [0, 1, 2].map(|k: usize| t[k][(i, j)]))),
        }
    }

    /// The same bodies behind the decoupling of another machine: the nominal one, when something hidden is mounted.
    pub(crate) fn decoupled_as(mut self, nominal: &Self) -> Self {
        self.decoupling = nominal.decoupling;
        self
    }

    /// Rigid motion at rest with these outputs: no deflection, no force.
    pub(crate) fn at_rest(x1: f64, outputs: [f64; 2]) -> State {
        let [y, r] = outputs;
        [x1, y + x1 * r, r, y, r, 0.0, 0.0, 0.0, 0.0, 0.0]
    }

    /// `[F_left, F_right] = T_u(p) u'`, in hardware: it follows p between samples.
    #[inline]
    pub(crate) fn beam_forces(&self, p: f64, u: [f64; 2]) -> [f64; 2] {
        self.decoupling.map(|row| {
            let [one, other] = row.map(|c| c[0] + p * (c[1] + p * c[2]));
            one * u[0] + other * u[1]
        })
    }

    /// (9): `y'_1 = y1 - p R1`, `y'_2 = R1`.
    #[inline]
    pub(crate) fn outputs(x: &State) -> [f64; 2] {
        [x[1] - x[0] * x[2], x[2]]
    }

    /// Rates of the state under motor forces `[F_x, F_left, F_right]` (7), (8).
    #[inline]
    pub(crate) fn rates(&self, x: &State, motors: [f64; 3]) -> State {
        let p = x[0];
        let [f_x, left, right] = motors;
        // (8) takes E(p)^T times the rates for the damping; the rate of p itself does not enter.
        let pair = |y: f64, r: f64, i: usize| self.stiffness[i] * y + self.damping[i] * r;
        let f_y = pair(x[1] - x[3] - p * x[4], x[6] - x[8] - p * x[9], 0);
        let f_r = pair(x[2] - x[4], x[7] - x[9], 1);
        let w = &self.inverse_masses;
        [
            x[5],
            x[6],
            x[7],
            x[8],
            x[9],
            f_x * w[0],
            -f_y * w[1],
            -f_r * w[2],
            (f_y + left + right) * w[3],
            (p * f_y + f_r + self.half_beam * (right - left)) * w[4],
        ]
    }

    /// The motion after `h` with held `F_x` and `u'`, by its Taylor series, up to the terms that rounding hides; none where the
    /// series of [`MOST_TERMS`] terms does not get there, and `h` is too long.
    ///
    /// Under a held force x1 is a polynomial of degree two in time, and the rest is linear with that polynomial in its
    /// coefficients: with `x(t + s h) = sum_k X_k s^k`, the coefficients of a product with x1 are
    /// `(x1 g)_k = x1_0 g_k + x1_1 g_(k-1) + x1_2 g_(k-2)`, and the equations of motion (7), (8) give each X_k from the ones before.
    /// The order follows the motion \[jorba2005\].
    #[inline]
    pub(crate) fn step(&self, x: &State, f_x: f64, u: [f64; 2], h: f64) -> Option<State> {
        let w = &self.inverse_masses;
        let p = [x[0], h * x[5], 0.5 * h * h * f_x * w[0]];
        let motors = self.beam_forces_along(p, u);
        // The latest coefficients of R2, of its rate, and of the force in the coupling.
        let (mut r, mut v, mut f) = ([0.0; 3], [0.0; 3], [0.0; 3]);
        let mut position = [x[1], x[2], x[3], x[4]];
        let mut rate = [x[6], x[7], x[8], x[9]];
        let mut sum = [[0.0; 4]; 2];
        let (mut scale, mut last) = (0.0, f64::INFINITY);
        for k in 0..MOST_TERMS {
            r = [position[3], r[0], r[1]];
            v = [rate[3], v[0], v[1]];
            let pair = |y: f64, r: f64, i: usize| self.stiffness[i] * y + self.damping[i] * r;
            let f_y = pair(
                position[0] - position[2] - product(p, r),
                rate[0] - rate[2] - product(p, v),
                0,
            );
            let f_r = pair(position[1] - position[3], rate[1] - rate[3], 1);
            f = [f_y, f[0], f[1]];
            let [left, right] = motors.get(k).copied().unwrap_or_default();
            let part = h * RECIPROCALS[k + 1];
            let rates = [
                -f_y * w[1],
                -f_r * w[2],
                (f_y + left + right) * w[3],
                (product(p, f) + f_r + self.half_beam * (right - left)) * w[4],
            ];
            position = rate.map(|v| part * v);
            rate = rates.map(|a| part * a);
            for i in 0..4 {
                sum[0][i] += position[i];
                sum[1][i] += rate[i];
            }
            if k + 1 == LEAST_TERMS {
                scale = self.size([x[1], x[2], x[3], x[4]], [x[6], x[7], x[8], x[9]], h)
                    + self.size(sum[0], sum[1], h);
            }
            if k + 1 >= LEAST_TERMS {
                // A single term may vanish by symmetry. What is no number ends the search too.
                let size = self.size(position, rate, h);
                let is_lost = last + size <= 0.25 * f64::EPSILON * scale;
                if is_lost || !scale.is_finite() {
                    let [[y1, r1, y2, r2], [vy1, vr1, vy2, vr2]] = sum;
                    let v_x = h * f_x * w[0];
                    let sum = [p[1] + p[2], y1, r1, y2, r2, v_x, vy1, vr1, vy2, vr2];
                    return Some(std::array::from_fn(|i| x[i] + sum[i]));
                }
                last = size;
            }
        }
        None
    }

    /// A length, m: the largest of positions and of rates times `h`, rotations at the end of the beam.
    #[inline]
    fn size(&self, position: [f64; 4], rate: [f64; 4], h: f64) -> f64 {
        let largest = |v: [f64; 4]| {
            let turn = v[1].abs().max(v[3].abs());
            v[0].abs().max(v[2].abs()).max(self.half_beam * turn)
        };
        largest(position).max(h * largest(rate))
    }

    /// Coefficients of `T_u(p) u'` along a p that is a polynomial of degree two.
    #[inline]
    fn beam_forces_along(&self, p: [f64; 3], u: [f64; 2]) -> [[f64; 2]; 5] {
        let square = [
            p[0] * p[0],
            2.0 * p[0] * p[1],
            p[1] * p[1] + 2.0 * p[0] * p[2],
            2.0 * p[1] * p[2],
            p[2] * p[2],
        ];
        std::array::from_fn(|k| {
            let one = f64::from(u8::from(k == 0));
            let line = p.get(k).copied().unwrap_or(0.0);
            self.decoupling.map(|row| {
                let [a, b] = row.map(|c| c[0] * one + c[1] * line + c[2] * square[k]);
                a * u[0] + b * u[1]
            })
        })
    }

    /// Kinetic energy of the beam and carriage in y and R, and energy in the springs.
    #[cfg(test)]
    pub(crate) fn energy(&self, x: &State) -> f64 {
        let kinetic: f64 = (1..5)
            .map(|i| 0.5 * x[i + 5] * x[i + 5] / self.inverse_masses[i])
            .sum();
        let e_y = x[1] - x[3] - x[0] * x[4];
        let e_r = x[2] - x[4];
        kinetic + 0.5 * (self.stiffness[0] * e_y * e_y + self.stiffness[1] * e_r * e_r)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MachineParameters;
    use nalgebra::DVector;

    #[test]
    fn rates_are_those_of_the_state_space() {
        let machine = MachineParameters::default().check().unwrap();
        let mechanics = Mechanics::new(&machine);
        let x: State = std::array::from_fn(|i| 0.1 * (1.0 + i as f64).sin());
        let motors = [0.3, -1.2, 2.1];
        let frozen = machine.mechanics().unwrap().frozen(&[x[0]]).unwrap();
        let expected =
            frozen.a() * DVector::from_row_slice(&x) + frozen.b() * DVector::from_row_slice(&motors);
        for (a, b) in mechanics.rates(&x, motors).iter().zip(expected.iter()) {
            assert!((a - b).abs() < 1e-12 * (1.0 + b.abs()), "{a} {b}");
        }
    }

    /// Against many small steps of the rule of midpoints, whose error falls with the square of the step: two such runs give the
    /// limit.
    #[test]
    fn a_step_is_that_of_many_small_ones() {
        let machine = MachineParameters::default().check().unwrap();
        let mechanics = Mechanics::new(&machine);
        let start: State = [0.1, 2e-3, 1e-2, -1e-3, 8e-3, 0.4, -0.05, 0.03, 0.02, -0.1];
        let (f_x, u, h) = (3.0, [0.7, -0.4], 0.05);
        let rates = |x: &State| {
            let [left, right] = mechanics.beam_forces(x[0], u);
            mechanics.rates(x, [f_x, left, right])
        };
        let small = |steps: usize| {
            let h = h / steps as f64;
            (0..steps).fold(start, |x, _| {
                let half = rates(&x);
                let middle = rates(&std::array::from_fn(|i| x[i] + 0.5 * h * half[i]));
                std::array::from_fn(|i| x[i] + h * middle[i])
            })
        };
        let (coarse, fine) = (small(20_000), small(40_000));
        let found = mechanics.step(&start, f_x, u, h).unwrap();
        for i in 0..10 {
            let limit = fine[i] + (fine[i] - coarse[i]) / 3.0;
            let scale = start[i % 5].abs() + start[5 + i % 5].abs();
            assert!(
                (found[i] - limit).abs() < 1e-11 * scale,
                "{i}: {} {limit}",
                found[i]
            );
        }
    }

    /// Two halves of a step are the step, up to rounding; over many periods of the resonances no series gets there.
    #[test]
    fn a_step_is_that_of_its_halves() {
        let machine = MachineParameters::default().check().unwrap();
        let mechanics = Mechanics::new(&machine);
        let start: State = [0.1, 2e-3, 1e-2, -1e-3, 8e-3, 0.4, -0.05, 0.03, 0.02, -0.1];
        let step = |x: &State, h: f64| mechanics.step(x, 3.0, [0.7, -0.4], h);
        for h in [1e-3, 0.01, 0.05, 0.1] {
            let whole = step(&start, h).unwrap();
            let halves = step(&step(&start, 0.5 * h).unwrap(), 0.5 * h).unwrap();
            for i in 0..10 {
                let scale = start[i % 5].abs() + start[5 + i % 5].abs();
                assert!(
                    (whole[i] - halves[i]).abs() < 2e-15 * scale,
                    "{h}, {i}: {} {}",
                    whole[i],
                    halves[i]
                );
            }
        }
        assert_eq!(step(&start, 10.0), None);
    }

    #[test]
    fn damping_only_takes_energy() {
        let machine = MachineParameters::default().check().unwrap();
        let mechanics = Mechanics::new(&machine);
        let mut x: State = [0.2, 1e-3, -2e-3, 0.0, 1e-3, 0.0, 0.0, 1e-3, 0.0, 0.0];
        let first = mechanics.energy(&x);
        let mut energy = first;
        for _ in 0..4000 {
            x = mechanics.step(&x, 0.0, [0.0; 2], 1e-3).unwrap();
            let next = mechanics.energy(&x);
            assert!(next <= energy * (1.0 + 1e-14), "{next} after {energy}");
            energy = next;
        }
        assert!(energy < 0.9 * first, "{energy} of {first}");
    }

    #[test]
    fn rest_stays_at_rest() {
        let machine = MachineParameters::default().check().unwrap();
        let x = Mechanics::at_rest(0.25, [1e-3, 2e-4]);
        let next = Mechanics::new(&machine).step(&x, 0.0, [0.0; 2], 0.05).unwrap();
        assert_eq!(Mechanics::outputs(&x).map(|v| (v * 1e12).round()), [1e9, 2e8]);
        for (a, b) in x.iter().zip(&next) {
            assert!((a - b).abs() < 1e-16, "{a} {b}");
        }
    }
}
