//! The application's Vulkan instance and device: made by the runtime (`XR_KHR_vulkan_enable2`), or by the application
//! itself from what the runtime asks for (`XR_KHR_vulkan_enable`).
#![allow(unsafe_code, reason = "passes the application's create infos on to Vulkan")]

use std::{ffi::c_char, sync::Arc};

use openxr::sys::{self, platform};

use super::pointer::{In, Out, OutArray};
use crate::mock::{
    fault::{Outcome, misuse, require},
    state::{
        Shared,
        instance::{VULKAN_ENABLE, VULKAN_ENABLE2},
    },
    vulkan::{self, KnownInstance, from_pointer, to_pointer},
};

const OK: Outcome<sys::Result> = Ok(sys::Result::SUCCESS);

pub fn get_requirements(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    system: sys::SystemId,
    out: Out<sys::GraphicsRequirementsVulkanKHR>,
) -> Outcome<sys::Result> {
    tell_requirements(shared, handle, system, &out, VULKAN_ENABLE)
}

pub fn get_requirements2(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    system: sys::SystemId,
    out: Out<sys::GraphicsRequirementsVulkanKHR>,
) -> Outcome<sys::Result> {
    tell_requirements(shared, handle, system, &out, VULKAN_ENABLE2)
}

fn tell_requirements(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    system: sys::SystemId,
    out: &Out<sys::GraphicsRequirementsVulkanKHR>,
    extension: &'static str,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    let instance = state.instance_mut(handle)?;
    instance.check_enabled(extension)?;
    instance.check_system(system)?;
    out.check_typed()?;
    instance.requirements_asked.insert(extension);
    out.write(sys::GraphicsRequirementsVulkanKHR {
        ty: sys::GraphicsRequirementsVulkanKHR::TYPE,
        next: out.next(),
        min_api_version_supported: sys::Version::new(1, 0, 0),
        max_api_version_supported: sys::Version::new(1, 4, 0xFFFF),
    });
    OK
}

/// The Vulkan instance extensions the runtime needs: none.
pub fn get_instance_extensions(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    system: sys::SystemId,
    capacity: u32,
    count: Out<u32>,
    buffer: Out<c_char>,
) -> Outcome<sys::Result> {
    let state = shared.lock();
    let instance = state.instance(handle)?;
    instance.check_enabled(VULKAN_ENABLE)?;
    instance.check_system(system)?;
    OutArray { capacity, count, items: buffer }.fill_text("")?;
    OK
}

/// The Vulkan device extensions the runtime needs: none.
pub fn get_device_extensions(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    system: sys::SystemId,
    capacity: u32,
    count: Out<u32>,
    buffer: Out<c_char>,
) -> Outcome<sys::Result> {
    get_instance_extensions(shared, handle, system, capacity, count, buffer)
}

pub fn get_device_of(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    system: sys::SystemId,
    vulkan: platform::VkInstance,
    out: Out<platform::VkPhysicalDevice>,
) -> Outcome<sys::Result> {
    let state = shared.lock();
    let instance = state.instance(handle)?;
    instance.check_enabled(VULKAN_ENABLE)?;
    instance.check_system(system)?;
    out.check()?;
    require!(!vulkan.is_null(), ERROR_VALIDATION_FAILURE, "vkInstance is VK_NULL_HANDLE");
    // SAFETY: not null; a living VkInstance by the application's promise.
    let vulkan = unsafe { KnownInstance::adopt(from_pointer(vulkan)) }?;
    out.write(to_pointer(vulkan.choose_device(state.config.graphics_device)?));
    OK
}

