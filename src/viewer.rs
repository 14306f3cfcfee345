//! The viewer: a session, the GPU and the renderer, owned in the order in which they must go; one readable frame.

use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, Result};
use ash::vk;
use glam::DVec3;

use crate::cli::RuntimeChoice;
use crate::course::Standpoint;
use crate::gpu::{
    Access, Buffer, BufferInfo, Commands, DeviceInfo, Frame, Frames, Gpu, GpuConfig, Image, Location,
    Transition,
};
use crate::mock::{Clock, Mock, MockConfig};
use crate::render::layout::{Request, SceneUniform, SlotLayout, TileRecord};
use crate::render::{
    Air, Backdrop, BackdropConfig, Baking, Behind, Budget, EyeTarget, Horizon, Pace, Shading, Sight, SkyCube,
    TargetFormat, TerrainPass, TileStore, View,
};
use crate::rig::{Eye, Pose, Rig};
use crate::telemetry::{FrameStats, Passes, Span, Stopwatch, Work};
use crate::terrain::Surface;
use crate::terrain::backdrop::{self, Layer, ROOT_UP};
use crate::terrain::morph::Detail;
use crate::terrain::select::{self, Counts, Selection, slots_needed};
use crate::terrain::tile::Cells;
use crate::world::{Look, World};
use crate::xr;

/// Frames that the CPU may be ahead of the GPU.
const IN_FLIGHT: usize = 2;

/// Distance of the near plane in the user's metres.
const NEAR_M: f32 = 0.05;

/// The height that a flight's altitude has for the user, in metres: comfortable for stereo.
const COMFORT_M: f64 = 2.0;

/// The head may turn so far (radians) between the choice of tiles and the display.
const HEAD_MARGIN: f32 = 0.06;

/// How much is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// Data and mesh cells of a tile.
    pub layout: SlotLayout,
    /// When tiles split and morph.
    pub detail: Detail,
    /// Levels below the anchor that are drawn.
    pub down: usize,
    /// What is baked: everything further above the anchor than its lag.
    pub backdrop: BackdropConfig,
}

/// Pixels that a data cell has on the screen when its tile is about to split: enough for its normals not to glitter.
const PIXELS_PER_CELL: f64 = 2.2;

/// Most pixels by which the nearest content of the backdrop may shift while the viewer moves about the anchor.
const PARALLAX_PIXELS: f64 = 0.5;

/// How far from where a layer is baked the viewer may be, in anchor tiles: as high as flights fly, and aside.
const ROAMING_TILES: f64 = 3.0;

/// Octaves beyond the nearest ground at which the air closes the world.
const HAZE_OCTAVES: usize = 32;

/// Least and most texels per side of the backdrop's faces.
const FACE: std::ops::RangeInclusive<f64> = 128.0..=4096.0;

impl Quality {
    /// What suits a device and a picture with so many pixels per unit of tangent at its middle: fewer triangles on
    /// a software device, finer tiles for finer pictures.
    pub fn new(info: &DeviceInfo, pixels_per_tangent: f64) -> Quality {
        let (mesh, split) = if info.software { (16, 2.6) } else { (32, 3.0) };
        let wanted = pixels_per_tangent / split / PIXELS_PER_CELL;
        let cells = if wanted > 46.0 { Cells::N64 } else { Cells::N32 };
        let (layout, detail) = (SlotLayout { cells, mesh }, Detail::new(split));
        let lag = backdrop::lag_for(ROAMING_TILES, split, pixels_per_tangent, PARALLAX_PIXELS).clamp(4, 14);
        let face = (2.0 * pixels_per_tangent).clamp(*FACE.start(), *FACE.end()).log2().ceil().exp2() as u32;
        let backdrop = BackdropConfig { face, lag, layers: HAZE_OCTAVES - lag };
        Quality { layout, detail, down: 3, backdrop }
    }

    /// Levels of live tiles: one more than the lag while the next layer is baked.
    fn live_levels(&self) -> usize {
        self.backdrop.lag + 1 + self.down
    }
}

