//! Who steers: the flight, until a person does.

use std::time::{Duration, Instant};

use crate::aids::Aids;
use crate::controllers::Controllers;
use crate::course::{Stand, Standpoint};
use crate::input::Input;
use crate::pilot::{MotionSettings, Pilot};
use crate::viewer::Viewer;
use crate::xr;

/// The longest frame: whatever held the session up, nobody is carried on further than this at once.
const LONGEST_FRAME: Duration = Duration::from_millis(250);

/// What is steered with, and the person who does, from when he first does.
#[derive(Debug, Default)]
pub struct Helm {
    /// Where [`Input::restart`] leads; None: to where he began to steer.
    pub start: Option<Stand>,
    /// How moving feels, for whoever takes over.
    pub motion: MotionSettings,
    /// What the hands of the wearer do.
    pub controllers: Controllers,
    pilot: Option<Pilot>,
    last: Option<Instant>,
}

impl Helm {
    /// With a start to go back to.
    pub fn new(start: Stand, motion: &MotionSettings, controllers: Controllers) -> Helm {
        Helm { start: Some(start), motion: *motion, controllers, ..Helm::default() }
    }

    /// The time since the frame before.
    pub fn begin_frame(&mut self) -> Duration {
        let now = Instant::now();
        let last = self.last.replace(now);
        last.map_or(Duration::ZERO, |last| now - last).min(LONGEST_FRAME)
    }

    /// What the wearer's hands want in a frame of `dt`.
    pub fn hands(&mut self, viewer: &Viewer, dt: Duration) -> Input {
        self.controllers.input(&viewer.hands(), viewer.gaze(), dt)
    }

    /// Hands over to a person, here.
    pub fn take(&mut self, here: &Stand) {
        self.start.get_or_insert_with(|| here.clone());
        self.pilot = Some(Pilot::at(here, &self.motion));
    }

    /// The person who steers, if somebody has begun to.
    pub fn pilot(&self) -> Option<&Pilot> {
        self.pilot.as_ref()
    }

    /// Other settings of moving. The wheel's speed stays, unless another one is set.
    pub fn set(&mut self, motion: &MotionSettings) {
        if let Some(pilot) = &mut self.pilot {
            let same = motion.speed == self.motion.speed;
            let speed = if same { pilot.settings().speed } else { motion.speed };
            pilot.set(&MotionSettings { speed, ..*motion });
        }
        self.motion = *motion;
    }

    /// Takes the person on by a frame of `dt`, if somebody steers.
    pub fn advance(&mut self, input: &Input, dt: Duration, headroom: f64) {
        let Some(pilot) = &mut self.pilot else { return };
        if let Some(start) = self.start.as_ref().filter(|_| input.restart) {
            pilot.go_to(start);
        }
        pilot.advance(dt.as_secs_f64(), &Input { restart: false, ..*input }, headroom);
    }

    /// Where the person is who steers.
    pub fn standpoint(&self) -> Option<Standpoint<'_>> {
        self.pilot.as_ref().map(Pilot::standpoint)
    }

    /// What the wearer sees over the land, with his hands as they were at the last frame.
    pub fn aids(&self, viewer: &Viewer) -> Aids {
        let mut aids = Aids::default();
        aids.show_hands(&viewer.hands(), &self.controllers.settings);
        aids
    }

    /// Lets the hands feel the octaves that go by.
    ///
    /// # Errors
    /// The session is lost.
    pub fn feel(&mut self, viewer: &Viewer, depth: f64) -> Result<(), xr::Error> {
        self.controllers.tick(depth).map_or(Ok(()), |amplitude| viewer.pulse(amplitude))
    }
}
