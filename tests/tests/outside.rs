//! What a crate outside the workspace can do: the example of each crate's first page compiles in a crate that depends on that crate alone, and
//! the library `lpv` identifies and validates without argument parser, HDF5, Parquet and renderer.

#![allow(
    clippy::unwrap_used,
    reason = "a check that cannot read the workspace must fail"
)]

use lpv_tests::{cargo, output_of, root};
use std::fmt::Write as _;
use std::path::Path;

/// Rust of the first example on a page of documentation, as `cargo test --doc` completes it.
fn first_example(page: &str) -> Option<String> {
    let lines = page
        .lines()
        .filter_map(|l| l.strip_prefix("//!"))
        .map(|l| l.strip_prefix(' ').unwrap_or(l));
    let mut inside: Option<bool> = None;
    let mut code = String::new();
    for line in lines {
        match (inside, line.trim_end()) {
            (None, "```" | "```no_run") => inside = Some(true),
            (None, other) if other.starts_with("```") => inside = Some(false),
            (Some(true), "```") => break,
            (Some(false), "```") => inside = None,
            (Some(true), line) => writeln!(code, "{}", line.strip_prefix("# ").unwrap_or(line)).unwrap(),
            _ => {}
        }
    }
    if code.contains("fn main(") {
        return Some(code);
    }
    let Some(end) = code.rfind("Ok::<(), ") else {
        return (!code.is_empty()).then(|| format!("fn main() {{\n{code}}}\n"));
    };
    let error = code[end..]
        .strip_prefix("Ok::<(), ")?
        .split(">(())")
        .next()?
        .to_owned();
    code.truncate(end);
    Some(format!("fn main() -> Result<(), {error}> {{\n{code}Ok(())\n}}\n"))
}

/// A workspace with one package for each source, each of which depends on one crate.
fn write(folder: &Path, packages: &[(String, String, String)]) {
    let mut members = String::new();
    for (name, dependency, source) in packages {
        let package = folder.join(name);
        std::fs::create_dir_all(package.join("src")).unwrap();
        std::fs::write(package.join("src/main.rs"), source).unwrap();
        let manifest =
            format!("[package]\nname = \"{name}\"\nedition = \"2024\"\n\n[dependencies]\n{dependency}\n");
        std::fs::write(package.join("Cargo.toml"), manifest).unwrap();
        write!(members, "\"{name}\",").unwrap();
    }
    let manifest = format!("[workspace]\nresolver = \"3\"\nmembers = [{members}]\n");
    std::fs::write(folder.join("Cargo.toml"), manifest).unwrap();
    std::fs::copy(root().join("Cargo.lock"), folder.join("Cargo.lock")).unwrap();
}

/// What cargo writes in a folder, with what it builds kept apart from the workspace.
fn cargo_in(folder: &Path, arguments: &[&str]) -> String {
    output_of(
        cargo(arguments)
            .current_dir(folder)
            .env("CARGO_TARGET_DIR", root().join("target/outside"))
            .env_remove("RUSTFLAGS"),
    )
}

#[test]
fn first_pages_and_the_library_compile_outside_the_workspace() {
    let folder = tempfile::tempdir().unwrap();
    let mut packages = Vec::new();
    for entry in std::fs::read_dir(root().join("crates")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        let Ok(page) = std::fs::read_to_string(path.join("src/lib.rs")) else {
            continue;
        };
        // An extension of Python has its first page there.
        if path.join("pyproject.toml").is_file() {
            continue;
        }
        let example = first_example(&page);
        assert!(example.is_some(), "the first page of {name} has no example");
        let dependency = format!("{name} = {{ path = {path:?}, default-features = false }}");
        packages.push((format!("outside-{name}"), dependency, example.unwrap()));
    }
    assert!(packages.len() > 10);
    let lpv = root().join("crates/lpv");
    let library = std::fs::read_to_string(lpv.join("examples/library.rs")).unwrap();
    let lines = library
        .lines()
        .filter(|l| !l.trim().is_empty() && !l.trim().starts_with("//"))
        .count();
    assert!(lines <= 40, "{lines} lines");
    let dependency = format!("lpv = {{ path = {lpv:?}, default-features = false }}");
    packages.push(("library".to_owned(), dependency, library));
    write(folder.path(), &packages);
    cargo_in(folder.path(), &["check", "--workspace"]);
    let tree = cargo_in(
        folder.path(),
        &["tree", "-p", "library", "--prefix", "none", "-e", "normal"],
    );
    for heavy in ["clap", "hdf5-pure", "parquet", "resvg", "indicatif"] {
        assert!(
            !tree.lines().any(|l| l.starts_with(&format!("{heavy} "))),
            "{heavy} in\n{tree}"
        );
    }
}
