//! A session's hold on the application's device: swapchain images, and copying submitted ones back.
#![allow(unsafe_code, reason = "Vulkan is an unsafe C interface")]

use ash::vk;
use openxr::sys;

use super::{
    fault::{Outcome, refusal},
    vulkan::{KnownDevice, KnownInstance, failed},
};

/// Reading back gives up on the GPU after this long.
const FENCE_TIMEOUT_NS: u64 = 20_000_000_000;

/// What every image of a swapchain is like.
#[derive(Clone, Copy, Debug)]
pub struct ImageSpec {
    pub format: vk::Format,
    pub usage: vk::ImageUsageFlags,
    pub flags: vk::ImageCreateFlags,
    pub size: [u32; 2],
    pub layers: u32,
    pub mips: u32,
    pub samples: u32,
}

impl ImageSpec {
    pub fn aspects(&self) -> vk::ImageAspectFlags {
        match self.format {
            vk::Format::D16_UNORM | vk::Format::D32_SFLOAT => vk::ImageAspectFlags::DEPTH,
            vk::Format::D24_UNORM_S8_UINT => vk::ImageAspectFlags::DEPTH | vk::ImageAspectFlags::STENCIL,
            _ => vk::ImageAspectFlags::COLOR,
        }
    }

    pub fn is_depth(&self) -> bool {
        self.aspects().contains(vk::ImageAspectFlags::DEPTH)
    }

    /// Levels down to a single pixel.
    fn whole_chain(&self) -> u32 {
        u32::BITS - self.size[0].max(self.size[1]).leading_zeros()
    }

    /// The layout the application gets its images in and gives them back in.
    fn layout(&self) -> vk::ImageLayout {
        if self.is_depth() {
            vk::ImageLayout::DEPTH_STENCIL_ATTACHMENT_OPTIMAL
        } else {
            vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL
        }
    }

    /// Bytes per texel of what is copied back.
    fn texel_size(&self) -> u64 {
        match self.format {
            vk::Format::D16_UNORM => 2,
            vk::Format::R16G16B16A16_SFLOAT => 8,
            _ => 4,
        }
    }
}

/// An image on the application's device, with memory of its own.
pub struct Image {
    pub handle: vk::Image,
    memory: vk::DeviceMemory,
}

/// A part of an image to copy to host memory.
#[derive(Clone, Copy)]
pub struct Region {
    pub image: vk::Image,
    pub spec: ImageSpec,
    pub layer: u32,
    pub offset: [i32; 2],
    pub size: [u32; 2],
}

struct Staging {
    buffer: vk::Buffer,
    memory: vk::DeviceMemory,
    size: u64,
    mapped: *const u8,
}

// SAFETY: the mapped pointer is only read through &mut Graphics, after the GPU has finished writing.
unsafe impl Send for Staging {}

/// A session's hold on the application's device and queue.
pub struct Graphics {
    instance: ash::Instance,
    physical: vk::PhysicalDevice,
    device: ash::Device,
    queue: vk::Queue,
    pool: vk::CommandPool,
    commands: vk::CommandBuffer,
    fence: vk::Fence,
    memory: vk::PhysicalDeviceMemoryProperties,
    staging: Option<Staging>,
    /// Loaded as long as its functions are called.
    _library: Option<ash::Entry>,
}

impl Graphics {
    /// A command buffer and a fence on the application's queue.
    pub fn new(instance: &KnownInstance, device: &KnownDevice, family: u32, index: u32) -> Outcome<Self> {
        let library = instance.library.clone();
        let instance = instance.functions.clone();
        // SAFETY: the device was made from this instance and the application keeps both alive longer than the
        // session; the queue was checked against those the device was made with.
        unsafe {
            let memory = instance.get_physical_device_memory_properties(device.physical);
            let physical = device.physical;
            let device = ash::Device::load(instance.fp_v1_0(), device.handle);
            let queue = device.get_device_queue(family, index);
            let pool = vk::CommandPoolCreateInfo::default()
                .queue_family_index(family)
                .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
            let pool = device
                .create_command_pool(&pool, None)
                .map_err(|result| failed("vkCreateCommandPool", result))?;
            let commands =
                vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
            let mut graphics = Self {
                instance,
                physical,
                queue,
                pool,
                commands: vk::CommandBuffer::null(),
                fence: vk::Fence::null(),
                memory,
                staging: None,
                device,
                _library: library,
            };
            graphics.commands = graphics
                .device
                .allocate_command_buffers(&commands)
                .map_err(|result| failed("vkAllocateCommandBuffers", result))?
                .into_iter()
                .next()
                .unwrap_or_default();
            graphics.fence = graphics
                .device
                .create_fence(&vk::FenceCreateInfo::default(), None)
                .map_err(|result| failed("vkCreateFence", result))?;
            Ok(graphics)
        }
    }

