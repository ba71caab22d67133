//! Joint reduction of states and deltas.

use crate::common::*;
use lfr_fit::{
    Candidate, FitError, FrozenData, GainFit, GrowSettings, LocalSettings, StartKind, StartSearch, grow,
    local_model,
};
use lfr_realize::{RealizeError, ReduceSettings, realize, reduce, reduce_to_continuous};
use lpv_core::nalgebra::{DMatrix, dmatrix};
use lpv_core::{Clock, Continuous, Discrete, Frf, FrfEstimate, Lfr, LfrBlocks, StateSpace};
use lpv_ident::{Interpolation, RegressionSettings, RigidTerm, Weighting, regress};
use obf_basis::{FkcmSettings, OrthonormalBasis, PoleSet, fkcm};
use xytable_plant::{Machine, MachineParameters};

fn decibel(v: f64) -> f64 {
    20.0 * v.log10()
}

/// The same frozen responses with two states that no output sees, every delta split in two, and mixed coordinates.
fn inflated<K: Clock>(lfr: &Lfr<K>, seed: u64) -> Lfr<K> {
    let m = lfr.blocks();
    let (n, nd) = (lfr.states(), lfr.delta_count());
    let mut rng = rng(seed);
    let mut a = DMatrix::zeros(n + 2, n + 2);
    a.view_mut((0, 0), (n, n)).copy_from(&m.a);
    a.view_mut((n, 0), (2, n))
        .copy_from(&(random(2, n, &mut rng) * 0.1));
    a[(n, n)] = 0.3 * m.a[(0, 0)];
    a[(n + 1, n + 1)] = 0.6 * m.a[(0, 0)];
    let stack = |top: &DMatrix<f64>, bottom: &DMatrix<f64>| {
        DMatrix::from_fn(top.nrows() + bottom.nrows(), top.ncols(), |i, j| {
            if i < top.nrows() {
                top[(i, j)]
            } else {
                bottom[(i - top.nrows(), j)]
            }
        })
    };
    let beside =
        |left: &DMatrix<f64>, right: &DMatrix<f64>| stack(&left.transpose(), &right.transpose()).transpose();
    let b1 = stack(&m.b1, &(random(2, nd, &mut rng) * 0.1));
    let c1 = beside(&m.c1, &DMatrix::zeros(nd, 2));
    let t = random(n + 2, n + 2, &mut rng) + DMatrix::identity(n + 2, n + 2) * 2.0;
    let inverse = t.clone().try_inverse().unwrap();
    let s = random(2 * nd, 2 * nd, &mut rng) + DMatrix::identity(2 * nd, 2 * nd) * 2.0;
    let s_inverse = s.clone().try_inverse().unwrap();
    let double = |x: &DMatrix<f64>| beside(&(x * 0.3), &(x * 0.7));
    let blocks = LfrBlocks {
        a: &t * a * &inverse,
        b1: &t * double(&b1) * &s_inverse,
        b2: &t * stack(&m.b2, &random(2, m.b2.ncols(), &mut rng)),
        c1: &s * stack(&c1, &c1) * &inverse,
        d11: &s * stack(&double(&m.d11), &double(&m.d11)) * &s_inverse,
        d12: &s * stack(&m.d12, &m.d12),
        c2: beside(&m.c2, &DMatrix::zeros(m.c2.nrows(), 2)) * &inverse,
        d21: double(&m.d21) * &s_inverse,
        d22: m.d22.clone(),
    };
    Lfr::new(blocks, one_parameter(2 * nd), lfr.range().clone(), lfr.clock()).unwrap()
}

/// What is redundant goes without a loss, by balancing alone.
#[test]
fn redundant_states_and_deltas_are_found() {
    let settings = ReduceSettings {
        positions: Some(9),
        ..ReduceSettings::default()
    };
    for seed in 0..3 {
        let truth = discrete(2, seed).to_lfr().unwrap();
        let reduced = reduce(&inflated(&truth, seed), clock(), 2, &one_parameter(2), &settings).unwrap();
        let balanced = reduced
            .starts
            .iter()
            .find(|s| s.kind == StartKind::Given)
            .unwrap();
        assert!(
            balanced.few_rms < 1e-8 && balanced.iterations < 5,
            "seed {seed}: {:?}",
            reduced.starts
        );
        assert!(reduced.largest < 1e-8 && reduced.judged == 33);
        let truth = continuous(2, seed).to_lfr().unwrap();
        let reduced = reduce(&inflated(&truth, seed), clock(), 2, &one_parameter(2), &settings).unwrap();
        assert!(reduced.largest < 1e-8, "seed {seed}: {:?}", reduced.starts);
        assert_eq!(reduced.refined.candidate.to_lfr().unwrap().delta_count(), 2);
    }
}

