//! `XR_EXT_conformance_automation`: the application moves the devices itself.

use std::sync::{Arc, MutexGuard};

use openxr::sys;

use crate::mock::{
    fault::{Fault, Outcome, misuse, require},
    input::{InputError, InputValue},
    pose::{Pose, PoseTrack},
    state::{Shared, State, device, space::check_pose},
};

const EXTENSION: &str = "XR_EXT_conformance_automation";

fn unsupported(error: &InputError) -> Fault {
    misuse(sys::Result::ERROR_PATH_UNSUPPORTED, error.to_string())
}

/// The state, if the session's instance has the extension and the path is a top-level user path.
fn open(
    shared: &Arc<Shared>,
    session: sys::Session,
    top: sys::Path,
) -> Outcome<(MutexGuard<'_, State>, &'static str)> {
    let state = shared.lock();
    let instance = state.instance(state.session(session)?.instance)?;
    require!(instance.has(EXTENSION), ERROR_FUNCTION_UNSUPPORTED, "{} is not enabled", EXTENSION);
    let user_path = instance.user_path(top)?;
    Ok((state, user_path))
}

/// A source's path as text, which must be of the device at the top-level user path.
fn source_text(state: &State, session: sys::Session, user_path: &str, source: sys::Path) -> Outcome<String> {
    let text = state.instance(state.session(session)?.instance)?.paths.text(source)?;
    let (known, _) = device::split(text).map_err(|error| unsupported(&error))?;
    require!(known == user_path, ERROR_PATH_UNSUPPORTED, "{} is not at {}", text, user_path);
    Ok(text.to_owned())
}

fn check_boolean(value: sys::Bool32) -> Outcome<()> {
    require!(
        [sys::TRUE, sys::FALSE].contains(&value),
        ERROR_VALIDATION_FAILURE,
        "{} is no XrBool32",
        value.into_raw()
    );
    Ok(())
}

pub fn set_active(
    shared: &Arc<Shared>,
    session: sys::Session,
    profile: sys::Path,
    top: sys::Path,
    active: sys::Bool32,
) -> Outcome<sys::Result> {
    let (mut state, user_path) = open(shared, session, top)?;
    check_boolean(active)?;
    let profile = state.instance(state.session(session)?.instance)?.profile(profile)?;
    let now_ns = state.timeline.now_ns();
    let done = if active == sys::FALSE {
        state.devices.disconnect(user_path)
    } else {
        state.devices.connect(user_path, profile.path, now_ns)
    };
    done.map_err(|error| unsupported(&error))?;
    Ok(state.success(session))
}

/// Sets a component. A device that is not there keeps nothing, and its application is not to blame.
fn set(
    shared: &Arc<Shared>,
    session: sys::Session,
    top: sys::Path,
    source: sys::Path,
    value: InputValue,
) -> Outcome<sys::Result> {
    let (mut state, user_path) = open(shared, session, top)?;
    let path = source_text(&state, session, user_path, source)?;
    let now_ns = state.timeline.now_ns();
    match state.devices.set(&path, value, now_ns) {
        Ok(()) | Err(InputError::NotConnected(_)) => Ok(state.success(session)),
        Err(error @ InputError::OutOfRange { .. }) => {
            Err(misuse(sys::Result::ERROR_VALIDATION_FAILURE, error.to_string()))
        }
        Err(error) => Err(unsupported(&error)),
    }
}

pub fn set_boolean(
    shared: &Arc<Shared>,
    session: sys::Session,
    top: sys::Path,
    source: sys::Path,
    value: sys::Bool32,
) -> Outcome<sys::Result> {
    // Whose device comes before to what.
    drop(open(shared, session, top)?);
    check_boolean(value)?;
    set(shared, session, top, source, InputValue::Boolean(value != sys::FALSE))
}

pub fn set_float(
    shared: &Arc<Shared>,
    session: sys::Session,
    top: sys::Path,
    source: sys::Path,
    value: f32,
) -> Outcome<sys::Result> {
    set(shared, session, top, source, InputValue::Float(value))
}

pub fn set_vector(
    shared: &Arc<Shared>,
    session: sys::Session,
    top: sys::Path,
    source: sys::Path,
    value: sys::Vector2f,
) -> Outcome<sys::Result> {
    set(shared, session, top, source, InputValue::Vector([value.x, value.y]))
}

/// Holds a pose of a device where it is now in a space.
pub fn set_location(
    shared: &Arc<Shared>,
    session: sys::Session,
    top: sys::Path,
    source: sys::Path,
    space: sys::Space,
    pose: sys::Posef,
) -> Outcome<sys::Result> {
    let (mut state, user_path) = open(shared, session, top)?;
    let path = source_text(&state, session, user_path, source)?;
    let now_ns = state.timeline.now_ns();
    let space = state.space_of(session, space)?;
    check_pose(pose, "the pose of an input")?;
    let Some(stage_from_space) = state.stage_from_space(space, now_ns) else {
        return Err(misuse(sys::Result::ERROR_VALIDATION_FAILURE, "the space cannot be located"));
    };
    let track = PoseTrack::fixed(stage_from_space.then(Pose::from_xr(pose)));
    state.devices.set_track(&path, track).map_err(|error| unsupported(&error))?;
    Ok(state.success(session))
}
