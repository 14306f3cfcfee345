//! A viewer on a mock of one's own: poses in, submitted pictures out; nothing may be said against it at the end.
#![allow(dead_code, reason = "each test binary uses its part")]

use fathomless::course::Course;
use fathomless::flight::FlightPose;
use fathomless::mock::{Clock, Fov, Mock, MockConfig, SubmittedFrame, SubmittedView};
use fathomless::viewer::{Remarks, Step, Viewer, ViewerConfig};
use fathomless::world::World;
use glam::{Quat, Vec3};

/// Near plane of the viewer, metres.
pub const NEAR_M: f32 = 0.05;

/// Height that a pose has for the user, metres.
pub const COMFORT_M: f64 = 2.0;

/// What differs between studios.
pub struct Setup {
    pub world: &'static str,
    pub size: [u32; 2],
    pub fov: [Fov; 2],
    pub ipd_m: f32,
    pub viewer: ViewerConfig,
    /// Octaves below the start that poses are counted from.
    pub depth: usize,
    /// Deepest pose, octaves.
    pub deepest: f64,
    pub read_back: bool,
    /// What the mock's first answer of a frame adds to the head's place, metres.
    pub early_error_m: glam::Vec3,
}

impl Default for Setup {
    fn default() -> Setup {
        let left = Fov { left: -0.8, right: 0.7, up: 0.75, down: -0.75 };
        Setup {
            world: "canyonlands",
            size: [128, 128],
            fov: [left, left.mirrored()],
            ipd_m: 0.063,
            viewer: ViewerConfig { validate: true, ..ViewerConfig::default() },
            depth: 0,
            deepest: 0.0,
            read_back: true,
            early_error_m: glam::Vec3::ZERO,
        }
    }
}

pub struct Studio {
    pub viewer: Viewer,
    pub mock: Mock,
    pub course: Course,
}

impl Studio {
    pub fn open(setup: &Setup) -> Studio {
        let mock = Mock::new(MockConfig {
            clock: Clock::Stepped { hz: 90.0 },
            eye_size: setup.size,
            fov: setup.fov,
            ipd_m: setup.ipd_m,
            read_back: setup.read_back,
            early_error_m: setup.early_error_m,
            ..MockConfig::default()
        });
        let world = World::load(setup.world).unwrap();
        let course = Course::new(world.surface, setup.depth, setup.deepest, |_| ());
        let viewer = Viewer::on_mock(&world, &setup.viewer, mock.clone());
        let viewer = viewer.unwrap_or_else(|error| panic!("{error:#}"));
        Studio { viewer, mock, course }
    }

    /// Draws a pose, through the frames that the session wants without a picture, and gives what was submitted.
    pub fn shoot(&mut self, pose: &FlightPose) -> SubmittedFrame {
        for _ in 0..100 {
            if self.viewer.frame(&self.course.at(pose), false).unwrap() == Step::Drew {
                return self.mock.take_last_frame().unwrap();
            }
        }
        panic!("a hundred frames without a picture");
    }

    /// Ends the session: neither the validation layer nor the runtime may have had anything to say.
    pub fn close(mut self) {
        self.viewer.request_exit().unwrap();
        let pose = pose(0.0, 3.0, 0.0, 0.0);
        for _ in 0..100 {
            if self.viewer.frame(&self.course.at(&pose), false).unwrap() == Step::Exited {
                assert_eq!(self.viewer.close().unwrap(), Remarks::default());
                assert_eq!(self.mock.leaks(), []);
                return;
            }
        }
        panic!("the session does not end");
    }
}

/// A pose above the target: octaves, cells of that depth, degrees.
pub fn pose(depth: f64, height: f64, pitch_deg: f64, yaw_deg: f64) -> FlightPose {
    FlightPose {
        depth,
        yaw: yaw_deg.to_radians(),
        pitch: pitch_deg.to_radians(),
        roll: 0.0,
        height,
        offset: [0.0; 2],
        ..FlightPose::default()
    }
}

/// The geometry of one submitted view, as the specification and the design have it, not as the renderer does it.
pub struct Camera {
    /// From the middle of the head, metres, along the terrain's axes.
    pub eye: Vec3,
    /// Turns view axes (−z ahead) to the terrain's.
    pub turn: Quat,
    tangents: [f32; 4],
    size: [f32; 2],
}

impl Camera {
    /// The cameras of a frame that was drawn for an orientation, with a head that looks straight ahead.
    pub fn both(frame: &SubmittedFrame, orientation: Quat) -> [Camera; 2] {
        let head = (frame.views[0].pose.position + frame.views[1].pose.position) / 2.0;
        [0, 1].map(|i| {
            let view = &frame.views[i];
            Camera {
                eye: orientation * (view.pose.position - head),
                turn: orientation * view.pose.orientation,
                tangents: [view.fov.left, view.fov.right, view.fov.up, view.fov.down].map(f32::tan),
                size: view.size.map(|n| n as f32),
            }
        })
    }

    /// The direction through a place in the picture (in pixels, from the upper left corner), 1 m deep.
    pub fn ray(&self, x: f32, y: f32) -> Vec3 {
        let [left, right, up, down] = self.tangents;
        let across = left + x / self.size[0] * (right - left);
        let upwards = up + y / self.size[1] * (down - up);
        self.turn * Vec3::new(across, upwards, -1.0)
    }

    /// Where a point of the scene is in the picture, and how deep; None behind the eye.
    pub fn project(&self, point: Vec3) -> Option<(f32, f32, f32)> {
        let [left, right, up, down] = self.tangents;
        let view = self.turn.conjugate() * (point - self.eye);
        let deep = -view.z;
        let x = (view.x / deep - left) / (right - left) * self.size[0];
        let y = (view.y / deep - up) / (down - up) * self.size[1];
        (deep > 0.0).then_some((x, y, deep))
    }
}

/// Depth of a pixel as stored.
pub fn depth_at(view: &SubmittedView, x: u32, y: u32) -> f32 {
    let depth = view.depth.as_ref().expect("depth is submitted");
    depth.values[(y * depth.size[0] + x) as usize]
}

/// The value that so much of the list (0..=1) is below.
pub fn quantile(values: &mut [f64], share: f64) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share).round() as usize]
}
