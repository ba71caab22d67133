//! Does the controller of the description give the inputs that were logged? One filter run over references and outputs tells.

use lpv_core::linalg::least_squares;
use lpv_core::nalgebra::{DMatrix, DVector};
use lpv_core::{Controller, Record};

/// Samples that are replayed.
const SAMPLES: usize = 20_000;
/// Part of the inputs that may be left: sensors of the log that are not those of the controller.
const LEFT: f64 = 0.25;
/// Factor by which other gains must lower what is left to be named as the cause, and the part that they may leave then.
const BETTER: f64 = 3.0;
const EXPLAINED: f64 = 0.2;
/// A controller whose replay grows by more than this is not judged: it is unstable by itself.
const GROWS: f64 = 1e9;

/// One loop whose controller does not give the logged input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Mismatch {
    /// The loop, from 0.
    pub(super) input: usize,
    /// What is left of the input about the replayed one, over the input.
    pub(super) left: f64,
    /// Factors on the reference's and the output's path that would make it fit, and what they leave.
    pub(super) factors: Option<[f64; 2]>,
}

/// Compares the logged inputs with those of the controller, whatever its state at the start; samples at the limit do not count.
pub(super) fn mismatches(record: &Record, controller: &Controller) -> Vec<Mismatch> {
    let samples = record.len().min(SAMPLES);
    let loops = controller
        .loops()
        .min(record.inputs.channels())
        .min(record.outputs.channels());
    (0..loops)
        .filter_map(|i| {
            let reference = record.references.columns.get(i).map(|r| &r[..samples]);
            let output = &record.outputs.columns[i][..samples];
            let injection = record.injection.columns.get(i);
            let logged: Vec<f64> = (0..samples)
                .map(|k| record.inputs.columns[i][k] - injection.map_or(0.0, |d| d[k]))
                .collect();
            one(controller, i, reference, output, &logged)
        })
        .collect()
}

fn one(controller: &Controller, i: usize, r: Option<&[f64]>, y: &[f64], u: &[f64]) -> Option<Mismatch> {
    let a = &controller.denominator[i];
    let order = a.len() - 1;
    let by_output: Vec<f64> = filtered(&controller.feedback_numerator[i], a, y)
        .iter()
        .map(|v| -v)
        .collect();
    // A reference is a setpoint before the controller, or an excitation behind it.
    let references: Vec<Vec<f64>> = r.map_or_else(Vec::new, |r| {
        vec![filtered(&controller.reference_numerator[i], a, r), r.to_vec()]
    });
    // What the state at the start does: the responses of the denominator to an impulse, delayed.
    let free: Vec<Vec<f64>> = (0..order)
        .map(|delay| {
            let impulse: Vec<f64> = (0..u.len()).map(|k| f64::from(u8::from(k == delay))).collect();
            filtered(&[1.0], a, &impulse)
        })
        .collect();
    let limit = controller.limit.map_or(f64::INFINITY, |limit| 0.999 * limit);
    let rows: Vec<usize> = (0..u.len()).filter(|k| u[*k].abs() < limit).collect();
    let size = rows.iter().map(|k| u[*k] * u[*k]).sum::<f64>().sqrt();
    let finite = |c: &Vec<f64>| c.iter().all(|v| v.abs() < f64::MAX);
    if rows.len() < 20 + 4 * (order + 2)
        || size == 0.0
        || !references.iter().chain([&by_output]).all(finite)
        || free.iter().flatten().any(|v| v.is_nan() || v.abs() > GROWS)
    {
        return None;
    }
    let fit = Fit {
        rows: &rows,
        free: &free,
        size,
    };
    let inputs = |r: Option<&Vec<f64>>, factors: [f64; 2]| -> Vec<f64> {
        let through = |k: usize| r.map_or(0.0, |r| factors[0] * r[k]) + factors[1] * by_output[k];
        (0..u.len()).map(|k| u[k] - through(k)).collect()
    };
    let paths: Vec<Option<&Vec<f64>>> = match references.as_slice() {
        [] => vec![None],
        some => some.iter().map(Some).collect(),
    };
    let as_described = paths
        .iter()
        .filter_map(|r| Some(fit.left(&[], &inputs(*r, [1.0; 2]))?.1));
    let as_described = as_described.min_by(f64::total_cmp)?;
    if as_described.is_nan() || as_described < LEFT {
        return None;
    }
    let other = paths.iter().filter_map(|r| {
        let columns: Vec<&Vec<f64>> = r.iter().copied().chain([&by_output]).collect();
        let (values, left) = fit.left(&columns, u)?;
        let factors = match values[..] {
            [reference, output] => [reference, output],
            _ => [f64::NAN, values[0]],
        };
        Some((factors, left))
    });
    let (factors, left) = other.min_by(|a, b| a.1.total_cmp(&b.1))?;
    let named = left < EXPLAINED && BETTER * left < as_described;
    Some(Mismatch {
        input: i,
        left: crate::signal::finite(as_described),
        factors: named.then_some(factors),
    })
}

/// Least squares on the rows that count, any state at the start beside the columns.
struct Fit<'a> {
    rows: &'a [usize],
    free: &'a [Vec<f64>],
    /// Norm of the inputs.
    size: f64,
}

