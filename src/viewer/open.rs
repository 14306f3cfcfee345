//! Opening a viewer, and opening it anew: the runtime, the device, the session, and what draws into it.

use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, Result};
use ash::vk;

use super::panel::Panel;
use super::wearer::Wearer;
use super::{IN_FLIGHT, Quality, Viewer, ViewerConfig};
use crate::aids::Aids;
use crate::controllers::Hands;
use crate::gpu::{Bootstrap, Frames, Gpu, GpuConfig};
use crate::inspect::Inspect;
use crate::mock::{Clock, Fov, Mask, Mock, MockConfig};
use crate::painter::{self, Painter, Vantage};
use crate::quality::samples_at_most;
use crate::render::{Backdrop, SkyCube, TargetFormat, TerrainPass, TileStore, VeilPass};
use crate::settings::RuntimeChoice;
use crate::telemetry::{FrameStats, Work};
use crate::terrain::select::Selection;
use crate::world::World;
use crate::xr;

/// A software device may well take minutes for a large picture.
const SOFTWARE_TIMEOUT: Duration = Duration::from_secs(600);

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
        let Viewer { painter, panel, session, mut runtime, gpu, mock, config, governor, .. } = self;
        painter.frames.wait_idle()?;
        drop(panel);
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
        let quality = config.quality(&gpu.info, in_a_window, pixels_per_tangent);
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
            panel: Panel::default(),
            session,
            runtime,
            gpu,
            mock,
            config,
            seat: None,
            seats_left: 0,
            wearer: Wearer::default(),
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
        viewer.prepare_panel();
        viewer
    }
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

/// The usual headset and the built-in one see about 45 degrees to each side.
pub(super) fn pixels_per_tangent(session: &xr::Session) -> f64 {
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

/// The eyes' pictures as the runtime has them: of one sample a pixel.
pub(super) fn target_format(info: &xr::SessionInfo) -> TargetFormat {
    TargetFormat {
        colour: info.color_format,
        depth: info.depth_format,
        encode: info.encode_srgb,
        multiview: info.multiview,
        samples: vk::SampleCountFlags::TYPE_1,
        copies_colour: false,
        copies_depth: false,
    }
}

/// Everything that draws a world into a session's pictures.
pub(super) fn new_painter(
    world: &World,
    quality: Quality,
    (config, in_a_window): (&ViewerConfig, bool),
    gpu: &Arc<Gpu>,
    session: &xr::Session,
) -> Result<Painter> {
    let info = session.info();
    let samples = samples_at_most(gpu.info.sample_counts, quality.samples);
    if samples != quality.samples {
        let (device, wanted) = (&gpu.info.name, quality.samples);
        tracing::warn!("{device} cannot take {wanted} samples of a pixel: it takes {samples}");
    }
    let quality = Quality { samples, ..quality };
    let slots = painter::slots(&gpu.info, &quality)?;
    let tiles = TileStore::new(gpu, quality.layout, slots, &world.surface, IN_FLIGHT)?;
    let backdrop = Backdrop::new(gpu, &tiles, quality.backdrop, IN_FLIGHT)?;
    let sky = session
        .cube_side()
        .map(|_| SkyCube::new(gpu, &backdrop, info.color_format, info.encode_srgb, IN_FLIGHT))
        .transpose()?;
    let format = target_format(info);
    let target = (format.sampled(quality.samples, gpu.info.resolves_to_layers), info.extent);
    let mut terrain = TerrainPass::new(gpu, &tiles, &backdrop, slots as usize, target, IN_FLIGHT)?;
    if config.bindings.is_some() && !in_a_window {
        terrain.prepare_aids(gpu)?;
    }
    let veil = VeilPass::new(gpu, format, IN_FLIGHT)?;
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
        aids: Aids::default(),
        veil,
        veil_in_mirror: false,
        blinks: false,
        vantage: Vantage::default(),
        stale_light: false,
        frozen: None,
    })
}
