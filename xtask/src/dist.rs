//! `cargo xtask dist`: the archive of a release, under the name and with the folder that `cargo binstall` asks for.
//!
//! It holds the program without its symbols, its manual pages and completions, the licences and the README. What was packed is
//! unpacked again and run before the archive is believed.

mod notices;

use crate::{Dist, TaskError, root};
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Largest archive, bytes.
const MOST_BYTES: u64 = 25_000_000;

/// Shells with completions, and what a file for each is called.
const SHELLS: [(&str, &str); 4] = [
    ("bash", "lpv.bash"),
    ("zsh", "_lpv"),
    ("fish", "lpv.fish"),
    ("powershell", "_lpv.ps1"),
];

/// One file of the archive.
struct Entry {
    /// Below the folder of the archive.
    name: String,
    bytes: Vec<u8>,
    is_program: bool,
}

impl Entry {
    fn file(name: &str, bytes: Vec<u8>) -> Self {
        let name = name.to_owned();
        Self {
            name,
            bytes,
            is_program: false,
        }
    }
}

/// Makes the archive; false where it is too large.
pub(crate) fn run(options: &Dist) -> Result<bool, TaskError> {
    let names = Names::of_this_machine()?;
    let program = match &options.program {
        Some(built) => built.clone(),
        None => build()?,
    };
    let stage = tempfile::tempdir()?;
    let mut entries = entries(&program, stage.path())?;
    let notices = notices::notices(&names.target)?.into_bytes();
    entries.push(Entry::file("LICENSES-THIRD-PARTY.txt", notices));
    let archive = pack(&names, &entries)?;
    let unpacked = stage.path().join("unpacked");
    unpack(&archive, &unpacked)?;
    let folder = unpacked.join(&names.folder);
    let said = output(&folder.join(&names.program), &["--version"])?;
    if String::from_utf8_lossy(&said).trim() != format!("lpv {}", names.version) {
        return Err(format!("the packed program is not lpv {}", names.version).into());
    }
    std::fs::create_dir_all(&options.output)?;
    let file = options.output.join(&names.archive);
    lpv::write_whole(&file, &archive)?;
    for entry in &entries {
        println!("{:>10} {}/{}", entry.bytes.len(), names.folder, entry.name);
    }
    println!("{:>10} {}", archive.len(), file.display());
    let fits = archive.len() as u64 <= MOST_BYTES;
    if !fits {
        println!("the archive is above {MOST_BYTES} bytes");
    }
    Ok(fits)
}

/// The names that `[package.metadata.binstall]` of the program promises.
struct Names {
    version: String,
    target: String,
    /// Of the archive, the last part of its address.
    archive: String,
    /// Within the archive.
    folder: String,
    program: String,
}

impl Names {
    fn of_this_machine() -> Result<Self, TaskError> {
        let about = output(Path::new("rustc"), &["-vV"])?;
        let about = String::from_utf8_lossy(&about);
        let target = about.lines().find_map(|l| l.strip_prefix("host: "));
        let target = target.ok_or("rustc -vV names no host")?;
        let manifest = std::fs::read_to_string(root().join("crates/lpv-cli/Cargo.toml"))?;
        Self::of(&manifest, env!("CARGO_PKG_VERSION"), target)
    }

    fn of(manifest: &str, version: &str, target: &str) -> Result<Self, TaskError> {
        let manifest: toml::Table = manifest.parse()?;
        let package = &manifest["package"];
        let promised = package.get("metadata").and_then(|m| m.get("binstall"));
        let promised = |key: &str| {
            let template = promised.and_then(|p| p.get(key)).and_then(|v| v.as_str());
            let template = template.ok_or(format!(
                "crates/lpv-cli/Cargo.toml: [package.metadata.binstall] has no {key}"
            ))?;
            let text = [
                ("{ name }", package["name"].as_str().unwrap_or_default()),
                ("{ bin }", "lpv"),
                ("{ target }", target),
                ("{ version }", version),
                ("{ binary-ext }", std::env::consts::EXE_SUFFIX),
            ]
            .into_iter()
            .fold(template.to_owned(), |text, (key, value)| text.replace(key, value));
            Ok::<String, String>(text)
        };
        let (address, program) = (promised("pkg-url")?, promised("bin-dir")?);
        let archive = address.rsplit('/').next().unwrap_or_default();
        let (folder, program) = program
            .split_once('/')
            .ok_or("bin-dir names no folder of the archive")?;
        if [archive, folder, program].iter().any(|n| n.contains('{')) {
            return Err(format!("{archive}, {folder}/{program}: a name that is not known here").into());
        }
        Ok(Self {
            version: version.to_owned(),
            target: target.to_owned(),
            archive: archive.to_owned(),
            folder: folder.to_owned(),
            program: program.to_owned(),
        })
    }
}

/// Builds the program as it goes out.
fn build() -> Result<PathBuf, TaskError> {
    output(
        Path::new("cargo"),
        &["build", "--locked", "--release", "--package", "lpv-cli"],
    )?;
    let about = output(
        Path::new("cargo"),
        &["metadata", "--no-deps", "--offline", "--format-version", "1"],
    )?;
    let about: serde_json::Value = serde_json::from_slice(&about)?;
    let folder = about["target_directory"]
        .as_str()
        .ok_or("cargo metadata names no folder of what is built")?;
    Ok(Path::new(folder).join(format!("release/lpv{}", std::env::consts::EXE_SUFFIX)))
}