/// Which session to open, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewerConfig {
    /// Which runtime.
    pub runtime: RuntimeChoice,
    /// Validation layers on.
    pub validate: bool,
    /// Pixels per eye; None takes what the runtime recommends.
    pub eye_size: Option<[u32; 2]>,
    /// Both eyes in one pass where the device can.
    pub multiview: bool,
    /// The mock's clock is stepped: as fast as frames can be drawn.
    pub stepped: bool,
    /// Every frame complete, whatever it takes (captures); else within a budget.
    pub complete: bool,
    /// How much is drawn; None: what suits the device and the size.
    pub quality: Option<Quality>,
    /// Sky and backdrop go to the runtime as a cubemap behind the eyes' pictures, where it takes one: it then turns
    /// them with the head exactly, whenever the picture was drawn. The eyes' pictures alone are then without them.
    pub backdrop_layer: bool,
}

impl Default for ViewerConfig {
    fn default() -> ViewerConfig {
        ViewerConfig {
            runtime: RuntimeChoice::Mock,
            validate: false,
            eye_size: None,
            multiview: true,
            stepped: true,
            complete: true,
            quality: None,
            backdrop_layer: false,
        }
    }
}

/// A software device may well take minutes for a large picture.
const SOFTWARE_TIMEOUT: Duration = Duration::from_secs(600);

/// Milliseconds of GPU time that tiles may take in a frame, where frames must not wait.
const TILE_BUDGET_MS: f64 = 2.0;

/// What came of a call of [`Viewer::frame`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// A frame was drawn.
    Drew,
    /// The runtime wanted a frame without a picture.
    Skipped,
    /// No frame is wanted now: try again in about 100 ms.
    Idle,
    /// The session is over.
    Exited,
}

/// Everything that draws into one session. Fields are dropped in order.
pub struct Viewer {
    painter: Painter,
    session: xr::Session,
    runtime: xr::Runtime,
    gpu: Arc<Gpu>,
    mock: Option<Mock>,
    /// The head of the first frame: the seat of the rig.
    seat: Option<Pose>,
    stats: FrameStats,
}

/// The renderer's parts and the world they draw.
struct Painter {
    selection: Selection,
    picture: Option<Buffer>,
    terrain: TerrainPass,
    /// Sky and backdrop as a layer of their own.
    sky: Option<SkyCube>,
    backdrop: Backdrop,
    tiles: TileStore,
    frames: Frames,
    quality: Quality,
    surface: Surface,
    look: Look,
    /// Nothing is left for the next frame.
    complete: bool,
    /// Pixels of both eyes.
    eye_pixels: f64,
    /// Depth of the frame before, and the octaves that a frame falls, smoothed.
    depth: Option<f64>,
    falling: f64,
    /// Work of the frame so far, of what is known as it is done.
    work: Work,
}

impl Viewer {
    /// Opens a session and prepares everything to draw `world` in it.
    ///
    /// # Errors
    /// No runtime, no device, no memory: a sentence that says what to do.
    pub fn open(world: &World, config: &ViewerConfig) -> Result<Viewer> {
        let (runtime, mock) = open_runtime(config)?;
        Viewer::on(world, config, runtime, mock)
    }

    /// The same on a mock of one's own.
    ///
    /// # Errors
    /// As [`Viewer::open`].
    pub fn on_mock(world: &World, config: &ViewerConfig, mock: Mock) -> Result<Viewer> {
        let entry = mock.entry().context("the built-in runtime cannot start")?;
        let runtime = xr::Runtime::open(entry, "Fathomless")?;
        Viewer::on(world, config, runtime, Some(mock))
    }

