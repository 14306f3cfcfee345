//! The Vulkan instance with its messenger, destroyed in the right order.
#![allow(unsafe_code, reason = "calls Vulkan")]

use std::ffi::{CStr, c_char};
use std::sync::Arc;

use anyhow::{Context, Result, bail};
use ash::{ext, khr, vk};

use super::bootstrap::Bootstrap;
use super::validation::{ValidationLog, messenger_info};

const VALIDATION_LAYER: &CStr = c"VK_LAYER_KHRONOS_validation";

const NO_LOADER: &str = "No Vulkan loader found. Install the Vulkan loader and a driver (Debian and Ubuntu: libvulkan1 \
     mesa-vulkan-drivers; Fedora: vulkan-loader mesa-vulkan-drivers; Arch: vulkan-icd-loader vulkan-swrast), or run setup.sh";

const OLD_LOADER: &str = "The Vulkan loader is too old: Vulkan 1.3 is needed. Install a newer one (Debian and Ubuntu: libvulkan1; \
     Fedora: vulkan-loader; Arch: vulkan-icd-loader), or run setup.sh";

const NO_LAYER: &str = "The Vulkan validation layer is not installed. Install it (Debian and Ubuntu: vulkan-validationlayers; \
     Fedora: vulkan-validation-layers; Arch: vulkan-validation-layers), or run without --validate";

/// An instance, the loader it came from, and the messenger that listens to it from its making to its end.
pub(super) struct Instance {
    pub(super) raw: ash::Instance,
    pub(super) log: Arc<ValidationLog>,
    /// `VK_EXT_debug_utils` is on: objects can be named.
    pub(super) names: bool,
    /// Windows of the platform that was asked for can be drawn to.
    pub(super) surfaces: bool,
    messenger: Option<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
    pub(super) entry: ash::Entry,
    /// Destroy nothing: the device hangs and may still be using it.
    pub(super) leak: bool,
}

impl Instance {
    /// With `surface`, the platform's extension for windows, where the loader offers it.
    pub(super) fn new(boot: &dyn Bootstrap, validate: bool, surface: Option<&'static CStr>) -> Result<Self> {
        let entry = load()?;
        if validate && !has_layer(&entry)? {
            bail!(NO_LAYER);
        }
        let names = validate || has_extension(&entry, ext::debug_utils::NAME)?;
        let surface = match surface {
            Some(name) if has_extension(&entry, khr::surface::NAME)? && has_extension(&entry, name)? => {
                Some(name)
            }
            _ => None,
        };
        let log = Arc::new(ValidationLog::default());
        let raw = create(boot, &entry, Wanted { validate, names, surface }, &log)?;
        let surfaces = surface.is_some();
        let mut made = Self { raw, log, names, surfaces, messenger: None, entry, leak: false };
        if validate {
            made.messenger = Some(made.listen()?);
        }
        Ok(made)
    }

    fn listen(&self) -> Result<(ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)> {
        let debug = ext::debug_utils::Instance::new(&self.entry, &self.raw);
        // SAFETY: the extension is on, and the log lives until after the messenger is destroyed (see `drop`).
        let messenger = unsafe { debug.create_debug_utils_messenger(&messenger_info(&self.log), None) }
            .context("Vulkan refused a messenger for its validation messages")?;
        Ok((debug, messenger))
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        if self.leak {
            std::mem::forget((Arc::clone(&self.log), self.entry.clone()));
            return;
        }
        // SAFETY: the device is gone by now (`Gpu` drops this last), and nobody else destroys these.
        unsafe {
            if let Some((debug, messenger)) = self.messenger.take() {
                debug.destroy_debug_utils_messenger(messenger, None);
            }
            self.raw.destroy_instance(None);
        }
    }
}

/// Finds the Vulkan loader and makes sure that it speaks 1.3.
pub(super) fn load() -> Result<ash::Entry> {
    // SAFETY: loading the system's Vulkan loader runs only its own initialisers.
    let entry = unsafe { ash::Entry::load() }.context(NO_LOADER)?;
    // SAFETY: no preconditions.
    let version = unsafe { entry.try_enumerate_instance_version() }.context(NO_LOADER)?;
    if version.unwrap_or(vk::API_VERSION_1_0) < vk::API_VERSION_1_3 {
        bail!(OLD_LOADER);
    }
    Ok(entry)
}

pub(super) fn has_layer(entry: &ash::Entry) -> Result<bool> {
    // SAFETY: no preconditions.
    let layers =
        unsafe { entry.enumerate_instance_layer_properties() }.context("Vulkan cannot list its layers")?;
    Ok(layers.iter().any(|layer| layer.layer_name_as_c_str() == Ok(VALIDATION_LAYER)))
}

fn has_extension(entry: &ash::Entry, name: &CStr) -> Result<bool> {
    // SAFETY: no preconditions.
    let offered = unsafe { entry.enumerate_instance_extension_properties(None) }
        .context("Vulkan cannot list its extensions")?;
    Ok(offered.iter().any(|extension| extension.extension_name_as_c_str() == Ok(name)))
}

/// What is switched on beside Vulkan itself.
#[derive(Clone, Copy)]
struct Wanted {
    validate: bool,
    names: bool,
    surface: Option<&'static CStr>,
}

fn create(
    boot: &dyn Bootstrap,
    entry: &ash::Entry,
    wanted: Wanted,
    log: &ValidationLog,
) -> Result<ash::Instance> {
    let application = vk::ApplicationInfo::default()
        .application_name(c"fathomless")
        .engine_name(c"fathomless")
        .api_version(vk::API_VERSION_1_3);

    let mut extensions: Vec<*const c_char> = Vec::new();
    let mut layers: Vec<*const c_char> = Vec::new();
    if wanted.names {
        extensions.push(ext::debug_utils::NAME.as_ptr());
    }
    if let Some(surface) = wanted.surface {
        extensions.extend([khr::surface::NAME.as_ptr(), surface.as_ptr()]);
    }
    if wanted.validate {
        layers.push(VALIDATION_LAYER.as_ptr());
        extensions.push(ext::validation_features::NAME.as_ptr());
    }

    // Chained to the instance itself, the messenger also hears of its creation and its destruction.
    let checks = [vk::ValidationFeatureEnableEXT::SYNCHRONIZATION_VALIDATION];
    let mut features = vk::ValidationFeaturesEXT::default().enabled_validation_features(&checks);
    let mut messenger = messenger_info(log);
    let mut info = vk::InstanceCreateInfo::default()
        .application_info(&application)
        .enabled_extension_names(&extensions)
        .enabled_layer_names(&layers);
    if wanted.validate {
        info = info.push_next(&mut features).push_next(&mut messenger);
    }

    let handle = boot.create_instance(entry, &info)?;
    // SAFETY: the handle was just made through this loader.
    Ok(unsafe { ash::Instance::load(entry.static_fn(), handle) })
}
