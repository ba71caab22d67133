//! A model along the records, in the loop, with the sensitivities of its outputs.

use super::data::{MovingData, MovingRecord};
use super::flow::{Want, add_product, multiply};
use crate::problem::Linear;
use lpv_core::linalg::least_squares;
use lpv_numerics::dense::Triangle;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// A model that can be taken from sample to sample.
pub(crate) trait Dynamics: Sync {
    /// Storage of one step, used again for the next.
    type Step: AsRef<Transition>;

    fn states(&self) -> usize;
    fn parameters(&self) -> usize;
    fn storage(&self, record: &MovingRecord) -> Self::Step;

    /// From sample `k` of a record to the next. None where the model does not exist.
    fn step(&self, record: &MovingRecord, k: usize, want: Want, step: &mut Self::Step) -> Option<()>;

    /// Adds the derivative of `y = C x` by the parameters at constant x, `n_y x n_theta`.
    fn add_output(&self, step: &Self::Step, x: &DVector<f64>, sensitivity: &mut DMatrix<f64>);

    /// Adds the derivative of `x+ = A x + B u` by the parameters at the constant `signal = [x; u]`, `n x n_theta`.
    fn force(&self, step: &mut Self::Step, signal: &DVector<f64>, sensitivity: &mut DMatrix<f64>);
}

/// `x+ = A x + B u`, `y = C x`.
pub(crate) struct Transition {
    /// `[A B]`, `n x (n + n_u)`.
    pub(crate) ab: DMatrix<f64>,
    pub(crate) c: DMatrix<f64>,
}

/// What the errors of one record say about the parameters: `r + J dtheta`, compressed, the first state eliminated.
pub(crate) struct Row {
    pub(crate) jacobian: DMatrix<f64>,
    pub(crate) residual: DVector<f64>,
    /// Sum of squares in units of the noise.
    pub(crate) cost: f64,
}

/// Samples between two factorisations.
const CHUNK: usize = 128;

/// An error this many times the largest output is a model that has run away.
const AWAY: f64 = 1e3;

/// All records, in order.
pub(crate) fn rows<D: Dynamics>(dynamics: &D, data: &MovingData, want: Want) -> Option<Vec<Row>> {
    data.records()
        .par_iter()
        .map(|record| row(dynamics, data, record, want))
        .collect()
}

/// `y_rec - y`, `n_y x N`, of each record; where the first state is unknown, the one that fits best.
pub(crate) fn errors<D: Dynamics>(dynamics: &D, data: &MovingData) -> Option<Vec<DMatrix<f64>>> {
    data.records()
        .par_iter()
        .map(|record| {
            let start = first_state(dynamics, data, record)?;
            let mut errors = DMatrix::zeros(record.outputs.nrows(), record.len());
            walk(dynamics, data, record, &start, Walk::values(), |k, e, _| {
                errors.set_column(k, e);
            })?;
            Some(errors)
        })
        .collect()
}

/// The state in which a record begins: rest, or where the machine did not rest the one that fits best.
fn first_state<D: Dynamics>(dynamics: &D, data: &MovingData, record: &MovingRecord) -> Option<DVector<f64>> {
    let (n, ny) = (dynamics.states(), record.outputs.nrows());
    let rest = DVector::zeros(n);
    if record.at_rest {
        return Some(rest);
    }
    let mut whole = DMatrix::zeros(record.len() * ny, n + 1);
    walk(dynamics, data, record, &rest, Walk::first_state(), |k, e, s| {
        for i in 0..ny {
            let scale = 1.0 / data.noise()[i];
            for j in 0..n {
                whole[(k * ny + i, j)] = s[(i, j)] * scale;
            }
            whole[(k * ny + i, n)] = e[i] * scale;
        }
    })?;
    let (observed, right) = (whole.columns(0, n).into_owned(), whole.column(n).into_owned());
    let start = least_squares(observed, &right, 1e-12).ok()?;
    Some(start.column(0).into_owned())
}

/// The rows of all records on top of each other.
pub(crate) fn stacked(rows: Vec<Row>) -> Linear {
    let columns = rows.first().map_or(0, |r| r.jacobian.ncols());
    let height = rows.iter().map(|r| r.jacobian.nrows()).sum();
    let mut linear = Linear {
        jacobian: DMatrix::zeros(height, columns),
        residual: DVector::zeros(height),
        factorisations: rows.len(),
        chains: Vec::new(),
    };
    let mut at = 0;
    for row in rows {
        let size = row.jacobian.nrows();
        linear.jacobian.rows_mut(at, size).copy_from(&row.jacobian);
        linear.residual.rows_mut(at, size).copy_from(&row.residual);
        at += size;
    }
    linear
}

