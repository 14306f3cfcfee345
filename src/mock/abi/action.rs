//! Actions.
#![allow(unsafe_code, reason = "follows the pointers inside verified structures")]

use std::{ffi::c_char, sync::Arc};

use openxr::sys::{self, ActionType};

use super::pointer::{In, Out, OutArray, array, fixed_text};
use crate::mock::{
    fault::{Outcome, require},
    state::{Shared, action::Names, input::ActionState},
};

const OK: Outcome<sys::Result> = Ok(sys::Result::SUCCESS);

pub fn create_action_set(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    info: In<sys::ActionSetCreateInfo>,
    out: Out<sys::ActionSet>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.instance(handle)?;
    let info = info.get()?;
    out.check()?;
    let names = Names {
        name: fixed_text(&info.action_set_name),
        localized: fixed_text(&info.localized_action_set_name),
    };
    out.write(state.create_action_set(handle, &names, info.priority)?);
    OK
}

pub fn destroy_action_set(shared: &Arc<Shared>, set: sys::ActionSet) -> Outcome<sys::Result> {
    shared.lock().destroy_action_set(set)?;
    OK
}

pub fn create_action(
    shared: &Arc<Shared>,
    set: sys::ActionSet,
    info: In<sys::ActionCreateInfo>,
    out: Out<sys::Action>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.action_sets.get(set)?;
    let info = info.get()?;
    out.check()?;
    let names =
        Names { name: fixed_text(&info.action_name), localized: fixed_text(&info.localized_action_name) };
    // SAFETY: the structure is verified; its array is the caller's promise.
    let subactions = unsafe { array(info.subaction_paths, info.count_subaction_paths) }?;
    out.write(state.create_action(set, &names, info.action_type, subactions)?);
    OK
}

pub fn destroy_action(shared: &Arc<Shared>, action: sys::Action) -> Outcome<sys::Result> {
    shared.lock().destroy_action(action)?;
    OK
}

pub fn suggest_bindings(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    info: In<sys::InteractionProfileSuggestedBinding>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.instance(handle)?;
    let info = info.get()?;
    // SAFETY: the structure is verified; its array is the caller's promise.
    let bindings = unsafe { array(info.suggested_bindings, info.count_suggested_bindings) }?;
    state.suggest_bindings(handle, info.interaction_profile, bindings)?;
    OK
}

pub fn attach(
    shared: &Arc<Shared>,
    session: sys::Session,
    info: In<sys::SessionActionSetsAttachInfo>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.session(session)?;
    let info = info.get()?;
    // SAFETY: the structure is verified; its array is the caller's promise.
    let sets = unsafe { array(info.action_sets, info.count_action_sets) }?;
    state.attach(session, sets)
}

pub fn get_profile(
    shared: &Arc<Shared>,
    session: sys::Session,
    top: sys::Path,
    out: Out<sys::InteractionProfileState>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.session(session)?;
    out.check_typed()?;
    let profile = state.current_profile(session, top)?;
    out.write(sys::InteractionProfileState {
        ty: sys::InteractionProfileState::TYPE,
        next: out.next(),
        interaction_profile: profile,
    });
    Ok(state.success(session))
}

/// The state of an action of a type, with the code to return.
fn state_of(
    shared: &Arc<Shared>,
    session: sys::Session,
    info: In<sys::ActionStateGetInfo>,
    kind: ActionType,
) -> Outcome<(ActionState, sys::Result)> {
    let state = shared.lock();
    let info = info.get()?;
    let answer = state.action_state(session, info.action, info.subaction_path, kind)?;
    Ok((answer, state.success(session)))
}

pub fn get_boolean(
    shared: &Arc<Shared>,
    session: sys::Session,
    info: In<sys::ActionStateGetInfo>,
    out: Out<sys::ActionStateBoolean>,
) -> Outcome<sys::Result> {
    shared.lock().session(session)?;
    out.check_typed()?;
    let (state, code) = state_of(shared, session, info, ActionType::BOOLEAN_INPUT)?;
    out.write(sys::ActionStateBoolean {
        ty: sys::ActionStateBoolean::TYPE,
        next: out.next(),
        current_state: (state.value[0] != 0.0).into(),
        changed_since_last_sync: state.changed.into(),
        last_change_time: sys::Time::from_nanos(state.last_change_ns),
        is_active: state.is_active.into(),
    });
    Ok(code)
}

