//! Bare hands, where the runtime sees their joints and makes no controllers of them (`XR_EXT_hand_tracking`).

#![allow(unsafe_code, reason = "calls the C interface of the OpenXR runtime")]

use std::ptr;
use std::sync::Arc;

use openxr::{raw, sys, sys::Handle as _};

use super::error::Error;
use super::outcome::Outcome;
use super::raw::RawSession;
use super::space::Space;
use super::view::pose_from_sys;
use crate::controllers::pinch::Joints;
use crate::rig::Pose;

/// A tracker for each hand of a session.
pub(super) struct HandJoints {
    raw: Arc<RawSession>,
    functions: raw::HandTrackingEXT,
    /// Left, right.
    trackers: [sys::HandTrackerEXT; 2],
}

impl HandJoints {
    /// `None` where the extension is not in use, or the headset sees no hands.
    ///
    /// # Errors
    /// Losses.
    pub(super) fn new(raw: &Arc<RawSession>) -> Result<Option<HandJoints>, Error> {
        let Some(functions) = raw.instance().exts().ext_hand_tracking else { return Ok(None) };
        let trackers = [sys::HandTrackerEXT::NULL; 2];
        let mut hands = HandJoints { raw: Arc::clone(raw), functions, trackers };
        for (i, hand) in [sys::HandEXT::LEFT, sys::HandEXT::RIGHT].into_iter().enumerate() {
            match hands.create(hand) {
                Ok(tracker) => hands.trackers[i] = tracker,
                Err(error) if error.outcome() == Outcome::GoOn => {
                    tracing::debug!("bare hands do nothing: {error}");
                    return Ok(None);
                }
                Err(error) => return Err(error),
            }
        }
        Ok(Some(hands))
    }

    fn create(&self, hand: sys::HandEXT) -> Result<sys::HandTrackerEXT, Error> {
        let info = sys::HandTrackerCreateInfoEXT {
            ty: sys::HandTrackerCreateInfoEXT::TYPE,
            next: ptr::null(),
            hand,
            hand_joint_set: sys::HandJointSetEXT::DEFAULT,
        };
        let mut tracker = sys::HandTrackerEXT::NULL;
        // SAFETY: a live session and a properly typed structure; the extension is in use.
        let code = unsafe { (self.functions.create_hand_tracker)(self.raw.handle(), &info, &mut tracker) };
        self.raw.check("xrCreateHandTrackerEXT", code).map(|_| tracker)
    }

    /// Where a hand's joints are (0: left) at a time in nanoseconds, in a space; `None`: it is not seen.
    ///
    /// # Errors
    /// Refusals and losses.
    pub(super) fn locate(&self, hand: usize, base: &Space, time_ns: i64) -> Result<Option<Joints>, Error> {
        let info = sys::HandJointsLocateInfoEXT {
            ty: sys::HandJointsLocateInfoEXT::TYPE,
            next: ptr::null(),
            base_space: base.handle(),
            time: sys::Time::from_nanos(time_ns),
        };
        let mut joints = [sys::HandJointLocationEXT::default(); sys::HAND_JOINT_COUNT_EXT];
        let mut located = sys::HandJointLocationsEXT {
            ty: sys::HandJointLocationsEXT::TYPE,
            next: ptr::null_mut(),
            is_active: sys::FALSE,
            joint_count: joints.len() as u32,
            joint_locations: joints.as_mut_ptr(),
        };
        // SAFETY: a live tracker and space of the session; `joints` has room for as many as the structure says.
        let code = unsafe { (self.functions.locate_hand_joints)(self.trackers[hand], &info, &mut located) };
        self.raw.check("xrLocateHandJointsEXT", code)?;
        let active = bool::from(located.is_active);
        Ok(active.then(|| of_interest(&joints)).flatten())
    }
}

/// Those that say what the hand does; `None` where one of them is not known.
fn of_interest(joints: &[sys::HandJointLocationEXT; sys::HAND_JOINT_COUNT_EXT]) -> Option<Joints> {
    let pose = |joint: sys::HandJointEXT| {
        let location = &joints[joint.into_raw() as usize];
        let known = sys::SpaceLocationFlags::POSITION_VALID | sys::SpaceLocationFlags::ORIENTATION_VALID;
        let pose = location.location_flags.contains(known).then(|| pose_from_sys(location.pose)).flatten()?;
        Some(Pose { position: pose.position, orientation: pose.orientation })
    };
    let at = |joint| pose(joint).map(|pose| pose.position);
    Some(Joints {
        palm: pose(sys::HandJointEXT::PALM)?,
        wrist: at(sys::HandJointEXT::WRIST)?,
        index_proximal: at(sys::HandJointEXT::INDEX_PROXIMAL)?,
        middle_proximal: at(sys::HandJointEXT::MIDDLE_PROXIMAL)?,
        thumb_tip: at(sys::HandJointEXT::THUMB_TIP)?,
        index_tip: at(sys::HandJointEXT::INDEX_TIP)?,
        other_tips: [
            at(sys::HandJointEXT::MIDDLE_TIP)?,
            at(sys::HandJointEXT::RING_TIP)?,
            at(sys::HandJointEXT::LITTLE_TIP)?,
        ],
    })
}

impl Drop for HandJoints {
    fn drop(&mut self) {
        for tracker in self.trackers.into_iter().filter(|it| *it != sys::HandTrackerEXT::NULL) {
            // SAFETY: made here, destroyed once, and nothing uses it any more.
            unsafe { (self.functions.destroy_hand_tracker)(tracker) };
        }
    }
}
