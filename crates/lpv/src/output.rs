//! Where results go: a place is looked at before the work, and written whole.
//!
//! No result replaces what is read, nor a file that is not a result of the same kind, unless that is forced. What is written is
//! written to a spare file in the same folder, which takes the place in one step.

mod kind;
mod problem;
mod spare;

pub use kind::Kind;
pub use problem::PlaceProblem;
pub(crate) use problem::is_slip;
pub use spare::{Stopped, Unfinished, abandon, one_by_one, place_all, yield_to_end};

use crate::PipelineError;
use experiment_data::Bundle;
use spare::Spare;
use std::fs::{self, Metadata};
use std::io::Write;
use std::path::{Path, PathBuf};

/// What happens to a file that stands at the place of a result and is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Overwrite {
    /// It stays, and the call fails.
    Refuse,
    /// It is replaced.
    Replace,
}

impl Overwrite {
    /// Replaces if a user asked for it.
    pub fn if_asked(asked: bool) -> Self {
        match asked {
            true => Self::Replace,
            false => Self::Refuse,
        }
    }
}

/// What a command reads, so that it cannot be written.
#[derive(Debug, Default)]
pub struct Inputs {
    files: Vec<(Identity, String)>,
}

impl Inputs {
    /// Nothing is read.
    pub fn none() -> Self {
        Self::default()
    }

    /// Adds a file and what it is, as in "the model"; one that is missing needs no care.
    #[must_use]
    pub fn file(mut self, file: &Path, role: &str) -> Self {
        self.push(file, role);
        self
    }

    /// Adds what a diagnosis is given beside a bundle.
    #[must_use]
    pub fn beside(mut self, model: Option<&Path>, effects: Option<&Path>) -> Self {
        let files = [
            (model, "the model that effects are added to"),
            (effects, "the file of effects"),
        ];
        for (file, role) in files {
            if let Some(file) = file {
                self.push(file, role);
            }
        }
        self
    }

    /// Adds the description and all records of a bundle.
    #[must_use]
    pub fn bundle(mut self, bundle: &Bundle) -> Self {
        let name = bundle.folder().display();
        self.push(
            bundle.description_file(),
            &format!("the description of the bundle {name}"),
        );
        for index in 0..bundle.len() {
            if let Ok(file) = bundle.record_path(index) {
                self.push(
                    &file,
                    &format!("a record (records[{index}]) of the bundle {name}"),
                );
            }
        }
        self
    }

    fn push(&mut self, file: &Path, role: &str) {
        if let Some(identity) = Identity::of(file) {
            self.files.push((identity, role.to_owned()));
        }
    }

    fn role_of(&self, file: &Path) -> Option<&str> {
        let identity = Identity::of(file)?;
        let found = self.files.iter().find(|(known, _)| *known == identity);
        found.map(|(_, role)| role.as_str())
    }
}

/// A file itself, whatever its name: links of both kinds lead to the same one.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Identity {
    #[cfg(unix)]
    Node(u64, u64),
    #[cfg(not(unix))]
    Path(PathBuf),
}

impl Identity {
    #[cfg(unix)]
    fn of(file: &Path) -> Option<Self> {
        use std::os::unix::fs::MetadataExt;
        let found = fs::metadata(file).ok()?;
        Some(Self::Node(found.dev(), found.ino()))
    }

    #[cfg(not(unix))]
    fn of(file: &Path) -> Option<Self> {
        file.canonicalize().ok().map(Self::Path)
    }
}

/// A place that a result may go to.
#[derive(Debug)]
pub struct Place {
    /// As it was given.
    file: PathBuf,
    way: Way,
}

#[derive(Debug)]
enum Way {
    /// A regular file, or none yet, behind all links.
    Whole(PathBuf),
    /// A pipe or device, which is written to.
    Through,
    /// Standard output by its name in the file system.
    StandardOutput,
}

