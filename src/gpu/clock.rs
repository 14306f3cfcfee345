//! The device's clock beside the processor's, where a driver can read both at once (`VK_EXT_calibrated_timestamps`).
#![allow(unsafe_code, reason = "calls Vulkan")]

use anyhow::{Context, Result};
use ash::{ext, vk};

/// The processor's clock that [`now_ns`](crate::telemetry::now_ns) reads.
const HOST: vk::TimeDomainEXT = vk::TimeDomainEXT::CLOCK_MONOTONIC;

/// Reads both clocks.
pub(super) struct DeviceClock {
    functions: ext::calibrated_timestamps::Device,
}

/// Both clocks at one moment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Calibration {
    /// The device's, in ticks.
    pub(super) ticks: u64,
    /// The processor's, in nanoseconds.
    pub(super) ns: u64,
}

/// True where [`DeviceClock`] can be had, its extension being offered.
pub(super) fn offered(
    entry: &ash::Entry,
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
) -> Result<bool> {
    let functions = ext::calibrated_timestamps::Instance::new(entry, instance);
    // SAFETY: the device offers the extension, and is of this instance.
    let domains = unsafe { functions.get_physical_device_calibrateable_time_domains(physical) }
        .context("Vulkan cannot list the device's clocks")?;
    Ok(cfg!(unix) && domains.contains(&HOST) && domains.contains(&vk::TimeDomainEXT::DEVICE))
}

impl DeviceClock {
    /// Of a device on which the extension is on.
    pub(super) fn new(instance: &ash::Instance, device: &ash::Device) -> DeviceClock {
        DeviceClock { functions: ext::calibrated_timestamps::Device::new(instance, device) }
    }

    /// Both clocks now, without touching the heap. None where the driver does not tell.
    pub(super) fn read(&self) -> Option<Calibration> {
        let info = |domain| vk::CalibratedTimestampInfoEXT::default().time_domain(domain);
        let infos = [info(vk::TimeDomainEXT::DEVICE), info(HOST)];
        let (mut times, mut deviation) = ([0; 2], 0);
        let (device, read) = (self.functions.device(), self.functions.fp().get_calibrated_timestamps_ext);
        // SAFETY: the extension is on, the device alive, and there is room for both times.
        let result = unsafe {
            read(device, infos.len() as u32, infos.as_ptr(), times.as_mut_ptr(), &raw mut deviation)
        };
        let [ticks, ns] = times;
        (result == vk::Result::SUCCESS).then_some(Calibration { ticks, ns })
    }
}