    fn on(world: &World, config: &ViewerConfig, runtime: xr::Runtime, mock: Option<Mock>) -> Result<Viewer> {
        let gpu = Gpu::new(&runtime, &GpuConfig { validate: config.validate })?;
        let mut session = xr::Session::new(
            &runtime,
            &gpu,
            xr::SessionConfig { eye_size: config.eye_size, near_m: NEAR_M, multiview: config.multiview },
        )?;
        let extent = session.info().extent;
        // The usual headset and the built-in one see about 45 degrees to each side.
        let usual = Quality::new(&gpu.info, f64::from(extent.width.max(extent.height)) / 2.0);
        let quality = config.quality.unwrap_or(usual);
        let slots = slots(&gpu.info, &quality)?;
        let tiles = TileStore::new(&gpu, quality.layout, slots, &world.surface, IN_FLIGHT)?;
        let backdrop = Backdrop::new(&gpu, &tiles, quality.backdrop, IN_FLIGHT)?;
        let sky = match config.backdrop_layer {
            true => open_sky(&mut session, &runtime, &gpu, &backdrop)?,
            false => None,
        };
        let info = session.info();
        let format = TargetFormat {
            colour: info.color_format,
            depth: info.depth_format,
            encode: info.encode_srgb,
            multiview: info.multiview,
        };
        let terrain = TerrainPass::new(&gpu, &tiles, &backdrop, slots as usize, format, IN_FLIGHT)?;
        let mut frames = Frames::new(&gpu, IN_FLIGHT)?;
        if gpu.info.software {
            frames.timeout = SOFTWARE_TIMEOUT;
        }
        let painter = Painter {
            selection: Selection::default(),
            picture: None,
            terrain,
            sky,
            backdrop,
            tiles,
            frames,
            quality,
            surface: world.surface,
            look: world.look.clone(),
            complete: config.complete,
            eye_pixels: 2.0 * f64::from(extent.width) * f64::from(extent.height),
            depth: None,
            falling: 0.0,
            work: Work::default(),
        };
        Ok(Viewer { painter, session, runtime, gpu, mock, seat: None, stats: FrameStats::default() })
    }

    /// The device.
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// The runtime.
    pub fn runtime(&self) -> &xr::Runtime {
        &self.runtime
    }

    /// What the session settled on.
    pub fn session_info(&self) -> &xr::SessionInfo {
        self.session.info()
    }

    /// What the last selection came to.
    pub fn counts(&self) -> Counts {
        self.painter.selection.counts
    }

    /// How much is drawn.
    pub fn quality(&self) -> &Quality {
        &self.painter.quality
    }

    /// The backdrop.
    pub fn backdrop(&self) -> &Backdrop {
        &self.painter.backdrop
    }

    /// What the last frame drawn cost.
    pub fn stats(&self) -> &FrameStats {
        &self.stats
    }

    /// From now on every frame is complete, whatever it takes, or else within a budget. The next frame may be anywhere.
    pub fn set_complete(&mut self, complete: bool) {
        self.painter.complete = complete;
        (self.painter.depth, self.painter.falling) = (None, 0.0);
    }

    /// Texels per side of the layer that sky and backdrop are shown as; None: they are in the eyes' pictures.
    pub fn backdrop_layer(&self) -> Option<u32> {
        self.session.cube_side()
    }

    /// Light and sky, or what shows holes.
    pub fn set_shading(&mut self, shading: Shading) {
        self.painter.terrain.shading = shading;
    }

    /// Asks the session to end; go on calling [`Viewer::frame`] until it says [`Step::Exited`].
    ///
    /// # Errors
    /// The session is lost.
    pub fn request_exit(&mut self) -> Result<(), xr::Error> {
        self.session.request_exit()
    }

