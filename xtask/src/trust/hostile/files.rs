//! Files and folders: what is read is never written over; what is asked for comes, or is refused.

use super::{Draw, Judged, Lab, TaskError, Watch, small};
use crate::trust::bundle::Description;
use crate::trust::kinds::records::Places;
use crate::trust::program::{find, find_where, watch, worth};
use crate::trust::rig::Rig;
use serde_json::Value;
use std::fs::{self, File, Permissions};
use std::os::unix::fs::{MetadataExt, PermissionsExt};

/// Records of one place that cannot be of one machine.
pub(super) fn contradicting_records(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let rig = Rig::open(draw, 1);
    let mut description = Description::single(rig.rate).scheduled("p");
    let p = draw.uniform(-1.0, 1.0);
    let step = draw.uniform(0.08, 0.2);
    for i in 0..5 {
        let mut other = rig.clone();
        other.axis.modes[0][0] *= 1.0 + step * f64::from(i);
        other.machine = other.axis.linear().sampled(1.0 / rig.rate);
        let signals = other.periodic(draw, 6);
        let file = format!("g{i}.csv");
        let at = vec![p; signals.y[0].len()];
        Rig::table(&signals).with("p", &at).write(&lab.path(&file))?;
        description = description.periodic(&file, rig.period, false);
    }
    description.write(&lab.folder)?;
    let mut watch = Watch::new("the records disagree: said in the first line, exit 3");
    let line = watch
        .run(lab, &["identify", ".", "-o", "m.json"])?
        .first()
        .to_lowercase();
    let named = ["contradict", "disagree", "differ"]
        .iter()
        .any(|w| line.contains(w));
    watch.check(named, "not named");
    Ok(watch.judged())
}

/// `convert` without `-o` beside a record of the model's name.
pub(super) fn convert_destroys_measurement(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    small(draw, lab)?;
    let mut watch = Watch::new("the record is as it was");
    watch.run(lab, &["identify", "b", "-o", "b/a.json"])?;
    let before = fs::read(lab.path("b/a.csv"))?;
    watch.run(lab, &["convert", "b/a.json", "--to", "csv"])?;
    watch.check(fs::read(lab.path("b/a.csv"))? == before, "the record is gone");
    // Something of the user's that is no result, of any name.
    let (target, ending) = draw.pick([("mat", "mat"), ("python", "py"), ("csv", "csv")]);
    let own = lab.path(&format!("b/notes.{ending}"));
    fs::copy(lab.path("b/a.json"), lab.path("b/notes.json")).ok();
    fs::write(&own, "my own notes\n")?;
    watch.run(lab, &["convert", "b/notes.json", "--to", target])?;
    watch.check(
        fs::read(&own)? == b"my own notes\n",
        "a file of the user's is replaced",
    );
    Ok(watch.judged())
}

/// `diagnose --model D/model.json -o D`.
pub(super) fn diagnose_destroys_its_model(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    small(draw, lab)?;
    let mut watch = Watch::new("the model that was given is as it was");
    watch.run(lab, &["identify", "b", "-o", "D/model.json"])?;
    let before = fs::read(lab.path("D/model.json")).unwrap_or_default();
    watch.run(lab, &["diagnose", "b", "--model", "D/model.json", "-o", "D"])?;
    watch.check(
        fs::read(lab.path("D/model.json")).unwrap_or_default() == before,
        "the model is another",
    );
    Ok(watch.judged())
}

/// Standard error, and standard output, that cannot be written.
pub(super) fn closed_stderr(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    small(draw, lab)?;
    let wrong = draw.pick([
        ["inspect", "nothing"],
        ["convert", "nothing.json"],
        ["report", "nothing"],
    ]);
    let mut seen = Watch::new("exit 2 also where nobody listens");
    let full = || File::options().write(true).open("/dev/full");
    let mut command = lab.command(&wrong);
    if wrong[0] == "convert" {
        command.args(["--to", "mat"]);
    }
    let code = command
        .stdout(std::process::Stdio::null())
        .stderr(full()?)
        .status()?
        .code();
    seen.check(code == Some(2), &format!("{wrong:?}: {code:?}"));
    let code = lab
        .command(&["inspect", "b"])
        .stdout(full()?)
        .stderr(full()?)
        .status()?
        .code();
    seen.check(matches!(code, Some(0 | 1)), &format!("inspect: {code:?}"));
    let said = watch(&mut lab.command(&["inspect", "b"]))?;
    seen.saw(said, &format!("lpv {} 2>/dev/full", wrong.join(" ")));
    Ok(seen.judged())
}

/// A name that the file system takes.
pub(super) fn long_output_name(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    small(draw, lab)?;
    let long = draw.integer(236, 250);
    let name = format!("{}.json", "a".repeat(long));
    let mut watch = Watch::new("a name of 255 bytes is a name");
    let code = watch.run(lab, &["identify", "b", "-o", &name])?.code;
    watch.check(
        matches!(code, Some(0 | 3)) && lab.path(&name).is_file(),
        "not written",
    );
    Ok(watch.judged())
}

