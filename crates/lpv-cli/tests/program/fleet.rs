//! `lpv fleet` and `lpv merge`: shards, kills, and the table.

use crate::common::Desk;
#[cfg(unix)]
use crate::common::signal;
use std::process::Stdio;
use std::time::{Duration, Instant};

/// Machines that are diagnosed in a second or two, and a folder that is no bundle.
fn desk(machines: usize) -> Desk {
    let desk = Desk::new();
    for seed in 1..=machines {
        let text = format!(
            "seed = {seed}\npositions = {{ values = [-0.2, 0.0, 0.2] }}\n\
             multisine = {{ period = 512, periods = 4, lines = \"odd\" }}\n\
             setpoints = {{ samples = 800 }}\nmoves = {{ estimation = 2, validation = 1 }}\n"
        );
        desk.write("machine.toml", text);
        desk.done(&format!(
            "simulate --machine machine.toml --hide coulomb-friction -o fleet/m{seed}"
        ));
    }
    desk.write("fleet/no/notes.txt", "");
    desk
}

/// What the program prints and ends with.
fn ends(desk: &Desk, line: &str, code: i32) -> String {
    let out = desk.lpv(line);
    let message = String::from_utf8_lossy(&out.stderr);
    assert_eq!(out.status.code(), Some(code), "lpv {line}: {message}");
    String::from_utf8(out.stdout).unwrap()
}

/// The folder of the results of a bundle.
fn folder_of(desk: &Desk, out: &str, bundle: &str) -> std::path::PathBuf {
    let entries = std::fs::read_dir(desk.path(out)).into_iter().flatten().flatten();
    let mut found = entries.map(|e| e.path()).filter(|p| {
        let name = p.file_name().unwrap_or_default().to_string_lossy().into_owned();
        name.starts_with(&format!("{bundle}-"))
    });
    found.next().unwrap_or_default()
}

#[test]
fn shards_make_the_table_of_one_run() {
    let desk = desk(3);
    desk.write("exact.toml", "lfr = \"exact\"\norder = 6\nintegrators = 2\n");
    let fleet = "fleet fleet/m1 fleet/no fleet/m2 fleet/m3 --task identify -c exact.toml";
    // One bundle is refused: its row says why, the others have their results, and the exit code tells.
    let said = ends(&desk, &format!("{fleet} -o whole"), 3);
    assert!(
        said.contains("fleet/no: `fleet/no` holds no experiment.toml"),
        "{said}"
    );
    ends(&desk, &format!("{fleet} --shard 2/2 -o parts"), 3);
    let told = ends(&desk, "merge parts -o parts.csv", 3);
    assert!(
        told.contains("missing: fleet/m1") && told.contains("missing: fleet/m2"),
        "{told}"
    );
    desk.lpv(&format!("{fleet} --shard 1/2 -o parts"));
    for ending in ["csv", "json"] {
        ends(&desk, &format!("merge whole -o whole.{ending}"), 3);
        ends(&desk, &format!("merge parts -o parts.{ending}"), 3);
        assert_eq!(
            desk.bytes(&format!("whole.{ending}")),
            desk.bytes(&format!("parts.{ending}"))
        );
    }
    // What a merge reads, it does not replace, and a row is that of its bundle.
    let list = desk.bytes("whole/fleet.json");
    let row = folder_of(&desk, "parts", "m3").join("row.json");
    for place in [
        "whole/fleet.json".into(),
        row.strip_prefix(desk.path("")).unwrap().display().to_string(),
    ] {
        let said = desk.refused(&format!("merge whole parts -o {place} --force"));
        assert!(said.contains("of a shard"), "{said}");
    }
    assert_eq!(list, desk.bytes("whole/fleet.json"));
    let own = std::fs::read(&row).unwrap();
    std::fs::copy(folder_of(&desk, "parts", "m1").join("row.json"), &row).unwrap();
    let said = desk.refused("merge parts");
    assert!(said.contains("in the place of that of fleet/m3"), "{said}");
    std::fs::write(&row, own).unwrap();
    let again = ends(&desk, &format!("{fleet} -o whole"), 3);
    assert!(again.contains("3 of them kept from before"), "{again}");
    let model = |out: &str| std::fs::read(folder_of(&desk, out, "m3").join("model.json")).unwrap();
    desk.judged("identify fleet/m3 -c exact.toml -o alone/m3/model.json");
    assert_eq!(model("whole"), desk.bytes("alone/m3/model.json"));
    assert_eq!(model("parts"), model("whole"));
}

#[test]
fn a_killed_shard_goes_on_where_it_was() {
    let desk = desk(2);
    let words = ["fleet", "fleet/m1", "fleet/m2", "-o", "out"];
    let mut child = desk
        .program(&words)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    while !folder_of(&desk, "out", "m1").join("row.json").is_file() {
        assert!(begun.elapsed() < Duration::from_secs(120), "no row is written");
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    let told = ends(&desk, "merge out", 3);
    assert!(told.contains("missing: fleet/m2"), "{told}");
    let row = || std::fs::read(folder_of(&desk, "out", "m1").join("row.json")).unwrap();
    let first = row();
    let said = ends(&desk, &words.join(" "), 0);
    assert!(said.contains("1 of them kept from before"), "{said}");
    // The time in it tells that it was not made again.
    assert_eq!(row(), first);
    let table = ends(&desk, "merge out", 0);
    assert!(table.contains("coulomb-friction at "), "{table}");
    // The files are those of `lpv diagnose`.
    desk.judged("diagnose fleet/m2 -o alone/m2");
    let theirs = std::fs::read(folder_of(&desk, "out", "m2").join("diagnosis.json")).unwrap();
    assert_eq!(theirs, desk.bytes("alone/m2/diagnosis.json"));
}

#[test]
#[cfg(unix)]
fn ctrl_c_between_two_bundles_says_that_rows_stay() {
    let desk = desk(2);
    let words = ["fleet", "fleet/m1", "fleet/m2", "-o", "out"];
    let child = desk
        .program(&words)
        .stderr(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    while !folder_of(&desk, "out", "m1").join("row.json").is_file() {
        std::thread::sleep(Duration::from_millis(2));
    }
    signal(&child, "-INT");
    let out = child.wait_with_output().unwrap();
    let message = String::from_utf8(out.stderr).unwrap();
    assert_eq!(out.status.code(), Some(130), "{message}");
    assert!(message.contains("what was finished stays"), "{message}");
}

#[test]
fn what_is_wrong_is_said_before_the_work() {
    let desk = Desk::new();
    desk.write("table.csv", "a,b\n1,2\n");
    for (line, part) in [
        ("fleet a b -o out --shard 3/2", "k/N"),
        ("fleet a a -o out", "named twice"),
        ("fleet a -o out --config settings.toml", "--task identify"),
        ("fleet a -o out --task identify --model m.json", "--task diagnose"),
        ("merge nothing", "fleet.json"),
        ("merge nothing -o table.txt", ".json or .csv"),
        ("merge nothing -o table.csv", "which is no table of `lpv merge`"),
    ] {
        let message = desk.refused(line);
        assert!(message.contains(part), "{line}: {message}");
    }
    assert_eq!(desk.files().len(), 1);
}
