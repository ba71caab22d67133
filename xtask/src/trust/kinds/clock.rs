//! What goes wrong between a machine and its log: clocks, holds, counters, drifts.

use super::{Draw, Judged, Lab, TaskError, Words};
use crate::trust::bundle::{Description, Table};
use crate::trust::loops::{Signals, moves, repeated, rms};
use crate::trust::rig::Rig;
use std::f64::consts::TAU;

/// `y`, `u` or all signals change only every few samples.
pub(super) fn held_samples(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rig = Rig::closed(draw);
    let signals = rig.periodic(draw, 8);
    let every = draw.integer(3, 12);
    let hold = |signal: &[f64]| -> Vec<f64> { (0..signal.len()).map(|k| signal[k - k % every]).collect() };
    let longer = |signal: &[f64]| -> Vec<f64> {
        signal
            .iter()
            .flat_map(|v| std::iter::repeat_n(*v, every))
            .collect()
    };
    let mut table = Rig::table(&signals);
    let (mut rate, mut period) = (rig.rate, rig.period);
    let what = draw.pick(["y", "u", "all"]);
    match what {
        "all" => {
            table.0.iter_mut().for_each(|(_, v)| *v = longer(v));
            rate *= every as f64;
            period *= every;
        }
        one => {
            let held = hold(table.column(one)?);
            *table.column(one)? = held;
        }
    }
    Description::single(rate)
        .referred(&["r"])
        .periodic("a.csv", period, false)
        .write(&lab.folder)?;
    table.write(&lab.path("a.csv"))?;
    let words = Words::cause(&[&[
        "repeat",
        "is held",
        "are held",
        "held for",
        "sample and hold",
        "sample-and-hold",
        "held samples",
        "same value",
        "only every",
        "updated every",
        "changes every",
    ]]);
    // No model of held samples is one of the machine at its own clock.
    let truth = (what != "all").then(|| rig.truth(&signals));
    lab.identify(
        ".",
        truth.as_ref(),
        &[],
        &words,
        &format!("{what} held for {every} samples: say so"),
    )
}

/// The generator runs on another clock.
pub(super) fn period_not_whole(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rig = Rig::open(draw, 2);
    let real = rig.period as f64 + draw.sign() * draw.uniform(0.05, 0.45);
    let phases: Vec<f64> = rig.lines.iter().map(|_| draw.uniform(0.0, TAU)).collect();
    let amplitude = rig.force * (2.0 / rig.lines.len() as f64).sqrt();
    let input: Vec<f64> = (0..8 * rig.period)
        .map(|t| {
            let turn = TAU * t as f64 / real;
            let line = |(k, phase): (&usize, &f64)| amplitude * (*k as f64 * turn + phase).cos();
            rig.lines.iter().zip(&phases).map(line).sum()
        })
        .collect();
    let signals = rig.follow(draw, &input);
    Description::single(rig.rate)
        .periodic("a.csv", rig.period, false)
        .write(&lab.folder)?;
    Rig::table(&signals).write(&lab.path("a.csv"))?;
    let words = Words::cause(&[
        &["period"],
        &["clock", "drift", "whole", "does not repeat", "not repeat"],
    ]);
    lab.identify(
        ".",
        Some(&rig.truth(&signals)),
        &[],
        &words,
        &format!("period {real:.3}, declared {}", rig.period),
    )
}

/// Rows are missing; the column of times tells.
pub(super) fn lost_samples(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rig = Rig::closed(draw);
    let signals = rig.periodic(draw, 4);
    let count = signals.y[0].len();
    let mut table = Table(vec![(
        "t".to_owned(),
        (0..count).map(|k| k as f64 / rig.rate).collect(),
    )]);
    table.0.extend(Rig::table(&signals).0);
    for _ in 0..draw.integer(1, 5) {
        let row = draw.integer(count / 10, table.rows() - count / 10);
        table.0.iter_mut().for_each(|(_, v)| {
            v.remove(row);
        });
    }
    table.write(&lab.path("a.csv"))?;
    let rate = format!("{:?}", rig.rate);
    let words = Words::cause(&[&["lost", "missing", "gap", "evenly", "time column", "dropped"]]);
    let new = [
        "new",
        "a.csv",
        "--sample-rate",
        &rate,
        "--input",
        "u",
        "--output",
        "y",
        "--reference",
        "r",
    ];
    let said = lab.run(&new)?;
    let wanted = "rows are missing: say where, or put the samples at their times";
    if said.code == Some(2) && words.told(&said.first()) {
        return Ok(Judged::new(
            true,
            &said,
            &format!("lpv {}", new.join(" ")),
            wanted,
        ));
    }
    lab.identify(".", Some(&rig.truth(&signals)), &[], &words, wanted)
}

