//! The xy-table: responses at 21 positions to small LFRs, judged at 81.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up must fail")]

use lfr_realize::{
    DeltaReach, FrozenData, GrowSettings, Grown, LocalModel, LocalSettings, RefineSettings, grow, local_model,
};
use lpv_core::num_complex::Complex;
use lpv_core::{Continuous, DeltaBlock, Discrete, Frf, WellPosedness};
use xytable_plant::{Machine, MachineParameters};

struct Bench {
    machine: Machine,
    clock: Discrete,
    data: FrozenData,
    local: LocalModel<Continuous>,
}

impl Bench {
    fn new() -> Self {
        let machine = MachineParameters::default().check().unwrap();
        let clock = Discrete::from_rate(20.0).unwrap();
        let at = |p: f64| (vec![p], response(&machine, clock, p));
        let responses: Vec<(Vec<f64>, Frf)> = machine.positions(21).into_iter().map(at).collect();
        let data = FrozenData::relative(clock, &responses).unwrap();
        let centre = data.subset(|p| p[0] == 0.0).unwrap();
        // As a fit gives them: 1 % off.
        let poles: Vec<Complex<f64>> = machine
            .sampled_flexible_poles(0.0, clock)
            .unwrap()
            .into_iter()
            .map(|z| (z.ln() * 1.01).exp())
            .collect();
        let local = local_model(
            Continuous,
            &centre,
            &poles,
            &LocalSettings::new().check().unwrap(),
        )
        .unwrap();
        Self {
            machine,
            clock,
            data,
            local,
        }
    }

    fn grow(&self, deltas: usize, reach: DeltaReach, seed: u64) -> Grown<Continuous> {
        let deltas = [DeltaBlock {
            parameter: 0,
            repetitions: deltas,
        }];
        let settings = GrowSettings::new()
            .reach(reach)
            .seed(seed)
            .refine(RefineSettings::new().target(3e-5));
        let range = self.machine.scheduling_range().unwrap();
        let (flexible, gamma) = (&self.local.flexible, self.local.gamma.as_ref());
        grow(
            flexible,
            gamma,
            &self.data,
            &deltas,
            &range,
            &settings.check().unwrap(),
        )
        .unwrap()
    }

    /// Largest and median of `||G - F||_F / ||F||_F` over all lines at 81 positions, decibels.
    fn errors(&self, grown: &Grown<Continuous>) -> (f64, f64) {
        let mut errors: Vec<f64> = Vec::new();
        for p in self.machine.positions(81) {
            let frozen = grown.refined.candidate.frozen(&[p]).unwrap();
            let found = frozen
                .zero_order_hold(self.clock)
                .unwrap()
                .frequency_response(&lines())
                .unwrap();
            errors.extend(
                found
                    .relative_error(&response(&self.machine, self.clock, p))
                    .unwrap(),
            );
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

fn response(machine: &Machine, clock: Discrete, p: f64) -> Frf {
    machine
        .sampled(p, clock)
        .unwrap()
        .frequency_response(&lines())
        .unwrap()
}

#[test]
fn few_deltas_do_for_the_whole_stroke() {
    let bench = Bench::new();
    let gamma = bench.local.gamma.as_ref().unwrap();
    // The decoupled machine is I / s^2 at low frequency.
    assert!((gamma - lpv_core::nalgebra::DMatrix::identity(2, 2)).amax() < 1e-9);
    let (states, outputs) = (DeltaReach::States, DeltaReach::Outputs);
    for (deltas, reach, seeds, worst, median) in [
        (3, outputs, 1, -50.0, -75.0),
        (4, outputs, 1, -60.0, -80.0),
        (5, states, 4, -65.0, -85.0),
        (6, states, 1, -65.0, -85.0),
    ] {
        for seed in (0..seeds).map(|s| 100 * s) {
            let grown = bench.grow(deltas, reach, seed);
            let (largest, middle) = bench.errors(&grown);
            assert!(grown.reached, "{deltas} deltas, seed {seed}: {:?}", grown.starts);
            assert!(
                largest < worst && middle < median,
                "{deltas} deltas, seed {seed}: {largest} {middle}"
            );
            let lfr = grown.refined.candidate.to_lfr().unwrap();
            assert_eq!((lfr.states(), lfr.delta_count()), (8, deltas));
            assert!(matches!(
                lfr.well_posedness().unwrap(),
                WellPosedness::Proven { .. }
            ));
            // Changes of coordinates: similarity of four states and of the deltas.
            assert_eq!(grown.refined.account.gauge, 16 + deltas * deltas);
            let work: usize = grown.starts.iter().map(|s| s.iterations).sum();
            assert!(work < 400, "{deltas} deltas, seed {seed}: {work} iterations");
        }
    }
}
