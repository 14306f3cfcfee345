//! Runs a command.

use std::io::{BufWriter, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use indicatif::{ProgressBar, ProgressStyle};

use crate::address::Address;
use crate::bench::{self, Subject};
use crate::bindings::{self, ProfileBindings};
use crate::bookmarks::Store;
use crate::capture::{Job, capture};
use crate::cli::{self, Action, Command, Eyes, Format, RuntimeChoice, Shard, Verbosity};
use crate::comfort::Comfort;
use crate::controllers::Controllers;
use crate::desk::Desk;
use crate::desktop::Display;
use crate::export::{self, About, Grid};
use crate::flying::{Flying, Headset};
use crate::governor::GovernorSettings;
use crate::gpu::{self, Direct, Gpu, GpuConfig};
use crate::helm::Helm;
use crate::panels::{Panels, key_lines};
use crate::settings::{self, InForce, QualitySettings, Settings, Size, Watch};
use crate::shaders::{self, Folder};
use crate::supervisor::{Absent, Chronicle, Patience, Supervisor};
use crate::telemetry::Logbook;
use crate::telemetry::logbook::Wanted;
use crate::viewer::{DeskConfig, Quality, Remarks, ViewerConfig, stand_in_mock};
use crate::world::World;
use crate::{at, doctor, files, flying, runtime_manifest, verify};

/// Runs a command.
///
/// # Errors
/// A sentence that says what failed and what to do.
pub fn run(command: Command) -> Result<()> {
    let Command { action, validate, verbosity } = command;
    let session = Session { validate, verbosity };
    match action {
        Action::View(view) => session.view(&view),
        Action::Capture(capture) => session.capture(&capture),
        Action::Bench(bench) => session.bench(&bench),
        Action::Verify(verify) => session.verify(&verify),
        Action::Doctor => doctor::run(verbosity),
        Action::Worlds => worlds(),
        Action::Export(export) => session.export(&export),
        Action::Bookmarks(change) => bookmarks(&change),
        Action::Shaders { out } => print_shaders(out.as_deref(), verbosity),
        Action::Settings(shown) => print_settings(&shown),
        Action::Runtime { out } => runtime_manifest::run(out.as_deref(), verbosity == Verbosity::Quiet),
    }
}

/// What all commands share.
#[derive(Clone, Copy)]
struct Session {
    validate: bool,
    verbosity: Verbosity,
}

impl Session {
    fn capture(self, args: &cli::Capture) -> Result<()> {
        let folder = args.shaders.as_deref().map(Folder::open).transpose()?;
        let job = Job {
            world: &args.world,
            flight: &args.flight,
            depth: args.depth as usize,
            at: args.at.as_ref(),
            frames: args.frames.clone(),
            every: 1,
            shard: args.shard,
            eyes: args.eyes,
            out: &args.out,
            viewer: ViewerConfig {
                runtime: args.runtime,
                validate: self.validate,
                eye_size: Some([args.size.width, args.size.height]),
                wish: QualitySettings { samples: args.samples, ..QualitySettings::default() },
                inspect: args.show,
                shaders: folder.as_ref().map(|folder| folder.shelf),
                ..ViewerConfig::default()
            },
        };
        self.draw(&job)
    }

    fn draw(self, job: &Job<'_>) -> Result<()> {
        let stop = stop_on_signal()?;
        let bar = self.progress("frames");
        let done = capture(job, &stop, &bar);
        bar.finish_and_clear();
        let done = done?;
        if self.verbosity > Verbosity::Quiet {
            println!(
                "{} pictures of {} frames in {} ({:.1} frames per second)",
                done.pictures,
                done.frames,
                job.out.display(),
                done.frames as f64 / done.seconds.max(1e-9)
            );
        }
        self.judge(&done.remarks)?;
        if done.stopped {
            bail!("stopped early; the pictures drawn so far are whole");
        }
        Ok(())
    }

    /// Flies until the wearer, a signal or the window's end; without a headset and a display, draws a short dive to
    /// files.
    fn view(self, args: &cli::View) -> Result<()> {
        let shaders = args.shaders.as_deref().map(Folder::open).transpose()?;
        args.settings.remarks.iter().for_each(|remark| tracing::warn!("settings: {remark}"));
        let runtime = args.settings.settings.view.runtime;
        let headset = args.wait_for_headset || self.system_answers(runtime)?;
        // The headset works without it.
        let display = Display::open().unwrap_or_else(|error| {
            tracing::warn!("going on without a window: {error:#}");
            None
        });
        if let Some(display) = display {
            return self.fly_at_the_desk(args, shaders, display);
        }
        if headset {
            return self.fly(args, shaders);
        }
        let stays = args.at.as_ref().is_some_and(|at| at.stays);
        let what = if stays { "what is seen there" } else { "a short dive as pictures" };
        if self.verbosity > Verbosity::Quiet {
            let why = match runtime {
                RuntimeChoice::Mock => "The built-in runtime has no headset",
                _ => "No headset answers (`fathomless doctor` says what is missing)",
            };
            println!("{why}, so here is {what}.");
        }
        let fps = 20;
        let every = (args.flight.fps / fps).max(1) as usize;
        let most = if stays { 1 } else { 3 * u64::from(args.flight.fps) };
        let job = Job {
            world: &args.world,
            flight: &args.flight,
            depth: args.depth as usize,
            at: args.at.as_ref(),
            frames: 0..args.flight.frames().min(most),
            every,
            shard: Shard::WHOLE,
            eyes: Eyes::Both,
            out: std::path::Path::new("captures"),
            viewer: ViewerConfig {
                validate: self.validate,
                eye_size: Some([640, 640]),
                shaders: shaders.as_ref().map(|folder| folder.shelf),
                ..ViewerConfig::default()
            },
        };
        self.draw(&job)
    }

    /// True if there is a system runtime with a headset; an error if it was insisted upon and there is none.
    fn system_answers(self, choice: RuntimeChoice) -> Result<bool> {
        if choice == RuntimeChoice::Mock {
            return Ok(false);
        }
        match flying::system_runtime() {
            Ok(_) => Ok(true),
            Err(error) if choice == RuntimeChoice::System => {
                Err(error).context("no headset to show the world in")
            }
            Err(error) => {
                tracing::debug!("no headset: {error}");
                Ok(false)
            }
        }
    }

    fn fly(self, args: &cli::View, shaders: Option<Folder>) -> Result<()> {
        let stop = stop_on_signal()?;
        let mut flying = self.flying(args, shaders, None);
        let mut supervisor = Supervisor::new(patience(args), &stop);
        let flown = supervisor.fly(&mut flying);
        self.tell(&supervisor, &mut flying.logbook);
        self.judge(&flying.remarks())?;
        flown
    }

    /// The same with a window, in which anybody can steer.
    fn fly_at_the_desk(self, args: &cli::View, shaders: Option<Folder>, display: Display) -> Result<()> {
        let stop = stop_on_signal()?;
        let (eye_size, rate_hz) =
            if draws_in_software() { (SOFTWARE_EYE, SOFTWARE_HZ) } else { (DESK_EYE, DESK_HZ) };
        let config = DeskConfig { surface: display.surface_extension()?, eye_size, rate_hz };
        if self.verbosity > Verbosity::Quiet {
            println!("{}", greeting(&args.settings.settings));
        }
        let (panels, feed) = Panels::new(key_lines(&args.settings.settings));
        let fly = |link| {
            let flying = self.flying(args, shaders, Some(config));
            let settings = (InForce::clone(&args.settings), Watch::new(args.sources.clone()));
            let mut desk = Desk::new(flying, args.flight_asked, settings, (link, feed));
            let mut supervisor = Supervisor::new(patience(args), &stop);
            let flown = supervisor.fly(&mut desk);
            self.tell(&supervisor, &mut desk.flying.logbook);
            self.judge(&desk.flying.remarks())?;
            flown
        };
        let leave = |flown: &Result<()>| {
            tracing::warn!("the display does not answer any more: leaving it as it is");
            if let Err(error) = flown {
                eprintln!("error: {error:#}");
            }
            std::process::exit(i32::from(flown.is_err()));
        };
        display.run("Fathomless", &args.settings.settings, &stop, panels, fly, leave)?
    }

    fn flying(self, args: &cli::View, shaders: Option<Folder>, desk: Option<DeskConfig>) -> Flying<'_> {
        let Settings { view, quality, motion, comfort, controllers, sound, .. } = &args.settings.settings;
        let config = ViewerConfig {
            validate: self.validate,
            eye_size: view.size.map(Size::pixels),
            stepped: false,
            complete: false,
            wish: *quality,
            backdrop_layer: view.backdrop_layer,
            mask: view.mask,
            refresh_hz: view.refresh_rate,
            bindings: Some(bindings_of_controllers(args)),
            desk,
            // Whoever says how many pixels there are gets them.
            governor: (!args.fixed_quality).then(|| GovernorSettings {
                least_scale: if view.size.is_some() { 1.0 } else { GovernorSettings::default().least_scale },
                ..GovernorSettings::default()
            }),
            shaders: shaders.as_ref().map(|folder| folder.shelf),
            ..ViewerConfig::default()
        };
        let course = at::course(&args.world, &args.flight, args.depth as usize, args.at.as_ref());
        let headset = match view.runtime {
            RuntimeChoice::Mock => Headset::Mock(stand_in_mock(&config)),
            _ => Headset::Runtime(flying::system_runtime),
        };
        let mut flying = Flying::new(&args.world, &args.flight, course, config, headset);
        let start = at::stand(&args.world, args.depth as usize, args.at.as_ref());
        flying.shaders = shaders;
        flying.sound.set(sound);
        flying.comfort = Comfort::new(*comfort);
        flying.wrist.shelf.saver = Some(settings::save);
        // A window tells whether there is a headset once it is open.
        let motion = if desk.is_some() { *motion } else { comfort.motion(motion) };
        flying.helm = Helm::new(start, &motion, Controllers::new(*controllers));
        flying.logbook =
            Logbook::open(&Wanted { trace: args.trace.as_deref(), stats: args.stats.as_deref() });
        flying
    }

    fn tell(self, supervisor: &Supervisor<'_>, logbook: &mut Logbook) {
        logbook.close();
        if self.verbosity >= Verbosity::Info {
            print!("{}", logbook.histogram.text());
        }
        if self.verbosity > Verbosity::Quiet {
            let Chronicle { drawn, skipped, opened, renewed, .. } = supervisor.chronicle;
            println!(
                "{drawn} frames drawn and {skipped} without a picture in {:.1} s of flight; the runtime was opened {opened} \
                 times, another session made {renewed} times",
                supervisor.flown.as_secs_f64()
            );
        }
    }

    fn bench(self, args: &cli::Bench) -> Result<()> {
        let files = [
            (&args.json, "--json"),
            (&args.html, "--html"),
            (&args.stats, "--stats"),
            (&args.trace, "--trace"),
        ];
        for (path, option) in files {
            path.as_ref().map_or(Ok(()), |path| files::prepare_file(path, option))?;
        }
        let subject = Subject {
            world: &args.world,
            flight: &args.flight,
            frames: args.frames.clone(),
            depths: args.depths.clone(),
            trace: args.trace.as_deref(),
            viewer: ViewerConfig {
                runtime: args.runtime,
                validate: self.validate,
                eye_size: Some([args.size.width, args.size.height]),
                wish: QualitySettings { samples: args.samples, ..QualitySettings::default() },
                complete: args.complete,
                ..ViewerConfig::default()
            },
        };
        let stop = stop_on_signal()?;
        let bar = self.progress("frames");
        let flown = bench::fly(&subject, &stop, &bar);
        bar.finish_and_clear();
        let (report, remarks) = flown?;
        print!("{}", report.table());
        if let Some(path) = &args.json {
            bench::write_json(path, &report)?;
        }
        if let Some(path) = &args.html {
            bench::write_html(path, &report)?;
        }
        if let Some(path) = &args.stats {
            bench::write_stats(path, &report)?;
        }
        self.judge(&remarks)?;
        if report.stopped {
            bail!("stopped early; the figures are of the {} frames flown so far", report.frames);
        }
        Ok(())
    }

    fn export(self, args: &cli::Export) -> Result<()> {
        let stand = at::stand(&args.world, args.depth as usize, args.at.as_ref());
        let address = Address::of(&args.world, &stand.standpoint()).to_string();
        let about = About { address: &address, world: &args.world.name };
        let points = Grid::points(args.cells);
        // Smaller ones are done before anybody could read of it.
        let long = points > 1_000_000 && args.out.is_some();
        let bar = if long { self.progress("points") } else { ProgressBar::hidden() };
        bar.set_length(points);
        let grid = Grid::around(&stand, args.cells, args.level_offset, |done| bar.set_position(done));
        bar.set_message("writing");
        let text = |to: &mut dyn Write| match args.format {
            Format::Obj => export::write_obj(&grid, &about, to),
            Format::Csv | Format::Png16 => export::write_csv(&grid, &about, to),
        };
        let written = match (&args.out, args.format) {
            (None, _) => {
                let mut out = BufWriter::new(std::io::stdout().lock());
                return Ok(text(&mut out).and_then(|()| out.flush())?);
            }
            (Some(path), Format::Png16) => export::write_png16(&grid, &about, path),
            (Some(path), _) => files::write_whole(path, |file| text(file)),
        };
        bar.finish_and_clear();
        let path = args.out.as_deref().unwrap_or(std::path::Path::new("")).display();
        written.with_context(|| format!("cannot write {path}: choose another file with --out"))?;
        if self.verbosity > Verbosity::Quiet {
            println!("{points} heights of {} at level {} in {path}", args.world.name, grid.level);
        }
        Ok(())
    }

    fn verify(self, args: &cli::Verify) -> Result<()> {
        let gpu = Gpu::new(&Direct, &GpuConfig { validate: self.validate })?;
        let layout = Quality::new(&gpu.info, 1024.0).layout;
        let bar = self.progress("tiles");
        bar.set_length(u64::from(args.tiles));
        bar.set_message("finding the way down");
        let start = Instant::now();
        let report = verify::verify(
            &gpu,
            &args.world.surface,
            layout,
            args.tiles as usize,
            args.depth as usize,
            |done| {
                bar.set_message("comparing");
                bar.set_position(done as u64);
            },
        );
        bar.finish_and_clear();
        let report = report?;
        println!(
            "{}: {} tiles of {} down to depth {} on {}: {} heights compared, {} differ; {} gradients, {} differ; \
             {} samples on shared edges, {} differ ({:.1} s)",
            if report.clean() { "equal" } else { "DIFFERENT" },
            report.tiles,
            args.world.name,
            report.deepest,
            gpu.info.name,
            report.heights,
            report.heights_differ,
            report.gradients,
            report.gradients_differ,
            report.shared,
            report.shared_differ,
            start.elapsed().as_secs_f64(),
        );
        let log = gpu.validation_log();
        drop(gpu);
        let said = log.report();
        let first = said.texts.into_iter().next();
        self.judge(&Remarks { validation: said.count as usize, violations: 0, first })?;
        if !report.clean() {
            bail!(
                "the GPU's heights are not the CPU's: please report the line above and the driver's version"
            );
        }
        Ok(())
    }

    /// With `--validate`, any remark is a failure.
    fn judge(self, remarks: &Remarks) -> Result<()> {
        let count = remarks.validation + remarks.violations;
        if count == 0 {
            return Ok(());
        }
        let first = remarks.first.as_deref().unwrap_or("(not kept)");
        if self.validate {
            bail!("{count} validation messages; the first: {first}");
        }
        tracing::warn!("{count} validation messages; the first: {first}");
        Ok(())
    }

    fn progress(self, what: &str) -> ProgressBar {
        if self.verbosity == Verbosity::Quiet {
            return ProgressBar::hidden();
        }
        let bar = ProgressBar::new(0);
        let template = format!("{{msg}} [{{bar:40}}] {{pos}}/{{len}} {what} {{eta}}");
        if let Ok(style) = ProgressStyle::with_template(&template) {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(200));
        bar
    }
}

