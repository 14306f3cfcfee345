//! Options for seeing how it works, as far as they need pipelines of their own; made when first asked for.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;
use glam::{Mat4, Quat, Vec3};

use super::backdrop::Backdrop;
use super::layout::{EyePush, Inspection, SlotLayout};
use super::target::TargetFormat;
use super::terrain::{SKY_VERTEX, TERRAIN_VERTEX, mesh_wires};
use super::tiles::TileStore;
use super::{
    HASH_SHADER, INSPECT_SHADER, SCENE_SHADER, SHOWN_SHADER, SKY_SHADER, SRGB_SHADER, Source, TERRAIN_SHADER,
    View,
};
use crate::gpu::{
    BindGroup, Buffer, BufferInfo, Commands, Gpu, GraphicsInfo, GraphicsPipeline, Location, Program, Resource,
};
use crate::inspect::{BackdropView, Inspect, LEVEL_COLOURS, SurfaceView};

/// The pieces of its program.
const PIECES: [Source<'static>; 7] =
    [HASH_SHADER, SCENE_SHADER, TERRAIN_SHADER, SKY_SHADER, SRGB_SHADER, SHOWN_SHADER, INSPECT_SHADER];

/// The share of the picture that the unfolded faces take.
const FACES_SHARE: f32 = 0.95;

/// The ground as a mesh of lines or in other colours, the backdrop tinted or unfolded.
pub(super) struct Inspector {
    pub(super) ground: GraphicsPipeline,
    pub(super) wireframe: GraphicsPipeline,
    pub(super) tinted: GraphicsPipeline,
    faces: GraphicsPipeline,
    /// Indices of lines, those of the skirts last.
    pub(super) wires: Buffer,
    wire_indices: u32,
    frames: Vec<PerFrame>,
}

struct PerFrame {
    inspection: Buffer,
    /// One for each cubemap of the backdrop.
    groups: [BindGroup; 2],
}

impl Inspector {
    /// `frames` are the uniforms and the tile records of the frames in flight.
    pub(super) fn new<'a>(
        gpu: &Arc<Gpu>,
        (store, backdrop): (&TileStore, &Backdrop),
        format: TargetFormat,
        frames: impl Iterator<Item = [&'a Buffer; 2]>,
    ) -> Result<Inspector> {
        let program = Program::new(gpu, "inspect", &PIECES, &store.layout.constants())?;
        let ground = GraphicsInfo {
            cull: vk::CullModeFlags::BACK,
            ..format.pipeline(&program, TERRAIN_VERTEX, "inspect_fragment", (vk::CompareOp::GREATER, true))
        };
        let on_sky = |fragment, compare| {
            GraphicsPipeline::new(&format.pipeline(&program, SKY_VERTEX, fragment, (compare, false)))
        };
        let per_frame = |[scene, tiles]: [&'a Buffer; 2]| -> Result<PerFrame> {
            let inspection = Buffer::new(
                gpu,
                &BufferInfo {
                    name: "inspection",
                    size: size_of::<Inspection>() as u64,
                    usage: vk::BufferUsageFlags::UNIFORM_BUFFER,
                    location: Location::Upload,
                },
            )?;
            let group = |cube| {
                let [colour, distance, smooth, exact] = backdrop.resources(cube);
                let resources = [
                    ("scene", Resource::Buffer(scene)),
                    ("tiles", Resource::Buffer(tiles)),
                    ("slots", Resource::Buffer(&store.slots)),
                    ("inspection", Resource::Buffer(&inspection)),
                    colour,
                    distance,
                    smooth,
                    exact,
                ];
                program.bind_group(0, &resources)
            };
            let groups = [group(0)?, group(1)?];
            Ok(PerFrame { inspection, groups })
        };
        let wires = mesh_wires(store.layout);
        Ok(Inspector {
            ground: GraphicsPipeline::new(&ground)?,
            wireframe: GraphicsPipeline::new(&GraphicsInfo {
                topology: vk::PrimitiveTopology::LINE_LIST,
                ..ground
            })?,
            tinted: on_sky("tinted_fragment", vk::CompareOp::GREATER_OR_EQUAL)?,
            faces: on_sky("faces_fragment", vk::CompareOp::ALWAYS)?,
            wires: Buffer::with_data(gpu, "wire indices", vk::BufferUsageFlags::INDEX_BUFFER, &wires)?,
            wire_indices: wires.len() as u32,
            frames: frames.map(per_frame).collect::<Result<Vec<_>>>()?,
        })
    }

    /// Whether there is anything to do for it.
    pub(super) fn is_wanted(inspect: &Inspect) -> bool {
        let backdrop = matches!(inspect.backdrop, BackdropView::Tinted | BackdropView::Faces);
        inspect.wireframe || backdrop || Inspector::colours(inspect)
    }

    /// Whether the ground has other colours than usual.
    pub(super) fn colours(inspect: &Inspect) -> bool {
        inspect.levels || inspect.surface != SurfaceView::Lit
    }

    /// Indices of a tile's lines, with those of its skirts or without.
    pub(super) fn wire_indices(&self, layout: SlotLayout, skirts: bool) -> u32 {
        if skirts { self.wire_indices } else { self.wire_indices - wires_of_skirts(layout) }
    }

    /// What its pipelines read.
    pub(super) fn group(&self, index: usize, cube: usize) -> &BindGroup {
        &self.frames[index].groups[cube]
    }

    /// Writes the uniform of the frame in flight `index`.
    pub(super) fn set(&mut self, index: usize, inspect: &Inspect, views: &[View; 2]) {
        let head_from_scene = head_from_scene(views);
        let palette = LEVEL_COLOURS.map(|[r, g, b]| [r, g, b, 255].map(|part| f32::from(part) / 255.0));
        self.frames[index].inspection.slice_mut()[0] = Inspection {
            palette,
            head_from_scene: Mat4::from_quat(head_from_scene).to_cols_array_2d(),
            surface: match inspect.surface {
                SurfaceView::Lit => 0,
                SurfaceView::Normals => 1,
                SurfaceView::Slopes => 2,
                SurfaceView::Depth => 3,
            },
            levels: u32::from(inspect.levels),
            face: FACES_SHARE * face_side(head_from_scene, views),
            unused: 0,
        };
    }

    /// Draws the unfolded faces over all else; an eye is named where the pass is for one.
    pub(super) fn draw_faces(&self, pass: &Commands<'_>, index: usize, cube: usize, eye: Option<u32>) {
        pass.bind(&self.faces, &[self.group(index, cube)]);
        pass.push(&self.faces, &EyePush { view: eye.unwrap_or(0), first_tile: 0 });
        pass.draw(3, 1);
    }
}

/// Between the two eyes' orientations.
fn head_from_scene(views: &[View; 2]) -> Quat {
    let [left, right] = views.map(|view| Quat::from_mat4(&view.scene_from_view));
    left.slerp(right, 0.5).inverse()
}

/// The largest side of a face, as a tangent, that lets four beside and three above each other be seen whole by both eyes.
fn face_side(head_from_scene: Quat, views: &[View; 2]) -> f32 {
    let corners = |view: &View| {
        let (view_from_clip, turn) = (view.clip_from_view.inverse(), Quat::from_mat4(&view.scene_from_view));
        [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)].map(|(x, y)| {
            let ahead = head_from_scene * (turn * view_from_clip.project_point3(Vec3::new(x, y, 1.0)));
            (ahead.truncate() / -ahead.z).abs()
        })
    };
    let least = views.iter().flat_map(corners).reduce(|a, b| a.min(b)).unwrap_or_default();
    (least.x / 2.0).min(least.y / 1.5)
}

