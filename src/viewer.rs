//! The viewer: a session, the GPU and the renderer, owned in the order in which they must go; one readable frame.

use std::ffi::CStr;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, Result};
use ash::vk;
use glam::Quat;

use crate::bindings::ProfileBindings;
use crate::controllers::Hands;
use crate::course::Standpoint;
use crate::governor::{Dials, Governor, GovernorSettings, Sample};
use crate::gpu::{
    Access, Bootstrap, Buffer, BufferInfo, DeviceInfo, Frames, Gpu, GpuConfig, Image, ImageInfo, Location,
    ShaderText, Shelf, Transition, ValidationLog,
};
use crate::inspect::Inspect;
use crate::mock::{Clock, Fov, Mask, Mock, MockConfig};
use crate::painter::{self, Painter, Vantage, whole_image};
pub use crate::quality::Quality;
use crate::render::{
    Backdrop, Behind, EyeTarget, Shading, SkyCube, TargetFormat, TerrainPass, TileStore, View,
};
use crate::rig::{COMFORT_M, Eye, Pose, Rig};
use crate::settings::{QualitySettings, RuntimeChoice};
use crate::telemetry::{FrameStats, GpuPass, GpuTimes, Passes, Span, Stopwatch, Work, now_ns};
use crate::terrain::morph::Detail;
use crate::terrain::select::{Counts, Selection};
use crate::world::World;
use crate::xr;

/// Frames that the CPU may be ahead of the GPU.
const IN_FLIGHT: usize = 2;

/// Distance of the near plane in the user's metres.
const NEAR_M: f32 = 0.05;

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
    /// Where it is None: what is wished otherwise than suits these.
    pub wish: QualitySettings,
    /// Sky and backdrop go to the runtime as a cubemap behind the eyes' pictures, where it takes one: it then turns
    /// them with the head exactly, whenever the picture was drawn. The eyes' pictures alone are then without them.
    pub backdrop_layer: bool,
    /// What the headset's lenses hide is not drawn: the pictures are then not whole.
    pub mask: bool,
    /// Display rate to ask the headset for, in Hz.
    pub refresh_hz: Option<f32>,
    /// What the controllers do; None: they are not read.
    pub bindings: Option<&'static [ProfileBindings]>,
    /// The eyes' pictures are shown in a window.
    pub desk: Option<DeskConfig>,
    /// What is shown otherwise than usual, to begin with.
    pub inspect: Inspect,
    /// How much is drawn follows what frames take; None: it stays as it is.
    pub governor: Option<GovernorSettings>,
    /// Shaders that take the place of built-in ones.
    pub shaders: Option<&'static Shelf>,
}

/// What a viewer needs to be shown in a window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeskConfig {
    /// The Vulkan extension for windows of its platform.
    pub surface: &'static CStr,
    /// Pixels per eye where nobody wears a headset.
    pub eye_size: [u32; 2],
    /// Frames per second at most where nobody wears one.
    pub rate_hz: f64,
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
            wish: QualitySettings::default(),
            backdrop_layer: false,
            mask: false,
            refresh_hz: None,
            bindings: None,
            desk: None,
            inspect: Inspect::default(),
            governor: None,
            shaders: None,
        }
    }
}

impl ViewerConfig {
    fn session(&self) -> xr::SessionConfig {
        let &ViewerConfig { eye_size, multiview, mask, refresh_hz, .. } = self;
        xr::SessionConfig { eye_size, near_m: NEAR_M, multiview, mask, refresh_hz }
    }

    /// Nobody wears the headset, and somebody sees a window.
    fn is_in_a_window(&self, mock: Option<&Mock>) -> bool {
        self.desk.is_some() && mock.is_some()
    }

    fn open_hands(&self, session: &mut xr::Session, runtime: &xr::Runtime) -> Result<(), xr::Error> {
        self.bindings.map_or(Ok(()), |bindings| session.open_hands(runtime, bindings))
    }
}

/// Frames per second that a governor holds in a window where nobody says how many, and where the processor draws: what is
/// half as smooth there is twice as sharp.
const DESK_RATE_HZ: f64 = 60.0;
const SOFTWARE_RATE_HZ: f64 = 30.0;

/// The least share of the images' width and height that is ever drawn.
const LEAST_SCALE: f64 = 0.1;

