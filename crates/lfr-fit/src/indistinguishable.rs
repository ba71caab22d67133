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
    let mut admitted = Vec::new();
    // What each of the others does to the free entries, and which fixed ones it moves and by how much.
    let mut others: Vec<DVector<f64>> = Vec::new();
    let mut moved: Vec<Vec<(usize, f64)>> = Vec::new();
    for generator in generators(m, shape, channels) {
        let on_free = DVector::from_iterator(free.len(), free.iter().map(|&at| generator[at]));
        let on_fixed: Vec<(usize, f64)> = (0..place.len())
            .filter(|&at| place[at].is_none() && generator[at] != 0.0)
            .map(|at| (at, generator[at]))
            .collect();
        if on_fixed.is_empty() {
            admitted.push(on_free);
        } else {
            let size = on_fixed.iter().map(|(_, v)| v * v).sum::<f64>().sqrt();
            others.push(on_free / size);
            moved.push(on_fixed.into_iter().map(|(at, v)| (at, v / size)).collect());
        }
    }
    for group in groups(&moved, place.len()) {
        let mut rows: Vec<usize> = group
            .iter()
            .flat_map(|&g| moved[g].iter().map(|(at, _)| *at))
            .collect();
        rows.sort_unstable();
        rows.dedup();
        let mut on_fixed = DMatrix::zeros(rows.len().max(group.len()), group.len());
        for (column, &g) in group.iter().enumerate() {
            for (at, v) in &moved[g] {
                let row = rows.partition_point(|r| r < at);
                on_fixed[(row, column)] = *v;
            }
        }
        let (values, vectors) = right_singular(&on_fixed)?;
        let largest = values.max();
        for (value, combination) in values.iter().zip(vectors.column_iter()) {
            if *value <= NULL * largest {
                let sum = group.iter().zip(combination.iter());
                admitted.push(sum.fold(DVector::zeros(free.len()), |sum, (&g, c)| sum + &others[g] * *c));
            }
        }
    }
    if admitted.is_empty() {
        return Ok(DMatrix::zeros(free.len(), 0));
    }
    Ok(DMatrix::from_columns(&admitted))
}

/// Generators that move fixed entries in common, directly or through others: only these can undo what one of them does.
fn groups(moved: &[Vec<(usize, f64)>], entries: usize) -> Vec<Vec<usize>> {
    // The first generator that moved an entry, and to which one each generator leads.
    let mut first = vec![None; entries];
    let mut leads: Vec<usize> = (0..moved.len()).collect();
    fn root(leads: &mut [usize], mut at: usize) -> usize {
        while leads[at] != at {
            leads[at] = leads[leads[at]];
            at = leads[at];
        }
        at
    }
    for (g, on_fixed) in moved.iter().enumerate() {
        for (at, _) in on_fixed {
            let other: usize = *first[*at].get_or_insert(g);
            let (a, b) = (root(&mut leads, g), root(&mut leads, other));
            leads[a.max(b)] = a.min(b);
        }
    }
    let mut groups: Vec<Vec<usize>> = vec![Vec::new(); moved.len()];
    for g in 0..moved.len() {
        groups[root(&mut leads, g)].push(g);
    }
    groups.retain(|group| !group.is_empty());
    groups
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