    /// One frame of the session, drawn from `standpoint`. A head that is worn has its own pitch and roll: then `worn`
    /// keeps the standpoint's heading only.
    ///
    /// # Errors
    /// [`xr::Error`] or [`crate::gpu::Lost`] when session, instance or device are lost.
    pub fn frame(&mut self, standpoint: &Standpoint<'_>, worn: bool) -> Result<Step> {
        let mut watch = Stopwatch::start();
        match self.session.poll()? {
            xr::Phase::Idle => return Ok(Step::Idle),
            xr::Phase::Exited => return Ok(Step::Exited),
            xr::Phase::Running(_) => {}
        }
        let Some(tick) = self.session.wait_frame()? else { return Ok(Step::Idle) };
        watch.lap(Span::Wait);
        let mut xr_frame = self.session.begin_frame(tick)?;
        let Some(images) = xr_frame.acquire()? else {
            xr_frame.end(None)?;
            return Ok(Step::Skipped);
        };
        let views = xr_frame.locate_views()?;
        watch.lap(Span::Xr);
        let (head, eyes) = plain(&views);
        let seat = self.seat.unwrap_or(head);
        // Until the head is tracked, the seat is wherever the head is taken to be.
        self.seat = self.seat.or((views.tracking == xr::Tracking::Full).then_some(head));
        let rig = rig(standpoint, &seat, worn);
        let painter = &mut self.painter;
        let draws_before = self.gpu.draws();
        let mut frame = painter.begin(standpoint, &rig, (&head, &eyes), &mut watch)?;
        let target = EyeTarget {
            extent: images.extent,
            colour: images.color.both,
            colour_of_eye: images.color.per_eye,
            depth: images.depth.both,
            depth_of_eye: images.depth.per_eye,
        };
        let behind = painter.draw_sky(&mut frame, &mut xr_frame, standpoint, &rig)?;
        if behind == Behind::Open {
            // Scene axes to the play space's: the backdrop is along the terrain's axes, and the rig turns the play space.
            xr_frame.show_cube(rig.orientation.conjugate());
        }
        painter.record(&mut frame, &images, &target, behind);

        // The eyes are asked for again, as late as can be: nearer to the display, the prediction is better.
        watch.lap(Span::Record);
        let views = xr_frame.locate_views()?;
        watch.lap(Span::Xr);
        // The tiles are placed around the head as it was: the eyes have moved from there.
        let (_, eyes) = plain(&views);
        let views_of_scene = [0, 1].map(|i| View {
            scene_from_view: rig.scene_from_view(&head, &eyes[i]),
            clip_from_view: views.eyes[i].fov.clip_from_view(NEAR_M),
        });
        painter.set_sight(frame.index, standpoint, &rig, views_of_scene);
        watch.lap(Span::Record);
        let serial = painter.frames.submit(frame, &[], &[])?;
        watch.lap(Span::Submit);
        xr_frame.end(Some(&views))?;
        watch.lap(Span::Xr);
        self.stats = FrameStats {
            serial,
            spans: watch.spans(),
            work: Work { draws: self.gpu.draws() - draws_before, ..painter.work() },
            timed_serial: painter.frames.timed_serial(),
            passes: Passes::default(),
        };
        painter.frames.times().iter().for_each(|pass| self.stats.passes.add(pass.name, pass.ms));
        Ok(Step::Drew)
    }

    /// From now on every frame can be read by [`Viewer::picture`].
    ///
    /// # Errors
    /// Out of memory; or the backdrop is a layer of its own, so that the eyes' pictures are not the whole.
    pub fn keep_pictures(&mut self) -> Result<()> {
        anyhow::ensure!(
            self.painter.sky.is_none(),
            "pictures cannot be kept while the backdrop is a layer of its own: do without --backdrop-layer"
        );
        let extent = self.session.info().extent;
        let size = 2 * 4 * u64::from(extent.width) * u64::from(extent.height);
        self.painter.picture = Some(Buffer::new(
            &self.gpu,
            &BufferInfo {
                name: "picture",
                size,
                usage: vk::BufferUsageFlags::TRANSFER_DST,
                location: Location::Readback,
            },
        )?);
        Ok(())
    }

    /// Waits for the last frame, and gives an eye's picture: sRGB, rows from the top, 3 bytes per pixel.
    ///
    /// # Errors
    /// The device is lost.
    pub fn picture(&mut self, eye: usize) -> Result<Vec<u8>> {
        self.painter.frames.wait_idle()?;
        let info = self.session.info();
        let pixels = info.extent.width as usize * info.extent.height as usize;
        let Some(buffer) = &self.painter.picture else { anyhow::bail!("pictures are not kept") };
        let eye = &buffer.slice::<[u8; 4]>()[eye * pixels..(eye + 1) * pixels];
        let blue_first = matches!(info.color_format, vk::Format::B8G8R8A8_SRGB | vk::Format::B8G8R8A8_UNORM);
        let rgb = |&[a, g, b, _]: &[u8; 4]| if blue_first { [b, g, a] } else { [a, g, b] };
        Ok(eye.iter().flat_map(rgb).collect())
    }

