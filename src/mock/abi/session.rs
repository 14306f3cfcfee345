//! Sessions.
#![allow(unsafe_code, reason = "takes the application's Vulkan handles for what they claim to be")]

use std::sync::Arc;

use openxr::sys;

use super::pointer::{In, Out};
use crate::mock::{
    fault::{Fault, Outcome, misuse, refusal, require},
    graphics::Graphics,
    state::{
        Shared,
        instance::{VULKAN_ENABLE, VULKAN_ENABLE2},
    },
    vulkan::{KnownDevice, KnownInstance, from_pointer},
};

pub fn create_session(
    shared: &Arc<Shared>,
    handle: sys::Instance,
    info: In<sys::SessionCreateInfo>,
    out: Out<sys::Session>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    let instance = state.instance(handle)?;
    let binding = info.chained::<sys::GraphicsBindingVulkanKHR>()?;
    let info = info.get()?;
    out.check()?;
    require!(info.create_flags.is_empty(), ERROR_VALIDATION_FAILURE, "createFlags must be 0");
    instance.check_system(info.system_id)?;
    if binding.is_none() && instance.has("XR_MND_headless") {
        out.write(state.create_session(handle, None)?);
        return Ok(sys::Result::SUCCESS);
    }
    let (own, made_here) = (instance.has(VULKAN_ENABLE), instance.has(VULKAN_ENABLE2));
    let Some(binding) = binding.filter(|_| own || made_here) else {
        return Err(invalid(
            "no XrGraphicsBindingVulkanKHR of an enabled extension is chained to XrSessionCreateInfo",
        ));
    };
    let known = instance.vulkan_instances.iter().find(|known| known.handle == from_pointer(binding.instance));
    let (extension, call) = match known {
        None if own => (VULKAN_ENABLE, "xrGetVulkanGraphicsRequirementsKHR"),
        _ => (VULKAN_ENABLE2, "xrGetVulkanGraphicsRequirements2KHR"),
    };
    require!(
        instance.requirements_asked.contains(extension),
        ERROR_GRAPHICS_REQUIREMENTS_CALL_MISSING,
        "{} must be called before xrCreateSession",
        call
    );
    let adopted;
    let (vulkan, device) = match known {
        // The newest first: drivers reuse the addresses of destroyed devices.
        Some(vulkan) => {
            let device = |device: &&KnownDevice| device.handle == from_pointer(binding.device);
            let device = instance.vulkan_devices.iter().rev().find(device);
            let device =
                device.ok_or_else(|| invalid("the VkDevice was not made by xrCreateVulkanDeviceKHR"))?;
            require!(
                device.physical == from_pointer(binding.physical_device),
                ERROR_GRAPHICS_DEVICE_INVALID,
                "the VkDevice is of another VkPhysicalDevice"
            );
            if vulkan.choose_device(state.config.graphics_device)? != device.physical {
                // It was when the VkDevice was made: nobody's fault.
                return Err(refusal(
                    sys::Result::ERROR_GRAPHICS_DEVICE_INVALID,
                    "the VkPhysicalDevice is not what xrGetVulkanGraphicsDevice2KHR gives now",
                ));
            }
            (vulkan, device)
        }
        None if own => {
            adopted = adopt(binding, state.config.graphics_device)?;
            (&adopted.0, &adopted.1)
        }
        None => return Err(invalid("the VkInstance was not made by xrCreateVulkanInstanceKHR")),
    };
    let (family, index) = (binding.queue_family_index, binding.queue_index);
    let has_queue = |&(f, count): &(u32, u32)| f == family && index < count;
    require!(
        device.queues.iter().any(has_queue),
        ERROR_GRAPHICS_DEVICE_INVALID,
        "the VkDevice has no queue {} of family {}",
        index,
        family
    );
    let graphics = Graphics::new(vulkan, device, family, index)?;
    out.write(state.create_session(handle, Some(graphics))?);
    Ok(sys::Result::SUCCESS)
}

fn invalid(text: &'static str) -> Fault {
    misuse(sys::Result::ERROR_GRAPHICS_DEVICE_INVALID, text)
}

/// The Vulkan objects of an application that makes its own.
fn adopt(binding: &sys::GraphicsBindingVulkanKHR, nth: u32) -> Outcome<(KnownInstance, KnownDevice)> {
    if binding.instance.is_null() || binding.physical_device.is_null() || binding.device.is_null() {
        return Err(invalid("a Vulkan handle is VK_NULL_HANDLE"));
    }
    // SAFETY: not null; a living VkInstance by the application's promise.
    let vulkan = unsafe { KnownInstance::adopt(from_pointer(binding.instance)) }?;
    let physical = from_pointer(binding.physical_device);
    if vulkan.choose_device(nth)? != physical {
        return Err(invalid("the VkPhysicalDevice is not what xrGetVulkanGraphicsDeviceKHR gives"));
    }
    let device = vulkan.adopt_device(physical, from_pointer(binding.device));
    Ok((vulkan, device))
}

pub fn destroy_session(shared: &Arc<Shared>, handle: sys::Session) -> Outcome<sys::Result> {
    let done = shared.lock().destroy_session(handle);
    shared.changed.notify_all();
    done?;
    Ok(sys::Result::SUCCESS)
}

pub fn begin_session(
    shared: &Arc<Shared>,
    handle: sys::Session,
    info: In<sys::SessionBeginInfo>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.session(handle)?;
    let kind = info.get()?.primary_view_configuration_type;
    state.begin_session(handle, kind)
}

pub fn end_session(shared: &Arc<Shared>, handle: sys::Session) -> Outcome<sys::Result> {
    let ended = shared.lock().end_session(handle);
    shared.changed.notify_all();
    ended
}

pub fn request_exit(shared: &Arc<Shared>, handle: sys::Session) -> Outcome<sys::Result> {
    shared.lock().request_exit(handle)
}
