//! The backdrop: a cubemap of everything too far away to show parallax, shared by both eyes.
//!
//! Its texels have one sample each, however many the eyes' pixels have: they stand still in the world and are filtered when
//! they are seen, so that their edges neither crawl nor flicker. Samples would have to be kept for all faces while a layer
//! is baked, over many frames: 300 MB for four of them at 1024 texels a side.
//!
//! It is the fold of its layers, far to near. There are two cubemaps, the one in use and the spare; what goes into which
//! is [`Schedule`]'s business. What is seen depends on the layers alone, not on how they came.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;
use glam::{DVec3, Vec3};

use super::layout::{EyePush, SceneUniform, TileRecord};
use super::look::bake_uniform;
use super::terrain::{mesh_buffer, tile_record};
use super::tiles::TileStore;
use super::{BAKE_SHADER, HASH_SHADER, SCENE_SHADER, TERRAIN_SHADER};
use crate::gpu::{
    Access, Attachment, BindGroup, Buffer, BufferInfo, Commands, Depth, Gpu, GraphicsInfo, GraphicsPipeline,
    Image, ImageInfo, Load, Location, Program, Resource, Sampler, Target, Transition,
};
use crate::terrain::Place;
use crate::terrain::backdrop::{Ladder, Layer, LayerId, ROOT_UP};
use crate::terrain::deal::Deal;
use crate::terrain::morph::Detail;
use crate::terrain::place::START_LEVEL;
use crate::terrain::pool::Slot;
use crate::terrain::schedule::{MOST_EXTRA, Schedule, Want};
use crate::terrain::select::{Drawn, Selection, Tiles, View};
use crate::terrain::surface::Corner;
use crate::terrain::{Patch, Surface};
use crate::world::Look;

const COLOUR: vk::Format = vk::Format::R8G8B8A8_SRGB;
const DISTANCE: vk::Format = vk::Format::R32_SFLOAT;
const DEPTH: vk::Format = vk::Format::D32_SFLOAT;
const FACES: usize = 6;

/// The logarithm of the distance where nothing is baked: less than any.
const NOTHING: f32 = -1e30;

/// Standard deviation of the slopes within a tile from its plane's: 0.5 to 0.6 in the worlds at hand.
const ROUGHNESS: f64 = 0.6;

/// A layer has all tiles that live ones and the next layer may leave out: where they begin is reckoned from points that lie
/// less than so many of its tiles from where it is baked.
const ROAMED: f32 = 0.1;

/// The innermost tiles' skirts reach over so many texels, so that none between them and what begins there is left open.
const RIM_TEXELS: f64 = 2.0;

/// What morphs, and skirts, lie no farther outside a tile's box, in tiles.
const BEYOND: f32 = 0.25;

/// Levels of the colour's mipmap: seen towards a corner of a face, up to three texels share a pixel's width.
const MIPS: u32 = 3;

/// Most tiles that one submission bakes.
const MOST_BATCH: usize = 256;

/// How the backdrop is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BackdropConfig {
    /// Texels per side of a face, at most 4 096.
    pub face: u32,
    /// Levels from a layer's tiles down to the tile that it is baked above.
    pub lag: usize,
    /// The farthest that a viewer may be from where a layer is baked, in tiles of its key: beyond, its parallax is seen.
    pub bound: f64,
    /// Layers: octaves of distance that it shows.
    pub layers: usize,
    /// When its tiles split: earlier than live ones ever do, so that these always reach its nearest content, and the bound
    /// holds for whatever of it is seen.
    pub detail: Detail,
}

impl BackdropConfig {
    /// A tile of a layer is no nearer to the point it is baked from, in tiles.
    fn least(&self) -> f32 {
        self.detail.split as f32 - ROAMED
    }

    /// How far the rim's skirts reach out, in tiles: a face's middle texels are the widest.
    fn rim_skirt(&self) -> f32 {
        (RIM_TEXELS * self.detail.split * 2.0 / f64::from(self.face)) as f32
    }
}

