//! The small LFR: 8 states and few deltas, from the same experiments, with bars of its own.

use crate::TaskError;
use crate::experiment::{Bench, median};
use crate::identification::{self, BAND_HZ, TestGrid};
use crate::size::{NOISE, Size};
use indicatif::ProgressBar;
use lfr_fit::moving::{MovingData, StaticLfr, StaticLfrSettings, fit_static, simulate_errors};
use lfr_fit::{
    DeltaSplit, FrozenData, GainFit, GrowSettings, Grown, LocalModel, LocalSettings, RefineSettings, Refined,
    grow, local_model, merge_lines, refine,
};
use lfr_realize::{ReduceSettings, reduce_to_continuous};
use lpv_core::nalgebra::{DMatrix, DVector};
use lpv_core::num_complex::Complex;
use lpv_core::{Continuous, DeltaBlock, Discrete, Frf, Lfr, Purpose, Record, StateSpace};
use rayon::prelude::*;
use serde::Serialize;
use std::f64::consts::TAU;
use std::time::Instant;
use xytable_plant::{
    ControllerSettings, Machine, MachineParameters, MoveKind, MoveSettings, MovingExperiment, MovingSettings,
    Noise, VerifiedController,
};

/// Everything under `lfr_small`.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct SmallAccount {
    noise_free_3: FrozenAccount,
    noise_free_4: FrozenAccount,
    noise_free_5: FrozenAccount,
    noise_free_6: FrozenAccount,
    noisy_5: NoisyAccount,
    starts: Starts,
    /// Strict error after joint reduction and refinement, over that of the best start; below -160 dB both count as exact.
    joint_reduction_loss_db: f64,
    joint_reduction: Reduction,
    moving: MovingAccount,
    sweep: SweepAccount,
    /// The whole noise-free fit with 5 deltas, from responses to LFR.
    seconds: f64,
    machines: Vec<MachineAccount>,
}

/// Frozen errors over 81 positions.
#[derive(Debug, Clone, Serialize)]
struct FrozenAccount {
    strict_max_db: f64,
    median_db: f64,
    /// Rms residual of the fit.
    residual: f64,
    starts: usize,
    iterations: usize,
}

#[derive(Debug, Clone, Serialize)]
struct NoisyAccount {
    strict_max_db_band: f64,
    strict_max_db_nyquist: f64,
    /// Error over its stated deviation, median over lines and positions.
    cramer_rao_ratio: f64,
    /// Stated deviation over the size of the response, the largest over lines and positions.
    bound_nyquist_db: f64,
    /// The same of the noise-free LFR with 3 deltas, had it been fitted to the noisy responses.
    bound_nyquist_3_db: f64,
    residual: f64,
    seconds: f64,
}

/// From the direct OBF LFR to 8 states and 5 deltas.
#[derive(Debug, Clone, Serialize)]
struct Reduction {
    from_states: usize,
    from_deltas: usize,
    /// Strict error of the reduced LFR against the machine, before it saw data again.
    before_db: f64,
    /// Refined on the data.
    reduced_db: f64,
    /// The best start without it, refined alike.
    best_start_db: f64,
}

#[derive(Debug, Clone, Serialize)]
struct Starts {
    reached: usize,
    of: usize,
    /// Longest of them, restarts included.
    longest_seconds: f64,
}

#[derive(Debug, Clone, Serialize)]
struct MovingAccount {
    deltas: usize,
    /// Closed loop on a fast back-and-forth that was not fitted, noise-free, rms of y1 (m) and y2 (rad).
    closed_loop_rms: [f64; 2],
    /// The same of the model that knows frozen responses only.
    frozen_only_rms: [f64; 2],
    /// The largest rms error over the three judged moves, from noisy data, over that of the model from noise-free data on
    /// the same noisy records, which is the noise as it leaves the closed loop; the larger of y1 and y2.
    noisy_over_noise: f64,
    /// The same over the noise of a sample of the sensor, by output.
    noisy_over_sensor: [f64; 2],
    /// What the noise alone leaves, over that of a sample of the sensor.
    noise_over_sensor: [f64; 2],
    seconds: f64,
}

