//! The panels: egui's triangles into a picture of their own.
//!
//! It is drawn anew only when there is something new to see in it, and stays as it is in between: a window, or a
//! layer of the headset's, shows it as often as it likes. The twin of `shaders/panels.wgsl`.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;
use egui::epaint::{ColorImage, Primitive, Vertex};

use super::PANELS_SHADER;
use super::layout::PanelPush;
use crate::gpu::{
    Access, Attachment, BindGroup, Blend, Buffer, BufferInfo, Commands, Frames, Gpu, GraphicsInfo,
    GraphicsPipeline, Image, ImageInfo, Load, Location, Program, Resource, Sampler, Target, Transition,
};
use crate::panels::Painted;

/// Of the panels' picture and of the letters: plain numbers, as they are gamma-encoded already.
const FORMAT: vk::Format = vk::Format::R8G8B8A8_UNORM;

/// Pictures that may be on their way.
const IN_FLIGHT: usize = 2;

const READ: (Access, vk::ImageLayout) = (Access::FRAGMENT_READ, vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL);

/// Draws the panels.
pub struct PanelPass {
    /// Goes first: it waits for the pictures on their way, which use the rest.
    frames: Frames,
    panels: GraphicsPipeline,
    program: Arc<Program>,
    sampler: Sampler,
    slots: Vec<Slot>,
    letters: Option<Letters>,
    target: Option<Image>,
    gpu: Arc<Gpu>,
}

/// An image that can be sampled.
struct Texture {
    group: BindGroup,
    image: Image,
}

struct Letters {
    texture: Texture,
    version: u64,
}

/// Triangles of one picture on its way.
struct Slot {
    group: BindGroup,
    vertices: Buffer,
    indices: Buffer,
}

impl PanelPass {
    /// Nothing is drawn yet.
    ///
    /// # Errors
    /// Out of memory.
    pub fn new(gpu: &Arc<Gpu>) -> Result<PanelPass> {
        let program = Program::new(gpu, "panels", &[PANELS_SHADER], &[])?;
        let panels = GraphicsPipeline::new(&GraphicsInfo {
            blend: Blend::Premultiplied,
            ..GraphicsInfo::new(&program, "panel_vertex", "panel_fragment", &[FORMAT])
        })?;
        let clamp = vk::SamplerAddressMode::CLAMP_TO_EDGE;
        Ok(PanelPass {
            panels,
            slots: (0..IN_FLIGHT)
                .map(|_| Slot::new(gpu, &program, 1 << 13, 1 << 14))
                .collect::<Result<Vec<_>>>()?,
            program,
            sampler: Sampler::new(gpu, "panels", vk::Filter::LINEAR, clamp)?,
            letters: None,
            target: None,
            frames: Frames::new(gpu, IN_FLIGHT)?,
            gpu: Arc::clone(gpu),
        })
    }

    /// Whether [`PanelPass::draw`] could draw now, without waiting.
    ///
    /// # Errors
    /// [`Lost`](crate::gpu::Lost)
    pub fn is_free(&self) -> Result<bool> {
        Ok(self.frames.free()?.is_some())
    }

    /// Draws the picture anew. Waits while [`PanelPass::is_free`] is false.
    ///
    /// # Errors
    /// Out of memory, or [`Lost`](crate::gpu::Lost).
    pub fn draw(&mut self, painted: &Painted) -> Result<()> {
        let [width, height] = painted.size;
        if width == 0 || height == 0 {
            return Ok(());
        }
        let mut frame = self.frames.begin()?;
        self.fit(painted)?;
        let staged = self.stage(painted)?;
        self.slots[frame.index].write(&self.gpu, &self.program, painted)?;
        let (Some(letters), Some(target)) = (&self.letters, &self.target) else { return Ok(()) };
        if let Some(staging) = staged {
            frame.pass(c"letters", |commands| upload(commands, &staging, &letters.texture.image));
            self.frames.bury(staging);
        }
        let slot = &self.slots[frame.index];
        frame.pass(c"panels", |commands| {
            let aspect = vk::ImageAspectFlags::COLOR;
            let drawn = (Access::COLOUR_WRITE, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL);
            // What the window shows may still be reading it.
            let old = (Access::COLOUR_WRITE | Access::FRAGMENT_READ, vk::ImageLayout::UNDEFINED);
            let image = target.raw;
            commands.transition(&[Transition { image, aspect, from: old, to: drawn }]);
            let colour = [Attachment::new(target.view, drawn.1, Load::Colour([0.0; 4]))];
            let pass = Target { extent: target.extent, view_mask: 0, colour: &colour, depth: None };
            commands.render(&pass, |pass| {
                pass.bind(&self.panels, &[&letters.texture.group, &slot.group]);
                pass.index_buffer(&slot.indices, vk::IndexType::UINT32);
                let points = painted.size.map(|pixels| pixels as f32 / painted.scale);
                pass.push(&self.panels, &PanelPush { clip_per_point: points.map(|side| 2.0 / side) });
                draw_meshes(&pass, painted);
            });
            commands.transition(&[Transition { image, aspect, from: drawn, to: READ }]);
        });
        self.frames.submit(frame, &[], &[])?;
        Ok(())
    }

