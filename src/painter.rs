//! The renderer's parts at work: one frame of one world, from the choice of tiles to the recorded passes.

mod aids;
mod inspect;

use anyhow::Result;
use ash::vk;
use glam::DVec3;

use crate::aids::Aids;
use crate::course::Standpoint;
use crate::gpu::{Access, Buffer, Commands, DeviceInfo, Frame, Frames, Image, Transition};
use crate::inspect::Inspect;
use crate::quality::Quality;
use crate::render::layout::{Request, SceneUniform, TileRecord};
use crate::render::{
    Air, Backdrop, Baking, Behind, Budget, Dark, EyeTarget, Horizon, Shading, Sight, SkyCube, TerrainPass,
    TileStore, VeilPass, View,
};
use crate::rig::{COMFORT_M, Eye, Pose, Rig};
use crate::telemetry::{Span, Stopwatch, Work};
use crate::terrain::backdrop::ROOT_UP;
use crate::terrain::morph::Detail;
use crate::terrain::select::{self, Frustum, Selection, slots_needed};
use crate::terrain::{Block, Surface};
use crate::world::Look;
use crate::xr;
use inspect::Frozen;
pub(crate) use inspect::Vantage;

/// The head may turn so far (radians) between the choice of tiles and the display.
const HEAD_MARGIN: f32 = 0.06;

/// Tiles are made ahead for where the viewer will be when he has gone so many of his heights above the ground: in a dive that
/// is three quarters of an octave.
const FORESEEN: f64 = 0.4;

/// Heights per frame below which a viewer stands still.
const LEAST_SPEED: f64 = 1e-3;

/// The renderer's parts and the world they draw.
pub(crate) struct Painter {
    pub(crate) selection: Selection,
    pub(crate) picture: Option<Buffer>,
    /// The eyes' pictures once more, in TRANSFER_SRC_OPTIMAL once a frame was drawn: what a window shows.
    pub(crate) mirror: Option<Image>,
    /// The part of it that the last frame fills, from its corner.
    pub(crate) mirrored: vk::Extent2D,
    pub(crate) terrain: TerrainPass,
    /// Sky and backdrop as a layer of their own.
    pub(crate) sky: Option<SkyCube>,
    pub(crate) backdrop: Backdrop,
    pub(crate) tiles: TileStore,
    pub(crate) frames: Frames,
    pub(crate) quality: Quality,
    /// The split that there are slots for.
    pub(crate) most_split: f64,
    pub(crate) surface: Surface,
    pub(crate) look: Look,
    /// Nothing is left for the next frame.
    pub(crate) complete: bool,
    /// Pixels of both eyes.
    pub(crate) eye_pixels: f64,
    /// The backdrop is as if the viewer had come here as he goes on: else it is made so, at once.
    pub(crate) settled: bool,
    /// How fast the viewer may go on, from 0 to 1.
    pub(crate) headroom: f64,
    /// Milliseconds of GPU time that tiles may take in a frame, where frames must not wait.
    pub(crate) tiles_ms: f64,
    /// The same where nothing is held back.
    pub(crate) most_tiles_ms: f64,
    /// Milliseconds that baking may take.
    pub(crate) bake_budget_ms: f64,
    /// Milliseconds and texels of a frame's baking, smoothed.
    pub(crate) bake_cost: [f64; 2],
    /// Work of the frame so far, of what is known as it is done.
    pub(crate) work: Work,
    /// What is shown otherwise than usual.
    pub(crate) inspect: Inspect,
    /// What is drawn over the land.
    pub(crate) aids: Aids,
    pub(crate) veil: VeilPass,
    /// The mirror shows the veil, too: the wearer's very picture.
    pub(crate) veil_in_mirror: bool,
    /// The frame is black: see [`Aids::blinks`].
    pub(crate) blinks: bool,
    /// What the last selection was made from.
    pub(crate) vantage: Vantage,
    /// What was baked is in another light.
    pub(crate) stale_light: bool,
    /// Where the viewer was when the selection was frozen.
    pub(crate) frozen: Option<Frozen>,
}