/// What goes into the archive, made from a program that is built.
fn entries(program: &Path, stage: &Path) -> Result<Vec<Entry>, TaskError> {
    let bare = stage.join(format!("lpv{}", std::env::consts::EXE_SUFFIX));
    std::fs::copy(program, &bare).map_err(|e| format!("{}: {e}", program.display()))?;
    // Elsewhere the symbols stand in a file of their own.
    if cfg!(unix) {
        output(Path::new("strip"), &[&bare.to_string_lossy()])?;
    }
    let pages = stage.join("man");
    output(&bare, &["man", &pages.to_string_lossy()])?;
    let mut all = vec![Entry {
        name: format!("lpv{}", std::env::consts::EXE_SUFFIX),
        bytes: std::fs::read(&bare)?,
        is_program: true,
    }];
    for name in ["README.md", "LICENSE-MIT", "LICENSE-APACHE"] {
        all.push(Entry::file(name, std::fs::read(root().join(name))?));
    }
    for (shell, name) in SHELLS {
        let script = output(&bare, &["completions", shell])?;
        all.push(Entry::file(&format!("completions/{name}"), script));
    }
    let mut names = std::fs::read_dir(&pages)?
        .map(|page| Ok(page?.file_name().to_string_lossy().into_owned()))
        .collect::<Result<Vec<_>, std::io::Error>>()?;
    names.sort();
    for name in names {
        let page = std::fs::read(pages.join(&name))?;
        all.push(Entry::file(&format!("man/{name}"), page));
    }
    Ok(all)
}

/// What a command prints; where it fails, its own words.
fn output(program: &Path, words: &[&str]) -> Result<Vec<u8>, TaskError> {
    let line = format!("{} {}", program.display(), words.join(" "));
    let done = Command::new(program).args(words).current_dir(root()).output();
    let done = done.map_err(|e| format!("`{line}` cannot be run: {e}"))?;
    if done.status.success() {
        return Ok(done.stdout);
    }
    Err(format!("`{line}` failed: {}", String::from_utf8_lossy(&done.stderr)).into())
}

/// The same files give the same bytes.
fn pack(names: &Names, entries: &[Entry]) -> Result<Vec<u8>, TaskError> {
    let mut archive = tar::Builder::new(GzEncoder::new(Vec::new(), flate2::Compression::best()));
    for entry in entries {
        let mut head = tar::Header::new_gnu();
        head.set_size(entry.bytes.len() as u64);
        head.set_mode(if entry.is_program { 0o755 } else { 0o644 });
        let path = format!("{}/{}", names.folder, entry.name);
        archive.append_data(&mut head, path, entry.bytes.as_slice())?;
    }
    Ok(archive.into_inner()?.finish()?)
}

fn unpack(archive: &[u8], into: &Path) -> Result<(), TaskError> {
    Ok(tar::Archive::new(GzDecoder::new(archive)).unpack(into)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MANIFEST: &str = include_str!("../../crates/lpv-cli/Cargo.toml");

    #[test]
    fn the_names_are_those_that_the_manifest_promises() {
        let names = Names::of(MANIFEST, "1.2.3", "x86_64-unknown-linux-gnu").unwrap();
        assert_eq!(names.archive, "lpv-cli-x86_64-unknown-linux-gnu-v1.2.3.tar.gz");
        assert_eq!(names.folder, "lpv-cli-x86_64-unknown-linux-gnu-v1.2.3");
        assert_eq!(names.program, format!("lpv{}", std::env::consts::EXE_SUFFIX));
        let bare = MANIFEST.replace("[package.metadata.binstall]", "[package.metadata.other]");
        let refused = Names::of(&bare, "1.2.3", "any").err().unwrap().to_string();
        assert!(refused.contains("has no pkg-url"), "{refused}");
        let strange = MANIFEST.replace("{ version }", "{ tag }");
        assert!(Names::of(&strange, "1.2.3", "any").is_err());
    }

    #[test]
    fn what_is_packed_is_unpacked_with_its_right_to_run() {
        let names = Names::of(MANIFEST, "1.2.3", "any").unwrap();
        let entries = [
            Entry {
                name: names.program.clone(),
                bytes: vec![7; 100_000],
                is_program: true,
            },
            Entry::file("man/lpv.1", b"page".to_vec()),
        ];
        let archive = pack(&names, &entries).unwrap();
        assert!(archive == pack(&names, &entries).unwrap(), "the bytes differ");
        let folder = tempfile::tempdir().unwrap();
        unpack(&archive, folder.path()).unwrap();
        for entry in &entries {
            let file = folder.path().join(&names.folder).join(&entry.name);
            assert!(std::fs::read(&file).unwrap() == entry.bytes, "{}", entry.name);
            #[cfg(unix)]
            {
                use std::os::unix::fs::PermissionsExt;
                let mode = std::fs::metadata(&file).unwrap().permissions().mode();
                assert_eq!(mode & 0o111 != 0, entry.is_program, "{}", entry.name);
            }
        }
    }
}