/// Pixels per eye where nobody wears a headset, for a window: on a graphics card, and where the processor draws.
const DESK_EYE: [u32; 2] = [1600, 1000];
const SOFTWARE_EYE: [u32; 2] = [640, 400];

/// What controllers do: as the user's file says, where there is one that can be used. Kept until the program ends.
fn bindings_of_controllers(args: &cli::View) -> &'static [ProfileBindings] {
    let left_handed = args.settings.settings.controllers.left_handed;
    let file = args.sources.around.bindings_file().filter(|file| file.exists());
    let own = file.and_then(|file| {
        let name = file.display().to_string();
        let read = std::fs::read_to_string(&file).map_err(|error| format!("{name}: {error}"));
        let parsed = read
            .and_then(|text| bindings::parse(&name, &text, left_handed).map_err(|errors| errors.to_string()));
        parsed.inspect_err(|wrong| tracing::warn!("the built-in bindings are used instead: {wrong}")).ok()
    });
    let built_in = || {
        bindings::parse("config/bindings.toml", bindings::BUILT_IN, left_handed)
            .inspect_err(|wrong| tracing::error!("the controllers do nothing: {wrong}"))
            .unwrap_or_default()
    };
    own.unwrap_or_else(built_in).leak()
}

/// Frames per second at most, there: a frame begins at a beat of this rate, and a processor that draws should not wait for it
/// long.
const DESK_HZ: f64 = 90.0;
const SOFTWARE_HZ: f64 = 240.0;

