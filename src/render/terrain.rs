//! The terrain and the sky behind it: one instanced indirect draw for all tiles, both eyes in one pass or a pass each.

use super::aids::{AidsPass, Placed};
use super::backdrop::Backdrop;
use super::inspect::Inspector;
use super::layout::{EyePush, SceneUniform, SlotLayout, TileRecord};
use super::lines::{LinesPass, Selected};
use super::look::{Sight, scene_uniform};
use super::mask::MaskPass;
use super::target::{self, EyeTarget, SampleImages, TargetFormat};
use super::tiles::TileStore;
use super::{HASH_SHADER, SCENE_SHADER, SKY_SHADER, TERRAIN_SHADER};
use crate::aids::Aids;
use crate::gpu::{
    BindGroup, Buffer, BufferInfo, Commands, Gpu, GraphicsInfo, GraphicsPipeline, Load, Location, Program,
    Resource,
};
use crate::inspect::{BackdropView, Inspect, SurfaceView};
use crate::terrain::morph::Corners;
use crate::terrain::select::{Drawn, Selection};
use crate::world::Look;
use anyhow::Result;
use ash::vk;
use glam::{DVec3, Vec2};
use std::sync::Arc;

/// How pixels are shaded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shading {
    /// Light, air and sky.
    Full,
    /// Light grey by slope on this background, with neither air nor sky: what shows through is a hole.
    Holes([f32; 4]),
}

/// What is behind the tiles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Behind {
    /// The sky, and before it the backdrop's cubemap of this index.
    Sky(usize),
    /// Nothing: colour, alpha and depth are 0 where there is no tile. The rest is 1 in alpha.
    Open,
}

/// The vertex entries of terrain.wgsl and sky.wgsl: for both eyes in one pass, and for one.
pub(super) const TERRAIN_VERTEX: [&str; 2] = ["terrain_vertex", "terrain_vertex_of_eye"];
pub(super) const SKY_VERTEX: [&str; 2] = ["sky_vertex", "sky_vertex_of_eye"];

/// Pipelines and buffers of the terrain and the sky.
pub struct TerrainPass {
    format: TargetFormat,
    /// Where a pixel has several samples.
    samples: Option<SampleImages>,
    terrain: GraphicsPipeline,
    sky: GraphicsPipeline,
    indices: Buffer,
    layout: SlotLayout,
    frames: Vec<PerFrame>,
    most_tiles: usize,
    inspect: Inspect,
    /// What some of the options of `inspect` need, once one of them has been asked for.
    inspector: Option<Inspector>,
    lines: Option<LinesPass>,
    /// What hands and ways are drawn with, once there are any.
    aids: Option<AidsPass>,
    /// How pixels are shaded.
    pub shading: Shading,
    /// Where eyes are drawn one by one, only this one is: the other's picture keeps what it held.
    pub only_eye: Option<u32>,
    /// What is covered, since nobody sees it.
    mask: Option<MaskPass>,
}

struct PerFrame {
    scene: Buffer,
    tiles: Buffer,
    draw: Buffer,
    /// One for each cubemap of the backdrop.
    groups: [BindGroup; 2],
}

