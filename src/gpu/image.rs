//! Images with their views, and samplers: named, freed on drop.
#![allow(unsafe_code, reason = "calls Vulkan")]

use std::sync::Arc;

use anyhow::{Context, Result};
use ash::vk;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::Allocation;

use super::context::Gpu;
use super::memory::Request;

/// What an image is to be: 2-D, with layers and mips.
#[derive(Debug, Clone, Copy)]
pub struct ImageInfo<'a> {
    /// Shown in validation messages.
    pub name: &'a str,
    /// Texels.
    pub width: u32,
    /// Texels.
    pub height: u32,
    /// At least 1; 6 for a cube.
    pub layers: u32,
    /// At least 1.
    pub mips: u32,
    /// Of the image and of its views.
    pub format: vk::Format,
    /// What it is used for. TRANSIENT_ATTACHMENT: where the device can keep its texels on the chip, it takes no memory.
    pub usage: vk::ImageUsageFlags,
    /// Samples per texel.
    pub samples: vk::SampleCountFlags,
    /// Six layers that can also be sampled as a cube.
    pub cube: bool,
}

impl Default for ImageInfo<'_> {
    /// One layer, one mip, one sample, no cube, and no size, format or use yet.
    fn default() -> Self {
        Self {
            name: "image",
            width: 1,
            height: 1,
            layers: 1,
            mips: 1,
            format: vk::Format::UNDEFINED,
            usage: vk::ImageUsageFlags::empty(),
            samples: vk::SampleCountFlags::TYPE_1,
            cube: false,
        }
    }
}

/// An image with its memory and views, in layout UNDEFINED until it is first used.
pub struct Image {
    /// The handle.
    pub raw: vk::Image,
    /// All layers and mips: `texture_2d_array` where there is more than one layer, else `texture_2d`.
    pub view: vk::ImageView,
    /// All six layers as a cube, where it is one; else null.
    pub cube_view: vk::ImageView,
    /// One layer each, its first mip: what a pass draws to.
    pub layer_views: Vec<vk::ImageView>,
    /// Texels.
    pub extent: vk::Extent2D,
    /// As asked for.
    pub format: vk::Format,
    /// Colour or depth.
    pub aspect: vk::ImageAspectFlags,
    memory: Option<Allocation>,
    gpu: Arc<Gpu>,
}

impl Image {
    /// A new image in device memory.
    ///
    /// # Errors
    /// Out of memory, or the device cannot do this format or size.
    pub fn new(gpu: &Arc<Gpu>, info: &ImageInfo<'_>) -> Result<Self> {
        let what = || format!("image {} ({}x{} {:?})", info.name, info.width, info.height, info.format);
        let extent = vk::Extent2D { width: info.width, height: info.height };
        // SAFETY: plain creation on a live device.
        let raw = unsafe { gpu.device.create_image(&create_info(info), None) }
            .with_context(|| format!("cannot make {}", what()))?;
        gpu.name(raw, info.name);
        let mut made = Self {
            raw,
            view: vk::ImageView::null(),
            cube_view: vk::ImageView::null(),
            layer_views: Vec::with_capacity(info.layers as usize),
            extent,
            format: info.format,
            aspect: aspect_of(info.format),
            memory: None,
            gpu: Arc::clone(gpu),
        };
        let memory = gpu.memory.allocate(&Request {
            name: info.name,
            // SAFETY: the image is alive.
            requirements: unsafe { gpu.device.get_image_memory_requirements(raw) },
            location: MemoryLocation::GpuOnly,
            linear: false,
            transient: info.usage.contains(vk::ImageUsageFlags::TRANSIENT_ATTACHMENT),
        })?;
        let memory = made.memory.insert(memory);
        // SAFETY: the memory was allocated for this image and is bound once.
        unsafe { gpu.device.bind_image_memory(raw, memory.memory(), memory.offset()) }
            .with_context(|| format!("cannot bind {}", what()))?;
        made.make_views(info).with_context(|| format!("cannot make a view of {}", what()))?;
        Ok(made)
    }

