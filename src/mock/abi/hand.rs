//! `XR_EXT_hand_tracking`: trackers and joints.
#![allow(unsafe_code, reason = "follows the pointers inside verified structures")]

use std::sync::Arc;

use openxr::sys;

use super::pointer::{In, Out, array};
use crate::mock::{
    fault::{Outcome, misuse, require},
    hand::{JOINTS, Side, Source},
    pose::vector_to_xr,
    state::{
        Shared,
        hand::{DATA_SOURCE, EXTENSION, HandTracker},
        instance::Instance,
    },
};

/// Fills the hand tracking part of the system's properties, where it is asked for.
pub fn write_properties(instance: &Instance, out: &Out<sys::SystemProperties>) -> Outcome<()> {
    let asked = out.chained::<sys::SystemHandTrackingPropertiesEXT>()?;
    if let Some(out) = asked.filter(|_| instance.has(EXTENSION)) {
        out.write(sys::SystemHandTrackingPropertiesEXT {
            ty: sys::SystemHandTrackingPropertiesEXT::TYPE,
            next: out.next(),
            supports_hand_tracking: sys::TRUE,
        });
    }
    Ok(())
}

/// What the application takes joints from, if it says so.
fn accepted_sources(info: Option<&sys::HandTrackingDataSourceInfoEXT>) -> Outcome<Option<Vec<Source>>> {
    let Some(info) = info else { return Ok(None) };
    // SAFETY: the structure is verified; its array is the caller's promise.
    let asked = unsafe { array(info.requested_data_sources.cast_const(), info.requested_data_source_count) }?;
    let mut accepted = Vec::with_capacity(2);
    for number in asked {
        let source = match *number {
            sys::HandTrackingDataSourceEXT::UNOBSTRUCTED => Some(Source::Unobstructed),
            sys::HandTrackingDataSourceEXT::CONTROLLER => Some(Source::Controller),
            _ => None,
        };
        let source = source.filter(|source| !accepted.contains(source));
        let Some(source) = source else {
            return Err(misuse(
                sys::Result::ERROR_VALIDATION_FAILURE,
                format!("requestedDataSources has {number:?}, which is unknown or there twice"),
            ));
        };
        accepted.push(source);
    }
    Ok(Some(accepted))
}

pub fn create_tracker(
    shared: &Arc<Shared>,
    session: sys::Session,
    info: In<sys::HandTrackerCreateInfoEXT>,
    out: Out<sys::HandTrackerEXT>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    let instance = state.instance(state.session(session)?.instance)?;
    let sources = info.chained::<sys::HandTrackingDataSourceInfoEXT>()?;
    let sources = accepted_sources(sources.filter(|_| instance.has(DATA_SOURCE)))?;
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
    out.write(state.create_hand_tracker(session, side, sources)?);
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
    let HandTracker { session, accepted, .. } = state.hand_trackers.get(tracker)?;
    let (session, tells_source) = (*session, accepted.is_some());
    let instance = state.instance(state.session(session)?.instance)?;
    let info = info.get()?;
    let told = out.chained::<sys::HandTrackingDataSourceStateEXT>()?.filter(|_| instance.has(DATA_SOURCE));
    require!(
        told.is_none() || tells_source,
        ERROR_VALIDATION_FAILURE,
        "the tracker was made without XrHandTrackingDataSourceInfoEXT, so it does not tell its source"
    );
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
    if let Some(told) = told {
        told.write(sys::HandTrackingDataSourceStateEXT {
            ty: sys::HandTrackingDataSourceStateEXT::TYPE,
            next: told.next(),
            is_active: joints.is_some().into(),
            data_source: match joints.as_ref().map(|joints| joints.source) {
                Some(Source::Controller) => sys::HandTrackingDataSourceEXT::CONTROLLER,
                _ => sys::HandTrackingDataSourceEXT::UNOBSTRUCTED,
            },
        });
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
