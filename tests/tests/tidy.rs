//! What the compiler does not hold: the map of the crates, the front door of each, and the texts.
//!
//! Every check gathers all that is wrong before it fails, so that one run shows the whole list.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "a check that cannot read the workspace must fail"
)]

use cargo_metadata::{DependencyKind, Metadata, MetadataCommand, Package};
use lpv_tests::{cargo, output_of, root};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Longest source file of a crate, in lines.
const MOST_LINES: usize = 400;

/// Files that may be longer, and why.
const LONG_FILES: [(&str, &str); 1] = [(
    "crates/lpv/src/finding.rs",
    "one enum: what can be found in data, each with its fields and its sentence",
)];

/// Effects that are found and that the simulated table cannot hide, and why.
const NOT_HIDDEN: [(&str, &str); 9] = [
    (
        "direction-dependent-friction",
        "hidden as dry friction beside a constant force",
    ),
    (
        "position-force",
        "looked for on axes without a known controller; the table is simulated with its own",
    ),
    (
        "input-gain",
        "looked for on servo axes alone; `xytable_plant::servo_axis` hides it",
    ),
    (
        "stiffness-drift",
        "looked for on servo axes alone; `xytable_plant::servo_axis` hides it",
    ),
    (
        "quadratic-friction",
        "looked for on servo axes alone; `xytable_plant::servo_axis` hides it",
    ),
    (
        "gravity",
        "looked for on servo axes alone; `xytable_plant::servo_axis` hides it",
    ),
    (
        "temperature",
        "looked for on servo axes alone; `xytable_plant::servo_axis` hides it",
    ),
    (
        "friction-drift",
        "looked for on servo axes alone; `xytable_plant::servo_axis` hides it",
    ),
    (
        "load-dependent-friction",
        "looked for on servo axes alone; `xytable_plant::servo_axis` hides it",
    ),
];

/// Largest file of the repository, in bytes: data sets are generated, not stored.
const MOST_BYTES: u64 = 100_000;

/// Headings of the paragraph in which a crate says what it leaves out.
const REFUSALS: [&str; 3] = [
    "//! # What it does not do",
    "//! # What this crate does not do",
    "//! # What is not here",
];

/// Public hosts that a text may point to. Everything else, above all the host of a private registry, stays out.
const HOSTS: [&str; 8] = [
    "doi.org",
    "github.com",
    "docs.rs",
    "crates.io",
    "doc.rust-lang.org",
    "www.rust-lang.org",
    "www.w3.org",
    "www.apache.org",
];

fn metadata() -> Metadata {
    MetadataCommand::new()
        .manifest_path(root().join("Cargo.toml"))
        .no_deps()
        .other_options(["--offline".to_string()])
        .exec()
        .unwrap()
}

fn folder(package: &Package) -> PathBuf {
    package
        .manifest_path
        .parent()
        .unwrap()
        .as_std_path()
        .to_path_buf()
}

/// The library crates and the task runner: all packages but those that only hold tests and benches.
fn mapped(metadata: &Metadata) -> Vec<&Package> {
    let root = root();
    metadata
        .packages
        .iter()
        .filter(|p| {
            let folder = folder(p);
            folder.parent() == Some(root.join("crates").as_path()) || folder == root.join("xtask")
        })
        .collect()
}

/// Those that other crates can link. An extension of another language has its door there.
fn library_crates(metadata: &Metadata) -> Vec<&Package> {
    let is_extension = |p: &Package| {
        let mut kinds = p.targets.iter().flat_map(|t| &t.kind);
        kinds.any(|kind| kind.to_string() == "cdylib")
    };
    mapped(metadata)
        .into_iter()
        .filter(|p| folder(p).join("src/lib.rs").is_file() && !is_extension(p))
        .collect()
}