impl BackdropConfig {
    /// Level of the nearest layer that is wanted where the anchor is of `level`.
    pub fn nearest_layer(&self, level: usize) -> usize {
        level.saturating_sub(self.lag)
    }
}

/// What one call of [`Backdrop::prepare`] set up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Baking {
    /// Tiles that are baked in this submission, or parts of one.
    pub pieces: usize,
    /// About how many texels they cover.
    pub texels: usize,
    /// True if nothing is left to bake.
    pub whole: bool,
}

struct Cube {
    colour: Image,
    distance: Image,
    /// Distances count tiles of this level.
    reference: usize,
    /// The mipmap is older than the texels.
    blurred: bool,
}

/// A layer on its way into a cube.
struct Job {
    cube: usize,
    /// Level of its tiles.
    level: usize,
    /// The cube is cleared first.
    first: bool,
}

struct PerFrame {
    scene: Buffer,
    tiles: Buffer,
    group: BindGroup,
    /// First tile record and number of tiles of each face.
    faces: [(u32, u32); FACES],
    /// First index and number of indices of what is drawn of each tile.
    indices: (u32, u32),
}

/// The cubemap in use, the spare one, and what bakes them.
pub struct Backdrop {
    config: BackdropConfig,
    schedule: Schedule,
    /// The viewer, as of the frame's beginning.
    ladder: Ladder,
    cubes: [Cube; 2],
    /// Counts what [`Backdrop::stamp`] tells apart.
    stamp: u64,
    depth: Image,
    pipeline: GraphicsPipeline,
    indices: Buffer,
    index_count: u32,
    mesh: u32,
    frames: Vec<PerFrame>,
    smooth: Sampler,
    exact: Sampler,
    job: Option<Job>,
    selection: Selection,
    /// The job's tiles, in the order in which they are baked.
    deal: Deal,
    patches: Patches,
}

/// Answers a layer's selection: every tile is to be had, and its patch is kept.
#[derive(Default)]
struct Patches(Vec<Patch>);

impl Tiles for Patches {
    fn ready(&mut self, _: Corner) -> Option<Slot> {
        None
    }

    fn make(&mut self, patch: &Patch, _: bool) -> Option<Slot> {
        self.0.push(*patch);
        Some(self.0.len() as Slot - 1)
    }
}

