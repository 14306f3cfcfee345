//! Sessions and their life: the states of the specification, driven by frames and by what the user wants.

use ash::vk;
use openxr::sys::{self, SessionState};

use super::{
    State, debug::Labels, event::Event, frame::FrameLoop, input::Attached, instance::check_stereo,
    limit_reached,
};
use crate::mock::{
    fault::{Fault, Outcome, misuse, refusal, require},
    graphics::Graphics,
};

/// Where the imaginary user wants the application to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Wish {
    /// Not running.
    Away,
    /// Running but not seen.
    Hidden,
    /// Seen, without input.
    Shown,
    /// Seen, with input.
    Focused,
}

pub struct Session {
    pub instance: sys::Instance,
    /// `None`: headless.
    pub graphics: Option<Graphics>,
    /// Vulkan formats offered, best first.
    pub formats: Vec<i64>,
    pub state: SessionState,
    /// The state the application knows of: the one in the last event it polled. A headless application need not poll.
    pub seen: SessionState,
    pub running: bool,
    /// Every call answers XR_ERROR_SESSION_LOST.
    pub lost: bool,
    pub exiting: bool,
    pub frames: FrameLoop,
    /// Display time of the first frame: 0 on the script's clock.
    pub script_start_ns: Option<i64>,
    pub attached: Option<Attached>,
    pub labels: Labels,
}

impl Session {
    pub fn is_visible(&self) -> bool {
        matches!(self.state, SessionState::VISIBLE | SessionState::FOCUSED)
    }

    /// Offers those of the formats that the device can draw to.
    pub fn offer(&mut self, formats: &[vk::Format]) {
        let supported = self.graphics.as_ref().map(|it| it.supported(formats)).unwrap_or_default();
        self.formats = supported.iter().map(|format| i64::from(format.as_raw())).collect();
    }

    /// In a state, or past it only because its loss was announced meanwhile: the application cannot know yet.
    fn is_or_will_be_lost(&self, state: SessionState) -> bool {
        self.state == state || self.state == SessionState::LOSS_PENDING
    }

    /// What swapchains and reading back are done with.
    pub fn graphics(&self) -> Outcome<&Graphics> {
        self.graphics.as_ref().ok_or_else(no_graphics)
    }

    pub fn graphics_mut(&mut self) -> Outcome<&mut Graphics> {
        self.graphics.as_mut().ok_or_else(no_graphics)
    }
}

fn no_graphics() -> Fault {
    misuse(sys::Result::ERROR_VALIDATION_FAILURE, "the session is headless")
}

impl State {
    /// Adds a session, verified at the boundary, and starts its life.
    pub fn create_session(
        &mut self,
        instance: sys::Instance,
        graphics: Option<Graphics>,
    ) -> Outcome<sys::Session> {
        let mut session = Session {
            instance,
            graphics,
            formats: Vec::new(),
            state: SessionState::UNKNOWN,
            seen: SessionState::UNKNOWN,
            running: false,
            lost: false,
            exiting: false,
            frames: FrameLoop::new(),
            script_start_ns: None,
            attached: None,
            labels: Labels::default(),
        };
        session.offer(&self.config.formats);
        let handle = self.sessions.insert(session).ok_or_else(limit_reached::<sys::Session>)?;
        self.enter_state(handle, SessionState::IDLE)?;
        self.pursue(handle)?;
        Ok(handle)
    }

    /// Destroys a session with its swapchains, spaces and hand trackers.
    pub fn destroy_session(&mut self, handle: sys::Session) -> Outcome<()> {
        self.sessions.get(handle)?;
        for swapchain in self.swapchains.handles_where(|it| it.session == handle) {
            self.destroy_swapchain(swapchain)?;
        }
        for space in self.spaces.handles_where(|it| it.session == handle) {
            self.spaces.remove(space)?;
        }
        for tracker in self.hand_trackers.handles_where(|it| it.session == handle) {
            self.hand_trackers.remove(tracker)?;
        }
        let session = self.sessions.remove(handle)?;
        if let Ok(instance) = self.instances.get_mut(session.instance) {
            instance.events.forget(handle);
        }
        Ok(())
    }

    pub fn begin_session(
        &mut self,
        handle: sys::Session,
        kind: sys::ViewConfigurationType,
    ) -> Outcome<sys::Result> {
        let instance = self.session(handle)?.instance;
        let outdated = self.instance(instance)?.events.tells_state_of(handle);
        let session = self.session_mut(handle)?;
        require!(!session.running, ERROR_SESSION_RUNNING, "the session is running already");
        let headless = session.graphics.is_none();
        let seen_ready = headless || session.seen == SessionState::READY;
        let outdated = outdated && !headless;
        if seen_ready && outdated && session.state != SessionState::LOSS_PENDING {
            let text = "the session was READY, as the application has seen, and is so no more";
            return Err(refusal(sys::Result::ERROR_SESSION_NOT_READY, text));
        }
        require!(
            seen_ready && session.is_or_will_be_lost(SessionState::READY),
            ERROR_SESSION_NOT_READY,
            "the session is {:?} and the application has seen {:?}; xrBeginSession needs READY",
            session.state,
            session.seen
        );
        if !headless {
            check_stereo(kind)?;
        }
        session.running = true;
        session.frames.restart();
        self.tell_presence(handle);
        if headless {
            // Nobody need wait for a headless session's frames.
            while self.rise(handle)? {}
        }
        Ok(self.success(handle))
    }