#[derive(Debug, Clone, Serialize)]
struct SweepAccount {
    /// Slow sweep, open loop with recorded u and p, rms of y1 (m) and y2 (rad).
    open_loop_rms: [f64; 2],
}

#[derive(Debug, Clone, Serialize)]
struct MachineAccount {
    name: &'static str,
    positions: usize,
    noise_free_4: FrozenAccount,
    noise_free_5: FrozenAccount,
    noise_free_6: FrozenAccount,
    starts: Starts,
    moving: MovingAccount,
    sweep: SweepAccount,
}

/// One machine with what is needed to judge models of it.
struct Subject {
    machine: Machine,
    controller: VerifiedController,
    clock: Discrete,
    positions: usize,
    lines: Vec<f64>,
}

/// Largest and median error over these positions.
const JUDGED: usize = 81;
/// Lines up to Nyquist of the noise-free fits.
const LINES: usize = 160;

impl Subject {
    fn of_bench(bench: &Bench) -> Result<Self, TaskError> {
        Self::new(MachineParameters::default(), bench.size.positions)
    }

    fn new(parameters: MachineParameters, positions: usize) -> Result<Self, TaskError> {
        let machine = parameters.check()?;
        let clock = Discrete::from_rate(20.0)?;
        let controller = VerifiedController::by_rule(&machine, &ControllerSettings::default(), clock)?;
        let lines = (0..LINES)
            .map(|k| (k as f64 + 0.5) / LINES as f64 * 0.5 / clock.sample_time())
            .collect();
        Ok(Self {
            machine,
            controller,
            clock,
            positions,
            lines,
        })
    }

    fn truth(&self, p: f64, lines: &[f64]) -> Result<Frf, TaskError> {
        Ok(self.machine.sampled(p, self.clock)?.frequency_response(lines)?)
    }

    fn responses(&self) -> Result<FrozenData, TaskError> {
        let at = |p: f64| -> Result<_, TaskError> { Ok((vec![p], self.truth(p, &self.lines)?)) };
        let all: Vec<_> = self
            .machine
            .positions(self.positions)
            .into_iter()
            .map(at)
            .collect::<Result<_, _>>()?;
        Ok(FrozenData::relative(self.clock, &all)?)
    }

    fn local(&self, data: &FrozenData) -> Result<LocalModel<Continuous>, TaskError> {
        let centre = data.subset(|p| p[0].abs() < 1e-9)?;
        let poles = self.machine.sampled_flexible_poles(0.0, self.clock)?;
        Ok(local_model(
            Continuous,
            &centre,
            &poles,
            &LocalSettings::default(),
        )?)
    }

    fn grow(
        &self,
        data: &FrozenData,
        deltas: usize,
        settings: GrowSettings,
    ) -> Result<Grown<Continuous>, TaskError> {
        let local = self.local(data)?;
        Ok(grow(
            &local.flexible,
            local.gamma.as_ref(),
            data,
            &[DeltaBlock {
                parameter: 0,
                repetitions: deltas,
            }],
            &self.machine.scheduling_range()?,
            &settings,
        )?)
    }

    /// Errors of a model over the judged positions, at the given lines.
    fn errors(&self, lfr: &Lfr<Continuous>, lines: &[f64]) -> Result<Vec<f64>, TaskError> {
        let at = |p: f64| -> Result<Vec<f64>, TaskError> {
            let own = lfr
                .frozen(&[p])?
                .zero_order_hold(self.clock)?
                .frequency_response(lines)?;
            Ok(own.relative_error(&self.truth(p, lines)?)?)
        };
        let all: Vec<Vec<f64>> = self
            .machine
            .positions(JUDGED)
            .into_par_iter()
            .map(at)
            .collect::<Result<_, _>>()?;
        Ok(all.concat())
    }

