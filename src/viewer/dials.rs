//! How much is drawn while a viewer runs: what is wanted, what can change from frame to frame, and the governor.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;

use super::open::new_painter;
use super::{Quality, Viewer, ViewerConfig};
use crate::governor::{Dials, Governor, GovernorSettings, Sample};
use crate::gpu::ShaderText;
use crate::painter::{self, Painter};
use crate::quality::samples_at_most;
use crate::settings::QualitySettings;
use crate::telemetry::{FrameStats, Span, now_ns};
use crate::terrain::morph::Detail;
use crate::world::World;

/// Frames per second that a governor holds in a window where nobody says how many, and where the processor draws: what is
/// half as smooth there is twice as sharp.
const DESK_RATE_HZ: f64 = 60.0;
const SOFTWARE_RATE_HZ: f64 = 30.0;

/// The least share of the images' width and height that is ever drawn.
const LEAST_SCALE: f64 = 0.1;

impl Viewer {
    /// From now on how much is drawn follows what frames take, down from what it is now; None: it stays as it is.
    pub fn govern(&mut self, settings: Option<&GovernorSettings>) {
        let rate_hz = match (self.gpu.info.software, self.is_in_a_window()) {
            (true, _) => Some(SOFTWARE_RATE_HZ),
            (false, true) => Some(DESK_RATE_HZ),
            (false, false) => None,
        };
        let floor = self.painter.quality.backdrop.detail.split;
        self.governor = settings.map(|settings| {
            let settings = GovernorSettings { rate_hz: settings.rate_hz.or(rate_hz), ..*settings };
            Governor::new(&settings, self.dials(), floor)
        });
    }

    /// How much is drawn, as far as it can change from frame to frame.
    pub fn dials(&self) -> Dials {
        Dials { split: self.painter.quality.detail.split, scale: self.scale, tiles_ms: self.painter.tiles_ms }
    }

    /// Draws so much from the next frame on: tiles split no later than the backdrop allows, and no earlier than there is
    /// room for.
    pub fn set_dials(&mut self, dials: Dials) {
        let painter = &mut self.painter;
        let floor = painter.quality.backdrop.detail.split;
        painter.quality.detail = Detail::new(dials.split.clamp(floor, painter.most_split.max(floor)));
        painter.tiles_ms = dials.tiles_ms.max(0.0);
        self.scale = dials.scale.clamp(LEAST_SCALE, 1.0);
        let all = self.session.info().extent;
        let part = |pixels: u32| (f64::from(pixels) * self.scale).round() as u32;
        self.session.set_drawn(vk::Extent2D { width: part(all.width), height: part(all.height) });
    }

    /// The next frame is drawn with all its pixels: it is to be kept.
    pub fn draw_in_full(&mut self) {
        self.in_full = true;
        self.session.set_drawn(self.session.info().extent);
    }

    /// Pixels of each eye that are drawn.
    pub fn drawn(&self) -> [u32; 2] {
        let vk::Extent2D { width, height } = self.session.drawn();
        [width, height]
    }

    /// Draws another world from now on, or the same with another quality; all else stays, and the dials where the quality
    /// does. The next frame may be anywhere.
    ///
    /// # Errors
    /// Out of memory: then everything is as it was; or the device is lost.
    pub fn redraw(&mut self, world: &World, quality: Quality) -> Result<()> {
        self.painter.frames.wait_idle()?;
        let kind = (&self.config, self.is_in_a_window());
        let mut painter = new_painter(world, quality, kind, &self.gpu, &self.session)?;
        painter.set_inspect(&self.gpu, self.inspect())?;
        painter.follow(&mut self.painter);
        let (wanted, dials) = (self.wanted_quality(), self.dials());
        self.painter = painter;
        // What hides them may have been made for another number of samples, or by other shaders.
        self.session.ask_hidden_areas_again();
        if self.wanted_quality() == wanted {
            // What frames took is still true of the next ones, but for those that the change itself holds up.
            self.set_dials(dials);
            self.done_ns = None;
            if let Some(governor) = &mut self.governor {
                governor.settle();
            }
        } else {
            self.govern_anew();
        }
        Ok(())
    }

    /// Draws the same by other shaders from now on, where [`ViewerConfig::shaders`](super::ViewerConfig::shaders) has a shelf
    /// for them.
    ///
    /// # Errors
    /// As [`Viewer::redraw`], or the device refuses them: then everything is as it was.
    pub fn set_shaders(&mut self, world: &World, texts: Arc<[ShaderText]>) -> Result<()> {
        let Some(shelf) = self.config.shaders else { return Ok(()) };
        let before = shelf.put(texts);
        let screen = self.panel.screen_anew(&self.gpu, self.session.info());
        let done = screen.and_then(|screen| {
            self.redraw(world, self.wanted_quality())?;
            self.panel.draw_by(screen);
            Ok(())
        });
        done.inspect_err(|_| drop(shelf.put(before)))
    }

