//! The flight's side of the panels: wishes about the picture are granted, frames reported, and pictures of the panels drawn.

use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::Result;

use crate::course::Standpoint;
use crate::desktop::Link;
use crate::gpu::{Gpu, Image, Lost};
use crate::heap;
use crate::inspect::Inspect;
use crate::panels::{Facts, Feed, Moment, Report, Tuning, Wish, controller_lines, key_lines};
use crate::quality::{Quality, samples_offered};
use crate::render::PanelPass;
use crate::settings::{QualitySettings, Settings, Side};
use crate::telemetry::{FrameStats, Memory, ResidentSet, Row};
use crate::viewer::{Viewer, survive};
use crate::world::{Sun, World};

/// From one look at the memory, and at the address, to the next.
const SELDOM: Duration = Duration::from_millis(500);

/// The flight's side of the panels.
pub struct Cover {
    feed: Feed,
    chosen: Chosen,
    /// The facts were told.
    told: bool,
    /// The number of the bindings that were told.
    told_bound: Option<u32>,
    /// When the last frame was reported.
    last: Option<Instant>,
    looked: Option<Instant>,
    resident: ResidentSet,
    memory: Memory,
}

/// What was chosen in the panels. It stays through everything that happens to sessions.
#[derive(Clone, Copy, Debug, Default)]
struct Chosen {
    inspect: Option<Inspect>,
    sun: Option<Sun>,
    tuning: Option<Tuning>,
}

impl Cover {
    /// With the flight's end of the panels.
    pub fn new(feed: Feed) -> Cover {
        Cover {
            feed,
            chosen: Chosen::default(),
            told: false,
            told_bound: None,
            last: None,
            looked: None,
            resident: ResidentSet::open(),
            memory: Memory::default(),
        }
    }

    /// What was asked for.
    pub fn wish(&self) -> Option<Wish> {
        self.feed.wish()
    }

    /// Shows it like this from now on, if there is room for it.
    ///
    /// # Errors
    /// The device is lost.
    pub fn inspect(&mut self, viewer: &mut Viewer, inspect: Inspect) -> Result<()> {
        if survive(viewer.set_inspect(&inspect))? {
            self.chosen.inspect = Some(inspect);
        }
        Ok(())
    }

    /// Light from there from now on.
    pub fn light(&mut self, viewer: &mut Viewer, sun: Sun, settled: bool) {
        self.chosen.sun = Some(sun);
        viewer.set_sun(sun.direction(), settled);
    }

    /// Draws so much from now on, if there is room for it.
    ///
    /// # Errors
    /// The device is lost.
    pub fn tune(&mut self, viewer: &mut Viewer, world: &World, tuning: Tuning) -> Result<()> {
        // Whatever comes of it, the panels hear what it is now.
        self.told = false;
        let wanted = viewer.wanted_quality();
        if wanted.fineness() != tuning.fineness {
            let quality = wanted.tuned(&tuning.fineness, viewer.pixels_per_tangent());
            if !survive(viewer.redraw(world, quality))? {
                return Ok(());
            }
            self.light_again(viewer);
        }
        viewer.set_budgets_ms([tuning.tile_ms, tuning.bake_ms]);
        self.chosen.tuning = Some(tuning);
        Ok(())
    }

    /// Draws as much as is set from now on, if there is room for it, whatever was chosen in the panels.
    ///
    /// # Errors
    /// The device is lost.
    pub fn set(&mut self, viewer: &mut Viewer, world: &World, quality: &QualitySettings) -> Result<()> {
        self.told = false;
        if survive(viewer.set_wish(world, quality))? {
            self.chosen.tuning = None;
            self.light_again(viewer);
        }
        Ok(())
    }

    /// Another world is drawn from now on, in its own light.
    pub fn enter(&mut self) {
        (self.chosen.sun, self.told) = (None, false);
    }

    /// Another viewer draws from now on: what was chosen holds there, too.
    ///
    /// # Errors
    /// The device is lost.
    pub fn follow(&mut self, viewer: &mut Viewer, world: &World) -> Result<()> {
        (self.told, self.told_bound) = (false, None);
        if let Some(tuning) = self.chosen.tuning {
            self.tune(viewer, world, tuning)?;
        }
        self.light_again(viewer);
        match &self.chosen.inspect {
            Some(inspect) => survive(viewer.set_inspect(inspect)).map(drop),
            None => Ok(()),
        }
    }

    /// The light that was chosen shines on what is drawn from now on, too.
    pub fn light_again(&self, viewer: &mut Viewer) {
        if let Some(sun) = self.chosen.sun {
            viewer.set_sun(sun.direction(), true);
        }
    }

