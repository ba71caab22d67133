//! The xy-table and three like it: responses at 21 or 11 positions to small LFRs, judged at 81.

use lfr_fit::{
    DeltaReach, FrozenData, GrowSettings, LocalModel, LocalSettings, RefineSettings, Refined, SizeChoice,
    StartAccount, StartKind, StartOutcome, StartSearch, grow, grow_sizes, local_model,
};
use lpv_core::nalgebra::DMatrix;
use lpv_core::num_complex::Complex;
use lpv_core::{
    Continuous, DeltaBlock, Discrete, Frf, FrfEstimate, SchedulingRange, StateSpace, WellPosedness,
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::TAU;
use xytable_plant::{Machine, MachineParameters};

/// Masses m1, m2, inertias J1, J2, modes, damping ratio, positions. The first is the default.
const MACHINES: [([f64; 4], [f64; 2], f64, usize); 4] = [
    ([12.0, 20.0, 0.25, 1.2], [1.45, 2.0], 0.015, 21),
    ([8.0, 30.0, 0.15, 2.0], [1.45, 2.0], 0.005, 11),
    ([16.0, 25.0, 0.4, 1.0], [1.3, 2.3], 0.02, 11),
    ([10.0, 14.0, 0.3, 0.8], [1.6, 1.9], 0.05, 11),
];

struct Bench {
    machine: Machine,
    range: SchedulingRange,
    clock: Discrete,
    responses: Vec<(Vec<f64>, Frf)>,
}

impl Bench {
    fn new(([m1, m2, j1, j2], modes, damping, positions): ([f64; 4], [f64; 2], f64, usize)) -> Self {
        let reduced = [m1 * m2 / (m1 + m2), j1 * j2 / (j1 + j2)];
        let rate = modes.map(|f| TAU * f);
        let parameters = MachineParameters {
            carriage_mass_kg: m1,
            beam_mass_kg: m2,
            carriage_inertia_kg_m2: j1,
            beam_inertia_kg_m2: j2,
            stiffness_y_n_per_m: rate[0] * rate[0] * reduced[0],
            stiffness_r_n_m_per_rad: rate[1] * rate[1] * reduced[1],
            damping_y_n_s_per_m: 2.0 * damping * rate[0] * reduced[0],
            damping_r_n_m_s_per_rad: 2.0 * damping * rate[1] * reduced[1],
            ..MachineParameters::default()
        };
        let machine = parameters.check().unwrap();
        let clock = Discrete::from_rate(20.0).unwrap();
        let at = |p: f64| (vec![p], response(&machine, clock, p));
        Self {
            responses: machine.positions(positions).into_iter().map(at).collect(),
            range: machine.scheduling_range().unwrap(),
            machine,
            clock,
        }
    }

    fn exact(&self) -> FrozenData {
        FrozenData::relative(self.clock, &self.responses).unwrap()
    }

    /// White noise on the outputs, 1 % of the median of the response of each; the covariance is known.
    fn noisy(&self, seed: u64) -> FrozenData {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let one = |(p, exact): &(Vec<f64>, Frf)| {
            let deviation = |row: usize| {
                let mut sizes: Vec<f64> = (0..exact.len()).map(|k| exact.line(k).row(row).norm()).collect();
                sizes.sort_by(f64::total_cmp);
                0.01 * sizes[sizes.len() / 2]
            };
            let deviation = [deviation(0), deviation(1)];
            let (mut c, mut s) = (Vec::new(), Vec::new());
            let mut frf = exact.clone();
            for k in 0..frf.len() {
                let variance = deviation.map(|d| Complex::from(d * d));
                c.extend(DMatrix::from_diagonal(&variance.to_vec().into()).iter());
                s.extend(DMatrix::<Complex<f64>>::identity(2, 2).iter());
                for (at, v) in frf.line_slice_mut(k).iter_mut().enumerate() {
                    let half = deviation[at % 2] * 0.5_f64.sqrt();
                    *v += Complex::new(half * normal(), half * normal());
                }
            }
            (
                p.clone(),
                FrfEstimate::new(frf, c, s, f64::INFINITY, None).unwrap(),
            )
        };
        let estimates: Vec<_> = self.responses.iter().map(one).collect();
        FrozenData::weighted(self.clock, &estimates, 0.0).unwrap()
    }

    /// From poles as a fit gives them: 1 % off.
    fn local(&self, data: &FrozenData) -> LocalModel<Continuous> {
        let centre = data.subset(|p| p[0] == 0.0).unwrap();
        let poles = self.machine.sampled_flexible_poles(0.0, self.clock).unwrap();
        let poles: Vec<Complex<f64>> = poles.into_iter().map(|z| (z.ln() * 1.01).exp()).collect();
        let settings = LocalSettings::default();
        local_model(Continuous, &centre, &poles, &settings).unwrap()
    }

    /// Largest and median of `||G - F||_F / ||F||_F` over all lines at 81 positions, decibels.
    fn errors(&self, refined: &Refined<Continuous>) -> (f64, f64) {
        let mut errors: Vec<f64> = Vec::new();
        for p in self.machine.positions(81) {
            let found = held(&refined.candidate.frozen(&[p]).unwrap(), self.clock);
            let truth = response(&self.machine, self.clock, p);
            errors.extend(found.relative_error(&truth).unwrap());
        }
        errors.sort_by(f64::total_cmp);
        let decibel = |e: f64| 20.0 * e.log10();
        (
            decibel(errors[errors.len() - 1]),
            decibel(errors[errors.len() / 2]),
        )
    }
}

fn lines() -> Vec<f64> {
    (0..160).map(|k| (f64::from(k) + 0.5) / 16.0).collect()
}

fn held(frozen: &StateSpace<Continuous>, clock: Discrete) -> Frf {
    let held = frozen.zero_order_hold(clock).unwrap();
    held.frequency_response(&lines()).unwrap()
}

fn response(machine: &Machine, clock: Discrete, p: f64) -> Frf {
    machine
        .sampled(p, clock)
        .unwrap()
        .frequency_response(&lines())
        .unwrap()
}

fn deltas(repetitions: usize) -> Vec<DeltaBlock> {
    vec![DeltaBlock {
        parameter: 0,
        repetitions,
    }]
}

fn settings() -> GrowSettings {
    GrowSettings {
        refine: RefineSettings {
            target: 1e-5,
            ..RefineSettings::default()
        },
        ..GrowSettings::default()
    }
}

#[test]
fn few_deltas_do_for_the_whole_stroke() {
    for case in MACHINES {
        let bench = Bench::new(case);
        let (data, range) = (bench.exact(), &bench.range);
        let local = bench.local(&data);
        let gamma = local.gamma.as_ref().unwrap();
        // The decoupled machine is I / s^2 at low frequency.
        assert!((gamma - DMatrix::identity(2, 2)).amax() < 1e-9);
        for (count, reach, worst, median) in [
            (3, DeltaReach::Outputs, -60.0, -80.0),
            (4, DeltaReach::States, -70.0, -95.0),
            (5, DeltaReach::States, -75.0, -95.0),
            (6, DeltaReach::States, -75.0, -95.0),
        ] {
            let settings = GrowSettings { reach, ..settings() };
            let flexible = &local.flexible;
            let grown = grow(flexible, Some(gamma), &data, &deltas(count), range, &settings).unwrap();
            let (largest, middle) = bench.errors(&grown.refined);
            assert!(
                grown.reached && largest < worst && middle < median,
                "{case:?}, {count} deltas: {largest} {middle} {:?}",
                grown.starts
            );
            let lfr = grown.refined.candidate.to_lfr().unwrap();
            assert_eq!((lfr.states(), lfr.delta_count()), (8, count));
            let posed = lfr.well_posedness().unwrap();
            assert!(matches!(posed, WellPosedness::Proven { .. }));
            // Changes of coordinates: similarity of four states and of the deltas.
            assert_eq!(grown.refined.account.indistinguishable, 16 + count * count);
            let work: usize = grown.starts.iter().map(|s| s.iterations).sum();
            assert!(work < 600, "{case:?}, {count} deltas: {work} iterations");
        }
    }
}

/// The smallest size that reaches the target, or the one beyond which little is won.
#[test]
fn sizes_are_chosen() {
    let bench = Bench::new(MACHINES[1]);
    let data = bench.exact();
    let local = bench.local(&data);
    let settings = settings();
    let choose = |counts: &[usize]| {
        let sizes: Vec<_> = counts.iter().map(|n| deltas(*n)).collect();
        let gamma = local.gamma.as_ref();
        let sizes = grow_sizes(&local.flexible, gamma, &data, &sizes, &bench.range, &settings).unwrap();
        (sizes.choice, sizes.chosen, sizes.grown.len())
    };
    assert_eq!(choose(&[1, 2, 3, 4]), (SizeChoice::TargetReached, 2, 3));
    assert_eq!(choose(&[1, 2]), (SizeChoice::Knee, 1, 2));
}

/// With noise of known covariance the residual is the noise, and the error of the model is as large as the fit says.
/// The default machine has one delta more: with 4 the search ends in a narrow valley, 3 % above the noise.
#[test]
fn noise_is_reached() {
    for ((case, seed), count) in MACHINES.into_iter().zip(1..).zip([5, 4, 4, 4]) {
        let bench = Bench::new(case);
        let data = bench.noisy(seed);
        let local = bench.local(&data);
        let settings = GrowSettings::default();
        let gamma = local.gamma.as_ref();
        let grown = grow(
            &local.flexible,
            gamma,
            &data,
            &deltas(count),
            &bench.range,
            &settings,
        )
        .unwrap();
        let (refined, rms) = (&grown.refined, grown.refined.account.rms);
        assert!(
            grown.reached && (0.98..1.02).contains(&rms),
            "{case:?}: {rms} {:?}",
            grown.starts
        );
        let (mut squares, mut expected) = (0.0, 0.0);
        for p in bench.machine.positions(9) {
            let found = held(&refined.candidate.frozen(&[p]).unwrap(), bench.clock);
            let truth = response(&bench.machine, bench.clock, p);
            let deviations = refined.response_deviation(&[p], &lines()).unwrap();
            for (k, deviation) in deviations.iter().enumerate() {
                let weight = 1.0 / truth.line(k).norm_squared();
                squares += (found.line(k) - truth.line(k)).norm_squared() * weight;
                expected += deviation.norm_squared() * weight;
            }
        }
        let ratio = (squares / expected).sqrt();
        let account = &refined.account;
        assert!(
            ratio < 1.5,
            "{case:?}: {ratio} {} {:?}",
            account.decrease,
            account.stop
        );
    }
}

/// Twenty random starts and the deterministic one, each by itself. About a minute.
#[test]
#[ignore = "long"]
fn every_start_reaches_the_target() {
    for case in MACHINES {
        let bench = Bench::new(case);
        let data = bench.exact();
        let local = bench.local(&data);
        let settings = GrowSettings {
            restarts: 20,
            search: StartSearch::All,
            ..settings()
        };
        let gamma = local.gamma.as_ref();
        let grown = grow(&local.flexible, gamma, &data, &deltas(5), &bench.range, &settings).unwrap();
        let random = |s: &&StartAccount| matches!(s.kind, StartKind::Random { .. });
        assert_eq!(grown.starts.iter().filter(random).count(), 20);
        for start in grown.starts.iter().filter(random).chain(grown.starts.first()) {
            let reached = matches!(start.outcome, StartOutcome::Refined { rms } if rms <= 3e-5);
            assert!(reached, "{case:?}: {start:?}");
        }
    }
}
