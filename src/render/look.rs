//! A world's look, the eyes and the air, as the shaders want them.

use super::layout::{MaterialUniform, SceneUniform, ViewUniform};
use crate::terrain::morph::Detail;
use crate::world::Look;
use glam::{Mat4, Vec3};

/// One eye, over the scene: metres from the middle of the head, along the terrain's axes.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// The eye and its axes.
    pub scene_from_view: Mat4,
    /// Infinite reversed-Z projection.
    pub clip_from_view: Mat4,
}

/// What the air does to distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Air {
    /// Metres to the nearest ground as the rig keeps it: octaves of haze count from here.
    pub begin_m: f32,
    /// Octaves at which the air is still clear.
    pub clear_octaves: f32,
    /// Octaves at which nothing but air is seen.
    pub close_octaves: f32,
}

impl Air {
    /// No haze at any distance.
    pub const NONE: Air = Air { begin_m: 1.0, clear_octaves: 1e6, close_octaves: 2e6 };

    /// The air of a look, closed where the drawn world ends, `end_octaves` beyond `begin_m`, if that is nearer.
    pub fn new(look: &Look, begin_m: f32, end_octaves: f32) -> Air {
        let close_octaves = look.haze_close_octaves.min(end_octaves);
        // A nearer end draws the whole curve in, so that it still looks like air.
        let clear_octaves = look.haze_clear_octaves.min(0.45 * close_octaves);
        Air { begin_m, clear_octaves, close_octaves }
    }
}

/// What both eyes see this frame.
#[derive(Clone, Copy, Debug)]
pub struct Sight {
    /// Left and right.
    pub views: [View; 2],
    /// The air.
    pub air: Air,
    /// When tiles split and morph.
    pub detail: Detail,
    /// Octaves below the start of the world of what is [`Sight::cell_m`] large.
    pub depth: f64,
    /// Metres of a cell of that depth.
    pub cell_m: f32,
    /// Metres, as a power of two, of the tiles that the backdrop's distances count; None: there is no backdrop.
    pub backdrop: Option<f32>,
}

/// Fills the uniform. `encode`: the target does not encode sRGB by itself.
pub(super) fn scene_uniform(look: &Look, sight: &Sight, encode: bool, flat: bool) -> SceneUniform {
    let mut scene = ground_uniform(look, sight.depth, sight.detail);
    scene.views = sight.views.map(|view| {
        let clip_from_scene = view.clip_from_view * view.scene_from_view.inverse();
        let mut turn = view.scene_from_view;
        turn.w_axis = Vec3::ZERO.extend(1.0);
        ViewUniform {
            clip_from_scene: clip_from_scene.to_cols_array_2d(),
            ray_from_clip: (turn * view.clip_from_view.inverse()).to_cols_array_2d(),
        }
    });
    scene.encode = u32::from(encode);
    scene.flat_shading = u32::from(flat);
    scene.per_drift_begin = 1.0 / sight.cell_m;
    set_air(&mut scene, &sight.air, sight.backdrop);
    scene
}

/// The uniform for what is behind the tiles, in every direction: sky, air, and the backdrop's distances as in
/// [`Sight::backdrop`].
pub(super) fn sky_uniform(look: &Look, air: &Air, backdrop: Option<f32>, encode: bool) -> SceneUniform {
    let mut scene = SceneUniform { encode: u32::from(encode), ..light_uniform(look) };
    set_air(&mut scene, air, backdrop);
    scene
}

pub(super) fn set_air(scene: &mut SceneUniform, air: &Air, backdrop: Option<f32>) {
    scene.per_haze_begin = 1.0 / air.begin_m;
    scene.haze_close = air.close_octaves;
    scene.backdrop = u32::from(backdrop.is_some());
    scene.log_distance = backdrop.unwrap_or(0.0);
    // A logistic: a twentieth closed at the clear end, half in the middle.
    let Air { clear_octaves, close_octaves, .. } = *air;
    scene.haze_middle = clear_octaves + 0.62 * (close_octaves - clear_octaves);
    scene.haze_steepness = 3.0 / (scene.haze_middle - clear_octaves).max(0.1);
}

/// The uniform for baking tiles that are `depth` octaves below the start of the world, with their size as the unit. Those at
/// the rim have skirts that reach out by `rim_skirt` of it.
pub(super) fn bake_uniform(
    look: &Look,
    depth: f64,
    detail: Detail,
    log_distance: f32,
    rim_skirt: f32,
) -> SceneUniform {
    SceneUniform { per_drift_begin: 1.0, log_distance, rim_skirt, ..ground_uniform(look, depth, detail) }
}

/// Sun and sky.
fn light_uniform(look: &Look) -> SceneUniform {
    SceneUniform {
        sun_direction: look.sun_direction,
        sun_colour: look.sun_colour,
        sky_zenith: look.sky_zenith,
        sky_strength: look.sky_strength,
        sky_horizon: look.sky_horizon,
        ..SceneUniform::default()
    }
}

/// What the light on the ground needs.
fn ground_uniform(look: &Look, depth: f64, detail: Detail) -> SceneUniform {
    let mut scene = SceneUniform {
        morph_start: detail.morph_start as f32,
        per_morph_length: (1.0 / (detail.morph_end - detail.morph_start)) as f32,
        ..light_uniform(look)
    };
    let tints = look.drift_tints.len().clamp(1, 8);
    scene.drift_tints = tints as u32;
    scene.drift_per_octave = tints as f32 / look.drift_octaves;
    // Reduced here, in 64 bits: at depth 1 000 000 a float has no fraction left.
    let rounds = depth / f64::from(look.drift_octaves);
    scene.drift_phase = (rounds.rem_euclid(1.0) * tints as f64) as f32;
    scene.tints = std::array::from_fn(|i| {
        let [r, g, b] = look.drift_tints.get(i).copied().unwrap_or([1.0; 3]);
        [r, g, b, 0.0]
    });

    scene.materials_used = look.materials.len().min(8) as u32;
    for (uniform, material) in scene.materials.iter_mut().zip(&look.materials) {
        *uniform = MaterialUniform {
            colour: material.colour,
            slope: material.slope,
            strata: material.strata,
            grain: material.grain,
            unused: [0.0; 2],
        };
    }
    let strata = look.strata_colours.len().min(4);
    scene.strata_used = strata as u32;
    // One round of colours is a power of two of cells, so that it fits the period of what is known of a height.
    let round = (look.strata_band_cells * strata.max(1) as f32).max(1.0 / 64.0);
    scene.strata_per_cell = 1.0 / round.log2().round().exp2();
    for (uniform, [r, g, b]) in scene.strata.iter_mut().zip(&look.strata_colours) {
        *uniform = [*r, *g, *b, 0.0];
    }
    scene
}
