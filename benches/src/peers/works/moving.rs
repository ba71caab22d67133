//! The plant while its carriage moves, in its loop.

use super::{Failure, Run, write};
use differential_equations::prelude::*;
use lpv_benches::Bench;
use lpv_core::{Discrete, Purpose};
use std::path::Path;
use xytable_plant::{
    ControllerSettings, DigitalController, Discretisation, MachineParameters, MovingExperiment,
    MovingSettings, Noise, PlantError, discretise,
};

const SAMPLES: usize = 4000;

/// A tolerance at which an integrator of order eight takes a sample in one step, and stays far below 1e-10.
const THEIRS: f64 = 1e-6;

fn settings() -> MovingSettings {
    MovingSettings {
        noise: Noise::Off,
        ..MovingSettings::default()
    }
}

pub(super) fn ours() -> Result<Run, Failure> {
    let bench = Bench::new()?;
    let setpoints = bench.sweep(SAMPLES)?;
    Ok(Box::new(move || {
        let experiment =
            MovingExperiment::new(&bench.machine, &bench.controller, setpoints.clone(), settings())?;
        let record = experiment.run("sweep", Purpose::Validation)?.record;
        Ok(record.outputs.columns.concat())
    }))
}

/// The largest error of an output, m or rad, against sixteen steps a sample.
pub(super) fn error(found: &[f64]) -> Result<f64, Failure> {
    let bench = Bench::new()?;
    let setpoints = bench.sweep(SAMPLES)?;
    let experiment = MovingExperiment::new(&bench.machine, &bench.controller, setpoints, settings())?;
    let mut truth = [Vec::new(), Vec::new()];
    experiment.stream(16, &mut |sample| -> Result<(), PlantError> {
        (0..2).for_each(|i| truth[i].push(sample.outputs[i]));
        Ok(())
    })?;
    let truth = truth.concat();
    if truth.len() != found.len() {
        return Err(format!("{} numbers for {}", found.len(), truth.len()).into());
    }
    let differences = truth.iter().zip(found).map(|(a, b)| (a - b).abs());
    Ok(differences.fold(0.0, f64::max))
}

fn servo(clock: Discrete) -> Result<DigitalController, Failure> {
    let rule = ControllerSettings {
        bandwidth_hz: MovingSettings::default().servo_bandwidth_hz,
        ..ControllerSettings::default()
    };
    let sampled = discretise(&rule.design()?, clock, Discretisation::ZeroOrderHold)?;
    Ok(DigitalController::from_state_space(&sampled)?)
}

pub(super) fn export(folder: &Path) -> Result<(), Failure> {
    let bench = Bench::new()?;
    let q = bench.machine.parameters();
    let numbers = [
        q.carriage_mass_kg,
        q.beam_mass_kg,
        q.carriage_inertia_kg_m2,
        q.beam_inertia_kg_m2,
        q.half_beam_m,
        q.stiffness_y_n_per_m,
        q.stiffness_r_n_m_per_rad,
        q.damping_y_n_s_per_m,
        q.damping_r_n_m_s_per_rad,
        q.servo_mass_kg,
        bench.clock.sample_time(),
        THEIRS,
    ];
    write(folder, "machine", numbers)?;
    let servo = servo(bench.clock)?;
    for (i, loop_) in bench.controller.digital().iter().chain([&servo]).enumerate() {
        write(
            folder,
            &format!("numerator{i}"),
            loop_.numerator().iter().copied(),
        )?;
        write(
            folder,
            &format!("denominator{i}"),
            loop_.denominator().iter().copied(),
        )?;
    }
    let setpoints = bench.sweep(SAMPLES)?;
    let all = [
        setpoints.y1.position(),
        setpoints.y2.position(),
        setpoints.x1.position(),
        setpoints.x1.velocity(),
    ];
    write(folder, "setpoints", all.concat())
}

/// The bodies under held commands, as a user of an integrator writes them.
struct Bodies {
    machine: MachineParameters,
    force: f64,
    commands: [f64; 2],
}