    /// Waits for the last frame, and gives the backdrop in use.
    ///
    /// # Errors
    /// The device is lost, or out of memory.
    pub fn read_backdrop(&mut self) -> Result<Faces> {
        self.painter.frames.wait_idle()?;
        let backdrop = &self.painter.backdrop;
        let face = backdrop.config().face;
        Ok(Faces {
            side: face as usize,
            colour: read_faces(&self.gpu, backdrop.colour_image())?,
            log_distance: read_faces(&self.gpu, backdrop.distance_image())?,
            reference: backdrop.reference(),
        })
    }

    /// Ends the session and closes the device; what the validation layer and the built-in runtime had to say.
    ///
    /// # Errors
    /// The session or the device is lost.
    pub fn close(self) -> Result<Remarks> {
        self.painter.frames.wait_idle()?;
        let log = self.gpu.validation_log();
        let mock = self.mock.clone();
        drop(self);
        let report = log.report();
        let violations = mock.map(|mock| mock.violations()).unwrap_or_default();
        Ok(Remarks {
            validation: report.count as usize,
            violations: violations.len(),
            first: report.texts.into_iter().next().or_else(|| violations.first().map(|v| format!("{v:?}"))),
        })
    }
}

impl Painter {
    /// Begins a frame: bakes what is needed, selects tiles, and records their making and a part of the backdrop.
    fn begin(
        &mut self,
        standpoint: &Standpoint<'_>,
        rig: &Rig,
        (head, eyes): (&Pose, &[Eye; 2]),
        watch: &mut Stopwatch,
    ) -> Result<Frame> {
        let here = rig.head(head);
        self.work = Work::default();
        self.backdrop.begin_frame();
        // The first frame and a jump show everything at once; else coarser tiles stand in for what is to come.
        let at_once = self.complete || self.outrun(standpoint.place.level());
        if at_once {
            self.bake_all(standpoint, here)?;
        }
        watch.lap(Span::Bake);
        self.tiles.set_budget(match at_once {
            true => Budget::Unlimited,
            false => Budget::Milliseconds(TILE_BUDGET_MS),
        });
        let mut frame = self.frames.begin()?;
        watch.lap(Span::Begin);
        let index = frame.index;
        let tile_ms = self.frames.times().iter().find(|pass| pass.name == "tiles").map(|pass| pass.ms);
        self.tiles.begin_frame(index, tile_ms);
        let level = standpoint.place.level();
        let window = self.window(level);
        let (root, in_root) = standpoint.place.lift(here, level, window.root);
        let root_m = rig.metres_per_tile * (1u64 << (level - window.root)) as f64;
        let view = select::View {
            root: &root.block,
            head: in_root,
            levels: level + self.quality.down - window.root,
            live_from: window.live_from,
            detail: self.quality.detail,
            frusta: Some(eyes.map(|eye| rig.frustum(head, &eye, HEAD_MARGIN, root_m))),
        };
        self.selection.select(&self.surface, &view, &mut self.tiles);
        watch.lap(Span::Select);
        self.terrain.set_tiles(index, &self.selection.drawn, root_m);
        watch.lap(Span::Record);
        let baking = match self.complete {
            true => Baking::default(),
            false => {
                let pace = self.pace(standpoint);
                self.prepare_bake(index, standpoint, here, pace)
            }
        };
        watch.lap(Span::Bake);
        self.count(baking);
        frame.pass(c"tiles", |commands| self.tiles.record(commands));
        if baking.tiles > 0 {
            frame.pass(c"bake", |commands| self.backdrop.record(commands, index, baking));
        }
        Ok(frame)
    }

    /// Sees to it that the cube layer, where there is one, shows what is behind the tiles. It is drawn anew only when
    /// that has changed; where the runtime does not give it in time, the eyes' pictures take its place.
    fn draw_sky(
        &mut self,
        frame: &mut Frame,
        xr_frame: &mut xr::Frame<'_>,
        standpoint: &Standpoint<'_>,
        rig: &Rig,
    ) -> Result<Behind, xr::Error> {
        let horizon = self.horizon(standpoint, rig);
        let in_eyes = Behind::Sky(self.backdrop.front());
        let Some(sky) = self.sky.as_mut().filter(|_| self.terrain.shading == Shading::Full) else {
            return Ok(in_eyes);
        };
        if !sky.is_stale(&self.look, &horizon, &self.backdrop) {
            return Ok(Behind::Open);
        }
        let Some(cube) = xr_frame.acquire_cube()? else { return Ok(in_eyes) };
        let (index, scene) = (frame.index, (&self.look, &horizon, &self.backdrop));
        frame.pass(c"sky cube", |commands| sky.record(commands, index, scene, (&cube.faces, cube.side)));
        Ok(Behind::Open)
    }

