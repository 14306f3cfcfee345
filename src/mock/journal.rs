//! What happened: calls counted and logged, violations, leaked handles; and the hooks that change what happens.

use std::{
    collections::{BTreeMap, VecDeque},
    thread::ThreadId,
};

use openxr::sys;

use super::fault::Fault;

/// Calls kept in the log.
const LOG_LENGTH: usize = 4096;

/// Violations kept: the first ones, which explain the rest.
const MOST_VIOLATIONS: usize = 4096;

/// Session states kept.
const MOST_STATES: usize = 4096;

/// A rule of the specification that the application broke.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    /// The function called, such as `xrEndFrame`.
    pub function: &'static str,
    /// Which call of that function it was, from 1.
    pub call: u64,
    /// What the call returned.
    pub code: sys::Result,
    /// What was wrong, a sentence.
    pub text: String,
}

/// One call in the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Call {
    /// The function called.
    pub function: &'static str,
    /// What it returned.
    pub code: sys::Result,
    /// Who called.
    pub thread: ThreadId,
}

/// A handle still alive when its instance was destroyed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Leak {
    /// The handle type, such as `XrSpace`.
    pub kind: &'static str,
    /// The handle's value.
    pub handle: u64,
}

/// Which calls of a function a hook changes; calls are counted from 1 for the whole life of the mock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Calls {
    /// The n-th call only.
    Nth(u64),
    /// The n-th call and all after it.
    From(u64),
    /// Every call.
    All,
}

impl Calls {
    fn includes(self, call: u64) -> bool {
        match self {
            Self::Nth(n) => call == n,
            Self::From(n) => call >= n,
            Self::All => true,
        }
    }
}

struct Hook {
    function: &'static str,
    calls: Calls,
    code: sys::Result,
}

#[derive(Default)]
pub struct Journal {
    counts: BTreeMap<&'static str, u64>,
    /// How often each function returned each code.
    pub results: BTreeMap<(&'static str, i32), u64>,
    log: VecDeque<Call>,
    /// Session states entered, the first 4096.
    pub states: Vec<sys::SessionState>,
    pub frames_submitted: u64,
    pub frames_with_projection: u64,
    pub frames_as_located: u64,
    pub violations: Vec<Violation>,
    pub leaks: Vec<Leak>,
    hooks: Vec<Hook>,
}

impl Journal {
    pub fn new() -> Self {
        Self { log: VecDeque::with_capacity(LOG_LENGTH), ..Self::default() }
    }

    pub fn hook(&mut self, function: &'static str, calls: Calls, code: sys::Result) {
        self.hooks.push(Hook { function, calls, code });
    }

    pub fn clear_hooks(&mut self) {
        self.hooks.clear();
    }

    /// Counts a call; the code a hook wants it to return, if any.
    pub fn begin(&mut self, function: &'static str) -> Option<sys::Result> {
        let count = self.counts.entry(function).or_default();
        *count += 1;
        let call = *count;
        self.hooks
            .iter()
            .find(|hook| hook.function == function && hook.calls.includes(call))
            .map(|hook| hook.code)
    }

    /// Logs a call's result.
    pub fn end(&mut self, function: &'static str, code: sys::Result) {
        *self.results.entry((function, code.into_raw())).or_default() += 1;
        if self.log.len() == LOG_LENGTH {
            self.log.pop_front();
        }
        self.log.push_back(Call { function, code, thread: std::thread::current().id() });
    }

    /// Notes a session's new state.
    pub fn entered(&mut self, state: sys::SessionState) {
        if self.states.len() < MOST_STATES {
            self.states.push(state);
        }
    }

    /// Records a misuse.
    pub fn record(&mut self, function: &'static str, fault: Fault) {
        if self.violations.len() == MOST_VIOLATIONS {
            return;
        }
        let call = self.count(function);
        self.violations.push(Violation { function, call, code: fault.code, text: fault.text.into_owned() });
    }

    pub fn count(&self, function: &str) -> u64 {
        self.counts.get(function).copied().unwrap_or(0)
    }

    pub fn log(&self) -> Vec<Call> {
        self.log.iter().cloned().collect()
    }
}
