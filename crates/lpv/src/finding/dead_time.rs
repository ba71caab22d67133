//! Records without periods: dead time between input and output, and a level that drifts without cause.

use lpv_core::nalgebra::{DMatrix, DVector};

/// Longest dead time that is looked for, and the shortest that matters, samples.
const LONGEST: usize = 100;
const SHORTEST: usize = 5;
/// Past outputs of the law that is fitted: so many that what noise adds to them is white in what is left.
const ORDER: usize = 12;
/// Rows of the fit.
const ROWS: usize = 4000;
/// What inputs explain over what chance does, in variances of the rest: the first ones behind a dead time at least so much.
const SEEN: f64 = 80.0;
/// Part of an input's deviation that its other samples must leave.
const FRESH: f64 = 0.05;
/// Inputs behind a dead time that are looked at together.
const FIRST: usize = 6;

/// Samples by which the output follows the input late: in a law with past outputs and all inputs the latest ones explain nothing
/// that the earlier ones do not, and the first ones behind them do.
///
/// With the inputs in the order from the earliest to the latest, the rows of `Q^T y` of an orthogonal decomposition are what each
/// input adds to those before; without effect their squares over the variance of the rest are chi-squared.
pub(super) fn dead_time(u: &[f64], y: &[f64]) -> Option<usize> {
    let start = LONGEST.max(ORDER);
    let rows = u.len().min(y.len()).checked_sub(start)?.min(ROWS);
    let columns = 1 + ORDER + LONGEST;
    if rows < 5 * columns {
        return None;
    }
    let scale = |x: &[f64]| {
        let size = lpv_numerics::statistics::standard_deviation(x);
        (size > 0.0).then(|| (lpv_numerics::statistics::mean(x), size))
    };
    let ((u0, u_size), (y0, y_size)) = (scale(u)?, scale(y)?);
    let y_at = |k: usize| (y[k] - y0) / y_size;
    let matrix = DMatrix::from_fn(rows, columns + 1, |k, j| match j {
        0 => 1.0,
        _ if j <= ORDER => y_at(k + start - j),
        _ if j == columns => y_at(k + start),
        // Lags from the largest to none.
        _ => (u[k + start - (columns - 1 - j)] - u0) / u_size,
    });
    let r = matrix.qr().r();
    // Of a sweep or band-limited noise each sample follows from the others, and what is left of it tells nothing.
    if r[(columns - 1, columns - 1)].abs() < FRESH * (rows as f64).sqrt() {
        return None;
    }
    let freedom = (rows - columns) as f64;
    let rest = r[(columns, columns)].powi(2) / freedom;
    // By lag, from none on.
    let adds: Vec<f64> = (0..LONGEST)
        .map(|lag| r[(columns - 1 - lag, columns)].powi(2) / rest)
        .collect();
    let mut sum = 0.0;
    let mut delay = 0;
    for (lag, add) in adds.iter().enumerate() {
        sum += add;
        let count = (lag + 1) as f64;
        if sum > count + 4.0 * (2.0 * count).sqrt() + 8.0 {
            break;
        }
        delay = lag + 1;
    }
    let first: f64 = adds.iter().skip(delay).take(FIRST).sum();
    // A sample of delay is what any machine has.
    (delay > SHORTEST && delay < LONGEST && first > SEEN && begins(&adds, delay)).then(|| delay - 1)
}

/// Whether a response begins behind a dead time, and does not only come out of the noise there: one that grows evenly through the
/// first lags behind it is traced back to where it is nothing.
fn begins(adds: &[f64], delay: usize) -> bool {
    /// Part of the dead time that must be one.
    const PART: f64 = 0.5;
    let sizes: Vec<f64> = adds.iter().skip(delay).take(FIRST).map(|a| a.sqrt()).collect();
    let count = sizes.len() as f64;
    let (middle, mean) = (0.5 * (count - 1.0), sizes.iter().sum::<f64>() / count);
    let product = |(k, size): (usize, &f64)| (k as f64 - middle) * (size - mean);
    let slope = sizes.iter().enumerate().map(product).sum::<f64>() / (count * (count * count - 1.0) / 12.0);
    let origin = delay as f64 + middle - mean / slope;
    slope <= 0.0 || origin > PART * delay as f64
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
            .map(lpv_numerics::statistics::mean)
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
    // What the column does not hold, the inputs would have had to take back.
    let (low, high) = lpv_numerics::statistics::range(y);
    (rise.abs() <= high - low
        && rise.abs() > STANDS_OUT * deviation
        && rise.abs() > MATTERS * lpv_numerics::statistics::standard_deviation(&rest))
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
        let noise = lpv_numerics::statistics::standard_deviation(&y) * 10f64.powf(random.between(-6.0, -2.5));
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
            let rise = lpv_numerics::statistics::standard_deviation(&y) * random.between(3.0, 30.0);
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