    fn is_in_a_window(&self) -> bool {
        self.config.is_in_a_window(self.mock.as_ref())
    }

    /// The governor begins again, from all that is wanted.
    fn govern_anew(&mut self) {
        let governor = self.config.governor;
        let Painter { most_split, most_tiles_ms, .. } = self.painter;
        self.set_dials(Dials { split: most_split, scale: 1.0, tiles_ms: most_tiles_ms });
        self.govern(governor.as_ref());
    }

    /// Milliseconds of GPU time that making tiles and baking may take in a frame at most, above 0.
    pub fn budgets_ms(&self) -> [f64; 2] {
        [self.painter.most_tiles_ms, self.painter.bake_budget_ms]
    }

    /// Sets [`Viewer::budgets_ms`].
    pub fn set_budgets_ms(&mut self, budgets: [f64; 2]) {
        if budgets != self.budgets_ms() {
            [self.painter.most_tiles_ms, self.painter.bake_budget_ms] = budgets;
            self.govern_anew();
        }
    }

    /// How much would be drawn if frames took no time.
    pub fn wanted_quality(&self) -> Quality {
        Quality { detail: Detail::new(self.painter.most_split), ..self.painter.quality }
    }

    /// From now on every frame is complete, whatever it takes, or else within a budget. The next frame may be anywhere.
    pub fn set_complete(&mut self, complete: bool) {
        self.painter.complete = complete;
        self.painter.settled = false;
    }

    /// Draws as much of `world`, the one that is drawn, as is wished from now on. All but the budgets is left as it is where
    /// none of it is wished otherwise than before.
    ///
    /// # Errors
    /// As [`Viewer::redraw`].
    pub fn set_wish(&mut self, world: &World, wish: &QualitySettings) -> Result<()> {
        let drawn = |wish: &QualitySettings| QualitySettings { tile_ms: 0.0, bake_ms: None, ..*wish };
        if drawn(wish) != drawn(&self.config.wish) {
            let config = ViewerConfig { wish: *wish, ..self.config };
            let quality = config.quality(&self.gpu.info, self.is_in_a_window(), self.pixels_per_tangent());
            self.redraw(world, quality)?;
        }
        self.config.wish = *wish;
        self.set_budgets_ms(self.budgets_by(wish));
        Ok(())
    }

    /// How much would be drawn by other settings.
    pub fn quality_by(&self, wish: &QualitySettings) -> Quality {
        let info = &self.gpu.info;
        let config = ViewerConfig { wish: *wish, quality: None, ..self.config };
        let quality = config.quality(info, self.is_in_a_window(), self.pixels_per_tangent());
        Quality { samples: samples_at_most(info.sample_counts, quality.samples), ..quality }
    }

    /// [`Viewer::budgets_ms`] by other settings.
    pub fn budgets_by(&self, wish: &QualitySettings) -> [f64; 2] {
        let usual = painter::bake_budget_ms(&self.gpu.info, self.is_in_a_window());
        [wish.tile_ms, wish.bake_ms.unwrap_or(usual)]
    }

    /// How fast the viewer may go on, as a share of 0 to 1 of his speed: slower where he would outrun the backdrop.
    pub fn headroom(&self) -> f64 {
        self.painter.headroom
    }

    /// Tells the governor, where there is one, what the frame took, and does what it says.
    pub(super) fn heed_governor(&mut self, period_ms: f64) {
        let now = now_ns();
        let Some(before) = self.done_ns.replace(now) else { return };
        let Some(governor) = &mut self.governor else { return };
        let FrameStats { spans, passes, .. } = &self.stats;
        let interval_ms = (now - before) as f64 * 1e-6;
        // Runtimes pace frames in other calls, too: what is waited for there is not work.
        let xr = spans.of(Span::Xr);
        let waited_ms = spans.of(Span::Wait).wall_ms + (xr.wall_ms - xr.cpu_ms).max(0.0);
        let change = governor.observe(&Sample {
            interval_ms,
            busy_ms: interval_ms - waited_ms,
            cpu_ms: spans.cpu_ms(),
            gpu_ms: passes.total_ms(),
            tiles_ms: passes.of("tiles"),
            period_ms,
        });
        if let Some(change) = change {
            tracing::info!("{change}");
            self.set_dials(change.dials);
        }
    }
}
