//! Machines of several axes that each move by themselves: which input moves which outputs.
//!
//! Outputs that move together, each the other one with a gain, an offset and a small delay, are encoders of one axis. An input belongs
//! to the axis whose motion (acceleration, speed, its sign, a constant) explains the most of it by least squares; all inputs together
//! are shared out so that the sum of what is explained is largest.

use crate::TraceError;
use lpv_core::linalg::least_squares;
use lpv_core::{Discrete, Record};
use lti_ident::rigid_body::{Filter, Motion, RigidBodySettings};
use nalgebra::{DMatrix, DVector};

/// Channels of one axis, as indices of the records.
#[derive(Debug, Clone, PartialEq)]
pub struct AxisChannels {
    /// What drives it.
    pub input: usize,
    /// Where it is.
    pub output: usize,
    /// Further encoders of it.
    pub further: Vec<usize>,
    /// Part of the squared input that the motion explains.
    pub explained: f64,
}

/// Part of the size of an output that may be left where another one and its rate explain it.
const TOGETHER: f64 = 0.02;

/// Part of a squared input that the motion of its axis must explain.
const LEAST: f64 = 0.5;

/// The axes of some records, in the order of their inputs.
///
/// # Errors
/// [`TraceError::Axes`] where there are not as many positions that move apart as inputs; [`TraceError::Coupled`] for an input that
/// the motion of no position explains; [`TraceError::Lti`] for records that are too short.
pub fn axes(records: &[Record], clock: Discrete) -> Result<Vec<AxisChannels>, TraceError> {
    let first = records.first().ok_or(TraceError::TooFew {
        what: "a diagnosis needs at least one record along moves",
    })?;
    let inputs = first.inputs.channels();
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for output in 0..first.outputs.channels() {
        let mut mine = None;
        for (g, group) in groups.iter().enumerate() {
            if move_together(records, group[0], output) {
                mine = Some(g);
                break;
            }
        }
        match mine {
            Some(g) => groups[g].push(output),
            None => groups.push(vec![output]),
        }
    }
    if groups.len() != inputs {
        return Err(TraceError::Axes {
            inputs,
            positions: groups.len(),
        });
    }
    let mut explained = DMatrix::zeros(inputs, inputs);
    for (g, group) in groups.iter().enumerate() {
        let rows = Rows::of(records, group[0], clock)?;
        for input in 0..inputs {
            explained[(input, g)] = rows.explain(records, input, clock)?;
        }
    }
    let shared = share_out(&explained);
    let axis = |(input, g): (usize, usize)| AxisChannels {
        input,
        output: groups[g][0],
        further: groups[g][1..].to_vec(),
        explained: explained[(input, g)],
    };
    let found: Vec<AxisChannels> = shared.into_iter().enumerate().map(axis).collect();
    match found.iter().find(|a| a.explained < LEAST) {
        Some(a) => Err(TraceError::Coupled {
            input: first.inputs.names[a.input].clone(),
            output: first.outputs.names[a.output].clone(),
            percent: 100.0 * a.explained,
        }),
        None => Ok(found),
    }
}

/// Whether an output is another one with a gain, an offset by record and a small delay.
fn move_together(records: &[Record], one: usize, other: usize) -> bool {
    let (mut rows, mut right) = (Vec::new(), Vec::new());
    for record in records {
        let (q, y) = (&record.outputs.columns[one], &record.outputs.columns[other]);
        let inner = 1..record.len().saturating_sub(1);
        let [q_mean, y_mean] = [q, y].map(|c| lpv_numerics::statistics::mean(c));
        for k in inner {
            rows.extend([q[k] - q_mean, 0.5 * (q[k + 1] - q[k - 1])]);
            right.push(y[k] - y_mean);
        }
    }
    let (rows, right) = (
        DMatrix::from_row_slice(right.len(), 2, &rows),
        DVector::from_vec(right),
    );
    let Ok(found) = least_squares(rows.clone(), &right, 1e-12) else {
        return false;
    };
    let left = (&right - rows * found).norm();
    left < TOGETHER * right.norm()
}

