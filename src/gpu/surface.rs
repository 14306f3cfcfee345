//! Pictures in a window by Vulkan: its surface and swapchain. Whoever calls may be held up by the window.
#![allow(unsafe_code, reason = "calls Vulkan")]

use std::any::Any;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use ash::{khr, vk};
use raw_window_handle::{HasDisplayHandle, HasWindowHandle};

use super::context::{Gpu, Lane, nanoseconds};
use super::frames::{Frames, Lost, SemaphoreAt};
use super::present::Picture;
use super::sync::{Access, Transition};

/// Longest wait for an image of the window, after which the picture is left out: the window may be hidden.
const WAIT: Duration = Duration::from_millis(50);

/// Longest wait for a copy to a window's image.
const TIMEOUT: Duration = Duration::from_secs(60);

/// A window's surface. No lock is held while it waits for the window, but for the queue's while a picture is handed over;
/// where the device has a second queue, that one is nobody else's.
pub(super) struct Surface {
    frames: Frames,
    /// Signalled when the window has given an image.
    acquired: vk::Semaphore,
    chain: Option<Chain>,
    /// The chain no longer fits the window.
    stale: bool,
    format: vk::SurfaceFormatKHR,
    mode: vk::PresentModeKHR,
    raw: vk::SurfaceKHR,
    surfaces: khr::surface::Instance,
    swapchains: khr::swapchain::Device,
    gpu: Arc<Gpu>,
    /// Outlives the surface.
    _window: Arc<dyn Any + Send + Sync>,
}

/// A window's images at one size.
struct Chain {
    raw: vk::SwapchainKHR,
    images: Vec<vk::Image>,
    /// Signalled when an image is drawn.
    drawn: Vec<vk::Semaphore>,
    extent: vk::Extent2D,
    /// Size of the picture that it was made for.
    wanted: vk::Extent2D,
    swapchains: khr::swapchain::Device,
    gpu: Arc<Gpu>,
}

impl Surface {
    pub(super) fn new<W>(gpu: &Arc<Gpu>, window: &Arc<W>) -> Result<Self>
    where
        W: HasWindowHandle + HasDisplayHandle + Any + Send + Sync,
    {
        let display = window.display_handle().context("the display is gone")?.as_raw();
        let handle = window.window_handle().context("the window is gone")?.as_raw();
        let mut frames = Frames::in_lane(gpu, 1, Lane::Window)?;
        frames.timeout = TIMEOUT;
        let acquired = semaphore(gpu)?;
        // SAFETY: both handles are of the window, which is kept until the surface is destroyed; the instance is the
        // entry's and lives as long as `gpu`.
        let made = unsafe { ash_window::create_surface(gpu.entry(), &gpu.instance, display, handle, None) };
        let raw = made
            // SAFETY: nothing has used it yet.
            .inspect_err(|_| gpu.destroy(|device| unsafe { device.destroy_semaphore(acquired, None) }))
            .context("Vulkan cannot draw to the window")?;
        let mut made = Self {
            frames,
            acquired,
            chain: None,
            stale: false,
            format: vk::SurfaceFormatKHR::default(),
            mode: vk::PresentModeKHR::FIFO,
            raw,
            surfaces: khr::surface::Instance::new(gpu.entry(), &gpu.instance),
            swapchains: khr::swapchain::Device::new(&gpu.instance, &gpu.device),
            gpu: Arc::clone(gpu),
            _window: Arc::clone(window) as Arc<dyn Any + Send + Sync>,
        };
        made.choose()?;
        Ok(made)
    }

    /// Chooses format and mode: no vertical sync where that can be had, as it is the headset that sets the pace.
    fn choose(&mut self) -> Result<()> {
        let (physical, surface) = (self.gpu.physical, self.raw);
        // SAFETY: the surface is alive, and `physical` is of its instance.
        let (supported, formats, modes, caps) = unsafe {
            (
                self.surfaces.get_physical_device_surface_support(
                    physical,
                    self.gpu.queue_family,
                    surface,
                )?,
                self.surfaces.get_physical_device_surface_formats(physical, surface)?,
                self.surfaces.get_physical_device_surface_present_modes(physical, surface)?,
                self.surfaces.get_physical_device_surface_capabilities(physical, surface)?,
            )
        };
        let name = &self.gpu.info.name;
        ensure!(supported, "{name} has no queue that can show pictures in the window");
        ensure!(
            caps.supported_usage_flags.contains(vk::ImageUsageFlags::TRANSFER_DST),
            "{name} cannot copy to the window"
        );
        // What is shown is sRGB already.
        let plain = [vk::Format::B8G8R8A8_UNORM, vk::Format::R8G8B8A8_UNORM];
        self.format = *formats
            .iter()
            .filter(|format| format.color_space == vk::ColorSpaceKHR::SRGB_NONLINEAR)
            .find(|format| plain.contains(&format.format))
            .with_context(|| format!("{name} offers no 8-bit pictures for the window"))?;
        let wanted = [vk::PresentModeKHR::MAILBOX, vk::PresentModeKHR::IMMEDIATE];
        self.mode = wanted.into_iter().find(|mode| modes.contains(mode)).unwrap_or(vk::PresentModeKHR::FIFO);
        tracing::debug!(format = ?self.format.format, mode = ?self.mode, "Vulkan shows pictures in the window");
        Ok(())
    }