    fn record(&mut self, frame: &mut Frame, images: &xr::EyeImages, target: &EyeTarget, behind: Behind) {
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
        if let Some(picture) = &self.picture {
            frame.pass(c"picture", |commands| copy_out(commands, images.color.image, images.extent, picture));
        }
    }

    fn set_sight(&mut self, index: usize, standpoint: &Standpoint<'_>, rig: &Rig, views: [View; 2]) {
        let Horizon { air, backdrop } = self.horizon(standpoint, rig);
        let sight = Sight {
            views,
            air,
            detail: self.quality.detail,
            depth: standpoint.depth,
            cell_m: (rig.metres_per_tile * unit(standpoint)) as f32,
            backdrop,
        };
        self.terrain.set_sight(index, &self.look, &sight);
    }

    /// Counts what a submission makes and bakes.
    fn count(&mut self, baking: Baking) {
        let (made, baked) = (self.tiles.requested(), baking.tiles);
        let bytes = made * size_of::<Request>() + baked * size_of::<TileRecord>();
        self.work.tiles_made += made as u64;
        self.work.texels_baked += baking.texels as u64;
        self.work.bytes_uploaded += bytes as u64;
    }

    /// The work of the frame just recorded, but for its draws.
    fn work(&self) -> Work {
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
        let air = air(&self.look, standpoint, &self.quality);
        let backdrop = self.backdrop.nearest().map(|_| {
            let levels = standpoint.place.level() as f64 - self.backdrop.reference() as f64;
            (rig.metres_per_tile.log2() + levels) as f32
        });
        Horizon { air, backdrop }
    }

    /// Where live tiles begin: at the level after the nearest whole layer of the backdrop.
    fn window(&self, level: usize) -> Window {
        let highest = (level + self.quality.down).saturating_sub(select::MOST_LEVELS);
        let wanted = level.saturating_sub(self.quality.backdrop.lag);
        let live = self.backdrop.nearest().map_or(wanted, |l| l + 1);
        let root = live.saturating_sub(ROOT_UP).max(highest).min(level);
        Window { root, live_from: live.saturating_sub(root) }
    }

    /// True if the viewer is where the backdrop in use is of no use.
    fn outrun(&self, level: usize) -> bool {
        let wanted = level.saturating_sub(self.quality.backdrop.lag);
        self.backdrop.nearest().is_none_or(|nearest| nearest.abs_diff(wanted) > MOST_BEHIND)
    }

    fn prepare_bake(&mut self, index: usize, standpoint: &Standpoint<'_>, here: DVec3, pace: Pace) -> Baking {
        let BackdropConfig { lag, layers, .. } = self.quality.backdrop;
        let nearest = standpoint.place.level().saturating_sub(lag);
        let farthest = ((nearest + 1).saturating_sub(layers) / FAR_STEP * FAR_STEP).max(ROOT_UP);
        let wanted = (farthest..=nearest).map(|level| Layer::new(standpoint.place, here, level, lag));
        let with = (&self.surface, &self.look, self.quality.detail);
        self.backdrop.prepare(index, wanted, pace, with, &mut self.tiles)
    }

