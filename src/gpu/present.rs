//! A window's pictures: drawn beside the frames, shown by a thread of their own, so that the window holds nothing up.

use std::any::Any;
use std::ffi::CStr;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use ash::{khr, vk};
use raw_window_handle::{HasDisplayHandle, HasWindowHandle, RawDisplayHandle};

use super::buffer::{Buffer, BufferInfo, Location};
use super::context::{DeviceInfo, Gpu};
use super::frames::{Frame, Frames, Lost, SemaphoreAt};
use super::image::{Image, ImageInfo};
use super::paste::Paste;
use super::surface::Surface;
use super::sync::{Access, Transition};

/// Pictures that may be on their way to the window: one on show, one that waits.
const IN_FLIGHT: usize = 2;

/// Longest wait for drawing to end when the window goes: a software driver may be busy with a large frame.
const TIMEOUT: Duration = Duration::from_secs(60);

/// Longest wait for the window to let go of its last picture.
const PATIENCE: Duration = Duration::from_secs(2);

/// From one try to open the way to the window to the next.
const RETRY: Duration = Duration::from_secs(1);

/// Chooses the way: `swapchain` or `copy`.
const WAY_VARIABLE: &str = "FATHOMLESS_WINDOW";

/// The format of what is drawn: that of Vulkan's windows nearly everywhere, and of copied pictures.
const FORMAT: vk::Format = vk::Format::B8G8R8A8_UNORM;

/// The instance extension by which Vulkan draws to windows of a display's platform.
///
/// # Errors
/// Vulkan knows no such platform.
#[allow(unsafe_code, reason = "names of extensions come as C strings")]
pub fn surface_extension(display: RawDisplayHandle) -> Result<&'static CStr> {
    let names = ash_window::enumerate_required_extensions(display)
        .context("Vulkan does not know this kind of display")?;
    // SAFETY: these are names of extensions that live for ever.
    let names = names.iter().map(|name| unsafe { CStr::from_ptr(*name) });
    let own = names.into_iter().find(|name| *name != khr::surface::NAME);
    own.context("Vulkan does not know this kind of display")
}

/// How pictures get into a window.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// Vulkan shows them: a swapchain. They never leave the GPU.
    Swapchain,
    /// They are copied to the host's memory, and the display is given them without Vulkan. A software driver does nothing
    /// else, but holds up the queue while it does (Mesa's, seen in 22.3.6, sends the picture within the call that shows it).
    Copy,
}

impl Way {
    fn new(info: &DeviceInfo, has_surfaces: bool) -> Result<Way> {
        match std::env::var(WAY_VARIABLE).ok().as_deref() {
            None | Some("") if info.software || !has_surfaces => Ok(Way::Copy),
            None | Some("") => Ok(Way::Swapchain),
            Some("copy") => Ok(Way::Copy),
            Some("swapchain") if has_surfaces => Ok(Way::Swapchain),
            Some("swapchain") => bail!("{} cannot show pictures in windows (no VK_KHR_swapchain)", info.name),
            Some(other) => bail!("{WAY_VARIABLE}={other:?} is neither \"swapchain\" nor \"copy\""),
        }
    }
}

/// What came of [`Presenter::show`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shown {
    /// The picture is on its way to the window.
    Yes,
    /// The window is busy, hidden or of no size: this picture is left out.
    Skipped,
}

/// Where a picture for the window is drawn, in layout COLOR_ATTACHMENT_OPTIMAL.
#[derive(Debug, Clone, Copy)]
pub struct Canvas {
    /// Which of the pictures in flight it is, from 0: choose what belongs to one by it.
    pub index: usize,
    /// What to draw to.
    pub view: vk::ImageView,
    /// Pixels.
    pub extent: vk::Extent2D,
}

/// A picture on its way: the frames' thread has it, or the presenting one, never both.
pub(super) struct Picture {
    index: usize,
    pub(super) image: Image,
    /// What is in the image, for the host: [`Way::Copy`].
    pub(super) pixels: Option<Buffer>,
    /// When it is drawn.
    pub(super) drawn: SemaphoreAt,
}

impl Picture {
    fn new(gpu: &Arc<Gpu>, way: Way, index: usize, extent: vk::Extent2D) -> Result<Picture> {
        let vk::Extent2D { width, height } = extent;
        let image = Image::new(
            gpu,
            &ImageInfo {
                name: "window",
                width,
                height,
                format: FORMAT,
                usage: vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::TRANSFER_SRC,
                ..ImageInfo::default()
            },
        )?;
        let buffer = || {
            Buffer::new(
                gpu,
                &BufferInfo {
                    name: "window",
                    size: 4 * u64::from(width) * u64::from(height),
                    usage: vk::BufferUsageFlags::TRANSFER_DST,
                    location: Location::Readback,
                },
            )
        };
        let pixels = (way == Way::Copy).then(buffer).transpose()?;
        let never = SemaphoreAt {
            semaphore: vk::Semaphore::null(),
            value: 0,
            stage: vk::PipelineStageFlags2::ALL_COMMANDS,
        };
        Ok(Picture { index, image, pixels, drawn: never })
    }

