//! The application's Vulkan instance and device, made for it through `XR_KHR_vulkan_enable2` or its own through
//! `XR_KHR_vulkan_enable`. Only Vulkan 1.0 functions are used, so that any application's device will do.
#![allow(unsafe_code, reason = "Vulkan is an unsafe C interface")]

use ash::vk;
use openxr::sys::{self, platform};

use super::fault::{Fault, Outcome, misuse, refusal};

/// The application's VkInstance, and how to reach its functions.
pub struct KnownInstance {
    pub handle: vk::Instance,
    pub functions: ash::Instance,
    loader: vk::PFN_vkGetInstanceProcAddr,
    /// Keeps the Vulkan loader loaded when the runtime had to find it by itself.
    pub library: Option<ash::Entry>,
}

/// The application's VkDevice.
#[derive(Clone)]
pub struct KnownDevice {
    pub handle: vk::Device,
    pub physical: vk::PhysicalDevice,
    /// Family and count of the queues it was made with.
    pub queues: Vec<(u32, u32)>,
}

/// A Vulkan call that failed, as OpenXR tells it.
pub fn failed(what: &str, result: vk::Result) -> Fault {
    let code = match result {
        vk::Result::ERROR_OUT_OF_HOST_MEMORY | vk::Result::ERROR_OUT_OF_DEVICE_MEMORY => {
            sys::Result::ERROR_OUT_OF_MEMORY
        }
        _ => sys::Result::ERROR_RUNTIME_FAILURE,
    };
    refusal(code, format!("{what} failed: {result}"))
}

/// Calls the application's `vkCreateInstance` with its own create info.
///
/// # Safety
/// `loader` is a `vkGetInstanceProcAddr`; `info` and `allocator` are what `vkCreateInstance` may be given.
pub unsafe fn create_instance(
    loader: platform::VkGetInstanceProcAddr,
    info: *const platform::VkInstanceCreateInfo,
    allocator: *const platform::VkAllocationCallbacks,
) -> Outcome<Result<KnownInstance, vk::Result>> {
    // SAFETY: both are the C type of vkGetInstanceProcAddr; vk::Instance is a transparent pointer.
    let loader: vk::PFN_vkGetInstanceProcAddr = unsafe { std::mem::transmute(loader) };
    // SAFETY: vkCreateInstance may be asked for with a null instance.
    let found = unsafe { loader(vk::Instance::null(), c"vkCreateInstance".as_ptr()) };
    let Some(found) = found else {
        return Err(misuse(
            sys::Result::ERROR_VALIDATION_FAILURE,
            "pfnGetInstanceProcAddr does not know vkCreateInstance",
        ));
    };
    // SAFETY: the loader returned it under this name.
    let create: vk::PFN_vkCreateInstance = unsafe { std::mem::transmute(found) };
    let mut handle = vk::Instance::null();
    // SAFETY: the caller vouches for the create info and the allocator.
    let result = unsafe { create(info.cast(), allocator.cast(), &mut handle) };
    if result != vk::Result::SUCCESS {
        return Ok(Err(result));
    }
    let functions = ash::StaticFn { get_instance_proc_addr: loader };
    // SAFETY: the instance was just made through this loader.
    let functions = unsafe { ash::Instance::load(&functions, handle) };
    Ok(Ok(KnownInstance { handle, functions, loader, library: None }))
}

impl KnownInstance {
    /// An instance that the application has made by itself. Vulkan has no way to verify such a handle.
    ///
    /// # Safety
    /// The handle is of a living VkInstance.
    pub unsafe fn adopt(handle: vk::Instance) -> Outcome<Self> {
        // SAFETY: the application has made an instance, so the loader is in the process and sound.
        let library = unsafe { ash::Entry::load() }.map_err(|error| {
            refusal(
                sys::Result::ERROR_RUNTIME_FAILURE,
                format!("the Vulkan loader cannot be loaded: {error}"),
            )
        })?;
        // SAFETY: the caller's promise.
        let functions = unsafe { ash::Instance::load(library.static_fn(), handle) };
        let loader = library.static_fn().get_instance_proc_addr;
        Ok(Self { handle, functions, loader, library: Some(library) })
    }

