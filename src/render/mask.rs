//! What nobody sees of the eyes' pictures, covered before anything else is drawn: what follows fails the depth test there.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;
use glam::{Mat4, Vec2};

use super::MASK_SHADER;
use super::layout::{EyePush, MaskCorner};
use super::target::TargetFormat;
use crate::gpu::{
    BindGroup, Buffer, BufferInfo, Commands, Gpu, GraphicsPipeline, Location, Program, Resource,
};

/// Covers triangles of each eye's picture.
pub struct MaskPass {
    pipeline: GraphicsPipeline,
    corners: u32,
    /// What the groups read.
    _buffer: Buffer,
    frames: Vec<PerFrame>,
}

struct PerFrame {
    lenses: Buffer,
    group: BindGroup,
}

impl MaskPass {
    /// A pass that covers these triangles, three corners each, left eye and right eye: tangents of the angles to the
    /// right and upwards. None where there are none.
    ///
    /// # Errors
    /// Out of memory.
    pub fn new(
        gpu: &Arc<Gpu>,
        triangles: &[Vec<Vec2>; 2],
        format: TargetFormat,
        frames_in_flight: usize,
    ) -> Result<Option<MaskPass>> {
        let corners: Vec<_> = (0..)
            .zip(triangles)
            .flat_map(|(eye, corners)| {
                corners.iter().map(move |c| MaskCorner { tangents: c.to_array(), eye, unused: 0 })
            })
            .collect();
        if corners.is_empty() {
            return Ok(None);
        }
        let program = Program::new(gpu, "mask", &[MASK_SHADER], &[])?;
        let vertex = ["mask_vertex", "mask_vertex_of_eye"];
        let covers = (vk::CompareOp::ALWAYS, true);
        let pipeline = GraphicsPipeline::new(&format.pipeline(&program, vertex, "mask_fragment", covers))?;
        let buffer = Buffer::with_data(gpu, "mask corners", vk::BufferUsageFlags::STORAGE_BUFFER, &corners)?;
        let per_frame = || -> Result<PerFrame> {
            let lenses = Buffer::new(
                gpu,
                &BufferInfo {
                    name: "mask lenses",
                    size: size_of::<[[f32; 4]; 2]>() as u64,
                    usage: vk::BufferUsageFlags::UNIFORM_BUFFER,
                    location: Location::Upload,
                },
            )?;
            let resources =
                [("mask_lenses", Resource::Buffer(&lenses)), ("mask_corners", Resource::Buffer(&buffer))];
            let group = program.bind_group(0, &resources)?;
            Ok(PerFrame { lenses, group })
        };
        let frames = (0..frames_in_flight).map(|_| per_frame()).collect::<Result<Vec<_>>>()?;
        Ok(Some(MaskPass { pipeline, corners: corners.len() as u32, _buffer: buffer, frames }))
    }

    /// Writes what the eyes of the frame in flight `index` project with. May be called after recording, until the frame
    /// is submitted.
    pub(super) fn set_lenses(&mut self, index: usize, clip_from_view: [Mat4; 2]) {
        self.frames[index].lenses.slice_mut().copy_from_slice(&clip_from_view.map(lens));
    }

    /// Draws, in a pass that has just begun; an eye is named where the pass is for one.
    pub(super) fn draw(&self, pass: &Commands<'_>, index: usize, eye: Option<u32>) {
        pass.bind(&self.pipeline, &[&self.frames[index].group]);
        pass.push(&self.pipeline, &EyePush { view: eye.unwrap_or(0), first_tile: 0 });
        pass.draw(self.corners, 1);
    }
}

/// What a projection makes of a point (x, y, −1), whose w it leaves at 1: x and y are scaled and shifted.
pub(super) fn lens(clip_from_view: Mat4) -> [f32; 4] {
    let [x, y, z] = [clip_from_view.x_axis, clip_from_view.y_axis, clip_from_view.z_axis];
    [x.x, y.y, -z.x, -z.y]
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Vec3, Vec4};

    #[test]
    fn a_lens_does_what_the_projection_does() {
        let projection = Mat4::from_cols(
            Vec4::new(1.1, 0.0, 0.0, 0.0),
            Vec4::new(0.0, -1.3, 0.0, 0.0),
            Vec4::new(-0.2, 0.1, 0.0, -1.0),
            Vec4::new(0.0, 0.0, 0.05, 0.0),
        );
        let [sx, sy, ox, oy] = lens(projection);
        for (x, y) in [(0.0, 0.0), (-1.1, 0.3), (0.5, -0.7)] {
            let clip = projection.project_point3(Vec3::new(x, y, -1.0)).truncate();
            assert!((clip - Vec2::new(x * sx + ox, y * sy + oy)).length() < 1e-6, "{x} {y}");
        }
    }
}
