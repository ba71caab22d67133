//! An axis on a spring to ground: a flexure, a piezo stage, a mass on a spring.

use crate::PipelineError;
use lpv_core::nalgebra::{DMatrix, DVector};
use lpv_core::{Discrete, Record};
use lti_ident::rigid_body::{Filter, Motion, RigidBodySettings, centred, decimated};
use residual_trace::{Axis, Base};

/// What least squares says of the inverse dynamics `J q'' + F_v q' + k q + o = u`.
pub(super) struct Found {
    axis: Axis,
    stiffness: f64,
    /// Standard deviation of the mass.
    pub(super) deviation: f64,
    /// Root mean square of the force that is left, over that of the force.
    pub(super) left: f64,
    /// The same without the spring.
    pub(super) left_free: f64,
}

impl Found {
    /// Whether mass and stiffness are both below zero: what the input pushes up goes down.
    pub(super) fn is_reversed(&self) -> bool {
        self.stiffness < 0.0
    }

    /// The mass.
    pub(super) fn mass(&self) -> f64 {
        self.axis.mass()
    }

    /// The base, with the reason for it.
    pub(super) fn held(self, reasons: &mut Vec<String>) -> Base {
        reasons.push(format!(
            "base: an axis on a spring to ground leaves {:.1} % of the force, a free axis {:.1} %",
            100.0 * self.left,
            100.0 * self.left_free
        ));
        Base::Axis(self.axis.on_spring(self.stiffness))
    }
}

/// The axis of some records; none where mass and stiffness have not the same sign.
pub(super) fn axis(records: &[Record], clock: Discrete) -> Result<Option<Found>, PipelineError> {
    let positions: Vec<&[f64]> = records
        .iter()
        .filter_map(|r| r.outputs.columns.first())
        .map(Vec::as_slice)
        .collect();
    let filter = Filter::new(&positions, clock, &RigidBodySettings::new().check()?);
    let kept = |x: &[f64]| decimated(x, clock, filter.regression_cutoff_hz, filter.decimation);
    let mut columns: [Vec<f64>; 4] = Default::default();
    let mut force = Vec::new();
    for record in records {
        let (Some(q), Some(u)) = (record.outputs.columns.first(), record.inputs.columns.first()) else {
            return Ok(None);
        };
        let motion = Motion::new(q, clock, filter.position_cutoff_hz)?;
        for (column, signal) in
            columns
                .iter_mut()
                .zip([&motion.acceleration, &motion.velocity, &motion.position])
        {
            column.extend(kept(signal)?);
        }
        force.extend(kept(&centred(u))?);
    }
    columns[3] = vec![1.0; force.len()];
    let solved = |columns: &[&Vec<f64>]| {
        // Columns of size one: units of position and force are the user's.
        let sizes: Vec<f64> = columns.iter().map(|c| norm(c)).collect();
        if force.len() < 4 * columns.len() || sizes.iter().any(|s| !(s.is_finite() && *s > 0.0)) {
            return None;
        }
        let rows = DMatrix::from_fn(force.len(), columns.len(), |k, j| columns[j][k] / sizes[j]);
        let target = DVector::from_column_slice(&force);
        let svd = rows.clone().svd(true, true);
        let found = svd.solve(&target, 1e-12).ok()?;
        let left = (&target - rows * &found).norm();
        let values: Vec<f64> = found.iter().zip(&sizes).map(|(v, s)| v / s).collect();
        // Of the first, whose row of V over the singular values has this norm.
        let spread = svd.v_t.as_ref().map_or(0.0, |v_t| {
            let parts = (0..columns.len()).map(|j| (v_t[(j, 0)] / svd.singular_values[j]).powi(2));
            parts.sum::<f64>().sqrt()
        });
        let deviation = spread * left / ((force.len() - columns.len()) as f64).sqrt() / sizes[0];
        Some((values, deviation, left / target.norm()))
    };
    let [a, v, q, one] = &columns;
    let (Some((held, deviation, left)), Some((_, _, left_free))) =
        (solved(&[a, v, q, one]), solved(&[a, v, one]))
    else {
        return Ok(None);
    };
    let fits = held[0] * held[2] > 0.0 && left.is_finite();
    Ok(fits.then(|| Found {
        axis: Axis::new(held[0], held[1], held[3]),
        stiffness: held[2],
        deviation,
        left,
        left_free,
    }))
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|v| v * v).sum::<f64>().sqrt()
}
