//! Hand trackers and where they find the joints.

use glam::Vec3;
use openxr::sys;

use super::{
    State,
    device::GRIP,
    limit_reached,
    space::{Origin, VELOCITY_STEP_NS, check_time, velocity},
};
use crate::mock::{
    config::Tracking,
    fault::{Outcome, require},
    hand::{self, JOINTS, Joint, Side, Source},
    pose::Pose,
};

pub const EXTENSION: &str = "XR_EXT_hand_tracking";
pub const DATA_SOURCE: &str = "XR_EXT_hand_tracking_data_source";

pub struct HandTracker {
    pub session: sys::Session,
    side: Side,
    /// What the application takes joints from; `None`: from anything, and it does not ask from what.
    pub accepted: Option<Vec<Source>>,
}

/// A joint in the base space.
#[derive(Clone, Copy)]
pub struct LocatedJoint {
    pub pose: Pose,
    /// Metres.
    pub radius: f32,
    /// Metres per second and radians per second in the base space, when known.
    pub velocity: Option<(Vec3, Vec3)>,
}

pub struct LocatedJoints {
    pub source: Source,
    pub tracking: Tracking,
    pub all: [LocatedJoint; JOINTS],
}

impl State {
    /// A tracker of a hand; `None` stands for a number that is no XrHandEXT.
    pub fn create_hand_tracker(
        &mut self,
        session: sys::Session,
        side: Option<Side>,
        accepted: Option<Vec<Source>>,
    ) -> Outcome<sys::HandTrackerEXT> {
        let instance = self.instance(self.session(session)?.instance)?;
        require!(instance.has(EXTENSION), ERROR_FUNCTION_UNSUPPORTED, "{} is not enabled", EXTENSION);
        let Some(side) = side else {
            return Err(crate::mock::fault::misuse(
                sys::Result::ERROR_VALIDATION_FAILURE,
                "hand is neither left nor right",
            ));
        };
        let tracker = HandTracker { session, side, accepted };
        self.hand_trackers.insert(tracker).ok_or_else(limit_reached::<sys::HandTrackerEXT>)
    }

    /// The joints in a space; `None` while the hand is not seen, or the session has not the focus.
    pub fn locate_joints(
        &self,
        tracker: sys::HandTrackerEXT,
        base: sys::Space,
        time: sys::Time,
    ) -> Outcome<Option<LocatedJoints>> {
        let HandTracker { session, side, accepted } = self.hand_trackers.get(tracker)?;
        let (session, side) = (*session, *side);
        let base = self.space_of(session, base)?;
        check_time(time)?;
        let focused = self.session(session)?.state == sys::SessionState::FOCUSED;
        let mut tracking = self.devices.tracking(side.user_path());
        if base.origin == Origin::Reference(sys::ReferenceSpaceType::VIEW) {
            tracking = tracking.and(self.tracking(session, time.as_nanos()));
        }
        let is_known = tracking.orientation_valid && tracking.position_valid;
        let is_accepted = |source: &Source| accepted.as_ref().is_none_or(|all| all.contains(source));
        let source = self.devices.hand_sources(side).find(is_accepted);
        let Some(source) = source.filter(|_| focused && is_known) else {
            return Ok(None);
        };
        let joints = hand::joints_in_grip(side, self.devices.curl(side));
        let base_from_grip = |time_ns: i64| {
            let time_s = self.script_time_s(session, time_ns);
            let grip = self.devices.pose(side.user_path(), GRIP, time_s);
            Some(self.stage_from_space(base, time_ns)?.inverse().then(grip))
        };
        let Some(now) = base_from_grip(time.as_nanos()) else {
            return Ok(None);
        };
        let around = (tracking == Tracking::FULL)
            .then(|| {
                let before = base_from_grip(time.as_nanos().saturating_sub(VELOCITY_STEP_NS))?;
                Some((before, base_from_grip(time.as_nanos().saturating_add(VELOCITY_STEP_NS))?))
            })
            .flatten();
        let all = joints.map(|Joint { pose, radius }| LocatedJoint {
            pose: now.then(pose),
            radius,
            velocity: around.map(|(before, after)| velocity(before.then(pose), after.then(pose))),
        });
        Ok(Some(LocatedJoints { source, tracking, all }))
    }
}