/// Motion of one output along all records, filtered to the band of its accelerations.
struct Rows {
    filter: Filter,
    motion: DMatrix<f64>,
}

impl Rows {
    fn of(records: &[Record], output: usize, clock: Discrete) -> Result<Self, TraceError> {
        let positions: Vec<&[f64]> = records
            .iter()
            .map(|r| r.outputs.columns[output].as_slice())
            .collect();
        let filter = Filter::new(&positions, clock, &RigidBodySettings::default())?;
        let mut columns: [Vec<f64>; 3] = Default::default();
        for q in positions {
            let motion = Motion::new(q, clock, filter.position_cutoff_hz)?;
            let sign: Vec<f64> = motion.velocity.iter().map(|v| v.signum()).collect();
            for (column, signal) in columns
                .iter_mut()
                .zip([&motion.acceleration, &motion.velocity, &sign])
            {
                column.extend(filter.reduced(signal, clock)?);
            }
        }
        // Columns of size one: units are the user's.
        for column in &mut columns {
            let size = column.iter().map(|v| v * v).sum::<f64>().sqrt();
            if size > 0.0 {
                column.iter_mut().for_each(|v| *v /= size);
            }
        }
        let rows = columns[0].len();
        Ok(Self {
            filter,
            motion: DMatrix::from_fn(rows, 4, |k, j| columns.get(j).map_or(1.0, |c| c[k])),
        })
    }

    /// Part of the squared departure of an input from its mean.
    fn explain(&self, records: &[Record], input: usize, clock: Discrete) -> Result<f64, TraceError> {
        let mut force = Vec::new();
        for record in records {
            force.extend(self.filter.held(&record.inputs.columns[input], clock)?);
        }
        let middle = lpv_numerics::statistics::mean(&force);
        let force = DVector::from_iterator(force.len(), force.iter().map(|f| f - middle));
        let size = force.norm_squared();
        let Ok(found) = least_squares(self.motion.clone(), &force, 1e-12) else {
            return Ok(0.0);
        };
        let left = (&force - &self.motion * found).norm_squared();
        Ok(if size > 0.0 {
            (1.0 - left / size).max(0.0)
        } else {
            0.0
        })
    }
}

/// A column for each row of a square matrix, so that the sum of the entries is large: from the largest entry down, then by exchanges
/// of two until none makes it larger.
fn share_out(worth: &DMatrix<f64>) -> Vec<usize> {
    let n = worth.nrows();
    let mut order: Vec<(usize, usize)> = (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).collect();
    order.sort_by(|a, b| worth[*b].total_cmp(&worth[*a]));
    let mut shared = vec![None; n];
    for (i, j) in order {
        if shared[i].is_none() && !shared.contains(&Some(j)) {
            shared[i] = Some(j);
        }
    }
    let mut shared: Vec<usize> = shared.into_iter().flatten().collect();
    loop {
        let pairs = (0..n).flat_map(|a| (a + 1..n).map(move |b| (a, b)));
        let gain = |(a, b): (usize, usize)| {
            worth[(a, shared[b])] + worth[(b, shared[a])] - worth[(a, shared[a])] - worth[(b, shared[b])]
        };
        match pairs.max_by(|x, y| gain(*x).total_cmp(&gain(*y))) {
            Some((a, b)) if gain((a, b)) > 1e-12 => shared.swap(a, b),
            _ => return shared,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::share_out;
    use nalgebra::dmatrix;

    #[test]
    fn an_exchange_beats_the_largest_entry() {
        // The largest entry alone would leave 0.1 for the other input.
        let worth = dmatrix![0.90, 0.88; 0.85, 0.10];
        assert_eq!(share_out(&worth), [1, 0]);
        assert_eq!(share_out(&dmatrix![0.1, 0.0; 0.0, 0.1]), [0, 1]);
    }
}
