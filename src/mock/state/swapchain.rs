//! Swapchains: images on the application's device, and the order of acquire, wait and release.

use std::collections::VecDeque;

use ash::vk;
use openxr::sys::{self, SwapchainCreateFlags, SwapchainUsageFlags};

use super::{State, limit_reached};
use crate::mock::{
    fault::{Outcome, misuse, require},
    graphics::{Image, ImageSpec, with_attachment},
};

pub struct Swapchain {
    pub session: sys::Session,
    pub spec: ImageSpec,
    /// Layers the application counts: without the faces of a cube.
    pub array_size: u32,
    pub images: Vec<Image>,
    /// Which images have been brought into their layout.
    prepared: Vec<bool>,
    /// Images the application holds, oldest first.
    acquired: VecDeque<u32>,
    /// The oldest of them has been waited for.
    waited: bool,
    next: u32,
    /// The image that layers refer to.
    pub released: Option<u32>,
    is_static: bool,
    ever_acquired: bool,
}

impl Swapchain {
    /// Made with faceCount 6: the six faces of each array element are layers of its images.
    pub fn is_cube(&self) -> bool {
        self.spec.flags.contains(vk::ImageCreateFlags::CUBE_COMPATIBLE)
    }
}

impl State {
    pub fn create_swapchain(
        &mut self,
        session: sys::Session,
        info: &sys::SwapchainCreateInfo,
    ) -> Outcome<sys::Swapchain> {
        let (spec, is_static) = self.image_spec(session, info)?;
        let usual = self.config.image_count;
        let wanted = if spec.is_depth() { self.config.depth_image_count.unwrap_or(usual) } else { usual };
        let count = if is_static { 1 } else { wanted.max(1) };
        let graphics = self.session(session)?.graphics()?;
        require!(
            graphics.can_create(&spec),
            ERROR_FEATURE_UNSUPPORTED,
            "the device has no such images: {:?}",
            spec
        );
        let images = graphics.create_images(&spec, count)?;
        let swapchain = Swapchain {
            session,
            spec,
            array_size: info.array_size,
            prepared: vec![false; images.len()],
            images,
            acquired: VecDeque::with_capacity(count as usize),
            waited: false,
            next: 0,
            released: None,
            is_static,
            ever_acquired: false,
        };
        self.swapchains.insert(swapchain).ok_or_else(limit_reached::<sys::Swapchain>)
    }

    /// What the images must be like, and whether there is to be only one.
    fn image_spec(
        &self,
        session: sys::Session,
        info: &sys::SwapchainCreateInfo,
    ) -> Outcome<(ImageSpec, bool)> {
        let formats = &self.session(session)?.formats;
        require!(
            formats.contains(&info.format),
            ERROR_SWAPCHAIN_FORMAT_UNSUPPORTED,
            "format {} is not among those xrEnumerateSwapchainFormats gives",
            info.format
        );
        let [max_width, max_height] = self.config.max_image_size;
        require!(
            (1..=max_width).contains(&info.width) && (1..=max_height).contains(&info.height),
            ERROR_VALIDATION_FAILURE,
            "{} x {} pixels is outside 1 x 1 to {} x {}",
            info.width,
            info.height,
            max_width,
            max_height
        );
        require!(
            info.face_count == 1 || (info.face_count == 6 && info.width == info.height),
            ERROR_VALIDATION_FAILURE,
            "faceCount {} is neither 1 nor 6 of square images",
            info.face_count
        );
        require!(
            info.array_size > 0 && info.mip_count > 0 && info.sample_count > 0,
            ERROR_VALIDATION_FAILURE,
            "arraySize, mipCount and sampleCount must not be 0"
        );
        require!(
            info.sample_count == 1,
            ERROR_FEATURE_UNSUPPORTED,
            "sampleCount {} is above maxSwapchainSampleCount, which is 1",
            info.sample_count
        );
        let create = info.create_flags;
        require!(
            SwapchainCreateFlags::STATIC_IMAGE.contains(create),
            ERROR_FEATURE_UNSUPPORTED,
            "createFlags {:?} are not supported, only STATIC_IMAGE",
            create
        );
        let format = vk::Format::from_raw(i32::try_from(info.format).unwrap_or_default());
        let cube = if info.face_count == 6 {
            vk::ImageCreateFlags::CUBE_COMPATIBLE
        } else {
            vk::ImageCreateFlags::empty()
        };
        let (usage, mutable) = image_usage(info.usage_flags)?;
        let spec = with_attachment(ImageSpec {
            format,
            usage,
            flags: cube | mutable,
            size: [info.width, info.height],
            layers: info.array_size.saturating_mul(info.face_count),
            mips: info.mip_count,
            samples: info.sample_count,
        });
        Ok((spec, create == SwapchainCreateFlags::STATIC_IMAGE))
    }

