//! The command line: text in, a [`Command`] of checked values out.

use std::ffi::{OsStr, OsString};
use std::fmt;
use std::ops::Range;
use std::path::PathBuf;
use std::str::FromStr;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{ArgAction, Args, Parser, Subcommand, ValueEnum};

use crate::address::MAX_LEVEL;
use crate::at::{self, Destination};
use crate::bookmarks;
use crate::export::MAX_CELLS;
use crate::flight::Flight;
use crate::world::World;

/// The deepest start, in octaves below the world's own.
pub const MAX_DEPTH: u32 = 1_000_000;
/// The longest side of a picture, in pixels: what Vulkan devices commonly allow.
pub const MAX_SIDE: u32 = 16_384;
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
    /// Cells a side, 1 to [`MAX_CELLS`].
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
    /// Which OpenXR runtime.
    pub runtime: RuntimeChoice,
    /// Sky and backdrop as a layer of the runtime's own, where it has such.
    pub backdrop_layer: bool,
    /// Wait for a headset where none answers.
    pub wait_for_headset: bool,
    /// Pixels of each eye; None: what the headset recommends.
    pub size: Option<Size>,
    /// Display rate to ask the headset for, in Hz.
    pub refresh_hz: Option<f32>,
    /// Quality stays as it begins, whatever frames take.
    pub fixed_quality: bool,
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
    /// Whose pictures to write.
    pub eyes: Eyes,
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

/// Pixels of a picture, each side 1 to [`MAX_SIDE`]. Written `640x480`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Size {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
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

/// Which OpenXR runtime runs the session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum RuntimeChoice {
    /// The system's where it answers with a headset, else the built-in mock.
    Auto,
    /// The system's, or fail.
    System,
    /// The built-in mock runtime.
    Mock,
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

