//! Events.

use std::sync::Arc;

use openxr::sys;

use super::pointer::Out;
use crate::mock::{
    fault::Outcome,
    state::{Shared, event::Event, instance::STEREO},
};

pub fn poll_event(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    out: Out<sys::EventDataBuffer>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.instance(handle)?;
    out.check_typed()?;
    match state.poll_event(handle)? {
        Some(event) => {
            write(&out, event);
            Ok(sys::Result::SUCCESS)
        }
        None => Ok(sys::Result::EVENT_UNAVAILABLE),
    }
}

fn write(out: &Out<sys::EventDataBuffer>, event: Event) {
    let next = std::ptr::null();
    match event {
        Event::SessionState { session, state, time_ns } => put(
            out,
            sys::EventDataSessionStateChanged {
                ty: sys::EventDataSessionStateChanged::TYPE,
                next,
                session,
                state,
                time: sys::Time::from_nanos(time_ns),
            },
        ),
        Event::InstanceLoss { time_ns } => put(
            out,
            sys::EventDataInstanceLossPending {
                ty: sys::EventDataInstanceLossPending::TYPE,
                next,
                loss_time: sys::Time::from_nanos(time_ns),
            },
        ),
        Event::Lost { count } => put(
            out,
            sys::EventDataEventsLost { ty: sys::EventDataEventsLost::TYPE, next, lost_event_count: count },
        ),
        Event::InteractionProfile { session } => put(
            out,
            sys::EventDataInteractionProfileChanged {
                ty: sys::EventDataInteractionProfileChanged::TYPE,
                next,
                session,
            },
        ),
        Event::ReferenceSpace { session, kind, change_ns, pose } => put(
            out,
            sys::EventDataReferenceSpaceChangePending {
                ty: sys::EventDataReferenceSpaceChangePending::TYPE,
                next,
                session,
                reference_space_type: kind,
                change_time: sys::Time::from_nanos(change_ns),
                pose_valid: sys::TRUE,
                pose_in_previous_space: pose.to_xr(),
            },
        ),
        Event::UserPresence { session, present } => put(
            out,
            sys::EventDataUserPresenceChangedEXT {
                ty: sys::EventDataUserPresenceChangedEXT::TYPE,
                next,
                session,
                is_user_present: present.into(),
            },
        ),
        Event::RefreshRate { from_hz, to_hz } => put(
            out,
            sys::EventDataDisplayRefreshRateChangedFB {
                ty: sys::EventDataDisplayRefreshRateChangedFB::TYPE,
                next,
                from_display_refresh_rate: from_hz,
                to_display_refresh_rate: to_hz,
            },
        ),
        Event::VisibilityMask { session, view } => put(
            out,
            sys::EventDataVisibilityMaskChangedKHR {
                ty: sys::EventDataVisibilityMaskChangedKHR::TYPE,
                next,
                session,
                view_configuration_type: STEREO,
                view_index: view,
            },
        ),
        Event::Performance(notice) => put(
            out,
            sys::EventDataPerfSettingsEXT {
                ty: sys::EventDataPerfSettingsEXT::TYPE,
                next,
                domain: notice.domain,
                sub_domain: notice.sub_domain,
                from_level: notice.from,
                to_level: notice.to,
            },
        ),
        // A number in the range of an extension that does not exist.
        Event::Unknown => {
            let next = std::ptr::null();
            put(out, sys::BaseInStructure { ty: sys::StructureType::from_raw(1_999_999_000), next });
        }
    }
}

/// Writes an event over the buffer made for the largest one.
fn put<E>(buffer: &Out<sys::EventDataBuffer>, event: E) {
    const { assert!(size_of::<E>() <= size_of::<sys::EventDataBuffer>()) };
    buffer.cast::<E>().write(event);
}
