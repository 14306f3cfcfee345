//! A flight at the desk: shown in a window, steered by keys and mouse, kept going by the
//! [`Supervisor`](crate::supervisor::Supervisor).

use std::fmt::Write as _;
use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::{Context, Result};
use toml::Value;

use crate::address::{Address, Scribe};
use crate::at;
use crate::bookmarks::Store;
use crate::controllers::ControllerSettings;
use crate::cover::{self, Cover, Curtain};
use crate::desktop::{Hands, Link, Mirror, Pane, Scene, Sights, Spectator, TITLE_EVERY};
use crate::flying::{Flying, Headset};
use crate::input::{Input, Ray};
use crate::panels::{Feed, Wish};
use crate::picture::{self, Pixels};
use crate::settings::{self, InForce, Leaf, Place, Settings, Side, Watch};
use crate::supervisor::{Stage, Venue};
use crate::telemetry::{Span, Stopwatch};
use crate::viewer::{Step, Viewer, survive};
use crate::world::World;
use crate::wrist::Departure;

/// How long the title says what was kept.
const NOTICE_FOR: Duration = Duration::from_secs(3);

/// Names tried for a screenshot.
const MOST_NAMES: u32 = 100_000;

/// A flight with a window. The place stays through everything that happens to sessions.
pub struct Desk<'a> {
    /// The flight under it.
    pub flying: Flying<'a>,
    /// The flight goes by itself until somebody steers.
    autopilot: bool,
    /// Somebody wears the headset that is shown.
    worn: bool,
    /// The window's own camera, while it shows that.
    spectator: Option<Spectator>,
    /// Whose picture the window shows.
    side: Side,
    /// What is set, and news of that.
    settings: InForce,
    watch: Watch,
    /// How deep the viewer was when the dive of a double-click began.
    fell_from: Option<f64>,
    /// A world that waits for the dark, and its seed.
    leaving: Option<(String, Option<u64>)>,
    /// A picture and a bookmark are to be kept with the next frame that is drawn.
    due: (bool, bool),
    link: Link,
    cover: Cover,
    scribe: Scribe,
    keeper: Keeper,
    meter: Meter,
}

/// What is open: the mirror goes first, then what it showed.
pub struct Show {
    mirror: Option<Mirror>,
    curtain: Curtain,
    viewer: Viewer,
}

