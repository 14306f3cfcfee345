//! Results, structure types and paths as strings.

use std::{ffi::c_char, sync::Arc};

use openxr::sys;

use super::pointer::{In, Out, OutArray, fixed_chars};
use crate::mock::{fault::Outcome, registry, state::Shared};

const OK: Outcome<sys::Result> = Ok(sys::Result::SUCCESS);

pub fn result_to_string(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    value: sys::Result,
    out: Out<[c_char; sys::MAX_RESULT_STRING_SIZE]>,
) -> Outcome<sys::Result> {
    shared.lock().instance(handle)?;
    out.check()?;
    let raw = value.into_raw();
    let text = match registry::name(registry::RESULTS, raw) {
        Some(name) => name.to_owned(),
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
    let raw = value.into_raw();
    let text = registry::name(registry::STRUCTURE_TYPES, raw)
        .map_or_else(|| format!("XR_UNKNOWN_STRUCTURE_TYPE_{raw}"), str::to_owned);
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
