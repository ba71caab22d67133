//! Changes of coordinates: directions of M along which no frozen response moves.

use crate::FitError;
use crate::candidate::Channel;
use crate::shape::Shape;
use lpv_numerics::dense::right_singular;
use nalgebra::{DMatrix, DVector};

/// Combinations of generators that move fixed entries by less than this part of what each moves alone are admitted.
const NULL: f64 = 1e-10;

/// Tangents `dM` of all changes of coordinates that leave the fixed entries alone, one a column, in the order of the
/// free entries. The columns may be dependent.
///
/// - States: `E_ij M - M E_ij` for any i, j.
/// - Channels closed by the same delta: the same in the rows of z and the columns of w, since then
///   `T Delta = Delta T`.
/// - A direct channel d says `z_d - w_d = 0`, so its row less `w_d` may be added to any row, and its column less `z_d`
///   to any column.
pub(crate) fn tangents(
    m: &DMatrix<f64>,
    shape: Shape,
    channels: &[Channel],
    free: &[(usize, usize)],
) -> Result<DMatrix<f64>, FitError> {
    let mut place = vec![None; m.nrows() * m.ncols()];
    for (at, &(i, j)) in free.iter().enumerate() {
        place[j * m.nrows() + i] = Some(at);
    }
    let fixed: Vec<usize> = (0..place.len()).filter(|&at| place[at].is_none()).collect();
    let (mut admitted, mut others, mut moved) = (Vec::new(), Vec::new(), Vec::new());
    for generator in generators(m, shape, channels) {
        let on_free = DVector::from_iterator(free.len(), free.iter().map(|&at| generator[at]));
        let on_fixed = DVector::from_iterator(fixed.len(), fixed.iter().map(|&at| generator[at]));
        let size = on_fixed.norm();
        if size == 0.0 {
            admitted.push(on_free);
        } else {
            others.push(on_free / size);
            moved.push(on_fixed / size);
        }
    }
    if !others.is_empty() {
        let (values, vectors) = right_singular(&DMatrix::from_columns(&moved))?;
        let largest = values.max();
        let combine = DMatrix::from_columns(&others);
        for (value, combination) in values.iter().zip(vectors.column_iter()) {
            if *value <= NULL * largest {
                admitted.push(&combine * combination);
            }
        }
    }
    if admitted.is_empty() {
        return Ok(DMatrix::zeros(free.len(), 0));
    }
    Ok(DMatrix::from_columns(&admitted))
}

fn generators(m: &DMatrix<f64>, shape: Shape, channels: &[Channel]) -> Vec<DMatrix<f64>> {
    let (a, b) = (shape.rows(), shape.columns());
    let similarity = |(row, other_row): (usize, usize), (column, other_column): (usize, usize)| {
        let mut d = DMatrix::zeros(m.nrows(), m.ncols());
        d.row_mut(row).copy_from(&m.row(other_row));
        let mut target = d.column_mut(other_column);
        target -= m.column(column);
        d
    };
    let mut all = Vec::new();
    for i in 0..shape.states {
        for j in 0..shape.states {
            all.push(similarity((i, j), (i, j)));
        }
    }
    for (i, c) in channels.iter().enumerate() {
        for (j, other) in channels.iter().enumerate() {
            if c == other {
                all.push(similarity((a + i, a + j), (b + i, b + j)));
            }
        }
    }
    for d in (0..channels.len()).filter(|&d| channels[d] == Channel::Direct) {
        let mut row = m.row(a + d).into_owned();
        row[b + d] -= 1.0;
        for i in 0..m.nrows() {
            let mut change = DMatrix::zeros(m.nrows(), m.ncols());
            change.row_mut(i).copy_from(&row);
            all.push(change);
        }
        let mut column = m.column(b + d).into_owned();
        column[a + d] -= 1.0;
        for j in 0..m.ncols() {
            let mut change = DMatrix::zeros(m.nrows(), m.ncols());
            change.column_mut(j).copy_from(&column);
            all.push(change);
        }
    }
    all
}
