//! What a foreign application did, as JSON: one line when its last instance is gone.

use std::{collections::BTreeMap, fs::OpenOptions, io::Write, path::Path};

use openxr::sys;
use serde::Serialize;

use super::state::State;

/// One life of the runtime in a process: from the first call to the end of the last instance.
#[derive(Serialize)]
struct Life<'a> {
    runtime: &'static str,
    version: &'static str,
    process: u32,
    /// False when the process ended, or let go of the runtime, with an instance alive.
    instances_destroyed: bool,
    /// Function to result code to how often it was returned.
    calls: BTreeMap<&'static str, BTreeMap<String, u64>>,
    /// Session states, in the order they were entered.
    states: Vec<String>,
    frames: Frames,
    violations: Vec<Violation<'a>>,
    leaks: Vec<Leak>,
    /// The last 1024 while focused.
    haptics: Vec<Haptic<'a>>,
}

#[derive(Serialize)]
struct Frames {
    /// Ended, with or without layers.
    submitted: u64,
    /// Ended with a projection layer.
    with_projection: u64,
    /// Of these, those whose views are what `xrLocateViews` last answered for their display time.
    as_located: u64,
}

#[derive(Serialize)]
struct Violation<'a> {
    function: &'static str,
    /// Which call of the function, from 1.
    call: u64,
    code: String,
    text: &'a str,
}

#[derive(Serialize)]
struct Leak {
    kind: &'static str,
    /// In hexadecimal, since JSON's numbers are too short for handles.
    handle: String,
}

#[derive(Serialize)]
struct Haptic<'a> {
    action: &'a str,
    subaction: Option<&'a str>,
    /// Nanoseconds; -1 is the shortest possible; null where the vibration was stopped.
    duration_ns: Option<i64>,
    frequency_hz: f32,
    amplitude: f32,
}

fn code_name(code: sys::Result) -> String {
    format!("XR_{code:?}")
}

impl<'a> Life<'a> {
    fn of(state: &'a State) -> Self {
        let journal = &state.journal;
        let mut calls = BTreeMap::<_, BTreeMap<_, _>>::new();
        for (&(function, code), &count) in &journal.results {
            calls.entry(function).or_default().insert(code_name(sys::Result::from_raw(code)), count);
        }
        Self {
            runtime: "Fathomless mock runtime",
            version: env!("CARGO_PKG_VERSION"),
            process: std::process::id(),
            instances_destroyed: state.instances.is_empty(),
            calls,
            states: journal.states.iter().map(|state| format!("{state:?}")).collect(),
            frames: Frames {
                submitted: journal.frames_submitted,
                with_projection: journal.frames_with_projection,
                as_located: journal.frames_as_located,
            },
            violations: journal
                .violations
                .iter()
                .map(|violation| Violation {
                    function: violation.function,
                    call: violation.call,
                    code: code_name(violation.code),
                    text: &violation.text,
                })
                .collect(),
            leaks: journal
                .leaks
                .iter()
                .map(|leak| Leak { kind: leak.kind, handle: format!("{:#x}", leak.handle) })
                .collect(),
            haptics: state
                .haptics
                .iter()
                .map(|haptic| Haptic {
                    action: &haptic.action,
                    subaction: haptic.subaction.as_deref(),
                    duration_ns: haptic.duration_ns,
                    frequency_hz: haptic.frequency_hz,
                    amplitude: haptic.amplitude,
                })
                .collect(),
        }
    }
}

/// Appends the life of a mock to a file: one line, one JSON object. Lines of several processes do not mix.
pub fn append(path: &Path, state: &State) -> std::io::Result<()> {
    let mut line = serde_json::to_vec(&Life::of(state))?;
    line.push(b'\n');
    OpenOptions::new().create(true).append(true).open(path)?.write_all(&line)
}
