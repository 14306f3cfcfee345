//! Draws frames of a flight to PNG files, each written whole or not at all.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use anyhow::{Context, Result, bail};
use indicatif::ProgressBar;

use crate::cli::Eyes;
use crate::course::Course;
use crate::flight::Flight;
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
    /// Frames of the flight.
    pub frames: Range<u64>,
    /// Only every so many-th of them, at least 1.
    pub every: usize,
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
    prepare_folder(job.out)?;
    let frames: Vec<u64> = job.frames.clone().step_by(job.every).collect();
    let deepest = job.flight.keyframes.iter().map(|k| k.pose.depth).fold(0.0, f64::max);
    progress.set_message("finding the way down");
    let mut course = Course::new(job.world.surface, job.depth, deepest, |_| ());
    progress.set_message("opening the session");
    let mut viewer = Viewer::open(job.world, &job.viewer)?;
    viewer.keep_pictures()?;
    let size = viewer.session_info().extent;
    progress.set_message("drawing");
    progress.set_length(frames.len() as u64);
    let start = Instant::now();
    let mut done = Done { pictures: 0, frames: 0, seconds: 0.0, stopped: false, remarks: Remarks::default() };
    for frame in frames {
        if stop.load(Ordering::Relaxed) {
            done.stopped = true;
            break;
        }
        draw(&mut viewer, &mut course, &job.flight.pose(frame))?;
        for (i, side) in sides(job.eyes).iter().enumerate() {
            let path = job.out.join(format!("frame_{frame:06}_{side}.png"));
            let (side, pixels) = match job.eyes {
                Eyes::Cube => face(&viewer.read_backdrop()?, i),
                Eyes::Both | Eyes::Left => ([size.width, size.height], viewer.picture(i)?),
                Eyes::Right => ([size.width, size.height], viewer.picture(1)?),
            };
            write_png(&path, side, &pixels)?;
            done.pictures += 1;
        }
        done.frames += 1;
        progress.inc(1);
    }
    done.seconds = start.elapsed().as_secs_f64();
    finish(&mut viewer, &mut course, &job.flight.pose(0))?;
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

/// Draws one pose, through the frames that a session wants without a picture.
fn draw(viewer: &mut Viewer, course: &mut Course, pose: &crate::flight::FlightPose) -> Result<()> {
    for _ in 0..PATIENCE {
        match viewer.frame(&course.at(pose), false)? {
            Step::Drew => return Ok(()),
            Step::Skipped => {}
            Step::Idle => std::thread::sleep(std::time::Duration::from_millis(5)),
            Step::Exited => bail!("the OpenXR runtime ended the session before the last frame; run it again"),
        }
    }
    bail!("the OpenXR runtime asks for no pictures: put the headset on, or use --runtime mock")
}

/// Ends the session as the runtime wants it ended.
fn finish(viewer: &mut Viewer, course: &mut Course, pose: &crate::flight::FlightPose) -> Result<()> {
    viewer.request_exit()?;
    for _ in 0..PATIENCE {
        match viewer.frame(&course.at(pose), false)? {
            Step::Exited => return Ok(()),
            Step::Idle => std::thread::sleep(std::time::Duration::from_millis(5)),
            Step::Drew | Step::Skipped => {}
        }
    }
    bail!("the OpenXR runtime does not end the session; restart it")
}

/// Makes the folder, and makes sure that it can be written, before any work is done.
///
/// # Errors
/// It cannot be made or written.
pub fn prepare_folder(out: &Path) -> Result<()> {
    let advice = || format!("cannot write to {}: choose another folder with --out", out.display());
    std::fs::create_dir_all(out).with_context(advice)?;
    let probe = partial(&out.join("probe"));
    File::create(&probe).with_context(advice)?;
    std::fs::remove_file(&probe).with_context(advice)
}

/// Writes an 8-bit RGB picture under another name, then renames it: nothing half-written is left behind.
///
/// # Errors
/// The disk is full or the folder is gone.
pub fn write_png(path: &Path, [width, height]: [u32; 2], rgb: &[u8]) -> Result<()> {
    let partial = partial(path);
    let written = encode(&partial, [width, height], rgb).and_then(|()| Ok(std::fs::rename(&partial, path)?));
    written
        .inspect_err(|_| {
            // Best effort: the error itself is what matters.
            let _ = std::fs::remove_file(&partial);
        })
        .with_context(|| format!("cannot write {}: is the disk full?", path.display()))
}

fn encode(path: &Path, [width, height]: [u32; 2], rgb: &[u8]) -> Result<()> {
    let mut file = BufWriter::new(File::create(path)?);
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    encoder.write_header()?.write_image_data(rgb)?;
    file.flush()?;
    Ok(())
}

fn partial(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(format!(".{}.partial", std::process::id()));
    PathBuf::from(name)
}
