//! A window's pictures: its surface and swapchain, shown without ever waiting for the window.
#![allow(unsafe_code, reason = "calls Vulkan")]

use std::any::Any;
use std::ffi::CStr;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use ash::{khr, vk};
use raw_window_handle::{HasDisplayHandle, HasWindowHandle, RawDisplayHandle};

use super::commands::Commands;
use super::context::Gpu;
use super::frames::{Frames, Lost, SemaphoreAt};
use super::sync::{Access, Transition};

/// Pictures that may be on their way to the window.
const IN_FLIGHT: usize = 2;

/// Longest wait for them when the window goes: a software driver may be busy with a large frame.
const TIMEOUT: Duration = Duration::from_secs(60);

/// The instance extension by which Vulkan draws to windows of a display's platform.
///
/// # Errors
/// Vulkan knows no such platform.
pub fn surface_extension(display: RawDisplayHandle) -> Result<&'static CStr> {
    let names = ash_window::enumerate_required_extensions(display)
        .context("Vulkan does not know this kind of display")?;
    // SAFETY: these are names of extensions that live for ever.
    let names = names.iter().map(|name| unsafe { CStr::from_ptr(*name) });
    let own = names.into_iter().find(|name| *name != khr::surface::NAME);
    own.context("Vulkan does not know this kind of display")
}

/// What came of [`Presenter::show`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shown {
    /// The window gets the picture.
    Yes,
    /// The window is busy, hidden or of no size: this picture is left out.
    Skipped,
    /// The window's surface is gone: make another presenter.
    SurfaceLost,
}

/// An image of a window, to be written by transfers, in layout TRANSFER_DST_OPTIMAL.
#[derive(Debug, Clone, Copy)]
pub struct WindowImage {
    /// The handle.
    pub raw: vk::Image,
    /// Pixels.
    pub extent: vk::Extent2D,
}

/// Shows pictures in a window. It never waits for the window: where that has no image to give, nothing is shown.
/// Mesa's software driver (seen in 22.3.6) sends the picture within the call that shows it, in every mode: an X server that
/// reads nothing any more then holds up whoever shows.
pub struct Presenter {
    frames: Frames,
    /// Signalled when the window has given an image; one per frame in flight.
    acquired: Vec<vk::Semaphore>,
    chain: Option<Chain>,
    /// The chain no longer fits the window.
    stale: bool,
    format: vk::SurfaceFormatKHR,
    mode: vk::PresentModeKHR,
    surface: vk::SurfaceKHR,
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
    /// Size of the window that it was made for.
    wanted: vk::Extent2D,
    swapchains: khr::swapchain::Device,
    gpu: Arc<Gpu>,
}

impl Presenter {
    /// For a window that has no other presenter.
    ///
    /// # Errors
    /// A sentence that says why pictures cannot be shown there.
    pub fn new<W>(gpu: &Arc<Gpu>, window: &Arc<W>) -> Result<Self>
    where
        W: HasWindowHandle + HasDisplayHandle + Send + Sync + 'static,
    {
        ensure!(gpu.presents, "{} cannot show pictures in windows (no VK_KHR_swapchain)", gpu.info.name);
        let display = window.display_handle().context("the display is gone")?.as_raw();
        let handle = window.window_handle().context("the window is gone")?.as_raw();
        // SAFETY: both handles are of the window, which is kept until the surface is destroyed; the instance is the
        // entry's and lives as long as `gpu`.
        let surface =
            unsafe { ash_window::create_surface(gpu.entry(), &gpu.instance, display, handle, None) }
                .context("Vulkan cannot draw to the window")?;
        let mut made = Self {
            frames: Frames::new(gpu, IN_FLIGHT)?,
            acquired: Vec::with_capacity(IN_FLIGHT),
            chain: None,
            stale: false,
            format: vk::SurfaceFormatKHR::default(),
            mode: vk::PresentModeKHR::FIFO,
            surface,
            surfaces: khr::surface::Instance::new(gpu.entry(), &gpu.instance),
            swapchains: khr::swapchain::Device::new(&gpu.instance, &gpu.device),
            gpu: Arc::clone(gpu),
            _window: Arc::clone(window) as Arc<dyn Any + Send + Sync>,
        };
        made.frames.timeout = TIMEOUT;
        for _ in 0..IN_FLIGHT {
            let semaphore = semaphore(gpu)?;
            made.acquired.push(semaphore);
        }
        made.choose()?;
        Ok(made)
    }

    /// Chooses format and mode: no vertical sync where that can be had, as it is the headset that sets the pace.
    fn choose(&mut self) -> Result<()> {
        let (physical, surface) = (self.gpu.physical, self.surface);
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
        tracing::debug!(format = ?self.format.format, mode = ?self.mode, "pictures are shown in the window");
        Ok(())
    }

