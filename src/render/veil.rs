//! What spares the stomach: the field of view narrowed, all of it faded to black. Laid over the finished pictures.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;
use glam::{Mat4, Vec3};

use super::layout::{EyePush, VeilUniform};
use super::look::View;
use super::mask::lens;
use super::target::{EyeTarget, TargetFormat};
use super::{SRGB_SHADER, VEIL_SHADER};
use crate::aids::Vignette;
use crate::gpu::{
    Access, Attachment, BindGroup, Blend, Buffer, BufferInfo, Commands, Gpu, GraphicsInfo, GraphicsPipeline,
    Load, Location, Program, Resource, Target,
};

/// What darkens a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dark {
    /// The field of view is narrowed.
    pub vignette: Option<Vignette>,
    /// All of it is faded to black, 0 (not at all) to 1.
    pub fade: f32,
}

impl Dark {
    /// Whether there is anything to draw.
    pub fn is_any(&self) -> bool {
        self.fade > 0.0 || self.vignette.is_some_and(|vignette| vignette.strength > 0.0)
    }
}

/// Darkens the eyes' pictures, alpha included.
pub struct VeilPass {
    pipeline: GraphicsPipeline,
    multiview: bool,
    frames: Vec<PerFrame>,
}

struct PerFrame {
    veil: Buffer,
    group: BindGroup,
}

/// Vignettes less than this wide (radians) are taken for this wide.
const NARROWEST: f32 = 1e-3;

impl VeilPass {
    /// A pass over pictures of this format.
    ///
    /// # Errors
    /// Out of memory.
    pub fn new(gpu: &Arc<Gpu>, format: TargetFormat, frames_in_flight: usize) -> Result<VeilPass> {
        let program = Program::new(gpu, "veil", &[SRGB_SHADER, VEIL_SHADER], &[])?;
        let (vertex, view_mask) = match format.multiview {
            true => ("veil_vertex", 0b11),
            false => ("veil_vertex_of_eye", 0),
        };
        let fragment = if format.encode { "veil_fragment_encoded" } else { "veil_fragment" };
        let pipeline = GraphicsPipeline::new(&GraphicsInfo {
            view_mask,
            blend: Blend::Premultiplied,
            ..GraphicsInfo::new(&program, vertex, fragment, &[format.colour])
        })?;
        let per_frame = || -> Result<PerFrame> {
            let veil = Buffer::new(
                gpu,
                &BufferInfo {
                    name: "veil",
                    size: size_of::<VeilUniform>() as u64,
                    usage: vk::BufferUsageFlags::UNIFORM_BUFFER,
                    location: Location::Upload,
                },
            )?;
            let group = program.bind_group(0, &[("veil", Resource::Buffer(&veil))])?;
            Ok(PerFrame { veil, group })
        };
        let frames = (0..frames_in_flight).map(|_| per_frame()).collect::<Result<Vec<_>>>()?;
        Ok(VeilPass { pipeline, multiview: format.multiview, frames })
    }

    /// Writes how dark it is, and the eyes of the frame in flight `index`. May be called after recording, until the frame
    /// is submitted.
    pub fn set(&mut self, index: usize, dark: &Dark, views: &[View; 2]) {
        self.frames[index].veil.slice_mut()[0] = veil_uniform(dark, views);
    }

    /// Records the passes, over pictures that were just drawn. `commands` are outside any pass; only one eye's picture
    /// is darkened where that is the only one drawn.
    pub fn record(&self, commands: Commands<'_>, index: usize, target: &EyeTarget, only_eye: Option<u32>) {
        commands.barrier(Access::COLOUR_WRITE, Access::COLOUR_WRITE);
        if self.multiview {
            self.record_pass(commands, index, target.extent, target.colour, None);
            return;
        }
        for eye in (0..2u32).filter(|eye| only_eye.is_none_or(|only| only == *eye)) {
            self.record_pass(commands, index, target.extent, target.colour_of_eye[eye as usize], Some(eye));
        }
    }

    fn record_pass(
        &self,
        commands: Commands<'_>,
        index: usize,
        extent: vk::Extent2D,
        colour: vk::ImageView,
        eye: Option<u32>,
    ) {
        let colour = [Attachment::new(colour, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL, Load::Keep)];
        let view_mask = if eye.is_none() { 0b11 } else { 0 };
        commands.render(&Target { extent, view_mask, colour: &colour, depth: None }, |pass| {
            pass.bind(&self.pipeline, &[&self.frames[index].group]);
            pass.push(&self.pipeline, &EyePush { view: eye.unwrap_or(0), first_tile: 0 });
            pass.draw(3, 1);
        });
    }
}

fn veil_uniform(dark: &Dark, views: &[View; 2]) -> VeilUniform {
    let share = |v: f32| if v.is_nan() { 0.0 } else { v.clamp(0.0, 1.0) };
    let open = Vignette { inner: 0.0, outer: NARROWEST, strength: 0.0 };
    let Vignette { inner, outer, strength } = dark.vignette.unwrap_or(open);
    let ahead = ahead(&views.map(|view| view.scene_from_view));
    VeilUniform {
        lenses: views.map(|view| lens(view.clip_from_view)),
        ahead: ahead.map(|ahead| ahead.extend(0.0).to_array()),
        inner,
        outer: outer.max(inner + NARROWEST),
        strength: share(strength),
        fade: share(dark.fade),
    }
}

/// Where the head looks, which is the mean of where its eyes do, along the axes of each eye.
fn ahead(scene_from_view: &[Mat4; 2]) -> [Vec3; 2] {
    let [left, right] = scene_from_view.map(|eye| eye.transform_vector3(Vec3::NEG_Z));
    let ahead = (left + right).try_normalize().unwrap_or(left);
    scene_from_view.map(|eye| eye.transpose().transform_vector3(ahead))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;

    #[test]
    fn ahead_is_one_direction_for_both_eyes_however_they_are_turned() {
        let head = Quat::from_rotation_y(0.7) * Quat::from_rotation_x(-0.4);
        let canted = [0.2, -0.2].map(|turn| {
            Mat4::from_rotation_translation(head * Quat::from_rotation_y(turn), Vec3::new(turn, 0.0, 0.0))
        });
        let ahead = ahead(&canted);
        for (eye, ahead) in canted.iter().zip(ahead) {
            let seen = eye.transform_vector3(ahead);
            assert!(seen.distance(head * Vec3::NEG_Z) < 1e-5, "{seen}");
        }
        assert!((ahead[0].x - 0.2f32.sin()).abs() < 1e-5 && (ahead[1].x + 0.2f32.sin()).abs() < 1e-5);
    }

    #[test]
    fn nothing_is_drawn_where_nothing_is_dark() {
        let vignette = |strength| Some(Vignette { inner: 0.5, outer: 0.8, strength });
        assert!(!Dark::default().is_any());
        assert!(!Dark { vignette: vignette(0.0), fade: 0.0 }.is_any());
        assert!(Dark { vignette: vignette(0.1), fade: 0.0 }.is_any());
        assert!(Dark { vignette: None, fade: 0.01 }.is_any());
    }
}
