//! The instance, the device and its queues.
#![allow(unsafe_code, reason = "calls Vulkan")]

use std::ffi::{CStr, CString, c_char};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;

use anyhow::{Context, Result};
use ash::{ext, khr, vk};

use super::bootstrap::{Bootstrap, Offer, lacking, text};
use super::clock::{self, DeviceClock};
use super::commands::Commands;
use super::frames::{Lost, SemaphoreAt};
use super::instance::Instance;
use super::memory::Memory;
use super::shelf::Shelf;
use super::validation::{ValidationLog, ValidationReport};

/// How long [`Gpu::run`] waits: a software driver may need its time for a whole test's work.
const RUN_TIMEOUT: Duration = Duration::from_secs(60);

/// How to make a [`Gpu`].
#[derive(Debug, Clone, Copy, Default)]
pub struct GpuConfig {
    /// Turn on the validation layer (core and synchronisation) and count what it says.
    pub validate: bool,
}

/// What the device is and can do.
#[derive(Debug, Clone)]
pub struct DeviceInfo {
    /// Name of the device, e.g. `llvmpipe (LLVM 15.0.6, 256 bits)`.
    pub name: String,
    /// Name of the driver, e.g. `llvmpipe`.
    pub driver: String,
    /// Version of the driver in its own words, e.g. `Mesa 22.3.6 (LLVM 15.0.6)`.
    pub driver_version: String,
    /// Vulkan version of the device, e.g. `1.3.230`.
    pub api_version: String,
    /// PCI vendor, or a Khronos number for those without one.
    pub vendor: u32,
    /// Drawn by the processor: everything is hundreds of times slower.
    pub software: bool,
    /// Both eyes can be drawn in one pass, and should be. False on software drivers even if they offer it: it is no
    /// faster there, and Mesa's llvmpipe (seen in 22.3.6) draws the triangles that need clipping into the wrong layer.
    pub multiview: bool,
    /// The device offers multiview, and it is on.
    pub multiview_offered: bool,
    /// Several draws fit one indirect call.
    pub multi_draw_indirect: bool,
    /// Indirect draws may start at an instance other than 0.
    pub draw_indirect_first_instance: bool,
    /// Nanoseconds per timestamp tick.
    pub timestamp_period_ns: f64,
    /// Meaningful bits of a timestamp; 0: the device has no clock.
    pub timestamp_bits: u32,
    /// Samples that a pixel of a colour and of a depth attachment may have.
    pub sample_counts: vk::SampleCountFlags,
    /// Samples are resolved to the layers of the view that is given for it. False on software drivers: Mesa's llvmpipe
    /// (seen in 22.3.6) resolves to the first layers of its image instead.
    pub resolves_to_layers: bool,
    /// How the samples of a pixel's depth become one where they are resolved: MAX, else SAMPLE_ZERO, which all devices
    /// can.
    pub depth_resolve: vk::ResolveModeFlags,
    /// Vulkan's limits.
    pub limits: vk::PhysicalDeviceLimits,
}

/// The device, its queues and its memory. Everything made from it holds an [`Arc`] of it, so it goes last.
pub struct Gpu {
    /// The instance, for whoever makes surfaces or OpenXR sessions.
    pub instance: ash::Instance,
    /// The device chosen.
    pub physical: vk::PhysicalDevice,
    /// The logical device.
    pub device: ash::Device,
    /// Family of all queues. All work but that of windows goes to the one of index 0.
    pub queue_family: u32,
    /// What the device is.
    pub info: DeviceInfo,
    /// Vulkan can draw to windows of the platform that was asked for.
    pub(super) has_surfaces: bool,
    pub(super) memory: Memory,
    pub(super) debug: Option<ext::debug_utils::Device>,
    /// Where the device's clock can be compared to the processor's.
    pub(super) clock: Option<DeviceClock>,
    /// Draw calls recorded so far.
    pub(super) draws: AtomicU64,
    /// Shaders that take the place of built-in ones.
    pub(super) shelf: OnceLock<&'static Shelf>,
    queue: Mutex<vk::Queue>,
    /// A second queue, where the family has one: who shows pictures in a window may be held up by the window.
    window_queue: Option<Mutex<vk::Queue>>,
    /// A wait timed out: the GPU may still be at work, so nothing may be destroyed any more.
    abandoned: AtomicBool,
    owner: Instance,
}

