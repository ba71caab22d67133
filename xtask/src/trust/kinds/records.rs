//! Records that contradict each other or their description.

use super::{Draw, Judged, Lab, TaskError, Words};
use crate::trust::bundle::{Description, Table};
use crate::trust::judge::Truth;
use crate::trust::loops::{Signals, moves, rms};
use crate::trust::machine::Axis;
use crate::trust::rig::Rig;

/// One axis at several places: its mode moves with p, its loop stays.
pub(crate) struct Places {
    pub(crate) rig: Rig,
    pub(crate) positions: Vec<f64>,
    pub(crate) axes: Vec<Axis>,
}

impl Places {
    /// `count` places from `-reach` to `reach` in any unit, the mode moving by about a fifth.
    pub(crate) fn new(draw: &mut Draw, count: usize) -> Self {
        let rig = Rig::closed(draw);
        let reach = draw.decades(1e-2, 1e3);
        let change = draw.sign() * draw.uniform(0.05, 0.12);
        let positions: Vec<f64> = (0..count)
            .map(|i| reach * (2.0 * i as f64 / (count - 1) as f64 - 1.0))
            .collect();
        let axes = positions
            .iter()
            .map(|p| {
                let mut axis = rig.axis.clone();
                axis.modes[0][0] *= 1.0 + change * p / reach;
                axis
            })
            .collect();
        Self { rig, positions, axes }
    }
    /// The rig with the machine of a place.
    pub(crate) fn rig_at(&self, place: usize) -> Rig {
        Rig {
            machine: self.axes[place].linear().sampled(1.0 / self.rig.rate),
            axis: self.axes[place].clone(),
            ..self.rig.clone()
        }
    }
    /// A periodic record of a place: `y, u, r, p`.
    pub(crate) fn record(&self, draw: &mut Draw, place: usize, periods: usize) -> (Table, Signals) {
        let signals = self.rig_at(place).periodic(draw, periods);
        let at = vec![self.positions[place]; signals.y[0].len()];
        (Rig::table(&signals).with("p", &at), signals)
    }
    /// A description of one periodic record `pos1.csv ...` a place.
    pub(crate) fn description(&self) -> Description {
        let mut description = Description::single(self.rig.rate).referred(&["r"]).scheduled("p");
        for i in 0..self.positions.len() {
            description = description.periodic(&format!("pos{}.csv", i + 1), self.rig.period, false);
        }
        description
    }
    /// The truth at all places, by the inputs of one of them.
    pub(crate) fn truth(&self, signals: &Signals) -> Truth {
        let mut truth = self.rig.truth(signals);
        truth.places = (0..self.positions.len())
            .map(|i| (self.positions[i], self.rig_at(i).machine))
            .collect();
        truth
    }
}

/// Of five records one has another sign, another unit, or its place in another unit.
pub(super) fn one_record_wrong(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let places = Places::new(draw, 5);
    let odd = draw.integer(0, 4);
    let what = draw.pick(["sign", "unit", "position"]);
    let factor: f64 = draw.pick([1000.0, 1e-3, 1e6]);
    let mut any = None;
    for i in 0..5 {
        let (mut table, signals) = places.record(draw, i, 8);
        if i == odd {
            let (column, by) = match what {
                "sign" => ("u", -1.0),
                "unit" => ("y", factor),
                _ => ("p", factor.max(1000.0)),
            };
            table.column(column)?.iter_mut().for_each(|v| *v *= by);
        }
        table.write(&lab.path(&format!("pos{}.csv", i + 1)))?;
        any = Some(signals);
    }
    places.description().write(&lab.folder)?;
    let name = format!("pos{}", odd + 1);
    let words = match what {
        "sign" => Words::cause(&[&["sign", "polarity", "opposite"], &[name.as_str()]]),
        "unit" => Words::cause(&[&["unit", "scale", "factor", "times"], &[name.as_str()]]),
        _ => Words::cause(&[
            &["position", "place", " p "],
            &[name.as_str(), "unit", "apart", "far"],
        ]),
    };
    // A place in the middle that is far off changes nothing: zero in any unit is zero.
    let truth = any
        .map(|s| places.truth(&s))
        .filter(|_| what != "position" || odd == 2);
    lab.identify(".", truth.as_ref(), &[], &words, &format!("{what} of {name}.csv"))
}

/// The column of the position has any name.
pub(super) fn position_column_names(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let places = Places::new(draw, 3);
    let name = draw.pick([
        "x_pos", "pos", "position", "x", "q", "stellung", "stage_y", "carriage", "z_axis", "Achse2",
    ]);
    let mut files = Vec::new();
    for i in 0..3 {
        let (mut table, _) = places.record(draw, i, 3);
        if let Some(last) = table.0.last_mut() {
            name.clone_into(&mut last.0);
        }
        let file = format!("pos{}.csv", i + 1);
        table.write(&lab.path(&file))?;
        files.push(file);
    }
    let (rate, period) = (format!("{:?}", places.rig.rate), places.rig.period.to_string());
    let mut all = vec!["new"];
    all.extend(files.iter().map(String::as_str));
    all.extend(["--sample-rate", &rate, "--period", &period]);
    let said = lab.run(&all)?;
    let right = super::draft(lab, ".").is_some_and(|d| {
        d.scheduling == [name] && d.outputs == ["y"] && d.inputs == ["u"] && d.references == ["r"]
    });
    let right = right && said.code == Some(0);
    Ok(Judged::new(
        right,
        &said,
        &format!("lpv {}", all.join(" ")),
        &format!("scheduling `{name}`"),
    ))
}