    /// Shows a picture, once it is drawn, or leaves it out where the window gives no image for it.
    ///
    /// # Errors
    /// The surface is lost: another may do; or the device.
    pub(super) fn show(&mut self, picture: &Picture) -> Result<()> {
        match self.try_show(picture) {
            Ok(()) => Ok(()),
            Err(Refusal::Lost(lost)) => Err(lost.into()),
            Err(Refusal::Vulkan(vk::Result::ERROR_OUT_OF_DATE_KHR)) => {
                self.stale = true;
                Ok(())
            }
            Err(Refusal::Vulkan(vk::Result::NOT_READY | vk::Result::TIMEOUT)) => Ok(()),
            Err(Refusal::Vulkan(result)) => Err(result.into()),
        }
    }

    fn try_show(&mut self, picture: &Picture) -> Result<(), Refusal> {
        let size = picture.image.extent;
        if self.stale || self.chain.as_ref().is_none_or(|chain| chain.wanted != size) {
            self.remake(size)?;
        }
        let Some(chain) = &self.chain else { return Ok(()) };
        // The frame that last waited for the semaphore has finished: each is waited for.
        let (wait, no_fence) = (nanoseconds(WAIT), vk::Fence::null());
        // SAFETY: as above.
        let (image, suboptimal) =
            unsafe { self.swapchains.acquire_next_image(chain.raw, wait, self.acquired, no_fence) }?;
        self.stale |= suboptimal;
        let (target, drawn) = (chain.images[image as usize], chain.drawn[image as usize]);
        let (raw, extent) = (chain.raw, chain.extent);
        let mut frame = self.frames.begin()?;
        frame.pass(c"window", |commands| {
            let aspect = vk::ImageAspectFlags::COLOR;
            let written = (Access::COPY_WRITE, vk::ImageLayout::TRANSFER_DST_OPTIMAL);
            // From the stage that waits for the window.
            let given = (Access::COPY_WRITE, vk::ImageLayout::UNDEFINED);
            commands.transition(&[Transition { image: target, aspect, from: given, to: written }]);
            let from = (picture.image.raw, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
            // The window may be of another size by now, and of another order of colours.
            commands.blit(from, (target, written.1), &[whole(size, extent)]);
            let shown = (Access::NONE, vk::ImageLayout::PRESENT_SRC_KHR);
            commands.transition(&[Transition { image: target, aspect, from: written, to: shown }]);
        });
        let at = |semaphore, stage| SemaphoreAt { semaphore, value: 0, stage };
        let (before, after) = (vk::PipelineStageFlags2::ALL_TRANSFER, vk::PipelineStageFlags2::ALL_COMMANDS);
        let serial =
            self.frames.submit(frame, &[at(self.acquired, before), picture.drawn], &[at(drawn, after)])?;
        let (waits, chains, images) = ([drawn], [raw], [image]);
        let info =
            vk::PresentInfoKHR::default().wait_semaphores(&waits).swapchains(&chains).image_indices(&images);
        // SAFETY: the queue is locked, the image acquired and in the layout for it.
        let present = |queue| unsafe { self.swapchains.queue_present(queue, &info) };
        let shown = self.gpu.with_lane(Lane::Window, present);
        // Whatever came of that, the picture is read until here.
        self.frames.wait(serial)?;
        self.stale |= shown?;
        Ok(())
    }

    /// Images of the window's size; none where it has no size.
    fn remake(&mut self, size: vk::Extent2D) -> Result<(), Refusal> {
        let (physical, surface) = (self.gpu.physical, self.raw);
        // SAFETY: the surface is alive, and `physical` is of its instance.
        let caps = unsafe { self.surfaces.get_physical_device_surface_capabilities(physical, surface) }?;
        let (least, most) = (caps.min_image_extent, caps.max_image_extent);
        let extent = match caps.current_extent.width {
            // The window is as large as what is shown in it.
            u32::MAX => vk::Extent2D {
                width: size.width.clamp(least.width, most.width),
                height: size.height.clamp(least.height, most.height),
            },
            _ => caps.current_extent,
        };
        if extent.width == 0 || extent.height == 0 {
            return Err(Refusal::Vulkan(vk::Result::NOT_READY));
        }
        let most_images = if caps.max_image_count == 0 { u32::MAX } else { caps.max_image_count };
        let old = self.chain.take();
        let info = vk::SwapchainCreateInfoKHR::default()
            .surface(surface)
            // One on show, one that waits, one to draw.
            .min_image_count((caps.min_image_count + 1).max(3).min(most_images))
            .image_format(self.format.format)
            .image_color_space(self.format.color_space)
            .image_extent(extent)
            .image_array_layers(1)
            .image_usage(vk::ImageUsageFlags::TRANSFER_DST)
            .image_sharing_mode(vk::SharingMode::EXCLUSIVE)
            .pre_transform(caps.current_transform)
            .composite_alpha(opaque(caps.supported_composite_alpha))
            .present_mode(self.mode)
            .clipped(true)
            .old_swapchain(old.as_ref().map_or(vk::SwapchainKHR::null(), |old| old.raw));
        // SAFETY: the surface is alive and has no other live swapchain than the old one.
        let made = unsafe { self.swapchains.create_swapchain(&info, None) };
        if let Some(old) = old {
            // Its pictures may still be on their way.
            self.frames.bury(old);
        }
        let mut chain = Chain {
            raw: made?,
            images: Vec::new(),
            drawn: Vec::new(),
            extent,
            wanted: size,
            swapchains: self.swapchains.clone(),
            gpu: Arc::clone(&self.gpu),
        };
        // SAFETY: just made.
        chain.images = unsafe { self.swapchains.get_swapchain_images(chain.raw) }?;
        for _ in 0..chain.images.len() {
            let drawn = semaphore(&self.gpu)?;
            chain.drawn.push(drawn);
        }
        tracing::debug!(width = extent.width, height = extent.height, images = chain.images.len(), "window");
        self.chain = Some(chain);
        self.stale = false;
        Ok(())
    }
}

/// All of a picture to all of a window.
fn whole(from: vk::Extent2D, to: vk::Extent2D) -> vk::ImageBlit {
    let corners = |extent: vk::Extent2D| {
        let far = vk::Offset3D { x: extent.width as i32, y: extent.height as i32, z: 1 };
        [vk::Offset3D::default(), far]
    };
    let layer = vk::ImageSubresourceLayers {
        aspect_mask: vk::ImageAspectFlags::COLOR,
        mip_level: 0,
        base_array_layer: 0,
        layer_count: 1,
    };
    vk::ImageBlit::default()
        .src_subresource(layer)
        .src_offsets(corners(from))
        .dst_subresource(layer)
        .dst_offsets(corners(to))
}

/// Why a picture was not shown.
enum Refusal {
    Lost(Lost),
    Vulkan(vk::Result),
}

impl From<Lost> for Refusal {
    fn from(lost: Lost) -> Refusal {
        Refusal::Lost(lost)
    }
}

impl From<vk::Result> for Refusal {
    fn from(result: vk::Result) -> Refusal {
        Refusal::Vulkan(result)
    }
}

impl Drop for Surface {
    fn drop(&mut self) {
        if let Err(lost) = self.frames.wait_idle() {
            tracing::warn!("{lost}");
        }
        // What was handed over for showing is no frame's: only the queue knows of it.
        // SAFETY: the queue is locked. Where this fails, the device is lost.
        let idle = |queue| unsafe { self.gpu.device.queue_wait_idle(queue) };
        let _ = self.gpu.with_lane(Lane::Window, idle);
        self.chain = None;
        self.frames.clear();
        self.gpu.destroy(|device| {
            // SAFETY: all frames have finished, and no swapchain of the surface is left.
            unsafe {
                device.destroy_semaphore(self.acquired, None);
                self.surfaces.destroy_surface(self.raw, None);
            }
        });
    }
}

impl Drop for Chain {
    fn drop(&mut self) {
        self.gpu.destroy(|device| {
            // SAFETY: the frames that drew to it have finished (see `Frames::bury`).
            unsafe {
                self.drawn.iter().for_each(|semaphore| device.destroy_semaphore(*semaphore, None));
                self.swapchains.destroy_swapchain(self.raw, None);
            }
        });
    }
}

fn semaphore(gpu: &Gpu) -> Result<vk::Semaphore, vk::Result> {
    // SAFETY: plain creation on a live device.
    let made = unsafe { gpu.device.create_semaphore(&vk::SemaphoreCreateInfo::default(), None) }?;
    gpu.name(made, "window");
    Ok(made)
}

/// Opaque where that can be had, else whatever there is.
fn opaque(offered: vk::CompositeAlphaFlagsKHR) -> vk::CompositeAlphaFlagsKHR {
    let all = [
        vk::CompositeAlphaFlagsKHR::OPAQUE,
        vk::CompositeAlphaFlagsKHR::INHERIT,
        vk::CompositeAlphaFlagsKHR::PRE_MULTIPLIED,
        vk::CompositeAlphaFlagsKHR::POST_MULTIPLIED,
    ];
    all.into_iter().find(|alpha| offered.contains(*alpha)).unwrap_or(vk::CompositeAlphaFlagsKHR::OPAQUE)
}
