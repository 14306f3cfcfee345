//! PURE: places the poses of a flight in a world: the steered path, the anchor for each depth, the viewer over it.

use crate::flight::{FlightPose, Footing, Gaze};
use crate::terrain::block::Digit;
use crate::terrain::place::{Dive, START_LEVEL, TARGET_LEVELS, target};
use crate::terrain::{Block, Place, Spine, Surface};
use glam::{DVec3, Quat, Vec3};
use std::f64::consts::TAU;

/// The viewer stays at least this share of a flight's height above the ground below.
const CLEARANCE: f64 = 0.35;

/// A flight's way through a world. Every standpoint is a function of world, depth and pose alone, to the bit, whatever
/// was asked for before.
///
/// One path is kept, with its bottom where the viewer is. A level deeper or shallower costs the same at any depth, and
/// so does a way sideways, but for the logarithm of its length; from pose to pose nothing is allocated.
#[derive(Debug)]
pub struct Course {
    /// The way down to the target.
    way: Quadrants,
    /// Octaves that the flight's own depths are counted from.
    offset: f64,
    /// The anchor, and the viewer.
    place: Place,
    /// The anchor, counted in tiles from the tile on the way down.
    aside: [i64; 2],
    /// How much the corner of the anchor's plane lies above that of the tile on the way down (1/65 536 tile).
    rise: i64,
    /// The target, seen from the tile on the way down at the anchor's level.
    target: DVec3,
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
    /// Height of the flight above its ground, in anchor tiles: the scale of what is seen.
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
    /// `progress` hears the levels behind it.
    pub fn new(surface: Surface, offset: usize, deepest: f64, progress: impl FnMut(usize)) -> Course {
        let level = START_LEVEL + offset + deepest.max(0.0).ceil() as usize;
        Course::along(Dive::new(surface, level, progress), offset as f64)
    }

    /// Steers on from the tile under a viewer, down to `deepest` octaves below him. There a flight begins: its
    /// depth 0 is his depth, fraction included; its target lies in that tile.
    pub fn from(stand: &Stand, deepest: f64, progress: impl FnMut(usize)) -> Course {
        let mut spine = stand.place.spine.clone();
        let [dx, _, dz] = stand.place.position.to_array().map(|v| v.floor() as i64);
        spine.jump([dx, dz]);
        let deepest = (START_LEVEL as f64 + stand.depth + deepest.max(0.0)).ceil().max(0.0);
        Course::along(Dive::below(spine, deepest as usize, progress), stand.depth)
    }

    /// A viewer who stays where he is, whatever the flight's poses.
    pub fn staying(stand: Stand) -> Course {
        Course { stand: Some(stand.clone()), ..Course::from(&stand, 0.0, |_| ()) }
    }

    /// A flight down a dive, with its depths counted from `offset` octaves below the start.
    fn along(dive: Dive, offset: f64) -> Course {
        let mut spine = canonical(dive.into_spine());
        spine.shrink_to_fit();
        let way = Quadrants::of(&spine);
        let level = level_of(offset, &way);
        while spine.level() > level {
            spine.pop();
        }
        let target = target(&spine, way.below(level));
        let place = Place { spine, position: target };
        Course { way, offset, place, aside: [0, 0], rise: 0, target, stand: None }
    }

    /// The surface that it goes over.
    pub fn surface(&self) -> &Surface {
        self.place.spine.surface()
    }

    /// Bytes held for the path: all that grows with depth.
    pub fn path_bytes(&self) -> usize {
        self.place.spine.path_bytes() + self.way.bytes.capacity()
    }

