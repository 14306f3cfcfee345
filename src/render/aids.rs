//! What is drawn over the land for a person in a headset: hands, their rays, the arc of a step, the way back, the grid.
//!
//! Solids and lines, drawn after the land and tested against its depth. What covers the land has a depth of its own, so that
//! the runtime moves it with the head as it moves the land; lines behind the land show through it a little.

mod draft;

use std::sync::Arc;

use anyhow::Result;
use ash::vk;
use glam::Mat4;

use self::draft::{Draft, MOST_POINTS, MOST_SOLIDS};
use super::layout::{AidEye, AidPoint, AidSight, AidSolid, EyePush};
use super::look::Sight;
use super::target::TargetFormat;
use super::{AIDS_SHADER, SCENE_SHADER, SHOWN_SHADER, SRGB_SHADER};
use crate::aids::Aids;
use crate::gpu::{
    BindGroup, Blend, Buffer, BufferInfo, Commands, Constant, Gpu, GraphicsInfo, GraphicsPipeline, Location,
    Program, Resource,
};
use crate::world::Look;

/// Cells of a solid's mesh around it.
const AROUND: u32 = 32;

/// Cells of a solid's mesh along it: odd, half of the others at each end of a capsule.
const ALONG: u32 = 11;

/// The constants of the shader's prelude.
pub const AID_CONSTANTS: [(&str, Constant); 2] =
    [("AROUND", Constant::U32(AROUND)), ("ALONG", Constant::U32(ALONG))];

/// Where the play space is in a frame, and how large its pictures are.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    /// From metres of the play space from the seat.
    pub scene_from_play: Mat4,
    /// Pixels of each eye that are drawn.
    pub extent: vk::Extent2D,
}

/// Pipelines and shapes.
pub(super) struct AidsPass {
    solid: GraphicsPipeline,
    line_core: GraphicsPipeline,
    line_veil: GraphicsPipeline,
    line_hidden: GraphicsPipeline,
    indices: Buffer,
    frames: Vec<PerFrame>,
    draft: Draft,
}

struct PerFrame {
    sight: Buffer,
    solids: Buffer,
    points: Buffer,
    group: BindGroup,
    placed: Option<Placed>,
    n_solids: u32,
    /// Pairs of points that follow each other.
    n_segments: u32,
}

