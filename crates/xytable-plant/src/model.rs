//! The machine as state space: five degrees of freedom (7), (8), and the decoupled plant (9), (10).

use crate::{Machine, PlantError};
use lpv_core::{Continuous, Discrete, LpvStateSpace, MatrixFunction, SchedulingRange, StateSpace};
use nalgebra::{DMatrix, Matrix2, Matrix4, Matrix4x2, Vector4};
use num_complex::Complex;

/// Coefficients of a polynomial in p: `M_0 + p M_1 + p^2 M_2`.
type Quadratic<M> = [M; 3];

impl Machine {
    /// The decoupled plant (10), `u' -> y'`: 8 states `[y1, R1, y2, R2]` and their rates, `u'` in m/s² and rad/s², `y'`
    /// in m and rad.
    ///
    /// `A(p)` is quadratic, `B'(p) = B T_u(p)` quadratic, `C'(p) = T_y(p) C` affine, `D = 0`.
    ///
    /// # Errors
    /// [`PlantError::Core`] if parameters are so extreme that a coefficient overflows.
    pub fn plant(&self) -> Result<LpvStateSpace<Continuous>, PlantError> {
        let m = self.inverse_mass();
        let b = self.rigid_mass_terms().map(|t| {
            let mut b = DMatrix::zeros(8, 2);
            let force = m * Matrix4x2::from_fn(|i, j| if i < 2 { 0.0 } else { t[(i - 2, j)] });
            b.view_mut((4, 0), (4, 2)).copy_from(&force);
            b
        });
        // (9): y'_1 = y1 - p R1, y'_2 = R1.
        let mut c = [DMatrix::zeros(2, 8), DMatrix::zeros(2, 8)];
        c[0][(0, 0)] = 1.0;
        c[1][(0, 1)] = -1.0;
        c[0][(1, 1)] = 1.0;
        Ok(LpvStateSpace::new(
            MatrixFunction::polynomial(self.beam_dynamics().to_vec())?,
            MatrixFunction::polynomial(b.to_vec())?,
            MatrixFunction::polynomial(c.to_vec())?,
            MatrixFunction::constant(DMatrix::zeros(2, 2))?,
            self.scheduling_range()?,
            Continuous,
        )?)
    }

    /// The mechanics (7), (8) with x1: 10 states `[x1, y1, R1, y2, R2]` and their rates, inputs
    /// `[F_x, F_left, F_right]` in N, outputs `[x1, y1, R1]`. The row of x1 is `m x1'' = F_x`.
    ///
    /// # Errors
    /// As [`Machine::plant`].
    pub fn mechanics(&self) -> Result<LpvStateSpace<Continuous>, PlantError> {
        let q = &self.parameters;
        // Position i of the four beam states is position i + 1 here, and rate 4 + i is rate 6 + i.
        let place = |i: usize| if i < 4 { i + 1 } else { i + 2 };
        let a = self.beam_dynamics().map(|small| {
            let mut a = DMatrix::zeros(10, 10);
            for i in 0..8 {
                for j in 0..8 {
                    a[(place(i), place(j))] = small[(i, j)];
                }
            }
            a
        });
        let mut a = a.to_vec();
        a[0][(0, 5)] = 1.0;
        let mut b = DMatrix::zeros(10, 3);
        b[(5, 0)] = 1.0 / q.servo_mass_kg;
        for (motor, arm) in [(1, -q.half_beam_m), (2, q.half_beam_m)] {
            b[(8, motor)] = 1.0 / q.beam_mass_kg;
            b[(9, motor)] = arm / q.beam_inertia_kg_m2;
        }
        Ok(LpvStateSpace::new(
            MatrixFunction::polynomial(a)?,
            MatrixFunction::constant(b)?,
            MatrixFunction::constant(DMatrix::identity(3, 10))?,
            MatrixFunction::constant(DMatrix::zeros(3, 3))?,
            self.scheduling_range()?,
            Continuous,
        )?)
    }

    /// The decoupled plant (10) at constant `position`.
    ///
    /// # Errors
    /// [`PlantError::Position`] outside the stroke; [`PlantError::Core`] on overflow.
    pub fn frozen(&self, position: f64) -> Result<StateSpace<Continuous>, PlantError> {
        let p = self.check_position(position)?;
        Ok(self.plant()?.frozen(&[p])?)
    }

    /// The decoupled plant at constant `position`, sampled with its input held between samples; exact.
    ///
    /// # Errors
    /// As [`Machine::frozen`].
    pub fn sampled(&self, position: f64, clock: Discrete) -> Result<StateSpace<Discrete>, PlantError> {
        Ok(self.frozen(position)?.zero_order_hold(clock)?)
    }

