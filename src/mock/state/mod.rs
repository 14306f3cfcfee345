//! The runtime itself: a state machine without a pointer in it. The C boundary verifies and converts, then asks here.

pub mod action;
pub mod binding;
pub mod debug;
pub mod device;
pub mod event;
pub mod frame;
pub mod hand;
pub mod headset;
pub mod input;
pub mod instance;
pub mod layer;
pub mod path;
pub mod player;
pub mod session;
pub mod space;
pub mod swapchain;

use std::{
    collections::VecDeque,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
};

use openxr::sys;

use self::{
    action::{Action, ActionSet, Haptic},
    debug::Messenger,
    device::Devices,
    hand::HandTracker,
    input::Wanted,
    instance::Instance,
    player::Player,
    session::{Session, Wish},
    space::Space,
    swapchain::Swapchain,
};
use super::{
    config::{MockConfig, Timing, Tracking},
    fault::{Fault, Outcome, refusal},
    handle::{Named, Table, fresh_salt},
    journal::Journal,
    pose::Pose,
    record::SubmittedFrame,
    timeline::Timeline,
};

/// One mock, shared between its handles, its entry points and its instances.
pub struct Shared {
    state: Mutex<State>,
    /// Notified when something happens that a blocked `xrWaitFrame` may wait for.
    pub changed: Condvar,
}

impl Shared {
    pub fn new(config: MockConfig) -> Self {
        Self { state: Mutex::new(State::new(config)), changed: Condvar::new() }
    }

    /// A panic elsewhere does not stop the runtime: the state is valid between any two statements that may panic.
    pub fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Unless somebody holds it.
    pub fn try_lock(&self) -> Option<MutexGuard<'_, State>> {
        self.state.try_lock().ok()
    }
}

/// Everything a mock knows.
pub struct State {
    pub config: MockConfig,
    pub timeline: Timeline,
    pub journal: Journal,
    /// The last submitted frames, oldest first.
    pub frames: VecDeque<SubmittedFrame>,
    pub haptics: Vec<Haptic>,
    pub devices: Devices,
    /// Where the imaginary user wants the sessions to be.
    pub wish: Wish,
    /// Overrides the script's tracking when set.
    pub tracking: Option<Tracking>,
    /// Overrides the script's choice of frames to render when set.
    pub rendering: Option<bool>,
    /// Overrides the configuration's timing when set.
    pub timing: Option<Timing>,
    pub unavailable_calls: u32,
    /// Calls of xrWaitSwapchainImage still to time out.
    pub image_timeouts: u32,
    /// Origins of LOCAL in STAGE, each with the time from which it holds; never empty.
    pub origins: Vec<(i64, Pose)>,
    /// The headset is worn.
    pub present: bool,
    /// What the application asked of processor and GPU.
    pub performance: [Option<sys::PerfSettingsLevelEXT>; 2],
    pub player: Player,
    /// Frames waited for by all sessions.
    pub frames_waited: u64,
    /// Where the sequence of the runtime's whims is.
    pub whim: u64,
    pub instances: Table<sys::Instance, Instance>,
    pub sessions: Table<sys::Session, Session>,
    pub swapchains: Table<sys::Swapchain, Swapchain>,
    pub spaces: Table<sys::Space, Space>,
    pub action_sets: Table<sys::ActionSet, ActionSet>,
    pub actions: Table<sys::Action, Action>,
    pub hand_trackers: Table<sys::HandTrackerEXT, HandTracker>,
    pub messengers: Table<sys::DebugUtilsMessengerEXT, Messenger>,
    /// Keeps the mock alive while instances of it are, though its handles be gone.
    pub keep_alive: Option<Arc<Shared>>,
    /// Reused by every `xrEndFrame`.
    pub scratch: Vec<layer::Layer>,
    /// Reused by every `xrSyncActions`.
    wanted: Vec<Wanted>,
    instances_made: u64,
}

impl State {
    fn new(config: MockConfig) -> Self {
        let salt = fresh_salt();
        Self {
            timeline: Timeline::new(config.clock),
            journal: Journal::new(),
            frames: VecDeque::with_capacity(config.keep_frames + 1),
            haptics: Vec::new(),
            devices: Devices::default(),
            wish: if config.asleep { Wish::Away } else { Wish::Focused },
            tracking: None,
            rendering: None,
            timing: None,
            unavailable_calls: config.unavailable_calls,
            image_timeouts: config.image_timeouts,
            origins: vec![(i64::MIN, config.local_origin)],
            present: config.user_present,
            performance: [None; 2],
            player: Player::default(),
            frames_waited: 0,
            whim: 0,
            instances: Table::new(salt),
            sessions: Table::new(salt),
            swapchains: Table::new(salt),
            spaces: Table::new(salt),
            action_sets: Table::new(salt),
            actions: Table::new(salt),
            hand_trackers: Table::new(salt),
            messengers: Table::new(salt),
            keep_alive: None,
            scratch: Vec::new(),
            wanted: Vec::new(),
            instances_made: 0,
            config,
        }
    }

    /// The next of a sequence of numbers that look random and are the same in every run.
    pub fn next_whim(&mut self) -> u64 {
        self.whim = self.whim.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let x = (self.whim ^ (self.whim >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        x ^ (x >> 31)
    }

    /// An instance that is alive and not lost.
    pub fn instance(&self, handle: sys::Instance) -> Outcome<&Instance> {
        let instance = self.instances.get(handle)?;
        if instance.is_lost(self.timeline.now_ns()) {
            return Err(refusal(sys::Result::ERROR_INSTANCE_LOST, "the instance is lost"));
        }
        Ok(instance)
    }

    pub fn instance_mut(&mut self, handle: sys::Instance) -> Outcome<&mut Instance> {
        self.instance(handle)?;
        self.instances.get_mut(handle)
    }

    /// A session that is alive and not lost.
    pub fn session(&self, handle: sys::Session) -> Outcome<&Session> {
        let session = self.sessions.get(handle)?;
        self.instance(session.instance)?;
        if session.lost {
            return Err(refusal(sys::Result::ERROR_SESSION_LOST, "the session is lost"));
        }
        Ok(session)
    }

    pub fn session_mut(&mut self, handle: sys::Session) -> Outcome<&mut Session> {
        self.session(handle)?;
        self.sessions.get_mut(handle)
    }

    /// A session that is also running.
    pub fn running(&mut self, handle: sys::Session) -> Outcome<&mut Session> {
        let session = self.session_mut(handle)?;
        if !session.running {
            return Err(super::fault::misuse(
                sys::Result::ERROR_SESSION_NOT_RUNNING,
                "the session is not running: xrBeginSession comes first, and nothing after xrEndSession",
            ));
        }
        Ok(session)
    }

    /// The code for success in a session: XR_SESSION_LOSS_PENDING when that is announced.
    pub fn success(&self, handle: sys::Session) -> sys::Result {
        match self.sessions.get(handle) {
            Ok(session) if session.state == sys::SessionState::LOSS_PENDING => {
                sys::Result::SESSION_LOSS_PENDING
            }
            _ => sys::Result::SUCCESS,
        }
    }
}

/// The answer when a table is full.
pub fn limit_reached<H: Named>() -> Fault {
    refusal(sys::Result::ERROR_LIMIT_REACHED, format!("no room for another {}", H::KIND.name()))
}
