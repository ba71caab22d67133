//! Nothing of the user's is destroyed: no result replaces what is read, nor what is no result, and nothing is left half written.

use crate::common::{Desk, machine_bundle, message_of, mode_bundle};
use std::path::Path;

/// A bundle of the mode, and its model.
fn identified(desk: &Desk) {
    mode_bundle(desk, "axis");
    desk.done("identify axis -o result/model.json");
}

/// Runs a line that is refused, and changes no file.
fn untouched(desk: &Desk, line: &str) -> String {
    let before = desk.files();
    let message = desk.refused(line);
    assert!(before == desk.files(), "lpv {line} changed files");
    message
}

#[test]
fn no_result_replaces_what_is_read() {
    let desk = Desk::new();
    identified(&desk);
    desk.write("settings.toml", "order = 2\n");
    for force in ["", " --force"] {
        for (line, what) in [
            ("identify axis -o axis/run.csv", "records[0]"),
            ("identify axis -o ./axis/../axis/run.csv", "records[0]"),
            ("identify axis -o axis/experiment.toml", "description"),
            ("identify axis -c settings.toml -o settings.toml", "settings"),
            ("convert result/model.json --to csv -o axis/run.csv", "records[0]"),
            ("convert result/model.json --to json", "a model"),
            ("report result -o result/model.json", "a model"),
            ("report result/model.json -o result/model.json", "a model"),
            ("report result -o axis/run.csv", "records[0]"),
            (
                "report result --bundle axis -o axis/experiment.toml",
                "description",
            ),
        ] {
            let message = untouched(&desk, &format!("{line}{force}"));
            assert!(
                message.contains(what) && message.contains("--output"),
                "{line}: {message}"
            );
        }
    }
}

#[test]
#[cfg(unix)]
fn links_lead_to_the_same_file() {
    let desk = Desk::new();
    identified(&desk);
    std::os::unix::fs::symlink("axis/run.csv", desk.path("soft")).unwrap();
    std::fs::hard_link(desk.path("axis/run.csv"), desk.path("hard")).unwrap();
    std::os::unix::fs::symlink("axis", desk.path("way")).unwrap();
    for name in ["soft", "hard", "way/run.csv"] {
        let message = untouched(&desk, &format!("identify axis -o {name} --force"));
        assert!(message.contains("records[0]"), "{message}");
    }
    // A link to a result, or to nothing, is followed and stays.
    std::os::unix::fs::symlink("result/model.json", desk.path("latest.json")).unwrap();
    std::os::unix::fs::symlink("result/new.json", desk.path("next.json")).unwrap();
    for (name, target) in [
        ("latest.json", "result/model.json"),
        ("next.json", "result/new.json"),
    ] {
        let told = desk.done(&format!("identify axis -o {name} --seed 5"));
        assert!(told.contains(name), "{told}");
        assert_eq!(std::fs::read_link(desk.path(name)).unwrap(), Path::new(target));
        assert!(desk.text(target).contains("\"seed\": 5"));
    }
    // A second name of a result would keep the old content: refused, and cut only by force.
    std::fs::hard_link(desk.path("result/model.json"), desk.path("kept.json")).unwrap();
    let message = untouched(&desk, "identify axis -o result/model.json");
    assert!(message.contains("hard link"), "{message}");
    let kept = desk.bytes("kept.json");
    desk.done("identify axis -o result/model.json --seed 6 --force");
    assert_eq!(desk.bytes("kept.json"), kept);
}

