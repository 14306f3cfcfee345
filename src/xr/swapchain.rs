//! The images the eyes are drawn into: two layers each, left eye first, colour and depth, with the views to draw through.

#![allow(unsafe_code, reason = "makes Vulkan image views")]

use std::ops::Range;
use std::sync::Arc;

use ash::vk;
use openxr::sys;

use super::error::Error;
use super::raw::{RawSession, Shape};
use crate::gpu::{Gpu, Image, ImageInfo};

/// Layers of every image: the two eyes.
pub(super) const LAYERS: u32 = 2;

/// How long a frame waits for an image that the runtime still reads, in nanoseconds. Longer than any display's frame, and
/// short enough that a stuck runtime does not freeze the rest of the program.
const IMAGE_TIMEOUT_NS: i64 = 250_000_000;

/// Depth of the eye images.
pub(super) const DEPTH_FORMAT: vk::Format = vk::Format::D32_SFLOAT;

/// One two-layer image to draw into, and its views.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Surface {
    /// The image: 2 layers, 1 level, 1 sample.
    pub image: vk::Image,
    /// Its format, which is also that of its views.
    pub format: vk::Format,
    /// The layout it is in when it is acquired. It has to be back in its attachment layout
    /// (`COLOR_ATTACHMENT_OPTIMAL` or `DEPTH_STENCIL_ATTACHMENT_OPTIMAL`) when the frame's work is done. `UNDEFINED` is
    /// a depth image that is not submitted: all frames share it, so wait for the depth writes of the frame before.
    pub layout: vk::ImageLayout,
    /// Both layers (2D array): for one multiview pass.
    pub both: vk::ImageView,
    /// A layer each (2D), left and right: for a pass per eye.
    pub per_eye: [vk::ImageView; 2],
}

/// Colour or depth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Use {
    Color,
    Depth,
}

impl Use {
    fn aspect(self) -> vk::ImageAspectFlags {
        match self {
            Self::Color => vk::ImageAspectFlags::COLOR,
            Self::Depth => vk::ImageAspectFlags::DEPTH,
        }
    }

    fn layout(self) -> vk::ImageLayout {
        match self {
            Self::Color => vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL,
            Self::Depth => vk::ImageLayout::DEPTH_STENCIL_ATTACHMENT_OPTIMAL,
        }
    }

    /// Colour is read too: by the mirror and by captures. What pixels of several samples are resolved to is copied to the
    /// images where it cannot be resolved to them: where their format does not encode sRGB by itself, or the device does
    /// not resolve to any layer.
    fn flags(self, format: vk::Format, gpu: &Gpu) -> sys::SwapchainUsageFlags {
        use sys::SwapchainUsageFlags as Flags;
        let encodes = matches!(format, vk::Format::R8G8B8A8_SRGB | vk::Format::B8G8R8A8_SRGB);
        let (flags, copied) = match self {
            Self::Color => (Flags::COLOR_ATTACHMENT | Flags::TRANSFER_SRC, !encodes),
            Self::Depth => (Flags::DEPTH_STENCIL_ATTACHMENT, false),
        };
        if copied || !gpu.info.resolves_to_layers { flags | Flags::TRANSFER_DST } else { flags }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Color => "eye colour",
            Self::Depth => "eye depth",
        }
    }
}

/// The colour format to use, and whether the shader has to encode sRGB itself since the format does not.
///
/// # Errors
/// `Unsupported` when the runtime offers no 8-bit colour at all.
pub(super) fn choose_color(offered: &[vk::Format]) -> Result<(vk::Format, bool), Error> {
    let wanted = [
        (vk::Format::R8G8B8A8_SRGB, false),
        (vk::Format::B8G8R8A8_SRGB, false),
        (vk::Format::R8G8B8A8_UNORM, true),
        (vk::Format::B8G8R8A8_UNORM, true),
    ];
    wanted.into_iter().find(|(format, _)| offered.contains(format)).ok_or_else(|| {
        Error::Unsupported(
            "the OpenXR runtime offers no 8-bit colour images: update the headset's software".into(),
        )
    })
}

/// How far an image has come since it was asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Hold {
    /// The runtime has them all.
    None,
    /// Ours, but the runtime may still be reading it.
    Acquired(usize),
    /// Ours to draw into.
    Ready(usize),
}

/// Which of a swapchain's images is whose.
pub(super) struct Chain {
    pub(super) images: Vec<vk::Image>,
    hold: Hold,
    /// An image was given back: there is something to show.
    released: bool,
    handle: sys::Swapchain,
    pub(super) raw: Arc<RawSession>,
}

