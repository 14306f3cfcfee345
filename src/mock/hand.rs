//! The joints of a hand: bones of an adult's hand, bent by what the hand presses.

use glam::{Mat3, Quat, Vec3};
use openxr::sys;

use super::pose::Pose;

/// Which hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    Left,
    Right,
}

impl Side {
    pub fn of(user_path: &str) -> Option<Self> {
        [Self::Left, Self::Right].into_iter().find(|side| side.user_path() == user_path)
    }

    pub fn user_path(self) -> &'static str {
        match self {
            Self::Left => "/user/hand/left",
            Self::Right => "/user/hand/right",
        }
    }
}

/// What the joints of a hand are known from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The hand itself, which is seen.
    Unobstructed,
    /// The device that it holds.
    Controller,
}

/// How far the fingers are bent, [0, 1] each.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Curl {
    pub index: f32,
    /// Middle, ring and little finger.
    pub others: f32,
    /// How near the tips of thumb and index are to each other: at 1 they touch.
    pub pinch: f32,
}

/// A joint in some space.
#[derive(Clone, Copy)]
pub struct Joint {
    pub pose: Pose,
    /// To the skin, metres.
    pub radius: f32,
}

pub const JOINTS: usize = sys::HAND_JOINT_COUNT_EXT;
/// The numbers of XrHandJointEXT.
pub const WRIST: usize = 1;
pub const THUMB_TIP: usize = 5;
pub const INDEX_TIP: usize = 10;

/// A finger of the right hand in the palm's space: fingers along -z, back of the hand up, thumb on the left.
struct Finger {
    /// Where the metacarpal bone begins, metres.
    root: Vec3,
    /// Where the finger leaves the palm, metres.
    knuckle: Vec3,
    /// Bones from the knuckle to the tip, metres.
    bones: &'static [f32],
    /// How far each joint from the knuckle on is bent, radians: when open, and how much more when closed.
    bend: &'static [(f32, f32)],
    /// Of each joint from the root to the tip, metres.
    radii: &'static [f32],
}

const BEND: &[(f32, f32)] = &[(0.10, 1.30), (0.15, 1.60), (0.10, 1.00)];
const RADII: &[f32] = &[0.017, 0.012, 0.010, 0.009, 0.008];

const THUMB: Finger = Finger {
    root: Vec3::new(-0.020, -0.010, 0.030),
    knuckle: Vec3::new(-0.045, -0.020, -0.004),
    bones: &[0.032, 0.026],
    bend: &[(0.10, 0.50), (0.10, 0.80)],
    radii: &[0.018, 0.014, 0.012, 0.010],
};

const FINGERS: [Finger; 4] = [
    Finger {
        root: Vec3::new(-0.014, 0.0, 0.032),
        knuckle: Vec3::new(-0.024, 0.0, -0.031),
        bones: &[0.040, 0.024, 0.022],
        bend: BEND,
        radii: RADII,
    },
    Finger {
        root: Vec3::new(0.0, 0.0, 0.0325),
        knuckle: Vec3::new(0.0, 0.0, -0.0325),
        bones: &[0.044, 0.027, 0.024],
        bend: BEND,
        radii: RADII,
    },
    Finger {
        root: Vec3::new(0.011, 0.0, 0.031),
        knuckle: Vec3::new(0.019, 0.0, -0.028),
        bones: &[0.041, 0.026, 0.024],
        bend: BEND,
        radii: RADII,
    },
    Finger {
        root: Vec3::new(0.020, 0.0, 0.029),
        knuckle: Vec3::new(0.036, 0.0, -0.020),
        bones: &[0.032, 0.019, 0.021],
        bend: BEND,
        radii: RADII,
    },
];

const PALM_JOINT: Joint = Joint { pose: Pose::IDENTITY, radius: 0.016 };
const WRIST_JOINT: Joint =
    Joint { pose: Pose { position: Vec3::new(0.0, 0.0, 0.055), orientation: Quat::IDENTITY }, radius: 0.024 };

/// The palm lies this far behind the middle of what it holds, metres.
const PALM_DEPTH: f32 = 0.03;

/// All joints in the space of the grip, in the order of XrHandJointEXT.
pub fn joints_in_grip(side: Side, curl: Curl) -> [Joint; JOINTS] {
    let mut joints = [PALM_JOINT; JOINTS];
    joints[WRIST] = WRIST_JOINT;
    let mut next = WRIST + 1;
    let thumb = curl.index.min(curl.others);
    let pinch = curl.pinch.clamp(0.0, 1.0);
    let index = curl.index.max(PINCHED_INDEX * pinch);
    let bends = [thumb, index, curl.others, curl.others, curl.others];
    for (finger, curl) in [&THUMB].into_iter().chain(&FINGERS).zip(bends) {
        next = add_finger(&mut joints, next, finger, curl);
    }
    turn_thumb(&mut joints, pinch);
    let grip_from_palm = grip_from_palm(side);
    joints.map(|joint| {
        let pose = if side == Side::Left { mirrored(joint.pose) } else { joint.pose };
        Joint { pose: grip_from_palm.then(pose), ..joint }
    })
}

