//! PURE: the rig, the play space's place in the terrain: where it is, which way it faces, how large it is.
//!
//! The head moves inside the rig in metres; the rig stands in the terrain in tiles. What leaves here is in *scene*
//! coordinates: metres from the middle of the head, along the terrain's axes.

use crate::terrain::select::Frustum;
use glam::{DVec3, Mat4, Quat, Vec3};

/// What a standpoint's height is for the user, in metres: comfortable for stereo.
pub const COMFORT_M: f64 = 2.0;

/// A head or an eye in the play space, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Metres from the play space's origin.
    pub position: Vec3,
    /// Unit quaternion.
    pub orientation: Quat,
}

/// One eye as the runtime gives it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eye {
    /// Where it is.
    pub pose: Pose,
    /// Angles of the view's sides in radians: left (usually negative), right, up, down (usually negative).
    pub fov: [f32; 4],
}

/// The play space's place in the terrain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rig {
    /// Point of the play space, in metres, that stands at [`Rig::position`].
    pub seat: Vec3,
    /// Where the seat is, in anchor tiles.
    pub position: DVec3,
    /// Turns play-space axes to the terrain's.
    pub orientation: Quat,
    /// The user's metres per anchor tile: above 0.
    pub metres_per_tile: f64,
}

impl Rig {
    /// The middle of the head, in anchor tiles.
    pub fn head(&self, head: &Pose) -> DVec3 {
        let from_seat = self.orientation * (head.position - self.seat);
        self.position + from_seat.as_dvec3() / self.metres_per_tile
    }

    /// An eye's axes over the scene.
    pub fn scene_from_view(&self, head: &Pose, eye: &Eye) -> Mat4 {
        let from_head = self.orientation * (eye.pose.position - head.position);
        let turn = (self.orientation * eye.pose.orientation).normalize();
        Mat4::from_rotation_translation(turn, from_head)
    }

    /// The play space, in metres from the seat, over the scene.
    pub fn scene_from_play(&self, head: &Pose) -> Mat4 {
        Mat4::from_rotation_translation(self.orientation, self.orientation * (self.seat - head.position))
    }

    /// What an eye sees, widened by `margin` radians on every side; `root_m` is the size in metres of a tile of the
    /// selection's root.
    pub fn frustum(&self, head: &Pose, eye: &Eye, margin: f32, root_m: f64) -> Frustum {
        let from_head = self.orientation * (eye.pose.position - head.position);
        let turn = (self.orientation * eye.pose.orientation).normalize();
        // Just short of a right angle, where the tangent ends.
        let widest = 1.55;
        let [left, right, up, down] = eye.fov;
        let [left, down] = [left, down].map(|a| (a - margin).clamp(-widest, widest).tan());
        let [right, up] = [right, up].map(|a| (a + margin).clamp(-widest, widest).tan());
        let normals = [
            Vec3::new(1.0, 0.0, left),
            Vec3::new(-1.0, 0.0, -right),
            Vec3::new(0.0, -1.0, -up),
            Vec3::new(0.0, 1.0, down),
        ];
        Frustum { eye: from_head / root_m as f32, normals: normals.map(|n| turn * n.normalize()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn eye() -> Eye {
        let pose = Pose { position: Vec3::new(0.03, 1.6, 0.0), orientation: Quat::IDENTITY };
        Eye { pose, fov: [-0.8, 0.7, 0.6, -0.9] }
    }

    #[test]
    fn a_frustum_holds_what_lies_between_its_angles() {
        let head = Pose { position: Vec3::new(0.0, 1.6, 0.0), orientation: Quat::IDENTITY };
        let rig = Rig {
            seat: Vec3::ZERO,
            position: DVec3::ZERO,
            orientation: Quat::from_rotation_y(1.0),
            metres_per_tile: 3.0,
        };
        let frustum = rig.frustum(&head, &eye(), 0.0, 24.0);
        let inside = |across: f32, up: f32, forward: f32| {
            let in_view = Vec3::new(across.tan() * forward, up.tan() * forward, -forward);
            let p = frustum.eye + rig.orientation * in_view;
            frustum.normals.iter().all(|n| n.dot(p - frustum.eye) >= 0.0)
        };
        assert!(inside(0.0, 0.0, 1.0) && inside(-0.79, 0.59, 5.0) && inside(0.69, -0.89, 0.1));
        assert!(!inside(-0.81, 0.0, 1.0) && !inside(0.71, 0.0, 1.0));
        assert!(!inside(0.0, 0.61, 1.0) && !inside(0.0, -0.91, 1.0) && !inside(0.0, 0.0, -1.0));
    }

    #[test]
    fn the_head_moves_in_the_rig_in_metres() {
        let rig = Rig {
            seat: Vec3::new(0.0, 1.6, 0.0),
            position: DVec3::new(0.5, 2.0, 0.5),
            orientation: Quat::from_rotation_y(std::f32::consts::FRAC_PI_2),
            metres_per_tile: 2.0,
        };
        let head = Pose { position: Vec3::new(0.0, 1.8, -1.0), orientation: Quat::IDENTITY };
        // Forward (−z) is −x after a quarter turn to the left.
        assert!((rig.head(&head) - DVec3::new(0.0, 2.1, 0.5)).length() < 1e-6);
        let eye = eye();
        let at_eye = rig.scene_from_view(&head, &eye) * Vec3::ZERO.extend(1.0);
        assert!((at_eye.truncate() - Vec3::new(1.0, -0.2, -0.03)).length() < 1e-6);
    }
}
