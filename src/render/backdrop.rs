//! The backdrop: a cubemap of everything too far away to show parallax, shared by both eyes.
//!
//! It is the fold of its layers, far to near. Going inwards, the next layer is drawn over the ones that are there:
//! until it is whole, live tiles cover what it shows. Any other change (outwards, sideways) folds everything anew
//! into the spare cubemap, which then takes over. What is seen depends on the layers alone, not on how they came.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;
use glam::Vec3;

use super::layout::{EyePush, SceneUniform, TileRecord};
use super::look::bake_uniform;
use super::terrain::{mesh_buffer, tile_record};
use super::tiles::TileStore;
use super::{BAKE_SHADER, HASH_SHADER, SCENE_SHADER, TERRAIN_SHADER};
use crate::gpu::{
    Access, Attachment, BindGroup, Buffer, BufferInfo, Commands, Depth, Gpu, GraphicsInfo, GraphicsPipeline,
    Image, ImageInfo, Load, Location, Program, Resource, Sampler, Target, Transition,
};
use crate::terrain::backdrop::{Layer, ROOT_UP};
use crate::terrain::morph::Detail;
use crate::terrain::place::START_LEVEL;
use crate::terrain::pool::Slot;
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

/// A layer reaches so many of its tiles further inwards than the live tiles begin, so that no sky shows between.
const OVERLAP: f64 = 0.45;

/// Layers that are remembered at least: more than are ever wanted.
const KEPT: usize = 64;

/// Most tiles that one submission bakes.
const MOST_BATCH: usize = 256;

/// How the backdrop is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BackdropConfig {
    /// Texels per side of a face, at most 4 096.
    pub face: u32,
    /// Levels from a layer's tiles down to the tile that it is baked above.
    pub lag: usize,
    /// Layers: octaves of distance that it shows.
    pub layers: usize,
}

/// What one call of [`Backdrop::prepare`] set up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Baking {
    /// Tiles that are baked in this submission.
    pub tiles: usize,
    /// About how many texels they cover.
    pub texels: usize,
    /// True if nothing is left to bake.
    pub whole: bool,
}

struct Cube {
    colour: Image,
    distance: Image,
    /// What is baked, far to near.
    layers: Vec<(usize, Corner)>,
    /// Distances count tiles of this level.
    reference: usize,
    /// A layer was begun and given up: parts of it are in the texels.
    tainted: bool,
}

/// A layer on its way into a cube.
struct Job {
    cube: usize,
    layer: (usize, Corner),
    /// Tiles of it that are baked.
    done: usize,
    /// The cube is cleared first.
    first_of_cube: bool,
}

struct PerFrame {
    scene: Buffer,
    tiles: Buffer,
    group: BindGroup,
    /// First tile record and number of tiles of each face.
    faces: [(u32, u32); FACES],
}

