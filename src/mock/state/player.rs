//! The script being played: which cues are still to come, and what each does.

use openxr::sys;

use super::device::Devices;
use super::{Shared, State, session::Wish};
use crate::mock::{
    input::InputError,
    script::{Act, Cue, InputAct, When},
};

/// Cues in the order of their script; each is taken out when it is done.
#[derive(Default)]
pub struct Player {
    cues: Vec<Cue>,
    /// Frames waited for before the script began.
    first_frame: u64,
    /// Display time of the script's first frame.
    start_ns: Option<i64>,
    /// Acts that could not be done, a sentence each.
    pub errors: Vec<String>,
}

/// A moment at which cues may be due.
#[derive(Clone, Copy)]
pub enum Moment {
    /// A frame of any session is about to be predicted.
    Frame { count: u64 },
    /// It has been: this is when it is displayed.
    Display { display_ns: i64 },
    /// A call of a function has been answered.
    Called { function: &'static str, count: u64, now_ns: i64 },
}

impl Player {
    pub fn load(&mut self, cues: Vec<Cue>, frames_waited: u64) {
        *self = Self { cues, first_frame: frames_waited, ..Self::default() };
    }

    pub fn is_done(&self) -> bool {
        self.cues.is_empty()
    }

    fn is_due(&self, when: &When, moment: Moment) -> bool {
        let passed = |seconds: f64, time_ns: i64| {
            self.start_ns.is_some_and(|start| (time_ns - start) as f64 * 1e-9 >= seconds - 1e-9)
        };
        match (when, moment) {
            (When::Frame(frame), Moment::Frame { count }) => count >= self.first_frame + frame,
            (When::Seconds(seconds), Moment::Display { display_ns }) => passed(*seconds, display_ns),
            (When::Seconds(seconds), Moment::Called { now_ns, .. }) => passed(*seconds, now_ns),
            (When::Call { function, nth }, Moment::Called { function: called, count, .. }) => {
                called == *function && count >= *nth
            }
            _ => false,
        }
    }

    fn take_due(&mut self, moment: Moment) -> Option<Cue> {
        if let Moment::Display { display_ns } = moment {
            self.start_ns.get_or_insert(display_ns);
        }
        let due = self.cues.iter().position(|cue| self.is_due(&cue.when, moment))?;
        Some(self.cues.remove(due))
    }
}

impl State {
    /// Does what the script has for this moment.
    pub fn play_due(&mut self, moment: Moment) {
        while let Some(cue) = self.player.take_due(moment) {
            cue.acts.into_iter().for_each(|act| self.perform(act));
        }
    }

    /// What a test, a script or the viewer's desk does to the headset and the runtime.
    pub fn perform(&mut self, act: Act) {
        match act {
            Act::GainFocus => self.set_wish(Wish::Focused),
            Act::LoseFocus => self.set_wish(Wish::Shown),
            Act::Hide => self.set_wish(Wish::Hidden),
            Act::Stop => self.set_wish(Wish::Away),
            Act::Exit => self.exit_sessions(),
            Act::ForceState(state) => self.force_state(state),
            Act::LoseSession => self.announce_session_loss(),
            Act::KillSession => self.lose_sessions(),
            Act::LoseInstance(delay) => {
                self.announce_instance_loss(i64::try_from(delay.as_nanos()).unwrap_or(i64::MAX));
            }
            Act::DisconnectFor(calls) => self.unavailable_calls = calls,
            Act::Head(track) => self.config.head = track,
            Act::Tracking(tracking) => self.tracking = tracking,
            Act::ShouldRender(should_render) => self.rendering = should_render,
            Act::Recentre { new_in_previous, delay } => self.recentre(new_in_previous, delay),
            Act::RecentreOnHead => self.recentre_on_head(),
            Act::Bounds(bounds_m) => self.set_bounds(bounds_m),
            Act::Fov(fov) => self.set_fov(fov),
            Act::Ipd(ipd_m) => self.config.ipd_m = ipd_m,
            Act::EyeTurn(turn) => self.config.eye_turn = turn,
            Act::EyeSizes([left, right]) => {
                self.config.eye_size = left;
                self.config.right_eye_size = Some(right);
            }
            Act::Mask(mask) => self.set_mask(mask),
            Act::Formats(formats) => self.set_formats(formats),
            Act::RefreshRates(rates_hz) => self.config.refresh_rates_hz = rates_hz,
            Act::RefreshRate(hz) => self.set_refresh_rate(hz),
            Act::UserPresent(present) => self.set_present(present),
            Act::Timing(timing) => self.timing = timing,
            Act::ImageTimeouts(calls) => self.image_timeouts = calls,
            Act::ShuffleImages(shuffle) => self.config.shuffle_images = shuffle,
            Act::ViewCount(views) => self.config.view_count = views,
            Act::GraphicsDevice(nth) => self.config.graphics_device = nth,
            Act::Input(act) => {
                let now_ns = self.timeline.now_ns();
                if let Err(error) = self.devices.perform(act, now_ns) {
                    self.player.errors.push(error.to_string());
                }
            }
            Act::Performance(notice) => self.notify_performance(notice),
            Act::ClaimLostEvents(count) => {
                self.instances.iter_mut().for_each(|it| it.events.claim_lost(count))
            }
            Act::RepeatEvent => self.instances.iter_mut().for_each(|it| it.events.repeat()),
            Act::ForeignEvent => self.tell_foreign_event(),
            Act::UnknownEvent => {
                self.instances.iter_mut().for_each(|it| it.events.push(super::event::Event::Unknown));
            }
        }
    }

    /// A state that the rules may not allow to come next.
    fn force_state(&mut self, state: sys::SessionState) {
        for handle in self.sessions.handles_where(|session| !session.lost) {
            // A session in the table has its instance in the table, so there is nothing to fail.
            let _ = self.enter_state(handle, state);
        }
    }
}

impl Devices {
    pub fn perform(&mut self, act: InputAct, now_ns: i64) -> Result<(), InputError> {
        match act {
            InputAct::Connect { user_path, profile } => self.connect(&user_path, &profile, now_ns),
            InputAct::Disconnect { user_path } => self.disconnect(&user_path),
            InputAct::Set { path, value } => self.set(&path, value, now_ns),
            InputAct::Track { path, track } => self.set_track(&path, track),
            InputAct::Tracking { user_path, tracking } => self.set_tracking(&user_path, tracking),
            InputAct::Hand { user_path, seen } => self.set_bare(&user_path, seen),
        }
    }
}

/// After a call: plays what is due, and wakes who waits for it.
pub fn after_call(shared: &Shared, state: &mut State, function: &'static str) {
    if state.player.is_done() {
        return;
    }
    let count = state.journal.count(function);
    let now_ns = state.timeline.now_ns();
    state.play_due(Moment::Called { function, count, now_ns });
    shared.changed.notify_all();
}
