//! A servo axis from its records by least squares: free, or on a spring to ground (a flexure, a piezo stage, a mass on a spring).

use crate::catalogue::LEAST_TURN;
use crate::inverse::{Moved, of_size_one};
use crate::track::turn_in;
use crate::{Axis, Base, TraceError};
use lpv_core::linalg::svd;
use lpv_core::{Discrete, Record};
use lpv_numerics::statistics::range;
use lti_ident::rigid_body::{Estimator, Filter, RigidBodySettings};
use lti_ident::{LtiIdentError, Segment};
use nalgebra::DVector;
use std::f64::consts::TAU;

/// A free axis, or one on a spring to ground where that leaves much less of the force; its reason joins `reasons`.
///
/// # Errors
/// [`TraceError::Lti`] for records that do not determine the mass, or for an input with the sign of the other direction.
pub fn servo_axis(
    records: &[Record],
    clock: Discrete,
    reasons: &mut Vec<String>,
) -> Result<Base, TraceError> {
    /// Part of the force that a free axis leaves which one on a spring may leave.
    const LEFT: f64 = 0.5;
    // What is wrong with the records, the free axis says.
    let sprung = on_spring(records, clock);
    let better = |found: &Found| found.left < LEFT * found.left_free;
    let (sprung, reversed): (Option<_>, Option<_>) = match sprung {
        Some(found) if found.is_reversed() => (None, Some(found)),
        other => (other, None),
    };
    if let (Some(found), [record, ..]) = (reversed.filter(|r| better(r)), records) {
        return Err(LtiIdentError::OppositeSigns {
            input: record.inputs.names[0].clone(),
            output: record.outputs.names[0].clone(),
            inertia: found.axis.mass(),
            deviation: found.deviation,
        }
        .into());
    }
    let free = free_axis(records, clock);
    match (sprung, free) {
        (Some(found), Err(_)) => Ok(found.held(reasons)),
        (Some(found), Ok(_)) if better(&found) => Ok(found.held(reasons)),
        (_, free) => free,
    }
}

/// A free axis by the force below a frequency, where `base` is one and was found in a wider band: an input that comes late, or a noise that
/// is not white, leaves little of an inertia above. None where there is no other.
pub fn axis_in_band(base: &Base, records: &[Record], clock: Discrete, most_hz: f64) -> Option<Base> {
    let positions: Vec<&[f64]> = records.iter().map(|r| r.outputs.columns[0].as_slice()).collect();
    let wide = Filter::new(&positions, clock, &RigidBodySettings::default()).ok()?;
    let is_free = matches!(base, Base::Axis(axis) if axis.stiffness().is_none());
    if !is_free || wide.regression_cutoff_hz <= most_hz {
        return None;
    }
    let settings = RigidBodySettings {
        regression_cutoff_hz: Some(most_hz),
        estimator: Estimator::LeastSquares,
        dry_friction: true,
        ..RigidBodySettings::default()
    };
    let segments: Vec<Segment<'_>> = records.iter().map(Segment::whole).collect();
    let found = lti_ident::rigid_body::identify(&segments, clock, &settings).ok()?;
    let axis = found.model.axes()[0];
    Some(Base::Axis(Axis::new(axis.inertia, axis.viscous, axis.offset)))
}

fn free_axis(records: &[Record], clock: Discrete) -> Result<Base, TraceError> {
    let segments: Vec<Segment<'_>> = records.iter().map(Segment::whole).collect();
    let identify = |dry_friction: bool| {
        let settings = RigidBodySettings {
            dry_friction,
            ..RigidBodySettings::default()
        };
        lti_ident::rigid_body::identify(&segments, clock, &settings)
    };
    // Friction that is larger than the inertial force makes the inertia negative where it is left out.
    let found = identify(false).or_else(|error| match error {
        LtiIdentError::Inertia { .. } => identify(true).map_err(|_| error),
        _ => Err(error),
    })?;
    let axis = found.model.axes()[0];
    Ok(Base::Axis(Axis::new(axis.inertia, axis.viscous, axis.offset)))
}

