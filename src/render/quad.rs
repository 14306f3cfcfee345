//! A picture that hangs before the wearer, drawn into a layer of the runtime's own, over the eyes' pictures, or over their
//! copies for the window. The twin of `shaders/quad.wgsl`.
//!
//! It is over the land wherever that is, as a layer of the runtime's would be: there is no depth test, so that what is
//! worked with is never behind a hill. From behind there is nothing, as of a layer.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;
use glam::Mat4;

use super::layout::{HungUniform, QuadPush};
use super::target::{EyeTarget, TargetFormat};
use super::{QUAD_SHADER, SRGB_SHADER};
use crate::gpu::{
    Access, Attachment, BindGroup, Blend, Buffer, BufferInfo, Commands, Gpu, GraphicsInfo, GraphicsPipeline,
    Image, Load, Location, Program, Resource, Sampler, Target, Transition,
};

/// Corners of two triangles.
const CORNERS: u32 = 6;

/// Draws a picture where it hangs.
pub struct QuadPass {
    alone: GraphicsPipeline,
    in_eyes: GraphicsPipeline,
    in_mirror: GraphicsPipeline,
    multiview: bool,
    /// The eyes' format encodes sRGB by itself.
    linear: bool,
    /// What it shows, once there is something.
    picture: Option<BindGroup>,
    frames: Vec<PerFrame>,
    sampler: Sampler,
    program: Arc<Program>,
}

struct PerFrame {
    hung: Buffer,
    group: BindGroup,
}

impl QuadPass {
    /// For eyes of this format, and for copies of them of the format `mirror`, which does not encode. Nothing is drawn
    /// before [`QuadPass::show`].
    ///
    /// # Errors
    /// Out of memory.
    pub fn new(
        gpu: &Arc<Gpu>,
        format: TargetFormat,
        mirror: vk::Format,
        frames_in_flight: usize,
    ) -> Result<QuadPass> {
        let program = Program::new(gpu, "quad", &[SRGB_SHADER, QUAD_SHADER], &[])?;
        let sampler = Sampler::new(gpu, "quad", vk::Filter::LINEAR, vk::SamplerAddressMode::CLAMP_TO_EDGE)?;
        let (vertex, view_mask) = match format.multiview {
            true => ("quad_vertex", 0b11),
            false => ("quad_vertex_of_eye", 0),
        };
        let over = |colour| {
            GraphicsPipeline::new(&GraphicsInfo {
                view_mask,
                blend: Blend::Premultiplied,
                cull: vk::CullModeFlags::BACK,
                front: vk::FrontFace::COUNTER_CLOCKWISE,
                ..GraphicsInfo::new(&program, vertex, "quad_fragment", &[colour])
            })
        };
        let alone = [format.colour];
        let per_frame = || -> Result<PerFrame> {
            let hung = Buffer::new(
                gpu,
                &BufferInfo {
                    name: "hung",
                    size: size_of::<HungUniform>() as u64,
                    usage: vk::BufferUsageFlags::UNIFORM_BUFFER,
                    location: Location::Upload,
                },
            )?;
            let group = program.bind_group(1, &[("hung", Resource::Buffer(&hung))])?;
            Ok(PerFrame { hung, group })
        };
        Ok(QuadPass {
            alone: GraphicsPipeline::new(&GraphicsInfo::new(
                &program,
                "quad_vertex_alone",
                "quad_fragment",
                &alone,
            ))?,
            in_eyes: over(format.colour)?,
            in_mirror: over(mirror)?,
            multiview: format.multiview,
            linear: !format.encode,
            picture: None,
            frames: (0..frames_in_flight).map(|_| per_frame()).collect::<Result<Vec<_>>>()?,
            sampler,
            program,
        })
    }

