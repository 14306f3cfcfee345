//! `XR_EXT_hand_tracking`: trackers and joints.
#![allow(unsafe_code, reason = "follows the pointers inside verified structures")]

use std::sync::Arc;

use openxr::sys;

use super::pointer::{In, Out};
use crate::mock::{
    fault::{Outcome, require},
    hand::{JOINTS, Side},
    pose::vector_to_xr,
    state::{Shared, hand::EXTENSION, instance::Instance},
};

/// Fills the hand tracking part of the system's properties, where it is asked for.
pub fn write_properties(instance: &Instance, out: &Out<sys::SystemProperties>) -> Outcome<()> {
    if let Some(out) = out.chained::<sys::SystemHandTrackingPropertiesEXT>()? {
        out.write(sys::SystemHandTrackingPropertiesEXT {
            ty: sys::SystemHandTrackingPropertiesEXT::TYPE,
            next: out.next(),
            supports_hand_tracking: instance.has(EXTENSION).into(),
        });
    }
    Ok(())
}

pub fn create_tracker(
    shared: &Arc<Shared>,
    session: sys::Session,
    info: In<sys::HandTrackerCreateInfoEXT>,
    out: Out<sys::HandTrackerEXT>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.session(session)?;
    let info = info.get()?;
    out.check()?;
    require!(
        info.hand_joint_set == sys::HandJointSetEXT::DEFAULT,
        ERROR_VALIDATION_FAILURE,
        "{:?} is no XrHandJointSetEXT",
        info.hand_joint_set
    );
    let side = match info.hand {
        sys::HandEXT::LEFT => Some(Side::Left),
        sys::HandEXT::RIGHT => Some(Side::Right),
        _ => None,
    };
    out.write(state.create_hand_tracker(session, side)?);
    Ok(state.success(session))
}

pub fn destroy_tracker(shared: &Arc<Shared>, tracker: sys::HandTrackerEXT) -> Outcome<sys::Result> {
    shared.lock().hand_trackers.remove(tracker)?;
    Ok(sys::Result::SUCCESS)
}

fn check_count(count: u32, what: &str) -> Outcome<()> {
    require!(
        count as usize == JOINTS,
        ERROR_VALIDATION_FAILURE,
        "jointCount {} of {} must be {}",
        count,
        what,
        JOINTS
    );
    Ok(())
}

pub fn locate_joints(
    shared: &Arc<Shared>,
    tracker: sys::HandTrackerEXT,
    info: In<sys::HandJointsLocateInfoEXT>,
    out: Out<sys::HandJointLocationsEXT>,
) -> Outcome<sys::Result> {
    let state = shared.lock();
    let session = state.hand_trackers.get(tracker)?.session;
    state.session(session)?;
    let info = info.get()?;
    let velocities = out.chained::<sys::HandJointVelocitiesEXT>()?;
    let locations = out.get()?;
    check_count(locations.joint_count, "XrHandJointLocationsEXT")?;
    let (count, pointer) = (locations.joint_count, locations.joint_locations);
    let places = Out::nested(pointer);
    places.check()?;
    let velocity_places = match &velocities {
        Some(velocities) => {
            let velocities = velocities.get()?;
            check_count(velocities.joint_count, "XrHandJointVelocitiesEXT")?;
            let places = Out::nested(velocities.joint_velocities);
            places.check()?;
            Some(places)
        }
        None => None,
    };
    let joints = state.locate_joints(tracker, info.base_space, info.time)?;
    for i in 0..JOINTS {
        let joint = joints.as_ref().map(|joints| joints.all[i]);
        let tracking = joints.as_ref().map(|joints| joints.tracking);
        // SAFETY: the counts agree with the room, which is the caller's promise.
        unsafe {
            places.offset(i).write(sys::HandJointLocationEXT {
                location_flags: tracking.map(|it| it.location_flags()).unwrap_or_default(),
                pose: joint.map_or(sys::Posef::IDENTITY, |joint| joint.pose.to_xr()),
                radius: joint.map_or(0.0, |joint| joint.radius),
            });
            let Some(places) = &velocity_places else {
                continue;
            };
            let (linear, angular) = joint.and_then(|joint| joint.velocity).unwrap_or_default();
            let is_known = joint.is_some_and(|joint| joint.velocity.is_some());
            places.offset(i).write(sys::HandJointVelocityEXT {
                velocity_flags: if is_known {
                    sys::SpaceVelocityFlags::LINEAR_VALID | sys::SpaceVelocityFlags::ANGULAR_VALID
                } else {
                    sys::SpaceVelocityFlags::EMPTY
                },
                linear_velocity: vector_to_xr(linear),
                angular_velocity: vector_to_xr(angular),
            });
        }
    }
    out.write(sys::HandJointLocationsEXT {
        ty: sys::HandJointLocationsEXT::TYPE,
        next: out.next(),
        is_active: joints.is_some().into(),
        joint_count: count,
        joint_locations: pointer,
    });
    Ok(state.success(session))
}
