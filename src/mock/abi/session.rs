//! Sessions.

use std::sync::Arc;

use openxr::sys;

use super::pointer::{In, Out};
use crate::mock::{
    fault::{Outcome, misuse, require},
    graphics::Graphics,
    state::Shared,
    vulkan::from_pointer,
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
    let Some(binding) = binding.filter(|_| instance.check_vulkan_enabled().is_ok()) else {
        return Err(misuse(
            sys::Result::ERROR_GRAPHICS_DEVICE_INVALID,
            "no XrGraphicsBindingVulkan2KHR of an enabled extension is chained to XrSessionCreateInfo",
        ));
    };
    require!(
        instance.graphics_requirements_asked,
        ERROR_GRAPHICS_REQUIREMENTS_CALL_MISSING,
        "xrGetVulkanGraphicsRequirements2KHR must be called before xrCreateSession"
    );
    let invalid = |text: &'static str| misuse(sys::Result::ERROR_GRAPHICS_DEVICE_INVALID, text);
    let vulkan = instance
        .vulkan_instances
        .iter()
        .find(|known| known.handle == from_pointer(binding.instance))
        .ok_or_else(|| invalid("the VkInstance was not made by xrCreateVulkanInstanceKHR"))?;
    // The newest first: drivers reuse the addresses of destroyed devices.
    let device = instance
        .vulkan_devices
        .iter()
        .rev()
        .find(|known| known.handle == from_pointer(binding.device))
        .ok_or_else(|| invalid("the VkDevice was not made by xrCreateVulkanDeviceKHR"))?;
    require!(
        device.physical == from_pointer(binding.physical_device),
        ERROR_GRAPHICS_DEVICE_INVALID,
        "the VkDevice is of another VkPhysicalDevice"
    );
    let (family, index) = (binding.queue_family_index, binding.queue_index);
    let has_queue = |&(f, count): &(u32, u32)| f == family && index < count;
    require!(
        device.queues.iter().any(has_queue),
        ERROR_GRAPHICS_DEVICE_INVALID,
        "the VkDevice was made without queue {} of family {}",
        index,
        family
    );
    let graphics = Graphics::new(vulkan, device, family, index)?;
    out.write(state.create_session(handle, Some(graphics))?);
    Ok(sys::Result::SUCCESS)
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