impl TerrainPass {
    /// A pass that draws the tiles of `store`, at most `most_tiles` of them, for eyes of at most `most` pixels.
    ///
    /// # Errors
    /// Out of memory.
    pub fn new(
        gpu: &Arc<Gpu>,
        store: &TileStore,
        backdrop: &Backdrop,
        most_tiles: usize,
        (format, most): (TargetFormat, vk::Extent2D),
        frames_in_flight: usize,
    ) -> Result<TerrainPass> {
        let layout = store.layout;
        let program = Program::new(
            gpu,
            "terrain",
            &[HASH_SHADER, SCENE_SHADER, TERRAIN_SHADER, SKY_SHADER],
            &layout.constants(),
        )?;
        let terrain = GraphicsPipeline::new(&GraphicsInfo {
            cull: vk::CullModeFlags::BACK,
            front: vk::FrontFace::COUNTER_CLOCKWISE,
            ..format.pipeline(&program, TERRAIN_VERTEX, "terrain_fragment", (vk::CompareOp::GREATER, true))
        })?;
        // At depth 0, where no tile was drawn.
        let behind = (vk::CompareOp::GREATER_OR_EQUAL, false);
        let sky = GraphicsPipeline::new(&format.pipeline(&program, SKY_VERTEX, "sky_fragment", behind))?;
        let (indices, _) = mesh_buffer(gpu, layout)?;
        let upload = |name, size: usize, usage| {
            Buffer::new(gpu, &BufferInfo { name, size: size as u64, usage, location: Location::Upload })
        };
        let per_frame = || -> Result<PerFrame> {
            let scene = upload("scene", size_of::<SceneUniform>(), vk::BufferUsageFlags::UNIFORM_BUFFER)?;
            let tiles = upload(
                "drawn tiles",
                most_tiles * size_of::<TileRecord>(),
                vk::BufferUsageFlags::STORAGE_BUFFER,
            )?;
            let draw =
                upload("draw arguments", size_of::<[u32; 5]>(), vk::BufferUsageFlags::INDIRECT_BUFFER)?;
            let group = |cube| {
                let [colour, distance, smooth, exact] = backdrop.resources(cube);
                let resources = [
                    ("scene", Resource::Buffer(&scene)),
                    ("tiles", Resource::Buffer(&tiles)),
                    ("slots", Resource::Buffer(&store.slots)),
                    colour,
                    distance,
                    smooth,
                    exact,
                ];
                program.bind_group(0, &resources)
            };
            let groups = [group(0)?, group(1)?];
            Ok(PerFrame { scene, tiles, draw, groups })
        };
        Ok(TerrainPass {
            format,
            samples: SampleImages::new(gpu, &format, most)?,
            terrain,
            sky,
            indices,
            layout,
            frames: (0..frames_in_flight).map(|_| per_frame()).collect::<Result<Vec<_>>>()?,
            most_tiles,
            inspect: Inspect::default(),
            inspector: None,
            lines: None,
            aids: None,
            shading: Shading::Full,
            only_eye: None,
            mask: None,
        })
    }

    /// From now on these triangles of each eye's picture are covered, as [`MaskPass::new`] takes them. No frame may be in
    /// flight.
    ///
    /// # Errors
    /// Out of memory.
    pub fn set_mask(
        &mut self,
        gpu: &Arc<Gpu>,
        triangles: &[Vec<Vec2>; 2],
        frames_in_flight: usize,
    ) -> Result<()> {
        self.mask = MaskPass::new(gpu, triangles, self.format, frames_in_flight)?;
        Ok(())
    }

    /// Takes over from the pass before it what does not depend on the tiles. No frame may be in flight.
    pub fn follow(&mut self, before: &mut TerrainPass) {
        self.mask = before.mask.take().filter(|_| before.format == self.format);
        (self.shading, self.only_eye) = (before.shading, before.only_eye);
    }

    /// From now on frames are drawn with these options. `store` and `backdrop` are those that it was made with.
    ///
    /// # Errors
    /// Out of memory for what an option needs; then nothing has changed.
    pub fn set_inspect(
        &mut self,
        gpu: &Arc<Gpu>,
        store: &TileStore,
        backdrop: &Backdrop,
        inspect: &Inspect,
    ) -> Result<()> {
        if self.inspector.is_none() && Inspector::is_wanted(inspect) {
            let frames = self.frames.iter().map(|frame| [&frame.scene, &frame.tiles]);
            self.inspector = Some(Inspector::new(gpu, (store, backdrop), self.format, frames)?);
        }
        if self.lines.is_none() && has_lines(inspect) {
            let scenes = self.frames.iter().map(|frame| &frame.scene);
            self.lines = Some(LinesPass::new(gpu, self.most_tiles, self.format, scenes)?);
        }
        self.inspect = *inspect;
        Ok(())
    }