pub fn get_float(
    shared: &Arc<Shared>,
    session: sys::Session,
    info: In<sys::ActionStateGetInfo>,
    out: Out<sys::ActionStateFloat>,
) -> Outcome<sys::Result> {
    shared.lock().session(session)?;
    out.check_typed()?;
    let (state, code) = state_of(shared, session, info, ActionType::FLOAT_INPUT)?;
    out.write(sys::ActionStateFloat {
        ty: sys::ActionStateFloat::TYPE,
        next: out.next(),
        current_state: state.value[0],
        changed_since_last_sync: state.changed.into(),
        last_change_time: sys::Time::from_nanos(state.last_change_ns),
        is_active: state.is_active.into(),
    });
    Ok(code)
}

pub fn get_vector(
    shared: &Arc<Shared>,
    session: sys::Session,
    info: In<sys::ActionStateGetInfo>,
    out: Out<sys::ActionStateVector2f>,
) -> Outcome<sys::Result> {
    shared.lock().session(session)?;
    out.check_typed()?;
    let (state, code) = state_of(shared, session, info, ActionType::VECTOR2F_INPUT)?;
    out.write(sys::ActionStateVector2f {
        ty: sys::ActionStateVector2f::TYPE,
        next: out.next(),
        current_state: sys::Vector2f { x: state.value[0], y: state.value[1] },
        changed_since_last_sync: state.changed.into(),
        last_change_time: sys::Time::from_nanos(state.last_change_ns),
        is_active: state.is_active.into(),
    });
    Ok(code)
}

pub fn get_pose(
    shared: &Arc<Shared>,
    session: sys::Session,
    info: In<sys::ActionStateGetInfo>,
    out: Out<sys::ActionStatePose>,
) -> Outcome<sys::Result> {
    shared.lock().session(session)?;
    out.check_typed()?;
    let (state, code) = state_of(shared, session, info, ActionType::POSE_INPUT)?;
    out.write(sys::ActionStatePose {
        ty: sys::ActionStatePose::TYPE,
        next: out.next(),
        is_active: state.is_active.into(),
    });
    Ok(code)
}

pub fn sync(
    shared: &Arc<Shared>,
    session: sys::Session,
    info: In<sys::ActionsSyncInfo>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.session(session)?;
    let info = info.get()?;
    // SAFETY: the structure is verified; its array is the caller's promise.
    let active = unsafe { array(info.active_action_sets, info.count_active_action_sets) }?;
    state.sync_actions(session, active)
}

pub fn enumerate_sources(
    shared: &Arc<Shared>,
    session: sys::Session,
    info: In<sys::BoundSourcesForActionEnumerateInfo>,
    capacity: u32,
    count: Out<u32>,
    sources: Out<sys::Path>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.session(session)?;
    let bound = state.bound_sources(session, info.get()?.action)?;
    let out = OutArray { capacity, count, items: sources };
    out.fill(bound.into_iter())?;
    Ok(state.success(session))
}

pub fn source_name(
    shared: &Arc<Shared>,
    session: sys::Session,
    info: In<sys::InputSourceLocalizedNameGetInfo>,
    capacity: u32,
    count: Out<u32>,
    buffer: Out<c_char>,
) -> Outcome<sys::Result> {
    let state = shared.lock();
    state.session(session)?;
    let info = info.get()?;
    let name = state.source_name(session, info.source_path, info.which_components)?;
    let out = OutArray { capacity, count, items: buffer };
    out.fill_text(&name)?;
    Ok(state.success(session))
}

pub fn apply_haptic(
    shared: &Arc<Shared>,
    session: sys::Session,
    info: In<sys::HapticActionInfo>,
    vibration: In<sys::HapticVibration>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.session(session)?;
    let (info, vibration) = (info.get()?, vibration.get()?);
    let duration = vibration.duration.as_nanos();
    require!(
        duration >= -1 && vibration.frequency >= 0.0 && (0.0..=1.0).contains(&vibration.amplitude),
        ERROR_VALIDATION_FAILURE,
        "a vibration of {} ns at {} Hz and amplitude {} is not possible",
        duration,
        vibration.frequency,
        vibration.amplitude
    );
    let wanted = (duration, vibration.frequency, vibration.amplitude);
    state.vibrate(session, info.action, info.subaction_path, Some(wanted))
}

pub fn stop_haptic(
    shared: &Arc<Shared>,
    session: sys::Session,
    info: In<sys::HapticActionInfo>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.session(session)?;
    let info = info.get()?;
    state.vibrate(session, info.action, info.subaction_path, None)
}
