//! A flat rectangle that the runtime shows before the eyes' pictures: it is drawn when its contents change, not every
//! frame, and read at the display's full sharpness whenever the eyes' pictures were drawn.

#![allow(unsafe_code, reason = "makes Vulkan image views")]

use std::sync::Arc;

use ash::vk;
use openxr::sys;

use super::error::Error;
use super::frame::Frame;
use super::outcome::Outcome;
use super::raw::{QuadLayer, RawSession, Shape};
use super::runtime::Runtime;
use super::session::Session;
use super::swapchain::{Chain, view_of};
use super::view::{Pose, pose_to_sys};

/// A rectangle's image to draw into. It is acquired in `COLOR_ATTACHMENT_OPTIMAL` and has to be in it again when the
/// frame's work is done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct QuadSurface {
    /// The image: 1 layer, 1 level, 1 sample.
    pub image: vk::Image,
    /// Its format, that of the eyes' colour.
    pub format: vk::Format,
    /// Its pixels.
    pub extent: vk::Extent2D,
    /// All of it.
    pub view: vk::ImageView,
}

/// A runtime's swapchain of rectangles.
pub(super) struct Quad {
    surfaces: Vec<QuadSurface>,
    pub(super) chain: Chain,
    extent: vk::Extent2D,
    /// The runtime has refused a frame with it: it is not shown any more.
    refused: bool,
}

impl Quad {
    fn new(raw: &Arc<RawSession>, format: vk::Format, extent: vk::Extent2D) -> Result<Self, Error> {
        let shape = Shape { extent, faces: 1, array: 1 };
        let chain = Chain::new(raw, format, sys::SwapchainUsageFlags::COLOR_ATTACHMENT, shape)?;
        let surfaces = Vec::with_capacity(chain.images.len());
        let mut quad = Self { surfaces, chain, extent, refused: false };
        for i in 0..quad.chain.images.len() {
            let image = quad.chain.images[i];
            raw.gpu.name(image, &format!("quad layer {i}"));
            let view = whole_view(raw, image, format)?;
            // Kept at once, so that what is made goes again when the next one fails.
            quad.surfaces.push(QuadSurface { image, format, extent, view });
        }
        Ok(quad)
    }

    /// As a layer at `pose` (its middle; it faces +z); `None` before it was drawn, and where it is refused.
    pub(super) fn layer(&self, pose: &Pose, [width, height]: [f32; 2]) -> Option<QuadLayer> {
        let swapchain = self.chain.shown().filter(|_| !self.refused)?;
        let vk::Extent2D { width: across, height: down } = self.extent;
        Some(QuadLayer {
            image: sys::SwapchainSubImage {
                swapchain,
                image_rect: sys::Rect2Di {
                    offset: sys::Offset2Di { x: 0, y: 0 },
                    extent: sys::Extent2Di { width: across as i32, height: down as i32 },
                },
                image_array_index: 0,
            },
            pose: pose_to_sys(pose),
            size: sys::Extent2Df { width, height },
        })
    }

    /// The runtime does not take it: it is not shown any more.
    pub(super) fn refuse(&mut self, error: &Error) {
        tracing::info!("the OpenXR runtime takes no quad layer: {error}");
        self.refused = true;
    }

    /// An image to draw into; `None` while the runtime is not done with it.
    fn acquire(&mut self) -> Result<Option<QuadSurface>, Error> {
        self.chain.acquire()?;
        Ok(self.chain.wait()?.map(|index| self.surfaces[index]))
    }
}

/// Whether the same end of a frame may do without the quad layer: a time that is refused is refused with fewer layers, too.
pub(super) fn may_be_of_a_layer(error: &Error) -> bool {
    let is_of_the_time = matches!(error, Error::Call { code: sys::Result::ERROR_TIME_INVALID, .. });
    error.outcome() == Outcome::SkipFrame && !is_of_the_time
}

impl Session {
    /// Makes a rectangle of so many pixels for the runtime to show before the eyes' pictures:
    /// [`Frame::acquire_quad`] draws into it, [`Frame::show_quad`] shows it. False where the runtime has no room for
    /// another layer or no image of this kind, or there is no memory for it, which is no error: the session is as it
    /// was. `runtime` is the one that the session was made on.
    ///
    /// # Errors
    /// Losses.
    pub fn open_quad(&mut self, runtime: &Runtime, extent: vk::Extent2D) -> Result<bool, Error> {
        let about = runtime.info();
        let before = 1 + u32::from(self.cube.is_some());
        if about.max_layers != 0 && about.max_layers <= before {
            tracing::info!("the OpenXR runtime has no room for a quad layer: {} in all", about.max_layers);
            return Ok(false);
        }
        let fits = |side: u32, most: u32| most == 0 || side <= most;
        let [width, height] = about.max_image;
        if !(fits(extent.width, width) && fits(extent.height, height)) {
            tracing::info!("the OpenXR runtime takes no image as large as a quad layer needs");
            return Ok(false);
        }
        match Quad::new(&self.raw, self.info.color_format, extent) {
            Ok(quad) => self.quad = Some(quad),
            Err(error) if error.lost().is_some() => return Err(error),
            Err(error) => tracing::info!("there is no image for a quad layer: {error}"),
        }
        Ok(self.quad.is_some())
    }

    /// Whether there is a rectangle that the runtime has not refused to show.
    pub fn has_quad(&self) -> bool {
        self.quad.as_ref().is_some_and(|quad| !quad.refused)
    }
}

impl Frame<'_> {
    /// As [`Session::has_quad`].
    pub fn has_quad(&self) -> bool {
        self.session.has_quad()
    }

    /// The rectangle to draw anew, all of it: the runtime goes on showing the one drawn last until this frame ends.
    /// `None` where there is none ([`Session::open_quad`]), the runtime keeps it too long, or refuses to hand it out: then
    /// there is none from now on.
    ///
    /// # Errors
    /// Losses, and what calls for another session.
    pub fn acquire_quad(&mut self) -> Result<Option<QuadSurface>, Error> {
        let Some(quad) = &mut self.session.quad else { return Ok(None) };
        match quad.acquire() {
            Err(error) if error.outcome() == Outcome::GiveUp => {
                quad.refuse(&error);
                Ok(None)
            }
            acquired => acquired,
        }
    }

    /// Shows the rectangle drawn last, of this frame or an earlier one, before the eyes' pictures: its middle at `pose` in
    /// the session's space, facing +z of it, so many metres wide and high, its colours multiplied by their alpha.
    pub fn show_quad(&mut self, pose: &Pose, size_m: [f32; 2]) {
        self.quad = Some((*pose, size_m));
    }
}

impl Drop for Quad {
    fn drop(&mut self) {
        let raw = &self.chain.raw;
        if raw.hung() {
            return;
        }
        for surface in &self.surfaces {
            // SAFETY: made by `new`; the session waits for the GPU before its images go.
            unsafe { raw.gpu.device.destroy_image_view(surface.view, None) };
        }
    }
}

fn whole_view(raw: &RawSession, image: vk::Image, format: vk::Format) -> Result<vk::ImageView, Error> {
    view_of(&raw.gpu, image, (format, vk::ImageAspectFlags::COLOR), 0..1)
        .map_err(|code| Error::Vulkan { what: "making a view of the quad layer", code })
}
