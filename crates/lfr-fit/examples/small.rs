//! Four xy-tables as small LFRs: responses at constant positions, poles at the middle one, and nothing else.
//!
//! For each machine a table over the number of deltas: largest and median relative error over 81 positions, the start
//! that won, and which size would be taken. Then how 20 random starts and the deterministic one fare with 5 deltas.

use lfr_fit::{
    FrozenData, GrowSettings, LocalSettings, RefineSettings, Sizes, StartAccount, StartKind, StartOutcome,
    StartSearch, grow, grow_sizes, local_model,
};
use lpv_core::{Continuous, DeltaBlock, Discrete, Frf};
use std::f64::consts::TAU;
use std::time::Instant;
use xytable_plant::{Machine, MachineParameters};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// Masses m1, m2, inertias J1, J2, modes, damping ratio, positions.
const MACHINES: [([f64; 4], [f64; 2], f64, usize); 4] = [
    ([12.0, 20.0, 0.25, 1.2], [1.45, 2.0], 0.015, 21),
    ([8.0, 30.0, 0.15, 2.0], [1.45, 2.0], 0.005, 11),
    ([16.0, 25.0, 0.4, 1.0], [1.3, 2.3], 0.02, 11),
    ([10.0, 14.0, 0.3, 0.8], [1.6, 1.9], 0.05, 11),
];

fn main() -> Result<()> {
    for (masses, modes, damping, positions) in MACHINES {
        println!("masses {masses:?}, modes {modes:?}, damping {damping}, {positions} positions");
        let case = Case::new(machine(masses, modes, damping)?, positions)?;
        let first = case.settings(0);
        let all = GrowSettings {
            restarts: 1,
            search: StartSearch::All,
            ..case.settings(0)
        };
        // What `lpv identify` would do: stop at the first size that reaches the target.
        let began = Instant::now();
        let taken = case.sizes(&first)?;
        println!(
            "  takes {} deltas ({:?}) after {:.0} ms",
            taken.chosen + 1,
            taken.choice,
            1e3 * began.elapsed().as_secs_f64()
        );
        case.table(&case.sizes(&all)?)?;
        case.starts()?;
    }
    Ok(())
}

struct Case {
    machine: Machine,
    clock: Discrete,
    lines: Vec<f64>,
    data: FrozenData,
    truth: Vec<(Vec<f64>, Frf)>,
}

impl Case {
    fn new(machine: Machine, positions: usize) -> Result<Self> {
        let clock = Discrete::from_rate(20.0)?;
        let lines: Vec<f64> = (0..160).map(|k| (f64::from(k) + 0.5) / 16.0).collect();
        let responses = |count: usize| -> Result<Vec<(Vec<f64>, Frf)>> {
            let at = |p: f64| Ok((vec![p], machine.sampled(p, clock)?.frequency_response(&lines)?));
            machine.positions(count).into_iter().map(at).collect()
        };
        Ok(Self {
            data: FrozenData::relative(clock, &responses(positions)?)?,
            truth: responses(81)?,
            machine,
            clock,
            lines,
        })
    }

    fn settings(&self, seed: u64) -> GrowSettings {
        GrowSettings {
            seed,
            refine: RefineSettings {
                target: 1e-5,
                ..RefineSettings::default()
            },
            ..GrowSettings::default()
        }
    }

    fn local(&self) -> Result<lfr_fit::LocalModel<Continuous>> {
        let centre = self.data.subset(|p| p[0] == 0.0)?;
        let poles = self.machine.sampled_flexible_poles(0.0, self.clock)?;
        let settings = LocalSettings::default();
        Ok(local_model(Continuous, &centre, &poles, &settings)?)
    }

    fn sizes(&self, settings: &lfr_fit::GrowSettings) -> Result<Sizes<Continuous>> {
        let local = self.local()?;
        let sizes: Vec<Vec<DeltaBlock>> = (1..=6).map(deltas).collect();
        let range = self.machine.scheduling_range()?;
        let gamma = local.gamma.as_ref();
        Ok(grow_sizes(
            &local.flexible,
            gamma,
            &self.data,
            &sizes,
            &range,
            settings,
        )?)
    }

    fn table(&self, sizes: &Sizes<Continuous>) -> Result<()> {
        println!("  states deltas     rms   largest    median  won by    each start: rms, iterations, ms");
        for grown in &sizes.grown {
            let lfr = grown.refined.candidate.to_lfr()?;
            let mut errors = Vec::new();
            for (p, g) in &self.truth {
                let frozen = lfr.frozen(p)?.zero_order_hold(self.clock)?;
                errors.extend(frozen.frequency_response(&self.lines)?.relative_error(g)?);
            }
            errors.sort_by(f64::total_cmp);
            let decibel = |e: f64| 20.0 * e.log10();
            println!(
                "  {:6} {:6} {:.1e} {:6.1} dB {:6.1} dB  {:9} {}",
                lfr.states(),
                lfr.delta_count(),
                grown.refined.account.rms,
                decibel(errors[errors.len() - 1]),
                decibel(errors[errors.len() / 2]),
                name(&grown.starts[grown.winner]),
                grown.starts.iter().map(text).collect::<Vec<_>>().join(", ")
            );
        }
        Ok(())
    }

    fn starts(&self) -> Result<()> {
        let settings = GrowSettings {
            restarts: 20,
            search: StartSearch::All,
            ..self.settings(0)
        };
        let began = Instant::now();
        let local = self.local()?;
        let range = self.machine.scheduling_range()?;
        let (gamma, five) = (local.gamma.as_ref(), deltas(5));
        let grown = grow(&local.flexible, gamma, &self.data, &five, &range, &settings)?;
        let spent: f64 = grown.starts.iter().map(|s| s.seconds).sum();
        let (first, random) = grown.starts.split_at(grown.starts.len() - 20);
        let mut seconds: Vec<f64> = random.iter().map(|s| s.seconds).collect();
        seconds.sort_by(f64::total_cmp);
        let reached = |s: &&StartAccount| matches!(s.outcome, StartOutcome::Refined { rms } if rms <= 3e-5);
        println!(
            "  5 deltas: {} of 20 random starts reach 3e-5, median {:.0} ms, longest {:.0} ms; coherent start {}; before any start {:.0} ms",
            random.iter().filter(reached).count(),
            1e3 * seconds[10],
            1e3 * seconds[19],
            text(&first[0]),
            1e3 * (began.elapsed().as_secs_f64() - spent)
        );
        Ok(())
    }
}

fn name(start: &StartAccount) -> &'static str {
    match start.kind {
        StartKind::Coherent { .. } => "coherent",
        StartKind::Given => "given",
        StartKind::Random { .. } => "random",
    }
}

fn text(start: &StartAccount) -> String {
    let ms = 1e3 * start.seconds;
    match start.outcome {
        StartOutcome::Refined { rms } => format!("{} {rms:.1e} {} {ms:.0}", name(start), start.iterations),
        other => format!("{} {other:?} {} {ms:.0}", name(start), start.iterations),
    }
}

fn deltas(repetitions: usize) -> Vec<DeltaBlock> {
    vec![DeltaBlock {
        parameter: 0,
        repetitions,
    }]
}

fn machine([m1, m2, j1, j2]: [f64; 4], modes_hz: [f64; 2], damping: f64) -> Result<Machine> {
    let reduced = [m1 * m2 / (m1 + m2), j1 * j2 / (j1 + j2)];
    let rate = modes_hz.map(|f| TAU * f);
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
    Ok(parameters.check()?)
}
