//! Inverse dynamics of an axis with its effects: the force that a motion needs.

use crate::base::{Axis, Base, Motion, Pair};
use crate::effect::{Effect, Family, Scale};
use crate::fit::Explained;
use crate::track::Track;
use lpv_core::Discrete;
use lpv_core::linalg::least_squares;
use lti_ident::rigid_body::{self, Filter, RigidBodySettings};
use nalgebra::{DMatrix, DVector};

impl Explained {
    /// Force of the motor of an axis along a motion of its encoder: positions, speeds and accelerations by sample of a record. Effects with
    /// states of their own stay at their start. None for other machines.
    pub fn inverse_dynamics(&self, track: &Track, motion: [&[f64]; 3]) -> Option<Vec<f64>> {
        let Base::Axis(axis) = &self.base else {
            return None;
        };
        let [q, v, _] = motion;
        let at = |(q, v): (&f64, &f64)| Motion {
            motor_position: [*q, 0.0],
            motor_speed: [*v, 0.0],
            load_position: [*q, 0.0],
            load_speed: [*v, 0.0],
            deflection: [0.0; 2],
        };
        let motions: Vec<Motion> = q.iter().zip(v).map(at).collect();
        let effects = self.forces_along(track, &motions);
        let forces = axis.force_along(motion, track.step).into_iter().zip(effects);
        Some(forces.map(|(force, effect)| force - effect[0]).collect())
    }

    /// Sum of the squared force that it leaves of the input of a record, in the band of the acceleration; none for other machines than an axis.
    pub(crate) fn force_left(&self, track: &Track) -> Option<f64> {
        let [moved] = <[Moved; 1]>::try_from(Moved::all(std::slice::from_ref(track))?).ok()?;
        let told = moved.reduced(&self.inverse_dynamics(track, moved.motion())?)?;
        let left = moved.pushed.iter().zip(&told).map(|(a, b)| (a - b).powi(2));
        Some(left.sum())
    }

    /// The same machine with the parameters of a rigid axis, and the amplitudes of its effects, by least squares of the force of the inverse
    /// dynamics along what was measured: a start that does not depend on where the present model is. None for other machines, where the
    /// records do not tell, and where an amplitude would be below nothing.
    pub(crate) fn by_its_force(&self, tracks: &[Track], moved: &[Moved]) -> Option<Self> {
        let Base::Axis(axis) = &self.base else {
            return None;
        };
        let units = axis.units()?;
        let amplitudes = self.units_of_effects(axis);
        let mut rows: Vec<Vec<f64>> = vec![Vec::new(); units.len() + amplitudes.len()];
        let mut force = Vec::new();
        for (track, moved) in tracks.iter().zip(moved) {
            let own = units
                .iter()
                .map(|unit| unit.force_along(moved.motion(), track.step));
            let effects = amplitudes
                .iter()
                .map(|unit| unit.inverse_dynamics(track, moved.motion()));
            for (column, row) in own.map(Some).chain(effects).zip(&mut rows) {
                row.extend(moved.reduced(&column?)?);
            }
            force.extend_from_slice(&moved.pushed);
        }
        let found = solved(&rows, &force)?;
        let (base, amplitudes) = found.split_at(units.len());
        let mut rest = amplitudes.iter();
        let mut other = Self {
            base: Base::Axis(axis.with_parameters(base)?),
            ..self.clone()
        };
        for (effect, values) in &mut other.effects {
            for (v, p) in values
                .iter_mut()
                .zip(effect.parameters)
                .filter(|(_, p)| p.scale.is_amplitude())
            {
                *v = *rest.next()?;
                if p.scale == Scale::NotNegative && *v < 0.0 {
                    return None;
                }
            }
        }
        Some(other)
    }

    /// Each amplitude of its effects alone, as one, on an axis of nothing.
    fn units_of_effects(&self, axis: &Axis) -> Vec<Self> {
        let units = self.effects.iter().flat_map(|(effect, values)| {
            let is_amplitude = |i: &usize| effect.parameters[*i].scale.is_amplitude();
            let which: Vec<usize> = (0..values.len()).filter(is_amplitude).collect();
            let alone = |one: &usize| {
                let mut values = values.clone();
                which
                    .iter()
                    .for_each(|i| values[*i] = if i == one { 1.0 } else { 0.0 });
                (*effect, values)
            };
            which.iter().map(alone).collect::<Vec<_>>()
        });
        let alone = |effect| Self {
            base: Base::Axis(axis.of_nothing()),
            effects: vec![effect],
        };
        units.map(alone).collect()
    }