fn row<D: Dynamics>(dynamics: &D, data: &MovingData, record: &MovingRecord, want: Want) -> Option<Row> {
    let ny = record.outputs.nrows();
    let first = if record.at_rest { 0 } else { dynamics.states() };
    let parameters = if want == Want::Derivative {
        dynamics.parameters()
    } else {
        0
    };
    let columns = first + parameters + 1;
    let start = first_state(dynamics, data, record)?;
    if parameters == 0 {
        let mut cost = 0.0;
        walk(dynamics, data, record, &start, Walk::values(), |_, e, _| {
            cost += e
                .iter()
                .zip(data.noise())
                .map(|(e, s)| (e / s).powi(2))
                .sum::<f64>();
        })?;
        return cost.is_finite().then(|| Row {
            jacobian: DMatrix::zeros(0, 0),
            residual: DVector::zeros(0),
            cost,
        });
    }
    let mut triangle = Triangle::new(columns, CHUNK * ny);
    let mut filled = 0;
    let wanted = Walk {
        first_state: !record.at_rest,
        parameters: want == Want::Derivative,
    };
    walk(dynamics, data, record, &start, wanted, |_, e, s| {
        for i in 0..ny {
            let scale = 1.0 / data.noise()[i];
            // The error falls where the output rises.
            for j in 0..columns - 1 {
                triangle.column_mut(j)[filled] = -s[(i, j)] * scale;
            }
            triangle.column_mut(columns - 1)[filled] = e[i] * scale;
            filled += 1;
        }
        if filled == CHUNK * ny {
            triangle.absorb(filled);
            filled = 0;
        }
    })?;
    if filled > 0 {
        triangle.absorb(filled);
    }
    let r = triangle.factor();
    let rest = columns - 1 - first;
    let residual = r.view((first, columns - 1), (rest + 1, 1)).column(0).into_owned();
    let mut jacobian = DMatrix::zeros(rest + 1, rest);
    jacobian
        .rows_mut(0, rest)
        .copy_from(&r.view((first, first), (rest, rest)));
    let cost = residual.norm_squared();
    cost.is_finite().then_some(Row {
        jacobian,
        residual,
        cost,
    })
}

/// Which sensitivities to carry: to the first state, then to the parameters.
#[derive(Clone, Copy)]
struct Walk {
    first_state: bool,
    parameters: bool,
}

impl Walk {
    fn values() -> Self {
        Self {
            first_state: false,
            parameters: false,
        }
    }
    fn first_state() -> Self {
        Self {
            first_state: true,
            parameters: false,
        }
    }
}

/// Visits the error `y_rec - y` and the sensitivities of y, sample by sample.
fn walk<D: Dynamics>(
    dynamics: &D,
    data: &MovingData,
    record: &MovingRecord,
    start: &DVector<f64>,
    wanted: Walk,
    mut visit: impl FnMut(usize, &DVector<f64>, &DMatrix<f64>),
) -> Option<()> {
    let (n, nu, ny) = (dynamics.states(), record.inputs.nrows(), record.outputs.nrows());
    let first = if wanted.first_state { n } else { 0 };
    let parameters = if wanted.parameters {
        dynamics.parameters()
    } else {
        0
    };
    let columns = first + parameters;
    let want = if wanted.parameters {
        Want::Derivative
    } else {
        Want::Value
    };
    let k = data.feedback();
    let nf = k.states();
    let limit = AWAY * record.outputs.amax().max(f64::MIN_POSITIVE);

    let mut step = dynamics.storage(record);
    let mut f = DVector::zeros(nf);
    // [x; u] and, a column a parameter, their sensitivities.
    let mut signal = DVector::zeros(n + nu);
    let mut x = start.clone();
    let mut moved = DMatrix::zeros(n + nu, columns);
    let mut sx = DMatrix::zeros(n, columns);
    sx.view_mut((0, 0), (first, first)).fill_with_identity();
    let (mut sf, mut next_f) = (DMatrix::zeros(nf, columns), DMatrix::zeros(nf, columns));
    let (mut sy, mut su) = (DMatrix::zeros(ny, columns), DMatrix::zeros(nu, columns));
    let mut forced = DMatrix::zeros(n, parameters);
    let mut direct = DMatrix::zeros(ny, parameters);
    let mut e = DVector::zeros(ny);
    for sample in 0..record.len() {
        dynamics.step(record, sample, want, &mut step)?;
        e.copy_from(&record.outputs.column(sample));
        e.gemv(-1.0, &step.as_ref().c, &x, 1.0);
        if columns > 0 {
            multiply(&step.as_ref().c, &sx, &mut sy);
            if parameters > 0 {
                direct.fill(0.0);
                dynamics.add_output(&step, &x, &mut direct);
                let mut part = sy.columns_mut(first, parameters);
                part += &direct;
            }
        }
        visit(sample, &e, &sy);
        let error = e.amax();
        if error.is_nan() || error > limit {
            return None;
        }
        signal.rows_mut(0, n).copy_from(&x);
        let mut u = signal.rows_mut(n, nu);
        u.copy_from(&record.inputs.column(sample));
        u.gemv(1.0, k.c(), &f, 1.0);
        u.gemv(1.0, k.d(), &e, 1.0);
        if columns > 0 {
            multiply(k.c(), &sf, &mut su);
            add_product(-1.0, k.d(), &sy, &mut su);
            multiply(k.a(), &sf, &mut next_f);
            add_product(-1.0, k.b(), &sy, &mut next_f);
            std::mem::swap(&mut sf, &mut next_f);
            moved.rows_mut(0, n).copy_from(&sx);
            moved.rows_mut(n, nu).copy_from(&su);
            multiply(&step.as_ref().ab, &moved, &mut sx);
            if parameters > 0 {
                forced.fill(0.0);
                dynamics.force(&mut step, &signal, &mut forced);
                let mut part = sx.columns_mut(first, parameters);
                part += &forced;
            }
        }
        f = k.a() * &f + k.b() * &e;
        x.gemv(1.0, &step.as_ref().ab, &signal, 0.0);
    }
    Some(())
}