    /// Those of the wanted formats that the device can draw to and copy from.
    pub fn supported(&self, wanted: &[vk::Format]) -> Vec<vk::Format> {
        let can_draw = |format: &vk::Format| {
            let spec = ImageSpec {
                format: *format,
                usage: vk::ImageUsageFlags::TRANSFER_SRC,
                flags: vk::ImageCreateFlags::empty(),
                size: [1, 1],
                layers: 2,
                mips: 1,
                samples: 1,
            };
            self.can_create(&with_attachment(spec))
        };
        wanted.iter().copied().filter(can_draw).collect()
    }

    /// Whether the device has such images at all.
    pub fn can_create(&self, spec: &ImageSpec) -> bool {
        // SAFETY: the physical device belongs to the instance.
        let limits = unsafe {
            self.instance.get_physical_device_image_format_properties(
                self.physical,
                spec.format,
                vk::ImageType::TYPE_2D,
                vk::ImageTiling::OPTIMAL,
                spec.usage,
                spec.flags,
            )
        };
        limits.is_ok_and(|limits| {
            spec.size[0] <= limits.max_extent.width
                && spec.size[1] <= limits.max_extent.height
                && spec.layers <= limits.max_array_layers
                && spec.mips <= limits.max_mip_levels.min(spec.whole_chain())
                && limits.sample_counts.as_raw() & spec.samples != 0
        })
    }

    /// `count` images with memory, in no layout yet (see `prepare`).
    pub fn create_images(&self, spec: &ImageSpec, count: u32) -> Outcome<Vec<Image>> {
        let mut images = Vec::new();
        for _ in 0..count {
            match self.create_image(spec) {
                Ok(image) => images.push(image),
                Err(fault) => {
                    self.destroy_images(images);
                    return Err(fault);
                }
            }
        }
        Ok(images)
    }

    fn create_image(&self, spec: &ImageSpec) -> Outcome<Image> {
        let info = vk::ImageCreateInfo::default()
            .flags(spec.flags)
            .image_type(vk::ImageType::TYPE_2D)
            .format(spec.format)
            .extent(vk::Extent3D { width: spec.size[0], height: spec.size[1], depth: 1 })
            .mip_levels(spec.mips)
            .array_layers(spec.layers)
            .samples(vk::SampleCountFlags::from_raw(spec.samples))
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(spec.usage)
            .sharing_mode(vk::SharingMode::EXCLUSIVE)
            .initial_layout(vk::ImageLayout::UNDEFINED);
        // SAFETY: the device is alive and `can_create` has accepted these parameters.
        unsafe {
            let handle =
                self.device.create_image(&info, None).map_err(|result| failed("vkCreateImage", result))?;
            let needs = self.device.get_image_memory_requirements(handle);
            let memory =
                self.allocate(needs, &[vk::MemoryPropertyFlags::DEVICE_LOCAL]).and_then(|memory| match self
                    .device
                    .bind_image_memory(handle, memory, 0)
                {
                    Ok(()) => Ok(memory),
                    Err(result) => {
                        self.device.free_memory(memory, None);
                        Err(failed("vkBindImageMemory", result))
                    }
                });
            match memory {
                Ok(memory) => Ok(Image { handle, memory }),
                Err(fault) => {
                    self.device.destroy_image(handle, None);
                    Err(fault)
                }
            }
        }
    }

    /// Memory of the first kind in `preferences` that exists, or of any kind the resource can live in.
    fn allocate(
        &self,
        needs: vk::MemoryRequirements,
        preferences: &[vk::MemoryPropertyFlags],
    ) -> Outcome<vk::DeviceMemory> {
        let types = &self.memory.memory_types[..self.memory.memory_type_count as usize];
        let fits = |index: usize| needs.memory_type_bits & 1 << index != 0;
        let find = |flags: vk::MemoryPropertyFlags| {
            (0..types.len()).find(|&i| fits(i) && types[i].property_flags.contains(flags))
        };
        let index = preferences
            .iter()
            .find_map(|flags| find(*flags))
            .or_else(|| find(vk::MemoryPropertyFlags::empty()))
            .ok_or_else(|| {
                refusal(sys::Result::ERROR_OUT_OF_MEMORY, "no memory type fits a swapchain image")
            })?;
        let info =
            vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(index as u32);
        // SAFETY: the memory type exists on the device.
        unsafe { self.device.allocate_memory(&info, None) }
            .map_err(|result| failed("vkAllocateMemory", result))
    }

