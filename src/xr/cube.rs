//! A cubemap for the runtime to show behind the eyes' pictures: it is drawn when its contents change, not every frame.

#![allow(unsafe_code, reason = "makes Vulkan image views")]

use std::sync::Arc;

use ash::vk;
use openxr::sys;

use super::error::Error;
use super::raw::{RawSession, Shape};
use super::swapchain::{Chain, view_of};

/// The faces of a cubemap, in the order of its image's layers: +x −x +y −y +z −z.
const FACES: usize = 6;

/// A cubemap to draw into. Its image is acquired in `COLOR_ATTACHMENT_OPTIMAL` and has to be in it again when the
/// frame's work is done.
///
/// The runtime looks into it with the direction of the gaze, in the axes that [`Frame::show_cube`] turns. The
/// specification (`XR_KHR_composition_layer_cube`) calls that "direct sampling from cubemaps" and says nothing of
/// handedness, so that the graphics API's own rule holds: Vulkan's "Cube Map Face Selection", the same by which a
/// shader's cube sampler takes the direction. Nothing is mirrored.
///
/// [`Frame::show_cube`]: super::Frame::show_cube
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CubeSurface {
    /// The image: 6 layers, 1 level, 1 sample.
    pub image: vk::Image,
    /// Its format, that of the eyes' colour.
    pub format: vk::Format,
    /// Texels per side of a face.
    pub side: u32,
    /// A face each (2D): +x −x +y −y +z −z.
    pub faces: [vk::ImageView; FACES],
}

/// A runtime's swapchain of cubemaps.
pub(super) struct Cube {
    surfaces: Vec<CubeSurface>,
    pub(super) chain: Chain,
    pub(super) side: u32,
}

impl Cube {
    pub(super) fn new(raw: &Arc<RawSession>, format: vk::Format, side: u32) -> Result<Self, Error> {
        let extent = vk::Extent2D { width: side, height: side };
        let shape = Shape { extent, faces: FACES as u32, array: 1 };
        let usage = sys::SwapchainUsageFlags::COLOR_ATTACHMENT;
        let chain = Chain::new(raw, format, usage, shape)?;
        let mut cube = Self { surfaces: Vec::with_capacity(chain.images.len()), chain, side };
        for i in 0..cube.chain.images.len() {
            let image = cube.chain.images[i];
            raw.gpu.name(image, &format!("cube layer {i}"));
            // Kept at once, so that what is made goes again when the next one fails.
            cube.surfaces.push(CubeSurface { image, format, side, faces: [vk::ImageView::null(); FACES] });
            for face in 0..FACES {
                cube.surfaces[i].faces[face] = face_view(raw, image, format, face as u32)?;
            }
        }
        Ok(cube)
    }

    /// An image to draw into; `None` while the runtime is not done with it.
    pub(super) fn acquire(&mut self) -> Result<Option<CubeSurface>, Error> {
        self.chain.acquire()?;
        Ok(self.chain.wait()?.map(|index| self.surfaces[index]))
    }
}

impl Drop for Cube {
    fn drop(&mut self) {
        let raw = &self.chain.raw;
        if raw.hung() {
            return;
        }
        for view in self.surfaces.iter().flat_map(|surface| surface.faces) {
            // SAFETY: made by `new` or null; the session waits for the GPU before its images go.
            unsafe { raw.gpu.device.destroy_image_view(view, None) };
        }
    }
}

fn face_view(
    raw: &RawSession,
    image: vk::Image,
    format: vk::Format,
    face: u32,
) -> Result<vk::ImageView, Error> {
    view_of(&raw.gpu, image, (format, vk::ImageAspectFlags::COLOR), face..face + 1)
        .map_err(|code| Error::Vulkan { what: "making a view of a face of the cube layer", code })
}
