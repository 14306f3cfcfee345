//! Eyes as the runtime places them: poses, fields of view, the matrices made from them, and the memory of the last good ones.

use std::f32::consts::{FRAC_PI_2, FRAC_PI_4};

use glam::{Mat4, Quat, Vec3, Vec4};
use openxr::sys;

/// A place and a direction: metres and a unit quaternion; x right, y up, looking along -z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Metres from the origin of the space it was located in.
    pub position: Vec3,
    /// Turns the pose's own axes into those of the space.
    pub orientation: Quat,
}

impl Pose {
    /// At the origin, looking along -z.
    pub const IDENTITY: Self = Self { position: Vec3::ZERO, orientation: Quat::IDENTITY };

    /// From this pose's own coordinates to those of the space it is in.
    pub fn space_from_view(&self) -> Mat4 {
        Mat4::from_rotation_translation(self.orientation, self.position)
    }

    /// The view matrix: from the space this pose is in to the pose's own coordinates.
    pub fn view_from_space(&self) -> Mat4 {
        let turn = self.orientation.conjugate();
        Mat4::from_rotation_translation(turn, turn * -self.position)
    }

    /// `inner`, given relative to this pose, expressed in the space this pose is in.
    pub fn compose(&self, inner: &Pose) -> Pose {
        Pose {
            position: self.position + self.orientation * inner.position,
            orientation: (self.orientation * inner.orientation).normalize(),
        }
    }

    /// `other`, given in the same space, expressed relative to this pose.
    pub fn relative(&self, other: &Pose) -> Pose {
        let turn = self.orientation.conjugate();
        Pose {
            position: turn * (other.position - self.position),
            orientation: (turn * other.orientation).normalize(),
        }
    }
}

/// An eye's field of view: four angles in radians from its -z axis, in (-pi/2, pi/2); left and down are usually negative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fov {
    /// Angle of the left edge.
    pub left: f32,
    /// Angle of the right edge.
    pub right: f32,
    /// Angle of the upper edge.
    pub up: f32,
    /// Angle of the lower edge.
    pub down: f32,
}

impl Fov {
    /// Reversed-Z infinite projection into Vulkan's clip space: y down, depth 1 at `near_m` metres, 0 at infinity.
    pub fn clip_from_view(&self, near_m: f32) -> Mat4 {
        let (left, right) = (self.left.tan(), self.right.tan());
        let (up, down) = (self.up.tan(), self.down.tan());
        let (width, height) = (right - left, down - up);
        Mat4::from_cols(
            Vec4::new(2.0 / width, 0.0, 0.0, 0.0),
            Vec4::new(0.0, 2.0 / height, 0.0, 0.0),
            Vec4::new((right + left) / width, (up + down) / height, 0.0, -1.0),
            Vec4::new(0.0, 0.0, near_m, 0.0),
        )
    }

    /// Whether a projection can be made of it.
    fn is_sound(&self) -> bool {
        let angles = [self.left, self.right, self.up, self.down];
        angles.iter().all(|a| a.is_finite() && a.abs() < FRAC_PI_2)
            && self.left < self.right
            && self.down < self.up
    }
}

/// One eye of one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// The eye in the session's space.
    pub pose: Pose,
    /// What it sees.
    pub fov: Fov,
}

/// How much of the views is known at this moment; the rest is the last that was.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tracking {
    /// Place and direction.
    Full,
    /// The direction; the head stays where it was last seen.
    OrientationOnly,
    /// The place; the head looks where it last looked.
    PositionOnly,
    /// Neither: everything is the last good one.
    Lost,
}

/// Both eyes at one display time, in the session's space. Left first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Views {
    /// Left, right.
    pub eyes: [View; 2],
    /// Between the eyes: the middle of their places, the mean of their directions.
    pub head: Pose,
    /// Which part is fresh.
    pub tracking: Tracking,
}

/// Remembers the last good head, eyes and fields of view, and fills in with them what the runtime does not know.
///
/// Place and direction are kept apart, and the eyes relative to the head: while only the direction is known the eyes go on
/// turning round the head, instead of swapping sides when the head looks back.
#[derive(Debug, Clone)]
pub(super) struct LastGood {
    head: Pose,
    /// The eyes relative to the head.
    eyes: [Pose; 2],
    fovs: [Fov; 2],
}