    pub fn destroy_images(&self, images: Vec<Image>) {
        for image in images {
            // SAFETY: the runtime made these; the application has finished with them when it destroys the swapchain,
            // and the runtime waits for its own copies.
            unsafe {
                self.device.destroy_image(image.handle, None);
                self.device.free_memory(image.memory, None);
            }
        }
    }

    /// Brings a new image into the layout the application expects. Touches the queue.
    pub fn prepare(&mut self, image: vk::Image, spec: &ImageSpec) -> Outcome<()> {
        let barrier = barrier(image, spec)
            .old_layout(vk::ImageLayout::UNDEFINED)
            .new_layout(spec.layout())
            .dst_access_mask(vk::AccessFlags::MEMORY_READ | vk::AccessFlags::MEMORY_WRITE);
        self.submit(|device, commands| {
            // SAFETY: the command buffer is recording and the image is alive.
            unsafe {
                device.cmd_pipeline_barrier(
                    commands,
                    vk::PipelineStageFlags::TOP_OF_PIPE,
                    vk::PipelineStageFlags::ALL_COMMANDS,
                    vk::DependencyFlags::empty(),
                    &[],
                    &[],
                    &[barrier],
                );
            }
        })
    }

    /// Copies parts of images to host memory, rows from the top, tightly packed. Touches the queue and waits for it.
    pub fn read(&mut self, regions: &[Region]) -> Outcome<Vec<Vec<u8>>> {
        let mut offsets = Vec::with_capacity(regions.len());
        let mut total = 0u64;
        for region in regions {
            let bytes = u64::from(region.size[0]) * u64::from(region.size[1]) * region.spec.texel_size();
            offsets.push((total, bytes));
            total += bytes.next_multiple_of(16);
        }
        let (buffer, mapped) = self.stage(total)?;
        self.submit(|device, commands| {
            // SAFETY: the command buffer is recording; images and buffer are alive and the regions lie inside them.
            unsafe { record_copies(device, commands, buffer, regions, &offsets) };
        })?;
        let copy = |&(offset, bytes): &(u64, u64)| {
            // SAFETY: the buffer is mapped whole, coherent, and the fence says that the GPU has written it.
            unsafe { std::slice::from_raw_parts(mapped.add(offset as usize), bytes as usize) }.to_vec()
        };
        Ok(offsets.iter().map(copy).collect())
    }

    /// The staging buffer, of at least `size` bytes.
    fn stage(&mut self, size: u64) -> Outcome<(vk::Buffer, *const u8)> {
        if let Some(staging) = &self.staging
            && staging.size >= size
        {
            return Ok((staging.buffer, staging.mapped));
        }
        self.free_staging();
        let info = vk::BufferCreateInfo::default().size(size).usage(vk::BufferUsageFlags::TRANSFER_DST);
        let coherent = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        // SAFETY: the device is alive; on failure what was made is destroyed again.
        unsafe {
            let buffer =
                self.device.create_buffer(&info, None).map_err(|result| failed("vkCreateBuffer", result))?;
            let needs = self.device.get_buffer_memory_requirements(buffer);
            let cached = coherent | vk::MemoryPropertyFlags::HOST_CACHED;
            let memory = match self.allocate(needs, &[cached, coherent]) {
                Ok(memory) => memory,
                Err(fault) => {
                    self.device.destroy_buffer(buffer, None);
                    return Err(fault);
                }
            };
            let mapped = self.device.bind_buffer_memory(buffer, memory, 0).and_then(|()| {
                self.device.map_memory(memory, 0, vk::WHOLE_SIZE, vk::MemoryMapFlags::empty())
            });
            let mapped = match mapped {
                Ok(mapped) => mapped.cast::<u8>().cast_const(),
                Err(result) => {
                    self.device.destroy_buffer(buffer, None);
                    self.device.free_memory(memory, None);
                    return Err(failed("mapping the read-back buffer", result));
                }
            };
            self.staging = Some(Staging { buffer, memory, size, mapped });
            Ok((buffer, mapped))
        }
    }

    fn free_staging(&mut self) {
        if let Some(staging) = self.staging.take() {
            // SAFETY: every copy into it has been waited for.
            unsafe {
                self.device.destroy_buffer(staging.buffer, None);
                self.device.free_memory(staging.memory, None);
            }
        }
    }

    /// Records, submits and waits.
    fn submit(&mut self, record: impl FnOnce(&ash::Device, vk::CommandBuffer)) -> Outcome<()> {
        let (device, commands) = (&self.device, self.commands);
        let begin = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the previous submission was waited for, so command buffer and fence are free; the application does
        // not touch the queue while it is in a call that may use it.
        let done = unsafe {
            device
                .begin_command_buffer(commands, &begin)
                .and_then(|()| {
                    record(device, commands);
                    device.end_command_buffer(commands)
                })
                .and_then(|()| {
                    let buffers = [commands];
                    let submit = vk::SubmitInfo::default().command_buffers(&buffers);
                    device.queue_submit(self.queue, &[submit], self.fence)
                })
                .and_then(|()| device.wait_for_fences(&[self.fence], true, FENCE_TIMEOUT_NS))
                .and_then(|()| device.reset_fences(&[self.fence]))
        };
        done.map_err(|result| failed("the runtime's work on the application's queue", result))
    }
}

