//! The event queue of an instance.

use std::collections::VecDeque;

use openxr::sys;

use super::State;
use crate::mock::{fault::Outcome, pose::Pose, script::PerformanceNotice};

/// Events kept for an application that does not poll.
const CAPACITY: usize = 256;

/// What `xrPollEvent` can deliver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    SessionState {
        session: sys::Session,
        state: sys::SessionState,
        time_ns: i64,
    },
    InstanceLoss {
        time_ns: i64,
    },
    Lost {
        count: u32,
    },
    InteractionProfile {
        session: sys::Session,
    },
    ReferenceSpace {
        session: sys::Session,
        kind: sys::ReferenceSpaceType,
        change_ns: i64,
        /// The new origin in the space as it was.
        pose: Pose,
    },
    UserPresence {
        session: sys::Session,
        present: bool,
    },
    RefreshRate {
        from_hz: f32,
        to_hz: f32,
    },
    VisibilityMask {
        session: sys::Session,
        view: u32,
    },
    Performance(PerformanceNotice),
    /// Of a type that no extension has.
    Unknown,
}

impl Event {
    fn session(&self) -> Option<sys::Session> {
        match *self {
            Self::SessionState { session, .. }
            | Self::InteractionProfile { session }
            | Self::ReferenceSpace { session, .. }
            | Self::UserPresence { session, .. }
            | Self::VisibilityMask { session, .. } => Some(session),
            _ => None,
        }
    }
}

#[derive(Default)]
pub struct Queue {
    events: VecDeque<Event>,
    dropped: u32,
    /// The last one delivered.
    last: Option<Event>,
}

impl Queue {
    pub fn push(&mut self, event: Event) {
        if self.events.len() == CAPACITY {
            self.events.pop_front();
            self.dropped += 1;
        }
        self.events.push_back(event);
    }

    fn pop(&mut self) -> Option<Event> {
        match std::mem::take(&mut self.dropped) {
            0 => {
                let event = self.events.pop_front()?;
                self.last = Some(event);
                Some(event)
            }
            count => Some(Event::Lost { count }),
        }
    }

    /// Says that so many events were lost; those in the queue stay.
    pub fn claim_lost(&mut self, count: u32) {
        self.dropped = self.dropped.saturating_add(count);
    }

    /// Queues the last delivered event once more.
    pub fn repeat(&mut self) {
        if let Some(event) = self.last {
            self.push(event);
        }
    }

    /// Whether a state of a session waits to be told.
    pub fn tells_state_of(&self, of: sys::Session) -> bool {
        self.events.iter().any(|event| matches!(event, Event::SessionState { session, .. } if *session == of))
    }

    /// Forgets the events of a destroyed session.
    pub fn forget(&mut self, gone: sys::Session) {
        self.events.retain(|event| event.session() != Some(gone));
        self.last = self.last.filter(|event| event.session() != Some(gone));
    }
}

impl State {
    /// The next event; the application has now seen the state it tells.
    pub fn poll_event(&mut self, handle: sys::Instance) -> Outcome<Option<Event>> {
        let event = self.instance_mut(handle)?.events.pop();
        if let Some(Event::SessionState { session, state, .. }) = event
            && let Ok(session) = self.sessions.get_mut(session)
        {
            session.seen = state;
        }
        Ok(event)
    }
}