/// The responses of the machine that xy-table tests use.
struct Bench {
    machine: Machine,
    clock: Discrete,
    data: FrozenData,
}

impl Bench {
    fn new() -> Self {
        let machine = MachineParameters::default().check().unwrap();
        let clock = Discrete::from_rate(20.0).unwrap();
        let positions = machine.positions(21);
        let mut bench = Self {
            data: FrozenData::relative(clock, &[(vec![0.0], response(&machine, clock, 0.0))]).unwrap(),
            machine,
            clock,
        };
        bench.data = FrozenData::relative(clock, &bench.responses(&positions)).unwrap();
        bench
    }

    fn responses(&self, positions: &[f64]) -> Vec<(Vec<f64>, Frf)> {
        let at = |p: &f64| (vec![*p], response(&self.machine, self.clock, *p));
        positions.iter().map(at).collect()
    }

    /// The direct LFR of the expansion in 16 functions, of degree 17: 36 states, 34 deltas.
    fn expansion(&self) -> Lfr<Discrete> {
        let positions = self.machine.positions(41);
        let poles = positions
            .iter()
            .flat_map(|p| self.machine.sampled_flexible_poles(*p, self.clock).unwrap());
        let upper: Vec<_> = poles.filter(|z| z.im > 0.0).collect();
        let poles = PoleSet::from_upper_half(&upper).unwrap();
        let found = fkcm(&poles, &FkcmSettings::new(16)).unwrap();
        let basis = OrthonormalBasis::takenaka_malmquist(&found.poles, self.clock).unwrap();
        let half = positions[40];
        let lobatto: Vec<f64> = (0..21)
            .map(|k| -half * (std::f64::consts::PI * f64::from(k) / 20.0).cos())
            .collect();
        let estimates: Vec<FrfEstimate> = self
            .responses(&lobatto)
            .into_iter()
            .map(|(p, g)| FrfEstimate::with_unit_covariance(g, Some(p[0].into())).unwrap())
            .collect();
        let settings = RegressionSettings {
            rigid_body: RigidTerm::diagonal(2),
            weighting: Weighting::Relative,
            ..RegressionSettings::default()
        };
        let fits = regress(&estimates, basis.state_space(), &settings).unwrap();
        let model = fits.interpolate(Interpolation::Polynomial { order: 17 }).unwrap();
        realize(&model.series().unwrap()).unwrap().lfr
    }

    /// Largest `||F - G||_F / ||G||_F` at 81 positions, decibels.
    fn strict(&self, mut frozen: impl FnMut(&[f64]) -> StateSpace<Discrete>) -> f64 {
        let truth = self.responses(&self.machine.positions(81));
        let errors = truth.iter().flat_map(|(p, g)| {
            let own = frozen(p).frequency_response(&table_lines()).unwrap();
            own.relative_error(g).unwrap()
        });
        decibel(errors.fold(0.0, f64::max))
    }

    fn strict_of(&self, candidate: &Candidate<Continuous>) -> f64 {
        self.strict(|p| candidate.frozen(p).unwrap().zero_order_hold(self.clock).unwrap())
    }
}

fn table_lines() -> Vec<f64> {
    (0..160).map(|k| (f64::from(k) + 0.5) / 16.0).collect()
}

fn response(machine: &Machine, clock: Discrete, p: f64) -> Frf {
    let sampled = machine.sampled(p, clock).unwrap();
    sampled.frequency_response(&table_lines()).unwrap()
}

