//! Debug messengers, object names and labels.
#![allow(
    unsafe_code,
    reason = "follows the pointers inside verified structures, and calls the application back"
)]

use std::{
    ffi::{CString, c_char},
    ptr,
    sync::Arc,
};

use openxr::sys;

use super::pointer::{In, Out, optional_text, typed_array};
use crate::mock::{
    fault::{Outcome, misuse, require},
    state::{
        Shared,
        debug::{Labels, Message, Messenger, Object, c_text},
    },
};

const OK: Outcome<sys::Result> = Ok(sys::Result::SUCCESS);

const SEVERITIES: u64 = 0x1111;
const TYPES: u64 = 0xF;

/// Calls those messengers that want such a message. Nothing is locked: they may call the runtime.
pub fn deliver(messengers: &[Messenger], message: &Message) {
    let mut objects: Vec<_> = message
        .objects
        .iter()
        .map(|object| sys::DebugUtilsObjectNameInfoEXT {
            ty: sys::DebugUtilsObjectNameInfoEXT::TYPE,
            next: ptr::null(),
            object_type: object.kind,
            object_handle: object.handle,
            object_name: object.name.as_ref().map_or(ptr::null(), |name| name.as_ptr()),
        })
        .collect();
    let mut labels: Vec<_> = message
        .labels
        .iter()
        .map(|label| sys::DebugUtilsLabelEXT {
            ty: sys::DebugUtilsLabelEXT::TYPE,
            next: ptr::null(),
            label_name: label.as_ptr(),
        })
        .collect();
    let data = sys::DebugUtilsMessengerCallbackDataEXT {
        ty: sys::DebugUtilsMessengerCallbackDataEXT::TYPE,
        next: ptr::null(),
        message_id: message.id.as_ptr(),
        function_name: message.function.as_ptr(),
        message: message.text.as_ptr(),
        object_count: objects.len() as u32,
        objects: objects.as_mut_ptr(),
        session_label_count: labels.len() as u32,
        session_labels: labels.as_mut_ptr(),
    };
    for messenger in messengers.iter().filter(|it| it.wants(message.severity, message.types)) {
        let user_data = ptr::with_exposed_provenance_mut(messenger.user_data);
        // SAFETY: the application gave the callback for this, with this pointer; the data lives through the call.
        unsafe { (messenger.callback)(message.severity, message.types, &data, user_data) };
    }
}

/// A verified messenger; the instance it will belong to.
pub fn messenger(
    instance: sys::Instance,
    info: &sys::DebugUtilsMessengerCreateInfoEXT,
) -> Outcome<Messenger> {
    check_bits("messageSeverities", info.message_severities.into_raw(), SEVERITIES)?;
    check_bits("messageTypes", info.message_types.into_raw(), TYPES)?;
    let Some(callback) = info.user_callback else {
        return Err(misuse(sys::Result::ERROR_VALIDATION_FAILURE, "userCallback is NULL"));
    };
    Ok(Messenger {
        instance,
        severities: info.message_severities,
        types: info.message_types,
        callback,
        user_data: info.user_data.expose_provenance(),
    })
}

fn check_bits(what: &str, bits: u64, known: u64) -> Outcome<()> {
    require!(
        bits != 0 && bits & !known == 0,
        ERROR_VALIDATION_FAILURE,
        "{} is {:#x}, which is none or not only known bits",
        what,
        bits
    );
    Ok(())
}

pub fn create_messenger(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    info: In<sys::DebugUtilsMessengerCreateInfoEXT>,
    out: Out<sys::DebugUtilsMessengerEXT>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.instance(handle)?;
    let messenger = messenger(handle, info.get()?)?;
    out.check()?;
    out.write(state.create_messenger(messenger)?);
    OK
}

pub fn destroy_messenger(shared: &Arc<Shared>, handle: sys::DebugUtilsMessengerEXT) -> Outcome<sys::Result> {
    shared.lock().destroy_messenger(handle)?;
    OK
}

pub fn submit_message(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    severity: sys::DebugUtilsMessageSeverityFlagsEXT,
    types: sys::DebugUtilsMessageTypeFlagsEXT,
    data: In<sys::DebugUtilsMessengerCallbackDataEXT>,
) -> Outcome<sys::Result> {
    let state = shared.lock();
    state.instance(handle)?;
    let data = data.get()?;
    check_bits("messageSeverity", severity.into_raw(), SEVERITIES)?;
    check_bits("messageTypes", types.into_raw(), TYPES)?;
    // SAFETY: the structure is verified; its arrays and texts are the caller's promise.
    let objects = unsafe { typed_array(data.objects.cast_const(), data.object_count) }?;
    // SAFETY: as above.
    let given = unsafe { typed_array(data.session_labels.cast_const(), data.session_label_count) }?;
    let object = |it: &sys::DebugUtilsObjectNameInfoEXT| {
        let known = state.object_name(handle, it.object_type, it.object_handle);
        let name = owned(it.object_name)?.or_else(|| known.cloned());
        Ok(Object { kind: it.object_type, handle: it.object_handle, name })
    };
    let objects: Vec<_> = objects.iter().map(object).collect::<Outcome<_>>()?;
    let label = |it: &sys::DebugUtilsLabelEXT| Ok(owned(it.label_name)?.unwrap_or_default());
    let mut labels: Vec<_> = given.iter().map(label).collect::<Outcome<_>>()?;
    labels.extend(state.labels_of(&objects));
    let message = Message {
        severity,
        types,
        id: owned(data.message_id)?.unwrap_or_default(),
        function: owned(data.function_name)?.unwrap_or_default(),
        text: c_text(In::new(data.message).text()?),
        objects,
        labels,
    };
    let listeners = state.listeners(Some(handle), severity, types);
    drop(state);
    deliver(&listeners, &message);
    OK
}

/// A text that may be left out.
fn owned(text: *const c_char) -> Outcome<Option<CString>> {
    Ok(optional_text(text)?.map(c_text))
}

pub fn set_object_name(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    info: In<sys::DebugUtilsObjectNameInfoEXT>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.instance(handle)?;
    let info = info.get()?;
    state.name_object(handle, info.object_type, info.object_handle, owned(info.object_name)?)?;
    OK
}

pub fn begin_label(
    shared: &Arc<Shared>,
    session: sys::Session,
    label: In<sys::DebugUtilsLabelEXT>,
) -> Outcome<sys::Result> {
    put_label(shared, session, label, Labels::begin)
}

pub fn end_label(shared: &Arc<Shared>, session: sys::Session) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.session_mut(session)?.labels.end();
    Ok(state.success(session))
}

pub fn insert_label(
    shared: &Arc<Shared>,
    session: sys::Session,
    label: In<sys::DebugUtilsLabelEXT>,
) -> Outcome<sys::Result> {
    put_label(shared, session, label, Labels::insert)
}

fn put_label(
    shared: &Arc<Shared>,
    session: sys::Session,
    label: In<sys::DebugUtilsLabelEXT>,
    put: impl FnOnce(&mut Labels, CString),
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.session(session)?;
    let label = c_text(In::new(label.get()?.label_name).text()?);
    put(&mut state.session_mut(session)?.labels, label);
    Ok(state.success(session))
}