/// A frame's viewer.
#[derive(Clone, Copy)]
struct Viewpoint<'a> {
    standpoint: &'a Standpoint<'a>,
    rig: &'a Rig,
    head: &'a Pose,
    eyes: &'a [Eye; 2],
    /// The middle of the head, in anchor tiles.
    here: DVec3,
}

impl Viewpoint<'_> {
    /// Level of the anchor.
    fn level(&self) -> usize {
        self.standpoint.place.level()
    }

    /// Metres of a tile of a level.
    fn tile_m(&self, level: usize) -> f64 {
        self.rig.metres_per_tile * 2f64.powi(self.level() as i32 - level as i32)
    }
}

/// Where a selection begins.
struct Root<'a> {
    block: &'a Block,
    /// The middle of the head, in the block's tiles.
    head: DVec3,
    /// Levels below the block's that may be drawn.
    levels: usize,
    window: Window,
}

impl Root<'_> {
    fn view(&self, detail: Detail, frusta: Option<[Frustum; 2]>) -> select::View<'_> {
        let &Root { block, head, levels, window: Window { live_from, prefetch_from, .. } } = self;
        select::View { root: block, head, levels, live_from, prefetch_from, detail, frusta }
    }
}

impl Painter {
    /// Begins a frame: bakes what is needed, selects tiles, and records their making and a part of the backdrop.
    pub(crate) fn begin(
        &mut self,
        standpoint: &Standpoint<'_>,
        rig: &Rig,
        (head, eyes): (&Pose, &[Eye; 2]),
        watch: &mut Stopwatch,
    ) -> Result<Frame> {
        let viewpoint = Viewpoint { standpoint, rig, head, eyes, here: rig.head(head) };
        self.work = Work::default();
        if let Some(moved) = self.moved_since_frozen(&viewpoint) {
            return self.begin_frozen(&viewpoint, moved, watch);
        }
        if std::mem::take(&mut self.stale_light) {
            self.backdrop.forget();
            self.settled = false;
        }
        let frame = match self.inspect.octave {
            None => self.begin_usual(&viewpoint, watch)?,
            Some(octave) => self.begin_octave(&viewpoint, inspect::octave_level(octave), watch)?,
        };
        self.freeze(&viewpoint);
        Ok(frame)
    }

    fn begin_usual(&mut self, viewpoint: &Viewpoint<'_>, watch: &mut Stopwatch) -> Result<Frame> {
        let &Viewpoint { standpoint, here, .. } = viewpoint;
        self.backdrop.begin_frame((standpoint.place, here), standpoint.depth, self.complete);
        // The first frame and a jump show everything at once; else coarser tiles stand in for what is to come.
        let at_once = self.complete || !self.settled || self.backdrop.schedule().is_lost();
        if at_once {
            self.settle(standpoint, here)?;
        }
        watch.lap(Span::Bake);
        let all = at_once || self.backdrop.schedule().is_hasty();
        self.tiles.set_budget(match all {
            true => Budget::Unlimited,
            false => Budget::Milliseconds(self.tiles_ms),
        });
        let mut frame = self.frames.begin()?;
        watch.lap(Span::Begin);
        let index = frame.index;
        self.tiles.begin_frame(index, self.pass_ms("tiles"));
        let baking = self.prepare_bake(index, standpoint, self.most_texels());
        watch.lap(Span::Bake);
        let level = viewpoint.level();
        let window = self.window(level);
        let (root, head) = standpoint.place.lift(here, level, window.root);
        let levels = level + self.quality.down - window.root;
        let surface = self.surface;
        let from = Root { block: &root.block, head, levels, window };
        self.select(viewpoint, &surface, &from);
        self.foresee(viewpoint, &surface, &from, all);
        let at_hand = (self.selection.counts.soon == 0).then_some(window.root + window.prefetch_from);
        self.backdrop.set_at_hand(at_hand);
        watch.lap(Span::Select);
        self.place_tiles(index, viewpoint, DVec3::ZERO);
        watch.lap(Span::Record);
        self.learn(&baking);
        self.headroom = self.backdrop.headroom(self.most_texels());
        watch.lap(Span::Bake);
        self.count(&baking);
        frame.pass(c"tiles", |commands| self.tiles.record(commands));
        if self.backdrop.has_work(&baking) {
            frame.pass(c"bake", |commands| self.backdrop.record(commands, index, &baking));
        }
        Ok(frame)
    }

