//! How far an effect shows, without any solver: what the machine does beside what a clean one would do with the same commands.

use super::{AxisRun, ServoAxis};
use crate::PlantError;
use lpv_core::linalg::least_squares;
use nalgebra::{DMatrix, DVector};

/// What is known of the clean machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Known {
    /// Neither mass nor viscous friction, force at rest, and stiffness of a flexure: an identification would fit them.
    Nothing,
    /// All of these: for effects that are parameters of the machine.
    Machine,
}

/// Root mean square over some records of the position that the effect adds to the answer to the same commands, m, least over position
/// and speed at the beginning of each record and over what is not known of the machine.
///
/// # Errors
/// [`PlantError::Diverged`]; of a regression that is not finite.
pub fn deviation(machine: &ServoAxis, runs: &[AxisRun], speed: f64, known: Known) -> Result<f64, PlantError> {
    let samples: usize = runs.iter().map(|r| r.inputs.len()).sum();
    let mut columns: Vec<Vec<f64>> = Vec::new();
    let mut added = Vec::with_capacity(samples);
    let mut shared: Vec<Vec<f64>> = Vec::new();
    let mut before = 0;
    for run in runs {
        let length = run.inputs.len();
        let [q, next] = [run.motor[0], run.motor.get(1).copied().unwrap_or(run.motor[0])];
        let start = [q, (next - q) * machine.rate_hz];
        let answer = |m: &ServoAxis, start: [f64; 2]| -> Result<Vec<f64>, PlantError> {
            Ok(m.answer(&run.inputs, start, speed)?.exact)
        };
        let clean = answer(machine, start)?;
        let beside = |other: Vec<f64>| -> Vec<f64> { other.iter().zip(&clean).map(|(a, b)| a - b).collect() };
        added.extend(run.exact.iter().zip(&clean).map(|(a, b)| a - b));
        let time = length as f64 / machine.rate_hz;
        for moved in [[q + speed * time, start[1]], [q, start[1] + speed]] {
            let mut column = vec![0.0; samples];
            column[before..before + length].copy_from_slice(&beside(answer(machine, moved)?));
            columns.push(column);
        }
        if known == Known::Nothing {
            for (i, other) in neighbours(machine, time).iter().enumerate() {
                let column = beside(answer(other, start)?);
                match shared.get_mut(i) {
                    Some(c) => c.extend(column),
                    None => shared.push(column),
                }
            }
        }
        before += length;
    }
    columns.extend(shared);
    let sizes = columns
        .iter()
        .map(|c| c.iter().map(|v| v * v).sum::<f64>().sqrt());
    let sizes: Vec<f64> = sizes.map(|s| if s > 0.0 { s } else { 1.0 }).collect();
    let rows = DMatrix::from_fn(samples, columns.len(), |k, j| columns[j][k] / sizes[j]);
    let target = DVector::from_vec(added);
    let found = least_squares(rows.clone(), &target, 1e-12)?;
    Ok((target - rows * found).norm() / (samples.max(1) as f64).sqrt())
}

/// Machines with one parameter a little different: the answers are linear in it, the mass nearly.
fn neighbours(machine: &ServoAxis, time: f64) -> Vec<ServoAxis> {
    const LITTLE: f64 = 1e-4;
    let mass = machine.mass_kg;
    let heavier = ServoAxis {
        mass_kg: mass * (1.0 + LITTLE),
        ..machine.clone()
    };
    let slower = ServoAxis {
        viscous_n_s_per_m: machine.viscous_n_s_per_m + LITTLE * mass / time,
        ..machine.clone()
    };
    let forced = ServoAxis {
        offset_n: machine.offset_n + LITTLE * machine.offset_n.abs().max(mass),
        ..machine.clone()
    };
    let stiffer = ServoAxis {
        stiffness_n_per_m: machine.stiffness_n_per_m * (1.0 + LITTLE),
        ..machine.clone()
    };
    let mut all = vec![heavier, slower, forced];
    if machine.stiffness_n_per_m > 0.0 {
        all.push(stiffer);
    }
    all
}
