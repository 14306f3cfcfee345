//! The window's picture, put together in one small pass: parts of the eyes' pictures, and what is laid over them.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;
use bytemuck::NoUninit;

use super::pane::Pane;
use crate::gpu::{
    Access, Attachment, BindGroup, Blend, Canvas, Frame, Gpu, GraphicsInfo, GraphicsPipeline, Image, Load,
    Presenter, Program, Resource, Sampler, Source, Target, Transition,
};

/// `shaders/mirror.wgsl`.
pub const MIRROR_SHADER: Source<'static> =
    Source { name: "shaders/mirror.wgsl", text: include_str!("../../shaders/mirror.wgsl") };

/// Something in a window, drawn before on the same queue.
#[derive(Clone, Copy)]
pub struct Scene<'a> {
    /// The eyes' pictures, a layer each, in TRANSFER_SRC_OPTIMAL; they are left as they were.
    pub eyes: &'a Image,
    /// What is laid over them, stretched over the whole window: colours as they are stored, multiplied by their alpha; in
    /// SHADER_READ_ONLY_OPTIMAL, and ready to be read by fragment shaders.
    pub overlay: Option<&'a Image>,
}

/// A pane as the shader takes it: twin of `Pane` in mirror.wgsl.
#[derive(Clone, Copy, Debug, NoUninit)]
#[repr(C)]
pub struct PanePush {
    /// Columns; their fourth numbers are not used.
    pub picture_from_pane: [[f32; 4]; 3],
    /// The layer.
    pub eye: u32,
    /// None of these is.
    pub unused_0: u32,
    /// See above.
    pub unused_1: u32,
    /// See above.
    pub unused_2: u32,
}

impl PanePush {
    fn new(pane: &Pane) -> PanePush {
        let column = |i| pane.picture_from_pane.col(i).as_vec3().extend(0.0).to_array();
        let picture_from_pane = [column(0), column(1), column(2)];
        PanePush { picture_from_pane, eye: pane.eye as u32, unused_0: 0, unused_1: 0, unused_2: 0 }
    }
}

/// Draws windows' pictures.
pub struct Composer {
    panes: GraphicsPipeline,
    over: GraphicsPipeline,
    frames: [PerFrame; Presenter::IN_FLIGHT],
    program: Arc<Program>,
    sampler: Sampler,
}

/// What a picture in flight was drawn from.
#[derive(Default)]
struct PerFrame {
    eyes: Option<BindGroup>,
    overlay: Option<BindGroup>,
}

impl Composer {
    /// Draws to images of [`Presenter::FORMAT`].
    ///
    /// # Errors
    /// Out of memory.
    pub fn new(gpu: &Arc<Gpu>) -> Result<Composer> {
        let program = Program::new(gpu, "mirror", &[MIRROR_SHADER], &[])?;
        let colour = [Presenter::FORMAT];
        let panes =
            GraphicsPipeline::new(&GraphicsInfo::new(&program, "pane_vertex", "pane_fragment", &colour))?;
        let over = GraphicsPipeline::new(&GraphicsInfo {
            blend: Blend::Premultiplied,
            ..GraphicsInfo::new(&program, "overlay_vertex", "overlay_fragment", &colour)
        })?;
        let edge = vk::SamplerAddressMode::CLAMP_TO_EDGE;
        let sampler = Sampler::new(gpu, "mirror", vk::Filter::LINEAR, edge)?;
        Ok(Composer { panes, over, frames: Default::default(), program, sampler })
    }

    /// Points a picture in flight, which is free, to what it is drawn from.
    ///
    /// # Errors
    /// Out of memory.
    fn set(&mut self, index: usize, scene: &Scene<'_>) -> Result<()> {
        let layout = vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL;
        let frame = &mut self.frames[index];
        let eyes = Resource::Texture(scene.eyes.view, layout);
        match &frame.eyes {
            Some(group) => group.set("eyes", &eyes)?,
            None => {
                let sampler = ("mirror_sampler", Resource::Sampler(&self.sampler));
                frame.eyes = Some(self.program.bind_group(0, &[("eyes", eyes), sampler])?);
            }
        }
        let Some(overlay) = scene.overlay else { return Ok(()) };
        let overlay = Resource::Texture(overlay.view, layout);
        match &frame.overlay {
            Some(group) => group.set("overlay", &overlay)?,
            None => frame.overlay = Some(self.program.bind_group(1, &[("overlay", overlay)])?),
        }
        Ok(())
    }

    /// Draws panes, and the overlay over them.
    ///
    /// # Errors
    /// Out of memory.
    pub fn record(
        &mut self,
        frame: &mut Frame,
        canvas: Canvas,
        scene: &Scene<'_>,
        panes: impl Iterator<Item = Pane>,
    ) -> Result<()> {
        self.set(canvas.index, scene)?;
        let PerFrame { eyes: Some(eyes), overlay } = &self.frames[canvas.index] else { return Ok(()) };
        let aspect = vk::ImageAspectFlags::COLOR;
        let copied = (Access::COPY_WRITE | Access::COPY_READ, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
        let read = (Access::FRAGMENT_READ, vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL);
        let kept = (Access::COPY_READ, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
        let image = scene.eyes.raw;
        frame.pass(c"mirror", |commands| {
            commands.transition(&[Transition { image, aspect, from: copied, to: read }]);
            let layout = vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL;
            let colour = [Attachment::new(canvas.view, layout, Load::Colour([0.0, 0.0, 0.0, 1.0]))];
            let target = Target { extent: canvas.extent, view_mask: 0, colour: &colour, depth: None };
            commands.render(&target, |pass| {
                pass.bind(&self.panes, &[eyes]);
                for pane in panes {
                    let [left, top, right, bottom] = pane.window;
                    let (width, height) = ((right - left) as u32, (bottom - top) as u32);
                    pass.viewport(vk::Rect2D {
                        offset: vk::Offset2D { x: left, y: top },
                        extent: vk::Extent2D { width, height },
                    });
                    pass.push(&self.panes, &PanePush::new(&pane));
                    pass.draw(3, 1);
                }
                if let Some(overlay) = overlay.as_ref().filter(|_| scene.overlay.is_some()) {
                    pass.viewport(vk::Rect2D { offset: vk::Offset2D::default(), extent: canvas.extent });
                    pass.bind(&self.over, &[eyes, overlay]);
                    pass.draw(3, 1);
                }
            });
            commands.transition(&[Transition { image, aspect, from: read, to: kept }]);
        });
        Ok(())
    }
}