/// Half the distance between the eyes until the runtime has told it, in metres.
const HALF_EYE_DISTANCE_M: f32 = 0.0315;

impl LastGood {
    /// Before anything was located: `eye_height_m` above the space's origin, looking along -z.
    pub(super) fn new(eye_height_m: f32) -> Self {
        let eye = |x| Pose { position: Vec3::new(x, 0.0, 0.0), ..Pose::IDENTITY };
        let fov = Fov { left: -FRAC_PI_4, right: FRAC_PI_4, up: FRAC_PI_4, down: -FRAC_PI_4 };
        Self {
            head: Pose { position: Vec3::new(0.0, eye_height_m, 0.0), ..Pose::IDENTITY },
            eyes: [eye(-HALF_EYE_DISTANCE_M), eye(HALF_EYE_DISTANCE_M)],
            fovs: [fov; 2],
        }
    }

    /// The space's origin moved up by `by_m`: the head stays where it is in the room.
    pub(super) fn origin_raised(&mut self, by_m: f32) {
        self.head.position.y -= by_m;
    }

    /// Views made of what `located` says is valid and of the last good rest, which they then are.
    pub(super) fn update(&mut self, flags: sys::ViewStateFlags, located: &[sys::View; 2]) -> Views {
        for (fov, view) in self.fovs.iter_mut().zip(located) {
            let now = fov_from_sys(view.fov);
            if now.is_sound() {
                *fov = now;
            }
        }
        let [left, right] = located.map(|view| view.pose);
        let orientations = flags
            .contains(sys::ViewStateFlags::ORIENTATION_VALID)
            .then(|| Some([quat_from_sys(left.orientation)?, quat_from_sys(right.orientation)?]))
            .flatten();
        let positions = flags
            .contains(sys::ViewStateFlags::POSITION_VALID)
            .then(|| [left, right].map(|pose| vec_from_sys(pose.position)))
            .filter(|p| p.iter().all(|v| v.is_finite()));

        let tracking = match (&orientations, &positions) {
            (Some(_), Some(_)) => Tracking::Full,
            (Some(_), None) => Tracking::OrientationOnly,
            (None, Some(_)) => Tracking::PositionOnly,
            (None, None) => Tracking::Lost,
        };
        if let Some([a, b]) = orientations {
            self.head.orientation = middle(a, b);
        }
        if let Some([a, b]) = positions {
            self.head.position = a.midpoint(b);
        }
        let poses = match (orientations, positions) {
            // Exactly the runtime's numbers: it expects them back with the frame.
            (Some(q), Some(p)) => {
                let poses = [0, 1].map(|i| Pose { position: p[i], orientation: q[i] });
                self.eyes = poses.map(|eye| self.head.relative(&eye));
                poses
            }
            _ => self.eyes.map(|eye| self.head.compose(&eye)),
        };
        let eyes = [0, 1].map(|i| View { pose: poses[i], fov: self.fovs[i] });
        Views { eyes, head: self.head, tracking }
    }
}

/// The direction between two: the normalised mean, of the nearer pair of the quaternions' two signs.
fn middle(a: Quat, b: Quat) -> Quat {
    let b = if a.dot(b) < 0.0 { -b } else { b };
    let mean = a + b;
    if mean.length_squared() > 1e-6 { mean.normalize() } else { a }
}

/// `None` for what is no direction: runtimes leave zeros or rubbish where tracking is lost.
fn quat_from_sys(q: sys::Quaternionf) -> Option<Quat> {
    let quat = Quat::from_xyzw(q.x, q.y, q.z, q.w);
    let length = quat.length();
    if !length.is_finite() || length < 0.5 {
        return None;
    }
    Some(if (length - 1.0).abs() > 1e-5 { quat.normalize() } else { quat })
}

fn vec_from_sys(v: sys::Vector3f) -> Vec3 {
    Vec3::new(v.x, v.y, v.z)
}