/// The command asked for by this process's arguments.
///
/// Does not return where help was asked for (exit code 0) or the arguments make no sense (one sentence on stderr,
/// exit code 2).
pub fn parse() -> Command {
    match parse_from(std::env::args_os()) {
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

/// The command asked for by these arguments, the program's own name first.
///
/// # Errors
/// [`Stop`]: help to print, or what is wrong with the arguments.
pub fn parse_from(args: impl IntoIterator<Item = impl Into<OsString>>) -> Result<Command, Stop> {
    let args = with_default_command(args.into_iter().map(Into::into).collect());
    let raw = RawCommand::try_parse_from(&args).map_err(|error| stop(&error))?;
    raw.check()
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

const EXAMPLES: &str = "\
Examples:
  fathomless                                    see the default world
  fathomless view --world hills --depth 1000    another world, a thousand octaves down
  fathomless capture --out dive                 draw the default dive, a picture per eye and frame
  fathomless bench --html bench.html            what does a dive cost, at every depth?
  fathomless view --at dive/frame_000090_left.png    back to where a picture was drawn
  fathomless bookmarks                          the places you have marked
  fathomless export --cells 256 --out here.csv  heights as exact numbers, for other programs
  fathomless verify --tiles 2000                do the GPU and the CPU agree on every height?
  fathomless runtime --out mock.json            the mock runtime, for your own OpenXR application
  fathomless doctor                             what is missing on this machine?

Exit codes: 0 fine, 1 failed, 2 the command line makes no sense.
RUST_LOG, where set, decides what is logged instead of -v and -q.";

const VIEW_EXAMPLES: &str = "\
Examples:
  fathomless view                               the default world, on the headset if there is one, and in a window
  fathomless view --world tunkovic --seed 7     another world with a seed of your own
  fathomless view --at dive/frame_000090_left.png    where a picture was drawn
  fathomless view --at @mesa --flight dive      falling on from a bookmark
  fathomless view --runtime mock                on the built-in runtime, headset or not
  fathomless view --wait-for-headset --refresh-rate 90

In the window: W A S D, Space and C fly, Q and E roll, F takes the mouse to look around (Esc lets it go), the wheel
sets the speed, Z dives to the point under the cursor, X backs out, L levels up, R goes back to the start, M changes the
eye, P keeps the picture, B the place, F11 fills the screen, Esc ends.

Without a headset and a display it draws a three-second dive to captures/ and says where.";

const CAPTURE_EXAMPLES: &str = "\
Examples:
  fathomless capture                            the default dive, to captures/
  fathomless capture --frames 0..2 --size 512x512 --validate
  fathomless capture --flight over --world hills --eyes left --out over
  fathomless capture --flight my-flight.toml --depth 100000 --frames 120..180

  fathomless capture --flight dive-and-return --octaves 200 --shard 3/8

Frames do not depend on each other: several runs, on several machines, may each draw a part. --shard I/N splits the
frames into N parts (neighbours stay together) and draws the one numbered I, from 0 to N-1; the parts are disjoint,
together they are the whole, and their pictures are the same.
Every picture carries the address of its place, for --at. With --at and no --flight the one frame of that place is
drawn again; with --flight, the flight begins there: its depth 0 is the place's depth, its target the ground below.";

const BENCH_EXAMPLES: &str = "\
Examples:
  fathomless bench                              a dive and the way back, on the built-in runtime
  fathomless bench --flight dive --octaves 200 --json dive.json --html dive.html
  fathomless bench --flight still --depths 10,1000,100000
  fathomless bench --flight skim --frames 0..600 --size 1024x1024 --validate

Frames are flown one after the other as fast as they are done, and counted by decades of depth (0-9, 10-99, ...), or
by the depths asked for. CPU times are this program's own; where it waits, none passes.";

const EXPORT_EXAMPLES: &str = "\
Examples:
  fathomless export --out start.csv             257 x 257 heights around the world's start
  fathomless export --at dive/frame_000090_left.png --format png16 --out there.png
  fathomless export --at @mesa --cells 512 --format obj --out mesa.obj
  fathomless export --cells 2 --world hills     a few to stdout, with the address of the place

csv: whole numbers, in 1/65536 of the spacing. png16: 16-bit grey, 0 the lowest point and 65535 the highest; what that
means in spacings is in its text chunk. obj: a mesh in spacings. Heights count from the point 0,0 under the place.";

const BOOKMARKS_EXAMPLES: &str = "\
Examples:
  fathomless bookmarks                          all of them, with their addresses
  fathomless bookmarks add mesa --at dive/frame_000090_left.png
  fathomless bookmarks remove mesa
  fathomless view --at @mesa                    go there

They are in bookmarks.toml in your data folder; FATHOMLESS_DATA_DIR, where set, names another.";

const VERIFY_EXAMPLES: &str = "\
Examples:
  fathomless verify                             a quick look
  fathomless verify --tiles 2000 --depth 100000
  fathomless verify --world my-world.toml --validate";

const DOCTOR_EXAMPLES: &str = "\
Examples:
  fathomless doctor                             Vulkan, OpenXR and the display, and what to install
  fathomless doctor -v                          with every device and extension";

const RUNTIME_EXAMPLES: &str = "\
Examples:
  fathomless runtime --out mock.json            write the manifest
  fathomless runtime                            print it

Then, for any OpenXR application that draws with Vulkan:
  XR_RUNTIME_JSON=$PWD/mock.json your-application

The mock runtime is a headset made of nothing: real time, real images, no window, and every rule
of the specification checked. Inside the application it reads two more variables:
  FATHOMLESS_MOCK_LOG=FILE     a line of JSON for each life of the runtime goes there: calls with
                               results, rules broken, handles leaked, states, frames, vibrations
  FATHOMLESS_MOCK_SCRIPT=FILE  a TOML script: what the headset is like, and what happens to it";

const WORLDS_EXAMPLES: &str = "\
Examples:
  fathomless worlds                             each world's name and a line about it
  fathomless view --world hills                 see one of them
  fathomless view --world ./my-world.toml       or your own; the shipped files in config/worlds/ show how";

/// A VR headset viewer for a fractal landscape you can fall into for ever
#[derive(Parser)]
#[command(name = "fathomless", version, after_help = EXAMPLES, max_term_width = 100)]
#[command(override_usage = "fathomless [COMMAND] [OPTIONS]")]
struct RawCommand {
    #[command(subcommand)]
    action: RawAction,

    /// Turn the Vulkan validation layers on; anything they say makes the run fail
    #[arg(long, global = true, help_heading = "Options of every command")]
    validate: bool,

    /// Say more on stderr: -v what is done, -vv why, -vvv everything
    #[arg(short, long, global = true, help_heading = "Options of every command", action = ArgAction::Count)]
    verbose: u8,

    /// Say nothing on stderr but errors
    #[arg(short, long, global = true, help_heading = "Options of every command", conflicts_with = "verbose")]
    quiet: bool,
}

#[derive(Subcommand)]
enum RawAction {
    /// See the world (this is what happens where no command is given)
    #[command(after_help = VIEW_EXAMPLES)]
    View(RawView),
    /// Draw frames of a flight to PNG files
    #[command(after_help = CAPTURE_EXAMPLES)]
    Capture(RawCapture),
    /// Measure what a flight costs: time, work and memory over depth
    #[command(after_help = BENCH_EXAMPLES)]
    Bench(RawBench),
    /// Compare heights made on the GPU with the CPU's, bit for bit
    #[command(after_help = VERIFY_EXAMPLES)]
    Verify(RawVerify),
    /// Say what Vulkan, OpenXR and the display offer here, and what to install
    #[command(after_help = DOCTOR_EXAMPLES)]
    Doctor,
    /// List the worlds, with a line about each
    #[command(after_help = WORLDS_EXAMPLES)]
    Worlds,
    /// Write the heights around a place to a file for other programs
    #[command(after_help = EXPORT_EXAMPLES)]
    Export(RawExport),
    /// List, add and remove bookmarks: places by name
    #[command(after_help = BOOKMARKS_EXAMPLES)]
    Bookmarks {
        #[command(subcommand)]
        change: Option<RawBookmarks>,
    },
    /// Print or write the manifest of the mock runtime, for other OpenXR applications
    #[command(after_help = RUNTIME_EXAMPLES)]
    Runtime {
        /// The manifest, such as mock.json; stdout where not given
        #[arg(long, value_name = "FILE")]
        out: Option<PathBuf>,
    },
}

#[derive(Args)]
struct RawExport {
    /// Cells a side, 1 to 4096: more make the grid finer, not wider
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = cells, allow_negative_numbers = true)]
    cells: u32,

    /// Levels finer (and the grid narrower by as many octaves); negative: coarser and wider
    #[arg(long, value_name = "K", default_value_t = 0, value_parser = level_offset, allow_negative_numbers = true)]
    level_offset: i32,

    /// What to write: csv (exact numbers), png16 (a grey picture) or obj (a mesh)
    #[arg(long, value_enum, default_value_t = Format::Csv, value_name = "FORMAT", hide_possible_values = true)]
    format: Format,

    /// The file, written whole or not at all; stdout where not given (not for png16)
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    #[command(flatten)]
    place: RawPlaceArgs,
}

#[derive(Subcommand)]
enum RawBookmarks {
    /// Print all bookmarks (this is what happens where nothing is given)
    List,
    /// Add a bookmark
    Add {
        /// Its name: letters, digits, `-`, `_` and `.`
        #[arg(value_parser = bookmarks::Name::from_str)]
        name: bookmarks::Name,

        /// The place: an address, a picture drawn by fathomless, or a file with an address in it
        #[arg(long, value_name = "PLACE")]
        at: OsString,
    },
    /// Remove a bookmark
    Remove {
        /// Its name
        name: String,
    },
}

#[derive(Args)]
struct RawWorldArgs {
    #[arg(long, value_name = "NAME|FILE", value_parser = World::load, help = world_help())]
    world: Option<World>,

    /// Seed of the landscape, instead of the world's own: a whole number, decimal or 0x...
    #[arg(long, value_name = "SEED", value_parser = seed, allow_negative_numbers = true)]
    seed: Option<u64>,
}

/// Where to begin.
#[derive(Args)]
struct RawPlaceArgs {
    #[command(flatten)]
    world: RawWorldArgs,

    /// Octaves below the world's start to begin at, 0 to 1000000
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = depth, allow_negative_numbers = true)]
    depth: u32,

    /// Begin at a place: an address, @NAME of a bookmark, a picture drawn by fathomless, or a file with an address in it
    #[arg(long, value_name = "PLACE", conflicts_with_all = ["seed", "depth"])]
    at: Option<OsString>,
}