impl Backdrop {
    /// Two empty cubemaps.
    ///
    /// # Errors
    /// Out of memory, or the device cannot draw to the formats.
    pub fn new(
        gpu: &Arc<Gpu>,
        store: &TileStore,
        config: BackdropConfig,
        frames_in_flight: usize,
    ) -> Result<Backdrop> {
        let program = Program::new(
            gpu,
            "bake",
            &[HASH_SHADER, SCENE_SHADER, TERRAIN_SHADER, BAKE_SHADER],
            &store.layout.constants(),
        )?;
        let colours = [COLOUR, DISTANCE];
        let pipeline = GraphicsPipeline::new(&GraphicsInfo {
            depth: Some(Depth { format: DEPTH, compare: vk::CompareOp::GREATER, write: true }),
            cull: vk::CullModeFlags::BACK,
            // Faces of a cubemap are mirrored, seen from within.
            front: vk::FrontFace::CLOCKWISE,
            ..GraphicsInfo::new(&program, "bake_vertex", "bake_fragment", &colours)
        })?;
        let image = |name, format, cube, mips, usage| {
            Image::new(
                gpu,
                &ImageInfo {
                    name,
                    width: config.face,
                    height: config.face,
                    layers: 6,
                    mips,
                    format,
                    usage,
                    cube,
                    ..ImageInfo::default()
                },
            )
        };
        let seen = vk::ImageUsageFlags::COLOR_ATTACHMENT
            | vk::ImageUsageFlags::SAMPLED
            | vk::ImageUsageFlags::TRANSFER_SRC;
        let cube = |colour, distance| -> Result<Cube> {
            Ok(Cube {
                colour: image(colour, COLOUR, true, MIPS, seen | vk::ImageUsageFlags::TRANSFER_DST)?,
                distance: image(distance, DISTANCE, true, 1, seen)?,
                reference: 0,
                blurred: true,
            })
        };
        let cubes = [
            cube("backdrop colour", "backdrop distance")?,
            cube("spare backdrop colour", "spare backdrop distance")?,
        ];
        let depth = image("backdrop depth", DEPTH, false, 1, vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT)?;
        let all = [&cubes[0].colour, &cubes[0].distance, &cubes[1].colour, &cubes[1].distance, &depth];
        gpu.run(|commands| {
            let general = |image: &&Image| Transition {
                image: image.raw,
                aspect: image.aspect,
                from: (Access::NONE, vk::ImageLayout::UNDEFINED),
                to: (Access::ALL, vk::ImageLayout::GENERAL),
            };
            commands.transition(&[0, 1, 2, 3, 4].map(|i| general(&all[i])));
        })?;
        let upload = |name, size: usize, usage| {
            Buffer::new(gpu, &BufferInfo { name, size: size as u64, usage, location: Location::Upload })
        };
        let (indices, index_count) = mesh_buffer(gpu, store.layout)?;
        let per_frame = || -> Result<PerFrame> {
            let scene =
                upload("bake scene", size_of::<SceneUniform>(), vk::BufferUsageFlags::UNIFORM_BUFFER)?;
            let records = MOST_BATCH * FACES * size_of::<TileRecord>();
            let tiles = upload("baked tiles", records, vk::BufferUsageFlags::STORAGE_BUFFER)?;
            let resources = [
                ("scene", Resource::Buffer(&scene)),
                ("tiles", Resource::Buffer(&tiles)),
                ("slots", Resource::Buffer(&store.slots)),
            ];
            let group = program.bind_group(0, &resources)?;
            Ok(PerFrame { scene, tiles, group, faces: [(0, 0); FACES], indices: (0, index_count) })
        };
        let clamp = vk::SamplerAddressMode::CLAMP_TO_EDGE;
        Ok(Backdrop {
            config,
            schedule: Schedule::default(),
            ladder: Ladder::default(),
            cubes,
            stamp: 0,
            depth,
            pipeline,
            indices,
            index_count,
            mesh: store.layout.mesh,
            frames: (0..frames_in_flight).map(|_| per_frame()).collect::<Result<Vec<_>>>()?,
            smooth: Sampler::new(gpu, "backdrop, smooth", vk::Filter::LINEAR, clamp)?,
            exact: Sampler::new(gpu, "backdrop, exact", vk::Filter::NEAREST, clamp)?,
            job: None,
            selection: Selection::default(),
            deal: Deal::default(),
            patches: Patches(Vec::with_capacity(4096)),
        })
    }

    /// How it is made.
    pub fn config(&self) -> BackdropConfig {
        self.config
    }

    /// Index of the cubemap to draw.
    pub fn front(&self) -> usize {
        self.schedule.front()
    }

    /// What is baked where.
    pub fn schedule(&self) -> &Schedule {
        &self.schedule
    }

    /// Another number whenever the cubemap in use shows something else for good: a layer more, or all anew. While a
    /// layer is being baked it is not counted: live tiles cover it.
    pub fn stamp(&self) -> u64 {
        self.stamp
    }

    /// What the sky's shader needs of cubemap `index`.
    pub fn resources(&self, index: usize) -> [(&'static str, Resource<'_>); 4] {
        let cube = &self.cubes[index];
        [
            ("backdrop_colour", Resource::Texture(cube.colour.cube_view, vk::ImageLayout::GENERAL)),
            ("backdrop_distance", Resource::Texture(cube.distance.cube_view, vk::ImageLayout::GENERAL)),
            ("smooth_sampler", Resource::Sampler(&self.smooth)),
            ("exact_sampler", Resource::Sampler(&self.exact)),
        ]
    }

