//! The application's Vulkan: what it makes itself, and what the runtime makes for it.
#![allow(unsafe_code, reason = "raw Vulkan, and raw calls of the runtime")]
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

use std::{
    ffi::{CStr, c_void},
    mem,
    ptr::{self, null},
    sync::{Arc, Mutex, PoisonError},
};

use ash::vk::{self, Handle as _};
use fathomless::mock::Mock;
use openxr as xr;
use xr::sys::{self, Result as R};

use crate::{Kind::Instance, Run, config};

const VALIDATION: &CStr = c"VK_LAYER_KHRONOS_validation";

/// What the validation layers have said so far.
static MESSAGES: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// A Vulkan instance and a device with one queue.
pub struct Vulkan {
    pub instance: ash::Instance,
    pub physical: vk::PhysicalDevice,
    pub device: ash::Device,
    pub family: u32,
    entry: ash::Entry,
    messenger: Option<(ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT)>,
}

impl Vulkan {
    /// Made by the application itself, once: sequences cannot break it.
    pub fn new() -> Self {
        // SAFETY: ordinary Vulkan, destroyed in `drop`.
        unsafe {
            let entry =
                ash::Entry::load().expect("no Vulkan loader: install libvulkan1 and mesa-vulkan-drivers");
            let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_0);
            let info = vk::InstanceCreateInfo::default().application_info(&application);
            let instance = entry.create_instance(&info, None).unwrap();
            let physical = preferred_device(&instance);
            let family = graphics_family(&instance, physical);
            let priorities = [1.0];
            let queues = [vk::DeviceQueueCreateInfo::default()
                .queue_family_index(family)
                .queue_priorities(&priorities)];
            let info = vk::DeviceCreateInfo::default().queue_create_infos(&queues);
            let device = instance.create_device(physical, &info, None).unwrap();
            Self { instance, physical, device, family, entry, messenger: None }
        }
    }

    pub fn messages() -> Vec<String> {
        MESSAGES.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Drop for Vulkan {
    fn drop(&mut self) {
        // SAFETY: all sessions are gone.
        unsafe {
            self.device.destroy_device(None);
            if let Some((functions, messenger)) = self.messenger.take() {
                functions.destroy_debug_utils_messenger(messenger, None);
            }
            self.instance.destroy_instance(None);
        }
    }
}

fn graphics_family(instance: &ash::Instance, physical: vk::PhysicalDevice) -> u32 {
    // SAFETY: a physical device of a living instance.
    let families = unsafe { instance.get_physical_device_queue_family_properties(physical) };
    families.iter().position(|it| it.queue_flags.contains(vk::QueueFlags::GRAPHICS)).unwrap() as u32
}

/// What the runtime would choose.
fn preferred_device(instance: &ash::Instance) -> vk::PhysicalDevice {
    let mock = Mock::new(config());
    let entry = mock.entry().unwrap();
    let mut wanted = xr::ExtensionSet::default();
    wanted.khr_vulkan_enable = true;
    let info = xr::ApplicationInfo { application_name: "chooser", ..Default::default() };
    let chooser = entry.create_instance(&info, &wanted, &[], &()).unwrap();
    let system = chooser.system(xr::FormFactor::HEAD_MOUNTED_DISPLAY).unwrap();
    // SAFETY: the VkInstance is alive.
    let chosen = unsafe { chooser.vulkan_graphics_device(system, instance.handle().as_raw() as _) }.unwrap();
    vk::PhysicalDevice::from_raw(chosen as u64)
}

unsafe extern "system" fn on_message(
    _: vk::DebugUtilsMessageSeverityFlagsEXT,
    _: vk::DebugUtilsMessageTypeFlagsEXT,
    data: *const vk::DebugUtilsMessengerCallbackDataEXT<'_>,
    _: *mut c_void,
) -> vk::Bool32 {
    // SAFETY: Vulkan gives a valid message.
    let text = unsafe { (*data).message_as_c_str() }.unwrap_or(c"").to_string_lossy().into_owned();
    MESSAGES.lock().unwrap_or_else(PoisonError::into_inner).push(text);
    vk::FALSE
}

impl Run<'_> {
    /// A session on Vulkan that the runtime has made, and what pictures need. It gets as far as the instance's
    /// extensions let it.
    pub fn begin_with_pictures(&mut self, validate: bool) {
        for name in ["xrCreateInstance", "xrGetSystem", "xrGetSystem", "xrGetVulkanGraphicsRequirements2KHR"]
        {
            self.step(name);
        }
        if let Some(vulkan) = self.make_vulkan(validate) {
            self.vulkan = Arc::new(vulkan);
        }
        for name in [
            "xrCreateSession",
            "xrCreateSession",
            "xrPollEvent",
            "xrPollEvent",
            "xrPollEvent",
            "xrPollEvent",
            "xrBeginSession",
            "xrCreateReferenceSpace",
            "xrCreateSwapchain",
            "xrAcquireSwapchainImage",
            "xrWaitSwapchainImage",
            "xrReleaseSwapchainImage",
        ] {
            self.step(name);
        }
    }

    /// Vulkan as the runtime makes it for the newest instance; `None` where that has not the extension.
    fn make_vulkan(&mut self, validate: bool) -> Option<Vulkan> {
        let instance = self.living.iter().rfind(|it| it.kind == Instance)?.raw;
        let entry = self.vulkan.entry.clone();
        let loader = entry.static_fn().get_instance_proc_addr;
        // SAFETY: the same C function type under two names.
        let loader: sys::platform::VkGetInstanceProcAddr = unsafe { mem::transmute(loader) };
        let system_id = sys::SystemId::from_raw(self.system);
        // SAFETY: no instance is needed to ask.
        let layers = unsafe { entry.enumerate_instance_layer_properties() }.unwrap();
        let validated = validate && layers.iter().any(|it| it.layer_name_as_c_str() == Ok(VALIDATION));
        let (layers, extensions) = ([VALIDATION.as_ptr()], [vk::EXT_DEBUG_UTILS_NAME.as_ptr()]);
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_0);
        let mut wanted = vk::InstanceCreateInfo::default().application_info(&application);
        if validated {
            wanted = wanted.enabled_layer_names(&layers).enabled_extension_names(&extensions);
        }
        let info = sys::VulkanInstanceCreateInfoKHR {
            ty: sys::VulkanInstanceCreateInfoKHR::TYPE,
            next: null(),
            system_id,
            create_flags: sys::VulkanInstanceCreateFlagsKHR::EMPTY,
            pfn_get_instance_proc_addr: Some(loader),
            vulkan_create_info: (&raw const wanted).cast(),
            vulkan_allocator: null(),
        };
        let (mut made, mut result) = (0u64, vk::Result::NOT_READY.as_raw());
        let places =
            |made: &mut u64, result: &mut i32| [ptr::from_mut(made) as u64, ptr::from_mut(result) as u64];
        let [out, code] = places(&mut made, &mut result);
        if self.call("xrCreateVulkanInstanceKHR", &[instance, (&raw const info) as u64, out, code])
            != R::SUCCESS
        {
            return None;
        }
        assert_eq!(result, vk::Result::SUCCESS.as_raw());
        // SAFETY: the runtime has just made it.
        let vk_instance = unsafe { ash::Instance::load(entry.static_fn(), vk::Instance::from_raw(made)) };
        let messenger = validated.then(|| listen(&entry, &vk_instance));
        let get = sys::VulkanGraphicsDeviceGetInfoKHR {
            ty: sys::VulkanGraphicsDeviceGetInfoKHR::TYPE,
            next: null(),
            system_id,
            vulkan_instance: made as _,
        };
        let mut chosen = 0u64;
        let arguments = [instance, (&raw const get) as u64, (&raw mut chosen) as u64];
        assert_eq!(self.call("xrGetVulkanGraphicsDevice2KHR", &arguments), R::SUCCESS);
        let physical = vk::PhysicalDevice::from_raw(chosen);
        let family = graphics_family(&vk_instance, physical);
        let priorities = [1.0];
        let queues =
            [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&priorities)];
        let wanted = vk::DeviceCreateInfo::default().queue_create_infos(&queues);
        let info = sys::VulkanDeviceCreateInfoKHR {
            ty: sys::VulkanDeviceCreateInfoKHR::TYPE,
            next: null(),
            system_id,
            create_flags: sys::VulkanDeviceCreateFlagsKHR::EMPTY,
            pfn_get_instance_proc_addr: Some(loader),
            vulkan_physical_device: chosen as _,
            vulkan_create_info: (&raw const wanted).cast(),
            vulkan_allocator: null(),
        };
        let [out, code] = places(&mut made, &mut result);
        let arguments = [instance, (&raw const info) as u64, out, code];
        assert_eq!(self.call("xrCreateVulkanDeviceKHR", &arguments), R::SUCCESS);
        // SAFETY: the runtime has just made it.
        let device = unsafe { ash::Device::load(vk_instance.fp_v1_0(), vk::Device::from_raw(made)) };
        Some(Vulkan { instance: vk_instance, physical, device, family, entry, messenger })
    }
}

fn listen(
    entry: &ash::Entry,
    instance: &ash::Instance,
) -> (ash::ext::debug_utils::Instance, vk::DebugUtilsMessengerEXT) {
    use vk::{DebugUtilsMessageSeverityFlagsEXT as Severity, DebugUtilsMessageTypeFlagsEXT as Types};
    let functions = ash::ext::debug_utils::Instance::new(entry, instance);
    let info = vk::DebugUtilsMessengerCreateInfoEXT::default()
        .message_severity(Severity::WARNING | Severity::ERROR)
        .message_type(Types::VALIDATION | Types::PERFORMANCE)
        .pfn_user_callback(Some(on_message));
    // SAFETY: the extension is enabled.
    let messenger = unsafe { functions.create_debug_utils_messenger(&info, None) }.unwrap();
    (functions, messenger)
}