#[derive(Args)]
struct RawFlightArgs {
    #[arg(long, value_name = "NAME|FILE", value_parser = Flight::load, help = flight_help())]
    flight: Option<Flight>,

    /// Fly so many octaves instead of the flight's own; for dives and returns
    #[arg(long, value_name = "N", value_parser = octaves, allow_negative_numbers = true)]
    octaves: Option<u32>,

    /// OpenXR runtime: system, mock (the built-in one), or auto: the system's where it has a headset, else mock
    #[arg(long, value_enum, default_value_t = RuntimeChoice::Auto, value_name = "RUNTIME", hide_possible_values = true)]
    runtime: RuntimeChoice,
}

#[derive(Args)]
struct RawView {
    #[command(flatten)]
    place: RawPlaceArgs,

    #[command(flatten)]
    flight: RawFlightArgs,

    /// Hand sky and backdrop to the headset's runtime as a cubemap behind the eyes, where it takes one
    #[arg(long)]
    backdrop_layer: bool,

    /// Where no headset answers, ask again each second until one does
    #[arg(long)]
    wait_for_headset: bool,

    /// Pixels of each eye on a headset, where not given what it recommends; without one, of the picture in the window
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,

    /// Ask the headset to show so many frames per second, or the nearest it can
    #[arg(long, value_name = "HZ", value_parser = refresh_rate, allow_negative_numbers = true)]
    refresh_rate: Option<f32>,

