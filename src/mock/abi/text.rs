//! Results, structure types and paths as strings.

use std::{ffi::c_char, fmt::Debug, sync::Arc};

use openxr::sys;

use super::pointer::{In, Out, OutArray, fixed_chars};
use crate::mock::{fault::Outcome, state::Shared};

const OK: Outcome<sys::Result> = Ok(sys::Result::SUCCESS);

/// The name of an enumerant, or `None` if its number is all that is known of it.
fn known_name(value: impl Debug) -> Option<String> {
    let name = format!("{value:?}");
    name.parse::<i64>().is_err().then_some(name)
}

pub fn result_to_string(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    value: sys::Result,
    out: Out<[c_char; sys::MAX_RESULT_STRING_SIZE]>,
) -> Outcome<sys::Result> {
    shared.lock().instance(handle)?;
    out.check()?;
    let raw = value.into_raw();
    let text = match known_name(value) {
        Some(name) => format!("XR_{name}"),
        None if raw < 0 => format!("XR_UNKNOWN_FAILURE_{raw}"),
        None => format!("XR_UNKNOWN_SUCCESS_{raw}"),
    };
    out.write(fixed_chars(&text));
    OK
}

pub fn structure_type_to_string(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    value: sys::StructureType,
    out: Out<[c_char; sys::MAX_STRUCTURE_NAME_SIZE]>,
) -> Outcome<sys::Result> {
    shared.lock().instance(handle)?;
    out.check()?;
    let text = known_name(value).map_or_else(
        || format!("XR_UNKNOWN_STRUCTURE_TYPE_{}", value.into_raw()),
        |name| format!("XR_TYPE_{name}"),
    );
    out.write(fixed_chars(&text));
    OK
}

pub fn string_to_path(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    path: In<c_char>,
    out: Out<sys::Path>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.instance(handle)?;
    out.check()?;
    out.write(state.string_to_path(handle, path.text()?)?);
    OK
}

pub fn path_to_string(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    path: sys::Path,
    capacity: u32,
    count: Out<u32>,
    buffer: Out<c_char>,
) -> Outcome<sys::Result> {
    let state = shared.lock();
    let out = OutArray { capacity, count, items: buffer };
    out.fill_text(state.path_to_string(handle, path)?)?;
    OK
}
