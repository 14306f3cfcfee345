//! What Rust and the shaders share: constants, and structs that lie in memory the same way on both sides.
//!
//! The structs mirror `shaders/scene.wgsl`, `terrain.wgsl`, `mask.wgsl`, `inspect.wgsl`, `lines.wgsl`, `aids.wgsl`,
//! `panels.wgsl`, `quad.wgsl`, `tile.wgsl` and `veil.wgsl`; `tests/shaders.rs` compares them member by member.

use crate::gpu::Constant;
use crate::terrain::tile::{Cells, Tile, gradient};
use bytemuck::{Pod, Zeroable};

/// Where the parts of a slot lie, in words of 32 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SlotLayout {
    /// N: data cells per side.
    pub cells: Cells,
    /// Mesh cells per side; divides N, at least 2.
    pub mesh: u32,
}

impl SlotLayout {
    /// (N+3)² fine residuals begin here.
    pub const FINE: usize = 0;

    /// (N/2+3)² coarse residuals begin here.
    pub fn coarse(&self) -> usize {
        Self::FINE + self.cells.fine_side().pow(2)
    }

    /// (N+1)² packed fine gradients begin here.
    pub fn fine_gradient(&self) -> usize {
        self.coarse() + self.cells.coarse_side().pow(2)
    }

    /// (N/2+1)² packed coarse gradients begin here.
    pub fn coarse_gradient(&self) -> usize {
        self.fine_gradient() + (self.cells.fine_side() - 2).pow(2)
    }

    /// Words of a whole slot.
    pub fn words(&self) -> usize {
        self.coarse_gradient() + (self.cells.coarse_side() - 2).pow(2)
    }

    /// Writes what the slot of a tile holds: the reference of the compute shader, word for word.
    pub fn fill(&self, tile: &Tile, words: &mut [i32]) {
        words[Self::FINE..self.coarse()].copy_from_slice(&tile.fine);
        words[self.coarse()..self.fine_gradient()].copy_from_slice(&tile.coarse);
        let gradients = |grid: &[i32], side: usize, to: &mut [i32]| {
            let inner = side - 2;
            for (i, word) in to.iter_mut().enumerate() {
                let p = (i / inner + 1) * side + i % inner + 1;
                let dx = gradient(grid[p + 1] - grid[p - 1]);
                let dz = gradient(grid[p + side] - grid[p - side]);
                *word = i32::from(dx as u16) | i32::from(dz) << 16;
            }
        };
        let (fine, coarse) = (self.fine_gradient(), self.coarse_gradient());
        gradients(&tile.fine, self.cells.fine_side(), &mut words[fine..coarse]);
        gradients(&tile.coarse, self.cells.coarse_side(), &mut words[coarse..self.words()]);
    }

    /// The constants of the shaders' prelude.
    pub fn constants(&self) -> [(&'static str, Constant); 10] {
        let word = |n: usize| Constant::U32(n as u32);
        [
            ("CELLS", word(self.cells.n())),
            ("MESH", Constant::U32(self.mesh)),
            ("STEPS", Constant::U32(self.cells.steps())),
            ("FINE_SIDE", word(self.cells.fine_side())),
            ("COARSE_SIDE", word(self.cells.coarse_side())),
            ("FINE", word(Self::FINE)),
            ("COARSE", word(self.coarse())),
            ("FINE_GRADIENT", word(self.fine_gradient())),
            ("COARSE_GRADIENT", word(self.coarse_gradient())),
            ("SLOT_WORDS", word(self.words())),
        ]
    }
}

/// `Eye` of scene.wgsl: what a pass of its own draws.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct EyePush {
    /// Eye, or face of the backdrop.
    pub view: u32,
    /// Its first tile among the tile records.
    pub first_tile: u32,
}

/// `PanelPush` of panels.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct PanelPush {
    /// Clip units per point.
    pub clip_per_point: [f32; 2],
}

/// `Hung` of quad.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct HungUniform {
    /// Column-major, for the left eye and the right one.
    pub clip_from_picture: [[[f32; 4]; 4]; 2],
}

/// `QuadPush` of quad.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct QuadPush {
    /// The eye, in a pass for one.
    pub view: u32,
    /// 1: the target encodes sRGB by itself.
    pub linear: u32,
}

/// `MaskCorner` of mask.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct MaskCorner {
    /// Tangents of the angles to the right and upwards.
    pub tangents: [f32; 2],
    /// 0: left, 1: right.
    pub eye: u32,
    /// 0.
    pub unused: u32,
}

/// `Veil` of veil.wgsl; see there.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[expect(missing_docs, reason = "each member is explained once, in veil.wgsl")]
pub struct VeilUniform {
    pub lenses: [[f32; 4]; 2],
    pub ahead: [[f32; 4]; 2],
    pub inner: f32,
    pub outer: f32,
    pub strength: f32,
    pub fade: f32,
}

/// `LinePoint` of lines.wgsl: an end of a line.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct LinePoint {
    /// Metres from the middle of the head, along the terrain's axes.
    pub at: [f32; 3],
    /// sRGB, red in the lowest byte.
    pub colour: u32,
}

/// `AidEye` of aids.wgsl: an eye over the play space, from the seat.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct AidEye {
    /// Column-major.
    pub clip_from_play: [[f32; 4]; 4],
    /// Where it is.
    pub at: [f32; 3],
    /// Metres that a pixel spans at a distance of 1 m.
    pub pixel: f32,
}

