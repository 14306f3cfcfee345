//! Arguments to commands: worlds, flights and places are loaded, and what does not go together is refused.

use std::ffi::OsStr;
use std::ops::Range;
use std::path::PathBuf;

use toml::Value;

use super::args::*;
use super::help::{default_flight, default_world};
use super::{
    Action, Bench, Bookmarks, Capture, Command, Depths, Export, Eyes, Format, MAX_DEPTH, RuntimeChoice,
    Shard, Shown, Stop, Verbosity, Verify, View, usage,
};
use crate::address::MAX_LEVEL;
use crate::at::{self, Destination};
use crate::flight::Flight;
use crate::settings::{InForce, Sources};
use crate::world::World;

impl RawCommand {
    pub(super) fn check(self, sources: Sources) -> Result<Command, Stop> {
        let verbosity = match (self.quiet, self.verbose) {
            (true, _) => Verbosity::Quiet,
            (false, 0) => Verbosity::Normal,
            (false, 1) => Verbosity::Info,
            (false, 2) => Verbosity::Debug,
            (false, _) => Verbosity::Trace,
        };
        let action = self.action.check(sources)?;
        let asked = matches!(&action, Action::View(view) if view.settings.settings.view.validate);
        Ok(Command { action, validate: self.validate || asked, verbosity })
    }
}

impl RawAction {
    fn check(self, sources: Sources) -> Result<Action, Stop> {
        Ok(match self {
            RawAction::View(raw) => Action::View(raw.check(sources)?),
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
            RawAction::Settings { manual: true, .. } => Action::Settings(Shown::Manual),
            RawAction::Settings { settings, manual: false } => {
                let sources = settings.over(sources);
                let file = sources.around.user_file();
                Action::Settings(Shown::InForce(load(&sources)?, file))
            }
            RawAction::Shaders { out } => Action::Shaders { out },
            RawAction::Runtime { out } => Action::Runtime { out: out.filter(|out| out.as_os_str() != "-") },
        })
    }
}

impl RawSettingsArgs {
    fn over(self, sources: Sources) -> Sources {
        Sources { config: self.config, sets: self.set, ..sources }
    }
}

fn load(sources: &Sources) -> Result<Box<InForce>, Stop> {
    sources.load().map(Box::new).map_err(|problem| Stop::Usage(problem.to_string()))
}

impl RawView {
    fn check(self, sources: Sources) -> Result<View, Stop> {
        let (fixed_quality, RawRecords { trace, stats }) = (self.fixed_quality, self.records);
        differ(&[("--trace", &trace), ("--stats", &stats)])?;
        let mut sources = self.settings.over(sources);
        let mut option = |path, value: Option<Value>, name| {
            sources.options.extend(value.map(|value| (path, value, name)));
        };
        let on = |given: bool| given.then_some(Value::Boolean(true));
        let runtime = self.flight.runtime.and_then(|runtime| Value::try_from(runtime).ok());
        option("view.runtime", runtime, "--runtime");
        option("view.backdrop_layer", on(self.backdrop_layer), "--backdrop-layer");
        option("view.wait_for_headset", on(self.wait_for_headset), "--wait-for-headset");
        option("view.size", self.size.map(|size| size.to_string().into()), "--size");
        option("quality.samples", self.samples.map(Value::from), "--samples");
        option("view.refresh_rate", self.refresh_rate.map(Value::from), "--refresh-rate");
        let settings = load(&sources)?;
        let mock = settings.settings.view.runtime == RuntimeChoice::Mock;
        if self.wait_for_headset && mock {
            return Err(Stop::Usage(
                "the built-in runtime has no headset to wait for: give --wait-for-headset without --runtime mock"
                    .to_owned(),
            ));
        }
        let wait_for_headset = settings.settings.view.wait_for_headset && !mock;
        let shaders = self.flight.shaders.clone();
        let flight_asked = self.flight.flight.is_some() || self.flight.octaves.is_some();
        let Begin { world, depth, at, flight } = begin(self.place, self.flight)?;
        Ok(View {
            world,
            depth,
            at,
            flight,
            flight_asked,
            settings,
            sources,
            wait_for_headset,
            fixed_quality,
            shaders,
            trace,
            stats,
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
        let show = self.show.unwrap_or_default();
        if self.eyes == Eyes::Cube && !show.is_usual() {
            return Err(Stop::Usage(
                "`--eyes cube` writes the backdrop as it is baked, which --show does not change; leave one of them out"
                    .into(),
            ));
        }
        if show.frozen && self.shard != Shard::WHOLE {
            return Err(Stop::Usage(
                "`--show frozen` keeps the tiles of the first frame, which the parts of --shard do not share; leave \
                 one of them out"
                    .into(),
            ));
        }
        let (runtime, shaders) =
            (self.flight.runtime.unwrap_or(RuntimeChoice::Auto), self.flight.shaders.clone());
        let Begin { world, depth, at, flight } = begin(self.place, self.flight)?;
        // At a place where nothing moves, one frame is as good as all.
        let all = if at.as_ref().is_some_and(|at| at.stays) { 1 } else { flight.frames() };
        Ok(Capture {
            out: self.out,
            frames: frames_of(&flight, all, self.frames)?,
            shard: self.shard,
            size: self.size,
            samples: self.samples,
            eyes: self.eyes,
            show,
            world,
            depth,
            at,
            flight,
            runtime,
            shaders,
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
            samples: self.samples,
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

/// The flight of somebody who stays at a place.
const STILL: &str = "still";
