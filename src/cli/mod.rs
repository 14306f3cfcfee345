//! The command line: text in, a [`Command`] of checked values out.
//!
//! | file | noun |
//! |---|---|
//! | `args` | what the command line looks like |
//! | `values` | texts of single arguments and what they mean |
//! | `check` | arguments to commands |
//! | `help` | examples, and the names that help lists |

mod args;
mod check;
mod help;
mod values;

use std::ffi::OsString;
use std::ops::Range;
use std::path::PathBuf;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{CommandFactory, FromArgMatches, Subcommand, ValueEnum};

use crate::at::Destination;
use crate::bookmarks;
use crate::flight::Flight;
use crate::inspect::Inspect;
use crate::settings::{InForce, Settings, Sources, Surroundings};
pub use crate::settings::{MAX_SIDE, RuntimeChoice, Size};
use crate::world::World;
use args::{RawAction, RawCommand};

/// The deepest start, in octaves below the world's own.
pub const MAX_DEPTH: u32 = 1_000_000;
/// The most parts that a run can be split into.
pub const MAX_SHARDS: u32 = 1_000_000;
/// The most tiles `verify` takes on in one run.
pub const MAX_TILES: u32 = 10_000_000;

/// What to do, checked: worlds and flights are loaded, numbers are in range.
#[derive(Clone, Debug, PartialEq)]
pub struct Command {
    /// Which command, with its own values.
    pub action: Action,
    /// Turn the Vulkan validation layers on and end in failure if they say anything.
    pub validate: bool,
    /// How much to say on stderr.
    pub verbosity: Verbosity,
}

/// The commands.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// See the world.
    View(View),
    /// Draw frames of a flight to files.
    Capture(Capture),
    /// Measure what a flight costs.
    Bench(Bench),
    /// Compare the GPU's heights with the CPU's.
    Verify(Verify),
    /// Say what this machine offers.
    Doctor,
    /// List the worlds.
    Worlds,
    /// Write heights for other programs.
    Export(Export),
    /// List or change the bookmarks.
    Bookmarks(Bookmarks),
    /// Give out the mock runtime's manifest.
    Runtime {
        /// The file; None is stdout.
        out: Option<PathBuf>,
    },
    /// List the shaders, or write them.
    Shaders {
        /// The folder to write them to; None lists them.
        out: Option<PathBuf>,
    },
    /// Print the settings.
    Settings(Shown),
}

/// `settings`: what is printed.
#[derive(Clone, Debug, PartialEq)]
pub enum Shown {
    /// The manual.
    Manual,
    /// What is in force, and the user's own file.
    InForce(Box<InForce>, Option<PathBuf>),
}

/// `export`: write the heights around a place for other programs.
#[derive(Clone, Debug, PartialEq)]
pub struct Export {
    /// The world, with the seed asked for.
    pub world: World,
    /// Octaves below the world's start, 0 to [`MAX_DEPTH`].
    pub depth: u32,
    /// The place, instead of the world's start.
    pub at: Option<Destination>,
    /// Cells a side, 1 to [`MAX_CELLS`](crate::export::MAX_CELLS).
    pub cells: u32,
    /// Levels finer than the cells would be; negative: coarser.
    pub level_offset: i32,
    /// What to write.
    pub format: Format,
    /// The file; None is stdout, which no picture goes to.
    pub out: Option<PathBuf>,
}

/// How heights are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Exact integers as text.
    Csv,
    /// A 16-bit greyscale picture.
    Png16,
    /// A mesh, Wavefront OBJ.
    Obj,
}

/// `bookmarks`: list or change them.
#[derive(Clone, Debug, PartialEq)]
pub enum Bookmarks {
    /// Print all of them.
    List,
    /// Add one.
    Add {
        /// Its name.
        name: bookmarks::Name,
        /// Its place.
        at: Destination,
    },
    /// Remove one.
    Remove {
        /// Its name.
        name: String,
    },
}

