//! Positions against each other: one in another unit.

use super::Finding;
use lpv_numerics::statistics::median;

/// How many times the stroke of all others one must lie away to be of another unit.
const AWAY: f64 = 30.0;
/// Factors between units of length and angle.
const UNITS: [f64; 9] = [
    1e3,
    1e-3,
    1e6,
    1e-6,
    57.295_779_5,
    0.017_453_292_5,
    100.0,
    0.01,
    25.4,
];

/// Records whose scheduling lies far away from that of all others.
pub(super) fn places(at: &[(&str, [f64; 2])]) -> Option<Finding> {
    let middles: Vec<f64> = at.iter().map(|(_, [low, high])| 0.5 * (low + high)).collect();
    let centre = median(&middles);
    let away = |k: usize| (middles[k] - centre).abs();
    let far = (0..at.len()).max_by(|a, b| away(*a).total_cmp(&away(*b)))?;
    let others = || (0..at.len()).filter(|k| *k != far && middles[*k] != middles[far]);
    let low = others().map(|k| at[k].1[0]).fold(f64::INFINITY, f64::min);
    let high = others().map(|k| at[k].1[1]).fold(f64::NEG_INFINITY, f64::max);
    let different = others().any(|k| middles[k] != centre) || high > low;
    if at.len() < 3 || !different || 2 * others().count() < at.len() {
        return None;
    }
    let middle = middles[far];
    let beyond = (low - middle).max(middle - high);
    if beyond.is_nan() || beyond <= AWAY * (high - low) {
        return None;
    }
    // A unit whose factor brings it back among the others.
    let slack = 0.5 * (high - low);
    let inside = |f: &f64| (low - slack..=high + slack).contains(&(middle * f));
    Some(Finding::PositionStandsApart {
        record: at[far].0.to_owned(),
        position: middle,
        others: [low, high],
        factor: UNITS.into_iter().find(inside),
    })
}

#[cfg(test)]
mod tests {
    use super::super::kit::Random;
    use super::*;

    fn of(places_at: &[f64]) -> Option<Finding> {
        let all: Vec<(&str, [f64; 2])> = places_at.iter().map(|p| ("run", [*p, *p])).collect();
        places(&all)
    }

    #[test]
    fn a_position_in_another_unit_is_named_and_grids_are_not() {
        let mut alarms = 0;
        for seed in 0..200 {
            let mut random = Random::new(seed);
            let (count, size) = (3 + seed as usize % 8, random.decades(6.0));
            let offset = if seed % 2 == 0 { 0.0 } else { random.decades(3.0) };
            let mut grid: Vec<f64> = (0..count)
                .map(|k| size * (k as f64 - 1.3 + 0.3 * random.unit() + offset))
                .collect();
            alarms += usize::from(of(&grid).is_some());
            if offset == 0.0 && count > 3 {
                grid[0] *= 1e3;
                let Some(Finding::PositionStandsApart { factor, .. }) = of(&grid) else {
                    panic!("{seed}: {grid:?}");
                };
                assert_eq!(factor, Some(1e-3));
            }
        }
        assert!(alarms <= 2, "{alarms}");
        assert_eq!(of(&[1.0, 1.0, 1.0]), None);
    }
}
