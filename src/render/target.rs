//! What the eyes are drawn into: the target, what pipelines must know of it, and the images in which a pixel has several
//! samples before they are resolved to it.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;

use crate::gpu::{
    Access, Attachment, Commands, Depth, Gpu, GraphicsInfo, Image, ImageInfo, Load, Program, Transition,
};
use crate::world::linear_from_share;

/// What the eyes are drawn into: two layers, left and right, of one sample a pixel.
#[derive(Clone, Copy, Debug)]
pub struct EyeTarget {
    /// Pixels of each eye that are drawn, from the corner.
    pub extent: vk::Extent2D,
    /// The colour image, in COLOR_ATTACHMENT_OPTIMAL before and after.
    pub colour_image: vk::Image,
    /// Both layers of it.
    pub colour: vk::ImageView,
    /// Each layer of it.
    pub colour_of_eye: [vk::ImageView; 2],
    /// The depth image, in DEPTH_STENCIL_ATTACHMENT_OPTIMAL before and after.
    pub depth_image: vk::Image,
    /// Both layers of it.
    pub depth: vk::ImageView,
    /// Each layer of it.
    pub depth_of_eye: [vk::ImageView; 2],
    /// Somebody reads the depth when all is drawn.
    pub depth_is_read: bool,
}

/// What every pipeline of the eyes' passes has to know: formats, samples, views.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TargetFormat {
    /// Colour format of what is drawn into.
    pub colour: vk::Format,
    /// Depth format of it.
    pub depth: vk::Format,
    /// It does not encode sRGB by itself.
    pub encode: bool,
    /// Both eyes in one pass.
    pub multiview: bool,
    /// Samples of a pixel.
    pub samples: vk::SampleCountFlags,
    /// What the samples of colour are resolved to is copied to the target from an image of our own: see
    /// [`TargetFormat::sampled`].
    pub copies_colour: bool,
    /// The same for depth.
    pub copies_depth: bool,
}

impl TargetFormat {
    /// The same with so many samples a pixel (1, 2, 4 or 8), of which the target gets the mean. Light is what may be
    /// averaged, not its encoding: half of a pixel white and half black is 188 in sRGB, not 128, which would draw dark
    /// outlines round bright things. So where the shaders would have to encode, the samples are of the sRGB format with
    /// the same texels, and the texels of the mean are copied. So is all where the device does not resolve to any layer
    /// ([`DeviceInfo::resolves_to_layers`](crate::gpu::DeviceInfo::resolves_to_layers)).
    pub fn sampled(self, samples: u32, resolves_to_layers: bool) -> TargetFormat {
        if samples == 1 {
            return self;
        }
        TargetFormat {
            colour: if self.encode { srgb_format(self.colour) } else { self.colour },
            encode: false,
            samples: vk::SampleCountFlags::from_raw(samples),
            copies_colour: self.encode || !resolves_to_layers,
            copies_depth: !resolves_to_layers,
            ..self
        }
    }

    /// Of the passes' targets: see [`Target`](crate::gpu::Target).
    pub fn view_mask(&self) -> u32 {
        if self.multiview { 0b11 } else { 0 }
    }

    /// What a pipeline of the eyes' passes begins with: opaque triangles of both faces. `vertex` is for both eyes in one
    /// pass, and for one eye.
    pub fn pipeline<'a>(
        &'a self,
        program: &'a Arc<Program>,
        [of_both, of_eye]: [&'a str; 2],
        fragment: &'a str,
        (compare, write): (vk::CompareOp, bool),
    ) -> GraphicsInfo<'a> {
        let vertex = if self.multiview { of_both } else { of_eye };
        GraphicsInfo {
            view_mask: self.view_mask(),
            depth: Some(Depth { format: self.depth, compare, write }),
            samples: self.samples,
            ..GraphicsInfo::new(program, vertex, fragment, std::slice::from_ref(&self.colour))
        }
    }

    /// What to clear with for a grey, 0..=1 of sRGB.
    pub(super) fn grey(&self, grey: f32) -> [f32; 4] {
        let grey = if self.encode { grey } else { linear_from_share(grey) };
        [grey, grey, grey, 1.0]
    }
}

