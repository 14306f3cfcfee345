//! What is kept of the frames of a flight: a trace and a line each, written by a thread of their own, and a histogram.
//!
//! The frame thread neither waits for the disk nor touches the heap: it hands over plain records, and where the disk is so
//! slow that [`AHEAD`] of them wait, further ones are left out, and counted.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;

use anyhow::{Context, Result};

use super::trace::Trace;
use super::{FrameStats, Histogram, Memory, Passes, ResidentSet, Row};
use crate::{files, heap};

/// Frames that may wait to be written.
pub const AHEAD: usize = 256;

/// Frames by which the GPU's times come late, at most.
const LATE: usize = 8;

/// A frame's record.
#[derive(Clone, Copy, Debug)]
struct Entry {
    row: Row,
    stats: FrameStats,
}

/// Files that a flight leaves behind.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wanted<'a> {
    /// A Chrome trace.
    pub trace: Option<&'a Path>,
    /// A line of CSV per frame.
    pub stats: Option<&'a Path>,
}

/// Keeps what there is to know of a flight's frames.
#[derive(Debug, Default)]
pub struct Logbook {
    /// How long frames took.
    pub histogram: Histogram,
    frames: u64,
    /// Of this thread, when the last frame was done.
    allocations: u64,
    last_ns: Option<u64>,
    writing: Option<Writing>,
}

#[derive(Debug)]
struct Writing {
    to: SyncSender<Entry>,
    thread: JoinHandle<()>,
    missing: Arc<AtomicU64>,
    resident: ResidentSet,
}

impl Logbook {
    /// Begins the files that are wanted. One that cannot be written is done without, with a word about it: nobody's flight
    /// ends for that.
    pub fn open(wanted: &Wanted<'_>) -> Logbook {
        let mut outputs = Vec::new();
        let begin = |path, option, format| match Output::begin(path, option, format) {
            Ok(output) => Some(output),
            Err(error) => {
                tracing::warn!("going on without {option}: {error:#}");
                None
            }
        };
        outputs.extend(wanted.trace.and_then(|path| begin(path, "--trace", Format::Trace(Trace::default()))));
        outputs.extend(wanted.stats.and_then(|path| begin(path, "--stats", Format::Lines(VecDeque::new()))));
        let mut logbook = Logbook::default();
        if !outputs.is_empty() {
            let (to, from) = sync_channel(AHEAD);
            let missing = Arc::new(AtomicU64::new(0));
            let left_out = Arc::clone(&missing);
            let thread = std::thread::spawn(move || write(&from, outputs, &left_out));
            logbook.writing = Some(Writing { to, thread, missing, resident: ResidentSet::open() });
        }
        logbook
    }

    /// A frame was drawn `depth` octaves below the start, and shown. Give what else is known of memory; what this process
    /// has is added.
    pub fn frame(&mut self, stats: &FrameStats, depth: f64, memory: Memory) {
        let laps = stats.laps.as_slice();
        let Some(end_ns) = laps.last().map(|lap| lap.end_ns) else { return };
        let begin_ns = self.last_ns.unwrap_or(laps[0].begin_ns);
        let frame_ms = end_ns.saturating_sub(begin_ns) as f64 * 1e-6;
        self.last_ns = Some(end_ns);
        self.histogram.add(frame_ms);
        let frame = self.frames;
        self.frames += 1;
        let Some(writing) = &self.writing else { return };
        let rss_bytes = writing.resident.bytes();
        let memory = Memory { rss_bytes, heap_bytes: heap::live_bytes(), ..memory };
        let before = std::mem::replace(&mut self.allocations, heap::allocations());
        let allocations = if frame == 0 { 0 } else { self.allocations - before };
        let row = Row { frame, frame_ms, memory, allocations, ..Row::of(stats, depth) };
        // A thread that has given up has said so.
        if let Err(TrySendError::Full(_)) = writing.to.try_send(Entry { row, stats: *stats }) {
            writing.missing.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// The next frame begins a count of its own: what lies between is no frame's.
    pub fn pause(&mut self) {
        self.last_ns = None;
    }

    /// Ends the files, once all frames are in them.
    pub fn close(&mut self) {
        let Some(Writing { to, thread, missing, .. }) = self.writing.take() else { return };
        drop(to);
        if thread.join().is_err() {
            tracing::warn!("the trace or the figures of the frames may be incomplete");
        }
        let missing = missing.load(Ordering::Relaxed);
        if missing > 0 {
            tracing::warn!("{missing} frames are missing in the files: the disk is too slow for them");
        }
    }
}

impl Drop for Logbook {
    fn drop(&mut self) {
        self.close();
    }
}

/// A file being written.
struct Output {
    file: File,
    path: PathBuf,
    format: Format,
}

enum Format {
    Trace(Trace),
    /// Rows that wait for the GPU's times.
    Lines(VecDeque<Row>),
}

impl Output {
    fn begin(path: &Path, option: &str, format: Format) -> Result<Output> {
        files::prepare_file(path, option)?;
        let mut text = String::new();
        match &format {
            Format::Trace(trace) => trace.begin(&mut text),
            Format::Lines(_) => text.push_str(Row::CSV_HEAD),
        }
        let begun = File::create(path).and_then(|mut file| file.write_all(text.as_bytes()).map(|()| file));
        let file = begun.with_context(|| format!("cannot write {}", path.display()))?;
        Ok(Output { file, path: path.to_owned(), format })
    }

    /// Writes a frame at once: whatever happens next, the file has all frames so far.
    fn frame(&mut self, text: &mut String, Entry { row, stats }: &Entry) -> io::Result<()> {
        text.clear();
        match &mut self.format {
            Format::Trace(trace) => trace.frame(text, stats, row.depth),
            Format::Lines(rows) => {
                rows.push_back(*row);
                time(rows, stats.timed_serial, &stats.passes);
                let known = |row: &Row| row.serial <= stats.timed_serial;
                while rows.front().is_some_and(known) || rows.len() > LATE {
                    let Some(row) = rows.pop_front() else { break };
                    row.write_csv(text);
                }
            }
        }
        self.file.write_all(text.as_bytes())
    }

    fn end(mut self, text: &mut String, missing: u64) -> io::Result<()> {
        text.clear();
        match &self.format {
            Format::Trace(trace) => trace.end(text, missing),
            Format::Lines(rows) => rows.iter().for_each(|row| row.write_csv(text)),
        }
        self.file.write_all(text.as_bytes())
    }
}

/// Puts the GPU's times with their frame.
fn time(rows: &mut VecDeque<Row>, serial: u64, passes: &Passes) {
    if let Some(row) = rows.iter_mut().find(|row| row.serial == serial) {
        row.passes = *passes;
    }
}

/// Writes frames until there are no more, or no file is left that takes them.
fn write(from: &Receiver<Entry>, mut outputs: Vec<Output>, missing: &AtomicU64) {
    let mut text = String::with_capacity(16 * 1024);
    for entry in from {
        outputs.retain_mut(|output| match output.frame(&mut text, &entry) {
            Ok(()) => true,
            Err(error) => {
                complain(&output.path, &error);
                false
            }
        });
        if outputs.is_empty() {
            return;
        }
    }
    for output in outputs {
        let path = output.path.clone();
        if let Err(error) = output.end(&mut text, missing.load(Ordering::Relaxed)) {
            complain(&path, &error);
        }
    }
}

fn complain(path: &Path, error: &io::Error) {
    tracing::warn!("{} ends early: {error}; the flight goes on without it", path.display());
}