    /// Leave the quality as it begins, even where frames come too slowly
    #[arg(long)]
    fixed_quality: bool,

    #[command(flatten)]
    records: RawRecords,
}

#[derive(Args)]
struct RawRecords {
    /// Write a trace of all frames to this file, for ui.perfetto.dev or chrome://tracing
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,

    /// Write the figures of each frame to this file as CSV
    #[arg(long, value_name = "FILE")]
    stats: Option<PathBuf>,
}

#[derive(Args)]
struct RawCapture {
    /// Folder for the pictures, made where it is missing
    #[arg(long, value_name = "DIR", default_value = "captures")]
    out: PathBuf,

    /// Frames to draw, from A up to, not including, B; all of the flight's where not given
    #[arg(long, value_name = "A..B", value_parser = frames)]
    frames: Option<Range<u64>>,

    /// Draw only part I of N, counted from 0, of those frames
    #[arg(
        long,
        value_name = "I/N",
        default_value = "0/1",
        hide_default_value = true,
        allow_negative_numbers = true
    )]
    shard: Shard,

    /// Pixels of one eye's picture
    #[arg(long, value_name = "WxH", default_value = "512x512")]
    size: Size,

    /// Whose pictures to write: both, left, right, or cube: the six faces of the backdrop
    #[arg(long, value_enum, default_value_t = Eyes::Both, value_name = "EYES", hide_possible_values = true)]
    eyes: Eyes,

    #[command(flatten)]
    place: RawPlaceArgs,

    #[command(flatten)]
    flight: RawFlightArgs,

    /// Refused with a sentence that says why: pictures are what the eyes' own images hold.
    #[arg(long, hide = true)]
    backdrop_layer: bool,
}

#[derive(Args)]
struct RawBench {
    #[arg(long, value_name = "NAME|FILE", default_value = "dive-and-return", value_parser = Flight::load, help = flight_help())]
    flight: Flight,

    /// Fly so many octaves instead of the flight's own; for dives and returns
    #[arg(long, value_name = "N", value_parser = octaves, allow_negative_numbers = true)]
    octaves: Option<u32>,

    /// Frames to fly, from A up to, not including, B; all of the flight's where not given
    #[arg(long, value_name = "A..B", value_parser = frames)]
    frames: Option<Range<u64>>,

    /// Octaves to add to the flight's depth, 0 to 1000000
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = depth, allow_negative_numbers = true)]
    depth: u32,

    /// Fly once for each of these depths, such as 10,1000,100000, and report on each
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', value_parser = depth, conflicts_with = "depth")]
    depths: Vec<u32>,

    /// Pixels of each eye
    #[arg(long, value_name = "WxH", default_value = "512x512")]
    size: Size,

    /// Make every frame complete, whatever it takes, instead of keeping to a budget
    #[arg(long)]
    complete: bool,

    /// Write the figures to this file as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,

    /// Write a page with charts to this file
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,

    #[command(flatten)]
    records: RawRecords,

    #[command(flatten)]
    world: RawWorldArgs,

    /// OpenXR runtime: mock (the built-in one), system, or auto: the system's where it has a headset, else mock
    #[arg(long, value_enum, default_value_t = RuntimeChoice::Mock, value_name = "RUNTIME", hide_possible_values = true)]
    runtime: RuntimeChoice,
}

