//! How well parameters are known whatever errors there are: by what they would be without a part of the records.

use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// What a part of the records says of the coordinates, linearised.
#[derive(Debug, Clone)]
pub(super) struct Part {
    /// `J^T J` and `J^T r` of its rows.
    information: DMatrix<f64>,
    score: DVector<f64>,
}

impl Part {
    pub(super) fn of(jacobian: &DMatrix<f64>, residual: &[f64], rows: Range<usize>) -> Self {
        let part = jacobian.rows(rows.start, rows.len());
        let residual = DVector::from_column_slice(&residual[rows]);
        Self {
            information: part.tr_mul(&part),
            score: part.tr_mul(&residual),
        }
    }

    pub(super) fn join(&mut self, other: &Self) {
        self.information += &other.information;
        self.score += &other.score;
    }
}

/// Neighbours that are left out together: a thirty-second of a record, an eighth, and a record.
const TOGETHER: [usize; 3] = [1, 4, super::PARTS];

/// Standard deviations of the coordinates of a fit by what they would be without one part after the other (the jackknife of Tukey,
/// linearised and in groups: Efron 1982). That errors are white is not assumed, nor that they are noise: parts that contradict each other make the deviation as large as they do. Parts of several lengths are tried, and
/// the largest deviation counts; those without which a coordinate is not known say nothing of it. `factor` has the information of all
/// rows, also of those that belong to no record.
pub(super) fn deviations_without_parts(factor: &DMatrix<f64>, records: &[Vec<Part>]) -> Vec<f64> {
    let scaled = Scaled::of(factor);
    let all = scaled.of_matrix(&factor.tr_mul(factor));
    let mut largest = vec![0.0_f64; factor.ncols()];
    for together in TOGETHER {
        let groups: Vec<Part> = records
            .iter()
            .flat_map(|parts| parts.chunks(together))
            .filter_map(|group| {
                let (first, rest) = group.split_first()?;
                let mut sum = first.clone();
                rest.iter().for_each(|p| sum.join(p));
                Some(sum)
            })
            .collect();
        let mut sum = vec![0.0; scaled.seen.len()];
        for group in &groups {
            let rest = &all - scaled.of_matrix(&group.information);
            let Some(moved) = moved(&rest, &scaled.of_vector(&group.score)) else {
                continue;
            };
            sum.iter_mut().zip(moved.iter()).for_each(|(s, m)| *s += m * m);
        }
        let part = 1.0 - 1.0 / groups.len().max(1) as f64;
        for ((j, length), sum) in scaled.seen.iter().zip(sum) {
            largest[*j] = largest[*j].max((part * sum).sqrt() / length);
        }
    }
    largest
}

/// By how much a fit with this factor moves by errors with this gradient; not at all where it knows too little.
pub(super) fn moved_by(factor: &DMatrix<f64>, gradient: &DVector<f64>) -> Vec<f64> {
    let scaled = Scaled::of(factor);
    let mut all = vec![0.0; factor.ncols()];
    if let Some(step) = moved(
        &scaled.of_matrix(&factor.tr_mul(factor)),
        &scaled.of_vector(gradient),
    ) {
        for ((j, length), step) in scaled.seen.iter().zip(step.iter()) {
            all[*j] = step / length;
        }
    }
    all
}

/// Coordinates that the records show, in units in which the information of each is one.
struct Scaled {
    seen: Vec<(usize, f64)>,
}

impl Scaled {
    fn of(factor: &DMatrix<f64>) -> Self {
        let lengths = factor.column_iter().map(|c| c.norm()).enumerate();
        Self {
            seen: lengths.filter(|(_, length)| *length > 1e-30).collect(),
        }
    }

    fn of_matrix(&self, m: &DMatrix<f64>) -> DMatrix<f64> {
        let count = self.seen.len();
        DMatrix::from_fn(count, count, |i, j| {
            let ((i, a), (j, b)) = (self.seen[i], self.seen[j]);
            m[(i, j)] / (a * b)
        })
    }

    fn of_vector(&self, v: &DVector<f64>) -> DVector<f64> {
        DVector::from_iterator(
            self.seen.len(),
            self.seen.iter().map(|(j, length)| v[*j] / length),
        )
    }
}

/// By how much a fit moves without a part with this score, where the rest has this information. None where the rest does not know.
fn moved(rest: &DMatrix<f64>, score: &DVector<f64>) -> Option<DVector<f64>> {
    /// Part of the information of a coordinate, given the others, without which the rest is a guess.
    const KNOWN: f64 = 1e-9;
    let factor = rest.clone().cholesky()?;
    let pivots = factor.l_dirty().diagonal();
    (pivots.iter().all(|p| p * p > KNOWN)).then(|| factor.solve(score))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean of numbers that come in pairs, each a part: without one, it is that of the others.
    #[test]
    fn the_jackknife_of_a_mean_by_hand() {
        let numbers = [[1.0, 2.0], [4.0, 3.0], [0.0, 2.0]];
        let mean = 2.0;
        let records: Vec<Vec<Part>> = numbers
            .iter()
            .map(|pair| {
                let errors: Vec<f64> = pair.iter().map(|v| v - mean).collect();
                vec![Part::of(&DMatrix::from_element(2, 1, 1.0), &errors, 0..2)]
            })
            .collect();
        let factor = DMatrix::from_element(1, 1, 6.0_f64.sqrt());
        let without = [9.0 / 4.0, 5.0 / 4.0, 10.0 / 4.0];
        let expected = (2.0 / 3.0 * without.map(|w: f64| (w - mean).powi(2)).iter().sum::<f64>()).sqrt();
        let found = deviations_without_parts(&factor, &records);
        assert!((found[0] - expected).abs() < 1e-12, "{found:?} {expected}");
    }

    #[test]
    fn what_one_part_alone_knows_is_not_told_by_the_others() {
        let part = |column: [f64; 2], errors: [f64; 2]| {
            let jacobian = DMatrix::from_row_slice(2, 2, &[1.0, column[0], 1.0, column[1]]);
            Part::of(&jacobian, &errors, 0..2)
        };
        let records = vec![
            vec![part([0.0, 1.0], [0.1, -0.1])],
            vec![part([0.0, 0.0], [0.1, -0.1])],
            vec![part([0.0, 0.0], [-0.1, 0.1])],
        ];
        let rows = DMatrix::from_row_slice(
            6,
            2,
            &[1.0, 0.0, 1.0, 1.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0],
        );
        let found = deviations_without_parts(&rows.qr().unpack_r(), &records);
        assert!(found.iter().all(|d| d.is_finite()), "{found:?}");
    }
}
