//! Keeps a flight going over whatever happens to headsets, sessions and runtimes: waits, opens anew, stands in.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::Result;

use crate::gpu;
use crate::viewer::Step;
use crate::xr::{self, Outcome};

/// Where a flight is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Venue {
    /// On the headset's own runtime.
    Headset,
    /// On the built-in runtime, where nobody sees it, until a headset answers.
    StandIn,
}

/// What to do where no headset answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Absent {
    /// At the start give up; later, when it has been there, wait for it.
    Fail,
    /// Wait for it.
    Wait,
    /// Fly on the built-in runtime until it answers.
    StandIn,
}

/// How patient a [`Supervisor`] is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patience {
    /// What to do where no headset answers.
    pub absent: Absent,
    /// From one question to the next, and between reopenings.
    pub retry: Duration,
    /// From poll to poll while no frames are wanted.
    pub idle: Duration,
    /// Reopenings in a row, none of which lasted for [`Patience::lasting`] frames, before it gives up.
    pub attempts: u32,
    /// Frames drawn after which a session counts as one that works.
    pub lasting: u32,
    /// Frames refused in a row before the session is made anew.
    pub refusals: u32,
}

impl Patience {
    /// A second between questions, ten polls a second, five attempts.
    pub fn new(absent: Absent) -> Patience {
        Patience {
            absent,
            retry: Duration::from_secs(1),
            idle: Duration::from_millis(100),
            attempts: 5,
            lasting: 60,
            refusals: 90,
        }
    }
}

/// What a [`Supervisor`] keeps going. Errors are told apart by [`outcome_of`].
pub trait Stage {
    /// All that is open: runtime, device, session.
    type Show;

    /// Opens everything.
    ///
    /// # Errors
    /// Whatever there is to know of why not; nothing is left open then.
    fn open(&mut self, venue: Venue) -> Result<Self::Show>;

    /// Another session after this one was lost.
    ///
    /// # Errors
    /// As of `open`.
    fn renew(&mut self, show: Self::Show) -> Result<Self::Show>;

    /// One frame, of so far into the flight.
    ///
    /// # Errors
    /// Losses and refusals.
    fn frame(&mut self, show: &mut Self::Show, flown: Duration) -> Result<Step>;

    /// How fast the flight goes on, as a share of its own speed from 0 to 1; 0 while nobody wears the headset.
    fn speed(&self, show: &Self::Show) -> f64;

    /// Asks the session to end.
    ///
    /// # Errors
    /// Losses and refusals.
    fn request_exit(&mut self, show: &mut Self::Show) -> Result<()>;

    /// Whether a headset answers now. Asked each [`Patience::retry`] while something stands in for it; must not block.
    fn headset_answers(&mut self) -> bool;
}

/// What is done about a failure.
pub fn outcome_of(error: &anyhow::Error) -> Outcome {
    if let Some(error) = error.downcast_ref::<xr::Error>() {
        return error.outcome();
    }
    match error.downcast_ref::<gpu::Lost>() {
        Some(_) => Outcome::ReopenInstance,
        None => Outcome::GiveUp,
    }
}

/// What has happened on the way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Chronicle {
    /// Frames drawn.
    pub drawn: u64,
    /// Frames that ended without a picture.
    pub skipped: u64,
    /// Times that everything was opened.
    pub opened: u32,
    /// Times that only the session was made anew.
    pub renewed: u32,
    /// Times that no headset answered.
    pub waited: u32,
}

/// Flies until the wearer or a signal ends it. It keeps the time flown, so that a flight goes on where it was.
#[derive(Debug)]
pub struct Supervisor<'a> {
    patience: Patience,
    stop: &'a AtomicBool,
    /// How far into the flight it is: the time in which frames were drawn, at the speed that the stage allowed.
    pub flown: Duration,
    /// What has happened so far.
    pub chronicle: Chronicle,
    /// Reopenings since a session last worked.
    attempts: u32,
}

/// How a session ended.
enum Ending {
    /// By the wearer's wish or ours.
    Over,
    /// A headset answers, and nothing has to stand in for it any longer.
    HeadsetBack,
    /// By a failure: it goes on with this.
    Failed(Outcome, anyhow::Error),
}