fn fov_from_sys(fov: sys::Fovf) -> Fov {
    Fov { left: fov.angle_left, right: fov.angle_right, up: fov.angle_up, down: fov.angle_down }
}

/// `None` when the pose's direction is unknown garbage.
pub(super) fn pose_from_sys(pose: sys::Posef) -> Option<Pose> {
    let position = vec_from_sys(pose.position);
    let orientation = quat_from_sys(pose.orientation)?;
    position.is_finite().then_some(Pose { position, orientation })
}

pub(super) fn pose_to_sys(pose: &Pose) -> sys::Posef {
    let p = pose.position;
    sys::Posef {
        orientation: quat_to_sys(pose.orientation),
        position: sys::Vector3f { x: p.x, y: p.y, z: p.z },
    }
}

pub(super) fn quat_to_sys(q: Quat) -> sys::Quaternionf {
    sys::Quaternionf { x: q.x, y: q.y, z: q.z, w: q.w }
}

pub(super) fn fov_to_sys(fov: &Fov) -> sys::Fovf {
    sys::Fovf { angle_left: fov.left, angle_right: fov.right, angle_up: fov.up, angle_down: fov.down }
}

#[cfg(test)]
mod tests {
    use super::*;
    use openxr::sys::ViewStateFlags as Flags;

    const LOPSIDED: Fov = Fov { left: -0.9, right: 0.6, up: 0.7, down: -0.8 };

    fn close(a: Vec3, b: Vec3) {
        assert!(a.distance(b) < 1e-5, "{a} is not {b}");
    }

    #[test]
    fn the_edges_of_the_fov_land_on_the_edges_of_clip_space() {
        let clip = LOPSIDED.clip_from_view(0.1);
        let at = |x: f32, y: f32| clip.project_point3(Vec3::new(x.tan(), y.tan(), -1.0) * 3.0);
        let depth = 0.1 / 3.0;
        close(at(LOPSIDED.left, LOPSIDED.up), Vec3::new(-1.0, -1.0, depth));
        close(at(LOPSIDED.right, LOPSIDED.down), Vec3::new(1.0, 1.0, depth));
    }

    #[test]
    fn depth_is_one_at_the_near_plane_and_falls_to_zero_at_infinity() {
        let clip = LOPSIDED.clip_from_view(0.05);
        let depth = |z: f32| clip.project_point3(Vec3::new(0.0, 0.0, -z)).z;
        assert!((depth(0.05) - 1.0).abs() < 1e-6);
        assert!((depth(5.0) - 0.01).abs() < 1e-6);
        assert!(depth(1e6) < depth(1e3) && depth(1e30) < 1e-30);
        let infinity = clip * Vec4::new(0.0, 0.0, -1.0, 0.0);
        assert_eq!((infinity.z, infinity.w), (0.0, 1.0));
    }

    #[test]
    fn the_view_matrix_undoes_the_pose() {
        let pose = Pose {
            position: Vec3::new(1.0, 2.0, 3.0),
            orientation: Quat::from_rotation_y(0.7) * Quat::from_rotation_x(-0.3),
        };
        let both = pose.view_from_space() * pose.space_from_view();
        assert!(both.abs_diff_eq(Mat4::IDENTITY, 1e-6));
        // Turned left by a quarter, what was to the left is straight ahead.
        let left = Pose { orientation: Quat::from_rotation_y(FRAC_PI_2), ..Pose::IDENTITY };
        close(left.view_from_space().transform_point3(Vec3::NEG_X), Vec3::NEG_Z);
    }

    #[test]
    fn relative_and_compose_are_inverse() {
        let a = Pose { position: Vec3::new(0.3, 1.5, -2.0), orientation: Quat::from_rotation_y(1.1) };
        let b = Pose { position: Vec3::new(-1.0, 0.2, 0.4), orientation: Quat::from_rotation_z(0.4) };
        let back = a.compose(&a.relative(&b));
        close(back.position, b.position);
        assert!(back.orientation.angle_between(b.orientation) < 1e-3);
    }