impl<'a> Desk<'a> {
    /// A flight to be steered, from its helm's start; with `autopilot` it goes by itself until somebody does. `feed` is of
    /// the panels in the window.
    pub fn new(
        flying: Flying<'a>,
        autopilot: bool,
        (settings, watch): (InForce, Watch),
        (link, feed): (Link, Feed),
    ) -> Desk<'a> {
        let scribe = Scribe::new(&flying.world);
        Desk {
            flying,
            autopilot,
            worn: false,
            spectator: None,
            side: settings.settings.mirror.side,
            settings,
            watch,
            fell_from: None,
            leaving: None,
            due: (false, false),
            link,
            cover: Cover::new(feed),
            scribe,
            keeper: Keeper::new(),
            meter: Meter::default(),
        }
    }

    /// Takes up what has been set while the window is open.
    ///
    /// # Errors
    /// The device is lost.
    fn heed(&mut self, viewer: &mut Viewer) -> Result<()> {
        let new = match self.watch.news() {
            None => return Ok(()),
            Some(Ok(new)) => new,
            Some(Err(problem)) => {
                tracing::warn!("the settings stay as they were: {problem}");
                self.meter.notify(format!("settings: {problem}"));
                return Ok(());
            }
        };
        new.remarks.iter().for_each(|remark| tracing::warn!("settings: {remark}"));
        let differ: Vec<String> = new.differing(&self.settings).map(str::to_owned).collect();
        let chosen = self.flying.choices();
        // What was chosen in the panels, and saved, is in force already.
        let ahead = cover::tuning(viewer).changes(&cover::tuning_by(viewer, &self.settings.settings.quality));
        let is_there = |path: &str, value: &Value| ahead.iter().any(|(one, to)| *one == path && to == value);
        for path in &differ {
            let value = new.lines.iter().find(|line| line.path == *path).map(|line| &line.value);
            let waits = settings::needs_restart(path) && !value.is_some_and(|value| is_there(path, value));
            match waits {
                true => tracing::warn!("settings: {path} is taken up at the next start"),
                false => tracing::info!("settings: {path} is taken up"),
            }
        }
        let (now, old) = (&new.settings, &self.settings.settings);
        self.link.set(now, Some(old));
        if now.quality != old.quality {
            self.flying.config.wish = now.quality;
            self.cover.set(viewer, &self.flying.world, &now.quality)?;
        }
        self.flying.sound.set(&now.sound);
        let left_handed = self.flying.helm.controllers.settings.left_handed;
        // What the hands are bound to stays until the next start.
        self.flying.helm.controllers.settings = ControllerSettings { left_handed, ..now.controllers };
        self.cover.settings(now);
        viewer.show_veil_in_mirror(now.mirror.vignette);
        self.flying.comfort.settings = now.comfort;
        self.set_motion(now);
        self.flying.heed(&chosen, now, &differ);
        self.settings = new;
        self.flying.tell(&mut self.settings.settings);
        self.meter.notify("settings taken up".to_owned());
        Ok(())
    }

    /// Takes up shaders that have been changed while the window is open.
    fn heed_shaders(&mut self, show: &mut Show) -> Result<()> {
        let Some(other) = self.flying.heed_shaders(&mut show.viewer)? else { return Ok(()) };
        if other {
            self.cover.light_again(&mut show.viewer);
            if let Some(mirror) = &mut show.mirror {
                // The window's picture may show the curtain.
                mirror.wait_drawn()?;
                show.curtain = Curtain::default();
                survive(mirror.compose_anew())?;
            }
        }
        let words = if other { "shaders taken up" } else { "the shaders stay as they were: see the log" };
        self.meter.notify(words.to_owned());
        Ok(())
    }

    /// How moving feels, to whoever it is who sees it.
    fn set_motion(&mut self, Settings { motion, comfort, .. }: &Settings) {
        let motion = if self.worn { comfort.motion(motion) } else { *motion };
        self.flying.helm.set(&motion);
    }

    /// Ends the dive of a double-click where it has arrived, or leads nowhere.
    fn land(&mut self, hands: &Hands) {
        let Some(pilot) = self.flying.helm.pilot().filter(|_| hands.falls) else {
            self.fell_from = None;
            return;
        };
        let depth = pilot.standpoint().depth;
        let from = *self.fell_from.get_or_insert(depth);
        if !pilot.dives() || depth - from >= self.settings.settings.mouse.double_click_octaves {
            self.fell_from = None;
            self.link.land();
        }
    }

    /// With the mirror that there is already, where it is on the viewer's device.
    fn show(&mut self, mut viewer: Viewer, mirror: Option<Mirror>) -> Result<Show> {
        self.cover.follow(&mut viewer, &self.flying.world)?;
        viewer.show_veil_in_mirror(self.settings.settings.mirror.vignette);
        let same = mirror.filter(|mirror| Arc::ptr_eq(mirror.gpu(), viewer.gpu()));
        // Without a mirror the headset still works.
        let mirror = same.map_or_else(|| self.link.mirror(viewer.gpu()), Ok);
        let mirror = match mirror.and_then(|mirror| viewer.keep_mirror().map(|()| mirror)) {
            Ok(mirror) => Some(mirror),
            Err(error) => {
                tracing::warn!("nothing is shown in the window: {error:#}");
                None
            }
        };
        Ok(Show { mirror, curtain: Curtain::default(), viewer })
    }

    /// Does what was asked for in the panels.
    fn grant(&mut self, show: &mut Show, wish: Wish, flown: Duration) -> Result<()> {
        let viewer = &mut show.viewer;
        match wish {
            Wish::Inspect(inspect) => self.cover.inspect(viewer, inspect)?,
            Wish::Sun { sun, settled } => self.cover.light(viewer, sun, settled),
            Wish::Tuning(tuning) => self.cover.tune(viewer, &self.flying.world, tuning)?,
            Wish::World { name, seed } => self.leaving = Some((name, seed)),
            Wish::Vignette(on) => self.flying.comfort.settings.vignette = on,
            Wish::CopyAddress => {
                let standpoint = self.flying.standpoint(flown);
                self.cover.copy(self.scribe.address(&standpoint).to_string());
            }
            Wish::Side(side) => self.link.show(side),
            Wish::Save => self.save(viewer),
        }
        Ok(())
    }

    /// Writes how much is drawn to the user's own settings, as far as it is otherwise there.
    fn save(&mut self, viewer: &Viewer) {
        let by_settings = cover::tuning_by(viewer, &self.settings.settings.quality);
        let mut changes = cover::tuning(viewer).changes(&by_settings);
        if self.side != self.settings.settings.mirror.side {
            changes.extend(Value::try_from(self.side).map(|side| ("mirror.side", side)));
        }
        let is_changed = |line: &&Leaf| changes.iter().any(|(path, _)| *path == line.path);
        let before: Vec<Leaf> = self.settings.lines.iter().filter(is_changed).cloned().collect();
        self.keeper.work("what was changed", move || {
            let file = settings::save(&changes)?;
            let mut words = format!("kept {}", file.display());
            let own = file.display().to_string();
            for Leaf { path, place, .. } in before {
                let is_over = match &place {
                    Place::BuiltIn | Place::Change => false,
                    Place::File { file, .. } => *file != own,
                    Place::Set(_) | Place::Variable(_) | Place::Option(_) => true,
                };
                if is_over {
                    write!(words, "; {place} comes over {path} there")?;
                }
            }
            Ok(words)
        });
    }

    /// Goes to another world, where one was asked for and the wearer does not see the jump.
    fn leave(&mut self, viewer: &mut Viewer) -> Result<()> {
        let leaves = self.leaving.is_some() && self.flying.comfort.may_jump();
        let Some((name, seed)) = self.leaving.take_if(|_| leaves) else { return Ok(()) };
        match self.world(&name, seed) {
            Ok(world) => {
                let start = at::stand(&world, 0, None);
                self.depart(viewer, Departure { world, stand: start })
            }
            Err(error) => {
                tracing::warn!("{error:#}");
                Ok(())
            }
        }
    }

    /// A world by its name; the one that is flown in need not be a built-in one.
    fn world(&self, name: &str, seed: Option<u64>) -> Result<World> {
        let here = &self.flying.world;
        let mut world = if here.name == name { here.clone() } else { World::load(name)? };
        world.surface.seed = seed.unwrap_or(world.surface.seed);
        Ok(world)
    }

    /// Goes elsewhere, maybe to another world.
    fn depart(&mut self, viewer: &mut Viewer, Departure { world, stand }: Departure) -> Result<()> {
        if world != self.flying.world {
            if !self.flying.enter(viewer, world)? {
                return Ok(());
            }
            self.cover.enter();
            self.scribe = Scribe::new(&self.flying.world);
        }
        self.fell_from = None;
        self.link.land();
        self.flying.helm.go_to(&stand);
        Ok(())
    }

    /// The panels hear of the frame just drawn, while they are shown.
    fn report(&mut self, show: &Show, watch: &Stopwatch, flown: Duration) {
        if !self.link.has_panels() {
            return self.cover.rest();
        }
        let speed = self.flying.helm.pilot().map(|pilot| [pilot.speed(), pilot.settings().speed]);
        let vignette = self.worn.then_some(self.flying.comfort.settings.vignette);
        let settings = &self.settings.settings;
        self.cover.introduce(&show.viewer, &self.flying.world, (settings, vignette));
        let standpoint = self.flying.standpoint(flown);
        let scribe = &mut self.scribe;
        let mut stats = *show.viewer.stats();
        stats.surround(watch);
        let address = || scribe.address(&standpoint).to_string();
        self.cover.report((&show.viewer, &stats), &standpoint, (speed, self.side), address);
    }

    /// The window gets what was drawn, if it can take it.
    fn mirror(&mut self, show: &mut Show, hands: &Hands, dt_s: f64) -> Result<()> {
        let Show { mirror: Some(mirror), curtain, viewer } = show else { return Ok(()) };
        self.spectate(viewer, hands, dt_s);
        let (Some(eyes), Some(sights)) = (viewer.mirror(), self.sights(viewer, hands.side)) else {
            return Ok(());
        };
        let overlay = curtain.draw(&self.link, viewer.gpu())?;
        let scene = Scene { eyes, drawn: viewer.mirrored(), overlay };
        mirror.show(&scene, sights, hands.window)?;
        Ok(())
    }

    /// The spectator's camera goes on, where it is looked through: somebody wears the headset.
    fn spectate(&mut self, viewer: &Viewer, hands: &Hands, dt_s: f64) {
        let Some(eye) = viewer.eye(0).filter(|_| self.worn && hands.side == Side::Spectator) else {
            self.spectator = None;
            return;
        };
        let looks = eye.pose.orientation.as_dquat();
        let camera = self.spectator.unwrap_or(Spectator::at(looks)).follow(looks, dt_s);
        let whole = Pane::new(0, [0, 0, hands.window[0] as i32, hands.window[1] as i32], eye.fov);
        self.spectator = Some(whole.map_or(camera, |pane| camera.within(looks, &pane, eye.fov)));
    }

    /// What the window shows of the last frame drawn.
    fn sights(&self, viewer: &Viewer, side: Side) -> Option<Sights> {
        let eyes = [viewer.eye(0)?, viewer.eye(1)?];
        let looks = eyes[0].pose.orientation.as_dquat();
        let eye_from_spectator = self.spectator.map(|camera| camera.eye_from_camera(looks));
        Some(Sights { side, fov: eyes.map(|eye| eye.fov), eye_from_spectator })
    }

    /// From the eye whose picture it is through a point of the window.
    fn ray(&self, viewer: &Viewer, hands: &Hands, point: [f64; 2]) -> Option<Ray> {
        let mut panes = self.sights(viewer, hands.side)?.panes(hands.window);
        let (eye, seen) = panes.find_map(|pane| Some((pane.eye, pane.seen_at(point)?)))?;
        let pose = viewer.eye(eye)?.pose;
        Some(Ray { origin_m: pose.position, direction: pose.orientation * seen.as_vec3() })
    }

    /// Screenshots and bookmarks of the frame just drawn.
    fn keep(&mut self, show: &mut Show, hands: &Hands, flown: Duration) -> Result<()> {
        let (wanted, bookmark) = std::mem::take(&mut self.due);
        if !wanted && !bookmark {
            return Ok(());
        }
        let screenshot = wanted && show.viewer.mirror().is_some();
        if wanted && !screenshot {
            self.meter.notify("there is no picture to keep".to_owned());
        }
        let standpoint = self.flying.standpoint(flown);
        let (address, depth) = (self.scribe.address(&standpoint), standpoint.depth);
        if bookmark {
            let name = format!("{}-{depth:.0}", self.flying.world.name);
            self.keeper.bookmark(name, address.clone());
        }
        if screenshot {
            let size = show.viewer.mirrored();
            let pixels = show.viewer.read_mirror(hands.side.eye())?;
            let description = format!("{}, {depth:.2} octaves below the start", self.flying.world.name);
            let folder = PathBuf::from(&self.settings.settings.desk.screenshots);
            let address = address.to_string();
            self.keeper.screenshot(Screenshot { pixels, size, description, address }, folder);
        }
        Ok(())
    }

    fn tell(&mut self, flown: Duration) {
        let notice = self.keeper.heard();
        let Some(rate) = self.meter.due(notice) else { return };
        let depth = self.flying.standpoint(flown).depth;
        self.link.set_title(|title| {
            write!(title, "Fathomless: {}, depth {depth:.2} octaves, ", self.flying.world.name)?;
            match (&self.meter.notice, self.flying.helm.pilot()) {
                (Some((notice, _)), _) => title.push_str(notice),
                (None, Some(pilot)) => {
                    write!(title, "{:.2} of {:.2} octaves/s", pilot.speed(), pilot.settings().speed)?;
                }
                (None, None) => write!(title, "flight {}", self.flying.flight.name)?,
            }
            write!(title, ", {rate:.0} frames/s")
        });
    }
}

