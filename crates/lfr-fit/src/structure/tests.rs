use super::*;
use crate::frozen::{Closure, close};
use crate::sampling::hold::Derivative;
use crate::test_kit::{candidate, clock, random, rng};
use crate::{Channel, RandomChannels};
use lpv_core::{Continuous, DeltaBlock, Discrete, SchedulingRange, StateSpace};

const CHANNELS: [Channel; 2] = [Channel::Parameter(0), Channel::Direct];

fn machine(gain: &DMatrix<f64>) -> Candidate<Continuous> {
    let mut rng = rng(1);
    let local = StateSpace::new(
        random(2, 2, &mut rng),
        random(2, 2, &mut rng),
        random(2, 2, &mut rng),
        DMatrix::zeros(2, 2),
        Continuous,
    );
    let delta = DeltaBlock {
        parameter: 0,
        repetitions: 2,
    };
    let range = SchedulingRange::interval(0.0, 1.0).unwrap();
    Candidate::flexible(
        &local.unwrap(),
        Some(gain),
        &[delta],
        range,
        RandomChannels::default(),
    )
    .unwrap()
}

#[test]
fn a_fixed_rigid_body_is_constant_and_a_free_one_does_not_move_its_poles() {
    let gain = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, 2.0]);
    let fixed = machine(&gain);
    let structure = Structure::new(&fixed);
    assert_eq!(
        (structure.constant, structure.kept),
        (vec![0, 1, 2, 3], vec![4, 5])
    );
    let freed = fixed.with_free_gain().unwrap();
    assert_eq!(freed.free().iter().filter(|f| **f).count(), 6 * 6 - 8 + 2);
    let structure = Structure::new(&freed);
    // Axis i has the states i and 2 + i.
    assert!(structure.constant.is_empty());
    let reach = Reach::new(&freed);
    assert_eq!(reach.moving, [4, 5]);
    // The gain moves B of position and velocity; the double integrators' own A and C stay.
    for i in 0..2 {
        assert!(reach.active.contains(&(i, 6 + i)) && reach.active.contains(&(2 + i, 6 + i)));
    }
    assert!(reach.active.iter().all(|&(i, j)| j >= 4 && (i >= 4 || j >= 6)));
}

/// A random half of the entries is free, and a fifth of the rest is zero: what the pattern calls fixed does not move.
fn check_pattern<K: Sampling>(own: K, poles: [f64; 3]) {
    for seed in 0..20 {
        let full = candidate(own, poles, &CHANNELS, seed);
        let (rows, columns) = full.matrix().shape();
        let dice = random(rows, columns, &mut rng(100 + seed));
        let free = dice.map(|v| v > 0.6);
        let sparse = full
            .matrix()
            .zip_map(&dice, |v, d| if d.abs() < 0.4 { 0.0 } else { v });
        let candidate = full.with_free(free.clone()).unwrap().with_matrix(sparse);
        let reach = Reach::new(&candidate);
        let at = |direction: f64| {
            let change =
                random(rows, columns, &mut rng(200 + seed)).zip_map(&free, |v, f| if f { v } else { 0.0 });
            let m = candidate.matrix() + change * direction;
            let s = close(&m, candidate.shape(), &[0.7, 1.0], Closure::Value)
                .unwrap()
                .s;
            own.sample(&s, 3, clock(), Derivative::Skip).unwrap().s
        };
        let moved = at(1e-3) - at(-1e-3);
        for j in 0..moved.ncols() {
            for i in 0..moved.nrows() {
                let active = reach.active.contains(&(i, j));
                assert!(active || moved[(i, j)].abs() < 1e-15, "seed {seed}: {:?}", (i, j));
            }
        }
        // Not everything is called active.
        assert!(reach.active.len() < 25 || seed > 0);
    }
}

#[test]
fn entries_that_are_not_active_do_not_move() {
    check_pattern(Continuous, [-0.3, -0.5, -0.9]);
    check_pattern(Discrete::new(0.5).unwrap(), [0.3, 0.5, -0.9]);
}
