//! Runs that are ended at a random moment: what was there before is there after, whole; and the next run into the same place works.

use super::bundle::Description;
use super::draw::Draw;
use super::judge::Judged;
use super::loops::{moves, rms};
use super::program::{Lab, Said};
use super::rig::Rig;
use super::{Case, TaskError};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

/// Moments a case: fifty cases of each command at ten seeds make 500.
const MOMENTS: usize = 10;

const COMMANDS: [&str; 5] = ["identify", "diagnose", "simulate", "report", "convert"];

/// So many cases of each command.
pub(crate) fn cases(first: u64, seeds: u64) -> Vec<Case> {
    let mut all = Vec::new();
    for command in COMMANDS {
        all.extend(
            (first..first + seeds)
                .map(|i| Case::new("kills", command, i, move |draw, lab| killed(draw, lab, command))),
        );
    }
    all
}

/// Every file of a folder with its content.
fn content(folder: &Path) -> Result<BTreeMap<String, Vec<u8>>, TaskError> {
    let mut all = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        for entry in std::fs::read_dir(&next)? {
            let path = entry?.path();
            if path.is_dir() {
                open.push(path);
            } else {
                let name = path.strip_prefix(folder)?.display().to_string();
                all.insert(name, std::fs::read(&path)?);
            }
        }
    }
    Ok(all)
}

fn killed(draw: &mut Draw, lab: &Lab, command: &'static str) -> Result<Judged, TaskError> {
    let rig = Rig::closed(draw);
    let signals = rig.periodic(draw, 4);
    std::fs::create_dir_all(lab.path("b"))?;
    Rig::table(&signals).write(&lab.path("b/a.csv"))?;
    let slow = (2.0 * rig.rate / rig.axis.modes[0][0]) as usize;
    for (file, by) in [("m1.csv", 30.0), ("m2.csv", -20.0)] {
        let moved = rig.follow(draw, &moves(&[by * rms(&signals.y[0]), 0.0], 20 * slow, 5 * slow));
        Rig::table(&moved).write(&lab.path("b").join(file))?;
    }
    let mut description = Description::single(rig.rate).referred(&["r"]);
    if let Some(c) = &rig.controller {
        description = description.controlled(c);
    }
    description
        .periodic("a.csv", rig.period, false)
        .transient("m1.csv", false)
        .transient("m2.csv", true)
        .write(&lab.path("b"))?;
    let machine = "[multisine]\nperiod = 64\nperiods = 4\nlines = { band = { first = 1, last = 19 } }\n[positions]\ncount = 2\n[moves]\nestimation = 0\nvalidation = 0\n";
    std::fs::write(lab.path("m.toml"), machine)?;
    lab.run(&["identify", "b", "-o", "result/model.json"])?;
    let arguments: &[&str] = match command {
        "identify" => &["identify", "b", "-o", "result/model.json"],
        "diagnose" => &["diagnose", "b", "-o", "d"],
        "simulate" => &["simulate", "--machine", "m.toml", "-o", "s"],
        "report" => &["report", "result"],
        _ => &["convert", "result/model.json", "--to", "mat"],
    };
    // How long it takes when nothing ends it; what it leaves is the old state that no killed run may spoil.
    let start = Instant::now();
    let whole = lab.run(arguments)?;
    let seconds = start.elapsed().as_secs_f64();
    let mut judged = Judged::new(
        true,
        &whole,
        &format!("lpv {} (killed)", arguments.join(" ")),
        "nothing lost, and the next run works",
    );
    let before = content(&lab.folder)?;
    for _ in 0..MOMENTS {
        if command == "simulate" {
            // A bundle is written once: into a place of its own.
            std::fs::remove_dir_all(lab.path("s")).ok();
        }
        let mut child = lab
            .command(arguments)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()?;
        std::thread::sleep(Duration::from_secs_f64(draw.uniform(0.0, 1.1 * seconds)));
        child.kill().ok();
        child.wait()?;
        if let Some(lost) = lost(&before, &content(&lab.folder)?, command) {
            judged.is_right = false;
            judged.said = format!("lost: {lost}");
            return Ok(judged);
        }
        let next = lab.run(arguments)?;
        let complete = command != "simulate" || lab.run(&["inspect", "s"])?.code == Some(0);
        if next.code != whole.code || !complete {
            // A bundle that was ready when the kill came is refused to be replaced, and whole.
            let ready = command == "simulate" && next.code == Some(2) && complete && refused_whole(&next);
            if !ready {
                judged.is_right = false;
                judged.said = format!("the next run ends with {:?}: {}", next.code, next.first());
                return Ok(judged);
            }
        }
    }
    Ok(judged)
}

fn refused_whole(next: &Said) -> bool {
    next.first().contains("exists")
}

/// A file that was there and is gone or is neither the old nor a whole one of its kind.
fn lost(
    before: &BTreeMap<String, Vec<u8>>,
    after: &BTreeMap<String, Vec<u8>>,
    command: &str,
) -> Option<String> {
    before.iter().find_map(|(name, old)| {
        if command == "simulate" && name.starts_with("s/") {
            return None;
        }
        match after.get(name) {
            None => Some(format!("{name} is gone")),
            Some(new) if new == old => None,
            // An output of the command itself: the new one must be whole.
            Some(new) if is_output(name) => (!is_whole(name, new)).then(|| format!("{name} is cut off")),
            Some(_) => Some(format!("{name} is changed")),
        }
    })
}

fn is_output(name: &str) -> bool {
    name.starts_with("result/") || name.starts_with("d/")
}

fn is_whole(name: &str, bytes: &[u8]) -> bool {
    if name.ends_with(".json") {
        return serde_json::from_slice::<serde_json::Value>(bytes).is_ok();
    }
    if name.ends_with(".html") {
        return String::from_utf8_lossy(bytes).trim_end().ends_with("</html>");
    }
    !bytes.is_empty()
}