impl Drop for Graphics {
    fn drop(&mut self) {
        self.free_staging();
        // SAFETY: every submission has been waited for; null handles may be destroyed.
        unsafe {
            self.device.destroy_fence(self.fence, None);
            self.device.destroy_command_pool(self.pool, None);
        }
    }
}

/// The usage that the layouts and the read-back need, added to what the application asked for.
pub fn with_attachment(mut spec: ImageSpec) -> ImageSpec {
    spec.usage |= vk::ImageUsageFlags::TRANSFER_SRC;
    spec.usage |= if spec.is_depth() {
        vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT
    } else {
        vk::ImageUsageFlags::COLOR_ATTACHMENT
    };
    spec
}

fn barrier(image: vk::Image, spec: &ImageSpec) -> vk::ImageMemoryBarrier<'static> {
    vk::ImageMemoryBarrier::default()
        .image(image)
        .src_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
        .dst_queue_family_index(vk::QUEUE_FAMILY_IGNORED)
        .subresource_range(vk::ImageSubresourceRange {
            aspect_mask: spec.aspects(),
            base_mip_level: 0,
            level_count: vk::REMAINING_MIP_LEVELS,
            base_array_layer: 0,
            layer_count: vk::REMAINING_ARRAY_LAYERS,
        })
}

/// # Safety
/// The command buffer is recording; the regions lie inside their living images, the offsets inside the buffer.
unsafe fn record_copies(
    device: &ash::Device,
    commands: vk::CommandBuffer,
    buffer: vk::Buffer,
    regions: &[Region],
    offsets: &[(u64, u64)],
) {
    let all = vk::AccessFlags::MEMORY_READ | vk::AccessFlags::MEMORY_WRITE;
    let mut distinct: Vec<&Region> = Vec::new();
    for region in regions {
        if distinct.iter().all(|seen| seen.image != region.image) {
            distinct.push(region);
        }
    }
    let source = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;
    let to_source: Vec<_> = distinct
        .iter()
        .map(|region| {
            barrier(region.image, &region.spec)
                .old_layout(region.spec.layout())
                .new_layout(source)
                .src_access_mask(vk::AccessFlags::MEMORY_WRITE)
                .dst_access_mask(vk::AccessFlags::TRANSFER_READ)
        })
        .collect();
    let back: Vec<_> = distinct
        .iter()
        .map(|region| {
            barrier(region.image, &region.spec)
                .old_layout(source)
                .new_layout(region.spec.layout())
                .src_access_mask(vk::AccessFlags::TRANSFER_READ)
                .dst_access_mask(all)
        })
        .collect();
    let host = vk::MemoryBarrier::default()
        .src_access_mask(vk::AccessFlags::TRANSFER_WRITE)
        .dst_access_mask(vk::AccessFlags::HOST_READ);
    let (everything, transfer) = (vk::PipelineStageFlags::ALL_COMMANDS, vk::PipelineStageFlags::TRANSFER);
    let no_flags = vk::DependencyFlags::empty();
    // SAFETY: the caller's promises.
    unsafe {
        device.cmd_pipeline_barrier(commands, everything, transfer, no_flags, &[], &[], &to_source);
        for (region, (offset, _)) in regions.iter().zip(offsets) {
            let aspect = if region.spec.is_depth() {
                vk::ImageAspectFlags::DEPTH
            } else {
                vk::ImageAspectFlags::COLOR
            };
            let copy = vk::BufferImageCopy {
                buffer_offset: *offset,
                buffer_row_length: 0,
                buffer_image_height: 0,
                image_subresource: vk::ImageSubresourceLayers {
                    aspect_mask: aspect,
                    mip_level: 0,
                    base_array_layer: region.layer,
                    layer_count: 1,
                },
                image_offset: vk::Offset3D { x: region.offset[0], y: region.offset[1], z: 0 },
                image_extent: vk::Extent3D { width: region.size[0], height: region.size[1], depth: 1 },
            };
            device.cmd_copy_image_to_buffer(commands, region.image, source, buffer, &[copy]);
        }
        device.cmd_pipeline_barrier(
            commands,
            transfer,
            everything | vk::PipelineStageFlags::HOST,
            no_flags,
            &[host],
            &[],
            &back,
        );
    }
}
