//! How much is drawn: what suits a device and the size of its pictures.

use ash::vk;

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
    /// Samples of a pixel: 1, 2, 4 or 8, as far as the device can.
    pub samples: u32,
}

/// What of it a person may change in the panels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fineness {
    /// A tile is split when it is nearer than so many of its own sizes: 2 to 4.
    pub split: f64,
    /// Levels below the anchor that are drawn: 1 to 5.
    pub down: usize,
    /// Data cells a side of a tile, one of [`CELLS`].
    pub cells: u32,
    /// Mesh cells a side of a tile, one of [`MESHES`] and no more than `cells`.
    pub mesh: u32,
    /// Samples of a pixel, one of [`SAMPLES`].
    pub samples: u32,
}

/// Data cells a side that a tile may have.
pub const CELLS: [u32; 4] = [16, 32, 64, 128];

/// Mesh cells a side that a tile may have.
pub const MESHES: [u32; 4] = [8, 16, 32, 64];

/// Samples that a pixel may have.
pub const SAMPLES: [u32; 4] = [1, 2, 4, 8];

/// Of [`SAMPLES`], those that a device can.
pub fn samples_offered(offered: vk::SampleCountFlags) -> impl Iterator<Item = u32> {
    SAMPLES.into_iter().filter(move |&n| n == 1 || offered.contains(vk::SampleCountFlags::from_raw(n)))
}

/// The most of these that is no more than `wanted`.
pub fn samples_at_most(offered: vk::SampleCountFlags, wanted: u32) -> u32 {
    samples_offered(offered).take_while(|&n| n <= wanted).last().unwrap_or(1)
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
    /// Samples of a pixel. All devices can 4 of what we draw into.
    samples: u32,
}

const HARDWARE: Profile =
    Profile { mesh: 32, split: 3.0, least_split: 2.6, parallax_pixels: 0.5, face_share: 1.0, samples: 4 };

/// Half of the time goes into triangles there, and 4 samples take nearly four times as long as one.
const SOFTWARE: Profile = Profile { mesh: 16, split: 2.6, samples: 1, ..HARDWARE };

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

    /// The same as fine as this. Where it splits otherwise, it does so whatever frames take.
    pub fn tuned(&self, fineness: &Fineness, pixels_per_tangent: f64) -> Quality {
        let &Fineness { split, down, cells, mesh, samples } = fineness;
        let split = split.clamp(2.0, 4.0);
        let backdrop = if split == self.detail.split {
            self.backdrop
        } else {
            let BackdropConfig { bound, lag, detail, face, .. } = self.backdrop;
            let parallax = backdrop::parallax(bound / SUDDEN, detail.split, lag) * pixels_per_tangent;
            baked(split, None, parallax, face, pixels_per_tangent)
        };
        let cells = Cells::new(cells).unwrap_or(self.layout.cells);
        Quality {
            layout: SlotLayout { cells, mesh: mesh.min(cells.n() as u32) },
            detail: Detail::new(split),
            down: down.clamp(1, MOST_DOWN),
            backdrop,
            samples,
        }
    }

    /// How fine it is.
    pub fn fineness(&self) -> Fineness {
        let SlotLayout { cells, mesh } = self.layout;
        let Quality { detail, down, samples, .. } = *self;
        Fineness { split: detail.split, down, cells: cells.n() as u32, mesh, samples }
    }

    fn of(profile: &Profile, pixels_per_tangent: f64, wish: &QualitySettings) -> Quality {
        let &Profile { mesh, split, least_split, parallax_pixels, face_share, samples } = profile;
        // Whoever sets where tiles split has it so throughout.
        let [split, least_split] = [split, least_split].map(|usual| wish.split.unwrap_or(usual));
        let wanted = pixels_per_tangent / split / PIXELS_PER_CELL;
        let usual = if wanted > 46.0 { Cells::N64 } else { Cells::N32 };
        let cells = wish.cells.and_then(Cells::new).unwrap_or(usual);
        let mesh = wish.mesh.unwrap_or(mesh).min(cells.n() as u32);
        let (layout, detail) = (SlotLayout { cells, mesh }, Detail::new(split));
        let face = wish.backdrop_face.map_or(2.0 * face_share * pixels_per_tangent, f64::from);
        let face = (face / FACE_STEP).ceil() * FACE_STEP;
        let face = face.clamp(*FACE.start(), *FACE.end()) as u32;
        let backdrop = baked(least_split, wish.backdrop_lag, parallax_pixels, face, pixels_per_tangent);
        let samples = wish.samples.unwrap_or(samples);
        Quality { layout, detail, down: wish.levels_below, backdrop, samples }
    }

    /// Levels of live tiles: one more than the lag while the next layer is baked, and those that the spare is behind.
    pub(crate) fn live_levels(&self) -> usize {
        self.backdrop.lag + 1 + MOST_EXTRA + self.down
    }
}