    /// How much to bake in this frame: what is over the cubemap in use is due when the next octave begins, and is
    /// spread evenly until then; anything else goes as fast as the share of texels allows.
    fn pace(&mut self, standpoint: &Standpoint<'_>) -> Pace {
        let fallen = self.depth.replace(standpoint.depth).map_or(0.0, |before| standpoint.depth - before);
        self.falling += 0.2 * (fallen.clamp(-1.0, 1.0) - self.falling);
        let most = (BAKED_SHARE * self.eye_pixels) as usize;
        let texels = match self.backdrop.remaining() {
            Some(remaining) if self.falling > 1e-4 => {
                let frames = (1.0 - standpoint.depth.rem_euclid(1.0)) / self.falling;
                most.min((remaining as f64 / frames.max(1.0)).ceil() as usize)
            }
            _ => most,
        };
        Pace { texels, ..Pace::UNLIMITED }
    }

    /// Bakes everything that is wanted here, in submissions of a layer each.
    fn bake_all(&mut self, standpoint: &Standpoint<'_>, here: DVec3) -> Result<()> {
        loop {
            let mut frame = self.frames.begin()?;
            let index = frame.index;
            self.tiles.begin_frame(index, None);
            let baking = self.prepare_bake(index, standpoint, here, Pace::UNLIMITED);
            if baking.whole {
                return Ok(());
            }
            self.count(baking);
            frame.pass(c"tiles", |commands| self.tiles.record(commands));
            frame.pass(c"bake", |commands| self.backdrop.record(commands, index, baking));
            self.frames.submit(frame, &[], &[])?;
        }
    }
}

/// The texels of a backdrop, face by face (+x −x +y −y +z −z), rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Faces {
    /// Texels per side.
    pub side: usize,
    /// sRGB at half brightness without air, and coverage: 0 or 255.
    pub colour: Vec<[u8; 4]>,
    /// log2 of the distance in tiles of the reference level; far below any where nothing is.
    pub log_distance: Vec<f32>,
    /// Level of the tiles that distances count.
    pub reference: usize,
}

/// All texels of a cube's image, which is in layout GENERAL and has four bytes per texel.
fn read_faces<T: bytemuck::Pod>(gpu: &Arc<Gpu>, image: &Image) -> Result<Vec<T>> {
    let texels = 6 * image.extent.width as usize * image.extent.height as usize;
    let buffer = Buffer::new(
        gpu,
        &BufferInfo {
            name: "backdrop texels",
            size: 4 * texels as u64,
            usage: vk::BufferUsageFlags::TRANSFER_DST,
            location: Location::Readback,
        },
    )?;
    let region = whole_image(image.extent, 6);
    let aspect = vk::ImageAspectFlags::COLOR;
    let baked = (Access::COLOUR_WRITE | Access::FRAGMENT_READ, vk::ImageLayout::GENERAL);
    let copied = (Access::COPY_READ, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
    gpu.run(|commands| {
        commands.transition(&[Transition { image: image.raw, aspect, from: baked, to: copied }]);
        commands.copy_image_to_buffer((image.raw, copied.1), &buffer, &[region]);
        commands.transition(&[Transition { image: image.raw, aspect, from: copied, to: baked }]);
    })?;
    Ok(buffer.slice::<T>()[..texels].to_vec())
}

/// All layers of a colour image, packed.
fn whole_image(extent: vk::Extent2D, layers: u32) -> vk::BufferImageCopy {
    vk::BufferImageCopy::default()
        .image_subresource(vk::ImageSubresourceLayers {
            aspect_mask: vk::ImageAspectFlags::COLOR,
            mip_level: 0,
            base_array_layer: 0,
            layer_count: layers,
        })
        .image_extent(vk::Extent3D { width: extent.width, height: extent.height, depth: 1 })
}

/// What was found wrong with our own use of Vulkan and OpenXR.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Remarks {
    /// Messages of the validation layer.
    pub validation: usize,
    /// Violations that the built-in runtime recorded.
    pub violations: usize,
    /// The first of them.
    pub first: Option<String>,
}