/// From (36, 34) to (8, 5). The large LFR is itself far from the machine, and so is what is nearest to it; fitted to the
/// responses of the machine it is as good as what grows there from the true poles.
#[test]
fn the_expansion_reduces_to_eight_states_and_five_deltas() {
    let bench = Bench::new();
    let large = bench.expansion();
    assert_eq!((large.states(), large.delta_count()), (36, 34));
    let of_large = bench.strict(|p| large.frozen(p).unwrap());
    let five = one_parameter(5);
    let reduced = reduce_to_continuous(&large, 8, &five, &ReduceSettings::default()).unwrap();
    let lfr = reduced.refined.candidate.to_lfr().unwrap();
    assert_eq!((lfr.states(), lfr.delta_count(), reduced.judged), (8, 5, 81));
    let gamma = reduced.gamma.as_ref().unwrap();
    // Held: the integrators are those of the expansion, exactly.
    assert_eq!(
        reduced
            .refined
            .candidate
            .matrix()
            .view((2, 8), (2, 2))
            .into_owned(),
        *gamma
    );
    assert!(decibel(reduced.largest) < -12.0 && decibel(reduced.median) < -35.0);
    let before = bench.strict_of(&reduced.refined.candidate);
    assert!(before < of_large - 3.0, "{before} {of_large}");

    // On the data, by the same stages and the same rule as every other start.
    let range = bench.machine.scheduling_range().unwrap();
    let poles = bench.machine.sampled_flexible_poles(0.0, bench.clock).unwrap();
    let centre = bench.data.subset(|p| p[0] == 0.0).unwrap();
    let local = local_model(Continuous, &centre, &poles, &LocalSettings::default()).unwrap();
    // All starts but the random ones: how far beyond its target a single one goes is chance.
    let settings = GrowSettings {
        gain: GainFit::Free,
        search: StartSearch::All,
        restarts: 0,
        ..GrowSettings::default()
    };
    let own = reduced.grow(&bench.data, &settings).unwrap();
    let (flexible, gamma) = (&local.flexible, local.gamma.as_ref());
    let best = grow(flexible, gamma, &bench.data, &five, &range, &settings).unwrap();
    assert!(own.reached && best.reached);
    // What is smaller no data will ever show.
    let [own, best] = [own, best].map(|grown| bench.strict_of(&grown.refined.candidate).max(EXACT));
    assert!(own - best <= 1.0, "{own} dB against {best} dB");
}

/// A strict error of 1e-8, decibels.
const EXACT: f64 = -160.0;

#[test]
fn what_cannot_be_reduced_is_refused() {
    let settings = ReduceSettings {
        positions: Some(5),
        ..ReduceSettings::default()
    };
    let one = |a: DMatrix<f64>, b: DMatrix<f64>, c: DMatrix<f64>, touched: f64| {
        let n = a.nrows();
        let blocks = LfrBlocks {
            b1: DMatrix::from_element(n, 1, touched),
            c1: DMatrix::from_fn(1, n, |_, j| if j + 1 == n { 1.0 } else { 0.0 }),
            d11: dmatrix![0.1],
            d12: dmatrix![0.0],
            d21: dmatrix![0.0],
            d22: dmatrix![0.0],
            a,
            b2: b,
            c2: c,
        };
        Lfr::new(blocks, one_parameter(1), interval(), clock()).unwrap()
    };
    let refused = |lfr: &Lfr<Discrete>, states: usize| {
        reduce(lfr, clock(), states, &one_parameter(1), &settings).unwrap_err()
    };
    let unstable = one(dmatrix![1.2], dmatrix![1.0], dmatrix![1.0], 0.0);
    assert!(
        matches!(refused(&unstable, 1), RealizeError::Reduction { problem, .. } if problem.contains("outside"))
    );
    let single = one(
        dmatrix![1.0, 0.0; 0.0, 0.5],
        dmatrix![1.0; 1.0],
        dmatrix![1.0, 1.0],
        0.0,
    );
    assert!(
        matches!(refused(&single, 2), RealizeError::Reduction { problem, .. } if problem.contains("rigid"))
    );
    // (z + 1) / (z - 1)^2 whose gain follows a delta.
    let chain = dmatrix![1.0, 1.0, 0.0; 0.0, 1.0, 0.0; 0.0, 0.0, 0.5];
    let t2 = clock().sample_time().powi(2);
    let moving = one(
        chain.clone(),
        dmatrix![0.0; 1.0; 1.0],
        dmatrix![t2, 0.5 * t2, 1.0],
        0.1,
    );
    assert!(matches!(refused(&moving, 3), RealizeError::Reduction { .. }));
    let held = one(chain, dmatrix![0.0; 1.0; 1.0], dmatrix![t2, 0.5 * t2, 1.0], 0.0);
    assert!(matches!(
        refused(&held, 2),
        RealizeError::Fit(FitError::Setting { name: "states", .. })
    ));
    let nothing = reduce(&held, clock(), 3, &one_parameter(0), &settings).unwrap_err();
    assert_eq!(nothing, RealizeError::Fit(FitError::Empty { what: "deltas" }));
    for (name, settings) in [
        (
            "positions",
            ReduceSettings {
                positions: Some(1),
                ..ReduceSettings::default()
            },
        ),
        (
            "lines",
            ReduceSettings {
                lines: 0,
                ..ReduceSettings::default()
            },
        ),
    ] {
        assert!(matches!(settings.check(), Err(FitError::Setting { name: n, .. }) if n == name));
    }
}