/// `view`: see the world.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// The world, with the seed asked for.
    pub world: World,
    /// Octaves below the world's start to begin at, 0 to [`MAX_DEPTH`].
    pub depth: u32,
    /// Where to begin, instead of the world's start.
    pub at: Option<Destination>,
    /// What to fly where nobody steers.
    pub flight: Flight,
    /// The flight was asked for: it begins by itself where somebody could steer, too.
    pub flight_asked: bool,
    /// Everything that can be set, with the options of the command line.
    pub settings: Box<InForce>,
    /// Where that comes from.
    pub sources: Sources,
    /// Wait for a headset where none answers.
    pub wait_for_headset: bool,
    /// Quality stays as it begins, whatever frames take.
    pub fixed_quality: bool,
    /// A folder of shaders that take the place of the built-in ones.
    pub shaders: Option<PathBuf>,
    /// A trace of the frames.
    pub trace: Option<PathBuf>,
    /// Figures of each frame, as CSV.
    pub stats: Option<PathBuf>,
}

/// `capture`: draw frames of a flight to files.
#[derive(Clone, Debug, PartialEq)]
pub struct Capture {
    /// The folder for the pictures.
    pub out: PathBuf,
    /// The frames to draw, within the flight's, never empty.
    pub frames: Range<u64>,
    /// Which part of them.
    pub shard: Shard,
    /// Pixels of one eye's picture.
    pub size: Size,
    /// Samples of a pixel; None: what suits the device.
    pub samples: Option<u32>,
    /// Whose pictures to write.
    pub eyes: Eyes,
    /// What they show otherwise than usual.
    pub show: Inspect,
    /// The world, with the seed asked for.
    pub world: World,
    /// Octaves to add to the flight's depth, 0 to [`MAX_DEPTH`].
    pub depth: u32,
    /// Where the flight begins, instead of the world's start.
    pub at: Option<Destination>,
    /// The flight.
    pub flight: Flight,
    /// Which OpenXR runtime.
    pub runtime: RuntimeChoice,
    /// A folder of shaders that take the place of the built-in ones.
    pub shaders: Option<PathBuf>,
}

/// `bench`: measure what a flight costs.
#[derive(Clone, Debug, PartialEq)]
pub struct Bench {
    /// The flight.
    pub flight: Flight,
    /// The frames to fly, within the flight's, never empty.
    pub frames: Range<u64>,
    /// Where to fly them.
    pub depths: Depths,
    /// Pixels of each eye.
    pub size: Size,
    /// The world, with the seed asked for.
    pub world: World,
    /// Samples of a pixel; None: what suits the device.
    pub samples: Option<u32>,
    /// Every frame complete, whatever it takes, instead of within a budget.
    pub complete: bool,
    /// Where to write the figures as JSON.
    pub json: Option<PathBuf>,
    /// Where to write a page with charts.
    pub html: Option<PathBuf>,
    /// Where to write a line per frame.
    pub stats: Option<PathBuf>,
    /// A trace of the frames.
    pub trace: Option<PathBuf>,
    /// Which OpenXR runtime.
    pub runtime: RuntimeChoice,
}

/// How deep a flight is flown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Depths {
    /// Once, so many octaves deeper than it says.
    Once(u32),
    /// Once for each of these, one or more.
    Each(Vec<u32>),
}

/// One of several parts of a run, that together are the whole and have nothing in common. Written `0/4`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which part, below `count`.
    pub index: u32,
    /// How many parts, 1 to [`MAX_SHARDS`].
    pub count: u32,
}

impl Shard {
    /// The only part.
    pub const WHOLE: Shard = Shard { index: 0, count: 1 };

    /// The part of so many things in a row: neighbours stay together, no part is longer than another by more than one.
    pub fn part_of(self, things: usize) -> Range<usize> {
        let border = |i: u32| (things as u128 * u128::from(i) / u128::from(self.count)) as usize;
        border(self.index)..border(self.index + 1)
    }
}

/// `verify`: compare the GPU's heights with the CPU's.
#[derive(Clone, Debug, PartialEq)]
pub struct Verify {
    /// How many tiles, 1 to [`MAX_TILES`].
    pub tiles: u32,
    /// The deepest of them, in octaves below the start, 0 to [`MAX_DEPTH`].
    pub depth: u32,
    /// The world, with the seed asked for.
    pub world: World,
}

/// Which eyes' pictures are written. Both are always drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Eyes {
    /// A picture for each eye.
    Both,
    /// The left eye's only.
    Left,
    /// The right eye's only.
    Right,
    /// The six faces of the backdrop instead: what is too far away to show parallax, without air.
    Cube,
}

/// How much to say on stderr.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verbosity {
    /// Errors only, and no progress bar (`-q`).
    Quiet,
    /// Warnings and progress.
    Normal,
    /// What is done, step by step (`-v`).
    Info,
    /// And why (`-vv`).
    Debug,
    /// Everything (`-vvv`).
    Trace,
}