    /// Makes what hands and ways are drawn with, so that the first frame with one of them does not wait for it.
    ///
    /// # Errors
    /// Out of memory.
    pub fn prepare_aids(&mut self, gpu: &Arc<Gpu>) -> Result<()> {
        if self.aids.is_none() {
            let scenes = self.frames.iter().map(|frame| &frame.scene);
            self.aids = Some(AidsPass::new(gpu, self.format, scenes)?);
        }
        Ok(())
    }

    /// Writes what is drawn over the land in the frame in flight `index`.
    ///
    /// # Errors
    /// Out of memory, the first time that there is something.
    pub fn set_aids(&mut self, gpu: &Arc<Gpu>, index: usize, aids: &Aids, placed: &Placed) -> Result<()> {
        if aids.has_shapes() {
            self.prepare_aids(gpu)?;
        }
        if let Some(pass) = &mut self.aids {
            pass.set(index, aids, placed);
        }
        Ok(())
    }

    /// Triangles of one tile, skirts included where there are such.
    pub fn triangles_per_tile(&self) -> u32 {
        if self.inspect.wireframe { 0 } else { self.mesh_indices() / 3 }
    }

    fn mesh_indices(&self) -> u32 {
        triangle_indices(self.layout, self.inspect.skirts)
    }

    /// Writes the tiles to draw into the buffers of the frame in flight `index`. `root_m` is the size in metres of
    /// a tile of the selection's root level; the viewer has moved by so many of those tiles since the selection.
    pub fn set_tiles(&mut self, index: usize, drawn: &[Drawn], root_m: f64, moved: DVec3) {
        let indices = match &self.inspector {
            Some(inspector) if self.inspect.wireframe => {
                inspector.wire_indices(self.layout, self.inspect.skirts)
            }
            _ => self.mesh_indices(),
        };
        let morph = self.inspect.morph;
        let frame = &mut self.frames[index];
        let count = drawn.len().min(self.most_tiles);
        let records: &mut [TileRecord] = frame.tiles.slice_mut();
        for (record, tile) in records.iter_mut().zip(&drawn[..count]) {
            let level = (1u64 << tile.level) as f64;
            let tile = Drawn {
                head: tile.head + moved * level,
                corners: if morph { tile.corners } else { Corners::FINE },
                ..*tile
            };
            *record = tile_record(&tile, root_m / level);
        }
        frame.draw.slice_mut::<u32>().copy_from_slice(&[indices, count as u32, 0, 0, 0]);
    }

    /// Writes the lines that the options ask for into the buffers of the frame in flight `index`.
    pub fn set_lines(&mut self, index: usize, selection: &Selection, selected: &Selected) {
        if let Some(lines) = self.lines.as_mut().filter(|_| has_lines(&self.inspect)) {
            lines.set(index, &self.inspect, selection, selected);
        }
    }

    /// Writes the eyes, the light and the air. May be called after recording, until the frame is submitted: so late
    /// can the eyes be located.
    pub fn set_sight(&mut self, index: usize, look: &Look, sight: &Sight) {
        let flat = self.shading != Shading::Full;
        self.frames[index].scene.slice_mut()[0] = scene_uniform(look, sight, self.format.encode, flat);
        if let Some(mask) = &mut self.mask {
            mask.set_lenses(index, sight.views.map(|view| view.clip_from_view));
        }
        if let Some(aids) = &mut self.aids {
            aids.set_sight(index, look, sight);
        }
        if let Some(inspector) = self.inspector.as_mut().filter(|_| Inspector::is_wanted(&self.inspect)) {
            inspector.set(index, &self.inspect, &sight.views);
        }
    }

