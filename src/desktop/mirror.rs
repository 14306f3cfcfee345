//! The mirror: the eyes' pictures in the window.

use std::any::Any;
use std::sync::Arc;

use anyhow::Result;
use ash::vk;
use raw_window_handle::{HasDisplayHandle, HasWindowHandle};

use super::compose::{Composer, Scene};
use super::pane::Sights;
use crate::gpu::{Gpu, Lost, Presenter, Shown};

/// Shows pictures in the window, and never waits for it.
pub struct Mirror {
    /// Goes first: what it has in flight uses the other.
    presenter: Presenter,
    composer: Composer,
}

impl Mirror {
    /// For a window that has no other mirror.
    ///
    /// # Errors
    /// Out of memory, or a way was chosen that is none.
    pub fn new<W>(gpu: &Arc<Gpu>, window: &Arc<W>) -> Result<Mirror>
    where
        W: HasWindowHandle + HasDisplayHandle + Any + Send + Sync,
    {
        Ok(Mirror { presenter: Presenter::new(gpu, window)?, composer: Composer::new(gpu)? })
    }

    /// The device.
    pub fn gpu(&self) -> &Arc<Gpu> {
        self.presenter.gpu()
    }

    /// Draws with the shaders that there are now.
    ///
    /// # Errors
    /// They cannot be used, or the device is lost: all stays as it was.
    pub fn compose_anew(&mut self) -> Result<()> {
        let composer = Composer::new(self.gpu())?;
        self.presenter.wait_drawn()?;
        self.composer = composer;
        Ok(())
    }

    /// Shows a scene in a window of so many pixels, unless the window is busy.
    ///
    /// # Errors
    /// The device is lost.
    pub fn show(&mut self, scene: &Scene<'_>, sights: Sights, window: [u32; 2]) -> Result<Shown, Lost> {
        let size = vk::Extent2D { width: window[0], height: window[1] };
        let composer = &mut self.composer;
        self.presenter.show(size, |frame, canvas| {
            let panes = sights.panes([canvas.extent.width, canvas.extent.height]);
            if let Err(error) = composer.record(frame, canvas, scene, panes) {
                tracing::warn!("the window's picture is not drawn: {error:#}");
            }
        })
    }

    /// Waits until no scene shown before is in use any more.
    ///
    /// # Errors
    /// The device is lost.
    pub fn wait_drawn(&self) -> Result<(), Lost> {
        self.presenter.wait_drawn()
    }
}