    /// Whether its last effect is a force of the motion alone, which the inverse dynamics tell.
    pub(crate) fn ends_with_a_force(&self) -> bool {
        self.ends_with([Family::Friction, Family::PositionForce])
    }

    /// Whether its last effect is a force of motion and time, which the inverse dynamics of a start tell.
    pub(crate) fn starts_with_a_force(&self) -> bool {
        self.ends_with([Family::Structure, Family::Disturbance]) || self.ends_with_a_force()
    }

    fn ends_with(&self, families: [Family; 2]) -> bool {
        let is_of_motion = |(e, v): &(&Effect, Vec<f64>)| (e.block)(v, &self.base, e.place).states() == 0;
        let last = self.effects.last();
        last.is_some_and(|last| families.contains(&last.0.family) && is_of_motion(last))
    }
}

/// The motion of an axis that a record shows, and the force that drove it, both in the band of the acceleration.
pub(crate) struct Moved {
    filter: Filter,
    clock: Discrete,
    motion: rigid_body::Motion,
    /// The input, reduced.
    pushed: Vec<f64>,
}

impl Moved {
    /// Of positions and inputs of the same axis, record by record, in one band; none where they do not tell one.
    pub(crate) fn of(records: &[[&[f64]; 2]], clock: Discrete) -> Option<Vec<Self>> {
        let positions: Vec<&[f64]> = records.iter().map(|[q, _]| *q).collect();
        let filter = Filter::new(&positions, clock, &RigidBodySettings::default()).ok()?;
        let one = |[q, u]: &[&[f64]; 2]| {
            Some(Self {
                motion: rigid_body::Motion::new(q, clock, filter.position_cutoff_hz).ok()?,
                pushed: filter.held(u, clock).ok()?,
                filter,
                clock,
            })
        };
        records.iter().map(one).collect()
    }

    /// Of the first channels of tracks.
    pub(crate) fn all(tracks: &[Track]) -> Option<Vec<Self>> {
        let first = |pairs: &[Pair]| pairs.iter().map(|v| v[0]).collect::<Vec<f64>>();
        let clock = Discrete::new(tracks.first()?.step).ok()?;
        let signals: Vec<[Vec<f64>; 2]> = tracks
            .iter()
            .map(|t| [first(&t.outputs), first(&t.inputs)])
            .collect();
        let signals: Vec<[&[f64]; 2]> = signals.iter().map(|s| s.each_ref().map(Vec::as_slice)).collect();
        Self::of(&signals, clock)
    }

    /// Positions, speeds and accelerations by sample.
    pub(crate) fn motion(&self) -> [&[f64]; 3] {
        [
            &self.motion.position,
            &self.motion.velocity,
            &self.motion.acceleration,
        ]
    }

    /// The input, behind both filters.
    pub(crate) fn pushed(&self) -> &[f64] {
        &self.pushed
    }

    /// A signal along the motion, behind the filter of the equations.
    pub(crate) fn reduced(&self, force: &[f64]) -> Option<Vec<f64>> {
        self.filter.reduced(force, self.clock).ok()
    }
}

/// Least squares of a target; none where a column is nothing or too little is known.
fn solved(columns: &[Vec<f64>], target: &[f64]) -> Option<Vec<f64>> {
    let columns: Vec<&Vec<f64>> = columns.iter().collect();
    let (rows, sizes) = of_size_one(&columns, target.len())?;
    let found = least_squares(rows, &DVector::from_column_slice(target), 1e-9).ok()?;
    Some(found.iter().zip(&sizes).map(|(v, s)| v / s).collect())
}

/// Columns of a regression of size one, since units of position and force are the user's, and their sizes; none where one is nothing, or where
/// so many rows are too few.
pub(crate) fn of_size_one(columns: &[&Vec<f64>], rows: usize) -> Option<(DMatrix<f64>, Vec<f64>)> {
    let size = |column: &&Vec<f64>| column.iter().map(|v| v * v).sum::<f64>().sqrt();
    let sizes: Vec<f64> = columns.iter().map(size).collect();
    if rows < 4 * columns.len() || sizes.iter().any(|s| !(s.is_finite() && *s > 0.0)) {
        return None;
    }
    let of_one = DMatrix::from_fn(rows, columns.len(), |k, j| columns[j][k] / sizes[j]);
    Some((of_one, sizes))
}
