//! Spaces and views.
#![allow(unsafe_code, reason = "follows the pointers inside verified structures")]

use std::sync::Arc;

use openxr::sys;

use super::pointer::{In, Out, OutArray, array};
use crate::mock::{
    fault::{Outcome, require},
    pose::vector_to_xr,
    state::{Shared, space::Location},
};

pub fn enumerate_reference_spaces(
    shared: &Arc<Shared>,
    session: sys::Session,
    capacity: u32,
    count: Out<u32>,
    kinds: Out<sys::ReferenceSpaceType>,
) -> Outcome<sys::Result> {
    let state = shared.lock();
    let out = OutArray { capacity, count, items: kinds };
    out.fill(state.reference_spaces(session)?.into_iter())?;
    Ok(state.success(session))
}

pub fn create_reference_space(
    shared: &Arc<Shared>,
    session: sys::Session,
    info: In<sys::ReferenceSpaceCreateInfo>,
    out: Out<sys::Space>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.session(session)?;
    let info = info.get()?;
    out.check()?;
    out.write(state.create_reference_space(
        session,
        info.reference_space_type,
        info.pose_in_reference_space,
    )?);
    Ok(state.success(session))
}

pub fn get_bounds(
    shared: &Arc<Shared>,
    session: sys::Session,
    kind: sys::ReferenceSpaceType,
    out: Out<sys::Extent2Df>,
) -> Outcome<sys::Result> {
    let state = shared.lock();
    state.session(session)?;
    out.check()?;
    let bounds = state.bounds(session, kind)?;
    let [width, height] = bounds.unwrap_or_default();
    out.write(sys::Extent2Df { width, height });
    if bounds.is_none() {
        return Ok(sys::Result::SPACE_BOUNDS_UNAVAILABLE);
    }
    Ok(state.success(session))
}

pub fn create_action_space(
    shared: &Arc<Shared>,
    session: sys::Session,
    info: In<sys::ActionSpaceCreateInfo>,
    out: Out<sys::Space>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.session(session)?;
    let info = info.get()?;
    out.check()?;
    out.write(state.create_action_space(
        session,
        info.action,
        info.subaction_path,
        info.pose_in_action_space,
    )?);
    Ok(state.success(session))
}

pub fn destroy_space(shared: &Arc<Shared>, space: sys::Space) -> Outcome<sys::Result> {
    shared.lock().destroy_space(space)?;
    Ok(sys::Result::SUCCESS)
}

pub fn locate_space(
    shared: &Arc<Shared>,
    space: sys::Space,
    base: sys::Space,
    time: sys::Time,
    out: Out<sys::SpaceLocation>,
) -> Outcome<sys::Result> {
    let state = shared.lock();
    let session = state.spaces.get(space)?.session;
    state.spaces.get(base)?;
    let velocity = out.chained::<sys::SpaceVelocity>()?;
    let location = state.locate_space(session, space, base, time)?;
    out.write(sys::SpaceLocation {
        ty: sys::SpaceLocation::TYPE,
        next: out.next(),
        location_flags: location.tracking.location_flags(),
        pose: location.pose.to_xr(),
    });
    if let Some(out) = velocity {
        let data = velocity_data(&location);
        out.write(sys::SpaceVelocity {
            ty: sys::SpaceVelocity::TYPE,
            next: out.next(),
            velocity_flags: data.velocity_flags,
            linear_velocity: data.linear_velocity,
            angular_velocity: data.angular_velocity,
        });
    }
    Ok(state.success(session))
}

fn velocity_data(location: &Location) -> sys::SpaceVelocityData {
    let (linear, angular) = location.velocity.unwrap_or_default();
    let flags = if location.velocity.is_some() {
        sys::SpaceVelocityFlags::LINEAR_VALID | sys::SpaceVelocityFlags::ANGULAR_VALID
    } else {
        sys::SpaceVelocityFlags::EMPTY
    };
    sys::SpaceVelocityData {
        velocity_flags: flags,
        linear_velocity: vector_to_xr(linear),
        angular_velocity: vector_to_xr(angular),
    }
}

pub fn locate_spaces(
    shared: &Arc<Shared>,
    session: sys::Session,
    info: In<sys::SpacesLocateInfo>,
    out: Out<sys::SpaceLocations>,
) -> Outcome<sys::Result> {
    let state = shared.lock();
    state.session(session)?;
    let info = info.get()?;
    let velocities = out.chained::<sys::SpaceVelocities>()?;
    // SAFETY: the structure is verified; its array is the caller's promise.
    let spaces = unsafe { array(info.spaces, info.space_count) }?;
    require!(!spaces.is_empty(), ERROR_VALIDATION_FAILURE, "spaceCount is 0");
    let locations = out.get()?;
    require!(
        locations.location_count == info.space_count,
        ERROR_VALIDATION_FAILURE,
        "locationCount {} is not spaceCount {}",
        locations.location_count,
        info.space_count
    );
    let places = Out::nested(locations.locations);
    places.check()?;
    let velocity_places = match &velocities {
        Some(velocities) => {
            let velocities = velocities.get()?;
            require!(
                velocities.velocity_count == info.space_count,
                ERROR_VALIDATION_FAILURE,
                "velocityCount {} is not spaceCount {}",
                velocities.velocity_count,
                info.space_count
            );
            let places = Out::nested(velocities.velocities);
            places.check()?;
            Some(places)
        }
        None => None,
    };
    let located: Vec<Location> = spaces
        .iter()
        .map(|space| state.locate_space(session, *space, info.base_space, info.time))
        .collect::<Outcome<_>>()?;
    for (i, location) in located.iter().enumerate() {
        // SAFETY: the counts agree with the room, which is the caller's promise.
        unsafe {
            places.offset(i).write(sys::SpaceLocationData {
                location_flags: location.tracking.location_flags(),
                pose: location.pose.to_xr(),
            });
            if let Some(places) = &velocity_places {
                places.offset(i).write(velocity_data(location));
            }
        }
    }
    Ok(state.success(session))
}

/// The same under the name it has in `XR_KHR_locate_spaces`.
pub fn locate_spaces_khr(
    shared: &Arc<Shared>,
    session: sys::Session,
    info: In<sys::SpacesLocateInfo>,
    out: Out<sys::SpaceLocations>,
) -> Outcome<sys::Result> {
    locate_spaces(shared, session, info, out)
}

pub fn locate_views(
    shared: &Arc<Shared>,
    session: sys::Session,
    info: In<sys::ViewLocateInfo>,
    view_state: Out<sys::ViewState>,
    capacity: u32,
    count: Out<u32>,
    views: Out<sys::View>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.session(session)?;
    let info = info.get()?;
    view_state.check_typed()?;
    let (tracking, eyes) =
        state.locate_views(session, info.view_configuration_type, info.display_time, info.space)?;
    let out = OutArray { capacity, count, items: views };
    out.fill_typed(state.config.view_count as usize, |i, next| sys::View {
        ty: sys::View::TYPE,
        next,
        pose: eyes[i % 2].pose.to_xr(),
        fov: eyes[i % 2].fov.to_xr(),
    })?;
    if capacity > 0 {
        state.sessions.get_mut(session)?.frames.located(info.display_time, info.space, eyes);
    }
    view_state.write(sys::ViewState {
        ty: sys::ViewState::TYPE,
        next: view_state.next(),
        view_state_flags: tracking.view_flags(),
    });
    Ok(state.success(session))
}
