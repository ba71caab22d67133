//! Least squares of a tall problem that arrives in blocks of rows: a straight line through a million points.

use lpv_numerics::dense::{Triangle, solve_upper};
use lpv_numerics::nalgebra::DMatrix;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    const BLOCK: usize = 1000;
    // Columns: one, x, y.
    let mut triangle = Triangle::new(3, BLOCK);
    for block in 0..1000 {
        for row in 0..BLOCK {
            let x = 1e-6 * (block * BLOCK + row) as f64;
            let y = 2.0 - 3.0 * x + 1e-3 * (1e4 * x).sin();
            for (j, value) in [1.0, x, y].into_iter().enumerate() {
                triangle.column_mut(j)[row] = value;
            }
        }
        triangle.absorb(BLOCK);
    }
    let r = triangle.factor();
    let left = r.view((0, 0), (2, 2)).into_owned();
    let right = DMatrix::from_fn(2, 1, |i, _| r[(i, 2)]);
    let line = solve_upper(&left, &right).ok_or("the columns are dependent")?;
    println!(
        "y = {:.6} {:+.6} x, what is left {:.3e}",
        line[0],
        line[1],
        r[(2, 2)].abs() / 1e3
    );
    Ok(())
}