    /// Asks for what will be wanted where the viewer goes on as he does. Not where all is made at once: such a frame depends
    /// on its place alone.
    fn foresee(&mut self, viewpoint: &Viewpoint<'_>, surface: &Surface, root: &Root<'_>, all: bool) {
        let (way, of_level) = self.backdrop.schedule().pace();
        let levels_down = |from: usize, to: usize| (to as f64 - from as f64).exp2();
        let height = viewpoint.standpoint.height * levels_down(viewpoint.level(), of_level);
        let speed = way.length() / height;
        let goes = !all && speed > LEAST_SPEED;
        self.tiles.set_foreseen(if goes { FORESEEN / speed } else { 0.0 });
        if goes {
            let by = way * (FORESEEN / speed * levels_down(of_level, root.window.root));
            let view = root.view(self.quality.detail, None);
            self.selection.foresee(surface, &view, by, &mut self.tiles);
        }
    }

    fn select(&mut self, viewpoint: &Viewpoint<'_>, surface: &Surface, root: &Root<'_>) {
        let &Viewpoint { rig, head, eyes, .. } = viewpoint;
        let window = root.window;
        let root_m = viewpoint.tile_m(window.root);
        let frusta = eyes.map(|eye| rig.frustum(head, &eye, HEAD_MARGIN, root_m));
        let view = root.view(self.quality.detail, Some(frusta));
        self.selection.select(surface, &view, &mut self.tiles);
        self.vantage = Vantage {
            root: window.root,
            root_m,
            eyes: eyes.map(|eye| (rig.scene_from_view(head, &eye), eye.fov)),
        };
    }

    /// Sees to it that the cube layer, where there is one, shows what is behind the tiles. It is drawn anew only when
    /// that has changed; where the runtime does not give it in time, the eyes' pictures take its place.
    pub(crate) fn draw_sky(
        &mut self,
        frame: &mut Frame,
        xr_frame: &mut xr::Frame<'_>,
        standpoint: &Standpoint<'_>,
        rig: &Rig,
    ) -> Result<Behind, xr::Error> {
        let horizon = self.horizon(standpoint, rig);
        let in_eyes = Behind::Sky(self.backdrop.front());
        let usual = self.sky_is_usual() && self.terrain.shading == Shading::Full;
        let Some(sky) = self.sky.as_mut().filter(|_| usual) else { return Ok(in_eyes) };
        if !sky.is_stale(&self.look, &horizon, &self.backdrop) {
            return Ok(Behind::Open);
        }
        let Some(cube) = xr_frame.acquire_cube()? else { return Ok(in_eyes) };
        let (index, scene) = (frame.index, (&self.look, &horizon, &self.backdrop));
        frame.pass(c"sky cube", |commands| sky.record(commands, index, scene, (&cube.faces, cube.side)));
        Ok(Behind::Open)
    }

    pub(crate) fn record(
        &mut self,
        frame: &mut Frame,
        images: &xr::EyeImages,
        target: &EyeTarget,
        behind: Behind,
    ) {
        let index = frame.index;
        if images.depth.layout == vk::ImageLayout::UNDEFINED {
            // Our own depth image, shared by all frames: the frame before may still write it.
            frame.commands().transition(&[Transition {
                image: images.depth.image,
                aspect: vk::ImageAspectFlags::DEPTH,
                from: (Access::DEPTH_WRITE, vk::ImageLayout::UNDEFINED),
                to: (Access::DEPTH_WRITE, vk::ImageLayout::DEPTH_STENCIL_ATTACHMENT_OPTIMAL),
            }]);
        }
        frame.pass(c"terrain", |commands| self.terrain.record(commands, index, behind, target));
    }