/// Every file of the repository that is not ignored, relative to its root.
fn files() -> Vec<PathBuf> {
    let listed = Command::new("git")
        .args(["ls-files", "-z", "--cached", "--others", "--exclude-standard"])
        .current_dir(root())
        .output();
    let mut files: Vec<PathBuf> = match listed {
        Ok(o) if o.status.success() => o
            .stdout
            .split(|&b| b == 0)
            .filter(|name| !name.is_empty())
            .map(|name| PathBuf::from(String::from_utf8_lossy(name).into_owned()))
            .collect(),
        // A source archive has no index; then everything but build products counts.
        _ => {
            let mut all = Vec::new();
            walk(&root(), &mut all);
            all.iter()
                .map(|f| f.strip_prefix(root()).unwrap().to_path_buf())
                .collect()
        }
    };
    files.retain(|f| root().join(f).is_file());
    assert!(files.len() > 50, "only {} files found", files.len());
    files
}

fn walk(folder: &Path, into: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let skipped = path
            .file_name()
            .is_some_and(|n| n == "target" || n == ".git" || n == "results");
        if path.is_dir() && !skipped {
            walk(&path, into);
        } else if path.is_file() {
            into.push(path);
        }
    }
}

fn read(relative: impl AsRef<Path>) -> String {
    let path = root().join(relative);
    let bytes = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    String::from_utf8_lossy(&bytes).into_owned()
}

fn has_extension(file: &Path, extension: &str) -> bool {
    file.extension().is_some_and(|e| e == extension)
}