    /// Records the passes. `commands` are outside any pass.
    pub fn record(&self, commands: Commands<'_>, index: usize, behind: Behind, target: &EyeTarget) {
        if self.format.multiview {
            self.record_pass(commands, (index, behind), target, None);
        } else {
            for eye in (0..2u32).filter(|eye| self.only_eye.is_none_or(|only| only == *eye)) {
                self.record_pass(commands, (index, behind), target, Some(eye));
            }
        }
    }

    fn record_pass(
        &self,
        commands: Commands<'_>,
        (index, behind): (usize, Behind),
        target: &EyeTarget,
        eye: Option<u32>,
    ) {
        let plain = plain_ground(&self.inspect);
        let background = match (self.shading, plain, behind) {
            (Shading::Holes(colour), ..) => Load::Colour(colour),
            (_, Some(grey), _) => Load::Colour(self.format.grey(grey)),
            (_, None, Behind::Sky(_)) => Load::Discard,
            (_, None, Behind::Open) => Load::Colour([0.0; 4]),
        };
        let frame = &self.frames[index];
        let push = EyePush { view: eye.unwrap_or(0), first_tile: 0 };
        // The tiles need neither cubemap.
        let cube = if let Behind::Sky(cube) = behind { cube } else { 0 };
        target::render(commands, (target, self.samples.as_ref()), eye, background, |pass| {
            if let Some(mask) = &self.mask {
                mask.draw(&pass, index, eye);
            }
            let (terrain, group, indices) = self.ground(index, cube);
            pass.bind(terrain, &[group]);
            pass.push(terrain, &push);
            pass.index_buffer(indices, vk::IndexType::UINT16);
            pass.draw_indexed_indirect(&frame.draw, 0, 1);
            if behind != Behind::Open && plain.is_none() {
                let (sky, group) = self.sky(index, cube);
                pass.bind(sky, &[group]);
                pass.push(sky, &push);
                pass.draw(3, 1);
            }
            if let Some(lines) = self.lines.as_ref().filter(|_| has_lines(&self.inspect)) {
                lines.draw(&pass, index, eye);
            }
            if let Some(inspector) = self.inspecting(|inspect| inspect.backdrop == BackdropView::Faces) {
                inspector.draw_faces(&pass, index, cube, eye);
            }
            if let Some(aids) = &self.aids {
                aids.draw(&pass, index, eye);
            }
        });
    }

    /// What draws otherwise than usual, where that is so.
    fn inspecting(&self, so: impl Fn(&Inspect) -> bool) -> Option<&Inspector> {
        self.inspector.as_ref().filter(|_| so(&self.inspect))
    }

    /// What draws the tiles: pipeline, group, indices.
    fn ground(&self, index: usize, cube: usize) -> (&GraphicsPipeline, &BindGroup, &Buffer) {
        if let Some(inspector) = self.inspecting(|inspect| inspect.wireframe) {
            return (&inspector.wireframe, inspector.group(index, cube), &inspector.wires);
        }
        match self.inspecting(Inspector::colours) {
            Some(inspector) if self.shading == Shading::Full => {
                (&inspector.ground, inspector.group(index, cube), &self.indices)
            }
            _ => (&self.terrain, &self.frames[index].groups[cube], &self.indices),
        }
    }

    /// What draws the sky: pipeline, group.
    fn sky(&self, index: usize, cube: usize) -> (&GraphicsPipeline, &BindGroup) {
        match self.inspecting(|inspect| inspect.backdrop == BackdropView::Tinted) {
            Some(inspector) if self.shading == Shading::Full => {
                (&inspector.tinted, inspector.group(index, cube))
            }
            _ => (&self.sky, &self.frames[index].groups[cube]),
        }
    }
}

/// Whether lines are drawn.
fn has_lines(inspect: &Inspect) -> bool {
    inspect.boxes || inspect.patches || inspect.frusta
}

/// What is behind the tiles where neither backdrop nor sky is: a grey, 0..=1 of sRGB.
fn plain_ground(inspect: &Inspect) -> Option<f32> {
    // There the depth buffer holds 0.
    let grey = if inspect.surface == SurfaceView::Depth { 0.0 } else { 0.13 };
    inspect.on_plain_ground().then_some(grey)
}