    /// Shows `picture` from now on, which is in SHADER_READ_ONLY_OPTIMAL and outlives this. No frame in flight shows
    /// another one.
    ///
    /// # Errors
    /// Out of memory.
    pub fn show(&mut self, picture: &Image) -> Result<()> {
        let layout = vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL;
        let resources = [
            ("quad_picture", Resource::Texture(picture.view, layout)),
            ("quad_sampler", Resource::Sampler(&self.sampler)),
        ];
        self.picture = Some(self.program.bind_group(0, &resources)?);
        Ok(())
    }

    /// Writes where the picture is for the eyes of the frame in flight `index`: from (right, up, 0), −1/2 to 1/2 over it.
    /// May be called after recording, until the frame is submitted.
    pub fn set(&mut self, index: usize, clip_from_picture: [Mat4; 2]) {
        let hung = HungUniform { clip_from_picture: clip_from_picture.map(|m| m.to_cols_array_2d()) };
        self.frames[index].hung.slice_mut()[0] = hung;
    }

    /// Draws all of a layer of its own, in the eyes' format. `commands` are outside any pass.
    pub fn record_alone(
        &self,
        commands: Commands<'_>,
        index: usize,
        view: vk::ImageView,
        extent: vk::Extent2D,
    ) {
        let layout = vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL;
        let colour = [Attachment::new(view, layout, Load::Discard)];
        commands.render(&Target { extent, view_mask: 0, colour: &colour, depth: None }, |pass| {
            self.draw(&pass, &self.alone, index, QuadPush { view: 0, linear: u32::from(self.linear) });
        });
    }

    /// Draws it over the eyes' pictures, or over one of them. `commands` are outside any pass.
    pub fn record_in_eyes(&self, commands: Commands<'_>, index: usize, target: &EyeTarget) {
        // What is drawn there is drawn before.
        commands.barrier(Access::COLOUR_WRITE, Access::COLOUR_WRITE);
        let views = (target.colour, target.colour_of_eye);
        self.record_over(commands, (index, &self.in_eyes, self.linear), target.extent, views);
    }

    /// Draws it over copies of the eyes' pictures, two layers in TRANSFER_SRC_OPTIMAL, as far as they are filled; leaves
    /// them like that.
    pub fn record_in_mirror(
        &self,
        commands: Commands<'_>,
        index: usize,
        mirror: &Image,
        extent: vk::Extent2D,
    ) {
        let (image, aspect) = (mirror.raw, vk::ImageAspectFlags::COLOR);
        let copied = (Access::COPY_WRITE | Access::COPY_READ, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
        let drawn = (Access::COLOUR_WRITE, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL);
        let kept = (Access::COPY_READ, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
        commands.transition(&[Transition { image, aspect, from: copied, to: drawn }]);
        let views = (mirror.view, [mirror.layer_views[0], mirror.layer_views[1]]);
        self.record_over(commands, (index, &self.in_mirror, false), extent, views);
        commands.transition(&[Transition { image, aspect, from: drawn, to: kept }]);
    }

    fn record_over(
        &self,
        commands: Commands<'_>,
        (index, pipeline, linear): (usize, &GraphicsPipeline, bool),
        extent: vk::Extent2D,
        (both, of_eye): (vk::ImageView, [vk::ImageView; 2]),
    ) {
        let layout = vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL;
        let pass = |view_mask, image, eye| {
            let colour = [Attachment::new(image, layout, Load::Keep)];
            commands.render(&Target { extent, view_mask, colour: &colour, depth: None }, |pass| {
                self.draw(&pass, pipeline, index, QuadPush { view: eye, linear: u32::from(linear) });
            });
        };
        if self.multiview {
            pass(0b11, both, 0);
        } else {
            (0..).zip(of_eye).for_each(|(eye, view)| pass(0, view, eye));
        }
    }

    fn draw(&self, pass: &Commands<'_>, pipeline: &GraphicsPipeline, index: usize, push: QuadPush) {
        let Some(picture) = &self.picture else { return };
        pass.bind(pipeline, &[picture, &self.frames[index].group]);
        pass.push(pipeline, &push);
        pass.draw(CORNERS, 1);
    }
}