    /// Reports what changes seldom, where it has changed.
    pub fn introduce(
        &mut self,
        viewer: &Viewer,
        world: &World,
        (settings, vignette): (&Settings, Option<bool>),
    ) {
        if !self.told {
            self.told = true;
            self.feed.tell(Report::Facts(Box::new(facts(viewer, world, (settings, vignette)))));
        }
        let (bound, number) = viewer.bound();
        if self.told_bound.replace(number) != Some(number) {
            self.feed.tell(Report::Controllers(controller_lines(bound)));
        }
    }

    /// Settings have changed: facts and keys may be others.
    pub fn settings(&mut self, settings: &Settings) {
        self.told = false;
        self.feed.tell(Report::Keys(key_lines(settings)));
    }

    /// Reports the frame just drawn, and what it cost. The address is asked for only now and then.
    pub fn report(
        &mut self,
        (viewer, stats): (&Viewer, &FrameStats),
        standpoint: &Standpoint<'_>,
        (speed, side): (Option<[f64; 2]>, Side),
        address: impl FnOnce() -> String,
    ) {
        let now = Instant::now();
        let Some(last) = self.last.replace(now) else { return };
        if self.looked.is_none_or(|looked| now - looked > SELDOM) {
            self.looked = Some(now);
            self.memory = Memory {
                rss_bytes: self.resident.bytes(),
                gpu_bytes: viewer.gpu().memory_bytes(),
                heap_bytes: heap::live_bytes(),
                path_bytes: standpoint.place.spine.path_bytes() as u64,
            };
            self.feed.tell(Report::Address { text: address(), copy: false });
        }
        let row = Row {
            depth: standpoint.depth,
            serial: stats.serial,
            frame_ms: (now - last).as_secs_f64() * 1e3,
            spans: stats.spans,
            passes: stats.passes,
            work: stats.work,
            headroom: stats.headroom,
            parallax: stats.parallax,
            memory: self.memory,
            ..Row::default()
        };
        self.feed.tell(Report::Frame(Moment { row, speed, side }));
    }

    /// The panels are hidden: what comes next begins anew.
    pub fn rest(&mut self) {
        (self.told, self.told_bound, self.last, self.looked) = (false, None, None, None);
    }

    /// Gives an address to the clipboard.
    pub fn copy(&self, text: String) {
        self.feed.tell(Report::Address { text, copy: true });
    }
}

/// How much is drawn, as far as the panels can change it.
pub fn tuning(viewer: &Viewer) -> Tuning {
    tuning_of(&viewer.wanted_quality(), viewer.budgets_ms())
}

/// The same as it would be by other settings.
pub fn tuning_by(viewer: &Viewer, settings: &QualitySettings) -> Tuning {
    tuning_of(&viewer.quality_by(settings), viewer.budgets_by(settings))
}

fn tuning_of(quality: &Quality, [tile_ms, bake_ms]: [f64; 2]) -> Tuning {
    Tuning { fineness: quality.fineness(), tile_ms, bake_ms }
}

fn facts(viewer: &Viewer, world: &World, (settings, vignette): (&Settings, Option<bool>)) -> Facts {
    let extent = viewer.session_info().extent;
    Facts {
        world: world.name.clone(),
        title: world.title.clone(),
        seed: world.surface.seed,
        sun: Sun::towards(world.look.sun_direction),
        device: viewer.gpu().info.name.clone(),
        eye_size: [extent.width, extent.height],
        tuning: tuning(viewer),
        by_settings: tuning_by(viewer, &settings.quality),
        side_by_settings: settings.mirror.side,
        samples: samples_offered(viewer.gpu().info.sample_counts).collect(),
        inspect: *viewer.inspect(),
        vignette,
    }
}

/// Draws the panels over a window.
#[derive(Default)]
pub struct Curtain {
    pass: Option<PanelPass>,
    /// It cannot be drawn, which was said.
    failed: bool,
}

impl Curtain {
    /// What is laid over the window's next picture, drawn anew where there is something new; None while the panels are
    /// hidden.
    ///
    /// # Errors
    /// The device is lost.
    pub fn draw(&mut self, link: &Link, gpu: &Arc<Gpu>) -> Result<Option<&Image>> {
        if !link.has_panels() || self.failed {
            return Ok(None);
        }
        match self.refresh(link, gpu) {
            Ok(()) => Ok(self.pass.as_ref().and_then(PanelPass::picture)),
            Err(error) if error.is::<Lost>() => Err(error),
            Err(error) => {
                tracing::warn!("the panels cannot be drawn: {error:#}");
                self.failed = true;
                Ok(None)
            }
        }
    }

    fn refresh(&mut self, link: &Link, gpu: &Arc<Gpu>) -> Result<()> {
        let pass = match &mut self.pass {
            Some(pass) => pass,
            none => none.insert(PanelPass::new(gpu)?),
        };
        if pass.is_free()?
            && let Some(painted) = link.painted()
        {
            pass.draw(&painted)?;
        }
        Ok(())
    }
}
