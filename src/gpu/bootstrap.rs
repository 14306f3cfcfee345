//! Who makes the Vulkan instance and device, and what a device must offer.
#![allow(unsafe_code, reason = "calls Vulkan")]

use std::ffi::CStr;

use anyhow::{Context, Result, anyhow, bail};
use ash::vk;

/// Selects a device by a part of its name, in any case.
const GPU_VARIABLE: &str = "FATHOMLESS_GPU";

/// What to say where Vulkan has a loader and no driver.
pub(crate) const NO_DRIVER: &str = "No Vulkan driver found. Install the one for your graphics card, or the software driver (Debian, Ubuntu \
     and Fedora: mesa-vulkan-drivers; Arch: vulkan-swrast), or run setup.sh";

/// Who makes the instance and the device: Vulkan itself ([`Direct`]: verify, doctor, tests) or an OpenXR runtime.
pub trait Bootstrap {
    /// Makes an instance from `info`; its extensions and layers are wanted, more may be added.
    fn create_instance(&self, entry: &ash::Entry, info: &vk::InstanceCreateInfo<'_>) -> Result<vk::Instance>;

    /// The device to use.
    fn physical_device(&self, instance: &ash::Instance) -> Result<vk::PhysicalDevice>;

    /// Makes a device from `info`, whose features and queues must be granted.
    fn create_device(
        &self,
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
    ) -> Result<vk::Device>;
}

/// Vulkan without a headset: the best device there is, or the one whose name contains `FATHOMLESS_GPU`.
#[derive(Debug, Clone, Copy, Default)]
pub struct Direct;

impl Bootstrap for Direct {
    fn create_instance(&self, entry: &ash::Entry, info: &vk::InstanceCreateInfo<'_>) -> Result<vk::Instance> {
        // SAFETY: `info` is well formed and outlives the call.
        match unsafe { entry.create_instance(info, None) } {
            Ok(instance) => Ok(instance.handle()),
            Err(vk::Result::ERROR_INCOMPATIBLE_DRIVER) => Err(anyhow!(NO_DRIVER)),
            Err(error) => Err(error).context("Vulkan refused to start (vkCreateInstance)"),
        }
    }

    fn physical_device(&self, instance: &ash::Instance) -> Result<vk::PhysicalDevice> {
        let candidates = candidates(instance)?;
        if candidates.is_empty() {
            bail!(NO_DRIVER);
        }
        choose(&candidates, std::env::var(GPU_VARIABLE).ok().as_deref())
    }