#[derive(Args)]
struct RawVerify {
    /// How many tiles to compare, 1 to 10000000
    #[arg(long, value_name = "N", default_value_t = 500, value_parser = tiles, allow_negative_numbers = true)]
    tiles: u32,

    /// Deepest tile, in octaves below the world's start, 0 to 1000000
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = depth, allow_negative_numbers = true)]
    depth: u32,

    #[command(flatten)]
    world: RawWorldArgs,
}

impl RawCommand {
    fn check(self) -> Result<Command, Stop> {
        let verbosity = match (self.quiet, self.verbose) {
            (true, _) => Verbosity::Quiet,
            (false, 0) => Verbosity::Normal,
            (false, 1) => Verbosity::Info,
            (false, 2) => Verbosity::Debug,
            (false, _) => Verbosity::Trace,
        };
        Ok(Command { action: self.action.check()?, validate: self.validate, verbosity })
    }
}

impl RawAction {
    fn check(self) -> Result<Action, Stop> {
        Ok(match self {
            RawAction::View(raw) => {
                let RawView { backdrop_layer, wait_for_headset, size, refresh_rate: refresh_hz, .. } = raw;
                let (fixed_quality, RawRecords { trace, stats }) = (raw.fixed_quality, raw.records);
                differ(&[("--trace", &trace), ("--stats", &stats)])?;
                let runtime = raw.flight.runtime;
                let flight_asked = raw.flight.flight.is_some() || raw.flight.octaves.is_some();
                if wait_for_headset && runtime == RuntimeChoice::Mock {
                    return Err(Stop::Usage(
                        "the built-in runtime has no headset to wait for: give --wait-for-headset without --runtime mock"
                            .to_owned(),
                    ));
                }
                let Begin { world, depth, at, flight } = begin(raw.place, raw.flight)?;
                Action::View(View {
                    world,
                    depth,
                    at,
                    flight,
                    flight_asked,
                    runtime,
                    backdrop_layer,
                    wait_for_headset,
                    size,
                    refresh_hz,
                    fixed_quality,
                    trace,
                    stats,
                })
            }
            RawAction::Capture(raw) => Action::Capture(raw.check()?),
            RawAction::Bench(raw) => Action::Bench(raw.check()?),
            RawAction::Verify(raw) => {
                Action::Verify(Verify { tiles: raw.tiles, depth: raw.depth, world: raw.world.seeded()? })
            }
            RawAction::Doctor => Action::Doctor,
            RawAction::Worlds => Action::Worlds,
            RawAction::Export(raw) => Action::Export(raw.check()?),
            RawAction::Bookmarks { change } => Action::Bookmarks(match change {
                None | Some(RawBookmarks::List) => Bookmarks::List,
                Some(RawBookmarks::Add { name, at }) => Bookmarks::Add { name, at: destination(&at, true)? },
                Some(RawBookmarks::Remove { name }) => Bookmarks::Remove { name },
            }),
            RawAction::Runtime { out } => Action::Runtime { out: out.filter(|out| out.as_os_str() != "-") },
        })
    }
}

impl RawExport {
    fn check(self) -> Result<Export, Stop> {
        let out = self.out.filter(|out| out.as_os_str() != "-");
        if self.format == Format::Png16 && out.is_none() {
            return Err(Stop::Usage(
                "a picture needs a file: give one with --out, such as heights.png".to_owned(),
            ));
        }
        let (cells, level_offset, format) = (self.cells, self.level_offset, self.format);
        let (world, depth, at) = self.place.check(true)?;
        Ok(Export { world, depth, at, cells, level_offset, format, out })
    }
}

impl RawPlaceArgs {
    /// The world, the depth and the place; without a flight one `stays` at the place.
    fn check(self, stays: bool) -> Result<(World, u32, Option<Destination>), Stop> {
        let Some(at) = &self.at else { return Ok((self.world.seeded()?, self.depth, None)) };
        let at = destination(at, stays)?;
        let world =
            at.address.world(self.world.world.as_ref()).map_err(|error| Stop::Usage(error.to_string()))?;
        Ok((world, 0, Some(at)))
    }
}

fn destination(place: &OsStr, stays: bool) -> Result<Destination, Stop> {
    let address = at::find(place).map_err(|error| Stop::Usage(error.to_string()))?;
    Ok(Destination { address, stays })
}

