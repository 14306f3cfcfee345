//! Files written whole or not at all.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::{Context, Result, ensure};

/// Writes a file under another name, then renames it: whoever looks sees the old file or the new one, and what fails
/// leaves nothing half-written behind. Of several that write one file at the same time, in this process or in others,
/// the last one's stays, whole.
///
/// # Errors
/// What the system says: the disk is full, the folder is gone or must not be written.
pub fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> io::Result<()> {
    let partial = partial(path);
    let written = write_through(&partial, write).and_then(|()| std::fs::rename(&partial, path));
    written.inspect_err(|_| {
        // Best effort: the error itself is what matters.
        let _ = std::fs::remove_file(&partial);
    })
}

fn write_through(path: &Path, write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    let mut file = BufWriter::new(File::create(path)?);
    write(&mut file)?;
    file.flush()
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
    ensure!(is_file, "{} is a folder: name a file with {option}", path.display());
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    prepare_folder(folder.unwrap_or(Path::new(".")), option)
}

/// The name that a file has until it is whole: this writer's own, whoever else writes the same file at the same time.
fn partial(path: &Path) -> PathBuf {
    static WRITERS: AtomicU64 = AtomicU64::new(0);
    let writer = WRITERS.fetch_add(1, Ordering::Relaxed);
    let mut name = path.as_os_str().to_owned();
    name.push(format!(".{}-{writer}.partial", std::process::id()));
    PathBuf::from(name)
}