/// The device that is used without a headset is the processor itself.
fn draws_in_software() -> bool {
    let devices = gpu::survey().and_then(|survey| survey.devices).unwrap_or_default();
    devices.iter().any(|device| device.chosen && device.info.software)
}

/// What to press first.
fn greeting(settings: &Settings) -> String {
    let key = |action| settings.keys.names(action).next().unwrap_or("(no key)");
    let fly =
        [settings::Action::Ahead, settings::Action::Back, settings::Action::Left, settings::Action::Right];
    format!(
        "{} takes the mouse, {} fly, {} dives, {} backs out, {} ends; more: fathomless view --help",
        key(settings::Action::TakeMouse),
        fly.map(key).join(" "),
        key(settings::Action::Dive),
        key(settings::Action::BackOut),
        key(settings::Action::End),
    )
}

/// Prints the settings as a file of settings, with where each comes from.
fn print_settings(shown: &cli::Shown) -> Result<()> {
    let mut out = std::io::stdout().lock();
    let (in_force, file) = match shown {
        cli::Shown::Manual => return Ok(out.write_all(settings::MANUAL.as_bytes())?),
        cli::Shown::InForce(in_force, file) => (in_force, file),
    };
    in_force.remarks.iter().for_each(|remark| tracing::warn!("settings: {remark}"));
    writeln!(
        out,
        "# The settings of `fathomless view` here. `fathomless settings --manual` says what they mean."
    )?;
    if let Some(path) = file {
        let there = if path.exists() { "" } else { ", which does not exist yet" };
        writeln!(out, "# Your own are in {}{there}.", path.display())?;
    }
    let mut section = "";
    for line in &in_force.lines {
        let (heading, name) = line.path.rsplit_once('.').unwrap_or(("", &line.path));
        if heading != section {
            section = heading;
            writeln!(out, "\n[{heading}]")?;
        }
        let setting = format!("{name} = {}", line.value);
        match line.place {
            settings::Place::BuiltIn => writeln!(out, "{setting}")?,
            _ => writeln!(out, "{setting:32}  # {}", line.place)?,
        }
    }
    Ok(())
}

