//! Which way the viewer faces: what is upright, his heading, and how his look is turned from that.

use crate::terrain::{Block, Place};
use glam::{DMat3, DQuat, DVec3};
use std::f64::consts::{FRAC_PI_2, TAU};

/// How the viewer faces: `upright · pitch · roll`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Facing {
    /// Upright and heading: turns the play space of a worn headset to the terrain's axes. What is level, turned.
    pub(super) upright: DQuat,
    /// The same without the turns since.
    level: DQuat,
    /// Those turns, to the left, in 2⁻⁶⁴ of a whole one: a turn and the same back end on the bits they began with.
    turned: i64,
    /// Radians upwards, −π/2 to π/2.
    pub(super) pitch: f64,
    /// Radians towards the right shoulder, −π to π.
    pub(super) roll: f64,
}

impl Facing {
    /// The facing that looks as `orientation` does, with `up` as upright.
    pub(super) fn new(orientation: DQuat, up: DVec3) -> Facing {
        let ahead = orientation * DVec3::NEG_Z;
        let level = |v: DVec3| v.reject_from_normalized(up);
        // Straight up or down it is the top or the back of the head that says where ahead is.
        let ahead = if level(ahead).length() > 1e-4 {
            level(ahead)
        } else {
            level(-ahead.dot(up).signum() * (orientation * DVec3::Y))
        };
        let back = -ahead.try_normalize().unwrap_or_else(|| up.any_orthonormal_vector());
        let upright = DQuat::from_mat3(&DMat3::from_cols(up.cross(back), up, back)).normalize();
        let look = upright.inverse() * orientation;
        let forward = look * DVec3::NEG_Z;
        let pitch = forward.y.atan2(-forward.z).clamp(-FRAC_PI_2, FRAC_PI_2);
        let right = DQuat::from_rotation_x(-pitch) * look * DVec3::X;
        Facing { upright, level: upright, turned: 0, pitch, roll: (-right.y).atan2(right.x) }
    }

    /// Turns a viewer who looks along −z.
    pub(super) fn orientation(&self) -> DQuat {
        self.upright * DQuat::from_rotation_x(self.pitch) * DQuat::from_rotation_z(-self.roll)
    }

    /// Turns the heading to the right, radians.
    pub(super) fn turn(&mut self, right: f64) {
        self.turn_by(part_of_turn(-right));
    }

    /// Turns the heading to the left, in 2⁻⁶⁴ of a whole turn.
    pub(super) fn turn_by(&mut self, left: i64) {
        if left != 0 {
            self.turned = self.turned.wrapping_add(left);
            self.settle();
        }
    }

    fn settle(&mut self) {
        let turned = self.turned as f64 * (TAU / WHOLE_TURN);
        let upright = (self.level * DQuat::from_rotation_y(turned)).normalize();
        // The same turn has two quaternions: beyond half of a whole one the other would come next.
        self.upright = if upright.dot(self.upright) < 0.0 { -upright } else { upright };
    }

    /// Turns the look by radians to the right and up of the picture, rolled as it is.
    pub(super) fn look(&mut self, right: f64, up: f64) {
        let (sin, cos) = self.roll.sin_cos();
        self.turn(right * cos + up * sin);
        self.pitch = (self.pitch + up * cos - right * sin).clamp(-FRAC_PI_2, FRAC_PI_2);
    }

    /// Tilts the head towards the right shoulder, radians.
    pub(super) fn tilt(&mut self, right: f64) {
        let roll = self.roll + right;
        self.roll = roll - TAU * (roll / TAU).round();
    }

    /// Turns what is upright towards `up`, a unit vector, the short way: by a share of what is left, and by at most
    /// `most` radians. Returns how far it was off.
    pub(super) fn level(&mut self, up: DVec3, most: f64, share: f64) -> f64 {
        let was = self.upright * DVec3::Y;
        let off = was.angle_between(up);
        let angle = most.min(off * share);
        if let Some(axis) = was.cross(up).try_normalize().filter(|_| angle > 0.0) {
            self.level = (DQuat::from_axis_angle(axis, angle) * self.level).normalize();
            self.settle();
        }
        off
    }

    /// Takes a share of the roll off, at most `most` radians. Returns how much there was.
    pub(super) fn unroll(&mut self, most: f64, share: f64) -> f64 {
        let was = self.roll.abs();
        self.roll -= (self.roll * share).clamp(-most, most);
        was
    }
}

/// What [`Facing::turn_by`] counts a whole turn as.
const WHOLE_TURN: f64 = 18_446_744_073_709_551_616.0;

/// An angle in radians in 2⁻⁶⁴ of a whole turn, without its whole turns.
pub(super) fn part_of_turn(angle: f64) -> i64 {
    let turns = angle / TAU;
    ((turns - turns.round()) * WHOLE_TURN) as i64
}