impl Gpu {
    /// Opens the device that `boot` gives.
    ///
    /// # Errors
    /// A sentence that says what to install or update: no loader, driver, device or layer, or one too old.
    pub fn new(boot: &dyn Bootstrap, config: &GpuConfig) -> Result<Arc<Self>> {
        Self::presenting(boot, config, None)
    }

    /// The same, ready to show pictures in windows of a platform, whose extension `surface` names
    /// ([`surface_extension`](super::surface_extension)), as far as Vulkan can do that here.
    ///
    /// # Errors
    /// As [`Gpu::new`].
    pub fn presenting(
        boot: &dyn Bootstrap,
        config: &GpuConfig,
        surface: Option<&'static CStr>,
    ) -> Result<Arc<Self>> {
        let owner = Instance::new(boot, config.validate, surface)?;
        let instance = owner.raw.clone();
        let physical = boot.physical_device(&instance)?;
        let offer = Offer::of(&instance, physical);
        let info = describe(&instance, physical, &offer);
        let Some(queue_family) = offer.queue_family.filter(|_| offer.lacks.is_empty()) else {
            return Err(lacking(&info.name, &offer.lacks));
        };
        let has_surfaces = owner.surfaces && has_extension(&instance, physical, khr::swapchain::NAME)?;
        let queues = if has_surfaces { offer.queue_count.min(2) } else { 1 };
        let calibrates = has_extension(&instance, physical, ext::calibrated_timestamps::NAME)?
            && clock::offered(&owner.entry, &instance, physical)?;
        let extras = Extras { has_surfaces, calibrates, queues };
        let device = create_device(boot, &instance, physical, &offer, extras)?;
        // SAFETY: the device was made with so many queues of this family.
        let queue = |index| Mutex::new(unsafe { device.get_device_queue(queue_family, index) });
        let (queue, window_queue) = (queue(0), (queues > 1).then(|| queue(1)));
        let debug = owner.names.then(|| ext::debug_utils::Device::new(&instance, &device));
        let clock = calibrates.then(|| DeviceClock::new(&instance, &device));
        let memory = match Memory::new(&instance, physical, &device) {
            Ok(memory) => memory,
            Err(error) => {
                // SAFETY: nothing was made from the device yet.
                unsafe { device.destroy_device(None) };
                return Err(error);
            }
        };
        tracing::info!(
            device = info.name,
            driver = info.driver_version,
            vulkan = info.api_version,
            "GPU opened"
        );
        Ok(Arc::new(Self {
            instance,
            physical,
            device,
            queue_family,
            info,
            has_surfaces,
            memory,
            debug,
            clock,
            draws: AtomicU64::new(0),
            shelf: OnceLock::new(),
            queue,
            window_queue,
            abandoned: AtomicBool::new(false),
            owner,
        }))
    }

    /// The loader, for functions of extensions.
    pub(super) fn entry(&self) -> &ash::Entry {
        &self.owner.entry
    }

    /// What the validation layers have said so far; always empty without `validate`.
    pub fn validation(&self) -> ValidationReport {
        self.owner.log.report()
    }

    /// The counter behind [`Gpu::validation`], to be read after the device is gone (leaks are found at the end).
    pub fn validation_log(&self) -> Arc<ValidationLog> {
        Arc::clone(&self.owner.log)
    }

    /// Runs `f` with the queue locked. An OpenXR runtime may touch the queue in begin_frame, end_frame, acquire and
    /// release: hold this lock round those. Not reentrant: `f` must neither submit nor [`run`](Gpu::run).
    pub fn with_queue<R>(&self, f: impl FnOnce(vk::Queue) -> R) -> R {
        self.with_lane(Lane::Main, f)
    }