/// The cubemap in use, the spare one, and what bakes them.
pub struct Backdrop {
    config: BackdropConfig,
    cubes: [Cube; 2],
    front: usize,
    /// The spare has become whole in the frame before: it takes over before the next one is planned.
    whole_spare: bool,
    /// Counts what [`Backdrop::stamp`] tells apart.
    stamp: u64,
    depth: Image,
    pipeline: GraphicsPipeline,
    indices: Buffer,
    index_count: u32,
    frames: Vec<PerFrame>,
    smooth: Sampler,
    exact: Sampler,
    job: Option<Job>,
    selection: Selection,
    tiles: Vec<Drawn>,
    patches: Patches,
    wanted: Vec<Layer>,
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
        let image = |name, format, cube, usage| {
            Image::new(
                gpu,
                &ImageInfo {
                    name,
                    width: config.face,
                    height: config.face,
                    layers: 6,
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
                colour: image(colour, COLOUR, true, seen)?,
                distance: image(distance, DISTANCE, true, seen)?,
                layers: Vec::with_capacity(256),
                reference: 0,
                tainted: false,
            })
        };
        let cubes = [
            cube("backdrop colour", "backdrop distance")?,
            cube("spare backdrop colour", "spare backdrop distance")?,
        ];
        let depth = image("backdrop depth", DEPTH, false, vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT)?;
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
            Ok(PerFrame { scene, tiles, group, faces: [(0, 0); FACES] })
        };
        let (indices, index_count) = mesh_buffer(gpu, store.layout)?;
        let clamp = vk::SamplerAddressMode::CLAMP_TO_EDGE;
        Ok(Backdrop {
            config,
            cubes,
            front: 0,
            whole_spare: false,
            stamp: 0,
            depth,
            pipeline,
            indices,
            index_count,
            frames: (0..frames_in_flight).map(|_| per_frame()).collect::<Result<Vec<_>>>()?,
            smooth: Sampler::new(gpu, "backdrop, smooth", vk::Filter::LINEAR, clamp)?,
            exact: Sampler::new(gpu, "backdrop, exact", vk::Filter::NEAREST, clamp)?,
            job: None,
            selection: Selection::default(),
            tiles: Vec::with_capacity(1024),
            patches: Patches(Vec::with_capacity(4096)),
            wanted: Vec::with_capacity(config.layers),
        })
    }

    /// How it is made.
    pub fn config(&self) -> BackdropConfig {
        self.config
    }

    /// Index of the cubemap to draw.
    pub fn front(&self) -> usize {
        self.front
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
        &self.cubes[self.front].colour
    }

    /// The distance image of the cubemap in use: six layers, layout GENERAL, log2 of tiles of [`Backdrop::reference`].
    pub fn distance_image(&self) -> &Image {
        &self.cubes[self.front].distance
    }

    /// The level whose tiles the distances of the cubemap in use count.
    pub fn reference(&self) -> usize {
        self.cubes[self.front].reference
    }

    /// Level of the nearest whole layer of the cubemap in use: live tiles begin at the next one. None: it is empty.
    pub fn nearest(&self) -> Option<usize> {
        let cube = &self.cubes[self.front];
        cube.layers.last().map(|&(level, _)| level)
    }

    /// Keys of the layers of the cubemap in use, far to near.
    pub fn layers(&self) -> &[(usize, Corner)] {
        &self.cubes[self.front].layers
    }

    /// About how many texels of the layer being baked into the cubemap in use are still to come. None: nothing is
    /// being baked there.
    pub fn remaining(&self) -> Option<usize> {
        let job = self.job.as_ref().filter(|job| job.cube == self.front)?;
        let tiles = self.tiles[job.done..].iter();
        let sum: f64 = tiles.map(|tile| solid_angle(tile, &self.patches.0[tile.slot as usize])).sum();
        Some((sum * texels_per_steradian(self.config.face)) as usize)
    }

    /// A spare that has become whole takes over. Call it before the frame's live tiles are chosen: they begin where the
    /// cubemap in use ends.
    pub fn begin_frame(&mut self) {
        if std::mem::take(&mut self.whole_spare) {
            self.front = 1 - self.front;
            self.stamp += 1;
        }
    }

    /// Chooses what to bake next on the way to the layers `wanted` (far to near): one tile of one layer, then more up to
    /// `most_texels`. Asks `store` for its tiles. Call it once per submission, after the store's own begin of the frame.
    pub fn prepare(
        &mut self,
        index: usize,
        wanted: impl Iterator<Item = Layer>,
        most_texels: usize,
        (surface, look, detail): (&Surface, &Look, Detail),
        store: &mut TileStore,
    ) -> Baking {
        self.begin_frame();
        self.wanted.clear();
        self.wanted.extend(wanted);
        self.frames[index].faces = [(0, 0); FACES];
        let whole = Baking { whole: true, ..Baking::default() };
        if !self.choose(surface, detail) {
            return whole;
        }
        let Some(job) = &mut self.job else { return whole };
        let cube = &self.cubes[job.cube];
        let level = job.layer.0;
        let frame = &mut self.frames[index];
        let log_distance = cube.reference as f32 - level as f32;
        frame.scene.slice_mut()[0] =
            bake_uniform(look, level as f64 - START_LEVEL as f64, detail, log_distance);

        let per_steradian = texels_per_steradian(self.config.face);
        let mut batch = [(0 as Slot, 0usize); MOST_BATCH];
        let mut baking = Baking::default();
        for tile in job.done..self.tiles.len() {
            let patch = &self.patches.0[self.tiles[tile].slot as usize];
            let texels = baking.texels + (solid_angle(&self.tiles[tile], patch) * per_steradian) as usize;
            if baking.tiles > 0 && (baking.tiles >= MOST_BATCH || texels > most_texels) {
                break;
            }
            let Some(slot) = store.make_anyway(patch) else { break };
            batch[baking.tiles] = (slot, tile);
            baking = Baking { tiles: baking.tiles + 1, texels, whole: false };
        }
        let mut record = 0;
        let records: &mut [TileRecord] = frame.tiles.slice_mut();
        for (face, span) in frame.faces.iter_mut().enumerate() {
            let first = record;
            for &(slot, tile) in &batch[..baking.tiles] {
                let drawn = Drawn { slot, ..self.tiles[tile] };
                if touches_face(&drawn, face) {
                    records[record] = tile_record(&drawn, 1.0);
                    record += 1;
                }
            }
            *span = (first as u32, (record - first) as u32);
        }
        baking
    }

    /// Sees to it that there is a job, if something is wanted that is not there; false if nothing is. A job that is not
    /// wanted for the moment is kept: it may be again.
    fn choose(&mut self, surface: &Surface, detail: Detail) -> bool {
        let keys = |layer: &Layer| (layer.level, layer.key);
        // Far layers that are wanted no more are beyond the haze: they may stay.
        let begins = |cube: &Cube, wanted: &[Layer]| {
            let first = wanted.first().filter(|_| !cube.tainted)?;
            let at = cube.layers.iter().position(|&layer| layer == keys(first))?;
            let there = &cube.layers[at..];
            let same = there.len() <= wanted.len() && there.iter().zip(wanted).all(|(a, b)| *a == keys(b));
            same.then_some(there.len())
        };
        let in_front = begins(&self.cubes[self.front], &self.wanted);
        let spare = 1 - self.front;
        let (cube, next) = match in_front {
            Some(there) if there == self.wanted.len() => return false,
            Some(there) => (self.front, there),
            None => match begins(&self.cubes[spare], &self.wanted) {
                Some(there) => (spare, there),
                None => {
                    self.cubes[spare].layers.clear();
                    self.cubes[spare].tainted = false;
                    (spare, 0)
                }
            },
        };
        let Some(layer) = self.wanted.get(next).copied() else { return false };
        if self.job.as_ref().is_some_and(|job| job.cube == cube && job.layer == keys(&layer)) {
            return true;
        }
        let first_of_cube = self.cubes[cube].layers.is_empty();
        if first_of_cube && let Some(nearest) = self.wanted.last() {
            self.cubes[cube].reference = nearest.level;
        }
        if let Some(old) = &self.job
            && old.done > 0
        {
            self.cubes[old.cube].tainted = true;
        }
        if first_of_cube {
            self.cubes[cube].tainted = false;
        }
        self.job = Some(Job { cube, layer: keys(&layer), done: 0, first_of_cube });
        self.select(surface, detail, &layer);
        true
    }

    /// The tiles of a layer, nearest last.
    fn select(&mut self, surface: &Surface, detail: Detail, layer: &Layer) {
        let inner = Detail { split: detail.split - OVERLAP, ..detail };
        let view = View {
            root: &layer.root,
            head: layer.eye,
            levels: ROOT_UP + 1,
            live_from: ROOT_UP,
            detail: inner,
            frusta: None,
        };
        self.patches.0.clear();
        self.selection.select(surface, &view, &mut self.patches);
        self.tiles.clear();
        self.tiles.extend(self.selection.drawn.iter().filter(|tile| tile.level == ROOT_UP));
    }

    /// Records what [`Backdrop::prepare`] chose; the tiles must have been recorded before.
    pub fn record(&mut self, commands: Commands<'_>, index: usize, baking: Baking) {
        let Some(job) = &mut self.job else { return };
        let cube = &mut self.cubes[job.cube];
        let frame = &self.frames[index];
        let extent = vk::Extent2D { width: self.config.face, height: self.config.face };
        let begins = job.done == 0;
        commands.barrier(
            Access::FRAGMENT_READ | Access::COLOUR_WRITE | Access::DEPTH_WRITE,
            Access::COLOUR_WRITE | Access::DEPTH_WRITE,
        );
        for face in 0..FACES {
            let (first_tile, count) = frame.faces[face];
            if count == 0 && !begins {
                continue;
            }
            let clear = |load| if job.first_of_cube && begins { load } else { Load::Keep };
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
                    pass.draw_indexed(self.index_count, count);
                }
            });
        }
        commands.barrier(Access::COLOUR_WRITE, Access::FRAGMENT_READ | Access::COLOUR_WRITE);
        job.done += baking.tiles;
        if job.done >= self.tiles.len() {
            cube.layers.push(job.layer);
            if cube.layers.len() > 4 * KEPT {
                // A dive goes on for ever: what is known of far layers, beyond all haze, is forgotten.
                cube.layers.drain(..3 * KEPT);
            }
            let whole = self.wanted.last().is_some_and(|last| (last.level, last.key) == job.layer);
            self.whole_spare = whole && job.cube != self.front;
            self.stamp += u64::from(job.cube == self.front);
            self.job = None;
        }
    }
}