    /// Copies the eyes' pictures to where they are wanted, too, after all that was drawn into them, and darkens them.
    pub(crate) fn keep(&mut self, frame: &mut Frame, images: &xr::EyeImages, target: &EyeTarget) {
        if !self.veil_in_mirror {
            self.copy_to_mirror(frame, images);
        }
        if self.dark().is_some() {
            let (index, only_eye) = (frame.index, self.terrain.only_eye);
            frame.pass(c"veil", |commands| self.veil.record(commands, index, target, only_eye));
        }
        if self.veil_in_mirror {
            self.copy_to_mirror(frame, images);
        }
        if let Some(picture) = &self.picture {
            frame.pass(c"picture", |commands| copy_out(commands, images.color.image, images.extent, picture));
        }
    }

    /// What darkens the frame, if anything does.
    fn dark(&self) -> Option<Dark> {
        let fade = if self.blinks { 1.0 } else { self.aids.fade };
        Some(Dark { vignette: self.aids.vignette, fade }).filter(Dark::is_any)
    }

    fn copy_to_mirror(&mut self, frame: &mut Frame, images: &xr::EyeImages) {
        if let Some(mirror) = &self.mirror {
            self.mirrored = images.extent;
            frame.pass(c"mirror", |commands| copy_aside(commands, images.color.image, images.extent, mirror));
        }
    }

    pub(crate) fn set_sight(
        &mut self,
        index: usize,
        standpoint: &Standpoint<'_>,
        rig: &Rig,
        views: [View; 2],
    ) {
        let Horizon { air, backdrop } = self.horizon(standpoint, rig);
        if let Some(dark) = self.dark() {
            self.veil.set(index, &dark, &views);
        }
        let sight = Sight {
            views,
            air,
            detail: self.quality.detail,
            depth: standpoint.depth,
            cell_m: (rig.metres_per_tile * standpoint.unit()) as f32,
            backdrop,
        };
        self.terrain.set_sight(index, &self.look, &sight);
    }

    /// Takes over from the painter before it what does not depend on the world.
    pub(crate) fn follow(&mut self, before: &mut Painter) {
        self.picture = before.picture.take();
        self.mirror = before.mirror.take();
        self.terrain.follow(&mut before.terrain);
        self.complete = before.complete;
        (self.most_tiles_ms, self.bake_budget_ms) = (before.most_tiles_ms, before.bake_budget_ms);
        self.mirrored = before.mirrored;
        self.aids = std::mem::take(&mut before.aids);
        self.veil_in_mirror = before.veil_in_mirror;
    }

    /// Light from elsewhere. Where it is `settled`, what was baked in the old light is baked anew.
    pub(crate) fn set_sun(&mut self, direction: [f32; 3], settled: bool) {
        self.look.sun_direction = direction;
        // A frozen backdrop stays as it is, for as long as that.
        self.stale_light |= settled;
    }

    /// Counts what a submission makes and bakes.
    fn count(&mut self, baking: &Baking) {
        let (made, baked) = (self.tiles.requested(), baking.pieces);
        let bytes = made * size_of::<Request>() + baked * size_of::<TileRecord>();
        self.work.tiles_made += made as u64;
        self.work.texels_baked += baking.texels as u64;
        self.work.bytes_uploaded += bytes as u64;
    }

    /// The work of the frame just recorded, but for its draws.
    pub(crate) fn work(&self) -> Work {
        let counts = self.selection.counts;
        let bytes = counts.drawn * size_of::<TileRecord>()
            + size_of::<SceneUniform>()
            + size_of::<vk::DrawIndexedIndirectCommand>();
        Work {
            nodes: counts.nodes as u64,
            tiles_drawn: counts.drawn as u64,
            tiles_waiting: counts.waiting as u64,
            triangles: counts.drawn as u64 * u64::from(self.terrain.triangles_per_tile()),
            bytes_uploaded: self.work.bytes_uploaded + bytes as u64,
            ..self.work
        }
    }

    fn horizon(&self, standpoint: &Standpoint<'_>, rig: &Rig) -> Horizon {
        let air = match self.has_haze() {
            true => air(&self.look, standpoint, &self.quality),
            false => Air::NONE,
        };
        let backdrop = self.backdrop.nearest().filter(|_| self.has_backdrop()).map(|_| {
            let levels = standpoint.place.level() as f64 - self.backdrop.reference() as f64;
            (rig.metres_per_tile.log2() + levels) as f32
        });
        Horizon { air, backdrop }
    }