/// Outputs that are inputs.
pub(super) fn output_destroys_bundle(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    small(draw, lab)?;
    let mut watch = Watch::new("no output is a record, a description or the model that is read");
    watch.run(lab, &["identify", "b", "-o", "m/model.json"])?;
    let files = ["b/a.csv", "b/experiment.toml", "m/model.json"];
    let before: Vec<_> = files
        .iter()
        .map(|f| fs::read(lab.path(f)).unwrap_or_default())
        .collect();
    // By another way to the same place, too.
    std::os::unix::fs::symlink(lab.path("b/a.csv"), lab.path("link.json"))?;
    fs::hard_link(lab.path("b/a.csv"), lab.path("hard.json"))?;
    for arguments in [
        ["identify", "b", "-o", "b/a.csv"],
        ["identify", "b", "-o", "b/experiment.toml"],
        ["identify", "b", "-o", "b/../b/a.csv"],
        ["identify", "b", "-o", "link.json"],
        ["identify", "b", "-o", "hard.json"],
        ["report", "m", "-o", "m/model.json"],
        ["report", "m", "-o", "b/a.csv"],
        ["diagnose", "b", "-o", "b/a.csv"],
    ] {
        watch.run(lab, &arguments)?;
        for (file, old) in files.iter().zip(&before) {
            watch.check(
                &fs::read(lab.path(file)).unwrap_or_default() == old,
                &format!("{file} is another"),
            );
        }
    }
    watch.run(lab, &["convert", "m/model.json", "--to", "csv", "-o", "b/a.csv"])?;
    watch.check(fs::read(lab.path("b/a.csv"))? == before[0], "b/a.csv is another");
    Ok(watch.judged())
}

/// The same places in a unit of a billionth.
pub(super) fn outputs_in_nanometres(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let places = Places::new(draw, 3);
    let factor = draw.pick([1e3, 1e6, 1e9, 1e12]);
    let mut watch = Watch::new(&format!("outputs times {factor:e}: a model as without"));
    let mut codes = Vec::new();
    for (folder, by) in [("m", 1.0), ("nm", factor)] {
        places.description().write(&lab.path(folder))?;
        let mut again = Draw::new(1, folder, 0);
        for i in 0..3 {
            let (mut table, _) = places.record(&mut again, i, 6);
            table.column("y")?.iter_mut().for_each(|v| *v *= by);
            table.column("r")?.iter_mut().for_each(|v| *v *= by);
            table.write(&lab.path(&format!("{folder}/pos{}.csv", i + 1)))?;
        }
        codes.push(
            watch
                .run(lab, &["identify", folder, "-o", &format!("{folder}.json")])?
                .code,
        );
    }
    watch.check(codes[0] == codes[1], &format!("{codes:?}"));
    Ok(watch.judged())
}

/// What was private stays private.
pub(super) fn permissions_widened(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    small(draw, lab)?;
    let mode = draw.pick([0o600, 0o640, 0o660]);
    let mut watch = Watch::new(&format!("mode {mode:o} is kept, and so is a hard link"));
    watch.run(lab, &["identify", "b", "-o", "m.json"])?;
    fs::set_permissions(lab.path("m.json"), Permissions::from_mode(mode))?;
    watch.run(lab, &["identify", "b", "-o", "m.json"])?;
    let now = fs::metadata(lab.path("m.json"))?.mode() & 0o777;
    watch.check(now == mode, &format!("mode {now:o}"));
    Ok(watch.judged())
}

/// Places far from zero are places.
pub(super) fn position_offset_merges(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let places = Places::new(draw, 5);
    let reach = places.positions[4];
    let offset = draw.sign() * reach * draw.decades(1e3, 1e6);
    places.description().write(&lab.folder)?;
    for i in 0..5 {
        let (mut table, _) = places.record(draw, i, 8);
        table.column("p")?.iter_mut().for_each(|v| *v += offset);
        table.write(&lab.path(&format!("pos{}.csv", i + 1)))?;
    }
    let mut watch = Watch::new("five places");
    watch.run(lab, &["identify", ".", "-o", "m.json"])?;
    let json = lab.json("m.json");
    let found = find_where(&json, "positions", Value::is_u64).and_then(Value::as_u64);
    let refused = ["not-a-model", "contradictory-data"].contains(&worth(&json).as_str());
    watch.check(found == Some(5) || refused, &format!("{found:?} places"));
    Ok(watch.judged())
}

/// `report m.json`.
pub(super) fn report_of_a_file(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    small(draw, lab)?;
    let mut watch = Watch::new("a page beside the model");
    watch.run(lab, &["identify", "b", "-o", "m.json"])?;
    let before = fs::read(lab.path("m.json")).unwrap_or_default();
    let code = watch.run(lab, &["report", "m.json"])?.code;
    watch.check(code == Some(0), &format!("{code:?}"));
    watch.check(
        fs::read(lab.path("m.json")).unwrap_or_default() == before,
        "the model is another",
    );
    let pages = fs::read_dir(&lab.folder)?
        .flatten()
        .filter(|e| e.file_name().to_string_lossy().ends_with(".html"));
    watch.check(pages.count() == 1, "no page");
    Ok(watch.judged())
}

/// The same samples on any clock.
pub(super) fn slow_sampling(draw: &mut Draw, lab: &Lab) -> Result<Judged, TaskError> {
    let places = Places::new(draw, 3);
    for i in 0..3 {
        places
            .record(draw, i, 6)
            .0
            .write(&lab.path(&format!("pos{}.csv", i + 1)))?;
    }
    let slow = draw.pick([1e-6, 1e-4, 1e-3, 1e9]);
    let mut watch = Watch::new(&format!("{slow:e} Hz: the model that 50 Hz gives"));
    let mut found = Vec::new();
    let mut seconds = Vec::new();
    for rate in [50.0, slow] {
        let mut description = places.description();
        description.rate = rate;
        description.write(&lab.folder)?;
        let said = watch.run(lab, &["identify", ".", "-o", "m.json"])?;
        seconds.push(said.seconds);
        found.push(find(&lab.json("m.json"), "lfr").map(ToString::to_string));
    }
    watch.check(found[0] == found[1], &format!("states and deltas {found:?}"));
    watch.check(seconds[1] < 5.0 * seconds[0] + 2.0, &format!("{seconds:.1?} s"));
    Ok(watch.judged())
}