    /// The queues that a device of the application's own can have: all there are.
    pub fn adopt_device(&self, physical: vk::PhysicalDevice, handle: vk::Device) -> KnownDevice {
        // SAFETY: the physical device is one that `choose_device` gave.
        let families = unsafe { self.functions.get_physical_device_queue_family_properties(physical) };
        let queues = (0..).zip(families).map(|(family, is)| (family, is.queue_count)).collect();
        KnownDevice { handle, physical, queues }
    }

    /// The device a headset hangs on: a discrete GPU before an integrated one before the rest, the first of these for 0.
    pub fn choose_device(&self, nth: u32) -> Outcome<vk::PhysicalDevice> {
        // SAFETY: the application keeps its instance alive while it asks about it.
        let mut devices = unsafe { self.functions.enumerate_physical_devices() }
            .map_err(|result| failed("vkEnumeratePhysicalDevices", result))?;
        devices.sort_by_key(|device| {
            // SAFETY: the device comes from this instance.
            let properties = unsafe { self.functions.get_physical_device_properties(*device) };
            match properties.device_type {
                vk::PhysicalDeviceType::DISCRETE_GPU => 0,
                vk::PhysicalDeviceType::INTEGRATED_GPU => 1,
                vk::PhysicalDeviceType::VIRTUAL_GPU => 2,
                _ => 3,
            }
        });
        let chosen = (nth as usize).checked_rem(devices.len()).map(|i| devices[i]);
        chosen.ok_or_else(|| refusal(sys::Result::ERROR_RUNTIME_FAILURE, "Vulkan offers no physical device"))
    }

    /// Calls the application's `vkCreateDevice` with its own create info.
    ///
    /// # Safety
    /// `info` and `allocator` are what `vkCreateDevice` may be given for a device of this instance.
    pub unsafe fn create_device(
        &self,
        physical: vk::PhysicalDevice,
        info: *const platform::VkDeviceCreateInfo,
        allocator: *const platform::VkAllocationCallbacks,
    ) -> Outcome<Result<KnownDevice, vk::Result>> {
        // SAFETY: the instance is the loader's own.
        let found = unsafe { (self.loader)(self.handle, c"vkCreateDevice".as_ptr()) };
        let Some(found) = found else {
            return Err(misuse(
                sys::Result::ERROR_VALIDATION_FAILURE,
                "pfnGetInstanceProcAddr does not know vkCreateDevice",
            ));
        };
        // SAFETY: the loader returned it under this name.
        let create: vk::PFN_vkCreateDevice = unsafe { std::mem::transmute(found) };
        let mut handle = vk::Device::null();
        // SAFETY: the caller vouches for the create info and the allocator.
        let result = unsafe { create(physical, info.cast(), allocator.cast(), &mut handle) };
        if result != vk::Result::SUCCESS {
            return Ok(Err(result));
        }
        // SAFETY: vkCreateDevice accepted the create info, so it is one, with its queue infos.
        let queues = unsafe {
            let info = &*info.cast::<vk::DeviceCreateInfo<'_>>();
            std::slice::from_raw_parts(info.p_queue_create_infos, info.queue_create_info_count as usize)
        };
        Ok(Ok(KnownDevice {
            handle,
            physical,
            queues: queues.iter().map(|queue| (queue.queue_family_index, queue.queue_count)).collect(),
        }))
    }
}

/// The raw pointer of a Vulkan dispatchable handle, as OpenXR passes it.
pub fn to_pointer<H: vk::Handle>(handle: H) -> *const std::ffi::c_void {
    handle.as_raw() as *const std::ffi::c_void
}

/// A Vulkan dispatchable handle from the raw pointer OpenXR passes.
pub fn from_pointer<H: vk::Handle>(pointer: *const std::ffi::c_void) -> H {
    H::from_raw(pointer as u64)
}