    fn frozen(
        &self,
        data: &FrozenData,
        deltas: usize,
    ) -> Result<(FrozenAccount, Grown<Continuous>), TaskError> {
        let grown = self.grow(data, deltas, GrowSettings::default())?;
        let errors = self.errors(&grown.refined.candidate.to_lfr()?, &self.lines)?;
        let account = FrozenAccount {
            strict_max_db: decibel(errors.iter().copied().fold(0.0, f64::max)),
            median_db: decibel(median(errors)),
            residual: grown.refined.account.rms,
            starts: grown.starts.len(),
            iterations: grown.starts.iter().map(|s| s.iterations).sum(),
        };
        Ok((account, grown))
    }

    fn strict_db(&self, lfr: &Lfr<Continuous>) -> Result<f64, TaskError> {
        let errors = self.errors(lfr, &self.lines)?;
        Ok(decibel(errors.into_iter().fold(0.0, f64::max)))
    }

    /// The direct LFR reduced to 8 states and 5 deltas, then refined by the rule of every other start.
    fn reduction(&self, direct: &Lfr<Discrete>, data: &FrozenData) -> Result<Reduction, TaskError> {
        let deltas = [DeltaBlock {
            parameter: 0,
            repetitions: 5,
        }];
        let reduced = reduce_to_continuous(direct, 8, &deltas, &ReduceSettings::default())?;
        // One stopping rule for both.
        let settings = GrowSettings {
            gain: GainFit::Free,
            refine: RefineSettings {
                max_iterations: REDUCTION_ITERATIONS,
                ..RefineSettings::default()
            },
            ..GrowSettings::default()
        };
        let refined = reduced.grow(data, &settings)?;
        let best = self.grow(data, 5, settings)?;
        Ok(Reduction {
            from_states: direct.states(),
            from_deltas: direct.delta_count(),
            before_db: self.strict_db(&reduced.refined.candidate.to_lfr()?)?,
            reduced_db: self.strict_db(&refined.refined.candidate.to_lfr()?)?,
            best_start_db: self.strict_db(&best.refined.candidate.to_lfr()?)?,
        })
    }

    /// How many seeds reach both bars of 5 deltas by themselves.
    fn starts(&self, data: &FrozenData, seeds: u64) -> Result<Starts, TaskError> {
        let mut starts = Starts {
            reached: 0,
            of: 0,
            longest_seconds: 0.0,
        };
        for seed in 0..seeds {
            let began = Instant::now();
            let grown = self.grow(
                data,
                5,
                GrowSettings {
                    seed,
                    ..GrowSettings::default()
                },
            )?;
            starts.longest_seconds = starts.longest_seconds.max(began.elapsed().as_secs_f64());
            let errors = self.errors(&grown.refined.candidate.to_lfr()?, &self.lines)?;
            let strict = decibel(errors.iter().copied().fold(0.0, f64::max));
            starts.of += 1;
            starts.reached += usize::from(strict <= -60.0 && decibel(median(errors)) <= -80.0);
        }
        Ok(starts)
    }

    fn feedback(&self) -> Result<StateSpace<Discrete>, TaskError> {
        let [one, other] = self.controller.digital();
        Ok(one
            .state_space(self.clock)?
            .beside(&other.state_space(self.clock)?)?)
    }

    fn moves(&self, kinds: &[MoveKind], noise: bool, first_seed: u64) -> Result<Vec<Record>, TaskError> {
        let run = |(kind, seed): (&MoveKind, u64)| -> Result<Record, TaskError> {
            let setpoints = MoveSettings::default().setpoints(*kind, &self.machine, self.clock, seed)?;
            let settings = MovingSettings {
                noise: if noise {
                    Noise::Normal {
                        y1_std_m: NOISE[0],
                        y2_std_rad: NOISE[1],
                    }
                } else {
                    Noise::Off
                },
                seed,
                ..MovingSettings::default()
            };
            let made = MovingExperiment::new(&self.machine, &self.controller, setpoints, settings)?
                .run("move", Purpose::Estimation)?;
            Ok(made.record)
        };
        kinds.iter().zip(first_seed..).map(run).collect()
    }