pub fn create_vulkan_instance(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    info: In<sys::VulkanInstanceCreateInfoKHR>,
    out: Out<platform::VkInstance>,
    result: Out<platform::VkResult>,
) -> Outcome<sys::Result> {
    let info = {
        let state = shared.lock();
        let instance = state.instance(handle)?;
        instance.check_enabled(VULKAN_ENABLE2)?;
        let info = info.get()?;
        out.check()?;
        result.check()?;
        instance.check_system(info.system_id)?;
        require!(
            info.create_flags.is_empty() && !info.vulkan_create_info.is_null(),
            ERROR_VALIDATION_FAILURE,
            "createFlags must be 0 and vulkanCreateInfo not NULL"
        );
        info
    };
    let Some(loader) = info.pfn_get_instance_proc_addr else {
        return Err(misuse(sys::Result::ERROR_VALIDATION_FAILURE, "pfnGetInstanceProcAddr is NULL"));
    };
    // SAFETY: the structure is verified; what it points at is the caller's promise. The lock is not held, since
    // Vulkan may call back into the application.
    let made = unsafe { vulkan::create_instance(loader, info.vulkan_create_info, info.vulkan_allocator) }?;
    match made {
        Ok(known) => {
            result.write(ash::vk::Result::SUCCESS.as_raw());
            out.write(to_pointer(known.handle));
            let mut state = shared.lock();
            let instances = &mut state.instance_mut(handle)?.vulkan_instances;
            // A driver may give out the address of a destroyed instance again.
            instances.retain(|old| old.handle != known.handle);
            instances.push(known);
        }
        Err(code) => result.write(code.as_raw()),
    }
    OK
}

pub fn get_device(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    info: In<sys::VulkanGraphicsDeviceGetInfoKHR>,
    out: Out<platform::VkPhysicalDevice>,
) -> Outcome<sys::Result> {
    let state = shared.lock();
    let instance = state.instance(handle)?;
    instance.check_enabled(VULKAN_ENABLE2)?;
    let info = info.get()?;
    out.check()?;
    instance.check_system(info.system_id)?;
    let known = instance
        .vulkan_instances
        .iter()
        .find(|known| known.handle == from_pointer(info.vulkan_instance))
        .ok_or_else(unknown_instance)?;
    out.write(to_pointer(known.choose_device(state.config.graphics_device)?));
    OK
}

pub fn create_vulkan_device(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    info: In<sys::VulkanDeviceCreateInfoKHR>,
    out: Out<platform::VkDevice>,
    result: Out<platform::VkResult>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    let instance = state.instance(handle)?;
    instance.check_enabled(VULKAN_ENABLE2)?;
    let info = info.get()?;
    out.check()?;
    result.check()?;
    instance.check_system(info.system_id)?;
    require!(
        info.create_flags.is_empty()
            && !info.vulkan_create_info.is_null()
            && info.pfn_get_instance_proc_addr.is_some(),
        ERROR_VALIDATION_FAILURE,
        "createFlags must be 0, vulkanCreateInfo and pfnGetInstanceProcAddr not NULL"
    );
    let physical = from_pointer(info.vulkan_physical_device);
    let known = instance
        .vulkan_instances
        .iter()
        .rev()
        .find(|known| known.choose_device(state.config.graphics_device).is_ok_and(|it| it == physical))
        .ok_or_else(|| {
            misuse(
                sys::Result::ERROR_VALIDATION_FAILURE,
                "vulkanPhysicalDevice is not what xrGetVulkanGraphicsDevice2KHR gives",
            )
        })?;
    // SAFETY: the structure is verified; what it points at is the caller's promise.
    let made = unsafe { known.create_device(physical, info.vulkan_create_info, info.vulkan_allocator) }?;
    match made {
        Ok(known) => {
            result.write(ash::vk::Result::SUCCESS.as_raw());
            out.write(to_pointer(known.handle));
            state.instance_mut(handle)?.vulkan_devices.push(known);
        }
        Err(code) => result.write(code.as_raw()),
    }
    OK
}

fn unknown_instance() -> crate::mock::fault::Fault {
    misuse(sys::Result::ERROR_VALIDATION_FAILURE, "the VkInstance was not made by xrCreateVulkanInstanceKHR")
}
