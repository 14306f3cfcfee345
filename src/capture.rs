//! Draws frames of a flight to PNG files, each written whole or not at all.

use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use anyhow::{Context, Result, bail};
use indicatif::ProgressBar;

use crate::address::Scribe;
use crate::at::{self, Destination};
use crate::cli::{Eyes, Shard};
use crate::course::Standpoint;
use crate::files;
use crate::flight::Flight;
use crate::picture::{self, Note, Pixels};
use crate::viewer::{Faces, Remarks, Step, Viewer, ViewerConfig};
use crate::world::World;

/// Frames that a session may pass without a picture before that counts as an error.
const PATIENCE: u32 = 1_000;

/// What to draw, and where to.
#[derive(Clone, Debug)]
pub struct Job<'a> {
    /// The world.
    pub world: &'a World,
    /// The flight.
    pub flight: &'a Flight,
    /// Octaves to add to the flight's depth.
    pub depth: usize,
    /// Where the flight begins, instead of the world's start.
    pub at: Option<&'a Destination>,
    /// Frames of the flight.
    pub frames: Range<u64>,
    /// Only every so many-th of them, at least 1.
    pub every: usize,
    /// Which part of what is left.
    pub shard: Shard,
    /// Whose pictures to write.
    pub eyes: Eyes,
    /// The folder.
    pub out: &'a Path,
    /// The session.
    pub viewer: ViewerConfig,
}

/// What was done.
#[derive(Clone, Debug)]
pub struct Done {
    /// Pictures written.
    pub pictures: usize,
    /// Frames drawn.
    pub frames: usize,
    /// Seconds from the first frame to the last.
    pub seconds: f64,
    /// True if it was stopped early.
    pub stopped: bool,
    /// What validation had to say.
    pub remarks: Remarks,
}

/// Draws the job's frames. Ends early, with what is there, when `stop` becomes true.
///
/// # Errors
/// A folder that cannot be written, no runtime or device, a lost device: a sentence that says what to do.
pub fn capture(job: &Job<'_>, stop: &AtomicBool, progress: &ProgressBar) -> Result<Done> {
    let was_there = job.out.exists();
    files::prepare_folder(job.out, "--out")?;
    draw_frames(job, stop, progress).inspect_err(|_| {
        if !was_there {
            // Only an empty folder goes; pictures stay.
            let _ = std::fs::remove_dir(job.out);
        }
    })
}

fn draw_frames(job: &Job<'_>, stop: &AtomicBool, progress: &ProgressBar) -> Result<Done> {
    let every = job.every.max(1) as u64;
    let count = (job.frames.end.saturating_sub(job.frames.start)).div_ceil(every);
    let part = job.shard.part_of(count as usize);
    let frames = part.len() as u64;
    let first = job.frames.start + part.start as u64 * every;
    progress.set_message("finding the way down");
    let mut course = at::course(job.world, job.flight, job.depth, job.at);
    let mut scribe = Scribe::new(job.world);
    progress.set_message("opening the session");
    let mut viewer = Viewer::open(job.world, &job.viewer)?;
    viewer.keep_pictures()?;
    let size = viewer.session_info().extent;
    progress.set_message("drawing");
    progress.set_length(frames);
    let start = Instant::now();
    let mut done = Done { pictures: 0, frames: 0, seconds: 0.0, stopped: false, remarks: Remarks::default() };
    for frame in (0..frames).map(|i| first + i * every) {
        if stop.load(Ordering::Relaxed) {
            done.stopped = true;
            break;
        }
        let standpoint = course.at(&job.flight.pose(frame));
        draw(&mut viewer, &standpoint)?;
        let words = Words::about(job, frame, &standpoint, &mut scribe);
        let faces = (job.eyes == Eyes::Cube).then(|| viewer.read_backdrop()).transpose()?;
        for (i, side) in sides(job.eyes).iter().enumerate() {
            let path = job.out.join(format!("frame_{frame:06}_{side}.png"));
            let (side, pixels) = match &faces {
                Some(faces) => face(faces, i),
                None => {
                    let eye = if job.eyes == Eyes::Right { 1 } else { i };
                    ([size.width, size.height], viewer.picture(eye)?)
                }
            };
            picture::write(&path, side, Pixels::Rgb8(&pixels), &words.notes())
                .with_context(|| format!("cannot write {}: is the disk full?", path.display()))?;
            done.pictures += 1;
        }
        done.frames += 1;
        progress.inc(1);
    }
    done.seconds = start.elapsed().as_secs_f64();
    finish(&mut viewer, &course.at(&job.flight.pose(0)))?;
    done.remarks = viewer.close()?;
    Ok(done)
}

fn sides(eyes: Eyes) -> &'static [&'static str] {
    match eyes {
        Eyes::Both => &["left", "right"],
        Eyes::Left => &["left"],
        Eyes::Right => &["right"],
        Eyes::Cube => &["px", "nx", "py", "ny", "pz", "nz"],
    }
}

/// A face of the backdrop: its size and pixels.
fn face(faces: &Faces, face: usize) -> ([u32; 2], Vec<u8>) {
    let texels = faces.side * faces.side;
    let pixels = faces.colour[face * texels..(face + 1) * texels].iter().flat_map(|&[r, g, b, _]| [r, g, b]);
    ([faces.side as u32; 2], pixels.collect())
}

/// Draws from one standpoint, through the frames that a session wants without a picture.
///
/// # Errors
/// The session is over or lost, or never wants a picture.
pub(crate) fn draw(viewer: &mut Viewer, standpoint: &Standpoint<'_>) -> Result<()> {
    for _ in 0..PATIENCE {
        match viewer.frame(standpoint, false)? {
            Step::Drew => return Ok(()),
            Step::Skipped => {}
            Step::Idle => std::thread::sleep(std::time::Duration::from_millis(5)),
            Step::Exited => bail!("the OpenXR runtime ended the session before the last frame; run it again"),
        }
    }
    bail!("the OpenXR runtime asks for no pictures: put the headset on, or use --runtime mock")
}

/// Ends the session as the runtime wants it ended.
///
/// # Errors
/// The session is lost, or does not end.
pub(crate) fn finish(viewer: &mut Viewer, standpoint: &Standpoint<'_>) -> Result<()> {
    viewer.request_exit()?;
    for _ in 0..PATIENCE {
        match viewer.frame(standpoint, false)? {
            Step::Exited => return Ok(()),
            Step::Idle => std::thread::sleep(std::time::Duration::from_millis(5)),
            Step::Drew | Step::Skipped => {}
        }
    }
    bail!("the OpenXR runtime does not end the session; restart it")
}

/// What a picture says about itself.
struct Words {
    description: String,
    address: String,
}

impl Words {
    fn about(job: &Job<'_>, frame: u64, standpoint: &Standpoint<'_>, scribe: &mut Scribe) -> Words {
        let (world, flight) = (&job.world.name, &job.flight.name);
        let description =
            format!("{world}, {:.2} octaves below the start; frame {frame} of {flight}", standpoint.depth);
        Words { description, address: scribe.address(standpoint).to_string() }
    }

    fn notes(&self) -> [Note<'_>; 3] {
        picture::notes(&self.description, &self.address)
    }
}