    /// Where a pose of the flight is.
    pub fn at(&mut self, pose: &FlightPose) -> Standpoint<'_> {
        if self.stand.is_none() {
            self.fly_to(pose);
        }
        if let Some(stand) = &self.stand {
            return stand.standpoint();
        }
        let depth = self.offset + pose.depth;
        let [yaw, pitch] = self.gaze(pose);
        let heading = Quat::from_rotation_y(-yaw as f32);
        Standpoint {
            place: &self.place,
            position: self.place.position,
            height: pose.height * self.unit(depth),
            depth,
            orientation: heading
                * Quat::from_rotation_x(pitch as f32)
                * Quat::from_rotation_z(-whole_turns_off(pose.roll) as f32),
            heading,
        }
    }

    /// The anchor goes to a pose's level and tile, the viewer to its place there.
    fn fly_to(&mut self, pose: &FlightPose) {
        let depth = self.offset + pose.depth;
        self.go_to_level(level_of(depth, &self.way));
        let unit = self.unit(depth);
        let [x, z] = [self.target.x + pose.offset[0] * unit, self.target.z + pose.offset[1] * unit];
        self.go_aside([x.floor() as i64, z.floor() as i64]);
        let [x, z] = [x - x.floor(), z - z.floor()];
        self.place.position = DVec3::new(x, self.altitude(pose, [x, z], pose.height * unit), z);
    }

    /// A cell of a depth, in anchor tiles: 1 down to 1/2 where the anchor is at that depth.
    fn unit(&self, depth: f64) -> f64 {
        (self.place.level() as f64 - START_LEVEL as f64 - depth).exp2()
    }

    /// The anchor goes to the tile of the way down at a level.
    fn go_to_level(&mut self, level: usize) {
        if self.place.level() == level {
            return;
        }
        self.go_aside([0, 0]);
        let spine = &mut self.place.spine;
        while spine.level() > level {
            spine.pop();
        }
        while spine.level() < level {
            spine.push(self.way.digit(spine.level()));
        }
        self.target = target(spine, self.way.below(level));
    }

    /// The anchor goes to a tile of its level, counted from the one on the way down.
    fn go_aside(&mut self, aside: [i64; 2]) {
        let [dx, dz] = [aside[0] - self.aside[0], aside[1] - self.aside[1]];
        self.rise = self.rise.wrapping_add(self.place.spine.jump([dx, dz]));
        self.aside = aside;
    }

    /// The target, seen from the anchor.
    fn target_from_anchor(&self) -> DVec3 {
        let [dx, dz] = self.aside.map(|tiles| tiles as f64);
        self.target - DVec3::new(dx, self.rise as f64 / 65_536.0, dz)
    }

    /// How high over the corner of the anchor's plane a viewer at (x, z) is, in tiles.
    fn altitude(&self, pose: &FlightPose, [x, z]: [f64; 2], height: f64) -> f64 {
        let over_target = self.target_from_anchor().y + height;
        if pose.footing == Footing::Target && pose.offset == [0.0; 2] {
            return over_target;
        }
        let lowest = self.place.ground(x, z) + CLEARANCE * height;
        match pose.footing {
            Footing::Target => over_target.max(lowest),
            Footing::Ground { smoothing } => {
                let over_ground =
                    self.smoothed_ground([x, z], smoothing, |block, at| block.rise(at[0], at[1]));
                self.stay_clear([x, z], over_ground + height, smoothing, height).max(lowest)
            }
            Footing::Clear { smoothing } => {
                self.stay_clear([x, z], over_target, smoothing, height).max(lowest)
            }
        }
    }

    /// A height for a viewer at (x, z), raised where the ground around comes near it: smoothly, and before he is there.
    fn stay_clear(&self, at: [f64; 2], wanted: f64, smoothing: u8, height: f64) -> f64 {
        let around = self.smoothed_ground(at, smoothing.saturating_sub(1), highest_around);
        smooth_max(wanted, around + CLEARANCE * height, height)
    }

    /// The ground around (x, z) of the anchor without its details, in tiles above the corner of the anchor's plane:
    /// a smooth surface (a uniform cubic B-spline, so C²) over what `rise` makes of the lattice points of the level
    /// `smoothing` octaves above. As those are the same points whichever anchor they are seen from, so is the surface.
    fn smoothed_ground(
        &self,
        [x, z]: [f64; 2],
        smoothing: u8,
        rise: impl Fn(&Block, [i32; 2]) -> i64,
    ) -> f64 {
        let (step, corner) = self.place.seen_from_above(DVec3::new(x, 0.0, z), usize::from(smoothing));
        let (across, along) = (spline(corner.x), spline(corner.z));
        let mut height = 0.0;
        for j in -1..=2 {
            for i in -1..=2 {
                let weight = across[(i + 1) as usize] * along[(j + 1) as usize];
                height += weight * (rise(&step.block, [i, j]) as f64 / 65_536.0);
            }
        }
        (height - corner.y) * f64::from(1u32 << smoothing)
    }

    /// Yaw and pitch of a pose, in radians.
    fn gaze(&self, pose: &FlightPose) -> [f64; 2] {
        let turned = match pose.gaze {
            Gaze::Pose => [0.0; 2],
            Gaze::Target => {
                let way = self.target_from_anchor() - self.place.position;
                [way.x.atan2(-way.z), way.y.atan2(way.x.hypot(way.z))]
            }
        };
        [whole_turns_off(turned[0] + pose.yaw), turned[1] + pose.pitch]
    }
}