/// `AidSight` of aids.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct AidSight {
    /// Left and right.
    pub eyes: [AidEye; 2],
    /// Towards the sun, along the play space's axes.
    pub sun: [f32; 3],
    /// 0.
    pub unused: f32,
    /// Away from the land, along the play space's axes.
    pub up: [f32; 3],
    /// 0.
    pub unused_too: f32,
}

/// `AidSolid` of aids.wgsl; see there.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[expect(missing_docs, reason = "each member is explained once, in aids.wgsl")]
pub struct AidSolid {
    pub a: [f32; 3],
    pub radius_a: f32,
    pub b: [f32; 3],
    pub radius_b: f32,
    pub colour: u32,
    pub ring: u32,
    pub glow: f32,
    pub unused: u32,
}

/// `AidPoint` of aids.wgsl: a point of a line.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct AidPoint {
    /// Metres of the play space from the seat.
    pub at: [f32; 3],
    /// Metres; below 0: the line ends here.
    pub half_width: f32,
    /// The way the line goes here.
    pub tangent: [f32; 3],
    /// sRGB and alpha, red in the lowest byte.
    pub colour: u32,
}

/// `Inspection` of inspect.wgsl; see there.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[expect(missing_docs, reason = "each member is explained once, in inspect.wgsl")]
pub struct Inspection {
    pub palette: [[f32; 4]; 8],
    pub head_from_scene: [[f32; 4]; 4],
    pub surface: u32,
    pub levels: u32,
    pub face: f32,
    pub unused: u32,
}

/// `Request` of tile.wgsl: a tile to make.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Request {
    /// The patch's residuals.
    pub residuals: [i32; 16],
    /// The patch's level.
    pub level: u32,
    /// The patch's corner.
    pub x: u32,
    /// The patch's corner.
    pub z: u32,
    /// The patch's plane, mod 2³².
    pub c: u32,
    /// The patch's plane, mod 2³².
    pub gx: u32,
    /// The patch's plane, mod 2³².
    pub gz: u32,
    /// Where the tile goes.
    pub slot: u32,
    /// Always 0.
    pub unused: u32,
}

/// `Surface` of tile.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct SurfaceUniform {
    /// Low half of the seed.
    pub seed_low: u32,
    /// High half of the seed.
    pub seed_high: u32,
    /// 0: bilinear, 1: cubic.
    pub scheme: u32,
    /// As in [`Surface`](crate::terrain::Surface).
    pub amplitude: i32,
    /// 0: no terraces.
    pub period: u32,
    /// As in [`Terrace`](crate::terrain::Terrace).
    pub tread_fall: u32,
    /// As in [`Terrace`](crate::terrain::Terrace).
    pub riser_fall: u32,
    /// The level whose noise is there alone; 0: every level's is.
    pub only: u32,
}

/// `Tile` of terrain.wgsl: a tile to draw.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct TileRecord {
    /// The corner of the tile's plane, metres from the middle of the head.
    pub origin: [f32; 3],
    /// Side in metres.
    pub size: f32,
    /// Rise over run of the plane.
    pub slope: [f32; 2],
    /// Slot number.
    pub slot: u32,
    /// [`Corners`](crate::terrain::morph::Corners), and [`TileRecord::AT_RIM`].
    pub corners: u32,
    /// Lattice coordinate of the corner.
    pub x: u32,
    /// Lattice coordinate of the corner.
    pub z: u32,
    /// Height of the plane's corner mod 2³².
    pub c: u32,
    /// Level mod 2³².
    pub level: u32,
}

impl TileRecord {
    /// The bit of `corners` that says that tiles beside it begin where the baked ones end: its skirts reach farther.
    pub const AT_RIM: u32 = 256;
}

/// `View` of scene.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct ViewUniform {
    /// Column-major.
    pub clip_from_scene: [[f32; 4]; 4],
    /// The inverse without the eye's place.
    pub ray_from_clip: [[f32; 4]; 4],
}

/// `Material` of scene.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct MaterialUniform {
    /// Linear.
    pub colour: [f32; 3],
    /// Gradient at which it shows alone.
    pub slope: f32,
    /// Share of strata.
    pub strata: f32,
    /// Share of noise.
    pub grain: f32,
    /// Always 0.
    pub unused: [f32; 2],
}

/// `Scene` of scene.wgsl; see there.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[expect(missing_docs, reason = "each member is explained once, in scene.wgsl")]
pub struct SceneUniform {
    pub views: [ViewUniform; 2],
    pub sun_direction: [f32; 3],
    pub encode: u32,
    pub sun_colour: [f32; 3],
    pub per_haze_begin: f32,
    pub sky_zenith: [f32; 3],
    pub sky_strength: f32,
    pub sky_horizon: [f32; 3],
    pub haze_middle: f32,
    pub haze_steepness: f32,
    pub haze_close: f32,
    pub morph_start: f32,
    pub per_morph_length: f32,
    pub drift_phase: f32,
    pub drift_per_octave: f32,
    pub drift_tints: u32,
    pub materials_used: u32,
    pub strata_used: u32,
    pub strata_per_cell: f32,
    pub flat_shading: u32,
    pub per_drift_begin: f32,
    pub log_distance: f32,
    pub backdrop: u32,
    pub rim_skirt: f32,
    pub unused: u32,
    pub materials: [MaterialUniform; 8],
    pub tints: [[f32; 4]; 8],
    pub strata: [[f32; 4]; 4],
}
