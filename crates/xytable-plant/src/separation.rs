//! At constant p the plant splits exactly into its rigid motion and two deflections.
//!
//! With `E = [e_y, e_r]` (deflections `e = E^T q`) and the rigid motions `N` (`E^T N = 0`), the coordinates
//! `z = M_rb^-1 N^T M q` and `e` give
//!
//! - `z'' = u'`, because `N^T f = M_rb u'`: two double integrators, sampled exactly by hand;
//! - `e'' = -E^T M^-1 E (k e + d e') + E^T M^-1 f`: four states, sampled by a small matrix exponential;
//! - `y' = z + C_e e`, with `C_e = T_y M^-1 E (E^T M^-1 E)^-1`.
//!
//! No eigenvectors are involved, so there is no ill-conditioned transform to fall back from.

use crate::{Machine, PlantError};
use lpv_core::{Continuous, Discrete, StateSpace};
use nalgebra::{DMatrix, Matrix2, Matrix2x4, Matrix4, Matrix4x2};

/// Rigid motion and deflections at one position.
pub(crate) struct Separation {
    generator: Matrix4<f64>,
    input: Matrix4x2<f64>,
    output: Matrix2<f64>,
}

/// The separated plant, sampled; arrays, because the simulation kernel reads them in its innermost loop.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SampledSeparation {
    /// Sample time.
    pub(crate) t: f64,
    /// Flexible states `[e, e']` to their next value.
    pub(crate) a: [[f64; 4]; 4],
    /// `u'` to the next flexible states.
    pub(crate) b: [[f64; 2]; 4],
    /// Deflections `e` to `y'`.
    pub(crate) c: [[f64; 2]; 2],
}

impl Separation {
    /// `position` is inside the stroke.
    pub(crate) fn new(machine: &Machine, position: f64) -> Self {
        let q = machine.parameters();
        let p = position;
        let e = Matrix4x2::new(1.0, 0.0, 0.0, 1.0, -1.0, 0.0, -p, -1.0);
        let flexibility = machine.inverse_mass() * e;
        let w = e.transpose() * flexibility;
        let k = Matrix2::from_diagonal(&[q.stiffness_y_n_per_m, q.stiffness_r_n_m_per_rad].into());
        let d = Matrix2::from_diagonal(&[q.damping_y_n_s_per_m, q.damping_r_n_m_s_per_rad].into());
        let mut generator = Matrix4::zeros();
        generator.fixed_view_mut::<2, 2>(0, 2).fill_with_identity();
        generator.fixed_view_mut::<2, 2>(2, 0).copy_from(&(-w * k));
        generator.fixed_view_mut::<2, 2>(2, 2).copy_from(&(-w * d));
        let [m0, m1, m2] = machine.rigid_mass_terms();
        let mut input = Matrix4x2::zeros();
        let on_beam = flexibility.transpose().fixed_columns::<2>(2).into_owned();
        input
            .fixed_view_mut::<2, 2>(2, 0)
            .copy_from(&(on_beam * (m0 + m1 * p + m2 * (p * p))));
        let sensor = Matrix2x4::new(1.0, -p, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0);
        // w = E^T M^-1 E is positive definite for positive masses; NaN stands for an overflow, which `sampled` refuses.
        let output = w
            .try_inverse()
            .map_or_else(|| Matrix2::repeat(f64::NAN), |i| sensor * flexibility * i);
        Self {
            generator,
            input,
            output,
        }
    }

    /// `[0, I; -W k, -W d]`, 4 x 4.
    pub(crate) fn flexible_generator(&self) -> DMatrix<f64> {
        DMatrix::from_column_slice(4, 4, self.generator.as_slice())
    }

    /// Exact sampling with held inputs.
    pub(crate) fn sampled(&self, clock: Discrete) -> Result<SampledSeparation, PlantError> {
        let dense =
            |rows: usize, columns: usize, values: &[f64]| DMatrix::from_column_slice(rows, columns, values);
        let output = Matrix2x4::from_fn(|i, j| if j < 2 { self.output[(i, j)] } else { 0.0 });
        let flexible = StateSpace::new(
            self.flexible_generator(),
            dense(4, 2, self.input.as_slice()),
            dense(2, 4, output.as_slice()),
            DMatrix::zeros(2, 2),
            Continuous,
        )?
        .zero_order_hold(clock)?;
        Ok(SampledSeparation {
            t: clock.sample_time(),
            a: std::array::from_fn(|i| std::array::from_fn(|j| flexible.a()[(i, j)])),
            b: std::array::from_fn(|i| std::array::from_fn(|j| flexible.b()[(i, j)])),
            c: std::array::from_fn(|i| std::array::from_fn(|j| flexible.c()[(i, j)])),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MachineParameters;

    #[test]
    fn the_separated_plant_is_the_plant() {
        let machine = MachineParameters::default().check().unwrap();
        let clock = Discrete::from_rate(20.0).unwrap();
        for p in machine.positions(5) {
            let s = Separation::new(&machine, p).sampled(clock).unwrap();
            let mut a = DMatrix::zeros(8, 8);
            let mut b = DMatrix::zeros(8, 2);
            let mut c = DMatrix::zeros(2, 8);
            for i in 0..4 {
                for j in 0..4 {
                    a[(4 + i, 4 + j)] = s.a[i][j];
                }
                for j in 0..2 {
                    b[(4 + i, j)] = s.b[i][j];
                }
            }
            for i in 0..2 {
                a[(i, i)] = 1.0;
                a[(i, i + 2)] = s.t;
                a[(i + 2, i + 2)] = 1.0;
                b[(i, i)] = 0.5 * s.t * s.t;
                b[(i + 2, i)] = s.t;
                c[(i, i)] = 1.0;
                for j in 0..2 {
                    c[(i, 4 + j)] = s.c[i][j];
                }
            }
            let ours = StateSpace::new(a, b, c, DMatrix::zeros(2, 2), clock).unwrap();
            let f: Vec<f64> = (1..=100).map(|k| 0.1 * f64::from(k)).collect();
            let truth = machine.sampled(p, clock).unwrap().frequency_response(&f).unwrap();
            let error = ours
                .frequency_response(&f)
                .unwrap()
                .relative_error(&truth)
                .unwrap();
            assert!(error.iter().all(|e| *e < 1e-9), "p = {p}: {error:?}");
        }
    }
}