impl Place {
    /// Looks whether a result of this kind may and can be written here, without leaving anything behind.
    ///
    /// # Errors
    /// [`PipelineError::Place`] for an input, a folder, or a file that is not to be replaced; [`PipelineError::Write`] if the system
    /// would not let a file be written there.
    pub fn check(
        file: &Path,
        kind: Kind,
        inputs: &Inputs,
        overwrite: Overwrite,
    ) -> Result<Self, PipelineError> {
        let place = Self::find(file)?;
        let refuse = |problem| PipelineError::Place {
            file: file.to_owned(),
            problem,
        };
        if let Some(role) = inputs.role_of(file) {
            let role = role.to_owned();
            return Err(refuse(PlaceProblem::Input { role }));
        }
        let Way::Whole(target) = &place.way else {
            return Ok(place);
        };
        let found = fs::metadata(target).ok();
        if let (Some(found), Overwrite::Refuse) = (&found, overwrite) {
            if found.len() > 0 && !kind.is(target) {
                return Err(refuse(PlaceProblem::Foreign {
                    found: kind::in_words(target),
                    wanted: kind.name(),
                }));
            }
            if has_second_name(found) {
                return Err(refuse(PlaceProblem::Linked));
            }
            if found.permissions().readonly() {
                return Err(refuse(PlaceProblem::Protected));
            }
        }
        spare::probe(target).map_err(|source| place.refused(source))?;
        Ok(place)
    }

    /// Whether a result of this kind stands here.
    pub(crate) fn is_result(file: &Path, kind: Kind) -> bool {
        file.is_file() && kind.is(file)
    }

    /// The place behind a name, unchecked.
    fn find(file: &Path) -> Result<Self, PipelineError> {
        let standard_output = ["/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"];
        let way = if cfg!(unix) && standard_output.iter().any(|name| file == Path::new(name)) {
            Way::StandardOutput
        } else {
            match fs::metadata(file) {
                Ok(found) if found.is_dir() => {
                    return Err(PipelineError::Place {
                        file: file.to_owned(),
                        problem: PlaceProblem::Folder,
                    });
                }
                Ok(found) if !found.is_file() => Way::Through,
                _ => Way::Whole(behind_links(file)),
            }
        };
        Ok(Self {
            file: file.to_owned(),
            way,
        })
    }

    fn spare(&self, bytes: &[u8]) -> std::io::Result<Option<Spare>> {
        match &self.way {
            Way::Whole(target) => Spare::write(target, bytes).map(Some),
            Way::Through | Way::StandardOutput => Ok(None),
        }
    }

    fn put(&self, spare: Option<Spare>, bytes: &[u8]) -> std::io::Result<()> {
        match (spare, &self.way) {
            (Some(spare), _) => spare.place(),
            (None, Way::StandardOutput) => {
                let mut out = std::io::stdout().lock();
                out.write_all(bytes).and_then(|()| out.flush())
            }
            (None, _) => fs::OpenOptions::new()
                .write(true)
                .open(&self.file)
                .and_then(|mut open| open.write_all(bytes)),
        }
    }

    fn refused(&self, source: std::io::Error) -> PipelineError {
        PipelineError::Write {
            file: self.file.clone(),
            source,
        }
    }
}

/// Follows links, also one to a file that is not there yet.
fn behind_links(file: &Path) -> PathBuf {
    /// What the system follows too.
    const MOST_LINKS: usize = 40;
    let mut target = file.to_owned();
    for _ in 0..MOST_LINKS {
        match fs::read_link(&target) {
            Ok(next) => target = target.parent().unwrap_or(Path::new("")).join(next),
            Err(_) => break,
        }
    }
    target
}

#[cfg(unix)]
fn has_second_name(found: &Metadata) -> bool {
    std::os::unix::fs::MetadataExt::nlink(found) > 1
}

#[cfg(not(unix))]
fn has_second_name(_found: &Metadata) -> bool {
    false
}

/// Writes whole files, or leaves what was there: none takes its place before all are on the disk. Folders that are missing on the way
/// are made.
///
/// # Errors
/// [`PipelineError::Write`].
pub fn write_all(results: &[(&Place, &[u8])]) -> Result<(), PipelineError> {
    let mut spares = Vec::new();
    for (place, bytes) in results {
        spares.push(place.spare(bytes).map_err(|e| place.refused(e))?);
    }
    place_all(|| {
        let pairs = results.iter().zip(spares);
        pairs
            .into_iter()
            .try_for_each(|((place, bytes), spare)| place.put(spare, bytes).map_err(|e| place.refused(e)))
    })
}

/// Writes a file whole, as [`write_all`] does, whatever stands there. A pipe or a device is written to.
///
/// # Errors
/// [`PipelineError::Write`]; [`PipelineError::Place`] for a folder.
pub fn write_whole(file: &Path, bytes: &[u8]) -> Result<(), PipelineError> {
    write_all(&[(&Place::find(file)?, bytes)])
}