impl Stage for Desk<'_> {
    type Show = Show;

    fn open(&mut self, venue: Venue) -> Result<Show> {
        self.worn = venue == Venue::Headset && matches!(self.flying.headset, Headset::Runtime(_));
        let settings = self.settings.settings.clone();
        self.set_motion(&settings);
        let viewer = self.flying.open(venue)?;
        self.show(viewer, None)
    }

    fn renew(&mut self, show: Show) -> Result<Show> {
        let Show { mirror, curtain, viewer } = show;
        // The window's pictures are drawn from the viewer's.
        let drawn = mirror.as_ref().map_or(Ok(()), Mirror::wait_drawn);
        let mirror = mirror.filter(|_| drawn.is_ok());
        drop(curtain);
        let viewer = self.flying.renew(viewer)?;
        self.show(viewer, mirror)
    }

    fn frame(&mut self, show: &mut Show, flown: Duration) -> Result<Step> {
        let mut watch = Stopwatch::start();
        self.heed(&mut show.viewer)?;
        self.heed_shaders(show)?;
        let dt = self.flying.helm.begin_frame();
        while let Some(wish) = self.cover.wish() {
            self.grant(show, wish, flown)?;
        }
        self.leave(&mut show.viewer)?;
        let hands = self.link.hands();
        self.side = hands.side;
        self.due.0 |= hands.screenshot;
        self.due.1 |= hands.bookmark;
        let dive = hands.dive.and_then(|point| self.ray(&show.viewer, &hands, point));
        // Keys fly where the wearer looks.
        let input = match self.worn {
            true => {
                let keys = Input { aim: show.viewer.gaze(), dive, ..hands.input };
                let hands = self.flying.hands(&mut show.viewer, flown, dt)?;
                self.flying.tell(&mut self.settings.settings);
                hands.with(&keys)
            }
            false => Input { dive, ..hands.input },
        };
        if let Some(departure) = self.flying.departure() {
            self.depart(&mut show.viewer, departure)?;
        }
        if self.flying.helm.pilot().is_none() && !(self.autopilot || self.worn) {
            let start = self.flying.helm.start.clone();
            let here = start.unwrap_or_else(|| self.flying.standpoint(flown).stand());
            self.flying.helm.take(&here);
        }
        self.flying.steer(&mut show.viewer, &input, flown, dt);
        self.land(&hands);
        let standpoint = self.flying.standpoint(flown);
        let depth = standpoint.depth;
        // What nobody sees takes half of the time where the processor draws.
        show.viewer.set_only_eye(hands.side.only_eye().filter(|_| !self.worn));
        if self.due.0 {
            show.viewer.draw_in_full();
        }
        watch.lap(Span::Place);
        let step = show.viewer.frame(&standpoint, self.worn)?;
        watch.skip();
        if step == Step::Drew {
            if self.worn {
                self.flying.helm.feel(&show.viewer, depth)?;
            }
            self.meter.drawn += 1;
            self.mirror(show, &hands, dt.as_secs_f64())?;
            watch.lap(Span::Mirror);
            self.keep(show, &hands, flown)?;
            self.report(show, &watch, flown);
        }
        self.flying.sound.follow(depth, dt, self.flying.helm.jumped());
        self.flying.note(&show.viewer, &watch, step, depth);
        self.tell(flown);
        Ok(step)
    }

    fn speed(&self, show: &Show) -> f64 {
        self.flying.speed(&show.viewer)
    }

    fn request_exit(&mut self, show: &mut Show) -> Result<()> {
        self.flying.request_exit(&mut show.viewer)
    }

    fn headset_answers(&mut self) -> bool {
        self.flying.headset_answers()
    }
}

