//! The `fathomless` command.

fn main() {}
