//! Closed loop without excitation: all that the input does is what a controller makes of the output.

use lpv_core::Record;
use lpv_core::nalgebra::{DMatrix, DVector};

/// Past samples of output and input that tell the input: more would foretell a smooth excitation too.
const PAST: usize = 5;
/// Rows that are looked at.
const ROWS: usize = 4000;
/// What the output of the same sample leaves of what the past does not tell: no measurement of a plant gives so little.
const EXACT: f64 = 1e-8;

/// Whether input and output obey a causal law from the output to the input exactly, as only a controller does.
pub(super) fn is_feedback_only(record: &Record) -> bool {
    let ([u], [y]) = (
        record.inputs.columns.as_slice(),
        record.outputs.columns.as_slice(),
    ) else {
        return false;
    };
    let rows = u.len().saturating_sub(PAST).min(ROWS);
    if rows < 20 * PAST {
        return false;
    }
    let scaled = |x: &[f64]| -> Vec<f64> {
        let m = lpv_numerics::statistics::mean(x);
        let size = lpv_numerics::statistics::standard_deviation(x);
        x.iter().map(|v| (v - m) / size).collect()
    };
    let (u, y) = (scaled(u), scaled(y));
    let target = DVector::from_fn(rows, |k, _| u[k + PAST]);
    let columns = 2 * PAST + 2;
    let matrix = DMatrix::from_fn(rows, columns, |k, j| match j {
        0 => 1.0,
        j if j <= PAST => u[k + PAST - j],
        j if j <= 2 * PAST => y[k + 2 * PAST - j],
        _ => y[k + PAST],
    });
    let left = |columns: usize| -> f64 {
        let qr = matrix.columns(0, columns).into_owned().qr();
        let q = qr.q();
        (&target - &q * q.tr_mul(&target)).norm()
    };
    let (with, without) = (left(columns), left(columns - 1));
    without > 1e-6 * target.norm() && with < EXACT * without
}

#[cfg(test)]
mod tests {
    use super::super::kit::{Plant, Random, multisine, record};
    use super::*;

    fn loop_of(random: &mut Random) -> (Plant, [Vec<f64>; 2], f64) {
        let frequency = random.between(0.05, 0.2);
        let gain = random.decades(3.0);
        let plant = Plant::machine(frequency, random.between(0.005, 0.1), [1.0, 1.0], gain);
        let w = 0.03 * frequency * std::f64::consts::TAU;
        let (pole, zero) = ((-5.0 * w).exp(), (-0.3 * w).exp());
        let lead = 0.5 * w * w / gain * (1.0 - pole) / (1.0 - zero);
        (plant, [vec![lead, -lead * zero], vec![1.0, -pole]], lead)
    }

    #[test]
    fn noise_in_a_loop_is_seen_and_excitation_is_not_taken_for_it() {
        let mut alarms = 0;
        for seed in 0..100 {
            let mut random = Random::new(seed);
            let (plant, controller, lead) = loop_of(&mut random);
            let size = random.decades(6.0);
            let e = random.noise(3000, size);
            let still = vec![0.0; e.len()];
            let [u, y] = plant.in_loop(&controller, &still, &e);
            assert!(is_feedback_only(&record(None, &[], &u, &y)), "{seed}");
            // The same loop driven, with noise of any size, and open, driven by what can be foretold and what cannot.
            let size = lpv_numerics::statistics::standard_deviation(&e)
                * lead.abs()
                * 10f64.powf(random.between(-2.0, 6.0));
            let drive: Vec<f64> = multisine(&mut random, 3000, 200, 3000)
                .iter()
                .map(|r| size * r)
                .collect();
            let [u, y] = plant.in_loop(&controller, &drive, &e);
            let white = random.noise(3000, 1.0);
            let chirp: Vec<f64> = (0..3000).map(|k| (1e-4 * f64::from(k).powi(2)).sin()).collect();
            let steps: Vec<f64> = (0..3000).map(|k| f64::from(k / 300 % 2)).collect();
            let open = Plant::machine(random.between(0.01, 0.2), 0.02, [0.99, 0.98], random.decades(3.0));
            let mut all = vec![record(None, &[], &u, &y)];
            for u in [white, chirp, steps, drive] {
                let y = open.open(&u);
                all.push(record(None, &[], &u, &y));
            }
            alarms += all.iter().filter(|r| is_feedback_only(r)).count();
        }
        assert!(alarms <= 3, "{alarms} of 500");
    }
}