/// Where a flight begins, and which it is.
struct Begin {
    world: World,
    depth: u32,
    at: Option<Destination>,
    flight: Flight,
}

fn begin(place: RawPlaceArgs, flight: RawFlightArgs) -> Result<Begin, Stop> {
    let (flight, octaves) = (flight.flight, flight.octaves);
    let (world, depth, at) = place.check(flight.is_none())?;
    let flight = match flight {
        Some(flight) => flight,
        None => {
            let name = if at.is_some() { STILL } else { default_flight() };
            Flight::load(name).map_err(|error| Stop::Usage(error.to_string()))?
        }
    };
    let flight = lengthened(flight, octaves)?;
    if let Some(at) = &at {
        let (level, deepest) = (at.address.level(), flight.deepest());
        if level as f64 + deepest > MAX_LEVEL as f64 {
            return Err(Stop::Usage(format!(
                "the flight `{}` goes {deepest} octaves deeper than this address's level {level}, and no address goes \
                 below level {MAX_LEVEL}; choose a flight that is not as deep",
                flight.name
            )));
        }
    }
    Ok(Begin { world, depth, at, flight })
}

impl RawCapture {
    fn check(self) -> Result<Capture, Stop> {
        if self.backdrop_layer {
            return Err(Stop::Usage(
                "`capture` cannot use --backdrop-layer: its pictures are the eyes' own images, and the sky would be \
                 missing from them; leave it out"
                    .into(),
            ));
        }
        let runtime = self.flight.runtime;
        let Begin { world, depth, at, flight } = begin(self.place, self.flight)?;
        // At a place where nothing moves, one frame is as good as all.
        let all = if at.as_ref().is_some_and(|at| at.stays) { 1 } else { flight.frames() };
        Ok(Capture {
            out: self.out,
            frames: frames_of(&flight, all, self.frames)?,
            shard: self.shard,
            size: self.size,
            eyes: self.eyes,
            world,
            depth,
            at,
            flight,
            runtime,
        })
    }
}

impl RawBench {
    fn check(self) -> Result<Bench, Stop> {
        let flight = lengthened(self.flight, self.octaves)?;
        let RawRecords { trace, stats } = self.records;
        differ(&[("--json", &self.json), ("--html", &self.html), ("--stats", &stats), ("--trace", &trace)])?;
        Ok(Bench {
            frames: frames_of(&flight, flight.frames(), self.frames)?,
            flight,
            depths: match self.depths.is_empty() {
                true => Depths::Once(self.depth),
                false => Depths::Each(self.depths),
            },
            size: self.size,
            world: self.world.seeded()?,
            complete: self.complete,
            json: self.json,
            html: self.html,
            stats,
            trace,
            runtime: self.runtime,
        })
    }
}

/// No two of these options name one file.
fn differ(files: &[(&str, &Option<PathBuf>)]) -> Result<(), Stop> {
    for (i, (option, path)) in files.iter().enumerate() {
        if let Some((other, _)) = files[..i].iter().find(|(_, before)| path.is_some() && *before == *path) {
            return Err(usage(&format!("{other} and {option} name the same file")));
        }
    }
    Ok(())
}

/// The flight over the octaves asked for.
fn lengthened(flight: Flight, octaves: Option<u32>) -> Result<Flight, Stop> {
    let Some(octaves) = octaves else { return Ok(flight) };
    flight.with_octaves(f64::from(octaves)).ok_or_else(|| {
        usage(&format!(
            "the flight `{}` cannot go over {octaves} octaves: it is no dive, or would end deeper than {MAX_DEPTH}",
            flight.name
        ))
    })
}

/// The frames asked for, else all of a flight, which has so many.
fn frames_of(flight: &Flight, all: u64, asked: Option<Range<u64>>) -> Result<Range<u64>, Stop> {
    let all = 0..all;
    let frames = asked.unwrap_or(all.clone());
    if frames.end > all.end {
        return Err(Stop::Usage(format!(
            "frames {}..{} go beyond the flight `{}`, which has {}; ask for frames within 0..{}",
            frames.start, frames.end, flight.name, all.end, all.end
        )));
    }
    Ok(frames)
}

