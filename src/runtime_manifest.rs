//! `fathomless runtime`: the manifest that makes OpenXR loaders load the mock runtime.

use std::env::consts::{DLL_PREFIX, DLL_SUFFIX};
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde::Serialize;

use crate::files;

#[derive(Serialize)]
struct Manifest<'a> {
    file_format_version: &'static str,
    runtime: Runtime<'a>,
}

#[derive(Serialize)]
struct Runtime<'a> {
    name: &'static str,
    library_path: &'a str,
}

/// The manifest of a runtime's shared library, as JSON ("Runtime Manifest File Format" of the OpenXR loader).
///
/// # Errors
/// The path is not UTF-8, so that JSON cannot say it.
pub fn manifest(library: &Path) -> Result<String> {
    let library_path = library
        .to_str()
        .with_context(|| format!("{} is not UTF-8: move it to a plainer path", library.display()))?;
    let runtime = Runtime { name: "Fathomless mock runtime", library_path };
    let mut text = serde_json::to_string_pretty(&Manifest { file_format_version: "1.0.0", runtime })?;
    text.push('\n');
    Ok(text)
}

/// The mock runtime's shared library: beside the program, where cargo puts it for `cargo run` and tests, or in
/// `../lib`. Of several the newest.
///
/// # Errors
/// There is none.
pub fn library(program: &Path) -> Result<PathBuf> {
    let name = format!("{DLL_PREFIX}fathomless{DLL_SUFFIX}");
    let folder = program.parent().unwrap_or(Path::new("."));
    let places = [folder.join("../lib"), folder.join("deps"), folder.to_owned()];
    let written = |path: &PathBuf| path.metadata().and_then(|about| about.modified()).ok();
    let found =
        places.iter().map(|place| place.join(&name)).filter(|path| path.is_file()).max_by_key(written);
    let Some(found) = found else {
        bail!(
            "{name} is not beside {}: `cargo build --release` makes both, and they must stay together",
            program.display()
        );
    };
    found.canonicalize().with_context(|| format!("cannot find out where {} is", found.display()))
}

/// Prints the manifest, or writes it to a file; says how to use it unless told to be quiet.
///
/// # Errors
/// The library is missing, or the file cannot be written.
pub fn run(out: Option<&Path>, quiet: bool) -> Result<()> {
    let program = std::env::current_exe().context("cannot find out where this program is")?;
    let text = manifest(&library(&program)?)?;
    let Some(path) = out else {
        std::io::stdout().lock().write_all(text.as_bytes())?;
        if !quiet {
            // Not to stdout, which may go to a file.
            eprintln!(
                "Save it (`fathomless runtime --out mock.json`), and applications run on the mock runtime with"
            );
            eprintln!("  XR_RUNTIME_JSON=mock.json your-application");
        }
        return Ok(());
    };
    files::prepare_file(path, "--out")?;
    files::write_whole(path, |file| file.write_all(text.as_bytes()))
        .with_context(|| format!("cannot write {}", path.display()))?;
    if !quiet {
        let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        println!(
            "Wrote {0}. Applications run on the mock runtime with\n  XR_RUNTIME_JSON={0} your-application",
            path.display()
        );
    }
    Ok(())
}