impl ODE<f64, [f64; 10]> for Bodies {
    fn diff(&self, _t: f64, x: &[f64; 10], rates: &mut [f64; 10]) {
        let q = &self.machine;
        let (p, [u1, u2]) = (x[0], self.commands);
        let (m1, l) = (q.carriage_mass_kg, q.half_beam_m);
        let inertia = m1 * p * p + q.carriage_inertia_kg_m2 + q.beam_inertia_kg_m2;
        let push = (m1 + q.beam_mass_kg) * u1 + m1 * p * u2;
        let turn = (m1 * p * u1 + inertia * u2) / l;
        let (left, right) = (0.5 * (push - turn), 0.5 * (push + turn));
        let f_y = q.stiffness_y_n_per_m * (x[1] - x[3] - p * x[4])
            + q.damping_y_n_s_per_m * (x[6] - x[8] - p * x[9]);
        let f_r = q.stiffness_r_n_m_per_rad * (x[2] - x[4]) + q.damping_r_n_m_s_per_rad * (x[7] - x[9]);
        rates[..5].copy_from_slice(&x[5..]);
        rates[5] = self.force / q.servo_mass_kg;
        rates[6] = -f_y / m1;
        rates[7] = -f_r / q.carriage_inertia_kg_m2;
        rates[8] = (f_y + left + right) / q.beam_mass_kg;
        rates[9] = (p * f_y + f_r + l * (right - left)) / q.beam_inertia_kg_m2;
    }
}

/// A difference equation, direct form.
struct Law {
    numerator: Vec<f64>,
    denominator: Vec<f64>,
    errors: Vec<f64>,
    outputs: Vec<f64>,
}

impl Law {
    fn new(controller: &DigitalController) -> Self {
        let (numerator, denominator) = (controller.numerator().to_vec(), controller.denominator().to_vec());
        Self {
            errors: vec![0.0; numerator.len()],
            outputs: vec![0.0; denominator.len()],
            numerator,
            denominator,
        }
    }

    fn next(&mut self, error: f64) -> f64 {
        self.errors.rotate_right(1);
        self.errors[0] = error;
        self.outputs.rotate_right(1);
        let forward: f64 = self.numerator.iter().zip(&self.errors).map(|(b, e)| b * e).sum();
        let back: f64 = self.denominator[1..]
            .iter()
            .zip(&self.outputs[1..])
            .map(|(a, u)| a * u)
            .sum();
        self.outputs[0] = forward - back;
        self.outputs[0]
    }
}

pub(super) fn peer() -> Result<Run, Failure> {
    let bench = Bench::new()?;
    let (setpoints, servo) = (bench.sweep(SAMPLES)?, servo(bench.clock)?);
    Ok(Box::new(move || {
        let t = bench.clock.sample_time();
        let [mut k1, mut k2] = bench.controller.digital().each_ref().map(Law::new);
        let mut law = Law::new(&servo);
        let mut bodies = Bodies {
            machine: *bench.machine.parameters(),
            force: 0.0,
            commands: [0.0; 2],
        };
        let (position, velocity) = (setpoints.x1.position(), setpoints.x1.velocity());
        let start = [setpoints.y1.position()[0], setpoints.y2.position()[0]];
        let y = start[0] + position[0] * start[1];
        let mut x = [position[0], y, start[1], y, start[1], 0.0, 0.0, 0.0, 0.0, 0.0];
        let (mut one, mut other) = (Vec::with_capacity(2 * SAMPLES), Vec::with_capacity(SAMPLES));
        for k in 0..SAMPLES {
            let outputs = [x[1] - x[0] * x[2], x[2]];
            one.push(outputs[0]);
            other.push(outputs[1]);
            bodies.commands = [
                k1.next(setpoints.y1.position()[k] - outputs[0]),
                k2.next(setpoints.y2.position()[k] - outputs[1]),
            ];
            let next = (k + 1).min(SAMPLES - 1);
            let forward = (velocity[next] - velocity[k]) / t;
            bodies.force = bodies.machine.servo_mass_kg * (forward + law.next(position[k] - x[0]));
            let method = ExplicitRungeKutta::dop853()
                .rtol(THEIRS)
                .atol(1e-2 * THEIRS)
                .h0(t);
            let solution = IVP::ode(&bodies, 0.0, t, x)
                .method(method)
                .solve()
                .map_err(|e| format!("sample {k}: {e:?}"))?;
            x = *solution.y.last().ok_or("no solution")?;
        }
        one.extend(other);
        Ok(one)
    }))
}
