//! How much is drawn: what suits a device and the size of its pictures.

use crate::gpu::DeviceInfo;
use crate::render::BackdropConfig;
use crate::render::layout::SlotLayout;
use crate::settings::QualitySettings;
use crate::terrain::backdrop;
use crate::terrain::morph::Detail;
use crate::terrain::schedule::{MOST_EXTRA, SUDDEN};
use crate::terrain::tile::Cells;

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

/// How far from where a layer is baked the viewer may be at least, in tiles of its key: its tile, its storey, and some
/// way on while a better one is baked.
const ROAMING_TILES: f64 = 4.0;

/// Octaves beyond the nearest ground at which the air closes the world.
const HAZE_OCTAVES: usize = 32;

/// Least and most texels per side of the backdrop's faces, and the step between, which its mipmap divides.
const FACE: std::ops::RangeInclusive<f64> = 64.0..=4096.0;
const FACE_STEP: f64 = 64.0;

impl Quality {
    /// What suits a device and a picture with so many pixels per unit of tangent at its middle: fewer triangles on
    /// a software device, finer tiles for finer pictures.
    pub fn new(info: &DeviceInfo, pixels_per_tangent: f64) -> Quality {
        Quality::wished(info, pixels_per_tangent, &QualitySettings::default())
    }

    /// The same, but for what is wished otherwise.
    pub fn wished(info: &DeviceInfo, pixels_per_tangent: f64, wish: &QualitySettings) -> Quality {
        let (mesh, split) = if info.software { (16, 2.6) } else { (32, 3.0) };
        let split = wish.split.unwrap_or(split);
        let wanted = pixels_per_tangent / split / PIXELS_PER_CELL;
        let usual = if wanted > 46.0 { Cells::N64 } else { Cells::N32 };
        let cells = wish.cells.and_then(Cells::new).unwrap_or(usual);
        let mesh = wish.mesh.unwrap_or(mesh).min(cells.n() as u32);
        let (layout, detail) = (SlotLayout { cells, mesh }, Detail::new(split));
        let lag = backdrop::lag_for(ROAMING_TILES / SUDDEN, split, pixels_per_tangent, PARALLAX_PIXELS)
            .clamp(4, 14);
        let lag = wish.backdrop_lag.unwrap_or(lag);
        let bound = SUDDEN * backdrop::bound_for(lag, split, pixels_per_tangent, PARALLAX_PIXELS);
        let face = wish.backdrop_face.map_or(2.0 * pixels_per_tangent, f64::from);
        let face = (face / FACE_STEP).ceil() * FACE_STEP;
        let face = face.clamp(*FACE.start(), *FACE.end()) as u32;
        let backdrop = BackdropConfig { face, lag, bound, layers: HAZE_OCTAVES - lag };
        Quality { layout, detail, down: wish.levels_below, backdrop }
    }

    /// Levels of live tiles: one more than the lag while the next layer is baked, and those that the spare is behind.
    pub(crate) fn live_levels(&self) -> usize {
        self.backdrop.lag + 1 + MOST_EXTRA + self.down
    }
}
