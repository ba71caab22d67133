//! Units do not matter: the same records in other units of outputs, inputs, positions and time give the same model.

mod table;

use super::bundle::{Description, Table, number};
use super::draw::Draw;
use super::judge::{Judged, frozen};
use super::kinds::records::Places;
use super::loops::{Controller, moves, rms};
use super::machine::C64;
use super::program::{Lab, Said, find, worth};
use super::rig::Rig;
use super::{Case, TaskError};
use lpv::ModelFile;
use serde_json::Value;

/// How far the frozen responses may be apart.
const SAME: f64 = 1e-6;

/// Every structure with every change of units.
pub(crate) fn cases(first: u64, seeds: u64, is_quick: bool) -> Vec<Case> {
    let mut all = Vec::new();
    for (name, make) in STRUCTURES {
        // A diagnosis takes long enough to be tried on fewer machines.
        let count = if is_quick { 1 } else { seeds };
        if is_quick && name == "diagnose" {
            continue;
        }
        all.extend((first..first + count).map(|i| {
            Case::new("scales", name, i, move |draw, lab| {
                compared(draw, lab, name, make)
            })
        }));
    }
    if !is_quick {
        all.extend((first..first + seeds).map(|i| Case::new("scales", "xy-table", i, table::compared)));
    }
    all
}

/// Records of one machine, and how each column is counted.
pub(crate) struct Source {
    rate: f64,
    description: Description,
    records: Vec<(String, Table)>,
    arguments: Vec<&'static str>,
    positions: Vec<f64>,
    /// Lines in cycles a sample.
    lines: Vec<f64>,
    diagnosed: bool,
}

type Make = fn(&mut Draw) -> Source;

const STRUCTURES: [(&str, Make); 5] = [
    ("lpv", lpv),
    ("lti periodic", lti_periodic),
    ("lti transient", lti_transient),
    ("rigid-body", rigid_body),
    ("diagnose", diagnosed),
];

fn lines() -> Vec<f64> {
    (1..80).map(|k| 0.4 * f64::from(k) / 80.0).collect()
}

fn lpv(draw: &mut Draw) -> Source {
    let places = Places::new(draw, 5);
    let records = (0..5)
        .map(|i| (format!("pos{}.csv", i + 1), places.record(draw, i, 8).0))
        .collect();
    Source {
        rate: places.rig.rate,
        description: places.description(),
        records,
        arguments: Vec::new(),
        positions: places.positions.clone(),
        lines: lines(),
        diagnosed: false,
    }
}

fn lti_periodic(draw: &mut Draw) -> Source {
    let rig = Rig::closed(draw);
    let signals = rig.periodic(draw, 8);
    Source {
        rate: rig.rate,
        description: Description::single(rig.rate)
            .referred(&["r"])
            .periodic("a.csv", rig.period, false),
        records: vec![("a.csv".to_owned(), Rig::table(&signals))],
        arguments: Vec::new(),
        positions: vec![0.0],
        lines: lines(),
        diagnosed: false,
    }
}

fn lti_transient(draw: &mut Draw) -> Source {
    let mut rig = Rig::open(draw, 1);
    let input = rig.random(draw, 3000);
    rig.noise = 0.0;
    let clean = rig.follow(draw, &input);
    rig.noise = rms(&clean.y[0]) * 1e-3;
    let signals = rig.follow(draw, &input);
    let mut table = Rig::table(&signals);
    table.0.retain(|(name, _)| name != "r");
    Source {
        rate: rig.rate,
        description: Description::single(rig.rate).transient("a.csv", false),
        records: vec![("a.csv".to_owned(), table)],
        arguments: Vec::new(),
        positions: vec![0.0],
        lines: lines(),
        diagnosed: false,
    }
}

fn rigid_body(draw: &mut Draw) -> Source {
    let mut rig = super::kinds::servo(draw);
    let input = super::kinds::swings(draw, &rig, 3000);
    let clean = rig.follow(draw, &input);
    rig.noise = rms(&clean.y[0]) * 1e-5;
    let signals = rig.follow(draw, &input);
    let table = Table::default().with("y", &signals.y[0]).with("u", &signals.u[0]);
    Source {
        rate: rig.rate,
        description: Description::single(rig.rate).transient("a.csv", false),
        records: vec![("a.csv".to_owned(), table)],
        arguments: vec!["--structure", "rigid-body"],
        positions: vec![0.0],
        lines: lines(),
        diagnosed: false,
    }
}

