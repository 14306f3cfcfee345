//! The `fathomless` command.

use std::io::ErrorKind;
use std::process::ExitCode;

use fathomless::cli::{self, Verbosity};
use fathomless::gpu::ShaderError;
use fathomless::heap::Counting;
use fathomless::log_lines::LogLines;
use tracing_subscriber::EnvFilter;
use tracing_subscriber::filter::LevelFilter;
use tracing_subscriber::prelude::*;

#[global_allocator]
static HEAP: Counting = Counting;

fn main() -> ExitCode {
    let command = cli::parse();
    log_to_stderr(command.verbosity);
    match fathomless::app::run(command) {
        Ok(()) => ExitCode::SUCCESS,
        // Whoever read our output has seen enough (`fathomless worlds | head -1`).
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(error) => {
            match error.is::<ShaderError>() {
                // It points at a line with carets.
                true => eprintln!("error: {error:#}"),
                false => eprintln!("error: {}", one_line(&error)),
            }
            ExitCode::FAILURE
        }
    }
}

/// Sends the log to stderr, as talkative as asked for (RUST_LOG, where it is set, decides instead), and its last lines to
/// the book that the window shows.
fn log_to_stderr(verbosity: Verbosity) {
    let level = match verbosity {
        Verbosity::Quiet => "error",
        Verbosity::Normal => "warn",
        Verbosity::Info => "info",
        Verbosity::Debug => "debug",
        Verbosity::Trace => "trace",
    };
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| {
        EnvFilter::new(match verbosity {
            Verbosity::Debug | Verbosity::Trace => level.to_owned(),
            // winit warns of displays that are a little unusual, gilrs of systems without gamepads, arboard of those
            // without a clipboard manager.
            _ => format!("{level},winit=error,gilrs=off,gilrs_core=off,arboard=error"),
        })
    });
    let to_stderr = tracing_subscriber::fmt::layer()
        .with_writer(std::io::stderr)
        .with_target(verbosity >= Verbosity::Debug)
        .with_filter(filter);
    tracing_subscriber::registry().with(to_stderr).with(LogLines.with_filter(LevelFilter::INFO)).init();
}

/// The error and its causes as one line.
fn one_line(error: &anyhow::Error) -> String {
    format!("{error:#}").split_whitespace().collect::<Vec<_>>().join(" ")
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let io = error.downcast_ref::<std::io::Error>();
    io.is_some_and(|error| error.kind() == ErrorKind::BrokenPipe)
}
