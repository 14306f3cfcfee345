//! A frame: waited for, begun, drawn, and always ended.

use ash::vk;
use glam::Quat;
use openxr::sys;

use super::cube::CubeSurface;
use super::error::Error;
use super::outcome::Outcome;
use super::quad::may_be_of_a_layer;
use super::raw::{CubeLayer, Layer, LayerEye};
use super::session::Session;
use super::swapchain::Surface;
use super::view::{Pose, Views, fov_to_sys, pose_to_sys, quat_to_sys};
use crate::controllers::Hands;

/// What the runtime wants of the next frame. Hand it to [`Session::begin_frame`].
#[derive(Debug, PartialEq, Eq)]
#[must_use = "a frame that was waited for has to be begun and ended"]
pub struct Tick {
    /// When it will be seen, in the runtime's nanoseconds.
    pub display_time_ns: i64,
    /// From this frame to the next, in nanoseconds.
    pub period_ns: i64,
    /// False: nothing would be seen, so draw nothing and end the frame without views.
    pub should_render: bool,
}

/// How far the session is within a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    /// No frame is open.
    Between,
    /// Waited for, for this display time.
    Waited(i64),
    /// Begun, for this display time.
    Begun(i64),
}

/// What to draw a frame into: layer 0 is the left eye.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EyeImages {
    /// Colour, in a format that [`SessionInfo`](super::SessionInfo) names.
    pub color: Surface,
    /// Depth: clear it to 0, draw with GREATER.
    pub depth: Surface,
    /// Pixels of each eye to be drawn, from the image's corner.
    pub extent: vk::Extent2D,
}

/// A frame that has begun. Dropped without [`end`](Frame::end), on an error's way out, it ends without a picture.
#[must_use = "end the frame, or it ends without a picture"]
pub struct Frame<'s> {
    pub(super) session: &'s mut Session,
    tick: Tick,
    /// Images were handed out for drawing.
    drawable: bool,
    /// How the cube behind the eyes' pictures is turned, if it shows.
    cube: Option<Quat>,
    /// Where the rectangle before them is, and how large in metres, if it shows.
    pub(super) quad: Option<(Pose, [f32; 2])>,
}

impl Session {
    /// Blocks until the runtime wants the next frame. `None` while the session does not run.
    ///
    /// # Errors
    /// Losses and refusals.
    pub fn wait_frame(&mut self) -> Result<Option<Tick>, Error> {
        self.close_frame();
        if !self.is_running() {
            return Ok(None);
        }
        let waited = self.raw.wait_frame();
        let state = match self.heed(waited) {
            Ok(state) => state,
            Err(error) if error.outcome() == Outcome::Idle => return Ok(None),
            Err(error) => return Err(error),
        };
        let display_time_ns = state.predicted_display_time.as_nanos();
        self.step = Step::Waited(display_time_ns);
        self.settle_origin(display_time_ns)?;
        Ok(Some(Tick {
            display_time_ns,
            period_ns: state.predicted_display_period.as_nanos(),
            should_render: state.should_render.into(),
        }))
    }

    /// Begins the frame that `tick` was waited for.
    ///
    /// # Errors
    /// Losses and refusals; `ERROR_CALL_ORDER_INVALID` when another frame was waited for since.
    pub fn begin_frame(&mut self, tick: Tick) -> Result<Frame<'_>, Error> {
        if self.step != Step::Waited(tick.display_time_ns) {
            return Err(Error::Call {
                call: "Session::begin_frame (with the tick of another frame)",
                code: sys::Result::ERROR_CALL_ORDER_INVALID,
            });
        }
        self.begin(tick.display_time_ns)?;
        Ok(Frame { session: self, tick, drawable: false, cube: None, quad: None })
    }

    fn begin(&mut self, display_time_ns: i64) -> Result<(), Error> {
        // Also when it fails: the runtime decides whether the wait still counts, and another begin would not help.
        self.step = Step::Between;
        let begun = self.raw.begin_frame();
        if self.heed(begun)? == sys::Result::FRAME_DISCARDED {
            tracing::debug!("the OpenXR runtime discarded the frame before");
            self.oddities.frames_discarded += 1;
        }
        self.step = Step::Begun(display_time_ns);
        Ok(())
    }

    /// Ends what is open of a frame, without a picture: else the runtime would wait for it for ever.
    pub(super) fn close_frame(&mut self) {
        if let Step::Waited(time_ns) = self.step
            && let Err(error) = self.begin(time_ns)
        {
            tracing::debug!("an unused frame could not be begun: {error}");
        }
        if let Step::Begun(time_ns) = self.step {
            self.step = Step::Between;
            let released = self.release_images();
            let ended = self.raw.end_frame(time_ns, self.blend, None);
            if let Err(error) = released.and(ended) {
                tracing::debug!("an unfinished frame could not be ended: {error}");
            }
        }
    }
}

impl Session {
    /// Gives back what the frame has drawn into.
    fn release_images(&mut self) -> Result<(), Error> {
        let cube = self.cube.as_mut().map_or(Ok(()), |cube| cube.chain.release());
        let quad = self.quad.as_mut().map_or(Ok(()), |quad| quad.chain.release());
        self.color.release().and(self.depth.release()).and(cube).and(quad)
    }
}

