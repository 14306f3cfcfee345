//! Flies a flight through an OpenXR session as fast as frames are done, and reports what the frames cost.

mod html;
mod report;
mod svg;

use std::io::Write;
use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use anyhow::{Context, Result};
use indicatif::ProgressBar;

use crate::capture;
use crate::cli::Depths;
use crate::course::Course;
use crate::flight::{Flight, FlightPose};
use crate::telemetry::logbook::Wanted;
use crate::telemetry::{Logbook, Memory, Recorder, ResidentSet, Row, Span, Stopwatch};
use crate::viewer::{Remarks, Viewer, ViewerConfig};
use crate::world::World;
use crate::{files, heap};

pub use report::{AtDepth, Machine, Named, Quantiles, Report};

/// Frames drawn before the count begins: drivers compile and take their memory at the first ones.
const WARM_UP: usize = 12;

/// So many times a flight's frames it may take, where the backdrop slows it down.
const MOST_SLOWED: u64 = 4;

/// Frames drawn after the last that is counted, so that its GPU times come in.
const COOL_DOWN: usize = 4;

/// What to fly, and where.
#[derive(Clone, Debug)]
pub struct Subject<'a> {
    /// The world.
    pub world: &'a World,
    /// The flight.
    pub flight: &'a Flight,
    /// Frames of the flight.
    pub frames: Range<u64>,
    /// How deep.
    pub depths: Depths,
    /// A trace of the frames that count.
    pub trace: Option<&'a Path>,
    /// The session.
    pub viewer: ViewerConfig,
}

/// Flies, and closes the session. Ends early, with the figures so far, when `stop` becomes true.
///
/// # Errors
/// No runtime or device, a lost device: a sentence that says what to do.
pub fn fly(subject: &Subject<'_>, stop: &AtomicBool, progress: &ProgressBar) -> Result<(Report, Remarks)> {
    let depths = match &subject.depths {
        Depths::Once(depth) => std::slice::from_ref(depth),
        Depths::Each(depths) => depths.as_slice(),
    };
    let per_run = subject.frames.end - subject.frames.start;
    progress.set_length(per_run * depths.len() as u64);
    progress.set_message("opening the session");
    let mut viewer = Viewer::open(subject.world, &subject.viewer)?;
    let mut logbook = Logbook::open(&Wanted { trace: subject.trace, stats: None });
    let mut recorder = Recorder::new((MOST_SLOWED * per_run) as usize * depths.len());
    let mut runs = Vec::with_capacity(depths.len());
    let mut last = None;
    for &depth in depths {
        progress.set_message("finding the way down");
        drop(last.take());
        let mut course = Course::new(subject.world.surface, depth as usize, subject.flight.deepest(), |_| ());
        let mut run = Run { viewer: &mut viewer, course: &mut course, flight: subject.flight };
        progress.set_message("warming up");
        // From a first frame that has all its tiles, as if the flight had come that way.
        run.viewer.set_complete(true);
        run.hold(subject.frames.start, WARM_UP)?;
        run.viewer.set_complete(subject.viewer.complete);
        run.hold(subject.frames.start, 1)?;
        progress.set_message(format!("flying at {depth}"));
        let begun = recorder.rows.len();
        logbook.pause();
        run.fly(subject.frames.clone(), (&mut recorder, &mut logbook), stop, progress)?;
        runs.push((depth, begun..recorder.rows.len()));
        last = Some(course);
        if stop.load(Ordering::Relaxed) {
            break;
        }
    }
    if let Some(course) = &mut last {
        capture::finish(&mut viewer, &course.at(&subject.flight.pose(0)))?;
    }
    let mut report = Report::new(subject, &viewer, recorder.rows, &runs);
    report.stopped = stop.load(Ordering::Relaxed);
    let remarks = viewer.close()?;
    report.validation_messages = remarks.validation + remarks.violations;
    Ok((report, remarks))
}

/// One flight through the session.
struct Run<'a> {
    viewer: &'a mut Viewer,
    course: &'a mut Course,
    flight: &'a Flight,
}

impl Run<'_> {
    /// Draws the same frame again and again.
    fn hold(&mut self, frame: u64, times: usize) -> Result<()> {
        for _ in 0..times {
            capture::draw(self.viewer, &self.course.at(&self.flight.pose(frame)))?;
        }
        Ok(())
    }

    fn fly(
        &mut self,
        frames: Range<u64>,
        (recorder, logbook): (&mut Recorder, &mut Logbook),
        stop: &AtomicBool,
        progress: &ProgressBar,
    ) -> Result<()> {
        let resident = ResidentSet::open();
        let begun = progress.position();
        let mut done = Instant::now();
        let mut at = frames.start as f64;
        for _ in 0..MOST_SLOWED * (frames.end - frames.start) {
            if stop.load(Ordering::Relaxed) || at >= frames.end as f64 {
                break;
            }
            let allocated = heap::allocations();
            let mut watch = Stopwatch::start();
            let pose = pose(self.flight, at);
            let standpoint = self.course.at(&pose);
            watch.lap(Span::Place);
            let depth = standpoint.depth;
            capture::draw(self.viewer, &standpoint)?;
            let (now, allocations) = (Instant::now(), heap::allocations() - allocated);
            let mut stats = *self.viewer.stats();
            stats.surround(&watch);
            recorder.time(stats.timed_serial, &stats.passes);
            let row = Row {
                frame: at as u64,
                frame_ms: (now - done).as_secs_f64() * 1e3,
                memory: Memory {
                    rss_bytes: resident.bytes(),
                    gpu_bytes: self.viewer.gpu().memory_bytes(),
                    heap_bytes: heap::live_bytes(),
                    path_bytes: self.course.path_bytes() as u64,
                },
                allocations,
                ..Row::of(&stats, depth)
            };
            logbook.frame(&stats, depth, row.memory);
            // Where the viewer would outrun the backdrop he slows down, as in the headset.
            at += row.headroom;
            recorder.push(row);
            progress.set_position(begun + (at as u64).min(frames.end) - frames.start);
            done = now;
        }
        for _ in 0..COOL_DOWN {
            capture::draw(self.viewer, &self.course.at(&pose(self.flight, at)))?;
            let stats = self.viewer.stats();
            recorder.time(stats.timed_serial, &stats.passes);
        }
        Ok(())
    }
}

/// The pose of a flight at so many frames since its beginning, whole or not.
fn pose(flight: &Flight, frames: f64) -> FlightPose {
    match frames.fract() {
        0.0 => flight.pose(frames as u64),
        _ => flight.pose_at(frames / f64::from(flight.fps)),
    }
}

/// Writes a report's figures as JSON.
///
/// # Errors
/// The file cannot be written.
pub fn write_json(path: &Path, report: &Report) -> Result<()> {
    let text = serde_json::to_string_pretty(report).context("the figures do not fit JSON")?;
    write(path, &text)
}

/// Writes a report as a page with charts that needs nothing but itself.
///
/// # Errors
/// The file cannot be written.
pub fn write_html(path: &Path, report: &Report) -> Result<()> {
    write(path, &html::page(report))
}

/// Writes a line per frame, as CSV.
///
/// # Errors
/// The file cannot be written.
pub fn write_stats(path: &Path, report: &Report) -> Result<()> {
    write(path, &report.lines())
}

fn write(path: &Path, text: &str) -> Result<()> {
    files::write_whole(path, |file| writeln!(file, "{}", text.trim_end()))
        .with_context(|| format!("cannot write {}: is the disk full?", path.display()))
}
