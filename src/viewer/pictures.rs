//! What a viewer has drawn, to be read or shown: the eyes' pictures, the mirror, the backdrop.

use std::sync::Arc;

use anyhow::{Context, Result};
use ash::vk;

use super::Viewer;
use crate::gpu::{Access, Buffer, BufferInfo, Gpu, Image, ImageInfo, Location, Transition};
use crate::painter::whole_image;

impl Viewer {
    /// From now on every frame can be read by [`Viewer::picture`].
    ///
    /// # Errors
    /// Out of memory; or the backdrop is a layer of its own, so that the eyes' pictures are not the whole.
    pub fn keep_pictures(&mut self) -> Result<()> {
        anyhow::ensure!(
            self.painter.sky.is_none(),
            "pictures cannot be kept while the backdrop is a layer of its own: do without --backdrop-layer"
        );
        let extent = self.session.info().extent;
        let size = 2 * 4 * u64::from(extent.width) * u64::from(extent.height);
        self.painter.picture = Some(Buffer::new(
            &self.gpu,
            &BufferInfo {
                name: "picture",
                size,
                usage: vk::BufferUsageFlags::TRANSFER_DST,
                location: Location::Readback,
            },
        )?);
        Ok(())
    }

    /// Waits for the last frame, and gives an eye's picture: sRGB, rows from the top, 3 bytes per pixel.
    ///
    /// # Errors
    /// The device is lost.
    pub fn picture(&mut self, eye: usize) -> Result<Vec<u8>> {
        self.painter.frames.wait_idle()?;
        let Some(buffer) = &self.painter.picture else { anyhow::bail!("pictures are not kept") };
        Ok(self.rgb(buffer, self.session.drawn(), eye))
    }

    /// An eye's picture out of a buffer with both.
    fn rgb(&self, buffer: &Buffer, extent: vk::Extent2D, eye: usize) -> Vec<u8> {
        let info = self.session.info();
        let pixels = extent.width as usize * extent.height as usize;
        let eye = &buffer.slice::<[u8; 4]>()[eye * pixels..(eye + 1) * pixels];
        let blue_first = matches!(info.color_format, vk::Format::B8G8R8A8_SRGB | vk::Format::B8G8R8A8_UNORM);
        let rgb = |&[a, g, b, _]: &[u8; 4]| if blue_first { [b, g, a] } else { [a, g, b] };
        eye.iter().flat_map(rgb).collect()
    }

    /// From now on every frame is copied aside, to be shown in a window ([`Viewer::mirror`]).
    ///
    /// # Errors
    /// Out of memory.
    pub fn keep_mirror(&mut self) -> Result<()> {
        let info = self.session.info();
        if self.painter.mirror.is_none() {
            self.painter.mirror = Some(Image::new(
                &self.gpu,
                &ImageInfo {
                    name: "mirror",
                    width: info.extent.width,
                    height: info.extent.height,
                    layers: 2,
                    format: plain_format(info.color_format),
                    usage: vk::ImageUsageFlags::TRANSFER_DST
                        | vk::ImageUsageFlags::TRANSFER_SRC
                        | vk::ImageUsageFlags::COLOR_ATTACHMENT
                        | vk::ImageUsageFlags::SAMPLED,
                    ..ImageInfo::default()
                },
            )?);
        }
        Ok(())
    }

    /// Whether the mirror shows what narrows and fades the wearer's view, too; it does not unless it is told to.
    pub fn show_veil_in_mirror(&mut self, shown: bool) {
        self.painter.veil_in_mirror = shown;
    }

    /// The eyes' last pictures, a layer each, in TRANSFER_SRC_OPTIMAL: sRGB that Vulkan takes for plain numbers. None
    /// before a frame was drawn.
    pub fn mirror(&self) -> Option<&Image> {
        self.painter.mirror.as_ref().filter(|_| self.eyes.is_some())
    }

    /// The part of [`Viewer::mirror`] that the last frame fills, from its corner.
    pub fn mirrored(&self) -> [u32; 2] {
        let vk::Extent2D { width, height } = self.painter.mirrored;
        [width, height]
    }

    /// Waits for the last frame, and gives an eye's picture as [`Viewer::picture`] does, of [`Viewer::mirrored`] pixels.
    ///
    /// # Errors
    /// The device is lost, or out of memory; or no frame was drawn and kept.
    pub fn read_mirror(&mut self, eye: usize) -> Result<Vec<u8>> {
        let mirror = self.mirror().context("there is no picture yet")?;
        let extent = self.painter.mirrored;
        let pixels = extent.width as usize * extent.height as usize;
        let buffer = Buffer::new(
            &self.gpu,
            &BufferInfo {
                name: "screenshot",
                size: 2 * 4 * pixels as u64,
                usage: vk::BufferUsageFlags::TRANSFER_DST,
                location: Location::Readback,
            },
        )?;
        let from = (mirror.raw, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
        self.gpu.run(|commands| commands.copy_image_to_buffer(from, &buffer, &[whole_image(extent, 2)]))?;
        Ok(self.rgb(&buffer, extent, eye))
    }

    /// Waits for the last frame, and gives the backdrop in use.
    ///
    /// # Errors
    /// The device is lost, or out of memory.
    pub fn read_backdrop(&mut self) -> Result<Faces> {
        self.painter.frames.wait_idle()?;
        let backdrop = &self.painter.backdrop;
        let face = backdrop.config().face;
        Ok(Faces {
            side: face as usize,
            colour: read_faces(&self.gpu, backdrop.colour_image())?,
            log_distance: read_faces(&self.gpu, backdrop.distance_image())?,
            reference: backdrop.reference(),
        })
    }
}

/// The texels of a backdrop, face by face (+x −x +y −y +z −z), rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Faces {
    /// Texels per side.
    pub side: usize,
    /// sRGB at half brightness without air, and coverage: 0 or 255.
    pub colour: Vec<[u8; 4]>,
    /// log2 of the distance in tiles of the reference level; far below any where nothing is.
    pub log_distance: Vec<f32>,
    /// Level of the tiles that distances count.
    pub reference: usize,
}

/// All texels of a cube's image, which is in layout GENERAL and has four bytes per texel.
fn read_faces<T: bytemuck::Pod>(gpu: &Arc<Gpu>, image: &Image) -> Result<Vec<T>> {
    let texels = 6 * image.extent.width as usize * image.extent.height as usize;
    let buffer = Buffer::new(
        gpu,
        &BufferInfo {
            name: "backdrop texels",
            size: 4 * texels as u64,
            usage: vk::BufferUsageFlags::TRANSFER_DST,
            location: Location::Readback,
        },
    )?;
    let region = whole_image(image.extent, 6);
    let aspect = vk::ImageAspectFlags::COLOR;
    let baked = (Access::COLOUR_WRITE | Access::FRAGMENT_READ, vk::ImageLayout::GENERAL);
    let copied = (Access::COPY_READ, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
    gpu.run(|commands| {
        commands.transition(&[Transition { image: image.raw, aspect, from: baked, to: copied }]);
        commands.copy_image_to_buffer((image.raw, copied.1), &buffer, &[region]);
        commands.transition(&[Transition { image: image.raw, aspect, from: copied, to: baked }]);
    })?;
    Ok(buffer.slice::<T>()[..texels].to_vec())
}

/// The same texels as plain numbers.
pub(super) fn plain_format(format: vk::Format) -> vk::Format {
    match format {
        vk::Format::R8G8B8A8_SRGB => vk::Format::R8G8B8A8_UNORM,
        vk::Format::B8G8R8A8_SRGB => vk::Format::B8G8R8A8_UNORM,
        other => other,
    }
}