    /// Where live tiles begin: at the level after the nearest whole layer of the backdrop.
    fn window(&self, level: usize) -> Window {
        let wanted = self.quality.backdrop.nearest_layer(level);
        let live = self.backdrop.nearest().map_or(wanted, |l| l + 1);
        let prefetch = self.backdrop.schedule().prefetch_from().map_or(live, |l| l.min(live));
        self.window_from(level, live, prefetch)
    }

    fn window_from(&self, level: usize, live: usize, prefetch: usize) -> Window {
        let highest = (level + self.quality.down).saturating_sub(select::MOST_LEVELS);
        let root = prefetch.saturating_sub(ROOT_UP).max(highest).min(level);
        let [live_from, prefetch_from] = [live, prefetch].map(|l| l.saturating_sub(root));
        Window { root, live_from, prefetch_from }
    }

    /// Most texels that a frame may bake: a share of the eyes' pixels, and no more than the budget of time lets, as far as
    /// that is known.
    fn most_texels(&self) -> f64 {
        let share = BAKED_SHARE * self.eye_pixels;
        let [ms, texels] = self.bake_cost;
        if ms > 0.0 { (self.bake_budget_ms / ms * texels).clamp(0.25 * share, share) } else { share }
    }

    /// GPU time of a pass of the last frame that was measured, if it had one.
    fn pass_ms(&self, name: &str) -> Option<f64> {
        self.frames.times().iter().find(|pass| pass.name == name).map(|pass| pass.ms)
    }

    /// Learns what baking costs the GPU: both sides of the ratio are smoothed alike, as times come frames late.
    fn learn(&mut self, baking: &Baking) {
        let Some(bake_ms) = self.pass_ms("bake") else { return };
        let [ms, texels] = &mut self.bake_cost;
        *ms += 0.05 * (bake_ms - *ms);
        *texels += 0.05 * (baking.texels as f64 - *texels);
    }

    fn prepare_bake(&mut self, index: usize, standpoint: &Standpoint<'_>, most_texels: f64) -> Baking {
        let with = (&self.surface, &self.look);
        self.backdrop.prepare(index, standpoint.place, most_texels, with, &mut self.tiles)
    }

    /// Bakes everything that is wanted here, and the spare where frames must not wait for it later.
    fn settle(&mut self, standpoint: &Standpoint<'_>, here: DVec3) -> Result<()> {
        let at = (standpoint.place, here);
        // A complete frame has begun like that already.
        if !self.complete {
            self.backdrop.begin_frame(at, standpoint.depth, true);
        }
        self.bake_all(standpoint)?;
        if !self.complete {
            self.backdrop.begin_frame(at, standpoint.depth, false);
            self.bake_all(standpoint)?;
        }
        self.settled = true;
        Ok(())
    }

    /// Bakes until nothing is left to bake, in submissions of a layer or less each.
    fn bake_all(&mut self, standpoint: &Standpoint<'_>) -> Result<()> {
        loop {
            let mut frame = self.frames.begin()?;
            let index = frame.index;
            self.tiles.begin_frame(index, None);
            let baking = self.prepare_bake(index, standpoint, f64::INFINITY);
            if baking.whole {
                return Ok(());
            }
            self.count(&baking);
            frame.pass(c"tiles", |commands| self.tiles.record(commands));
            frame.pass(c"bake", |commands| self.backdrop.record(commands, index, &baking));
            self.frames.submit(frame, &[], &[])?;
        }
    }
}

/// All layers of a colour image, packed.
pub(crate) fn whole_image(extent: vk::Extent2D, layers: u32) -> vk::BufferImageCopy {
    vk::BufferImageCopy::default()
        .image_subresource(vk::ImageSubresourceLayers {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            mip_level: 0,
            base_array_layer: 0,
            layer_count: layers,
        })
        .image_extent(vk::Extent3D { width: extent.width, height: extent.height, depth: 1 })
}

/// Where the selection begins, and from which of its levels tiles are live.
#[derive(Clone, Copy, Debug)]
struct Window {
    root: usize,
    live_from: usize,
    prefetch_from: usize,
}

