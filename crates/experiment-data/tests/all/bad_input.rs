//! Every broken bundle is refused with its message, and docs/bad-input.md shows them all.
use crate::broken::{Case, cases, first_error};
use experiment_data::Bundle;
use std::path::Path;

/// What the reader says, with `bundle` for the folder.
fn message(case: &Case) -> String {
    let dir = tempfile::tempdir().unwrap();
    (case.build)(dir.path());
    let text = first_error(dir.path()).unwrap_or_else(|| panic!("{} is not refused", case.name));
    text.replace(&dir.path().display().to_string(), "bundle")
}

#[test]
fn the_bundle_that_is_broken_was_correct() {
    let dir = tempfile::tempdir().unwrap();
    crate::broken::small::write(dir.path());
    assert_eq!(first_error(dir.path()), None);
}

#[test]
fn each_is_refused_soon_with_its_message() {
    let mut wrong = Vec::new();
    for case in cases() {
        let start = std::time::Instant::now();
        let text = message(&case);
        for part in case.message.iter().filter(|part| !text.contains(**part)) {
            wrong.push(format!("{}: {part} expected in {text}", case.name));
        }
        assert!(start.elapsed().as_secs() < 2, "{}", case.name);
        let named =
            text.contains("experiment.toml") || text.contains("(records[") || case.name == "folder-empty";
        if !named || text.contains('\n') {
            wrong.push(format!("{}: no file, or many lines, in {text}", case.name));
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// A period at a time, a record is refused for the same reason.
#[test]
fn records_in_parts_are_refused_alike() {
    let mut refused = 0;
    for case in cases() {
        let dir = tempfile::tempdir().unwrap();
        (case.build)(dir.path());
        let Ok(bundle) = Bundle::open(dir.path()) else {
            continue;
        };
        for i in 0..bundle.len() {
            let text = |e: experiment_data::DataError| e.to_string();
            let (whole, parts) = (bundle.load(i), bundle.each_period(i, |_| ()));
            refused += usize::from(whole.is_err());
            let position = whole.map(|record| record.position);
            assert_eq!(position.map_err(text), parts.map_err(text), "{}", case.name);
        }
    }
    assert!(refused > 40, "{refused}");
}

#[test]
fn the_page_is_up_to_date() {
    let page = page();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/bad-input.md");
    if std::env::var_os("RENEW_DOCS").is_some() {
        std::fs::write(&path, &page).unwrap();
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        committed == page,
        "docs/bad-input.md is not what the crate says; renew it with\n\
         RENEW_DOCS=1 cargo test -p experiment-data --test all bad_input"
    );
}

fn page() -> String {
    let all = cases();
    let mut page = format!(
        "# What is said about bad input\n\n\
         {} broken bundles and the message for each, with `bundle` for the folder. The bundles are built in\n\
         `crates/experiment-data/tests/all/broken`; a test holds this page against them. It is renewed by\n\
         `RENEW_DOCS=1 cargo test -p experiment-data --test all bad_input`.\n",
        all.len()
    );
    let mut part = "";
    let mut names: Vec<&str> = Vec::new();
    for case in &all {
        assert!(!names.contains(&case.name), "{} twice", case.name);
        names.push(case.name);
        if case.part != part {
            part = case.part;
            page += &format!("\n## {part}\n\n");
        }
        let mut what = case.what.to_owned();
        what[..1].make_ascii_uppercase();
        page += &format!("- {what} (`{}`):\n  `` {} ``\n", case.name, message(case));
    }
    page
}
