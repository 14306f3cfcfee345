//! Poses, fields of view and pose tracks, as plain data.

use glam::{Quat, Vec3};
use openxr::sys;

/// A rigid transform: metres, unit quaternion; right-handed, y up, -z forward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Metres.
    pub position: Vec3,
    /// Unit quaternion.
    pub orientation: Quat,
}

impl Pose {
    /// No translation, no rotation.
    pub const IDENTITY: Self = Self { position: Vec3::ZERO, orientation: Quat::IDENTITY };

    /// Position in metres and an orientation, which is normalised.
    pub fn new(position: Vec3, orientation: Quat) -> Self {
        Self { position, orientation: orientation.normalize() }
    }

    /// Upright at a position in metres, looking along -z.
    pub fn at(x: f32, y: f32, z: f32) -> Self {
        Self { position: Vec3::new(x, y, z), orientation: Quat::IDENTITY }
    }

    /// `a_from_b.then(b_from_c)` is `a_from_c`.
    #[must_use]
    pub fn then(self, inner: Self) -> Self {
        Self {
            position: self.position + self.orientation * inner.position,
            orientation: (self.orientation * inner.orientation).normalize(),
        }
    }

    /// `a_from_b.inverse()` is `b_from_a`.
    #[must_use]
    pub fn inverse(self) -> Self {
        let orientation = self.orientation.conjugate();
        Self { position: -(orientation * self.position), orientation }
    }

    pub(super) fn from_xr(pose: sys::Posef) -> Self {
        let (p, q) = (pose.position, pose.orientation);
        Self { position: Vec3::new(p.x, p.y, p.z), orientation: Quat::from_xyzw(q.x, q.y, q.z, q.w) }
    }

    pub(super) fn to_xr(self) -> sys::Posef {
        sys::Posef {
            orientation: sys::Quaternionf {
                x: self.orientation.x,
                y: self.orientation.y,
                z: self.orientation.z,
                w: self.orientation.w,
            },
            position: vector_to_xr(self.position),
        }
    }
}

pub(super) fn vector_to_xr(v: Vec3) -> sys::Vector3f {
    sys::Vector3f { x: v.x, y: v.y, z: v.z }
}

/// Finite, and the quaternion's length is 1 to within a hundredth.
pub(super) fn is_valid(pose: sys::Posef) -> bool {
    let pose = Pose::from_xr(pose);
    pose.position.is_finite()
        && pose.orientation.is_finite()
        && (pose.orientation.length() - 1.0).abs() <= 0.01
}

/// The four half angles of one eye, radians; left and down are negative as a rule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fov {
    /// Radians, negative to the left.
    pub left: f32,
    /// Radians.
    pub right: f32,
    /// Radians.
    pub up: f32,
    /// Radians, negative downwards.
    pub down: f32,
}

impl Fov {
    /// The same field seen in a mirror: the other eye's.
    #[must_use]
    pub fn mirrored(self) -> Self {
        Self { left: -self.right, right: -self.left, ..self }
    }

    pub(super) fn from_xr(fov: sys::Fovf) -> Self {
        Self { left: fov.angle_left, right: fov.angle_right, up: fov.angle_up, down: fov.angle_down }
    }

    pub(super) fn to_xr(self) -> sys::Fovf {
        sys::Fovf { angle_left: self.left, angle_right: self.right, angle_up: self.up, angle_down: self.down }
    }

    /// Every angle strictly inside a quarter turn.
    pub(super) fn is_valid(self) -> bool {
        [self.left, self.right, self.up, self.down]
            .iter()
            .all(|angle| angle.abs() < std::f32::consts::FRAC_PI_2)
    }
}

/// Where something is over time: keyframes, straight lines and slerp between them, the ends held.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseTrack {
    /// Seconds and poses, in order of time; never empty.
    keys: Vec<(f64, Pose)>,
}

impl PoseTrack {
    /// The same pose for ever.
    pub fn fixed(pose: Pose) -> Self {
        Self { keys: vec![(0.0, pose)] }
    }

    /// Keyframes: seconds since the session's first frame, and the pose then. They are put in order of time; none
    /// at all means the identity for ever.
    pub fn new(keys: impl IntoIterator<Item = (f64, Pose)>) -> Self {
        let mut keys: Vec<_> = keys.into_iter().collect();
        keys.sort_by(|a, b| a.0.total_cmp(&b.0));
        if keys.is_empty() {
            keys.push((0.0, Pose::IDENTITY));
        }
        Self { keys }
    }

    /// The pose at a time in seconds.
    pub fn sample(&self, time_s: f64) -> Pose {
        let next = self.keys.partition_point(|(t, _)| *t <= time_s);
        if next == 0 {
            return self.keys[0].1;
        }
        let (t0, a) = self.keys[next - 1];
        let Some(&(t1, b)) = self.keys.get(next) else {
            return a;
        };
        let s = ((time_s - t0) / (t1 - t0)) as f32;
        Pose {
            position: a.position.lerp(b.position, s),
            orientation: a.orientation.slerp(b.orientation, s).normalize(),
        }
    }
}

impl Default for PoseTrack {
    /// A person of eye height 1.6 m who stands in the middle and looks along -z.
    fn default() -> Self {
        Self::fixed(Pose::at(0.0, 1.6, 0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_and_its_inverse_cancel() {
        let pose = Pose::new(Vec3::new(1.0, 2.0, 3.0), Quat::from_rotation_y(0.7));
        let identity = pose.then(pose.inverse());
        assert!(identity.position.length() < 1e-6);
        assert!(identity.orientation.angle_between(Quat::IDENTITY) < 1e-3);
    }

    #[test]
    fn tracks_interpolate_and_hold_their_ends() {
        let track = PoseTrack::new([
            (2.0, Pose::new(Vec3::X * 4.0, Quat::from_rotation_y(1.0))),
            (0.0, Pose::IDENTITY),
        ]);
        assert_eq!(track.sample(-1.0), Pose::IDENTITY);
        assert_eq!(track.sample(9.0).position, Vec3::X * 4.0);
        let middle = track.sample(1.0);
        assert!((middle.position.x - 2.0).abs() < 1e-6);
        assert!(middle.orientation.angle_between(Quat::from_rotation_y(0.5)) < 1e-3);
    }
}