/// What the title says, and when.
#[derive(Default)]
struct Meter {
    drawn: u32,
    since: Option<Instant>,
    notice: Option<(String, Instant)>,
}

impl Meter {
    /// Words for the title, for a while.
    fn notify(&mut self, words: String) {
        self.notice = Some((words, Instant::now()));
    }

    /// Frames per second since the last title, when it is time for another.
    fn due(&mut self, notice: Option<String>) -> Option<f64> {
        let now = Instant::now();
        self.notice.take_if(|(_, since)| since.elapsed() > NOTICE_FOR);
        self.notice = notice.map(|text| (text, now)).or(self.notice.take());
        let elapsed = now - *self.since.get_or_insert(now);
        if elapsed < TITLE_EVERY {
            return None;
        }
        let rate = f64::from(self.drawn) / elapsed.as_secs_f64();
        (self.drawn, self.since) = (0, Some(now));
        Some(rate)
    }
}

/// A picture to be kept.
struct Screenshot {
    pixels: Vec<u8>,
    size: [u32; 2],
    description: String,
    address: String,
}

/// Writes screenshots and bookmarks, beside the frames.
struct Keeper {
    at_work: Vec<JoinHandle<()>>,
    says: Sender<String>,
    hears: Receiver<String>,
}

impl Keeper {
    fn new() -> Keeper {
        let (says, hears) = channel();
        Keeper { at_work: Vec::new(), says, hears }
    }

