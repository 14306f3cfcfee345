//! The painter's part of the options for seeing how it works: a selection that is kept, the noise of one octave alone, and
//! what is left away.

use std::sync::Arc;

use anyhow::Result;
use glam::{DVec3, Mat4};

use super::{Baking, Budget, Painter, Root, TILE_BUDGET_MS, Viewpoint};
use crate::gpu::{Frame, Gpu};
use crate::inspect::{BackdropView, Inspect};
use crate::render::Selected;
use crate::telemetry::{Span, Stopwatch};
use crate::terrain::Place;
use crate::terrain::place::START_LEVEL;

/// What a selection was made from.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Vantage {
    /// Level of its root.
    pub(super) root: usize,
    /// Metres of a tile of that.
    pub(super) root_m: f64,
    /// The eyes' axes, in metres from the middle of the head, and the angles of their views' sides.
    pub(super) eyes: [(Mat4, [f32; 4]); 2],
}

/// Where the viewer was when the selection was kept.
pub(crate) struct Frozen {
    place: Place,
    here: DVec3,
}

/// Octaves that a viewer may go in or out from where a selection is kept: beyond, tiles are selected anew.
const FROZEN_OCTAVES: usize = 32;

impl Painter {
    /// From now on frames show this.
    ///
    /// # Errors
    /// Out of memory for what an option needs, or the device is lost.
    pub(crate) fn set_inspect(&mut self, gpu: &Arc<Gpu>, inspect: &Inspect) -> Result<()> {
        if *inspect == self.inspect {
            return Ok(());
        }
        self.terrain.set_inspect(gpu, &self.tiles, &self.backdrop, inspect)?;
        if inspect.octave != self.inspect.octave {
            // The tiles of the one are not those of the other.
            self.frames.wait_idle()?;
            let alone = |octave| self.surface.alone(octave_level(octave) as u32);
            self.tiles.set_surface(&inspect.octave.map_or(self.surface, alone));
            (self.frozen, self.settled) = (None, false);
        }
        if !inspect.frozen && self.frozen.take().is_some() {
            self.settled = false;
        }
        self.inspect = *inspect;
        Ok(())
    }

    /// How far the viewer has moved since the selection was frozen, in tiles of its root. None where it is not, or is out of
    /// reach.
    pub(super) fn moved_since_frozen(&self, viewpoint: &Viewpoint<'_>) -> Option<DVec3> {
        let frozen = self.frozen.as_ref()?;
        let place = viewpoint.standpoint.place;
        if place.level().abs_diff(frozen.place.level()) > FROZEN_OCTAVES {
            return None;
        }
        let (way, level) = place.way_from(viewpoint.here, (&frozen.place, frozen.here))?;
        Some(way * 2f64.powi(self.vantage.root as i32 - level as i32))
    }

    /// The selection just made is kept from now on, if that is wanted.
    pub(super) fn freeze(&mut self, viewpoint: &Viewpoint<'_>) {
        if self.inspect.frozen {
            self.frozen = Some(Frozen { place: viewpoint.standpoint.place.clone(), here: viewpoint.here });
        }
    }

    /// Begins a frame with the tiles and the backdrop that there are.
    pub(super) fn begin_frozen(
        &mut self,
        viewpoint: &Viewpoint<'_>,
        moved: DVec3,
        watch: &mut Stopwatch,
    ) -> Result<Frame> {
        let frame = self.frames.begin()?;
        watch.lap(Span::Begin);
        self.tiles.begin_frame(frame.index, None);
        self.tiles.keep(&self.selection.drawn);
        self.selection.counts.made = 0;
        watch.lap(Span::Select);
        self.place_tiles(frame.index, viewpoint, moved);
        self.headroom = 1.0;
        watch.lap(Span::Record);
        Ok(frame)
    }

    /// Begins a frame of a plain with the noise of one level alone, below the viewer as the ground is, and as much lower as
    /// that noise can rise.
    pub(super) fn begin_octave(
        &mut self,
        viewpoint: &Viewpoint<'_>,
        octave: usize,
        watch: &mut Stopwatch,
    ) -> Result<Frame> {
        let &Viewpoint { standpoint, here, .. } = viewpoint;
        self.tiles.set_budget(match self.complete || !self.settled {
            true => Budget::Unlimited,
            false => Budget::Milliseconds(TILE_BUDGET_MS),
        });
        self.settled = true;
        let mut frame = self.frames.begin()?;
        watch.lap(Span::Begin);
        self.tiles.begin_frame(frame.index, self.pass_ms("tiles"));
        let level = viewpoint.level();
        // From so high above its hills a coarse octave is seen as a fine one is from here.
        let scale = level.min(octave);
        let live = self.quality.backdrop.nearest_layer(scale) + 1;
        let window = self.window_from(scale, live, live);
        let surface = self.surface.alone(octave as u32);
        let rise = f64::from(surface.amplitude) / 65_536.0 * 2f64.powi(level as i32 - octave as i32);
        let (_, mut head) = standpoint.place.lift(here, level, window.root);
        let height = standpoint.height + here.y - standpoint.position.y + rise;
        head.y = height * 2f64.powi(window.root as i32 - level as i32);
        let block = standpoint.place.alone(octave, window.root);
        let levels = scale + self.quality.down - window.root;
        self.select(viewpoint, &surface, &Root { block: &block, head, levels, window });
        watch.lap(Span::Select);
        self.place_tiles(frame.index, viewpoint, DVec3::ZERO);
        self.headroom = 1.0;
        self.count(&Baking::default());
        frame.pass(c"tiles", |commands| self.tiles.record(commands));
        watch.lap(Span::Record);
        Ok(frame)
    }

    /// Puts the tiles selected, and the lines about them, where they are seen by a viewer who has moved by so many tiles of
    /// the selection's root since.
    pub(super) fn place_tiles(&mut self, index: usize, viewpoint: &Viewpoint<'_>, moved: DVec3) {
        let root_m = viewpoint.tile_m(self.vantage.root);
        self.terrain.set_tiles(index, &self.selection.drawn, root_m, moved);
        let selected =
            Selected { root_m, moved, eyes: self.vantage.eyes, metre: root_m / self.vantage.root_m };
        self.terrain.set_lines(index, &self.selection, &selected);
    }

    pub(super) fn has_haze(&self) -> bool {
        !self.inspect.live_only && self.inspect.octave.is_none()
    }

    pub(super) fn has_backdrop(&self) -> bool {
        self.has_haze() && self.inspect.backdrop != BackdropView::Off
    }

    /// Whether what is behind the tiles is as if there were no options.
    pub(super) fn sky_is_usual(&self) -> bool {
        let tinted = self.inspect.backdrop == BackdropView::Tinted;
        self.has_backdrop() && !tinted && !self.inspect.on_plain_ground()
    }
}

/// Level of an octave below the start; 1 is the coarsest that there is.
pub(super) fn octave_level(octave: i32) -> usize {
    (START_LEVEL as i64 + i64::from(octave)).max(1) as usize
}
