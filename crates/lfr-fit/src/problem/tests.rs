use super::*;
use crate::test_kit::{candidate, clock, random, responses, rng, weighted};
use crate::{Channel, RandomChannels};
use lpv_core::StateSpace;
use lpv_core::{Continuous, DeltaBlock, SchedulingRange};

const ONE: [Channel; 2] = [Channel::Parameter(0), Channel::Parameter(0)];
const MIXED: [Channel; 3] = [Channel::Parameter(0), Channel::Direct, Channel::Parameter(0)];

const SLOW: [f64; 3] = [-0.3, -0.8, -1.9];
const INSIDE: [f64; 3] = [0.2, 0.5, -0.6];

fn direction(problem: &Problem<'_, impl Sampling>, seed: u64) -> DVector<f64> {
    let n = problem.free.len();
    random(n, 1, &mut rng(seed)).column(0).into_owned()
}

/// The gradient `J^T r` against differences of the cost, and `||J d||` against the cost of data that the start fits
/// exactly.
fn check_derivatives<K: Sampling>(candidate: &Candidate<K>, other: &FrozenData, own: &FrozenData) {
    let problem = Problem::new(candidate, other).unwrap();
    let theta = problem.theta(candidate);
    let linear = problem.linearise(&theta).unwrap();
    let gradient = linear.jacobian.transpose() * &linear.residual;
    for seed in 0..4 {
        let d = direction(&problem, seed);
        let h = 1e-5;
        let at = |h: f64| problem.cost(&(&theta + &d * h)).unwrap().total;
        let difference = (at(h) - at(-h)) / (4.0 * h);
        let exact = gradient.dot(&d);
        let scale = gradient.norm() * d.norm();
        assert!(
            (difference - exact).abs() < 1e-6 * scale,
            "{difference:e} {exact:e}"
        );
    }
    let problem = Problem::new(candidate, own).unwrap();
    let linear = problem.linearise(&theta).unwrap();
    assert!(problem.cost(&theta).unwrap().total < 1e-20 * problem.data.equations() as f64);
    for seed in 4..8 {
        let d = direction(&problem, seed);
        let h = 1e-6;
        let at = |h: f64| problem.cost(&(&theta + &d * h)).unwrap().total / (h * h);
        let exact = (&linear.jacobian * &d).norm_squared();
        let difference = 0.5 * (at(h) + at(-h));
        assert!(
            (difference - exact).abs() < 1e-5 * exact,
            "{difference:e} {exact:e}"
        );
    }
}

fn check<K: Sampling>(own: K, poles: [f64; 3], channels: &[Channel], lines: usize) {
    let model = candidate(own, poles, channels, 3);
    let other = responses(&candidate(own, poles, channels, 8), lines);
    let exact = responses(&model, lines);
    check_derivatives(&model, &weighted(&other, 0.1, 1), &weighted(&exact, 0.0, 2));
    let relative = |r: &[(Vec<f64>, Frf)]| FrozenData::relative(clock(), r).unwrap();
    check_derivatives(&model, &relative(&other), &relative(&exact));
    // A third of the entries free.
    let free = random(model.matrix().nrows(), model.matrix().ncols(), &mut rng(5)).map(|v| v > 0.3);
    let sparse = model.with_free(free).unwrap();
    check_derivatives(&sparse, &relative(&other), &relative(&exact));
}

#[test]
fn the_whole_jacobian_meets_finite_differences() {
    check(Continuous, SLOW, &ONE, 20);
    check(Continuous, SLOW, &MIXED, 20);
    check(Continuous, SLOW, &[], 20);
    check(clock(), INSIDE, &ONE, 20);
    check(clock(), INSIDE, &MIXED, 20);
}

/// More lines than one factorisation, and than one task, takes.
#[test]
fn many_lines_are_taken_in_parts() {
    check(clock(), INSIDE, &ONE, 2500);
}

fn check_indistinguishable<K: Sampling>(own: K, poles: [f64; 3], channels: &[Channel], dimension: usize) {
    let model = candidate(own, poles, channels, 3);
    let data = responses(&candidate(own, poles, channels, 8), 15);
    let data = FrozenData::relative(clock(), &data).unwrap();
    let problem = Problem::new(&model, &data).unwrap();
    let theta = problem.theta(&model);
    let tangents = problem.indistinguishable(&theta).unwrap();
    let linear = problem.linearise(&theta).unwrap();
    for tangent in tangents.column_iter() {
        let moved = (&linear.jacobian * tangent).norm();
        assert!(
            moved < 1e-11 * linear.jacobian.norm() * tangent.norm(),
            "{moved:e}"
        );
    }
    let rank = tangents.rank(1e-10);
    assert_eq!(rank, dimension);
    // What is left is determined: no tangent is missing.
    let values = linear.jacobian.clone().singular_values();
    let determined = values.iter().filter(|v| **v > 1e-10 * values.max()).count();
    assert_eq!(determined, problem.free.len() - rank);
}

