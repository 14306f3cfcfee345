//! The system's OpenXR loader, asked only when there is a runtime for it to load.

#![allow(unsafe_code, reason = "loads the OpenXR loader's shared library")]

use std::ffi::OsString;
use std::path::PathBuf;

use openxr::EntryError;

use super::error::Error;

/// Names the runtime's manifest file directly.
const RUNTIME_VARIABLE: &str = "XR_RUNTIME_JSON";

/// The system's OpenXR loader.
///
/// # Errors
/// `Unavailable` when no runtime is set up or the loader is not installed. Whether the runtime answers shows in
/// [`Runtime::open`](super::Runtime::open).
pub fn system_entry() -> Result<openxr::Entry, Error> {
    // The loader itself would print several lines of errors for what is the ordinary case of a desk without a headset.
    if cfg!(target_os = "linux") {
        system_manifest()?;
    }
    load_loader()
}

/// The manifest of the active runtime, where one is set up. (The loader has the last word which it takes.)
///
/// # Errors
/// `Unavailable` when there is none.
pub fn system_manifest() -> Result<PathBuf, Error> {
    find_manifest(|name| std::env::var_os(name).filter(|value| !value.is_empty()))
}

/// The loader itself, whether or not there is a runtime for it.
///
/// # Errors
/// `Unavailable` when it is not installed.
pub(super) fn load_loader() -> Result<openxr::Entry, Error> {
    // SAFETY: the library of that name is the Khronos loader, which keeps to the specification.
    unsafe { openxr::Entry::load(&()) }.map_err(|error| match error {
        EntryError::Load(cause) => Error::Unavailable(format!(
            "the OpenXR loader is missing ({cause}): install it (Debian and Ubuntu: libopenxr-loader1, Fedora: \
             openxr-libs, Arch: openxr)"
        )),
        EntryError::Xr(code) => Error::from_code("xrInitializeLoaderKHR", code),
    })
}

/// The first runtime manifest where loaders look for one; `variable` reads the environment.
fn find_manifest(variable: impl Fn(&str) -> Option<OsString>) -> Result<PathBuf, Error> {
    if let Some(path) = variable(RUNTIME_VARIABLE).map(PathBuf::from) {
        return if path.is_file() {
            Ok(path)
        } else {
            Err(Error::Unavailable(format!(
                "there is no OpenXR runtime manifest {} as {RUNTIME_VARIABLE} says: correct or unset that variable",
                path.display()
            )))
        };
    }
    let is_manifest = |name: &str| name.starts_with("active_runtime") && name.ends_with(".json");
    let found = search_path(variable).into_iter().find_map(|folder| {
        let mut files = folder.join("openxr/1").read_dir().ok()?.flatten();
        files.find(|file| file.file_name().to_str().is_some_and(is_manifest)).map(|file| file.path())
    });
    found.ok_or_else(|| {
        Error::Unavailable(
            "no OpenXR runtime is set up: install the headset's software (SteamVR, Monado, WiVRn) and make it the \
             active OpenXR runtime"
                .into(),
        )
    })
}

/// The folders in which loaders look for `openxr/1/active_runtime*.json`, and a few more, so that none is missed.
fn search_path(variable: impl Fn(&str) -> Option<OsString>) -> Vec<PathBuf> {
    let home = variable("HOME").map(PathBuf::from);
    let own = |name: &str, below_home: &str| {
        variable(name).map(PathBuf::from).or_else(|| Some(home.as_ref()?.join(below_home)))
    };
    let shared = |name: &str, default: &str| {
        let list = variable(name).unwrap_or_else(|| default.into());
        std::env::split_paths(&list).collect::<Vec<_>>()
    };
    let mut folders = Vec::new();
    folders.extend(own("XDG_CONFIG_HOME", ".config"));
    folders.extend(shared("XDG_CONFIG_DIRS", "/etc/xdg"));
    folders.extend(["/etc", "/usr/local/etc"].map(PathBuf::from));
    folders.extend(own("XDG_DATA_HOME", ".local/share"));
    folders.extend(shared("XDG_DATA_DIRS", "/usr/local/share:/usr/share"));
    folders
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests stop at the first surprise")]

    use super::*;

    #[test]
    fn a_manifest_is_found_where_the_environment_says() {
        let folder = tempfile::tempdir().unwrap();
        let config = folder.path().join(".config/openxr/1");
        std::fs::create_dir_all(&config).unwrap();
        let manifest = config.join("active_runtime.x86_64.json");
        std::fs::write(&manifest, "{}").unwrap();

        let only =
            |name: &'static str, value: PathBuf| move |n: &str| (n == name).then(|| value.clone().into());
        assert!(find_manifest(only("HOME", folder.path().into())).is_ok());
        assert!(find_manifest(only("XDG_CONFIG_DIRS", folder.path().join(".config"))).is_ok());
        assert!(find_manifest(only(RUNTIME_VARIABLE, manifest)).is_ok());
    }

    #[test]
    fn a_named_manifest_that_is_not_there_is_named_in_the_error() {
        let error = find_manifest(|n| (n == RUNTIME_VARIABLE).then(|| "/nowhere/runtime.json".into()));
        let text = error.unwrap_err().to_string();
        assert!(text.contains("/nowhere/runtime.json") && text.contains(RUNTIME_VARIABLE), "{text}");
    }
}