    /// What was kept since it was last asked, or why not.
    fn heard(&mut self) -> Option<String> {
        self.hears.try_iter().last()
    }

    fn screenshot(&mut self, shot: Screenshot, folder: PathBuf) {
        self.work("the screenshot", move || {
            let path = shot.write(&folder)?;
            Ok(format!("kept {}", path.display()))
        });
    }

    fn bookmark(&mut self, name: String, address: Address) {
        self.work("the bookmark", move || {
            let name = Store::open()?.add_like(&name, &address)?;
            Ok(format!("bookmark @{}", name.as_str()))
        });
    }

    fn work(&mut self, what: &'static str, work: impl FnOnce() -> Result<String> + Send + 'static) {
        self.at_work.retain(|thread| !thread.is_finished());
        let says = self.says.clone();
        self.at_work.push(std::thread::spawn(move || {
            let words = match work() {
                Ok(words) => {
                    tracing::info!("{words}");
                    words
                }
                Err(error) => {
                    tracing::warn!("{what} is not kept: {error:#}");
                    format!("{what} is not kept: {error:#}")
                }
            };
            // The window may be gone by now.
            let _ = says.send(words);
        }));
    }
}

impl Drop for Keeper {
    fn drop(&mut self) {
        // Nothing that was asked for is lost by leaving.
        for thread in self.at_work.drain(..) {
            let _ = thread.join();
        }
    }
}

impl Screenshot {
    /// Writes it under the first name that is free.
    fn write(&self, folder: &Path) -> Result<PathBuf> {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot make the folder {}", folder.display()))?;
        let path = reserve(folder)?;
        let notes = picture::notes(&self.description, &self.address);
        picture::write(&path, self.size, Pixels::Rgb8(&self.pixels), &notes)
            .inspect_err(|_| {
                let _ = std::fs::remove_file(&path);
            })
            .with_context(|| format!("cannot write {}: is the disk full?", path.display()))?;
        Ok(path)
    }
}

/// An empty file under the first name that is free: nobody else takes it.
fn reserve(folder: &Path) -> Result<PathBuf> {
    for i in 1..MOST_NAMES {
        let path = folder.join(format!("screenshot_{i:04}.png"));
        match File::create_new(&path) {
            Ok(_) => return Ok(path),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error).with_context(|| format!("cannot write {}", path.display())),
        }
    }
    anyhow::bail!("{} is full of screenshots", folder.display())
}
