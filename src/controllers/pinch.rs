//! PURE: what a bare hand does, from where its joints are. For runtimes that see hands and make no controllers of them.

use glam::{Mat3, Quat, Vec3};

use super::Hand;
use crate::rig::Pose;

/// Metres between the tips of thumb and index at which a pinch is closed, and open. Tips that touch are about as far apart
/// as a finger is thick.
const PINCH_M: [f32; 2] = [0.016, 0.060];

/// The same of the fingertips' distance to the palm in a fist: of a hand whose palm is as long as the second.
const FIST: [f32; 2] = [0.55, 1.10];

/// Joints of a hand, by the names of `XrHandJointEXT`; positions in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joints {
    /// The palm: fingers along −z, its back up.
    pub palm: Pose,
    /// The wrist.
    pub wrist: Vec3,
    /// Where the index leaves the palm.
    pub index_proximal: Vec3,
    /// Where the middle finger does.
    pub middle_proximal: Vec3,
    /// The thumb's tip.
    pub thumb_tip: Vec3,
    /// The index's tip.
    pub index_tip: Vec3,
    /// Tips of middle, ring and little finger.
    pub other_tips: [Vec3; 3],
}

/// What a hand does whose joints these are (0: the left one), and how far it is a fist, 0 to 1: that backs out. A pinch dives,
/// or holds, where both hands pinch; a fist is no pinch.
pub fn hand(joints: &Joints, index: usize) -> (Hand, f32) {
    let palm_m = joints.middle_proximal.distance(joints.wrist).max(1e-3);
    let bent = |tip: &Vec3| share(tip.distance(joints.palm.position) / palm_m, FIST);
    let fist = joints.other_tips.iter().map(bent).fold(1.0, f32::min);
    let pinch = share(joints.thumb_tip.distance(joints.index_tip), PINCH_M);
    let hand = Hand {
        aim: aim(joints),
        grip: Some(grip(joints, index)),
        dive: pinch * (1.0 - fist),
        grab: 0.0,
        has_grab: false,
        is_bare: true,
    };
    (hand, fist)
}

/// 1 up to the first of two lengths, 0 from the second on.
fn share(length: f32, [closed, open]: [f32; 2]) -> f32 {
    let share = ((open - length) / (open - closed)).clamp(0.0, 1.0);
    if share.is_nan() { 0.0 } else { share }
}

/// From where the index leaves the palm, away from the wrist: a pinch bends the fingers and leaves both where they are.
fn aim(joints: &Joints) -> Option<Pose> {
    let ahead = (joints.index_proximal - joints.wrist).try_normalize()?;
    let up = joints.palm.orientation * Vec3::Y;
    let right = ahead.cross(up).try_normalize()?;
    let orientation = Quat::from_mat3(&Mat3::from_cols(right, right.cross(ahead), -ahead)).normalize();
    Some(Pose { position: joints.index_proximal, orientation })
}

/// The palm, turned as grips are: the thumb along −z, x out of the left palm and into the right one.
fn grip(joints: &Joints, index: usize) -> Pose {
    let palm = joints.palm.orientation;
    let side = if index == 0 { -1.0 } else { 1.0 };
    let (back, right) = (palm * Vec3::Y * side, palm * Vec3::X * side);
    let orientation = Quat::from_mat3(&Mat3::from_cols(back, palm * Vec3::Z, right)).normalize();
    Pose { position: joints.palm.position, orientation }
}
