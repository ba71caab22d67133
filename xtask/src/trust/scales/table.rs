//! The xy-table: its description holds lengths, so that forces and time alone have other units.

use super::{SAME, TaskError, same_responses};
use crate::trust::bundle::number;
use crate::trust::draw::Draw;
use crate::trust::judge::Judged;
use crate::trust::program::Lab;
use std::fs;

/// A simulated table as it is, and with other units of force and time.
pub(super) fn compared(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let carriage = draw.uniform(11.0, 13.0);
    let machine = format!(
        "[machine]\ncarriage-mass-kg = {carriage}\n[multisine]\nperiod = 1024\nperiods = 6\nlines = {{ band = {{ first = 1, last = 300 }} }}\n[positions]\ncount = 3\n[moves]\nestimation = 0\nvalidation = 0\n"
    );
    fs::write(lab.path("m.toml"), machine)?;
    let made = lab.run(&["simulate", "--machine", "m.toml", "--format", "csv", "-o", "si"])?;
    if made.code != Some(0) {
        return Err(format!("no table: {}", made.first()).into());
    }
    let power = |draw: &mut Draw| 10.0_f64.powi(draw.integer(0, 8) as i32 * 3 - 12);
    let (force, time) = match draw.integer(0, 2) {
        0 => (power(draw), 1.0),
        1 => (1.0, power(draw)),
        _ => (power(draw), power(draw)),
    };
    rewritten(lab, force, time)?;
    let arguments = |folder: &str| -> Vec<String> {
        [
            "identify",
            folder,
            "-o",
            &format!("{folder}.json"),
            "--structure",
            "xy-table",
        ]
        .iter()
        .map(ToString::to_string)
        .collect()
    };
    let run = |folder: &str| {
        let owned = arguments(folder);
        lab.run(&owned.iter().map(String::as_str).collect::<Vec<_>>())
    };
    let (one, two) = (run("si")?, run("other")?);
    let wanted = format!(
        "xy-table: the same as in SI with u times {}, time times {}",
        number(force),
        number(time)
    );
    let (same, what) = match one.code == two.code {
        true => same_responses(lab, &[-0.2, 0.0, 0.2], force, [0.05, 0.05 * time])?,
        false => (
            false,
            format!("exit {:?}, in SI {:?}: {}", two.code, one.code, two.first()),
        ),
    };
    let mut judged = Judged::new(
        same,
        &two,
        "lpv identify other -o other.json --structure xy-table",
        &wanted,
    );
    if !same {
        judged.said = format!("{what} (bar {SAME:e})");
    }
    Ok(judged)
}

/// The bundle `si` as `other`: forces times `force`, seconds times `time`.
fn rewritten(lab: &Lab, force: f64, time: f64) -> Result<(), TaskError> {
    fs::create_dir_all(lab.path("other/records"))?;
    let text = fs::read_to_string(lab.path("si/experiment.toml"))?;
    let mut whole: toml::Table = text.parse()?;
    let rate = whole
        .get("sample_rate")
        .and_then(toml::Value::as_float)
        .ok_or("no rate")?;
    whole.insert("sample_rate".to_owned(), toml::Value::Float(rate / time));
    if let Some(controller) = whole.get_mut("controller").and_then(toml::Value::as_table_mut) {
        for key in ["reference_numerator", "feedback_numerator", "limit"] {
            if let Some(value) = controller.get_mut(key) {
                scale(value, force);
            }
        }
    }
    // Masses stay what they are: forces of the motors are masses times lengths over the square of a time.
    if let Some(geometry) = whole.get_mut("geometry").and_then(toml::Value::as_table_mut)
        && let Some(value) = geometry.get_mut("force_from_input")
    {
        scale(value, 1.0 / (force * time * time));
    }
    fs::write(lab.path("other/experiment.toml"), whole.to_string())?;
    for entry in fs::read_dir(lab.path("si/records"))? {
        let path = entry?.path();
        let text = fs::read_to_string(&path)?;
        let header = text.lines().next().ok_or("an empty record")?;
        let is_force: Vec<bool> = header.split(',').map(|n| n.starts_with('u')).collect();
        let mut out = format!("{header}\n");
        for line in text.lines().skip(1) {
            let cells = line
                .split(',')
                .zip(&is_force)
                .map(|(cell, is_force)| match is_force {
                    true => number(cell.parse::<f64>().unwrap_or(f64::NAN) * force),
                    false => cell.to_owned(),
                });
            out.push_str(&cells.collect::<Vec<_>>().join(","));
            out.push('\n');
        }
        let name = path.file_name().ok_or("a record has a name")?;
        fs::write(lab.path("other/records").join(name), out)?;
    }
    Ok(())
}

/// Numbers in lists of any depth.
fn scale(value: &mut toml::Value, by: f64) {
    match value {
        toml::Value::Float(v) => *v *= by,
        toml::Value::Array(all) => all.iter_mut().for_each(|v| scale(v, by)),
        _ => {}
    }
}