    pub fn end_session(&mut self, handle: sys::Session) -> Outcome<sys::Result> {
        let session = self.running(handle)?;
        let seen_stopping = session.graphics.is_none() || session.seen == SessionState::STOPPING;
        require!(
            seen_stopping && session.is_or_will_be_lost(SessionState::STOPPING),
            ERROR_SESSION_NOT_STOPPING,
            "the session is {:?} and the application has seen {:?}; xrEndSession needs STOPPING",
            session.state,
            session.seen
        );
        session.running = false;
        if session.state == SessionState::STOPPING {
            self.enter_state(handle, SessionState::IDLE)?;
            self.pursue(handle)?;
        }
        Ok(self.success(handle))
    }

    pub fn request_exit(&mut self, handle: sys::Session) -> Outcome<sys::Result> {
        self.running(handle)?.exiting = true;
        self.pursue(handle)?;
        Ok(self.success(handle))
    }

    /// Sets the state and queues the event that tells.
    pub fn enter_state(&mut self, handle: sys::Session, state: SessionState) -> Outcome<()> {
        let time_ns = self.timeline.now_ns();
        let session = self.sessions.get_mut(handle)?;
        session.state = state;
        let instance = session.instance;
        self.journal.entered(state);
        self.instances.get_mut(instance)?.events.push(Event::SessionState {
            session: handle,
            state,
            time_ns,
        });
        Ok(())
    }

    /// Takes all steps towards the wish that need no frame of the application: downwards, IDLE to READY, and out.
    pub fn pursue(&mut self, handle: sys::Session) -> Outcome<()> {
        loop {
            let session = self.sessions.get(handle)?;
            let wish = if session.exiting { Wish::Away } else { self.wish };
            let next = match session.state {
                SessionState::IDLE if session.exiting => SessionState::EXITING,
                SessionState::IDLE if wish > Wish::Away => SessionState::READY,
                SessionState::READY if wish == Wish::Away && !session.running => SessionState::IDLE,
                SessionState::SYNCHRONIZED if wish == Wish::Away => SessionState::STOPPING,
                SessionState::VISIBLE if wish < Wish::Shown => SessionState::SYNCHRONIZED,
                SessionState::FOCUSED if wish < Wish::Focused => SessionState::VISIBLE,
                _ => return Ok(()),
            };
            self.enter_state(handle, next)?;
        }
    }

    /// Takes one step upwards, as a frame of the application allows; whether there was one to take.
    pub fn rise(&mut self, handle: sys::Session) -> Outcome<bool> {
        let session = self.sessions.get(handle)?;
        let wish = if session.exiting { Wish::Away } else { self.wish };
        let next = match session.state {
            SessionState::READY => SessionState::SYNCHRONIZED,
            SessionState::SYNCHRONIZED if wish >= Wish::Shown => SessionState::VISIBLE,
            SessionState::VISIBLE if wish >= Wish::Focused => SessionState::FOCUSED,
            _ => return Ok(false),
        };
        self.enter_state(handle, next)?;
        self.pursue(handle)?;
        Ok(true)
    }

    /// The user changed their mind: every session follows.
    pub fn set_wish(&mut self, wish: Wish) {
        self.wish = wish;
        for handle in self.sessions.handles_where(|session| !session.lost) {
            // A session in the table has its instance in the table, so there is nothing to fail.
            let _ = self.pursue(handle);
            if self.sessions.get(handle).is_ok_and(|it| it.running && it.graphics.is_none()) {
                while self.rise(handle).unwrap_or(false) {}
            }
        }
    }

    /// The user quits: every session goes the way of an exit that the application has asked for.
    pub fn exit_sessions(&mut self) {
        for handle in self.sessions.handles_where(|session| !session.lost) {
            if let Ok(session) = self.sessions.get_mut(handle) {
                session.exiting = true;
            }
            // As in `set_wish`: both tables have the entries.
            let _ = self.pursue(handle);
        }
    }

    /// Announces that every session will be lost.
    pub fn announce_session_loss(&mut self) {
        for handle in self.sessions.handles_where(|session| !session.lost) {
            // As in `set_wish`: both tables have the entries.
            let _ = self.enter_state(handle, SessionState::LOSS_PENDING);
        }
    }

    /// From now on every call on the sessions answers XR_ERROR_SESSION_LOST.
    pub fn lose_sessions(&mut self) {
        for session in self.sessions.iter_mut() {
            session.lost = true;
        }
    }

    /// Announces the loss of every instance, which happens after `delay_ns`.
    pub fn announce_instance_loss(&mut self, delay_ns: i64) {
        let time_ns = self.timeline.now_ns().saturating_add(delay_ns);
        for instance in self.instances.iter_mut() {
            // What is lost, or announced to be, stays so.
            instance.lost_at_ns = Some(instance.lost_at_ns.map_or(time_ns, |at| at.min(time_ns)));
            instance.events.push(Event::InstanceLoss { time_ns });
        }
    }
}
