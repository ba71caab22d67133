//! The catalogue of `lpv diagnose` as a page with a picture of each effect.

use crate::TaskError;
use experiment_data::{Bundle, RecordFormat};
use lpv::diagnose::{Diagnosed, Given, diagnose};
use lpv::silent;
use lpv::simulate::{MachineFile, simulate};
use lpv_diagnose::catalogue::KINDS;
use lpv_diagnose::effect::{Effect, Family, Needs, Place};
use lpv_report::Figure;
use std::fmt::Write as _;
use std::path::Path;
use xytable_plant::HiddenEffect;

/// Pixels of a picture.
const WIDTH: u32 = 800;

/// Writes `effects.md` and the folder `effects` with the pictures.
///
/// # Errors
/// Of the file system; of a machine that cannot be simulated or diagnosed.
pub(crate) fn write(folder: &Path) -> Result<(), TaskError> {
    let pictures = folder.join("effects");
    std::fs::create_dir_all(&pictures)?;
    let mut page = String::from(
        "# The effects that `lpv diagnose` knows\n\n\
         Made by `cargo xtask effects --bless`. One file of `crates/lpv-diagnose/src/catalogue` an effect: its parameters, from where it \
         is tried, and its block in the simulation. The pictures come from the default machine of `lpv simulate` with the effect \
         hidden in it (`--hide NAME`), as `lpv diagnose` found it. `u`, `y` and `s` stand for the units of the input and of \
         the output of its channel and of time. Errors of sensors are tried at each output. What acts on commands, motors or guides acts \
         where the `[geometry]` of the bundle says: alike at all motors that are coupled (but cogging, cables and an asymmetry, which \
         differ); where each input drives a motor of its own, or without a geometry, at each channel by itself, a delay and a lag also \
         at all inputs. What acts on a part of these, as friction of one of two guides, is `unexplained`. An effect \
         periodic in position is accepted only if its pitch is shorter than the travel, one periodic in time only if a full period \
         lies in a record, a drift only if its time constant is between one sample and ten record lengths.\n",
    );
    for (effect, others) in KINDS.into_iter().filter_map(<[Effect]>::split_first) {
        println!("{}", effect.name);
        let _ = write!(
            page,
            "\n## {}\n\n{}. Family `{}`.\n\n| parameter | unit |\n|---|---|\n",
            effect.name,
            capital(effect.meaning),
            effect.family.name()
        );
        for p in effect.parameters {
            let _ = writeln!(
                page,
                "| `{}` | {} |",
                p.name,
                if p.unit.is_empty() { "1" } else { p.unit }
            );
        }
        let names = |e: &Effect| {
            e.parameters
                .iter()
                .map(|p| format!("`{}`", p.name))
                .collect::<Vec<_>>()
        };
        let mut told = vec![(names(effect), effect.meaning)];
        for other in others {
            if told.contains(&(names(other), other.meaning)) {
                continue;
            }
            told.push((names(other), other.meaning));
            let when =
                if other.extends.is_some() && effect.extends.is_none() || other.fitted() > effect.fitted() {
                    format!("As a refinement, {}", other.meaning)
                } else if is_of_an_axis(other) {
                    format!("On a servo axis, {}", other.meaning)
                } else if matches!((effect.place, other.place), (Place::Motor(_), Place::Output(_))) {
                    format!("At a sensor, {}", other.meaning)
                } else if other.needs == effect.needs {
                    "In its simpler form".to_owned()
                } else {
                    "Where each input drives a motor of its own".to_owned()
                };
            let _ = writeln!(page, "\n{when}: {}.", names(other).join(", "));
        }
        if let Some(simpler) = &effect.extends {
            let _ = writeln!(page, "\nTried as a refinement of `{}`.", simpler.name);
        }
        if is_of_an_axis(effect) {
            let _ = writeln!(page, "\nOf servo axes alone; see [their bench](blind-servo.md).");
            continue;
        }
        let Ok(hidden) = effect.name.parse::<HiddenEffect>() else {
            let _ = writeln!(
                page,
                "\nThe simulated machine cannot hide it; see [measured data](measured-data.md)."
            );
            continue;
        };
        let found = found(hidden)?;
        let d = &found.diagnosis;
        let names: Vec<&str> = d.effects.iter().map(|e| e.effect.as_str()).collect();
        let said = if names.is_empty() {
            "no effect".to_owned()
        } else {
            names.join(", ")
        };
        if let Some(figure) = picture(effect, &found) {
            std::fs::write(
                pictures.join(format!("{}.png", effect.name)),
                figure.to_png(WIDTH)?,
            )?;
            let _ = writeln!(
                page,
                "\n![{}](effects/{}.png)\n\nHidden in the default machine: {said} ({}).",
                effect.name, effect.name, d.verdict
            );
        }
    }
    std::fs::write(folder.join("effects.md"), page)?;
    Ok(())
}

/// Whether an effect acts on servo axes alone.
fn is_of_an_axis(effect: &Effect) -> bool {
    matches!(
        effect.needs,
        Needs::Axis | Needs::FreeAxis | Needs::Load | Needs::Spring
    )
}

fn found(hidden: HiddenEffect) -> Result<Diagnosed, TaskError> {
    let folder = tempfile::tempdir()?;
    let out = folder.path().join("bundle");
    let file = MachineFile {
        second_signal: true,
        ..MachineFile::default()
    };
    simulate(&file, &[hidden], &out, RecordFormat::Npz, &|_, _| ())?;
    Ok(diagnose(&Bundle::open(&out)?, Given::default(), &silent)?)
}

/// The view in which an effect is seen best.
fn picture<'a>(effect: &Effect, found: &'a Diagnosed) -> Option<&'a Figure> {
    match effect.family {
        Family::Friction | Family::PositionForce => found.over_motion(),
        Family::Structure | Family::Timing | Family::Actuator => found.in_spectrum(),
        Family::Scheduling | Family::Disturbance | Family::Sensor => Some(found.in_time()),
    }
}

/// With a capital.
pub(crate) fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| {
        first.to_uppercase().chain(letters).collect()
    })
}
