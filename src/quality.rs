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
    /// When tiles split and morph: not later than [`BackdropConfig::detail`].
    pub detail: Detail,
    /// Levels below the anchor that are drawn.
    pub down: usize,
    /// What is baked: everything further above the anchor than its lag.
    pub backdrop: BackdropConfig,
}

/// Pixels that a data cell has on the screen when its tile is about to split: enough for its normals not to glitter.
const PIXELS_PER_CELL: f64 = 2.2;

/// What differs between devices and uses.
struct Profile {
    /// Mesh cells of a tile.
    mesh: u32,
    /// Tiles split at so many of their own sizes, and where frames come too slowly at so many.
    split: f64,
    least_split: f64,
    /// Most pixels by which the nearest content of the backdrop may shift while the viewer moves about the anchor.
    parallax_pixels: f64,
    /// Texels of the backdrop per pixel of the picture.
    face_share: f64,
}

const HARDWARE: Profile =
    Profile { mesh: 32, split: 3.0, least_split: 2.6, parallax_pixels: 0.5, face_share: 1.0 };

/// Half of the time goes into triangles there.
const SOFTWARE: Profile = Profile { mesh: 16, split: 2.6, ..HARDWARE };

/// Quads of 15 pixels hardly show, since light and colour do not come from the mesh; nor does a pixel of parallax for one
/// eye.
const SOFTWARE_WINDOW: Profile =
    Profile { mesh: 8, least_split: 2.2, parallax_pixels: 1.0, face_share: 0.75, ..SOFTWARE };

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
        Quality::wished(info, pixels_per_tangent, &QualitySettings::default())
    }

    /// The same, but for what is wished otherwise.
    pub fn wished(info: &DeviceInfo, pixels_per_tangent: f64, wish: &QualitySettings) -> Quality {
        let profile = if info.software { SOFTWARE } else { HARDWARE };
        Quality::of(&profile, pixels_per_tangent, wish)
    }

    /// The same where somebody flies in a window: a software device then draws what can be flown in, not what is best.
    pub fn for_window(info: &DeviceInfo, pixels_per_tangent: f64, wish: &QualitySettings) -> Quality {
        let profile = if info.software { SOFTWARE_WINDOW } else { HARDWARE };
        Quality::of(&profile, pixels_per_tangent, wish)
    }

    /// The same tiles, split at `split` of their sizes (2 to 4) whatever frames take, and `down` levels below the anchor
    /// (1 to 5).
    pub fn tuned(&self, split: f64, down: usize, pixels_per_tangent: f64) -> Quality {
        let wish = QualitySettings {
            split: Some(split.clamp(2.0, 4.0)),
            levels_below: down.clamp(1, MOST_DOWN),
            backdrop_face: Some(self.backdrop.face),
            ..QualitySettings::default()
        };
        Quality { layout: self.layout, ..Quality::of(&HARDWARE, pixels_per_tangent, &wish) }
    }

    fn of(profile: &Profile, pixels_per_tangent: f64, wish: &QualitySettings) -> Quality {
        let &Profile { mesh, split, least_split, parallax_pixels, face_share } = profile;
        // Whoever sets where tiles split has it so throughout.
        let [split, least_split] = [split, least_split].map(|usual| wish.split.unwrap_or(usual));
        let wanted = pixels_per_tangent / split / PIXELS_PER_CELL;
        let usual = if wanted > 46.0 { Cells::N64 } else { Cells::N32 };
        let cells = wish.cells.and_then(Cells::new).unwrap_or(usual);
        let mesh = wish.mesh.unwrap_or(mesh).min(cells.n() as u32);
        let (layout, detail) = (SlotLayout { cells, mesh }, Detail::new(split));
        let lag = backdrop::lag_for(ROAMING_TILES / SUDDEN, least_split, pixels_per_tangent, parallax_pixels)
            .clamp(4, 14);
        let lag = wish.backdrop_lag.unwrap_or(lag);
        let bound = SUDDEN * backdrop::bound_for(lag, least_split, pixels_per_tangent, parallax_pixels);
        let face = wish.backdrop_face.map_or(2.0 * face_share * pixels_per_tangent, f64::from);
        let face = (face / FACE_STEP).ceil() * FACE_STEP;
        let face = face.clamp(*FACE.start(), *FACE.end()) as u32;
        let backdrop =
            BackdropConfig { face, lag, bound, layers: HAZE_OCTAVES - lag, detail: Detail::new(least_split) };
        Quality { layout, detail, down: wish.levels_below, backdrop }
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
    fn live_tiles_reach_the_backdrop_at_every_split_and_its_parallax_stays_small() {
        for profile in [&HARDWARE, &SOFTWARE, &SOFTWARE_WINDOW] {
            for pixels_per_tangent in [40.0, 320.0, 800.0, 2000.0] {
                let Quality { detail, backdrop, .. } =
                    Quality::of(profile, pixels_per_tangent, &QualitySettings::default());
                assert!(backdrop.detail.split <= detail.split);
                // At the least split its nearest content is nearest.
                let BackdropConfig { lag, bound, .. } = backdrop;
                let shift = backdrop::parallax(bound / SUDDEN, backdrop.detail.split, lag);
                assert!(shift * pixels_per_tangent <= profile.parallax_pixels * 1.000_001, "{shift}");
                assert_eq!(f64::from(backdrop.face) % FACE_STEP, 0.0);
            }
        }
    }

    #[test]
    fn whatever_is_chosen_fits_a_selection() {
        for pixels in [100.0, 500.0, 2000.0, 8000.0] {
            let usual = Quality::of(&HARDWARE, pixels, &QualitySettings::default());
            let chosen = usual.tuned(3.0, usual.down, pixels);
            assert_eq!(chosen.tuned(3.0, usual.down, pixels), chosen);
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
