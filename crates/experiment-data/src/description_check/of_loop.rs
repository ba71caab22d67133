//! Controller and geometry against the channels.

use super::{Fault, fault};
use crate::DescriptionError;
use crate::key_path::KeyPath;
use lpv_core::{Controller, ControllerFault, ControllerProblem, Geometry};

/// One loop an input, with an output and a reference each.
pub(super) fn check_controller(
    c: &Controller,
    (inputs, outputs, references): (usize, usize, usize),
) -> Result<(), Fault> {
    let root = KeyPath::key("controller");
    c.check(inputs).map_err(|ControllerFault { key, at, problem }| {
        let path = at.into_iter().fold(root.then(key), |path, k| path.at(k));
        let problem = match problem {
            ControllerProblem::NotFinite { value } => DescriptionError::NotFinite { value },
            other => DescriptionError::Controller(other),
        };
        fault(path, problem)
    })?;
    // A regulator without setpoints has no reference at all: r = 0.
    for (signal, found, absent_is_fine) in [("output", outputs, false), ("reference", references, true)] {
        if found < inputs && !(absent_is_fine && found == 0) {
            let loops = inputs;
            let problem = DescriptionError::LoopSignals { loops, signal, found };
            return Err(fault(root, problem));
        }
    }
    Ok(())
}

/// Matrices of the sizes of the channels.
pub(super) fn check_geometry(
    g: &Geometry,
    (inputs, outputs, scheduling): (usize, usize, usize),
) -> Result<(), Fault> {
    let root = KeyPath::key("geometry");
    let forces = root.then("force_from_input");
    let found = g.force_from_input.len();
    if !(1..=3).contains(&found) {
        return Err(fault(forces, DescriptionError::MatrixCount { found }));
    }
    if found > 1 && scheduling != 1 {
        return Err(fault(
            forces,
            DescriptionError::GeometryScheduling { found: scheduling },
        ));
    }
    // The motors are counted once; everything else must agree.
    let motors = g.motors().max(1);
    check_matrix(
        &g.motor_from_output,
        motors,
        outputs,
        &root.then("motor_from_output"),
    )?;
    for (k, t) in g.force_from_input.iter().enumerate() {
        check_matrix(t, motors, inputs, &forces.at(k))?;
    }
    Ok(())
}

fn check_matrix(m: &[Vec<f64>], rows: usize, columns: usize, path: &KeyPath) -> Result<(), Fault> {
    let size = |found, place: &str| DescriptionError::MatrixSize {
        rows,
        columns,
        found,
        place: place.to_owned(),
    };
    if m.len() != rows {
        return Err(fault(path.clone(), size(m.len(), "rows")));
    }
    for (i, row) in m.iter().enumerate() {
        if row.len() != columns {
            return Err(fault(path.at(i), size(row.len(), "this row")));
        }
        if let Some(j) = row.iter().position(|v| !v.is_finite()) {
            return Err(fault(
                path.at(i).at(j),
                DescriptionError::NotFinite { value: row[j] },
            ));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_geometry_fits_its_channels() {
        let g = Geometry {
            force_from_input: vec![vec![vec![1.0, 2.0]], vec![vec![3.0, 0.0]], vec![vec![0.0, 5.0]]],
            motor_from_output: vec![vec![1.0, -0.5]],
        };
        assert!(check_geometry(&g, (2, 2, 1)).is_ok());
        assert!(check_geometry(&g, (2, 2, 0)).is_err());
        assert!(check_geometry(&g, (1, 2, 1)).is_err());
        let ragged = Geometry {
            force_from_input: vec![],
            motor_from_output: vec![vec![], vec![1.0]],
        };
        assert!(check_geometry(&ragged, (1, 1, 0)).is_err());
    }
}
