//! What tests with other programs need: the shared library, a compiler, a sentence where a program is missing.
#![allow(dead_code, reason = "each test uses its part")]
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

use std::path::{Path, PathBuf};
use std::process::Command;

/// The mock runtime's shared library as cargo has just built it for this test.
pub fn library() -> PathBuf {
    let program = Path::new(env!("CARGO_BIN_EXE_fathomless"));
    let path = program.with_file_name("deps").join("libfathomless.so");
    assert!(path.is_file(), "{} is not there: Cargo.toml makes a cdylib", path.display());
    path
}

/// Compiles a C program of `tests/foreign/` into a folder.
pub fn compile(source: &str, folder: &Path) -> PathBuf {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/foreign").join(source);
    let program = folder.join(source.file_stem().unwrap());
    let mut cc = Command::new("cc");
    cc.args(["-std=c11", "-Wall", "-Wextra", "-Werror", "-Wno-missing-field-initializers", "-g", "-O1"]);
    let output =
        cc.arg(&source).arg("-o").arg(&program).args(["-ldl", "-lvulkan", "-lopenxr_loader"]).output();
    let output = output.expect("no C compiler: run `sh setup.sh`, which installs one");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.success(),
        "{said}\nIf a header or a library is missing: `sh setup.sh` installs it."
    );
    program
}