/// Which way the ground's plane faces around a place, by the tiles of `level` (with fraction): a unit vector that changes
/// smoothly with the place and with the level.
pub(super) fn ground_up(place: &Place, level: f64) -> DVec3 {
    let level = level.clamp(0.0, place.level() as f64);
    let (whole, part) = (level.floor(), level.fract());
    let [coarse, fine] = [whole, (whole + 1.0).min(place.level() as f64)].map(|level| {
        let (step, at) = place.lift(place.position, place.level(), level as usize);
        slope(&step.block, at)
    });
    let [gx, gz] = [0, 1].map(|axis| coarse[axis] + part * (fine[axis] - coarse[axis]));
    DVec3::new(-gx, 1.0, -gz).normalize()
}

/// Rise over run along x and z of a block's heights: of the uniform cubic B-spline over its lattice points.
fn slope(block: &Block, at: DVec3) -> [f64; 2] {
    let cell = |v: f64| v.floor().clamp(-1.0, 1.0);
    let (i, k) = (cell(at.x), cell(at.z));
    let (x, z) = (weights((at.x - i).clamp(0.0, 1.0)), weights((at.z - k).clamp(0.0, 1.0)));
    let mut slope = [0.0; 2];
    for (dz, (weight_z, slope_z)) in (-1..).zip(z) {
        for (dx, (weight_x, slope_x)) in (-1..).zip(x) {
            let height = f64::from(block.residual(i as i32 + dx, k as i32 + dz)) / 65_536.0;
            slope[0] += slope_x * weight_z * height;
            slope[1] += weight_x * slope_z * height;
        }
    }
    let [gx, gz] = block.plane.slope();
    [slope[0] + gx, slope[1] + gz]
}

/// The weights of the lattice points −1, 0, 1, 2 at `u` of 0 to 1, each with its derivative.
fn weights(u: f64) -> [(f64, f64); 4] {
    let v = 1.0 - u;
    [
        (v * v * v / 6.0, -v * v / 2.0),
        ((4.0 - 6.0 * u * u + 3.0 * u * u * u) / 6.0, u * (1.5 * u - 2.0)),
        ((4.0 - 6.0 * v * v + 3.0 * v * v * v) / 6.0, -v * (1.5 * v - 2.0)),
        (u * u * u / 6.0, u * u / 2.0),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_facing_looks_as_the_orientation_does() {
        for (yaw, pitch, roll, up) in [
            (0.5, -0.3, 0.2, DVec3::Y),
            (-2.0, 1.2, -0.7, DVec3::new(0.5, 1.0, -2.0).normalize()),
            (3.0, -FRAC_PI_2, 0.4, DVec3::Y),
            (1.0, FRAC_PI_2, 0.0, DVec3::Y),
            (1.0, -0.5, 3.0, DVec3::X),
        ] {
            let orientation =
                DQuat::from_rotation_y(yaw) * DQuat::from_rotation_x(pitch) * DQuat::from_rotation_z(-roll);
            let facing = Facing::new(orientation, up);
            assert!(
                facing.orientation().angle_between(orientation) < 1e-6,
                "{yaw} {pitch} {roll}: {facing:?}"
            );
            assert!((facing.upright * DVec3::Y).distance(up) < 1e-9);
            if up == DVec3::Y && pitch.abs() < 1.5 {
                assert!(
                    (facing.pitch - pitch).abs() < 1e-6 && (facing.roll - roll).abs() < 1e-6,
                    "{facing:?}"
                );
            }
        }
    }

    #[test]
    fn looking_right_is_right_on_the_picture_whatever_the_roll() {
        for roll in [0.0, 0.6, -1.5, 3.0] {
            let mut facing = Facing::new(DQuat::IDENTITY, DVec3::Y);
            facing.tilt(roll);
            let before = facing.orientation();
            facing.look(0.01, 0.02);
            let ahead = before.inverse() * facing.orientation() * DVec3::NEG_Z;
            assert!((ahead - DVec3::new(0.01, 0.02, -1.0)).length() < 1e-3, "{roll}: {ahead}");
        }
    }

    #[test]
    fn levelling_keeps_the_heading_and_ends_upright() {
        let mut facing = Facing::new(DQuat::from_rotation_y(0.7), DVec3::new(0.3, 1.0, 0.1).normalize());
        let heading = |facing: &Facing| (facing.upright * DVec3::NEG_Z).with_y(0.0).normalize();
        let before = heading(&facing);
        for _ in 0..2_000 {
            let was = facing.upright;
            facing.level(DVec3::Y, 0.002, 0.015);
            assert!(facing.upright.angle_between(was) <= 0.002_001);
        }
        assert!((facing.upright * DVec3::Y).distance(DVec3::Y) < 1e-3);
        assert!(heading(&facing).dot(before) > 0.99);
    }
}