    fn located(head: &Pose) -> [sys::View; 2] {
        [-0.03, 0.03].map(|x| {
            let eye = head.compose(&Pose { position: Vec3::new(x, 0.0, 0.0), ..Pose::IDENTITY });
            sys::View {
                ty: sys::View::TYPE,
                next: std::ptr::null_mut(),
                pose: pose_to_sys(&eye),
                fov: fov_to_sys(&LOPSIDED),
            }
        })
    }

    fn both() -> Flags {
        Flags::ORIENTATION_VALID | Flags::POSITION_VALID
    }

    #[test]
    fn the_head_is_between_the_eyes() {
        let head = Pose { position: Vec3::new(1.0, 1.7, 0.5), orientation: Quat::from_rotation_y(0.4) };
        let views = LastGood::new(0.0).update(both(), &located(&head));
        close(views.head.position, head.position);
        assert!(views.head.orientation.angle_between(head.orientation) < 1e-3);
        assert_eq!(views.tracking, Tracking::Full);
        assert_eq!(views.eyes[0].fov, LOPSIDED);
    }

    #[test]
    fn the_mean_direction_ignores_the_sign_of_the_quaternions() {
        let (a, b) = (Quat::from_rotation_y(0.1), -Quat::from_rotation_y(0.3));
        assert!(middle(a, b).angle_between(Quat::from_rotation_y(0.2)) < 1e-3);
    }

    #[test]
    fn what_is_lost_stays_at_its_last_good_value() {
        let first = Pose { position: Vec3::new(1.0, 1.7, 0.5), orientation: Quat::from_rotation_y(0.4) };
        let second = Pose { position: Vec3::new(-2.0, 1.2, 3.0), orientation: Quat::from_rotation_y(2.4) };
        let mut last = LastGood::new(0.0);
        let good = last.update(both(), &located(&first));

        let turned = last.update(Flags::ORIENTATION_VALID, &located(&second));
        assert_eq!(turned.tracking, Tracking::OrientationOnly);
        close(turned.head.position, first.position);
        assert!(turned.head.orientation.angle_between(second.orientation) < 1e-3);
        // The eyes turn with the head: the right eye stays on its right.
        let right = turned.head.relative(&turned.eyes[1].pose);
        close(right.position, Vec3::new(0.03, 0.0, 0.0));

        let moved = last.update(Flags::POSITION_VALID, &located(&first));
        assert_eq!(moved.tracking, Tracking::PositionOnly);
        close(moved.head.position, first.position);
        assert!(moved.head.orientation.angle_between(second.orientation) < 1e-3);

        let back = last.update(both(), &located(&first));
        assert_eq!(back, good);
        let lost = last.update(Flags::EMPTY, &located(&second));
        assert_eq!(lost.tracking, Tracking::Lost);
        for (eye, was) in lost.eyes.iter().zip(good.eyes) {
            close(eye.pose.position, was.pose.position);
            assert!(eye.pose.orientation.is_normalized());
        }
    }

    #[test]
    fn zero_quaternions_and_rubbish_are_never_used_though_flagged_valid() {
        let mut rubbish = located(&Pose::IDENTITY);
        rubbish[1].pose.orientation = sys::Quaternionf { x: 0.0, y: 0.0, z: 0.0, w: 0.0 };
        rubbish[0].pose.position.x = f32::NAN;
        rubbish[0].fov = sys::Fovf { angle_left: 0.0, angle_right: 0.0, angle_up: 0.0, angle_down: 0.0 };
        let views = LastGood::new(1.6).update(both(), &rubbish);
        assert_eq!(views.tracking, Tracking::Lost);
        assert_eq!(views.head.position, Vec3::new(0.0, 1.6, 0.0));
        for eye in views.eyes {
            assert!(eye.pose.view_from_space().is_finite());
            assert!(eye.fov.clip_from_view(0.1).is_finite());
        }
    }

    #[test]
    fn a_raised_origin_leaves_the_head_where_it_is() {
        let mut last = LastGood::new(0.0);
        last.origin_raised(-1.5);
        let views = last.update(Flags::EMPTY, &located(&Pose::IDENTITY));
        close(views.head.position, Vec3::new(0.0, 1.5, 0.0));
    }
}