/// One more record at the middle, with so little amplitude that friction and noise rule it.
pub(super) fn same_position_weak_record(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let mut rig = Rig::closed(draw);
    rig.axis.viscous =
        rig.axis.mass * std::f64::consts::TAU * rig.axis.modes[0][0] * draw.decades(1e-4, 1e-2);
    rig.machine = rig.axis.linear().sampled(1.0 / rig.rate);
    let strong = rig.periodic(draw, 8);
    let weak = Rig {
        force: rig.force / draw.uniform(20.0, 100.0),
        ..rig.clone()
    };
    let weak = weak.periodic(draw, 8);
    Rig::table(&strong).write(&lab.path("strong.csv"))?;
    Rig::table(&weak).write(&lab.path("weak.csv"))?;
    Description::single(rig.rate)
        .referred(&["r"])
        .periodic("strong.csv", rig.period, false)
        .periodic("weak.csv", rig.period, false)
        .write(&lab.folder)?;
    let words = Words::cause(&[&["weak", "amplitude"], &["weak.csv", "record"]]);
    lab.identify(
        ".",
        Some(&rig.truth(&strong)),
        &[],
        &words,
        "the model as without the weak record",
    )
}

/// The controller of the description does not give the commands of the log.
pub(super) fn controller_mismatch(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rig = Rig::closed(draw);
    let Some(real) = rig.controller.clone() else {
        return Err("a closed rig has a controller".into());
    };
    let mut written = real.clone();
    let signals = rig.periodic(draw, 8);
    let slow = (2.0 * rig.rate / rig.axis.modes[0][0]) as usize;
    let reach = 20.0 * rms(&signals.y[0]);
    let moved = rig.follow(draw, &moves(&[reach, 0.0], 40 * slow, 10 * slow));
    let (mut a, mut m) = (Rig::table(&signals), Rig::table(&moved));
    let what = draw.pick(["gain", "sign", "unit"]);
    match what {
        "gain" => {
            let by = draw.pick([2.0, 3.0, 0.5, 10.0]);
            written.reference.iter_mut().for_each(|v| *v *= by);
            written.feedback.iter_mut().for_each(|v| *v *= by);
        }
        "sign" => written.feedback.iter_mut().for_each(|v| *v *= -1.0),
        _ => {
            for table in [&mut a, &mut m] {
                table.column("y")?.iter_mut().for_each(|v| *v *= 1000.0);
            }
        }
    }
    a.write(&lab.path("a.csv"))?;
    m.write(&lab.path("m.csv"))?;
    Description::single(rig.rate)
        .referred(&["r"])
        .controlled(&written)
        .periodic("a.csv", rig.period, false)
        .transient("m.csv", true)
        .write(&lab.folder)?;
    let wanted = format!("the [controller] has another {what} than the log");
    let inspected = lab.run(&["inspect", "."])?;
    let named = inspected.warnings().iter().any(|l| l.contains("controller"));
    let seen = Judged::new(
        named,
        &inspected,
        "lpv inspect .",
        &format!("a warning: {wanted}"),
    );
    lab.run(&["identify", ".", "-o", "m.json"])?;
    let validated = lab.run(&["validate", "m.json", "."])?;
    let line = validated.first();
    let named = line.contains("controller") && !line.starts_with("good");
    Ok(seen.and(Judged::new(named, &validated, "lpv validate m.json .", &wanted)))
}

/// A positive command moves the axis backwards.
pub(super) fn polarity(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let mut rig = super::axes::servo(draw);
    let input = super::axes::swings(draw, &rig, 4000);
    rig.noise = 0.0;
    let clean = rig.follow(draw, &input);
    rig.noise = rms(&clean.y[0]) * 1e-4;
    let mut signals = rig.follow(draw, &input);
    signals.u[0].iter_mut().for_each(|v| *v = -*v);
    Description::single(rig.rate)
        .transient("a.csv", false)
        .write(&lab.folder)?;
    let mut table = Rig::table(&signals);
    table.0.retain(|(name, _)| name != "r");
    table.write(&lab.path("a.csv"))?;
    let words = Words::cause(&[&["opposite", "polarity", "reversed", "scale = [-1"]]);
    lab.identify(
        ".",
        None,
        &["--structure", "rigid-body"],
        &words,
        "input and output have opposite signs: scale = [-1.0]",
    )
}

/// In open loop the reference column is the input itself.
pub(super) fn reference_is_input(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let mut rig = super::axes::servo(draw);
    rig.noise = 0.0;
    let mut description = Description::single(rig.rate).referred(&["u"]);
    for (i, file) in ["a.csv", "b.csv"].into_iter().enumerate() {
        let input = super::axes::swings(draw, &rig, 4000);
        if i == 0 {
            let clean = rig.follow(draw, &input);
            rig.noise = rms(&clean.y[0]) * draw.decades(1e-5, 1e-3);
        }
        let signals = rig.follow(draw, &input);
        let mut table = Rig::table(&signals);
        table.0.retain(|(name, _)| name != "r");
        table.write(&lab.path(file))?;
        description = description.transient(file, false);
    }
    description.write(&lab.folder)?;
    super::axes::rigid_body(lab, &rig.axis, &Words::cause(&[&["reference"]]))
}
