//! Pictures of a diagnosis.

use crate::PipelineError;
use experiment_data::{ChannelGroup, Description};
use lpv_core::nalgebra::DMatrix;
use lpv_core::{Continuous, ControllerState, Discrete, FrfEstimate, StateSpace};
use lpv_diagnose::{Base, EquivalentForce, Explained, Trace, Track, equivalent_force};
use lpv_report::{Axis, Colour, Figure, Marker, Panel, Series, Style};
use realfft::RealFftPlanner;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};
use std::f64::consts::TAU;

impl super::Diagnosed {
    /// The force that the base lacks over speed and position of its motors; none of responses.
    pub fn over_motion(&self) -> Option<&Figure> {
        self.force.first()
    }

    /// Errors before and after over time, or over frequency for responses.
    pub fn in_time(&self) -> &Figure {
        &self.errors
    }

    /// Position of an axis along the first held-out record and its error, let run free, before and after; of an axis that an observer holds.
    pub fn free_run(&self) -> Option<&Figure> {
        self.free_run.as_ref()
    }

    /// The axes of a machine of several that move by themselves, each diagnosed alone; empty of any other.
    pub fn axes(&self) -> &[Self] {
        &self.axes
    }

    /// Their spectrum; none of responses.
    pub fn in_spectrum(&self) -> Option<&Figure> {
        self.spectrum.as_ref()
    }
}

/// A channel that has panels of its own.
pub(super) struct Channel<'a> {
    name: &'a str,
    /// Empty where none is known.
    unit: &'a str,
}

impl<'a> Channel<'a> {
    pub(super) fn all(of: &'a ChannelGroup) -> Vec<Self> {
        let unit = |i: usize| of.units.get(i).map_or("", String::as_str);
        let names = of.columns.iter().enumerate();
        names.map(|(i, name)| Self { name, unit: unit(i) }).collect()
    }

    pub(super) fn panel_in_time(&self, what: &str) -> Panel {
        let y = Axis::linear(with_unit(what, self.unit));
        Panel::new(Axis::linear("Time (s)"), y).title(self.name)
    }
}

/// Unit of a channel, of the first where it has none.
fn unit_of(group: &ChannelGroup, channel: usize) -> &str {
    let unit = group.units.get(channel).or(group.units.first());
    unit.map_or("", String::as_str)
}

/// What an axis shows with its unit, where there is one.
fn with_unit(what: &str, unit: &str) -> String {
    match unit {
        "" => what.to_owned(),
        _ => format!("{what} ({unit})"),
    }
}

fn frequency() -> Axis {
    Axis::log("Frequency (Hz)")
}

/// The force of a motor along a record, by sample: where the motor is, what it does there.
pub(super) struct Along<'a> {
    pub(super) motor: usize,
    pub(super) position: Vec<f64>,
    pub(super) speed: Vec<f64>,
    /// What the effects add.
    pub(super) effects: Vec<f64>,
    /// Units of the position and of the force, empty where none is known.
    pub(super) units: [&'a str; 2],
}

/// The equivalent force along a record, before and after.
pub(super) fn of_force(
    found: &Trace,
    controller: &ControllerState,
    track: &Track,
    noise: [f64; 2],
    description: &Description,
) -> Vec<Figure> {
    let force = |model: &Explained| equivalent_force(model, controller, track, noise).ok();
    // A base that was fitted without the effects is bent by them; that of the model shows them as they are.
    let plain = Explained {
        base: found.model.base.clone(),
        effects: Vec::new(),
    };
    // A machine without what holds it may diverge: then there is no picture.
    let motions = found.model.motions(controller, track);
    let (Some(before), Some(after), Some(motions)) = (force(&plain), force(&found.model), motions) else {
        return Vec::new();
    };
    let channels = &description.channels;
    let inputs = Channel::all(&channels.input);
    let effects = found.model.forces_along(track, &motions);
    let along = |motor: usize| Along {
        motor,
        position: motions.iter().map(|m| m.motor_position[motor]).collect(),
        speed: motions.iter().map(|m| m.motor_speed[motor]).collect(),
        effects: effects.iter().map(|f| f[motor]).collect(),
        units: [&channels.output, &channels.input].map(|of| unit_of(of, motor)),
    };
    // The motors that effects act on; of those that are coupled the first tells enough.
    let acts = |motor: &usize| effects.iter().any(|f| f[*motor] != 0.0);
    let most = if found.model.base.has_motors_of_their_own() {
        2
    } else {
        1
    };
    let mut drawn: Vec<Along> = (0..most).filter(acts).map(along).collect();
    if drawn.is_empty() {
        drawn.push(along(0));
    }
    vec![
        over_motion(&drawn, &before),
        force_in_time(&inputs, track.step, [&before, &after]),
    ]
}

