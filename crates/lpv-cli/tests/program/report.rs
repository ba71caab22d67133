//! `lpv report`: one page for a folder of models.

use crate::common::{Desk, machine_bundle, mode_bundle};

#[test]
fn the_page_has_its_sections_and_needs_nothing_else() {
    let desk = Desk::new();
    machine_bundle(&desk);
    desk.done("identify bundle -o result/model.json");
    desk.write("result/notes.json", "{\"not\": \"a model\"}");
    let said = desk.done("report result");
    assert!(said.contains("report.html"), "{said}");
    let page = desk.text("result/report.html");
    assert!(page.starts_with("<!DOCTYPE html>") || page.starts_with("<!doctype html>"));
    for part in [
        "model.json",
        "Choices",
        "Frequency responses",
        "Poles",
        "Coefficient functions",
        "Errors in time",
        "Time responses",
        "move1",
        "<svg",
    ] {
        assert!(page.contains(part), "{part} is not on the page");
    }
    assert!(
        !page.contains("<script ")
            && !page.contains("http-equiv=\"refresh\"")
            && !page.contains("notes.json")
    );
    // The same input gives the same bytes.
    desk.done("report result -o other/page.html");
    assert_eq!(page, desk.text("other/page.html"));
}

#[test]
fn a_folder_that_moved_with_its_bundle_still_finds_it() {
    let desk = Desk::new();
    mode_bundle(&desk, "one/bundle");
    desk.done("identify one/bundle -o one/result/model.json");
    std::fs::rename(desk.path("one"), desk.path("two")).unwrap();
    desk.done("report two/result");
    assert!(
        !desk
            .text("two/result/report.html")
            .contains("Without measurements")
    );
}

#[test]
fn without_the_bundle_the_page_says_so() {
    let desk = Desk::new();
    mode_bundle(&desk, "bundle");
    desk.done("identify bundle -o result/model.json");
    std::fs::rename(desk.path("bundle"), desk.path("elsewhere")).unwrap();
    desk.done("report result");
    let page = desk.text("result/report.html");
    assert!(
        page.contains("Without measurements")
            && page.contains("--bundle")
            && page.contains("Frequency responses")
    );
    desk.done("report result --bundle elsewhere");
    assert!(!desk.text("result/report.html").contains("Without measurements"));
    // A bundle that the user names must be there.
    let message = desk.refused("report result --bundle bundle -o page.html");
    assert!(
        message.contains("bundle") && !desk.path("page.html").exists(),
        "{message}"
    );
}

#[test]
fn every_model_of_a_folder_is_on_the_page() {
    let desk = Desk::new();
    mode_bundle(&desk, "bundle");
    desk.done("identify bundle -o result/a.json");
    desk.done("identify bundle -o result/b.json");
    desk.done("report result");
    let page = desk.text("result/report.html");
    assert!(page.contains("a.json") && page.contains("b.json"));
}

#[test]
fn a_folder_without_a_model_is_refused() {
    let desk = Desk::new();
    desk.write("result/notes.txt", "nothing");
    let message = desk.refused("report result");
    assert!(
        message.contains("result") && message.contains("lpv identify"),
        "{message}"
    );
    assert!(desk.refused("report nowhere").contains("nowhere"));
    desk.write("result/model.json", "{\"format\": \"lpv-model\", ");
    assert!(desk.refused("report result").contains("model.json"));
    assert!(!desk.path("result/report.html").exists());
}
