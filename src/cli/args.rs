//! What the command line looks like: [`clap`]'s part of it.

use std::ffi::OsString;
use std::ops::Range;
use std::path::PathBuf;
use std::str::FromStr;

use clap::{ArgAction, Args, Parser, Subcommand};

use super::help::*;
use super::values::*;
use super::{Eyes, Format, RuntimeChoice, Shard, Size};
use crate::bookmarks;
use crate::flight::Flight;
use crate::inspect::Inspect;
use crate::world::World;

/// A VR headset viewer for a fractal landscape you can fall into for ever
#[derive(Parser)]
#[command(name = "fathomless", version, after_help = EXAMPLES, max_term_width = 100)]
#[command(override_usage = "fathomless [COMMAND] [OPTIONS]")]
pub(super) struct RawCommand {
    #[command(subcommand)]
    pub(super) action: RawAction,

    /// Turn the Vulkan validation layers on; anything they say makes the run fail
    #[arg(long, global = true, help_heading = "Options of every command")]
    pub(super) validate: bool,

    /// Say more on stderr: -v what is done, -vv why, -vvv everything
    #[arg(short, long, global = true, help_heading = "Options of every command", action = ArgAction::Count)]
    pub(super) verbose: u8,

    /// Say nothing on stderr but errors
    #[arg(short, long, global = true, help_heading = "Options of every command", conflicts_with = "verbose")]
    pub(super) quiet: bool,
}

#[derive(Subcommand)]
pub(super) enum RawAction {
    /// See the world (this is what happens where no command is given)
    View(RawView),
    /// Draw frames of a flight to PNG files
    #[command(after_help = capture_help())]
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
    /// List the shaders that are built in, or write them to a folder, to be changed and used with --shaders
    #[command(after_help = SHADERS_EXAMPLES)]
    Shaders {
        /// Write them to this folder, which is made where it is missing
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
    },
    /// Print the settings in force, and where each comes from
    #[command(after_help = SETTINGS_EXAMPLES)]
    Settings {
        #[command(flatten)]
        settings: RawSettingsArgs,

        /// Print the manual instead: every setting with what it does and its built-in value
        #[arg(long, conflicts_with_all = ["config", "set"])]
        manual: bool,
    },
}

#[derive(Args)]
pub(super) struct RawSettingsArgs {
    /// Settings from this file, over those of your own fathomless.toml
    #[arg(long, value_name = "FILE")]
    pub(super) config: Option<PathBuf>,

    /// One setting, such as motion.speed=2; may be repeated (`fathomless settings` lists them all)
    #[arg(long, value_name = "SECTION.KEY=VALUE")]
    pub(super) set: Vec<String>,
}

#[derive(Args)]
pub(super) struct RawExport {
    /// Cells a side, 1 to 4096: more make the grid finer, not wider
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = cells, allow_negative_numbers = true)]
    pub(super) cells: u32,

    /// Levels finer (and the grid narrower by as many octaves); negative: coarser and wider
    #[arg(long, value_name = "K", default_value_t = 0, value_parser = level_offset, allow_negative_numbers = true)]
    pub(super) level_offset: i32,

    /// What to write: csv (exact numbers), png16 (a grey picture) or obj (a mesh)
    #[arg(long, value_enum, default_value_t = Format::Csv, value_name = "FORMAT", hide_possible_values = true)]
    pub(super) format: Format,

    /// The file, written whole or not at all; stdout where not given (not for png16)
    #[arg(long, value_name = "FILE")]
    pub(super) out: Option<PathBuf>,

    #[command(flatten)]
    pub(super) place: RawPlaceArgs,
}

#[derive(Subcommand)]
pub(super) enum RawBookmarks {
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
pub(super) struct RawWorldArgs {
    #[arg(long, value_name = "NAME|FILE", value_parser = World::load, help = world_help())]
    pub(super) world: Option<World>,