#[test]
fn changes_of_coordinates_do_nothing_and_are_all_that_does_nothing() {
    // Similarity of three states, and of the channels of one parameter.
    check_indistinguishable(Continuous, SLOW, &ONE, 9 + 4);
    check_indistinguishable(clock(), INSIDE, &ONE, 9 + 4);
    check_indistinguishable(clock(), INSIDE, &[], 9);
    // The row of a direct channel may be added to seven rows and its column to seven columns, its own entry being in
    // both. Of the two rows of y and the two columns of u only one combination leaves D22 alone.
    check_indistinguishable(
        clock(),
        INSIDE,
        &[Channel::Parameter(0), Channel::Direct],
        9 + 1 + 7 + 7 - 1 - 4 + 1,
    );
}

/// A fixed output matrix leaves no change of the states, a fixed row of it leaves those that keep this row.
#[test]
fn fixed_entries_restrict_the_changes_of_coordinates() {
    for (rows, dimension) in [(3..4, 6), (3..5, 3)] {
        let model = candidate(clock(), INSIDE, &[], 3);
        let free = DMatrix::from_fn(5, 5, |i, j| !(rows.contains(&i) && j < 3 || i >= 3 && j >= 3));
        let model = model.with_free(free).unwrap();
        let data = FrozenData::relative(clock(), &responses(&model, 15)).unwrap();
        let problem = Problem::new(&model, &data).unwrap();
        let tangents = problem.indistinguishable(&problem.theta(&model)).unwrap();
        assert_eq!(tangents.rank(1e-9), dimension);
        let linear = problem.linearise(&problem.theta(&model)).unwrap();
        assert!((linear.jacobian * tangents).norm() < 1e-10);
    }
}

/// With the rigid body left out of the search the cost is that of the whole model.
#[test]
fn constant_states_change_nothing() {
    let part = |rows, columns, seed| random(rows, columns, &mut rng(seed));
    let a = DMatrix::from_row_slice(2, 2, &[-0.2, 1.5, -1.5, -0.2]);
    let local = StateSpace::new(a, part(2, 2, 1), part(2, 2, 2), DMatrix::zeros(2, 2), Continuous).unwrap();
    let gamma = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.3, 2.0]);
    let delta = DeltaBlock {
        parameter: 0,
        repetitions: 2,
    };
    let range = SchedulingRange::interval(1.0, 3.0).unwrap();
    let random = RandomChannels { seed: 3, size: 0.2 };
    let model = Candidate::flexible(&local, Some(&gamma), &[delta], range, random).unwrap();
    let frequencies_hz: Vec<f64> = (1..20).map(|k| 0.05 * f64::from(k)).collect();
    let positions = [1.0, 2.2, 3.0].map(|p| {
        let held = model.frozen(&[p]).unwrap().zero_order_hold(clock()).unwrap();
        (vec![p], held.frequency_response(&frequencies_hz).unwrap())
    });
    let data = FrozenData::relative(clock(), &positions).unwrap();
    let problem = Problem::new(&model, &data).unwrap();
    let theta = problem.theta(&model);
    assert_eq!((problem.shape.states, theta.len()), (2, 6 * 6 - 8));
    assert!(problem.cost(&theta).unwrap().total < 1e-24);
    assert_eq!(problem.candidate(&theta), model);
    let moved = &theta * 1.01;
    let changed = problem.candidate(&moved);
    let error = positions.iter().flat_map(|(p, g)| {
        let held = changed.frozen(p).unwrap().zero_order_hold(clock()).unwrap();
        held.frequency_response(&frequencies_hz)
            .unwrap()
            .relative_error(g)
            .unwrap()
    });
    let expected: f64 = error.map(|e| e * e).sum();
    let found = problem.cost(&moved).unwrap().total;
    assert!((found - expected).abs() < 1e-9 * expected);
}

/// Where the residual r is zero, `phi = |r|^2 / 2` along d has the third derivative `3 r'.r''`.
#[test]
fn curvature_is_that_of_the_cost() {
    let model = candidate(Continuous, SLOW, &ONE, 3);
    let data = weighted(&responses(&model, 20), 0.0, 2);
    let problem = Problem::new(&model, &data).unwrap();
    let theta = problem.theta(&model);
    let linear = problem.linearise(&theta).unwrap();
    for seed in 0..4 {
        let d = direction(&problem, seed) * 0.01;
        let at = |h: f64| 0.5 * problem.cost(&(&theta + &d * h)).unwrap().total;
        let h = 0.1;
        let third = (at(2.0 * h) - 2.0 * at(h) + 2.0 * at(-h) - at(-2.0 * h)) / (2.0 * h * h * h);
        let exact = 3.0 * problem.curvature(&theta, &linear, &d).unwrap().dot(&d);
        let scale = (&linear.jacobian * &d).norm_squared();
        assert!(
            exact.abs() > 1e-4 * scale,
            "the residuals are straight: {exact:e} of {scale:e}"
        );
        assert!((third - exact).abs() < 2e-2 * exact.abs(), "{third:e} {exact:e}");
    }
}