/// A backdrop with faces of so many texels where tiles split at `split` or earlier, whose nearest content shifts by no more
/// than `parallax` pixels.
fn baked(
    split: f64,
    lag: Option<usize>,
    parallax: f64,
    face: u32,
    pixels_per_tangent: f64,
) -> BackdropConfig {
    let usual = backdrop::lag_for(ROAMING_TILES / SUDDEN, split, pixels_per_tangent, parallax).clamp(4, 14);
    let lag = lag.unwrap_or(usual);
    let bound = SUDDEN * backdrop::bound_for(lag, split, pixels_per_tangent, parallax);
    BackdropConfig { face, lag, bound, layers: HAZE_OCTAVES - lag, detail: Detail::new(split) }
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
        for profile in [&HARDWARE, &SOFTWARE, &SOFTWARE_WINDOW] {
            for pixels in [100.0, 500.0, 2000.0, 8000.0] {
                let usual = Quality::of(profile, pixels, &QualitySettings::default());
                let chosen = usual.tuned(&usual.fineness(), pixels);
                assert_eq!(chosen, usual);
                for split in [0.0, 2.0, 2.7, 4.0, 9.0] {
                    let most = usual.tuned(&Fineness { split, down: 99, ..usual.fineness() }, pixels);
                    assert!(
                        most.live_levels() <= MOST_LEVELS && (2.0..=4.0).contains(&most.detail.split),
                        "{most:?}"
                    );
                    let BackdropConfig { lag, bound, detail, .. } = most.backdrop;
                    let shift = backdrop::parallax(bound / SUDDEN, detail.split, lag) * pixels;
                    assert!(shift <= profile.parallax_pixels * 1.000_001, "{shift} pixels at {split}");
                }
            }
        }
    }

    #[test]
    fn any_tile_size_is_had_and_the_mesh_is_never_finer_than_the_data() {
        let usual = Quality::of(&HARDWARE, 500.0, &QualitySettings::default());
        for cells in CELLS {
            for mesh in MESHES {
                let Fineness { cells: data, mesh: drawn, .. } =
                    usual.tuned(&Fineness { cells, mesh, ..usual.fineness() }, 500.0).fineness();
                assert_eq!((data, drawn), (cells, mesh.min(cells)));
            }
        }
    }

    #[test]
    fn a_count_that_the_device_cannot_falls_to_the_next_lower() {
        use vk::SampleCountFlags as Counts;
        let few = Counts::TYPE_1 | Counts::TYPE_4;
        assert_eq!(SAMPLES.map(|wanted| samples_at_most(few, wanted)), [1, 1, 4, 4]);
        let all = few | Counts::TYPE_2 | Counts::TYPE_8 | Counts::TYPE_16;
        assert_eq!(SAMPLES.map(|wanted| samples_at_most(all, wanted)), SAMPLES);
        assert_eq!(samples_offered(all).collect::<Vec<_>>(), SAMPLES);
    }
}