    /// Shows what `draw` records in a window of so many pixels, unless that would take waiting.
    ///
    /// # Errors
    /// The device is lost.
    pub fn show(
        &mut self,
        size: vk::Extent2D,
        draw: impl FnOnce(Commands<'_>, WindowImage),
    ) -> Result<Shown, Lost> {
        match self.try_show(size, draw) {
            Ok(shown) => Ok(shown),
            Err(Refusal::Lost(lost)) => Err(lost),
            Err(Refusal::Vulkan(vk::Result::ERROR_SURFACE_LOST_KHR)) => Ok(Shown::SurfaceLost),
            Err(Refusal::Vulkan(vk::Result::ERROR_OUT_OF_DATE_KHR)) => {
                self.stale = true;
                Ok(Shown::Skipped)
            }
            Err(Refusal::Vulkan(vk::Result::NOT_READY | vk::Result::TIMEOUT)) => Ok(Shown::Skipped),
            Err(Refusal::Vulkan(result)) => Err(Lost::Device { result, pass: "mirror" }),
        }
    }

    fn try_show(
        &mut self,
        size: vk::Extent2D,
        draw: impl FnOnce(Commands<'_>, WindowImage),
    ) -> Result<Shown, Refusal> {
        if size.width == 0 || size.height == 0 {
            return Ok(Shown::Skipped);
        }
        let Some(index) = self.frames.free()? else { return Ok(Shown::Skipped) };
        if self.stale || self.chain.as_ref().is_none_or(|chain| chain.wanted != size) {
            self.remake(size)?;
        }
        let Some(chain) = &self.chain else { return Ok(Shown::Skipped) };
        let acquired = self.acquired[index];
        // SAFETY: the frame that last waited for this semaphore has finished.
        let (image, suboptimal) =
            unsafe { self.swapchains.acquire_next_image(chain.raw, 0, acquired, vk::Fence::null()) }?;
        self.stale |= suboptimal;
        let (target, drawn) = (chain.images[image as usize], chain.drawn[image as usize]);
        let (raw, extent) = (chain.raw, chain.extent);
        let mut frame = self.frames.begin()?;
        frame.pass(c"mirror", |commands| {
            let aspect = vk::ImageAspectFlags::COLOR;
            let written = (Access::COPY_WRITE, vk::ImageLayout::TRANSFER_DST_OPTIMAL);
            // From the stage that waits for the window.
            let given = (Access::COPY_WRITE, vk::ImageLayout::UNDEFINED);
            commands.transition(&[Transition { image: target, aspect, from: given, to: written }]);
            draw(commands, WindowImage { raw: target, extent });
            let shown = (Access::NONE, vk::ImageLayout::PRESENT_SRC_KHR);
            commands.transition(&[Transition { image: target, aspect, from: written, to: shown }]);
        });
        let at = |semaphore, stage| SemaphoreAt { semaphore, value: 0, stage };
        let (before, after) = (vk::PipelineStageFlags2::ALL_TRANSFER, vk::PipelineStageFlags2::ALL_COMMANDS);
        self.frames.submit(frame, &[at(acquired, before)], &[at(drawn, after)])?;
        let (waits, chains, images) = ([drawn], [raw], [image]);
        let info =
            vk::PresentInfoKHR::default().wait_semaphores(&waits).swapchains(&chains).image_indices(&images);
        // SAFETY: the queue is locked, the image acquired and in the layout for it.
        let shown = self.gpu.with_queue(|queue| unsafe { self.swapchains.queue_present(queue, &info) });
        self.stale |= shown?;
        Ok(Shown::Yes)
    }

    /// Images of the window's size; none where it has no size.
    fn remake(&mut self, size: vk::Extent2D) -> Result<(), Refusal> {
        let (physical, surface) = (self.gpu.physical, self.surface);
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

impl Drop for Presenter {
    fn drop(&mut self) {
        if let Err(lost) = self.frames.wait_idle() {
            tracing::warn!("{lost}");
        }
        // What was handed over for showing is no frame's: only the queue knows of it.
        // SAFETY: the queue is locked. Where this fails, the device is lost.
        let _ = self.gpu.with_queue(|queue| unsafe { self.gpu.device.queue_wait_idle(queue) });
        self.chain = None;
        self.frames.clear();
        self.gpu.destroy(|device| {
            // SAFETY: all frames have finished, and no swapchain of the surface is left.
            unsafe {
                self.acquired.iter().for_each(|semaphore| device.destroy_semaphore(*semaphore, None));
                self.surfaces.destroy_surface(self.surface, None);
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