    /// Seed of the landscape, instead of the world's own: a whole number, decimal or 0x...
    #[arg(long, value_name = "SEED", value_parser = seed, allow_negative_numbers = true)]
    pub(super) seed: Option<u64>,
}

/// Where to begin.
#[derive(Args)]
pub(super) struct RawPlaceArgs {
    #[command(flatten)]
    pub(super) world: RawWorldArgs,

    /// Octaves below the world's start to begin at, 0 to 1000000
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = depth, allow_negative_numbers = true)]
    pub(super) depth: u32,

    /// Begin at a place: an address, @NAME of a bookmark, a picture drawn by fathomless, or a file with an address in it
    #[arg(long, value_name = "PLACE", conflicts_with_all = ["seed", "depth"])]
    pub(super) at: Option<OsString>,
}

#[derive(Args)]
pub(super) struct RawFlightArgs {
    #[arg(long, value_name = "NAME|FILE", value_parser = Flight::load, help = flight_help())]
    pub(super) flight: Option<Flight>,

    /// Fly so many octaves instead of the flight's own; for dives and returns
    #[arg(long, value_name = "N", value_parser = octaves, allow_negative_numbers = true)]
    pub(super) octaves: Option<u32>,

    /// OpenXR runtime: system, mock (the built-in one), or auto: the system's where it has a headset, else mock
    #[arg(long, value_enum, value_name = "RUNTIME", hide_possible_values = true)]
    pub(super) runtime: Option<RuntimeChoice>,

    /// Draw with the shaders of this folder (`fathomless shaders` makes one); `view` takes up changes as they are saved
    #[arg(long, value_name = "DIR")]
    pub(super) shaders: Option<PathBuf>,
}

#[derive(Args)]
pub(super) struct RawView {
    #[command(flatten)]
    pub(super) place: RawPlaceArgs,

    #[command(flatten)]
    pub(super) flight: RawFlightArgs,

    /// Hand sky and backdrop to the headset's runtime as a cubemap behind the eyes, where it takes one
    #[arg(long)]
    pub(super) backdrop_layer: bool,

    /// Where no headset answers, ask again each second until one does
    #[arg(long)]
    pub(super) wait_for_headset: bool,

    /// Pixels of each eye on a headset, where not given what it recommends; without one, of the picture in the window
    #[arg(long, value_name = "WxH")]
    pub(super) size: Option<Size>,

    /// Samples of a pixel, 1, 2, 4 or 8: more smooth the edges of ridges against the sky
    #[arg(long, value_name = "N", value_parser = samples, allow_negative_numbers = true)]
    pub(super) samples: Option<u32>,

    /// Ask the headset to show so many frames per second, or the nearest it can
    #[arg(long, value_name = "HZ", value_parser = refresh_rate, allow_negative_numbers = true)]
    pub(super) refresh_rate: Option<f32>,

    /// Leave the quality as it begins, even where frames come too slowly
    #[arg(long)]
    pub(super) fixed_quality: bool,

    #[command(flatten)]
    pub(super) records: RawRecords,

    #[command(flatten)]
    pub(super) settings: RawSettingsArgs,
}

#[derive(Args)]
pub(super) struct RawRecords {
    /// Write a trace of all frames to this file, for ui.perfetto.dev or chrome://tracing
    #[arg(long, value_name = "FILE")]
    pub(super) trace: Option<PathBuf>,

    /// Write the figures of each frame to this file as CSV
    #[arg(long, value_name = "FILE")]
    pub(super) stats: Option<PathBuf>,
}

#[derive(Args)]
pub(super) struct RawCapture {
    /// Folder for the pictures, made where it is missing
    #[arg(long, value_name = "DIR", default_value = "captures")]
    pub(super) out: PathBuf,

    /// Frames to draw, from A up to, not including, B; all of the flight's where not given
    #[arg(long, value_name = "A..B", value_parser = frames)]
    pub(super) frames: Option<Range<u64>>,

