//! The searches on the positioning machine, against an independent search's best costs.
use crate::machine;
use num_complex::{Complex, c64};
use obf_basis::{
    FkcmSettings, MinimaxSettings, PoleSet, PoleUnit, Refinement, Stop, Verdict, choose_functions, fkcm,
    kolmogorov_cost_db, log_fuzzy_cost, polish_minimax,
};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};

/// Functions and best known n-width cost over the continuum, dB.
const BEST: [(usize, f64); 4] = [(4, -2.55), (8, -6.92), (12, -12.37), (16, -19.42)];

fn grid() -> PoleSet {
    PoleSet::new(&machine::sampled_poles(21)).unwrap()
}

fn minimax() -> obf_basis::MinimaxSettings {
    MinimaxSettings::default()
}

#[test]
fn the_machine_has_the_reference_poles() {
    for (p, expected) in [
        (0.0, [c64(-0.18850, 12.56496), c64(-0.13666, 9.10959)]),
        (0.3, [c64(-0.24348, 13.49371), c64(-0.15854, 10.26832)]),
    ] {
        let poles = machine::continuous_poles(p);
        for e in expected {
            assert!(
                poles.iter().any(|s| (s - e).norm() < 1e-5),
                "{p}: {e} is missing from {poles:?}"
            );
        }
    }
}

#[test]
fn the_machine_poles_are_roots() {
    // An inaccurate eigenvalue solver would move every cost below, so each pole meets its characteristic equation.
    for k in 0..=20 {
        let p = -0.3 + 0.03 * f64::from(k);
        let poles = machine::continuous_poles(p);
        assert_eq!(poles.len(), 4);
        for s in poles {
            let residual = machine::characteristic(p, s).norm() / s.norm().powi(4);
            assert!(residual < 1e-12, "{p}: {s} leaves {residual:e}");
        }
    }
}

#[test]
fn fuzzy_search_on_the_grid_is_within_1_db_of_the_best_on_the_continuum() {
    let dense = machine::sampled_poles(2001);
    for (functions, best) in BEST {
        let found = fkcm(&grid(), &FkcmSettings::new(functions)).unwrap();
        let cost = kolmogorov_cost_db(&found.poles, &dense).unwrap();
        assert!(cost <= best + 1.0, "{functions}: {cost}");
        assert_eq!(found.poles.len(), functions);
        assert_eq!(found.stop, Stop::Converged);
        assert!(found.reached_best >= 1);
        let columns = found.memberships.row_sum();
        assert!(columns.iter().all(|s| (s - 1.0).abs() < 1e-12));
        // Work, not time: a start that needs many more Newton steps than today is a defect.
        assert!(found.refinement_steps < 250);
        let raw = FkcmSettings {
            refinement: Refinement::None,
            ..FkcmSettings::new(functions)
        };
        assert!(fkcm(&grid(), &raw).unwrap().log_fuzzy_cost >= found.log_fuzzy_cost);
    }
}

#[test]
fn minimax_on_the_continuum_reaches_the_best_known() {
    let dense = machine::sampled_poles(2001);
    for (functions, best) in BEST {
        // From the fuzzy search, and from a single poor start without extra ones.
        let found = fkcm(&grid(), &FkcmSettings::new(functions)).unwrap();
        let polished = polish_minimax(&found.poles, &dense, &minimax()).unwrap();
        assert!(
            polished.cost_db <= best + 0.01,
            "{functions}: {}",
            polished.cost_db
        );
        assert!(polished.cost_db <= polished.start_cost_db);
        // On an arc of continuous poles n pairs balance at least n + 1 maxima.
        assert!(polished.active.len() > functions / 2);
        assert_eq!(polished.stop, Stop::Converged);
        assert!(polished.iterations < 400);
    }
}

#[test]
fn noise_of_1e_5_on_the_poles_costs_little() {
    let dense = machine::sampled_poles(2001);
    for seed in 0..4 {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut noise = || rng.random_range(-2e-5..2e-5);
        let noisy: Vec<_> = grid()
            .upper_half()
            .into_iter()
            .map(|z| z + c64(noise(), noise()))
            .collect();
        let noisy = PoleSet::from_upper_half(&noisy).unwrap();
        for (functions, best) in BEST {
            let found = fkcm(&noisy, &FkcmSettings::new(functions)).unwrap();
            let cost = kolmogorov_cost_db(&found.poles, &dense).unwrap();
            assert!(cost <= best + 1.0, "{seed}, {functions}: {cost}");
        }
    }
}

#[test]
fn one_pair_needs_no_refinement() {
    // With one centre the memberships are one, and the centre step solves the whole problem but for the lagged factor.
    let raw = FkcmSettings {
        refinement: Refinement::None,
        ..FkcmSettings::new(2)
    };
    let alternation = fkcm(&grid(), &raw).unwrap();
    let polished = polish_minimax(&alternation.poles, grid().as_slice(), &minimax()).unwrap();
    assert!(
        alternation.cost_db <= polished.cost_db + 1e-3,
        "{} {}",
        alternation.cost_db,
        polished.cost_db
    );
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let run = || {
        let found = fkcm(
            &grid(),
            &FkcmSettings {
                seed: 5,
                ..FkcmSettings::new(12)
            },
        )
        .unwrap();
        let polished = polish_minimax(&found.poles, grid().as_slice(), &minimax()).unwrap();
        (found, polished)
    };
    let pool = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
    assert_eq!(pool(1).install(run), pool(3).install(run));
}