/// The anchor's level at a depth: the nearest that a way leads to.
fn level_of(depth: f64, way: &Quadrants) -> usize {
    ((START_LEVEL as f64 + depth.floor()).max(0.0) as usize).min(way.levels - TARGET_LEVELS)
}

/// The path to the same tile by digits of 0 and 1 only.
fn canonical(spine: Spine) -> Spine {
    let is_quadrant = |level| spine.digit(level).iter().all(|digit| (0..=1).contains(digit));
    if (0..spine.level()).all(is_quadrant) {
        return spine;
    }
    let ([x, z], quadrants) = spine.canonical();
    let mut path = Spine::new(*spine.surface(), x, z);
    quadrants.into_iter().for_each(|[qx, qz]| path.push([qx as i8, qz as i8]));
    path
}

/// An angle without its whole turns, as f32 keeps little of one that has many; within half a turn it stays as it is.
fn whole_turns_off(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).round()
}

/// The greater of two numbers, rounded off where they are nearer than `width` (above 0) to each other; never less than
/// the greater.
fn smooth_max(a: f64, b: f64, width: f64) -> f64 {
    let overlap = (width - (a - b).abs()).max(0.0);
    a.max(b) + overlap * overlap / (4.0 * width)
}

/// The weights of the lattice points −1, 0, 1, 2 at `u` of 0 to 1.
fn spline(u: f64) -> [f64; 4] {
    let v = 1.0 - u;
    let inner = |u: f64| (4.0 - 6.0 * u * u + 3.0 * u * u * u) / 6.0;
    [v * v * v / 6.0, inner(u), inner(v), u * u * u / 6.0]
}

/// The highest of a lattice point (x and z in −1..=2) and its eight neighbours, above the plane's corner.
fn highest_around(block: &Block, [x, z]: [i32; 2]) -> i64 {
    let rises = (-1..=1).flat_map(|j| (-1..=1).map(move |i| block.rise(x + i, z + j)));
    rises.fold(i64::MIN, i64::max)
}

/// The quadrants of a path, two bits per level.
#[derive(Debug)]
struct Quadrants {
    bytes: Vec<u8>,
    levels: usize,
}

impl Quadrants {
    /// Those of a path whose digits are all 0 or 1, as those of a dive are.
    fn of(spine: &Spine) -> Quadrants {
        let levels = spine.level();
        let mut bytes = vec![0; levels.div_ceil(4)];
        for level in 0..levels {
            let [x, z] = spine.digit(level);
            debug_assert!(x | z | 1 == 1, "a dive keeps to the quadrants of its tile");
            bytes[level / 4] |= (x as u8 | (z as u8) << 1) << (2 * (level % 4));
        }
        Quadrants { bytes, levels }
    }

    /// The digit that leads from a level to the next.
    fn digit(&self, level: usize) -> Digit {
        let bits = self.bytes[level / 4] >> (2 * (level % 4));
        [(bits & 1) as i8, (bits >> 1 & 1) as i8]
    }

    /// The digits that lead on from a level to the target.
    fn below(&self, level: usize) -> [Digit; TARGET_LEVELS] {
        std::array::from_fn(|i| self.digit(level + i))
    }
}

impl Standpoint<'_> {
    /// A cell of its depth, in anchor tiles: whichever level the anchor is at.
    pub fn unit(&self) -> f64 {
        (self.place.level() as f64 - START_LEVEL as f64 - self.depth).exp2()
    }

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