    /// The same for a lane. That for windows is the main one where the device has no second queue.
    pub(super) fn with_lane<R>(&self, lane: Lane, f: impl FnOnce(vk::Queue) -> R) -> R {
        let queue = match (lane, &self.window_queue) {
            (Lane::Window, Some(queue)) => queue,
            _ => &self.queue,
        };
        f(*queue.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Waits until a timeline has come so far; false where it takes longer than `timeout`.
    pub(super) fn wait_for(&self, at: &SemaphoreAt, timeout: Duration) -> Result<bool, vk::Result> {
        let (semaphores, values) = ([at.semaphore], [at.value]);
        let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
        // SAFETY: the semaphore is alive.
        match unsafe { self.device.wait_semaphores(&info, nanoseconds(timeout)) } {
            Ok(()) => Ok(true),
            Err(vk::Result::TIMEOUT) => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// From now on programs are made of the texts on this shelf, as far as it has any, instead of those that are built in. The
    /// first shelf stays.
    pub fn read_shaders_from(&self, shelf: &'static Shelf) {
        self.shelf.get_or_init(|| shelf);
    }

    /// Draw calls recorded so far, by all frames.
    pub fn draws(&self) -> u64 {
        self.draws.load(Ordering::Relaxed)
    }

    /// Bytes of live buffers and images.
    pub fn memory_bytes(&self) -> u64 {
        self.memory.used()
    }

    /// Bytes held from the driver for them, in blocks.
    pub fn memory_reserved_bytes(&self) -> u64 {
        self.memory.reserved()
    }

    /// Records, submits and waits: uploads, read-back and tests. What it wrote is visible to the host and to
    /// every later command. Not for frames: it stalls and allocates.
    ///
    /// # Errors
    /// [`Lost`] when the device is lost or does not finish within a minute.
    pub fn run<R>(&self, record: impl FnOnce(Commands<'_>) -> R) -> Result<R, Lost> {
        let lost = |result| Lost::Device { result, pass: "run" };
        let pool_info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(self.queue_family)
            .flags(vk::CommandPoolCreateFlags::TRANSIENT);
        // SAFETY: plain creation on a live device; both are destroyed below, after the wait.
        let pool = unsafe { self.device.create_command_pool(&pool_info, None) }.map_err(lost)?;
        // SAFETY: as above.
        let fence = unsafe { self.device.create_fence(&vk::FenceCreateInfo::default(), None) };
        let result = fence.map_err(lost).and_then(|fence| {
            let result = self.record_and_wait(pool, fence, record);
            // SAFETY: the fence is idle, or the device is abandoned and `destroy` does nothing.
            self.destroy(|device| unsafe { device.destroy_fence(fence, None) });
            result
        });
        // SAFETY: as for the fence.
        self.destroy(|device| unsafe { device.destroy_command_pool(pool, None) });
        result
    }

    fn record_and_wait<R>(
        &self,
        pool: vk::CommandPool,
        fence: vk::Fence,
        record: impl FnOnce(Commands<'_>) -> R,
    ) -> Result<R, Lost> {
        let lost = |result| Lost::Device { result, pass: "run" };
        let buffer_info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the pool is ours alone; recorded once and submitted once.
        let raw = unsafe { self.device.allocate_command_buffers(&buffer_info) }.map_err(lost)?[0];
        // SAFETY: as above.
        unsafe { self.device.begin_command_buffer(raw, &begin) }.map_err(lost)?;
        let commands = Commands::new(self, raw);
        commands.wait_for_everything();
        let value = record(commands);
        commands.wait_for_everything();
        // SAFETY: the buffer is being recorded.
        unsafe { self.device.end_command_buffer(raw) }.map_err(lost)?;
        let infos = [vk::CommandBufferSubmitInfo::default().command_buffer(raw)];
        let submits = [vk::SubmitInfo2::default().command_buffer_infos(&infos)];
        // SAFETY: the queue is locked, the fence unsignalled, the buffer recorded.
        self.with_queue(|queue| unsafe { self.device.queue_submit2(queue, &submits, fence) })
            .map_err(lost)?;
        // SAFETY: the fence was submitted.
        match unsafe { self.device.wait_for_fences(&[fence], true, nanoseconds(RUN_TIMEOUT)) } {
            Ok(()) => Ok(value),
            Err(vk::Result::TIMEOUT) => {
                self.abandon();
                Err(Lost::DeviceHang { pass: "run", seconds: RUN_TIMEOUT.as_secs_f64() })
            }
            Err(result) => Err(lost(result)),
        }
    }

    /// Gives a Vulkan object a name that validation messages and captures show.
    pub fn name(&self, object: impl vk::Handle, name: &str) {
        let Some(debug) = &self.debug else { return };
        let Ok(name) = CString::new(name) else { return };
        let info = vk::DebugUtilsObjectNameInfoEXT::default().object_handle(object).object_name(&name);
        // SAFETY: the object is alive, of this device and used by the caller alone.
        if let Err(error) = unsafe { debug.set_debug_utils_object_name(&info) } {
            tracing::debug!("cannot name an object: {error}");
        }
    }

    /// Frees something, unless the GPU hangs and may still be using it: then it is leaked.
    pub(super) fn destroy(&self, free: impl FnOnce(&ash::Device)) {
        if !self.abandoned.load(Ordering::Relaxed) {
            free(&self.device);
        }
    }

    /// The GPU did not answer in time: from now on nothing of it is destroyed.
    pub(super) fn abandon(&self) {
        self.abandoned.store(true, Ordering::Relaxed);
    }
}

impl Drop for Gpu {
    fn drop(&mut self) {
        if self.abandoned.load(Ordering::Relaxed) {
            self.memory.leak();
            self.owner.leak = true;
            return;
        }
        self.memory.close();
        // SAFETY: everything made from the device holds an `Arc` of this, so all of it is gone and the queue is idle.
        unsafe { self.device.destroy_device(None) };
    }
}

/// Where work is submitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Lane {
    /// The queue of the eyes' pictures.
    Main,
    /// The queue of what is shown in windows.
    Window,
}

/// A duration as Vulkan counts it.
pub(super) fn nanoseconds(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}

/// Extensions that are switched on beside what is needed.
#[derive(Clone, Copy)]
struct Extras {
    has_surfaces: bool,
    calibrates: bool,
    queues: u32,
}

fn create_device(
    boot: &dyn Bootstrap,
    instance: &ash::Instance,
    physical: vk::PhysicalDevice,
    offer: &Offer,
    extras: Extras,
) -> Result<ash::Device> {
    let mut extensions: Vec<*const c_char> = Vec::new();
    if extras.has_surfaces {
        extensions.push(khr::swapchain::NAME.as_ptr());
    }
    if extras.calibrates {
        extensions.push(ext::calibrated_timestamps::NAME.as_ptr());
    }
    // The eyes' pictures come before the window's.
    let priorities = &[1.0, 0.0][..extras.queues as usize];
    let queues = [vk::DeviceQueueCreateInfo::default()
        .queue_family_index(offer.queue_family.context("the device has no queue for graphics and compute")?)
        .queue_priorities(priorities)];
    let core = vk::PhysicalDeviceFeatures::default()
        .multi_draw_indirect(offer.multi_draw_indirect)
        .draw_indirect_first_instance(offer.draw_indirect_first_instance);
    let mut v11 = vk::PhysicalDeviceVulkan11Features::default().multiview(offer.multiview);
    // Not in one VkPhysicalDeviceVulkan12Features: an OpenXR runtime that wants timeline semaphores too (Monado 25) looks
    // for this structure alone, and adds its own beside that other one, which is not allowed.
    let mut timeline = vk::PhysicalDeviceTimelineSemaphoreFeatures::default().timeline_semaphore(true);
    let mut reset = vk::PhysicalDeviceHostQueryResetFeatures::default().host_query_reset(true);
    let mut v13 = vk::PhysicalDeviceVulkan13Features::default()
        .dynamic_rendering(true)
        .synchronization2(true)
        .maintenance4(true);
    let mut features = vk::PhysicalDeviceFeatures2::default().features(core);
    let info = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_extension_names(&extensions)
        .push_next(&mut v13)
        .push_next(&mut timeline)
        .push_next(&mut reset)
        .push_next(&mut v11)
        .push_next(&mut features);
    let handle = boot.create_device(instance, physical, &info)?;
    // SAFETY: the handle was just made from this instance.
    Ok(unsafe { ash::Device::load(instance.fp_v1_0(), handle) })
}

fn has_extension(instance: &ash::Instance, physical: vk::PhysicalDevice, name: &CStr) -> Result<bool> {
    // SAFETY: `physical` is of this instance.
    let offered = unsafe { instance.enumerate_device_extension_properties(physical) }
        .context("Vulkan cannot list the device's extensions")?;
    Ok(offered.iter().any(|extension| extension.extension_name_as_c_str() == Ok(name)))
}

/// The nearest surface of reversed depth where that can be had: what mixes a near surface with a far one moves with the near
/// one when a runtime reprojects the picture, so that silhouettes keep their edges (as anti-aliasing over time takes the
/// nearest pixel's motion; Karis 2014). Else the depth of one sample: a mean would be the depth of nothing.
fn depth_resolve(offered: vk::ResolveModeFlags) -> vk::ResolveModeFlags {
    match offered.contains(vk::ResolveModeFlags::MAX) {
        true => vk::ResolveModeFlags::MAX,
        false => vk::ResolveModeFlags::SAMPLE_ZERO,
    }
}

pub(super) fn describe(instance: &ash::Instance, physical: vk::PhysicalDevice, offer: &Offer) -> DeviceInfo {
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut resolve = vk::PhysicalDeviceDepthStencilResolveProperties::default();
    let mut properties = vk::PhysicalDeviceProperties2::default();
    // SAFETY: `physical` is of this instance.
    let version = unsafe { instance.get_physical_device_properties(physical) }.api_version;
    if version >= vk::API_VERSION_1_2 {
        properties = properties.push_next(&mut driver).push_next(&mut resolve);
    }
    // SAFETY: as above, and a device of 1.2 knows the structures chained here.
    unsafe { instance.get_physical_device_properties2(physical, &mut properties) };
    let core = properties.properties;
    // SAFETY: as above.
    let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
    let family = offer.queue_family.and_then(|index| families.get(index as usize));
    let software = core.device_type == vk::PhysicalDeviceType::CPU;
    DeviceInfo {
        name: text(core.device_name_as_c_str().unwrap_or_default()),
        driver: text(driver.driver_name_as_c_str().unwrap_or_default()),
        driver_version: text(driver.driver_info_as_c_str().unwrap_or_default()),
        api_version: format!(
            "{}.{}.{}",
            vk::api_version_major(version),
            vk::api_version_minor(version),
            vk::api_version_patch(version)
        ),
        vendor: core.vendor_id,
        software,
        multiview: offer.multiview && !software,
        multiview_offered: offer.multiview,
        multi_draw_indirect: offer.multi_draw_indirect,
        draw_indirect_first_instance: offer.draw_indirect_first_instance,
        timestamp_period_ns: f64::from(core.limits.timestamp_period),
        timestamp_bits: family.map_or(0, |family| family.timestamp_valid_bits),
        sample_counts: core.limits.framebuffer_color_sample_counts
            & core.limits.framebuffer_depth_sample_counts,
        resolves_to_layers: !software,
        depth_resolve: depth_resolve(resolve.supported_depth_resolve_modes),
        limits: core.limits,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_is_resolved_to_the_depth_of_a_surface() {
        use vk::ResolveModeFlags as Modes;
        let all = Modes::SAMPLE_ZERO | Modes::AVERAGE | Modes::MIN | Modes::MAX;
        assert_eq!(depth_resolve(all), Modes::MAX);
        assert_eq!(depth_resolve(Modes::SAMPLE_ZERO | Modes::AVERAGE), Modes::SAMPLE_ZERO);
    }
}