/// The format whose texels are the same, and that encodes and decodes sRGB.
fn srgb_format(format: vk::Format) -> vk::Format {
    match format {
        vk::Format::R8G8B8A8_UNORM => vk::Format::R8G8B8A8_SRGB,
        vk::Format::B8G8R8A8_UNORM => vk::Format::B8G8R8A8_SRGB,
        other => other,
    }
}

const COLOUR_LAYOUT: vk::ImageLayout = vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL;
const DEPTH_LAYOUT: vk::ImageLayout = vk::ImageLayout::DEPTH_STENCIL_ATTACHMENT_OPTIMAL;

/// What a pass draws into where a pixel has several samples. Nothing of them outlives the pass: where the GPU draws tile by
/// tile, they take no memory. Passes for one eye share one layer.
pub(super) struct SampleImages {
    colour: Image,
    depth: Image,
    /// What they are resolved to, on its way to the target.
    resolved: [Option<Image>; 2],
}

impl SampleImages {
    /// Images for eyes of at most so many pixels; None where one sample is all there is.
    pub(super) fn new(
        gpu: &Arc<Gpu>,
        format: &TargetFormat,
        most: vk::Extent2D,
    ) -> Result<Option<SampleImages>> {
        use vk::ImageUsageFlags as Usage;
        if format.samples == vk::SampleCountFlags::TYPE_1 {
            return Ok(None);
        }
        let image = |name, (format_of_it, samples), usage| {
            Image::new(
                gpu,
                &ImageInfo {
                    name,
                    width: most.width,
                    height: most.height,
                    layers: if format.multiview { 2 } else { 1 },
                    format: format_of_it,
                    samples,
                    usage,
                    ..ImageInfo::default()
                },
            )
        };
        let transient = Usage::TRANSIENT_ATTACHMENT;
        let one = vk::SampleCountFlags::TYPE_1;
        let colour = || {
            let usage = Usage::COLOR_ATTACHMENT | Usage::TRANSFER_SRC;
            image("resolved colour", (format.colour, one), usage)
        };
        let depth = || {
            let usage = Usage::DEPTH_STENCIL_ATTACHMENT | Usage::TRANSFER_SRC;
            image("resolved depth", (format.depth, one), usage)
        };
        Ok(Some(SampleImages {
            colour: image(
                "samples of colour",
                (format.colour, format.samples),
                transient | Usage::COLOR_ATTACHMENT,
            )?,
            depth: image(
                "samples of depth",
                (format.depth, format.samples),
                transient | Usage::DEPTH_STENCIL_ATTACHMENT,
            )?,
            resolved: [
                format.copies_colour.then(colour).transpose()?,
                format.copies_depth.then(depth).transpose()?,
            ],
        }))
    }

    /// Before a pass: what the pass before drew into them is dropped, once that is done.
    fn begin(&self, commands: Commands<'_>) {
        let fresh = |image: &Image, before: Access| {
            let (access, layout) = attached(image.aspect);
            Transition {
                image: image.raw,
                aspect: image.aspect,
                from: (before, vk::ImageLayout::UNDEFINED),
                to: (access, layout),
            }
        };
        let sampled = [&self.colour, &self.depth].map(|image| fresh(image, attached(image.aspect).0));
        commands.transition(&sampled);
        for image in self.resolved.iter().flatten() {
            commands.transition(&[fresh(image, Access::COPY_READ)]);
        }
    }

