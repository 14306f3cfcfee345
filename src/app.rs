//! Runs a command.

use std::io::Write;

use crate::cli::{Action, Command};
use crate::world::World;

/// Runs a command.
///
/// # Errors
/// A sentence that says what failed and what to do.
pub fn run(command: Command) -> anyhow::Result<()> {
    match command.action {
        Action::Worlds => worlds(),
        _ => anyhow::bail!("this build can only list worlds; run `fathomless worlds`"),
    }
}

/// Prints each world's name and its line.
fn worlds() -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    let width = World::names().map(str::len).max().unwrap_or_default();
    for name in World::names() {
        let world = World::load(name)?;
        writeln!(out, "{name:width$}  {}", world.title)?;
    }
    Ok(())
}
