//! Which session to open, and how.

use std::ffi::CStr;

use super::{NEAR_M, Quality};
use crate::bindings::ProfileBindings;
use crate::governor::GovernorSettings;
use crate::gpu::{DeviceInfo, Shelf};
use crate::inspect::Inspect;
use crate::mock::Mock;
use crate::settings::{QualitySettings, RuntimeChoice};
use crate::xr;

/// Which session to open, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewerConfig {
    /// Which runtime.
    pub runtime: RuntimeChoice,
    /// Validation layers on.
    pub validate: bool,
    /// Pixels per eye; None takes what the runtime recommends.
    pub eye_size: Option<[u32; 2]>,
    /// Both eyes in one pass where the device can.
    pub multiview: bool,
    /// The mock's clock is stepped: as fast as frames can be drawn.
    pub stepped: bool,
    /// Every frame complete, whatever it takes (captures); else within a budget.
    pub complete: bool,
    /// How much is drawn; None: what suits the device and the size.
    pub quality: Option<Quality>,
    /// Where it is None: what is wished otherwise than suits these.
    pub wish: QualitySettings,
    /// Sky and backdrop go to the runtime as a cubemap behind the eyes' pictures, where it takes one: it then turns
    /// them with the head exactly, whenever the picture was drawn. The eyes' pictures alone are then without them.
    pub backdrop_layer: bool,
    /// What the headset's lenses hide is not drawn: the pictures are then not whole.
    pub mask: bool,
    /// Display rate to ask the headset for, in Hz.
    pub refresh_hz: Option<f32>,
    /// What the controllers do; None: they are not read.
    pub bindings: Option<&'static [ProfileBindings]>,
    /// The eyes' pictures are shown in a window.
    pub desk: Option<DeskConfig>,
    /// What is shown otherwise than usual, to begin with.
    pub inspect: Inspect,
    /// How much is drawn follows what frames take; None: it stays as it is.
    pub governor: Option<GovernorSettings>,
    /// Shaders that take the place of built-in ones.
    pub shaders: Option<&'static Shelf>,
}

/// What a viewer needs to be shown in a window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeskConfig {
    /// The Vulkan extension for windows of its platform.
    pub surface: &'static CStr,
    /// Pixels per eye where nobody wears a headset.
    pub eye_size: [u32; 2],
    /// Frames per second at most where nobody wears one.
    pub rate_hz: f64,
}

impl Default for ViewerConfig {
    fn default() -> ViewerConfig {
        ViewerConfig {
            runtime: RuntimeChoice::Mock,
            validate: false,
            eye_size: None,
            multiview: true,
            stepped: true,
            complete: true,
            quality: None,
            wish: QualitySettings::default(),
            backdrop_layer: false,
            mask: false,
            refresh_hz: None,
            bindings: None,
            desk: None,
            inspect: Inspect::default(),
            governor: None,
            shaders: None,
        }
    }
}

impl ViewerConfig {
    pub(super) fn session(&self) -> xr::SessionConfig {
        let &ViewerConfig { eye_size, multiview, mask, refresh_hz, .. } = self;
        xr::SessionConfig { eye_size, near_m: NEAR_M, multiview, mask, refresh_hz }
    }

    /// How much is drawn for pictures with so many pixels per unit of tangent.
    pub(super) fn quality(&self, info: &DeviceInfo, in_a_window: bool, pixels_per_tangent: f64) -> Quality {
        self.quality.unwrap_or_else(|| match in_a_window {
            true => Quality::for_window(info, pixels_per_tangent, &self.wish),
            false => Quality::wished(info, pixels_per_tangent, &self.wish),
        })
    }

    /// Nobody wears the headset, and somebody sees a window.
    pub(super) fn is_in_a_window(&self, mock: Option<&Mock>) -> bool {
        self.desk.is_some() && mock.is_some()
    }

    pub(super) fn open_hands(
        &self,
        session: &mut xr::Session,
        runtime: &xr::Runtime,
    ) -> Result<(), xr::Error> {
        self.bindings.map_or(Ok(()), |bindings| session.open_hands(runtime, bindings))
    }
}
