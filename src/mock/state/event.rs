//! The event queue of an instance.

use std::collections::VecDeque;

use openxr::sys;

use super::State;
use crate::mock::fault::Outcome;

/// Events kept for an application that does not poll.
const CAPACITY: usize = 256;

/// What `xrPollEvent` can deliver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    SessionState { session: sys::Session, state: sys::SessionState, time_ns: i64 },
    InstanceLoss { time_ns: i64 },
    InteractionProfile { session: sys::Session },
    Lost { count: u32 },
}

#[derive(Default)]
pub struct Queue {
    events: VecDeque<Event>,
    dropped: u32,
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
            0 => self.events.pop_front(),
            count => Some(Event::Lost { count }),
        }
    }

    /// Forgets the events of a destroyed session.
    pub fn forget(&mut self, gone: sys::Session) {
        self.events.retain(|event| {
            !matches!(event, Event::SessionState { session, .. } | Event::InteractionProfile { session } if *session == gone)
        });
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