impl Fit<'_> {
    /// Factors of the columns, and the norm of what is left over that of the inputs.
    fn left(&self, columns: &[&Vec<f64>], target: &[f64]) -> Option<(Vec<f64>, f64)> {
        let all: Vec<&Vec<f64>> = columns.iter().copied().chain(self.free).collect();
        let norm = |c: &[f64]| self.rows.iter().map(|k| c[*k] * c[*k]).sum::<f64>().sqrt();
        let norms: Vec<f64> = all.iter().map(|c| norm(c).max(f64::MIN_POSITIVE)).collect();
        let right = DVector::from_iterator(self.rows.len(), self.rows.iter().map(|k| target[*k] / self.size));
        if all.is_empty() {
            return Some((Vec::new(), right.norm()));
        }
        let matrix = DMatrix::from_fn(self.rows.len(), all.len(), |k, j| all[j][self.rows[k]] / norms[j]);
        let solution = least_squares(matrix.tr_mul(&matrix), &matrix.tr_mul(&right), 1e-13).ok()?;
        let left = (right - matrix * &solution).norm();
        let values = solution.iter().zip(&norms).map(|(v, n)| v * self.size / n);
        Some((values.take(columns.len()).collect(), left))
    }
}

/// `b / a x`, at rest before the first sample.
fn filtered(b: &[f64], a: &[f64], x: &[f64]) -> Vec<f64> {
    let mut out: Vec<f64> = Vec::with_capacity(x.len());
    for k in 0..x.len() {
        let forced: f64 = b.iter().take(k + 1).enumerate().map(|(i, b)| b * x[k - i]).sum();
        let own: f64 = a
            .iter()
            .enumerate()
            .skip(1)
            .take(k)
            .map(|(i, a)| a * out[k - i])
            .sum();
        out.push((forced - own) / a[0]);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::kit::{Plant, Random, record};
    use super::*;

    /// A loop of its own size, rate and noise with lead or lead-lag control: record and controller, from a random sample on.
    fn servo(random: &mut Random) -> (Record, Controller) {
        let frequency = random.between(0.05, 0.2);
        let gain = random.decades(3.0);
        let plant = Plant::machine(frequency, random.between(0.005, 0.1), [1.0, 1.0], gain);
        // A lead far below the mode, with the integrator of half of them.
        let w = 0.03 * frequency * std::f64::consts::TAU;
        let k = 0.5 * w * w / gain;
        let pole = (-5.0 * w).exp();
        let zero = (-0.3 * w).exp();
        let lead = k * (1.0 - pole) / (1.0 - zero);
        let integral = if random.unit() < 0.5 { 0.05 * w } else { 0.0 };
        let b = vec![
            lead * (1.0 + integral),
            -lead * (zero * (1.0 + integral) + 1.0),
            lead * zero,
        ];
        let a = vec![1.0, -1.0 - pole, pole];
        let samples = 4000;
        let mut aim = 0.0;
        let r: Vec<f64> = (0..samples)
            .map(|t| {
                if t % 400 == 0 {
                    aim = random.normal();
                }
                aim
            })
            .collect();
        let size = 10f64.powf(random.between(-6.0, -1.0));
        let e = random.noise(samples, size);
        // The reference enters through the same controller, or behind it, then as small as its commands.
        let through = filtered(&b, &a, &r);
        let (r, through) = match random.unit() < 0.5 {
            true => (r, through),
            false => (through.clone(), through),
        };
        let [u, y] = plant.in_loop(&[b.clone(), a.clone()], &through, &e);
        assert!(y.iter().all(|v| v.abs() < 100.0), "the loop is stable");
        let from = random.between(0.0, 1000.0) as usize;
        let record = record(None, &r[from..], &u[from..], &y[from..]);
        let controller = Controller {
            reference_numerator: vec![b.clone()],
            feedback_numerator: vec![b],
            denominator: vec![a],
            limit: None,
        };
        (record, controller)
    }

    #[test]
    fn a_wrong_gain_sign_or_unit_is_named() {
        for seed in 0..40 {
            let mut random = Random::new(seed);
            let (record, controller) = servo(&mut random);
            for factor in [3.0, -1.0, 1e-3, 1e3, 57.3] {
                let mut wrong = controller.clone();
                wrong.feedback_numerator[0].iter_mut().for_each(|b| *b /= factor);
                let found = mismatches(&record, &wrong);
                let [alpha, beta] = found[0].factors.unwrap_or([f64::NAN; 2]);
                assert!((beta / factor - 1.0).abs() < 0.05, "{seed}, {factor}: {found:?}");
                assert!((alpha - 1.0).abs() < 0.05, "{seed}, {factor}: {found:?}");
            }
        }
    }

    #[test]
    fn the_right_controller_gives_what_was_logged() {
        let mut alarms = 0;
        for seed in 0..200 {
            let mut random = Random::new(300 + seed);
            let (record, controller) = servo(&mut random);
            alarms += usize::from(!mismatches(&record, &controller).is_empty());
        }
        assert!(alarms <= 2, "{alarms} of 200");
    }
}