/// A software device may well take minutes for a large picture.
const SOFTWARE_TIMEOUT: Duration = Duration::from_secs(600);

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
    config: ViewerConfig,
    /// The head of the first frame since the origin moved last: the seat of the rig.
    seat: Option<Pose>,
    /// The eyes of the last frame drawn.
    eyes: Option<[Eye; 2]>,
    /// What the hands did at the last frame, in the session's space.
    hands: Hands,
    /// How often the origin had moved when the seat was taken.
    origin_moves: u32,
    stats: FrameStats,
    governor: Option<Governor>,
    /// Share of the images' width and height that is drawn.
    scale: f64,
    /// The next frame is drawn in full, whatever the scale.
    in_full: bool,
    /// When the frame before was done; None: there was none just before.
    done_ns: Option<u64>,
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

    /// The same on a runtime that is open; `mock` is what it is, if it is one.
    ///
    /// # Errors
    /// As [`Viewer::open`].
    pub fn on(
        world: &World,
        config: &ViewerConfig,
        runtime: xr::Runtime,
        mock: Option<Mock>,
    ) -> Result<Viewer> {
        let surface = config.desk.map(|desk| desk.surface);
        let gpu = Gpu::presenting(&runtime, &GpuConfig { validate: config.validate }, surface)?;
        if let Some(shelf) = config.shaders {
            gpu.read_shaders_from(shelf);
        }
        Viewer::with(world, config, (runtime, mock), gpu)
    }

    /// Another session on the same runtime, after this one was lost. The device and what was made on it stay where the
    /// headset is still the same.
    ///
    /// # Errors
    /// No headset answers, or what [`Viewer::open`] fails with; nothing is left open then.
    pub fn renew(self, world: &World) -> Result<Viewer> {
        let dials = self.dials();
        let Viewer { painter, session, mut runtime, gpu, mock, config, governor, .. } = self;
        painter.frames.wait_idle()?;
        let (was, cube) = (*session.info(), session.cube_side());
        drop(session);
        runtime.find_headset()?;
        if runtime.physical_device(&gpu.instance)? != gpu.physical {
            tracing::info!("the headset hangs on another GPU now");
            drop(painter);
            drop(gpu);
            return Viewer::on(world, &config, runtime, mock);
        }
        let mut session = xr::Session::new(&runtime, &gpu, config.session())?;
        if *session.info() != was || cube.is_some() {
            drop((painter, session));
            return Viewer::with(world, &config, (runtime, mock), gpu);
        }
        config.open_hands(&mut session, &runtime)?;
        let mut viewer = Viewer::of(painter, session, (runtime, mock), gpu, config);
        viewer.set_dials(dials);
        Ok(Viewer { governor, ..viewer })
    }

    fn with(
        world: &World,
        config: &ViewerConfig,
        (runtime, mock): (xr::Runtime, Option<Mock>),
        gpu: Arc<Gpu>,
    ) -> Result<Viewer> {
        let mut session = xr::Session::new(&runtime, &gpu, config.session())?;
        config.open_hands(&mut session, &runtime)?;
        let pixels_per_tangent = pixels_per_tangent(&session);
        let in_a_window = config.is_in_a_window(mock.as_ref());
        let quality =
            config.quality.unwrap_or(wished(&gpu.info, in_a_window, pixels_per_tangent, &config.wish));
        if config.backdrop_layer {
            open_cube(&mut session, &runtime, &quality)?;
        }
        let mut painter = new_painter(world, quality, (config, in_a_window), &gpu, &session)?;
        painter.set_inspect(&gpu, &config.inspect)?;
        Ok(Viewer::of(painter, session, (runtime, mock), gpu, *config))
    }

    fn of(
        painter: Painter,
        session: xr::Session,
        (runtime, mock): (xr::Runtime, Option<Mock>),
        gpu: Arc<Gpu>,
        config: ViewerConfig,
    ) -> Viewer {
        let stats = FrameStats::default();
        let mut viewer = Viewer {
            painter,
            session,
            runtime,
            gpu,
            mock,
            config,
            seat: None,
            eyes: None,
            hands: Hands::default(),
            origin_moves: 0,
            stats,
            governor: None,
            scale: 1.0,
            in_full: false,
            done_ns: None,
        };
        viewer.govern(config.governor.as_ref());
        viewer
    }

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

    /// Draws another world from now on, or the same with another quality; all else stays. The next frame may be anywhere.
    ///
    /// # Errors
    /// Out of memory: then everything is as it was; or the device is lost.
    pub fn redraw(&mut self, world: &World, quality: Quality) -> Result<()> {
        self.painter.frames.wait_idle()?;
        let kind = (&self.config, self.is_in_a_window());
        let mut painter = new_painter(world, quality, kind, &self.gpu, &self.session)?;
        painter.set_inspect(&self.gpu, self.inspect())?;
        painter.follow(&mut self.painter);
        self.painter = painter;
        self.govern_anew();
        Ok(())
    }

    /// Draws the same by other shaders from now on, where [`ViewerConfig::shaders`] has a shelf for them.
    ///
    /// # Errors
    /// As [`Viewer::redraw`], or the device refuses them: then everything is as it was.
    pub fn set_shaders(&mut self, world: &World, texts: Arc<[ShaderText]>) -> Result<()> {
        let Some(shelf) = self.config.shaders else { return Ok(()) };
        let before = shelf.put(texts);
        self.redraw(world, self.wanted_quality()).inspect_err(|_| drop(shelf.put(before)))?;
        self.session.ask_hidden_areas_again();
        Ok(())
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

    /// Light from this direction, a unit vector as [`Look::sun_direction`](crate::world::Look::sun_direction). Where it is
    /// `settled`, the backdrop is baked anew in it.
    pub fn set_sun(&mut self, direction: [f32; 3], settled: bool) {
        self.painter.set_sun(direction, settled);
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

    /// How much would be drawn by other settings.
    pub fn quality_by(&self, wish: &QualitySettings) -> Quality {
        wished(&self.gpu.info, self.is_in_a_window(), self.pixels_per_tangent(), wish)
    }

    /// [`Viewer::budgets_ms`] by other settings.
    pub fn budgets_by(&self, wish: &QualitySettings) -> [f64; 2] {
        let usual = painter::bake_budget_ms(&self.gpu.info, self.is_in_a_window());
        [wish.tile_ms, wish.bake_ms.unwrap_or(usual)]
    }

    /// Pixels per unit of tangent in the middle of an eye's picture, about.
    pub fn pixels_per_tangent(&self) -> f64 {
        pixels_per_tangent(&self.session)
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
        self.painter.settled = false;
    }

    /// Other budgets from now on, the rest of what is wished from the next viewer on.
    pub fn set_budgets(&mut self, wish: &QualitySettings) {
        self.config.wish = *wish;
        self.set_budgets_ms(self.budgets_by(wish));
    }

    /// How fast the viewer may go on, as a share of 0 to 1 of his speed: slower where he would outrun the backdrop.
    pub fn headroom(&self) -> f64 {
        self.painter.headroom
    }

    /// Texels per side of the layer that sky and backdrop are shown as; None: they are in the eyes' pictures.
    pub fn backdrop_layer(&self) -> Option<u32> {
        self.session.cube_side()
    }

    /// From now on this is shown otherwise than usual. What rare options need is made when they are first asked for, and
    /// another octave makes every tile anew; else it costs nothing.
    ///
    /// # Errors
    /// Out of memory, then nothing has changed; or the device is lost.
    pub fn set_inspect(&mut self, inspect: &Inspect) -> Result<()> {
        self.painter.set_inspect(&self.gpu, inspect)?;
        self.config.inspect = *inspect;
        Ok(())
    }

    /// What is shown otherwise than usual.
    pub fn inspect(&self) -> &Inspect {
        &self.config.inspect
    }

    /// Light and sky, or what shows holes.
    pub fn set_shading(&mut self, shading: Shading) {
        self.painter.terrain.shading = shading;
    }

    /// Only this eye's picture is seen: the other need not be drawn. None: both are.
    pub fn set_only_eye(&mut self, eye: Option<usize>) {
        self.painter.terrain.only_eye = eye.map(|eye| eye as u32);
    }

    /// False while the runtime says that nobody wears the headset.
    pub fn is_worn(&self) -> bool {
        self.session.is_worn()
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
        // Hands that are not read let go.
        self.hands = Hands::default();
        match self.session.poll()? {
            xr::Phase::Idle => {
                self.done_ns = None;
                return Ok(Step::Idle);
            }
            xr::Phase::Exited => return Ok(Step::Exited),
            xr::Phase::Running(_) => {}
        }
        let Some(tick) = self.session.wait_frame()? else { return Ok(Step::Idle) };
        let period_ms = tick.period_ns as f64 * 1e-6;
        watch.lap(Span::Wait);
        // Poses count from elsewhere: where the wearer is now is his seat.
        if self.origin_moves != self.session.origin_moves() {
            (self.seat, self.origin_moves) = (None, self.session.origin_moves());
        }
        let hidden = self.session.hidden_areas()?;
        let mut xr_frame = self.session.begin_frame(tick)?;
        if let Some(hidden) = hidden {
            self.painter.frames.wait_idle()?;
            self.painter.terrain.set_mask(&self.gpu, &hidden, IN_FLIGHT)?;
        }
        self.hands = xr_frame.read_hands()?;
        let Some(images) = xr_frame.acquire()? else {
            xr_frame.end(None)?;
            // The next interval is not one of drawing.
            self.done_ns = None;
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
        self.eyes = Some(eyes);
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
        let (clock, begun_ns) = painter.frames.timed_from();
        self.stats = FrameStats {
            serial,
            spans: watch.spans(),
            laps: watch.laps(),
            work: Work { draws: self.gpu.draws() - draws_before, ..painter.work() },
            headroom: painter.headroom,
            parallax: painter.backdrop.schedule().used().unwrap_or(0.0),
            timed_serial: painter.frames.timed_serial(),
            passes: Passes::default(),
            gpu: GpuTimes::new(clock),
        };
        for pass in painter.frames.times() {
            self.stats.passes.add(pass.name, pass.ms);
            let at = |ms: f64| begun_ns + (ms * 1e6) as u64;
            let (begin_ns, end_ns) = (at(pass.start_ms), at(pass.start_ms + pass.ms));
            self.stats.gpu.push(GpuPass { name: pass.name, begin_ns, end_ns });
        }
        if std::mem::take(&mut self.in_full) {
            self.set_dials(self.dials());
        }
        self.heed_governor(period_ms);
        Ok(Step::Drew)
    }

    /// Tells the governor, where there is one, what the frame took, and does what it says.
    fn heed_governor(&mut self, period_ms: f64) {
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

    /// Turns the axes of the head, as of the last frame drawn, to the play space's. Identity before there was one.
    pub fn gaze(&self) -> Quat {
        self.eye(0).map(|eye| eye.pose.orientation).unwrap_or_default()
    }

    /// What the hands did at the last frame, with their positions in metres from the seat.
    pub fn hands(&self) -> Hands {
        let mut hands = self.hands;
        let from_seat = |pose: Option<Pose>| {
            pose.zip(self.seat).map(|(pose, seat)| Pose { position: pose.position - seat.position, ..pose })
        };
        for hand in &mut hands.hands {
            (hand.aim, hand.grip) = (from_seat(hand.aim), from_seat(hand.grip));
        }
        hands
    }

    /// The interaction profiles of what the hands hold, left and right.
    pub fn interaction_profiles(&self) -> [Option<&str>; 2] {
        self.session.interaction_profiles()
    }

    /// Lets both hands feel a tick of an amplitude from 0 to 1.
    ///
    /// # Errors
    /// The session is lost.
    pub fn pulse(&self, amplitude: f32) -> Result<(), xr::Error> {
        self.session.pulse(0, amplitude)?;
        self.session.pulse(1, amplitude)
    }

    /// Waits for the last frame, and gives an eye's picture: sRGB, rows from the top, 3 bytes per pixel.
    ///
    /// # Errors
    /// The device is lost.
    pub fn picture(&mut self, eye: usize) -> Result<Vec<u8>> {
        self.painter.frames.wait_idle()?;
        let Some(buffer) = &self.painter.picture else { anyhow::bail!("pictures are not kept") };
        Ok(self.rgb(buffer, self.session.drawn(), eye))
    }

    /// An eye's picture out of a buffer with both.
    fn rgb(&self, buffer: &Buffer, extent: vk::Extent2D, eye: usize) -> Vec<u8> {
        let info = self.session.info();
        let pixels = extent.width as usize * extent.height as usize;
        let eye = &buffer.slice::<[u8; 4]>()[eye * pixels..(eye + 1) * pixels];
        let blue_first = matches!(info.color_format, vk::Format::B8G8R8A8_SRGB | vk::Format::B8G8R8A8_UNORM);
        let rgb = |&[a, g, b, _]: &[u8; 4]| if blue_first { [b, g, a] } else { [a, g, b] };
        eye.iter().flat_map(rgb).collect()
    }

    /// From now on every frame is copied aside, to be shown in a window ([`Viewer::mirror`]).
    ///
    /// # Errors
    /// Out of memory.
    pub fn keep_mirror(&mut self) -> Result<()> {
        let info = self.session.info();
        if self.painter.mirror.is_none() {
            self.painter.mirror = Some(Image::new(
                &self.gpu,
                &ImageInfo {
                    name: "mirror",
                    width: info.extent.width,
                    height: info.extent.height,
                    layers: 2,
                    format: plain_format(info.color_format),
                    usage: vk::ImageUsageFlags::TRANSFER_DST
                        | vk::ImageUsageFlags::TRANSFER_SRC
                        | vk::ImageUsageFlags::SAMPLED,
                    ..ImageInfo::default()
                },
            )?);
        }
        Ok(())
    }

    /// The eyes' last pictures, a layer each, in TRANSFER_SRC_OPTIMAL: sRGB that Vulkan takes for plain numbers. None
    /// before a frame was drawn.
    pub fn mirror(&self) -> Option<&Image> {
        self.painter.mirror.as_ref().filter(|_| self.eyes.is_some())
    }

    /// The part of [`Viewer::mirror`] that the last frame fills, from its corner.
    pub fn mirrored(&self) -> [u32; 2] {
        let vk::Extent2D { width, height } = self.painter.mirrored;
        [width, height]
    }

    /// An eye of the last frame drawn, with its position in metres from the seat. None before there was one.
    pub fn eye(&self, eye: usize) -> Option<Eye> {
        let (eye, seat) = (self.eyes?[eye], self.seat?);
        let pose = Pose { position: eye.pose.position - seat.position, ..eye.pose };
        Some(Eye { pose, ..eye })
    }

    /// Waits for the last frame, and gives an eye's picture as [`Viewer::picture`] does, of [`Viewer::mirrored`] pixels.
    ///
    /// # Errors
    /// The device is lost, or out of memory; or no frame was drawn and kept.
    pub fn read_mirror(&mut self, eye: usize) -> Result<Vec<u8>> {
        let mirror = self.mirror().context("there is no picture yet")?;
        let extent = self.painter.mirrored;
        let pixels = extent.width as usize * extent.height as usize;
        let buffer = Buffer::new(
            &self.gpu,
            &BufferInfo {
                name: "screenshot",
                size: 2 * 4 * pixels as u64,
                usage: vk::BufferUsageFlags::TRANSFER_DST,
                location: Location::Readback,
            },
        )?;
        let from = (mirror.raw, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
        self.gpu.run(|commands| commands.copy_image_to_buffer(from, &buffer, &[whole_image(extent, 2)]))?;
        Ok(self.rgb(&buffer, extent, eye))
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
        let witness = self.witness();
        drop(self);
        Ok(witness.remarks())
    }

    /// Who hears what is wrong with our use of Vulkan and OpenXR. It outlives the viewer.
    pub fn witness(&self) -> Witness {
        Witness { log: self.gpu.validation_log(), mock: self.mock.clone() }
    }
}

impl Drop for Painter {
    /// Whatever ends a viewer, what the GPU still uses stays until it is done.
    fn drop(&mut self) {
        if let Err(error) = self.frames.wait_idle() {
            tracing::warn!("{error}");
        }
    }
}

/// The validation layer and the built-in runtime of a viewer, as far as they are there.
pub struct Witness {
    log: Arc<ValidationLog>,
    mock: Option<Mock>,
}

impl Witness {
    /// What they have said so far.
    pub fn remarks(&self) -> Remarks {
        let report = self.log.report();
        let violations = self.mock.as_ref().map(Mock::violations).unwrap_or_default();
        Remarks {
            validation: report.count as usize,
            violations: violations.len(),
            first: report.texts.into_iter().next().or_else(|| violations.first().map(|v| format!("{v:?}"))),
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
    stand_in(config)
}

/// A built-in runtime of one's own.
///
/// # Errors
/// Too many of them are alive.
pub fn stand_in(config: &ViewerConfig) -> Result<(xr::Runtime, Option<Mock>)> {
    let mock = stand_in_mock(config);
    let entry = mock.entry().context("the built-in runtime cannot start")?;
    Ok((xr::Runtime::open(entry, "Fathomless")?, Some(mock)))
}

/// A mock headset for a viewer; one for a window sees what a window shows: no lenses hide anything, and the pixels are
/// square.
pub fn stand_in_mock(config: &ViewerConfig) -> Mock {
    let hz = config.desk.map_or(90.0, |desk| desk.rate_hz);
    let usual = config.desk.map_or([1024, 1024], |desk| desk.eye_size);
    let eye_size = config.eye_size.unwrap_or(usual);
    let mock = MockConfig {
        clock: if config.stepped { Clock::Stepped { hz } } else { Clock::Real { hz } },
        eye_size,
        max_image_size: [16_384, 16_384],
        ..MockConfig::default()
    };
    Mock::new(match config.desk {
        None => mock,
        Some(_) => MockConfig { fov: [desk_fov(eye_size); 2], mask: Mask::Empty, ..mock },
    })
}

/// A right angle along the longer side.
fn desk_fov(size: [u32; 2]) -> Fov {
    let longer = size[0].max(size[1]) as f32;
    let [across, up] = size.map(|side| (side as f32 / longer).atan());
    Fov { left: -across, right: across, up, down: -up }
}

/// How much is drawn by these settings.
fn wished(info: &DeviceInfo, in_a_window: bool, pixels_per_tangent: f64, wish: &QualitySettings) -> Quality {
    match in_a_window {
        true => Quality::for_window(info, pixels_per_tangent, wish),
        false => Quality::wished(info, pixels_per_tangent, wish),
    }
}

/// The usual headset and the built-in one see about 45 degrees to each side.
fn pixels_per_tangent(session: &xr::Session) -> f64 {
    let extent = session.info().extent;
    f64::from(extent.width.max(extent.height)) / 2.0
}

/// Opens the layer that sky and backdrop are shown as; a word about it where the runtime has none.
fn open_cube(session: &mut xr::Session, runtime: &xr::Runtime, quality: &Quality) -> Result<()> {
    // Texel for texel what is baked: nothing is resampled but by the runtime.
    if !session.open_cube(runtime, quality.backdrop.face)? {
        tracing::info!("the backdrop is drawn into the eyes' pictures: it cannot be a layer of its own here");
    }
    Ok(())
}

/// Everything that draws a world into a session's pictures.
fn new_painter(
    world: &World,
    quality: Quality,
    (config, in_a_window): (&ViewerConfig, bool),
    gpu: &Arc<Gpu>,
    session: &xr::Session,
) -> Result<Painter> {
    let info = session.info();
    let slots = painter::slots(&gpu.info, &quality)?;
    let tiles = TileStore::new(gpu, quality.layout, slots, &world.surface, IN_FLIGHT)?;
    let backdrop = Backdrop::new(gpu, &tiles, quality.backdrop, IN_FLIGHT)?;
    let sky = session
        .cube_side()
        .map(|_| SkyCube::new(gpu, &backdrop, info.color_format, info.encode_srgb, IN_FLIGHT))
        .transpose()?;
    let format = TargetFormat {
        colour: info.color_format,
        depth: info.depth_format,
        encode: info.encode_srgb,
        multiview: info.multiview,
    };
    let terrain = TerrainPass::new(gpu, &tiles, &backdrop, slots as usize, format, IN_FLIGHT)?;
    let mut frames = Frames::new(gpu, IN_FLIGHT)?;
    if gpu.info.software {
        frames.timeout = SOFTWARE_TIMEOUT;
    }
    Ok(Painter {
        selection: Selection::default(),
        picture: None,
        mirror: None,
        mirrored: vk::Extent2D::default(),
        terrain,
        sky,
        backdrop,
        tiles,
        frames,
        most_split: quality.detail.split,
        quality,
        surface: world.surface,
        look: world.look.clone(),
        complete: config.complete,
        eye_pixels: 2.0 * f64::from(info.extent.width) * f64::from(info.extent.height),
        settled: false,
        headroom: 1.0,
        tiles_ms: config.wish.tile_ms,
        most_tiles_ms: config.wish.tile_ms,
        bake_budget_ms: config.wish.bake_ms.unwrap_or(painter::bake_budget_ms(&gpu.info, in_a_window)),
        bake_cost: [0.0; 2],
        work: Work::default(),
        inspect: Inspect::default(),
        vantage: Vantage::default(),
        stale_light: false,
        frozen: None,
    })
}

/// The same texels as plain numbers.
fn plain_format(format: vk::Format) -> vk::Format {
    match format {
        vk::Format::R8G8B8A8_SRGB => vk::Format::R8G8B8A8_UNORM,
        vk::Format::B8G8R8A8_SRGB => vk::Format::B8G8R8A8_UNORM,
        other => other,
    }
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
