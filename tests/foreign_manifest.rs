//! `fathomless runtime` gives a manifest that names the library beside the program by its whole path, says how to use
//! it, and says what is wrong where there is none.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

const PROGRAM: &str = env!("CARGO_BIN_EXE_fathomless");

fn runtime(program: impl AsRef<Path>, args: &[&str], folder: &Path) -> Output {
    Command::new(program.as_ref()).arg("runtime").args(args).current_dir(folder).output().unwrap()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

fn library_of(manifest: &[u8]) -> PathBuf {
    let manifest: Value = serde_json::from_slice(manifest).unwrap();
    assert_eq!(manifest["file_format_version"], "1.0.0");
    let path = PathBuf::from(manifest["runtime"]["library_path"].as_str().unwrap());
    assert!(path.is_absolute(), "{}", path.display());
    path
}

#[test]
fn it_is_printed_and_nothing_else_with_it() {
    let folder = tempfile::tempdir().unwrap();
    let output = runtime(PROGRAM, &[], folder.path());
    assert!(output.status.success());
    let library = library_of(&output.stdout);
    assert!(library.is_file() && library.ends_with("libfathomless.so"), "{}", library.display());
    assert!(text(&output.stderr).contains("XR_RUNTIME_JSON=mock.json your-application"));

    let quiet = runtime(PROGRAM, &["-q"], folder.path());
    assert_eq!((quiet.stdout, quiet.stderr), (output.stdout, Vec::new()));
}

#[test]
fn it_is_written_where_asked() {
    let folder = tempfile::tempdir().unwrap();
    let output = runtime(PROGRAM, &["--out", "new/mock.json"], folder.path());
    assert!(output.status.success(), "{output:?}");
    let path = folder.path().canonicalize().unwrap().join("new/mock.json");
    let hint = format!("XR_RUNTIME_JSON={} your-application", path.display());
    assert!(text(&output.stdout).contains(&hint), "{output:?}");
    assert!(library_of(&fs::read(path).unwrap()).is_file());

    let output = runtime(PROGRAM, &["--out", "new"], folder.path());
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("name a file with --out"), "{output:?}");
}

/// A program on its own knows no library; of two it takes the newer.
#[test]
fn the_library_is_looked_for_beside_the_program() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path().canonicalize().unwrap();
    fs::create_dir_all(root.join("bin/deps")).unwrap();
    fs::create_dir_all(root.join("lib")).unwrap();
    let program = root.join("bin/fathomless");
    fs::copy(PROGRAM, &program).unwrap();
    let output = runtime(&program, &[], &root);
    assert_eq!(output.status.code(), Some(1));
    let said = text(&output.stderr);
    assert!(said.starts_with("error: libfathomless.so is not beside "), "{said}");
    assert!(said.contains("cargo build --release"), "{said}");
    assert_eq!(said.lines().count(), 1, "{said}");

    for place in ["lib", "bin/deps", "bin"] {
        let library = root.join(place).join("libfathomless.so");
        fs::write(&library, place).unwrap();
        let output = runtime(&program, &[], &root);
        assert_eq!(library_of(&output.stdout), library);
        // File times may be coarse.
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    fs::write(root.join("bin/deps/libfathomless.so"), "newer").unwrap();
    assert_eq!(library_of(&runtime(&program, &[], &root).stdout), root.join("bin/deps/libfathomless.so"));

    // Called through a link from elsewhere it still finds what belongs to it.
    symlink(&program, root.join("link")).unwrap();
    assert_eq!(
        library_of(&runtime(root.join("link"), &[], &root).stdout),
        root.join("bin/deps/libfathomless.so")
    );
}