/// So far is the index bent in a pinch: the stretched thumb then just reaches its tip.
const PINCHED_INDEX: f32 = 0.45;

/// Turns the thumb about its knuckle towards the index's tip, by a share of the way.
fn turn_thumb(joints: &mut [Joint; JOINTS], share: f32) {
    let knuckle = joints[THUMB_TIP - 2].pose.position;
    let [from, to] = [THUMB_TIP, INDEX_TIP].map(|tip| (joints[tip].pose.position - knuckle).normalize());
    let turn = Quat::IDENTITY.slerp(Quat::from_rotation_arc(from, to), share);
    for Joint { pose, .. } in &mut joints[THUMB_TIP - 2..=THUMB_TIP] {
        pose.position = knuckle + turn * (pose.position - knuckle);
        pose.orientation = (turn * pose.orientation).normalize();
    }
}

/// Writes a finger's joints from `next` on; the index after them.
fn add_finger(joints: &mut [Joint; JOINTS], next: usize, finger: &Finger, curl: f32) -> usize {
    let mut pose = Pose::new(
        finger.root,
        Quat::from_rotation_arc(Vec3::NEG_Z, (finger.knuckle - finger.root).normalize()),
    );
    joints[next].pose = pose;
    pose.position = finger.knuckle;
    for (i, (bone, (open, closing))) in finger.bones.iter().zip(finger.bend).enumerate() {
        pose.orientation *= Quat::from_rotation_x(-(open + closing * curl.clamp(0.0, 1.0)));
        joints[next + 1 + i].pose = pose;
        pose.position += pose.orientation * Vec3::NEG_Z * *bone;
    }
    let tip = next + 1 + finger.bones.len();
    joints[tip].pose = pose;
    for (joint, radius) in joints[next..=tip].iter_mut().zip(finger.radii) {
        joint.radius = *radius;
    }
    tip + 1
}

/// The other hand's pose: seen in a mirror in the plane x = 0.
fn mirrored(pose: Pose) -> Pose {
    let (p, q) = (pose.position, pose.orientation);
    Pose { position: Vec3::new(-p.x, p.y, p.z), orientation: Quat::from_xyzw(q.x, -q.y, -q.z, q.w) }
}

/// The grip has the thumb at -z and the open fingers at -y; the back of the right hand is at +x, of the left at -x.
fn grip_from_palm(side: Side) -> Pose {
    let (x, back) = match side {
        Side::Left => (Vec3::NEG_Z, Vec3::NEG_X),
        Side::Right => (Vec3::Z, Vec3::X),
    };
    Pose::new(PALM_DEPTH * back, Quat::from_mat3(&Mat3::from_cols(x, back, Vec3::Y)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_numbers_are_those_of_the_header() {
        let joints = [
            (WRIST, sys::HandJointEXT::WRIST),
            (THUMB_TIP, sys::HandJointEXT::THUMB_TIP),
            (INDEX_TIP, sys::HandJointEXT::INDEX_TIP),
            (JOINTS - 1, sys::HandJointEXT::LITTLE_TIP),
        ];
        for (number, joint) in joints {
            assert_eq!(number as i32, joint.into_raw());
        }
    }

    #[test]
    fn a_closed_hand_is_narrower_than_an_open_one() {
        let reach = |curl: f32| {
            let joints = joints_in_grip(Side::Right, Curl { index: curl, others: curl, pinch: 0.0 });
            joints[INDEX_TIP].pose.position.distance(joints[WRIST].pose.position)
        };
        assert!(reach(1.0) < reach(0.5) && reach(0.5) < reach(0.0));
    }

    #[test]
    fn thumb_and_index_meet_in_a_pinch() {
        let gap = |pinch: f32| {
            let joints = joints_in_grip(Side::Left, Curl { pinch, ..Curl::default() });
            joints[INDEX_TIP].pose.position.distance(joints[THUMB_TIP].pose.position)
        };
        assert!(
            gap(1.0) < 0.016 && gap(0.5) > 0.02 && gap(0.0) > 0.06,
            "{} {} {}",
            gap(1.0),
            gap(0.5),
            gap(0.0)
        );
    }
}