/// A servo in its loop with a hidden payload-free friction: moves of both directions.
fn diagnosed(draw: &mut Draw) -> Source {
    let rig = super::kinds::servo(draw);
    let h = 1.0 / rig.rate;
    let controller = Controller::lead(rig.axis.mass, 0.02 / h, h);
    let rig = Rig {
        controller: Some(controller.clone()),
        ..rig
    };
    let reach = rig.force / rig.axis.mass * (200.0 * h).powi(2) / 6.0;
    let rig = Rig {
        noise: reach * 1e-6,
        ..rig
    };
    let coulomb = 0.2 * rig.force;
    let mut description = Description::single(rig.rate)
        .referred(&["r"])
        .controlled(&controller);
    let mut records = Vec::new();
    for (i, file) in ["a.csv", "b.csv", "c.csv"].into_iter().enumerate() {
        let targets = [[1.0, -0.5, 0.0], [0.6, -0.8, 0.0], [-1.0, 0.4, 0.0]][i].map(|t| t * reach);
        let path = moves(&targets, 200, 60);
        let signals = super::kinds::rubbed(&rig, coulomb, &path, draw);
        records.push((file.to_owned(), Rig::table(&signals)));
        description = description.transient(file, i == 2);
    }
    Source {
        rate: rig.rate,
        description,
        records,
        arguments: Vec::new(),
        positions: vec![0.0],
        lines: Vec::new(),
        diagnosed: true,
    }
}

/// Factors of y, u, p and time, and the shift of p in ranges.
#[derive(Debug, Clone, Copy)]
struct Units {
    y: f64,
    u: f64,
    p: f64,
    time: f64,
    shift: f64,
}

impl Units {
    const SI: Self = Self {
        y: 1.0,
        u: 1.0,
        p: 1.0,
        time: 1.0,
        shift: 0.0,
    };
    /// One or all of them, up to twelve decades.
    fn other(draw: &mut Draw) -> Self {
        let any = |draw: &mut Draw| 10.0_f64.powi(draw.integer(0, 8) as i32 * 3 - 12);
        let mut units = Self::SI;
        match draw.integer(0, 5) {
            0 => units.y = any(draw),
            1 => units.u = any(draw),
            2 => units.time = any(draw),
            3 => units.p = any(draw),
            4 => units.shift = draw.sign() * draw.decades(1.0, 1e6),
            _ => {
                units = Self {
                    y: any(draw),
                    u: any(draw),
                    p: any(draw),
                    time: any(draw),
                    shift: draw.sign() * draw.decades(1.0, 1e6),
                };
            }
        }
        units
    }
    fn position(&self, p: f64, range: f64) -> f64 {
        (p + self.shift * range) * self.p
    }
}

/// Writes the source in these units into a folder and runs the program there.
fn ran(lab: &Lab, folder: &str, source: &Source, units: Units) -> Result<Said, TaskError> {
    let range = 2.0 * source.positions.iter().fold(0.0_f64, |m, p| m.max(p.abs()));
    let mut description = source.description.clone();
    description.rate = source.rate / units.time;
    if let Some(c) = &mut description.controller {
        c.feedback.iter_mut().for_each(|v| *v *= units.u / units.y);
        c.reference.iter_mut().for_each(|v| *v *= units.u / units.y);
    }
    let path = description.write(&lab.path(folder))?;
    for (file, table) in &source.records {
        let mut table = table.clone();
        for (name, values) in &mut table.0 {
            let new = |v: f64| match name.as_str() {
                "y" => v * units.y,
                "r" if description.controller.is_some() => v * units.y,
                "u" | "r" => v * units.u,
                _ => units.position(v, range),
            };
            values.iter_mut().for_each(|v| *v = new(*v));
        }
        table.write(&path.join(file))?;
    }
    let model = format!("{folder}.json");
    match source.diagnosed {
        true => lab.run(&["diagnose", folder, "-o", &format!("{folder}-d")]),
        false => lab.run(&[&["identify", folder, "-o", &model][..], &source.arguments].concat()),
    }
}

