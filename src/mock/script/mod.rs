//! Scripts: a headset, and what happens to it and to the runtime when. From Rust, or from a TOML file
//! (`config/mock/tour.toml` shows every key).

mod file;
mod raw;
mod reader;

use std::time::Duration;

use ash::vk;
use glam::Quat;
use openxr::sys;

use super::{
    config::{Mask, MockConfig, Timing, Tracking},
    input::InputValue,
    journal::Calls,
    pose::{Fov, Pose, PoseTrack},
};

pub use reader::ScriptError;

/// A mock headset and everything that happens to it.
#[derive(Clone, Debug, Default)]
pub struct Script {
    /// The headset at first.
    pub config: MockConfig,
    /// What happens before anything else.
    pub start: Vec<Act>,
    /// What happens; of those due at once, the first comes first.
    pub cues: Vec<Cue>,
    /// Calls that return what they are told.
    pub faults: Vec<CallFault>,
}

/// Something that happens, once.
#[derive(Clone, Debug)]
pub struct Cue {
    /// When.
    pub when: When,
    /// What, in this order.
    pub acts: Vec<Act>,
}

/// When a cue is due.
#[derive(Clone, Debug, PartialEq)]
pub enum When {
    /// Before this frame is predicted. Frames are the calls of `xrWaitFrame` by all sessions since the script began,
    /// from 0.
    Frame(u64),
    /// When the first frame has been predicted that is displayed so many seconds after the script's frame 0, or during
    /// the first call that comes so late.
    Seconds(f64),
    /// When the n-th call of a function has been answered, counted from 1 over the life of the mock.
    Call {
        /// Such as `xrBeginSession`.
        function: &'static str,
        /// 1 is the first.
        nth: u64,
    },
}

/// What can happen to the headset and the runtime.
#[derive(Clone, Debug, PartialEq)]
pub enum Act {
    /// Sessions rise to FOCUSED, one state per frame; idle ones become READY.
    GainFocus,
    /// Focused sessions fall to VISIBLE: a system menu has opened.
    LoseFocus,
    /// Sessions fall to SYNCHRONIZED: the headset is off.
    Hide,
    /// Sessions fall to STOPPING, and to IDLE when they end; `GainFocus` makes them READY again.
    Stop,
    /// The user quits the application: sessions fall to STOPPING, IDLE and EXITING.
    Exit,
    /// Sessions jump to a state, whether the specification allows it or not.
    ForceState(sys::SessionState),
    /// Sessions become LOSS_PENDING: the application should destroy them.
    LoseSession,
    /// Sessions are lost without a warning: every call answers `XR_ERROR_SESSION_LOST`.
    KillSession,
    /// Instances will be lost; after so long every call answers `XR_ERROR_INSTANCE_LOST`.
    LoseInstance(Duration),
    /// The next so many calls of `xrGetSystem` answer `XR_ERROR_FORM_FACTOR_UNAVAILABLE`.
    DisconnectFor(u32),
    /// Another head track; its time 0 is the session's first frame.
    Head(PoseTrack),
    /// What tracking says; `None` gives it back to the configuration.
    Tracking(Option<Tracking>),
    /// Whether visible frames are to be rendered; `None` gives it back to the configuration.
    ShouldRender(Option<bool>),
    /// LOCAL moves, and LOCAL_FLOOR with it.
    Recentre {
        /// The new origin of LOCAL in LOCAL as it was.
        new_in_previous: Pose,
        /// How long after the announcement.
        delay: Duration,
    },
    /// LOCAL moves to where the head is, upright.
    RecentreOnHead,
    /// The bounds of STAGE: width and depth, metres, when known.
    Bounds(Option<[f32; 2]>),
    /// Fields of view, left eye and right eye.
    Fov([Fov; 2]),
    /// Distance between the eyes, metres.
    Ipd(f32),
    /// How the displays are turned in the head, left eye and right eye.
    EyeTurn([Quat; 2]),
    /// Recommended image sizes, left eye and right eye, pixels.
    EyeSizes([[u32; 2]; 2]),
    /// What the lenses hide.
    Mask(Mask),
    /// Swapchain formats, best first: the list that `xrEnumerateSwapchainFormats` gives has another length, perhaps
    /// between an application's two calls.
    Formats(Vec<vk::Format>),
    /// Refresh rates to choose from besides the clock's, hertz.
    RefreshRates(Vec<f32>),
    /// Refresh rate from 1 to 1000, hertz.
    RefreshRate(f32),
    /// Whether the headset is worn.
    UserPresent(bool),
    /// Timing of the frames to come; `None` gives it back to the configuration.
    Timing(Option<Timing>),
    /// The next so many calls of `xrWaitSwapchainImage` answer `XR_TIMEOUT_EXPIRED`.
    ImageTimeouts(u32),
    /// Whether images are acquired in any order.
    ShuffleImages(bool),
    /// The runtime tells of so many views from now on: a fault of its own, unless there are two.
    ViewCount(u32),
    /// The headset hangs on another of Vulkan's physical devices: see `MockConfig::graphics_device`.
    GraphicsDevice(u32),
    /// A device changes, as an application sees it when it syncs its actions. What cannot be, such as input of a device
    /// that is not connected, is told by `Mock::script_errors`.
    Input(InputAct),
    /// A notice of `XR_EXT_performance_settings`.
    Performance(PerformanceNotice),
    /// An event says that so many others were lost.
    ClaimLostEvents(u32),
    /// The last event delivered comes again.
    RepeatEvent,
    /// A STOPPING event comes for a session that nobody made.
    ForeignEvent,
    /// An event of unknown type comes.
    UnknownEvent,
}

/// What can happen to devices and hands: see `Mock::connect` and its neighbours.
#[derive(Clone, Debug, PartialEq)]
pub enum InputAct {
    /// A device of a profile comes to a user path.
    Connect {
        /// Such as `/user/hand/left`.
        user_path: String,
        /// Such as `/interaction_profiles/khr/simple_controller`.
        profile: String,
    },
    /// The device at a user path goes.
    Disconnect {
        /// Such as `/user/hand/left`.
        user_path: String,
    },
    /// A component is pressed, moved or released.
    Set {
        /// Such as `/user/hand/left/input/trigger/value`.
        path: String,
        /// To what.
        value: InputValue,
    },
    /// A pose follows a track in STAGE space from now on.
    Track {
        /// Such as `/user/hand/left/input/grip/pose`.
        path: String,
        /// Its time 0 is the session's first frame.
        track: PoseTrack,
    },
    /// What tracking says of a device.
    Tracking {
        /// Such as `/user/hand/left`.
        user_path: String,
        /// From now on.
        tracking: Tracking,
    },
    /// Whether a bare hand is seen.
    Hand {
        /// `/user/hand/left` or `/user/hand/right`.
        user_path: String,
        /// From now on.
        seen: bool,
    },
}

/// The runtime warns of a bottleneck, or takes the warning back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PerformanceNotice {
    /// Processor or GPU.
    pub domain: sys::PerfSettingsDomainEXT,
    /// Compositing, rendering or thermal.
    pub sub_domain: sys::PerfSettingsSubDomainEXT,
    /// How bad it was.
    pub from: sys::PerfSettingsNotificationLevelEXT,
    /// How bad it is.
    pub to: sys::PerfSettingsNotificationLevelEXT,
}

/// Calls of a function that return a code: see `Mock::on_call`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CallFault {
    /// Such as `xrEndFrame`.
    pub function: &'static str,
    /// Which calls.
    pub calls: Calls,
    /// What they return.
    pub code: sys::Result,
}