/// Why there is no command to run: help was asked for, or the arguments make no sense.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Stop {
    /// Text for stdout; the exit code is 0.
    Help(String),
    /// One sentence for stderr; the exit code is 2.
    Usage(String),
}

/// The command asked for by this process's arguments, with the settings that this process finds.
///
/// Does not return where help was asked for (exit code 0) or the arguments make no sense (one sentence on stderr,
/// exit code 2).
pub fn parse() -> Command {
    match parse_within(std::env::args_os(), Surroundings::of_process()) {
        Ok(command) => command,
        Err(Stop::Help(text)) => {
            print(std::io::stdout(), &text);
            std::process::exit(0)
        }
        Err(Stop::Usage(sentence)) => {
            print(std::io::stderr(), &format!("error: {sentence}\n"));
            std::process::exit(2)
        }
    }
}

/// Writes a text; where nobody reads it any more, that is no failure of ours.
fn print(mut to: impl std::io::Write, text: &str) {
    let _ = to.write_all(text.as_bytes());
}

/// The command asked for by these arguments, the program's own name first, with no settings but those named there.
///
/// # Errors
/// [`Stop`]: help to print, or what is wrong with the arguments.
pub fn parse_from(args: impl IntoIterator<Item = impl Into<OsString>>) -> Result<Command, Stop> {
    parse_within(args, Surroundings::default())
}

/// The same with the settings of some surroundings.
///
/// # Errors
/// As [`parse_from`], and what is wrong with the settings.
pub fn parse_within(
    args: impl IntoIterator<Item = impl Into<OsString>>,
    around: Surroundings,
) -> Result<Command, Stop> {
    let args = with_default_command(args.into_iter().map(Into::into).collect());
    let sources = Sources { around, ..Sources::default() };
    // Help names the keys as they are.
    let settings = sources.load().map_or_else(|_| Settings::default(), |in_force| in_force.settings);
    let command =
        RawCommand::command().mut_subcommand("view", |view| view.after_help(help::view_examples(&settings)));
    let matches = command.try_get_matches_from(&args).map_err(|error| stop(&error))?;
    let raw = RawCommand::from_arg_matches(&matches).map_err(|error| stop(&error))?;
    raw.check(sources)
}

/// `fathomless --world hills` means `fathomless view --world hills`: puts `view` in where no command is named.
fn with_default_command(mut args: Vec<OsString>) -> Vec<OsString> {
    let is_global = |arg: &OsString| {
        let text = arg.to_string_lossy();
        let short =
            text.strip_prefix('-').is_some_and(|s| !s.is_empty() && s.chars().all(|c| "vq".contains(c)));
        short || ["--verbose", "--quiet", "--validate"].contains(&text.as_ref())
    };
    let first = (1..args.len()).find(|&i| !is_global(&args[i])).unwrap_or(args.len());
    let own = ["-h", "--help", "-V", "--version"];
    let names_none = args.get(first).is_none_or(|arg| {
        let text = arg.to_string_lossy();
        text.starts_with('-') && !own.contains(&text.as_ref())
    });
    if names_none && !args.is_empty() {
        args.insert(first, "view".into());
    }
    args
}

/// One sentence from clap's paragraphs: what is wrong, the tips, and where to read more.
fn stop(error: &clap::Error) -> Stop {
    let text = error.render().to_string();
    if !error.use_stderr() {
        return Stop::Help(text);
    }
    if error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        return usage("a command is missing");
    }
    let mut paragraphs = text.split("\n\n");
    let words = |paragraph: &str| paragraph.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut sentence = words(paragraphs.next().unwrap_or_default());
    for tip in paragraphs.filter(|paragraph| paragraph.trim_start().starts_with("tip:")) {
        sentence.push_str(&format!(" ({})", words(tip).trim_start_matches("tip: ")));
    }
    // Our own parsers' sentences already say what to do.
    let ours = error.kind() == ErrorKind::ValueValidation;
    if let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidArg)
        && RawAction::has_subcommand(word)
    {
        return usage(&format!("the command `{word}` should come before its options"));
    }
    let sentence = sentence.trim_start_matches("error: ").to_owned();
    if ours { Stop::Usage(sentence) } else { usage(&sentence) }
}

fn usage(sentence: &str) -> Stop {
    Stop::Usage(format!("{sentence}; `fathomless --help` shows what there is"))
}