    fn moving(&self, records: &[Record]) -> Result<MovingData, TaskError> {
        Ok(MovingData::new(
            self.clock,
            records,
            &NOISE,
            Some(&self.feedback()?),
        )?)
    }

    /// Coordinates from records, then both together.
    fn along(
        &self,
        frozen: &Refined<Continuous>,
        data: &FrozenData,
        moves: &MovingData,
        iterations: usize,
    ) -> Result<StaticLfr, TaskError> {
        let settings = StaticLfrSettings {
            splits: vec![DeltaSplit {
                forces: 1,
                outputs: 1,
                accelerations: 2,
            }],
            iterations,
            ..StaticLfrSettings::default()
        };
        let found = fit_static(frozen, data, moves, &settings)?;
        Ok(found.ok_or("no LFR of four deltas explains the responses")?)
    }

    /// Moves and sweep, from noise-free data and from noisy data. `noisy`: responses with noise, in few lines.
    fn in_time(
        &self,
        data: &FrozenData,
        frozen: &Refined<Continuous>,
        noisy: Option<(&FrozenData, &Refined<Continuous>)>,
    ) -> Result<(MovingAccount, SweepAccount), TaskError> {
        use MoveKind::{BackAndForth, Sweep, Wander};
        let fitted = [Sweep, BackAndForth, Wander, BackAndForth, Wander];
        let judged = [BackAndForth, Sweep, Wander];
        let began = Instant::now();
        let clean = self.moving(&self.moves(&fitted, false, 10)?)?;
        let found = self.along(frozen, data, &clean, 20)?.candidate;
        let seconds = began.elapsed().as_secs_f64();
        let records = self.moves(&judged, false, 50)?;
        let judge = self.moving(&records)?;
        let [closed, frozen_only] =
            [&found, &frozen.candidate].map(|c| simulate_errors(c, &judge).map(|e| rms(&e[0])));
        let sweep = &records[1];
        let matrix = |c: &[Vec<f64>]| DMatrix::from_fn(c.len(), c[0].len(), |i, k| c[i][k]);
        let lfr = found.to_lfr()?;
        let run = lfr.simulate_held(
            &DVector::zeros(lfr.states()),
            &matrix(&sweep.inputs.columns),
            &matrix(&sweep.scheduling.columns),
            self.clock,
        )?;
        let open_loop_rms = rms(&(matrix(&sweep.outputs.columns) - run.outputs));

        let (noisy_by_output, machine) = match noisy {
            None => ([f64::NAN; 2], [f64::NAN; 2]),
            Some((few, fit)) => {
                let moves = self.moving(&self.moves(&fitted, true, 110)?)?;
                let found_noisy = self.along(fit, few, &moves, 2)?.candidate;
                let judge = self.moving(&self.moves(&judged, true, 150)?)?;
                (
                    over_noise(&simulate_errors(&found_noisy, &judge)?),
                    over_noise(&simulate_errors(&found, &judge)?),
                )
            }
        };
        Ok((
            MovingAccount {
                deltas: lfr.delta_count(),
                closed_loop_rms: closed?,
                frozen_only_rms: frozen_only?,
                noisy_over_noise: (noisy_by_output[0] / machine[0]).max(noisy_by_output[1] / machine[1]),
                noisy_over_sensor: noisy_by_output,
                noise_over_sensor: machine,
                seconds,
            },
            SweepAccount { open_loop_rms },
        ))
    }
}

fn rms(errors: &DMatrix<f64>) -> [f64; 2] {
    [0, 1].map(|i| (errors.row(i).norm_squared() / errors.ncols() as f64).sqrt())
}

/// The largest over the records.
fn over_noise(errors: &[DMatrix<f64>]) -> [f64; 2] {
    [0, 1].map(|i| errors.iter().map(|e| rms(e)[i] / NOISE[i]).fold(0.0, f64::max))
}

fn decibel(ratio: f64) -> f64 {
    20.0 * ratio.log10()
}

