//! Files written whole or not at all.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// Writes a file under another name, then renames it: whoever looks sees the old file or the new one, and what fails
/// leaves nothing half-written behind.
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

/// The name that a file has until it is whole: this process's own.
pub fn partial(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(format!(".{}.partial", std::process::id()));
    PathBuf::from(name)
}