/// The tile in the shader's words; `size` is its side in metres (or whatever the pass's unit is).
pub(super) fn tile_record(tile: &Drawn, size: f64) -> TileRecord {
    TileRecord {
        origin: (-tile.head * size).as_vec3().to_array(),
        size: size as f32,
        slope: tile.slope,
        slot: tile.slot,
        corners: tile.corners.0,
        x: tile.corner.x,
        z: tile.corner.z,
        c: tile.c,
        level: tile.corner.level,
    }
}

/// Indices of the triangles of a tile, with those of its skirts or without.
fn triangle_indices(layout: SlotLayout, skirts: bool) -> u32 {
    let mesh = layout.mesh;
    6 * mesh * mesh + if skirts { 4 * 6 * mesh } else { 0 }
}

/// The indices of a tile's mesh, and how many there are.
pub(super) fn mesh_buffer(gpu: &Arc<Gpu>, layout: SlotLayout) -> Result<(Buffer, u32)> {
    let mesh = mesh_indices(layout);
    let buffer = Buffer::with_data(gpu, "mesh indices", vk::BufferUsageFlags::INDEX_BUFFER, &mesh)?;
    Ok((buffer, mesh.len() as u32))
}

/// The edges of the same triangles, each once: those of the skirts last.
pub(super) fn mesh_wires(layout: SlotLayout) -> Vec<u16> {
    let mesh = layout.mesh;
    let side = mesh + 1;
    let at = |i: u32, j: u32| (j * side + i) as u16;
    let mut wires = Vec::with_capacity((6 * mesh * side + 4 * (4 * mesh + 2)) as usize);
    for j in 0..side {
        for i in 0..side {
            let (right, down) = (i < mesh, j < mesh);
            if right {
                wires.extend([at(i, j), at(i + 1, j)]);
            }
            if down {
                wires.extend([at(i, j), at(i, j + 1)]);
            }
            if right && down {
                wires.extend([at(i + 1, j), at(i, j + 1)]);
            }
        }
    }
    let hanging = |edge: u32, k: u32| (side * side + edge * side + k) as u16;
    for k in 0..side {
        for (edge, on_edge) in [at(k, 0), at(k, mesh), at(0, k), at(mesh, k)].into_iter().enumerate() {
            let edge = edge as u32;
            wires.extend([on_edge, hanging(edge, k)]);
            if k < mesh {
                wires.extend([hanging(edge, k), hanging(edge, k + 1)]);
            }
        }
    }
    wires
}

/// Triangles of a tile's mesh: the grid, quads split from (1, 0) to (0, 1), then a skirt along each side, facing outwards.
fn mesh_indices(layout: SlotLayout) -> Vec<u16> {
    let mesh = layout.mesh;
    let side = mesh + 1;
    let at = |i: u32, j: u32| (j * side + i) as u16;
    let hanging = |edge: u32, k: u32| (side * side + edge * side + k) as u16;
    let mut indices = Vec::with_capacity((mesh * mesh * 6 + 4 * mesh * 6) as usize);
    for j in 0..mesh {
        for i in 0..mesh {
            let (a, b, c, d) = (at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1));
            indices.extend([a, c, b, b, c, d]);
        }
    }
    for k in 0..mesh {
        let edges = [
            (at(k, 0), at(k + 1, 0), 0, false),
            (at(k, mesh), at(k + 1, mesh), 1, true),
            (at(0, k), at(0, k + 1), 2, true),
            (at(mesh, k), at(mesh, k + 1), 3, false),
        ];
        for (a, b, edge, flip) in edges {
            let (c, d) = (hanging(edge, k), hanging(edge, k + 1));
            if flip {
                indices.extend([a, c, b, b, c, d]);
            } else {
                indices.extend([a, b, c, b, d, c]);
            }
        }
    }
    indices
}