/// What least squares says of the inverse dynamics `J q'' + F_v q' + k q + o = u`.
struct Found {
    axis: Axis,
    stiffness: f64,
    /// Standard deviation of the mass.
    deviation: f64,
    /// Root mean square of the force that is left, over that of the force.
    left: f64,
    /// The same without the spring.
    left_free: f64,
}

impl Found {
    /// Whether mass and stiffness are both below zero: what the input pushes up goes down.
    fn is_reversed(&self) -> bool {
        self.stiffness < 0.0
    }

    /// The base, with the reason for it.
    fn held(self, reasons: &mut Vec<String>) -> Base {
        reasons.push(format!(
            "base: an axis on a spring to ground leaves {:.1} % of the force, a free axis {:.1} %",
            100.0 * self.left,
            100.0 * self.left_free
        ));
        Base::Axis(self.axis.on_spring(self.stiffness))
    }
}

/// The axis of some records; none where these do not tell one, or mass and stiffness have not the same sign.
fn on_spring(records: &[Record], clock: Discrete) -> Option<Found> {
    let signals: Option<Vec<[&[f64]; 2]>> = records
        .iter()
        .map(|r| {
            Some([
                r.outputs.columns.first()?.as_slice(),
                r.inputs.columns.first()?.as_slice(),
            ])
        })
        .collect();
    let angle = records
        .first()
        .and_then(|r| turn_in(r.outputs.units.first()?))
        .filter(|turn| {
            let travels = records
                .iter()
                .map(|r| range(&r.outputs.columns[0]))
                .map(|(low, high)| high - low);
            travels.fold(0.0, f64::max) > LEAST_TURN * turn
        })
        .map(|turn| TAU / turn);
    let mut columns: [Vec<f64>; 4] = Default::default();
    let mut gravity: [Vec<f64>; 2] = Default::default();
    let mut square = Vec::new();
    let mut force = Vec::new();
    for moved in Moved::of(&signals?, clock)? {
        let [q, v, a] = moved.motion();
        for (column, signal) in columns.iter_mut().zip([a, v, q]) {
            column.extend(moved.reduced(signal)?);
        }
        if let Some(angle) = angle {
            let (sine, cosine): (Vec<f64>, Vec<f64>) = q.iter().map(|q| (angle * q).sin_cos()).unzip();
            gravity[0].extend(moved.reduced(&sine)?);
            gravity[1].extend(moved.reduced(&cosine)?);
            square.extend(moved.reduced(&q.iter().map(|q| q * q).collect::<Vec<_>>())?);
        }
        force.extend_from_slice(moved.pushed());
    }
    columns[3] = vec![1.0; force.len()];
    let solved = |columns: &[&Vec<f64>]| {
        let (rows, sizes) = of_size_one(columns, force.len())?;
        let target = DVector::from_column_slice(&force);
        let svd = svd(rows.clone()).ok()?;
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
        return None;
    };
    /// Part of what a spring leaves that gravity must leave less to be meant: over few degrees they are the same.
    const LESS: f64 = 0.98;
    // An arm that hangs from its axis comes back as one on a spring does, one that softens among them.
    let [sine, cosine] = &gravity;
    let left_of = |columns: &[&Vec<f64>]| solved(columns).map_or(f64::INFINITY, |(_, _, left)| left);
    let is_arm = angle.is_some()
        && left_of(&[a, v, sine, cosine, one]) < LESS * left.min(left_of(&[a, v, q, &square, one]));
    let fits = held[0] * held[2] > 0.0 && left.is_finite() && !is_arm;
    fits.then(|| Found {
        axis: Axis::new(held[0], held[1], held[3]),
        stiffness: held[2],
        deviation,
        left,
        left_free,
    })
}