    /// Records what `draw` draws, and what has to follow to have it shown.
    fn record(&self, frame: &mut Frame, draw: impl FnOnce(&mut Frame, Canvas)) {
        let (image, aspect) = (self.image.raw, vk::ImageAspectFlags::COLOR);
        // It was shown, or it never will be: the presenting thread gave it back.
        let old = (Access::COPY_READ, vk::ImageLayout::UNDEFINED);
        let drawn = (Access::COLOUR_WRITE, vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL);
        let read = (Access::COPY_READ, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
        frame.commands().transition(&[Transition { image, aspect, from: old, to: drawn }]);
        let (view, extent) = (self.image.layer_views[0], self.image.extent);
        draw(frame, Canvas { index: self.index, view, extent });
        frame.commands().transition(&[Transition { image, aspect, from: drawn, to: read }]);
        if let Some(pixels) = &self.pixels {
            let layers = vk::ImageSubresourceLayers {
                aspect_mask: aspect,
                mip_level: 0,
                base_array_layer: 0,
                layer_count: 1,
            };
            let all = vk::BufferImageCopy::default().image_subresource(layers).image_extent(extent.into());
            frame.commands().copy_image_to_buffer((image, read.1), pixels, &[all]);
            frame.commands().barrier(Access::COPY_WRITE, Access::HOST_READ);
        }
    }
}

/// Shows pictures in a window. Whatever the window does, or does not do any more, nobody waits for it but a thread that
/// does nothing else; while that is busy, pictures are left out.
pub struct Presenter {
    frames: Frames,
    way: Way,
    /// The pictures that are not with the thread.
    pictures: [Option<Picture>; IN_FLIGHT],
    /// Those that are.
    away: [bool; IN_FLIGHT],
    /// No picture of this size can be had.
    refused: Option<vk::Extent2D>,
    to_show: Option<SyncSender<Picture>>,
    shown: Receiver<Picture>,
    thread: Option<JoinHandle<()>>,
    gpu: Arc<Gpu>,
}

impl Presenter {
    /// What [`Canvas::view`] has.
    pub const FORMAT: vk::Format = FORMAT;

    /// Pictures in flight: [`Canvas::index`] is below this.
    pub const IN_FLIGHT: usize = IN_FLIGHT;

    /// For a window that has no other presenter. Whether anything can be shown there is found out later: where it cannot,
    /// that is logged, and tried again.
    ///
    /// # Errors
    /// Out of memory, or a way was chosen that is none.
    pub fn new<W>(gpu: &Arc<Gpu>, window: &Arc<W>) -> Result<Self>
    where
        W: HasWindowHandle + HasDisplayHandle + Any + Send + Sync,
    {
        let way = Way::new(&gpu.info, gpu.has_surfaces)?;
        let mut frames = Frames::new(gpu, IN_FLIGHT)?;
        frames.timeout = TIMEOUT;
        let (to_show, to_do) = sync_channel(IN_FLIGHT);
        let (done, shown) = sync_channel(IN_FLIGHT);
        let outlet = Outlet { way, gpu: Arc::clone(gpu), window: Arc::clone(window) };
        let thread = std::thread::Builder::new().name("window".into()).spawn(move || {
            outlet.serve(to_do, &done);
            // Whoever hears no more from here knows that everything else has gone.
            drop(done);
        });
        Ok(Self {
            frames,
            way,
            pictures: [const { None }; IN_FLIGHT],
            away: [false; IN_FLIGHT],
            refused: None,
            to_show: Some(to_show),
            shown,
            thread: Some(thread.context("cannot start a thread for the window")?),
            gpu: Arc::clone(gpu),
        })
    }