#[test]
fn the_smallest_size_that_reaches_the_target_is_chosen() {
    let settings = FkcmSettings::new(2);
    let choice = choose_functions(&grid(), 2..=16, -12.0, &settings).unwrap();
    assert_eq!(
        (choice.verdict, choice.result.poles.len()),
        (Verdict::Reached, 12)
    );
    assert!(choice.table.windows(2).all(|w| w[1].cost_db < w[0].cost_db));
    let choice = choose_functions(&grid(), 2..=6, -12.0, &settings).unwrap();
    assert_eq!(
        (choice.verdict, choice.result.poles.len()),
        (Verdict::NotReached, 6)
    );
    #[allow(
        clippy::reversed_empty_ranges,
        reason = "the refusal of such a range is tested"
    )]
    let refused = choose_functions(&grid(), 6..=2, -12.0, &settings);
    assert!(refused.is_err());
}

#[test]
fn real_observations_get_real_poles_and_enough_poles_are_exact() {
    let reals: Vec<_> = (0..9)
        .map(|k| PoleUnit::Real(0.5 + 0.04 * f64::from(k)))
        .collect();
    let set = PoleSet::from_units(reals).unwrap();
    let found = fkcm(
        &set,
        &FkcmSettings {
            real_centres: Some(3),
            ..FkcmSettings::new(3)
        },
    )
    .unwrap();
    assert!(
        found
            .poles
            .units()
            .iter()
            .all(|u| matches!(u, PoleUnit::Real(a) if (0.5..0.82).contains(a)))
    );
    let polished = polish_minimax(&found.poles, set.as_slice(), &minimax()).unwrap();
    assert!(polished.cost_db <= found.cost_db && found.cost_db < -20.0);
    let exact = fkcm(
        &set,
        &FkcmSettings {
            real_centres: Some(9),
            ..FkcmSettings::new(9)
        },
    )
    .unwrap();
    assert_eq!((exact.cost_db, exact.stop), (f64::NEG_INFINITY, Stop::Exact));
}

fn inside() -> impl Strategy<Value = Complex<f64>> {
    (0.0..0.95f64, 0.01..3.1f64).prop_map(|(r, t)| Complex::from_polar(r, t))
}

fn wild() -> impl Strategy<Value = Vec<Complex<f64>>> {
    let number = prop_oneof![
        any::<f64>(),
        -1.0..1.0f64,
        Just(0.0),
        Just(f64::NAN),
        Just(f64::INFINITY),
        Just(1.0)
    ];
    let edge = (0u32..60, 0.0..std::f64::consts::PI)
        .prop_map(|(k, t)| Complex::from_polar(1.0 - 0.5f64.powi(k as i32), t));
    let one = prop_oneof![(number.clone(), number).prop_map(|(a, b)| c64(a, b)), edge];
    prop::collection::vec(one, 0..6)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn cost_is_invariant_and_monotone(
        basis in prop::collection::vec(inside(), 1..5), observed in prop::collection::vec(inside(), 1..8),
        extra in inside(), shift in -0.8..0.8f64,
    ) {
        let set = PoleSet::from_upper_half(&basis).unwrap();
        let cost = kolmogorov_cost_db(&set, &observed).unwrap();
        let conjugates: Vec<_> = observed.iter().map(|z| z.conj()).collect();
        prop_assert!((kolmogorov_cost_db(&set, &conjugates).unwrap() - cost).abs() < 1e-9);
        // A real Moebius map keeps the upper half of the disc and every kappa.
        let map = |z: &Complex<f64>| (z + shift) / (1.0 + shift * z);
        let mapped = PoleSet::from_upper_half(&basis.iter().map(map).collect::<Vec<_>>()).unwrap();
        let mapped_cost = kolmogorov_cost_db(&mapped, &observed.iter().map(map).collect::<Vec<_>>()).unwrap();
        prop_assert!((mapped_cost - cost).abs() < 1e-6 * (1.0 + cost.abs()));
        let more: Vec<_> = basis.iter().copied().chain([extra]).collect();
        prop_assert!(kolmogorov_cost_db(&PoleSet::from_upper_half(&more).unwrap(), &observed).unwrap() <= cost);
        let neper = cost / 20.0 * 10f64.ln() / basis.len() as f64;
        prop_assert!((log_fuzzy_cost(&set, &observed, 1e6).unwrap() - neper).abs() < 1e-3);
    }

    #[test]
    fn wild_input_never_panics(poles in wild(), observed in wild(), n in 0usize..7, m in any::<f64>(), reals in 0usize..4) {
        let _ = PoleSet::new(&poles);
        let settings = FkcmSettings { fuzziness: m, starts: 2, max_iterations: 20, ..FkcmSettings::new(n) };
        let _ = FkcmSettings { real_centres: Some(reals), tolerance: m, ..settings.clone() }.check();
        let tame = FkcmSettings { starts: 2, ..FkcmSettings::new(n.max(1)) };
        let settings = if settings.check().is_ok() { settings } else { tame };
        let quick = MinimaxSettings { extra_starts: 1, max_iterations: 40, ..MinimaxSettings::default() };
        if let Ok(set) = PoleSet::from_upper_half(&poles) {
            let found = fkcm(&set, &settings).unwrap();
            prop_assert!(!found.cost_db.is_nan() && found.cost_db <= 0.0);
            prop_assert_eq!(found.poles.len(), settings.functions);
            let cost = kolmogorov_cost_db(&set, &observed);
            let polished = polish_minimax(&set, &observed, &quick);
            prop_assert_eq!(cost.is_ok(), polished.is_ok());
            if let Ok(polished) = polished {
                prop_assert!(polished.cost_db <= polished.start_cost_db);
            }
            let clock = lpv_core::Discrete::new(1.0).unwrap();
            prop_assert!(obf_basis::OrthonormalBasis::takenaka_malmquist(&set, clock).is_ok());
        }
        let _ = log_fuzzy_cost(&PoleSet::new(&[c64(0.5, 0.0)]).unwrap(), &observed, m);
    }
}