    /// The four poles of the flexible part at constant `position`, values of s, sorted by real and imaginary part.
    /// The other four poles are at the origin.
    ///
    /// # Errors
    /// As [`Machine::frozen`].
    pub fn flexible_poles(&self, position: f64) -> Result<Vec<Complex<f64>>, PlantError> {
        let separated = crate::separation::Separation::new(self, self.check_position(position)?);
        Ok(lpv_core::linalg::eigenvalues(&separated.flexible_generator())?)
    }

    /// The four poles of the sampled flexible part, `z = exp(s T)`, in the order of [`Machine::flexible_poles`].
    ///
    /// # Errors
    /// As [`Machine::frozen`].
    pub fn sampled_flexible_poles(
        &self,
        position: f64,
        clock: Discrete,
    ) -> Result<Vec<Complex<f64>>, PlantError> {
        let t = clock.sample_time();
        Ok(self
            .flexible_poles(position)?
            .into_iter()
            .map(|s| (s * t).exp())
            .collect())
    }

    /// The stroke as the scheduling range of the models.
    ///
    /// # Errors
    /// [`PlantError::Core`] if the stroke overflows.
    pub fn scheduling_range(&self) -> Result<SchedulingRange, PlantError> {
        let h = self.parameters.half_stroke_m;
        Ok(SchedulingRange::interval(-h, h)?)
    }

    /// Decoupling of the inputs: motor forces `[F_left, F_right]` in N from `u'`, a polynomial in p of degree 2:
    /// `T_u(p) = B_rb^-1 M_rb(p)`.
    pub fn input_decoupling(&self) -> Quadratic<Matrix2<f64>> {
        let l = self.parameters.half_beam_m;
        let inverse = Matrix2::new(0.5, -0.5 / l, 0.5, 0.5 / l);
        self.rigid_mass_terms().map(|m| inverse * m)
    }

    /// `M_rb(p) = [m1+m2, m1 p; m1 p, m1 p² + J1 + J2]`, one matrix for each power of p.
    pub(crate) fn rigid_mass_terms(&self) -> Quadratic<Matrix2<f64>> {
        let q = &self.parameters;
        let (m1, m2) = (q.carriage_mass_kg, q.beam_mass_kg);
        [
            Matrix2::new(m1 + m2, 0.0, 0.0, q.carriage_inertia_kg_m2 + q.beam_inertia_kg_m2),
            Matrix2::new(0.0, m1, m1, 0.0),
            Matrix2::new(0.0, 0.0, 0.0, m1),
        ]
    }

    pub(crate) fn inverse_mass(&self) -> Matrix4<f64> {
        let q = &self.parameters;
        let mass = [
            q.carriage_mass_kg,
            q.carriage_inertia_kg_m2,
            q.beam_mass_kg,
            q.beam_inertia_kg_m2,
        ];
        Matrix4::from_diagonal(&Vector4::from(mass.map(f64::recip)))
    }

    /// `[0, I; -M^-1 K(p), -M^-1 D(p)]`, one matrix for each power of p.
    ///
    /// The column of E for e_y is `a + p b`, so `E diag(k) E^T` has the three terms `k_y a a^T + k_r c c^T`,
    /// `k_y (a b^T + b a^T)` and `k_y b b^T`.
    fn beam_dynamics(&self) -> Quadratic<DMatrix<f64>> {
        let q = &self.parameters;
        let a = Vector4::new(1.0, 0.0, -1.0, 0.0);
        let b = Vector4::new(0.0, 0.0, 0.0, -1.0);
        let c = Vector4::new(0.0, 1.0, 0.0, -1.0);
        let terms = |y: f64, r: f64| {
            [
                a * a.transpose() * y + c * c.transpose() * r,
                (a * b.transpose() + b * a.transpose()) * y,
                b * b.transpose() * y,
            ]
        };
        let stiffness = terms(q.stiffness_y_n_per_m, q.stiffness_r_n_m_per_rad);
        let damping = terms(q.damping_y_n_s_per_m, q.damping_r_n_m_s_per_rad);
        let minus = -self.inverse_mass();
        [0, 1, 2].map(|i: usize| {
            let mut a = DMatrix::zeros(8, 8);
            if i == 0 {
                a.view_mut((0, 4), (4, 4)).fill_with_identity();
            }
            a.view_mut((4, 0), (4, 4)).copy_from(&(minus * stiffness[i]));
            a.view_mut((4, 4), (4, 4)).copy_from(&(minus * damping[i]));
            a
        })
    }
}