    /// The device.
    pub fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// Draws a picture for a window of so many pixels, to be shown, unless the window is busy.
    ///
    /// # Errors
    /// The device is lost.
    pub fn show(&mut self, size: vk::Extent2D, draw: impl FnOnce(&mut Frame, Canvas)) -> Result<Shown, Lost> {
        self.take_back();
        let Some(index) = self.frames.free()?.filter(|index| !self.away[*index]) else {
            return Ok(Shown::Skipped);
        };
        let Some(mut picture) = self.picture(index, size) else { return Ok(Shown::Skipped) };
        let mut frame = self.frames.begin()?;
        picture.record(&mut frame, draw);
        let serial = self.frames.submit(frame, &[], &[])?;
        picture.drawn = self.frames.end_of(serial);
        self.away[index] = true;
        if let Some(thread) = &self.to_show
            && let Err(unsent) = thread.send(picture)
        {
            // The thread has ended by a fault, which was logged.
            self.frames.bury(unsent.0);
        }
        Ok(Shown::Yes)
    }

    /// Waits until what was drawn for the window is drawn: nothing it was drawn from is in use any more.
    ///
    /// # Errors
    /// The device is lost.
    pub fn wait_drawn(&self) -> Result<(), Lost> {
        self.frames.wait_idle()
    }

    fn take_back(&mut self) {
        while let Ok(picture) = self.shown.try_recv() {
            let index = picture.index;
            self.away[index] = false;
            self.pictures[index] = Some(picture);
        }
    }

    /// A picture of this size that is not in use; None where there can be none.
    fn picture(&mut self, index: usize, size: vk::Extent2D) -> Option<Picture> {
        let most = self.gpu.info.limits.max_image_dimension2_d;
        let extent = vk::Extent2D { width: size.width.min(most), height: size.height.min(most) };
        if extent.width == 0 || extent.height == 0 || self.refused == Some(extent) {
            return None;
        }
        self.refused = None;
        let fits = |picture: &Picture| picture.image.extent == extent;
        // One of another size is free to go, as all that drew to it has finished.
        if let Some(picture) = self.pictures[index].take().filter(fits) {
            return Some(picture);
        }
        match Picture::new(&self.gpu, self.way, index, extent) {
            Ok(picture) => Some(picture),
            Err(error) => {
                tracing::warn!("nothing is shown in the window at this size: {error:#}");
                self.refused = Some(extent);
                None
            }
        }
    }
}

impl Drop for Presenter {
    fn drop(&mut self) {
        self.to_show = None;
        if let Err(lost) = self.frames.wait_idle() {
            tracing::warn!("{lost}");
        }
        let deadline = Instant::now() + PATIENCE;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            match self.shown.recv_timeout(left) {
                Ok(_) => {}
                Err(RecvTimeoutError::Disconnected) => break,
                Err(RecvTimeoutError::Timeout) => {
                    // It may go on at any time, with what it holds.
                    tracing::warn!("the window does not take its last picture: it is left behind");
                    self.gpu.abandon();
                    return;
                }
            }
        }
        if self.thread.take().is_some_and(|thread| thread.join().is_err()) {
            tracing::warn!("showing pictures in the window ended by a fault of the program");
        }
    }
}

/// The thread's end of it.
struct Outlet<W> {
    way: Way,
    gpu: Arc<Gpu>,
    window: Arc<W>,
}

/// An open way to the window.
enum Open<W> {
    Surface(Box<Surface>),
    Paste(Paste<W>),
}

impl<W> Outlet<W>
where
    W: HasWindowHandle + HasDisplayHandle + Any + Send + Sync,
{
    /// Shows picture after picture and gives each back, until there will be no more.
    fn serve(self, to_do: Receiver<Picture>, done: &SyncSender<Picture>) {
        let mut open: Option<Open<W>> = None;
        let mut retry = Instant::now();
        let mut said = String::new();
        while let Ok(mut picture) = to_do.recv() {
            // Of several that wait, the last is the one to show.
            while let Ok(newer) = to_do.try_recv() {
                let older = std::mem::replace(&mut picture, newer);
                if done.send(older).is_err() {
                    return;
                }
            }
            if Instant::now() >= retry
                && let Err(error) = self.show(&mut open, &picture)
            {
                (open, retry) = (None, Instant::now() + RETRY);
                let why = format!("{error:#}");
                if why != said {
                    tracing::warn!("nothing is shown in the window: {why}");
                    said = why;
                }
            }
            if done.send(picture).is_err() {
                return;
            }
        }
    }

    fn show(&self, open: &mut Option<Open<W>>, picture: &Picture) -> Result<()> {
        let way = match open {
            Some(way) => way,
            None => open.insert(match self.way {
                Way::Swapchain => Open::Surface(Box::new(Surface::new(&self.gpu, &self.window)?)),
                Way::Copy => Open::Paste(Paste::new(&self.gpu, &self.window)?),
            }),
        };
        match way {
            Open::Surface(surface) => surface.show(picture),
            Open::Paste(paste) => paste.show(picture),
        }
    }
}