fn none(wrong: &[String]) {
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// The lines `crate: dependency dependency` of the fence `dag` in the architecture page, in their order.
fn map() -> Vec<(String, BTreeSet<String>)> {
    let page = read("docs/architecture.md");
    let fence = page
        .split("```dag\n")
        .nth(1)
        .unwrap_or_else(|| panic!("no fence `dag`"));
    let body = fence.split("```").next().unwrap_or_default();
    body.lines()
        .map(|line| {
            let (name, dependencies) = line.split_once(':').unwrap_or_else(|| panic!("no colon: {line}"));
            let dependencies = dependencies.split_whitespace().map(str::to_string).collect();
            (name.trim().to_string(), dependencies)
        })
        .collect()
}

#[test]
fn the_map_of_the_crates_is_the_one_that_cargo_sees() {
    let metadata = metadata();
    let ours: BTreeSet<&str> = metadata.packages.iter().map(|p| p.name.as_str()).collect();
    let real: BTreeMap<String, BTreeSet<String>> = mapped(&metadata)
        .into_iter()
        .map(|p| {
            let normal = p
                .dependencies
                .iter()
                .filter(|d| d.kind == DependencyKind::Normal && ours.contains(d.name.as_str()))
                .map(|d| d.name.to_string())
                .collect();
            (p.name.to_string(), normal)
        })
        .collect();
    let drawn = map();
    let mut wrong = Vec::new();
    let mut above = BTreeSet::new();
    for (name, dependencies) in &drawn {
        wrong.extend(
            dependencies
                .difference(&above)
                .map(|d| format!("{name} stands above {d}, which it depends on")),
        );
        above.insert(name.clone());
        match real.get(name) {
            None => wrong.push(format!("{name} is on the map, but not in the workspace")),
            Some(found) if found != dependencies => {
                wrong.push(format!(
                    "{name}: the map says {dependencies:?}, cargo says {found:?}"
                ));
            }
            Some(_) => {}
        }
    }
    wrong.extend(
        real.keys()
            .filter(|name| !above.contains(*name))
            .map(|name| format!("{name} is not on the map")),
    );
    let text = read("docs/architecture.md");
    wrong.extend(
        real.keys()
            .filter(|name| !text.contains(&format!("**{name}**")))
            .map(|name| format!("{name} has no paragraph in docs/architecture.md")),
    );
    none(&wrong);
}

/// Of the facade only what simulates bundles may know the simulated machine.
#[test]
fn the_pipeline_does_not_know_the_machine() {
    let allowed = ["simulate.rs", "simulate/", "error.rs"];
    let source = Path::new("crates/lpv/src");
    let wrong: Vec<String> = files()
        .into_iter()
        .filter_map(|f| f.strip_prefix(source).ok().map(Path::to_path_buf))
        .filter(|f| !allowed.iter().any(|a| f.starts_with(a)))
        .filter(|f| read(source.join(f)).contains("xytable_plant"))
        .map(|f| format!("{} names xytable_plant", f.display()))
        .collect();
    none(&wrong);
}

#[test]
fn manifests_share_lints_and_keep_the_default_bench_harness_out() {
    let mut wrong = Vec::new();
    for package in &metadata().packages {
        let manifest: toml::Table = std::fs::read_to_string(&package.manifest_path)
            .unwrap()
            .parse()
            .unwrap();
        let name = package.name.as_str();
        let flag = |value: Option<&toml::Value>, key: &str| {
            value.and_then(|t| t.get(key)).and_then(toml::Value::as_bool)
        };
        if flag(manifest.get("lints"), "workspace") != Some(true) {
            wrong.push(format!("{name}: [lints] workspace = true is missing"));
        }
        let source = folder(package).join("src");
        if source.join("lib.rs").is_file() && flag(manifest.get("lib"), "bench") != Some(false) {
            wrong.push(format!("{name}: [lib] bench = false is missing"));
        }
        let programs = manifest
            .get("bin")
            .and_then(toml::Value::as_array)
            .cloned()
            .unwrap_or_default();
        if source.join("main.rs").is_file() && programs.is_empty() {
            wrong.push(format!("{name}: [[bin]] bench = false is missing"));
        }
        if programs.iter().any(|b| flag(Some(b), "bench") != Some(false)) {
            wrong.push(format!("{name}: a [[bin]] without bench = false"));
        }
    }
    none(&wrong);
}

#[test]
fn every_library_has_a_front_door() {
    let mut wrong = Vec::new();
    for package in library_crates(&metadata()) {
        let (name, folder) = (package.name.as_str(), folder(package));
        let text = std::fs::read_to_string(folder.join("src/lib.rs")).unwrap();
        let documentation: Vec<&str> = text.lines().filter(|l| l.starts_with("//!")).collect();
        // Fences come in pairs; the first of a pair says whether the block is run.
        let opened: Vec<&str> = documentation
            .iter()
            .filter_map(|l| l.strip_prefix("//! ```"))
            .step_by(2)
            .collect();
        if !opened.iter().any(|info| info.is_empty() || *info == "rust") {
            wrong.push(format!("{name}: no doctest in src/lib.rs"));
        }
        let Some(at) = documentation.iter().position(|l| REFUSALS.contains(l)) else {
            wrong.push(format!(
                "{name}: no paragraph `# What it does not do` in src/lib.rs"
            ));
            continue;
        };
        let words: usize = documentation[at + 1..]
            .iter()
            .take_while(|l| !l.starts_with("//! #"))
            .map(|l| l.split_whitespace().count() - 1)
            .sum();
        if words < 20 {
            wrong.push(format!("{name}: `# What it does not do` says nothing"));
        }
        let examples = std::fs::read_dir(folder.join("examples")).into_iter().flatten();
        if !examples.flatten().any(|e| has_extension(&e.path(), "rs")) {
            wrong.push(format!("{name}: no program in examples/"));
        }
    }
    none(&wrong);
}

#[test]
fn the_python_package_has_a_front_door() {
    let package = Path::new("crates/lpv-python");
    let text = read(package.join("python/lpvident/__init__.py"));
    let page = text.split("\"\"\"").nth(1).unwrap_or_default();
    let refusal = page.split("What it does not do:").nth(1).unwrap_or_default();
    assert!(
        refusal.split_whitespace().count() >= 20,
        "lpvident: `What it does not do` says nothing"
    );
    let examples = std::fs::read_dir(root().join(package).join("examples"))
        .into_iter()
        .flatten();
    assert!(
        examples.flatten().any(|e| has_extension(&e.path(), "py")),
        "lpvident: no program in examples/"
    );
}

/// Packages with their version and features, by line, as cargo builds them for these arguments.
fn features(of: &[&str]) -> BTreeSet<String> {
    let tree = ["tree", "--locked", "--prefix", "none", "--format", "{p} {f}"];
    let text = output_of(cargo(&tree).args(of));
    text.lines()
        .map(|l| l.trim_end_matches(" (*)").to_owned())
        .collect()
}

#[test]
fn the_wheel_is_built_on_the_crates_of_the_tests() {
    let (all, wheel) = (
        features(&["--workspace"]),
        features(&["-p", "lpv-python", "-e", "no-dev"]),
    );
    assert!(wheel.len() > 50, "{wheel:?}");
    let said = |line: &String| {
        format!("{line}: other features in the tests; crates/lpv-python/Cargo.toml may ask for the same")
    };
    none(&wheel.difference(&all).map(said).collect::<Vec<_>>());
}

#[test]
fn files_are_small() {
    let mut wrong = Vec::new();
    for file in files() {
        let size = std::fs::metadata(root().join(&file)).unwrap().len();
        if size > MOST_BYTES {
            wrong.push(format!("{}: {size} bytes", file.display()));
        }
        let parts: Vec<_> = file.iter().map(|p| p.to_string_lossy()).collect();
        let is_source =
            parts.first().is_some_and(|p| p == "crates") && parts.get(2).is_some_and(|p| p == "src");
        let is_python = parts.get(1).is_some_and(|p| p == "lpv-python") && has_extension(&file, "py");
        if is_source && has_extension(&file, "rs") || is_python {
            let lines = read(&file).lines().count();
            let named = LONG_FILES.iter().any(|(name, _)| file == Path::new(name));
            if lines > MOST_LINES && !named {
                wrong.push(format!("{}: {lines} lines", file.display()));
            }
            if lines <= MOST_LINES && named {
                wrong.push(format!(
                    "{}: {lines} lines, no longer an exception",
                    file.display()
                ));
            }
        }
    }
    none(&wrong);
}

/// What follows `://` up to the end of the host.
fn hosts(text: &str) -> Vec<String> {
    text.split("://")
        .skip(1)
        .map(|rest| {
            rest.chars()
                .take_while(|c| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | ':' | '@'))
                .collect::<String>()
        })
        .map(|host| host.trim_end_matches(['.', ':']).to_string())
        .filter(|host| !host.is_empty())
        .collect()
}

