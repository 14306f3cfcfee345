//! The images of swapchains.

#![allow(unsafe_code, reason = "calls the C interface of the OpenXR runtime")]

use std::ptr;

use ash::vk::{self, Handle as _};
use openxr::sys;

use super::RawSession;
use crate::xr::error::Error;
use crate::xr::outcome::{Outcome, outcome};

/// What the images of a swapchain are like, apart from their format.
#[derive(Debug, Clone, Copy)]
pub(in crate::xr) struct Shape {
    pub(in crate::xr) extent: vk::Extent2D,
    /// 6: cubemaps, whose faces are layers of the image; else 1.
    pub(in crate::xr) faces: u32,
    pub(in crate::xr) array: u32,
}

impl RawSession {
    pub(in crate::xr) fn swapchain_formats(&self) -> Result<Vec<vk::Format>, Error> {
        let formats = self.array("xrEnumerateSwapchainFormats", 0i64, |capacity, count, out| {
            // SAFETY: a live session; `out` has room for `capacity` elements.
            unsafe { (self.instance.fp().enumerate_swapchain_formats)(self.handle, capacity, count, out) }
        })?;
        let known = formats.iter().filter_map(|&f| i32::try_from(f).ok());
        Ok(known.map(vk::Format::from_raw).collect())
    }

    pub(in crate::xr) fn create_swapchain(
        &self,
        format: vk::Format,
        usage: sys::SwapchainUsageFlags,
        shape: Shape,
    ) -> Result<sys::Swapchain, Error> {
        let info = sys::SwapchainCreateInfo {
            ty: sys::SwapchainCreateInfo::TYPE,
            next: ptr::null(),
            create_flags: sys::SwapchainCreateFlags::EMPTY,
            usage_flags: usage,
            format: i64::from(format.as_raw()),
            sample_count: 1,
            width: shape.extent.width,
            height: shape.extent.height,
            face_count: shape.faces,
            array_size: shape.array,
            mip_count: 1,
        };
        let mut swapchain = sys::Swapchain::default();
        // SAFETY: a live session and a properly typed structure.
        self.with_queue("xrCreateSwapchain", || unsafe {
            (self.instance.fp().create_swapchain)(self.handle, &info, &mut swapchain)
        })?;
        Ok(swapchain)
    }

    pub(in crate::xr) fn swapchain_images(&self, swapchain: sys::Swapchain) -> Result<Vec<vk::Image>, Error> {
        let empty = sys::SwapchainImageVulkanKHR {
            ty: sys::SwapchainImageVulkanKHR::TYPE,
            next: ptr::null_mut(),
            image: 0,
        };
        let images = self.array("xrEnumerateSwapchainImages", empty, |capacity, count, out| {
            // SAFETY: a live swapchain; `out` has room for `capacity` properly typed Vulkan images.
            unsafe { (self.instance.fp().enumerate_swapchain_images)(swapchain, capacity, count, out.cast()) }
        })?;
        Ok(images.iter().map(|i| vk::Image::from_raw(i.image)).collect())
    }

    pub(in crate::xr) fn acquire_image(&self, swapchain: sys::Swapchain) -> Result<u32, Error> {
        let mut index = 0;
        // SAFETY: a live swapchain; the info may be null.
        self.with_queue("xrAcquireSwapchainImage", || unsafe {
            (self.instance.fp().acquire_swapchain_image)(swapchain, ptr::null(), &mut index)
        })?;
        Ok(index)
    }

    /// Waits for the acquired image, the queue being free meanwhile. False when it is still in use after the time-out:
    /// `TIMEOUT_EXPIRED` is a success code, but the image must not be touched.
    pub(in crate::xr) fn wait_image(
        &self,
        swapchain: sys::Swapchain,
        timeout_ns: i64,
    ) -> Result<bool, Error> {
        let info = sys::SwapchainImageWaitInfo {
            ty: sys::SwapchainImageWaitInfo::TYPE,
            next: ptr::null(),
            timeout: sys::Duration::from_nanos(timeout_ns),
        };
        // SAFETY: a live swapchain and a properly typed structure.
        let code = unsafe { (self.instance.fp().wait_swapchain_image)(swapchain, &info) };
        let code = self.check("xrWaitSwapchainImage", code)?;
        Ok(outcome("xrWaitSwapchainImage", code) != Outcome::SkipFrame)
    }

    pub(in crate::xr) fn release_image(&self, swapchain: sys::Swapchain) -> Result<(), Error> {
        // SAFETY: a live swapchain; the info may be null.
        self.with_queue("xrReleaseSwapchainImage", || unsafe {
            (self.instance.fp().release_swapchain_image)(swapchain, ptr::null())
        })
        .map(drop)
    }

    pub(in crate::xr) fn destroy_swapchain(&self, swapchain: sys::Swapchain) {
        // SAFETY: the caller owns the swapchain, gives it up, and has waited for the GPU to be done with its images.
        self.gpu.with_queue(|_| unsafe { (self.instance.fp().destroy_swapchain)(swapchain) });
    }
}