    /// The picture, premultiplied, in SHADER_READ_ONLY_OPTIMAL, to be read in fragment shaders on the same queue; None before
    /// one was drawn.
    pub fn picture(&self) -> Option<&Image> {
        self.target.as_ref()
    }

    /// A picture of the window's size.
    fn fit(&mut self, painted: &Painted) -> Result<()> {
        let [width, height] = painted.size;
        let extent = vk::Extent2D { width, height };
        if self.target.as_ref().is_none_or(|target| target.extent != extent) {
            let usage = vk::ImageUsageFlags::COLOR_ATTACHMENT
                | vk::ImageUsageFlags::SAMPLED
                | vk::ImageUsageFlags::TRANSFER_SRC;
            let made = self.image("panels", extent, usage)?;
            if let Some(old) = self.target.replace(made) {
                // On the one queue, the window's pictures that show it are done before what is submitted next.
                self.frames.bury(old);
            }
        }
        Ok(())
    }

    /// New letters, in a buffer to be copied from.
    fn stage(&mut self, painted: &Painted) -> Result<Option<Buffer>> {
        if self.letters.as_ref().is_some_and(|letters| letters.version == painted.atlas_version) {
            return Ok(None);
        }
        let atlas: &ColorImage = &painted.atlas;
        let [width, height] = atlas.size.map(|side| side as u32);
        let extent = vk::Extent2D { width, height };
        let bytes: &[u8] = bytemuck::cast_slice(&atlas.pixels);
        let mut staging = Buffer::new(
            &self.gpu,
            &BufferInfo {
                name: "letters",
                size: bytes.len() as u64,
                usage: vk::BufferUsageFlags::TRANSFER_SRC,
                location: Location::Upload,
            },
        )?;
        staging.slice_mut()[..bytes.len()].copy_from_slice(bytes);
        let version = painted.atlas_version;
        match &mut self.letters {
            Some(letters) if letters.texture.image.extent == extent => letters.version = version,
            _ => {
                let usage = vk::ImageUsageFlags::TRANSFER_DST | vk::ImageUsageFlags::SAMPLED;
                let texture = self.texture(self.image("letters", extent, usage)?)?;
                if let Some(old) = self.letters.replace(Letters { texture, version }) {
                    self.frames.bury(old);
                }
            }
        }
        Ok(Some(staging))
    }

    fn image(&self, name: &str, extent: vk::Extent2D, usage: vk::ImageUsageFlags) -> Result<Image> {
        let vk::Extent2D { width, height } = extent;
        let info = ImageInfo { name, width, height, format: FORMAT, usage, ..ImageInfo::default() };
        Image::new(&self.gpu, &info)
    }

    fn texture(&self, image: Image) -> Result<Texture> {
        let resources = [
            ("panel_texture", Resource::Texture(image.view, READ.1)),
            ("panel_sampler", Resource::Sampler(&self.sampler)),
        ];
        Ok(Texture { group: self.program.bind_group(0, &resources)?, image })
    }
}

impl Slot {
    fn new(gpu: &Arc<Gpu>, program: &Arc<Program>, vertices: usize, indices: usize) -> Result<Slot> {
        let buffer = |name, size: usize, usage| {
            Buffer::new(gpu, &BufferInfo { name, size: size as u64, usage, location: Location::Upload })
        };
        let vertices =
            buffer("panel vertices", vertices * size_of::<Vertex>(), vk::BufferUsageFlags::STORAGE_BUFFER)?;
        let indices = buffer("panel indices", indices * 4, vk::BufferUsageFlags::INDEX_BUFFER)?;
        let group = program.bind_group(1, &[("panel_vertices", Resource::Buffer(&vertices))])?;
        Ok(Slot { group, vertices, indices })
    }

