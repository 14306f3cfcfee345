//! What extensions tell of the headset and ask of it: refresh rate, visibility mask, performance, clocks.

use std::sync::Arc;

use openxr::sys;

use super::pointer::{In, Out, OutArray};
use crate::mock::{
    fault::{Outcome, refusal, require},
    mask,
    state::{Shared, instance::check_stereo, space::check_time},
};

const NANOS: i64 = 1_000_000_000;

/// `struct timespec` of 64-bit systems; on others the extension is not offered.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct Timespec {
    seconds: i64,
    nanoseconds: i64,
}

pub fn enumerate_refresh_rates(
    shared: &Arc<Shared>,
    session: sys::Session,
    capacity: u32,
    count: Out<u32>,
    rates: Out<f32>,
) -> Outcome<sys::Result> {
    let state = shared.lock();
    state.session(session)?;
    let out = OutArray { capacity, count, items: rates };
    out.fill(state.refresh_rates().into_iter())?;
    Ok(state.success(session))
}

pub fn get_refresh_rate(shared: &Arc<Shared>, session: sys::Session, out: Out<f32>) -> Outcome<sys::Result> {
    let state = shared.lock();
    state.session(session)?;
    out.check()?;
    out.write(state.timeline.hz as f32);
    Ok(state.success(session))
}

pub fn request_refresh_rate(shared: &Arc<Shared>, session: sys::Session, hz: f32) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.session(session)?;
    state.request_refresh_rate(hz)?;
    Ok(state.success(session))
}

pub fn get_visibility_mask(
    shared: &Arc<Shared>,
    session: sys::Session,
    kind: sys::ViewConfigurationType,
    view: u32,
    mask: sys::VisibilityMaskTypeKHR,
    out: Out<sys::VisibilityMaskKHR>,
) -> Outcome<sys::Result> {
    let state = shared.lock();
    state.session(session)?;
    check_stereo(kind)?;
    require!(view < 2, ERROR_VALIDATION_FAILURE, "view {} is not one of 2", view);
    let fov = state.config.fov[view as usize];
    let Some(mesh) = mask::mesh(state.config.mask, fov, mask) else {
        return Err(crate::mock::fault::misuse(
            sys::Result::ERROR_VALIDATION_FAILURE,
            format!("{mask:?} is no XrVisibilityMaskTypeKHR"),
        ));
    };
    let asked = out.get()?;
    let (vertex_room, index_room) = (asked.vertex_capacity_input, asked.index_capacity_input);
    let (vertices, indices) = (Out::nested(asked.vertices), Out::nested(asked.indices));
    let (vertex_count, index_count) = (mesh.vertices.len() as u32, mesh.indices.len() as u32);
    let mut answer = *asked;
    (answer.vertex_count_output, answer.index_count_output) = (vertex_count, index_count);
    out.write(answer);
    if vertex_room == 0 && index_room == 0 {
        return Ok(state.success(session));
    }
    if vertex_room < vertex_count || index_room < index_count {
        return Err(refusal(
            sys::Result::ERROR_SIZE_INSUFFICIENT,
            format!(
                "room for {vertex_room} of {vertex_count} vertices, {index_room} of {index_count} indices"
            ),
        ));
    }
    vertices.fill(&mesh.vertices)?;
    indices.fill(&mesh.indices)?;
    Ok(state.success(session))
}

pub fn set_performance_level(
    shared: &Arc<Shared>,
    session: sys::Session,
    domain: sys::PerfSettingsDomainEXT,
    level: sys::PerfSettingsLevelEXT,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.session(session)?;
    require!(
        matches!(domain.into_raw(), 1 | 2),
        ERROR_VALIDATION_FAILURE,
        "{:?} is no XrPerfSettingsDomainEXT",
        domain
    );
    require!(
        matches!(level.into_raw(), 0 | 25 | 50 | 75),
        ERROR_VALIDATION_FAILURE,
        "{:?} is no XrPerfSettingsLevelEXT",
        level
    );
    state.performance[usize::from(domain == sys::PerfSettingsDomainEXT::GPU)] = Some(level);
    Ok(state.success(session))
}

/// An XrTime is a time of the monotonic clock in nanoseconds, so this only splits it.
pub fn timespec_from_time(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    time: sys::Time,
    out: Out<Timespec>,
) -> Outcome<sys::Result> {
    shared.lock().instance(handle)?;
    out.check()?;
    check_time(time)?;
    let nanos = time.as_nanos();
    out.write(Timespec { seconds: nanos / NANOS, nanoseconds: nanos % NANOS });
    Ok(sys::Result::SUCCESS)
}

pub fn time_from_timespec(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    timespec: In<Timespec>,
    out: Out<sys::Time>,
) -> Outcome<sys::Result> {
    shared.lock().instance(handle)?;
    let timespec = timespec.plain()?;
    out.check()?;
    let Timespec { seconds, nanoseconds } = timespec;
    let whole = seconds.checked_mul(NANOS).and_then(|it| it.checked_add(nanoseconds));
    let valid = whole.filter(|whole| (0..NANOS).contains(&nanoseconds) && *whole > 0);
    require!(
        valid.is_some(),
        ERROR_TIME_INVALID,
        "{} s and {} ns are no time of the monotonic clock",
        seconds,
        nanoseconds
    );
    out.write(sys::Time::from_nanos(valid.unwrap_or_default()));
    Ok(sys::Result::SUCCESS)
}
