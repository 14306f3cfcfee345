//! PURE: the surface, the path, the selection. Cannot fail; knows no GPU, no clock, no file.
//!
//! All heights are integers, so a processor and a graphics card agree bit for bit. Reading order:
//!
//! | file | noun |
//! |---|---|
//! | [`hash`] | the noise value of a lattice point |
//! | [`surface`] | subdivision schemes, octaves, one step of the recursion |
//! | [`plane`] | the plane a patch of heights is counted from |
//! | [`patch`] | 4×4 lattice points: a quadtree node, its children, its bounding box |
//! | [`block`] | 6×6 lattice points: the 3×3 tiles around the viewer |
//! | [`spine`] | the path from the root to the viewer, with checkpoints |
//! | [`place`] | where the viewer is, relative to the anchor; steered dives |
//! | [`nearest`] | the ground nearest to a point, and the ground that a ray meets |
//! | [`tile`] | N×N cells of heights, the reference of `shaders/tile.wgsl` |
//! | [`morph`] | where a vertex of a drawn tile is: the reference of `shaders/terrain.wgsl` |
//! | [`select`] | which tiles to draw from here |
//! | [`pool`] | which tile is in which slot |
//! | [`pace`] | how many tiles a frame makes |
//! | [`backdrop`] | which tiles are too far away to show parallax, and where they are baked from |
//! | [`schedule`] | which of them to bake next, and how fast |
//! | [`deal`] | what of that is baked in which frame |

pub mod backdrop;
pub mod block;
pub mod deal;
pub mod hash;
pub mod morph;
pub mod nearest;
pub mod pace;
pub mod patch;
pub mod place;
pub mod plane;
pub mod pool;
pub mod schedule;
pub mod select;
pub mod spine;
pub mod surface;
pub mod tile;

pub use block::Block;
pub use nearest::{Nearest, Probe};
pub use patch::Patch;
pub use place::Place;
pub use plane::Plane;
pub use spine::Spine;
pub use surface::{Scheme, Surface, Terrace};
pub use tile::Tile;

/// Which rules make the heights. It is counted up whenever any height of any world changes: a path then leads to
/// another place, and an address of another version says so instead of going there.
pub const GENERATOR_VERSION: u32 = 1;

/// One lattice spacing in fixed point: heights carry 16 fraction bits.
pub const ONE: i32 = 1 << 16;