    /// After a pass: what the samples were resolved to goes to the target, into the layer of the pass's eye, or both.
    fn end(&self, commands: Commands<'_>, target: &EyeTarget, eye: Option<u32>) {
        let [colour, depth] = &self.resolved;
        let depth = depth.as_ref().filter(|_| target.depth_is_read);
        let ways = [(colour.as_ref(), target.colour_image), (depth, target.depth_image)];
        for (from, to) in ways.into_iter().filter_map(|(from, to)| Some((from?, to))) {
            let aspect = from.aspect;
            let drawn = attached(aspect);
            let read = (Access::COPY_READ, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
            let written = (Access::COPY_WRITE, vk::ImageLayout::TRANSFER_DST_OPTIMAL);
            commands.transition(&[
                Transition { image: from.raw, aspect, from: drawn, to: read },
                Transition { image: to, aspect, from: drawn, to: written },
            ]);
            let layers = |base_array_layer| vk::ImageSubresourceLayers {
                aspect_mask: aspect,
                mip_level: 0,
                base_array_layer,
                layer_count: from.layer_views.len() as u32,
            };
            let vk::Extent2D { width, height } = target.extent;
            let region = vk::ImageCopy::default()
                .src_subresource(layers(0))
                .dst_subresource(layers(eye.unwrap_or(0)))
                .extent(vk::Extent3D { width, height, depth: 1 });
            commands.copy_image((from.raw, read.1), (to, written.1), &[region]);
            commands.transition(&[Transition { image: to, aspect, from: written, to: drawn }]);
        }
    }
}

/// How an attachment is used, and its layout. Depth is resolved where colours are.
fn attached(aspect: vk::ImageAspectFlags) -> (Access, vk::ImageLayout) {
    match aspect {
        vk::ImageAspectFlags::DEPTH => (Access::DEPTH_WRITE | Access::COLOUR_WRITE, DEPTH_LAYOUT),
        _ => (Access::COLOUR_WRITE, COLOUR_LAYOUT),
    }
}

/// Records one pass for both eyes, or one for an eye: `draw` gets what to draw with, and the target gets what is drawn.
pub(super) fn render(
    commands: Commands<'_>,
    (target, samples): (&EyeTarget, Option<&SampleImages>),
    eye: Option<u32>,
    background: Load,
    draw: impl FnOnce(Commands<'_>),
) {
    let of = |both, each: [vk::ImageView; 2]| eye.map_or(both, |eye| each[eye as usize]);
    let colour = of(target.colour, target.colour_of_eye);
    let depth = of(target.depth, target.depth_of_eye);
    let (colour, depth) = match samples {
        None => (
            Attachment::new(colour, COLOUR_LAYOUT, background),
            Attachment {
                store: target.depth_is_read,
                ..Attachment::new(depth, DEPTH_LAYOUT, Load::Depth(0.0))
            },
        ),
        Some(samples) => {
            samples.begin(commands);
            let [own_colour, own_depth] = samples.resolved.each_ref().map(Option::as_ref);
            let (colour, depth) =
                (own_colour.map_or(colour, |own| own.view), own_depth.map_or(depth, |own| own.view));
            (
                Attachment {
                    store: false,
                    resolve: Some(colour),
                    ..Attachment::new(samples.colour.view, COLOUR_LAYOUT, background)
                },
                Attachment {
                    store: false,
                    resolve: target.depth_is_read.then_some(depth),
                    ..Attachment::new(samples.depth.view, DEPTH_LAYOUT, Load::Depth(0.0))
                },
            )
        }
    };
    let view_mask = if eye.is_none() { 0b11 } else { 0 };
    let pass = crate::gpu::Target { extent: target.extent, view_mask, colour: &[colour], depth: Some(depth) };
    commands.render(&pass, draw);
    if let Some(samples) = samples {
        samples.end(commands, target, eye);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_cannot_be_resolved_as_light_is_copied() {
        let format = |colour, encode| TargetFormat {
            colour,
            depth: vk::Format::D32_SFLOAT,
            encode,
            multiview: true,
            samples: vk::SampleCountFlags::TYPE_1,
            copies_colour: false,
            copies_depth: false,
        };
        let plain = format(vk::Format::B8G8R8A8_UNORM, true);
        assert_eq!(plain.sampled(1, false), plain);
        let sampled = plain.sampled(4, true);
        assert_eq!((sampled.colour, sampled.encode), (vk::Format::B8G8R8A8_SRGB, false));
        assert_eq!((sampled.samples, sampled.view_mask()), (vk::SampleCountFlags::TYPE_4, 0b11));
        assert!(sampled.copies_colour && !sampled.copies_depth);
        let usual = format(vk::Format::R8G8B8A8_SRGB, false);
        assert_eq!(usual.sampled(2, true), TargetFormat { samples: vk::SampleCountFlags::TYPE_2, ..usual });
        // What is neither encoded nor decoded, as tests draw, is averaged as it is.
        let raw = format(vk::Format::R8G8B8A8_UNORM, false);
        assert_eq!(raw.sampled(4, false).colour, raw.colour);
    }
}
