//! Files that are there whole or not at all.

use std::fs::File;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

/// Makes a file with `write`, which is given another name to write to, and renames it when it is complete: nothing
/// half-written is ever found at `path`, nor left behind.
///
/// # Errors
/// The disk is full or the folder is gone.
pub fn write(path: &Path, write: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
    let partial = partial(path);
    let written = write(&partial).and_then(|()| Ok(std::fs::rename(&partial, path)?));
    written
        .inspect_err(|_| {
            // Best effort: the error itself is what matters.
            let _ = std::fs::remove_file(&partial);
        })
        .with_context(|| format!("cannot write {}: is the disk full?", path.display()))
}

/// Makes a folder, and makes sure that it can be written, before any work is done. `option` is the one that names it.
///
/// # Errors
/// It cannot be made or written.
pub fn prepare_folder(folder: &Path, option: &str) -> Result<()> {
    let advice = || format!("cannot write to {}: choose another folder with {option}", folder.display());
    std::fs::create_dir_all(folder).with_context(advice)?;
    let probe = partial(&folder.join("probe"));
    File::create(&probe).with_context(advice)?;
    std::fs::remove_file(&probe).with_context(advice)
}

/// Makes sure that a file can be written, before any work is done. `option` is the one that names it.
///
/// # Errors
/// It is a folder, or its folder cannot be made or written.
pub fn prepare_file(path: &Path, option: &str) -> Result<()> {
    let is_file = path.file_name().is_some() && !path.is_dir();
    anyhow::ensure!(is_file, "{} is a folder: name a file with {option}", path.display());
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    prepare_folder(folder.unwrap_or(Path::new(".")), option)
}

fn partial(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(format!(".{}.partial", std::process::id()));
    PathBuf::from(name)
}