impl RawWorldArgs {
    fn seeded(self) -> Result<World, Stop> {
        let mut world = match self.world {
            Some(world) => world,
            None => World::load(default_world()).map_err(|error| Stop::Usage(error.to_string()))?,
        };
        world.surface.seed = self.seed.unwrap_or(world.surface.seed);
        Ok(world)
    }
}

fn default_world() -> &'static str {
    World::names().next().unwrap_or_default()
}

fn default_flight() -> &'static str {
    Flight::names().next().unwrap_or_default()
}

/// The flight of somebody who stays at a place.
const STILL: &str = "still";

fn world_help() -> String {
    let names = World::names().collect::<Vec<_>>().join(", ");
    format!("The world: {names}, or a TOML file [default: {}, or the world of --at]", default_world())
}

fn flight_help() -> String {
    let names = Flight::names().collect::<Vec<_>>().join(", ");
    format!("The flight: {names}, or a TOML file [default: {}]", default_flight())
}

/// A value of an argument that makes no sense, as the end of clap's "invalid value 'X' for '--Y': ...".
#[derive(Clone, Debug, PartialEq, Eq)]
struct BadValue(String);

impl fmt::Display for BadValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for BadValue {}

/// A whole number within a range, both ends included.
fn whole(text: &str, least: u32, most: u32) -> Result<u32, BadValue> {
    let number = text.parse().ok().filter(|number| (least..=most).contains(number));
    number.ok_or_else(|| BadValue(format!("it should be a whole number from {least} to {most}")))
}

fn depth(text: &str) -> Result<u32, BadValue> {
    whole(text, 0, MAX_DEPTH)
}

fn octaves(text: &str) -> Result<u32, BadValue> {
    whole(text, 1, MAX_DEPTH)
}

fn refresh_rate(text: &str) -> Result<f32, BadValue> {
    let rate = text.parse().ok().filter(|hz| (1.0..=1000.0).contains(hz));
    rate.ok_or_else(|| BadValue("it should be a number from 1 to 1000".to_owned()))
}

fn tiles(text: &str) -> Result<u32, BadValue> {
    whole(text, 1, MAX_TILES)
}

fn cells(text: &str) -> Result<u32, BadValue> {
    whole(text, 1, MAX_CELLS)
}

/// Beyond these, a grid would be the whole world, or finer than a place is known.
fn level_offset(text: &str) -> Result<i32, BadValue> {
    let number = text.parse().ok().filter(|number| (-1_000_000..=1_000).contains(number));
    number.ok_or_else(|| BadValue("it should be a whole number from -1000000 to 1000".to_owned()))
}

fn seed(text: &str) -> Result<u64, BadValue> {
    let number = match text.strip_prefix("0x") {
        Some(digits) => u64::from_str_radix(digits, 16),
        None => text.parse(),
    };
    number.map_err(|_| BadValue(format!("it should be a whole number from 0 to {}", u64::MAX)))
}

fn frames(text: &str) -> Result<Range<u64>, BadValue> {
    let wrong = || BadValue("it should be A..B, such as 0..60 for the frames 0 to 59".to_owned());
    let (start, end) = text.split_once("..").ok_or_else(wrong)?;
    let frames: Range<u64> = start.parse().map_err(|_| wrong())?..end.parse().map_err(|_| wrong())?;
    if frames.is_empty() {
        let start = frames.start;
        let remedy = format!("B should be greater than A, such as {start}..{}", start.saturating_add(1));
        return Err(BadValue(format!("there is no frame in it; {remedy}")));
    }
    Ok(frames)
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Shard, String> {
        let parts = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        let shard = parts.map(|(index, count)| Shard { index, count });
        shard.filter(|s| s.index < s.count && s.count <= MAX_SHARDS).ok_or_else(|| {
            format!(
                "it should be I/N, part I of N counted from 0, such as 0/4 to 3/4, N at most {MAX_SHARDS}"
            )
        })
    }
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Size, String> {
        let side = |text: &str| text.parse().ok().filter(|side| (1..=MAX_SIDE).contains(side));
        let size = text
            .split_once('x')
            .and_then(|(width, height)| Some(Size { width: side(width)?, height: side(height)? }));
        size.ok_or_else(|| {
            format!("it should be WxH in pixels, such as 512x512, each side from 1 to {MAX_SIDE}")
        })
    }
}

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn claps_own_checks_hold() {
        RawCommand::command().debug_assert();
    }
}
