//! PURE: places the poses of a flight in a world: the steered path, the anchor for each depth, the viewer over it.

use crate::flight::FlightPose;
use crate::terrain::place::{Dive, START_LEVEL};
use crate::terrain::{Place, Surface};
use glam::{DVec3, Quat};

/// The viewer stays at least this share of a flight's height above the ground below.
const CLEARANCE: f64 = 0.35;

/// A flight's way through a world. Every pose is a function of world, depth and pose alone.
#[derive(Debug)]
pub struct Course {
    dive: Dive,
    /// Octaves that the flight's own depths are counted from.
    offset: usize,
    /// The dive's target, seen from the anchor used last.
    target: Place,
    /// The anchor of a viewer who is not above the target.
    aside: Option<Place>,
}

/// Where a pose is in the world.
#[derive(Clone, Copy, Debug)]
pub struct Standpoint<'a> {
    /// The anchor.
    pub place: &'a Place,
    /// The viewer, in anchor tiles.
    pub position: DVec3,
    /// Height above the flight's target, in anchor tiles: the scale of what is seen.
    pub height: f64,
    /// Octaves below the start, with fraction.
    pub depth: f64,
    /// Turns a viewer who looks along −z to where the pose looks.
    pub orientation: Quat,
    /// The same without pitch and roll: for a head that has its own.
    pub heading: Quat,
}

impl Course {
    /// Steers from the root of the world down to `deepest` octaves below `offset` octaves below the start.
    /// `progress` hears the octaves behind it.
    pub fn new(surface: Surface, offset: usize, deepest: f64, progress: impl FnMut(usize)) -> Course {
        let level = START_LEVEL + offset + deepest.max(0.0).ceil() as usize;
        let dive = Dive::new(surface, level, progress);
        let target = dive.place(START_LEVEL + offset);
        Course { dive, offset, target, aside: None }
    }

    /// The surface that it goes over.
    pub fn surface(&self) -> &Surface {
        self.target.spine.surface()
    }

    /// Where a pose of the flight is.
    pub fn at(&mut self, pose: &FlightPose) -> Standpoint<'_> {
        let level = (START_LEVEL + self.offset + pose.depth as usize).min(self.dive.deepest());
        if self.target.level() != level {
            self.target = self.dive.place(level);
        }
        let depth = self.offset as f64 + pose.depth;
        // A cell of the pose's depth, in anchor tiles: 1 down to 1/2.
        let unit = ((level - START_LEVEL) as f64 - depth).exp2();
        let from_target = DVec3::new(pose.offset[0], pose.height, pose.offset[1]) * unit;
        let yaw = Quat::from_rotation_y(-pose.yaw as f32);
        let pitch = Quat::from_rotation_x(pose.pitch as f32);
        let roll = Quat::from_rotation_z(-pose.roll as f32);
        let (place, position) = if pose.offset == [0.0; 2] {
            (&self.target, self.target.position + from_target)
        } else {
            let aside = self.aside.insert(self.target.clone());
            aside.walk(from_target);
            let ground = aside.ground(aside.position.x, aside.position.z);
            let lowest = ground + CLEARANCE * pose.height * unit;
            (&*aside, aside.position.with_y(aside.position.y.max(lowest)))
        };
        Standpoint {
            place,
            position,
            height: pose.height * unit,
            depth,
            orientation: yaw * pitch * roll,
            heading: yaw,
        }
    }
}
