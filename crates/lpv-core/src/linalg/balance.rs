//! Units of states in which a matrix has no larger entries than it needs.

use super::balance;
use nalgebra::DMatrix;

/// Balances a square matrix, so that the units of the states do not set its norm: it becomes `S^-1 A S`, with the diagonal of S
/// returned, powers of two, which round nothing. A state that only feeds others, or is only fed, as in a chain of integrators, takes
/// any unit: that in which these entries have size one.
pub fn balanced(a: &mut DMatrix<f64>) -> Vec<f64> {
    let n = a.nrows();
    let mut units = vec![1.0; n];
    // A chain is as long as there are states.
    for _ in 0..n {
        for (i, unit) in units.iter_mut().enumerate() {
            let sum = |of: &dyn Fn(usize) -> f64| (0..n).filter(|k| *k != i).map(of).sum::<f64>();
            let (row, column) = (sum(&|k| a[(i, k)].abs()), sum(&|k| a[(k, i)].abs()));
            let wanted = match (column > 0.0, row > 0.0) {
                (true, false) => column.recip(),
                (false, true) => row,
                _ => continue,
            };
            let factor = wanted.log2().round().clamp(-300.0, 300.0).exp2();
            a.column_mut(i).scale_mut(factor);
            a.row_mut(i).unscale_mut(factor);
            *unit *= factor;
        }
    }
    balance(a, &(0..n), |i, factor| units[i] *= factor);
    units
}
