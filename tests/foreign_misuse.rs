//! Whatever a C program passes to whichever function of the shared library, it gets the right result code and lives:
//! null, stale, foreign and invented handles, wrong types, endless chains, capacities from 0 to the largest.

#![allow(clippy::unwrap_used, reason = "tests")]

mod foreign_support;

use std::collections::BTreeSet;
use std::process::Command;

use fathomless::mock;

#[test]
fn every_function_answers_every_misuse() {
    let folder = tempfile::tempdir().unwrap();
    let program = foreign_support::compile("misuse.c", folder.path());
    let output = Command::new(program).arg(foreign_support::library()).output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    let wrong: Vec<&str> = said.lines().filter(|line| line.starts_with("WRONG")).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(output.status.success(), "{:?}: {said}", output.status);

    let called: BTreeSet<&str> = said.lines().filter_map(|line| line.strip_prefix("called ")).collect();
    let all: BTreeSet<&str> = mock::function_names().collect();
    assert_eq!(called, all, "misuse.c has a line for each function of the runtime, and each is called");
}