#[test]
fn texts_name_no_machine_and_no_private_host() {
    // In pieces, so that this file passes its own check.
    let folders = [["/wo", "rk/"].concat(), ["/ro", "ot/"].concat()];
    let mut wrong = Vec::new();
    for file in files() {
        let text = read(&file);
        for folder in folders.iter().filter(|f| text.contains(f.as_str())) {
            wrong.push(format!("{}: {folder}", file.display()));
        }
        for host in hosts(&text).iter().filter(|h| !HOSTS.contains(&h.as_str())) {
            wrong.push(format!("{}: host {host}", file.display()));
        }
    }
    let settings = read(".cargo/config.toml");
    for table in ["[source", "[registries", "[registry", "[http"] {
        if settings.contains(table) {
            wrong.push(format!(
                ".cargo/config.toml: {table}] belongs to a machine, not to the repository"
            ));
        }
    }
    none(&wrong);
}

/// The keys in `[toth2011]` or `[toth2009, laub1981]`, brackets escaped or not.
fn citations(line: &str) -> Vec<String> {
    let is_key = |k: &str| {
        let letters = k.chars().take_while(char::is_ascii_lowercase).count();
        let rest = &k[letters..];
        let year = rest
            .get(..4)
            .is_some_and(|y| y.bytes().all(|b| b.is_ascii_digit()));
        letters >= 3 && year && rest[4..].len() <= 1 && rest[4..].bytes().all(|b| b.is_ascii_lowercase())
    };
    line.split('[')
        .skip(1)
        .filter_map(|rest| rest.split(']').next())
        .map(|inside| inside.trim_end_matches('\\'))
        .filter(|inside| inside.is_ascii())
        .map(|inside| inside.split([',', ';']).map(str::trim).collect::<Vec<_>>())
        .filter(|keys| keys.iter().all(|k| is_key(k)))
        .flatten()
        .map(str::to_string)
        .collect()
}

