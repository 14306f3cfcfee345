//! Swapchains and their images.

use std::{sync::Arc, time::Duration};

use ash::vk::Handle as _;
use openxr::sys;

use super::pointer::{In, Out, OutArray};
use crate::mock::{fault::Outcome, state::Shared};

/// A scripted timeout sleeps as long as the application waits; but an application that waits longer than the first of
/// these waits for ever, and gets the second.
const LONGEST_TIMEOUT_NS: i64 = 10_000_000_000;
const FOR_EVER_NS: i64 = 100_000_000;

pub fn enumerate_formats(
    shared: &Arc<Shared>,
    session: sys::Session,
    capacity: u32,
    count: Out<u32>,
    formats: Out<i64>,
) -> Outcome<sys::Result> {
    let state = shared.lock();
    let out = OutArray { capacity, count, items: formats };
    out.fill(state.session(session)?.formats.iter().copied())?;
    Ok(state.success(session))
}

pub fn create_swapchain(
    shared: &Arc<Shared>,
    session: sys::Session,
    info: In<sys::SwapchainCreateInfo>,
    out: Out<sys::Swapchain>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    state.session(session)?;
    let info = info.get()?;
    out.check()?;
    out.write(state.create_swapchain(session, info)?);
    Ok(state.success(session))
}

pub fn destroy_swapchain(shared: &Arc<Shared>, handle: sys::Swapchain) -> Outcome<sys::Result> {
    shared.lock().destroy_swapchain(handle)?;
    Ok(sys::Result::SUCCESS)
}

pub fn enumerate_images(
    shared: &Arc<Shared>,
    handle: sys::Swapchain,
    capacity: u32,
    count: Out<u32>,
    images: Out<sys::SwapchainImageVulkanKHR>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    let swapchain = state.swapchain(handle)?;
    let out = OutArray { capacity, count, items: images };
    out.fill_typed(swapchain.images.len(), |i, next| sys::SwapchainImageVulkanKHR {
        ty: sys::SwapchainImageVulkanKHR::TYPE,
        next,
        image: swapchain.images[i].handle.as_raw(),
    })?;
    let session = swapchain.session;
    Ok(state.success(session))
}

pub fn acquire_image(
    shared: &Arc<Shared>,
    handle: sys::Swapchain,
    info: In<sys::SwapchainImageAcquireInfo>,
    out: Out<u32>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    let session = state.swapchain(handle)?.session;
    info.check_optional()?;
    out.check()?;
    out.write(state.acquire_image(handle)?);
    Ok(state.success(session))
}

pub fn wait_image(
    shared: &Arc<Shared>,
    handle: sys::Swapchain,
    info: In<sys::SwapchainImageWaitInfo>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    let session = state.swapchain(handle)?.session;
    let timeout = info.get()?.timeout;
    if state.wait_image(handle)? {
        return Ok(state.success(session));
    }
    let stepped = state.timeline.is_stepped();
    drop(state);
    if !stepped {
        let asked_ns = timeout.as_nanos().max(0);
        let sleep_ns = if asked_ns > LONGEST_TIMEOUT_NS { FOR_EVER_NS } else { asked_ns };
        std::thread::sleep(Duration::from_nanos(sleep_ns.unsigned_abs()));
    }
    Ok(sys::Result::TIMEOUT_EXPIRED)
}

pub fn release_image(
    shared: &Arc<Shared>,
    handle: sys::Swapchain,
    info: In<sys::SwapchainImageReleaseInfo>,
) -> Outcome<sys::Result> {
    let mut state = shared.lock();
    let session = state.swapchain(handle)?.session;
    info.check_optional()?;
    state.release_image(handle)?;
    Ok(state.success(session))
}
