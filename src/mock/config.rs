//! What a mock headset is like: one plain struct, every field with a default.

use std::ops::Range;

use ash::vk;
use glam::{Quat, Vec3};
use openxr::sys;

use super::pose::{Fov, Pose, PoseTrack};

/// Which clock the runtime lives by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Clock {
    /// The machine's: `xrWaitFrame` sleeps until the next refresh.
    Real {
        /// Refresh rate.
        hz: f64,
    },
    /// Virtual: each `xrWaitFrame` advances it by one period and returns at once.
    Stepped {
        /// Refresh rate.
        hz: f64,
    },
}

impl Clock {
    /// Refresh rate, held between 1 and 1000 Hz.
    pub fn hz(self) -> f64 {
        let (Self::Real { hz } | Self::Stepped { hz }) = self;
        if hz.is_finite() { hz.clamp(1.0, 1000.0) } else { 90.0 }
    }
}

/// What the tracking system says of the head.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tracking {
    /// The orientation may be read at all.
    pub orientation_valid: bool,
    /// The position may be read at all.
    pub position_valid: bool,
    /// The orientation is measured, not guessed.
    pub orientation_tracked: bool,
    /// The position is measured, not guessed.
    pub position_tracked: bool,
}

impl Tracking {
    /// Everything known and measured.
    pub const FULL: Self = Self {
        orientation_valid: true,
        position_valid: true,
        orientation_tracked: true,
        position_tracked: true,
    };
    /// Poses are guesses: valid, not tracked.
    pub const GUESSED: Self = Self { orientation_tracked: false, position_tracked: false, ..Self::FULL };
    /// Only the orientation is known (and measured).
    pub const ORIENTATION_ONLY: Self = Self { position_valid: false, position_tracked: false, ..Self::FULL };
    /// Nothing is known.
    pub const LOST: Self = Self {
        orientation_valid: false,
        position_valid: false,
        orientation_tracked: false,
        position_tracked: false,
    };

    /// What two devices say of their relation.
    #[must_use]
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            orientation_valid: self.orientation_valid && other.orientation_valid,
            position_valid: self.position_valid && other.position_valid,
            orientation_tracked: self.orientation_tracked && other.orientation_tracked,
            position_tracked: self.position_tracked && other.position_tracked,
        }
    }

    fn bits(self) -> u64 {
        u64::from(self.orientation_valid)
            | u64::from(self.position_valid) << 1
            | u64::from(self.orientation_tracked) << 2
            | u64::from(self.position_tracked) << 3
    }

    pub(super) fn view_flags(self) -> sys::ViewStateFlags {
        sys::ViewStateFlags::from_raw(self.bits())
    }

    pub(super) fn location_flags(self) -> sys::SpaceLocationFlags {
        sys::SpaceLocationFlags::from_raw(self.bits())
    }
}

/// A run of frames with its own tracking state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TrackingSpan {
    /// Frames counted from the session's first `xrWaitFrame`, which is frame 0.
    pub frames: Range<u64>,
    /// What holds then.
    pub tracking: Tracking,
}

/// How `xrWaitFrame` deviates from one frame per refresh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Timing {
    /// The frame is shown this many refreshes after the one before instead of the next: 2 misses one.
    Late {
        /// Refreshes, at least 1.
        periods: u32,
    },
    /// Every so many refreshes only, and the runtime says so in `predictedDisplayPeriod`: 2 is half rate.
    Every {
        /// Refreshes, at least 1.
        periods: u32,
    },
    /// Predictions are off by up to so much either way, and still strictly increasing.
    Jitter {
        /// Nanoseconds; more than half a period counts as that.
        most_ns: u32,
    },
    /// Predictions lie so much further ahead than they should. When this ends they fall back, which no runtime may.
    Ahead {
        /// Nanoseconds.
        ns: i64,
    },
    /// The same prediction as for the frame before, which no runtime may.
    Frozen,
}

/// A run of frames with its own timing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TimingSpan {
    /// Frames counted from the session's first `xrWaitFrame`, which is frame 0.
    pub frames: Range<u64>,
    /// What holds then.
    pub timing: Timing,
}

/// What the lenses hide, as `XR_KHR_visibility_mask` tells it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mask {
    /// Each view is its rectangle without the corners.
    Octagon {
        /// How much of each side a corner takes, [0, 0.5].
        cut: f32,
    },
    /// The runtime has the extension and knows no mask: meshes without a vertex.
    Empty,
}