/// A machine with other masses.
struct Made {
    name: &'static str,
    /// m1, m2, kg.
    masses: [f64; 2],
    /// J1, J2, kg m^2.
    inertias: [f64; 2],
    /// Uncoupled modes at p = 0, Hz.
    modes: [f64; 2],
    damping: f64,
}

const MACHINES: [Made; 3] = [
    Made {
        name: "light carriage, damping 0.005",
        masses: [8.0, 30.0],
        inertias: [0.15, 2.0],
        modes: [1.45, 2.0],
        damping: 0.005,
    },
    Made {
        name: "modes far apart, damping 0.02",
        masses: [16.0, 25.0],
        inertias: [0.4, 1.0],
        modes: [1.3, 2.3],
        damping: 0.02,
    },
    Made {
        name: "modes close, damping 0.05",
        masses: [10.0, 14.0],
        inertias: [0.3, 0.8],
        modes: [1.6, 1.9],
        damping: 0.05,
    },
];

impl Made {
    fn parameters(&self) -> MachineParameters {
        let reduced = [self.masses, self.inertias].map(|[a, b]| a * b / (a + b));
        let rate = self.modes.map(|f| TAU * f);
        MachineParameters {
            carriage_mass_kg: self.masses[0],
            beam_mass_kg: self.masses[1],
            carriage_inertia_kg_m2: self.inertias[0],
            beam_inertia_kg_m2: self.inertias[1],
            stiffness_y_n_per_m: rate[0] * rate[0] * reduced[0],
            stiffness_r_n_m_per_rad: rate[1] * rate[1] * reduced[1],
            damping_y_n_s_per_m: 2.0 * self.damping * rate[0] * reduced[0],
            damping_r_n_m_s_per_rad: 2.0 * self.damping * rate[1] * reduced[1],
            ..MachineParameters::default()
        }
    }
}

/// Strict errors below this, 1e-8, are equal: no data will ever show them.
const EXACT_DB: f64 = -160.0;

/// A reduced LFR of more deltas than the machine needs comes near it along a narrow valley.
const REDUCTION_ITERATIONS: usize = 2000;

/// Positions measured on them.
const FEW_POSITIONS: usize = 11;

pub(crate) fn run(size: Size, seed: u64) -> Result<SmallAccount, TaskError> {
    let seeds = if size == Size::full() { 20 } else { 3 };
    let bench = Bench::new(size, seed)?;
    let estimates = bench.run(&ProgressBar::hidden())?.estimates;
    let (pole_stage, _) = identification::poles(&bench, &estimates)?;
    let grid = TestGrid::new(&bench)?;
    let obf = identification::obf(&bench, &pole_stage, &estimates, &grid)?;
    let direct = identification::lfr(&obf, &grid)?.0.lfr;

    let subject = Subject::of_bench(&bench)?;
    let data = subject.responses()?;
    let began = Instant::now();
    let (noise_free_5, _) = subject.frozen(&data, 5)?;
    let seconds = began.elapsed().as_secs_f64();
    let (noise_free_3, three) = subject.frozen(&data, 3)?;
    let (noise_free_4, _) = subject.frozen(&data, 4)?;
    let (noise_free_6, _) = subject.frozen(&data, 6)?;
    let joint_reduction = subject.reduction(&direct, &data)?;

    let responses: Vec<_> = estimates
        .iter()
        .map(|e| (vec![e.single_position().unwrap_or(0.0)], e.clone()))
        .collect();
    let measured = FrozenData::weighted(bench.clock, &responses, 0.0)?;
    let began = Instant::now();
    let settings = GrowSettings {
        gain: GainFit::Free,
        ..GrowSettings::default()
    };
    let noisy = subject.grow(&measured, 5, settings)?.refined;
    let seconds_noisy = began.elapsed().as_secs_f64();
    let free_gain = three.refined.candidate.clone().with_free_gain()?;
    let as_it_is = RefineSettings {
        max_iterations: 0,
        ..RefineSettings::default()
    };
    let smallest = refine(&free_gain, &measured, &as_it_is)?;
    let noisy_5 = noisy_account(&subject, &noisy, &smallest, seconds_noisy)?;
    let local = subject.local(&measured)?;
    let range = subject.machine.scheduling_range()?;
    let gamma = local.gamma.as_ref();
    let few = merge_lines(&local.flexible, gamma, &measured, &range, &settings)?;
    let (moving, sweep) = subject.in_time(&data, &three.refined, Some((&few, &noisy)))?;
    Ok(SmallAccount {
        joint_reduction_loss_db: joint_reduction.reduced_db.max(EXACT_DB)
            - joint_reduction.best_start_db.max(EXACT_DB),
        joint_reduction,
        noise_free_3,
        noise_free_4,
        noise_free_5,
        noise_free_6,
        noisy_5,
        starts: subject.starts(&data, seeds)?,
        moving,
        sweep,
        seconds,
        machines: MACHINES
            .iter()
            .map(|made| machine(made, seeds))
            .collect::<Result<_, _>>()?,
    })
}

