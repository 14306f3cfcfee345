//! What OpenXR offers on this machine, asked without a session: for `doctor`.

use std::path::PathBuf;

use openxr::{ApplicationInfo, ExtensionSet, Version};

use super::error::Error;
use super::loader::{load_loader, system_manifest};
use super::runtime::{Runtime, RuntimeInfo, offered_extensions};

/// The system's loader, and the runtime behind it.
#[derive(Debug)]
pub struct Survey {
    /// Whether the loader is installed.
    pub loader: Result<(), Error>,
    /// The manifest of the active runtime.
    pub manifest: Result<PathBuf, Error>,
    /// What the runtime says; None: there is no loader, or nothing for it to load.
    pub runtime: Option<Result<RuntimeSurvey, Error>>,
}

/// One runtime.
#[derive(Debug)]
pub struct RuntimeSurvey {
    /// Its name for itself.
    pub name: String,
    /// Its own version.
    pub version: Version,
    /// Names of its extensions.
    pub extensions: Vec<String>,
    /// The headset and what it wants, or why it does not answer.
    pub headset: Result<RuntimeInfo, Error>,
}

/// Asks the system's loader and, if one is set up, its runtime.
pub fn survey() -> Survey {
    let (loader, manifest) = (load_loader(), system_manifest());
    let (loader, runtime) = match (loader, &manifest) {
        (Ok(entry), Ok(_)) => (Ok(()), Some(RuntimeSurvey::of(entry))),
        (loader, _) => (loader.map(|_| ()), None),
    };
    Survey { loader, manifest, runtime }
}

impl RuntimeSurvey {
    /// Asks the runtime behind an entry.
    ///
    /// # Errors
    /// It does not answer.
    pub fn of(entry: openxr::Entry) -> Result<RuntimeSurvey, Error> {
        let mut extensions = offered_extensions(&entry)?;
        extensions.sort();
        let (name, version) = {
            let application = ApplicationInfo {
                application_name: "Fathomless",
                application_version: 1,
                engine_name: env!("CARGO_PKG_NAME"),
                engine_version: 1,
                api_version: Version::new(1, 0, 0),
            };
            let instance = entry
                .create_instance(&application, &ExtensionSet::default(), &[], &())
                .map_err(|code| Error::from_code("xrCreateInstance", code))?;
            let properties =
                instance.properties().map_err(|code| Error::from_code("xrGetInstanceProperties", code))?;
            (properties.runtime_name, properties.runtime_version)
        };
        let headset = Runtime::open(entry, "Fathomless").map(|runtime| runtime.info().clone());
        Ok(RuntimeSurvey { name, version, extensions, headset })
    }
}