    /// Takes in all meshes, one after the other; makes room where there is too little. The GPU is not reading it.
    fn write(&mut self, gpu: &Arc<Gpu>, program: &Arc<Program>, painted: &Painted) -> Result<()> {
        let (mut vertices, mut indices) = (0, 0);
        for mesh in meshes(painted) {
            vertices += mesh.vertices.len();
            indices += mesh.indices.len();
        }
        let room = |buffer: &Buffer, size: usize| (buffer.size as usize) / size;
        if room(&self.vertices, size_of::<Vertex>()) < vertices || room(&self.indices, 4) < indices {
            *self = Slot::new(gpu, program, vertices.next_power_of_two(), indices.next_power_of_two())?;
        }
        let (mut first_vertex, mut first_index) = (0, 0);
        for mesh in meshes(painted) {
            let to = &mut self.vertices.slice_mut::<Vertex>()[first_vertex..][..mesh.vertices.len()];
            to.copy_from_slice(&mesh.vertices);
            let to = &mut self.indices.slice_mut::<u32>()[first_index..][..mesh.indices.len()];
            to.iter_mut().zip(&mesh.indices).for_each(|(to, index)| *to = index + first_vertex as u32);
            first_vertex += mesh.vertices.len();
            first_index += mesh.indices.len();
        }
        Ok(())
    }
}

/// The triangles to draw: the panels have no other textures than letters, and no callbacks.
fn meshes(painted: &Painted) -> impl Iterator<Item = &egui::Mesh> {
    painted.primitives.iter().filter_map(|clipped| match &clipped.primitive {
        Primitive::Mesh(mesh) => Some(mesh),
        Primitive::Callback(_) => None,
    })
}

/// Each mesh within its rectangle.
fn draw_meshes(pass: &Commands<'_>, painted: &Painted) {
    let clips = painted.primitives.iter().filter(|clipped| matches!(clipped.primitive, Primitive::Mesh(_)));
    let mut first = 0;
    for (clipped, mesh) in clips.zip(meshes(painted)) {
        let count = mesh.indices.len() as u32;
        if let Some(area) = pixels(clipped.clip_rect, painted) {
            pass.scissor(area);
            pass.draw_indexed_range(first, count, 1);
        }
        first += count;
    }
}

/// A rectangle in the window's pixels; None where nothing of it is inside.
fn pixels(rect: egui::Rect, painted: &Painted) -> Option<vk::Rect2D> {
    let side = |points: f32, most: u32| ((points * painted.scale).round().max(0.0) as u32).min(most);
    let [width, height] = painted.size;
    let [left, right] = [rect.min.x, rect.max.x].map(|x| side(x, width));
    let [top, bottom] = [rect.min.y, rect.max.y].map(|y| side(y, height));
    (left < right && top < bottom).then(|| vk::Rect2D {
        offset: vk::Offset2D { x: left as i32, y: top as i32 },
        extent: vk::Extent2D { width: right - left, height: bottom - top },
    })
}

fn upload(commands: Commands<'_>, staging: &Buffer, letters: &Image) {
    let (image, aspect) = (letters.raw, vk::ImageAspectFlags::COLOR);
    let written = (Access::COPY_WRITE, vk::ImageLayout::TRANSFER_DST_OPTIMAL);
    let old = (Access::FRAGMENT_READ, vk::ImageLayout::UNDEFINED);
    commands.transition(&[Transition { image, aspect, from: old, to: written }]);
    let vk::Extent2D { width, height } = letters.extent;
    let region = vk::BufferImageCopy::default()
        .image_subresource(vk::ImageSubresourceLayers {
            aspect_mask: aspect,
            mip_level: 0,
            base_array_layer: 0,
            layer_count: 1,
        })
        .image_extent(vk::Extent3D { width, height, depth: 1 });
    commands.copy_buffer_to_image(staging, (image, written.1), &[region]);
    commands.transition(&[Transition { image, aspect, from: written, to: READ }]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::{Rect, pos2};

    #[test]
    fn what_is_clipped_stays_within_the_window() {
        let painted = Painted {
            primitives: Vec::new(),
            atlas: Arc::new(ColorImage::default()),
            atlas_version: 1,
            scale: 1.5,
            size: [300, 200],
        };
        let area = |x0, y0, x1, y1| {
            let area = pixels(Rect::from_min_max(pos2(x0, y0), pos2(x1, y1)), &painted)?;
            Some([area.offset.x, area.offset.y, area.extent.width as i32, area.extent.height as i32])
        };
        assert_eq!(area(10.0, 20.0, 30.0, 40.0), Some([15, 30, 30, 30]));
        assert_eq!(area(-10.0, -1.0, 1000.0, f32::INFINITY), Some([0, 0, 300, 200]));
        assert_eq!(area(200.0, 0.0, 250.0, 10.0), None);
        assert_eq!(area(5.0, 5.0, 4.0, 9.0), None);
    }
}