fn noisy_account(
    subject: &Subject,
    fit: &Refined<Continuous>,
    smallest: &Refined<Continuous>,
    seconds: f64,
) -> Result<NoisyAccount, TaskError> {
    let lfr = fit.candidate.to_lfr()?;
    let band: Vec<f64> = (0..200)
        .map(|k| 0.01 * (BAND_HZ / 0.01).powf(f64::from(k) / 199.0))
        .collect();
    let worst = |lines: &[f64]| -> Result<f64, TaskError> {
        Ok(decibel(
            subject.errors(&lfr, lines)?.into_iter().fold(0.0, f64::max),
        ))
    };
    let mut ratios = Vec::new();
    for p in subject.machine.positions(JUDGED) {
        let deviation = fit.response_deviation(&[p], &subject.lines)?;
        let truth = subject.truth(p, &subject.lines)?;
        let own = lfr
            .frozen(&[p])?
            .zero_order_hold(subject.clock)?
            .frequency_response(&subject.lines)?;
        for (k, deviation) in deviation.iter().enumerate() {
            let error: DMatrix<Complex<f64>> = own.line(k) - truth.line(k);
            ratios.push((error.map(|e| e.norm_sqr()).sum() / deviation.norm_squared()).sqrt());
        }
    }
    let bound = |fit: &Refined<Continuous>| -> Result<f64, TaskError> {
        let mut largest = 0.0_f64;
        for p in subject.machine.positions(JUDGED) {
            let truth = subject.truth(p, &subject.lines)?;
            let deviations = fit.response_deviation(&[p], &subject.lines)?;
            for (k, deviation) in deviations.iter().enumerate() {
                largest = largest.max(deviation.norm() / truth.line(k).norm());
            }
        }
        Ok(decibel(largest))
    };
    Ok(NoisyAccount {
        bound_nyquist_db: bound(fit)?,
        bound_nyquist_3_db: bound(smallest)?,
        strict_max_db_band: worst(&band)?,
        strict_max_db_nyquist: worst(&subject.lines)?,
        cramer_rao_ratio: median(ratios),
        residual: fit.account.rms,
        seconds,
    })
}

fn machine(made: &Made, seeds: u64) -> Result<MachineAccount, TaskError> {
    let subject = Subject::new(made.parameters(), FEW_POSITIONS)?;
    let data = subject.responses()?;
    let (noise_free_4, _) = subject.frozen(&data, 4)?;
    let (noise_free_5, five) = subject.frozen(&data, 5)?;
    let (noise_free_6, _) = subject.frozen(&data, 6)?;
    let starts = subject.starts(&data, seeds)?;
    let (moving, sweep) = subject.in_time(&data, &five.refined, None)?;
    Ok(MachineAccount {
        name: made.name,
        positions: FEW_POSITIONS,
        noise_free_4,
        noise_free_5,
        noise_free_6,
        starts,
        moving,
        sweep,
    })
}