impl Frame<'_> {
    /// What the runtime wants of this frame.
    pub fn tick(&self) -> &Tick {
        &self.tick
    }

    /// The images to draw into. `None` when nothing would be seen or the runtime keeps the images too long: then skip
    /// drawing and end the frame without views.
    ///
    /// # Errors
    /// Losses and refusals.
    pub fn acquire(&mut self) -> Result<Option<EyeImages>, Error> {
        if !self.tick.should_render {
            return Ok(None);
        }
        let Session { color, depth, drawn, oddities, .. } = &mut *self.session;
        color.acquire()?;
        depth.acquire()?;
        let (Some(color), Some(depth)) = (color.wait()?, depth.wait()?) else {
            tracing::debug!(
                "the OpenXR runtime keeps the eye images too long; a frame goes without a picture"
            );
            oddities.images_late += 1;
            return Ok(None);
        };
        self.drawable = true;
        Ok(Some(EyeImages { color, depth, extent: *drawn }))
    }

    /// The cubemap to draw anew, all of it: the runtime goes on showing the one drawn last until this frame ends.
    /// `None` where there is none ([`Session::open_cube`]) or the runtime keeps it too long.
    ///
    /// # Errors
    /// Losses and refusals.
    pub fn acquire_cube(&mut self) -> Result<Option<CubeSurface>, Error> {
        self.session.cube.as_mut().map_or(Ok(None), super::cube::Cube::acquire)
    }

    /// Shows the cubemap drawn last, of this frame or an earlier one, where the eyes' pictures are transparent: they
    /// then count as multiplied by their alpha. `orientation` turns the cube's axes to those of the session's space.
    /// Without this call, and before a cubemap was drawn, the pictures count as opaque.
    pub fn show_cube(&mut self, orientation: Quat) {
        self.cube = Some(orientation.normalize());
    }

    /// Both eyes at this frame's display time. Call it as late as possible, since the prediction gets better the nearer
    /// that time is; calling it twice (early to choose what to draw, late to draw it) is fine.
    ///
    /// # Errors
    /// Losses and refusals.
    pub fn locate_views(&mut self) -> Result<Views, Error> {
        self.session.locate_views(self.tick.display_time_ns)
    }

    /// What the wearer does with his hands, with their poses at this frame's display time.
    ///
    /// # Errors
    /// Losses.
    pub fn read_hands(&mut self) -> Result<Hands, Error> {
        let Session { actions, spaces, .. } = &mut *self.session;
        let read =
            actions.as_mut().map(|actions| actions.read(spaces.base_space(), self.tick.display_time_ns));
        read.unwrap_or(Ok(Hands::default()))
    }

    /// Hands the frame over. `drawn` are the views it was drawn with, its work having been submitted; `None` when nothing
    /// was drawn, which shows nothing.
    ///
    /// # Errors
    /// Losses and refusals; the frame is over all the same.
    pub fn end(self, drawn: Option<&Views>) -> Result<(), Error> {
        let drawn = drawn.filter(|_| self.drawable);
        let session = &mut *self.session;
        session.release_images()?;
        let mut layer = drawn.map(|views| session.layer(views, self.cube, self.quad));
        let end = |session: &Session, layer: Option<&Layer>| {
            session.raw.end_frame(self.tick.display_time_ns, session.blend, layer)
        };
        let mut ended = end(session, layer.as_ref());
        // A frame whose end is refused is still open. Where it is taken without the quad, that is to blame.
        if let (Err(error), Some(layer)) = (&ended, layer.as_mut().filter(|layer| layer.front.is_some()))
            && may_be_of_a_layer(error)
        {
            layer.front = None;
            let again = end(session, Some(layer));
            if let (Ok(()), Some(quad)) = (&again, &mut session.quad) {
                quad.refuse(error);
            }
            ended = again;
        }
        session.heed(ended)?;
        session.step = Step::Between;
        Ok(())
    }
}

impl Session {
    fn layer(&self, views: &Views, cube: Option<Quat>, quad: Option<(Pose, [f32; 2])>) -> Layer {
        let sub_image = |swapchain, eye: usize| sys::SwapchainSubImage {
            swapchain,
            image_rect: sys::Rect2Di {
                offset: sys::Offset2Di { x: 0, y: 0 },
                extent: sys::Extent2Di { width: self.drawn.width as i32, height: self.drawn.height as i32 },
            },
            image_array_index: eye as u32,
        };
        Layer {
            space: self.spaces.base(),
            eyes: [0, 1].map(|eye| LayerEye {
                pose: pose_to_sys(&views.eyes[eye].pose),
                fov: fov_to_sys(&views.eyes[eye].fov),
                color: sub_image(self.color.handle(), eye),
                depth: self.depth.submitted().map(|swapchain| sub_image(swapchain, eye)),
            }),
            near_m: self.info.near_m,
            behind: self
                .cube
                .as_ref()
                .and_then(|cube| cube.chain.shown())
                .zip(cube)
                .map(|(swapchain, q)| CubeLayer { swapchain, orientation: quat_to_sys(q) }),
            front: self.quad.as_ref().zip(quad).and_then(|(it, (pose, size_m))| it.layer(&pose, size_m)),
        }
    }
}

impl Drop for Frame<'_> {
    fn drop(&mut self) {
        self.session.close_frame();
    }
}
