//! Spare files: what is being written, until it takes its place in one step.

use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tempfile::NamedTempFile;

/// Names of spare files are short, so that any name that the system takes can be written.
const PREFIX: &str = ".lpv-";
const SUFFIX: &str = ".part";

/// What is half written in this process.
static UNFINISHED: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Held while results take their places.
static PLACING: Mutex<Placing> = Mutex::new(Placing {
    one_by_one: false,
    all: false,
    some: false,
});

/// Which results have taken their places.
struct Placing {
    /// A command has several, of which each may be the last.
    one_by_one: bool,
    /// All of them: there is nothing left to stop.
    all: bool,
    /// Some of several.
    some: bool,
}

/// What a process that is stopped leaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stopped {
    /// All results: it had nothing left to do but to say so.
    Done,
    /// Those that it had finished, of several.
    Some,
    /// No result.
    Nothing,
}

/// Says that the results of this command come one by one: between two of them it can be stopped.
pub fn one_by_one() {
    locked(&PLACING).one_by_one = true;
}

fn locked<T>(mutex: &'static Mutex<T>) -> MutexGuard<'static, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A spare file or folder that goes when the program is stopped.
#[derive(Debug)]
pub struct Unfinished(Vec<PathBuf>);

impl Unfinished {
    /// Begins what `make` makes; until this is dropped, [`abandon`] removes what is at the paths of it: a file, a folder that was made
    /// for it and is still empty, or, as the first only, a folder with all that is in it.
    ///
    /// # Errors
    /// That of `make`.
    pub fn begin<T, E>(
        make: impl FnOnce() -> Result<T, E>,
        paths: impl FnOnce(&T) -> Vec<PathBuf>,
    ) -> Result<(T, Self), E> {
        // Locked meanwhile, so that nothing is begun that the end of the process would not see.
        let mut all = locked(&UNFINISHED);
        let made = make()?;
        let paths = paths(&made);
        all.extend(paths.iter().cloned());
        Ok((made, Self(paths)))
    }

    /// Adds to what was begun: [`abandon`] waits for the end of it, and after that nothing is added any more.
    pub fn add<T>(&self, work: impl FnOnce() -> T) -> T {
        let _all = locked(&UNFINISHED);
        work()
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        locked(&UNFINISHED).retain(|path| !self.0.contains(path));
    }
}

/// Lets the results of a command take their places: [`abandon`] waits for the end of it.
///
/// # Errors
/// That of `place`.
pub fn place_all<T, E>(place: impl FnOnce() -> Result<T, E>) -> Result<T, E> {
    let mut placed = locked(&PLACING);
    let result = place();
    let done = result.is_ok();
    placed.all = done && !placed.one_by_one;
    placed.some |= done;
    result
}

/// Removes what is half written, before the process ends: no other thread writes a result from then on. Does nothing if
/// all results have taken their places already.
pub fn abandon() -> Stopped {
    let placed = locked(&PLACING);
    if placed.all {
        return Stopped::Done;
    }
    let left = match placed.some {
        true => Stopped::Some,
        false => Stopped::Nothing,
    };
    let all = locked(&UNFINISHED);
    for path in all.iter() {
        // Another thread may still put files into a folder.
        for _ in 0..5 {
            let gone = match fs::symlink_metadata(path) {
                Ok(found) if !found.is_dir() => fs::remove_file(path).is_ok(),
                Ok(_) if is_spare(path) => fs::remove_dir_all(path).is_ok(),
                // A folder on the way, which may hold something of somebody else by now.
                Ok(_) => {
                    fs::remove_dir(path).is_ok() || path.read_dir().is_ok_and(|mut d| d.next().is_some())
                }
                Err(_) => true,
            };
            if gone {
                break;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }
    // To the end of the process.
    std::mem::forget((placed, all));
    left
}

/// Waits for ever if the process is about to end by [`abandon`], whose last word is the only one.
pub fn yield_to_end() {
    drop(locked(&PLACING));
}

fn is_spare(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.starts_with(PREFIX) && name.ends_with(SUFFIX)
}

fn folder_of(target: &Path) -> &Path {
    match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Tries to write there, and leaves everything as it was.
pub(super) fn probe(target: &Path) -> io::Result<()> {
    /// Another process may remove a folder that it made on the way to the same place.
    const TRIES: usize = 3;
    let mut result = Ok(());
    for _ in 0..TRIES {
        result = probe_once(target);
        if !matches!(&result, Err(e) if e.kind() == ErrorKind::NotFound) {
            break;
        }
    }
    result
}

fn probe_once(target: &Path) -> io::Result<()> {
    // The end of the process waits for it, and leaves nothing of it.
    let _all = locked(&UNFINISHED);
    let mut made = Vec::new();
    let tried = make_folders(folder_of(target), &mut made).and_then(|()| {
        // A name that is too long is refused by a look already; nothing is made there, since somebody else may write it now.
        if let Err(e) = fs::symlink_metadata(target)
            && e.kind() != ErrorKind::NotFound
        {
            return Err(e);
        }
        tempfile::Builder::new()
            .prefix(PREFIX)
            .suffix(SUFFIX)
            .tempfile_in(folder_of(target))
            .map_err(plain)?
            .close()
    });
    remove_empty(&made);
    tried
}

/// Makes a folder and those above it that are missing, and notes them.
fn make_folders(folder: &Path, made: &mut Vec<PathBuf>) -> io::Result<()> {
    if folder.as_os_str().is_empty() || folder.is_dir() {
        return Ok(());
    }
    if let Some(above) = folder.parent() {
        make_folders(above, made)?;
    }
    match fs::create_dir(folder) {
        Ok(()) => {
            made.push(folder.to_owned());
            Ok(())
        }
        Err(e) if e.kind() == ErrorKind::AlreadyExists && folder.is_dir() => Ok(()),
        Err(e) if e.kind() == ErrorKind::AlreadyExists => Err(ErrorKind::NotADirectory.into()),
        Err(e) => Err(e),
    }
}

/// The system's own word, without the name of a spare file that nobody asked for.
fn plain(error: io::Error) -> io::Error {
    match error.get_ref().and_then(|inner| inner.source()) {
        Some(source) => match source
            .downcast_ref::<io::Error>()
            .and_then(io::Error::raw_os_error)
        {
            Some(code) => io::Error::from_raw_os_error(code),
            None => error.kind().into(),
        },
        None => error,
    }
}

/// A file that is whole and on the disk, and waits to take its place. It goes when this is dropped.
pub(super) struct Spare {
    file: NamedTempFile,
    target: PathBuf,
    /// Folders that were missing, outermost first.
    made: Vec<PathBuf>,
    _unfinished: Unfinished,
}

impl Spare {
    /// Writes beside the target, with the permissions of the file there.
    pub(super) fn write(target: &Path, bytes: &[u8]) -> io::Result<Self> {
        let folder = folder_of(target);
        let mut builder = tempfile::Builder::new();
        builder.prefix(PREFIX).suffix(SUFFIX);
        // What a new file gets; the mask of the process is taken off by the system.
        #[cfg(unix)]
        let new = <fs::Permissions as std::os::unix::fs::PermissionsExt>::from_mode(0o666);
        #[cfg(unix)]
        builder.permissions(new);
        let make = || {
            let mut made = Vec::new();
            let file = make_folders(folder, &mut made).and_then(|()| {
                remove_stale(folder);
                builder.tempfile_in(folder).map_err(plain)
            });
            match file {
                Ok(file) => Ok((file, made)),
                Err(e) => {
                    remove_empty(&made);
                    Err(e)
                }
            }
        };
        let paths = |(file, made): &(NamedTempFile, Vec<PathBuf>)| {
            let outermost_last = made.iter().rev().cloned();
            std::iter::once(file.path().to_owned())
                .chain(outermost_last)
                .collect()
        };
        let ((file, made), unfinished) = Unfinished::begin(make, paths)?;
        let mut spare = Self {
            file,
            target: target.to_owned(),
            made,
            _unfinished: unfinished,
        };
        spare.fill(bytes)?;
        Ok(spare)
    }

    fn fill(&mut self, bytes: &[u8]) -> io::Result<()> {
        let file = self.file.as_file_mut();
        // A spare file that nobody holds is one that was left behind.
        file.lock().ok();
        file.write_all(bytes)?;
        if let Ok(old) = fs::metadata(&self.target) {
            keep_owner(file, &old);
            file.set_permissions(old.permissions())?;
        }
        file.sync_all()
    }

    /// Takes the place in one step: it holds what it held, or the whole of the new.
    pub(super) fn place(mut self) -> io::Result<()> {
        fs::rename(self.file.path(), &self.target)?;
        self.made.clear();
        // The name is on the disk too; where folders cannot be synced, it will be soon.
        File::open(folder_of(&self.target))
            .and_then(|f| f.sync_all())
            .ok();
        Ok(())
    }
}

impl Drop for Spare {
    fn drop(&mut self) {
        fs::remove_file(self.file.path()).ok();
        remove_empty(&self.made);
    }
}

fn remove_empty(folders: &[PathBuf]) {
    for folder in folders.iter().rev() {
        // One that somebody else uses by now stays.
        fs::remove_dir(folder).ok();
    }
}

#[cfg(unix)]
fn keep_owner(file: &File, old: &fs::Metadata) {
    use std::os::unix::fs::{MetadataExt, fchown};
    let Ok(new) = file.metadata() else { return };
    if (new.uid(), new.gid()) != (old.uid(), old.gid()) {
        // Only the owner of the machine may give files away; for others the group is worth a try.
        if fchown(file, Some(old.uid()), Some(old.gid())).is_err() {
            fchown(file, None, Some(old.gid())).ok();
        }
    }
}

#[cfg(not(unix))]
fn keep_owner(_file: &File, _old: &fs::Metadata) {}

/// Removes spare files that a process left behind which was killed: those that nobody holds, after a minute.
fn remove_stale(folder: &Path) {
    const AGE: Duration = Duration::from_secs(60);
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let old = || {
            let found = entry.metadata().ok().filter(fs::Metadata::is_file)?;
            found.modified().ok()?.elapsed().ok().filter(|age| *age > AGE)
        };
        if is_spare(&entry.path()) && old().is_some() {
            let free = File::open(entry.path()).is_ok_and(|f| f.try_lock().is_ok());
            if free {
                fs::remove_file(entry.path()).ok();
            }
        }
    }
}
