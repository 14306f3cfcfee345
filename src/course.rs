//! PURE: places the poses of a flight in a world: the steered path, the anchor for each depth, the viewer over it.

use crate::flight::FlightPose;
use crate::terrain::place::{Dive, START_LEVEL};
use crate::terrain::{Place, Surface};
use glam::{DVec3, Quat, Vec3};

/// The viewer stays at least this share of a flight's height above the ground below.
const CLEARANCE: f64 = 0.35;

/// A flight's way through a world. Every pose is a function of world, depth and pose alone.
#[derive(Debug)]
pub struct Course {
    dive: Dive,
    /// Octaves that the flight's own depths are counted from.
    offset: f64,
    /// The dive's target, seen from the anchor used last.
    target: Place,
    /// The anchor of a viewer who is not above the target.
    aside: Option<Place>,
    /// Where the viewer stays, whatever the pose.
    stand: Option<Stand>,
}

/// A viewer at a place of his own choice, above no target.
#[derive(Clone, Debug)]
pub struct Stand {
    /// The anchor, and the viewer in its tiles.
    pub place: Place,
    /// Height in anchor tiles: the scale of what is seen, above 0.
    pub height: f64,
    /// Octaves below the start, with fraction; negative further out.
    pub depth: f64,
    /// Turns a viewer who looks along −z.
    pub orientation: Quat,
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
        Course { dive, offset: offset as f64, target, aside: None, stand: None }
    }

    /// Steers on from the tile under a viewer, down to `deepest` octaves below him. There a flight begins: its
    /// depth 0 is his depth, fraction included; its target lies in that tile.
    pub fn from(stand: &Stand, deepest: f64, progress: impl FnMut(usize)) -> Course {
        let mut spine = stand.place.spine.clone();
        let [dx, _, dz] = stand.place.position.to_array().map(|v| v.floor().clamp(-1.0, 1.0) as i32);
        spine.walk(dx, dz);
        let top = START_LEVEL as f64 + stand.depth;
        let dive = Dive::below(spine, (top + deepest.max(0.0)).ceil().max(0.0) as usize, progress);
        let target = dive.place(dive.deepest().min(top.max(0.0) as usize));
        Course { dive, offset: stand.depth, target, aside: None, stand: None }
    }

    /// A viewer who stays where he is, whatever the flight's poses.
    pub fn staying(stand: Stand) -> Course {
        Course { stand: Some(stand.clone()), ..Course::from(&stand, 0.0, |_| ()) }
    }

    /// The surface that it goes over.
    pub fn surface(&self) -> &Surface {
        self.target.spine.surface()
    }

    /// Where a pose of the flight is.
    pub fn at(&mut self, pose: &FlightPose) -> Standpoint<'_> {
        if let Some(stand) = &self.stand {
            return stand.standpoint();
        }
        let depth = self.offset + pose.depth;
        let level = ((START_LEVEL as f64 + depth).max(0.0) as usize).min(self.dive.deepest());
        if self.target.level() != level {
            self.target = self.dive.place(level);
        }
        // A cell of the pose's depth, in anchor tiles: 1 down to 1/2.
        let unit = (level as f64 - START_LEVEL as f64 - depth).exp2();
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

impl Standpoint<'_> {
    /// The same, by itself.
    pub fn stand(&self) -> Stand {
        let &Standpoint { position, height, depth, orientation, .. } = self;
        Stand { place: Place { spine: self.place.spine.clone(), position }, height, depth, orientation }
    }
}

impl Stand {
    /// What he sees things from.
    pub fn standpoint(&self) -> Standpoint<'_> {
        Standpoint {
            place: &self.place,
            position: self.place.position,
            height: self.height,
            depth: self.depth,
            orientation: self.orientation,
            heading: heading(self.orientation),
        }
    }
}

/// The turn about the vertical that an orientation holds: towards where its −z looks, or, where that is straight up
/// or down, towards the back or the top of the head.
fn heading(orientation: Quat) -> Quat {
    let forward = orientation * Vec3::NEG_Z;
    let level = |v: Vec3| v.x.hypot(v.z) > 1e-4;
    let ahead = if level(forward) { forward } else { orientation * Vec3::Y * -forward.y.signum() };
    Quat::from_rotation_y((-ahead.x).atan2(-ahead.z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_heading_is_what_is_left_without_pitch_and_roll() {
        for (yaw, pitch, roll) in
            [(0.5f32, -0.3, 0.2), (-2.0, 1.2, -0.7), (3.0, -1.570_796_4, 0.0), (1.0, 0.0, 0.0)]
        {
            let yaw = Quat::from_rotation_y(yaw);
            let orientation = yaw * Quat::from_rotation_x(pitch) * Quat::from_rotation_z(roll);
            assert!(heading(orientation).angle_between(yaw) < 2e-3, "{yaw} {pitch} {roll}");
        }
    }
}