    fn create_device(
        &self,
        instance: &ash::Instance,
        physical: vk::PhysicalDevice,
        info: &vk::DeviceCreateInfo<'_>,
    ) -> Result<vk::Device> {
        // SAFETY: `physical` is of this instance, `info` is well formed and outlives the call.
        let device = unsafe { instance.create_device(physical, info, None) }
            .context("The graphics driver refused to open its device (vkCreateDevice)")?;
        Ok(device.handle())
    }
}

/// A device that could be used, by name and kind, and what it lacks.
struct Candidate {
    physical: vk::PhysicalDevice,
    name: String,
    kind: vk::PhysicalDeviceType,
    lacks: Vec<&'static str>,
}

fn candidates(instance: &ash::Instance) -> Result<Vec<Candidate>> {
    // SAFETY: the instance is alive.
    let devices = match unsafe { instance.enumerate_physical_devices() } {
        Ok(devices) => devices,
        // How some loaders say that every driver failed to load.
        Err(vk::Result::ERROR_INITIALIZATION_FAILED) => Vec::new(),
        Err(error) => return Err(error).context("Vulkan cannot list its devices"),
    };
    Ok(devices.into_iter().map(|physical| candidate(instance, physical)).collect())
}

fn candidate(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Candidate {
    // SAFETY: `physical` is of this instance.
    let properties = unsafe { instance.get_physical_device_properties(physical) };
    Candidate {
        physical,
        name: text(properties.device_name_as_c_str().unwrap_or_default()),
        kind: properties.device_type,
        lacks: Offer::of(instance, physical).lacks,
    }
}

fn choose(candidates: &[Candidate], wanted: Option<&str>) -> Result<vk::PhysicalDevice> {
    let named: Vec<&Candidate> = match wanted.map(str::to_lowercase) {
        Some(wanted) => candidates.iter().filter(|one| one.name.to_lowercase().contains(&wanted)).collect(),
        None => candidates.iter().collect(),
    };
    if named.is_empty() {
        let names: Vec<&str> = candidates.iter().map(|one| one.name.as_str()).collect();
        bail!(
            "{GPU_VARIABLE}={:?} names no device here; there is: {}",
            wanted.unwrap_or(""),
            names.join(", ")
        );
    }
    match named.iter().filter(|one| one.lacks.is_empty()).min_by_key(|one| rank(one.kind)) {
        Some(best) => Ok(best.physical),
        None => Err(lacking(&named[0].name, &named[0].lacks)),
    }
}

/// What to say when a device is not good enough.
pub(super) fn lacking(name: &str, lacks: &[&str]) -> anyhow::Error {
    anyhow!(
        "{name} lacks {}. Update the graphics driver, or install a software one by setup.sh",
        lacks.join(", ")
    )
}

/// Least is best.
fn rank(kind: vk::PhysicalDeviceType) -> u32 {
    match kind {
        vk::PhysicalDeviceType::DISCRETE_GPU => 0,
        vk::PhysicalDeviceType::INTEGRATED_GPU => 1,
        vk::PhysicalDeviceType::VIRTUAL_GPU => 2,
        vk::PhysicalDeviceType::CPU => 3,
        _ => 4,
    }
}

pub(super) fn text(name: &CStr) -> String {
    name.to_string_lossy().into_owned()
}

/// What a device offers of what we use.
pub(super) struct Offer {
    pub(super) multiview: bool,
    pub(super) multi_draw_indirect: bool,
    pub(super) draw_indirect_first_instance: bool,
    /// Family with graphics and compute (whose transfers come with them).
    pub(super) queue_family: Option<u32>,
    /// Queues of that family.
    pub(super) queue_count: u32,
    /// What is missing of what we cannot do without.
    pub(super) lacks: Vec<&'static str>,
}

impl Offer {
    pub(super) fn of(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Self {
        // SAFETY: `physical` is of this instance.
        let version = unsafe { instance.get_physical_device_properties(physical) }.api_version;
        let (queue_family, queue_count) = queue_family(instance, physical).unzip();
        let mut v11 = vk::PhysicalDeviceVulkan11Features::default();
        let mut v12 = vk::PhysicalDeviceVulkan12Features::default();
        let mut v13 = vk::PhysicalDeviceVulkan13Features::default();
        let mut features = vk::PhysicalDeviceFeatures2::default();
        if version >= vk::API_VERSION_1_3 {
            features = features.push_next(&mut v11).push_next(&mut v12).push_next(&mut v13);
            // SAFETY: the device is of 1.3, so it knows the structures chained here.
            unsafe { instance.get_physical_device_features2(physical, &mut features) };
        }
        let core = features.features;
        let needs = [
            (version >= vk::API_VERSION_1_3, "Vulkan 1.3"),
            (queue_family.is_some(), "a queue for graphics and compute"),
            (v12.timeline_semaphore == vk::TRUE, "timeline semaphores"),
            (v12.host_query_reset == vk::TRUE, "host query reset"),
            (v13.dynamic_rendering == vk::TRUE, "dynamic rendering"),
            (v13.synchronization2 == vk::TRUE, "synchronization2"),
            (v13.maintenance4 == vk::TRUE, "maintenance4"),
        ];
        Self {
            multiview: v11.multiview == vk::TRUE,
            multi_draw_indirect: core.multi_draw_indirect == vk::TRUE,
            draw_indirect_first_instance: core.draw_indirect_first_instance == vk::TRUE,
            queue_family,
            queue_count: queue_count.unwrap_or(0),
            lacks: needs.iter().filter(|(offered, _)| !offered).map(|(_, what)| *what).collect(),
        }
    }
}

/// The family to use, and how many queues it has.
fn queue_family(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Option<(u32, u32)> {
    // SAFETY: `physical` is of this instance.
    let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
    let wanted = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
    let found = (0u32..).zip(&families).find(|(_, family)| family.queue_flags.contains(wanted));
    found.map(|(index, family)| (index, family.queue_count))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, reason = "tests")]

    use super::*;
    use ash::vk::Handle;

    fn device(id: u64, name: &str, kind: vk::PhysicalDeviceType, lacks: &[&'static str]) -> Candidate {
        Candidate {
            physical: vk::PhysicalDevice::from_raw(id),
            name: name.into(),
            kind,
            lacks: lacks.to_vec(),
        }
    }

    #[test]
    fn the_best_device_that_lacks_nothing_is_chosen_unless_one_is_named() {
        let all = [
            device(1, "llvmpipe", vk::PhysicalDeviceType::CPU, &[]),
            device(2, "Old Card", vk::PhysicalDeviceType::DISCRETE_GPU, &["Vulkan 1.3"]),
            device(3, "Laptop Chip", vk::PhysicalDeviceType::INTEGRATED_GPU, &[]),
        ];
        let chosen = |wanted| choose(&all, wanted).map(|one| one.as_raw());
        assert_eq!(chosen(None).unwrap(), 3);
        assert_eq!(chosen(Some("PIPE")).unwrap(), 1);
        assert!(chosen(Some("old")).unwrap_err().to_string().contains("Old Card lacks Vulkan 1.3"));
        assert!(chosen(Some("rtx")).unwrap_err().to_string().contains("llvmpipe, Old Card, Laptop Chip"));
    }
}