fn patience(args: &cli::View) -> Patience {
    Patience::new(match (args.wait_for_headset, args.settings.settings.view.runtime) {
        (true, _) => Absent::Wait,
        (false, RuntimeChoice::System) => Absent::Fail,
        (false, _) => Absent::StandIn,
    })
}

/// Becomes true at the first SIGINT, SIGTERM or SIGHUP; the second ends the process.
fn stop_on_signal() -> Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    })
    .context("cannot listen for Ctrl-C")?;
    Ok(stop)
}

/// Prints each world's name and its line.
fn worlds() -> Result<()> {
    let mut out = std::io::stdout().lock();
    let width = World::names().map(str::len).max().unwrap_or_default();
    for name in World::names() {
        let world = World::load(name)?;
        writeln!(out, "{name:width$}  {}", world.title)?;
    }
    Ok(())
}

/// Prints each shader's file and its line, or writes them all.
fn print_shaders(folder: Option<&Path>, verbosity: Verbosity) -> Result<()> {
    let mut out = std::io::stdout().lock();
    if let Some(folder) = folder {
        shaders::write(folder)?;
        if verbosity > Verbosity::Quiet {
            let (n, folder) = (shaders::BUILT_IN.len(), folder.display());
            writeln!(out, "{n} shaders in {folder}: `fathomless view --shaders {folder}` draws with them")?;
        }
        return Ok(());
    }
    for (source, about) in &shaders::BUILT_IN {
        writeln!(out, "{:13}  {about}", shaders::file_name(source))?;
    }
    Ok(())
}

/// Lists or changes the bookmarks.
fn bookmarks(change: &cli::Bookmarks) -> Result<()> {
    let store = Store::open()?;
    let damage = match change {
        cli::Bookmarks::List => {
            let listing = store.list()?;
            let mut out = std::io::stdout().lock();
            for (name, address) in &listing.bookmarks {
                writeln!(out, "{name}  {address}")?;
            }
            if listing.bookmarks.is_empty() {
                writeln!(out, "No bookmarks yet: `fathomless bookmarks add NAME --at PLACE` makes one.")?;
            }
            listing.damage
        }
        cli::Bookmarks::Add { name, at } => store.add(name, &at.address)?,
        cli::Bookmarks::Remove { name } => store.remove(name)?,
    };
    if let Some(damage) = damage {
        tracing::warn!("{damage}");
    }
    Ok(())
}