/// The mock headset and the runtime around it.
#[derive(Clone, Debug)]
pub struct MockConfig {
    /// Real or stepped time, and the refresh rate.
    pub clock: Clock,
    /// Recommended image size per eye, pixels.
    pub eye_size: [u32; 2],
    /// The right eye's, where it differs.
    pub right_eye_size: Option<[u32; 2]>,
    /// Largest image size the system takes, pixels.
    pub max_image_size: [u32; 2],
    /// Fields of view, left eye and right eye.
    pub fov: [Fov; 2],
    /// `XrViewConfigurationProperties::fovMutable`.
    pub fov_mutable: bool,
    /// How the displays are turned in the head, left eye and right eye: not at all unless they are canted.
    pub eye_turn: [Quat; 2],
    /// Distance between the eyes, metres.
    pub ipd_m: f32,
    /// What the lenses hide.
    pub mask: Mask,
    /// Refresh rates to choose from besides the clock's, hertz.
    pub refresh_rates_hz: Vec<f32>,
    /// Whether the headset can tell that it is worn.
    pub user_presence: bool,
    /// Whether it is worn, at first.
    pub user_present: bool,
    /// Nobody wants to look, at first: sessions stay IDLE until `Mock::gain_focus`.
    pub asleep: bool,
    /// The head in STAGE space.
    pub head: PoseTrack,
    /// Metres that every other `xrLocateViews`, beginning with the first, adds to where the head is: an application that
    /// asks twice in a frame gets a prediction that has become better.
    pub early_error_m: Vec3,
    /// The origin of LOCAL space in STAGE space; LOCAL_FLOOR is the same at height 0.
    pub local_origin: Pose,
    /// Whether STAGE is offered.
    pub stage: bool,
    /// Width and depth of the STAGE bounds in metres, when they are known.
    pub bounds_m: Option<[f32; 2]>,
    /// Tracking other than full.
    pub tracking: Vec<TrackingSpan>,
    /// Frames (counted from the session's first `xrWaitFrame`) for which `shouldRender` is false though visible.
    pub skip_rendering: Vec<Range<u64>>,
    /// Frames with other timing than one per refresh.
    pub timing: Vec<TimingSpan>,
    /// Copy the submitted images to host memory at each `xrEndFrame`.
    pub read_back: bool,
    /// How many submitted frames to keep for the test to take.
    pub keep_frames: usize,
    /// Newest OpenXR version offered (major, minor).
    pub max_api_version: (u16, u16),
    /// Names of extensions that are not offered.
    pub absent_extensions: Vec<String>,
    /// `xrGetSystem` answers `XR_ERROR_FORM_FACTOR_UNAVAILABLE` this many times first.
    pub unavailable_calls: u32,
    /// Swapchain formats, best first; those the device cannot draw to are left out.
    pub formats: Vec<vk::Format>,
    /// Images per swapchain, at least 1.
    pub image_count: u32,
    /// Images per depth swapchain, where it differs.
    pub depth_image_count: Option<u32>,
    /// `xrAcquireSwapchainImage` gives any image that is free, not the next in turn.
    pub shuffle_images: bool,
    /// `xrWaitSwapchainImage` answers `XR_TIMEOUT_EXPIRED` this many times first, whatever the timeout.
    pub image_timeouts: u32,
    /// Most layers per frame, at least 1. Fewer than 16 are a fault of the runtime: the specification promises so many.
    pub max_layers: u32,
    /// How many views the runtime tells of. Any number but 2 is a fault of the runtime: the only view configuration it
    /// offers is stereo.
    pub view_count: u32,
    /// Which of Vulkan's physical devices the headset hangs on, the one it would like best being 0; after the last comes
    /// the first again.
    pub graphics_device: u32,
}

impl MockConfig {
    /// Recommended image size of an eye, pixels: 0 is the left one.
    pub fn eye_size_of(&self, eye: usize) -> [u32; 2] {
        self.right_eye_size.filter(|_| eye == 1).unwrap_or(self.eye_size)
    }
}

impl Default for MockConfig {
    /// A headset at 90 Hz in real time, 1024 x 1024 pixels per eye, asymmetric fields of view, nothing read back.
    fn default() -> Self {
        let left = Fov { left: -0.86, right: 0.80, up: 0.85, down: -0.85 };
        Self {
            clock: Clock::Real { hz: 90.0 },
            eye_size: [1024, 1024],
            right_eye_size: None,
            max_image_size: [8192, 8192],
            fov: [left, left.mirrored()],
            fov_mutable: true,
            eye_turn: [Quat::IDENTITY; 2],
            ipd_m: 0.063,
            mask: Mask::Octagon { cut: 0.25 },
            refresh_rates_hz: vec![72.0, 80.0, 90.0, 120.0],
            user_presence: true,
            user_present: true,
            asleep: false,
            head: PoseTrack::default(),
            early_error_m: Vec3::ZERO,
            local_origin: Pose::at(0.0, 1.6, 0.0),
            stage: true,
            bounds_m: Some([3.0, 3.0]),
            tracking: Vec::new(),
            skip_rendering: Vec::new(),
            timing: Vec::new(),
            read_back: false,
            keep_frames: 8,
            max_api_version: (1, 1),
            absent_extensions: Vec::new(),
            unavailable_calls: 0,
            formats: vec![
                vk::Format::R8G8B8A8_SRGB,
                vk::Format::B8G8R8A8_SRGB,
                vk::Format::R16G16B16A16_SFLOAT,
                vk::Format::R8G8B8A8_UNORM,
                vk::Format::B8G8R8A8_UNORM,
                vk::Format::D32_SFLOAT,
                vk::Format::D24_UNORM_S8_UINT,
                vk::Format::D16_UNORM,
            ],
            image_count: 3,
            depth_image_count: None,
            shuffle_images: false,
            image_timeouts: 0,
            max_layers: 16,
            view_count: 2,
            graphics_device: 0,
        }
    }
}
