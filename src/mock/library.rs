//! The shared library: what the OpenXR loader asks of it, and the one mock that answers a whole process. The mock
//! comes into being with the process's first call and is gone when its last instance is destroyed.
#![allow(unsafe_code, reason = "an exported C function that follows the loader's pointers")]

use std::{
    env, fs,
    io::Write,
    path::PathBuf,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::{SystemTime, UNIX_EPOCH},
};

use openxr::sys;

use super::{
    abi,
    control::Mock,
    handle, log,
    script::Script,
    slot::LIBRARY,
    state::{Shared, State},
};

/// Names the script that the library's mock plays.
const SCRIPT: &str = "FATHOMLESS_MOCK_SCRIPT";
/// Names the file that gets a line of JSON when the last instance is destroyed.
const LOG: &str = "FATHOMLESS_MOCK_LOG";

/// What can be asked before there is an instance.
const WITHOUT_INSTANCE: [&str; 4] = [
    "xrGetInstanceProcAddr",
    "xrEnumerateApiLayerProperties",
    "xrEnumerateInstanceExtensionProperties",
    "xrCreateInstance",
];

/// The mock of this process. It outlives single calls, so that a script can count those that make no instance.
static MOCK: Mutex<Option<Arc<Shared>>> = Mutex::new(None);

/// Held while an instance comes or goes, so that no instance is made in a mock that has just retired.
static COMING_AND_GOING: Mutex<()> = Mutex::new(());

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Performs one call on the library's mock. Without a mock there is no handle that could be valid.
pub fn enter(function: &'static str, perform: impl FnOnce(&Arc<Shared>) -> sys::Result) -> sys::Result {
    let comes_or_goes = matches!(function, "xrCreateInstance" | "xrDestroyInstance");
    let _turn = comes_or_goes.then(|| lock(&COMING_AND_GOING));
    let shared = match mock_for(function) {
        Ok(shared) => shared,
        Err(code) => return code,
    };
    let code = perform(&shared);
    if function == "xrDestroyInstance" {
        let state = shared.lock();
        if state.instances.is_empty() {
            write_log(&state);
            drop(state);
            lock(&MOCK).take();
        }
    }
    code
}

fn mock_for(function: &str) -> Result<Arc<Shared>, sys::Result> {
    let mut mock = lock(&MOCK);
    if let Some(shared) = &*mock {
        return Ok(Arc::clone(shared));
    }
    if !WITHOUT_INSTANCE.contains(&function) {
        return Err(sys::Result::ERROR_HANDLE_INVALID);
    }
    // Handles of a mock before this one must not fit, even when the library was unloaded in between and has
    // forgotten how many there were.
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    handle::skip_salts(now.as_nanos() as u64);
    let script = script_from_env().map_err(|sentence| {
        complain(&sentence);
        sys::Result::ERROR_INITIALIZATION_FAILED
    })?;
    Ok(Arc::clone(mock.insert(Mock::with_script(script).into_shared())))
}

fn named_file(variable: &str) -> Option<PathBuf> {
    env::var_os(variable).filter(|value| !value.is_empty()).map(PathBuf::from)
}

/// The script that the environment names; without one, the headset as it is by itself.
fn script_from_env() -> Result<Script, String> {
    let Some(path) = named_file(SCRIPT) else { return Ok(Script::default()) };
    let text = fs::read_to_string(&path).map_err(|error| format!("{SCRIPT}={}: {error}", path.display()))?;
    Script::from_toml(&text, &path.to_string_lossy()).map_err(|error| format!("{SCRIPT}: {error}"))
}

fn write_log(state: &State) {
    let Some(path) = named_file(LOG) else { return };
    if let Err(error) = log::append(&path, state) {
        complain(&format!("{LOG}={}: {error}", path.display()));
    }
}

/// There is nobody else to tell. A closed stderr is no reason to panic in somebody else's program.
fn complain(sentence: &str) {
    let _ = writeln!(std::io::stderr(), "fathomless mock runtime: {sentence}");
}

/// Where an application meets the library: the loader, or a program that loads it by itself, learns versions and
/// `xrGetInstanceProcAddr` here.
///
/// # Safety
/// Each pointer is null or points at a structure that holds what its own `structSize` says.
#[unsafe(no_mangle)]
#[allow(non_snake_case, reason = "the name is the interface")]
pub unsafe extern "system" fn xrNegotiateLoaderRuntimeInterface(
    loader: *const sys::NegotiateLoaderInfo,
    request: *mut sys::NegotiateRuntimeRequest,
) -> sys::Result {
    // SAFETY: the caller's promise.
    let answered = std::panic::catch_unwind(|| unsafe { negotiate(loader, request) });
    match answered {
        Ok(Ok(())) => sys::Result::SUCCESS,
        Ok(Err(sentence)) => {
            complain(&sentence);
            sys::Result::ERROR_INITIALIZATION_FAILED
        }
        Err(_) => sys::Result::ERROR_RUNTIME_FAILURE,
    }
}

