//! What lies between the logged channels and the motors.

use crate::DescriptionError;
use crate::description_check::{Fault, fault};
use crate::key_path::KeyPath;
use lpv_core::nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Motor forces from the inputs and motor coordinates from the outputs, rigid.
///
/// `F = (T_0 + p T_1 + p^2 T_2) u`, `q = C y`; rows are motors. In a bundle the sizes fit the channels; a value made by
/// hand is checked when it is written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct Geometry {
    /// `[T_0]`, `[T_0, T_1]` or `[T_0, T_1, T_2]`, each n_motors x n_u, rows first.
    pub force_from_input: Vec<Vec<Vec<f64>>>,
    /// C, n_motors x n_y, rows first.
    pub motor_from_output: Vec<Vec<f64>>,
}

impl Geometry {
    /// Number of motors.
    pub fn motors(&self) -> usize {
        self.motor_from_output.len()
    }

    /// T(p) = T_0 + p T_1 + p^2 T_2, n_motors x n_u. Missing entries count as zero.
    pub fn force_from_input_at(&self, p: f64) -> DMatrix<f64> {
        let matrices: Vec<_> = self.force_from_input.iter().map(|t| matrix(t)).collect();
        let (rows, columns) = matrices.first().map_or((0, 0), DMatrix::shape);
        DMatrix::from_fn(rows, columns, |i, j| {
            matrices
                .iter()
                .rev()
                .fold(0.0, |sum, t| sum * p + t.get((i, j)).copied().unwrap_or(0.0))
        })
    }

    /// C, n_motors x n_y. Missing entries count as zero.
    pub fn motor_from_output_matrix(&self) -> DMatrix<f64> {
        matrix(&self.motor_from_output)
    }

    pub(crate) fn check(&self, inputs: usize, outputs: usize, scheduling: usize) -> Result<(), Fault> {
        let root = KeyPath::key("geometry");
        let forces = root.then("force_from_input");
        let found = self.force_from_input.len();
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
        let motors = self.motors().max(1);
        check_matrix(
            &self.motor_from_output,
            motors,
            outputs,
            &root.then("motor_from_output"),
        )?;
        for (k, t) in self.force_from_input.iter().enumerate() {
            check_matrix(t, motors, inputs, &forces.at(k))?;
        }
        Ok(())
    }
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

fn matrix(rows: &[Vec<f64>]) -> DMatrix<f64> {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    DMatrix::from_fn(rows.len(), columns, |i, j| rows[i].get(j).copied().unwrap_or(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomial_by_hand() {
        let g = Geometry {
            force_from_input: vec![vec![vec![1.0, 2.0]], vec![vec![3.0, 0.0]], vec![vec![0.0, 5.0]]],
            motor_from_output: vec![vec![1.0, -0.5]],
        };
        assert!(g.check(2, 2, 1).is_ok());
        assert_eq!(
            g.force_from_input_at(2.0),
            DMatrix::from_row_slice(1, 2, &[7.0, 22.0])
        );
        assert_eq!(
            g.motor_from_output_matrix(),
            DMatrix::from_row_slice(1, 2, &[1.0, -0.5])
        );
        assert!(g.check(2, 2, 0).is_err());
        assert!(g.check(1, 2, 1).is_err());
        let ragged = Geometry {
            force_from_input: vec![],
            motor_from_output: vec![vec![], vec![1.0]],
        };
        assert_eq!(ragged.force_from_input_at(f64::NAN).shape(), (0, 0));
        assert!(ragged.check(1, 1, 0).is_err());
    }
}