    /// Draw only part I of N, counted from 0, of those frames
    #[arg(
        long,
        value_name = "I/N",
        default_value = "0/1",
        hide_default_value = true,
        allow_negative_numbers = true
    )]
    pub(super) shard: Shard,

    /// Pixels of one eye's picture
    #[arg(long, value_name = "WxH", default_value = "512x512")]
    pub(super) size: Size,

    /// Samples of a pixel, 1, 2, 4 or 8; where not given, 4 on a GPU and 1 where the processor draws
    #[arg(long, value_name = "N", value_parser = samples, allow_negative_numbers = true)]
    pub(super) samples: Option<u32>,

    /// Whose pictures to write: both, left, right, or cube: the six faces of the backdrop
    #[arg(long, value_enum, default_value_t = Eyes::Both, value_name = "EYES", hide_possible_values = true)]
    pub(super) eyes: Eyes,

    /// Show how it works: words with commas between, explained below, such as wireframe,levels
    #[arg(long, value_name = "LIST", value_parser = Inspect::from_str)]
    pub(super) show: Option<Inspect>,

    #[command(flatten)]
    pub(super) place: RawPlaceArgs,

    #[command(flatten)]
    pub(super) flight: RawFlightArgs,

    /// Refused with a sentence that says why: pictures are what the eyes' own images hold.
    #[arg(long, hide = true)]
    pub(super) backdrop_layer: bool,
}

#[derive(Args)]
pub(super) struct RawBench {
    #[arg(long, value_name = "NAME|FILE", default_value = "dive-and-return", value_parser = Flight::load, help = flight_help())]
    pub(super) flight: Flight,

    /// Fly so many octaves instead of the flight's own; for dives and returns
    #[arg(long, value_name = "N", value_parser = octaves, allow_negative_numbers = true)]
    pub(super) octaves: Option<u32>,

    /// Frames to fly, from A up to, not including, B; all of the flight's where not given
    #[arg(long, value_name = "A..B", value_parser = frames)]
    pub(super) frames: Option<Range<u64>>,

    /// Octaves to add to the flight's depth, 0 to 1000000
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = depth, allow_negative_numbers = true)]
    pub(super) depth: u32,

    /// Fly once for each of these depths, such as 10,1000,100000, and report on each
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', value_parser = depth, conflicts_with = "depth")]
    pub(super) depths: Vec<u32>,

    /// Pixels of each eye
    #[arg(long, value_name = "WxH", default_value = "512x512")]
    pub(super) size: Size,

    /// Samples of a pixel, 1, 2, 4 or 8; where not given, 4 on a GPU and 1 where the processor draws
    #[arg(long, value_name = "N", value_parser = samples, allow_negative_numbers = true)]
    pub(super) samples: Option<u32>,

    /// Make every frame complete, whatever it takes, instead of keeping to a budget
    #[arg(long)]
    pub(super) complete: bool,

    /// Write the figures to this file as JSON
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,

    /// Write a page with charts to this file
    #[arg(long, value_name = "FILE")]
    pub(super) html: Option<PathBuf>,

    #[command(flatten)]
    pub(super) records: RawRecords,

    #[command(flatten)]
    pub(super) world: RawWorldArgs,

    /// OpenXR runtime: mock (the built-in one), system, or auto: the system's where it has a headset, else mock
    #[arg(long, value_enum, default_value_t = RuntimeChoice::Mock, value_name = "RUNTIME", hide_possible_values = true)]
    pub(super) runtime: RuntimeChoice,
}

#[derive(Args)]
pub(super) struct RawVerify {
    /// How many tiles to compare, 1 to 10000000
    #[arg(long, value_name = "N", default_value_t = 500, value_parser = tiles, allow_negative_numbers = true)]
    pub(super) tiles: u32,

    /// Deepest tile, in octaves below the world's start, 0 to 1000000
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = depth, allow_negative_numbers = true)]
    pub(super) depth: u32,

    #[command(flatten)]
    pub(super) world: RawWorldArgs,
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