/// Slots for the live tiles, and for the layers that submissions in flight bake.
pub(crate) fn slots(info: &DeviceInfo, quality: &Quality) -> Result<u32> {
    let live = slots_needed(&quality.detail, quality.live_levels());
    let wanted = live + BAKE_SLOTS;
    let bytes = 4 * quality.layout.words() as u64;
    let room = (u64::from(info.limits.max_storage_buffer_range) / bytes) as u32;
    // The derivation is for the worst flight; what is usual fits in two thirds of it.
    anyhow::ensure!(
        room >= wanted * 2 / 3,
        "{} can address only {room} tiles and {wanted} are needed: choose smaller eye pictures (--size) or tiles (quality.cells)",
        info.name
    );
    Ok(wanted.min(room))
}

/// Slots for baking: what one submission bakes at most.
const BAKE_SLOTS: u32 = 256;

/// Baked texels of a frame, as a share of the eyes' pixels, where frames must not wait.
const BAKED_SHARE: f64 = 0.12;

/// Milliseconds of GPU time that baking may take in a frame; on a software device a frame takes so much longer, in a window
/// it should not.
pub(crate) fn bake_budget_ms(info: &DeviceInfo, in_a_window: bool) -> f64 {
    match (info.software, in_a_window) {
        (true, true) => 8.0,
        (true, false) => 12.0,
        (false, _) => 1.2,
    }
}

/// The haze closes where the backdrop ends, at the same distance at every depth: that of the nearer end.
fn air(look: &Look, standpoint: &Standpoint<'_>, quality: &Quality) -> Air {
    let cells = standpoint.height / standpoint.unit();
    let layers = quality.backdrop.lag + quality.backdrop.layers - 1;
    let end = layers as f64 + (quality.backdrop.detail.split / cells).log2();
    Air::new(look, COMFORT_M as f32, end as f32)
}

/// Copies both layers of a colour image to a buffer, and leaves the image as it was.
fn copy_out(commands: Commands<'_>, image: vk::Image, extent: vk::Extent2D, to: &Buffer) {
    let aspect = vk::ImageAspectFlags::COLOR;
    let drawn = (Access::COLOUR_WRITE, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL);
    let copied = (Access::COPY_READ, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
    commands.transition(&[Transition { image, aspect, from: drawn, to: copied }]);
    let region = whole_image(extent, 2);
    // The frame before may still be copying to the same buffer.
    commands.barrier(Access::COPY_WRITE, Access::COPY_WRITE);
    commands.copy_image_to_buffer((image, copied.1), to, &[region]);
    commands.transition(&[Transition { image, aspect, from: copied, to: drawn }]);
    commands.barrier(Access::COPY_WRITE, Access::HOST_READ);
}

/// Copies so much of both layers of a colour image to another of its size, and leaves the image as it was.
fn copy_aside(commands: Commands<'_>, image: vk::Image, extent: vk::Extent2D, to: &Image) {
    let aspect = vk::ImageAspectFlags::COLOR;
    let drawn = (Access::COLOUR_WRITE, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL);
    let read = (Access::COPY_READ, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
    let written = (Access::COPY_WRITE, vk::ImageLayout::TRANSFER_DST_OPTIMAL);
    // The window may still be reading the frame before.
    let old = (Access::COPY_READ, vk::ImageLayout::UNDEFINED);
    commands.transition(&[
        Transition { image, aspect, from: drawn, to: read },
        Transition { image: to.raw, aspect, from: old, to: written },
    ]);
    let layers = vk::ImageSubresourceLayers {
        aspect_mask: aspect,
        mip_level: 0,
        base_array_layer: 0,
        layer_count: to.layer_views.len() as u32,
    };
    let region = vk::ImageCopy::default()
        .src_subresource(layers)
        .dst_subresource(layers)
        .extent(vk::Extent3D { width: extent.width, height: extent.height, depth: 1 });
    commands.copy_image((image, read.1), (to.raw, written.1), &[region]);
    commands.transition(&[
        Transition { image, aspect, from: read, to: drawn },
        Transition { image: to.raw, aspect, from: written, to: read },
    ]);
}