    /// The colour image of the cubemap in use: six layers, layout GENERAL, sRGB at half brightness, alpha coverage.
    pub fn colour_image(&self) -> &Image {
        &self.cubes[self.front()].colour
    }

    /// The distance image of the cubemap in use: six layers, layout GENERAL, log2 of tiles of [`Backdrop::reference`].
    pub fn distance_image(&self) -> &Image {
        &self.cubes[self.front()].distance
    }

    /// The level whose tiles the distances of the cubemap in use count.
    pub fn reference(&self) -> usize {
        self.cubes[self.front()].reference
    }

    /// Level of the nearest whole layer of the cubemap in use: live tiles begin at the next one. None: it is empty.
    pub fn nearest(&self) -> Option<usize> {
        self.schedule.nearest()
    }

    /// The layers of the cubemap in use, far to near.
    pub fn layers(&self) -> &[LayerId] {
        self.schedule.layers()
    }

    /// See [`Schedule::set_at_hand`].
    pub fn set_at_hand(&mut self, from: Option<usize>) {
        self.schedule.set_at_hand(from);
    }

    /// Nothing that was baked is good any more.
    pub fn forget(&mut self) {
        self.schedule = Schedule::default();
        self.job = None;
    }

    /// About how many texels of the layer being baked are still to come.
    fn left(&self) -> f64 {
        self.job.as_ref().map_or(0.0, |_| self.deal.texels().0)
    }

    /// How fast the viewer may go, from 0 to 1, where at most `most` texels are baked in a frame: see
    /// [`Schedule::headroom`].
    pub fn headroom(&mut self, most: f64) -> f64 {
        self.schedule.headroom(self.left(), most)
    }

    /// What a viewer wants whose anchor is of `level`, `depth` octaves below the start.
    fn want(&self, level: usize, depth: f64, exact: bool) -> Want {
        let nearest = self.config.nearest_layer(level);
        let farthest = (nearest + 1).saturating_sub(self.config.layers);
        Want {
            nearest,
            farthest: farthest.max(ROOT_UP),
            least: ROOT_UP,
            lag: self.config.lag,
            bound: self.config.bound,
            exact,
            depth,
        }
    }

    /// Begins a frame of a viewer at `here` (tiles of the place's anchor): a spare that is the better one takes over. Call it
    /// before the frame's live tiles are chosen: they begin where the cubemap in use ends. `exact`: nothing but the
    /// place's own layers will do.
    pub fn begin_frame(&mut self, (place, here): (&Place, DVec3), depth: f64, exact: bool) {
        self.ladder.climb(place, here, self.config.layers + 2 * MOST_EXTRA + self.config.lag);
        let want = self.want(place.level(), depth, exact);
        if self.schedule.begin_frame(&self.ladder, &want) {
            self.stamp += 1;
        }
    }