fn open_runtime(config: &ViewerConfig) -> Result<(xr::Runtime, Option<Mock>)> {
    let system = || xr::system_entry().and_then(|entry| xr::Runtime::open(entry, "Fathomless"));
    match config.runtime {
        RuntimeChoice::System => return Ok((system()?, None)),
        RuntimeChoice::Auto => match system() {
            Ok(runtime) => return Ok((runtime, None)),
            Err(error) => tracing::info!("no headset ({error}); using the built-in runtime"),
        },
        RuntimeChoice::Mock => {}
    }
    let hz = 90.0;
    let mock = Mock::new(MockConfig {
        clock: if config.stepped { Clock::Stepped { hz } } else { Clock::Real { hz } },
        eye_size: config.eye_size.unwrap_or([1024, 1024]),
        max_image_size: [16_384, 16_384],
        ..MockConfig::default()
    });
    let entry = mock.entry().context("the built-in runtime cannot start")?;
    Ok((xr::Runtime::open(entry, "Fathomless")?, Some(mock)))
}

/// The layer that sky and backdrop are shown as; None, and a word about it, where the runtime has none.
fn open_sky(
    session: &mut xr::Session,
    runtime: &xr::Runtime,
    gpu: &Arc<Gpu>,
    backdrop: &Backdrop,
) -> Result<Option<SkyCube>> {
    // Texel for texel what is baked: nothing is resampled but by the runtime.
    if !session.open_cube(runtime, backdrop.config().face)? {
        tracing::info!("the backdrop is drawn into the eyes' pictures: it cannot be a layer of its own here");
        return Ok(None);
    }
    let info = session.info();
    SkyCube::new(gpu, backdrop, info.color_format, info.encode_srgb, IN_FLIGHT).map(Some)
}

/// The runtime's poses without the runtime's types.
fn plain(views: &xr::Views) -> (Pose, [Eye; 2]) {
    let pose = |pose: xr::Pose| Pose { position: pose.position, orientation: pose.orientation };
    let eyes = views.eyes.map(|eye| Eye {
        pose: pose(eye.pose),
        fov: [eye.fov.left, eye.fov.right, eye.fov.up, eye.fov.down],
    });
    (pose(views.head), eyes)
}

fn rig(standpoint: &Standpoint<'_>, seat: &Pose, worn: bool) -> Rig {
    Rig {
        seat: seat.position,
        position: standpoint.position,
        orientation: if worn { standpoint.heading } else { standpoint.orientation },
        metres_per_tile: COMFORT_M / standpoint.height,
    }
}

/// Where the selection begins, and from which of its levels tiles are live.
#[derive(Clone, Copy, Debug)]
struct Window {
    root: usize,
    live_from: usize,
}

/// Slots for the live tiles, and for the layers that submissions in flight bake.
fn slots(info: &DeviceInfo, quality: &Quality) -> Result<u32> {
    let live = slots_needed(&quality.detail, quality.live_levels());
    let wanted = live + BAKE_SLOTS;
    let bytes = 4 * quality.layout.words() as u64;
    let room = (u64::from(info.limits.max_storage_buffer_range) / bytes) as u32;
    // The derivation is for the worst flight; what is usual fits in two thirds of it.
    anyhow::ensure!(
        room >= wanted * 2 / 3,
        "{} can address only {room} tiles and {wanted} are needed: choose smaller eye pictures (--size)",
        info.name
    );
    Ok(wanted.min(room))
}

/// So many levels nearer or farther than wanted the backdrop's nearest layer may be while it is baked anew: beyond, the
/// parallax would be seen, or live tiles would outgrow the pool, and everything is baked at once.
const MOST_BEHIND: usize = 2;

/// Far ends of the backdrop are multiples of so many levels: a climb does not begin it anew with every octave.
const FAR_STEP: usize = 8;

/// Slots for baking: what one submission bakes at most.
const BAKE_SLOTS: u32 = 256;

/// Baked texels of a frame, as a share of the eyes' pixels, where frames must not wait.
const BAKED_SHARE: f64 = 0.12;

/// The size of a cell of the standpoint's depth in anchor tiles.
fn unit(standpoint: &Standpoint<'_>) -> f64 {
    (-standpoint.depth.rem_euclid(1.0)).exp2()
}

/// The haze closes where the backdrop ends, at the same distance at every depth: that of the nearer end.
fn air(look: &Look, standpoint: &Standpoint<'_>, quality: &Quality) -> Air {
    let cells = standpoint.height / unit(standpoint);
    let layers = quality.backdrop.lag + quality.backdrop.layers - 1;
    let end = layers as f64 + (quality.detail.split / cells).log2();
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
