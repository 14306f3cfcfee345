//! The panel in the headset: its picture, the layer that shows it, and what takes the layer's place where there is none.
//!
//! Where the panel hangs is told in the session's space, as of the hands that were read last, not in the space of the hand
//! itself. The runtime would carry the latter along until the display lights up, and so every tremble of the hand into the
//! letters; and what a ray hits would not be what is seen. In the session's space the layer is as steady as the land, the
//! runtime still turns it with the head exactly, and layer, eyes and window show it in the same place.

use std::sync::Arc;

use anyhow::Result;
use ash::vk;
use glam::{Mat4, Vec3};

use super::open::target_format;
use super::pictures::plain_format;
use super::{IN_FLIGHT, NEAR_M, Viewer};
use crate::aids::PanelAid;
use crate::bindings::Action;
use crate::gpu::{Frame, Gpu, Image, Lost};
use crate::panels::Painted;
use crate::render::{EyeTarget, PanelPass, QuadPass};
use crate::rig::Pose;
use crate::xr;

/// A panel, and where it hangs.
#[derive(Clone, Copy)]
pub struct Hung<'a> {
    /// Where.
    pub aid: PanelAid,
    /// What is seen on it.
    pub painted: &'a Painted,
    /// Another one whenever `painted` has changed, from 1.
    pub serial: u64,
}

/// How a panel is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PanelWay {
    /// As a layer of its own, and drawn into the window's pictures.
    Layer,
    /// Drawn over the eyes' pictures and into the window's.
    InEyes,
}

/// The viewer's side of a panel. What draws it is made when the viewer is opened, where its wearer can ask for one; the layer
/// when it is first shown.
#[derive(Default)]
pub(super) struct Panel {
    shown: Option<PanelAid>,
    screen: Option<Screen>,
    /// The session was asked for a layer.
    asked: bool,
    /// It cannot be drawn, which was said.
    failed: bool,
    /// How it was seen in the last frame.
    way: Option<PanelWay>,
}

/// What draws it.
pub(super) struct Screen {
    quad: QuadPass,
    pass: PanelPass,
    /// Serial of its picture, 0 before there was one, ...
    drawn: u64,
    /// ... and of the one in the layer.
    layered: u64,
}

impl Screen {
    fn new(gpu: &Arc<Gpu>, info: &xr::SessionInfo) -> Result<Screen> {
        let mirror = plain_format(info.color_format);
        let quad = QuadPass::new(gpu, target_format(info), mirror, IN_FLIGHT)?;
        Ok(Screen { quad, pass: PanelPass::new(gpu)?, drawn: 0, layered: 0 })
    }

    /// Its picture is this one from now on, or from a frame soon after, where older ones are on their way still.
    fn draw(&mut self, hung: &Hung<'_>) -> Result<()> {
        if self.drawn == hung.serial || !self.pass.is_free()? {
            return Ok(());
        }
        self.pass.draw(hung.painted)?;
        if self.drawn == 0 {
            let Some(picture) = self.pass.picture() else { anyhow::bail!("its picture is empty") };
            self.quad.show(picture)?;
        }
        self.drawn = hung.serial;
        Ok(())
    }
}

impl Viewer {
    /// Shows this panel from the next frame on; None: none. Its picture is drawn where it is another one than before.
    ///
    /// # Errors
    /// Session or device are lost. Where there is no room for a panel, a warning says so, and none is shown.
    pub fn hang(&mut self, hung: Option<&Hung<'_>>) -> Result<()> {
        self.panel.shown = None;
        let Some(hung) = hung.filter(|_| !self.panel.failed) else { return Ok(()) };
        match self.draw_panel(hung) {
            Ok(()) => self.panel.shown = Some(hung.aid),
            Err(error) if is_lost(&error) => return Err(error),
            Err(error) => self.panel.fail(&error),
        }
        Ok(())
    }

    /// Makes what draws the wearer's panel, where he can ask for one: no frame is to wait for that.
    pub(super) fn prepare_panel(&mut self) {
        if self.config.bindings.is_some() && !self.config.is_in_a_window(self.mock.as_ref()) {
            match Screen::new(&self.gpu, self.session.info()) {
                Ok(screen) => self.panel.screen = Some(screen),
                Err(error) => self.panel.fail(&error),
            }
        }
    }

    /// How the panel was seen in the last frame; None: it was not.
    pub fn panel_way(&self) -> Option<PanelWay> {
        self.panel.way
    }

    /// Pixels per unit of tangent that the headset's displays have in their middle, about, from what the runtime recommends;
    /// None before a frame was drawn.
    pub fn display_pixels_per_tangent(&self) -> Option<f32> {
        let [left, right, ..] = self.eye(0)?.fov.map(f32::tan);
        let recommended = self.runtime.info().eyes[0].recommended[0];
        Some(recommended as f32 / (right - left)).filter(|pixels| pixels.is_finite() && *pixels > 0.0)
    }