    /// Chooses what to bake next: about as many texels as are due in this frame, at most `most`. Asks `store` for the
    /// tiles. Call it once per submission, after the store's own begin of the frame.
    pub fn prepare(
        &mut self,
        index: usize,
        place: &Place,
        most: f64,
        (surface, look): (&Surface, &Look),
        store: &mut TileStore,
    ) -> Baking {
        self.frames[index].faces = [(0, 0); FACES];
        let Some((task, new)) = self.schedule.next(&self.ladder) else {
            self.job = None;
            return Baking { whole: true, ..Baking::default() };
        };
        if new {
            let layer = self.ladder.layer(place, task.id.level, self.config.lag);
            self.select(surface, &layer);
            if task.first {
                self.cubes[task.cube].reference = task.id.level;
            }
            self.job = Some(Job { cube: task.cube, level: task.id.level, first: task.first });
        }
        let quota = self.schedule.quota(self.left(), most);
        if new {
            self.deal.deal(quota);
        }
        let Some(job) = &self.job else { return Baking::default() };
        let cube = &self.cubes[job.cube];
        let frame = &mut self.frames[index];
        let log_distance = (cube.reference as f64 - job.level as f64) as f32;
        let depth = job.level as f64 - START_LEVEL as f64;
        frame.scene.slice_mut()[0] =
            bake_uniform(look, depth, self.config.detail, log_distance, self.config.rim_skirt());

        let mut batch = [(0 as Slot, 0usize); MOST_BATCH];
        let (mut pieces, mut texels) = (0, 0.0);
        frame.indices = (0, self.index_count);
        for index in self.deal.next(quota, MOST_BATCH) {
            let piece = self.deal.piece(index);
            let Some(slot) = store.make_to_bake(&self.patches.0[piece.tile.slot as usize]) else { break };
            if piece.parts > 1 {
                frame.indices = rows(self.mesh, self.index_count, piece.part, piece.parts);
            }
            batch[pieces] = (slot, index);
            (pieces, texels) = (pieces + 1, texels + f64::from(piece.texels));
        }
        let (mut record, least) = (0, self.config.least());
        let records: &mut [TileRecord] = frame.tiles.slice_mut();
        for (face, span) in frame.faces.iter_mut().enumerate() {
            let first = record;
            for &(slot, index) in &batch[..pieces] {
                let drawn = Drawn { slot, ..self.deal.piece(index).tile };
                if touches_face(&drawn, self.selection.heights(&drawn), face) {
                    let mut tile = tile_record(&drawn, 1.0);
                    if self.selection.touches_nearer(&drawn, least) {
                        tile.corners |= TileRecord::AT_RIM;
                    }
                    records[record] = tile;
                    record += 1;
                }
            }
            *span = (first as u32, (record - first) as u32);
        }
        Baking { pieces, texels: texels as usize, whole: false }
    }

    /// The tiles of a layer, and about how many texels each covers.
    fn select(&mut self, surface: &Surface, layer: &Layer) {
        let detail = self.config.detail;
        let view = View {
            root: &layer.root,
            head: layer.eye,
            levels: ROOT_UP,
            live_from: ROOT_UP,
            prefetch_from: ROOT_UP,
            detail,
            frusta: None,
        };
        self.patches.0.clear();
        self.selection.select(surface, &view, &mut self.patches);
        let per_steradian = texels_per_steradian(self.config.face);
        let least = self.config.least();
        let drawn = self.selection.drawn.iter();
        let drawn = drawn.filter(|tile| tile.level == ROOT_UP && self.selection.distance(tile) >= least);
        let weigh = |tile: &Drawn| solid_angle(tile) * per_steradian;
        self.deal.begin(drawn.map(|tile| (*tile, weigh(tile) as f32)));
    }

    /// True if [`Backdrop::record`] has something to do.
    pub fn has_work(&self, baking: &Baking) -> bool {
        baking.pieces > 0 || self.cubes[self.front()].blurred
    }

    /// Records what [`Backdrop::prepare`] chose; the tiles must have been recorded before.
    pub fn record(&mut self, commands: Commands<'_>, index: usize, baking: &Baking) {
        if !baking.whole {
            self.record_bake(commands, index, baking);
        }
        let front = &mut self.cubes[self.schedule.front()];
        if std::mem::take(&mut front.blurred) {
            commands.make_mips(&front.colour, MIPS);
        }
    }

