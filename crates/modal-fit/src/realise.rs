//! The state space of a modal model.

use crate::model::{Modal, Rigid, Section};
use lpv_core::{CoreError, Discrete, StateSpace};
use nalgebra::DMatrix;

impl Modal {
    /// The state space: two states a complex pole and rank, one a real one, a chain a rank of the rigid body.
    pub(crate) fn state_space(&self, clock: Discrete) -> Result<StateSpace<Discrete>, CoreError> {
        let (n_y, n_u) = self.shape;
        let t = clock.sample_time();
        let rigid = self.rigid.as_ref().map_or(0, |(kind, c, _)| match kind {
            Rigid::One => c.ncols(),
            Rigid::Two => 2 * c.ncols(),
        });
        let of = |s: &Section| if s.pole.im == 0.0 { 1 } else { 2 };
        let n = rigid + self.sections.iter().map(|s| of(s) * s.c.ncols()).sum::<usize>();
        let (mut a, mut b, mut c) = (
            DMatrix::zeros(n, n),
            DMatrix::zeros(n, n_u),
            DMatrix::zeros(n_y, n),
        );
        let mut at = 0;
        if let Some((kind, own_c, own_b)) = &self.rigid {
            for l in 0..own_c.ncols() {
                let drive = own_b.column(l).transpose();
                c.column_mut(at).copy_from(&own_c.column(l));
                a[(at, at)] = 1.0;
                match kind {
                    Rigid::One => b.row_mut(at).copy_from(&(drive * t)),
                    Rigid::Two => {
                        a[(at, at + 1)] = t;
                        a[(at + 1, at + 1)] = 1.0;
                        b.row_mut(at).copy_from(&(&drive * (0.5 * t * t)));
                        b.row_mut(at + 1).copy_from(&(drive * t));
                        at += 1;
                    }
                }
                at += 1;
            }
        }
        for s in &self.sections {
            for l in 0..s.c.ncols() {
                a[(at, at)] = s.pole.re;
                for j in 0..n_u {
                    b[(at, j)] = s.b[(j, l)].re;
                }
                let pair = s.pole.im != 0.0;
                for i in 0..n_y {
                    c[(i, at)] = if pair { 2.0 } else { 1.0 } * s.c[(i, l)].re;
                }
                if pair {
                    (a[(at, at + 1)], a[(at + 1, at)], a[(at + 1, at + 1)]) =
                        (-s.pole.im, s.pole.im, s.pole.re);
                    for j in 0..n_u {
                        b[(at + 1, j)] = s.b[(j, l)].im;
                    }
                    for i in 0..n_y {
                        c[(i, at + 1)] = -2.0 * s.c[(i, l)].im;
                    }
                    at += 1;
                }
                at += 1;
            }
        }
        let d = self.direct.clone().unwrap_or_else(|| DMatrix::zeros(n_y, n_u));
        StateSpace::new(a, b, c, d, clock)
    }
}