impl Chain {
    pub(super) fn new(
        raw: &Arc<RawSession>,
        format: vk::Format,
        usage: sys::SwapchainUsageFlags,
        shape: Shape,
    ) -> Result<Self, Error> {
        let handle = raw.create_swapchain(format, usage, shape)?;
        let mut chain =
            Self { images: Vec::new(), hold: Hold::None, released: false, handle, raw: Arc::clone(raw) };
        chain.images = raw.swapchain_images(handle)?;
        Ok(chain)
    }

    /// The swapchain, if there is something in it to show.
    pub(super) fn shown(&self) -> Option<sys::Swapchain> {
        self.released.then_some(self.handle)
    }

    /// Asks the runtime for the next image, unless one is held already.
    pub(super) fn acquire(&mut self) -> Result<(), Error> {
        if self.hold == Hold::None {
            let index = self.raw.acquire_image(self.handle)? as usize;
            if index >= self.images.len() {
                return Err(Error::Call {
                    call: "xrAcquireSwapchainImage (image out of range)",
                    code: sys::Result::ERROR_RUNTIME_FAILURE,
                });
            }
            self.hold = Hold::Acquired(index);
        }
        Ok(())
    }

    /// Which image to draw into; `None` while the runtime is not done with it, in which case it stays acquired and the
    /// next frame waits for it again.
    pub(super) fn wait(&mut self) -> Result<Option<usize>, Error> {
        if let Hold::Acquired(index) = self.hold
            && self.raw.wait_image(self.handle, IMAGE_TIMEOUT_NS)?
        {
            self.hold = Hold::Ready(index);
        }
        Ok(match self.hold {
            Hold::Ready(index) => Some(index),
            _ => None,
        })
    }

    /// Gives the image back, if there is one that may be given back.
    pub(super) fn release(&mut self) -> Result<(), Error> {
        if let Hold::Ready(_) = self.hold {
            self.raw.release_image(self.handle)?;
            self.hold = Hold::None;
            self.released = true;
        }
        Ok(())
    }
}

impl Drop for Chain {
    fn drop(&mut self) {
        if !self.raw.hung() {
            self.raw.destroy_swapchain(self.handle);
        }
    }
}

/// A runtime's swapchain of two-layer images.
pub(super) struct Swapchain {
    surfaces: Vec<Surface>,
    chain: Chain,
}

impl Swapchain {
    pub(super) fn new(
        raw: &Arc<RawSession>,
        kind: Use,
        format: vk::Format,
        extent: vk::Extent2D,
    ) -> Result<Self, Error> {
        let shape = Shape { extent, faces: 1, array: LAYERS };
        let chain = Chain::new(raw, format, kind.flags(format, &raw.gpu), shape)?;
        let mut swapchain = Self { surfaces: Vec::with_capacity(chain.images.len()), chain };
        for (i, &image) in swapchain.chain.images.iter().enumerate() {
            let name = format!("{} {i}", kind.name());
            let surface = Surface::new(&raw.gpu, kind, image, format, kind.layout(), &name)?;
            swapchain.surfaces.push(surface);
        }
        Ok(swapchain)
    }

    pub(super) fn handle(&self) -> sys::Swapchain {
        self.chain.handle
    }

    pub(super) fn acquire(&mut self) -> Result<(), Error> {
        self.chain.acquire()
    }

    pub(super) fn wait(&mut self) -> Result<Option<Surface>, Error> {
        Ok(self.chain.wait()?.map(|index| self.surfaces[index]))
    }

    pub(super) fn release(&mut self) -> Result<(), Error> {
        self.chain.release()
    }
}

impl Drop for Swapchain {
    fn drop(&mut self) {
        if !self.chain.raw.hung() {
            self.surfaces.iter().for_each(|surface| surface.destroy(&self.chain.raw.gpu));
        }
    }
}

/// Where depth goes.
pub(super) enum DepthImages {
    /// To the runtime, with the colour: it reprojects the better for it.
    Submitted(Swapchain),
    /// Nowhere: the runtime takes none. One image serves all frames, since each clears it.
    Kept(Image),
}

impl DepthImages {
    pub(super) fn new(raw: &Arc<RawSession>, submit: bool, extent: vk::Extent2D) -> Result<Self, Error> {
        if submit {
            return Swapchain::new(raw, Use::Depth, DEPTH_FORMAT, extent).map(Self::Submitted);
        }
        let info = ImageInfo {
            name: Use::Depth.name(),
            width: extent.width,
            height: extent.height,
            layers: LAYERS,
            format: DEPTH_FORMAT,
            usage: vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT,
            ..ImageInfo::default()
        };
        Image::new(&raw.gpu, &info).map(Self::Kept).map_err(Error::Gpu)
    }