    fn record_bake(&mut self, commands: Commands<'_>, index: usize, baking: &Baking) {
        let Some(job) = &mut self.job else { return };
        let cube = &mut self.cubes[job.cube];
        let frame = &self.frames[index];
        let extent = vk::Extent2D { width: self.config.face, height: self.config.face };
        let begins = self.deal.done() == 0;
        commands.barrier(
            Access::FRAGMENT_READ | Access::COPY_READ | Access::COLOUR_WRITE | Access::DEPTH_WRITE,
            Access::COLOUR_WRITE | Access::DEPTH_WRITE,
        );
        for face in 0..FACES {
            let (first_tile, count) = frame.faces[face];
            if count == 0 && !begins {
                continue;
            }
            let clear = |load| if job.first && begins { load } else { Load::Keep };
            let attachment = |image: &Image, load| {
                Attachment::new(image.layer_views[face], vk::ImageLayout::GENERAL, load)
            };
            let colour = [
                attachment(&cube.colour, clear(Load::Colour([0.0; 4]))),
                attachment(&cube.distance, clear(Load::Colour([NOTHING; 4]))),
            ];
            // Each layer is in front of all before it: its depths are compared among its own tiles only.
            let depth = attachment(&self.depth, if begins { Load::Depth(0.0) } else { Load::Keep });
            let target = Target { extent, view_mask: 0, colour: &colour, depth: Some(depth) };
            commands.render(&target, |pass| {
                if count > 0 {
                    pass.bind(&self.pipeline, &[&frame.group]);
                    pass.push(&self.pipeline, &EyePush { view: face as u32, first_tile });
                    pass.index_buffer(&self.indices, vk::IndexType::UINT16);
                    let (first, indices) = frame.indices;
                    pass.draw_indexed_range(first, indices, count);
                }
            });
        }
        commands
            .barrier(Access::COLOUR_WRITE, Access::FRAGMENT_READ | Access::COPY_READ | Access::COLOUR_WRITE);
        if self.deal.finish(baking.pieces) {
            cube.blurred = true;
            self.job = None;
            self.stamp += u64::from(self.schedule.finish(self.deal.texels().1, &self.ladder));
        }
    }
}

/// First index and number of indices of a part of a tile's mesh: its rows, and with the last ones the skirts.
fn rows(mesh: u32, indices: u32, part: u32, parts: u32) -> (u32, u32) {
    let row = |part| 6 * mesh * (mesh * part / parts);
    let end = if part + 1 == parts { indices } else { row(part + 1) };
    (row(part), end - row(part))
}

/// Texels of a cubemap per steradian, on average over the sphere.
fn texels_per_steradian(face: u32) -> f64 {
    6.0 * f64::from(face).powi(2) / (4.0 * std::f64::consts::PI)
}

/// About how many steradians of a tile face the eye, those that other tiles hide included: of its plane, roughened by
/// slopes that are normally distributed about it.
fn solid_angle(tile: &Drawn) -> f64 {
    let middle = middle(tile).as_dvec3();
    let distance = middle.length().max(1.0);
    let ahead = middle / distance;
    let facing = f64::from(tile.slope[0]) * ahead.x - ahead.y + f64::from(tile.slope[1]) * ahead.z;
    let rough = (ROUGHNESS * ahead.x.hypot(ahead.z)).max(0.01);
    // The mean of what is positive of a normal variable; the distribution by its usual approximation with tanh.
    let u = facing / rough;
    let share = 0.5 * (1.0 + (0.797_885 * (u + 0.044_715 * u * u * u)).tanh());
    let density = 0.398_942 * (-0.5 * u * u).exp();
    (facing * share + rough * density) / (distance * distance)
}

/// The middle of a tile, from the eye.
fn middle(tile: &Drawn) -> Vec3 {
    Vec3::new(0.5, 0.5 * (tile.slope[0] + tile.slope[1]), 0.5) - tile.head.as_vec3()
}

/// False if no part of a tile, whose bounding box reaches from `low` to `high` over its plane's corner, is seen through a
/// face: by a sphere.
fn touches_face(tile: &Drawn, [low, high]: [f32; 2], face: usize) -> bool {
    let radius = Vec3::new(0.5, 0.5 * (high - low) + BEYOND, 0.5).length();
    let axis = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z][face];
    let middle = Vec3::new(0.5, 0.5 * (low + high), 0.5) - tile.head.as_vec3();
    let ahead = middle.dot(axis);
    let side = (middle - axis * ahead).abs();
    // Distance to the planes at 45 degrees.
    (side.max_element() - ahead) * std::f32::consts::FRAC_1_SQRT_2 <= radius
}
