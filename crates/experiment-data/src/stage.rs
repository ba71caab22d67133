//! Where a bundle is made before it takes its place.

use crate::DataError;
use std::fs::{self, File};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Names of such folders, within the folder of the bundle.
const PREFIX: &str = ".lpv-";
const SUFFIX: &str = ".part";

/// Held while the folder is in use; one that nobody holds was left behind.
const LOCK: &str = "lock";
const DESCRIPTION: &str = "experiment.toml";
const RECORDS: &str = "records";

/// A folder within that of the bundle, which is gone when this is dropped.
#[derive(Debug)]
pub(crate) struct Stage {
    /// Of the bundle.
    folder: PathBuf,
    /// Folders that were missing, outermost first.
    made: Vec<PathBuf>,
    own: PathBuf,
    lock: Option<File>,
}

impl Stage {
    /// Makes the folder of the bundle if it is missing, and a folder in it. What a process left behind that was killed is removed,
    /// or completed if only its last step was missing.
    pub(crate) fn create(folder: &Path) -> Result<Self, DataError> {
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let own = folder.join(format!("{PREFIX}{}-{count}{SUFFIX}", std::process::id()));
        let mut stage = Self {
            folder: folder.to_owned(),
            made: Vec::new(),
            own,
            lock: None,
        };
        make_folders(folder, &mut stage.made)?;
        settle(folder)?;
        refuse_existing(&folder.join(DESCRIPTION))?;
        fs::create_dir(&stage.own).map_err(DataError::io("make the folder", &stage.own))?;
        let path = stage.own.join(LOCK);
        let lock = File::create_new(&path).map_err(DataError::io("create", &path))?;
        // Where a file system knows no locks, nothing is taken for left behind.
        lock.lock().ok();
        stage.lock = Some(lock);
        Ok(stage)
    }

    /// The folder to fill.
    pub(crate) fn path(&self) -> &Path {
        &self.own
    }

    /// The folders that were made for it, outermost first.
    pub(crate) fn made(&self) -> &[PathBuf] {
        &self.made
    }

    /// Puts the records and then the description where they belong. Nothing that exists is overwritten.
    pub(crate) fn publish(mut self) -> Result<(), DataError> {
        publish(&self.own, &self.folder)?;
        self.made.clear();
        Ok(())
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        self.lock = None;
        fs::remove_dir_all(&self.own).ok();
        for folder in self.made.iter().rev() {
            // One that somebody else uses by now stays.
            fs::remove_dir(folder).ok();
        }
    }
}

fn make_folders(folder: &Path, made: &mut Vec<PathBuf>) -> Result<(), DataError> {
    if folder.as_os_str().is_empty() || folder.is_dir() {
        return Ok(());
    }
    if let Some(above) = folder.parent() {
        make_folders(above, made)?;
    }
    match fs::create_dir(folder) {
        Ok(()) => made.push(folder.to_owned()),
        Err(e) if e.kind() == ErrorKind::AlreadyExists && folder.is_dir() => {}
        Err(e) => return Err(DataError::io("make the folder", folder)(e)),
    }
    Ok(())
}

/// Removes or completes what processes left behind in the folder of a bundle.
fn settle(folder: &Path) -> Result<(), DataError> {
    for entry in fs::read_dir(folder)
        .map_err(DataError::io("read", folder))?
        .flatten()
    {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let path = entry.path();
        if !(name.starts_with(PREFIX) && name.ends_with(SUFFIX) && path.is_dir()) {
            continue;
        }
        let Ok(lock) = File::open(path.join(LOCK)) else {
            // Killed before it was held: then it is empty, and goes.
            fs::remove_dir(&path).ok();
            continue;
        };
        if lock.try_lock().is_err() {
            continue;
        }
        // The description comes last, so that with it everything is there.
        if path.join(DESCRIPTION).is_file() && !folder.join(DESCRIPTION).exists() {
            publish(&path, folder)?;
        }
        drop(lock);
        fs::remove_dir_all(&path).map_err(DataError::io("remove", &path))?;
    }
    Ok(())
}

fn refuse_existing(path: &Path) -> Result<(), DataError> {
    match path.symlink_metadata() {
        Ok(_) => Err(DataError::Exists {
            path: path.to_owned(),
        }),
        Err(_) => Ok(()),
    }
}

fn publish(from: &Path, to: &Path) -> Result<(), DataError> {
    refuse_existing(&to.join(DESCRIPTION))?;
    let mut moves = Vec::new();
    gather(&from.join(RECORDS), &to.join(RECORDS), &mut moves)?;
    moves.iter().try_for_each(|(_, target)| refuse_existing(target))?;
    for (source, target) in moves {
        if let Some(parent) = target.parent() {
            fs::create_dir_all(parent).map_err(DataError::io("make the folder", parent))?;
        }
        fs::rename(&source, &target).map_err(DataError::io("write", &target))?;
    }
    let target = to.join(DESCRIPTION);
    fs::rename(from.join(DESCRIPTION), &target).map_err(DataError::io("write", &target))?;
    // The names are on the disk too; where folders cannot be synced, they will be soon.
    for folder in [&to.join(RECORDS), to] {
        File::open(folder).and_then(|f| f.sync_all()).ok();
    }
    Ok(())
}

/// What has to be moved: a folder at once where none stands in its place.
fn gather(from: &Path, to: &Path, moves: &mut Vec<(PathBuf, PathBuf)>) -> Result<(), DataError> {
    if !from.is_dir() {
        return Ok(());
    }
    if !to.is_dir() {
        moves.push((from.to_owned(), to.to_owned()));
        return Ok(());
    }
    for entry in fs::read_dir(from).map_err(DataError::io("read", from))? {
        let entry = entry.map_err(DataError::io("read", from))?;
        let (source, target) = (entry.path(), to.join(entry.file_name()));
        match source.is_dir() {
            true => gather(&source, &target, moves)?,
            false => moves.push((source, target)),
        }
    }
    Ok(())
}