/// The same machine twice, in two systems of units.
fn compared(draw: &mut Draw, lab: &Lab, name: &str, make: Make) -> Result<Judged, TaskError> {
    let source = make(draw);
    let units = Units::other(draw);
    let (one, two) = (
        ran(lab, "si", &source, Units::SI)?,
        ran(lab, "other", &source, units)?,
    );
    let wanted = format!(
        "{name}: the same as in SI with y times {}, u times {}, p times {} and {:.3e} ranges further, time times {}",
        number(units.y),
        number(units.u),
        number(units.p),
        units.shift,
        number(units.time)
    );
    let command = if source.diagnosed {
        "lpv diagnose other -o other-d"
    } else {
        "lpv identify other -o other.json"
    };
    if one.code != two.code {
        let mut judged = Judged::new(false, &two, command, &wanted);
        judged.said = format!("exit {:?}, in SI {:?}: {}", two.code, one.code, judged.said);
        return Ok(judged);
    }
    let (same, what) = match source.diagnosed {
        true => same_diagnosis(lab),
        false => same_model(lab, &source, units)?,
    };
    let mut judged = Judged::new(same, &two, command, &wanted);
    if !same {
        judged.said = what;
    }
    Ok(judged)
}

fn same_model(lab: &Lab, source: &Source, units: Units) -> Result<(bool, String), TaskError> {
    let range = 2.0 * source.positions.iter().fold(0.0_f64, |m, p| m.max(p.abs()));
    let places: Vec<[f64; 2]> = source
        .positions
        .iter()
        .map(|p| [*p, units.position(*p, range)])
        .collect();
    let times = [1.0 / source.rate, units.time / source.rate];
    same_at(lab, &places, &source.lines, units.u / units.y, times)
}

/// Of places that are the same in both.
fn same_responses(
    lab: &Lab,
    positions: &[f64],
    factor: f64,
    times: [f64; 2],
) -> Result<(bool, String), TaskError> {
    let places: Vec<[f64; 2]> = positions.iter().map(|p| [*p, *p]).collect();
    let lines: Vec<f64> = (1..60).map(|k| 0.3 * f64::from(k) / 60.0).collect();
    same_at(lab, &places, &lines, factor, times)
}

/// Compares `si.json` with `other.json`, whose responses are `factor` times smaller.
fn same_at(
    lab: &Lab,
    places: &[[f64; 2]],
    lines: &[f64],
    factor: f64,
    times: [f64; 2],
) -> Result<(bool, String), TaskError> {
    let read = |name: &str| ModelFile::read(&lab.path(name));
    let (one, two) = match (read("si.json"), read("other.json")) {
        (Ok(one), Ok(two)) => (one, two),
        (Err(_), Err(_)) => return Ok((true, "no model in either".to_owned())),
        _ => return Ok((false, "a model in one of both units only".to_owned())),
    };
    let (mut wrong, mut size) = (0.0, 0.0);
    for [p, q] in places {
        let a = frozen(&one.model, *p, times[0])?;
        let b = frozen(&two.model, *q, times[1])?;
        for cycles in lines {
            let (Some(a), Some(b)) = (a.response(*cycles), b.response(*cycles)) else {
                return Ok((false, "a response is infinite".to_owned()));
            };
            // Each line counts alike.
            let norm = a.norm();
            let apart = (b * C64::new(factor, 0.0) - a).norm() / norm;
            wrong += apart * apart;
            size += 1.0;
        }
    }
    let error: f64 = (wrong / f64::max(size, 1.0)).sqrt();
    let worths = [worth(&lab.json("si.json")), worth(&lab.json("other.json"))];
    let same = error <= SAME && worths[0] == worths[1];
    Ok((
        same,
        format!(
            "frozen responses differ by {error:.1e}; verdicts {:?} and {:?}",
            worths[0], worths[1]
        ),
    ))
}

/// The same word and the same effects.
fn same_diagnosis(lab: &Lab) -> (bool, String) {
    let told = |folder: &str| {
        let json = lab.json(&format!("{folder}-d/diagnosis.json"));
        let word = find(&json, "verdict").cloned().unwrap_or(Value::Null);
        let word = word.as_str().map_or_else(|| worth(&json), str::to_owned);
        let effects = find(&json, "effects")
            .and_then(Value::as_array)
            .cloned()
            .unwrap_or_default();
        let names = effects
            .iter()
            .filter_map(|e| Some(e.get("effect")?.as_str()?.to_owned()))
            .collect::<Vec<_>>();
        (word, names)
    };
    let (one, two) = (told("si"), told("other"));
    (one == two, format!("{two:?}, in SI {one:?}"))
}
