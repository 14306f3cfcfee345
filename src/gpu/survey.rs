//! What Vulkan offers on this machine, asked without opening a device: for `doctor`.
#![allow(unsafe_code, reason = "calls Vulkan")]

use std::ffi::CStr;

use anyhow::{Result, anyhow};
use ash::vk;

use super::bootstrap::{Bootstrap, Direct, Offer, text};
use super::context::{DeviceInfo, describe};
use super::instance::{Instance, has_layer, load};

/// What the loader offers, and the devices behind it.
#[derive(Debug)]
pub struct Survey {
    /// The loader's version, e.g. `1.3.239`.
    pub loader: String,
    /// The validation layer is there.
    pub validation: bool,
    /// Names of the layers.
    pub layers: Vec<String>,
    /// Names of the instance's extensions.
    pub extensions: Vec<String>,
    /// All devices, or why there is none: a sentence that says what to do.
    pub devices: Result<Vec<DeviceSurvey>>,
}

/// One device.
#[derive(Debug)]
pub struct DeviceSurvey {
    /// What it is.
    pub info: DeviceInfo,
    /// What it lacks of what cannot be done without; empty: it can be used.
    pub lacks: Vec<&'static str>,
    /// It is the one that is used without a headset.
    pub chosen: bool,
    /// Names of its extensions.
    pub extensions: Vec<String>,
}

/// Asks the loader and every device.
///
/// # Errors
/// No loader, or one too old: a sentence that says what to install.
pub fn survey() -> Result<Survey> {
    let entry = load()?;
    // SAFETY: no preconditions.
    let version = unsafe { entry.try_enumerate_instance_version() }?.unwrap_or(vk::API_VERSION_1_0);
    // SAFETY: no preconditions.
    let layers = unsafe { entry.enumerate_instance_layer_properties() }?;
    // SAFETY: no preconditions.
    let extensions = unsafe { entry.enumerate_instance_extension_properties(None) }?;
    Ok(Survey {
        loader: format!(
            "{}.{}.{}",
            vk::api_version_major(version),
            vk::api_version_minor(version),
            vk::api_version_patch(version)
        ),
        validation: has_layer(&entry)?,
        layers: sorted(layers.iter().map(|layer| layer.layer_name_as_c_str())),
        extensions: sorted(extensions.iter().map(|extension| extension.extension_name_as_c_str())),
        devices: devices(),
    })
}

fn devices() -> Result<Vec<DeviceSurvey>> {
    let instance = Instance::new(&Direct, false, None)?;
    let chosen = Direct.physical_device(&instance.raw);
    // SAFETY: the instance is alive.
    let all = match unsafe { instance.raw.enumerate_physical_devices() } {
        Ok(all) if !all.is_empty() => all,
        Ok(_) => return Err(chosen.err().unwrap_or_else(|| anyhow!("Vulkan lists no device"))),
        Err(error) => return Err(chosen.err().unwrap_or_else(|| error.into())),
    };
    let chosen = chosen.ok();
    all.into_iter()
        .map(|physical| {
            let offer = Offer::of(&instance.raw, physical);
            // SAFETY: `physical` is of this instance.
            let extensions = unsafe { instance.raw.enumerate_device_extension_properties(physical) }?;
            Ok(DeviceSurvey {
                info: describe(&instance.raw, physical, &offer),
                lacks: offer.lacks,
                chosen: chosen == Some(physical),
                extensions: sorted(extensions.iter().map(|extension| extension.extension_name_as_c_str())),
            })
        })
        .collect()
}

fn sorted<'a, E>(names: impl Iterator<Item = Result<&'a CStr, E>>) -> Vec<String> {
    let mut names: Vec<String> = names.map(|name| text(name.unwrap_or_default())).collect();
    names.sort();
    names
}