impl AidsPass {
    /// `scenes` are the frames' uniforms.
    pub(super) fn new<'a>(
        gpu: &Arc<Gpu>,
        format: TargetFormat,
        scenes: impl Iterator<Item = &'a Buffer>,
    ) -> Result<AidsPass> {
        let program = Program::new(
            gpu,
            "aids",
            &[SCENE_SHADER, SRGB_SHADER, SHOWN_SHADER, AIDS_SHADER],
            &AID_CONSTANTS,
        )?;
        let seen = vk::CompareOp::GREATER_OR_EQUAL;
        let line = |fragment, compare, write| {
            let vertex = ["aid_line_vertex", "aid_line_vertex_of_eye"];
            let base = format.pipeline(&program, vertex, fragment, (compare, write));
            GraphicsPipeline::new(&GraphicsInfo { blend: Blend::Alpha, ..base })
        };
        let vertex = ["solid_vertex", "solid_vertex_of_eye"];
        let solid = format.pipeline(&program, vertex, "solid_fragment", (seen, true));
        let per_frame = |scene| -> Result<PerFrame> {
            let upload = |name, size: usize, usage| {
                Buffer::new(gpu, &BufferInfo { name, size: size as u64, usage, location: Location::Upload })
            };
            let storage = vk::BufferUsageFlags::STORAGE_BUFFER;
            let sight =
                upload("sight of the aids", size_of::<AidSight>(), vk::BufferUsageFlags::UNIFORM_BUFFER)?;
            let solids = upload("solids", MOST_SOLIDS * size_of::<AidSolid>(), storage)?;
            let points = upload("points of lines", MOST_POINTS * size_of::<AidPoint>(), storage)?;
            let resources = [
                ("scene", Resource::Buffer(scene)),
                ("aids", Resource::Buffer(&sight)),
                ("solids", Resource::Buffer(&solids)),
                ("points", Resource::Buffer(&points)),
            ];
            let group = program.bind_group(0, &resources)?;
            Ok(PerFrame { sight, solids, points, group, placed: None, n_solids: 0, n_segments: 0 })
        };
        Ok(AidsPass {
            solid: GraphicsPipeline::new(&solid)?,
            line_core: line("aid_line_core", seen, true)?,
            line_veil: line("aid_line_veil", seen, false)?,
            line_hidden: line("aid_line_hidden", vk::CompareOp::LESS, false)?,
            indices: Buffer::with_data(gpu, "solid indices", vk::BufferUsageFlags::INDEX_BUFFER, &mesh())?,
            frames: scenes.map(per_frame).collect::<Result<Vec<_>>>()?,
            draft: Draft::default(),
        })
    }

    /// Writes what is drawn in the frame in flight `index`.
    pub(super) fn set(&mut self, index: usize, aids: &Aids, placed: &Placed) {
        self.draft.draw(aids);
        let (solids, points) = (self.draft.solids(), self.draft.points());
        let frame = &mut self.frames[index];
        frame.solids.slice_mut()[..solids.len()].copy_from_slice(solids);
        frame.points.slice_mut()[..points.len()].copy_from_slice(points);
        frame.n_solids = solids.len() as u32;
        frame.n_segments = points.len().saturating_sub(1) as u32;
        frame.placed = Some(*placed);
    }

    /// Writes the eyes and the light. May be called after recording, until the frame is submitted.
    pub(super) fn set_sight(&mut self, index: usize, look: &Look, sight: &Sight) {
        let frame = &mut self.frames[index];
        let Some(Placed { scene_from_play, extent }) = frame.placed else { return };
        let play_from_scene = scene_from_play.inverse();
        let eyes = sight.views.map(|view| {
            let play_from_view = play_from_scene * view.scene_from_view;
            // Two clip units across the picture, `x_axis.x` of them in a unit of tangent.
            let pixel = 2.0 / (view.clip_from_view.x_axis.x.abs() * extent.width.max(1) as f32);
            AidEye {
                clip_from_play: (view.clip_from_view * play_from_view.inverse()).to_cols_array_2d(),
                at: play_from_view.w_axis.truncate().to_array(),
                pixel,
            }
        });
        let turned = |direction: [f32; 3]| play_from_scene.transform_vector3(direction.into()).to_array();
        frame.sight.slice_mut()[0] = AidSight {
            eyes,
            sun: turned(look.sun_direction),
            up: turned([0.0, 1.0, 0.0]),
            ..AidSight::default()
        };
    }

    /// Draws, in a pass whose land and sky are drawn; an eye is named where the pass is for one.
    pub(super) fn draw(&self, pass: &Commands<'_>, index: usize, eye: Option<u32>) {
        let frame = &self.frames[index];
        let push = EyePush { view: eye.unwrap_or(0), first_tile: 0 };
        let lines = |pipeline: &GraphicsPipeline| {
            if frame.n_segments > 0 {
                pass.bind(pipeline, &[&frame.group]);
                pass.push(pipeline, &push);
                pass.draw(6, frame.n_segments);
            }
        };
        // First, while all that has a depth is the land.
        lines(&self.line_hidden);
        if frame.n_solids > 0 {
            pass.bind(&self.solid, &[&frame.group]);
            pass.push(&self.solid, &push);
            pass.index_buffer(&self.indices, vk::IndexType::UINT16);
            pass.draw_indexed_range(0, 6 * AROUND * ALONG, frame.n_solids);
        }
        lines(&self.line_core);
        lines(&self.line_veil);
    }
}

/// Triangles of a solid: its cells row by row, each row's last corners lying on its first ones.
fn mesh() -> Vec<u16> {
    let at = |row: u32, column: u32| (row * (AROUND + 1) + column) as u16;
    let cells = (0..ALONG).flat_map(|row| (0..AROUND).map(move |column| (row, column)));
    cells
        .flat_map(|(row, column)| {
            let (a, b) = (at(row, column), at(row, column + 1));
            let (c, d) = (at(row + 1, column), at(row + 1, column + 1));
            [a, b, c, b, d, c]
        })
        .collect()
}