/// # Safety
/// As for [`xrNegotiateLoaderRuntimeInterface`].
unsafe fn negotiate(
    loader: *const sys::NegotiateLoaderInfo,
    request: *mut sys::NegotiateRuntimeRequest,
) -> Result<(), String> {
    let refuse = |sentence: &str| Err(format!("the loader's request cannot be met: {sentence}"));
    if loader.is_null() || !loader.is_aligned() || request.is_null() || !request.is_aligned() {
        return refuse("a structure is NULL or misaligned");
    }
    // SAFETY: neither null nor misaligned; the caller promises structures.
    let (loader, asked) = unsafe { (&*loader, &*request) };
    let shape = (loader.struct_type, loader.struct_version, loader.struct_size);
    let wanted = (
        sys::NegotiateLoaderInfo::TYPE,
        sys::NegotiateLoaderInfo::VERSION,
        size_of::<sys::NegotiateLoaderInfo>(),
    );
    if shape != wanted {
        return refuse("XrNegotiateLoaderInfo has another type, version or size");
    }
    let shape = (asked.struct_type, asked.struct_version, asked.struct_size);
    let wanted = (
        sys::NegotiateRuntimeRequest::TYPE,
        sys::NegotiateRuntimeRequest::VERSION,
        size_of::<sys::NegotiateRuntimeRequest>(),
    );
    if shape != wanted {
        return refuse("XrNegotiateRuntimeRequest has another type, version or size");
    }
    let interface = sys::CURRENT_LOADER_RUNTIME_VERSION as u32;
    if !(loader.min_interface_version..=loader.max_interface_version).contains(&interface) {
        return refuse("only interface version 1 is known here");
    }
    let Some(version) = api_version(loader.min_api_version, loader.max_api_version) else {
        return refuse("only OpenXR 1.0 and 1.1 are known here");
    };
    // A script that cannot be read is told now, while saying no is still an answer that loaders understand.
    script_from_env()?;
    let get_instance_proc_addr = abi::proc_addr_of(LIBRARY);
    // SAFETY: neither null nor misaligned; the caller promises a structure to write to.
    let answer = unsafe { &mut *request };
    answer.runtime_interface_version = interface;
    answer.runtime_api_version = version;
    answer.get_instance_proc_addr = get_instance_proc_addr;
    Ok(())
}

/// The newest version of OpenXR that both sides know.
fn api_version(min: sys::Version, max: sys::Version) -> Option<sys::Version> {
    let version = sys::CURRENT_API_VERSION.min(max);
    (version >= min && version >= sys::Version::new(1, 0, 0)).then_some(version)
}

/// Runs when the process ends (the library is never unmapped, see `link.rs`). The application's Vulkan device may be
/// gone by then, so instances that are still alive are logged and left to the operating system. Whoever ends the process
/// in the midst of a call, from a callback of Vulkan's say, holds the locks, and gets no log rather than no end.
#[cfg(target_os = "linux")]
extern "C" fn at_exit() {
    let Some(mut mock) = MOCK.try_lock().ok() else { return };
    let Some(shared) = mock.take() else { return };
    if let Some(state) = shared.try_lock()
        && state.journal.count("xrCreateInstance") > 0
    {
        write_log(&state);
    }
    std::mem::forget(shared);
}

#[cfg(target_os = "linux")]
#[used]
// SAFETY: an array of functions without arguments that the dynamic linker calls once each.
#[unsafe(link_section = ".fini_array")]
static AT_EXIT: extern "C" fn() = at_exit;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_common_version_is_chosen() {
        let v = sys::Version::new;
        assert_eq!(api_version(v(1, 0, 0), v(1, 0x3FF, 0xFFF)), Some(sys::CURRENT_API_VERSION));
        assert_eq!(api_version(v(1, 0, 0), v(1, 0, 34)), Some(v(1, 0, 34)));
        assert_eq!(api_version(v(1, 1, 0), sys::CURRENT_API_VERSION), Some(sys::CURRENT_API_VERSION));
        assert_eq!(api_version(v(2, 0, 0), v(2, 1, 0)), None);
        assert_eq!(api_version(v(0, 1, 0), v(0, 90, 0)), None);
        assert_eq!(api_version(v(1, 2, 0), v(1, 9, 0)), None);
    }
}