    pub fn destroy_swapchain(&mut self, handle: sys::Swapchain) -> Outcome<()> {
        let swapchain = self.swapchains.remove(handle)?;
        self.sessions.get(swapchain.session)?.graphics()?.destroy_images(swapchain.images);
        Ok(())
    }

    /// A swapchain whose session is not lost.
    pub fn swapchain(&mut self, handle: sys::Swapchain) -> Outcome<&mut Swapchain> {
        let session = self.swapchains.get(handle)?.session;
        self.session(session)?;
        self.swapchains.get_mut(handle)
    }

    /// Gives the application the next image's index. Touches the queue the first time for each image.
    pub fn acquire_image(&mut self, handle: sys::Swapchain) -> Outcome<u32> {
        let swapchain = self.swapchain(handle)?;
        let count = swapchain.images.len() as u32;
        require!(
            swapchain.acquired.len() < count as usize,
            ERROR_CALL_ORDER_INVALID,
            "all {} images of the swapchain are acquired",
            count
        );
        require!(
            !(swapchain.is_static && swapchain.ever_acquired),
            ERROR_CALL_ORDER_INVALID,
            "the image of a static swapchain can be acquired only once"
        );
        let (mut start, session, spec) = (swapchain.next, swapchain.session, swapchain.spec);
        if self.config.shuffle_images {
            start = (self.next_whim() % u64::from(count)) as u32;
        }
        let swapchain = self.swapchains.get_mut(handle)?;
        let free = |index: &u32| !swapchain.acquired.contains(index);
        let index = (0..count).map(|i| (start + i) % count).find(free).unwrap_or(start);
        if !swapchain.prepared[index as usize] {
            let image = swapchain.images[index as usize].handle;
            self.sessions.get_mut(session)?.graphics_mut()?.prepare(image, &spec)?;
        }
        let swapchain = self.swapchains.get_mut(handle)?;
        swapchain.prepared[index as usize] = true;
        swapchain.next = (index + 1) % count;
        swapchain.acquired.push_back(index);
        swapchain.ever_acquired = true;
        Ok(index)
    }

    /// The runtime never reads an image outside xrEndFrame, so the wait is over at once, unless a script wants it to
    /// time out: then `false`.
    pub fn wait_image(&mut self, handle: sys::Swapchain) -> Outcome<bool> {
        let times_out = self.image_timeouts > 0;
        let swapchain = self.swapchain(handle)?;
        require!(!swapchain.acquired.is_empty(), ERROR_CALL_ORDER_INVALID, "no image is acquired");
        require!(
            !swapchain.waited,
            ERROR_CALL_ORDER_INVALID,
            "the oldest acquired image has been waited for and not yet released"
        );
        if times_out {
            self.image_timeouts -= 1;
            return Ok(false);
        }
        swapchain.waited = true;
        Ok(true)
    }

    pub fn release_image(&mut self, handle: sys::Swapchain) -> Outcome<()> {
        let swapchain = self.swapchain(handle)?;
        require!(swapchain.waited, ERROR_CALL_ORDER_INVALID, "no image has been waited for");
        swapchain.waited = false;
        swapchain.released = swapchain.acquired.pop_front();
        Ok(())
    }
}

/// Vulkan usage, and the create flag for mutable formats.
fn image_usage(usage: SwapchainUsageFlags) -> Outcome<(vk::ImageUsageFlags, vk::ImageCreateFlags)> {
    let table = [
        (SwapchainUsageFlags::COLOR_ATTACHMENT, vk::ImageUsageFlags::COLOR_ATTACHMENT),
        (SwapchainUsageFlags::DEPTH_STENCIL_ATTACHMENT, vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT),
        (SwapchainUsageFlags::UNORDERED_ACCESS, vk::ImageUsageFlags::STORAGE),
        (SwapchainUsageFlags::TRANSFER_SRC, vk::ImageUsageFlags::TRANSFER_SRC),
        (SwapchainUsageFlags::TRANSFER_DST, vk::ImageUsageFlags::TRANSFER_DST),
        (SwapchainUsageFlags::SAMPLED, vk::ImageUsageFlags::SAMPLED),
        (SwapchainUsageFlags::MUTABLE_FORMAT, vk::ImageUsageFlags::empty()),
    ];
    let mut known = SwapchainUsageFlags::EMPTY;
    let mut vulkan = vk::ImageUsageFlags::empty();
    for (xr, vk) in table {
        known |= xr;
        if usage.contains(xr) {
            vulkan |= vk;
        }
    }
    if !known.contains(usage) {
        return Err(misuse(
            sys::Result::ERROR_FEATURE_UNSUPPORTED,
            format!("usageFlags {usage:?} contain bits that are not supported"),
        ));
    }
    let flags = if usage.contains(SwapchainUsageFlags::MUTABLE_FORMAT) {
        vk::ImageCreateFlags::MUTABLE_FORMAT
    } else {
        vk::ImageCreateFlags::empty()
    };
    Ok((vulkan, flags))
}