#[test]
fn every_work_cited_is_in_the_list() {
    let mut wrong = Vec::new();
    let mut listed = BTreeSet::new();
    for line in read("docs/references.bib").lines().filter(|l| l.starts_with('@')) {
        let key = line
            .split('{')
            .nth(1)
            .unwrap_or_default()
            .trim_end_matches(',')
            .trim();
        if !listed.insert(key.to_string()) {
            wrong.push(format!("docs/references.bib: {key} twice"));
        }
    }
    assert!(
        listed.contains("toth2011"),
        "docs/references.bib lacks the paper itself"
    );
    for file in files() {
        let (is_source, is_text) = (has_extension(&file, "rs"), has_extension(&file, "md"));
        // This file shows what a key looks like.
        if !(is_source || is_text) || file.ends_with("tests/tests/tidy.rs") {
            continue;
        }
        for line in read(&file)
            .lines()
            .filter(|l| is_text || l.trim_start().starts_with("//"))
        {
            for key in citations(line).into_iter().filter(|k| !listed.contains(k)) {
                wrong.push(format!(
                    "{}: [{key}] is not in docs/references.bib",
                    file.display()
                ));
            }
        }
    }
    none(&wrong);
}

/// What the headings of a page are called in links.
fn anchors(page: &Path) -> BTreeSet<String> {
    let text = std::fs::read_to_string(page).unwrap_or_default();
    let headings = text.lines().filter(|l| l.starts_with('#'));
    headings
        .map(|line| {
            let title = line.trim_start_matches('#').trim().to_lowercase();
            let kept = title
                .chars()
                .filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
            kept.map(|c| if c == ' ' { '-' } else { c }).collect()
        })
        .collect()
}

/// The book shows each page once, and a page of the list that is missing would be made empty.
#[test]
fn every_page_stands_in_the_book() {
    let summary = read("docs/SUMMARY.md");
    let targets = summary.split("](").skip(1);
    let listed: Vec<&str> = targets.filter_map(|rest| rest.split(')').next()).collect();
    let once: BTreeSet<&str> = listed.iter().copied().collect();
    assert_eq!(once.len(), listed.len(), "a page stands in docs/SUMMARY.md twice");
    let pages: BTreeSet<String> = files()
        .iter()
        .filter_map(|f| f.strip_prefix("docs").ok())
        .filter(|f| has_extension(f, "md") && *f != Path::new("SUMMARY.md"))
        .map(|f| f.to_string_lossy().into_owned())
        .collect();
    let pages: BTreeSet<&str> = pages.iter().map(String::as_str).collect();
    assert_eq!(once, pages);
}

/// The programs of the tutorials are those that tests run.
#[test]
fn tutorials_show_programs_that_are_run() {
    let notebook: serde_json::Value = serde_json::from_str(&read("docs/python.ipynb")).unwrap();
    let cells = notebook["cells"].as_array().unwrap();
    let source = |cell: &serde_json::Value| match &cell["source"] {
        serde_json::Value::String(text) => text.clone(),
        lines => lines
            .as_array()
            .unwrap()
            .iter()
            .filter_map(|l| l.as_str())
            .collect(),
    };
    let mut python: Vec<String> = cells.iter().map(source).collect();
    python.push(read("crates/lpv-python/examples/from_arrays.py"));
    let rust = read("crates/lpv/examples/library.rs");
    let (_, rust) = rust.split_once("\n\n").unwrap();
    let mut wrong = Vec::new();
    for (page, language, programs) in [
        ("docs/tutorial-python.md", "python", python),
        ("docs/tutorial-rust.md", "rust", vec![rust.to_owned()]),
    ] {
        let text = read(page);
        let fence = format!("```{language}\n");
        let shown = text.split(&fence).skip(1);
        let shown: Vec<&str> = shown.filter_map(|rest| rest.split("```").next()).collect();
        assert!(!shown.is_empty(), "{page} shows no program");
        let is_run = |block: &&str| programs.iter().any(|p| p.trim() == block.trim());
        wrong.extend(
            shown
                .iter()
                .filter(|b| !is_run(b))
                .map(|b| format!("{page}: no test runs\n{b}")),
        );
    }
    none(&wrong);
}

