//! Who steers: the flight, until a person does.

use std::time::{Duration, Instant};

use glam::Vec3;

use crate::aids::{Aids, HandAid};
use crate::controllers::Controllers;
use crate::course::{Stand, Standpoint};
use crate::input::{Input, Ray};
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
    /// The person was taken elsewhere at once, in the last frame or between it and the one to come.
    jumped: bool,
    jumps: bool,
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
        if let Some(pilot) = &mut self.pilot {
            let stands = self.controllers.settings.standing;
            pilot.stand_on_ground(viewer.floor_m().filter(|_| stands).map(f64::from));
        }
        self.controllers.input(&viewer.hands(), &viewer.head(), dt)
    }

    /// The person's seat is where his head is now, and ahead is where he looks.
    pub fn recentre(&mut self, viewer: &mut Viewer) {
        if let Some(pilot) = &mut self.pilot {
            pilot.turn_to(viewer.gaze());
        }
        viewer.recentre();
        self.jumps = true;
    }

    /// The last frame took the person elsewhere at once: by a step through the air, back to the start, to another place
    /// that he chose, or by turning the play space under him.
    pub fn jumped(&self) -> bool {
        self.jumped
    }

    /// What is drawn of the hands, of where they point and what they do, and of the way back. All else of `aids` stays.
    pub fn aids(&mut self, viewer: &Viewer, aids: &mut Aids) {
        let hands = viewer.hands();
        let holds = self.pilot.as_ref().map_or([false; 2], Pilot::holds);
        aids.hands = std::array::from_fn(|i| {
            let hand = &hands.hands[i];
            let pilot = self.pilot.as_mut();
            let ray_m = pilot.zip(hand.aim.filter(|_| !holds[i])).and_then(|(pilot, aim)| {
                let ray = Ray { origin_m: aim.position, direction: aim.orientation * Vec3::NEG_Z };
                pilot.point_at(&ray, true)
            });
            let grip = hand.grip.or(hand.aim)?;
            Some(HandAid { grip, aim: hand.aim, ray_m: ray_m.map(|m| m as f32), holds: holds[i] })
        });
        if let Some(floor_m) = viewer.floor_m() {
            aids.floor_m = floor_m;
        }
        (aids.arc, aids.arc_lands, aids.thread) = Default::default();
        if let Some(pilot) = &self.pilot {
            let (arc, lands) = pilot.arc();
            (aids.arc, aids.arc_lands) = (*arc, lands);
            pilot.breadcrumbs(true).for_each(|crumb| aids.thread.push(crumb));
        }
        aids.heed(&self.controllers.settings);
    }

    /// Hands over to a person, here.
    pub fn take(&mut self, here: &Stand) {
        self.start.get_or_insert_with(|| here.clone());
        self.jumps |= self.pilot.is_some();
        self.pilot = Some(Pilot::at(here, &self.motion));
    }

    /// Takes the person elsewhere at once, whoever has steered so far.
    pub fn go_to(&mut self, there: &Stand) {
        self.take(there);
        self.jumps = true;
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

    /// Another speed, in octaves per second, for whoever steers and whoever takes over.
    pub fn set_speed(&mut self, speed: f64) {
        self.motion.speed = speed;
        if let Some(pilot) = &mut self.pilot {
            pilot.set(&MotionSettings { speed, ..*pilot.settings() });
        }
    }

    /// Takes the person on by a frame of `dt`, if somebody steers.
    pub fn advance(&mut self, input: &Input, dt: Duration, headroom: f64) {
        self.jumped = std::mem::take(&mut self.jumps);
        let Some(pilot) = &mut self.pilot else { return };
        let before = pilot.jumps();
        if let Some(start) = self.start.as_ref().filter(|_| input.restart) {
            pilot.go_to(start);
        }
        pilot.advance(dt.as_secs_f64(), &Input { restart: false, ..*input }, headroom);
        self.jumped |= pilot.jumps() != before;
    }

    /// Where the person is who steers.
    pub fn standpoint(&self) -> Option<Standpoint<'_>> {
        self.pilot.as_ref().map(Pilot::standpoint)
    }

    /// Lets the hands feel the octaves that go by, and the land that they take hold of.
    ///
    /// # Errors
    /// The session is lost.
    pub fn feel(&mut self, viewer: &Viewer, depth: f64) -> Result<(), xr::Error> {
        let tick = self.controllers.tick(depth).unwrap_or(0.0);
        viewer.pulse(self.controllers.take_pulses().map(|pulse| pulse.max(tick)))
    }
}