    fn make_views(&mut self, info: &ImageInfo<'_>) -> Result<(), vk::Result> {
        let all = vk::ImageSubresourceRange {
            aspect_mask: self.aspect,
            base_mip_level: 0,
            level_count: info.mips,
            base_array_layer: 0,
            layer_count: info.layers,
        };
        let kind =
            if info.layers > 1 { vk::ImageViewType::TYPE_2D_ARRAY } else { vk::ImageViewType::TYPE_2D };
        self.view = self.make_view(info.name, kind, all)?;
        if info.cube {
            self.cube_view = self.make_view(info.name, vk::ImageViewType::CUBE, all)?;
        }
        for layer in 0..info.layers {
            let one =
                vk::ImageSubresourceRange { level_count: 1, base_array_layer: layer, layer_count: 1, ..all };
            let view = self.make_view(info.name, vk::ImageViewType::TYPE_2D, one)?;
            self.layer_views.push(view);
        }
        Ok(())
    }

    fn make_view(
        &self,
        name: &str,
        kind: vk::ImageViewType,
        range: vk::ImageSubresourceRange,
    ) -> Result<vk::ImageView, vk::Result> {
        let create = vk::ImageViewCreateInfo::default()
            .image(self.raw)
            .view_type(kind)
            .format(self.format)
            .subresource_range(range);
        // SAFETY: the image is alive and bound to memory.
        let view = unsafe { self.gpu.device.create_image_view(&create, None) }?;
        self.gpu.name(view, name);
        Ok(view)
    }
}

impl Drop for Image {
    fn drop(&mut self) {
        let memory = self.memory.take();
        self.gpu.destroy(|device| {
            // SAFETY: the owner lets go only when the GPU has finished with it (see `Frames::bury`); null is ignored.
            unsafe {
                device.destroy_image_view(self.view, None);
                device.destroy_image_view(self.cube_view, None);
                self.layer_views.iter().for_each(|view| device.destroy_image_view(*view, None));
                device.destroy_image(self.raw, None);
            }
            if let Some(memory) = memory {
                self.gpu.memory.free(memory);
            }
        });
    }
}

fn create_info(info: &ImageInfo<'_>) -> vk::ImageCreateInfo<'static> {
    let flags = if info.cube { vk::ImageCreateFlags::CUBE_COMPATIBLE } else { vk::ImageCreateFlags::empty() };
    vk::ImageCreateInfo::default()
        .flags(flags)
        .image_type(vk::ImageType::TYPE_2D)
        .format(info.format)
        .extent(vk::Extent3D { width: info.width, height: info.height, depth: 1 })
        .mip_levels(info.mips)
        .array_layers(info.layers)
        .samples(info.samples)
        .tiling(vk::ImageTiling::OPTIMAL)
        .usage(info.usage)
        .sharing_mode(vk::SharingMode::EXCLUSIVE)
        .initial_layout(vk::ImageLayout::UNDEFINED)
}

/// Depth for the depth formats without stencil that are used here, colour for all else.
fn aspect_of(format: vk::Format) -> vk::ImageAspectFlags {
    match format {
        vk::Format::D32_SFLOAT | vk::Format::D16_UNORM | vk::Format::X8_D24_UNORM_PACK32 => {
            vk::ImageAspectFlags::DEPTH
        }
        _ => vk::ImageAspectFlags::COLOR,
    }
}

/// How textures are read.
pub struct Sampler {
    /// The handle.
    pub raw: vk::Sampler,
    gpu: Arc<Gpu>,
}

impl Sampler {
    /// The same filter within and between mips, and one rule for what lies outside.
    ///
    /// # Errors
    /// Out of memory.
    pub fn new(
        gpu: &Arc<Gpu>,
        name: &str,
        filter: vk::Filter,
        outside: vk::SamplerAddressMode,
    ) -> Result<Self> {
        let mip_mode = match filter {
            vk::Filter::NEAREST => vk::SamplerMipmapMode::NEAREST,
            _ => vk::SamplerMipmapMode::LINEAR,
        };
        let create = vk::SamplerCreateInfo::default()
            .min_filter(filter)
            .mag_filter(filter)
            .mipmap_mode(mip_mode)
            .address_mode_u(outside)
            .address_mode_v(outside)
            .address_mode_w(outside)
            .max_lod(vk::LOD_CLAMP_NONE);
        // SAFETY: plain creation on a live device.
        let raw = unsafe { gpu.device.create_sampler(&create, None) }
            .with_context(|| format!("cannot make sampler {name}"))?;
        gpu.name(raw, name);
        Ok(Self { raw, gpu: Arc::clone(gpu) })
    }
}

impl Drop for Sampler {
    fn drop(&mut self) {
        // SAFETY: the owner lets go only when the GPU has finished with it.
        self.gpu.destroy(|device| unsafe { device.destroy_sampler(self.raw, None) });
    }
}
