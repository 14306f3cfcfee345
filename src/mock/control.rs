//! The handle a test or the viewer holds: entry points, scripting, and what was recorded.

use std::{sync::Arc, time::Duration};

use openxr::sys;

use super::{
    abi,
    config::{MockConfig, Tracking},
    journal::{Call, Calls, Leak, Violation},
    pose::{Fov, Pose, PoseTrack},
    record::SubmittedFrame,
    slot,
    state::{Shared, action::Haptic, session::Wish},
};

/// What a mock cannot do.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MockError {
    /// Too many mocks are alive.
    #[error("all {} mock runtimes of this process are in use: drop one first", slot::SLOTS)]
    NoSlot,
    /// A hook names a function that the runtime does not have.
    #[error("{0} is no function of the mock runtime")]
    UnknownFunction(String),
    /// The crate could not load the entry points.
    #[error("the mock runtime's entry points could not be loaded: {0}")]
    Entry(sys::Result),
}

/// A mock OpenXR runtime. Clones are the same runtime; it lives until the last clone and the last instance are gone.
#[derive(Clone)]
pub struct Mock {
    shared: Arc<Shared>,
}

impl Default for Mock {
    fn default() -> Self {
        Self::new(MockConfig::default())
    }
}

impl Mock {
    /// A runtime of its own, independent of all others.
    pub fn new(config: MockConfig) -> Self {
        Self { shared: Arc::new(Shared::new(config)) }
    }

    /// The runtime's `xrGetInstanceProcAddr`. After the mock is gone it answers `XR_ERROR_RUNTIME_UNAVAILABLE` until
    /// another mock takes its place.
    pub fn get_instance_proc_addr(&self) -> Result<sys::pfn::GetInstanceProcAddr, MockError> {
        slot::of(&self.shared).and_then(abi::proc_addr_of).ok_or(MockError::NoSlot)
    }

    /// The runtime as the openxr crate sees it. Keep the mock while the entry or anything made from it is used.
    #[allow(unsafe_code, reason = "the crate cannot know that the function is sound")]
    pub fn entry(&self) -> Result<openxr::Entry, MockError> {
        let get_instance_proc_addr = self.get_instance_proc_addr()?;
        // SAFETY: it yields functions with the semantics of the specification for every core name.
        unsafe { openxr::Entry::from_get_instance_proc_addr(get_instance_proc_addr, &()) }
            .map_err(MockError::Entry)
    }

    /// Every rule broken so far; after 4096 no more are kept.
    pub fn violations(&self) -> Vec<Violation> {
        self.shared.lock().journal.violations.clone()
    }

    /// How often a function was called.
    pub fn calls(&self, function: &str) -> u64 {
        self.shared.lock().journal.count(function)
    }

    /// The last 4096 calls, oldest first.
    pub fn log(&self) -> Vec<Call> {
        self.shared.lock().journal.log()
    }

    /// Handles that were alive when their instance was destroyed.
    pub fn leaks(&self) -> Vec<Leak> {
        self.shared.lock().journal.leaks.clone()
    }

    /// The last 1024 vibrations asked for while focused.
    pub fn haptics(&self) -> Vec<Haptic> {
        self.shared.lock().haptics.clone()
    }

    /// Takes the frames submitted since the last call, at most `keep_frames`, oldest first.
    pub fn take_frames(&self) -> Vec<SubmittedFrame> {
        self.shared.lock().frames.drain(..).collect()
    }

    /// Takes the newest submitted frame; the older ones are forgotten.
    pub fn take_last_frame(&self) -> Option<SubmittedFrame> {
        let mut state = self.shared.lock();
        let last = state.frames.pop_back();
        state.frames.clear();
        last
    }

    /// The state of the session; of several, of any one. `None` without a session.
    pub fn session_state(&self) -> Option<sys::SessionState> {
        let state = self.shared.lock();
        state.sessions.iter().next().map(|(_, session)| session.state)
    }

