//! Pictures in a window without Vulkan: copied out of the host's memory.

use std::num::NonZeroU32;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Result, anyhow, ensure};
use raw_window_handle::{HasDisplayHandle, HasWindowHandle};

use super::context::Gpu;
use super::present::Picture;

/// Longest wait for a picture to be drawn. It was submitted before, and all it waits for is the GPU.
const TIMEOUT: Duration = Duration::from_secs(60);

/// A window's own buffers in the host's memory.
pub(super) struct Paste<W> {
    surface: softbuffer::Surface<Arc<W>, Arc<W>>,
    gpu: Arc<Gpu>,
}

impl<W: HasWindowHandle + HasDisplayHandle> Paste<W> {
    pub(super) fn new(gpu: &Arc<Gpu>, window: &Arc<W>) -> Result<Self> {
        let what = |error| anyhow!("the display takes no pictures: {error}");
        let context = softbuffer::Context::new(Arc::clone(window)).map_err(what)?;
        let surface = softbuffer::Surface::new(&context, Arc::clone(window)).map_err(what)?;
        tracing::debug!("pictures are copied to the window");
        Ok(Self { surface, gpu: Arc::clone(gpu) })
    }

    /// Waits for the picture and for the window, then shows it.
    pub(super) fn show(&mut self, picture: &Picture) -> Result<()> {
        ensure!(self.gpu.wait_for(&picture.drawn, TIMEOUT)?, "the GPU does not finish the window's picture");
        let what = |error| anyhow!("the window takes no picture: {error}");
        let extent = picture.image.extent;
        let sides = (NonZeroU32::new(extent.width), NonZeroU32::new(extent.height));
        let ((Some(width), Some(height)), Some(pixels)) = (sides, &picture.pixels) else { return Ok(()) };
        self.surface.resize(width, height).map_err(what)?;
        let mut buffer = self.surface.buffer_mut().map_err(what)?;
        let count = buffer.len().min(width.get() as usize * height.get() as usize);
        // Both are blue, green, red and a byte that says nothing.
        buffer[..count].copy_from_slice(&pixels.slice::<u32>()[..count]);
        buffer.present().map_err(what)
    }
}