    /// The swapchain that goes with every frame, if depth is submitted.
    pub(super) fn submitted(&self) -> Option<sys::Swapchain> {
        match self {
            Self::Submitted(swapchain) => Some(swapchain.handle()),
            Self::Kept(_) => None,
        }
    }

    pub(super) fn acquire(&mut self) -> Result<(), Error> {
        match self {
            Self::Submitted(swapchain) => swapchain.acquire(),
            Self::Kept(_) => Ok(()),
        }
    }

    pub(super) fn wait(&mut self) -> Result<Option<Surface>, Error> {
        match self {
            Self::Submitted(swapchain) => swapchain.wait(),
            Self::Kept(image) => Ok(Some(Surface {
                image: image.raw,
                format: image.format,
                layout: vk::ImageLayout::UNDEFINED,
                both: image.view,
                per_eye: [image.layer_views[0], image.layer_views[1]],
            })),
        }
    }

    pub(super) fn release(&mut self) -> Result<(), Error> {
        match self {
            Self::Submitted(swapchain) => swapchain.release(),
            Self::Kept(_) => Ok(()),
        }
    }
}

/// A view of some layers of a swapchain's image, of a format and aspect that it has.
pub(super) fn view_of(
    gpu: &Gpu,
    image: vk::Image,
    (format, aspect): (vk::Format, vk::ImageAspectFlags),
    layers: Range<u32>,
) -> Result<vk::ImageView, vk::Result> {
    let shape = match layers.len() {
        1 => vk::ImageViewType::TYPE_2D,
        _ => vk::ImageViewType::TYPE_2D_ARRAY,
    };
    let range = vk::ImageSubresourceRange::default()
        .aspect_mask(aspect)
        .level_count(1)
        .base_array_layer(layers.start)
        .layer_count(layers.len() as u32);
    let info = vk::ImageViewCreateInfo::default()
        .image(image)
        .view_type(shape)
        .format(format)
        .subresource_range(range);
    // SAFETY: a live image of this device; the driver is asked for nothing else than what the runtime made.
    unsafe { gpu.device.create_image_view(&info, None) }
}

impl Surface {
    fn new(
        gpu: &Gpu,
        kind: Use,
        image: vk::Image,
        format: vk::Format,
        layout: vk::ImageLayout,
        name: &str,
    ) -> Result<Self, Error> {
        gpu.name(image, name);
        let view = |layers: Range<u32>| {
            let name = format!("{name}, layers {}..{}", layers.start, layers.end);
            let view = view_of(gpu, image, (format, kind.aspect()), layers)
                .map_err(|code| Error::Vulkan { what: "making a view of an eye image", code })?;
            gpu.name(view, &name);
            Ok(view)
        };
        // Collected first, so that a failure in the middle leaks none.
        let made = [0..LAYERS, 0..1, 1..2].map(view);
        let [Ok(both), Ok(left), Ok(right)] = made else {
            let mut failure =
                Error::Vulkan { what: "making a view of an eye image", code: vk::Result::ERROR_UNKNOWN };
            for one in made {
                match one {
                    // SAFETY: made above and used by nobody.
                    Ok(view) => unsafe { gpu.device.destroy_image_view(view, None) },
                    Err(error) => failure = error,
                }
            }
            return Err(failure);
        };
        Ok(Self { image, format, layout, both, per_eye: [left, right] })
    }

    fn destroy(&self, gpu: &Gpu) {
        for view in [self.both, self.per_eye[0], self.per_eye[1]] {
            // SAFETY: made by `new`; the session waits for the GPU before its images go.
            unsafe { gpu.device.destroy_image_view(view, None) };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_is_preferred_and_plain_formats_are_encoded_by_the_shader() {
        use vk::Format as F;
        let choose = |offered: &[F]| choose_color(offered).ok();
        let all = [F::B8G8R8A8_UNORM, F::R8G8B8A8_UNORM, F::B8G8R8A8_SRGB, F::R8G8B8A8_SRGB];
        assert_eq!(choose(&all), Some((F::R8G8B8A8_SRGB, false)));
        assert_eq!(choose(&all[..3]), Some((F::B8G8R8A8_SRGB, false)));
        assert_eq!(choose(&all[..2]), Some((F::R8G8B8A8_UNORM, true)));
        assert_eq!(choose(&all[..1]), Some((F::B8G8R8A8_UNORM, true)));
        assert!(matches!(choose_color(&[F::R16_SFLOAT]), Err(Error::Unsupported(_))));
    }
}
