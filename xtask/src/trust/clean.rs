//! Clean machines of all kinds: nothing is wrong with their records, and nothing may be said against them.

use super::bundle::{Description, Table};
use super::draw::Draw;
use super::judge::{Judged, Words};
use super::kinds::records::Places;
use super::loops::{moves, rms};
use super::program::{Lab, worth};
use super::rig::Rig;
use super::{Case, TaskError};

/// So many, in turn of each sort.
pub(crate) fn cases(first: u64, count: u64) -> impl Iterator<Item = Case> {
    (first..first + count).map(|i| {
        let (name, make) = SORTS[i as usize % SORTS.len()];
        Case::new("clean", name, i, make)
    })
}

type Make = fn(&mut Draw, &Lab) -> Result<Judged, TaskError>;

const SORTS: [(&str, Make); 7] = [
    ("closed loop, periodic", closed),
    ("open loop, periodic", open),
    ("open loop, without periods", transient),
    ("five positions", places),
    ("closed loop with a held-out move", moved),
    ("rigid body", rigid),
    ("two modes without periods", two),
];

fn closed(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rig = Rig::closed(draw);
    periodic(draw, lab, &rig)
}

fn open(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let modes = draw.integer(1, 3);
    let mut rig = Rig::open(draw, modes);
    settled(&mut rig);
    periodic(draw, lab, &rig)
}

/// Long enough a period that the transient of the start is gone within one.
fn settled(rig: &mut Rig) {
    let slowest = rig
        .axis
        .modes
        .iter()
        .map(|m| m[0] * m[1])
        .fold(f64::INFINITY, f64::min)
        / rig.rate;
    rig.period = ((2.5 / slowest) as usize).clamp(800, 4000);
    rig.lines = (1..rig.period * 2 / 5).collect();
}

fn periodic(draw: &mut Draw, lab: &Lab, rig: &Rig) -> Result<Judged, TaskError> {
    let mut description = Description::single(rig.rate).referred(&["r"]);
    if let Some(c) = &rig.controller {
        description = description.controlled(c);
    }
    let mut any = None;
    for (file, is_held_out) in [("a.csv", false), ("b.csv", true)] {
        let signals = rig.periodic(draw, 9);
        Rig::table(&signals).write(&lab.path(file))?;
        description = description.periodic(file, rig.period, is_held_out);
        any = Some(signals);
    }
    description.write(&lab.folder)?;
    let truth = any.map(|s| rig.truth(&s));
    quiet(
        lab,
        lab.identify(".", truth.as_ref(), &[], &Words::none(), "good, and no warning")?,
        true,
    )
}

fn random(draw: &mut Draw, lab: &Lab, modes: usize) -> Result<Judged, TaskError> {
    let mut rig = Rig::open(draw, modes);
    rig.noise = 0.0;
    let mut description = Description::single(rig.rate);
    let mut any = None;
    for (file, is_held_out) in [("a.csv", false), ("b.csv", true)] {
        let input = rig.random(draw, 2500);
        if rig.noise == 0.0 {
            let clean = rig.follow(draw, &input);
            rig.noise = rms(&clean.y[0]) * draw.decades(1e-3, 1e-2);
        }
        let signals = rig.follow(draw, &input);
        let mut table = Rig::table(&signals);
        table.0.retain(|(name, _)| name != "r");
        table.write(&lab.path(file))?;
        description = description.transient(file, is_held_out);
        any = Some(signals);
    }
    description.write(&lab.folder)?;
    let cycles: Vec<f64> = (1..200).map(|k| 0.45 * f64::from(k) / 200.0).collect();
    let truth = any.map(|s| rig.truth_on(&s, &cycles));
    quiet(
        lab,
        lab.identify(".", truth.as_ref(), &[], &Words::none(), "good, and no warning")?,
        true,
    )
}

fn transient(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    random(draw, lab, 1)
}

fn two(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    random(draw, lab, 2)
}

fn places(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let places = Places::new(draw, 5);
    let mut description = places.description();
    let mut any = None;
    for i in 0..5 {
        let (table, signals) = places.record(draw, i, 9);
        table.write(&lab.path(&format!("pos{}.csv", i + 1)))?;
        any = Some(signals);
    }
    let (table, _) = places.record(draw, 2, 9);
    table.write(&lab.path("held.csv"))?;
    description = description.periodic("held.csv", places.rig.period, true);
    if let Some(c) = &places.rig.controller {
        description = description.controlled(c);
    }
    description.write(&lab.folder)?;
    let truth = any.map(|s| places.truth(&s));
    quiet(
        lab,
        lab.identify(".", truth.as_ref(), &[], &Words::none(), "good, and no warning")?,
        true,
    )
}

fn moved(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rig = Rig::closed(draw);
    let signals = rig.periodic(draw, 9);
    let slow = (2.0 * rig.rate / rig.axis.modes[0][0]) as usize;
    let path = moves(&[20.0 * rms(&signals.y[0]), 0.0], 40 * slow, 20 * slow);
    let along = rig.follow(draw, &path);
    Rig::table(&signals).write(&lab.path("a.csv"))?;
    Rig::table(&along).write(&lab.path("m.csv"))?;
    let mut description = Description::single(rig.rate).referred(&["r"]);
    if let Some(c) = &rig.controller {
        description = description.controlled(c);
    }
    description
        .periodic("a.csv", rig.period, false)
        .transient("m.csv", true)
        .write(&lab.folder)?;
    quiet(
        lab,
        lab.identify(
            ".",
            Some(&rig.truth(&signals)),
            &[],
            &Words::none(),
            "good, and no warning",
        )?,
        true,
    )
}

fn rigid(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let mut rig = super::kinds::servo(draw);
    let mut description = Description::single(rig.rate);
    for (file, is_held_out) in [("a.csv", false), ("b.csv", true)] {
        let input = super::kinds::swings(draw, &rig, 4000);
        if rig.noise == 0.0 {
            let clean = rig.follow(draw, &input);
            rig.noise = rms(&clean.y[0]) * draw.decades(1e-6, 1e-5);
        }
        let signals = rig.follow(draw, &input);
        Table::default()
            .with("y", &signals.y[0])
            .with("u", &signals.u[0])
            .write(&lab.path(file))?;
        description = description.transient(file, is_held_out);
    }
    description.write(&lab.folder)?;
    let judged = super::kinds::rigid_body(lab, &rig.axis, &Words::none())?;
    // `inspect` knows nothing of the structure that is meant.
    quiet(lab, judged, false)
}

/// Right where neither `inspect` nor `identify` warns, and a right model is called good; a model that is wrong and said to be wrong is
/// no false alarm, and counted with the wrong models.
fn quiet(lab: &Lab, identified: Judged, inspects: bool) -> Result<Judged, TaskError> {
    let worth = worth(&lab.json("m.json"));
    let is_good = worth.starts_with("good") || worth.is_empty();
    let model_is_right = identified.is_right;
    let mut judged = Judged {
        is_right: is_good || !model_is_right,
        ..identified
    };
    if inspects && model_is_right {
        let said = lab.run(&["inspect", "."])?;
        if let Some(line) = said
            .warnings()
            .into_iter()
            .next()
            .or((said.code != Some(0)).then(|| said.first()))
        {
            judged.is_right = false;
            judged.said = line;
            judged.command = "lpv inspect .".to_owned();
        }
    }
    Ok(judged)
}