#[test]
fn relative_links_lead_somewhere() {
    let mut wrong = Vec::new();
    let pages: Vec<PathBuf> = files()
        .into_iter()
        .filter(|f| has_extension(f, "md") && (f.starts_with("docs") || f == Path::new("README.md")))
        .collect();
    if !pages.iter().any(|p| p == Path::new("README.md")) {
        wrong.push("README.md is missing".to_string());
    }
    for page in pages {
        let base = root().join(page.parent().unwrap());
        let mut in_code = false;
        for line in read(&page).lines() {
            in_code ^= line.trim_start().starts_with("```");
            if in_code {
                continue;
            }
            for rest in line.split("](").skip(1) {
                let target = rest.split([')', ' ']).next().unwrap_or_default();
                let path = target.split('#').next().unwrap_or_default();
                if target.contains("://") || target.starts_with("mailto:") {
                    continue;
                }
                let to = match path {
                    "" => root().join(&page),
                    path => base.join(path),
                };
                let anchor = target.split_once('#').map(|(_, anchor)| anchor);
                let has = |anchor| !has_extension(&to, "md") || anchors(&to).contains(anchor);
                if !to.exists() || !anchor.is_none_or(has) {
                    wrong.push(format!("{}: {target}", page.display()));
                }
                // A book has nothing above its pages.
                if page.starts_with("docs") && path.starts_with("..") {
                    wrong.push(format!("{}: {target} leaves the book", page.display()));
                }
            }
        }
    }
    none(&wrong);
}

#[test]
fn the_readers_of_this_file_read_right() {
    assert_eq!(
        citations(r"as \[laub1981\], [toth2009, toth2011] and x[k]"),
        ["laub1981", "toth2009", "toth2011"]
    );
    assert!(citations("[`Lfr`] [0, 1] [text](page.md) [iso26262]").is_empty());
    let text = "see https:|docs.rs/x and sparse+http:|index.example:81/, or :|".replace('|', "//");
    assert_eq!(hosts(&text), ["docs.rs", "index.example:81"]);
}

/// The table of docs/theory.md leads to items that exist.
#[test]
fn each_equation_is_where_the_theory_says() {
    let text = read("docs/theory.md");
    let rows = text
        .lines()
        .filter(|l| l.starts_with('|') && l.contains("crates/"));
    let mut wrong = Vec::new();
    let mut count = 0;
    for row in rows {
        count += 1;
        let cells: Vec<&str> = row.trim_matches('|').split('|').map(str::trim).collect();
        let (item, file) = (cells[2].split('`').nth(1).unwrap_or(""), cells[3]);
        let source = std::fs::read_to_string(root().join(file)).unwrap_or_default();
        let declares = |keyword: &str| {
            source
                .split(&format!("{keyword} {item}"))
                .skip(1)
                .any(|rest| !rest.starts_with(|c: char| c.is_alphanumeric() || c == '_'))
        };
        if !["fn", "struct", "enum", "trait"].into_iter().any(declares) {
            wrong.push(format!("docs/theory.md: {item} is not declared in {file}"));
        }
    }
    assert!(count >= 15, "{count} equations");
    none(&wrong);
}

#[test]
fn every_effect_of_the_catalogue_can_be_hidden_or_is_listed() {
    let hidden: BTreeSet<&str> = xytable_plant::HiddenEffect::catalogue().map(|e| e.name).collect();
    let found: BTreeSet<&str> = lpv_diagnose::catalogue::all().map(|e| e.name).collect();
    let listed: BTreeSet<&str> = NOT_HIDDEN.iter().map(|(name, _)| *name).collect();
    let not_hidden: BTreeSet<&str> = found.difference(&hidden).copied().collect();
    assert_eq!(not_hidden, listed);
}