/// Indices of the lines of a tile's skirts.
fn wires_of_skirts(layout: SlotLayout) -> u32 {
    4 * (4 * layout.mesh + 2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::terrain::tile::Cells;

    #[test]
    fn the_wires_of_skirts_come_last_and_are_counted() {
        for mesh in [2, 16, 32] {
            let layout = SlotLayout { cells: Cells::N32, mesh };
            let wires = mesh_wires(layout);
            let grid = (mesh + 1).pow(2) as u16;
            let of_skirts = wires.chunks_exact(2).filter(|line| line.iter().any(|&v| v >= grid));
            assert_eq!(2 * of_skirts.count() as u32, wires_of_skirts(layout));
            let first = wires.iter().position(|&v| v >= grid).unwrap_or(0) as u32 & !1;
            assert_eq!(wires.len() as u32 - first, wires_of_skirts(layout));
            // Every edge of the grid once: along x, along z, and the diagonals.
            assert_eq!(first, 2 * (2 * mesh * (mesh + 1) + mesh * mesh));
        }
    }

    #[test]
    fn faces_fit_into_what_both_eyes_see() {
        let lens = |across: f32, up: f32| {
            Mat4::from_cols_array(&[
                1.0 / across,
                0.0,
                0.0,
                0.0,
                0.0,
                -1.0 / up,
                0.0,
                0.0,
                0.0,
                0.0,
                0.0,
                -1.0,
                0.0,
                0.0,
                0.05,
                0.0,
            ])
        };
        let view = |across, up| View { scene_from_view: Mat4::IDENTITY, clip_from_view: lens(across, up) };
        let head = head_from_scene(&[view(1.0, 1.0), view(1.0, 1.0)]);
        let side = face_side(head, &[view(1.0, 1.0), view(0.8, 0.9)]);
        assert!((side - 0.4).abs() < 1e-5, "{side}");
        let side = face_side(head, &[view(2.0, 0.6), view(2.0, 0.6)]);
        assert!((side - 0.4).abs() < 1e-5, "{side}");
    }
}