impl<'a> Supervisor<'a> {
    /// Flies from the beginning until `stop` becomes true.
    pub fn new(patience: Patience, stop: &'a AtomicBool) -> Supervisor<'a> {
        Supervisor { patience, stop, flown: Duration::ZERO, chronicle: Chronicle::default(), attempts: 0 }
    }

    /// Flies to the end.
    ///
    /// # Errors
    /// What nothing can be done about: a sentence that says what to do.
    pub fn fly<S: Stage>(&mut self, stage: &mut S) -> Result<()> {
        let mut venue = Venue::Headset;
        let mut opened = self.open(stage, venue);
        loop {
            let (mut lost, ending) = match opened {
                Ok(mut show) => {
                    let ending = self.play(stage, &mut show, venue);
                    (Some(show), ending)
                }
                Err(error) => (None, Ending::Failed(outcome_of(&error), error)),
            };
            let (outcome, error) = match ending {
                Ending::Failed(outcome, error) => (outcome, error),
                over => {
                    drop(lost);
                    if matches!(over, Ending::Over) {
                        return Ok(());
                    }
                    tracing::warn!("a headset answers: going on there, {}", self.place());
                    venue = Venue::Headset;
                    opened = self.open(stage, venue);
                    continue;
                }
            };
            let next = match self.judge(outcome, venue) {
                // Nothing was left to do but to end.
                next if self.is_stopping() && !matches!(outcome, Outcome::GiveUp | Outcome::AskAgain) => {
                    tracing::debug!("{error:#}; {next:?} is not worth it any more");
                    Next::End
                }
                next => next,
            };
            // Whatever else is next, all that was open goes before anything is waited for or opened.
            if let (Next::Renew, Some(show)) = (next, lost.take()) {
                tracing::warn!("{error:#}; making another session, {}", self.place());
                self.pause(self.attempts > 1);
                self.chronicle.renewed += 1;
                opened = stage.renew(show);
                continue;
            }
            match next {
                Next::End => return Ok(()),
                Next::GiveUp => return Err(error),
                // Most desks have no headset: that is as it should be.
                Next::StandIn if self.chronicle.drawn == 0 => {
                    tracing::info!(
                        "no headset answers, so the flight goes on without one until it does: {error:#}"
                    );
                    (venue, self.attempts) = (Venue::StandIn, 0);
                }
                Next::StandIn => {
                    tracing::warn!("{error:#}; going on without a headset, {}", self.place());
                    (venue, self.attempts) = (Venue::StandIn, 0);
                }
                Next::Wait => {
                    tracing::warn!("{error:#}; asking again in {:?}", self.patience.retry);
                    self.chronicle.waited += 1;
                    self.pause(true);
                }
                Next::Renew | Next::Open => {
                    tracing::warn!("{error:#}; opening the runtime again, {}", self.place());
                    self.pause(self.attempts > 1);
                }
            }
            if self.is_stopping() {
                return Ok(());
            }
            opened = self.open(stage, venue);
        }
    }

    /// What is next after a failure that comes to `outcome`.
    fn judge(&mut self, outcome: Outcome, venue: Venue) -> Next {
        let absent = if venue == Venue::StandIn { Absent::Fail } else { self.patience.absent };
        match outcome {
            Outcome::GiveUp | Outcome::AskAgain => Next::GiveUp,
            Outcome::Wait => match absent {
                Absent::StandIn => Next::StandIn,
                Absent::Fail if self.chronicle.drawn == 0 => Next::GiveUp,
                Absent::Fail | Absent::Wait => Next::Wait,
            },
            _ => {
                self.attempts += 1;
                match outcome {
                    _ if self.attempts > self.patience.attempts && absent == Absent::StandIn => Next::StandIn,
                    _ if self.attempts > self.patience.attempts => Next::GiveUp,
                    Outcome::ReopenInstance => Next::Open,
                    _ => Next::Renew,
                }
            }
        }
    }

    fn open<S: Stage>(&mut self, stage: &mut S, venue: Venue) -> Result<S::Show> {
        self.chronicle.opened += 1;
        stage.open(venue)
    }

    /// Frame after frame, until something ends it.
    fn play<S: Stage>(&mut self, stage: &mut S, show: &mut S::Show, venue: Venue) -> Ending {
        let (mut last, mut asked) = (Instant::now(), Instant::now());
        let (mut drawn, mut refused) = (0, 0);
        loop {
            if self.is_stopping()
                && let Err(error) = stage.request_exit(show)
            {
                return Ending::Failed(outcome_of(&error), error);
            }
            if venue == Venue::StandIn && asked.elapsed() >= self.patience.retry {
                asked = Instant::now();
                if stage.headset_answers() {
                    return Ending::HeadsetBack;
                }
            }
            match stage.frame(show, self.flown) {
                Ok(Step::Exited) => return Ending::Over,
                Ok(Step::Idle) => std::thread::sleep(self.patience.idle),
                Ok(Step::Drew) => {
                    (drawn, refused) = (drawn + 1, 0);
                    self.chronicle.drawn += 1;
                    let all = self.chronicle.drawn;
                    if drawn == 1 {
                        tracing::info!("{all} frames drawn, 1 of them in this session, {}", self.place());
                    } else if all.is_multiple_of(100) {
                        tracing::debug!(
                            "{all} frames drawn, {drawn} of them in this session, {}",
                            self.place()
                        );
                    }
                    if drawn >= self.patience.lasting {
                        self.attempts = 0;
                    }
                    self.flown += last.elapsed().mul_f64(stage.speed(show).clamp(0.0, 1.0));
                }
                Ok(Step::Skipped) => self.chronicle.skipped += 1,
                Err(error) => match outcome_of(&error) {
                    Outcome::Idle => std::thread::sleep(self.patience.idle),
                    Outcome::GoOn | Outcome::SkipFrame if refused < self.patience.refusals => {
                        tracing::debug!("a frame goes without a picture: {error:#}");
                        refused += 1;
                        self.chronicle.skipped += 1;
                    }
                    Outcome::GoOn | Outcome::SkipFrame => {
                        return Ending::Failed(Outcome::ReopenSession, error);
                    }
                    outcome => return Ending::Failed(outcome, error),
                },
            }
            last = Instant::now();
        }
    }

    fn is_stopping(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Waits for [`Patience::retry`], or until it is to stop.
    fn pause(&self, wanted: bool) {
        let until = Instant::now() + self.patience.retry;
        while wanted && !self.is_stopping() && Instant::now() < until {
            std::thread::sleep(self.patience.retry.min(Duration::from_millis(50)));
        }
    }

    fn place(&self) -> String {
        format!("{:.2} s into the flight", self.flown.as_secs_f64())
    }
}

/// What follows a failure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Next {
    End,
    GiveUp,
    Renew,
    Open,
    Wait,
    StandIn,
}
