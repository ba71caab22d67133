//! The walkthrough of docs/tutorial.md does what it says: its commands run in an empty folder, and the output that it shows is
//! the output. A line of it that ends in three dots shows how the program's line begins.

use std::path::Path;
use std::process::Command;

/// Fenced blocks of a page in order: their language and their text.
fn blocks(page: &str) -> Vec<(String, String)> {
    let mut found = Vec::new();
    let mut open: Option<(String, String)> = None;
    for line in page.lines() {
        match (line.strip_prefix("```"), &mut open) {
            (Some(language), None) => open = Some((language.to_owned(), String::new())),
            (Some(_), Some(_)) => found.extend(open.take()),
            (None, Some((_, text))) => {
                text.push_str(line);
                text.push('\n');
            }
            (None, None) => {}
        }
    }
    found
}

#[test]
fn every_command_runs_and_says_what_the_page_says() {
    let page = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/tutorial.md"))
        .unwrap();
    let folder = tempfile::tempdir().unwrap();
    let program = Path::new(env!("CARGO_BIN_EXE_lpv"));
    let path = format!(
        "{}:{}",
        program.parent().unwrap().display(),
        std::env::var("PATH").unwrap()
    );
    let mut output = String::new();
    let (mut commands, mut shown) = (0, 0);
    for (language, text) in blocks(&page) {
        match language.as_str() {
            "sh" => {
                let Ok(run) = Command::new("bash")
                    .args(["-e", "-o", "pipefail", "-c", &text])
                    .current_dir(folder.path())
                    .env("PATH", &path)
                    .output()
                else {
                    eprintln!("skipped: there is no bash to run the tutorial with");
                    return;
                };
                let errors = String::from_utf8_lossy(&run.stderr);
                assert!(run.status.success(), "{text}\n{errors}");
                assert!(errors.is_empty(), "{text}\n{errors}");
                output = String::from_utf8(run.stdout).unwrap();
                commands += text.lines().filter(|l| l.starts_with("lpv ")).count();
            }
            "text" => {
                for line in text.lines() {
                    let is_shown = |said: &str| match line.strip_suffix("...") {
                        Some(start) => said.starts_with(start),
                        None => said.trim_end() == line,
                    };
                    assert!(
                        output.lines().any(is_shown),
                        "the page shows\n{line}\nthe program says\n{output}"
                    );
                    shown += 1;
                }
            }
            _ => {}
        }
    }
    assert!(
        commands >= 12 && shown >= 12,
        "{commands} commands, {shown} lines"
    );
    for file in [
        "axis.json",
        "axis.mat",
        "table.json",
        "table.mat",
        "table.py",
        "report.html",
    ] {
        let size = std::fs::metadata(folder.path().join("result").join(file))
            .unwrap()
            .len();
        assert!(size > 1000, "{file}: {size} bytes");
    }
}