    /// Whether frames are read back from now on.
    pub fn set_read_back(&self, read_back: bool) {
        self.shared.lock().config.read_back = read_back;
    }

    /// A new head track; its time 0 is the session's first frame, as ever.
    pub fn set_head(&self, track: PoseTrack) {
        self.shared.lock().config.head = track;
    }

    /// Holds the head still at a pose in STAGE space, from now on.
    pub fn hold_head(&self, pose: Pose) {
        self.set_head(PoseTrack::fixed(pose));
    }

    /// New fields of view, left eye and right eye, radians.
    pub fn set_fov(&self, fov: [Fov; 2]) {
        self.shared.lock().config.fov = fov;
    }

    /// A new distance between the eyes, metres.
    pub fn set_ipd(&self, ipd_m: f32) {
        self.shared.lock().config.ipd_m = ipd_m;
    }

    /// What tracking says from now on; `None` gives it back to the script.
    pub fn set_tracking(&self, tracking: Option<Tracking>) {
        self.shared.lock().tracking = tracking;
    }

    /// Whether visible frames are to be rendered from now on; `None` gives it back to the script.
    pub fn set_should_render(&self, should_render: Option<bool>) {
        self.shared.lock().rendering = should_render;
    }

    /// The next calls of `xrGetSystem` answer that the headset is not connected.
    pub fn disconnect_for(&self, calls: u32) {
        self.shared.lock().unavailable_calls = calls;
    }

    /// Sessions rise to FOCUSED, one state per frame; idle ones become READY.
    pub fn gain_focus(&self) {
        self.wish(Wish::Focused);
    }

    /// Focused sessions fall to VISIBLE: a system menu has opened.
    pub fn lose_focus(&self) {
        self.wish(Wish::Shown);
    }

    /// Sessions fall to SYNCHRONIZED: the headset is off.
    pub fn hide(&self) {
        self.wish(Wish::Hidden);
    }

    /// Sessions fall to STOPPING, and to IDLE when they end; `gain_focus` makes them READY again.
    pub fn stop_session(&self) {
        self.wish(Wish::Away);
    }

    /// Sessions become LOSS_PENDING: the application should destroy them.
    pub fn lose_session(&self) {
        self.shared.lock().announce_session_loss();
        self.shared.changed.notify_all();
    }

    /// Sessions are lost without a warning: every call answers `XR_ERROR_SESSION_LOST`.
    pub fn kill_session(&self) {
        self.shared.lock().lose_sessions();
        self.shared.changed.notify_all();
    }

    /// Announces that instances will be lost; after `delay` on the runtime's clock every call answers
    /// `XR_ERROR_INSTANCE_LOST`.
    pub fn lose_instance(&self, delay: Duration) {
        let delay_ns = i64::try_from(delay.as_nanos()).unwrap_or(i64::MAX);
        self.shared.lock().announce_instance_loss(delay_ns);
        self.shared.changed.notify_all();
    }

    /// Makes calls of a function return a code. With an error code, `XR_TIMEOUT_EXPIRED` or `XR_EVENT_UNAVAILABLE` the
    /// function does nothing; with another positive code it works and then returns the code.
    pub fn on_call(&self, function: &str, calls: Calls, code: sys::Result) -> Result<(), MockError> {
        let known = abi::function_names()
            .find(|name| *name == function)
            .ok_or_else(|| MockError::UnknownFunction(function.to_owned()))?;
        self.shared.lock().journal.hook(known, calls, code);
        Ok(())
    }

    /// Forgets what `on_call` was told.
    pub fn clear_hooks(&self) {
        self.shared.lock().journal.clear_hooks();
    }

    pub(super) fn state(&self) -> std::sync::MutexGuard<'_, super::state::State> {
        self.shared.lock()
    }

    fn wish(&self, wish: Wish) {
        self.shared.lock().set_wish(wish);
        self.shared.changed.notify_all();
    }
}

/// The names of all functions of the runtime.
pub fn function_names() -> impl Iterator<Item = &'static str> {
    abi::function_names()
}
