//! Records without periods: dead time between input and output, and a level that drifts without cause.

use lpv_core::nalgebra::{DMatrix, DVector};

/// Longest dead time that is looked for, and the shortest that matters, samples.
const LONGEST: usize = 120;
const SHORTEST: usize = 5;
/// Past outputs and delayed inputs of the law that is fitted.
const ORDER: usize = 4;
const INPUTS: usize = 3;
/// Rows of the fit.
const ROWS: usize = 4000;
/// Part of what the past outputs leave that the late inputs must explain, and the part of that that early ones may.
const EXPLAINED: f64 = 0.03;
const EARLY: f64 = 0.1;

/// Samples by which the output follows the input late, where a law with this dead time foretells the output much better.
pub(super) fn dead_time(u: &[f64], y: &[f64]) -> Option<usize> {
    let start = LONGEST + INPUTS;
    let rows = u.len().checked_sub(start)?.min(ROWS);
    if rows < 40 * (ORDER + INPUTS) {
        return None;
    }
    let size = |x: &[f64]| crate::signal::deviation(x).max(f64::MIN_POSITIVE);
    let (u_size, y_size) = (size(u), size(y));
    let u0 = crate::signal::mean(u);
    let y0 = crate::signal::mean(y);
    let target = DVector::from_fn(rows, |k, _| (y[k + start] - y0) / y_size);
    let past = DMatrix::from_fn(rows, ORDER + 1, |k, j| match j {
        0 => 1.0,
        _ => (y[k + start - j] - y0) / y_size,
    });
    let q = past.clone().qr().q();
    let own = &target - &q * q.tr_mul(&target);
    // What past outputs leave, by inputs so late.
    let left = |delay: usize| -> Option<f64> {
        let inputs = DMatrix::from_fn(rows, INPUTS, |k, j| (u[k + start - delay - j] - u0) / u_size);
        let inputs = &inputs - &q * q.tr_mul(&inputs);
        let normal = inputs.tr_mul(&inputs);
        let solution = normal.svd(true, true).solve(&inputs.tr_mul(&own), 1e-12).ok()?;
        Some((&own - inputs * solution).norm())
    };
    let early = (0..SHORTEST.saturating_sub(INPUTS))
        .filter_map(left)
        .fold(f64::INFINITY, f64::min);
    let (delay, best) = (SHORTEST..=LONGEST)
        .filter_map(|d| Some((d, left(d)?)))
        .min_by(|a, b| a.1.total_cmp(&b.1))?;
    // The first that is as good: later inputs come in with those before.
    let first = (SHORTEST..=delay)
        .find(|d| left(*d).is_some_and(|l| l < 1.02 * best))
        .unwrap_or(delay);
    let explained = |left: f64| 1.0 - (left / own.norm()).powi(2);
    let late = explained(best);
    (late > EXPLAINED && explained(early) < EARLY * late).then_some(first)
}

/// Parts of a record whose means tell a drift.
const PARTS: usize = 16;
/// Standard deviations by which the rise stands out, and its size over the rest of the motion.
const STANDS_OUT: f64 = 12.0;
const MATTERS: f64 = 0.1;

/// Rise over the record of an output whose level drifts evenly, whatever its inputs do.
pub(super) fn trend(inputs: &[Vec<f64>], y: &[f64]) -> Option<f64> {
    let part = y.len() / PARTS;
    if part < 8 {
        return None;
    }
    let means = |x: &[f64]| -> Vec<f64> {
        x.chunks_exact(part)
            .take(PARTS)
            .map(crate::signal::mean)
            .collect()
    };
    let y_means = means(y);
    let middle = 0.5 * (PARTS as f64 - 1.0);
    let mut columns = vec![vec![1.0; PARTS], (0..PARTS).map(|b| b as f64 - middle).collect()];
    // What an input does to a machine that rests, that runs and that accelerates under it: the last two drift too.
    for u in inputs {
        let mut moved = u.clone();
        for _ in 0..3 {
            let own = means(&moved);
            let size = own.iter().map(|v| v.abs()).fold(f64::MIN_POSITIVE, f64::max);
            columns.push(own.iter().map(|v| v / size).collect());
            let mut sum = 0.0;
            moved.iter_mut().for_each(|v| {
                sum += *v;
                *v = sum;
            });
        }
    }
    let matrix = DMatrix::from_fn(PARTS, columns.len(), |b, j| columns[j][b]);
    let target = DVector::from_vec(y_means);
    let inverse = matrix.tr_mul(&matrix).try_inverse()?;
    let solution = &inverse * matrix.tr_mul(&target);
    let freedom = PARTS.checked_sub(columns.len()).filter(|f| *f > 4)? as f64;
    let scatter = ((&target - &matrix * &solution).norm_squared() / freedom).sqrt();
    let rise = solution[1] * PARTS as f64;
    let slope = rise / (PARTS * part) as f64;
    let rest: Vec<f64> = y.iter().enumerate().map(|(k, v)| v - slope * k as f64).collect();
    let deviation = scatter * inverse[(1, 1)].sqrt() * PARTS as f64;
    (rise.abs() > STANDS_OUT * deviation && rise.abs() > MATTERS * crate::signal::deviation(&rest))
        .then_some(rise)
}

#[cfg(test)]
mod tests {
    use super::super::kit::{Plant, Random};
    use super::*;

    fn machine(random: &mut Random, samples: usize) -> [Vec<f64>; 2] {
        let plant = Plant::machine(
            random.between(0.02, 0.2),
            random.between(0.01, 0.2),
            [0.9, 0.8],
            random.decades(3.0),
        );
        let size = random.decades(3.0);
        let u = random.noise(samples, size);
        let mut y = plant.open(&u);
        let noise = crate::signal::deviation(&y) * 10f64.powf(random.between(-6.0, -2.5));
        y.iter_mut().for_each(|y| *y += noise * random.normal());
        [u, y]
    }

    #[test]
    fn dead_times_and_drifts_are_told_and_machines_without_are_not() {
        let (mut alarms, mut drifts) = (0, 0);
        for seed in 0..60 {
            let mut random = Random::new(seed);
            let [u, y] = machine(&mut random, 3000);
            alarms += usize::from(dead_time(&u, &y).is_some())
                + usize::from(trend(std::slice::from_ref(&u), &y).is_some());
            let delay = 8 + (90.0 * random.unit()) as usize;
            let late: Vec<f64> = (0..y.len()).map(|k| y[k.saturating_sub(delay)]).collect();
            let told = dead_time(&u, &late).unwrap_or(0) as f64;
            assert!((told - delay as f64).abs() <= 3.0, "{seed}: {told} for {delay}");
            let rise = crate::signal::deviation(&y) * random.between(3.0, 30.0);
            let drifting: Vec<f64> = y
                .iter()
                .enumerate()
                .map(|(k, y)| y + rise * k as f64 / 3000.0)
                .collect();
            // What the inputs may have moved is left open, and makes the rise less certain.
            if let Some(told) = trend(&[u], &drifting) {
                assert!((told / rise - 1.0).abs() < 0.3, "{seed}: {told} for {rise}");
                drifts += 1;
            }
        }
        assert!(drifts >= 50, "{drifts} of 60");
        assert!(alarms <= 1, "{alarms} of 60");
    }
}
