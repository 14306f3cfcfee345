//! How much is drawn: what suits a device and the size of its pictures.

use crate::gpu::DeviceInfo;
use crate::render::BackdropConfig;
use crate::render::layout::SlotLayout;
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

/// Most levels below the anchor: more than this, and the live levels are more than a selection can have.
const MOST_DOWN: usize = 5;

/// Least and most texels per side of the backdrop's faces, and the step between, which its mipmap divides.
const FACE: std::ops::RangeInclusive<f64> = 64.0..=4096.0;
const FACE_STEP: f64 = 64.0;

impl Quality {
    /// What suits a device and a picture with so many pixels per unit of tangent at its middle: fewer triangles on
    /// a software device, finer tiles for finer pictures.
    pub fn new(info: &DeviceInfo, pixels_per_tangent: f64) -> Quality {
        let (mesh, split) = if info.software { (16, 2.6) } else { (32, 3.0) };
        Quality::of(mesh, split, pixels_per_tangent)
    }

    /// The same tiles, split at `split` of their sizes (2 to 4), and `down` levels below the anchor (1 to 5).
    pub fn tuned(&self, split: f64, down: usize, pixels_per_tangent: f64) -> Quality {
        let tuned = Quality::of(self.layout.mesh, split.clamp(2.0, 4.0), pixels_per_tangent);
        Quality { layout: self.layout, down: down.clamp(1, MOST_DOWN), ..tuned }
    }

    fn of(mesh: u32, split: f64, pixels_per_tangent: f64) -> Quality {
        let wanted = pixels_per_tangent / split / PIXELS_PER_CELL;
        let cells = if wanted > 46.0 { Cells::N64 } else { Cells::N32 };
        let (layout, detail) = (SlotLayout { cells, mesh }, Detail::new(split));
        let lag = backdrop::lag_for(ROAMING_TILES / SUDDEN, split, pixels_per_tangent, PARALLAX_PIXELS)
            .clamp(4, 14);
        let bound = SUDDEN * backdrop::bound_for(lag, split, pixels_per_tangent, PARALLAX_PIXELS);
        let face = (2.0 * pixels_per_tangent / FACE_STEP).ceil() * FACE_STEP;
        let face = face.clamp(*FACE.start(), *FACE.end()) as u32;
        let backdrop = BackdropConfig { face, lag, bound, layers: HAZE_OCTAVES - lag };
        Quality { layout, detail, down: 3, backdrop }
    }

    /// Levels of live tiles: one more than the lag while the next layer is baked, and those that the spare is behind.
    pub(crate) fn live_levels(&self) -> usize {
        self.backdrop.lag + 1 + MOST_EXTRA + self.down
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::terrain::select::MOST_LEVELS;

    #[test]
    fn whatever_is_chosen_fits_a_selection() {
        for pixels in [100.0, 500.0, 2000.0, 8000.0] {
            let usual = Quality::of(32, 3.0, pixels);
            assert_eq!(usual.tuned(3.0, usual.down, pixels), usual);
            for split in [0.0, 2.0, 2.7, 4.0, 9.0] {
                let most = usual.tuned(split, 99, pixels);
                assert!(
                    most.live_levels() <= MOST_LEVELS && (2.0..=4.0).contains(&most.detail.split),
                    "{most:?}"
                );
            }
        }
    }
}
