//! What lies between the logged channels and the motors.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Motor forces from the inputs and motor coordinates from the outputs, rigid.
///
/// `F = (T_0 + p T_1 + p^2 T_2) u`, `q = C y`; rows are motors. In a bundle the sizes fit the channels; a value made by
/// hand is checked when it is written.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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
        assert_eq!(
            g.force_from_input_at(2.0),
            DMatrix::from_row_slice(1, 2, &[7.0, 22.0])
        );
        assert_eq!(
            g.motor_from_output_matrix(),
            DMatrix::from_row_slice(1, 2, &[1.0, -0.5])
        );
        let ragged = Geometry {
            force_from_input: vec![],
            motor_from_output: vec![vec![], vec![1.0]],
        };
        assert_eq!(ragged.force_from_input_at(f64::NAN).shape(), (0, 0));
    }
}