/// The force that the model lacks over speed and over position, motor by motor, with what the effects add.
pub(super) fn over_motion(motors: &[Along<'_>], before: &EquivalentForce) -> Figure {
    let mut figure = Figure::new("").columns(2).caption(
        "Force that a motor would need beside the base model, with the parameters that it has with the effects, along the first \
         held-out record: what the Kalman smoother finds in the record, and what the fitted effects add as forces. Effects of sensors \
         and of timing are no such forces.",
    );
    for along in motors {
        let which = ["first", "second"][along.motor];
        let measured: Vec<f64> = before.motors.iter().map(|f| f[along.motor]).collect();
        let [unit, force_unit] = along.units;
        let rate = if unit.is_empty() {
            String::new()
        } else {
            format!("{unit}/s")
        };
        let [speed, position] = [with_unit("Speed", &rate), with_unit("Position", unit)];
        let force_axis = with_unit(&format!("Force, {which} motor"), force_unit);
        for (axis, at) in [(speed, &along.speed), (position, &along.position)] {
            let dots = |force: &[f64]| at.iter().copied().zip(force.iter().copied()).collect();
            let mut panel = Panel::new(Axis::linear(axis), Axis::linear(force_axis.clone())).series(
                Series::new(dots(&measured), Style::Dots)
                    .width(1.4)
                    .label("from the records")
                    .colour(Colour::Bound),
            );
            if along.effects.iter().any(|f| *f != 0.0) {
                panel = panel.series(
                    Series::new(dots(&along.effects), Style::Dots)
                        .width(1.8)
                        .label("fitted effects")
                        .colour(Colour::Model),
                );
            }
            figure = figure.panel(panel);
        }
    }
    figure
}

/// The equivalent force at each input over time, before and after, with two standard deviations.
pub(super) fn force_in_time(inputs: &[Channel<'_>], step: f64, forces: [&EquivalentForce; 2]) -> Figure {
    let mut figure = Figure::new("").columns(1).caption(
        "Disturbance at the inputs that would explain the first held-out record, smoothed; bands of two standard deviations.",
    );
    for (i, input) in inputs.iter().enumerate() {
        let mut panel = input.panel_in_time("Force");
        for (force, (label, colour)) in forces.iter().zip(BEFORE_AFTER) {
            let time = |k: usize| k as f64 * step;
            let known = force.value.iter().zip(&force.deviation).enumerate();
            let band: Vec<(f64, f64, f64)> = known
                .map(|(k, (v, d))| (time(k), v[i] - 2.0 * d[i], v[i] + 2.0 * d[i]))
                .collect();
            let line = force.value.iter().enumerate().map(|(k, v)| (time(k), v[i]));
            panel = panel
                .series(Series::band(&band).colour(colour))
                .series(Series::line(line.collect()).label(label).colour(colour));
        }
        figure = figure.panel(panel);
    }
    figure
}

/// Errors by output before and after, over frequency: mean power of windowed pieces of all records.
pub(super) fn in_spectrum(outputs: &[Channel<'_>], step: f64, errors: &[Vec<Vec<[f64; 2]>>; 2]) -> Figure {
    let mut figure = Figure::new("")
        .columns(outputs.len().min(2))
        .caption("Spectrum of the error in closed loop along all held-out records: power density in the square of the unit over Hz.");
    for (i, output) in outputs.iter().enumerate() {
        let mut panel = Panel::new(frequency(), Axis::log("Power density")).title(output.name);
        for (records, (label, colour)) in errors.iter().zip(BEFORE_AFTER) {
            let points = density(records, i, step);
            panel = panel.series(Series::line(points).label(label).colour(colour));
        }
        figure = figure.panel(panel);
    }
    figure
}

/// The frozen base against responses by position and line, in units of what their noise allows; none without responses.
pub(super) fn frozen(
    base: &Base,
    estimates: &[FrfEstimate],
    clock: Discrete,
) -> Result<Option<Figure>, PipelineError> {
    /// Positions that are drawn.
    const POSITIONS: usize = 5;
    /// Probability with which noise stays below the bound, line by line.
    const SURE: f64 = 0.99;
    let Some(first) = estimates.first() else {
        return Ok(None);
    };
    let parts = 2.0 * (first.frf().outputs() * first.frf().inputs()) as f64;
    // A covariance from few degrees of freedom is itself not known.
    let bound = FisherSnedecor::new(parts, first.degrees_of_freedom().max(1.0))
        .map_or(f64::NAN, |f| f.inverse_cdf(SURE).sqrt());
    let mut panel = Panel::new(frequency(), Axis::log("Error over its deviation"));
    let mut outside = 0;
    let mut lines = 0;
    let every = (estimates.len() - 1).max(1) as f64 / (POSITIONS - 1) as f64;
    let drawn: Vec<usize> = (0..POSITIONS)
        .map(|i| (i as f64 * every).round() as usize)
        .collect();
    for (index, estimate) in estimates.iter().enumerate() {
        let p = estimate.single_position().unwrap_or(0.0);
        let [a, b, c] = base.frozen(p)?;
        let direct = DMatrix::zeros(c.nrows(), b.ncols());
        let frf = estimate.frf();
        let model = StateSpace::new(a, b, c, direct, Continuous)?
            .zero_order_hold(clock)?
            .frequency_response(frf.frequencies_hz())?;
        let error = |k: usize| {
            let sum: f64 = (0..frf.outputs())
                .flat_map(|i| (0..frf.inputs()).map(move |j| (i, j)))
                .map(|(i, j)| {
                    (frf.line(k)[(i, j)] - model.line(k)[(i, j)]).norm_sqr()
                        / (0.5 * estimate.variance(k, i, j))
                })
                .sum();
            (sum / parts).sqrt()
        };
        let errors: Vec<f64> = (0..frf.len()).map(error).collect();
        lines += errors.len();
        outside += errors.iter().filter(|e| **e > bound).count();
        if drawn.contains(&index) {
            let points = frf.frequencies_hz().iter().copied().zip(errors).collect();
            let series = Series::new(points, Style::Dots)
                .width(1.6)
                .label(format!("p = {p:.3}"));
            panel = panel.series(series.colour(Colour::Index(index * 6 / estimates.len())));
        }
    }
    let caption = format!(
        "Base with the parameters of the model, frozen, against the responses of the periodic records, all channels of a line together; \
         noise stays below the line with a probability of {:.0} %, and {:.1} % of all lines and positions lie above it. Effects that \
         were there when the responses were measured bend them.",
        100.0 * SURE,
        100.0 * outside as f64 / lines.max(1) as f64
    );
    Ok(Some(
        Figure::new("")
            .panel(panel.marker(Marker::horizontal(bound)))
            .caption(caption),
    ))
}

/// Welch's power density: Hann windows that overlap by half.
fn density(records: &[Vec<[f64; 2]>], output: usize, step: f64) -> Vec<(f64, f64)> {
    /// Samples of a piece at most.
    const PIECE: usize = 1024;
    let shortest = records.iter().map(Vec::len).min().unwrap_or(0);
    let n = shortest.min(PIECE);
    if n < 16 {
        return Vec::new();
    }
    let window: Vec<f64> = (0..n)
        .map(|k| 0.5 - 0.5 * (TAU * k as f64 / n as f64).cos())
        .collect();
    let size: f64 = window.iter().map(|w| w * w).sum();
    let plan = RealFftPlanner::<f64>::new().plan_fft_forward(n);
    let mut spectrum = plan.make_output_vec();
    let mut sum = vec![0.0; spectrum.len()];
    let mut pieces = 0_usize;
    for record in records {
        for from in (0..=record.len() - n).step_by(n / 2) {
            let piece = record[from..from + n].iter().zip(&window);
            let mut piece: Vec<f64> = piece.map(|(e, w)| e[output] * w).collect();
            // Lengths are those of the plan.
            if plan.process(&mut piece, &mut spectrum).is_ok() {
                sum.iter_mut()
                    .zip(&spectrum)
                    .for_each(|(s, x)| *s += x.norm_sqr());
                pieces += 1;
            }
        }
    }
    let scale = 2.0 * step / (size * pieces.max(1) as f64);
    let line = |(k, s): (usize, &f64)| (k as f64 / (n as f64 * step), s * scale);
    sum.iter()
        .enumerate()
        .skip(1)
        .map(line)
        .filter(|(_, s)| *s > 0.0)
        .collect()
}

/// Errors by output before and after, over time.
pub(super) fn in_time(outputs: &[Channel<'_>], step: f64, errors: [&[[f64; 2]]; 2]) -> Figure {
    let mut figure = Figure::new("")
        .columns(1)
        .caption("Error in closed loop along the first held-out record.");
    for (i, output) in outputs.iter().enumerate() {
        let mut panel = output.panel_in_time("Error");
        for (record, (label, colour)) in errors.iter().zip(BEFORE_AFTER) {
            let points = record.iter().enumerate().map(|(k, e)| (k as f64 * step, e[i]));
            panel = panel.series(Series::line(points.collect()).label(label).colour(colour));
        }
        figure = figure.panel(panel);
    }
    figure
}

/// Magnitudes by output over frequency: what was measured, and the errors of a model before and after.
pub(super) fn over_frequency(outputs: &[String], lines: &[f64], curves: &[[Vec<f64>; 3]]) -> Figure {
    let mut figure = Figure::new("")
        .columns(curves.len().min(2))
        .caption("Held-out response and what the model leaves of it, before and after.");
    for (name, [measured, before, after]) in outputs.iter().zip(curves) {
        let line = |v: &[f64]| Series::line(lines.iter().copied().zip(v.iter().copied()).collect());
        figure = figure.panel(
            Panel::new(frequency(), Axis::log("Magnitude"))
                .title(name.clone())
                .series(line(measured).label("measured").colour(Colour::Reference))
                .series(line(before).label("error before").colour(Colour::Bound))
                .series(line(after).label("error after").colour(Colour::Error)),
        );
    }
    figure
}

pub(super) const BEFORE_AFTER: [(&str, Colour); 2] =
    [("before", Colour::Reference), ("after", Colour::Model)];

#[cfg(test)]
mod tests {
    use super::density;

    /// The density of white noise of variance v is `2 v T`, and its integral over frequency v.
    #[test]
    fn the_area_under_the_density_is_the_variance() {
        let mut seed = 1_u64;
        let mut uniform = || {
            seed = seed
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let record: Vec<[f64; 2]> = (0..40_000).map(|_| [0.0, uniform()]).collect();
        let found = density(&[record], 1, 0.1);
        let area: f64 = found.iter().map(|(_, s)| s).sum::<f64>() * found[0].0;
        assert!((area - 1.0 / 12.0).abs() < 0.005, "{area}");
    }
}