/// Times in milliseconds without a word of it.
pub(super) fn milliseconds(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rig = Rig::closed(draw);
    let step = draw.pick([1.0, 2.0, 4.0, 5.0, 10.0, 20.0, 50.0]);
    let rate = 1000.0 / step;
    // The velocity in units a second decides it, as in a drive's log.
    let signals = rig.periodic(draw, 3);
    let count = 400.min(signals.y[0].len());
    let speed: Vec<f64> = (0..count)
        .map(|k| (signals.y[0][k + 1] - signals.y[0][k]) * rate)
        .collect();
    Table::default()
        .with("time", &(0..count).map(|k| k as f64 * step).collect::<Vec<_>>())
        .with("target_position", &signals.r[0][..count])
        .with("actual_position", &signals.y[0][..count])
        .with("actual_speed", &speed)
        .with("current", &signals.u[0][..count])
        .write(&lab.path("a.csv"))?;
    let said = lab.run(&["new", "a.csv"])?;
    let found = super::draft(lab, ".").map_or(0.0, |d| d.rate);
    let asked = said.all().contains("millisecond") || said.all().contains(" ms");
    let right = said.code == Some(0) && ((found / rate - 1.0).abs() < 1e-6 || asked);
    Ok(Judged::new(
        right,
        &said,
        "lpv new a.csv",
        &format!("{rate} Hz, or the question; drafted {found} Hz"),
    ))
}

/// A counter of few bits.
pub(super) fn encoder_wrap(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let mut rig = Rig::closed(draw);
    // In counts: the loop's setpoint crosses the counter's range some times.
    let range = 2.0_f64.powi(draw.pick([12, 16, 20, 24]));
    let reach = range * draw.uniform(1.2, 6.0);
    let controller = rig.controller.clone();
    let slow = (5.0 * rig.rate / rig.axis.modes[0][0]) as usize;
    let targets = [reach, 0.2 * reach, -0.9 * reach, 0.0];
    let path = moves(&targets, 12 * slow.max(10), slow.max(10));
    rig.noise = 0.0;
    let mut signals = rig.follow(draw, &path);
    for y in &mut signals.y[0] {
        *y = y.round();
        *y -= range * ((*y + range / 2.0) / range).floor();
    }
    let mut description = Description::single(rig.rate).referred(&["r"]);
    if let Some(c) = &controller {
        description = description.controlled(c);
    }
    description.transient("a.csv", false).write(&lab.folder)?;
    Rig::table(&signals).write(&lab.path("a.csv"))?;
    let words = Words::cause(&[&["wrap", "overflow", "counter", "jump"]]);
    let truth = rig.truth(&signals);
    lab.identify(
        ".",
        Some(&truth),
        &[],
        &words,
        &format!("the counter wraps at {range}"),
    )
}

/// A ramp on a sensor, in a periodic record.
pub(super) fn sensor_drift(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rig = Rig::closed(draw);
    let signals = rig.periodic(draw, 9);
    let mut drifted = signals.clone();
    let total = draw.sign() * draw.uniform(0.5, 5.0) * rms(&signals.y[0]);
    ramp(&mut drifted, total);
    Description::single(rig.rate)
        .referred(&["r"])
        .periodic("a.csv", rig.period, false)
        .write(&lab.folder)?;
    Rig::table(&drifted).write(&lab.path("a.csv"))?;
    let words = Words::cause(&[&["drift", "trend", "slope", "ramp"]]);
    lab.identify(
        ".",
        Some(&rig.truth(&signals)),
        &[],
        &words,
        "the model as without the ramp, or the drift named",
    )
}

fn ramp(signals: &mut Signals, total: f64) {
    let count = signals.y[0].len() as f64;
    for (k, y) in signals.y[0].iter_mut().enumerate() {
        *y += total * k as f64 / count;
    }
}

