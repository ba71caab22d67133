//! Validation in time, Sec. V-B: open loop on a fast sweep of p, closed loop on a step-like setpoint.

use crate::TaskError;
use crate::experiment::Bench;
use crate::size::NOISE;
use lpv_core::nalgebra::DMatrix;
use lpv_core::{Controller, Discrete, Lfr, Purpose, Record, StateSpace};
use lpv_simulate::{Frozen, Run, SimulateError, closed_loop, open_loop, rms_error};
use rayon::prelude::*;
use serde::Serialize;
use xytable_plant::{
    Machine, MoveLimits, MovingExperiment, MovingSettings, Noise, Profile, Setpoint, Setpoints,
};

/// Errors of one model on one record: rms in metres and radians, and as multiples of the noise.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct TimeError {
    pub(crate) rms: Vec<f64>,
    pub(crate) over_noise: Vec<f64>,
}

impl TimeError {
    fn new(rms: Vec<f64>) -> Self {
        let over_noise = rms.iter().zip(NOISE).map(|(e, n)| e / n).collect();
        Self { rms, over_noise }
    }
}

/// Figures in time.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct TimeAccount {
    /// y1 (m) and y2 (rad), recorded u and p, fast monotone sweep.
    pub(crate) open_loop_sweep_rms: [f64; 2],
    /// The same in closed loop along the setpoint.
    pub(crate) closed_loop_rms: [f64; 2],
    pub(crate) open_loop_sweep_over_noise: [f64; 2],
    pub(crate) closed_loop_over_noise: [f64; 2],
    /// Closed loop at constant p (the middle between two positions): what the frozen error alone does.
    pub(crate) closed_loop_constant_p: TimeError,
    /// The plant's own model, sampled at frozen p, as the reference to compare with.
    pub(crate) plant_open_loop: TimeError,
    pub(crate) plant_closed_loop: TimeError,
    /// Estimated error of the integration behind the records, m or rad.
    pub(crate) integration_error: f64,
}

/// What the figure shows.
pub(crate) struct TimeStage {
    pub(crate) account: TimeAccount,
    pub(crate) record: Record,
    pub(crate) open: DMatrix<f64>,
    pub(crate) closed: DMatrix<f64>,
    pub(crate) clock: Discrete,
}

/// Length of the records.
const SAMPLES: usize = 4000;

/// The true plant, frozen at each p and sampled: exact where p stands still, physical coordinates where it moves.
struct SampledPlant<'a>(&'a Machine, Discrete);

impl Frozen for SampledPlant<'_> {
    fn at(&self, p: &[f64]) -> Result<StateSpace<Discrete>, SimulateError> {
        let refused = SimulateError::Structure {
            problem: "the scheduling record leaves the stroke of the machine",
        };
        self.0
            .sampled(p.first().copied().unwrap_or(0.0), self.1)
            .map_err(|_| refused)
    }
}

pub(crate) fn validate(bench: &Bench, lfr: &Lfr<Discrete>) -> Result<TimeStage, TaskError> {
    let controller = controller(bench);
    let (sweep, still) = rayon::join(|| moving_record(bench), || still_record(bench));
    let ((sweep, integration_error), still) = (sweep?, still?);
    let plant = SampledPlant(&bench.machine, bench.clock);
    let runs: [&(dyn Fn() -> Result<Run, SimulateError> + Sync); 5] = [
        &|| open_loop(lfr, &sweep, None),
        &|| closed_loop(lfr, &controller, &sweep, None),
        &|| closed_loop(lfr, &controller, &still, None),
        &|| open_loop(&plant, &sweep, None),
        &|| closed_loop(&plant, &controller, &sweep, None),
    ];
    let runs = runs.par_iter().with_max_len(1).map(|run| Ok(run()?.outputs));
    let outputs = runs.collect::<Result<Vec<_>, TaskError>>()?;
    let [open, closed, stands, plant_open, plant_closed]: [DMatrix<f64>; 5] =
        outputs.try_into().map_err(|_| "five simulations")?;
    let pair = |simulated: &DMatrix<f64>, record: &Record| TimeError::new(rms_error(simulated, record));
    let (o, c) = (pair(&open, &sweep), pair(&closed, &sweep));
    let two = |v: &[f64]| [v[0], v[1]];
    let account = TimeAccount {
        open_loop_sweep_rms: two(&o.rms),
        closed_loop_rms: two(&c.rms),
        open_loop_sweep_over_noise: two(&o.over_noise),
        closed_loop_over_noise: two(&c.over_noise),
        closed_loop_constant_p: pair(&stands, &still),
        plant_open_loop: pair(&plant_open, &sweep),
        plant_closed_loop: pair(&plant_closed, &sweep),
        integration_error,
    };
    Ok(TimeStage {
        account,
        record: sweep,
        open,
        closed,
        clock: bench.clock,
    })
}

fn controller(bench: &Bench) -> Controller {
    let loops = bench.controller.digital();
    let list = |f: fn(&xytable_plant::DigitalController) -> &[f64]| {
        loops.iter().map(|k| f(k).to_vec()).collect::<Vec<_>>()
    };
    Controller {
        reference_numerator: list(|k| k.numerator()),
        feedback_numerator: list(|k| k.numerator()),
        denominator: list(|k| k.denominator()),
        limit: None,
    }
}

/// The step-like pattern of y'_1 (0.1 m in all), zero for y'_2.
fn steps() -> Result<Profile, TaskError> {
    let limits = MoveLimits {
        speed: 0.02,
        acceleration: 0.01,
        jerk: 0.02,
    };
    Ok(Profile::at(0.0, limits)?
        .dwell(5.0)?
        .steps(&[0.05, 0.1, 0.05, 0.0, -0.05, 0.0], 12.0)?)
}

fn run(bench: &Bench, x1: Setpoint, name: &str) -> Result<(Record, f64), TaskError> {
    let setpoints = Setpoints {
        y1: steps()?.sample(bench.clock, SAMPLES),
        y2: Setpoint::constant(0.0, SAMPLES),
        x1,
        injection: None,
    };
    let settings = MovingSettings {
        noise: Noise::Off,
        tolerance: 1e-10,
        ..MovingSettings::default()
    };
    let made = MovingExperiment::new(&bench.machine, &bench.controller, setpoints, settings)?
        .run(name, Purpose::Validation)?;
    Ok((made.record, made.account.estimated_error))
}

fn moving_record(bench: &Bench) -> Result<(Record, f64), TaskError> {
    let limits = MoveLimits {
        speed: 0.01,
        acceleration: 0.005,
        jerk: 0.01,
    };
    let x1 = Profile::sweep(&bench.machine, 0.98, limits)?.sample(bench.clock, SAMPLES);
    run(bench, x1, "sweep")
}

fn still_record(bench: &Bench) -> Result<Record, TaskError> {
    let between = 0.5 * (bench.positions[2] + bench.positions[3]);
    Ok(run(bench, Setpoint::constant(between, SAMPLES), "still")?.0)
}
