//! Scripting of input: devices connected and taken away, components pressed and moved, hands led along tracks.

use super::{config::Tracking, control::Mock, hand::Curl, pose::PoseTrack, registry::Kind};

/// What a component measures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InputValue {
    /// A button: pressed or not.
    Boolean(bool),
    /// A trigger or an axis, [-1, 1].
    Float(f32),
    /// A stick or pad: x to the right and y upwards, [-1, 1] each.
    Vector([f32; 2]),
}

impl From<bool> for InputValue {
    fn from(value: bool) -> Self {
        Self::Boolean(value)
    }
}

impl From<f32> for InputValue {
    fn from(value: f32) -> Self {
        Self::Float(value)
    }
}

impl From<[f32; 2]> for InputValue {
    fn from(value: [f32; 2]) -> Self {
        Self::Vector(value)
    }
}

impl InputValue {
    /// What a component measures that nobody touches.
    pub(super) fn rest(kind: Kind) -> Self {
        match kind {
            Kind::Float => Self::Float(0.0),
            Kind::Vector => Self::Vector([0.0; 2]),
            Kind::Boolean | Kind::Pose | Kind::Haptic => Self::Boolean(false),
        }
    }

    pub(super) fn kind(self) -> Kind {
        match self {
            Self::Boolean(_) => Kind::Boolean,
            Self::Float(_) => Kind::Float,
            Self::Vector(_) => Kind::Vector,
        }
    }

    /// The value in numbers: a button is 0 or 1, what is no vector has y = 0.
    pub(super) fn as_vector(self) -> [f32; 2] {
        match self {
            Self::Boolean(pressed) => [f32::from(u8::from(pressed)), 0.0],
            Self::Float(value) => [value, 0.0],
            Self::Vector(vector) => vector,
        }
    }

    /// Whether it is of a kind and in range.
    pub(super) fn check(self, kind: Kind, path: &str) -> Result<(), InputError> {
        if self.kind() != kind {
            return Err(InputError::WrongKind { path: path.to_owned(), wanted: kind });
        }
        if !self.as_vector().iter().all(|number| (-1.0..=1.0).contains(number)) {
            return Err(InputError::OutOfRange { path: path.to_owned(), value: self });
        }
        Ok(())
    }
}

/// Input that cannot be.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InputError {
    /// The registry has no such interaction profile.
    #[error("{0} is no interaction profile of the OpenXR registry")]
    UnknownProfile(String),
    /// The registry has no device there, or no hand.
    #[error("{0} is no user path that a device or hand can have")]
    UnknownUserPath(String),
    /// Devices of the profile are elsewhere.
    #[error("{profile} is not for {user_path}")]
    NotThere {
        /// The profile.
        profile: &'static str,
        /// The user path.
        user_path: &'static str,
    },
    /// No profile has such an input or output.
    #[error("{0} is no input of any device")]
    UnknownComponent(String),
    /// The connected device has no such input.
    #[error("{profile} has no {path}")]
    NoSuchComponent {
        /// The connected device's profile.
        profile: &'static str,
        /// The full path.
        path: String,
    },
    /// Nothing is connected at the user path.
    #[error("no device is connected at {0}")]
    NotConnected(&'static str),
    /// The input is of another type.
    #[error("{path} is {wanted:?}")]
    WrongKind {
        /// The full path.
        path: String,
        /// What it is.
        wanted: Kind,
    },
    /// A number outside [-1, 1], or none.
    #[error("{value:?} is out of range for {path}")]
    OutOfRange {
        /// The full path.
        path: String,
        /// The value.
        value: InputValue,
    },
}

/// Devices. An application sees a change when it calls `xrSyncActions`; positions it sees at once.
impl Mock {
    /// Connects a device of an interaction profile (`/interaction_profiles/oculus/touch_controller`) at a user path
    /// (`/user/hand/left`), or exchanges the one there for it. Nothing is pressed on it.
    ///
    /// An application that has suggested bindings for the profile gets that one. One that has not, but has for
    /// `khr/simple_controller`, sees a hand's device as that. Otherwise the device is of no use to it.
    pub fn connect(&self, user_path: &str, profile: &str) -> Result<(), InputError> {
        let mut state = self.state();
        let now_ns = state.timeline.now_ns();
        state.devices.connect(user_path, profile, now_ns)
    }

    /// Takes the device at a user path away, if there is one.
    pub fn disconnect(&self, user_path: &str) -> Result<(), InputError> {
        self.state().devices.disconnect(user_path)
    }

    /// Presses, moves or releases a component of a connected device, by its full path
    /// (`/user/hand/left/input/trigger/value`). Each is set on its own: a trigger that is pulled does not click.
    pub fn set_input(&self, path: &str, value: impl Into<InputValue>) -> Result<(), InputError> {
        let mut state = self.state();
        let now_ns = state.timeline.now_ns();
        state.devices.set(path, value.into(), now_ns)
    }

    /// Leads a pose of a device, such as `/user/hand/left/input/grip/pose`, along a track in STAGE space; its time 0
    /// is the session's first frame. Poses without a track, and the hand's joints, follow the grip. The device need not
    /// be connected yet.
    pub fn set_pose_track(&self, path: &str, track: PoseTrack) -> Result<(), InputError> {
        self.state().devices.set_track(path, track)
    }

    /// What the tracking system says of the device at a user path from now on.
    pub fn set_device_tracking(&self, user_path: &str, tracking: Tracking) -> Result<(), InputError> {
        self.state().devices.set_tracking(user_path, tracking)
    }

    /// Whether the bare hand at `/user/hand/left` or `/user/hand/right` is seen, for `XR_EXT_hand_tracking`. A hand that
    /// holds a device is always seen.
    pub fn show_hand(&self, user_path: &str, seen: bool) -> Result<(), InputError> {
        self.state().devices.set_bare(user_path, seen)
    }

    /// How far a hand's thumb and index meet, and how far its fingers close to a fist, 0 to 1 each, for
    /// `XR_EXT_hand_tracking`: besides what a device that it holds makes of it.
    pub fn bend_hand(&self, user_path: &str, pinch: f32, fist: f32) -> Result<(), InputError> {
        for value in [pinch, fist] {
            InputValue::from(value).check(Kind::Float, user_path)?;
        }
        self.state().devices.bend(user_path, Curl { index: fist, others: fist, pinch })
    }

    /// The interaction profile of the device that is connected at a user path.
    pub fn connected_profile(&self, user_path: &str) -> Option<&'static str> {
        self.state().devices.profile(user_path).map(|profile| profile.path)
    }
}