    /// Whether what a hand holds has a button for the panel: bare ones have none. None: it holds nothing that is known, and
    /// is not seen.
    pub fn has_panel_button(&self, hand: usize) -> Option<bool> {
        let Some(held) = self.interaction_profiles()[hand] else {
            return self.hands.hands[hand].is_bare.then_some(false);
        };
        let profile = self.config.bindings?.iter().find(|profile| profile.profile == held)?;
        Some(profile.paths.iter().any(|(action, _)| *action == Action::Panel))
    }

    fn draw_panel(&mut self, hung: &Hung<'_>) -> Result<()> {
        let screen = match &mut self.panel.screen {
            Some(screen) => screen,
            none => none.insert(Screen::new(&self.gpu, self.session.info())?),
        };
        screen.draw(hung)?;
        if !self.panel.asked
            && let Some(picture) = screen.pass.picture()
        {
            self.panel.asked = true;
            if !self.session.open_quad(&self.runtime, picture.extent)? {
                tracing::info!("the panel is drawn into the eyes' pictures");
            }
        }
        Ok(())
    }
}

/// Session, instance or device are gone.
fn is_lost(error: &anyhow::Error) -> bool {
    error.is::<Lost>() || error.downcast_ref().is_some_and(|error: &xr::Error| error.lost().is_some())
}

impl Panel {
    fn fail(&mut self, error: &anyhow::Error) {
        tracing::warn!("the panel cannot be shown: {error:#}");
        self.failed = true;
    }

    /// Hides it until it is hung again.
    pub(super) fn hide(&mut self) {
        self.shown = None;
    }

    /// What draws it, as it is made now, for [`Panel::draw_by`]; None before it was made.
    ///
    /// # Errors
    /// Out of memory, or the device refuses its shaders.
    pub(super) fn screen_anew(&self, gpu: &Arc<Gpu>, info: &xr::SessionInfo) -> Result<Option<Screen>> {
        self.screen.as_ref().map(|_| Screen::new(gpu, info)).transpose()
    }

    /// Draws it by this from now on. No frame is in flight.
    pub(super) fn draw_by(&mut self, screen: Option<Screen>) {
        self.screen = screen;
    }

    /// Takes part in a frame, after the eyes' pictures were copied for the window and darkened: draws the layer where there
    /// is something new, or over the eyes where there is no layer. Positions count from `seat`.
    pub(super) fn draw(
        &mut self,
        frame: &mut Frame,
        xr_frame: &mut xr::Frame<'_>,
        target: &EyeTarget,
        seat: &Pose,
    ) -> Result<(), xr::Error> {
        self.way = None;
        let Panel { shown: Some(aid), screen: Some(screen), .. } = self else { return Ok(()) };
        if screen.drawn == 0 {
            return Ok(());
        }
        let index = frame.index;
        if xr_frame.has_quad() {
            if screen.layered != screen.drawn
                && let Some(surface) = xr_frame.acquire_quad()?
            {
                let quad = &screen.quad;
                frame.pass(c"panel layer", |commands| {
                    quad.record_alone(commands, index, surface.view, surface.extent);
                });
                screen.layered = screen.drawn;
            }
            // The first one may be late, or refused.
            if screen.layered != 0 && xr_frame.has_quad() {
                let position = aid.pose.position + seat.position;
                xr_frame.show_quad(&xr::Pose { position, orientation: aid.pose.orientation }, aid.size_m);
                self.way = Some(PanelWay::Layer);
                return Ok(());
            }
        }
        frame.pass(c"panel", |commands| screen.quad.record_in_eyes(commands, index, target));
        self.way = Some(PanelWay::InEyes);
        Ok(())
    }

    /// Draws the panel into the window's pictures, which have it in neither way.
    pub(super) fn draw_in_mirror(&self, frame: &mut Frame, mirror: Option<&Image>, extent: vk::Extent2D) {
        let (Some(_), Some(screen), Some(mirror)) = (self.way, &self.screen, mirror) else {
            return;
        };
        let index = frame.index;
        frame.pass(c"panel", |commands| screen.quad.record_in_mirror(commands, index, mirror, extent));
    }

    /// Writes where the frame's eyes see it. May be called after recording, until the frame is submitted.
    pub(super) fn set_views(&mut self, index: usize, views: &[xr::View; 2], seat: &Pose) {
        let Panel { shown: Some(aid), screen: Some(screen), .. } = self else { return };
        let [width, height] = aid.size_m;
        let space_from_picture = Mat4::from_scale_rotation_translation(
            Vec3::new(width, height, 1.0),
            aid.pose.orientation,
            aid.pose.position + seat.position,
        );
        screen.quad.set(
            index,
            views.map(|view| {
                view.fov.clip_from_view(NEAR_M) * view.pose.view_from_space() * space_from_picture
            }),
        );
    }
}