/// A record without periods, with a trend, or with a dead time.
pub(super) fn transient_trend_and_delay(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let mut rig = Rig::open(draw, 1);
    let input = rig.random(draw, 2500);
    let clean = rig.follow(draw, &input);
    rig.noise = rms(&clean.y[0]) * draw.decades(1e-3, 1e-2);
    let mut signals = rig.follow(draw, &input);
    let cycles: Vec<f64> = (1..200).map(|k| 0.45 * f64::from(k) / 200.0).collect();
    let mut truth = rig.truth_on(&signals, &cycles);
    let words = if draw.chance(0.5) {
        let total = draw.sign() * draw.uniform(2.0, 10.0) * rms(&clean.y[0]);
        ramp(&mut signals, total);
        Words::cause(&[&["drift", "trend", "slope", "ramp"]])
    } else {
        let dead = draw.integer(12, 40);
        signals.y[0] = [rig_noise(draw, &rig, dead), signals.y[0].clone()].concat();
        signals.y[0].truncate(input.len());
        truth.places[0].1 = delayed(&truth.places[0].1, dead);
        Words::cause(&[&["delay", "dead time"]])
    };
    Description::single(rig.rate)
        .transient("a.csv", false)
        .write(&lab.folder)?;
    let mut table = Rig::table(&signals);
    table.0.retain(|(name, _)| name != "r");
    table.write(&lab.path("a.csv"))?;
    lab.identify(
        ".",
        Some(&truth),
        &[],
        &words,
        "the model as without, or trend or delay named",
    )
}

fn rig_noise(draw: &mut Draw, rig: &Rig, count: usize) -> Vec<f64> {
    draw.noise(rig.noise, count)
}

/// A sampled machine behind so many samples of dead time.
pub(super) fn delayed(machine: &crate::trust::machine::Linear, dead: usize) -> crate::trust::machine::Linear {
    let n = machine.a.nrows();
    let mut out = machine.clone();
    // A chain of samples before the input.
    out.a = out.a.resize(n + dead, n + dead, 0.0);
    out.c = out.c.resize_horizontally(n + dead, 0.0);
    out.b = out.b.resize_vertically(n + dead, 0.0);
    for i in 0..n {
        out.a[(i, n)] = machine.b[(i, 0)];
        out.b[(i, 0)] = 0.0;
    }
    for k in 0..dead - 1 {
        out.a[(n + k, n + k + 1)] = 1.0;
    }
    out.b[(n + dead - 1, 0)] = 1.0;
    out
}

/// A sweep, its command exact.
pub(super) fn chirp_noise_free_command(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let mut rig = Rig::open(draw, 1);
    rig.axis.modes[0][0] = rig.rate * draw.uniform(0.03, 0.1);
    rig.machine = rig.axis.linear().sampled(1.0 / rig.rate);
    let (low, high) = (draw.uniform(0.002, 0.01), draw.uniform(0.15, 0.25));
    let samples = 3000;
    let mut phase = 0.0;
    let input: Vec<f64> = (0..samples)
        .map(|k| {
            phase += TAU * (low + (high - low) * k as f64 / samples as f64);
            rig.force * phase.sin()
        })
        .collect();
    rig.noise = 0.0;
    let clean = rig.follow(draw, &input);
    rig.noise = rms(&clean.y[0]) * draw.decades(1e-3, 1e-2);
    let signals = rig.follow(draw, &input);
    Description::single(rig.rate)
        .transient("a.csv", false)
        .write(&lab.folder)?;
    Rig::table(&signals).write(&lab.path("a.csv"))?;
    let cycles: Vec<f64> = (1..100)
        .map(|k| low + (high - low) * f64::from(k) / 100.0)
        .collect();
    lab.identify(
        ".",
        Some(&rig.truth_on(&signals, &cycles)),
        &[],
        &Words::none(),
        "a model right in the swept band",
    )
}

/// A loop in which nothing but the noise of its sensor moves.
pub(super) fn closed_loop_noise_only(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rig = Rig::closed(draw);
    let signals = rig.follow(draw, &repeated(&[0.0], 3000));
    Description::single(rig.rate)
        .transient("a.csv", false)
        .write(&lab.folder)?;
    let mut table = Rig::table(&signals);
    table.0.retain(|(name, _)| name != "r");
    table.write(&lab.path("a.csv"))?;
    let words = Words::cause(&[
        &["closed loop", "feedback", "controller", "-1/k"],
        &[
            "no reference",
            "without a reference",
            "excit",
            "inverse",
            "-1/k",
            "noise alone",
            "nothing but",
        ],
    ]);
    let cycles: Vec<f64> = (1..100).map(|k| 0.4 * f64::from(k) / 100.0).collect();
    lab.identify(
        ".",
        Some(&rig.truth_on(&signals, &cycles)),
        &[],
        &words,
        "the loop without a reference named",
    )
}
