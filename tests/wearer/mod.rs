//! A wearer with hands, on a mock headset over gentle ground.
#![allow(dead_code, reason = "each test binary uses its part")]
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests stop at the first surprise")]

use std::f32::consts::FRAC_PI_4;
use std::time::Duration;

use fathomless::bindings::{self, Action, BUILT_IN, HANDS, ProfileBindings};
use fathomless::controllers::{ControllerSettings, Controllers};
use fathomless::course::Course;
use fathomless::flight::FlightPose;
use fathomless::input::Input;
use fathomless::mock::registry::{self, Kind};
use fathomless::mock::{InputValue, Mock, MockConfig, Pose as MockPose, PoseTrack};
use fathomless::pilot::{MotionSettings, Pilot};
use fathomless::viewer::{Step, Viewer, ViewerConfig};
use fathomless::world::World;
use glam::{Quat, Vec3};

use crate::life::{assert_clean, least};

pub const FRAME: Duration = Duration::from_nanos(11_111_111);

/// Frames until the mock's session has the focus.
pub const SETTLED: usize = 8;

pub fn built_in(left_handed: bool) -> Vec<ProfileBindings> {
    bindings::parse("config/bindings.toml", BUILT_IN, left_handed).unwrap()
}

/// A wearer on a mock, over gentle ground.
pub struct Wearer {
    pub mock: Mock,
    pub viewer: Viewer,
    pub pilot: Pilot,
    pub controllers: Controllers,
}

impl Wearer {
    pub fn new(config: MockConfig, left_handed: bool) -> Wearer {
        let world = World::load("hills").unwrap();
        let mock = Mock::new(config);
        let bindings: &'static [ProfileBindings] = built_in(left_handed).leak();
        let config = ViewerConfig { bindings: Some(bindings), validate: true, ..least() };
        let viewer = Viewer::on_mock(&world, &config, mock.clone()).unwrap();
        let pose = FlightPose { height: 2.0, ..FlightPose::default() };
        let stand = Course::new(world.surface, 20, 0.0, |_| ()).at(&pose).stand();
        let pilot = Pilot::at(&stand, &MotionSettings { inertia_s: 0.0, ..MotionSettings::default() });
        let settings = ControllerSettings { left_handed, ..ControllerSettings::default() };
        Wearer { mock, viewer, pilot, controllers: Controllers::new(settings) }
    }

    /// Holds these controllers, pointing ahead and down.
    pub fn takes(&mut self, profile: &str) {
        for (hand, x) in HANDS.iter().zip([-0.2, 0.2]) {
            self.mock.connect(hand, profile).unwrap();
            let orientation = Quat::from_rotation_x(-FRAC_PI_4);
            let pose = MockPose { position: Vec3::new(x, 1.3, -0.3), orientation };
            self.mock.set_pose_track(&format!("{hand}/input/aim/pose"), PoseTrack::fixed(pose)).unwrap();
        }
    }

    /// What the person wants after so many frames of this.
    pub fn fly(&mut self, frames: usize) -> Input {
        let mut input = Input::default();
        for _ in 0..frames {
            let hands = self.viewer.hands();
            input = self.controllers.input(&hands, &self.viewer.head(), FRAME);
            self.pilot.advance(FRAME.as_secs_f64(), &input, 1.0);
            let tick = self.controllers.tick(self.pilot.standpoint().depth).unwrap_or(0.0);
            let felt = self.controllers.take_pulses().map(|pulse| pulse.max(tick));
            self.viewer.pulse(felt).unwrap();
            let step = self.viewer.frame(&self.pilot.standpoint(), true).unwrap();
            assert_ne!(step, Step::Exited);
        }
        input
    }

    /// Puts a hand where this is from the seat, in metres, pointing ahead and down.
    pub fn hand_at(&mut self, hand: usize, from_seat: Vec3) {
        let seat = self.seat();
        let orientation = Quat::from_rotation_x(-FRAC_PI_4);
        let pose = MockPose { position: seat + from_seat, orientation };
        for name in ["aim", "grip"] {
            let path = format!("{}/input/{name}/pose", HANDS[hand]);
            self.mock.set_pose_track(&path, PoseTrack::fixed(pose)).unwrap();
        }
    }

    /// Where the seat is for the mock: its head, which does not move.
    fn seat(&self) -> Vec3 {
        MockConfig::default().head.sample(0.0).position
    }

    pub fn set(&self, paths: &[&str], kind: Kind, value: f32) {
        for path in paths {
            self.mock.set_input(path, input_of(kind, value)).unwrap();
        }
    }

    pub fn ends(mut self) {
        self.viewer.request_exit().unwrap();
        while self.viewer.frame(&self.pilot.standpoint(), true).unwrap() != Step::Exited {}
        let witness = self.viewer.witness();
        drop(self.viewer);
        let remarks = witness.remarks();
        assert_eq!(remarks.validation, 0, "{:?}", remarks.first);
        assert_clean(&self.mock, "at the end");
    }
}

/// What an input of this kind says that is moved so far; a stick: ahead.
pub fn input_of(kind: Kind, value: f32) -> InputValue {
    match kind {
        Kind::Boolean => InputValue::from(value > 0.5),
        Kind::Vector => InputValue::from([0.0, value]),
        _ => InputValue::from(value),
    }
}

/// The full paths that a profile has for an action, and their kind.
pub fn paths(profile: &ProfileBindings, action: Action) -> (Vec<&str>, Kind) {
    let of = profile.paths.iter().filter(|(it, _)| *it == action).map(|(_, path)| path.as_str());
    let paths: Vec<&str> = of.collect();
    let registered = registry::profile(profile.profile).unwrap();
    let kind = paths.first().and_then(|path| {
        let (hand, subpath) = registered.split(path)?;
        Some(registered.component(hand, subpath)?.kind)
    });
    (paths, kind.unwrap_or(Kind::Boolean))
}
