//! What a frame draws: tiles made by compute, the terrain, the backdrop and the sky behind it. One file per thing drawn.
//!
//! Knows Vulkan (through `gpu`), the terrain and a world's look; never names OpenXR or a window.

mod aids;
mod backdrop;
mod inspect;
pub mod layout;
mod lines;
mod look;
mod mask;
mod panels;
mod quad;
mod sky_cube;
mod target;
mod terrain;
mod tiles;
mod veil;

pub use aids::{AID_CONSTANTS, Placed};
pub use backdrop::{Backdrop, BackdropConfig, Baking};
pub use lines::Selected;
pub use look::{Air, Sight, View};
pub use mask::MaskPass;
pub use panels::PanelPass;
pub use quad::QuadPass;
pub use sky_cube::{Horizon, SkyCube};
pub use target::{EyeTarget, TargetFormat};
pub use terrain::{Behind, Shading, TerrainPass};
pub use tiles::{Budget, TileStore};
pub use veil::{Dark, VeilPass};

use crate::gpu::Source;

/// `shaders/hash.wgsl`.
pub const HASH_SHADER: Source<'static> =
    Source { name: "shaders/hash.wgsl", text: include_str!("../../shaders/hash.wgsl") };
/// `shaders/scene.wgsl`.
pub const SCENE_SHADER: Source<'static> =
    Source { name: "shaders/scene.wgsl", text: include_str!("../../shaders/scene.wgsl") };
/// `shaders/terrain.wgsl`.
pub const TERRAIN_SHADER: Source<'static> =
    Source { name: "shaders/terrain.wgsl", text: include_str!("../../shaders/terrain.wgsl") };
/// `shaders/sky.wgsl`.
pub const SKY_SHADER: Source<'static> =
    Source { name: "shaders/sky.wgsl", text: include_str!("../../shaders/sky.wgsl") };
/// `shaders/mask.wgsl`.
pub const MASK_SHADER: Source<'static> =
    Source { name: "shaders/mask.wgsl", text: include_str!("../../shaders/mask.wgsl") };
/// `shaders/srgb.wgsl`.
pub const SRGB_SHADER: Source<'static> =
    Source { name: "shaders/srgb.wgsl", text: include_str!("../../shaders/srgb.wgsl") };
/// `shaders/shown.wgsl`.
pub const SHOWN_SHADER: Source<'static> =
    Source { name: "shaders/shown.wgsl", text: include_str!("../../shaders/shown.wgsl") };
/// `shaders/inspect.wgsl`.
pub const INSPECT_SHADER: Source<'static> =
    Source { name: "shaders/inspect.wgsl", text: include_str!("../../shaders/inspect.wgsl") };
/// `shaders/lines.wgsl`.
pub const LINES_SHADER: Source<'static> =
    Source { name: "shaders/lines.wgsl", text: include_str!("../../shaders/lines.wgsl") };
/// `shaders/aids.wgsl`.
pub const AIDS_SHADER: Source<'static> =
    Source { name: "shaders/aids.wgsl", text: include_str!("../../shaders/aids.wgsl") };
/// `shaders/bake.wgsl`.
pub const BAKE_SHADER: Source<'static> =
    Source { name: "shaders/bake.wgsl", text: include_str!("../../shaders/bake.wgsl") };
/// `shaders/veil.wgsl`.
pub const VEIL_SHADER: Source<'static> =
    Source { name: "shaders/veil.wgsl", text: include_str!("../../shaders/veil.wgsl") };
/// `shaders/panels.wgsl`.
pub const PANELS_SHADER: Source<'static> =
    Source { name: "shaders/panels.wgsl", text: include_str!("../../shaders/panels.wgsl") };
/// `shaders/quad.wgsl`.
pub const QUAD_SHADER: Source<'static> =
    Source { name: "shaders/quad.wgsl", text: include_str!("../../shaders/quad.wgsl") };
/// `shaders/tile.wgsl`.
pub use tiles::SHADER as TILE_SHADER;