#[test]
fn a_file_that_is_no_result_stays() {
    let desk = Desk::new();
    identified(&desk);
    desk.write("result/model.csv", "t,u,y\n0,1,2\n");
    desk.write("result/model.py", "print('mine')\n");
    desk.write(
        "result/model.mat",
        b"MATLAB 5.0 MAT-file, Platform: GLNXA64".repeat(9),
    );
    desk.write("result/report.html", "<!DOCTYPE html><title>mine</title>");
    desk.write("notes.json", "{\"verdict\": \"fine\"}");
    desk.write("notes.bin", [0_u8, 159, 146, 150]);
    for (line, what) in [
        ("convert result/model.json --to csv", "begins with `t,u,y`"),
        (
            "convert result/model.json --to python",
            "begins with `print('mine')`",
        ),
        ("convert result/model.json --to mat", "a MATLAB file"),
        ("report result", "a page"),
        ("report result/model.json", "a page"),
        ("identify axis -o notes.json", "a JSON file"),
        ("identify axis -o notes.bin", "another program"),
        ("identify axis -o result/report.html", "a page"),
        // A result, but of another kind.
        ("report result -o result/model.csv", "begins with"),
        (
            "convert result/model.json --to python -o result/report.html",
            "a page",
        ),
    ] {
        let message = untouched(&desk, line);
        assert!(
            message.contains(what) && message.contains("--output") && message.contains("--force"),
            "{line}: {message}"
        );
    }
    for (line, file) in [
        ("convert result/model.json --to csv", "result/model.csv"),
        ("convert result/model.json --to python", "result/model.py"),
        ("convert result/model.json --to mat", "result/model.mat"),
        ("report result", "result/report.html"),
        ("identify axis -o notes.json", "notes.json"),
    ] {
        let before = desk.bytes(file);
        desk.done(&format!("{line} --force"));
        assert_ne!(desk.bytes(file), before, "{line}");
        // Its own result is replaced without a question.
        desk.done(line);
    }
    // An empty file is nobody's.
    desk.write("empty.json", "");
    desk.done("identify axis -o empty.json");
}

#[test]
fn a_diagnosis_replaces_no_model_from_elsewhere() {
    let desk = Desk::new();
    machine_bundle(&desk);
    desk.done("identify bundle -o out/model.json");
    let with_model = untouched(&desk, "diagnose bundle --model out/model.json -o out");
    assert!(
        with_model.contains("out/model.json") && with_model.contains("the model"),
        "{with_model}"
    );
    let forced = untouched(&desk, "diagnose bundle --model out/model.json -o out --force");
    assert!(forced.contains("the model"), "{forced}");
    let without = untouched(&desk, "diagnose bundle -o out");
    assert!(without.contains("a model stands there"), "{without}");
    desk.done("diagnose bundle -o found");
    // Its own results it replaces.
    desk.done("diagnose bundle -o found");
    assert_eq!(desk.files().keys().filter(|f| f.starts_with("found")).count(), 3);
}

#[test]
#[cfg(unix)]
fn permissions_stay() {
    use std::os::unix::fs::PermissionsExt;
    let desk = Desk::new();
    identified(&desk);
    let file = desk.path("result/model.json");
    let mode = |file: &Path| std::fs::metadata(file).unwrap().permissions().mode() & 0o7777;
    for kept in [0o600, 0o640, 0o777] {
        std::fs::set_permissions(&file, std::fs::Permissions::from_mode(kept)).unwrap();
        desk.done("identify axis -o result/model.json");
        assert_eq!(mode(&file), kept);
    }
    // A new file has what others have.
    desk.write("other", "");
    desk.done("identify axis -o fresh.json");
    assert_eq!(mode(&desk.path("fresh.json")), mode(&desk.path("other")));
    std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o444)).unwrap();
    let message = untouched(&desk, "identify axis -o result/model.json");
    assert!(message.contains("write-protected"), "{message}");
}

#[test]
fn places_are_tried_before_the_work() {
    let desk = Desk::new();
    identified(&desk);
    desk.write("file", "x");
    // The records are broken: whoever complains about the place has looked at it first.
    desk.write("axis/run.csv", "u,y\n1,nan\n");
    let long = "n".repeat(256) + ".json";
    for place in [
        "file/model.json".to_owned(),
        "axis".to_owned(),
        format!("new/{long}"),
        long.clone(),
    ] {
        let message = untouched(&desk, &format!("identify axis -o {place}"));
        assert!(!message.contains("nan") && message.contains(&place), "{message}");
    }
    assert!(!desk.path("new").exists());
    // What leads nowhere leaves no folder.
    untouched(&desk, "identify axis -o some/where/model.json");
    assert!(!desk.path("some").exists());
}

#[test]
fn the_longest_name_is_written() {
    let desk = Desk::new();
    mode_bundle(&desk, "axis");
    let name = "n".repeat(250) + ".json";
    desk.done(&format!("identify axis -o {name}"));
    assert!(desk.path(&name).is_file());
    assert_eq!(desk.files().len(), 3);
}

