//! Inputs that are not what acted, and inputs that are and look as if they were not.

use super::{Draw, Judged, Lab, TaskError, Words};
use crate::trust::bundle::{Description, Table};
use crate::trust::loops::{Run, moves, repeated, rms, simulate};
use crate::trust::rig::Rig;

/// The amplifier clips what the log calls the input.
pub(super) fn saturated_command(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rig = Rig::open(draw, 1);
    let command = repeated(&rig.excitation(draw), 8);
    let run = Run {
        reference: vec![command],
        noise: vec![rig.noise],
        hidden_limit: Some(rig.force * draw.uniform(0.7, 2.0)),
        ..Run::default()
    };
    let signals = simulate(&rig.machine, &[], &run, draw);
    Description::single(rig.rate)
        .periodic("a.csv", rig.period, false)
        .write(&lab.folder)?;
    let mut table = Rig::table(&signals);
    table.0.retain(|(name, _)| name != "r");
    table.write(&lab.path("a.csv"))?;
    let words = Words::cause(&[&["satur", "clip", "limit", "nonlinear"]]);
    lab.identify(
        ".",
        Some(&rig.truth(&signals)),
        &[],
        &words,
        "the true model, or the amplifier's limit named",
    )
}

/// The input that acted stands at its limit, exactly.
pub(super) fn command_at_its_limit(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let mut rig = Rig::open(draw, 1);
    let limit = rig.force * draw.uniform(0.5, 1.0);
    let clamp = |input: Vec<f64>| -> Vec<f64> { input.into_iter().map(|v| v.clamp(-limit, limit)).collect() };
    let is_periodic = draw.chance(0.5);
    let input = match is_periodic {
        true => repeated(&clamp(rig.excitation(draw)), 8),
        false => clamp(rig.random(draw, 2500)),
    };
    rig.noise = 0.0;
    let clean = rig.follow(draw, &input);
    rig.noise = rms(&clean.y[0]) * draw.decades(1e-4, 1e-2);
    let signals = rig.follow(draw, &input);
    let description = Description::single(rig.rate);
    let description = match is_periodic {
        true => description.periodic("a.csv", rig.period, false),
        false => description.transient("a.csv", false),
    };
    description.write(&lab.folder)?;
    let mut table = Rig::table(&signals);
    table.0.retain(|(name, _)| name != "r");
    table.write(&lab.path("a.csv"))?;
    let inspected = lab.run(&["inspect", "."])?;
    let seen = Judged::new(
        inspected.code == Some(0),
        &inspected,
        "lpv inspect .",
        "no refusal: the input is exact",
    );
    let identified = lab.identify(
        ".",
        Some(&rig.truth(&signals)),
        &[],
        &Words::none(),
        "a right model",
    )?;
    Ok(seen.and(identified))
}

/// A linear machine without a fault.
pub(super) fn explained_false_alarm(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rig = Rig::closed(draw);
    let signals = rig.periodic(draw, 9);
    let slow = (2.0 * rig.rate / rig.axis.modes[0][0]) as usize;
    let reach = rms(&signals.y[0]) * draw.decades(3.0, 1e3);
    let moved = rig.follow(draw, &moves(&[reach, 0.0], 40 * slow, 20 * slow));
    Rig::table(&signals).write(&lab.path("a.csv"))?;
    Rig::table(&moved).write(&lab.path("m.csv"))?;
    let mut description = Description::single(rig.rate).referred(&["r"]);
    if let Some(c) = &rig.controller {
        description = description.controlled(c);
    }
    description
        .periodic("a.csv", rig.period, false)
        .transient("m.csv", true)
        .write(&lab.folder)?;
    let inspected = lab.run(&["inspect", "."])?;
    let alarm = inspected.warnings();
    let quiet = inspected.code == Some(0) && alarm.is_empty();
    let mut seen = Judged::new(
        quiet,
        &inspected,
        "lpv inspect .",
        "no warning on a clean linear machine",
    );
    if let Some(line) = alarm.into_iter().next() {
        seen.said = line;
    }
    let identified = lab.identify(
        ".",
        Some(&rig.truth(&signals)),
        &[],
        &Words::none(),
        "a right model",
    )?;
    Ok(seen.and(identified))
}

/// A multisine of a low band whose period is one sample short, so that it leaks a little everywhere.
pub(super) fn unexcited_lines(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let mut rig = Rig::open(draw, 1);
    let real = rig.period + 1;
    let highest = draw.integer(40, 100);
    rig.axis.modes[0][0] = rig.rate * draw.uniform(0.3, 0.7) * highest as f64 / rig.period as f64;
    rig.machine = rig.axis.linear().sampled(1.0 / rig.rate);
    rig.lines = (1..=highest).collect();
    let mut period = crate::trust::loops::multisine(draw, real, &rig.lines);
    period.truncate(rig.period);
    period.iter_mut().for_each(|v| *v *= rig.force);
    let input = repeated(&period, 8);
    rig.noise = 0.0;
    let clean = rig.follow(draw, &input);
    rig.noise = rms(&clean.y[0]) * draw.decades(1e-3, 1e-2);
    let signals = rig.follow(draw, &input);
    Description::single(rig.rate)
        .periodic("a.csv", rig.period, false)
        .write(&lab.folder)?;
    Rig::table(&signals).write(&lab.path("a.csv"))?;
    let inspected = lab.run(&["inspect", "."])?;
    let alarm = inspected
        .warnings()
        .into_iter()
        .find(|l| l.contains("mostly noise") || l.contains("`period`"));
    let mut seen = Judged::new(
        alarm.is_none(),
        &inspected,
        "lpv inspect .",
        "the period is right: no 'mostly noise'",
    );
    if let Some(line) = alarm {
        seen.said = line;
    }
    let identified = lab.identify(
        ".",
        Some(&rig.truth(&signals)),
        &[],
        &Words::none(),
        "a right model in the band",
    )?;
    Ok(seen.and(identified))
}

/// A bounded motion of which the input explains next to nothing.
pub(super) fn unstable_model_without_a_word(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rate = draw.decades(100.0, 1e4);
    let scale = draw.decades(1e-3, 1e3);
    let mut description = Description::single(rate);
    for (file, is_held_out) in [("a.csv", false), ("b.csv", true)] {
        let (mut place, mut speed) = (0.0, 0.0);
        let (mut y, mut u) = (Vec::new(), Vec::new());
        for k in 0..900 {
            let input = (std::f64::consts::TAU * k as f64 / 300.0).sin() + 0.1 * draw.normal();
            // A stiction-like wander that the input barely moves, held in its range.
            speed = 0.97 * speed + 0.2 * draw.normal() - 0.002 * place + 0.01 * input;
            place += speed;
            y.push(scale * (place * 10.0).round() / 10.0);
            u.push(input);
        }
        Table::default()
            .with("y", &y)
            .with("u", &u)
            .write(&lab.path(file))?;
        description = description.transient(file, is_held_out);
    }
    description.write(&lab.folder)?;
    let words = Words::cause(&[&[
        "not a model",
        "no model",
        "unstable",
        "explain",
        "noise and disturbance",
    ]]);
    let mut judged = lab.identify(
        ".",
        None,
        &[],
        &words,
        "not a model: the input explains next to nothing",
    )?;
    let worth = crate::trust::program::worth(&lab.json("m.json"));
    judged.is_silent =
        !judged.is_right && matches!(worth.as_str(), "" | "good") && lab.path("m.json").exists();
    Ok(judged)
}