/// Texels of a cubemap per steradian, on average over the sphere.
fn texels_per_steradian(face: u32) -> f64 {
    6.0 * f64::from(face).powi(2) / (4.0 * std::f64::consts::PI)
}

/// About how many steradians a tile takes up, hidden parts included: its upright extent is seen across, its ground
/// plan at a grazing angle.
fn solid_angle(tile: &Drawn, patch: &Patch) -> f64 {
    let corners = [patch.rise(0, 0), patch.rise(1, 0), patch.rise(0, 1), patch.rise(1, 1)];
    let (low, high) = corners.iter().fold((i64::MAX, i64::MIN), |(l, h), &c| (l.min(c), h.max(c)));
    let upright = (high - low) as f64 / 65_536.0 + 0.25;
    let middle = middle(tile);
    let distance = f64::from(middle.length()).max(1.0);
    let grazing = (f64::from(middle.y) / distance).abs();
    (upright + grazing) / (distance * distance)
}

/// The middle of a tile, from the eye.
fn middle(tile: &Drawn) -> Vec3 {
    Vec3::new(0.5, 0.5 * (tile.slope[0] + tile.slope[1]), 0.5) - tile.head.as_vec3()
}

/// False if no part of a tile is seen through a face, by its bounding sphere.
fn touches_face(tile: &Drawn, face: usize) -> bool {
    let slope = Vec3::new(tile.slope[0], 0.0, tile.slope[1]).length();
    // Half a diagonal of the sloping tile, and what rises from its plane.
    let radius = 0.71 * (1.0 + slope * slope).sqrt() + 1.0;
    let axis = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z][face];
    let middle = middle(tile);
    let ahead = middle.dot(axis);
    let side = (middle - axis * ahead).abs();
    // Distance to the planes at 45 degrees.
    (side.max_element() - ahead) * std::f32::consts::FRAC_1_SQRT_2 <= radius
}