#[test]
#[cfg(unix)]
fn paths_that_are_no_text_work() {
    use std::os::unix::ffi::OsStringExt;
    let desk = Desk::new();
    mode_bundle(&desk, "axis");
    let odd = |name: &[u8]| std::ffi::OsString::from_vec(name.to_vec());
    let bundle = odd(b"b\xff");
    std::fs::rename(desk.path("axis"), desk.path("").join(&bundle)).unwrap();
    let run = |words: &[&std::ffi::OsStr]| {
        let out = desk.program(words).output().unwrap();
        assert_eq!(
            out.status.code(),
            Some(0),
            "{words:?}: {}",
            String::from_utf8_lossy(&out.stderr)
        );
        assert!(out.stderr.is_empty());
    };
    let (model, folder) = (odd(b"r\xfe/m\xff.json"), odd(b"r\xfe"));
    let (page, found, record) = (odd(b"r\xfe/p\xff.html"), odd(b"s\xff"), odd(b"b\xff/run.csv"));
    run(&["inspect".as_ref(), &bundle]);
    run(&["identify".as_ref(), &bundle, "-o".as_ref(), &model]);
    run(&["validate".as_ref(), &model, &bundle, "--all".as_ref()]);
    run(&["convert".as_ref(), &model, "--to".as_ref(), "python".as_ref()]);
    run(&["report".as_ref(), &folder, "-o".as_ref(), &page]);
    let html = std::fs::read_to_string(desk.path("").join(&page)).unwrap();
    assert!(
        !html.contains("Without measurements"),
        "the bundle was found again"
    );
    for words in [
        ["new", "--sample-rate=10", "--force", "--json"].map(std::ffi::OsStr::new),
        ["new", "--sample-rate=10", "--force", "--name=x"].map(std::ffi::OsStr::new),
    ] {
        run(&[&words[..], &[&record]].concat());
    }
    desk.write("machine.toml", crate::common::MACHINE);
    run(&["simulate", "--machine", "machine.toml", "--json", "-o"]
        .map(std::ffi::OsStr::new)
        .iter()
        .copied()
        .chain([found.as_os_str()])
        .collect::<Vec<_>>());
    // A description is text, so that it cannot name such a file.
    let unnameable = odd(b"run\xff.csv");
    std::fs::copy(desk.path("").join(&record), desk.path("").join(&unnameable)).unwrap();
    let out = desk
        .program(&[std::ffi::OsStr::new("new"), &unnameable])
        .output()
        .unwrap();
    let message = message_of("new", &out);
    assert!(message.contains("rename the file"), "{message}");
    assert!(!desk.path("experiment.toml").exists());
}

#[test]
#[cfg(target_os = "linux")]
fn streams_that_cannot_be_written_are_no_panic() {
    let desk = Desk::new();
    mode_bundle(&desk, "axis");
    let full = || std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let code = |words: &[&str], out: bool| {
        let mut command = desk.program(words);
        match out {
            true => command.stdout(full()),
            false => command.stderr(full()),
        };
        command.output().unwrap().status.code()
    };
    assert_eq!(code(&["inspect", "nothing"], false), Some(2));
    assert_eq!(code(&["inspekt"], false), Some(2));
    for words in [&["inspect", "axis"][..], &["--help"], &["--version"], &["schema"]] {
        assert_eq!(code(words, true), Some(1), "{words:?}");
        assert_eq!(code(words, false), Some(0), "{words:?}");
    }
    // A device in the place of a result is written to.
    assert_eq!(code(&["identify", "axis", "-o", "/dev/full"], false), Some(1));
    desk.done("identify axis -o /dev/null");
    let told = desk.done("identify axis -o /dev/stdout");
    assert!(told.starts_with('{') && told.contains("lpv-model"), "{told}");
    assert!(Path::new("/dev/null").exists() && Path::new("/dev/full").exists());
}

#[test]
fn a_bundle_takes_its_place_at_once() {
    let desk = Desk::new();
    machine_bundle(&desk);
    let bundle = desk.files();
    assert!(bundle.keys().all(|f| !f.to_string_lossy().contains(".part")));
    // What a killed run left behind does not disturb the next.
    desk.write("again/.lpv-1-0.part/lock", "");
    desk.write("again/.lpv-1-0.part/records/grid00a.npz", "torn");
    desk.write("again/machine.toml", crate::common::MACHINE);
    desk.done("simulate --machine again/machine.toml -o again");
    let same = |name: &str| desk.bytes(&format!("bundle/{name}")) == desk.bytes(&format!("again/{name}"));
    assert!(same("experiment.toml") && same("records/move1.npz"));
    assert_eq!(desk.files().len(), 2 * bundle.len());
    // A file in the place of the folder.
    desk.write("taken", "x");
    untouched(&desk, "simulate --machine machine.toml -o taken");
    untouched(&desk, "simulate --machine machine.toml -o taken/below");
}
