//! The handle a test or the viewer holds: entry points, scripting, and what was recorded.

use std::{sync::Arc, time::Duration};

use openxr::sys;

use super::{
    abi,
    config::{MockConfig, Tracking},
    journal::{Call, Calls, Leak, Violation},
    pose::{Fov, Pose, PoseTrack},
    record::SubmittedFrame,
    script::{Act, Script},
    slot,
    state::{Shared, action::Haptic},
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

    /// The runtime of a script, which begins with the first frame.
    pub fn with_script(script: Script) -> Self {
        let mock = Self::new(script.config.clone());
        mock.play(script);
        mock
    }

    pub(super) fn into_shared(self) -> Arc<Shared> {
        self.shared
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

    /// How the application asked the processor and the GPU to run, through `XR_EXT_performance_settings`.
    pub fn performance_levels(&self) -> [Option<sys::PerfSettingsLevelEXT>; 2] {
        self.shared.lock().performance
    }

    /// The refresh rate, hertz.
    pub fn refresh_rate(&self) -> f64 {
        self.shared.lock().timeline.hz
    }

    /// Whether frames are read back from now on.
    pub fn set_read_back(&self, read_back: bool) {
        self.shared.lock().config.read_back = read_back;
    }

    /// Does one thing to the headset or the runtime, now.
    pub fn perform(&self, act: Act) {
        self.shared.lock().perform(act);
        self.shared.changed.notify_all();
    }

    /// Plays a script's cues and faults from now on, instead of those that were still to come; its frame 0 is the next
    /// one. The headset stays what it is.
    pub fn play(&self, script: Script) {
        let mut state = self.shared.lock();
        for fault in script.faults {
            state.journal.hook(fault.function, fault.calls, fault.code);
        }
        let waited = state.frames_waited;
        state.player.load(script.cues, waited);
        script.start.into_iter().for_each(|act| state.perform(act));
    }

    /// What a script asked for and could not be done, such as input of a device that is not connected; a sentence each.
    pub fn script_errors(&self) -> Vec<String> {
        self.shared.lock().player.errors.clone()
    }

    /// A new head track; its time 0 is the session's first frame, as ever.
    pub fn set_head(&self, track: PoseTrack) {
        self.perform(Act::Head(track));
    }

    /// Holds the head still at a pose in STAGE space, from now on.
    pub fn hold_head(&self, pose: Pose) {
        self.set_head(PoseTrack::fixed(pose));
    }

    /// New fields of view, left eye and right eye, radians.
    pub fn set_fov(&self, fov: [Fov; 2]) {
        self.perform(Act::Fov(fov));
    }

    /// A new distance between the eyes, metres.
    pub fn set_ipd(&self, ipd_m: f32) {
        self.perform(Act::Ipd(ipd_m));
    }

    /// What tracking says from now on; `None` gives it back to the configuration.
    pub fn set_tracking(&self, tracking: Option<Tracking>) {
        self.perform(Act::Tracking(tracking));
    }

    /// Whether visible frames are to be rendered from now on; `None` gives it back to the configuration.
    pub fn set_should_render(&self, should_render: Option<bool>) {
        self.perform(Act::ShouldRender(should_render));
    }

    /// The next calls of `xrGetSystem` answer that the headset is not connected.
    pub fn disconnect_for(&self, calls: u32) {
        self.perform(Act::DisconnectFor(calls));
    }

    /// Sessions rise to FOCUSED, one state per frame; idle ones become READY.
    pub fn gain_focus(&self) {
        self.perform(Act::GainFocus);
    }

    /// Focused sessions fall to VISIBLE: a system menu has opened.
    pub fn lose_focus(&self) {
        self.perform(Act::LoseFocus);
    }

    /// Sessions fall to SYNCHRONIZED: the headset is off.
    pub fn hide(&self) {
        self.perform(Act::Hide);
    }

    /// Sessions fall to STOPPING, and to IDLE when they end; `gain_focus` makes them READY again.
    pub fn stop_session(&self) {
        self.perform(Act::Stop);
    }

    /// The user quits the application: sessions fall to STOPPING, IDLE and EXITING.
    pub fn exit_session(&self) {
        self.perform(Act::Exit);
    }

    /// Sessions become LOSS_PENDING: the application should destroy them.
    pub fn lose_session(&self) {
        self.perform(Act::LoseSession);
    }

    /// Sessions are lost without a warning: every call answers `XR_ERROR_SESSION_LOST`.
    pub fn kill_session(&self) {
        self.perform(Act::KillSession);
    }

    /// Announces that instances will be lost; after `delay` on the runtime's clock every call answers
    /// `XR_ERROR_INSTANCE_LOST`.
    pub fn lose_instance(&self, delay: Duration) {
        self.perform(Act::LoseInstance(delay));
    }

    /// Moves LOCAL, and LOCAL_FLOOR with it, to a pose in LOCAL as it was.
    pub fn recentre(&self, new_in_previous: Pose) {
        self.perform(Act::Recentre { new_in_previous, delay: Duration::ZERO });
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
}

/// The names of all functions of the runtime.
pub fn function_names() -> impl Iterator<Item = &'static str> {
    abi::function_names()
}
